from __future__ import annotations

import math

import numpy as np
import pytest

from sbafab.geometry.region import disc, rectangle
from sbafab.meshing.solid import Partition, partition


def area(plane: Partition, chosen: np.ndarray) -> float:
    a, b, c = (plane.points[plane.triangles(chosen)[:, corner]] for corner in range(3))
    u, v = b - a, c - a
    return float((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2)


def test_two_overlapping_squares_make_three_cells() -> None:
    plane = partition([rectangle((0, 0), (2, 2)), rectangle((1, 1), (3, 3))], 0.002)
    first, second = plane.inside
    assert plane.inside.shape == (2, 3)
    assert area(plane, first & second) == pytest.approx(1.0, abs=1e-9)
    assert area(plane, first & ~second) == pytest.approx(3.0, abs=1e-9)
    assert area(plane, first | second) == pytest.approx(7.0, abs=1e-9)


def test_a_difference_is_filled_round_its_hole() -> None:
    plane = partition([disc((0, 0), 2.0), disc((0, 0), 0.5)], 0.002)
    ring = plane.inside[0] & ~plane.inside[1]
    assert area(plane, ring) == pytest.approx(math.pi * (4 - 0.25), rel=1e-5)


def test_nothing_chosen_has_neither_edges_nor_triangles() -> None:
    plane = partition([disc((0, 0), 2.0)], 0.002)
    nothing = np.zeros(1, dtype=bool)
    assert len(plane.boundary(nothing)) == 0
    assert plane.triangles(nothing).shape == (0, 3)


def test_an_edge_that_crosses_another_regions_edge_is_split_there() -> None:
    plane = partition([rectangle((0, 0), (2, 2)), rectangle((1, -1), (3, 1))], 0.002)
    boundary = plane.points[plane.boundary(plane.inside[0])]
    assert len(boundary) == 6
    assert [1.0, 0.0] in boundary[:, 0].round(9).tolist()
