"""Kerf compensation is exact, and refuses what it would change in kind."""

from __future__ import annotations

import math

import pytest

from sbafab.cutting.kerf import compensate
from sbafab.errors import DesignError
from sbafab.geometry.boolean import union
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc, rectangle, stadium


def test_disc_grows_and_its_hole_shrinks_by_half_the_kerf_as_circles() -> None:
    path = compensate(disc((1.0, 2.0), 3.25) - disc((1.5, 2.0), 0.5), 0.18)
    (outer,), (hole,) = path.outers, path.holes
    assert outer.circle == ((1.0, 2.0), pytest.approx(3.34, abs=1e-12))
    assert hole.circle == ((1.5, 2.0), pytest.approx(0.41, abs=1e-12))


def test_stadium_grows_by_the_closed_formula() -> None:
    grown = compensate(stadium((0.0, 0.0), 11.5, 20.0), 0.2)
    assert grown.area == pytest.approx(11.7 * 8.5 + math.pi * 5.85**2, abs=1e-9)


def test_plate_keeps_its_contours_and_grows_by_its_perimeter(plate: Region) -> None:
    """To first order the area grows by half the kerf times the length of all contours."""
    path = compensate(plate, 0.002)
    assert (len(path.outers), len(path.holes)) == (len(plate.outers), len(plate.holes))
    length = sum(contour.length for contour in plate.contours)
    assert path.area - plate.area == pytest.approx(0.001 * length, rel=1e-3)


def test_no_kerf_changes_nothing(plate: Region) -> None:
    assert compensate(plate, 0.0) is plate


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


def test_outline_that_closes_on_itself_is_an_error() -> None:
    """A ring with a slit 0.1 wide: the slit heals under a kerf of 0.2 and leaves a hole."""
    slit = rectangle((0.0, -0.05), (6.0, 0.05))
    cut = disc((0.0, 0.0), 5.0) - disc((0.0, 0.0), 3.0) - slit
    with pytest.raises(DesignError, match="splits"):
        compensate(cut, 0.2)
