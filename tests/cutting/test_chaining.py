"""Loose edges become contours, also where edges are shorter than ends may lie apart."""

from __future__ import annotations

from itertools import pairwise

import pytest

from sbafab.cutting.chaining import JOINED, check_clear, closed_loops
from sbafab.errors import OutputError
from sbafab.geometry.edges import Line, Point
from sbafab.geometry.region import disc

# A square of 1 mm whose last corner is cut off by three edges of half a micrometre each.
TINY = 0.0005
CORNERS = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.001, 1.0), (0.0007, 0.9996), (0.0003, 0.9993)]


def square(apart: float = 0.0) -> list[Line]:
    """Edges of the square, each end ``apart`` mm from where the next one starts."""
    closed: list[Point] = [*CORNERS, (0.0, 0.9992), CORNERS[0]]
    return [Line((a[0], a[1] + apart), b) for a, b in pairwise(closed)]


def test_tiny_edges_whose_ends_meet_stay() -> None:
    edges = square()
    assert min(edge.length for edge in edges) < TINY < JOINED
    (contour,) = closed_loops(edges[::-1])
    assert len(contour.edges) == len(edges)


@pytest.mark.parametrize("apart", [0.0002, 0.0009])
def test_tiny_edges_whose_ends_lie_apart_become_a_corner(apart: float) -> None:
    (contour,) = closed_loops(square(apart))
    assert 4 <= len(contour.edges) < len(square())
    assert abs(contour.area) == pytest.approx(1.0, abs=4 * JOINED)


def test_a_tiny_line_by_itself_is_refused() -> None:
    with pytest.raises(OutputError, match=r"contour open at x 3\.000, y 3\.000; close it\."):
        closed_loops([*square(), Line((3.0, 3.0), (3.0, 3.0 + TINY))])


def test_an_edge_drawn_twice_is_refused() -> None:
    edges = square()
    with pytest.raises(OutputError, match="3 edges end at x"):
        closed_loops([*edges, edges[0].reversed()])


@pytest.mark.parametrize("centre", [1.5, 0.5])
def test_circles_that_just_touch_are_refused(centre: float) -> None:
    """Discs of 1 and 0.5 mm, the small one outside (1 + 0.5) or inside (1 - 0.5)."""
    way = 1 if centre > 1 else -1
    for overlap in (0.0, 1e-5):
        small = disc((centre - way * overlap, 0.0), 0.5)
        with pytest.raises(OutputError, match=r"contours touch or cross at x 1\.000"):
            check_clear([*disc((0, 0), 1.0).contours, *small.contours])
    small = disc((centre + way * 1e-4, 0.0), 0.5)
    check_clear([*disc((0, 0), 1.0).contours, *small.contours])
