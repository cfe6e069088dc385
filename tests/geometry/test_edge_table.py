"""Boxes that touch, compared in arrays, beside every box with every other one by one."""

from __future__ import annotations

import random

import numpy as np
import pytest

from sbafab.geometry.edge_table import FEW, touching, touching_in_parts

Box = tuple[float, float, float, float]


def boxes(draw: random.Random, count: int) -> list[Box]:
    rows = []
    for _ in range(count):
        x, y = draw.randrange(40), draw.randrange(40)
        # Whole numbers, so that many touch at an edge or a corner.
        rows.append((x, y, x + draw.randrange(6), y + draw.randrange(6)))
    return [tuple(map(float, box)) for box in rows]


def touch(a: Box, b: Box) -> bool:
    return a[0] <= b[2] and b[0] <= a[2] and a[1] <= b[3] and b[1] <= a[3]


# Parts with nothing to ask, and with nothing that could be touched; and more pairs than a few.
@pytest.mark.parametrize(
    "parts",
    [
        [(7, 9)],
        [(5, 8), (0, 6), (4, 0), (30, 12)],
        [(0, 3), (2, 0)],
        [(150, 100), (3, 5), (80, 70)],
    ],
)
def test_each_part_touches_its_own_boxes_alone(parts: list[tuple[int, int]]) -> None:
    draw = random.Random(16)
    queries = [boxes(draw, count) for count, _ in parts]
    targets = [boxes(draw, count) for _, count in parts]
    expected = []
    first = other_first = 0
    for query, near in zip(queries, targets, strict=True):
        expected += [
            (first + i, other_first + j)
            for i, a in enumerate(query)
            for j, b in enumerate(near)
            if touch(a, b)
        ]
        first, other_first = first + len(query), other_first + len(near)
    columns = [
        np.array([box for part in every for box in part]).reshape(-1, 4).T
        for every in (queries, targets)
    ]
    counts, other_counts = zip(*parts, strict=True)
    query, near = touching_in_parts(columns[0], counts, columns[1], other_counts)
    assert list(zip(query.tolist(), near.tolist(), strict=True)) == expected


def test_many_boxes_are_told_as_few_are() -> None:
    draw = random.Random(17)
    queries, targets = boxes(draw, 300), boxes(draw, 200)
    assert len(queries) * len(targets) > FEW
    query, near = touching(np.array(queries).T, np.array(targets).T)
    expected = [(i, j) for i, a in enumerate(queries) for j, b in enumerate(targets) if touch(a, b)]
    assert list(zip(query.tolist(), near.tolist(), strict=True)) == expected
