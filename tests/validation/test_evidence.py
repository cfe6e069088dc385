"""Evidence that ships, read against the paper's text, and faults in files of evidence."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.errors import DesignError
from sbafab.models import paper
from sbafab.models.closed_forms import eq_4
from sbafab.validation.evidence import (
    AXES,
    QUANTITIES,
    MeasuredCurve,
    StatedError,
    load_evidence,
    read_csv,
    read_evidence,
)
from tests.validation.tables import evidence_csv

ROOT = Path(__file__).parents[2]

PAPER = {
    "energy-1kpa": ((1,), (0.531,), None),
    "energy-10kpa": ((10,), (45.3,), None),
    "loss-1kpa": ((1,), (0.055,), None),
    "loss-10kpa": ((10,), (4.2,), None),
    "force-1dof": ((0, 0.25, 0.75), (1.48, 1.01, 0.64), (0.04, 0.01, 0.01)),
    "force-3dof": ((0, 0.25, 0.75), (4.87, 4.07, 2.40), (0.02, 0.07, 0.03)),
    "force-bent": ((30, 60, 90), (3.22, 1.41, 0.55), (0.12, 0.05, 0.02)),
    "modulus-1dof": ((), (35,), None),
    "modulus-3dof": ((), (60,), None),
    "time-air": ((10,), (0.067,), (0.011,)),
    "time-water": ((10,), (0.920,), (0.080,)),
    "bend-times": ((30.3, 58.5, 89.7), (0.56, 0.78, 0.91), None),
    "flat-height": ((), (0.95,), None),
    "full-height": ((), (17.5,), None),
    "stroke-per-balloon": ((), (1.2,), None),
    "largest-bend": ((), (81,), (6,)),
    "folded-diameter": ((), (9.25,), None),
    "radial-deflated": ((), (15.33,), None),
    "radial-inflated": ((), (28,), None),
    "burst": ((), (367,), (18,)),
    "success": ((), (0.9,), None),
    "build-time": ((), (1.75,), None),
    "cutting-error": ((), (0.1,), None),
    "pin-error": ((), (0.004,), None),
    "density": ((), (1122,), None),
    "geometric-5mm": ((), (0.95,), None),
    "stroke-15-balloons": ((), (20,), None),
}
"""Axis, values and standard deviations as the paper's text has them (Sec. 2 to 6)."""
OF_FIGURE_7A = {"stroke-10mm-air": (45.0, 0.13), "stroke-10mm-water": (86.0, 0.12)}
"""Largest volume (ul a balloon) and error (mm) that Sec. 4.2 states against Eq. 4."""


def test_the_paper_has_every_figure_of_its_text() -> None:
    curves = {curve.id: curve for curve in load_evidence("paper").curves}
    assert curves.keys() == PAPER.keys() | OF_FIGURE_7A.keys() | {"loss-share"}
    for name, (x, y, errors) in PAPER.items():
        assert (curves[name].x, curves[name].y) == (x, y), name
        if errors is not None:
            assert curves[name].errors == errors, name
            assert curves[name].error.kind == "standard deviation"


def test_the_share_that_is_lost_is_loss_over_input() -> None:
    """With the error of the last digits of both, taken as even over their range."""
    curve = load_evidence("paper").curve("loss-share")
    assert curve.x == (1, 10)
    figures = ((0.055, 0.0005, 0.531, 0.0005), (4.2, 0.05, 45.3, 0.05))
    for share, error, (lost, digit, taken, last) in zip(
        curve.y, curve.errors, figures, strict=True
    ):
        assert share == pytest.approx(lost / taken, abs=5.1e-5)
        relative = math.hypot(digit / lost, last / taken) / math.sqrt(3)
        assert error == pytest.approx(share * relative, rel=0.06)


@pytest.mark.parametrize("name", OF_FIGURE_7A)
def test_strokes_of_figure_7a_are_eq_4_within_its_largest_error(name: str) -> None:
    curve = load_evidence("paper").curve(name)
    volume, largest = OF_FIGURE_7A[name]
    assert max(curve.x) == volume
    assert curve.y == pytest.approx(eq_4(5.0).stroke(curve.x), abs=5.1e-4)
    assert curve.errors == pytest.approx([largest / math.sqrt(3)] * len(curve.y))


def test_the_paper_and_the_constants_of_the_models_agree() -> None:
    curves = {curve.id: curve for curve in load_evidence("paper").curves}
    for name, values in (
        ("force-1dof", paper.FORCE_1DOF),
        ("force-3dof", paper.FORCE_3DOF),
        ("largest-bend", [paper.LARGEST_BEND]),
        ("burst", [paper.BURST]),
    ):
        assert curves[name].y == tuple(value.value for value in values)
        assert curves[name].errors == tuple(value.error for value in values)
    assert curves["force-1dof"].setup.pressure_kpa == paper.FORCE_KPA
    assert curves["time-water"].setup.flow_ml_min == paper.WATER_FLOW
    assert curves["time-air"].setup.flow_ml_min == paper.AIR_FLOW


def test_curves_have_a_source_and_a_design_that_can_be_built() -> None:
    evidence = load_evidence("paper")
    assert evidence.citation
    assert evidence.doi.startswith("10.")
    for curve in evidence.curves:
        assert curve.error.source
        assert curve.comparable or curve.reason
        if curve.is_described:
            load_design(curve.design, [curve.changes])


def test_a_wheel_holds_the_files() -> None:
    builder = pytest.importorskip("hatchling.builders.wheel").WheelBuilder(str(ROOT))
    packed = {included.distribution_path for included in builder.recurse_included_files()}
    assert "sbafab/validation/paper.toml" in packed
    tables = ("validation/quantities", "validation/paper_table", "models/priors", "models/models")
    assert {f"sbafab/{name}.csv" for name in (*tables, "models/paper_counterparts")} <= packed
    assert "sbafab/validation/paper_table.md.jinja" in packed


def test_axes_and_quantities_agree() -> None:
    for quantity in QUANTITIES.values():
        assert set(quantity.axes) <= AXES.keys()


def test_errors_are_absolute_and_relative_together() -> None:
    def errors(**stated: object) -> tuple[float | None, ...]:
        error = StatedError(source="here", **stated)
        return MeasuredCurve(id="a", quantity="force_n", place="here", y=(4.0,), error=error).errors

    assert errors(absolute=(0.3,), relative=0.1) == pytest.approx((0.5,))
    assert errors() == (None,)


# Files.

HEAD = 'schema = "sbafab/evidence@1"\ncitation = "a lab"\n'
CURVE = """[[curves]]
id = "force"
quantity = "force_n"
place = "bench"
x_name = "height_share"
x = [0, 0.5]
y = [2.0, 1.0]
error = { absolute = [0.1, 0.1], source = "three runs" }
"""


def written(tmp_path: Path, text: str, name: str = "lab.toml") -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_is_read_with_its_name_as_id(tmp_path: Path) -> None:
    evidence = read_evidence(written(tmp_path, HEAD + CURVE))
    (curve,) = evidence.curves
    assert (evidence.id, curve.test, curve.y) == ("lab", "force", (2.0, 1.0))


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('"force_n"', '"force"', "unknown quantity 'force'; did you mean force_n?"),
        ('"height_share"', '"volume_ul"', "x_name = 'volume_ul', which is not an axis of force_n"),
        ("x = [0, 0.5]", "x = [0]", "has 1 x for 2 y; give one for each"),
        ("[0.1, 0.1]", "[0.1]", "has 1 absolute errors for 2 y"),
        ("[0.1, 0.1]", "[0.1, -1]", "has an absolute error of -1; it must be at least 0"),
        ('place = "bench"\n', "", "place is missing; add it to the file of evidence"),
        (', source = "three runs"', "", "error.source is missing"),
        ("y = [2.0, 1.0]", 'y = [2.0, "a"]', "y.1 = 'a' must be a number"),
        ('place = "bench"', 'place = "bench"\ncomparable = false', "without a reason"),
        ('place = "bench"', 'place = "bench"\ncolour = 1', "colour"),
        ('"sbafab/evidence@1"', '"sbafab/kit@1"', "schema"),
        (HEAD, HEAD + CURVE, "has two curves 'force'; give each a unique id"),
    ],
)
def test_faults_of_a_file_are_one_sentence(
    tmp_path: Path, before: str, after: str, words: str
) -> None:
    text = (HEAD + CURVE).replace(before, after)
    assert text != HEAD + CURVE
    path = written(tmp_path, text)
    with pytest.raises(DesignError) as caught:
        read_evidence(path)
    message = str(caught.value)
    assert words in message
    assert message.startswith(str(path))
    assert "\n" not in message
    assert "design file" not in message


def test_no_such_source_says_what_there_is() -> None:
    with pytest.raises(DesignError, match=r"neither bundled evidence .*mean paper\?"):
        load_evidence("papr")
    with pytest.raises(DesignError, match="cannot be read"):
        load_evidence("none-here.csv")


# CSV.


def test_curves_come_back_from_a_table_as_they_were(tmp_path: Path) -> None:
    curves = [curve for curve in load_evidence("paper").curves if not curve.changes]
    assert len(curves) > 10
    path = written(tmp_path, evidence_csv(curves), "lab.csv")
    assert list(read_csv(path).curves) == curves


def test_a_table_of_a_lab_needs_two_columns(tmp_path: Path) -> None:
    path = written(tmp_path, "quantity;y\nflat_height_mm;0,95\nflat_height_mm;1,05\n", "lab.csv")
    (curve,) = load_evidence(path).curves
    assert (curve.id, curve.y, curve.errors) == ("flat_height_mm", (0.95, 1.05), (None, None))


def test_a_cell_of_the_curve_may_stand_in_any_row(tmp_path: Path) -> None:
    text = "# bench 2\ncurve,quantity,x_name,x,y,design\na,,,1,3,\na,stroke_mm,,2,4,lab.toml\n"
    path = written(tmp_path, text + "a,,pressure_kpa,3,5,\n", "lab.csv")
    (curve,) = read_csv(path).curves
    assert (curve.x, curve.y) == ((1, 2, 3), (3, 4, 5))
    assert curve.design == str(tmp_path / "lab.toml")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has no column quantity"),
        ("quantity,y\n", "has no rows below its header"),
        ("quantity,y,z\nforce_n,1,2\n", "has a column 'z'"),
        ("quantity,y,y\n", "has two columns y"),
        ("quantity,x\nforce_n,1\n", "has no column y"),
        ("quantity,y\nforce_n,1,2\n", "line 2 has 3 cells, but the header has 2"),
        ("quantity,y\nforce_n,\n", "line 2 has no y"),
        ("quantity,y\nforce_n,high\n", "line 2: y is 'high', not a number"),
        ("quantity,y\n,1\n", "line 2 has neither curve nor quantity"),
        ("curve,quantity,y\na,,1\n", "quantity is missing"),
        ("quantity,y,tip\nforce_n,1,loose\n", "tip = 'loose' must be"),
        ("quantity,y,runs\nforce_n,1,1.5\n", "runs is '1.5'; it must be a whole number"),
        ("quantity,y,tube_mm\nforce_n,1,-2\n", "tube_mm = -2"),
        ("curve,quantity,y\na b,force_n,1\n", "id = 'a b' must"),
        (
            "quantity,y,fluid\nforce_n,1,air\nforce_n,2,water\n",
            "fluid is 'water', but 'air' in an earlier line",
        ),
    ],
)
def test_faults_of_a_table_are_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = written(tmp_path, text, "lab.csv")
    with pytest.raises(DesignError) as caught:
        read_csv(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
