"""One figure of one design has one value and one interval, whichever part of the program is asked.

The parts hold their figures each in its own way: ``predict`` in records and in JSON, ``find`` as
quantities, the studio in answers of its jobs, the gallery in words, and the comparison with
measured curves in series.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import sbafab
from docs.scripts.gallery import FIGURES, figures_of, numbers_of
from sbafab.assemblies.files import load
from sbafab.design.files import template_names
from sbafab.design.records import Design
from sbafab.laminate.burst import burst
from sbafab.laminate.lay_up import pressed_layers
from sbafab.models.calibration import Uncertainty, factors_of, load_calibration
from sbafab.models.figures import Figure, Prediction
from sbafab.models.sizes import size_phrases, sizes
from sbafab.search.quantities import measured, read_quantity
from sbafab.studio.jobs import elastic, motion
from sbafab.validation.evidence import MeasuredCurve, Setup, StatedError
from sbafab.validation.model_values import model_values
from tests.studio.asking import job
from tests.validation.commands import run_predict

NAME = "3dof-15mm"
ONE_ANSWER = 1e-6
"""Relative difference that is left to rounding: JSON holds seven digits."""


class Case(NamedTuple):
    """A figure by its name in ``predict``, as a quantity of ``find``, and as a measured curve."""

    figure: str
    quantity: str
    curve: MeasuredCurve


def _curve(quantity: str, setup: Setup, x_name: str = "", x: tuple[float, ...] = ()) -> Any:
    return MeasuredCurve(
        id="one",
        quantity=quantity,
        place="bench",
        design=NAME,
        x_name=x_name,
        x=x,
        y=(1.0,),
        setup=setup,
        error=StatedError(source="bench"),
    )


CASES = {
    "force": Case(
        "blocked force at 100 kPa, flat",
        "force@0mm@100kPa",
        _curve("force_n", Setup(pressure_kpa=100.0, tip="held"), "stroke_mm", (0.0,)),
    ),
    "bend": Case(
        "bend at 10 kPa in one chamber, the others empty",
        "bend@10kPa",
        _curve("bend_deg", Setup(chambers=1), "pressure_kpa", (10.0,)),
    ),
    "stroke": Case(
        "free stroke at 10 kPa",
        "stroke@10kPa",
        _curve("stroke_mm", Setup(), "pressure_kpa", (10.0,)),
    ),
}
ELASTIC = ("elastic stack", "elastic balloon")


@pytest.fixture(scope="module")
def prediction() -> Prediction:
    return sbafab.predict(NAME)


def _figure(prediction: Prediction, name: str) -> Figure:
    """Return the figure to design with, which is that of an elastic model."""
    (figure,) = (one for one in prediction.figures if one.name == name and not one.other)
    assert figure.model.name.startswith(ELASTIC)
    return figure


def _row(figures: list[dict[str, Any]], name: str) -> dict[str, Any]:
    (row,) = (one for one in figures if one["name"] == name and one["design_with"])
    return row


def _near(figure: Figure) -> Any:
    return pytest.approx(figure.value, rel=ONE_ANSWER)


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_find_has_the_figure_of_predict(case: Case, prediction: Prediction) -> None:
    design = sbafab.load(NAME)
    value, _ = measured(read_quantity(case.quantity), design, sbafab.build(design))
    assert value == _near(_figure(prediction, case.figure))


@pytest.mark.parametrize(
    ("name", "quantities"),
    [
        ("radial-15mm", {f"{size}_diameter" for size in ("deflated", "reached", "inflated")}),
        # Its films stay solid in the press: no press factor.
        ("folded", {"height"}),
    ],
)
def test_find_has_the_sizes_of_predict(name: str, quantities: set[str]) -> None:
    design = sbafab.load(name)
    laminate = sbafab.build(design)
    figures = {one.name: one.value for one in sbafab.predict(name).figures}
    for quantity in quantities:
        figure = "folded height" if quantity == "height" else quantity.replace("_", " ")
        value, _ = measured(read_quantity(quantity), design, laminate)
        assert value == pytest.approx(figures[figure], rel=1e-12)


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_measured_curves_have_it_beside_them(case: Case, prediction: Prediction) -> None:
    answer = model_values(case.curve, factors_of(sbafab.load(NAME)))
    figure = _figure(prediction, case.figure)
    assert answer.model == figure.model.name
    assert answer.series == {"": (_near(figure),)}
    # Without the factors it is another figure.
    assert model_values(case.curve) != answer


def test_a_height_is_the_stroke_above_the_flat_one(prediction: Prediction) -> None:
    of = CASES["stroke"].curve.model_copy(update={"quantity": "height_mm"})
    answer = model_values(of, factors_of(sbafab.load(NAME)))
    height = _figure(prediction, "free height at 10 kPa")
    assert answer.series == {"": (_near(height),)}
    flat = next(one for one in prediction.figures if one.name == "folded height")
    stroke = _figure(prediction, CASES["stroke"].figure)
    assert height.value == pytest.approx(flat.value + stroke.value, rel=1e-12)


def test_the_studio_and_json_have_it_with_its_interval(
    prediction: Prediction, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (answer,) = elastic(job(tmp_path, sbafab.template(NAME)), lambda: None)
    code, out, _ = run_predict([NAME, "--json", "-o", str(tmp_path)], capsys)
    assert code == 0
    for figures in (answer["figures"], json.loads(out)["figures"]):
        for case in CASES.values():
            figure = _figure(prediction, case.figure)
            row = _row(figures, case.figure)
            assert row["value"] == _near(figure)
            assert figure.interval is not None
            assert row["interval"] == pytest.approx(figure.interval, rel=ONE_ANSWER)
            assert row["model"] == figure.model.title


def test_the_studio_moves_the_same_stack(prediction: Prediction, tmp_path: Path) -> None:
    """To the places that its numbers are sent with."""
    asked = {**job(tmp_path, sbafab.template(NAME)), "pose": {"pressures": [10.0, 0.0, 0.0]}}
    (pose,) = motion(asked, lambda: None)
    bend = _figure(prediction, CASES["bend"].figure).value
    assert pose["bend"] == pytest.approx(bend, rel=1e-3)
    stack = sbafab.stack(NAME)
    assert stack.pose((10.0, 0.0, 0.0)).bend == pytest.approx(bend, rel=ONE_ANSWER)


def test_the_gallery_shows_it_with_its_interval(prediction: Prediction) -> None:
    """To the decimals of a card, and with the decimals of its interval."""
    shown = {words: (value, aside) for words, value, aside in numbers_of(prediction)}
    known = {one.name: one for one in prediction.figures if not one.other}
    held = 0
    for name, words, digits in FIGURES:
        figure = known.get(name)
        if words not in shown or figure is None or figure.interval is None:
            continue
        held += 1
        numbers = [float(number) for number in re.findall(r"[\d.]+", shown[words][0])]
        expected = (figure.value, *figure.interval)
        assert numbers == pytest.approx(expected, abs=0.5 * 10.0**-digits * (1 + 1e-9))
    assert held == 2
    card = list(figures_of(prediction, sbafab.load(NAME)))
    for name, words, digits in FIGURES:
        if name in known:
            assert any(line.startswith(f"{words} {known[name].value:.{digits}f} ") for line in card)


DESIGNS = [name for name in template_names() if isinstance(load(name), Design)]


@pytest.mark.parametrize("name", DESIGNS)
def test_one_folded_height_and_one_burst(name: str) -> None:
    """Of predict, find, check's line, traveller and manifest's sizes; by hand from the films."""
    design = sbafab.load(name)
    laminate = sbafab.build(design)
    figures = {one.name: one for one in sbafab.predict(design, quick=True).figures}
    height = figures["folded height"].value
    factors = factors_of(design)
    by_hand = sum(
        layer.film.thickness
        * (factors.press_factor if layer.film.is_the_papers and layer in pressed else 1.0)
        for pressed in [pressed_layers(laminate)]
        for layer in laminate.layers
    )
    assert height == pytest.approx(by_hand, rel=1e-12)
    value, _ = measured(read_quantity("height"), design, laminate)
    assert value == pytest.approx(height, rel=1e-12)
    assert sizes(design, laminate)["folded_height"] == pytest.approx(height, rel=1e-12)
    assert f"folded height {height:.3f} mm" in size_phrases(design, laminate)[-1]
    estimate = burst(laminate)
    if estimate is not None and not design.form.works_under_vacuum:
        assert figures["burst pressure"].value == estimate.kpa
        assert measured(read_quantity("burst"), design, laminate)[0] == estimate.kpa


def test_nothing_past_the_burst_estimate() -> None:
    """Pockets of 10 mm burst at 367 / 2 (Sec. 4, film stress in proportion)."""
    found = sbafab.predict("1dof-10mm", pressures_kpa=[90, 100, 300], quick=True)
    flagged = {one.at.kpa: "near-burst" in one.flags for one in found.figures}
    assert flagged[90.0] is False
    assert flagged[100.0] is True
    assert 300.0 not in flagged
    assert any("300 kPa" in left.name and "184 kPa" in left.reason for left in found.left_out)


def test_pockets_far_off_the_evidence_are_extrapolations() -> None:
    calibration = load_calibration("paper")
    assert calibration is not None
    for diameter in (5.0, 10.0, 50.0):
        design = sbafab.load("1dof-5mm", chamber={"diameter": diameter})
        own = Uncertainty(calibration, laminate=sbafab.build(design), form=design.form)
        assert ("extrapolation" in own.flags("force")) == (diameter == 50.0)


@pytest.mark.parametrize(
    ("diameter", "doublings"),
    [(10.0, 1.0), pytest.param(50.0, math.log2(10), marks=pytest.mark.long)],
)
def test_intervals_widen_off_the_evidence(diameter: float, doublings: float) -> None:
    """Forces were measured of pockets of 5 mm: a doubling adds 0.15, four of them are far off. What
    a pocket's loss adds is less of a wider pocket, what the model misses is the same.
    """

    def spread(wide: float) -> float:
        found = sbafab.predict("1dof-5mm", pressures_kpa=[10], chamber={"diameter": wide})
        figure = _figure(found, "blocked force at 10 kPa, flat")
        assert figure.interval is not None
        assert ("extrapolation" in figure.flags) == (wide == 50.0)
        low, high = figure.interval
        return math.log(high / low) / 2 / 1.6448536

    calibration = load_calibration("paper")
    assert calibration is not None
    least = math.hypot(calibration.discrepancy["force"], 0.15 * doublings)
    assert least < spread(diameter) < math.hypot(spread(5.0), 0.15 * doublings)
