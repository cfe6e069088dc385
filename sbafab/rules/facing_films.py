"""facing-films: films of two balloons meet only at intended bonds.

The press welds two films that face each other with no film or mask between them if it closes on
both in one step and their faces bond in that step. Beyond a smaller balloon the two films need not
be neighbours. Balloons bond in their neck rings, a sheet in its windows, and all films on ears.
Elsewhere a mask must separate them, with the overhang required between neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import LOOSE, Interface, Laminate
from sbafab.rules.boundary import (
    Facing,
    beside,
    edges_along,
    middle,
    outward_reach,
    without_slivers,
)
from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.limits import TOLERANCE, holds
from sbafab.rules.margins import pin_at
from sbafab.rules.measures import Measures, distinct_interfaces
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained, layer_name

NAME = "facing-films"


_Weld = tuple[Region, Interface, int]
"""A place at which two films weld unintentionally, and the number of such places."""


def check(measures: Measures) -> list[Finding]:
    """Return the largest unintended weld; without any, the least overhang of masks there."""
    laminate, limit = measures.laminate, measures.design.rules.mask_overhang
    pairs = _distinct(measures.facing)
    welds = [(part, pair.gap, n) for pair, n in pairs for part in pair.bare.pieces]
    welds += _at_rims(laminate)
    if welds:
        return [_welded(welds, laminate)]
    overhangs = [
        (reach.value, edge.nearest(reach.at), pair.gap)
        for pair, _ in pairs
        for edge, reach in measures.reaches(pair.gap)
        if not pin_at(edge, laminate.pins)
    ]
    findings = [judged(NAME, True, 0.0, 0.0, "mm2", Place(), "apart")]
    if overhangs:
        value, p, gap = min(overhangs, key=lambda overhang: round(overhang[0], 9))
        below, above = gap.below.index, gap.above.index
        place = Place(gap.index, (below, *sorted(mask.index for mask in gap.masks), above), *p)
        facts = {"below": below, "above": above}
        good = holds(value, limit)
        findings.append(judged(NAME, good, limit, value, "mm", place, "overhang", **facts))
    return findings


RULE = Rule(NAME, check, explained(NAME), at_most=True)


def _distinct(pairs: Iterable[Facing]) -> list[tuple[Facing, int]]:
    """Return the first of each set of equal pairs, with the size of the set."""
    groups: dict[object, list[Facing]] = {}
    for pair in pairs:
        key = pair.gap.pattern, pair.gap.unbonded, pair.bare
        groups.setdefault(key, []).append(pair)
    return [(group[0], len(group)) for group in groups.values()]


def _at_rims(laminate: Laminate) -> Iterator[_Weld]:
    """Return the bonds between neighbouring balloons that reach a film edge other than a bore's."""
    for distinct in distinct_interfaces(laminate):
        gap = distinct.interface
        of = {gap.below.balloon, gap.above.balloon}
        # Films without a mask between them that belong together bond all over.
        is_one = gap.kind == "bond" and (len(of) == 1 or None in of)
        if gap.kind == "chamber" or not gap.pressed or is_one:
            continue
        bores = [bore.centre for bore in laminate.bores]
        rims = (c for c in gap.contact.contours if not (c.is_hole and any(map(c.winding, bores))))
        rim = Region(tuple(rims))
        for piece in without_slivers(gap.bond).pieces:
            p = middle(piece)
            # A circle round the piece that lies too far from the rim shares no edge.
            is_near = rim.distance_to_edge(p) <= math.dist(p, piece.bounds[2:]) + TOLERANCE
            if is_near and not _is_ear(piece, laminate) and edges_along(piece, rim):
                yield piece, gap, distinct.number


def _is_ear(piece: Region, laminate: Laminate) -> bool:
    """Return True if the piece surrounds a tooling hole, within twice the hole's least radius."""
    for pin in laminate.pins:
        if any(math.dist(pin.centre, bore.centre) < LOOSE for bore in laminate.bores):
            continue
        if any(hole.winding(pin.centre) for hole in piece.holes):
            room = Region(piece.outers).distance_to_edge(pin.centre)
            return all(math.dist(edge.start, pin.centre) <= 2 * room for edge in piece.edges)
    return False


def _welded(welds: Sequence[_Weld], laminate: Laminate) -> Finding:
    region, gap, _ = max(welds, key=lambda weld: round(weld[0].area, 9))
    masks = laminate.interfaces[gap.index - 1].masks
    layers = (gap.below.index, *(mask.index for mask in masks), gap.above.index)
    place = Place(gap.index, layers, *_inside(region))
    facts: dict[str, Any] = {"lower": layer_name(gap.below), "upper": layer_name(gap.above)}
    facts |= {"above": gap.above.index, "more": sum(number for _, _, number in welds) - 1}
    sentence = "welds" if facts["more"] else "weld"
    return judged(NAME, False, 0.0, region.area, "mm2", place, sentence, **facts)


def _inside(region: Region) -> Point:
    """Return a point inside the region: midway between its longest edge and the edge opposite."""
    edge = max(region.edges, key=lambda edge: round(edge.length, 9))
    across = outward_reach(edge.reversed(), region.index)
    return beside(edge, (across.value if across is not None else TOLERANCE) / 2)
