"""press-fit: the laminate fits the heated area; warns of untested heights and press minutes, and of
a film that is not an elastomer.

Heights are untested above ``validated_balloons``, or above that many of the paper's films: the time
for heat to reach a stack's middle is proportional to the square of its height. Minutes are untested
if neither kit nor design states them for a film.
"""

from __future__ import annotations

from collections.abc import Iterator

from sbafab.design.sections import MINUTES
from sbafab.laminate.lay_up import films_without_minutes
from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained, say

NAME = "press-fit"
STIFFEST = 1000.0
"""MPa, a Young's modulus above the hardest thermoplastic elastomers' (our value)."""


def check(measures: Measures) -> list[Finding]:
    """Return the laminate's size against the platen, in either orientation, and the warnings."""
    return [_size(measures), *_warnings(measures)]


RULE = Rule(NAME, check, explained(NAME), at_most=True)


def _size(measures: Measures) -> Finding:
    laminate, press = measures.laminate, measures.design.press
    low_x, low_y, high_x, high_y = laminate.bounds
    width, length = high_x - low_x, high_y - low_y
    # The side with less room to spare decides.
    sides = zip(sorted((width, length)), sorted(press.platen), strict=True)
    measured, limit = min(sides, key=lambda side: side[1] - side[0])
    good = measured <= limit + TOLERANCE
    firsts = [layers[0] for layers in laminate.patterns.values()]
    boxes = ((layer, layer.profile.bounds) for layer in firsts)
    largest, _ = max(boxes, key=lambda row: max(row[1][2] - row[1][0], row[1][3] - row[1][1]))
    place = Place() if good else Place(None, (largest.index,), high_x, high_y)
    facts = {"platen_width": press.platen_width, "platen_length": press.platen_length}
    facts |= {"width": width, "length": length}
    return judged(NAME, good, limit, measured, "mm", place, "size", **facts)


def _warnings(measures: Measures) -> Iterator[Finding]:
    laminate, design, nowhere = measures.laminate, measures.design, Place()
    balloons, validated = laminate.balloons, design.rules.validated_balloons
    if balloons > validated:
        limit, count = float(validated), float(balloons)
        yield judged(NAME, "warn", limit, count, "balloons", nowhere, "tall")
    elif laminate.thickness > design.rules.validated_height + TOLERANCE:
        high, most = laminate.thickness, design.rules.validated_height
        longer = (high / most) ** 2
        yield judged(NAME, "warn", most, high, "mm", nowhere, "high", longer=longer)
    films = films_without_minutes(laminate, design.press.timed_films)
    if films:
        names = [film.said for film in films]
        timed = design.press.minutes_for
        only = say(f"{NAME}.only", timed=timed) if timed else say(f"{NAME}.only-none")
        yield judged(NAME, "warn", None, None, "", nowhere, "unstated", films=names, only=only)
    keys = [f"press.{key}" for key in MINUTES if getattr(design.press, key) is None]
    if keys and not films:
        yield judged(NAME, "warn", None, None, "", nowhere, "left-out", keys=keys)
    for film in dict.fromkeys(layer.film for layer in laminate.tpe_layers):
        modulus, _ = film.elastic or (0.0, 0.0)
        if film.melts and modulus > STIFFEST:
            facts = {"table": film.table}
            yield judged(NAME, "warn", STIFFEST, modulus, "MPa", nowhere, "stiff", **facts)
