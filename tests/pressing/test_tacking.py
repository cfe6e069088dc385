"""Masks of registered sheets, tacked to their films one sheet at a time."""

from __future__ import annotations

import math

import pytest
from lxml import html as lxml_html

from sbafab.actuators import build, load_design
from sbafab.errors import DesignError
from sbafab.output.checked import press_settings
from sbafab.pressing.dowels import chamfer, least_seat
from sbafab.pressing.schedule import Schedule, schedule
from sbafab.reports.traveller.job import Job
from sbafab.reports.traveller.page import traveller_html

SHEET = ('registration.method="sheet"', "registration.experimental=true")


def planned(template: str, *changes: str) -> Schedule:
    design = load_design(template, (*SHEET, *changes))
    return schedule(build(design), press_settings(design))


@pytest.mark.parametrize("plate", [6.0, 12.0])
def test_every_tack_goes_from_cold_to_cold(plate: float) -> None:
    """29 mask sheets of 15 balloons; a lumped plate, followed second by second."""
    plan = planned("3dof-15mm", f"press.plate_thickness={plate}")
    tacking = plan.tacking
    assert tacking is not None
    assert tacking.sheets == 15 + 14
    heat = 7850 * 490 * plate / 1000  # J/(m2 K)
    warm, seconds = 20.0, 0
    while warm < 130:
        warm += 500 * (135 - warm) / heat
        seconds += 1
    assert tacking.warm_minutes == pytest.approx(seconds / 60, rel=0.04)
    cold, seconds = 135.0, 0
    while cold > 40:
        cold -= 2 * 10 * (cold - 20) / heat
        seconds += 1
    assert tacking.cool_minutes == pytest.approx(seconds / 60, rel=0.04)
    # Not the 29 minutes of the closed press alone.
    assert tacking.total_minutes > 29 * (1 + 30)
    assert plan.estimated_build_minutes == pytest.approx(30 + tacking.total_minutes + 60)


def test_pins_of_a_tack_stand_over_one_film_and_its_masks() -> None:
    plan = planned("3dof-15mm")
    tacking = plan.tacking
    assert tacking is not None
    assert tacking.stack_mm == pytest.approx(0.038 + 0.025)
    assert [pin.pin for pin in tacking.pins] == [f"corner{n}" for n in (1, 2, 3, 4)]
    for low, high in zip(tacking.pins, plan.steps[0].pin_settings, strict=True):
        top = 0.05 + 0.063
        assert low.stands_mm >= top + chamfer(low.diameter_mm) - 1e-9
        assert low.seat_mm >= least_seat(low.diameter_mm)
        # The whole stack is 1.865 mm high: pins for it would stand 1.8 mm into the pad.
        assert high.stands_mm > 1.865
        assert low.stands_mm < high.stands_mm - 0.9


def test_all_sheets_but_the_caps_are_stacked_at_once() -> None:
    # Two balloons have seven layers.
    first, last = planned("1dof-5mm", "stack.balloons=2").steps
    assert "Stack the sheets of layers 1 to 6 on the corner pins" in first.instructions
    assert "Lay the sheet of layer 7 on its pins" in last.instructions


@pytest.mark.parametrize("limit", [120, 135])
def test_a_transfer_film_that_does_not_stand_the_press_is_refused(limit: float) -> None:
    with pytest.raises(DesignError, match=f"panel.carrier_limit_c = {limit}"):
        planned("1dof-5mm", f"panel.carrier_limit_c={limit}")


def test_what_nobody_knows_of_the_transfer_film_is_a_blank() -> None:
    known = ("panel.carrier_limit_c=180", 'panel.carrier_adhesive="silicone, 40 um"')
    for changes, words in [
        ((), "adhesive ________________, rated for ________ °C by its maker"),
        (known, "adhesive silicone, 40 um, rated for 180 °C by its maker"),
    ]:
        design = load_design("1dof-5mm", (*SHEET, "stack.balloons=2", *changes))
        laminate = build(design)
        plan = schedule(laminate, press_settings(design))
        assert any("carrier_limit_c" in said for said in plan.warnings) == (not changes)
        page = traveller_html(design, laminate, plan, [], Job("0" * 64, "sbafab 1.0.0"))
        text = " ".join(lxml_html.fromstring(page).text_content().split())
        assert words in text
        assert plan.tacking is not None
        hours = plan.tacking.total_minutes / 60
        assert f"{plan.tacking.total_minutes:.0f} min = {hours:.2f} h" in text
        assert f"stand {plan.tacking.pins[0].stands_mm:g} mm over the plate" in text
        assert math.isclose(hours, 3 * plan.tacking.each_minutes / 60)
