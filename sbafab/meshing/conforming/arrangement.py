"""The plane cut up by the edges of several regions, arcs as arcs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

from sbafab.geometry.arrangement import Arrangement
from sbafab.geometry.boolean import arranged
from sbafab.geometry.edges import Edge, Point, edge_from_bulge
from sbafab.geometry.pieces import by_owner
from sbafab.geometry.region import Region

Label = tuple[bool, ...]
"""For each region, whether it covers a cell of the plane."""

CUSP = math.radians(8.0)
"""Edges that leave a point at less than this angle are joined for as far as they are near."""
NEAR = 0.03
"""The part of h within which they are near."""
COARSE = 0.35
"""Above this h, in mm, a coarser mesh does not move edges any farther."""


@dataclass(frozen=True)
class Border:
    """An edge between two cells: what covers the plane to the left and to the right of it."""

    edge: Edge
    left: Label
    right: Label

    def reversed(self) -> Border:
        return Border(self.edge.reversed(), self.right, self.left)


def arrangement(regions: Sequence[Region], h: float) -> list[Border]:
    """All edges of the regions, each place once, cut where they meet.

    Where two edges leave a point in one direction (a fillet and the outline it runs into) they
    are one until they are a small part of ``h`` mm apart, so that no cell ends in a cusp.
    """

    def labelled(found: Arrangement) -> list[Border]:
        sides = [_label(turns, len(regions)) for turns in found.left]
        return [
            Border(piece.edge, left, right)
            for piece, left, right in zip(found.pieces, sides[::2], sides[1::2], strict=True)
            if left != right
        ]

    borders = arranged([region.edges for region in regions], labelled)
    return _without_cusps(borders, min(h, COARSE))


def _label(turns: int, regions: int) -> Label:
    return tuple(count > 0 for count in by_owner(turns, regions))


def _without_cusps(borders: list[Border], h: float) -> list[Border]:
    """The borders with every cusp shortened to where its sides are apart."""
    leaving: defaultdict[Point, list[int]] = defaultdict(list)
    for number, border in enumerate(borders):
        leaving[border.edge.start].append(number)
        leaving[border.edge.end].append(number)
    kept: list[Border | None] = list(borders)
    added: list[Border] = []
    for corner, numbers in leaving.items():
        for i, first in enumerate(numbers):
            for second in numbers[i + 1 :]:
                a, b = kept[first], kept[second]
                if a is None or b is None or first == second:
                    continue
                if not (_ends_at(a, corner) and _ends_at(b, corner)):
                    continue  # cut short by another cusp at this corner
                joined = _joined(_from(a, corner), _from(b, corner), h)
                if joined is not None:
                    common, kept[first], bent, kept[second] = joined
                    added += [common] if common.left != common.right else []
                    added.append(bent)
    return [border for border in kept if border is not None] + added


def _ends_at(border: Border, corner: Point) -> bool:
    return corner in (border.edge.start, border.edge.end)


def _from(border: Border, corner: Point) -> Border:
    return border if border.edge.start == corner else border.reversed()


def _joined(a: Border, b: Border, h: float) -> tuple[Border, Border, Border, Border | None] | None:
    """The part that two borders from one corner share, and what is left of both.

    The second one is bent over about ``h`` to start where the first one does.
    """
    (ax, ay), (bx, by) = a.edge.direction(a.edge.start), b.edge.direction(b.edge.start)
    if ax * bx + ay * by <= math.cos(CUSP):
        return None
    apart = _parting(a.edge, b.edge, NEAR * h)
    if apart is None:
        return None
    end, b_end = apart
    # The cusp lies between the two: the common part keeps what is outside both.
    across = (b_end[0] - end[0]) * -ay + (b_end[1] - end[1]) * ax
    b_is_left = across > 0
    common = Border(
        a.edge.part(a.edge.start, end),
        b.left if b_is_left else a.left,
        a.right if b_is_left else b.right,
    )
    rest = b.edge.part(b_end, b.edge.end)
    whole = rest.length < 1.5 * h
    bent = rest if whole else rest.part(b_end, rest.at(h / rest.length))
    return (
        common,
        replace(a, edge=a.edge.part(end, a.edge.end)),
        replace(b, edge=edge_from_bulge(end, bent.end, bent.bulge)),
        None if whole else replace(b, edge=rest.part(bent.end, rest.end)),
    )


def _parting(a: Edge, b: Edge, near: float) -> tuple[Point, Point] | None:
    """The points, one on each, from which on two edges of one start are ``near`` mm apart.

    None if they already are at the first step, or never are.
    """
    steps = 256
    length = min(a.length, b.length)
    for step in range(1, steps):
        along = length * step / steps
        on_b = b.at(along / b.length)
        on_a = a.nearest(on_b)
        if math.dist(on_a, on_b) >= near:
            return (on_a, on_b) if step > 1 else None
    return None
