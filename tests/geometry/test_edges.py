"""Single edges and runs of them: bulges, bounds, nearest points, parallel edges, meeting points."""

from __future__ import annotations

import math
import pickle
from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sbafab.geometry.contour import tidy
from sbafab.geometry.edges import (
    EPSILON,
    Arc,
    Edge,
    Line,
    Point,
    distance_to,
    edge_from_bulge,
    left_normal,
    meeting_points,
    runs,
    same_support,
    unit,
)

places = st.tuples(st.floats(-9, 9), st.floats(-9, 9))
bulges = st.sampled_from([0.0, 1.0, -1.0]) | st.floats(0.01, 1) | st.floats(-1, -0.01)


@st.composite
def edges(draw: st.DrawFn) -> Edge:
    start, end = draw(places), draw(places)
    assume(math.dist(start, end) > 0.1)
    return edge_from_bulge(start, end, draw(bulges))


@given(edges(), places, st.floats(0, 1))
def test_an_edge_against_points_all_along_it(edge: Edge, p: Point, share: float) -> None:
    along = [edge.at(k / 2000) for k in range(2001)]
    step = edge.length / 2000
    assert sum(math.dist(a, b) for a, b in pairwise(along)) == pytest.approx(edge.length, rel=1e-5)
    assert distance_to(edge, p) == pytest.approx(min(math.dist(p, q) for q in along), abs=step)
    assert edge.farthest_from(p) == pytest.approx(max(math.dist(p, q) for q in along), abs=step)
    xs, ys = zip(*along, strict=True)
    assert edge.bounds == pytest.approx((min(xs), min(ys), max(xs), max(ys)), abs=step)
    q = edge.at(share)
    assert edge.parameter(q) == pytest.approx(share, abs=1e-6)
    for offset in (0.3, -0.3):
        moved, (nx, ny) = edge.offset(offset), left_normal(edge, q)
        if moved is not None:
            expected = (q[0] - offset * nx, q[1] - offset * ny)
            assert distance_to(moved, expected) == pytest.approx(0, abs=1e-6)
            assert edge.to_left(expected) == pytest.approx(-offset, abs=1e-6)


@given(edges())
def test_an_edge_comes_back_from_its_bulge_and_from_its_reverse(edge: Edge) -> None:
    back = edge_from_bulge(edge.start, edge.end, edge.bulge)
    assert back.bulge == pytest.approx(edge.bulge, abs=1e-12)
    turned = edge.reversed()
    assert turned.reversed() == edge
    assert turned.bulge == pytest.approx(-edge.bulge, abs=1e-12)
    assert turned.segment_area == pytest.approx(-edge.segment_area)
    assert turned.bounds == edge.bounds
    assert pickle.loads(pickle.dumps(edge)) == edge


def test_edges_that_meet() -> None:
    # Unit circles 1 apart cross at x = 1/2, y = sqrt(3)/2.
    a, b = Arc((1, 0), (-1, 0), (0, 0), 1.0, True), Arc((2, 0), (0, 0), (1, 0), 1.0, True)
    (crossing,) = [p for p in meeting_points(a, b) if p[1] > 0.1]
    assert crossing == pytest.approx((0.5, math.sqrt(0.75)), abs=1e-12)
    a, b = Arc((0, -1), (0, 1), (0, 0), 1.0, True), Arc((3, 2), (3, -2), (3, 0), 2.0, True)
    assert meeting_points(a, b) == [pytest.approx((1, 0))]
    points = meeting_points(Line((0, 0), (3, 0)), Line((5, 0), (2, 0)))
    assert sorted(points) == [(2, 0), (3, 0)]
    assert meeting_points(Line((0, 0), (1, 0)), Line((2, -1), (2, 1))) == []


# Edges are gathered by line and circle, and never round a corner, however finely it is drawn.


def closed(points: list[Point]) -> tuple[Edge, ...]:
    return tuple(Line(a, b) for a, b in pairwise([*points, points[0]]))


def shoelace(points: list[Point]) -> float:
    return sum(x * v - u * y for (x, y), (u, v) in pairwise([*points, points[0]])) / 2


def blunt(turn: float, step: float) -> list[Point]:
    """A quadrilateral with a corner of ``turn`` radians, ``step`` mm on whose sides are edges."""
    (ux, uy), corner = (math.cos(turn), math.sin(turn)), (5.0, 0.0)
    along = [(corner[0] + ux * s, corner[1] + uy * s) for s in (step, 5.0)]
    return [(0.0, 0.0), (corner[0] - step, 0.0), corner, *along, (5.0, 1.0)]


FINE = [(x / 50, y / 50) for x, y in (unit(360.0 * i / 1000) for i in range(1000))]


@pytest.mark.parametrize("points", [blunt(0.002, 2e-5), blunt(0.02, 2e-5), FINE])
def test_a_corner_or_curve_of_tiny_edges_stays(points: list[Point]) -> None:
    loop = closed(points)
    assert all(same_support(a, b) for a, b in pairwise(loop[:4]))
    contour = tidy(loop)
    assert contour is not None
    # A line across the corner would take 12.5 mm2 times its turn.
    assert contour.area == pytest.approx(shoelace(points), abs=1e-6)
    assert len(contour.edges) < len(loop)


def test_a_spiral_of_arcs_is_no_circle() -> None:
    spiral = []
    for i in range(40):
        radius, centre = 1.0 - 1e-6 * i, 1e-6 * i
        ends = (centre + radius, 0.0), (centre - radius, 0.0)
        spiral.append(Arc(*ends, (centre, 0.0), radius, True))
    assert all(same_support(a, b) for a, b in pairwise(spiral))
    for run in runs((*spiral, Line((0.0, 0.0), (1.0, 0.0)))):
        radii = [edge.radius for edge in run if isinstance(edge, Arc)]
        assert max(radii, default=0.0) - min(radii, default=0.0) <= 1.7e-5


@pytest.mark.parametrize("turn", [1, -1])
def test_a_sliver_does_not_take_its_lobe_with_it(turn: int) -> None:
    """5 mm of 4 nm, on average under what is dust, and a lobe at its end."""
    sliver = [(0.0, 0.0), (5.0, 0.0), (5.0, 4e-6), (0.0, 4e-6)]
    assert tidy(closed(sliver[::turn])) is None
    for high, wide in ((0.0006, 0.02), (0.002, 0.01)):
        lobed = [*sliver[:2], (5.0, high), (5.0 - wide, high), (5.0 - wide, 4e-6), sliver[3]]
        contour = tidy(closed(lobed[::turn]))
        assert abs(shoelace(lobed)) < 2 * EPSILON * 10
        assert contour is not None
        assert contour.area == pytest.approx(turn * shoelace(lobed), rel=1e-6)
