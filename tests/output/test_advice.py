"""The least bond and overhang for an asked yield: reached, and not with less."""

from __future__ import annotations

from sbafab.actuators import build, load_design
from sbafab.design.records import Design
from sbafab.output.advice import CHECK_SEED, SEED, advise
from sbafab.output.checked import limits
from sbafab.rules.registration_yield import simulate

SMALL = ("1dof-5mm", "stack.balloons=2", "rules.yield_builds=1000")


def lower_end(*assignments: str, seed: int = SEED) -> float:
    design: Design = load_design(SMALL[0], (*SMALL[1:], *assignments))
    return simulate(build(design), limits(design), seed).whole.interval[0]


def test_what_is_advised_reaches_the_target_and_less_does_not() -> None:
    advice = advise(load_design(SMALL[0], SMALL[1:]), 0.95)
    assert advice.share is not None
    assert advice.bond is not None
    assert advice.overhang is not None
    bond, overhang = f"bond.width={advice.bond}", f"mask.overhang={advice.overhang}"
    assert lower_end(bond, overhang, seed=CHECK_SEED) == advice.share.interval[0] >= 0.95
    worse = (f"bond.width={advice.bond - 0.02}", f"mask.overhang={advice.overhang - 0.02}")
    assert min(lower_end(*worse), lower_end(*worse, seed=CHECK_SEED)) < 0.95
    assert f"bond.width = {advice.bond:.2f}" in advice.sentence


def test_with_ears_the_rules_own_limits_are_enough() -> None:
    ears = "registration.method=ears"
    advice = advise(load_design(SMALL[0], (*SMALL[1:], ears)), 0.99)
    assert (advice.bond, advice.overhang) == (0.75, 0.5)
    assert lower_end(ears) >= 0.99


def test_where_nothing_helps_it_says_so() -> None:
    # Two edges off by up to 1 mm each take more than any bond tried has.
    design = load_design(SMALL[0], (*SMALL[1:], "registration.cutting_error=1"))
    advice = advise(design, 0.99)
    assert advice.share is None
    assert "ears" in advice.sentence
    assert advice.as_dict()["bond_width"] is None
