"""Whole nanometres, and contours in the order in which they are read."""

from __future__ import annotations

import random

from sbafab.geometry.contour import circle, in_reading_order, nanometres
from sbafab.geometry.region import rectangle


def test_nearest_nanometre_either_side_of_zero() -> None:
    assert [nanometres(x) for x in (0.0, 1.2e-6, -1.2e-6, 1.7e-6, -1.7e-6, 12.345678)] == [
        0,
        1,
        -1,
        2,
        -2,
        12_345_678,
    ]


def test_what_differs_by_less_is_in_one_order() -> None:
    hair = 3e-7
    left = rectangle((-2.0, -1.0), (-1.0, 1.0))
    lower = rectangle((1.0, -3.0), (2.0, -2.0))
    upper = rectangle((1.0 - hair, 2.0), (2.0, 3.0))
    hole = circle((0.0, 0.0), 0.25).reversed()
    expected = (left.contours[0], lower.contours[0], upper.contours[0], hole)
    shuffled = list(expected)
    for seed in range(20):
        random.Random(seed).shuffle(shuffled)
        assert in_reading_order(shuffled) == expected
