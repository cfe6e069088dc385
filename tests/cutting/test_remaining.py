"""The nearest of the points that are left, against a look at every one of them."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest

from sbafab.cutting import order
from sbafab.cutting.order import PointsLeft
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, disc


def scattered(seed: int) -> list[Point]:
    draw = random.Random(seed)
    kinds = (
        lambda: (draw.uniform(0, 100), draw.uniform(0, 100)),
        lambda: (float(draw.randint(0, 9)), float(draw.randint(0, 9))),
        lambda: (draw.choice([0.0, 500.0]) + draw.random(), draw.random()),
        lambda: (3.0, draw.uniform(-5, 5)),
        # All but on a line: cells made square after what lies across would be billions.
        lambda: (draw.uniform(0, 31), draw.uniform(0, 1e-15)),
        lambda: (1.0, 2.0),
    )
    return [kinds[seed % len(kinds)]() for _ in range(draw.choice([1, 2, 150]))]


@pytest.mark.parametrize("seed", range(24))
def test_the_nearest_is_taken_and_of_equal_ones_the_first(seed: int) -> None:
    points = scattered(seed)
    draw = random.Random(seed + 100)
    remaining, left = PointsLeft(points), list(range(len(points)))
    while left:
        p = (draw.uniform(-50, 150), draw.uniform(-50, 150))
        expected = min(left, key=lambda i: (round(math.dist(p, points[i]), 6), i))
        left.remove(expected)
        taken = remaining.take(p, lambda i, p=p: round(math.dist(p, points[i]), 6))  # type: ignore[misc]
        assert taken == expected


def plainly_undone(stops: list[Point]) -> list[Point]:
    """One sweep of 2-opt that looks at every pair."""
    stops = list(stops)
    count = len(stops) - 1
    for i in range(count - 1):
        for j in range(i + 1, min(count, i + order.LOOKED_AHEAD)):
            turned = [*stops[: i + 1], *stops[i + 1 : j + 2][::-1], *stops[j + 2 :]]
            near = slice(max(0, i), j + 3)
            old, new = (sum(math.dist(a, b) for a, b in pairwise(s[near])) for s in (stops, turned))
            if new < old - order.SHORTER:
                stops = turned
    return stops


@pytest.mark.parametrize("seed", range(6))
def test_crossings_are_undone_as_by_looking_at_every_pair(seed: int) -> None:
    draw = random.Random(seed)
    path: list[Contour] = [
        circle((draw.uniform(0, 30), draw.uniform(0, 30)), 0.1) for _ in range(70)
    ]
    starts = [(0.0, 0.0), *(contour.edges[0].start for contour in path)]
    order._undo_crossings(path, (0.0, 0.0))
    assert [contour.edges[0].start for contour in path] == plainly_undone(starts)[1:]


def test_every_contour_is_cut_once() -> None:
    draw = random.Random(3)
    contours = [
        contour
        for _ in range(300)
        for contour in disc((draw.uniform(0, 300), draw.uniform(0, 300)), 0.2).contours
    ]
    region = Region(tuple(contours))
    assert sorted(map(id, order.cutting_order(region, 3.0))) == sorted(map(id, contours))
