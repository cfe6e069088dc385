"""Boxes and edges near each other, against a look at every one of them."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sbafab.geometry import edge_table
from sbafab.geometry.edge_table import touching
from sbafab.geometry.edges import Bounds, Edge, distance_to, edge_from_bulge
from sbafab.geometry.spatial_index import EdgeIndex, close_pairs

# Whole numbers, so that many boxes touch at an edge or a corner.
places = st.integers(0, 40).map(float)
boxes = st.builds(
    lambda x, y, w, h: (x, y, x + w, y + h), places, places, *[st.integers(0, 6).map(float)] * 2
)


def meet(a: Bounds, b: Bounds, reach: float = 0.0) -> bool:
    across = max(a[0] - b[2], b[0] - a[2])
    return across <= reach and max(a[1] - b[3], b[1] - a[3]) <= reach


@given(st.lists(boxes, max_size=40), st.sampled_from([0.0, 1.5]))
def test_close_pairs_come_within_reach(listed: list[Bounds], reach: float) -> None:
    expected = {(i, j) for j, b in enumerate(listed) for i in range(j) if meet(listed[i], b, reach)}
    pairs = close_pairs(listed, reach)
    assert {(min(pair), max(pair)) for pair in pairs} == expected
    assert len(pairs) == len(expected)


@given(st.lists(boxes, max_size=20), st.lists(boxes, max_size=20))
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
