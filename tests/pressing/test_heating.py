"""The time-temperature line against the differential equation it solves, and its blanks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.actuators import build, load_design
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.plate_heating import cool_minutes, warm_minutes
from sbafab.pressing.schedule import Schedule, schedule
from sbafab.pressing.schedule_files import press_csv, press_json

Stack = Callable[..., Laminate]


def plan_of(template: str, *changes: str) -> Schedule:
    design = load_design(template, changes)
    return schedule(build(design), design)


def test_the_line_of_the_papers_films(stack: Stack) -> None:
    """From 20 C between platens at 135: 120 C after ln(115 / 15), 130 C after ln(115 / 5)."""
    plan = schedule(stack(6), load_design("1dof-5mm"))
    for step in plan.steps:
        melting, start, end = step.time_temperature
        assert (melting.point, melting.edge_c) == ("melting point", 120)
        assert melting.after_constants == pytest.approx(math.log(115 / 15), abs=1e-3)
        assert (start.point, start.edge_c) == ("clock starts", 130)
        assert start.after_constants == pytest.approx(math.log(115 / 5), abs=1e-3)
        # Films are above their melting point for ln 3 = 1.1 time constants before the clock starts.
        assert start.after_constants - melting.after_constants == pytest.approx(
            math.log(3), abs=2e-3
        )
        # Nobody has measured the bench's time constant: minutes are blanks.
        assert [p.after_minutes for p in step.time_temperature] == [None] * 3
        assert (end.point, end.edge_c) == ("clock ends", None)


def test_minutes_follow_from_the_time_constant_of_the_bench() -> None:
    """Held against steps of dT/dt = (135 - T) / tau."""
    plan = plan_of("1dof-5mm", "press.time_constant=2.5")
    melting, start, end = plan.steps[2].time_temperature
    edge, minutes, step = 20.0, 0.0, 1e-4
    reached = {}
    while minutes < (end.after_minutes or 0):
        for at in (120.0, 130.0):
            if edge >= at:
                reached.setdefault(at, minutes)
        edge += step * (135 - edge) / 2.5
        minutes += step
    assert melting.after_minutes == pytest.approx(reached[120.0], abs=0.01)
    assert start.after_minutes == pytest.approx(reached[130.0], abs=0.01)
    assert end.after_minutes == pytest.approx(reached[130.0] + 10, abs=0.01)
    assert end.edge_c == pytest.approx(edge, abs=0.05)
    # 135 - 5 exp(-4) = 134.908, said to a tenth.
    assert end.edge_c == 134.9


def test_the_clock_never_starts_below_the_melting_point(stack: Stack) -> None:
    laminate = stack(2)
    films = {layer.film: replace(layer.film, softens_above=132) for layer in laminate.layers}
    layers = [
        layer if layer.is_mask else replace(layer, film=films[layer.film])
        for layer in laminate.layers
    ]
    plan = schedule(replace(laminate, layers=tuple(layers)), load_design("1dof-5mm"))
    assert plan.heating.clock_c == 132
    assert plan.heating.clock_c < plan.heating.platen_c


@pytest.mark.parametrize(
    ("changes", "stated"),
    [
        ((), True),
        (("films.tpe.thickness=0.04",), True),
        (("films.tpe.thickness=0.05",), False),
        (("films.tpe.thickness=0.05", 'press.minutes_for=["Stretchlon 200, 50 um"]'), True),
        (("films.tpe.product=TPU 85A", "films.tpe.thickness=0.05"), False),
        (
            (
                "films.tpe.product=TPU 85A",
                "films.tpe.thickness=0.05",
                'press.minutes_for=["Stretchlon 200, 0.038 mm", "TPU 85A, 0.05 mm"]',
            ),
            True,
        ),
    ],
)
def test_minutes_are_those_of_a_film_that_somebody_stated_them_for(
    changes: tuple[str, ...], stated: bool
) -> None:
    plan = plan_of("1dof-5mm", *changes)
    press = press_json(plan)
    rows = press_csv(plan).splitlines()[1:]
    blank = [warning for warning in plan.warnings if "minutes are blank" in warning]
    if stated:
        assert [step["minutes"] for step in press["steps"]] == [3, 12, 10, 20]
        assert (press["total_press_minutes"], press["estimated_build_minutes"]) == (45, 105)
        assert not blank
        return
    assert [step["minutes"] for step in press["steps"]] == [None] * 4
    assert press["total_press_minutes"] is None is press["estimated_build_minutes"]
    assert all(",152.4,152.4,," in row for row in rows)
    product = "TPU 85A" if "TPU" in changes[0] else "Stretchlon 200"
    assert f'"{product}, 0.05 mm"' in blank[0]
    assert "press.minutes_for" in blank[0]


OWN = ("press.flash_bottom_minutes=4", "press.bond_bottom_minutes=10")
TPU = ("films.tpe.product=TPU 85A", "films.tpe.thickness=0.05")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        # The paper states 3, 12, 10 and 20 minutes at 135 C (Sec. 2).
        (("press.temperature_c=150",), "minutes stated for 135 C, the press is set to 150 C:"),
        (("press.temperature_c=130",), "minutes stated for 135 C, the press is set to 130 C:"),
        (("press.temperature_c=135.5",), "minutes stated for 135 C, the press is set to 135.5 C:"),
        (
            ("press.temperature_c=150", *OWN),
            "minutes of steps 3 and 4 stated for 135 C, the press is set to 150 C:",
        ),
        (
            ("press.temperature_c=150", *OWN, "press.flash_middle_minutes=8"),
            "minutes of step 4 stated for 135 C, the press is set to 150 C:",
        ),
        (("press.temperature_c=135",), ""),
        (OWN, ""),
        (
            (
                *("press.temperature_c=150", *OWN),
                *("press.flash_middle_minutes=8", "press.bond_all_minutes=15"),
            ),
            "",
        ),
        # Blank minutes belong to no temperature; those of a film that a user names are the user's.
        (("press.temperature_c=150", *TPU), ""),
        (("press.temperature_c=150", *TPU, 'press.minutes_for=["TPU 85A, 0.05 mm"]'), ""),
    ],
)
def test_the_papers_minutes_are_those_of_its_temperature(
    changes: tuple[str, ...], words: str
) -> None:
    press = press_json(plan_of("1dof-5mm", *changes))
    found = [text for text in press["warnings"] if "the press is set to" in text]
    assert [text.startswith(words) for text in found] == [True] * bool(words)
    assert all("scrap first" in text for text in found)
    if words:
        assert None not in [step["minutes"] for step in press["steps"]]


def test_an_unknown_melting_point_is_named() -> None:
    plan = plan_of("1dof-5mm", "films.tpe.product=TPU 85A", "films.tpe.thickness=0.038")
    assert plan.heating.melting_c is None
    assert any("no melting point of TPU 85A is known" in warning for warning in plan.warnings)


@pytest.mark.parametrize("method", ["channel-pin", "ears"])
@pytest.mark.parametrize("template", ["1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm"])
def test_every_step_says_how_large_its_laminate_is(template: str, method: str) -> None:
    design = load_design(template, [f"registration.method={method}"])
    laminate = build(design)
    plan = schedule(laminate, design)
    for step in plan.steps:
        (size,) = [part.size_mm for part in step.build_up if part.part == "laminate"]
        assert 0 < min(size) <= max(size) <= 152.4
    # The last step presses all: at least as large as every layer of it.
    for layer in laminate.layers:
        low_x, low_y, high_x, high_y = layer.profile.bounds
        assert high_x - low_x <= size[0] + 1e-6
        assert high_y - low_y <= size[1] + 1e-6


@pytest.mark.parametrize("plate", [6.0, 12.0])
def test_a_plate_warms_and_cools_as_a_lump_followed_second_by_second(plate: float) -> None:
    heat = 7850 * 490 * plate / 1000  # J/(m2 K)
    warm, seconds = 20.0, 0
    while warm < 130:
        warm += 500 * (135 - warm) / heat
        seconds += 1
    assert warm_minutes(plate, 135) == pytest.approx(seconds / 60, rel=0.04)
    cold, seconds = 135.0, 0
    while cold > 40:
        cold -= 2 * 10 * (cold - 20) / heat
        seconds += 1
    assert cool_minutes(plate, 135) == pytest.approx(seconds / 60, rel=0.04)
