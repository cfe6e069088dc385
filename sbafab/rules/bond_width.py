"""bond-width: every bond is wide enough everywhere (paper Sec. 2: narrower bonds leak)."""

from __future__ import annotations

from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.limits import holds
from sbafab.rules.measures import Measures, distinct_interfaces, place_in
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained

NAME = "bond-width"


def check(measures: Measures) -> list[Finding]:
    """Return the least width of any bond, measured between facing edges."""
    limit = measures.design.rules.bond_width
    widths = [
        (width.value if width else 0.0, width, distinct)
        for distinct in distinct_interfaces(measures.laminate)
        for width in [measures.bond(distinct.interface)]
        if width is not None or distinct.interface.bond.is_empty
    ]
    if not widths:
        return [judged(NAME, False, limit, None, "mm", Place(), "none")]
    value, width, distinct = min(widths, key=lambda entry: round(entry[0], 9))
    interface = distinct.interface
    is_seamed = bool(interface.seams) and not interface.pressed
    if width is None:
        sentence = "seams-beside" if is_seamed else "covered"
    elif not value:
        sentence = "sharp"
    else:
        sentence = "thin-seam" if is_seamed else "narrowest"
    place = place_in(interface, width and width.middle)
    good = holds(value, limit)
    return [judged(NAME, good, limit, value, "mm", place, sentence, where=distinct.name)]


RULE = Rule(NAME, check, explained(NAME))
