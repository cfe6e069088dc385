"""How small the triangles along each edge must be, for the narrow places beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sbafab.geometry.edges import Arc, Edge
from sbafab.meshing.conforming.arrangement import Border

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

ACROSS = 2.0
"""Triangles across a narrow place."""
TURN = 0.5
"""Angle in radians that one side of a triangle may follow an arc: a parabola through three points
of it then encloses the arc's area to 0.05 %."""
LEAST = 0.4
"""Triangles are never made smaller than this part of h."""


def narrows(borders: Sequence[Border], h: float) -> list[float]:
    """For each edge the side in mm of the triangles along it: ``h``, or less where it is needed.

    Straight out from each edge on both sides, the next edge that does not start or end where
    this one does must be two triangles away; tight arcs have sides of half a radian.
    """
    import numpy as np
    import shapely

    tails, heads, owner = _chords(borders, h / 2)
    ends = _end_numbers(borders)
    middles = (tails + heads) / 2
    along = heads - tails
    normals = np.column_stack([-along[:, 1], along[:, 0]])
    normals /= np.hypot(normals[:, 0], normals[:, 1])[:, None]
    far = normals * ACROSS * h
    rays = shapely.linestrings(np.stack([middles - far, middles + far], axis=1))
    chords = shapely.linestrings(np.stack([tails, heads], axis=1))
    ray, chord = shapely.STRtree(chords).query(rays, predicate="intersects")
    mine, theirs = ends[owner[ray]], ends[owner[chord]]
    apart = ~(mine[:, :, None] == theirs[:, None, :]).any(axis=(1, 2))
    ray, chord = ray[apart], chord[apart]
    widths = np.full(len(middles), math.inf)
    reach = _ray_lengths(middles[ray], normals[ray], tails[chord], heads[chord])
    np.minimum.at(widths, ray, reach)
    sizes = np.array([_by_bend(border.edge, h) for border in borders])
    np.minimum.at(sizes, owner, np.maximum(widths / ACROSS, LEAST * h))
    return [float(size) for size in sizes]


def _by_bend(edge: Edge, h: float) -> float:
    return min(h, TURN * edge.radius) if isinstance(edge, Arc) else h


def _chords(
    borders: Sequence[Border], step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """The edges as chords of at most ``step`` mm: tails, heads, and the edge of each."""
    import numpy as np

    tails, heads, owner = [], [], []
    for number, border in enumerate(borders):
        edge = border.edge
        count = max(2, math.ceil(edge.length / step))
        stops = [edge.at(i / count) for i in range(count + 1)]
        tails += stops[:-1]
        heads += stops[1:]
        owner += [number] * count
    return np.array(tails), np.array(heads), np.array(owner, dtype=np.int64)


def _end_numbers(borders: Sequence[Border]) -> NDArray[np.int64]:
    import numpy as np

    known: dict[tuple[float, float], int] = {}
    rows = [
        [known.setdefault(end, len(known)) for end in (border.edge.start, border.edge.end)]
        for border in borders
    ]
    return np.array(rows, dtype=np.int64)


def _ray_lengths(
    origins: NDArray[np.float64],
    normals: NDArray[np.float64],
    tails: NDArray[np.float64],
    heads: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Distance in mm from each origin along its normal, to either side, to its chord."""
    import numpy as np

    a, b = tails - origins, heads - origins
    side_a = a[:, 0] * normals[:, 1] - a[:, 1] * normals[:, 0]
    side_b = b[:, 0] * normals[:, 1] - b[:, 1] * normals[:, 0]
    run = side_a - side_b
    share = np.divide(side_a, run, out=np.full_like(run, 0.5), where=np.abs(run) > 1e-12)
    lengths: NDArray[np.float64] = np.abs(
        np.einsum("ij,ij->i", a + share[:, None] * (b - a), normals)
    )
    return lengths
