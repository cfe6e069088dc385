"""Ears: pinned in every step, nothing flush, and on the pins in one position only."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from sbafab.actuators import build, load_design
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.output.run import check
from sbafab.output.settings import press_settings
from sbafab.pressing.schedule import schedule

DESIGNS = [
    ("1dof-5mm", []),
    ("1dof-10mm", ["stack.balloons=2"]),
    ("1dof-5mm", ["stack.balloons=3", "chamber.diameter=[10, 5.5, 6]"]),
    ("3dof-15mm", []),
    *(("3dof-15mm", ["stack.balloons=3", f"chamber.count={n}"]) for n in (2, 4, 5, 6, 7, 8)),
    ("radial-15mm", []),
    ("radial-15mm", ["stack.balloons=3"]),
    ("radial-15mm", ["stack.balloons=2", "inlet.manifold=true"]),
]
SYMMETRIES: dict[str, Callable[[Point], Point]] = {
    "turned 90": lambda p: (-p[1], p[0]),
    "turned 180": lambda p: (-p[0], -p[1]),
    "turned 270": lambda p: (p[1], -p[0]),
    "flipped about x": lambda p: (p[0], -p[1]),
    "flipped about y": lambda p: (-p[0], p[1]),
    "flipped about y = x": lambda p: (p[1], p[0]),
    "flipped about y = -x": lambda p: (-p[1], -p[0]),
}


def eared(name: str, assignments: list[str]) -> Laminate:
    return build(load_design(name, [*assignments, 'registration.method="ears"']))


def tooling_holes(laminate: Laminate, layer: Layer) -> list[Point]:
    return [
        pin.centre
        for pin in laminate.pins_holding(layer)
        if not pin.name.startswith(("chamber", "channel"))
    ]


@pytest.mark.parametrize(("name", "assignments"), DESIGNS)
def test_nothing_fails_and_nothing_is_waived(name: str, assignments: list[str]) -> None:
    design = load_design(name, [*assignments, 'registration.method="ears"'])
    _, findings = check(design)
    for finding in findings:
        # Chamber masks have one pin each, or none, and the registration rules say what that costs.
        allowed = {"pass", "warn"} if finding.rule.startswith("registration-") else {"pass"}
        assert finding.verdict in allowed, finding.message


@pytest.mark.parametrize(("name", "assignments"), DESIGNS)
def test_every_film_and_separator_has_two_tooling_holes_a_part(
    name: str, assignments: list[str]
) -> None:
    laminate = eared(name, assignments)
    for layer in laminate.layers:
        expected = 0 if layer.role == "chamber-mask" else 2
        if layer.role not in ("chamber-mask", "sheet") and laminate.family == "radial":
            expected *= 3
        assert len(tooling_holes(laminate, layer)) == expected, layer.name


@pytest.mark.parametrize(("name", "assignments"), DESIGNS)
def test_the_two_ears_of_a_part_stand_at_unequal_distances(
    name: str, assignments: list[str]
) -> None:
    laminate = eared(name, assignments)
    for first, second in (("film1", "film2"), ("mask1", "mask2"), ("sheet1", "sheet2")):
        ends = [pin.centre for pin in laminate.pins if pin.name in (first, second)]
        if len(ends) == 2:
            assert abs(math.hypot(*ends[0]) - math.hypot(*ends[1])) > 0.5


@pytest.mark.parametrize("symmetry", SYMMETRIES)
@pytest.mark.parametrize(("name", "assignments"), DESIGNS)
def test_no_layer_goes_on_the_pins_turned_or_flipped(
    name: str, assignments: list[str], symmetry: str
) -> None:
    laminate = eared(name, assignments)
    moved = SYMMETRIES[symmetry]
    placed = {
        layers[0].name: tooling_holes(laminate, layers[0]) for layers in laminate.patterns.values()
    }
    for layer, holes in placed.items():
        if not holes:
            continue
        # Against every layer as it should lie: its holes are where its pins stand.
        for other, pins in placed.items():
            fits = bool(pins) and all(
                min(math.dist(moved(hole), pin) for pin in pins) < 0.75 for hole in holes
            )
            assert not fits, f"{layer} {symmetry} goes on the pins of {other}"


@pytest.mark.parametrize(("name", "assignments"), DESIGNS)
def test_two_pins_hold_base_and_cap_in_every_step(name: str, assignments: list[str]) -> None:
    design = load_design(name, [*assignments, 'registration.method="ears"'])
    laminate = build(design)
    for step in schedule(laminate, press_settings(design)).steps:
        for index in step.layers:
            layer = laminate.layer(index)
            if layer.role in ("base", "cap", "wall", "separator-mask", "sheet"):
                held = [pin.name for pin in laminate.pins_holding(layer) if pin.name in step.pins]
                assert len(held) >= 2, (step.title, layer.name)


def test_lumen_still_clears_2_and_chambers_keep_one_bond() -> None:
    laminate = eared("3dof-15mm", [])
    separator = next(layer for layer in laminate.layers if layer.role == "separator-mask")
    wall = laminate.layer(7)
    radii = {
        layer.role: next(
            hole.circle[1]
            for hole in layer.profile.holes
            if hole.circle is not None and math.hypot(*hole.circle[0]) < 1e-6
        )
        for layer in (separator, wall)
    }
    assert radii == pytest.approx({"separator-mask": 1.0, "wall": 1.5})
    assert math.hypot(*laminate.bores[0].centre) == pytest.approx(1.0 + 0.5 + 0.75 + 2.5)


def test_a_bore_that_needs_more_room_is_refused() -> None:
    with pytest.raises(DesignError, match="make the bore less than"):
        eared("1dof-5mm", ["bore.diameter=2.6"])
