"""The sweep: the triangulation swept through every film, bonded faces sharing nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sbafab.meshing.conforming.elements import EDGES
from sbafab.meshing.conforming.form import FormedFilm
from sbafab.meshing.conforming.layup import Layup

if TYPE_CHECKING:
    from numpy.typing import NDArray

NONE = -1
TETRAHEDRA = (
    ((0, 0), (1, 0), (2, 0), (2, 2)),
    ((0, 0), (1, 2), (1, 0), (2, 2)),
    ((0, 0), (0, 2), (1, 2), (2, 2)),
)
"""Corners of the tetrahedra in a prism: its columns by rank, and the level (0 below, 2 above)."""
SIDE = np.array([NONE, 3, 5, 4])
"""The mid-edge node between two corners of a triangle, by the sum of their places."""


@dataclass(frozen=True)
class Sweep:
    """Nodes and prisms of the swept films.

    ``prisms`` (m, 18) hold the six nodes of a triangle below, halfway up and above.
    ``lower``, ``middle`` and ``upper`` (plies, plane nodes) number the nodes of each film over
    the plane's, -1 where there are none; ``joints`` those halfway up the bond under each film.
    ``prism_of`` and ``joint_of`` (plies, triangles) number the prisms of films and bonds.
    """

    points: NDArray[np.float64]
    prisms: NDArray[np.int64]
    lower: NDArray[np.int64]
    middle: NDArray[np.int64]
    upper: NDArray[np.int64]
    joints: NDArray[np.int64]
    prism_of: NDArray[np.int64]
    joint_of: NDArray[np.int64]


def sweep(layup: Layup, forms: Sequence[FormedFilm], full_middles: bool) -> Sweep:
    """The films as prisms, bottom to top.

    Where films lie on each other, the nodes in the closure of a bond are one; where gaps are
    kept, wedges join them. ``full_middles`` puts a node halfway up over mid-edge nodes too, as
    tetrahedra need.
    """
    triangles = layup.plane.triangles
    shape = len(layup.plies), len(layup.plane.points)
    lower, middle, upper, joints = (np.full(shape, NONE, dtype=np.int64) for _ in range(4))
    prism_of, joint_of = (np.full((shape[0], len(triangles)), NONE) for _ in range(2))
    points: list[NDArray[np.float64]] = []
    prisms: list[NDArray[np.int64]] = []
    count = made = 0

    def place(
        numbers: NDArray[np.int64], nodes: NDArray[np.int64], at: NDArray[np.float64]
    ) -> None:
        nonlocal count
        numbers[nodes] = np.arange(count, count + len(nodes))
        points.append(at[nodes])
        count += len(nodes)

    def fill(of: NDArray[np.int64], cells: NDArray[np.bool_], *levels: NDArray[np.int64]) -> None:
        nonlocal made
        chosen = np.flatnonzero(cells)
        of[chosen] = np.arange(made, made + len(chosen))
        prisms.append(_prisms(triangles[chosen], *levels))
        made += len(chosen)

    for k, (ply, form) in enumerate(zip(layup.plies, forms, strict=True)):
        covered = np.unique(triangles[ply.cells])
        bonded = np.unique(triangles[ply.bonded])
        if not ply.gap:
            lower[k, bonded] = upper[k - 1, bonded] if k else NONE
        place(lower[k], covered[lower[k, covered] < 0], form.at(0.0))
        if ply.gap:
            below = forms[k - 1].at(layup.plies[k - 1].thickness)
            place(joints[k], _half_up(layup, bonded, full_middles), (below + form.at(0.0)) / 2)
            fill(joint_of[k], ply.bonded, upper[k - 1], joints[k], lower[k])
        place(middle[k], _half_up(layup, covered, full_middles), form.at(ply.thickness / 2))
        place(upper[k], covered, form.at(ply.thickness))
        fill(prism_of[k], ply.cells, lower[k], middle[k], upper[k])
    return Sweep(
        np.concatenate(points),
        np.concatenate(prisms),
        lower,
        middle,
        upper,
        joints,
        prism_of,
        joint_of,
    )


def _half_up(layup: Layup, nodes: NDArray[np.int64], full: bool) -> NDArray[np.int64]:
    return nodes if full else nodes[nodes < layup.plane.corners]


def _prisms(triangles: NDArray[np.int64], *levels: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.hstack([level[triangles] for level in levels])


def wedges(prisms: NDArray[np.int64]) -> NDArray[np.int64]:
    """The prisms as wedges (m, 15) of second order."""
    return prisms[:, [0, 1, 2, 12, 13, 14, 3, 4, 5, 15, 16, 17, 6, 7, 8]]


def tetrahedra(prisms: NDArray[np.int64], corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Three tetrahedra (3 x m, 10) of second order for each prism, in its order.

    ``corners`` (m, 3) are the plane's nodes under each prism: the diagonal of a side starts below
    the smaller number of two, so that neighbours agree.
    """
    ranked = np.argsort(corners, axis=1)
    is_even = (ranked[:, 1] - ranked[:, 0]) % 3 == 1
    cells = np.empty((len(prisms), 3, 10), dtype=np.int64)
    rows = np.arange(len(prisms))
    for number, tetra in enumerate(TETRAHEDRA):
        # A mirrored prism takes its first two corners the other way round.
        for turned, chosen in (((0, 1, 2, 3), is_even), ((1, 0, 2, 3), ~is_even)):
            ends = [tetra[place] for place in turned]
            pairs = [(end, end) for end in ends]
            pairs += [(ends[a], ends[b]) for a, b in EDGES["tetra10"]]
            for node, ((column, level), (other, other_level)) in enumerate(pairs):
                i, j = ranked[chosen, column], ranked[chosen, other]
                local = i if column == other else SIDE[i + j]
                height = 3 * (level + other_level)
                cells[rows[chosen], number, node] = prisms[rows[chosen], height + local]
    return cells.reshape(-1, 10)


def split_wedges(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Three tetrahedra (3 x m, 4) of first order for each wedge (m, 6), in its order.

    Which way a side is cut hangs on the lower nodes' numbers, so that neighbours agree.
    """
    prisms = np.repeat(corners, 3, axis=1)
    prisms[:, :3], prisms[:, 12:15] = corners[:, :3], corners[:, 3:]
    return tetrahedra(prisms, corners[:, :3])[:, :4]
