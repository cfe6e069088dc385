"""pressure-rating: the estimated burst pressure is the working pressure times a safety factor.

A design that states no working pressure is held against 100 kPa, at which the paper gives forces,
and is warned; one that states it fails.
"""

from __future__ import annotations

from sbafab.laminate.burst import NOT_BURST, Burst, burst
from sbafab.rules.finding import Finding, Place, Verdict
from sbafab.rules.limits import at
from sbafab.rules.measures import Measures, interface_name
from sbafab.rules.rule import Explanation, Rule

NAME = "pressure-rating"
UNSTATED = 100.0
"""kPa that a design is held against which states no working pressure."""
KEY = "acceptance.working_pressure_kpa"


def check(measures: Measures) -> list[Finding]:
    """Return the burst estimate of the weakest pocket against the working pressure."""
    acceptance = measures.design.acceptance
    stated, factor = acceptance.working_pressure_kpa, acceptance.safety_factor
    working = UNSTATED if stated is None else stated
    if working <= 0:
        return [_passed("it works under a vacuum, by which no film bursts")]
    estimate = burst(measures.laminate)
    if estimate is None and stated is None:
        return [_passed(f"not compared: {NOT_BURST}, and state {KEY}")]
    if estimate is None:
        remedy = "burst one actuator, and divide its pressure by the safety factor"
        message = f"{remedy}: {NOT_BURST}; whether {working:g} kPa is safe is not known"
        return [Finding(NAME, "warn", None, None, "kPa", Place(), message, remedy=remedy)]
    return [_compared(estimate, working, factor, stated is not None)]


def _passed(message: str) -> Finding:
    return Finding(NAME, "pass", None, None, "kPa", Place(), message)


def _compared(estimate: Burst, working: float, factor: float, is_stated: bool) -> Finding:
    limit, interface = factor * working, estimate.interface
    where = f"the widest pocket, of {interface_name(interface)} at {at(estimate.centre)},"
    bursts = f"{where} is estimated to burst at {estimate.kpa:.3g} kPa"
    is_good = estimate.kpa >= limit * (1 - ROUNDING)
    safe = f"{estimate.kpa / factor:.3g} kPa"
    place = Place(interface.index, interface.layer_indices, *estimate.centre)
    remedy = ""
    if is_good:
        message = f"{bursts}: with a safety factor of {factor:g} it may work at {safe}"
    elif is_stated:
        message = (
            f"{bursts}, less than {factor:g} times {working:g} kPa; lower {KEY} to {safe} or less, "
            "or take narrower pockets or thicker film"
        )
    else:
        remedy = f"state {KEY}, at most {safe}"
        message = f"{remedy}: {bursts}, less than {factor:g} times {working:g} kPa, the default"
    verdict: Verdict = "pass" if is_good else "fail" if is_stated else "warn"
    return Finding(NAME, verdict, limit, estimate.kpa, "kPa", place, message, remedy=remedy)


ROUNDING = 1e-9
"""Share of a limit that rounding may take."""

RULE = Rule(
    NAME,
    check,
    Explanation(
        "the estimated burst pressure is at least the working pressure times the safety factor; a "
        "film without a burst test is not compared, and warned of if a working pressure is stated",
        "A film under too much pressure bursts, or its bonds peel, at first use or after many.",
        "Work at less pressure, take smaller pockets or a thicker film.",
        (KEY, "acceptance.safety_factor", "chamber.diameter", "films.tpe.thickness"),
    ),
)
