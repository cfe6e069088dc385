"""mask-overhang: masks extend past every film edge that they separate (paper Sec. 2).

With less overhang, film over-melts at the edge. At a bore with a dowel pin, a flush mask is
intended because the pin holds all layers by it; it is reported as waived, with the pin's name.
"""

from __future__ import annotations

from sbafab.geometry.edges import Point
from sbafab.laminate.laminate import Pin
from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.limits import holds
from sbafab.rules.margins import pin_at
from sbafab.rules.measures import DistinctInterface, Measures, distinct_interfaces, place_in
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained

NAME = "mask-overhang"


_Overhang = tuple[float, Point, DistinctInterface]
"""Value, place and interface of an overhang, mm."""


def check(measures: Measures) -> list[Finding]:
    """Return the least overhang of a mask past an edge of unbonded film, and waivers at pins."""
    pins, limit = measures.laminate.pins, measures.design.rules.mask_overhang
    free: list[_Overhang] = []
    pinned: dict[str, list[_Overhang]] = {}
    outside: list[DistinctInterface] = []
    for distinct in distinct_interfaces(measures.laminate):
        gap = distinct.interface
        if gap.masks and gap.pressed and gap.masked.is_empty:
            outside.append(distinct)
        for edge, reach in measures.reaches(gap):
            overhang = reach.value, edge.nearest(reach.at), distinct
            pin = pin_at(edge, pins)
            if pin is not None and not holds(reach.value, limit):
                pinned.setdefault(pin.name, []).append(overhang)
            else:
                free.append(overhang)
    waived = [_waived(pin, pinned[pin.name], limit) for pin in pins if pin.name in pinned]
    return [_main(free, outside, limit), *waived]


RULE = Rule(NAME, check, explained(NAME))


def _main(free: list[_Overhang], outside: list[DistinctInterface], limit: float) -> Finding:
    if outside:
        distinct, place = outside[0], place_in(outside[0].interface)
        return judged(NAME, False, limit, 0.0, "mm", place, "outside", where=distinct.name)
    if not free:
        return judged(NAME, True, limit, None, "mm", Place(), "none")
    value, p, distinct = min(free, key=lambda overhang: overhang[0])
    place, where = place_in(distinct.interface, p), distinct.name
    return judged(NAME, holds(value, limit), limit, value, "mm", place, "least", where=where)


def _waived(pin: Pin, overhangs: list[_Overhang], limit: float) -> Finding:
    value, _, (interface, _) = min(overhangs, key=lambda overhang: overhang[0])
    numbers = {gap.index: number for _, _, (gap, number) in overhangs}
    place, count = place_in(interface, pin.centre), sum(numbers.values())
    return judged(NAME, "waived", limit, value, "mm", place, "pinned", pin=pin.name, count=count)
