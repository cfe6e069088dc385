"""Dowel pins: lengths that are sold, deep enough in the plate, through every film."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.dowels import chamfer, lengths_sold
from sbafab.pressing.schedule import PressSettings, Schedule, schedule

Stack = Callable[..., Laminate]
PAPER = PressSettings()
ISO_8734 = {1.0: (3, 4, 5, 6, 8, 10), 2.0: (5, 6, 8, 10, 12, 14, 16, 18, 20)}
"""Lengths in mm of ISO 8734, Table 1."""
CHAMFERS = {1.0: 0.2, 2.0: 0.35, 3.0: 0.5, 4.0: 0.63, 5.0: 0.8, 6.0: 1.2}
"""mm, of the same table."""


def plate(plan: Schedule) -> float:
    return plan.steps[0].build_up[0].thickness_mm


def test_lengths_are_the_standards() -> None:
    for diameter, lengths in ISO_8734.items():
        assert lengths_sold(diameter, "ISO 8734") == lengths
    assert {diameter: chamfer(diameter) for diameter in CHAMFERS} == CHAMFERS
    assert lengths_sold(1.0, "ISO 2338")[0] == 4
    assert lengths_sold(1.0, "ISO 8734", (7.0, 5.5)) == (5.5, 7.0)


@pytest.mark.parametrize("balloons", [1, 2, 15, 40])
def test_pins_are_bought_sit_firm_and_reach_through(stack: Stack, balloons: int) -> None:
    plan = schedule(stack(balloons, lumen=True), PAPER)
    pinned = [step for step in plan.steps if step.pins]
    assert pinned
    for step in pinned:
        assert tuple(pin.pin for pin in step.pin_settings) == step.pins
        for pin in step.pin_settings:
            assert pin.length_mm in ISO_8734[pin.diameter_mm]
            assert pin.seat_mm + pin.stands_mm == pytest.approx(pin.length_mm)
            assert max(2, 1.5 * pin.diameter_mm) <= pin.seat_mm <= plate(plan)
            # Over the stack stands the chamfer, which holds no film: 0.2 d at least.
            under = step.stack_mm + PAPER.release_thickness
            assert 0.15 * pin.diameter_mm <= pin.stands_mm - under <= 0.5
    lengths = {(pin.pin, pin.length_mm) for step in pinned for pin in step.pin_settings}
    assert len(lengths) == len(dict(lengths))


def test_own_lengths_and_the_other_standard(stack: Stack) -> None:
    own = schedule(stack(15), replace(PAPER, pin_lengths=(4.5, 7.0)))
    assert {pin.length_mm for step in own.steps for pin in step.pin_settings} == {4.5}
    other = schedule(stack(2), replace(PAPER, pin_standard="ISO 2338"))
    assert {pin.length_mm for step in other.steps for pin in step.pin_settings} == {4.0}


def test_pins_or_plate_that_do_not_do_are_refused(stack: Stack) -> None:
    with pytest.raises(
        DesignError, match=r"at least 3\.\d+ mm long .* registration.pin_lengths has"
    ):
        schedule(stack(15), replace(PAPER, pin_lengths=(3.0,)))
    with pytest.raises(DesignError, match=r"press.plate_thickness = 2 is thinner than the 3\.\d+"):
        schedule(stack(15), replace(PAPER, plate_thickness=2.0))


def test_a_diameter_that_nobody_sells_draws_a_warning(stack: Stack) -> None:
    laminate = stack(2)
    odd = replace(laminate, pins=tuple(replace(pin, diameter=0.9) for pin in laminate.pins))
    said = schedule(odd, PAPER).warnings
    assert any("ISO 8734 has no dowel pin of diameter 0.9" in words for words in said)
