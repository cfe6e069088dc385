"""Check for films of a mesh that pass through each other.

Each film is a surface over the plane, seen along its own upright. A film must lie above the one
below it wherever both exist. For films farther apart in the stack, two neighbouring nodes of one
must not lie on opposite sides of the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import OutputError
from sbafab.meshing.conforming.layup import FormedFilm, Layup
from sbafab.meshing.conforming.mesh import TRIANGLE_PARTS

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from shapely import STRtree

SLACK = 0.002
"""mm of apparent overlap allowed between films: the error of chords on curved films."""


class Crossing(NamedTuple):
    """Two films, by their index in the layup, that pass ``depth`` mm through each other, and the
    place of the deepest overlap on the flat laminate, in mm.
    """

    lower: int
    upper: int
    depth: float
    x: float
    y: float


def check_apart(stack: Layup, forms: Sequence[FormedFilm]) -> None:
    """Raises OutputError if films of a mesh cross; ``forms`` are not wrapped round a tube."""
    deepest = crossing(stack, forms)
    if deepest is not None:
        raise OutputError(f"{crossing_clause(stack, deepest)}; ask for a more even fill")


def crossing_clause(stack: Layup, worst: Crossing) -> str:
    """Return a clause that says which films cross, how deep and where."""
    lower, upper = (stack.plies[k].layer.index for k in (worst.lower, worst.upper))
    return (
        f"films {lower} and {upper} would pass through each other by {worst.depth:.2f} mm at "
        f"x {worst.x:.3f}, y {worst.y:.3f}"
    )


def crossing(stack: Layup, forms: Sequence[FormedFilm]) -> Crossing | None:
    """Return the deepest crossing of two films; None if all are apart or touch."""
    films = [_Film(stack, k, form) for k, form in enumerate(forms)]
    plane = _Plane(stack)
    near = [_between(plane, lower, upper) for lower, upper in pairwise(films)]
    # Films farther apart matter only if neighbours are in order.
    far = (
        _between(plane, lower, upper)
        for k, lower in enumerate(films)
        for upper in films[k + 2 :]
        if not any(near)
    )
    crossings = [pair for pair in (*near, *far) if pair is not None]
    return max(crossings, key=lambda pair: pair.depth, default=None)


class _Film:
    """A film's faces, in space and in its own frame."""

    def __init__(self, stack: Layup, k: int, form: FormedFilm) -> None:
        ply = stack.plies[k]
        self.number = k
        self.cells = ply.cells
        self.nodes = np.unique(stack.plane.triangles[ply.cells])
        self.bottom = form.base[self.nodes]
        self.top = form.at(ply.thickness if stack.is_thick else 0.0)[self.nodes]
        up = form.up[self.nodes[0]]
        flat = np.column_stack([stack.plane.points[self.nodes], np.ones(len(self.nodes))])
        level = self.bottom - np.outer(self.bottom @ up, up)
        ways, self.shift = np.split(np.linalg.lstsq(flat, level, rcond=None)[0], [2])
        self.axes = np.vstack([ways, up])

    def in_frame(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) in this film's frame: x and y of the flat laminate, and height."""
        inside: NDArray[np.float64] = (points - self.shift) @ self.axes.T
        return inside


class _Plane:
    """The triangulation that all films are surfaces over."""

    def __init__(self, stack: Layup) -> None:
        self.points = stack.plane.points
        triangles = stack.plane.triangles
        self.parts = np.concatenate([triangles[:, list(part)] for part in TRIANGLE_PARTS])
        self.cells = np.tile(np.arange(len(triangles)), len(TRIANGLE_PARTS))
        edges = np.concatenate(
            [self.parts[:, [0, 1]], self.parts[:, [1, 2]], self.parts[:, [2, 0]]]
        )
        self.edges = np.unique(np.sort(edges, axis=1), axis=0)

    @cached_property
    def tree(self) -> STRtree:
        from shapely import STRtree, linearrings, polygons

        return STRtree(polygons(linearrings(self.points[self.parts])))

    def part_at(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the triangle that holds each of points (n, 2); -1 outside of all."""
        from shapely import points as shapely_points

        places, parts = self.tree.query(shapely_points(points), predicate="intersects")
        holding = np.full(len(points), -1, dtype=np.int64)
        # On an edge, the first of the triangles that share it.
        holding[places[::-1]] = parts[::-1]
        return holding

    def over(
        self, film: _Film, face: NDArray[np.float64], points: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Height of points (n, 3), in a film's frame, over a face of it; NaN beside the film."""
        part = self.part_at(points[:, :2])
        there = np.flatnonzero(part >= 0)
        there = there[film.cells[self.cells[part[there]]]]
        height = np.full(len(self.points), np.nan)
        height[film.nodes] = film.in_frame(face)[:, 2]
        corners = self.parts[part[there]]
        a, b, c = (self.points[corners[:, i]] for i in range(3))
        offset = points[there, :2] - a
        twice = _cross(b - a, c - a)
        s, t = _cross(offset, c - a) / twice, _cross(b - a, offset) / twice
        h = height[corners]
        gaps = np.full(len(points), np.nan)
        gaps[there] = points[there, 2] - (h[:, 0] * (1 - s - t) + h[:, 1] * s + h[:, 2] * t)
        return gaps


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    z: NDArray[np.float64] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return z


def _between(plane: _Plane, lower: _Film, upper: _Film) -> Crossing | None:
    low, high = lower.in_frame(lower.top), lower.in_frame(upper.bottom)
    if high[:, 2].min() >= low[:, 2].max() - SLACK:
        return None
    low_above, high_above = upper.in_frame(lower.top), upper.in_frame(upper.bottom)
    if high_above[:, 2].min() >= low_above[:, 2].max() - SLACK:
        return None
    gaps = [
        (upper, plane.over(lower, lower.top, high)),
        (lower, -plane.over(upper, upper.bottom, low_above)),
    ]
    worst: Crossing | None = None
    for film, gap in gaps:
        depth = -gap
        if upper.number > lower.number + 1:
            depth = np.where(_is_pierced(plane, film, gap), np.abs(gap), np.nan)
        if not (depth > SLACK).any():
            continue
        deepest = int(np.nanargmax(depth))
        x, y = plane.points[film.nodes[deepest]]
        if worst is None or depth[deepest] > worst.depth:
            worst = Crossing(lower.number, upper.number, float(depth[deepest]), float(x), float(y))
    return worst


def _is_pierced(plane: _Plane, film: _Film, gap: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return a mask of a film's nodes that have a neighbour on the other side of the other film."""
    height = np.full(len(plane.points), np.nan)
    height[film.nodes] = gap
    a, b = height[plane.edges].T
    across = np.minimum(a, b) < -SLACK
    across &= np.maximum(a, b) > SLACK
    pierced = np.zeros(len(plane.points), dtype=bool)
    pierced[plane.edges[across]] = True
    of_film: NDArray[np.bool_] = pierced[film.nodes]
    return of_film
