"""bond-width: every bond is wide enough everywhere (paper Sec. 2: narrower ones leak)."""

from __future__ import annotations

from sbafab.design.records import Design
from sbafab.geometry.width import Width
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import at, holds
from sbafab.rules.measures import DistinctInterface, Measures, distinct_interfaces, interface_name
from sbafab.rules.rule import Explanation, Rule

NAME = "bond-width"


def check(measures: Measures) -> list[Finding]:
    """The least width of any bond, measured between facing edges."""
    laminate, design = measures.laminate, measures.design
    worst: tuple[float, Width | None, DistinctInterface] | None = None
    for distinct in distinct_interfaces(laminate):
        bond = distinct.interface.bond
        width = measures.bond(distinct.interface)
        if width is None and not bond.is_empty:
            continue
        value = width.value if width else 0.0
        if worst is None or value < worst[0] - 1e-9:
            worst = value, width, distinct
    if worst is None:
        return [_finding(None, design, Place(), "the laminate has no bond to measure")]
    value, width, distinct = worst
    interface = distinct.interface
    x, y = width.middle if width else (None, None)
    place = Place(interface.index, interface.layer_indices, x, y)
    return [_finding(value, design, place, _message(value, width, distinct, design))]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "every bond is at least 0.75 mm wide between facing edges",
        "A narrower ring peels or leaks under pressure; the paper found 0.75 mm to hold (Sec. 2).",
        "Make bond.width larger, or a seam wider, move what lies near the edge away from it, or "
        "round the outline.",
        ("rules.bond_width", "bond.width"),
    ),
)


def _finding(value: float | None, design: Design, place: Place, message: str) -> Finding:
    good = value is not None and holds(value, design.rules.bond_width)
    return Finding(
        NAME, "pass" if good else "fail", design.rules.bond_width, value, "mm", place, message
    )


def _message(value: float, width: Width | None, distinct: DistinctInterface, design: Design) -> str:
    where = interface_name(distinct.interface) + distinct.suffix
    if width is None:
        if distinct.interface.seams and not distinct.interface.pressed:
            return f"nothing bonds at {where}: its seams lie beside the films; move their paths"
        return f"nothing bonds at {where}: the mask covers all of it; make the mask smaller"
    narrowest = f"the narrowest bond is {value:.3f} mm, at {where}, {at(width.middle)}"
    if holds(value, design.rules.bond_width):
        return narrowest
    remedy = "raise bond.width, or move the edges on either side apart there"
    if not value:
        remedy = "round the sharp corner there"
    elif distinct.interface.seams and not distinct.interface.pressed:
        remedy = "make the seam there wider, or move its path inward from the film's edge"
    return f"{narrowest}; it needs {design.rules.bond_width:g}: {remedy}"
