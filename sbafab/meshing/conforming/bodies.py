"""Bodies: what hangs together above the sheet, such as each oblong balloon stack on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sbafab.meshing.conforming.layup import Layup

if TYPE_CHECKING:
    from numpy.typing import NDArray


def bodies(stack: Layup) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The body of each node of the plane, and of each stack's centre."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    films = [ply.cells for ply in stack.plies if ply.layer.role != "sheet"]
    triangles = stack.plane.triangles[np.any(films, axis=0)]
    count = len(stack.plane.points)
    rows, columns = np.repeat(triangles[:, 0], 5), triangles[:, 1:].ravel()
    links = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    labels = connected_components(links, directed=False)[1].astype(np.int64)
    offsets = stack.plane.points[:, None] - np.array(stack.centres)
    return labels, labels[np.linalg.norm(offsets, axis=2).argmin(axis=0)]
