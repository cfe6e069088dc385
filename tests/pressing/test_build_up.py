"""The build-up between the platens: the estimate against balance of forces and Gent's paper."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from sbafab.actuators import load_design
from sbafab.design.sections import Press
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.build_up import (
    EVEN,
    PADS,
    StackShape,
    column_modulus,
    gent_modulus,
    pad_modulus,
    pad_thickness,
    pressures,
)
from sbafab.pressing.schedule import schedule
from sbafab.pressing.schedule_files import press_json

Stack = Callable[..., Laminate]
PAPER = load_design("1dof-5mm")
PLATEN = (152.4, 152.4)
LAMINATE = StackShape(height=1.865, area=150.0, rim=50.0, below=0.375)


def rubber(thickness: float | None, hardness: float) -> dict[str, Any]:
    """Keys of a press pad of solid rubber."""
    keys = {"pad_material": "silicone rubber", "pad_hardness": hardness}
    return keys if thickness is None else {**keys, "pad_thickness": thickness}


def test_gents_modulus_is_that_of_rubber() -> None:
    # Gent's own scale: 0.69 MPa (100 psi) near 20 Shore A, 2.4 to 2.5 MPa at 50.
    assert gent_modulus(50) == pytest.approx(2450, rel=0.02)
    assert gent_modulus(20) == pytest.approx(720, rel=0.05)


@pytest.mark.parametrize("pad", [{}, rubber(25.0, 40.0)])
def test_what_films_and_plate_get_is_the_force(pad: dict[str, Any]) -> None:
    press = Press(**pad)
    found = pressures(press, 25.0, LAMINATE)
    platen = PLATEN[0] * PLATEN[1]
    carried = found.film * LAMINATE.area + found.plate * (platen - LAMINATE.area)
    assert carried == pytest.approx(110.0 * platen, rel=1e-3)
    # The pad is pressed together by the laminate's height more over it than beside it.
    more = (found.film - found.plate) / column_modulus(press, 25.0, LAMINATE) * 25.0
    assert more == pytest.approx(LAMINATE.height, rel=5e-3)
    assert found.bond < found.film < found.edge


def test_the_pad_spans_beside_what_stands_out(stack: Stack) -> None:
    """A soft half-space closes a gap of width w by 2 p w / E; E is 412.7 kPa at 10 Shore A.

    The pin of step 1 is 4 mm long in a hole of 3.25, over 0.063 of films and 0.05 below them; it
    may be 0.25 longer and its hole 0.05 shallower.
    """
    found = pressures(Press(), 25.0, LAMINATE)
    assert found.free == pytest.approx(1.865 * 412.7 / (2 * 110), abs=0.05)
    first = schedule(stack(2), PAPER.with_("registration.pin_lengths=[4]")).steps[0]
    out = 4 - 3.25 + 0.25 + 0.05 - 0.063 - 0.05
    width = out * 412.7 / (2 * 110)
    assert first.pressure_basis.endswith(f"; up to {width:.1f} mm round a pin none")


def test_solid_rubber_must_flow_aside_and_is_harder_than_a_sponge() -> None:
    # A disc of radius a on a pad of height H has the shape factor a / 2 H.
    a, thickness = 10.0, 5.0
    disc = StackShape(1.0, math.pi * a * a, 2 * math.pi * a, 0.0)
    solid = Press(**rubber(thickness, 10.0))
    assert column_modulus(solid, thickness, disc) == pytest.approx(
        pad_modulus(solid) * (1 + 2 * 1.0)
    )
    assert column_modulus(Press(), thickness, disc) == pad_modulus(Press())


def test_the_pad_is_the_thinnest_that_is_even_enough(stack: Stack) -> None:
    plan = schedule(stack(15), PAPER)
    [pad] = {item.thickness_mm for step in plan.steps for item in step.build_up[-1:]}
    assert max(step.film_kpa for step in plan.steps) <= EVEN * 110
    thinner = PADS[PADS.index(pad) - 1]
    with_thinner = schedule(stack(15), PAPER.with_(press={"pad_thickness": thinner}))
    assert max(step.film_kpa for step in with_thinner.steps) > EVEN * 110


@pytest.mark.parametrize(
    ("pad", "said"),
    [
        (
            {"pad_thickness": 3.0},
            r"pad_thickness = 3 of .* 1\.\d+ mm high the films would get \d+ kPa",
        ),
        (rubber(3.0, 60.0), r"fewer balloons .* make it thicker or softer"),
        ({"pad_hardness": 5.0, "pad_thickness": 50.0, "pressure_kpa": 180.0}, "harder or thicker"),
        ({"pad_hardness": 50.0}, "harder than any silicone sponge, 30 at most"),
        (rubber(None, 90.0), "no press pad"),
    ],
)
def test_a_set_up_that_cannot_give_the_pressure_is_refused(
    stack: Stack, pad: dict[str, Any], said: str
) -> None:
    with pytest.raises(DesignError, match=said):
        schedule(stack(15), PAPER.with_(press=pad))


def test_a_stack_too_high_for_every_pad_is_named() -> None:
    high = StackShape(height=50.0, area=250.0, rim=60.0, below=0.0)
    with pytest.raises(DesignError, match=r"stack 50.000 mm high .* \(stack.balloons\)"):
        pad_thickness(Press(), [high])


def test_a_pad_that_does_not_reach_the_base_plate_is_refused() -> None:
    # A quarter of the platen lies 2 mm high under 3 mm of hard rubber.
    wide = StackShape(height=2.0, area=5800.0, rim=300.0, below=0.0)
    with pytest.raises(DesignError, match="the films take the whole force, 440 kPa"):
        pad_thickness(Press(**rubber(3.0, 60.0)), [wide])


def test_a_pad_has_its_own_heat_limit(stack: Stack) -> None:
    with pytest.raises(DesignError, match="exceeds the limit of a press pad of silicone sponge"):
        schedule(stack(2), PAPER.with_("press.temperature_c=210"))


def test_every_step_lists_platen_to_platen(stack: Stack) -> None:
    # Base, cap and stacks are laid by hand in steps 2 and 4, and the separator masks in step 3.
    for step in press_json(schedule(stack(15), PAPER))["steps"]:
        parts = [item["part"] for item in step["build_up"]]
        paper = [] if step["step"] == 1 else ["underlay"]
        films = ["release film", "laminate", "release film"]
        assert parts == ["base plate", *paper, *films, "press pad"]
        assert all(i["thickness_mm"] == 0.1 for i in step["build_up"] if i["part"] == "underlay")
        assert step["build_up"][0]["size_mm"] == step["build_up"][-1]["size_mm"] == [152.4, 152.4]
        assert step["film_kpa"] > step["pressure_kpa"] >= step["plate_kpa"]
        assert step["pressure_basis"].startswith("estimate: ")
