"""The lift of a film by air: Poisson's equation on the triangles of a pocket."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.meshing.conforming.elements import integrals
from sbafab.meshing.conforming.extras import MISSING
from sbafab.meshing.conforming.plane import Plane

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Lift(NamedTuple):
    """Shapes (3, plane nodes) of a film over a pocket, in mm2, mm and mm.

    The first is what even pressure gives; the others are a neck disc that leans by one along x
    or y. ``plateaus`` (3,) are their heights at the middle of the neck disc (of the first one),
    ``volumes`` (3,) what they enclose.
    """

    shapes: NDArray[np.float64]
    plateaus: NDArray[np.float64]
    volumes: NDArray[np.float64]


def lift(
    plane: Plane,
    pocket: NDArray[np.bool_],
    held: NDArray[np.int64],
    discs: list[tuple[NDArray[np.int64], tuple[float, float]]],
) -> Lift:
    """How far the film over a pocket rises: -lap w = 1, w = 0 at the ``held`` nodes.

    ``discs`` are the nodes of each neck and its middle: they rise as one. For a round pocket
    without a neck this is the paraboloid of the paper's Eq. 1.
    """
    try:
        from scipy.sparse import coo_matrix, csr_matrix
        from scipy.sparse.linalg import splu
    except ImportError:
        raise DesignError(MISSING.format("scipy")) from None
    triangles = plane.triangles[pocket]
    stiffness, load = integrals(plane.points, triangles)
    count = len(plane.points)
    rows = np.repeat(triangles, 6, axis=1).ravel()
    columns = np.tile(triangles, (1, 6)).ravel()
    matrix = coo_matrix((stiffness.ravel(), (rows, columns)), shape=(count, count)).tocsr()
    weights = np.bincount(triangles.ravel(), load.ravel(), count)

    # Each unknown moves one node, or all nodes of one neck disc.
    unknown = np.full(count, -1)
    active = np.unique(triangles)
    unknown[active] = 0
    unknown[held] = -1
    for nodes, _ in discs:
        unknown[nodes] = -1
    free = np.flatnonzero(unknown == 0)
    unknown[free] = np.arange(len(free))
    lean = np.zeros((2, count))
    for number, (nodes, middle) in enumerate(discs):
        unknown[nodes] = len(free) + number
        lean[:, nodes] = (plane.points[nodes] - middle).T
    size = len(free) + len(discs)
    moved = np.flatnonzero(unknown >= 0)
    spread = csr_matrix((np.ones(len(moved)), (moved, unknown[moved])), shape=(count, size))
    factors = splu((spread.T @ matrix @ spread).tocsc())
    shapes = np.empty((3, count))
    shapes[0] = spread @ factors.solve(spread.T @ weights)
    for axis in range(2):
        push = spread.T @ (matrix @ lean[axis])
        shapes[1 + axis] = lean[axis] - spread @ factors.solve(push)
    plateaus = np.zeros(3)
    if discs:
        first = discs[0][0][0]
        plateaus = shapes[:, first] - np.array([0.0, *lean[:, first]])
    return Lift(shapes, plateaus, shapes @ weights)
