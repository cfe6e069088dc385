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

    Floats = NDArray[np.float64]

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
    crossings = [each for pair in pairwise(films) for each in _between(plane, *pair)]
    # Films farther apart matter only if neighbours are in order.
    if not crossings:
        far = ((lower, upper) for k, lower in enumerate(films) for upper in films[k + 2 :])
        crossings = [each for pair in far for each in _between(plane, *pair)]
    return max(crossings, key=lambda each: each.depth, default=None)


class _Film:
    """A film's faces, in space and in its own frame."""

    def __init__(self, stack: Layup, k: int, form: FormedFilm) -> None:
        ply = stack.plies[k]
        self.number = k
        self.cells = ply.cells
        self.nodes = stack.nodes(ply.cells)
        self.bottom = form.base[self.nodes]
        self.top = form.at(ply.thickness if stack.is_thick else 0.0)[self.nodes]
        up = form.up[self.nodes[0]]
        flat = np.column_stack([stack.plane.points[self.nodes], np.ones(len(self.nodes))])
        level = self.bottom - np.outer(self.bottom @ up, up)
        ways, self.shift = np.split(np.linalg.lstsq(flat, level, rcond=None)[0], [2])
        self.axes = np.vstack([ways, up])

    def in_frame(self, points: Floats) -> Floats:
        """Points (n, 3) in this film's frame: x and y of the flat laminate, and height."""
        inside: Floats = (points - self.shift) @ self.axes.T
        return inside


class _Plane:
    """The triangulation that all films are surfaces over."""

    def __init__(self, stack: Layup) -> None:
        self.points = stack.plane.points
        triangles = stack.plane.triangles
        self.parts = np.concatenate([triangles[:, list(part)] for part in TRIANGLE_PARTS])
        self.cells = np.tile(np.arange(len(triangles)), len(TRIANGLE_PARTS))

    @cached_property
    def tree(self) -> STRtree:
        from shapely import STRtree, linearrings, polygons

        return STRtree(polygons(linearrings(self.points[self.parts])))

    def over(self, film: _Film, face: Floats, points: Floats) -> Floats:
        """Height of points (n, 3), in a film's frame, over a face of it; NaN beside the film."""
        from shapely import points as shapely_points

        places, parts = self.tree.query(shapely_points(points[:, :2]), predicate="intersects")
        part = np.full(len(points), -1, dtype=np.int64)
        # On an edge, the first of the triangles that share it.
        part[places[::-1]] = parts[::-1]
        there = np.flatnonzero(part >= 0)
        there = there[film.cells[self.cells[part[there]]]]
        height = np.full(len(self.points), np.nan)
        height[film.nodes] = film.in_frame(face)[:, 2]
        corners = self.parts[part[there]]
        a, b, c = self.points[corners].transpose(1, 2, 0)
        (ux, uy), (vx, vy), (x, y) = b - a, c - a, points[there, :2].T - a
        twice = ux * vy - uy * vx
        s, t = (x * vy - y * vx) / twice, (ux * y - uy * x) / twice
        h = height[corners]
        gaps = np.full(len(points), np.nan)
        gaps[there] = points[there, 2] - (h[:, 0] * (1 - s - t) + h[:, 1] * s + h[:, 2] * t)
        return gaps

    def pierced(self, film: _Film, gap: Floats) -> NDArray[np.bool_]:
        """Return a mask of a film's nodes with a neighbour on the other side of the other film."""
        height = np.full(len(self.points), np.nan)
        height[film.nodes] = gap
        pierced = np.zeros(len(self.points), dtype=bool)
        for edge in ([0, 1], [1, 2], [2, 0]):
            ends = self.parts[:, edge]
            sides = height[ends]
            across = (sides.min(axis=1) < -SLACK) & (sides.max(axis=1) > SLACK)
            pierced[ends[across]] = True
        of_film: NDArray[np.bool_] = pierced[film.nodes]
        return of_film


def _between(plane: _Plane, lower: _Film, upper: _Film) -> list[Crossing]:
    """The deepest overlap of two films at the nodes of either; empty if they are apart."""
    faces = [[film.in_frame(face) for face in (lower.top, upper.bottom)] for film in (lower, upper)]
    if any(high[:, 2].min() >= low[:, 2].max() - SLACK for low, high in faces):
        return []
    crossings = []
    for film, gap in (
        (upper, plane.over(lower, lower.top, faces[0][1])),
        (lower, -plane.over(upper, upper.bottom, faces[1][0])),
    ):
        depth = -gap
        if upper.number > lower.number + 1:
            depth = np.where(plane.pierced(film, gap), np.abs(gap), np.nan)
        if (depth > SLACK).any():
            deepest = int(np.nanargmax(depth))
            x, y = plane.points[film.nodes[deepest]].tolist()
            crossings.append(Crossing(lower.number, upper.number, float(depth[deepest]), x, y))
    return crossings
