"""Points pooled, shapes shifted by less than anything cut can show."""

from __future__ import annotations

import itertools
from random import Random

import pytest

from sbafab.geometry.arrangement import PointPool
from sbafab.geometry.edges import SAME, Point
from sbafab.geometry.region import Region, difference, disc, intersection, rectangle, stadium, union
from tests.quick import few

STEPS = [(0.95 * SAME * i, 0.0) for i in range(5)]


def groups(points: list[Point]) -> set[frozenset[Point]]:
    pool = PointPool(points)
    by_leader: dict[Point, set[Point]] = {}
    for p in points:
        by_leader.setdefault(pool.snapped(p), set()).add(p)
    assert all(leader == min(group) for leader, group in by_leader.items())
    return {frozenset(group) for group in by_leader.values()}


def test_a_chain_of_points_is_one_point_in_any_order() -> None:
    for order in itertools.permutations(STEPS):
        assert groups(list(order)) == {frozenset(STEPS)}


def test_groups_are_what_hangs_together_by_short_steps() -> None:
    """Against every pair of points, grouped by hand."""
    random = Random(5)
    for _ in range(50):
        points = [(random.uniform(0, 40) * SAME, random.uniform(-9, 9) * SAME) for _ in range(120)]
        expected: list[set[Point]] = []
        for p in points:
            near = [g for g in expected if any(abs(complex(*p) - complex(*q)) < SAME for q in g)]
            expected = [g for g in expected if g not in near] + [{p}.union(*near)]
        random.shuffle(points)
        assert groups(points) == {frozenset(group) for group in expected}


def test_an_end_leads_before_a_crossing() -> None:
    pool = PointPool([(1e-6, 0.0)], [(0.0, 0.0)])
    assert pool.snapped((0.0, 0.0)) == (1e-6, 0.0)


SHAPES: list[Region] = [
    disc((0.1, 0.2), 3.25),
    stadium((0, 0), 5, 12),
    stadium((0, 0), 5, 12) - disc((0, 2), 1),
    rectangle((-1, -2), (3, 4)),
    disc((0, 0), 3.25) - disc((0, 0), 0.5),
    disc((0, 0), 2) & disc((1.5, 0), 2),
    disc((0, 0), 7.5) - rectangle((-20, -20), (20, 7.4)),
]


@pytest.mark.parametrize("shape", few(SHAPES, 3))
def test_shapes_shifted_by_a_hair(shape: Region) -> None:
    """Areas add up, and what is left of a shape is at most a band as wide as the shift."""
    around = sum(contour.length for contour in shape.contours)
    for angle in (0, 17.3):
        a = shape.turned(angle)
        for power in range(-28, -11):
            shift = 10 ** (power / 4)
            for dx, dy in ((1, 0), (0, 1), (0.6, 0.8)):
                b = a.moved(dx * shift, dy * shift)
                common = intersection(a, b).area
                room = (8e-6 + 1e-9) * around
                assert union([a, b]).area + common == pytest.approx(2 * a.area, abs=room)
                rest = difference(a, b).area
                assert rest == pytest.approx(a.area - common, abs=room)
                assert rest <= shift * around / 2 + room
