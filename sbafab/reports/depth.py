"""Triangulated surfaces on a picture, nearest first: a depth buffer filled by sample points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.meshing.surface import Surface

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

DENSITY = 1.45
"""Samples a pixel along a triangle's side: more than the root of 2, so that none is missed."""
MOST = 4_000_000
"""Samples that are held at once."""
AMBIENT = 0.58


class View(NamedTuple):
    """A parallel projection: mm to pixels, the three axes as rows (right, up, toward the eye)."""

    axes: NDArray[np.float64]
    scale: float
    centre: tuple[float, float]

    def flat(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) as pixels right and down, and mm toward the eye."""
        import numpy as np

        right, up, toward = (points @ self.axes.T).T
        x = self.centre[0] + self.scale * right
        y = self.centre[1] - self.scale * up
        return np.column_stack([x, y, toward])


class Buffer(NamedTuple):
    """For each pixel the depth, the number of the surface seen (-1: none), its face and light."""

    depth: NDArray[np.float64]
    body: NDArray[np.int16]
    face: NDArray[np.int32]
    light: NDArray[np.float64]


def view_of(
    surfaces: Sequence[Surface], elevation: float, azimuth: float, box: Sequence[float]
) -> View:
    """The view from so many degrees over the bench and round it from x, filling a box.

    The ``box`` is left, top, right, bottom in pixels.
    """
    import numpy as np

    e, a = math.radians(elevation), math.radians(azimuth)
    toward = [math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)]
    right = [-math.sin(a), math.cos(a), 0.0]
    axes = np.array([right, np.cross(toward, right), toward])
    points = np.concatenate([surface.points for surface in surfaces]) @ axes.T
    (low_x, low_y, _), (high_x, high_y, _) = points.min(axis=0), points.max(axis=0)
    x0, y0, x1, y1 = box
    scale = min((x1 - x0) / (high_x - low_x), (y1 - y0) / (high_y - low_y))
    centre = (
        (x0 + x1) / 2 - scale * (low_x + high_x) / 2,
        (y0 + y1) / 2 + scale * (low_y + high_y) / 2,
    )
    return View(axes, scale, centre)


def seen(
    surfaces: Sequence[Surface],
    view: View,
    width: int,
    height: int,
    lamp: Sequence[float],
    normals: Sequence[NDArray[np.float64]] | None = None,
) -> Buffer:
    """What the eye sees of the surfaces; ``lamp`` is the direction to the light, in the view.

    Faces are lit one by one, or smoothly where ``normals`` (n, 3) of the points are given.
    """
    import numpy as np

    size = width * height
    buffer = Buffer(
        np.full(size, -np.inf),
        np.full(size, -1, dtype=np.int16),
        np.zeros(size, dtype=np.int32),
        np.zeros(size, dtype=np.float64),
    )
    for body, surface in enumerate(surfaces):
        smooth = None if normals is None else lit(normals[body] @ view.axes.T, np.array(lamp))
        _paint(buffer, body, surface, view, (width, height), np.array(lamp), smooth)
    return Buffer(
        buffer.depth.reshape(height, width),
        buffer.body.reshape(height, width),
        buffer.face.reshape(height, width),
        buffer.light.reshape(height, width),
    )


def _paint(
    buffer: Buffer,
    body: int,
    surface: Surface,
    view: View,
    size: tuple[int, int],
    lamp: NDArray[np.float64],
    smooth: NDArray[np.float64] | None,
) -> None:
    import numpy as np

    corners = view.flat(surface.points)[surface.faces]
    # Pixels count downward: what faces the eye runs clockwise there.
    a, b, c = (corners[:, i, :2] for i in range(3))
    twice = (c - a)[:, 0] * (b - a)[:, 1] - (c - a)[:, 1] * (b - a)[:, 0]
    front = np.flatnonzero(twice > 1e-12)
    corners, twice = corners[front], twice[front]
    if smooth is None:
        light = np.repeat(_light(corners, view.scale, lamp)[:, None], 3, axis=1)
    else:
        light = smooth[surface.faces[front]]
    corners, light, long = _longest_first(corners, light)
    along = np.ceil(DENSITY * long).astype(np.int64) + 2
    across = np.ceil(DENSITY * twice / np.maximum(long, 1e-9)).astype(np.int64) + 2
    # Triangles of like size are sampled together.
    grids = np.column_stack([_power_of_two(along), _power_of_two(across)])
    for n, m in np.unique(grids, axis=0):
        own = np.flatnonzero((grids == (n, m)).all(axis=1))
        for part in np.array_split(own, max(1, len(own) * n * m // MOST)):
            seen_as = _Triangles(body, front[part], corners[part], light[part])
            _sample(buffer, seen_as, (int(n), int(m)), size)


def _light(
    corners: NDArray[np.float64], scale: float, lamp: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How light a triangle is, from its normal in the view (right, up, toward)."""
    import numpy as np

    true = corners * np.array([1 / scale, -1 / scale, 1.0])
    normal = np.cross(true[:, 1] - true[:, 0], true[:, 2] - true[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return lit(normal, lamp)


def lit(normals: NDArray[np.float64], lamp: NDArray[np.float64]) -> NDArray[np.float64]:
    """How light what faces along normals (n, 3) in the view is: from AMBIENT to 1."""
    import numpy as np

    light: NDArray[np.float64] = AMBIENT + (1 - AMBIENT) * np.clip(normals @ lamp, 0, 1)
    return light


def _longest_first(
    corners: NDArray[np.float64], light: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Corners and their light turned so that the longest side comes first; its length in pixels."""
    import numpy as np

    sides = np.roll(corners, -1, axis=1)[:, :, :2] - corners[:, :, :2]
    lengths = np.hypot(sides[:, :, 0], sides[:, :, 1])
    first = lengths.argmax(axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(corners, order[:, :, None], axis=1)
    return turned, np.take_along_axis(light, order, axis=1), lengths.max(axis=1)


def _power_of_two(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    import numpy as np

    return 2 ** np.ceil(np.log2(counts)).astype(np.int64)


class _Triangles(NamedTuple):
    """Triangles of one surface: their numbers in it, corners (n, 3, 3) in the view, and light."""

    body: int
    face: NDArray[np.int64]
    corners: NDArray[np.float64]
    light: NDArray[np.float64]


def _sample(buffer: Buffer, own: _Triangles, grid: tuple[int, int], size: tuple[int, int]) -> None:
    """Points of each triangle: along its first side, and from there towards its third corner."""
    import numpy as np

    s = np.linspace(0, 1, grid[0])[None, :, None, None]
    t = np.linspace(0, 1, grid[1])[None, None, :, None]
    a, b, c = (own.corners[:, i][:, None, None, :] for i in range(3))
    points = (1 - t) * (a + s * (b - a)) + t * c
    number = np.repeat(np.arange(len(own.face)), grid[0] * grid[1])
    x, y, depth = points.reshape(-1, 3).T
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    inside = (column >= 0) & (column < size[0]) & (row >= 0) & (row < size[1])
    place = row[inside] * size[0] + column[inside]
    depth, number = depth[inside], number[inside]
    np.maximum.at(buffer.depth, place, depth)
    won = depth == buffer.depth[place]
    place, number = place[won], number[won]
    at = np.flatnonzero(inside)[won] % (grid[0] * grid[1])
    p, q = s.ravel()[at // grid[1]], t.ravel()[at % grid[1]]
    shares = np.stack([(1 - q) * (1 - p), (1 - q) * p, q], axis=-1)
    buffer.light[place] = (own.light[number] * shares).sum(axis=1)
    buffer.face[place] = own.face[number]
    buffer.body[place] = own.body
