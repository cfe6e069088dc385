"""Edges filed by place, against a look at every one of them."""

from __future__ import annotations

import math
import random
import sys

import pytest

from sbafab.geometry import nearby
from sbafab.geometry.edges import Arc, Bounds, Edge, Line, distance_to
from sbafab.geometry.nearby import EdgeIndex, close_pairs


def scattered(seed: int) -> list[Edge]:
    draw = random.Random(seed)
    edges: list[Edge] = []
    for _ in range(60):
        x, y = draw.uniform(0, 20), draw.uniform(0, 10)
        turn, length = draw.uniform(0, math.tau), draw.choice([0.1, 1.0, 8.0])
        end = (x + length * math.cos(turn), y + length * math.sin(turn))
        if draw.random() < 0.5:
            edges.append(Line((x, y), end))
        else:
            middle = ((x + end[0]) / 2, (y + end[1]) / 2)
            edges.append(Arc((x, y), end, middle, length / 2, True))
    return edges


def meet(a: Bounds, b: Bounds) -> bool:
    return a[0] <= b[2] and b[0] <= a[2] and a[1] <= b[3] and b[1] <= a[3]


@pytest.mark.parametrize("seed", range(4))
def test_an_index_gives_the_edges_whose_boxes_meet_each_once(seed: int) -> None:
    edges = scattered(seed)
    index = EdgeIndex(edges)
    draw = random.Random(seed + 100)
    for _ in range(40):
        x, y, size = draw.uniform(-5, 25), draw.uniform(-5, 15), draw.choice([0.0, 0.5, 30.0])
        box = (x, y, x + size, y + size)
        expected = [number for number, edge in enumerate(edges) if meet(edge.bounds, box)]
        assert sorted(index.numbers(box)) == expected
        inside = all(
            box[0] <= low_x and box[1] <= low_y and high_x <= box[2] and high_y <= box[3]
            for low_x, low_y, high_x, high_y in (edge.bounds for edge in edges)
        )
        assert index.all_within(box) == inside


@pytest.mark.parametrize("seed", range(4))
def test_few_edges_come_in_the_order_of_many(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    edges = scattered(seed)
    index, draw = EdgeIndex(edges), random.Random(seed + 300)
    for _ in range(40):
        x, y, size = draw.uniform(-5, 25), draw.uniform(-5, 15), draw.choice([0.0, 3.0, 30.0])
        box = (x, y, x + size, y + size)
        monkeypatch.setattr(nearby, "FEW_EDGES", 100)
        few = index.numbers(box)
        monkeypatch.setattr(nearby, "FEW_EDGES", 0)
        assert index.numbers(box) == few


@pytest.mark.parametrize("seed", range(4))
def test_the_distance_is_that_of_the_nearest_edge(seed: int) -> None:
    edges = scattered(seed)
    index = EdgeIndex(edges)
    draw = random.Random(seed + 200)
    for _ in range(40):
        p = draw.uniform(-30, 50), draw.uniform(-30, 40)
        assert index.distance(p) == pytest.approx(min(distance_to(edge, p) for edge in edges))


@pytest.mark.parametrize("reach", [0.0, 0.7])
def test_pairs_of_many_boxes_come_as_those_of_few(
    reach: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = random.Random(5)
    boxes: list[Bounds] = []
    for _ in range(600):
        x, y = draw.choice([round(draw.uniform(0, 50)), draw.uniform(0, 50)]), draw.uniform(0, 50)
        size = draw.choice([0.0, 0.5, 9.0])
        boxes.append((x, y, x + size, y + size * draw.random()))
    pairs = list(close_pairs(boxes, reach))
    monkeypatch.setattr(nearby, "AT_ONCE", 100)
    assert list(close_pairs(boxes, reach)) == pairs
    monkeypatch.setattr(nearby, "MANY_BOXES", sys.maxsize)
    assert list(close_pairs(boxes, reach)) == pairs
    monkeypatch.setattr(nearby, "FEW_BOXES", sys.maxsize)
    assert list(close_pairs(boxes, reach)) == pairs
    assert len(pairs) > 500


def test_the_distance_to_a_single_edge_is_found_from_anywhere() -> None:
    index = EdgeIndex([Line((0.0, 0.0), (1.0, 0.0))])
    for x, y, expected in ((0.5, 3.0, 3.0), (-1.9, 0.0, 1.9), (5.0, 3.0, 5.0), (0.2, -0.1, 0.1)):
        assert index.distance((x, y)) == pytest.approx(expected)


def test_an_empty_index_holds_nothing() -> None:
    index = EdgeIndex([])
    assert list(index.numbers((-1.0, -1.0, 1.0, 1.0))) == []
    assert index.distance((0.0, 0.0)) == math.inf


def test_close_pairs_are_those_whose_boxes_come_within_reach() -> None:
    draw = random.Random(11)
    corners = [(draw.uniform(0, 50), draw.uniform(0, 50)) for _ in range(80)]
    boxes = [(x, y, x + draw.uniform(0, 6), y + draw.uniform(0, 6)) for x, y in corners]
    for reach in (0.0, 1.5):
        expected = {
            frozenset((i, j))
            for i, a in enumerate(boxes)
            for j, b in enumerate(boxes[:i])
            if max(a[0] - b[2], b[0] - a[2]) <= reach and max(a[1] - b[3], b[1] - a[3]) <= reach
        }
        pairs = list(close_pairs(boxes, reach))
        assert {frozenset(pair) for pair in pairs} == expected
        assert len(pairs) == len(expected)


@pytest.mark.parametrize("seed", range(4))
def test_the_least_distance_is_that_of_all_edges_on_an_edge_and_off_it(seed: int) -> None:
    edges = scattered(seed)
    index, draw = EdgeIndex(edges), random.Random(seed)
    places = [(draw.uniform(-30, 50), draw.uniform(-30, 40)) for _ in range(20)]
    places += [edge.at(draw.random()) for edge in edges]
    for p in places:
        assert index.distance(p) == min(distance_to(edge, p) for edge in edges)
