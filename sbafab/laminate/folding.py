"""Folded films: the flat part for two or more layers, and its halves after folding.

The part is oriented like its lowest layer; each further layer is turned over about its fold line.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from sbafab.geometry.contour import Similarity
from sbafab.geometry.edges import Edge, Line, Point
from sbafab.geometry.region import Region, polygon, union
from sbafab.laminate.joints import Fold

ON_LINE = 1e-5
"""Tolerance for an edge on a fold line, mm."""
FAR = 1e4
"""Distance beyond any part from a fold, mm."""


def fold_roots(folds: Iterable[Fold]) -> dict[int, int]:
    """Return, by index, the layer with which each folded layer is cut: the lowest of its film."""
    roots: dict[int, int] = {}
    for fold in sorted(folds, key=lambda fold: fold.lower):
        roots[fold.upper] = roots.get(fold.lower, fold.lower)
    return roots


def flat_part(layer: int, folds: Sequence[Fold], profiles: Sequence[Region]) -> Region:
    """Return the part from which a layer is cut: its profile, and the profiles of all layers folded
    onto it.

    ``profiles`` are those of all layers, bottom to top.
    """
    return union(
        unfolded(profiles[index - 1], lines) for index, lines in _members(layer, folds).items()
    )


def halves(layer: int, folds: Sequence[Fold], part: Region) -> dict[int, Region]:
    """Return the layers formed by folding a flat part, by index, each in its folded position.

    Folded layers lie on the left of their fold lines (``toward``).
    """
    members = _members(layer, folds)
    rest = part
    regions: dict[int, Region] = {}
    for index, lines in members.items():
        mine = rest
        upper = next(
            (fold for fold in folds if fold.lower == index and fold.upper in members), None
        )
        if upper is not None:
            # The part beyond the next fold line belongs to the layers above.
            side = _side(upper.line, lines)
            rest, mine = rest - side, rest & side
        regions[index] = unfolded(mine, lines[::-1])
    return regions


def _members(layer: int, folds: Sequence[Fold]) -> dict[int, list[tuple[Point, Point]]]:
    """The layers of a part, lowest first, each with the lines of its unfolding, in order."""
    members: dict[int, list[tuple[Point, Point]]] = {layer: []}
    for fold in sorted(folds, key=lambda fold: fold.lower):
        if fold.lower in members:
            members[fold.upper] = [fold.line, *members[fold.lower]]
    return members


def unfolded(region: Region, lines: Iterable[tuple[Point, Point]]) -> Region:
    """Return a region turned over about lines, one after another."""
    for line in lines:
        region = region.mapped(_reflection(line), 1.0, True)
    return region


def _reflection(line: tuple[Point, Point]) -> Similarity:
    (x0, y0), (x1, y1) = line
    length = math.dist(*line)
    ux, uy = (x1 - x0) / length, (y1 - y0) / length

    def reflected(p: Point) -> Point:
        across = 2 * ((p[0] - x0) * -uy + (p[1] - y0) * ux)
        return p[0] + across * uy, p[1] - across * ux

    return reflected


def _side(line: tuple[Point, Point], lines: Iterable[tuple[Point, Point]]) -> Region:
    """Return the half plane to the left of a line, large enough for unfolded parts."""
    (x0, y0), (x1, y1) = line
    length = math.dist(*line)
    ux, uy = (x1 - x0) / length * FAR, (y1 - y0) / length * FAR
    start, end = (x0 - ux, y0 - uy), (x0 + ux, y0 + uy)
    corners = [start, end, (end[0] - uy, end[1] + ux), (start[0] - uy, start[1] + ux)]
    return unfolded(polygon(corners), lines)


def lies_on(edge: Edge, lines: Iterable[tuple[Point, Point]]) -> bool:
    """Return True if an edge lies on one of the lines."""
    return isinstance(edge, Line) and any(
        max(abs(distance_from(line, p)) for p in (edge.start, edge.end)) < ON_LINE for line in lines
    )


def distance_from(line: tuple[Point, Point], p: Point) -> float:
    """Return the distance of a point from a line through two points, positive on its left."""
    (x0, y0), (x1, y1) = line
    return ((x1 - x0) * (p[1] - y0) - (y1 - y0) * (p[0] - x0)) / math.dist(*line)


def toward(line: tuple[Point, Point], region: Region) -> tuple[Point, Point]:
    """Return the line, directed with most of a region on its left."""
    ends = [distance_from(line, edge.start) for edge in region.edges]
    return line if max(ends, default=0.0) >= -min(ends, default=0.0) else (line[1], line[0])
