"""Process control of invented lots with known truth: what is charted, and what is named first."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import pytest

from sbafab.errors import DesignError
from sbafab.results.control_charts import ControlLimits
from sbafab.results.history import HistoryEntry
from sbafab.results.process_control import PAGE, ProcessControl, process_control, write_charts
from sbafab.results.records import Build, LabResult
from sbafab.results.store import Lab
from tests.site.formats import hold

Make = Callable[..., Build]
SHA = "c0ffee" + 58 * "0"


def lines(dice: random.Random, number: int, cold_from: int) -> list[HistoryEntry]:
    """A device: from ``cold_from`` on step 1 runs 4 degrees low, and the device leaks.

    Its lot changes at device 13, its operators take turns; neither matters.
    """
    is_cold = number >= cold_from
    entry = HistoryEntry(date=f"2026-05-{3 + (number + 3) // 4:02d}", serial=f"B{number}")
    warm = {"temperature_c": dice.gauss(134.5, 0.6) - 4 * is_cold}
    other = {"temperature_c": dice.gauss(135, 0.6)}
    decision = {"decision": "rework", "reason": "rim"} if is_cold else {"decision": "accept"}
    return [
        replace(entry, item="TPE", lot="L8" if number > 12 else "L7"),
        replace(entry, step="1", readings=warm, initials="AL" if number % 2 else "BO"),
        replace(entry, step="2", readings=other),
        replace(entry, step="leak test", **decision),
    ]


def filled(lab: Lab, build: Build, cold_from: int, seed: int = 5) -> ProcessControl:
    dice = random.Random(seed)
    rows = [line for number in range(1, 25) for line in lines(dice, number, cold_from)]
    lab.add_entries(SHA, build, rows)
    return process_control(lab, {"temperature_c": ControlLimits(130, 140)})


def test_the_step_that_ran_cold_is_named_first(lab: Lab, make_build: Make, tmp_path: Path) -> None:
    control = filled(lab, make_build(), 17)
    assert control.failures == (("leak test", "rim", 8),)
    first = control.suspects[0]
    assert (first.step, first.words[:13]) == ("1", "temperature_c")
    # 8 of 8 below 16 of 16: both orders of 735,471 choices, times the number of tests.
    assert first.p == pytest.approx(2 / 735_471 * len(control.suspects), rel=0.01)
    # 16 sound devices before, none failed, so that no chance of a run is stated.
    assert control.advice[0] == "the last 8 devices failed; of the 16 before, 0% did"
    assert control.advice[1].startswith("look first at step 1: temperature_c")
    assert control.advice[2] == "most failures are recorded at the leak test: 8 of 8"
    assert [str(change) for change in control.changes] == [
        "initials at step 1: AL to BO",
        "lot of TPE: L7 to L8",
    ]
    by_name = {chart_set.name: chart_set for chart_set in control.sets}
    assert list(by_name) == [*("failures by day", "temperature_c, step 1", "temperature_c, step 2")]
    assert by_name["failures by day"].charts[0].values == (0, 0, 0, 0, 1, 1)
    step = by_name["temperature_c, step 1"]
    # The moving range has its first point at device 2; device 17 is the first cold one.
    assert [s.point for s in step.charts[1].signals] == [15]
    assert (12, "lot of TPE: L7 to L8") in step.marks
    assert step.capability is not None
    assert step.capability.cp == pytest.approx(10 / 6 / step.capability.sigma)
    assert by_name["temperature_c, step 2"].charts[0].centre[0] == pytest.approx(135, abs=0.4)
    hold("control", control.as_dict())
    names = write_charts(control, tmp_path / "charts")
    assert names == [*(f"chart-0{n}.svg" for n in (1, 2, 3)), "charts.html", "charts.json"]
    before = {name: (tmp_path / "charts" / name).read_bytes() for name in names}
    write_charts(control, tmp_path / "charts")
    assert before == {name: (tmp_path / "charts" / name).read_bytes() for name in names}
    page = before[PAGE].decode()
    assert "Look first at step 1" in page
    assert "before point 13, lot of TPE: L7 to L8" in page


def test_a_stable_lot_has_no_suspect(lab: Lab, make_build: Make) -> None:
    control = filled(lab, make_build(), 99)
    assert (control.failures, control.suspects, control.advice) == ((), (), ())
    assert control.sets[0].charts[0].values == (0,) * 6


def test_two_failures_at_random_accuse_nobody(lab: Lab, make_build: Make) -> None:
    build = make_build()
    dice = random.Random(1)
    rows = [line for number in range(1, 25) for line in lines(dice, number, 99)]
    chance = ("B5", "B14")
    for place, line in enumerate(rows):
        if line.decision and line.serial in chance:
            rows[place] = replace(line, decision="rework", reason="rim")
    lab.add_entries(SHA, build, rows)
    control = process_control(lab, {})
    assert all(suspect.p > 0.05 for suspect in control.suspects)
    assert control.advice == ("look first where most are recorded at the leak test: 2 of 2",)


def test_a_cycle_of_several_devices_is_one_reading(lab: Lab, make_build: Make) -> None:
    for hour, value in enumerate((134.0, 135.0, 134.0)):
        then = datetime(2026, 5, 4, 8 + hour, tzinfo=UTC)
        step = HistoryEntry(step="1", readings={"temperature_c": value}, note=f"cycle {hour}")
        cycle = [replace(step, serial=f"A{n}") for n in range(4)]
        Lab(lab.path, 1.0, partial(datetime.fromtimestamp, then.timestamp(), UTC)).add_entries(
            SHA, make_build(), cycle
        )
    [chart_set] = process_control(lab, {}).sets
    assert chart_set.charts[0].values == (134.0, 135.0, 134.0)


def test_errors_are_held_against_the_stated_tolerances(lab: Lab, make_build: Make) -> None:
    errors = {"offset_mm": (0.05, 0.1, 0.06, 0.08)}
    lab.add(SHA, make_build(), [LabResult("A1", errors=errors)])
    [chart_set] = process_control(lab, {}).sets
    assert chart_set.capability is not None
    assert chart_set.capability.limits == ControlLimits(None, 0.2)
    with pytest.raises(DesignError, match="nothing is recorded of stroke_mm; recorded are offset"):
        process_control(lab, {"stroke_mm": ControlLimits(16, 18)})


def test_too_few_records_are_one_sentence(lab: Lab, make_build: Make) -> None:
    lab.add(SHA, make_build(), [LabResult("A1", "pass")])
    with pytest.raises(DesignError, match="too few records for a chart"):
        process_control(lab, {})


def test_limits_of_a_baseline_show_a_later_drift(lab: Lab, make_build: Make) -> None:
    """Step 1 runs 4 degrees low from device 17 on, the day 2026-05-08."""
    filled(lab, make_build(), 17)
    control = process_control(lab, {}, "2026-05-07")
    (cold,) = (each for each in control.sets if each.name == "temperature_c, step 1")
    assert cold.baseline == 16
    points = {s.point for s in cold.charts[0].signals if s.rule == 1}
    assert points == set(range(16, 24))
    with pytest.raises(DesignError, match="until 2026-05-01 there are too few points"):
        process_control(lab, {}, "2026-05-01")
