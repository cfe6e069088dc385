"""pressure-rating: the estimated burst pressure exceeds the working pressure by a safety factor.

Without a stated working pressure a design is compared with 100 kPa, at which the paper gives
forces, and is warned at most; with one it fails.
"""

from __future__ import annotations

from sbafab.laminate.burst import NOT_BURST, burst
from sbafab.rules.finding import Finding, Place, Verdict, judged
from sbafab.rules.measures import Measures, interface_name, place_in
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained

NAME = "pressure-rating"
UNSTATED = 100.0
"""kPa that a design is held against which states no working pressure."""
ROUNDING = 1e-9
"""Share of a limit that rounding may take."""


def check(measures: Measures) -> list[Finding]:
    """Return the burst estimate of the weakest pocket against the working pressure."""
    acceptance = measures.design.acceptance
    stated, factor = acceptance.working_pressure_kpa, acceptance.safety_factor
    working = UNSTATED if stated is None else stated
    if working <= 0:
        return [judged(NAME, True, None, None, "kPa", Place(), "vacuum")]
    estimate = burst(measures.laminate)
    if estimate is None:
        verdict: Verdict = "pass" if stated is None else "warn"
        sentence = "not-compared" if stated is None else "unknown"
        facts = {"unburst": NOT_BURST, "working": working}
        return [judged(NAME, verdict, None, None, "kPa", Place(), sentence, **facts)]
    limit, interface = factor * working, estimate.interface
    facts = {"working": working, "factor": factor, "safe_kpa": estimate.kpa / factor}
    facts["where"] = interface_name(interface)
    if estimate.kpa >= limit * (1 - ROUNDING):
        verdict, sentence = "pass", "safe"
    else:
        verdict, sentence = ("warn", "unstated") if stated is None else ("fail", "unsafe")
    place = place_in(interface, estimate.centre)
    return [judged(NAME, verdict, limit, estimate.kpa, "kPa", place, sentence, **facts)]


RULE = Rule(NAME, check, explained(NAME))
