"""Kerf compensation is exact, and refuses what it would change in kind."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from shapely.affinity import scale

from sbafab.cutting.kerf import compensate, in_chords
from sbafab.cutting.properties import kerf_of, kerf_properties, kerf_suffix
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.edges import Line
from sbafab.geometry.offset import Kerf
from sbafab.geometry.region import Region, disc, rectangle, stadium, union
from tests.quick import few


def test_disc_grows_and_its_hole_shrinks_by_half_the_kerf_as_circles() -> None:
    path = compensate(disc((1.0, 2.0), 3.25) - disc((1.5, 2.0), 0.5), 0.18)
    (outer,), (hole,) = path.outers, path.holes
    assert outer.circle == ((1.0, 2.0), pytest.approx(3.34, abs=1e-12))
    assert hole.circle == ((1.5, 2.0), pytest.approx(0.41, abs=1e-12))


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


def farthest_off(path: Region, region: Region, pair: tuple[float, float]) -> float:
    """How far, in mm, the path lies from the sum of the region and the beam's ellipse.

    The ellipse round a point of the exact path touches the region's edge and holds none of it.
    """
    half = np.array(pair) / 2
    counts = [max(4, math.ceil(edge.length / 0.002)) for edge in region.edges]
    edge = np.array(
        [e.at(k / n) for e, n in zip(region.edges, counts, strict=True) for k in range(n + 1)]
    )
    spots = np.array([e.at(t) for e in path.edges for t in (0.0, 0.2)])
    nearest = [np.hypot(*((edge - spot) / half).T).min() for spot in spots]
    return float(np.abs(np.array(nearest) - 1).max() * half.min())


def judged_area(region: Region, pair: tuple[float, float]) -> float:
    """Area of that sum: squeezed until the ellipse is a disc, grown, pulled back."""
    drawn = shapely.union_all([shapely.Polygon(r[0], r[1:]) for r in region.polygons(0.0001)])
    squeeze = pair[0] / pair[1]
    grown = scale(drawn, 1, squeeze, origin=(0, 0)).buffer(pair[0] / 2, quad_segs=200)
    return float(grown.area / squeeze)


LOPSIDED = rectangle((0.0, 0.0), (8.0, 5.0)).turned(20.0) - disc((4.0, 4.0), 0.4)


@pytest.mark.parametrize("pair", few([(0.12, 0.1), (0.08, 0.2), (0.3, 0.03)], 1))
@pytest.mark.parametrize("shape", ["plate", "dumbbell", "tilted"])
def test_two_widths_grow_by_the_ellipse(
    shape: str, pair: tuple[float, float], plate: Region
) -> None:
    region = {"plate": plate, "dumbbell": wide_dumbbell(), "tilted": LOPSIDED}[shape]
    path = compensate(region, pair)
    assert len(path.contours) == len(region.contours)
    assert farthest_off(path, region, pair) < 0.00012
    length = sum(contour.length for contour in region.contours)
    # The judge works on chords, and drops what turns little before it grows.
    assert path.area == pytest.approx(judged_area(region, pair), abs=0.0005 * length)


def wide_dumbbell() -> Region:
    """A hole with sharp corners all round: the path's pieces cross there."""
    slot = rectangle((-2.0, -0.4), (2.0, 0.4))
    return disc((0.0, 0.0), 5.0) - union([disc((-2.0, 0.0), 1.0), disc((2.0, 0.0), 1.0), slot])


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


def test_a_disc_cut_with_two_widths_has_the_ellipse_s_half_axes() -> None:
    path = compensate(disc((3.0, -1.0), 2.0), (0.3, 0.1))
    assert path.bounds == pytest.approx((0.85, -3.05, 5.15, 1.05), abs=0.0001)


def test_equal_widths_are_one() -> None:
    region = disc((1.0, 2.0), 3.0) - disc((1.0, 2.0), 0.5)
    assert compensate(region, (0.2, 0.2)) == compensate(region, 0.2)
    assert compensate(region, (0.0, 0.0)) is region


@pytest.mark.parametrize(
    ("region", "kerf", "says"),
    [
        (
            disc((0, 0), 5) - rectangle((1.8, 0.925), (2.2, 1.075)),
            (0.1, 0.2),
            "hole at x 2.000, y 1.000 vanishes",
        ),
        (dumbbell(), (0.1, 0.3), "hole at x .*, y 0.000 splits"),
        (disc((-1.1, 3), 1) | disc((1.1, 3), 1), (0.3, 0.1), "at x 0.000, y 3.000 runs into"),
    ],
)
def test_two_widths_lose_contours_each_its_own_way(
    region: Region, kerf: tuple[float, float], says: str
) -> None:
    """The other way round, the beam passes."""
    assert compensate(region, kerf[::-1])
    with pytest.raises(DesignError, match=says):
        compensate(region, kerf)


def test_a_slot_that_closes_is_told_where_it_is() -> None:
    slit = rectangle((2.0, -0.05), (6.0, 0.05))
    with pytest.raises(DesignError, match=r"outline at x [2-5]\.\d+, y 0\.000 splits"):
        compensate(disc((0.0, 0.0), 5.0) - disc((0.0, 0.0), 2.5) - slit, 0.2)


def test_a_thin_web_between_holes_is_kept() -> None:
    """The path leaves more of a web than the part has, never less."""
    region = disc((0, 0), 5) - disc((-1.02, 0), 1) - disc((1.02, 0), 1)
    path = compensate(region, 0.2)
    assert sorted(hole.circle[1] for hole in path.holes if hole.circle) == pytest.approx([0.9] * 2)


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
