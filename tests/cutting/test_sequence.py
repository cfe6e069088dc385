"""Order of cutting: inner before outer, short travel, heat spread."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import networkx

from sbafab.cutting.sequence import cutting_sequence, travel
from sbafab.geometry.region import Region, disc, rectangle, union


def grid(columns: int, rows: int, pitch: float, radius: float) -> Region:
    """Discs on a grid, listed so that neighbours in the list are far apart."""
    places = [(pitch * column, pitch * row) for column in range(columns) for row in range(rows)]
    shuffled = sorted(places, key=lambda p: math.sin(12.9898 * p[0] + 78.233 * p[1]))
    return Region(tuple(c for p in shuffled for c in disc(p, radius).contours))


def test_holes_are_cut_before_any_outline() -> None:
    plate = union([rectangle((x, 0), (x + 8, 8)) for x in (0.0, 10.0, 20.0)]) - union(
        [disc((x + 4, 4), 1) for x in (0.0, 10.0, 20.0)]
    )
    order = cutting_sequence(plate)
    assert [contour.is_hole for contour in order] == [True] * 3 + [False] * 3


def test_scattered_cuts_are_travelled_near_their_shortest_way() -> None:
    draw = random.Random(4)
    places = [(draw.uniform(2, 98), draw.uniform(2, 98)) for _ in range(120)]
    cuts = Region(tuple(c for p in places for c in disc(p, 0.5).contours))
    joined = networkx.Graph()
    stops = [(0.0, 0.0), *((x + 0.5, y) for x, y in places)]
    joined.add_weighted_edges_from((a, b, math.dist(a, b)) for a in stops for b in stops if a < b)
    # No way is shorter than the least tree that joins all stops.
    tree = networkx.minimum_spanning_tree(joined).size(weight="weight")
    assert tree <= travel(cutting_sequence(cuts)) <= 1.35 * tree
    assert travel(cuts.contours) > 5 * tree


def test_neighbours_do_not_follow_each_other_while_others_are_left() -> None:
    field = grid(6, 6, 10.0, 4.5)
    near = 2.0

    def hot(order: tuple[object, ...]) -> int:
        boxes = [contour.bounds for contour in order]  # type: ignore[attr-defined]
        return sum(
            max(a[0] - b[2], b[0] - a[2]) < near and max(a[1] - b[3], b[1] - a[3]) < near
            for a, b in pairwise(boxes)
        )

    assert hot(cutting_sequence(field)) > 20
    assert hot(cutting_sequence(field, heat_distance=near)) <= 3
    assert travel(cutting_sequence(field, heat_distance=near)) < travel(field.contours)
