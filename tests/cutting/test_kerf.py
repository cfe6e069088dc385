"""Kerf compensation is exact, and refuses what it would change in kind."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sbafab.cutting.cut_settings import kerf_of, kerf_properties, kerf_suffix
from sbafab.cutting.kerf import compensate, in_chords
from sbafab.cutting.verify import check_contours
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.edges import Line
from sbafab.geometry.offset import Kerf, fillet, shrink
from sbafab.geometry.region import Region, disc, rectangle, stadium, union
from tests.cutting.shapes import shapes


def test_chords_leave_a_mask_no_more_but_at_the_corners_of_its_part() -> None:
    """A beam of 0.1 mm is led round the corners of a mask in arcs of its own radius: their chords
    stay outside. Those of every other arc stay inside.
    """
    rounded, slot = (stadium((0.0, 0.0), 2 * radius, 4.0) for radius in (0.1, 1.5))
    error, sides = 0.01, ({}, {"beam": 0.1})
    inside, outside = (in_chords(rounded, "chamber-mask", error, **beam).area for beam in sides)
    assert inside < rounded.area < outside
    assert all(in_chords(slot, "chamber-mask", error, **beam).area < slot.area for beam in sides)


def test_stadium_grows_by_the_closed_formula() -> None:
    grown = compensate(stadium((0.0, 0.0), 11.5, 20.0), 0.2)
    assert grown.area == pytest.approx(11.7 * 8.5 + math.pi * 5.85**2, abs=1e-9)


@given(parts=st.lists(shapes(), min_size=1, max_size=3), kerf=st.sampled_from([0.05, 0.1, 0.3]))
def test_a_kerf_put_on_and_taken_off_leaves_the_part(parts: list[Region], kerf: float) -> None:
    """Of a part without hollows narrower than the beam."""
    region = fillet(shrink(union(parts), 0.2), 0.21)
    assume(not region.is_empty and min(edge.length for edge in region.edges) > 0.05)
    try:
        path = compensate(region, kerf)
    except DesignError:
        assume(False)
    check_contours(shrink(path, kerf / 2), region, 0.0001)


def dumbbell() -> Region:
    """A hole of two rounds joined by a slot 0.2 wide."""
    slot = rectangle((-2.0, -0.1), (2.0, 0.1))
    return disc((0.0, 0.0), 5.0) - union([disc((-2.0, 0.0), 1.0), disc((2.0, 0.0), 1.0), slot])


@pytest.mark.parametrize(
    ("region", "kerf", "says"),
    [
        (disc((0.0, 0.0), 5.0) - disc((2.0, 1.0), 0.1), 0.21, "hole at x 2.000, y 1.000 vanishes"),
        (dumbbell(), 0.3, "hole at x 0.000, y 0.000 splits"),
        (disc((-1.1, 3.0), 1.0) | disc((1.1, 3.0), 1.0), 0.3, "outline at x .*, y 3.000 runs into"),
    ],
)
def test_contour_lost_is_an_error_with_its_place(region: Region, kerf: float, says: str) -> None:
    compensate(region, kerf / 3)
    with pytest.raises(DesignError, match=says):
        compensate(region, kerf)


def test_two_widths_move_straight_edges_exactly() -> None:
    region = rectangle((1.0, 2.0), (11.0, 7.0)) - rectangle((4.0, 4.0), (6.0, 5.0))
    path = compensate(region, (0.2, 0.1))
    assert path.bounds == pytest.approx((0.9, 1.95, 11.1, 7.05), abs=1e-6)
    (hole,) = path.holes
    assert hole.bounds == pytest.approx((4.1, 4.05, 5.9, 4.95), abs=1e-12)
    assert all(isinstance(edge, Line) for edge in hole.edges)
    sides = [edge for edge in path.outers[0].edges if isinstance(edge, Line)]
    assert len(sides) == 4
    for side in sides:
        (x0, y0), (x1, y1) = side.start, side.end
        assert x0 == x1 or y0 == y1
    # A rectangle grows by its sides times the half widths, and a whole ellipse at its corners.
    assert path.outers[0].area == pytest.approx(
        10 * 5 + 2 * (10 * 0.05 + 5 * 0.1) + math.pi * 0.1 * 0.05, abs=1e-6
    )


@pytest.mark.parametrize("kerf", [(0.188, 0.194), (0.193, 0.095), (0.05, 0.2)])
@pytest.mark.parametrize("radius", [0.52, 1.24])
def test_two_widths_leave_a_round_hole_to_ten_nanometres(
    radius: float, kerf: tuple[float, float]
) -> None:
    """The path encloses pi R2 - R P + pi a b, with P the perimeter of the beam's ellipse."""
    a, b = kerf[0] / 2, kerf[1] / 2
    turns = [math.tau * (k + 0.5) / 2000 for k in range(2000)]
    perimeter = math.tau / 2000 * sum(math.hypot(a * math.sin(t), b * math.cos(t)) for t in turns)
    (hole,) = compensate(disc((0.0, 0.0), 4.0) - disc((0.0, 0.0), radius), kerf).holes
    low_x, low_y, high_x, high_y = hole.bounds
    sides = (radius - a, radius - b)
    assert (high_x, high_y) == pytest.approx(sides, abs=1e-5)
    assert (-low_x, -low_y) == pytest.approx(sides, abs=1e-5)
    expected = math.pi * radius**2 - radius * perimeter + math.pi * a * b
    assert -hole.area == pytest.approx(expected, abs=1e-5 * math.tau * radius)


@pytest.mark.parametrize(
    ("kerf", "suffix"), [(None, ""), (0.12, "_kerf0.12"), ((0.12, 0.1), "_kerf0.12x0.1")]
)
def test_a_kerf_is_read_as_it_was_told(kerf: Kerf | None, suffix: str) -> None:
    assert kerf_of(kerf_properties(kerf)) == kerf
    assert kerf_suffix(kerf) == suffix


@pytest.mark.parametrize(
    "width", ["", "x", "0.1 x nan", "0.1 x 0.1 x 0.1", "-0.1", "0.1 x 2", "nan"]
)
def test_a_kerf_that_cannot_be_is_refused(width: str) -> None:
    with pytest.raises(OutputError, match="leaves open"):
        kerf_of({"KERF_STATE": "compensated", "KERF_WIDTH": width})
