"""Control charts, capability and gauge study against published worked examples."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from sbafab.errors import DesignError
from sbafab.results.control_charts import (
    ControlLimits,
    Signal,
    capability,
    defects_chart,
    ewma_chart,
    individuals_chart,
    moving_range_chart,
    proportions_chart,
    western_electric,
)
from sbafab.results.gauge_study import GaugeReading, gauge_study, read_readings

FLOW = (49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1)
"""NIST/SEMATECH e-Handbook, 6.3.2.2."""
WAFERS = (
    *(12, 15, 8, 10, 4, 7, 16, 9, 14, 10, 5, 6, 17, 12, 22),
    *(8, 10, 5, 13, 11, 20, 18, 24, 15, 9, 12, 7, 13, 9, 6),
)
"""Misregistered chips of 50 on each of 30 wafers, 6.3.3.2."""
DEFECTS = (
    *(16, 14, 28, 16, 12, 20, 10, 12, 10, 17, 19, 17, 14),
    *(16, 15, 13, 14, 16, 11, 20, 11, 19, 16, 31, 13),
)
"""Defects on each of 25 wafers, 6.3.3.1."""
EWMA_DATA = (
    *(52.0, 47.0, 53.0, 49.3, 50.1, 47.0, 51.0, 50.1, 51.2, 50.5),
    *(49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1),
)
EWMA = (
    *(50.60, 49.52, 50.56, 50.18, 50.16, 49.21, 49.75, 49.85, 50.26, 50.33),
    *(50.11, 49.36, 49.52, 50.05, 49.38, 49.92, 50.73, 51.23, 51.94, 51.99),
)
"""6.3.2.4, weight 0.3, target 50, sigma 2.0539: limits 52.5884 and 47.4115."""


def test_individuals_and_moving_range_are_the_handbooks() -> None:
    chart, ranges = individuals_chart(FLOW), moving_range_chart(FLOW)
    assert chart.centre[0] == pytest.approx(50.81)
    assert ranges.centre[0] == pytest.approx(1.8778, abs=5e-5)
    assert (chart.upper[0], chart.lower[0]) == pytest.approx((55.8041, 45.8159), abs=1e-4)
    assert chart.signals == ()
    assert ranges.upper[0] == pytest.approx(3.267 * 1.8778, abs=1e-3)


def test_proportions_are_the_handbooks() -> None:
    chart = proportions_chart(WAFERS, [50] * 30)
    assert chart.centre[0] == pytest.approx(0.2313, abs=5e-5)
    assert (chart.upper[0], chart.lower[0]) == pytest.approx((0.4102, 0.0524), abs=1e-4)
    beyond = [signal.point + 1 for signal in chart.signals if signal.rule == 1]
    assert beyond == [15, 23], "the wafers that the handbook names"


def test_counts_are_the_handbooks() -> None:
    chart = defects_chart(DEFECTS, [1] * 25)
    assert (chart.centre[0], chart.lower[0], chart.upper[0]) == pytest.approx((16, 4, 28))
    assert [s.point + 1 for s in chart.signals if s.rule == 1] == [24]


def test_limits_of_groups_follow_their_size() -> None:
    """N = 4 and 16 at p = 0.5: 3 sigma are 0.75 and 0.375."""
    chart = proportions_chart([2, 8], [4, 16])
    assert chart.upper == pytest.approx((1.0, 0.875))
    assert chart.lower == pytest.approx((0.0, 0.125))
    assert defects_chart([4, 16], [4, 16]).upper == pytest.approx((2.5, 1.75))


def test_the_average_is_the_handbooks() -> None:
    chart = ewma_chart(EWMA_DATA, 50.0, 2.0539, 0.3)
    assert chart.values == pytest.approx(EWMA, abs=6e-3)
    assert (chart.upper[-1], chart.lower[-1]) == pytest.approx((52.5884, 47.4115), abs=2e-3)
    # The first average is 0.3 x + 0.7 target, whose deviation is 0.3 sigma.
    assert chart.upper[0] == pytest.approx(50 + 3 * 0.3 * 2.0539)
    assert chart.signals == ()


@pytest.mark.parametrize(
    ("z", "signals"),
    [
        ([0.1, 3.1, 0.1], [Signal(1, 1)]),
        ([0.1, -3.1, 0.1], [Signal(1, 1)]),
        ([2.1, 0.0, 2.1], [Signal(2, 2)]),
        ([2.1, 0.0, -2.1], []),
        ([2.1, 0.0, 0.0, 2.1], []),
        ([1.1, 1.1, -0.5, 1.1, 1.1], [Signal(4, 3)]),
        ([1.1, 1.1, 1.1, -0.5, -0.5, 1.1], []),
        ([0.1] * 8, [Signal(7, 4)]),
        ([0.1] * 7 + [-0.1] * 7, []),
    ],
)
def test_each_rule_of_western_electric(z: list[float], signals: list[Signal]) -> None:
    assert list(western_electric(z)) == signals


def test_a_stable_process_signals_once_in_92_points() -> None:
    """Champ and Woodall (1987): a mean run length of 91.75."""
    dice = random.Random(33)
    lengths = []
    for _ in range(600):
        z = [dice.gauss(0, 1) for _ in range(1500)]
        lengths.append(next(western_electric(z)).point + 1)
    # The deviation of a run's length is about its mean.
    assert sum(lengths) / 600 == pytest.approx(91.75, abs=3 * 92 / 600**0.5)


def test_capability_is_the_textbooks() -> None:
    """Montgomery, Introduction to Statistical Quality Control, examples 8.4 and 8.5, n = 20."""
    unit = [(n - 9.5) / 9.5 for n in range(20)]
    scale = (sum(x * x for x in unit) / 19) ** 0.5
    wide = capability([50 + 1.75 * x / scale for x in unit], ControlLimits(38, 62))
    assert wide.cp == pytest.approx(2.29, abs=5e-3)
    assert wide.cp_interval == pytest.approx((1.57, 3.01), abs=1e-2)
    narrow = capability([x / scale for x in unit], ControlLimits(None, 3 * 1.33))
    assert (narrow.cp, narrow.cpk) == (None, pytest.approx(1.33))
    assert narrow.cpk_interval == pytest.approx((0.88, 1.78), abs=1e-2)


def test_capability_of_the_handbook() -> None:
    """6.1.6: limits 8 and 20, mean 16, deviation 2: Cp 1.0, Cpk 0.6667."""
    values = [16 - 2 * (2 / 3) ** 0.5, 16, 16, 16 + 2 * (2 / 3) ** 0.5]
    scale = (sum((v - 16) ** 2 for v in values) / 3) ** 0.5
    state = capability([16 + 2 * (v - 16) / scale for v in values], ControlLimits(8, 20))
    assert (state.cp, state.cpk) == pytest.approx((1.0, 0.6667), abs=1e-4)


GAUGE = {
    "A": (
        (0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36),
        (0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25),
        (0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31),
    ),
    "B": (
        (0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68),
        (0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62),
        (0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50),
    ),
    "C": (
        (0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49),
        (-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77),
        (-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16),
    ),
}
"""AIAG, Measurement Systems Analysis: three appraisers, three trials, ten parts."""
READINGS = [
    GaugeReading(str(part), operator, value)
    for operator, trials in GAUGE.items()
    for trial in trials
    for part, value in enumerate(trial, start=1)
]


def test_the_gauge_study_is_the_manuals() -> None:
    study = gauge_study(READINGS)
    squares = {row.source: row.sum_of_squares for row in study.rows}
    assert squares == pytest.approx(
        {"parts": 88.3619, "operators": 3.1673, "interaction": 0.3590, "error": 2.7589}, abs=1e-4
    )
    by_name = {row.source: row for row in study.rows}
    assert [by_name[n].degrees for n in ("parts", "operators", "interaction", "error")] == [
        *(9, 2, 18, 60)
    ]
    assert by_name["interaction"].f == pytest.approx(0.434, abs=1e-3)
    assert study.is_pooled
    deviations = study.repeatability, study.operators, study.gauge, study.parts, study.total
    expected = (0.199933, 0.226838, 0.302373, 1.042327, 1.085301)
    assert deviations == pytest.approx(expected, abs=2e-5)
    assert study.interaction == 0
    assert study.share == pytest.approx(0.279, abs=1e-3)
    assert (study.categories, study.verdict) == (4, "marginal")


def test_readings_come_from_a_table(tmp_path: Path) -> None:
    path = tmp_path / "gauge.csv"
    rows = [f"{r.part};{r.operator};1;{str(r.reading).replace('.', ',')}" for r in READINGS]
    path.write_text("part;operator;trial;reading\n" + "\n".join(rows))
    assert read_readings(path) == READINGS
    for text, says in (
        ("part,reading\n1,2\n", "needs the columns part, operator, trial, reading"),
        ("part,operator,trial,reading\n1,A,1,x\n", "line 2: part '1', operator 'A', reading 'x'"),
    ):
        path.write_text(text)
        with pytest.raises(DesignError, match=says):
            read_readings(path)
    with pytest.raises(DesignError, match="part 10 has 2 readings by C"):
        gauge_study(READINGS[:-1])
    with pytest.raises(DesignError, match="two parts and two operators"):
        gauge_study(READINGS[:30])


def test_limits_of_a_baseline_are_those_of_its_points_alone() -> None:
    """The handbook's limits stay where the process shifts after them, and show it."""
    shifted = [*FLOW, *(value + 10 for value in FLOW[:4])]
    chart, ranges = individuals_chart(shifted, len(FLOW)), moving_range_chart(shifted, len(FLOW))
    assert (chart.upper[0], chart.lower[0]) == pytest.approx((55.8041, 45.8159), abs=1e-4)
    assert {signal.point for signal in chart.signals if signal.rule == 1} >= {10, 11, 12, 13}
    assert ranges.centre[0] == pytest.approx(1.8778, abs=5e-5)
    wafers = proportions_chart([*WAFERS, 40], [50] * 31, 30)
    assert (wafers.upper[-1], wafers.lower[-1]) == pytest.approx((0.4102, 0.0524), abs=1e-4)
    assert wafers.signals[-1].point == 30
    defects = defects_chart([*DEFECTS, 90], [1] * 26, 25)
    assert defects.centre == pytest.approx((sum(DEFECTS) / 25,) * 26)
