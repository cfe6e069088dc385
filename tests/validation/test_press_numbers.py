"""The paper's press schedule for its 3-DoF actuator (paper Sec. 2)."""

from __future__ import annotations

import pytest

from sbafab.actuators import build, load_design
from sbafab.pressing.schedule import Schedule, schedule


@pytest.fixture
def plan() -> Schedule:
    design = load_design("3dof-15mm")
    return schedule(build(design), design)


def test_four_steps_of_3_12_10_and_20_minutes(plan: Schedule) -> None:
    assert [step.minutes for step in plan.steps] == [3, 12, 10, 20]
    assert plan.total_press_minutes == 45


def test_110_kpa_on_the_whole_platen_are_2_555_kn(plan: Schedule) -> None:
    for step in plan.steps:
        assert step.temperature_c == 135
        assert step.pressure_kpa == 110
        assert step.force_n / 1000 == pytest.approx(2.555, abs=0.0005)


def test_which_layers_each_step_adds(plan: Schedule) -> None:
    assert [step.adds for step in plan.steps] == [(2, 3), (1,), tuple(range(4, 59)), (59,)]


def test_pins_are_in_for_flash_bonds_and_out_for_full_ones(plan: Schedule) -> None:
    assert [step.bond for step in plan.steps] == ["flash", "full", "flash", "full"]
    assert [bool(step.pins) for step in plan.steps] == [True, False, True, False]
