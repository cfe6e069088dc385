"""Pieces that were taken away, exchanged, turned or turned over in rendered scans are named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ezdxf
import pytest
import shapely
from shapely import affinity

from sbafab.lab.inspection import Inspection
from sbafab.lab.pieces import PieceFinding
from sbafab.lab.scan import Reference, Scan, read_cut_sheet, read_picture
from tests.lab.scans import Camera, pieces_of, render, save
from tests.lab.test_scans import inspected
from tests.quick import few

CAMERA = Camera(dpi=400, tilt=1.5, specks=20)
Polygon = Any


def middle(piece: Polygon) -> tuple[float, float]:
    low_x, low_y, high_x, high_y = piece.bounds
    return (low_x + high_x) / 2, (low_y + high_y) / 2


def at(piece: Polygon, place: Polygon) -> Polygon:
    """The piece with its middle where that of another lies."""
    (x, y), (u, v) = middle(piece), middle(place)
    return affinity.translate(piece, u - x, v - y)


def holes(piece: Polygon) -> int:
    return len(piece.interiors)


def amiss(folder: Path, tmp_path: Path, change: Any, sheet: str = "TPE_1") -> list[PieceFinding]:
    return inspected(folder, tmp_path, CAMERA, change, sheet).amiss


def places(findings: list[PieceFinding]) -> set[tuple[int, int]]:
    return {(round(finding.x), round(finding.y)) for finding in findings}


def rounded(piece: Polygon) -> tuple[int, int]:
    x, y = middle(piece)
    return round(x), round(y)


@pytest.mark.parametrize("number", few(range(16), 1, long=5))
def test_a_removed_piece_is_missing(number: int, folder: Path, tmp_path: Path) -> None:
    removed = pieces_of(folder / "sheets/TPE_1.dxf")[number]
    findings = amiss(folder, tmp_path, lambda pieces: [*pieces[:number], *pieces[number + 1 :]])
    assert [finding.verdict for finding in findings] == ["missing"]
    assert places(findings) == {rounded(removed)}


def test_exchanged_pieces_are_both_named(folder: Path, tmp_path: Path) -> None:
    """A disc with a bore and one without, and a plate with an inlet and one without a bore."""
    drawn = pieces_of(folder / "sheets/TPE_1.dxf")
    discs = [piece for piece in drawn if shapely.Polygon(piece.exterior).area < 110]
    bored, plain = (next(p for p in discs if holes(p) == count) for count in (1, 0))

    def change(pieces: list[Polygon]) -> list[Polygon]:
        swapped = {bored.wkb: at(plain, bored), plain.wkb: at(bored, plain)}
        return [swapped.get(piece.wkb, piece) for piece in pieces]

    findings = {finding.name: finding for finding in amiss(folder, tmp_path, change)}
    assert {name: finding.verdict for name, finding in findings.items()} == {
        "P05": "other piece",
        "P07": "other piece",
    }
    assert findings["P05"].message.startswith("P07 lies in its place")
    assert findings["P07"].message.startswith("P05 lies in its place")


FLAG = shapely.Polygon([(0, 0), (8, 0), (8, 5), (14, 5), (14, 9), (0, 9)])
"""No turn of it gives the mirrored one."""


def of_flags(tmp_path: Path, places: Any, change: Any) -> Inspection:
    """A scan of three flags, of which the first was changed."""
    path = drawn_by_ezdxf(
        tmp_path / "flags.dxf", [affinity.translate(FLAG, *place) for place in places]
    )
    picture = render(path, CAMERA, lambda drawn: [change(drawn[0]), *drawn[1:]])
    scan = save(picture, tmp_path / "scan.png", CAMERA.dpi)
    sheet = read_cut_sheet(path, None)
    return Inspection(Scan(read_picture(scan), sheet, Reference((CAMERA.dpi, CAMERA.dpi))))


@pytest.mark.parametrize("places", [[(0, 0), (20, 3), (40, 6)], [(0, 0), (20, 0), (0, 20)]])
def test_a_mirrored_piece_is_turned_over(places: Any, tmp_path: Path) -> None:
    inspection = of_flags(tmp_path, places, lambda piece: affinity.scale(piece, -1, 1))
    assert [(f.name, f.verdict) for f in inspection.amiss] == [("part 1", "turned over")]
    assert not inspection.location.from_below
    assert inspection.failed


@pytest.mark.parametrize("degrees", [12, -90, 180])
def test_a_turned_piece_is_said_to_be(degrees: int, tmp_path: Path) -> None:
    places = [(0, 0), (20, 0), (0, 20)]
    inspection = of_flags(tmp_path, places, lambda piece: affinity.rotate(piece, degrees))
    (finding,) = inspection.amiss
    assert (finding.name, finding.verdict) == ("part 1", "turned")
    assert finding.turn is not None
    assert abs(finding.turn) == pytest.approx(abs(degrees), abs=1.5)
    assert not inspection.failed


def drawn_by_ezdxf(path: Path, pieces: list[Polygon]) -> Path:
    document = ezdxf.new("R2010", units=4)
    document.header["$MEASUREMENT"] = 1
    document.layers.add("CUT_OUTER", color=1)
    for piece in pieces:
        document.modelspace().add_lwpolyline(
            list(piece.exterior.coords)[:-1], close=True, dxfattribs={"layer": "CUT_OUTER"}
        )
    document.saveas(path)
    return path


def test_a_hole_that_did_not_fall_out_is_named(folder: Path, tmp_path: Path) -> None:
    """A plate whose bore stays shut looks like the one without."""
    drawn = pieces_of(folder / "sheets/TPE_1.dxf")
    piece = max(drawn, key=lambda p: (holes(p), p.area))
    shut = shapely.Polygon(piece.exterior)
    (finding,) = amiss(
        folder, tmp_path, lambda pieces: [shut if p.wkb == piece.wkb else p for p in pieces]
    )
    x, y = piece.interiors[0].centroid.coords[0]
    assert (finding.name, finding.verdict) == ("P03", "other piece")
    assert finding.message == (
        f"P01 lies in its place, or the hole at x {x:.1f}, y {y:.1f} is not open"
    )


def test_a_skeleton_keeps_what_did_not_fall_out(folder: Path, tmp_path: Path) -> None:
    camera = Camera(dpi=400, skeleton=True, tilt=-2)
    inspection = inspected(folder, tmp_path, camera, lambda pieces: pieces[1:])
    (finding,) = inspection.amiss
    assert finding.message == "is still in the sheet"
