"""How many are made for so many good ones, and how many spare parts are cut."""

from __future__ import annotations

import pytest
from scipy.stats import binom

from sbafab.actuators import load_design
from sbafab.design.sections import builds_for, probability_of


@pytest.mark.parametrize("rate", [0.3, 0.9, 0.999, 1.0])
@pytest.mark.parametrize(("good", "builds"), [(1, 1), (1, 9), (20, 23), (200, 260), (500, 1000)])
def test_the_probability_is_the_upper_tail_of_the_binomial(
    good: int, builds: int, rate: float
) -> None:
    expected = binom.sf(good - 1, builds, rate)
    assert probability_of(good, builds, rate) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("certainty", [0.5, 0.8, 0.9, 0.99])
@pytest.mark.parametrize(("good", "rate"), [(1, 0.5), (7, 0.9), (100, 0.95), (800, 0.99)])
def test_one_build_fewer_is_not_enough(good: int, rate: float, certainty: float) -> None:
    builds = builds_for(good, rate, certainty)
    assert builds is not None
    assert binom.sf(good - 1, builds, rate) >= certainty
    assert builds == good or binom.sf(good - 1, builds - 1, rate) < certainty


def test_an_order_of_good_ones_says_how_many_are_made() -> None:
    made = load_design("1dof-5mm", ["order.good=20"])
    assert (made.order.copies, made.order.good, made.order.quantity) == (1, 20, 23)
    assert load_design("1dof-5mm", ["order.good=20", "order.copies=30"]).order.quantity == 30
    # As scipy has it: binom.sf(19, 23, 0.9) = 0.8073.
    assert "at least 20 of 23 do with a probability of 81%" in made.order.why
    assert made.with_("order.certainty=0.9").order.quantity == 24


@pytest.mark.parametrize(
    ("needed", "share", "least", "expected"),
    [
        (0, 0.05, 1, 0),
        (1, 0.05, 1, 1),
        (20, 0.05, 1, 1),
        (21, 0.05, 1, 2),
        (342, 0.05, 1, 18),
        (9, 0.0, 0, 0),
        (9, 0.0, 2, 2),
        (40, 0.1, 2, 4),
    ],
)
def test_spares_are_a_share_and_at_least_some(
    needed: int, share: float, least: int, expected: int
) -> None:
    few = [f"order.spare_share={share}", f"order.spares={least}"]
    assert load_design("1dof-5mm", few).order.spare_parts(needed) == expected
