"""Kerf and uncertainty from a measured coupon, against closed formulas and printed tables."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sbafab.cutting.calibration import (
    Axis,
    Kind,
    Measurement,
    calibrated,
    student_t,
)
from sbafab.cutting.measured_table import read_measurements
from sbafab.errors import DesignError

HEADER = "feature,axis,nominal_mm,measured_mm\n"


def sizes(kerf_x: float, kerf_y: float, scale: float = 1.0) -> list[Measurement]:
    """What an ideal instrument reads, with a scatter that sums to 0 over each group of four."""
    found = []
    features: list[tuple[Kind, float]] = [
        ("outer", 24.0),
        ("outer", 12.0),
        ("window", 14.0),
        ("window", 6.0),
    ]
    axes: list[tuple[Axis, float]] = [("x", kerf_x), ("y", kerf_y)]
    for kind, nominal in features:
        for axis, kerf in axes:
            for off in (-0.001, 0.001):
                sign = -1 if kind == "outer" else 1
                measured = scale * nominal + sign * kerf + off
                found.append(Measurement(kind, axis, nominal, measured))
    return found


@pytest.mark.parametrize(
    ("degrees", "t"),
    [(1, 12.7062), (2, 4.30265), (3, 3.18245), (5, 2.57058), (10, 2.22814), (30, 2.04227)],
)
def test_student_t_is_the_printed_table_s(degrees: int, t: float) -> None:
    assert student_t(degrees) == pytest.approx(t, abs=6e-5)


def test_mean_and_uncertainty_by_hand() -> None:
    """Kerfs 0.11, 0.12 and 0.16: mean 0.13, s = sqrt(0.0007)."""
    rows = [
        Measurement("outer", "x", 20.0, 19.89),
        Measurement("window", "y", 20.0, 20.12),
        Measurement("outer", "y", 20.0, 19.84),
    ]
    kerf = calibrated(rows, 0.02).overall.kerf
    assert kerf.value == pytest.approx(0.13, abs=1e-12)
    expected = math.sqrt(0.0007 / 3 + 0.02**2 / 12)
    assert kerf.uncertainty == pytest.approx(expected, rel=1e-9)
    assert kerf.half_width == pytest.approx(4.30265 * expected, rel=1e-5)


def test_equal_kerfs_do_not_differ() -> None:
    found = calibrated(sizes(0.12, 0.12), 0.001)
    assert found.overall.kerf.value == pytest.approx(0.12, abs=1e-9)
    assert not found.differs
    assert not found.overall.is_scaled


def test_x_and_y_are_told_apart() -> None:
    found = calibrated(sizes(0.12, 0.09), 0.001)
    assert found.x is not None
    assert found.y is not None
    assert found.difference is not None
    assert found.x.kerf.value == pytest.approx(0.12, abs=1e-9)
    assert found.y.kerf.value == pytest.approx(0.09, abs=1e-9)
    assert found.difference.value == pytest.approx(0.03, abs=1e-9)
    assert found.differs


def test_shrunk_film_is_told_from_kerf() -> None:
    rows = sizes(0.12, 0.12, scale=0.997)
    overall = calibrated(rows, 0.001).overall
    assert overall.is_scaled
    assert overall.scale is not None
    assert overall.scale.value == pytest.approx(0.997, abs=1e-9)
    assert overall.kerf.value == pytest.approx(0.12, abs=1e-9)
    design = np.array([[m.nominal, -1.0 if m.kind == "outer" else 1.0] for m in rows])
    measured = np.array([m.measured for m in rows])
    solution, rest, *_ = np.linalg.lstsq(design, measured, rcond=None)
    spread = rest[0] / (len(rows) - 2) * np.linalg.inv(design.T @ design)
    assert (overall.scale.value, overall.kerf.value) == pytest.approx(tuple(solution), abs=1e-9)
    assert overall.scale.uncertainty == pytest.approx(math.sqrt(spread[0, 0]), rel=1e-6)


def test_a_coarse_instrument_does_not_find_a_scale() -> None:
    assert not calibrated(sizes(0.12, 0.12, scale=0.9999), 0.1).overall.is_scaled


@pytest.mark.parametrize(
    ("kerf", "says"), [(-0.05, "negative"), (1.2, "over 1 mm"), (-3.0, "negative")]
)
def test_a_kerf_that_no_beam_has_is_refused(kerf: float, says: str) -> None:
    with pytest.raises(DesignError, match=says):
        calibrated(sizes(kerf, kerf), 0.01)


def test_inches_are_refused() -> None:
    inches = [replace(m, measured=m.measured / 25.4) for m in sizes(0.12, 0.12)]
    with pytest.raises(DesignError, match=r"about 0\.039\d* times .* millimetres"):
        calibrated(inches, 0.01)


def test_a_slip_of_the_pen_is_named() -> None:
    rows = sizes(0.12, 0.12)
    rows[2] = replace(rows[2], nominal=25.0)
    assert (rows[2].kind, rows[2].axis) == ("outer", "y")
    with pytest.raises(DesignError, match=r"the outer along y, nominal 25 and measured 23\.879"):
        calibrated(rows, 0.01)


@pytest.mark.parametrize("row", range(16))
@pytest.mark.parametrize("factor", [10.0, 0.1])
def test_a_misplaced_decimal_point_names_its_row_only(row: int, factor: float) -> None:
    """As 41.2 for 4.12: neither unit nor kerf is blamed, whichever row it is and whatever scale."""
    rows = [replace(m, where=f"line {n}") for n, m in enumerate(sizes(0.12, 0.09, 0.998))]
    rows[row] = replace(rows[row], measured=factor * rows[row].measured)
    with pytest.raises(DesignError, match=rf"^line {row}: the (outer|window) along .* mend the"):
        calibrated(rows, 0.01)


def test_a_slip_among_three_sizes_is_named() -> None:
    rows = [
        Measurement("window", "x", 4.0, 4.12, "line 2"),
        Measurement("window", "y", 4.0, 41.12, "line 3"),
        Measurement("outer", "x", 12.0, 11.88, "line 4"),
    ]
    with pytest.raises(DesignError, match=r"^line 3: .* measured 41\.12 mm, is 37\.00 mm off"):
        calibrated(rows, 0.01)


def test_sizes_that_scatter_as_cutting_does_are_no_slip() -> None:
    """0.2 mm is what two edges may be off by the paper's largest error of cutting."""
    rows = sizes(0.3, 0.3)
    rows[0] = replace(rows[0], measured=rows[0].measured - 0.2)
    assert calibrated(rows, 0.01).overall.count == 16


def table(folder: Path, text: str) -> Path:
    path = folder / "measured.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_remarks_blank_and_empty_rows_are_skipped(tmp_path: Path) -> None:
    text = (
        f"# a remark, with commas\n{HEADER}A outer,x,20,19.9\n\nA outer,y,20,\n"
        "B window,y,10,10.1,\n"
    )
    assert read_measurements(table(tmp_path, text)) == [
        Measurement("outer", "x", 20.0, 19.9),
        Measurement("window", "y", 10.0, 10.1),
    ]


def test_a_table_of_a_spreadsheet_with_decimal_commas(tmp_path: Path) -> None:
    text = "\ufeffFeature;Axis;Nominal_mm;Measured_mm\r\nA outer;X;20;19,88\r\n"
    (row,) = read_measurements(table(tmp_path, text))
    assert row.kerf == pytest.approx(0.12)


POINTS = f"{HEADER}A outer,x,24,23.9\nB window,y,10,10.1\n"
COMMAS = POINTS.replace(",", ";").replace(".", ",")
READABLE = {
    "points": POINTS,
    "commas and semicolons": COMMAS,
    "points and semicolons": POINTS.replace(",", ";"),
    "commas and tabs": COMMAS.replace(";", "\t"),
    "rows of a spreadsheet under our header": HEADER + COMMAS.partition("\n")[2],
    "typed beside our commas": f"{HEADER}A outer,x,24,;23,9\nB window,y,10,;10,1;\n",
    "quoted": f'{HEADER}"A outer","x","24","23,9"\nB window,y,10,"10,1"\n',
    "quoted header": POINTS.replace(HEADER[:-1], '"{}"'.format(HEADER[:-1].replace(",", '","'))),
    "with remarks": f"{HEADER[:-1]},remark\nA outer,x,24,23.9,2\nB window,y,10,10.1,worn\n",
    "another order": "measured_mm,axis,nominal_mm,feature\n23.9,x,24,A outer\n10.1,y,10,B window",
}


@pytest.mark.parametrize("name", READABLE)
def test_a_table_that_reads_one_way_only_is_read(tmp_path: Path, name: str) -> None:
    assert read_measurements(table(tmp_path, READABLE[name])) == [
        Measurement("outer", "x", 24.0, 23.9),
        Measurement("window", "y", 10.0, 10.1),
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no column feature"),
        ("feature,axis,nominal_mm\nA outer,x,20\n", "no column measured_mm"),
        (f"{HEADER}A outer,x,20,about 20\n", "line 2: measured_mm is 'about 20', not a number"),
        (f"{HEADER}A outer,x,,19.9\n", "nominal_mm is '', not a number"),
        (f"{HEADER}A outer,x,20,nan\n", "'nan', not a number"),
        (f"{HEADER}A outer,x,20,1_9\n", "'1_9', not a number"),
        (f"{HEADER}A outer,x,20,1.019,9\n", "5 cells where the header has 4; write decimal points"),
        (f"{HEADER}A outer,x,24,23,9\n", "line 2 has 5 cells where the header has 4"),
        (f"{HEADER}A outer,x,24,0,23,9\n", "line 2 has 6 cells"),
        (f"{HEADER}A outer,x,19.9\n", "line 2 has 3 cells where the header has 4"),
        (f"{HEADER[:-1]},\nA outer,x,24,23,9\n", "line 2 has 5 cells where the header has 4"),
        (f"{HEADER[:-1]},remark\nA outer,x,24,23,9\n", "may say 23 or 23,9 for measured_mm"),
        (
            "feature,nominal_mm,remark,axis,measured_mm\nA outer,24,5,x,23\n",
            "may say 24 or 24,5 for nominal_mm",
        ),
        (f"{HEADER}A outer,x,20,'19.9\n".replace("'", '"'), "line 2 has a quotation mark"),
        ("feature,axis,nominal_mm,measured_mm,Axis\nA outer,x,20,19.9,y\n", "two columns axis"),
        ("feature;axis;nominal_mm;measured_mm\nA outer;x;20;19;9\n", "one cell a column"),
        ("feature;axis;nominal_mm;measured_mm\nA outer;x;20;1.019,9\n", "not a number"),
        (f"{HEADER}A outer,x,20,-19.9\n", "above 0"),
        (f"{HEADER}A outer,z,20,19.9\n", "axis must be x or y"),
        (f"{HEADER}A,x,20,19.9\n", "feature must end in outer or window"),
    ],
)
def test_a_table_that_cannot_be_understood_is_refused(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(DesignError, match=says):
        read_measurements(table(tmp_path, text))


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_rows_are_refused(count: int) -> None:
    with pytest.raises(DesignError, match="needs 2"):
        calibrated(sizes(0.1, 0.1)[:count], 0.01)
