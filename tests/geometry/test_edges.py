"""Single edges and runs of them: bulges, bounds, nearest points, parallel edges, meeting points."""

from __future__ import annotations

import math
import pickle
import random
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sbafab.geometry import edge_table
from sbafab.geometry.arcs import (
    TOLERANCE,
    FitError,
    bezier,
    ellipse,
    elliptical_arc,
    fit_arcs,
)
from sbafab.geometry.contour import Contour, tidy
from sbafab.geometry.edge_table import touching
from sbafab.geometry.edges import (
    EPSILON,
    Arc,
    Bounds,
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
from sbafab.geometry.spatial_index import EdgeIndex, close_pairs
from tests.quick import few

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


# Boxes and edges near each other, against a look at every one of them.


# Whole numbers, so that many boxed touch at an edge or a corner.
grid = st.integers(0, 40).map(float)
boxed = st.builds(
    lambda x, y, w, h: (x, y, x + w, y + h), grid, grid, *[st.integers(0, 6).map(float)] * 2
)


def meet(a: Bounds, b: Bounds, reach: float = 0.0) -> bool:
    across = max(a[0] - b[2], b[0] - a[2])
    return across <= reach and max(a[1] - b[3], b[1] - a[3]) <= reach


@given(st.lists(boxed, max_size=40), st.sampled_from([0.0, 1.5]))
def test_close_pairs_come_within_reach(listed: list[Bounds], reach: float) -> None:
    expected = {(i, j) for j, b in enumerate(listed) for i in range(j) if meet(listed[i], b, reach)}
    pairs = close_pairs(listed, reach)
    assert {(min(pair), max(pair)) for pair in pairs} == expected
    assert len(pairs) == len(expected)


@given(st.lists(boxed, max_size=20), st.lists(boxed, max_size=20))
def test_boxes_touch_in_arrays(queries: list[Bounds], targets: list[Bounds]) -> None:
    columns = [np.array(each, dtype=float).reshape(-1, 4).T for each in (queries, targets)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(edge_table, "AT_ONCE", 20)
        pairs = zip(*(numbers.tolist() for numbers in touching(*columns)), strict=True)
    expected = [(i, j) for i, a in enumerate(queries) for j, b in enumerate(targets) if meet(a, b)]
    assert list(pairs) == expected


def scattered(draw: random.Random) -> list[Edge]:
    edges: list[Edge] = []
    for _ in range(60):
        x, y = draw.uniform(0, 20), draw.uniform(0, 10)
        turn, length = draw.uniform(0, math.tau), draw.choice([0.1, 1.0, 8.0])
        end = (x + length * math.cos(turn), y + length * math.sin(turn))
        edges.append(edge_from_bulge((x, y), end, draw.choice([0.0, 1.0, draw.uniform(-1, 1)])))
    return edges


@pytest.mark.parametrize("seed", range(4))
def test_an_index_knows_the_edges_in_a_box_and_the_nearest_one(seed: int) -> None:
    draw = random.Random(seed)
    edges = scattered(draw)
    index = EdgeIndex(edges)
    for _ in range(40):
        x, y, size = draw.uniform(-5, 25), draw.uniform(-5, 15), draw.choice([0.0, 0.5, 40.0])
        box = (x, y, x + size, y + size)
        expected = [number for number, edge in enumerate(edges) if meet(edge.bounds, box)]
        assert index.numbers(box) == expected
        inside = [box[0] <= b[0] and box[1] <= b[1] and b[2] <= box[2] and b[3] <= box[3]
                  for b in (edge.bounds for edge in edges)]  # fmt: skip
        assert index.all_within(box) == all(inside)
        for p in ((x, y), draw.choice(edges).at(draw.random())):
            assert index.distance(p) == min(distance_to(edge, p) for edge in edges)


# Arcs fitted to curves, against the curves themselves and closed formulas.


FULL = (0.0, math.tau)
CURVES = {
    "ellipse": (ellipse((1, 2), (5, 0), (0, 3)), FULL),
    "flat ellipse": (ellipse((0, 0), (20, 0), (0, 0.5)), FULL),
    "sheared ellipse": (ellipse((0, 0), (5, 1), (2, 3)), FULL),
    "S with inflection": (bezier([(0, 0), (1, 3), (4, -3), (5, 0)]), (0.0, 1.0)),
    "quadratic": (bezier([(0, 0), (4, 3), (5, 0)]), (0.0, 1.0)),
    "loop": (bezier([(0, 0), (10, 5), (-5, 5), (5, 0)]), (0.0, 1.0)),
    "handle of no length": (bezier([(0, 0), (0, 0), (4, 3), (5, 0)]), (0.0, 1.0)),
}


@pytest.mark.parametrize("name", few(CURVES, 3))
def test_arcs_stay_within_the_tolerance_of_the_curve(name: str) -> None:
    curve, (first, last) = CURVES[name]
    edges = fit_arcs(curve, first, last)
    count = 3000
    worst = max(
        min(distance_to(edge, curve(first + (last - first) * k / count)[0]) for edge in edges)
        for k in range(count + 1)
    )
    assert worst <= TOLERANCE
    # It is the tolerance that ends each span, so a closer fit would mean needless arcs.
    assert worst > TOLERANCE / 4


@pytest.mark.parametrize("name", CURVES)
def test_neighbours_meet_and_share_a_tangent(name: str) -> None:
    curve, (first, last) = CURVES[name]
    edges = fit_arcs(curve, first, last)
    assert edges[0].start == curve(first)[0]
    assert edges[-1].end == curve(last)[0]
    for before, after in pairwise(edges):
        assert before.end == after.start
        (ux, uy), (vx, vy) = before.direction(before.end), after.direction(after.start)
        assert math.atan2(ux * vy - uy * vx, ux * vx + uy * vy) == pytest.approx(0, abs=1e-5)


def test_half_axes_of_a_circle_give_exact_arcs() -> None:
    edges = elliptical_arc((1, 2), (3, 4), (-4, 3), *FULL)
    assert [type(edge) for edge in edges] == [Arc] * 4
    assert Contour(edges).circle == ((1, 2), 5)
    assert Contour(edges).area == pytest.approx(25 * math.pi, rel=1e-12)


def test_mirrored_half_axes_and_a_falling_parameter_turn_the_other_way() -> None:
    mirrored = elliptical_arc((0, 0), (5, 0), (0, -3), *FULL)
    falling = elliptical_arc((0, 0), (5, 0), (0, 3), math.tau, 0.0)
    for edges in (mirrored, falling):
        assert Contour(edges).area == pytest.approx(-math.pi * 15, rel=1e-4)


def _spike(t: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """The semicubical parabola: a cusp at the origin."""
    return (t**2, t**3), (2 * t, 3 * t**2)


def test_a_cusp_is_refused_with_its_place() -> None:
    with pytest.raises(FitError, match=r"cusp near x -?0\.0\d+, y -?0\.0\d+"):
        fit_arcs(_spike, -1.0, 1.0)
