from __future__ import annotations

import math

import pytest

from sbafab.geometry.contour import Contour, circle, facets
from sbafab.geometry.region import disc, rectangle, stadium


def shoelace(points: list[tuple[float, float]]) -> float:
    pairs = zip(points, points[1:] + points[:1], strict=True)
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in pairs) / 2


@pytest.mark.parametrize("radius", [0.05, 0.5, 2.5, 40.0])
def test_a_circle_keeps_its_area(radius: float) -> None:
    points = facets(circle((1.7, -0.3), radius), 0.002)
    assert shoelace(points) == pytest.approx(math.pi * radius**2, rel=1e-12)


@pytest.mark.parametrize("sagitta", [0.0005, 0.002, 0.02])
def test_chords_stay_within_the_sagitta(sagitta: float) -> None:
    points = facets(circle((0.0, 0.0), 2.5), sagitta)
    middle = math.dist((0.0, 0.0), [(a + b) / 2 for a, b in zip(*points[:2], strict=True)])
    reach = math.hypot(*points[0])
    assert reach - middle <= sagitta * 1.01
    assert middle < 2.5 < reach


def test_a_hole_runs_the_other_way_over_the_same_vertices() -> None:
    outer = facets(circle((0.0, 0.0), 2.5), 0.002)
    hole = facets(circle((0.0, 0.0), 2.5).reversed(), 0.002)
    assert shoelace(hole) < 0
    assert sorted(hole) == sorted(outer)


def test_how_a_circle_is_split_does_not_matter() -> None:
    whole = circle((0.0, 0.0), 2.5)
    first = whole.edges[0]
    middle = first.at(0.37)
    split = Contour(
        (first.part(first.start, middle), first.part(middle, first.end), *whole.edges[1:])
    )
    assert sorted(facets(split, 0.002)) == sorted(facets(whole, 0.002))


def test_a_stadium_keeps_its_corners_and_its_area() -> None:
    (contour,) = stadium((0.0, 0.0), 11.5, 20.0).contours
    points = facets(contour, 0.002)
    corners = {(x, y) for x in (5.75, -5.75) for y in (4.25, -4.25)}
    assert corners <= set(points)
    exact = math.pi * 5.75**2 + 11.5 * 8.5
    assert shoelace(points) == pytest.approx(exact, rel=5e-5)


def test_a_sliver_of_a_circle_still_has_three_vertices() -> None:
    (cut,) = (disc((0.0, 0.0), 1.0) & rectangle((0.999, -1.0), (2.0, 1.0))).contours
    assert len(facets(cut, 0.05)) >= 3
