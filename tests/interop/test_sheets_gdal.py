"""GDAL reads film sheets contour by contour: areas, layers, bounds, closed rings."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import shapely
from pyogrio import raw

from sbafab.cutting.properties import DxfProfile
from tests.interop.made import BORDER, LENGTH, PROFILES, WIDTH, Sheet
from tests.interop.page import contours_are_as_on_the_page

EXACT = 1e-5
"""Chords of a quarter degree are 3e-6 of a disc's area off."""
NANOMETRE = 1e-6


pytestmark = pytest.mark.usefixtures("fine_arcs")


def lines(path: Path) -> dict[str, list[shapely.LineString]]:
    """What lies on each layer, in the order of the file."""
    _, _, shapes, (names,) = raw.read(path, columns=["Layer"])
    found: dict[str, list[shapely.LineString]] = {}
    for name, shape in zip(names, shapes, strict=True):
        found.setdefault(name, []).append(shapely.from_wkb(shape))
    return found


def rings(edges: list[shapely.LineString]) -> list[shapely.Polygon]:
    """The rings that edges close to, least first; no end is left over."""
    # Ends of neighbours differ in the last digits.
    snapped = shapely.set_precision(edges, NANOMETRE)
    polygons, *loose = shapely.polygonize_full(snapped)
    assert [list(left.geoms) for left in loose] == [[], [], []]
    return sorted(polygons.geoms, key=lambda polygon: float(polygon.area))


def areas(polygons: list[shapely.Polygon]) -> list[float]:
    return [polygon.area for polygon in polygons]


@pytest.mark.parametrize("profile", PROFILES)
def test_every_contour_has_its_area(profile: DxfProfile, sheet: Sheet) -> None:
    found = lines(sheet.files[profile])
    outers, holes = areas(rings(found["CUT_OUTER"])), areas(rings(found["CUT_INNER"]))
    assert outers == pytest.approx(sheet.outers, rel=EXACT)
    assert holes == pytest.approx(sheet.holes, rel=EXACT)
    contours_are_as_on_the_page("GDAL (pyogrio 0.13)", sheet, outers, holes)


def test_every_contour_is_one_closed_ring(sheet: Sheet) -> None:
    found = lines(sheet.files["bulges"])
    contours = found["CUT_OUTER"] + found["CUT_INNER"]
    assert len(contours) == len(sheet.outers) + len(sheet.holes)
    assert all(contour.is_ring for contour in contours)


@pytest.mark.parametrize("profile", PROFILES)
def test_layers_come_in_cutting_order(profile: DxfProfile, sheet: Sheet) -> None:
    assert list(lines(sheet.files[profile])) == ["ENGRAVE", "CUT_INNER", "CUT_OUTER", "REFERENCE"]


@pytest.mark.parametrize("profile", PROFILES)
def test_parts_lie_inside_the_border_and_letters_outside_the_parts(
    profile: DxfProfile, sheet: Sheet
) -> None:
    found = lines(sheet.files[profile])
    (frame,) = rings(found["REFERENCE"])
    assert frame.bounds == pytest.approx((0.0, 0.0, WIDTH, LENGTH), abs=NANOMETRE)
    parts = shapely.union_all(rings(found["CUT_OUTER"]))
    usable = shapely.box(BORDER, BORDER, WIDTH - BORDER, LENGTH - BORDER)
    assert usable.buffer(NANOMETRE).contains(parts)
    assert all(frame.contains(run) and parts.disjoint(run) for run in found["ENGRAVE"])


@pytest.mark.parametrize("profile", PROFILES)
def test_the_pin_plate_has_a_hole_for_every_pin(
    profile: DxfProfile, sheets: dict[str, Sheet]
) -> None:
    found = lines(sheets["3dof-15mm TPE"].files[profile].with_name("fixture.dxf"))
    holes = rings(found["CUT_INNER"])
    # Lobes of 6.5 mm stand 4.25 from the axis in an overall diameter of 15; their bores are 1 mm.
    turns = [math.radians(turn) for turn in (0, 120, 240)]
    bores = [shapely.Point(4.25 * math.cos(turn), 4.25 * math.sin(turn)) for turn in turns]
    expected = [math.pi * 0.5**2] * 3 + [math.pi * 1.0**2]
    assert areas(holes) == pytest.approx(expected, rel=EXACT)
    for bore in (*bores, shapely.Point(0, 0)):
        assert min(bore.distance(hole.centroid) for hole in holes) < 1e-5
