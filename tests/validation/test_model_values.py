"""Models at the points of measured curves, held against closed forms and the stack itself."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

import sbafab
from sbafab.cli import main
from sbafab.errors import DesignError
from sbafab.lab.evidence import from_lab_records
from sbafab.lab.store import Lab
from sbafab.models.figures import Factors
from sbafab.models.stack import Stack
from sbafab.validation.comparison import ComparedPoint, compare
from sbafab.validation.evidence import (
    QUANTITIES,
    Evidence,
    MeasuredCurve,
    Setup,
    StatedError,
    load_evidence,
)
from sbafab.validation.model_values import (
    ANSWERS,
    model_values,
)
from tests.site.formats import hold
from tests.validation.tables import evidence_csv

THREE = "3dof-15mm"


@pytest.fixture(scope="module")
def three() -> Stack:
    return sbafab.stack("3dof-15mm", "models.calibration=none")


def curve(
    quantity: str, x_name: str = "", x: tuple[float, ...] = (), **more: object
) -> MeasuredCurve:
    return MeasuredCurve(
        id="a",
        quantity=quantity,
        place="bench",
        design=str(more.pop("design", "1dof-5mm")),
        x_name=x_name,
        x=x,
        y=more.pop("y", (1.0,) * max(len(x), 1)),
        error=StatedError(source="bench"),
        **more,
    )


def values(
    of: MeasuredCurve, factors: Factors | None = None
) -> dict[str, tuple[float | None, ...]]:
    return dict(model_values(of, factors).series)


def test_every_quantity_has_a_model_or_a_reason() -> None:
    reasons = {name for name, quantity in QUANTITIES.items() if quantity.without_model}
    assert ANSWERS.keys() | reasons == QUANTITIES.keys()
    assert not ANSWERS.keys() & reasons


def test_losses_are_the_share_of_the_input_work() -> None:
    paper = load_evidence("paper")
    lossy = Factors(loss_share=0.25)
    (work,) = values(paper.curve("energy-1kpa"))[""]
    assert work is not None
    assert values(paper.curve("loss-1kpa"), lossy)[""] == pytest.approx([work / 4])
    assert values(paper.curve("loss-share"), lossy)[""] == (0.25, 0.25)
    assert values(paper.curve("loss-share"))[""] == (0.0, 0.0)


def test_sizes_of_the_paper_follow_from_its_films() -> None:
    paper = load_evidence("paper")
    assert values(paper.curve("flat-height"))[""] == pytest.approx([30 * 0.038 + 29 * 0.025])
    films = 2 * (3 * 0.038 + 2 * 0.025)
    assert values(paper.curve("radial-deflated"))[""] == pytest.approx([15 + films])
    inflated = 15 + 2 * 20 / math.pi + films
    assert values(paper.curve("radial-inflated"))[""] == pytest.approx([inflated], rel=1e-4)


def test_a_press_factor_counts() -> None:
    flat = load_evidence("paper").curve("flat-height")
    # Of the films; the masks between them keep their thickness.
    half = 29 * 0.025 + 30 * 0.038 / 2
    assert values(flat, Factors(press_factor=0.5))[""] == pytest.approx([half])


def test_a_flat_force_is_nearly_pressure_times_pocket() -> None:
    held = curve(
        "force_n",
        "pressure_kpa",
        (50.0, 100.0),
        setup=Setup(tip="held", stroke_mm=0.0),
    )
    pocket = math.pi * 2.5**2
    for pressure, force in zip(held.x, values(held)[""], strict=True):
        assert force is not None
        assert 0.9 * pressure * pocket / 1000 < force <= pressure * pocket / 1000


def test_shares_of_the_height_have_five_readings_and_strokes_have_none(three: Stack) -> None:
    shares = load_evidence("paper").curve("force-3dof")
    series = values(shares)
    assert list(series) == [
        "full stroke at 10 kPa",
        "full stroke at 30 kPa",
        "full stroke at 100 kPa",
        "full height as in Sec. 4.6",
        "full stroke as in Sec. 4.2",
    ]
    # Sec. 4.2: a stack of 15 balloons inflates almost 2 cm.
    almost = shares.model_copy(update={"x_name": "stroke_mm", "x": (0.0, 5.0, 15.0)})
    assert values(almost)[""] == pytest.approx(series["full stroke as in Sec. 4.2"])
    full = three.pose((10.0,) * 3).height - three.flat_height
    by_stroke = shares.model_copy(
        update={"x_name": "stroke_mm", "x": (0.0, full / 4, 3 * full / 4)}
    )
    assert values(by_stroke)[""] == pytest.approx(series["full stroke at 10 kPa"])
    # A column blocked at the height that it reaches freely pushes with nothing.
    held = Setup(pressure_kpa=10.0, tip="held")
    alone = curve("force_n", "stroke_mm", (1.01 * full,), design=THREE, setup=held)
    assert values(alone)[""] == (0.0,)


def test_chambers_that_a_source_leaves_open_are_a_series_each(three: Stack) -> None:
    bend = load_evidence("paper").curve("largest-bend")
    answer = model_values(bend)
    chambers = [name.split(",")[0] for name in answer.series]
    assert chambers == ["one chamber"] * 3 + ["2 chambers"] * 3
    states = [(p, q, 0.0) for p in (10.0, 30.0, 100.0) for q in (0.0, p)]
    bends = [three.pose(state).bend for state in states]
    assert answer.ranges() == [pytest.approx((min(bends), max(bends)))]
    named = bend.model_copy(update={"setup": Setup(chambers=2, pressure_kpa=5.0)})
    assert values(named)[""] == pytest.approx([three.pose((5.0, 5.0, 0.0)).bend])


def test_a_volume_leads_back_to_its_pose(three: Stack) -> None:
    empty, pose = three.pose((0.0,) * 3), three.pose((2.0, 2.0, 2.0))
    taken_in = float((pose.volumes - empty.volumes).sum())
    stroke = curve("stroke_mm", "volume_ul", (taken_in, 1e6), design=THREE)
    first, beyond = values(stroke)[""]
    # Between sixty poses.
    assert first == pytest.approx(pose.height - three.flat_height, rel=1e-4)
    assert beyond is None


def test_times_are_volume_over_flow_without_a_tube(three: Stack) -> None:
    empty, pose = three.pose((0.0,) * 3), three.pose((4.0, 4.0, 4.0))
    taken_in = float((pose.volumes - empty.volumes).sum())
    setup = Setup(fluid="water", flow_ml_min=35.0, tube_mm=0.0)
    time = curve("time_s", "pressure_kpa", (4.0,), design=THREE, setup=setup)
    (water,) = values(time)[""]
    assert water == pytest.approx(taken_in / (35_000 / 60), rel=1e-3)
    (air,) = values(time.model_copy(update={"setup": setup.model_copy(update={"fluid": "air"})}))[
        ""
    ]
    # Of air at 4 kPa the same volume holds 1 + 4 / 101.325 as much at the atmosphere; and the flat
    # balloons hold a little.
    assert air == pytest.approx(water * (1 + 4 / 101.325), rel=5e-3)


def test_work_is_the_integral_of_pressure_over_volume() -> None:
    single = sbafab.stack("1dof-5mm", "models.calibration=none")
    pressures = [0.001, *(k / 50 for k in range(1, 51))]
    volumes = [float(single.pose((p,)).volumes.sum()) for p in pressures]
    pairs = list(zip(pressures, volumes, strict=True))
    steps = [((p + q) / 2, w - v) for (p, v), (q, w) in zip(pairs, pairs[1:], strict=False)]
    (work,) = values(curve("energy_mj", "pressure_kpa", (1.0,)))[""]
    assert work == pytest.approx(sum(p * v for p, v in steps) / 1000, rel=0.06)


@pytest.mark.parametrize(
    ("of", "words"),
    [
        (
            curve("force_n", "pressure_kpa", (10.0,)),
            "does not state the height at which the tip is held",
        ),
        (curve("force_n", "stroke_mm", (1.0,)), "states no pressure"),
        (curve("time_s", "pressure_kpa", (10.0,)), "states no flow"),
        (curve("bend_deg"), "one chamber does not bend"),
        (curve("force_n", design=""), "no design describes the actuator"),
        (curve("stroke_mm", design="nosuch"), "neither a template"),
        (curve("stroke_mm", design="radial-15mm"), "round"),
    ],
)
def test_what_has_no_value_says_why(of: MeasuredCurve, words: str) -> None:
    with pytest.raises(DesignError, match=words):
        model_values(of)


# The comparison and its command.


def test_intervals_are_held_against_the_measured_values() -> None:
    flat = curve("flat_height_mm", y=(0.4, 0.5))
    lab = Evidence(id="lab", citation="a lab", curves=(flat,))
    (without,) = compare(lab)
    assert without.points[0].within is None
    assert without.points[0].deviation == pytest.approx((0.331, 0.331))
    points = [
        ComparedPoint.at(each.x, each.measured, each.error, each.model, (0.45, 0.6))
        for each in without.points
    ]
    assert [point.within for point in points] == [False, True]
    assert [point.texts("mm")[-1] for point in points] == ["no", "yes"]
    assert points[0].texts("mm")[:4] == ("0.4 mm", "0.731 mm", "+83%", "0.45 to 0.6")


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


def test_a_lab_sees_its_table_beside_the_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bench.csv"
    path.write_text(
        "quantity,design,x_name,x,y,error,pressure_kpa,tip\n"
        "force_n,1dof-5mm,stroke_mm,0,1.5,0.05,100,held\nforce_n,,,1,1.4,0.05,,\n"
    )
    code, out, _ = run(["reproduce", str(path), "--json"], capsys)
    assert code == 0
    document = json.loads(out)
    hold("comparison", document)
    first, second = document["curves"][0]["points"]
    assert (first["measured"], second["x"]) == (1.5, 1.0)
    assert first["model"][0] > second["model"][0]
    code, out, _ = run(["reproduce", str(path)], capsys)
    assert code == 0
    assert "bench.csv compared: 2 of 2 values in 1 curves predicted" in out.replace("\n", " ")
    assert not (tmp_path / "reproduction").exists()


def test_a_source_says_what_could_not_be_had_and_what_no_model_gives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "array.toml"
    path.write_text(
        """schema = "sbafab/evidence@1"
citation = "an array of textile pouches"
missing = ["Only the abstract could be read."]
[[curves]]
id = "force"
quantity = "force_n"
place = "abstract"
x_name = "pressure_kpa"
x = [230]
y = [2.1]
error = { source = "none stated" }
comparable = false
reason = "It is no film that stretches."
"""
    )
    code, out, _ = run(["reproduce", str(path)], capsys)
    assert code == 0
    assert "230 kPa" in out
    assert "No design describes the actuator." in out
    assert "Not comparable: It is no film" in out
    assert "Not had: Only the abstract" in out
    assert "0 of 1 values" in out


def test_no_such_source_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(["reproduce", "papr"], capsys)
    assert (code, out) == (2, "")
    assert "did you mean paper?" in err
    assert err.count("\n") == 1


# A lab's records.


def test_records_of_a_lab_are_curves_of_what_was_built(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = tmp_path / "lab.sqlite"
    design = sbafab.load("1dof-5mm", **{"stack.balloons": 2, "rules.yield_builds": 100})
    sbafab.record(design, lab=lab, serial="A1", stroke_mm=2.2, force_n=1.4)
    sbafab.record(design, lab=lab, serial="A2", stroke_mm=2.4, height_mm=0.2)
    evidence = from_lab_records(Lab(lab))
    curves = {of.quantity: of for of in evidence.curves}
    assert curves["stroke_mm"].y == (2.2, 2.4)
    assert (curves["force_n"].x, curves["force_n"].y) == ((0.0,), (1.4,))
    assert curves["force_n"].setup.pressure_kpa == 100
    assert values(curves["flat_height_mm"])[""] == pytest.approx([4 * 0.038 + 3 * 0.025])
    assert all(model_values(of).series for of in evidence.curves)
    code, out, _ = run(["reproduce", str(lab), "--json"], capsys)
    assert code == 0
    assert {of["quantity"] for of in json.loads(out)["curves"]} == curves.keys()
    assert "stroke_mm" in evidence_csv(evidence.curves)


def test_records_without_a_number_are_no_evidence(tmp_path: Path) -> None:
    lab = tmp_path / "lab.sqlite"
    design = sbafab.load("1dof-5mm", **{"stack.balloons": 2, "rules.yield_builds": 100})
    sbafab.record(design, lab=lab, serial="A1", leak="pass")
    with pytest.raises(DesignError, match="has no record of stroke_mm"):
        from_lab_records(Lab(lab))
