"""A seam's error of place in the worst case and in sealing, on the template of a folded film.

Its seams are 2 mm wide and end 1 mm past the film; the middles of both lie 2 mm from the mouth's.
"""

from __future__ import annotations

import pytest

from sbafab.actuators import build, load_design
from sbafab.output.checked import limits
from sbafab.rules.deck import run_rule
from sbafab.rules.finding import Finding
from sbafab.rules.registration_worst_case import RULE as WORST_CASE
from sbafab.rules.sealing import RULE as SEALING

STEADY = {"registration.hand_placement": 0, "registration.hand_turn": 0}


def findings(rule: object, **settings: object) -> list[Finding]:
    named = {key.replace("__", "."): value for key, value in settings.items()}
    design = load_design("folded").with_({**STEADY, **named})
    return run_rule(rule, build(design), limits(design))  # type: ignore[arg-type]


@pytest.mark.parametrize("error", [0.0, 0.5, 1.2])
def test_the_tools_error_is_taken_off_a_bond_from_seam_to_edge(error: float) -> None:
    bond, _ = findings(WORST_CASE, registration__seam_error=error)
    # The film's edge and the seam's width lie off by the cutting error each.
    assert bond.measured == pytest.approx(2.0 - 2 * 0.1 - error)
    assert bond.verdict == "pass"


def test_a_tool_that_strays_too_far_fails() -> None:
    bond, _ = findings(WORST_CASE, registration__seam_error=1.6)
    assert bond.verdict == "fail"
    assert bond.measured == pytest.approx(0.2)
    assert "place of seam" in bond.message
    assert "make seam or bond.width larger" in bond.message


def test_by_default_a_laser_is_as_exact_as_its_cuts_and_other_tools_are_not() -> None:
    bond, _ = findings(WORST_CASE)
    assert bond.measured == pytest.approx(2.0 - 0.2 - 0.3)
    seams = load_design("folded").model_dump()["seams"]
    laser = [{**seam, "tool": "laser"} for seam in seams]
    bond, _ = findings(WORST_CASE, seams=laser)
    assert bond.measured == pytest.approx(2.0 - 0.2 - 0.1)


def test_sealing_alone_catches_a_seam_that_closes_the_mouth_when_it_strays() -> None:
    nominal, moved = findings(SEALING, registration__seam_error=0.9)
    assert (nominal.verdict, moved.verdict) == ("pass", "pass")
    # A seam 1.2 mm off reaches 0.2 mm past the middle of the mouth, where the tube goes in.
    nominal, moved = findings(SEALING, registration__seam_error=1.2)
    assert (nominal.verdict, moved.verdict) == ("pass", "fail")
    assert "off its path by up to 1.2 mm" in moved.message
    assert findings(WORST_CASE, registration__seam_error=1.2)[0].verdict == "pass"
