"""The paper's four steps (Sec. 2): which stacks meet in which step, and on which pins."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sbafab.actuators import build, load_design
from sbafab.geometry.region import disc
from sbafab.laminate.laminate import Laminate, Pin
from sbafab.laminate.lay_up import LayUpStep, press_steps

AXIS = (0.0, 0.0)


@pytest.fixture(scope="module")
def laminate() -> Laminate:
    return build(load_design("1dof-5mm", ["stack.balloons=3"]))


def told(step: LayUpStep) -> tuple[object, ...]:
    pins = [pin.name for pin in step.pins]
    return step.number, step.name, step.bond, step.stacks, step.adds, pins


def test_three_balloons_take_four_steps(laminate: Laminate) -> None:
    middle = (4, 5, 6, 7, 8, 9, 10)
    assert [told(step) for step in press_steps(laminate)] == [
        (1, "flash_bottom", "flash", ((2, 3),), (2, 3), ["chamber1"]),
        (2, "bond_bottom", "full", ((1,), (2, 3)), (1,), []),
        (3, "flash_middle", "flash", (middle,), middle, ["chamber1"]),
        (4, "bond_all", "full", ((1, 2, 3), middle, (11,)), (11,), []),
    ]


def test_middle_first_takes_two_steps(laminate: Laminate) -> None:
    core = (2, 3, 4, 5, 6, 7, 8, 9, 10)
    turned = replace(laminate, middle_first=True)
    assert [told(step) for step in press_steps(turned)] == [
        (1, "flash_middle", "flash", (core,), core, ["chamber1"]),
        (2, "bond_all", "full", ((1,), core, (11,)), (1, 11), []),
    ]
    # A balloon alone has too few layers between base and cap.
    single = replace(turned, layers=laminate.layers[:3])
    assert [step.name for step in press_steps(single)] == ["flash_bottom", "bond_bottom"]


def test_what_lies_under_the_base_joins_last() -> None:
    radial = build(load_design("radial-15mm", ["stack.balloons=2"]))
    channels = ["channel1", "channel2", "channel3"]
    # Sheet and its separator below the base, which is the third layer.
    assert [told(step) for step in press_steps(radial)] == [
        (1, "flash_bottom", "flash", ((4, 5),), (4, 5), channels),
        (2, "bond_bottom", "full", ((3,), (4, 5)), (3,), []),
        (3, "flash_middle", "flash", ((6, 7, 8),), (6, 7, 8), channels),
        (4, "bond_all", "full", ((1, 2), (3, 4, 5), (6, 7, 8), (9,)), (1, 2, 9), []),
    ]


def test_layers_without_a_base_start_from_the_lowest_film(laminate: Laminate) -> None:
    walls = replace(
        laminate,
        layers=tuple(replace(layer, index=i) for i, layer in enumerate(laminate.layers[4:7], 1)),
    )
    assert [step.stacks for step in press_steps(walls)] == [((2, 3),), ((1,), (2, 3))]


def test_a_pin_that_a_film_covers_stays_out(laminate: Laminate) -> None:
    layers = list(laminate.layers)
    layers[2] = replace(layers[2], profile=disc(AXIS, 3.25), pattern="closed")
    closed = replace(laminate, layers=tuple(layers))
    assert [len(step.pins) for step in press_steps(closed)] == [0, 0, 1, 0]


def on_ears(laminate: Laminate, pins_in: bool) -> Laminate:
    holed = [
        replace(layer, profile=layer.profile - disc((2.0, 1.0), 0.5), pattern=f"e{layer.index}")
        for layer in laminate.layers
    ]
    ear = Pin("ear", (2.0, 1.0), 1.0)
    return replace(
        laminate,
        layers=tuple(holed),
        pins=(ear,),
        registration="ears",
        pins_in_full_bonds=pins_in,
    )


def test_pins_of_ears_are_in_every_time_where_asked_for(laminate: Laminate) -> None:
    eared = on_ears(laminate, pins_in=True)
    assert [step.pins for step in press_steps(eared)] == [eared.pins] * 4


def test_ears_are_tacked_on_their_pins_and_fully_bonded_without(laminate: Laminate) -> None:
    eared = on_ears(laminate, pins_in=False)
    steps = press_steps(eared)
    assert [step.bond for step in steps] == ["flash", "flash", "full", "flash", "flash", "full"]
    assert [bool(step.pins) for step in steps] == [True, True, False, True, True, False]
    # Every layer joins once, in the step that has the pins; a full bond presses what was tacked.
    added = [index for step in steps for index in step.adds]
    assert sorted(added) == [layer.index for layer in eared.layers]
    for tack, full in ((steps[1], steps[2]), (steps[4], steps[5])):
        assert (full.adds, full.stacks) == ((), (tack.layers,))
