"""Lattices against packings known by closed forms, with shapely as the other judge of the gaps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import STRtree, unary_union
from shapely.geometry import Point as ShapelyPoint
from shapely.geometry import Polygon, box

from sbafab.actuators import build, load_design
from sbafab.cutting.lattice import Lattice, lattices_of
from sbafab.cutting.nesting import nest, of_material
from sbafab.cutting.placements import TURNS, Nest, NestPart, Stock, check_nest, placed
from sbafab.folders.build import make_build, stocks
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium


def best(shape: Region, spacing: float, width: float, length: float) -> Lattice:
    return lattices_of(shape, spacing, (0.0, 0.0, width, length), TURNS)[0]


def shapely_of(region: Region) -> Polygon:
    return Polygon(region.polygons(1e-4)[0][0])


def least_gap(shapes: Sequence[Polygon], near: float) -> float:
    """Return the least distance of two shapes, if it is less than ``near``."""
    outlines = np.array(shapes)
    first, second = STRtree(outlines).query(outlines, predicate="dwithin", distance=near)
    apart = first < second
    return float(
        shapely.distance(outlines[first[apart]], outlines[second[apart]]).min(initial=near)
    )


@pytest.mark.parametrize(("rows", "a_row"), [(7, 8), (8, 8), (15, 13)])
def test_discs_lie_in_the_densest_packing(rows: int, a_row: int) -> None:
    """Rows of discs half a pitch apart, sqrt(3)/2 of a pitch above each other (Thue)."""
    pitch = 11.0
    length = 10 + (rows - 1) * pitch * math.sqrt(3) / 2 + 0.002 * rows
    laid = best(disc((3.0, -2.0), 5.0), 1.0, 10 + (a_row - 1) * pitch + 0.002 * a_row, length)
    assert len(laid.places) == a_row * rows - rows // 2


@pytest.mark.parametrize("turned", [False, True])
def test_rectangles_fill_a_sheet_that_takes_two_lattices(turned: bool) -> None:
    """Two columns of 11 lying and one of 4 standing fill it: 26 x 44 mm, each with 0.5 mm of gap
    11 x 4 mm. Rows of one sort alone hold 22 or 24.
    """
    width, length = (43.5, 25.5) if turned else (25.5, 43.5)
    laid = best(rectangle((0.0, 0.0), (10.5, 3.5)), 0.5, width, length)
    assert len(laid.places) == 26 * 44 // (11 * 4)


def test_eighteen_membranes_of_a_finger_lie_on_one_sheet() -> None:
    """16 in pairs whose tabs pass each other, 117 mm wide, and two in the strip of 14.4 mm left."""
    design = load_design("finger")
    parts = of_material(make_build(design).pieces, "PTFE")
    (result,) = nest([replace(parts[0], count=18)], {"PTFE": stocks(design)["PTFE"]})
    assert result.sheets == 1
    judged(result)


def test_right_triangles_lie_in_pairs() -> None:
    """Turned by half, a triangle lies on the other's long side: 0.3 sqrt(2) mm off along x."""
    across, up = 9, 10
    pair = 10 + 0.3 * math.sqrt(2)
    width = across * pair + (across - 1) * 0.3 + 0.02
    laid = best(polygon([(0.0, 0.0), (10.0, 0.0), (0.0, 10.0)]), 0.3, width, up * 10.3 - 0.28)
    assert len(laid.places) >= 2 * across * up


sizes = st.floats(3.0, 12.0)
shapes_of_parts = st.one_of(
    sizes.map(lambda d: disc((d, -d), d / 2)),
    st.tuples(sizes, sizes).map(lambda s: stadium((0.0, 0.0), min(s), max(s))),
    st.tuples(sizes, sizes, sizes).map(lambda s: polygon([(0.0, 0.0), (s[0], 0.0), (s[1], s[2])])),
    st.tuples(sizes, sizes).map(
        lambda s: polygon(
            [(0.0, 0.0), (s[0], 0.0), (s[0], 1.0), (1.0, 1.0), (1.0, s[1] + 1), (0.0, s[1] + 1)]
        )
    ),
    sizes.map(lambda d: rectangle((0.0, 0.0), (d, 9.0)) - disc((d, 4.5), 0.4 * d)),
)


@settings(max_examples=3)
@given(shapes_of_parts, st.floats(0.05, 3.0), st.floats(30.0, 60.0), st.floats(30.0, 60.0))
def test_shapely_agrees_that_copies_are_apart(
    shape: Region, spacing: float, width: float, length: float
) -> None:
    for laid in lattices_of(shape, spacing, (2.0, 3.0, 2.0 + width, 3.0 + length), TURNS)[:2]:
        shapes = [shapely_of(placed(shape, turn, shift)) for turn, shift in laid.places]
        assert shapes
        assert least_gap(shapes, spacing) >= spacing - 2e-4
        assert box(2, 3, 2 + width, 3 + length).buffer(1e-5).contains(unary_union(shapes))


def judged(result: Nest) -> None:
    """Ask shapely for the gaps between parts and to pins."""
    stock = result.stock
    for sheet in range(result.sheets):
        shapes = [shapely_of(result.region(place)) for place in result.on_sheet(sheet)]
        pins = [ShapelyPoint(x, y).buffer(d / 2, quad_segs=100) for x, y, d in stock.pins]
        assert least_gap([*shapes, *pins], stock.spacing) >= stock.spacing - 5e-4
        assert box(*stock.usable).buffer(1e-5).contains(unary_union(shapes))


TRIANGLE = polygon([(0.0, 0.0), (9.0, 0.0), (4.0, 7.0)])
BENT = polygon([(0.0, 0.0), (8.0, 0.0), (8.0, 1.0), (1.0, 1.0), (1.0, 7.0), (0.0, 7.0)])
BITTEN = rectangle((0.0, 0.0), (6.0, 9.0)) - disc((6.0, 4.5), 2.4)


@pytest.mark.parametrize(
    ("shapes", "spacing"),
    [((TRIANGLE, BENT, disc((1.0, 2.0), 4.0)), 0.6), ((BITTEN, TRIANGLE, BENT), 1.3)],
)
def test_parts_round_lattices_and_pins_are_apart(
    shapes: tuple[Region, ...], spacing: float
) -> None:
    stock = Stock(width=64.0, length=58.0, border=4.0, spacing=spacing, pins=((31.0, 22.0, 2.5),))
    parts = [
        NestPart("demo", f"P{i}", 1, "TPE", shape, count)
        for i, (shape, count) in enumerate(zip(shapes, (70, 14, 5), strict=True))
    ]
    (result,) = nest(parts, {"TPE": stock})
    check_nest(result)
    assert result.sheets > 1
    judged(result)


def test_five_folded_pouches_lie_on_one_sheet() -> None:
    """As sparrow packs them; two lattices hold four, as bottom-left alone does."""
    design = load_design("folded", ("order.copies=4",))
    parts = of_material(make_build(design).pieces, "PE")
    stock = stocks(design)["PE"]
    low_x, low_y, high_x, high_y = stock.usable
    assert len(best(parts[0].region, stock.spacing, high_x - low_x, high_y - low_y).places) == 4
    (result,) = nest(parts, {"PE": stock})
    assert len(result.placements) == 5
    assert result.sheets == 1
    judged(result)


def test_only_turns_that_the_stock_allows_are_used() -> None:
    triangle = polygon([(0.0, 0.0), (7.0, 0.0), (2.0, 11.0)])
    for laid in lattices_of(triangle, 1.0, (0.0, 0.0, 50.0, 80.0), (0, 2)):
        assert {turn for turn, _ in laid.places} <= {0, 2}


def commonest(role: str, count: int) -> NestPart:
    """The shape that most layers of the 15 mm actuator have in a role."""
    patterns = build(load_design("3dof-15mm")).patterns.values()
    layer = max((own for own in patterns if own[0].role == role), key=len)[0]
    return NestPart("3dof", role, 1, "TPE", layer.profile, count)


def test_the_commonest_plate_lies_closer_than_bottom_left_puts_it() -> None:
    """Walls of the 15 mm actuator at 1.23 mm on 132.4 mm: 105 a sheet, 96 by bottom-left alone."""
    (result,) = nest([commonest("wall", 210)], {"TPE": Stock(spacing=1.23)})
    check_nest(result)
    assert result.sheets == 2
    judged(result)


def test_forty_lobed_plates_and_39_separators_lie_on_one_sheet() -> None:
    """On the 132.4 mm square that a border of 10 mm leaves of the press's heated area."""
    parts = [commonest("wall", 40), commonest("separator-mask", 39)]
    (result,) = nest(parts, {"TPE": Stock()})
    check_nest(result)
    assert (len(result.placements), result.sheets) == (79, 1)
