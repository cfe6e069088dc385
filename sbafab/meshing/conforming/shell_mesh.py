"""The shell mesh: mid-surfaces of second order, what is bonded as one shell of all its films."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sbafab.meshing.conforming.cavities import (
    flat_triangles,
    mouth_patch,
    mouths,
    neighbours,
    wetted,
)
from sbafab.meshing.conforming.checks import check_cavities, check_mesh
from sbafab.meshing.conforming.crossing import check_apart
from sbafab.meshing.conforming.form import FormedFilm
from sbafab.meshing.conforming.layup import Layup, MeshedVoid
from sbafab.meshing.conforming.model import Mesh
from sbafab.meshing.conforming.round_tube import round_tube
from sbafab.meshing.conforming.sets import node_sets
from sbafab.meshing.conforming.sweep import NONE, Sweep

if TYPE_CHECKING:
    from numpy.typing import NDArray


def thin(stack: Layup) -> Layup:
    """The layup with films of no thickness on each other: all mid-surfaces lie at z = 0."""
    plies = tuple(replace(ply, z=0.0, gap=0.0) for ply in stack.plies)
    return replace(stack, plies=plies, is_thick=False)


def shell_mesh(stack: Layup, forms: Sequence[FormedFilm]) -> Mesh:
    """The mid-surfaces of a thin layup, with their sets and cavities.

    A triangle where films are bonded is one for all of them and carries the sum of their
    thicknesses. Cavities leave the neck rings out, which have the same air on both sides.
    Raises OutputError where a check fails.
    """
    check_apart(stack, forms)
    forms = round_tube(stack, forms)
    triangles = stack.plane.triangles
    numbers = np.full((len(stack.plies), len(stack.plane.points)), NONE)
    cell_of = np.full((len(stack.plies), len(triangles)), NONE)
    points: list[NDArray[np.float64]] = []
    cells: list[NDArray[np.int64]] = []
    count = made = 0
    for k, (ply, form) in enumerate(zip(stack.plies, forms, strict=True)):
        covered = np.unique(triangles[ply.cells])
        if k:
            bonded = np.unique(triangles[ply.bonded])
            numbers[k, bonded] = numbers[k - 1, bonded]
            cell_of[k, ply.bonded] = cell_of[k - 1, ply.bonded]
        new = covered[numbers[k, covered] < 0]
        numbers[k, new] = np.arange(count, count + len(new))
        points.append(form.base[new])
        count += len(new)
        own = np.flatnonzero(ply.cells & ~ply.bonded)
        cell_of[k, own] = np.arange(made, made + len(own))
        cells.append(numbers[k][triangles[own]])
        made += len(own)
    nothing = np.full_like(numbers, NONE)
    swept = Sweep(
        np.concatenate(points),
        np.concatenate(cells),
        numbers,
        nothing,
        numbers,
        nothing,
        cell_of,
        np.full_like(cell_of, NONE),
    )
    mesh = _with_sets(stack, swept)
    check_mesh(mesh, {})
    check_cavities(mesh)
    return mesh


def _with_sets(stack: Layup, swept: Sweep) -> Mesh:
    named_nodes = node_sets(stack, swept)
    face_sets, cavities = {}, {}
    beyond = neighbours(stack.plane)
    for name, void in stack.voids.items():
        pockets = MeshedVoid({}, void.under, void.volume)
        faces = _one_sided(wetted(stack, swept, pockets, beyond))
        face_sets[f"cavity_{name}"] = faces
        patches = [
            mouth_patch(stack, swept, ply, edges) for ply, edges in mouths(stack, pockets, beyond)
        ]
        if patches:
            named_nodes[f"inlet_{name}"] = np.unique(np.concatenate(patches))
        if stack.sector is None:
            walls = flat_triangles("triangle6", swept.prisms, faces)[:, ::-1]
            cavities[name] = np.concatenate([walls, *patches])
    films, sections, thickness = _cell_sets(stack, swept)
    return Mesh(
        "shell",
        "triangle6",
        swept.points,
        swept.prisms,
        named_nodes,
        {**films, **sections},
        face_sets,
        cavities,
        thickness,
    )


def _one_sided(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The faces of cells that the air touches on one side only."""
    _, first, times = np.unique(faces[:, 0], return_index=True, return_counts=True)
    kept: NDArray[np.int64] = faces[np.sort(first[times == 1])]
    return kept


def _cell_sets(
    stack: Layup, swept: Sweep
) -> tuple[dict[str, NDArray[np.int64]], dict[str, NDArray[np.int64]], dict[str, float]]:
    """Cells of each film, cells of each thickness, and the thicknesses in mm."""
    films = {}
    total = np.zeros(len(swept.prisms))
    for ply, numbers in zip(stack.plies, swept.prism_of, strict=True):
        films[ply.name] = np.sort(numbers[numbers >= 0])
        total[films[ply.name]] += ply.thickness
    microns = np.round(total * 1000, 3)
    sections, thickness = {}, {}
    for value in np.unique(microns).tolist():
        name = f"section_{value:g}um".replace(".", "p")
        sections[name] = np.flatnonzero(microns == value)
        thickness[name] = value / 1000
    return films, sections, thickness
