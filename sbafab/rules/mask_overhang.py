"""mask-overhang: the masks reach past every film edge they keep apart (paper Sec. 2).

Short of that, film over-melts at the edge. At a bore with a dowel pin a flush mask is intended (the
pin holds all layers by it); it is reported as waived, by the pin's name.
"""

from __future__ import annotations

from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.laminate.laminate import Interface, Pin
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import at, holds
from sbafab.rules.margins import pin_at
from sbafab.rules.measures import DistinctInterface, Measures, distinct_interfaces, interface_name
from sbafab.rules.rule import Explanation, Rule

NAME = "mask-overhang"


class _Overhang(NamedTuple):
    value: float
    at: Point
    distinct: DistinctInterface


def check(measures: Measures) -> list[Finding]:
    """The least reach of any mask past an edge that bounds unbonded film, and pins' waivers."""
    laminate, design = measures.laminate, measures.design
    free: list[_Overhang] = []
    pinned: dict[str, list[_Overhang]] = {}
    bare: list[DistinctInterface] = []
    for distinct in distinct_interfaces(laminate):
        gap = distinct.interface
        if gap.masks and gap.pressed and gap.masked.is_empty:
            bare.append(distinct)
        for edge, reach in measures.reaches(distinct.interface):
            overhang = _Overhang(reach.value, edge.nearest(reach.at), distinct)
            pin = pin_at(edge, laminate.pins)
            if pin is not None and not holds(overhang.value, design.rules.mask_overhang):
                pinned.setdefault(pin.name, []).append(overhang)
            else:
                free.append(overhang)
    waived = [_waived(pin, pinned[pin.name], design) for pin in laminate.pins if pin.name in pinned]
    return [_main(free, bare, design), *waived]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "every mask reaches at least 0.50 mm past the film edges it keeps apart",
        "Film that melts at an edge runs round the end of a short mask and welds the pocket shut.",
        "Make mask.overhang larger. A flush mask at a pinned bore is meant, and waived by itself.",
        ("rules.mask_overhang", "mask.overhang"),
    ),
)


def _main(free: list[_Overhang], bare: list[DistinctInterface], design: Design) -> Finding:
    limit = design.rules.mask_overhang
    if bare:
        interface = bare[0].interface
        message = (
            f"the mask at {interface_name(interface)}{bare[0].suffix} lies outside the film, so "
            "all of it bonds; put the mask where the film is"
        )
        return Finding(NAME, "fail", limit, 0.0, "mm", _place(interface), message)
    if not free:
        message = "no free film edge lies on a mask"
        return Finding(NAME, "pass", limit, None, "mm", Place(), message)
    worst = min(free, key=lambda overhang: overhang.value)
    interface = worst.distinct.interface
    where = f"{interface_name(interface)}{worst.distinct.suffix}, {at(worst.at)}"
    good = holds(worst.value, limit)
    message = f"the least overhang of a mask past a film edge is {worst.value:.3f} mm, at {where}"
    if not good:
        message += f"; it needs {limit:g}: let the mask reach further past the edge there"
    return Finding(
        NAME,
        "pass" if good else "fail",
        limit,
        worst.value,
        "mm",
        _place(interface, worst.at),
        message,
    )


def _waived(pin: Pin, overhangs: list[_Overhang], design: Design) -> Finding:
    worst = min(overhangs, key=lambda overhang: overhang.value)
    interface = worst.distinct.interface
    patterns = {
        overhang.distinct.interface.index: overhang.distinct.number for overhang in overhangs
    }
    count = sum(patterns.values())
    interfaces = "1 interface" if count == 1 else f"{count} interfaces"
    message = (
        f"the dowel pin {pin.name} holds the layers by this opening, so at {interfaces} the mask "
        f"may end {worst.value:.3f} mm past its edge"
    )
    return Finding(
        NAME,
        "waived",
        design.rules.mask_overhang,
        worst.value,
        "mm",
        Place(interface.index, interface.layer_indices, *pin.centre),
        message,
    )


def _place(interface: Interface, p: Point | None = None) -> Place:
    x, y = p if p else (None, None)
    return Place(interface.index, interface.layer_indices, x, y)
