"""The calibration piece: nominal, readable by other programs, and its table fits its drawing."""

from __future__ import annotations

import csv
from pathlib import Path

import ezdxf
import pytest
import shapely

from sbafab.cutting.dxf_read import read_profile
from sbafab.errors import DesignError
from sbafab.lab.coupon import SIZE, coupon, read_measurements, write_coupon


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
