"""Predictions of one built actuator, and with a weight on its tip."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

import sbafab
from sbafab.errors import DesignError
from sbafab.models.figures import Prediction
from sbafab.models.stack import GRAVITY
from tests.validation.commands import run_predict

NAME = "3dof-15mm"


def width(found: Prediction, quantity: str, **at: float) -> float:
    """The half width of a figure's interval, as a factor."""
    figure = found.figure(quantity, **at)
    assert figure.interval is not None
    low, high = figure.interval
    return math.sqrt(high / low)


@pytest.fixture(scope="module")
def before() -> Prediction:
    return sbafab.predict(NAME, pressures_kpa=[10, 100])


def test_a_measured_value_narrows_what_hangs_on_it_and_draws_figures_towards_it(
    before: Prediction,
) -> None:
    predicted = before.value("free_height", kpa=10)
    texts = [f"height@10kPa={1.1 * predicted}mm"]
    found = sbafab.predict(NAME, pressures_kpa=[10, 100], measured=texts)
    assert found.asked.measured_texts == texts
    assert predicted < found.value("free_height", kpa=10) < 1.1 * predicted
    for quantity, at in (("free_stroke", {"kpa": 10}), ("bend", {"kpa": 10, "chambers": 1})):
        assert width(found, quantity, **at) < 0.92 * width(before, quantity, **at)
    force = {"kpa": 100, "share": 0.75}
    assert width(found, "blocked_force", **force) < width(before, "blocked_force", **force)
    assert [figure.interval for figure in found.before] == [
        figure.interval for figure in before.figures
    ]


def test_a_value_as_predicted_moves_nothing_and_narrows(before: Prediction) -> None:
    predicted = before.value("blocked_force", kpa=100, share=0)
    found = sbafab.predict(
        NAME, pressures_kpa=[10, 100], measured=[f"force@0mm@100kPa={predicted}N"]
    )
    assert found.value("blocked_force", kpa=100, share=0) == pytest.approx(predicted, rel=1e-5)
    assert width(found, "blocked_force", kpa=100, share=0) < 1.25


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("stroke@10kPa", "has no value"),
        ("stroke@10kPa=0mm", "must be above 0"),
        ("stroke@10kPa=two", "'two'"),
        ("strok@10kPa=16mm", "'strok@10kPa'"),
        ("width=20mm", "no calibrated model predicts the width"),
        ("chamber.diameter=5", "is a property of the drawing"),
        (
            "height@10kPa=30mm",
            "standard deviations above the",
        ),
        ("height@10kPa=2in", "standard deviations above"),
    ],
)
def test_a_reading_that_cannot_be_gets_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(DesignError) as error:
        sbafab.predict(NAME, measured=[text])
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)


def test_measured_values_need_a_calibration() -> None:
    with pytest.raises(DesignError, match=r'models\.calibration = "none"'):
        sbafab.predict(NAME, "models.calibration=none", measured=["stroke@10kPa=16mm"])


def test_a_serial_stands_for_what_is_recorded_of_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = tmp_path / "lab.sqlite"
    values = {"stroke_mm": 16.0, "force_n": 4.5, "height_mm": 1.1}
    sbafab.record(NAME, lab=lab, serial="A-03", leak="pass", **values)
    out = ["-o", str(tmp_path), "--lab", str(lab)]
    _, text, _ = run_predict([NAME, "--serial", "A-03", *out], capsys)
    joined = " ".join(text.split())
    assert "calibration paper with values of this actuator" in joined
    assert "without what was measured on this actuator" in joined
    written = json.loads((tmp_path / NAME / "predict.json").read_text(encoding="utf-8"))
    assert written["asked"]["measured"] == ["force@0mm@100kPa=4.5N", "height=1.1mm"]
    code, _, error = run_predict([NAME, "--serial", "A-04", *out], capsys)
    assert code == 2
    assert "has neither force nor height of A-04" in error


def test_a_weight_on_the_tip_lowers_it_as_the_stack_says() -> None:
    """Of 5 g at 2 kPa, beside the pose with that force; the paper's film as bought."""
    plain = ("models.calibration=none",)
    free = sbafab.predict(NAME, *plain, pressures_kpa=[2])
    loaded = sbafab.predict(NAME, *plain, pressures_kpa=[2], tip_load=5)
    pose = sbafab.stack(NAME, *plain).pose((2.0,) * 3, tip_load=(0.0, 0.0, -5e-3 * GRAVITY))
    height = loaded.value("free_height", kpa=2)
    assert height == pytest.approx(pose.height, rel=1e-6)
    assert height < 0.99 * free.value("free_height", kpa=2)
    bent = {"kpa": 2, "chambers": 1}
    assert loaded.value("bend", **bent) != pytest.approx(free.value("bend", **bent), rel=1e-3)
    with pytest.raises(DesignError, match="tip load = -1 g must be from 0 to 1000 g"):
        sbafab.predict(NAME, tip_load=-1)
