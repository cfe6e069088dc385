"""Named parts of a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sbafab.meshing.conforming.layup import Layup
from sbafab.meshing.conforming.sweep import Sweep

if TYPE_CHECKING:
    from numpy.typing import NDArray


def bond_name(ply: int) -> str:
    """The bond under a film, by its interface's index counted from 1."""
    return f"bond_{ply:03d}"


def node_sets(stack: Layup, swept: Sweep) -> dict[str, NDArray[np.int64]]:
    """Bonds, base, tip and symmetry planes."""
    triangles = stack.plane.triangles
    sets = {}
    for k, ply in enumerate(stack.plies):
        if ply.bonded.any():
            nodes = np.unique(triangles[ply.bonded])
            sets[bond_name(k)] = np.unique([swept.lower[k, nodes], swept.upper[k - 1, nodes]])
    bottom, top = stack.plies[0], stack.plies[-1]
    seat = bottom.cells if bottom.layer.role == "sheet" else stack.seats & bottom.cells
    sets["base"] = np.unique(swept.lower[0, np.unique(triangles[seat])])
    sets["tip"] = np.unique(swept.upper[-1, np.unique(triangles[stack.seats & top.cells])])
    if stack.sector is not None:
        for name, on_plane in stack.sector.on_planes(stack.plane.points):
            levels = (swept.lower, swept.middle, swept.upper, swept.joints)
            numbers = np.concatenate([level[:, on_plane].ravel() for level in levels])
            sets[name] = np.unique(numbers[numbers >= 0])
    return sets
