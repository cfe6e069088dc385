"""Arcs fitted to curves, against the curves themselves and closed formulas."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from sbafab.geometry.arcs import (
    TOLERANCE,
    FitError,
    bezier,
    ellipse,
    elliptical_arc,
    fit_arcs,
)
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, distance_to
from tests.quick import few

FULL = (0.0, math.tau)
CURVES = {
    "ellipse": (ellipse((1, 2), (5, 0), (0, 3)), FULL),
    "flat ellipse": (ellipse((0, 0), (20, 0), (0, 0.5)), FULL),
    "sheared ellipse": (ellipse((0, 0), (5, 1), (2, 3)), FULL),
    "S with inflection": (bezier([(0, 0), (1, 3), (4, -3), (5, 0)]), (0.0, 1.0)),
    "quadratic": (bezier([(0, 0), (4, 3), (5, 0)]), (0.0, 1.0)),
    "loop": (bezier([(0, 0), (10, 5), (-5, 5), (5, 0)]), (0.0, 1.0)),
    "handle of no length": (bezier([(0, 0), (0, 0), (4, 3), (5, 0)]), (0.0, 1.0)),
}


@pytest.mark.parametrize("name", few(CURVES, 3))
def test_arcs_stay_within_the_tolerance_of_the_curve(name: str) -> None:
    curve, (first, last) = CURVES[name]
    edges = fit_arcs(curve, first, last)
    count = 3000
    worst = max(
        min(distance_to(edge, curve(first + (last - first) * k / count)[0]) for edge in edges)
        for k in range(count + 1)
    )
    assert worst <= TOLERANCE
    # It is the tolerance that ends each span, so a closer fit would mean needless arcs.
    assert worst > TOLERANCE / 4


@pytest.mark.parametrize("name", CURVES)
def test_neighbours_meet_and_share_a_tangent(name: str) -> None:
    curve, (first, last) = CURVES[name]
    edges = fit_arcs(curve, first, last)
    assert edges[0].start == curve(first)[0]
    assert edges[-1].end == curve(last)[0]
    for before, after in pairwise(edges):
        assert before.end == after.start
        (ux, uy), (vx, vy) = before.direction(before.end), after.direction(after.start)
        assert math.atan2(ux * vy - uy * vx, ux * vx + uy * vy) == pytest.approx(0, abs=1e-5)


def test_half_axes_of_a_circle_give_exact_arcs() -> None:
    edges = elliptical_arc((1, 2), (3, 4), (-4, 3), *FULL)
    assert [type(edge) for edge in edges] == [Arc] * 4
    assert Contour(edges).circle == ((1, 2), 5)
    assert Contour(edges).area == pytest.approx(25 * math.pi, rel=1e-12)


def test_mirrored_half_axes_and_a_falling_parameter_turn_the_other_way() -> None:
    mirrored = elliptical_arc((0, 0), (5, 0), (0, -3), *FULL)
    falling = elliptical_arc((0, 0), (5, 0), (0, 3), math.tau, 0.0)
    for edges in (mirrored, falling):
        assert Contour(edges).area == pytest.approx(-math.pi * 15, rel=1e-4)


def _spike(t: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """The semicubical parabola: a cusp at the origin."""
    return (t**2, t**3), (2 * t, 3 * t**2)


def test_a_cusp_is_refused_with_its_place() -> None:
    with pytest.raises(FitError, match=r"cusp near x -?0\.0\d+, y -?0\.0\d+"):
        fit_arcs(_spike, -1.0, 1.0)
