"""facing-films: films of two balloons meet only at the bonds that the design intends.

The press welds any two films that face each other with neither film nor mask between them, if it
closes on both in one step and their faces bond in that step. Past a smaller balloon the two films
need not be neighbours. Balloons bond in their neck rings, a sheet in its windows, and all films on
ears. Elsewhere a mask must lie between them, and reach past the films' edges as far as between
neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import LOOSE, Interface, Laminate, Pin
from sbafab.rules.boundary import Facing, beside, edges_along, outward_reach, without_slivers
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import TOLERANCE, at, holds
from sbafab.rules.margins import pin_at
from sbafab.rules.measures import Measures, distinct_interfaces
from sbafab.rules.rule import Explanation, Rule

NAME = "facing-films"


class _Weld(NamedTuple):
    """A place at which two films weld unintentionally, and the ``number`` of such places."""

    region: Region
    gap: Interface
    number: int


class _Overhang(NamedTuple):
    value: float
    at: Point
    gap: Interface


def check(measures: Measures) -> list[Finding]:
    """Return the largest unintended weld; without any, the least overhang of masks there."""
    laminate, design = measures.laminate, measures.design
    pairs = _distinct(measures.facing)
    welds = [*_past_films(pairs), *_at_rims(laminate)]
    if welds:
        return [_welded(welds, laminate)]
    message = "films of two balloons meet where they are meant to bond, and nowhere else"
    clear = Finding(NAME, "pass", 0.0, 0.0, "mm2", Place(), message)
    overhangs = [o for pair, _ in pairs for o in _overhangs(pair.gap, laminate.pins, measures)]
    return [clear, _least(overhangs, design)] if overhangs else [clear]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "films of two balloons meet where they are meant to bond, and nowhere else",
        "The press welds any two films with neither film nor mask between them, neighbours or not, "
        "in a step that holds both, if their faces bond in it.",
        "Make balloons more alike, tabs shorter, or masks larger where the message says.",
        ("rules.mask_overhang", "mask.overhang", "chamber.diameter"),
    ),
    at_most=True,
)


def _distinct(pairs: Iterable[Facing]) -> list[tuple[Facing, int]]:
    """Return the first of each set of equal pairs, with their number."""
    groups: dict[object, list[Facing]] = {}
    for pair in pairs:
        key = pair.gap.pattern, pair.gap.unbonded, pair.bare
        groups.setdefault(key, []).append(pair)
    return [(group[0], len(group)) for group in groups.values()]


def _past_films(pairs: Iterable[tuple[Facing, int]]) -> Iterator[_Weld]:
    for pair, number in pairs:
        for piece in pair.bare.pieces:
            yield _Weld(piece, pair.gap, number)


def _at_rims(laminate: Laminate) -> Iterator[_Weld]:
    """Bonds between neighbouring balloons that reach a film edge other than a bore's."""
    for distinct in distinct_interfaces(laminate):
        gap = distinct.interface
        if gap.kind == "chamber" or not gap.pressed or _is_of_one_balloon(gap):
            continue
        rim = Region(tuple(c for c in gap.contact.contours if not _is_bore(c, laminate)))
        for piece in without_slivers(gap.bond).pieces:
            if _is_apart(piece, rim) or _is_ear(piece, laminate):
                continue
            if edges_along(piece, rim):
                yield _Weld(piece, gap, distinct.number)


def _is_of_one_balloon(gap: Interface) -> bool:
    """Return True if films without a mask between them belong together: they bond all over."""
    of = {gap.below.balloon, gap.above.balloon}
    return gap.kind == "bond" and (len(of) == 1 or None in of)


def _is_apart(piece: Region, rim: Region) -> bool:
    """Return True if a circle round the piece lies too far from the rim to share an edge."""
    low_x, low_y, high_x, high_y = piece.bounds
    middle = (low_x + high_x) / 2, (low_y + high_y) / 2
    return rim.distance_to_edge(middle) > math.dist(middle, (high_x, high_y)) + TOLERANCE


def _is_bore(contour: Contour, laminate: Laminate) -> bool:
    return contour.is_hole and any(contour.winding(bore.centre) for bore in laminate.bores)


def _is_ear(piece: Region, laminate: Laminate) -> bool:
    """Return True if the piece surrounds a tooling hole, within twice its least radius."""
    for pin in laminate.pins:
        if any(math.dist(pin.centre, bore.centre) < LOOSE for bore in laminate.bores):
            continue
        if any(hole.winding(pin.centre) for hole in piece.holes):
            room = Region(piece.outers).distance_to_edge(pin.centre)
            return all(math.dist(edge.start, pin.centre) <= 2 * room for edge in piece.edges)
    return False


def _overhangs(gap: Interface, pins: tuple[Pin, ...], measures: Measures) -> Iterator[_Overhang]:
    """Reach of the masks past the edges of either film in the area of facing."""
    for edge, reach in measures.reaches(gap):
        if not pin_at(edge, pins):
            yield _Overhang(reach.value, edge.nearest(reach.at), gap)


def _welded(welds: Sequence[_Weld], laminate: Laminate) -> Finding:
    worst = max(welds, key=lambda weld: round(weld.region.area, 9))
    gap, area, p = worst.gap, worst.region.area, _inside(worst.region)
    message = (
        f"layers {gap.below.index} ({gap.below.name}) and {gap.above.index} ({gap.above.name}) "
        f"face each other over {area:.3f} mm2 with neither film nor mask between, {at(p)}, and "
        f"weld there; let the mask below layer {gap.above.index} reach over that place"
    )
    masks = laminate.interfaces[gap.index - 1].masks
    more = sum(weld.number for weld in welds) - 1
    if more:
        message += f" (and {more} more such place{'s' if more > 1 else ''})"
    layers = (gap.below.index, *(mask.index for mask in masks), gap.above.index)
    place = Place(gap.index, layers, *p)
    return Finding(NAME, "fail", 0.0, area, "mm2", place, message)


def _least(overhangs: Sequence[_Overhang], design: Design) -> Finding:
    worst = min(overhangs, key=lambda overhang: round(overhang.value, 9))
    gap, limit = worst.gap, design.rules.mask_overhang
    good = holds(worst.value, limit)
    message = (
        f"layers {gap.below.index} and {gap.above.index} face each other past films that end "
        f"between them; the masks there reach {worst.value:.3f} mm past their edges, {at(worst.at)}"
    )
    if not good:
        message += (
            f"; it needs {limit:g}: let the mask below layer {gap.above.index} reach further there"
        )
    layers = (gap.below.index, *sorted(mask.index for mask in gap.masks), gap.above.index)
    place = Place(gap.index, layers, *worst.at)
    return Finding(NAME, "pass" if good else "fail", limit, worst.value, "mm", place, message)


def _inside(region: Region) -> Point:
    """A point inside the region: halfway from its longest edge to the edge across."""
    edge = max(region.edges, key=lambda edge: round(edge.length, 9))
    across = outward_reach(edge.reversed(), region.index)
    return beside(edge, (across.value if across is not None else TOLERANCE) / 2)
