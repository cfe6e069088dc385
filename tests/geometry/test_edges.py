"""Single edges: bulges, bounds, nearest points, parallel edges."""

from __future__ import annotations

import math

import pytest

from sbafab.geometry.edges import (
    Arc,
    Line,
    distance_to,
    edge_from_bulge,
    left_normal,
    meeting_points,
    unit,
)

QUARTER = Arc((3.0, 1.0), (1.0, 3.0), (1.0, 1.0), 2.0, True)
HALF = Arc((3.0, 1.0), (-1.0, 1.0), (1.0, 1.0), 2.0, True)


@pytest.mark.parametrize(("arc", "turn"), [(QUARTER, 90), (HALF, 180)])
def test_bulge_is_the_tangent_of_a_quarter_of_the_sweep(arc: Arc, turn: float) -> None:
    assert arc.bulge == pytest.approx(math.tan(math.radians(turn) / 4), abs=1e-15)
    assert arc.reversed().bulge == pytest.approx(-arc.bulge, abs=1e-15)


@pytest.mark.parametrize("bulge", [0.2, -0.37, 1.0, -1.0])
def test_an_arc_comes_back_from_its_bulge(bulge: float) -> None:
    edge = edge_from_bulge((0.3, -0.2), (1.7, 2.1), bulge)
    assert isinstance(edge, Arc)
    assert edge.bulge == pytest.approx(bulge, abs=1e-12)
    assert math.dist(edge.centre, edge.start) == pytest.approx(math.dist(edge.centre, edge.end))
    assert edge.ccw is (bulge > 0)


def test_a_bulge_of_zero_is_a_line() -> None:
    assert edge_from_bulge((0, 0), (1, 2), 0.0) == Line((0, 0), (1, 2))


def test_length_and_segment_area_of_a_quarter_arc() -> None:
    assert QUARTER.length == pytest.approx(math.pi)
    assert QUARTER.segment_area == pytest.approx(4 * (math.pi / 4 - 1 / 2))
    assert QUARTER.reversed().segment_area == pytest.approx(-QUARTER.segment_area)


@pytest.mark.parametrize(
    ("first", "last", "box"),
    [
        (-45, 45, (1 + math.sqrt(2), 1 - math.sqrt(2), 3, 1 + math.sqrt(2))),
        (45, 135, (1 - math.sqrt(2), 1 + math.sqrt(2), 1 + math.sqrt(2), 3)),
        (135, 225, (-1, 1 - math.sqrt(2), 1 - math.sqrt(2), 1 + math.sqrt(2))),
        (225, 315, (1 - math.sqrt(2), -1, 1 + math.sqrt(2), 1 - math.sqrt(2))),
        (0, 180, (-1, 1, 3, 3)),
        (90, 270, (-1, -1, 1, 3)),
        (50, 60, None),
    ],
)
def test_bounds_hold_the_quadrant_points_passed(
    first: float, last: float, box: tuple[float, float, float, float] | None
) -> None:
    start, end = HALF.on_circle(math.radians(first)), HALF.on_circle(math.radians(last))
    arc = Arc(start, end, HALF.centre, HALF.radius, True)
    expected = box or (end[0], start[1], start[0], end[1])
    assert arc.bounds == pytest.approx(expected, abs=1e-12)
    assert arc.reversed().bounds == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((4.0, 4.0), 3 * math.sqrt(2) - 2),
        ((1.5, 1.5), 2 - math.sqrt(0.5)),
        ((3.0, 0.0), 1.0),
        ((0.0, 3.0), 1.0),
        ((-1.0, -1.0), math.hypot(2, 4)),
        ((1.0, 1.0), 2.0),
    ],
)
def test_distance_to_a_quarter_arc(point: tuple[float, float], distance: float) -> None:
    assert distance_to(QUARTER, point) == pytest.approx(distance)
    assert distance_to(QUARTER.reversed(), point) == pytest.approx(distance)


def test_distance_to_a_line_ends_at_its_ends() -> None:
    line = Line((0, 0), (4, 3))
    assert distance_to(line, (7, 7)) == pytest.approx(5)
    assert distance_to(line, (-3, 4)) == pytest.approx(5)


def test_a_point_at_half_the_length_halves_both_kinds_of_edge() -> None:
    assert Line((0, 0), (4, 2)).at(0.5) == (2, 1)
    assert QUARTER.at(0.5) == pytest.approx((1 + math.sqrt(2), 1 + math.sqrt(2)))
    assert QUARTER.parameter(QUARTER.at(0.25)) == pytest.approx(0.25)


def test_parallel_edges_lie_to_the_right_of_travel() -> None:
    assert Line((0, 0), (2, 0)).offset(0.5) == Line((0, -0.5), (2, -0.5))
    outward = QUARTER.offset(0.5)
    inward = QUARTER.reversed().offset(0.5)
    assert outward is not None
    assert inward is not None
    assert (outward.radius, inward.radius) == (2.5, 1.5)
    assert outward.start == pytest.approx((3.5, 1.0))
    assert QUARTER.reversed().offset(2.0) is None


def test_left_of_a_counter_clockwise_arc_is_its_centre() -> None:
    assert left_normal(QUARTER, QUARTER.start) == pytest.approx((-1, 0))
    assert left_normal(Line((0, 0), (1, 0)), (0.5, 0)) == pytest.approx((0, 1))


def test_crossing_circles_meet_where_the_formula_says() -> None:
    # Unit circles 1 apart cross at x = 1/2, y = sqrt(3)/2.
    a = Arc((1, 0), (-1, 0), (0, 0), 1.0, True)
    b = Arc((2, 0), (0, 0), (1, 0), 1.0, True)
    (crossing,) = [p for p in meeting_points(a, b) if p[1] > 0.1]
    assert crossing == pytest.approx((0.5, math.sqrt(0.75)), abs=1e-12)


def test_tangent_circles_meet_once() -> None:
    a = Arc((0, -1), (0, 1), (0, 0), 1.0, True)
    b = Arc((3, 2), (3, -2), (3, 0), 2.0, True)
    assert meeting_points(a, b) == [pytest.approx((1, 0))]


def test_overlapping_lines_meet_at_the_ends_of_the_shared_stretch() -> None:
    points = meeting_points(Line((0, 0), (3, 0)), Line((5, 0), (2, 0)))
    assert sorted(points) == [(2, 0), (3, 0)]


def test_lines_that_stop_short_of_each_other_do_not_meet() -> None:
    assert meeting_points(Line((0, 0), (1, 0)), Line((2, -1), (2, 1))) == []


def test_the_box_of_an_arc_holds_ends_that_lie_off_its_circle() -> None:
    """By 0.2 nm, as snapped ends may: here beyond the extreme of the circle that they are near."""
    for turn, side in ((180.0, 0), (270.0, 1), (0.0, 2), (90.0, 3)):
        (ux, uy), (vx, vy) = unit(turn), unit(turn + 60.0)
        start = (2.0000000002 * ux, 2.0000000002 * uy)
        arc = Arc(start, (2.0 * vx, 2.0 * vy), (0.0, 0.0), 2.0, True)
        assert arc.bounds[side] == start[side % 2]
        assert arc.reversed().bounds == arc.bounds
