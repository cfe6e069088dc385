"""Kerf and uncertainty from a measured coupon, against closed formulas and printed tables."""

from __future__ import annotations

import csv
import math
import random
from dataclasses import replace
from pathlib import Path
from statistics import mean
from typing import NamedTuple

import ezdxf
import numpy as np
import pytest
import shapely

from sbafab.cutting.dxf_read import read_profile
from sbafab.errors import DesignError
from sbafab.lab.coupon import (
    SIZE,
    Axis,
    Kind,
    Measurement,
    calibrated,
    coupon,
    coupon_csv,
    read_measurements,
    student_t,
    write_coupon,
)
from tests.quick import few

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
    """Two outsides and two windows of one size: half the difference of their means.

    Outsides 0.11 and 0.15 too small, windows 0.14 and 0.12 too large: kerf (0.13 + 0.13) / 2, no
    reading error; rest 2 * 0.02^2 + 2 * 0.01^2 = 0.001 on two degrees of freedom. A scale cannot be
    told from one size. Scatter is wider than the step, so that rounding leaves next to nothing.
    """
    rows = [
        Measurement("outer", "x", 20.0, 19.89),
        Measurement("outer", "y", 20.0, 19.85),
        Measurement("window", "x", 20.0, 20.14),
        Measurement("window", "y", 20.0, 20.12),
    ]
    found = calibrated(rows, 0.02).overall
    assert found.kerf.value == pytest.approx(0.13, abs=1e-12)
    assert found.offsets[""].value == pytest.approx(0.0, abs=1e-12)
    assert (found.scale, found.degrees) == (None, 2)
    own = 0.0005 - 0.02**2 / 12
    left = 0.02 / math.sqrt(12) * math.exp(-2 * math.pi**2 * own / 0.02**2)
    expected = math.hypot(math.sqrt(0.0005 / 4), left)
    assert left < 1e-11
    assert found.kerf.uncertainty == pytest.approx(expected, rel=1e-9)
    assert found.kerf.half_width == pytest.approx(4.30265 * expected, rel=1e-5)


COUPONS = 150


class Reader(NamedTuple):
    """A way of reading sizes: constant error, scatter and step in mm, scales along x and y."""

    name: str
    offset: float
    scatter: float
    scales: tuple[float, float]
    step: float


READERS = (
    Reader("calliper that reads 0.03 too much", 0.03, 0.01, (1.0, 1.0), 0.01),
    Reader("calliper of a rough hand", -0.02, 0.025, (1.0, 1.0), 0.01),
    Reader("scanner with two scales", 0.004, 0.008, (1.002, 0.9985), 25.4 / 2400),
    Reader("microscope", 0.0, 0.003, (1.0, 1.0), 0.001),
    Reader("scanner and film that shrank", 0.0, 0.01, (0.997, 0.997), 25.4 / 1200),
)


def read_coupon(reader: Reader, kerf: float, draw: random.Random) -> list[Measurement]:
    """Return the coupon's sizes as an instrument reads them."""
    rows = []
    for row in csv.DictReader(line for line in coupon_csv().splitlines() if line[0] != "#"):
        kind: Kind = "window" if row["feature"].endswith("window") else "outer"
        axis: Axis = "x" if row["axis"] == "x" else "y"
        nominal = float(row["nominal_mm"])
        size = nominal + (kerf if kind == "window" else -kerf)
        read = reader.scales[axis == "y"] * size + reader.offset + draw.gauss(0, reader.scatter)
        rows.append(Measurement(kind, axis, nominal, round(read / reader.step) * reader.step))
    return rows


@pytest.mark.parametrize("reader", few(READERS, 2), ids=lambda reader: reader.name)
def test_intervals_hold_the_kerf_about_95_times_in_100(reader: Reader) -> None:
    """Of COUPONS each; within four standard deviations of a share of 0.95."""
    draw = random.Random(10)
    held = dict.fromkeys(("all", "x", "y", "offset"), 0)
    for _ in range(COUPONS):
        kerf = draw.uniform(0.08, 0.16)
        found = calibrated(read_coupon(reader, kerf, draw), reader.step)
        assert found.x is not None
        assert found.y is not None
        for name, estimate in (("all", found.overall), ("x", found.x), ("y", found.y)):
            low, high = estimate.kerf.interval
            # The reader's scale takes the kerf with it.
            scale = {"x": reader.scales[0], "y": reader.scales[1]}.get(name, mean(reader.scales))
            held[name] += low <= scale * kerf <= high
        low, high = found.x.offsets[""].interval
        held["offset"] += low <= reader.offset <= high
    slack = 4 * math.sqrt(0.95 * 0.05 / COUPONS)
    assert all(abs(count / COUPONS - 0.95) <= slack for count in held.values()), held


def test_each_instrument_has_its_own_reading_error() -> None:
    draw = random.Random(6)
    rows = [
        replace(row, instrument=name)
        for name, offset in (("calliper", 0.03), ("scanner", -0.01))
        for row in read_coupon(Reader(name, offset, 0.002, (1.0, 1.0), 0.001), 0.11, draw)
    ]
    found = calibrated(rows, 0.001).overall
    assert found.kerf.value == pytest.approx(0.11, abs=0.002)
    assert found.offsets["calliper"].value == pytest.approx(0.03, abs=0.003)
    assert found.offsets["scanner"].value == pytest.approx(-0.01, abs=0.003)


def test_shrunk_film_is_told_from_kerf() -> None:
    rows = sizes(0.12, 0.12, scale=0.997)
    overall = calibrated(rows, 0.001).overall
    assert overall.is_scaled
    assert overall.scale is not None
    assert overall.scale.value == pytest.approx(0.997, abs=1e-9)
    assert overall.kerf.value == pytest.approx(0.12, abs=1e-9)
    kinds = [(-1 if m.kind == "outer" else 1, 1 if m.axis == "x" else -1) for m in rows]
    design = np.array(
        [[m.nominal, k, 1.0, k * x, m.nominal * x] for m, (k, x) in zip(rows, kinds, strict=True)]
    )
    measured = np.array([m.measured for m in rows])
    solution, rest, *_ = np.linalg.lstsq(design, measured, rcond=None)
    spread = rest[0] / (len(rows) - 5) * np.linalg.inv(design.T @ design)
    fitted = (overall.scale.value, overall.kerf.value, overall.offsets[""].value)
    assert fitted == pytest.approx(tuple(solution[:3]), abs=1e-9)
    assert overall.scale.uncertainty == pytest.approx(math.sqrt(spread[0, 0]), rel=1e-6)


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


def table(folder: Path, text: str) -> Path:
    path = folder / "measured.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_column_names_the_instrument(tmp_path: Path) -> None:
    text = (
        "feature,axis,nominal_mm,measured_mm,instrument\nA outer,x,20,19.9,Scanner\n"
        "A window,x,14,14.1,\nA piece,x,14,13.9,microscope\n"
    )
    rows = read_measurements(table(tmp_path, text), "calliper")
    assert [row.instrument for row in rows] == ["scanner", "calliper", "microscope"]
    assert [row.kind for row in rows] == ["outer", "window", "outer"]
    with pytest.raises(DesignError, match="instrument is 'ruler'; it must be one of calliper"):
        read_measurements(table(tmp_path, text.replace("Scanner", "ruler")))


POINTS = f"{HEADER}A outer,x,24,23.9\nB window,y,10,10.1\n"
COMMAS = POINTS.replace(",", ";").replace(".", ",")
READABLE = {
    "points": POINTS,
    "commas and semicolons": COMMAS,
    "commas and tabs": COMMAS.replace(";", "\t"),
    "rows of a spreadsheet under our header": HEADER + COMMAS.partition("\n")[2],
    "typed beside our commas": f"{HEADER}A outer,x,24,;23,9\nB window,y,10,;10,1;\n",
    "quoted": f'{HEADER}"A outer","x","24","23,9"\nB window,y,10,"10,1"\n',
    "quoted header": POINTS.replace(HEADER[:-1], '"{}"'.format(HEADER[:-1].replace(",", '","'))),
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
        (f"{HEADER}A outer,x,20,nan\n", "'nan', not a number"),
        (f"{HEADER}A outer,x,20,1.019,9\n", "5 cells, but the header has 4; write decimal points"),
        (f"{HEADER}A outer,x,24,23,9\n", "line 2 has 5 cells, but the header has 4"),
        (f"{HEADER}A outer,x,19.9\n", "line 2 has 3 cells, but the header has 4"),
        (f"{HEADER[:-1]},remark\nA outer,x,24,23,9\n", "may mean 23 or 23,9 for measured_mm"),
        (
            f"{HEADER}A outer,x,20,'19.9\n".replace("'", '"'),
            "line 2 has an unmatched quotation mark",
        ),
        ("feature,axis,nominal_mm,measured_mm,Axis\nA outer,x,20,19.9,y\n", "two columns axis"),
        ("feature;axis;nominal_mm;measured_mm\nA outer;x;20;19;9\n", "one cell a column"),
        (f"{HEADER}A outer,x,20,10000.1\n", "10000.1; .* above 0 and at most 10000"),
        (f"{HEADER}A outer,z,20,19.9\n", "axis must be x or y"),
        (f"{HEADER}A,x,20,19.9\n", "feature must end in outer, window or piece"),
        (f"{HEADER}A outer,x,,19.9\n", "nominal_mm is '', not a number"),
        (f"{HEADER}A outer,x,20,1_9\n", "'1_9', not a number"),
        (f"{HEADER}A outer,x,24,0,23,9\n", "line 2 has 6 cells"),
        (f"{HEADER[:-1]},\nA outer,x,24,23,9\n", "line 2 has 5 cells, but the header has 4"),
        (
            "feature,nominal_mm,remark,axis,measured_mm\nA outer,24,5,x,23\n",
            "may mean 24 or 24,5 for nominal_mm",
        ),
        ("feature;axis;nominal_mm;measured_mm\nA outer;x;20;1.019,9\n", "not a number"),
        (f"{HEADER}A outer,x,20,-19.9\n", "above 0"),
    ],
)
def test_a_table_that_cannot_be_understood_is_refused(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(DesignError, match=says):
        read_measurements(table(tmp_path, text))


def test_remarks_blank_and_empty_rows_are_skipped(tmp_path: Path) -> None:
    rows = "A outer,x,20,19.9\n\nA outer,y,20,\nB window,y,10,10.1,\n"
    assert read_measurements(table(tmp_path, f"# a remark, with commas\n{HEADER}{rows}")) == [
        Measurement("outer", "x", 20.0, 19.9),
        Measurement("window", "y", 10.0, 10.1),
    ]


def test_what_the_sizes_cannot_tell_is_not_claimed() -> None:
    """A reading error from outsides alone, a scale read coarsely, anything from one row."""
    outsides = [m for m in sizes(0.12, 0.12) if m.kind == "outer"]
    assert calibrated(outsides, 0.001).overall.offsets == {}
    assert not calibrated(sizes(0.12, 0.12, scale=0.9999), 0.1).overall.is_scaled
    for count in (0, 1):
        with pytest.raises(DesignError, match="needs 2"):
            calibrated(sizes(0.1, 0.1)[:count], 0.01)


def test_x_and_y_are_told_apart() -> None:
    found = calibrated(sizes(0.12, 0.09), 0.001)
    assert found.x is not None
    assert found.y is not None
    assert found.difference is not None
    told = found.x.kerf.value, found.y.kerf.value, found.difference.value
    assert told == pytest.approx((0.12, 0.09, 0.03), abs=1e-9)
    assert found.differs
    assert not calibrated(sizes(0.12, 0.12), 0.001).differs


# The calibration piece: nominal, readable by other programs, and its table fits its drawing.


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("made") / "coupon"
    write_coupon(made, "sbafab 0")
    return made


def boxes(folder: Path, layer: str) -> list[shapely.Polygon]:
    model = ezdxf.readfile(folder / "coupon.dxf").modelspace()
    return [
        shapely.Polygon([(x, y) for x, y, *_ in entity.get_points()])
        for entity in model.query(f'LWPOLYLINE[layer=="{layer}"]')
        if entity.closed
    ]


def test_the_table_has_every_size_of_the_drawing(folder: Path) -> None:
    rows = [
        r
        for r in csv.reader((folder / "coupon.csv").read_text().splitlines())
        if not r[0].startswith("#")
    ]
    assert rows[0] == ["feature", "axis", "nominal_mm", "measured_mm"]
    for kind, layer in (
        ("outer", "CUT_OUTER"),
        ("window", "CUT_INNER"),
        # What falls out of a window is cut by the same line.
        ("piece", "CUT_INNER"),
    ):
        for axis, low, high in (("x", 0, 2), ("y", 1, 3)):
            told = sorted(float(r[2]) for r in rows if r[0].endswith(kind) and r[1] == axis)
            cut = sorted(box.bounds[high] - box.bounds[low] for box in boxes(folder, layer))
            assert told == pytest.approx(cut)
    assert len({tuple(row[:2]) for row in rows[1:]}) == len(rows) - 1 == 24


def test_the_piece_is_nominal_and_says_so(folder: Path) -> None:
    found = read_profile(folder / "coupon.dxf")
    assert found.region == coupon()
    assert found.properties["PATTERN"] == "coupon"
    assert found.properties["KERF_STATE"] == "uncalibrated: nominal edges"
    assert found.properties["KERF_WIDTH"] == "none"
    assert "COF2" in found.properties["WARNING"]


def test_it_fits_its_film_and_is_engraved_in_the_waste_alone(folder: Path) -> None:
    model = ezdxf.readfile(folder / "coupon.dxf").modelspace()
    parts = shapely.union_all([shapely.Polygon(b.exterior) for b in boxes(folder, "CUT_OUTER")])
    film = shapely.box(2, 2, SIZE - 2, SIZE - 2)
    assert film.contains(parts)
    letters = model.query('LWPOLYLINE[layer=="ENGRAVE"]')
    assert len(letters) > 10
    for stroke in letters:
        line = shapely.LineString([(x, y) for x, y, *_ in stroke.get_points()])
        assert film.contains(line)
        assert line.distance(parts) > 0.5


def test_sides_along_x_and_y_cannot_be_taken_for_each_other(folder: Path) -> None:
    for box in (*boxes(folder, "CUT_OUTER"), *boxes(folder, "CUT_INNER")):
        x0, y0, x1, y1 = box.bounds
        assert x1 - x0 > y1 - y0 + 1


def test_nothing_is_written_over_and_an_empty_table_has_no_measurements(folder: Path) -> None:
    with pytest.raises(DesignError, match="exists"):
        write_coupon(folder, "sbafab 0")
    assert read_measurements(folder / "coupon.csv") == []
