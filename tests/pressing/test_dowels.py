"""Dowel pins and their holes: sold, deep enough, through every film and never through a plate."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import pytest

from sbafab.actuators import build, load_design
from sbafab.errors import DesignError
from sbafab.laminate.base_plate import (
    hole_deviation,
    most_play,
    pin_deviations,
)
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.dowels import (
    Standard,
    chamfer,
    hole_notes,
    is_sold,
    lengths_sold,
)
from sbafab.pressing.schedule import Schedule, Step, plate_holes, schedule

Stack = Callable[..., Laminate]
PAPER = load_design("1dof-5mm")
ISO_8734 = {1.0: (3, 4, 5, 6, 8, 10), 2.0: (5, 6, 8, 10, 12, 14, 16, 18, 20)}
"""Lengths in mm of ISO 8734, Table 1."""
LENGTHS_FROM_TO = {
    "ISO 8734": "1: 3-10, 1.5: 4-16, 2: 5-20, 2.5: 6-24, 3: 8-30, 4: 10-40, 5: 12-50, 6: 14-60",
    "ISO 2338": "0.6: 2-6, 0.8: 2-8, 1: 4-10, 1.2: 4-12, 1.5: 4-16, 2: 6-20, 2.5: 6-24, 3: 8-30, "
    "4: 8-40, 5: 10-50, 6: 12-60",
}
"""Diameters, shortest and longest lengths, mm, as Table 1 of each standard prints them."""
CHAMFERS = {1.0: 0.2, 2.0: 0.35, 3.0: 0.5, 4.0: 0.63, 5.0: 0.8, 6.0: 1.2}
"""mm, of the same table."""
ISO_286 = {
    # Diameter up to, m6 from and to, H7 to: um, as suppliers' tables of ISO 286-2 print them.
    3.0: (2, 8, 10),
    6.0: (4, 12, 12),
    10.0: (6, 15, 15),
    18.0: (7, 18, 18),
}
LENGTHS, DEPTHS = 0.25, 0.05
"""By how much a pin up to 10 mm and a depth up to 6 mm may be off, mm: ISO 8734; ISO 2768-1, f."""
POINT = math.cos(math.radians(15)), math.sin(math.radians(15))
"""A pin's end narrows by 15 degrees along its chamfer."""


def plate(plan: Schedule) -> float:
    return plan.steps[0].build_up[0].thickness_mm


def under(step: Step) -> float:
    """All that lies on the plate up to the top of the stack, added part by part, mm."""
    names = [item.part for item in step.build_up]
    lying = step.build_up[1 : names.index("laminate") + 1]
    return sum(item.thickness_mm for item in lying)


@pytest.mark.parametrize("standard", ["ISO 8734", "ISO 2338"])
def test_every_diameter_of_the_standards_is_sold(standard: Standard) -> None:
    table = LENGTHS_FROM_TO[standard].split(", ")
    ends = {float(d): lengths.split("-") for d, lengths in (row.split(": ") for row in table)}
    for diameter, (shortest, longest) in ends.items():
        assert is_sold(diameter, standard)
        sold = lengths_sold(diameter, standard)
        assert (sold[0], sold[-1]) == (float(shortest), float(longest))
    assert all(chamfer(diameter) == sold for diameter, sold in CHAMFERS.items())
    absent = {0.5, 0.6, 0.8, 1.2, 3.5, 4.5} - set(ends)
    assert not any(is_sold(diameter, standard) for diameter in absent)


@pytest.mark.parametrize("balloons", [1, 2, 15, 40])
def test_pins_are_bought_and_stand_on_shoulders(stack: Stack, balloons: int) -> None:
    plan = schedule(stack(balloons, lumen=True), PAPER)
    pinned = [step for step in plan.steps if step.pins]
    assert pinned
    for step in pinned:
        assert tuple(pin.pin for pin in step.pin_settings) == step.pins
        for pin in step.pin_settings:
            assert pin.length_mm in ISO_8734[pin.diameter_mm]
            assert pin.seat_mm + pin.stands_mm == pytest.approx(pin.length_mm)
            # A floor of 1 mm is left under the shoulder.
            assert max(2, 1.5 * pin.diameter_mm) <= pin.seat_mm <= plate(plan) - 1
    # A plate is drilled once, and holes of one diameter alike.
    seats = {(pin.diameter_mm, pin.seat_mm) for step in pinned for pin in step.pin_settings}
    assert len(seats) == len(dict(seats))


def test_no_pin_falls_through_or_stands_off_its_height() -> None:
    """Random plates, holes reamed H7 and pins m6, all within their tolerances: 100 % of them."""
    draw = random.Random(20_241)
    loose = tight = 0
    for template, method in (
        ("3dof-15mm", "channel-pin"),
        ("1dof-5mm", "channel-pin"),
        ("3dof-15mm", "ears"),
    ):
        design = load_design(template, [f'registration.method="{method}"'])
        laminate = build(design)
        plan = schedule(laminate, design)
        holes = plate_holes(laminate, design)
        for _ in range(400):
            for step in plan.steps:
                for pin in step.pin_settings:
                    hole = holes[pin.pin]
                    low, high, reamed = ISO_286[min(d for d in ISO_286 if d >= pin.diameter_mm)]
                    thick = pin.diameter_mm + draw.uniform(low, high) / 1000
                    wide = pin.diameter_mm + draw.uniform(0, reamed) / 1000
                    long = pin.length_mm + draw.uniform(-LENGTHS, LENGTHS)
                    deep = hole.depth + draw.uniform(-DEPTHS, DEPTHS)
                    loose += thick < wide
                    tight += thick >= wide
                    # Loose or tight, its end is wider than the hole that goes on below it.
                    end = thick - 2 * chamfer(pin.diameter_mm) * POINT[1] / POINT[0]
                    assert end > hole.push_out + 0.1
                    assert deep < plate(plan) - 0.9
                    over = long - deep
                    assert abs(over - pin.stands_mm) <= pin.tolerance_mm + 1e-9
                    # Its cylinder reaches through the stack, and into the pad no deeper than half.
                    pad = step.build_up[-1].thickness_mm
                    assert over - chamfer(pin.diameter_mm) >= under(step) - 1e-9
                    assert over - under(step) < pad / 2
    # The issue that a fit would leave: about half of all pairs are loose.
    assert 0.4 < loose / (loose + tight) < 0.6


def test_fits_are_those_of_iso_286() -> None:
    for diameter, (low, high, reamed) in ISO_286.items():
        assert pin_deviations(diameter) == (low / 1000, high / 1000)
        assert hole_deviation(diameter) == reamed / 1000
        assert most_play(diameter, "cnc-mill") == pytest.approx((reamed - low) / 1000)
        assert most_play(diameter, "jig-borer") == 0.002


def test_the_shop_is_told_of_its_holes() -> None:
    design = load_design("3dof-15mm")
    laminate = build(design)
    holes = plate_holes(laminate, design)
    jig = hole_notes(laminate.pins, holes, "jig-borer")
    assert len(jig) == 3
    for line, diameter in zip(jig, (1, 2), strict=False):
        hole = next(hole for hole in holes.values() if hole.diameter == diameter)
        assert line.startswith(f"D{diameter} lapped")
        assert f"from above {hole.depth:g} +-0.05 deep, flat; D{hole.push_out:g} on through" in line
    assert jig[-1] == "each hole within 0.003 of its place, a jig borer"
    mill = hole_notes(laminate.pins, holes, "cnc-mill")
    assert mill[0].startswith("D1 H7,")
    assert "0.025" in mill[-1]
    lone = hole_notes(laminate.pins[:1], holes, "jig-borer")
    assert len(lone) == 1
    assert lone[0].startswith("D1 H7,")
    assert "not used" in hole_notes(laminate.pins[:1], {}, "jig-borer")[0]


def test_pins_or_plate_that_do_not_do_are_refused(stack: Stack) -> None:
    with pytest.raises(DesignError, match=r"at least \d\.\d+ mm long .* longest available is 3"):
        schedule(stack(15), PAPER.with_("registration.pin_lengths=[3]"))
    with pytest.raises(DesignError, match=r"press.plate_thickness = 2 is thinner than the 3\.\d+"):
        schedule(stack(15), PAPER.with_("press.plate_thickness=2"))


def test_the_depth_with_which_pins_stand_out_least_is_taken(stack: Stack) -> None:
    """As above, but with pins of 5.04: 5.04 - 0.3 - 0.438 = 4.302, drilled 4.30 deep, stands out
    0.74 where pins of 4 stand out 0.75.
    """
    own = PAPER.with_("registration.pin_lengths=[4, 5.04]", "press.plate_thickness=8")
    plan = schedule(stack(2), own)
    pins = {(pin.length_mm, pin.seat_mm) for step in plan.steps for pin in step.pin_settings}
    assert pins == {(5.04, 4.3)}
