"""The default engine: numbers known by closed forms, and shapely as the other judge."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import unary_union
from shapely.geometry import Point as ShapelyPoint
from shapely.geometry import Polygon, box

from sbafab.cutting.nesting import nest
from sbafab.cutting.placements import Nest, NestPart, Stock, check_nest
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium


def part(region: Region, count: int, pattern: str = "P01") -> NestPart:
    return NestPart("demo", pattern, 1, "TPE", region, count)


def nested(parts: Sequence[NestPart], stock: Stock) -> Nest:
    (result,) = nest(parts, {"TPE": stock})
    check_nest(result)
    return result


def shapely_of(region: Region) -> Polygon:
    rings = region.polygons(1e-4)[0]
    return Polygon(rings[0], rings[1:])


@pytest.mark.parametrize(("spacing", "a_row"), [(1.0, 5), (0.4, 5), (2.0, 3)])
def test_squares_fill_the_grid_they_fit_in_exactly(spacing: float, a_row: int) -> None:
    """A row of n squares of 10 mm takes 10 n + spacing (n - 1); by area, none can be added."""
    usable = 10 * a_row + spacing * (a_row - 1)
    stock = Stock(width=usable + 20, length=usable + 20, spacing=spacing)
    square = rectangle((3.0, 4.0), (13.0, 14.0))
    assert nested([part(square, a_row**2)], stock).sheets == 1
    assert nested([part(square, a_row**2 + 1)], stock).sheets == 2


def test_no_part_goes_into_a_hole_which_is_cut_before_it() -> None:
    frame = rectangle((0.0, 0.0), (40.0, 40.0)) - rectangle((5.0, 5.0), (35.0, 35.0))
    stock = Stock(width=60, length=60)
    result = nested([part(frame, 1), part(disc((0.0, 0.0), 14.0), 1, "P02")], stock)
    assert result.sheets == 2


def test_only_turns_that_the_stock_allows_are_used() -> None:
    upright = Stock(width=60, length=200, turns=(0, 2))
    result = nested([part(rectangle((0.0, 0.0), (39.0, 5.0)), 12)], upright)
    assert {place.turn % 2 for place in result.placements} == {0}


def test_a_part_as_large_as_the_usable_area_is_nested() -> None:
    stock = Stock(width=52.437, length=61.291)
    whole = rectangle((1.0, 1.0), (33.437, 42.291))
    assert nested([part(whole, 2)], stock).sheets == 2


def test_parts_keep_clear_of_pins() -> None:
    pins = ((20.0, 20.0, 6.0), (50.0, 61.0, 3.0))
    stock = Stock(width=80, length=80, border=5, spacing=1.5, pins=pins)
    result = nested([part(rectangle((0.0, 0.0), (11.0, 9.0)), 30)], stock)
    assert result.sheets == 1
    for x, y, diameter in pins:
        pin = ShapelyPoint(x, y)
        nearest = min(pin.distance(shapely_of(result.region(p))) for p in result.placements)
        assert nearest >= diameter / 2 + 1.5 - 1e-6


def test_a_roll_is_cut_off_after_its_parts() -> None:
    """Twelve squares of 10 mm, four across: three rows and two spacings between borders."""
    stock = Stock(width=63, length=5000, roll=True)
    result = nested([part(rectangle((0.0, 0.0), (10.0, 10.0)), 12)], stock)
    assert result.sheets == 1
    assert result.length(0) == pytest.approx(10 + 3 * 10 + 2 * 1 + 10)


sizes = st.floats(2.0, 14.0)
regions = st.one_of(
    sizes.map(lambda d: disc((d, -d), d / 2)),
    st.tuples(sizes, sizes).map(lambda s: rectangle((-1.0, 2.0), (s[0] - 1.0, s[1] + 2.0))),
    st.tuples(sizes, sizes).map(lambda s: stadium((0.0, 0.0), min(s), max(s))),
    st.tuples(sizes, sizes).map(
        lambda s: polygon([(0.0, 0.0), (s[0], 0.0), (s[0], 1.0), (1.0, 1.0), (1.0, s[1] + 1)])
    ),
)


@settings(max_examples=12)
@given(st.lists(st.tuples(regions, st.integers(1, 5)), min_size=1, max_size=4), st.floats(0.1, 3.0))
def test_shapely_agrees_that_random_parts_are_apart(
    chosen: list[tuple[Region, int]], spacing: float
) -> None:
    stock = Stock(width=45.0, length=50.0, border=4.0, spacing=spacing, pins=((22.0, 25.0, 2.0),))
    result = nested(
        [part(region, count, f"P{i}") for i, (region, count) in enumerate(chosen)], stock
    )
    assert len(result.placements) == sum(count for _, count in chosen)
    for sheet in range(result.sheets):
        shapes = [shapely_of(result.region(place)) for place in result.on_sheet(sheet)]
        shapes.append(ShapelyPoint(22.0, 25.0).buffer(1.0, quad_segs=200))
        least = min(
            (a.distance(b) for i, a in enumerate(shapes) for b in shapes[:i]), default=math.inf
        )
        assert least >= spacing - 5e-4
        assert box(4, 4, 41, 46).buffer(1e-5).contains(unary_union(shapes))
