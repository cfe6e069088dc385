"""press-fit: the laminate fits the heated area; a warning for untested heights and press minutes,
and for a film that is not an elastomer.

Heights are untested above ``validated_balloons``; minutes if no kit or design states them for a
film.
"""

from __future__ import annotations

from sbafab.laminate.assembly import films_without_minutes
from sbafab.laminate.laminate import Laminate
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Explanation, Rule

NAME = "press-fit"
STIFFEST = 1000.0
"""MPa, a Young's modulus above the hardest thermoplastic elastomers' (our value)."""


def check(measures: Measures) -> list[Finding]:
    """Return the laminate's size against the platen, either way round, and the warnings."""
    laminate, design = measures.laminate, measures.design
    low_x, low_y, high_x, high_y = laminate.bounds
    short, long = sorted((high_x - low_x, high_y - low_y))
    narrow, wide = sorted(design.press.platen)
    # The side with less room to spare decides.
    measured, limit = min(((short, narrow), (long, wide)), key=lambda side: side[1] - side[0])
    good = measured <= limit + TOLERANCE
    size = f"the laminate measures {high_x - low_x:.3f} x {high_y - low_y:.3f} mm"
    platen = f"{design.press.platen_width:g} x {design.press.platen_length:g} mm"
    message = f"{size} and lies within the heated area of {platen}"
    place = Place()
    if not good:
        message = f"{size} and does not fit the heated area of {platen}; make it smaller"
        largest = max(
            (layers[0] for layers in laminate.patterns.values()),
            key=lambda layer: _extent(layer.profile.bounds),
        )
        place = Place(None, (largest.index,), high_x, high_y)
    findings = [Finding(NAME, "pass" if good else "fail", limit, measured, "mm", place, message)]
    validated = design.rules.validated_balloons
    if laminate.balloons > validated:
        remedy = "press a test piece of this height first"
        message = (
            f"{remedy}: {laminate.balloons} balloons are more than the {validated} "
            "that have been built and tested; heat may not reach the middle of the stack"
        )
        findings.append(
            Finding(
                NAME,
                "warn",
                float(validated),
                float(laminate.balloons),
                "balloons",
                Place(),
                message,
                remedy=remedy,
            )
        )
    return findings + _unstated(laminate, design.press.timed_films) + _too_stiff(laminate)


RULE = Rule(
    NAME,
    check,
    Explanation(
        "the laminate lies in the heated area; more than 20 balloons, films whose minutes nobody "
        "stated, and films stiffer than any elastomer draw a warning",
        "What lies outside the platen is not bonded; heat may not reach a tall stack's middle.",
        "Make the actuator smaller, tell press.platen_width of a larger press, stack fewer; try "
        "another film on a sample and name it in press.minutes_for.",
        (
            "press.platen_width",
            "press.platen_length",
            "rules.validated_balloons",
            "press.minutes_for",
            "films.tpe.modulus",
        ),
    ),
    at_most=True,
)


def _unstated(laminate: Laminate, stated: tuple[tuple[str, float], ...]) -> list[Finding]:
    """A warning for films without stated press minutes."""
    films = films_without_minutes(laminate, stated)
    if not films:
        return []
    names = " and ".join(film.said for film in films)
    remedy = "try the bond on a sample, state the minutes and name the film in press.minutes_for"
    message = f"{remedy}: nobody stated press minutes for {names}, and the schedule leaves them out"
    return [Finding(NAME, "warn", None, None, "", Place(), message, remedy=remedy)]


def _too_stiff(laminate: Laminate) -> list[Finding]:
    """A warning for each film that melts and is stiffer than any elastomer."""
    findings = []
    for film in dict.fromkeys(layer.film for layer in laminate.tpe_layers):
        modulus, _ = film.elastic or (0.0, 0.0)
        if film.melts and modulus > STIFFEST:
            remedy = f"check {film.table}.modulus = {modulus:g} MPa, which is no elastomer's"
            message = f"{remedy}: those have {STIFFEST:g} MPa at most"
            findings.append(
                Finding(NAME, "warn", STIFFEST, modulus, "MPa", Place(), message, remedy=remedy)
            )
    return findings


def _extent(box: tuple[float, float, float, float]) -> float:
    return max(box[2] - box[0], box[3] - box[1])
