"""A slot is as narrow as its flanks are where its bottom begins: round, flat or a point."""

from __future__ import annotations

import math

import pytest

from sbafab.geometry.edges import Point, unit
from sbafab.geometry.offset import fillet
from sbafab.geometry.region import Region, disc, polygon, rectangle
from sbafab.geometry.width import least_gap, least_width
from sbafab.rules.film_limits import SHARP

PLATE = rectangle((-3.0, -4.0), (5.0, 4.0))


def wedge(radius: float, taper: float) -> Region:
    """A slot that opens to the right by ``taper`` degrees from the tangents of a round bottom."""
    away: list[Point] = []
    for side in (-1.0, 1.0):
        x, y = unit(90.0 + taper / 2)
        flank = unit(taper / 2)
        foot = (radius * x, side * radius * y)
        away += [foot, (foot[0] + 9.0 * flank[0], foot[1] + side * 9.0 * flank[1])]
    lower, far_below, upper, far_above = away
    return polygon([lower, far_below, far_above, upper]) | disc((0.0, 0.0), radius)


def trough(bottom: float, taper: float) -> Region:
    """A slot that opens to the right by ``taper`` degrees from a flat bottom at x = 0."""
    half = bottom / 2 + 9.0 * math.tan(math.radians(taper / 2))
    foot = [(0.0, bottom / 2), (0.0, -bottom / 2)] if bottom else [(0.0, 0.0)]
    return polygon([*foot, (9.0, -half), (9.0, half)])


@pytest.mark.parametrize("turn", [0.0, 37.0])
@pytest.mark.parametrize("taper", [4.0, 14.0, 16.0, 22.0, 29.5, 30.5, 45.0, 90.0])
def test_a_point_is_narrower_than_any_flat_bottom_between_the_same_flanks(
    taper: float, turn: float
) -> None:
    pointed, flat = (
        least_gap((PLATE - trough(bottom, taper)).turned(turn), SHARP) for bottom in (0.0, 0.139)
    )
    if taper > SHARP:
        assert (pointed, flat) == (None, None)
    else:
        assert pointed is not None
        assert flat is not None
        assert pointed.value == 0.0
        assert flat.value == pytest.approx(0.139, abs=1e-6)


@pytest.mark.parametrize("taper", [2.0, 10.0, 24.5])
def test_a_round_bottom_is_as_wide_as_between_its_tangent_points(taper: float) -> None:
    gap = least_gap(PLATE - wedge(0.3, taper), SHARP)
    assert gap is not None
    assert gap.value == pytest.approx(0.6 * math.cos(math.radians(taper / 2)), abs=1e-6)


@pytest.mark.parametrize("radius", [0.1, 0.2, 0.4])
@pytest.mark.parametrize("taper", [0.0, 8.0, 24.0])
def test_a_filleted_flat_bottom_is_as_wide_as_where_its_fillets_begin(
    radius: float, taper: float
) -> None:
    lean = math.radians(taper / 2)
    along_flank = radius * math.tan((math.pi / 2 - lean) / 2)
    gap = least_gap(fillet(PLATE - trough(1.0, taper), radius), SHARP)
    assert gap is not None
    assert gap.value == pytest.approx(1.0 + 2 * along_flank * math.sin(lean), abs=1e-6)


def test_a_drop_is_as_wide_as_its_round_end() -> None:
    lean = math.radians(10.0)
    tangent = (math.sin(lean), math.cos(lean))
    tip = (1.0 / math.sin(lean), 0.0)
    drop = disc((0.0, 0.0), 1.0) | polygon([(tangent[0], -tangent[1]), tip, tangent])
    width = least_width(drop, 15.0)
    assert width is not None
    assert width.value == pytest.approx(2.0, abs=1e-6)


def test_a_blunter_or_filleted_corner_is_no_slot() -> None:
    assert least_gap(PLATE - wedge(0.3, 35.0), SHARP) is None
    for angle in (60.0, 90.0, 120.0):
        x, y = unit(angle)
        notched = disc((0.0, 0.0), 4.0) - polygon([(0.0, 0.0), (9.0, 0.0), (9.0 * x, 9.0 * y)])
        assert least_gap(fillet(notched, 0.05), SHARP) is None
