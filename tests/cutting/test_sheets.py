"""Film sheets as they are written: read back, in order, with label, frame and time."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import ezdxf
import ezdxf.path
import pytest
import shapely

from sbafab.actuators import load_design
from sbafab.cutting import sheets as module
from sbafab.cutting.cut_settings import CutSettings
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.nesting import nest
from sbafab.cutting.placements import Nest, NestPart, Placement, Stock
from sbafab.cutting.sheets import SheetFile, write_sheets
from sbafab.design.sections import Laser, Sheets
from sbafab.errors import OutputError
from sbafab.folders.check import check_folder
from sbafab.folders.run import Run, RunRequest, generate
from sbafab.geometry.region import disc

SETTINGS = CutSettings("demo", "cd" * 32, generator="sbafab 1.2.3")
STOCK = Stock(width=60.0, length=80.0, border=6.0)
RING = disc((0.0, 0.0), 5.0) - disc((0.0, 0.0), 2.0)
PLAIN = Sheets()
LASER = Laser(cut_speed=10.0, travel_speed=100.0, pierce_seconds=0.5, heat_distance=0.0)


def ring_nest(count: int, stock: Stock = STOCK) -> Nest:
    (found,) = nest([NestPart("demo", "P01", 1, "TPE", RING, count)], {"TPE": stock})
    return found


def test_the_file_holds_the_parts_with_holes_before_outlines(tmp_path: Path) -> None:
    (sheet,) = write_sheets([ring_nest(7)], tmp_path, SETTINGS, LASER, PLAIN)
    found = read_profile(tmp_path / sheet.path)
    assert sheet.path == "sheets/TPE_1.dxf"
    assert found.region.area == pytest.approx(7 * math.pi * (25 - 4))
    assert sheet.parts_area == pytest.approx(7 * math.pi * 21)
    cut = [layer for layer in found.layers if layer.startswith("CUT_")]
    assert cut == ["CUT_INNER"] * 7 + ["CUT_OUTER"] * 7
    assert sheet.counts == (("demo", "P01", 7),)
    assert found.properties["PARTS"] == "7 x demo P01"
    assert found.properties["PATTERN"] == "sheet 1 of 1"


def test_the_label_is_engraved_in_the_border_alone(tmp_path: Path) -> None:
    (sheet,) = write_sheets([ring_nest(20)], tmp_path, SETTINGS, LASER, PLAIN)
    engraved = [
        edge
        for layer, edges in read_profile(tmp_path / sheet.path).strokes
        if layer == "ENGRAVE"
        for edge in edges
    ]
    assert engraved
    assert all(0 < y < 6 for edge in engraved for _, y in (edge.start, edge.end))
    assert all(6 - 1e-6 <= x <= 54 for edge in engraved for x, _ in (edge.start, edge.end))
    (plain,) = write_sheets([ring_nest(20)], tmp_path, SETTINGS, LASER, Sheets(label=False))
    assert "ENGRAVE" not in read_profile(tmp_path / plain.path).layers


def engraved_box(sheet: SheetFile, folder: Path) -> tuple[float, float, float, float]:
    strokes = [
        edges for layer, edges in read_profile(folder / sheet.path).strokes if layer == "ENGRAVE"
    ]
    ends = [p for edges in strokes for edge in edges for p in (edge.start, edge.end)]
    return shapely.MultiPoint(ends).bounds


def test_a_label_makes_way_for_pins(tmp_path: Path) -> None:
    pins = [(30.0, 3.0, 3.0), (3.0, 40.0, 3.0), (30.0, 77.0, 3.0), (57.0, 40.0, 3.0)]
    # Below, left, above, right: where the label is while the pins before are in its way.
    sides = [(6, 0, 54, 6), (0, 6, 6, 74), (6, 74, 54, 80), (54, 6, 60, 74)]
    for count, (low_x, low_y, high_x, high_y) in enumerate(sides):
        stock = STOCK.model_copy(update={"pins": tuple(pins[:count])})
        (sheet,) = write_sheets([ring_nest(1, stock)], tmp_path, SETTINGS, LASER, PLAIN)
        found = engraved_box(sheet, tmp_path)
        assert low_x - 1e-6 <= found[0]
        assert low_y - 1e-6 <= found[1]
        assert found[2] <= high_x + 1e-6
        assert found[3] <= high_y + 1e-6
    full_stock = STOCK.model_copy(update={"pins": tuple(pins)})
    (full,) = write_sheets([ring_nest(1, full_stock)], tmp_path, SETTINGS, LASER, PLAIN)
    assert full.label == "no room"


def test_a_label_that_is_too_long_is_turned_or_wrapped(tmp_path: Path) -> None:
    narrow = STOCK.model_copy(update={"width": 44.0, "border": 10.0, "roll": True, "length": 900.0})
    # One row of rings 1 mm apart: the long side has room for 1.5 mm letters, the short one not.
    (tall,) = write_sheets([ring_nest(12, narrow)], tmp_path, SETTINGS, LASER, PLAIN)
    low_x, low_y, high_x, high_y = engraved_box(tall, tmp_path)
    assert 0 < low_x < high_x < 10
    assert high_x - low_x >= 1.5
    assert 10 - 1e-6 <= low_y < high_y <= tall.length - 10 + 1e-6
    (short,) = write_sheets([ring_nest(2, narrow)], tmp_path, SETTINGS, LASER, PLAIN)
    low_x, low_y, high_x, high_y = engraved_box(short, tmp_path)
    assert 0 < low_y < high_y < 10
    # More than a line of at least 1.5 mm.
    assert high_y - low_y > 2 * 1.5
    assert 10 - 1e-6 <= low_x < high_x <= 34
    assert tall.label == short.label == "engraved"


def test_a_roll_is_cut_off_one_border_past_its_parts(tmp_path: Path) -> None:
    roll = STOCK.model_copy(update={"roll": True, "length": 500.0})
    (sheet,) = write_sheets([ring_nest(4, roll)], tmp_path, SETTINGS, LASER, PLAIN)
    # Four rings of 10 mm, 1 mm apart, take 43 of the 48 mm: one row.
    assert sheet.length == pytest.approx(6 + 10 + 6, abs=1e-6)
    found = read_profile(tmp_path / sheet.path)
    (parting,) = [edges for layer, edges in found.strokes if layer == "CUT_SHEET"]
    assert {y for edge in parting for _, y in (edge.start, edge.end)} == {sheet.length}
    assert found.layers.index("CUT_SHEET") > max(
        i for i, layer in enumerate(found.layers) if layer == "CUT_OUTER"
    )


def framed(*told: Any) -> str:
    return dxf_text(*told[:3], told[3]._replace(frame=(61.0, 80.0)))


def engraved(*_: object) -> tuple[tuple[tuple[float, float], ...], ...]:
    return (((0.0, 11.0), (60.0, 11.0)), ((7.0, 11.0), (8.0, 11.0)))


@pytest.mark.parametrize(
    ("name", "wrong", "said"),
    [
        ("dxf_text", framed, "REFERENCE"),
        ("_sheet_label", engraved, r"engraving at .* lies in a part"),
    ],
)
def test_a_sheet_that_does_not_read_back_as_meant_is_not_let_through(
    name: str, wrong: object, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, name, wrong)
    with pytest.raises(OutputError, match=said):
        write_sheets([ring_nest(1)], tmp_path, SETTINGS, LASER, PLAIN)


def test_parts_that_overlap_are_not_let_through(tmp_path: Path) -> None:
    part = NestPart("demo", "P01", 1, "TPE", RING, 2)
    places = (Placement(0, 0, 0, (11.0, 11.0)), Placement(0, 0, 0, (12.0, 11.0)))
    with pytest.raises(OutputError, match="touch or cross"):
        write_sheets([Nest("TPE", STOCK, (part,), places)], tmp_path, SETTINGS, LASER, PLAIN)


# Index marks on a written sheet, read by ezdxf and measured by shapely.


BORDER = 10.0
SPACING = 2.5


def written(folder: Path, *changes: str) -> Run:
    few = ("stack.balloons=2", "order.copies=4", "rules.yield_builds=100")
    spacing = [f"sheets.{film}.spacing={SPACING}" for film in ("tpe", "ptfe")]
    return generate(
        RunRequest(load_design("1dof-5mm", [*few, *spacing, *changes]), folder, ("cut",))
    )


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return written(tmp_path_factory.mktemp("marked"), "sheets.index_marks=true")


def shapes(path: Path) -> tuple[list[shapely.Polygon], list[shapely.LineString]]:
    """Outlines of the parts, and the engraved strokes inside the border."""
    drawing = ezdxf.readfile(path)
    outlines, strokes = [], []
    frame = shapely.box(BORDER, BORDER, 152.4 - BORDER, 152.4 - BORDER)
    for entity in drawing.modelspace():
        line = [(p.x, p.y) for p in ezdxf.path.make_path(entity).flattening(0.001)]
        if entity.dxf.layer == "CUT_OUTER":
            outlines.append(shapely.Polygon(line))
        elif entity.dxf.layer == "ENGRAVE" and frame.contains(shapely.LineString(line)):
            strokes.append(shapely.LineString(line))
    return outlines, strokes


@pytest.mark.parametrize("film", ["TPE", "PTFE"])
def test_marks_lie_in_the_skeleton_beside_their_parts(marked: Run, film: str) -> None:
    outlines, strokes = shapes(marked.folder / "sheets" / f"{film}_1.dxf")
    assert strokes
    # Strokes of one mark are less than 0.7 mm apart, two marks more than 0.5 mm and their digits.
    united = shapely.unary_union([stroke.buffer(0.35) for stroke in strokes])
    marks = [mark.buffer(-0.349) for mark in getattr(united, "geoms", [united])]
    assert len(outlines) / 2 < len(marks) <= len(outlines)
    parts = []
    for mark in marks:
        away = [mark.distance(outline) for outline in outlines]
        assert 0.499 < min(away) < 2.6
        parts.append(away.index(min(away)))
    assert len({*parts}) == len(parts)


def test_a_marked_folder_passes_and_its_marks_keep_off_the_parts(marked: Run) -> None:
    assert not [f for f in check_folder(marked.folder) if f.verdict == "fail"]
    outlines, strokes = shapes(marked.folder / "sheets" / "TPE_1.dxf")
    assert strokes
    assert min(a.distance(b) for a in outlines for b in strokes) >= 0.5 - 1e-3
