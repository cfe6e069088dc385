"""Drawn pocket outlines, against closed formulas and the drawing libraries' own flattening."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import pytest
import shapely

from sbafab.design.outline import described_outline, read_outline
from sbafab.errors import DesignError
from sbafab.geometry.edges import Arc, Line
from sbafab.geometry.region import Region, disc, stadium
from tests.design.drawing import PAGE, dxf, svg

SLOT = stadium((0, 0), 4, 10).turned(90)


def same_shape(region: Region, other: Region) -> bool:
    return (region - other).area + (other - region).area < 1e-6


def slot_of_pieces(space: Any) -> None:
    """Lines and arcs out of order and direction, one joint 0.4 um open."""
    space.add_line((-3, -2), (3, -2))
    space.add_arc((3, 0), 2, -90, 90)
    space.add_line((-3, 2), (3, 2.0004))
    space.add_arc((-3, 0), 2, 90, 270)


SLOTS: dict[str, Callable[[Any], object]] = {
    "clockwise": lambda m: m.add_lwpolyline(
        [(3, -2, 0), (-3, -2, -1), (-3, 2, 0), (3, 2, -1)], format="xyb", close=True
    ),
    "seen from behind": lambda m: m.add_lwpolyline(
        [(-3, -2, 0), (3, -2, 1), (3, 2, 0), (-3, 2, 1)],
        format="xyb",
        close=True,
        dxfattribs={"extrusion": (0, 0, -1)},
    ),
    "heavy polyline": lambda m: m.add_polyline2d(
        [(-3, -2, 0), (3, -2, 1), (3, 2, 0), (-3, 2, 1)], format="xyb", close=True
    ),
    "lines and arcs": slot_of_pieces,
}


@pytest.mark.parametrize("name", SLOTS)
def test_a_slot_is_read_exactly_however_it_is_drawn(tmp_path: Path, name: str) -> None:
    region = read_outline(dxf(tmp_path, SLOTS[name]))
    assert region.area == pytest.approx(24 + 4 * math.pi, abs=2e-3)
    assert (region - SLOT).area + (SLOT - region).area < 2e-3
    assert region.contours[0].area > 0
    kinds = [type(edge) for edge in region.edges]
    assert (kinds.count(Line), kinds.count(Arc)) == (2, 4)
    # No number of numpy: what is not plain is not written into laminate.json.
    assert {type(edge.ccw) for edge in region.edges if isinstance(edge, Arc)} == {bool}
    for edge, after in zip(region.edges, (*region.edges[1:], region.edges[0]), strict=True):
        assert edge.end == after.start


def test_what_is_hidden_or_lettering_is_no_outline(tmp_path: Path) -> None:
    def draw(space: Any) -> None:
        space.doc.layers.add("OFF").off()
        space.doc.layers.add("FROZEN").freeze()
        for layer in ("OFF", "FROZEN"):
            space.add_circle((0, 0), 9, dxfattribs={"layer": layer})
        space.add_blockref("B", (0, 0), dxfattribs={"layer": "OFF"})
        space.add_circle((0, 0), 3, dxfattribs={"layer": "not in the table"})
        space.add_text("pocket")
        space.add_point((0, 0, 7))

    assert same_shape(read_outline(dxf(tmp_path, draw)), disc((0, 0), 3))


@pytest.mark.parametrize(("unit", "mm"), [(0, 1), (1, 25.4), (4, 1), (5, 10), (6, 1000)])
def test_dxf_units_are_honoured(tmp_path: Path, unit: int, mm: float) -> None:
    path = dxf(tmp_path, lambda m: m.add_circle((0, 0.1 / mm), 2.5 / mm), unit)
    assert read_outline(path) == disc((0, 0.1), 2.5)
    assert described_outline(path)[1].startswith("drawn outline: 5.000 x 5.000 mm, ")


def test_an_arc_of_more_than_half_a_turn(tmp_path: Path) -> None:
    bulge = math.tan(math.radians(270) / 4)
    half = 2 * math.sin(math.radians(45))
    region = read_outline(
        dxf(
            tmp_path,
            lambda m: m.add_lwpolyline(
                [(-half, -half, 0), (half, -half, bulge)], format="xyb", close=True
            ),
        )
    )
    # Three quarters of a disc of radius 2 and the triangle that closes them.
    assert region.area == pytest.approx(0.75 * 4 * math.pi + 2)
    assert region.bounds == pytest.approx((-2, -half, 2, 2))


CURVED: dict[str, Callable[[Any], Any]] = {
    "ellipse": lambda m: m.add_ellipse((0.5, 0), (5, 1), 0.4),
    "ellipse from behind": lambda m: m.add_ellipse(
        (0.5, 0), (5, 1), 0.4, dxfattribs={"extrusion": (0, 0, -1)}
    ),
    "fit points": lambda m: m.add_spline([(5, 0, 0), (0, 5, 0), (-5, 0, 0), (0, -5, 0), (5, 0, 0)]),
}


@pytest.mark.parametrize("name", CURVED)
def test_dxf_curves_agree_with_the_flattening_of_ezdxf(tmp_path: Path, name: str) -> None:
    drawn = CURVED[name](ezdxf.new().modelspace())
    ring = shapely.Polygon([(p.x, p.y) for p in drawn.flattening(1e-5, 64)])
    region = read_outline(dxf(tmp_path, CURVED[name]))
    ours = shapely.Polygon(region.polygons(1e-5)[0][0])
    assert ours.exterior.hausdorff_distance(ring.exterior) < 0.0006


def test_a_rational_spline_that_is_a_circle_becomes_a_disc(tmp_path: Path) -> None:
    corners = [(5, 0), (5, 5), (0, 5), (-5, 5), (-5, 0), (-5, -5), (0, -5), (5, -5), (5, 0)]
    region = read_outline(
        dxf(
            tmp_path,
            lambda m: m.add_rational_spline(
                [(*p, 0) for p in corners],
                [1, math.sqrt(0.5)] * 4 + [1],
                degree=2,
                knots=[0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4],
            ),
        )
    )
    assert same_shape(region, disc((0, 0), 5))
    assert region.contours[0].circle is not None


ROUNDED = 60 - (4 - math.pi)
SVG_AREAS = {
    "circle": ('<circle r="2.5"/>', PAGE, math.pi * 6.25),
    "pixels of a page in mm": ('<circle r="96"/>', 'width="9mm" height="9mm"', math.pi * 25.4**2),
    "narrower page": (
        '<circle r="1"/>',
        'width="4cm" height="9cm" viewBox="0 0 8 8"',
        math.pi * 25,
    ),
    "rounded rect": ('<rect x="-5" y="-3" width="10" height="6" rx="1"/>', PAGE, ROUNDED),
    "turned and doubled": (
        '<g transform="scale(2)"><rect x="-5" y="-3" width="10" height="6" rx="1" '
        'transform="rotate(30)"/></g>',
        PAGE,
        4 * ROUNDED,
    ),
    "path of arcs": ('<path d="M-3-2h6a2,2 0 0 1 0,4h-6a2,2 0 0 1 0-4z"/>', PAGE, 24 + 4 * math.pi),
    "definitions and hidden shapes": (
        '<defs><circle r="1"/></defs><circle r="2" display="none"/><circle r="3"/>',
        PAGE,
        9 * math.pi,
    ),
}


@pytest.mark.parametrize("name", SVG_AREAS)
def test_svg_shapes_of_lines_and_arcs_are_exact(tmp_path: Path, name: str) -> None:
    body, page, area = SVG_AREAS[name]
    assert read_outline(svg(tmp_path, body, page)).area == pytest.approx(area, rel=1e-7)


def test_svg_ellipses_are_fitted(tmp_path: Path) -> None:
    squeezed = '<g transform="scale(2,1)"><circle r="2.5" transform="rotate(30)"/></g>'
    region = read_outline(svg(tmp_path, squeezed))
    ring = shapely.affinity.scale(shapely.Point(0, 0).buffer(1, 4096), 5, 2.5)
    ours = shapely.Polygon(region.polygons(1e-5)[0][0])
    assert ours.exterior.hausdorff_distance(ring.exterior) < 0.0006
    assert len(region.edges) < 60


@pytest.mark.parametrize("centre", [(10.0, 1.0), (2.0, 0.0), (-92.4, 121.3)])
def test_an_outline_drawn_elsewhere_is_centred_on_its_centroid(
    tmp_path: Path, centre: tuple[float, float]
) -> None:
    region, description = described_outline(dxf(tmp_path, lambda m: m.add_circle(centre, 2)))
    assert region.bounds == pytest.approx((-2, -2, 2, 2), abs=1e-6)
    assert description.endswith("centred on its centroid")


@pytest.mark.parametrize(
    ("unit", "said"),
    [
        (0, "6.000 x 6.000 mm, read at 1 mm a unit, for the file names no unit"),
        (1, "152.400"),
        (4, "6.000 x 6.000 mm, drawn in mm"),
        (5, "60.000 x 60.000 mm, drawn in cm"),
    ],
)
def test_the_size_that_is_understood_is_said(tmp_path: Path, unit: int, said: str) -> None:
    path = dxf(tmp_path, lambda m: m.add_circle((0, 0), 3), unit)
    if unit == 1:
        with pytest.raises(DesignError, match=r"measures 152\.4 x 152\.4 mm"):
            described_outline(path)
    else:
        assert described_outline(path)[1].startswith(f"drawn outline: {said}")
