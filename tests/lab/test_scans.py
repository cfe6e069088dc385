"""Scans of known kerf, scale, tilt, perspective, blur, noise, light and dust, measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
import shapely
from shapely import affinity

from sbafab.errors import DesignError
from sbafab.lab.inspection import Inspection
from sbafab.lab.pieces import PieceFinding
from sbafab.lab.scan import Reference, Scan, read_cut_sheet, read_picture
from tests.lab.conftest import cut
from tests.lab.scans import Camera, Change, pieces_of, render, save
from tests.quick import few

EDGE = 0.02
"""mm within which each edge is to be found."""


def inspected(
    folder: Path,
    tmp_path: Path,
    camera: Camera,
    change: Change | None = None,
    sheet: str = "TPE_1",
    is_photo: bool = False,
) -> Inspection:
    drawn = folder / "sheets" / f"{sheet}.dxf"
    path = save(render(drawn, camera, change), tmp_path / "scan.png", camera.dpi)
    dpi = None if is_photo else (camera.dpi, camera.dpi)
    return Inspection(
        Scan(read_picture(path), read_cut_sheet(folder, sheet), Reference(dpi), is_photo)
    )


def check(inspection: Inspection, camera: Camera) -> None:
    """Check kerf, its interval, scale, every edge and that no piece is found amiss."""
    fit = inspection.fit
    assert inspection.kerf.value == pytest.approx(camera.kerf, abs=0.005)
    low, high = inspection.kerf.interval
    assert low <= camera.kerf <= high
    # Film ends half the kerf inside the path; what is farther off is dust, a few places at most.
    errors = np.abs(fit.outside + camera.kerf / 2)
    assert np.mean(errors < EDGE) > 0.985
    assert np.sqrt(np.mean(np.square(errors[fit.weights > 0]))) < EDGE / 2
    assert [piece for piece in inspection.pieces if piece.verdict != "sound"] == []


def random_camera(seed: int) -> Camera:
    random = np.random.default_rng(seed)
    return Camera(
        kerf=random.uniform(0.06, 0.2),
        dpi=1200.0 if seed % 5 == 3 else 600.0,
        scale=(random.uniform(0.998, 1.002), random.uniform(0.998, 1.002)),
        tilt=random.uniform(-5, 5),
        blur=random.uniform(1, 2),
        noise=random.uniform(1, 8),
        light=random.uniform(0, 0.4),
        specks=int(random.integers(0, 80)),
        film=random.uniform(150, 220),
        paper=random.uniform(20, 60),
        seen_from_below=bool(random.integers(2)),
        skeleton=bool(random.integers(2)),
        moved=random.choice([0.0, 0.0, 0.15]),
        seed=seed,
    )


@pytest.mark.parametrize("seed", few(range(20), 2, long=6))
def test_a_scan_is_measured(seed: int, folder: Path, tmp_path: Path) -> None:
    camera = random_camera(seed)
    # Pieces that fell out of a skeleton move no window.
    camera = replace(camera, moved=0.0) if camera.skeleton else camera
    inspection = inspected(folder, tmp_path, camera)
    check(inspection, camera)
    assert inspection.location.content == ("skeleton" if camera.skeleton else "pieces")
    if not camera.moved:
        scale = inspection.scale
        assert (scale.x, scale.y) == pytest.approx(camera.scale, abs=2e-4)


@pytest.mark.parametrize(("keystone", "barrel"), few([(0.03, 0.004), (0.06, -0.004)], 1, names=2))
def test_a_photograph_is_measured(
    keystone: float, barrel: float, folder: Path, tmp_path: Path
) -> None:
    camera = Camera(dpi=500, keystone=keystone, barrel=barrel, tilt=-3, blur=1.5, specks=20)
    inspection = inspected(folder, tmp_path, camera, is_photo=True)
    check(inspection, camera)
    assert inspection.scale.reference.startswith("none")


@pytest.mark.parametrize("seed", few(range(50), 1, long=9))
def test_a_clean_sheet_gives_no_alarm(seed: int, folder: Path, lobed: Path, tmp_path: Path) -> None:
    of = lobed if seed % 5 == 4 else folder
    sheet = ("PTFE_1", "TPE_1")[seed % 2]
    camera = replace(random_camera(100 + seed), dpi=300.0, skeleton=False, moved=0.0)
    inspection = inspected(of, tmp_path, camera, sheet=sheet)
    assert inspection.amiss == []
    assert not inspection.failed


PINS = ((32.0, 14.0, 3.0), (32.0, 34.0, 3.0), (54.0, 24.0, 2.0))
"""Centre and diameter in mm, among the parts."""


def test_the_pins_of_a_sheet_give_the_scale(tmp_path: Path) -> None:
    """Film that has shrunk by 0.2 % between pins that have not, in a picture of unknown scale."""
    pins = str([list(pin) for pin in PINS])
    folder = cut(tmp_path, "1dof-10mm", "--set", f"sheets.tpe.pins={pins}")
    camera = Camera(dpi=600, tilt=2, noise=2)

    def shrunk(pieces: list[Any]) -> list[Any]:
        middle = shapely.MultiPolygon(pieces).envelope.centroid
        smaller = [shapely.affinity.scale(each, 0.998, 0.998, origin=middle) for each in pieces]
        discs = [shapely.Point(x, y).buffer((d + camera.kerf) / 2, 64) for x, y, d in PINS]
        return smaller + discs

    path = save(render(folder / "sheets" / "TPE_1.dxf", camera, shrunk), tmp_path / "p.png", None)
    sheet = read_cut_sheet(folder, "TPE_1")
    inspection = Inspection(Scan(read_picture(path), sheet, Reference(pins=True), False))
    assert inspection.scale.reference == "3 pins"
    assert inspection.scale.x == pytest.approx(0.998, abs=2e-4)
    # Without one of them the scale is not known: no pin is there, or the picture ends before it.
    for x, y in ((75.2, 26.0), (60.0, 60.0)):
        hidden = replace(sheet, pins=(*PINS[:2], (x, y, 2.0)))
        with pytest.raises(DesignError, match=f"the pin at x {x:g}, y {y:g} mm is not visible"):
            Inspection(Scan(read_picture(path), hidden, Reference(pins=True), False))


# Pieces that were taken away, exchanged, turned or turned over in rendered scans are named.


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
