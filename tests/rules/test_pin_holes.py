"""pin-holes: what it says of pins without holes, holes without pins and film in a pin's way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.geometry.region import Region, disc, rectangle
from sbafab.laminate.laminate import Laminate, Pin
from sbafab.rules import pin_holes
from sbafab.rules.deck import run_deck
from sbafab.rules.finding import Finding
from sbafab.rules.measures import Measures
from tests.designs import PAPER, errors

Good = Callable[..., Laminate]
Spoil = Callable[..., Laminate]
EARS = 'registration.method="ears"'
LIMITS = PAPER.with_(registration=errors(), rules={"yield_builds": 100})


def found(laminate: Laminate) -> Finding:
    (finding,) = pin_holes.check(Measures(laminate, LIMITS))
    return finding


def failing(laminate: Laminate) -> set[str]:
    return {f.rule for f in run_deck(laminate, LIMITS) if f.verdict == "fail"}


@pytest.mark.parametrize(
    "design",
    [
        ("1dof-5mm",),
        ("1dof-5mm", "stack.balloons=1"),
        ("3dof-15mm", "stack.balloons=2"),
        ("radial-15mm",),
        ("radial-15mm", "stack.balloons=2", "inlet.manifold=true"),
        ("1dof-5mm", "stack.balloons=3", EARS),
        ("1dof-5mm", "stack.balloons=1", EARS),
        ("3dof-15mm", "stack.balloons=2", "chamber.count=6", EARS),
        ("radial-15mm", "stack.balloons=2", EARS),
        ("radial-15mm", "inlet.manifold=true", EARS),
    ],
)
def test_sound_designs_pass(design: tuple[str, ...], good: Good) -> None:
    assert (found(good(*design)).verdict, found(good(*design)).measured) == ("pass", 0.0)


def test_no_pin_is_no_fault_of_channel_pins(good: Good) -> None:
    laminate = good("radial-15mm")
    assert not laminate.pins
    assert found(laminate).message == "no pin holds a layer"


def test_a_pin_that_no_layer_has_a_hole_for(good: Good) -> None:
    laminate = good("1dof-5mm", "stack.balloons=3", EARS)
    laminate = replace(laminate, pins=(*laminate.pins, Pin("film3", (30.0, 1.0), 1.5)))
    assert failing(laminate) == {"pin-holes"}
    finding = found(laminate)
    assert finding.measured == 1.0
    assert finding.message.startswith("the pin film3 at x 30.000, y 1.000 finds a hole in no layer")


def test_ears_that_vanished_from_all_films(good: Good) -> None:
    """The plate is drilled for them; where no hole tells an ear, its bond past the mask counts."""
    laminate = good("1dof-5mm", "stack.balloons=3", EARS)
    tools = [pin for pin in laminate.pins if pin.name.startswith("film")]

    def earless(profile: Region) -> Region:
        for pin in tools:
            profile = profile | disc(pin.centre, 0.8)
        return profile

    layers = tuple(
        layer
        if layer.is_mask
        else replace(layer, profile=earless(layer.profile), pattern=f"{layer.pattern}x")
        for layer in laminate.layers
    )
    laminate = replace(laminate, layers=layers)
    assert failing(laminate) == {"pin-holes", "facing-films"}
    assert "hangs on no pin in step 1" in found(laminate).message
    # Three patterns of film (tabbed base, tabbed wall, wall, cap) hang on nothing, two pins idle.
    assert found(laminate).measured >= 5


def test_one_film_without_the_hole_of_the_others(good: Good, spoil: Spoil) -> None:
    laminate = good("1dof-5mm", "stack.balloons=3", EARS)
    (pin,) = (pin for pin in laminate.pins if pin.name == "film1")
    wall = laminate.layer(5).profile | disc(pin.centre, 0.8)
    finding = found(spoil(laminate, 5, wall))
    assert finding.where.layers == (5,)
    assert finding.message.startswith("layer 5 (005_TPE_wall) has no hole for the pin film1 at")


@pytest.mark.parametrize("aside", [0.0, 0.6])
def test_film_in_the_way_of_a_pin(aside: float, good: Good, spoil: Spoil) -> None:
    """A wall that reaches over the pin of the mask's tail, or half over it."""
    laminate = good("1dof-5mm", "stack.balloons=3", EARS)
    (pin,) = (pin for pin in laminate.pins if pin.name == "strip1")
    x, y = pin.centre
    over = laminate.layer(3).profile | rectangle((x - 6, y + aside), (x + 6, y + 3))
    finding = found(spoil(laminate, 3, over))
    assert finding.verdict == "fail"
    blocked = [miss.fault for miss in pin_holes._blocked(spoil(laminate, 3, over))]
    assert any(
        what.startswith("layer 3 (003_TPE_wall) stands in the way of the pin strip1")
        and what.endswith("which layer 2 is laid on in step 1")
        for what in blocked
    )


def test_a_blocked_bore_is_told_by_channel_clear(good: Good, spoil: Spoil) -> None:
    laminate = good("1dof-5mm", "stack.balloons=3")
    assert found(spoil(laminate, 6, disc((0.0, 0.0), 2.5))).verdict == "pass"
