"""A flat laminate bent round its tube: x becomes the way round, z the way outward."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sbafab.meshing.surface import Surface, Vector

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SAGITTA = 0.008
"""mm by which a facet of a bent film may leave its cylinder; a fifth of a film."""
SNAP = 1e-3
"""mm: a point as near as this to a cut lies on it, so that no sliver is cut off."""


def bent_point(p: Vector, radius: float) -> Vector:
    """Where a point of the flat laminate comes to lie round a tube of this radius about z."""
    angle, r = p[0] / radius, radius + p[2]
    return r * math.cos(angle), r * math.sin(angle), p[1]


def bent(surface: Surface, radius: float, sagitta: float = SAGITTA) -> Surface:
    """The surface bent round a tube, first cut along the tube so that its facets follow it.

    Lengths at z = 0 stay; what lies above is stretched round the tube, as films on it are.
    """
    import numpy as np

    step = math.sqrt(8 * radius * sagitta)
    low, high = surface.points[:, 0].min(), surface.points[:, 0].max()
    first, last = math.floor(low / step) + 1, math.ceil(high / step)
    for number in range(first, last):
        surface = cut_along(surface, number * step)
    x, y, z = surface.points.T
    angle, r = x / radius, radius + z
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle), y])
    return Surface(points, surface.faces)


def cut_along(surface: Surface, x: float) -> Surface:
    """The same surface with an edge wherever it crosses the plane of this x."""
    import numpy as np

    offset = surface.points[:, 0] - x
    side = np.sign(np.where(np.abs(offset) < SNAP, 0.0, offset)).astype(np.int8)
    sides = side[surface.faces]
    crossed = (sides.min(axis=1) < 0) & (sides.max(axis=1) > 0)
    if not crossed.any():
        return surface
    faces, sides = surface.faces[crossed], sides[crossed]
    # The first corner becomes the one that is alone on its side, or the one on the plane.
    on_plane = (sides == 0).any(axis=1)
    alone = np.where(sides.sum(axis=1) > 0, -1, 1)
    wanted = np.where(on_plane, 0, alone)
    start = (sides == wanted[:, None]).argmax(axis=1)
    faces = np.take_along_axis(faces, (start[:, None] + np.arange(3)) % 3, axis=1)
    points, middle = _crossings(surface.points, offset, faces, on_plane)
    a, b, c = faces.T
    ab, bc, ca = middle
    split = [
        _rows(a, b, bc)[on_plane],
        _rows(a, bc, c)[on_plane],
        _rows(a, ab, ca)[~on_plane],
        _rows(ab, b, c)[~on_plane],
        _rows(ab, c, ca)[~on_plane],
    ]
    return Surface(points, np.concatenate([surface.faces[~crossed], *split]))


def _rows(*columns: NDArray[np.int64]) -> NDArray[np.int64]:
    import numpy as np

    return np.column_stack(columns)


def _crossings(
    points: NDArray[np.float64],
    offset: NDArray[np.float64],
    faces: NDArray[np.int64],
    on_plane: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], tuple[NDArray[np.int64], ...]]:
    """The points with those added where edges cross, and their indices by edge of the faces."""
    import numpy as np

    a, b, c = faces.T
    sets = [(a, b, ~on_plane), (b, c, on_plane), (c, a, ~on_plane)]
    ends = np.concatenate([np.column_stack([p, q])[use] for p, q, use in sets])
    ends.sort(axis=1)
    edges, inverse = np.unique(ends, axis=0, return_inverse=True)
    low, high = edges.T
    share = offset[low] / (offset[low] - offset[high])
    added = points[low] + share[:, None] * (points[high] - points[low])
    indices = len(points) + inverse.ravel()
    middle, done = [], 0
    for _, _, use in sets:
        column = np.full(len(faces), -1, dtype=np.int64)
        count = int(use.sum())
        column[use] = indices[done : done + count]
        done += count
        middle.append(column)
    return np.concatenate([points, added]), tuple(middle)
