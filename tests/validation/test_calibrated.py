"""Calibration files, and the intervals that follow from one."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w

import sbafab
from sbafab.errors import DesignError
from sbafab.models.balloon import inflate
from sbafab.models.balloon_map import balloon_map
from sbafab.models.calibration import (
    FIELDS,
    SHARED,
    UNKNOWNS,
    ModelCalibration,
    Uncertainty,
    calibration_of,
    deviations,
    factors_of,
    load_calibration,
    read_calibration,
)
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Balloon


@pytest.fixture(scope="module")
def paper() -> ModelCalibration:
    calibration = load_calibration("paper")
    assert calibration is not None
    return calibration


def test_half_widths_of_the_normal_distribution() -> None:
    assert deviations(0.9) == pytest.approx(1.6448536)
    assert deviations(0.6826895) == pytest.approx(1.0, abs=1e-6)


def test_an_interval_holds_posterior_and_discrepancy(paper: ModelCalibration) -> None:
    """By hand: a slope of -0.5 by the logarithm of the modulus ratio, and the motion's miss."""
    variance = 0.25 * paper.covariance[0][0] + paper.discrepancy["motion"] ** 2
    low, high = Uncertainty(paper).interval("motion", 10.0, (-0.5, 0.0, 0.0), is_log=True)
    assert math.log(high / 10) == pytest.approx(1.6448536 * math.sqrt(variance))
    assert low * high == pytest.approx(100.0)
    plain = Uncertainty(paper).interval("motion", 10.0, (0.0, 0.0, 0.0), is_log=False)
    assert plain[1] - 10 == pytest.approx(16.448536 * paper.discrepancy["motion"])


def test_correlated_unknowns_take_part_of_each_others_variance(paper: ModelCalibration) -> None:
    """Slopes along the ridge that the evidence leaves cancel; across it they add up."""
    ratio, loss = (math.sqrt(paper.covariance[i][i]) for i in (0, 1))

    def width(slopes: tuple[float, float]) -> float:
        low, high = Uncertainty(paper).interval("motion", 1.0, slopes, is_log=True)
        return math.log(high / low)

    alone = math.hypot(1.6448536 * 2 * math.sqrt(2), width((0.0, 0.0)))
    assert paper.covariance[0][1] < 0
    assert width((1 / ratio, 1 / loss)) < alone < width((1 / ratio, -1 / loss))


def test_a_measured_value_narrows_what_is_predicted_of_that_actuator(
    paper: ModelCalibration,
) -> None:
    """By the textbook's conditional normal, of a force that depends on the pocket loss alone."""
    slope, error, missed = -3.0, 0.02, 0.1
    rates = Uncertainty(paper).rates("force", (0.0, slope, 0.0))
    own = np.array([math.hypot(Uncertainty(paper).own_miss("force"), error)])
    built = Uncertainty(paper).conditioned(rates[None], np.array([missed]), own)
    variance, miss = paper.covariance[1][1], paper.discrepancy["force"] ** 2
    total = slope**2 * variance + miss + error**2
    shift = variance * slope / total * missed
    assert built.calibration.mean[1] == pytest.approx(paper.mean[1] + shift)
    assert built.calibration.covariance[1][1] == pytest.approx(
        variance - (variance * slope) ** 2 / total
    )
    assert math.log(built.factor("force")) == pytest.approx(SHARED * miss / total * missed)
    assert Uncertainty(paper).factor("force") == 1.0

    # Another force of the same rates: variance of sum of loss and what both miss in common.
    common = slope**2 * variance + SHARED * miss
    spread = math.sqrt(common - common**2 / total + (1 - SHARED) * miss)
    low, high = built.interval("force", 5.0, (0.0, slope, 0.0), is_log=True)
    assert math.log(high / low) == pytest.approx(2 * 1.6448536 * spread)
    wide = Uncertainty(paper).interval("force", 5.0, (0.0, slope, 0.0), is_log=True)
    assert high / low < wide[1] / wide[0]


def test_values_lie_within_the_intervals_of_the_unknowns(paper: ModelCalibration) -> None:
    for unknown in UNKNOWNS:
        low, high = paper.bounds(unknown.field)
        assert unknown.least <= low < paper.values[unknown.field] < high <= unknown.most


def test_a_known_weight_on_the_tip_is_exact(paper: ModelCalibration) -> None:
    row = FIELDS.index("tip_load")
    given, probed = Uncertainty(paper, tip_load=2.0), Uncertainty(paper, tip_load=None)
    assert given.factors.tip_load == 2.0
    assert probed.factors.tip_load == pytest.approx(paper.values["tip_load"])
    assert given.factors.pocket_loss == probed.factors.pocket_loss
    assert given.shifted()[row][0] == 0 != probed.shifted()[row][0]
    assert min(abs(change) for change, _ in given.shifted()[:row]) > 0


def test_another_film_has_the_priors_modulus_ratio(paper: ModelCalibration) -> None:
    films = {"tpe": {"product": "TPU 50", "thickness": 0.05, "modulus": 20.0, "poisson": 0.4}}
    other = calibration_of(sbafab.load("1dof-5mm", films=films, models={"calibration": "paper"}))
    assert other is not None
    assert other.values["modulus_ratio"] == 1.0
    assert other.covariance[0][0] == pytest.approx(UNKNOWNS[0].spread ** 2)
    assert other.covariance[0][1] == 0
    assert other.covariance[1][1] == paper.covariance[1][1]


def test_none_leaves_the_film_as_bought() -> None:
    design = sbafab.load("1dof-5mm", models={"calibration": "none"})
    assert calibration_of(design) is None
    assert factors_of(design) == Factors()


def test_an_interval_by_a_closed_form(paper: ModelCalibration) -> None:
    """A value in proportion to the modulus ratio has its variance and the discrepancy's."""
    value, (low, high) = Uncertainty(paper).interval_of(
        "force", lambda factors: 3 * factors.modulus_ratio
    )
    assert value == pytest.approx(3 * paper.values["modulus_ratio"])
    spread = math.sqrt(paper.covariance[0][0] + paper.discrepancy["force"] ** 2)
    assert math.log(high / low) == pytest.approx(2 * 1.6448536 * spread)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"mean": [1.0]}, "has a mean of 1 numbers; it must be 7"),
        ({"covariance": [[1.0] * 7] * 7}, "covariance that is not symmetric and positive definite"),
        ({"discrepancy": {"force": -1}}, "discrepancy.force = -1"),
        ({"unknowns": ["modulus_ratio"]}, "must have the unknowns"),
        # Its press factor is that of whole laminates.
        ({"schema": "sbafab/calibration@1"}, "schema = 'sbafab/calibration@1' must be"),
        # Its forces in bending miss as much as axial ones do.
        ({"schema": "sbafab/calibration@2"}, "schema = 'sbafab/calibration@2' must be"),
        ({"colour": "red"}, "colour"),
        ({"mean": [9.0, 0.1, -0.6, -1.0, -1.0, -3.0, -2.0]}, "mean of modulus_ratio"),
    ],
)
def test_a_faulty_file_gets_one_sentence(
    change: dict[str, object], sentence: str, paper: ModelCalibration, tmp_path: Path
) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(tomli_w.dumps({**paper.as_dict(), **change}))
    with pytest.raises(DesignError) as error:
        read_calibration(path)
    assert sentence in str(error.value)
    assert str(path) in str(error.value)
    assert str(error.value).endswith("; write it again with sbafab calibrate")
    assert "\n" not in str(error.value)
    assert "design file" not in str(error.value)


def test_a_file_is_read_as_it_was_written(paper: ModelCalibration, tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(tomli_w.dumps(paper.as_dict()))
    assert read_calibration(path) == paper
    design = sbafab.load("1dof-5mm", models={"calibration": "lab.toml"}).placed(tmp_path)
    assert calibration_of(design) == paper


def test_a_name_that_is_none_says_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(DesignError, match='neither "none", nor a bundled one'):
        load_calibration("papers", tmp_path)


@pytest.mark.parametrize("ratio", [0.5, 3.0])
def test_a_map_scales_with_the_modulus(ratio: float) -> None:
    """Against balloons of the other modulus, inflated."""
    base = Balloon(neck=1.1, bore=0.35)
    stiff = balloon_map(base, 20.0).stiffened(ratio)
    pressures = np.array([2.0, 8.0]) * ratio
    heights = np.array([0.4, 0.8])
    shapes = inflate(replace(base, modulus=ratio * base.modulus), pressures, heights, tied=True)
    assert stiff.most_pressure == 20 * ratio
    assert stiff.force(pressures, heights) == pytest.approx(shapes.force, rel=0.02)
    assert stiff.volume(pressures, heights) == pytest.approx(shapes.volume, rel=0.02)
