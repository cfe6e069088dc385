"""Edges are gathered by line and circle, and never round a corner, however finely it is drawn."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from sbafab.geometry.contour import Contour, circle, tidy
from sbafab.geometry.edges import EPSILON, Arc, Edge, Line, Point, runs, same_support, unit


def closed(points: list[Point]) -> tuple[Edge, ...]:
    return tuple(Line(a, b) for a, b in pairwise([*points, points[0]]))


def shoelace(points: list[Point]) -> float:
    return sum(x * v - u * y for (x, y), (u, v) in pairwise([*points, points[0]])) / 2


def blunt(turn: float, step: float) -> list[Point]:
    """A quadrilateral with a corner of ``turn`` radians, ``step`` mm on whose sides are edges."""
    (ux, uy), corner = (math.cos(turn), math.sin(turn)), (5.0, 0.0)
    along = [(corner[0] + ux * s, corner[1] + uy * s) for s in (step, 5.0)]
    return [(0.0, 0.0), (corner[0] - step, 0.0), corner, *along, (5.0, 1.0)]


@pytest.mark.parametrize("turn", [0.002, 0.02])
def test_a_corner_between_tiny_edges_stays(turn: float) -> None:
    points = blunt(turn, 2e-5)
    edges = closed(points)
    assert all(same_support(a, b) for a, b in pairwise(edges[:4]))
    contour = tidy(edges)
    assert contour is not None
    # A line across the corner would take 12.5 mm2 times its turn.
    assert contour.area == pytest.approx(shoelace(points), abs=1e-6)
    assert len(contour.edges) < len(edges)


def test_a_tiny_polygon_is_not_one_straight_line() -> None:
    points = [(x / 50, y / 50) for x, y in (unit(360.0 * i / 1000) for i in range(1000))]
    edges = closed(points)
    assert all(same_support(a, b) for a, b in pairwise(edges))
    contour = tidy(edges)
    assert contour is not None
    assert contour.area == pytest.approx(shoelace(points), rel=1e-3)


def test_a_spiral_of_arcs_is_no_circle() -> None:
    spiral = []
    x = 1.0
    for i in range(40):
        radius, centre = 1.0 - 1e-6 * i, x - 1.0 + 1e-6 * i
        spiral.append(
            Arc((centre + radius, 0.0), (centre - radius, 0.0), (centre, 0.0), radius, True)
        )
    assert all(same_support(a, b) for a, b in pairwise(spiral))
    result = list(runs((*spiral, Line((0.0, 0.0), (1.0, 0.0)))))
    for run in result:
        radii = [edge.radius for edge in run if isinstance(edge, Arc)]
        assert max(radii, default=0.0) - min(radii, default=0.0) <= 1.7e-5


def test_straight_edges_and_a_circle_are_one_run_each() -> None:
    square = closed([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)])
    assert [len(run) for run in runs(square)] == [3, 1, 1, 1]
    assert len(Contour(circle((0.0, 0.0), 1.0).edges).runs) == 1


@pytest.mark.parametrize("turn", [1, -1])
def test_a_sliver_does_not_take_its_lobe_with_it(turn: int) -> None:
    """5 mm of 4 nm, on average under what is dust, and a lobe at its end."""
    sliver = [(0.0, 0.0), (5.0, 0.0), (5.0, 4e-6), (0.0, 4e-6)]
    assert tidy(closed(sliver) if turn > 0 else closed(sliver[::-1])) is None
    for high, wide in ((0.0006, 0.02), (0.002, 0.01)):
        lobed = [*sliver[:2], (5.0, high), (5.0 - wide, high), (5.0 - wide, 4e-6), sliver[3]]
        contour = tidy(closed(lobed) if turn > 0 else closed(lobed[::-1]))
        assert abs(shoelace(lobed)) < 2 * EPSILON * 10
        assert contour is not None
        assert contour.area == pytest.approx(turn * shoelace(lobed), rel=1e-6)
