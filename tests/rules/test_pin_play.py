"""Layers on their pins: by how much they shift and turn, and how narrow a hole may come out."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from sbafab.geometry.edges import Point
from sbafab.laminate.laminate import Laminate
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.measures import Measures
from sbafab.rules.pin_fit import check
from sbafab.rules.placement_errors import Freedom, Laid, Part, freedoms
from tests.designs import PAPER

Good = Callable[..., Laminate]
BASE = Part(1, 0)


def ways_on(laminate: Laminate, pins: dict[Point, float]) -> tuple[Freedom, ...]:
    """Return the freedoms of the base, laid on pins with such play, mm."""
    laid = Laid([BASE], 1, pins, next(iter(pins)), None, stays=False)
    return freedoms(laminate, PAPER, [laid])[BASE]


@pytest.mark.parametrize(
    ("pins", "shift", "turn", "centre"),
    [
        # A lever: x and 10 - x from its fulcrum the ends go 0.1 and 0.3, so x = 2.5.
        ({(0.0, 0.0): 0.1, (10.0, 0.0): 0.3}, 0.1, 0.4 / 10, (2.5, 0.0)),
        ({(0.0, 0.0): 0.3, (10.0, 0.0): 0.1}, 0.1, 0.4 / 10, (7.5, 0.0)),
        ({(1.0, 2.0): 0.1, (1.0, 22.0): 0.1}, 0.1, 0.2 / 20, (1.0, 12.0)),
        # 3, 4, 5: where one pin has no play, the body turns about it.
        ({(0.0, 0.0): 0.0, (3.0, 4.0): 0.2}, 0.0, 0.2 / 5, (0.0, 0.0)),
        # The pair that leaves least decides: 0.2 in 20 before 0.4 in 10 and 0.4 in 22.4.
        ({(0.0, 0.0): 0.1, (10.0, 0.0): 0.3, (0.0, 20.0): 0.1}, 0.1, 0.2 / 20, (0.0, 10.0)),
    ],
)
def test_a_body_turns_about_the_point_that_divides_its_play(
    good: Good, pins: dict[Point, float], shift: float, turn: float, centre: Point
) -> None:
    aside, about = ways_on(good("1dof-5mm"), pins)
    assert aside.centre is None
    assert aside.most == pytest.approx(0.004 + shift)
    assert about.most == pytest.approx(turn)
    assert about.centre == pytest.approx(centre)


def test_pins_without_play_let_nothing_turn(good: Good) -> None:
    [aside] = ways_on(good("1dof-5mm"), {(0.0, 0.0): 0.0, (10.0, 0.0): 0.0})
    assert (aside.centre, aside.most) == (None, 0.004)


def test_cutting_and_pins_both_narrow_a_hole(good: Good) -> None:
    """A hole of 1 mm, its edge and its place off by 0.01 and 0.02 all round: 0.94. The pin of 0.6
    to m6 is up to 0.608 thick, which leaves 0.332; one of 0.99, up to 0.998, widens it.
    """
    limits = PAPER.with_("registration.cutting_error=0.01", "registration.pin_error=0.02")
    [loose] = check(Measures(good("1dof-5mm", "bore.pin_diameter=0.6"), limits))
    assert loose.measured == 0.0
    assert "(0.332 mm to spare at worst)" in loose.message
    assert "may come out 0.940 mm wide" in loose.message
    [tight] = check(Measures(good("1dof-5mm", "bore.pin_diameter=0.99"), limits))
    # Findings are rounded to the sixth digit.
    assert tight.measured == pytest.approx(0.998 / 0.94 - 1, abs=5e-7)


@pytest.mark.parametrize(("missed", "verdict"), [(1.9, "pass"), (2.1, "fail")])
def test_a_stretch_may_miss_what_is_allowed_by_what_a_hole_may(
    good: Good, missed: float, verdict: str
) -> None:
    """The hole of 0.94 may miss its drawing by the tolerance on each side, two of them in all."""
    allowed = 0.998 / 0.94 - 1 - missed * TOLERANCE / 0.94
    limits = PAPER.with_(
        registration={"cutting_error": 0.01, "pin_error": 0.02, "pin_stretch": allowed}
    )
    [found] = check(Measures(good("1dof-5mm", "bore.pin_diameter=0.99"), limits))
    assert found.verdict == verdict
