"""Faulty nests are refused with the place; distances agree with closed forms and shapely."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

from sbafab.cutting.placements import (
    Nest,
    NestPart,
    Placement,
    Stock,
    check_nest,
    check_placed,
    least_distance,
)
from sbafab.errors import OutputError
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium

SQUARE = rectangle((0.0, 0.0), (10.0, 10.0))
STOCK = Stock(width=60, length=60, border=5, pins=((50.0, 50.0, 4.0),), most=2)


def nest_of(*shifts: tuple[float, float, int], count: int | None = None) -> Nest:
    placements = len(shifts) if count is None else count
    return Nest(
        material="TPE",
        stock=STOCK,
        parts=(NestPart("demo", "P01", 1, "TPE", SQUARE, placements),),
        placements=tuple(Placement(0, sheet, 0, (x, y)) for x, y, sheet in shifts),
    )


@pytest.mark.parametrize(
    ("faulty", "message"),
    [
        (nest_of((5, 5, 0), (15.9, 5, 0)), r"are 0\.9000 mm apart at x 15\.\d+, y \d+\.\d+"),
        (nest_of((5, 5, 0), (12, 8, 0)), r"overlap at x"),
        (nest_of((5, 5, 0), (5, 5, 0)), r"overlap at x"),
        (nest_of((4.9, 5, 0)), r"0\.1000 mm into the border"),
        (nest_of((5, 45.01, 0)), r"0\.0100 mm into the border"),
        (nest_of((45, 30, 0), (45, 45, 0)), r"pin at x 50, y 50 overlap"),
        (nest_of((37.5, 45, 0)), r"pin at x 50, y 50 are 0\.5000 mm apart"),
        (nest_of((5, 5, 0), count=2), r"not nested 2 times"),
        (nest_of((5, 5, 1)), r"too many parts or sheets"),
        (nest_of((5, 5, 0), (5, 5, 1), (5, 5, 2)), r"too many parts or sheets"),
    ],
)
def test_a_faulty_nest_is_refused(faulty: Nest, message: str) -> None:
    with pytest.raises(OutputError, match=message):
        check_nest(faulty)


def test_slack_allows_for_the_rounding_of_a_file() -> None:
    regions = [("a", SQUARE.moved(5, 5)), ("b", SQUARE.moved(15.9995, 5))]
    check_placed(regions, STOCK, slack=1e-3)
    with pytest.raises(OutputError, match="a and b"):
        check_placed(regions, STOCK)


def test_nothing_may_lie_in_a_hole_which_is_cut_first() -> None:
    frame = rectangle((34.0, 34.0), (55.0, 55.0)) - rectangle((36.0, 36.0), (53.0, 53.0))
    with pytest.raises(OutputError, match="frame and inside overlap"):
        check_placed([("frame", frame), ("inside", disc((40.0, 40.0), 2.5))], STOCK)
    with pytest.raises(OutputError, match="pin"):
        check_placed([("frame", frame)], STOCK)


spots = st.tuples(st.floats(-4, 4), st.floats(-4, 4))


sizes = st.floats(0.5, 3)
shapes = st.one_of(
    st.builds(disc, spots, sizes),
    st.builds(lambda p, w, h: stadium(p, w, w + h), spots, sizes, st.floats(0, 3)),
    st.builds(lambda p, w: polygon([p, (p[0] + w, p[1]), (p[0], p[1] + 2 * w)]), spots, sizes),
)


@settings(max_examples=80)
@given(shapes, shapes, spots)
def test_shapely_finds_the_same_distance(a: Region, b: Region, shift: tuple[float, float]) -> None:
    b = b.moved(*shift)
    judge = Polygon(a.polygons(1e-5)[0][0]).distance(Polygon(b.polygons(1e-5)[0][0]))
    assert least_distance(a, b, 30.0).value == pytest.approx(judge, abs=3e-5)
