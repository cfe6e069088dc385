"""What is written is read back as the same contours, in every way of writing curves."""

from __future__ import annotations

import math
import re

import pytest
import shapely

from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import Surroundings, dxf_text, number
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import DxfProfile
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Line, Point
from sbafab.geometry.region import Region, disc

NAMES = ["disc", "ring", "discs", "stadium", "tab", "plate", "island"]


def outlines(region: Region) -> list[shapely.LinearRing]:
    return [shapely.LinearRing(contour.polygon(1e-4)) for contour in region.contours]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("profile", "allowed"), [("bulges", 1e-3), ("arcs", 1e-3), ("chords", 6e-3)]
)
def test_contours_come_back_within_a_micrometre(
    name: str, profile: DxfProfile, allowed: float, profiles: dict[str, Region]
) -> None:
    region = profiles[name]
    drawn = in_chords(region, None, 0.005) if profile == "chords" else region
    found = read_profile(dxf_text(cutting_order(drawn), {}, profile)).region
    assert (len(found.outers), len(found.holes)) == (len(region.outers), len(region.holes))
    expected = outlines(region)
    for ring in outlines(found):
        assert min(shapely.hausdorff_distance(ring, other) for other in expected) < allowed


@pytest.mark.parametrize("profile", ["bulges", "arcs"])
def test_arcs_stay_the_same_arcs(profile: DxfProfile, plate: Region) -> None:
    found = read_profile(dxf_text(cutting_order(plate), {}, profile)).region
    radii = sorted(round(edge.radius, 5) for edge in found.edges if isinstance(edge, Arc))
    assert radii == sorted(round(edge.radius, 5) for edge in plate.edges if isinstance(edge, Arc))
    assert math.isclose(found.area, plate.area, rel_tol=1e-8)


def test_custom_properties_come_back() -> None:
    properties = {"DESIGN": "Grüße", "WAIVED": "none", "NOTE": "two\nlines"}
    found = read_profile(dxf_text(disc((0.0, 0.0), 1.0).contours, properties)).properties
    assert found == {"DESIGN": "Grüße", "WAIVED": "none", "NOTE": "two lines"}


def test_holes_come_first_and_the_datum_last(plate: Region) -> None:
    found = read_profile(dxf_text(cutting_order(plate), {}))
    assert found.layers == (*["CUT_INNER"] * 4, "CUT_OUTER", "REFERENCE", "REFERENCE")
    assert found.other == ("LINE", "LINE")
    assert found.units == "mm"


def test_datum_can_be_left_out(plate: Region) -> None:
    assert read_profile(dxf_text(cutting_order(plate), {}, sheet=Surroundings())).other == ()


@pytest.mark.parametrize("radius", [2.0, 0.25])
def test_no_bulge_turns_more_than_a_quarter(radius: float) -> None:
    low, high = (0.0, -radius), (0.0, radius)
    half = Arc(low, high, (0.0, 0.0), radius, True)
    text = dxf_text([Contour((half, Line(high, low)))], {})
    polyline = text.split("AcDbPolyline\n")[1].split("  0\n")[0]
    bulges = [float(value) for value in re.findall(r"\n 42\n(.*)", polyline)]
    assert bulges == pytest.approx([math.tan(math.pi / 8)] * 2, abs=1e-9)
    assert math.isclose(read_profile(text).region.area, math.pi / 2 * radius**2, rel_tol=1e-8)


def test_a_large_bulge_from_elsewhere_is_read_exactly(plate_text: str) -> None:
    """Three quarters of a circle of radius 1 and the chord: area 3/4 pi + 1/2."""
    bulge = math.tan(math.radians(270) / 4)
    body = f" 90\n2\n 70\n1\n 10\n1.0\n 20\n0.0\n 42\n{bulge}\n 10\n0.0\n 20\n-1.0\n"
    start = plate_text.index("  0\nCIRCLE\n")
    end = plate_text.index("  0\nENDSEC", start)
    entity = (
        f"  0\nLWPOLYLINE\n  5\n900\n100\nAcDbEntity\n  8\nCUT_OUTER\n100\nAcDbPolyline\n{body}"
    )
    region = read_profile(plate_text[:start] + entity + plate_text[end:]).region
    assert math.isclose(region.area, 0.75 * math.pi + 0.5, rel_tol=1e-9)


def test_extents_bound_the_drawing(plate: Region, plate_text: str) -> None:
    low = re.search(r"\$EXTMIN\n 10\n(.*)\n 20\n(.*)\n", plate_text)
    high = re.search(r"\$EXTMAX\n 10\n(.*)\n 20\n(.*)\n", plate_text)
    assert low is not None
    assert high is not None
    found = [float(value) for value in (*low.groups(), *high.groups())]
    assert found == pytest.approx(plate.bounds, abs=1e-9)


@pytest.mark.parametrize(
    ("value", "text"),
    [(-0.0, "0.0"), (-1e-12, "0.0"), (2.5, "2.5"), (1e-7, "0.0000001"), (1 / 3, "0.333333333")],
)
def test_numbers_have_no_exponent_and_no_negative_zero(value: float, text: str) -> None:
    assert number(value) == text


def test_a_travel_order_visits_the_nearest_next() -> None:
    places: list[Point] = [(5.0, 0.0), (1.0, 0.0), (3.0, 0.0), (-2.5, 0.0), (4.0, 0.0)]
    sheet = disc((0.0, 0.0), 9.0)
    for place in places:
        sheet = sheet - disc(place, 0.25)
    order = [contour.circle for contour in cutting_order(sheet)]
    assert [round(circle[0][0], 6) for circle in order if circle] == [1.0, 3.0, 4.0, 5.0, -2.5, 0.0]


def test_outlines_go_on_from_the_last_hole() -> None:
    ring = disc((10.0, 0.0), 2.0) - disc((10.0, 0.0), 1.0)
    order = [contour.circle for contour in cutting_order(ring | disc((3.0, 0.0), 1.0))]
    assert [circle[0][0] for circle in order if circle] == pytest.approx([10.0, 10.0, 3.0])
