"""Booleans against closed formulas, above all where edges coincide or only touch."""

from __future__ import annotations

import math
import random

import pytest

from sbafab.geometry.edges import Arc, Line
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium, strip, union, wound


def lens(r: float, s: float, gap: float) -> float:
    """Common area of two circles with their centres ``gap`` apart."""
    a = math.acos((gap**2 + r**2 - s**2) / (2 * gap * r))
    b = math.acos((gap**2 + s**2 - r**2) / (2 * gap * s))
    kite = math.sqrt((r + s - gap) * (gap + r - s) * (gap - r + s) * (gap + r + s)) / 2
    return r**2 * a + s**2 * b - kite


@pytest.mark.parametrize("degrees", [0, 30, 90, 123.4])
@pytest.mark.parametrize(("r", "s", "gap"), [(1, 1, 1), (3.25, 1.75, 4.25), (2, 0.5, 1.6)])
def test_two_crossing_discs(r: float, s: float, gap: float, degrees: float) -> None:
    a, b = disc((0, 0), r), disc((gap, 0), s).turned(degrees)
    common = lens(r, s, gap)
    assert (a & b).area == pytest.approx(common)
    assert (a | b).area == pytest.approx(math.pi * (r**2 + s**2) - common)
    assert (a - b).area == pytest.approx(math.pi * r**2 - common)
    assert (b - a).area == pytest.approx(math.pi * s**2 - common)


def test_arcs_stay_arcs() -> None:
    both = disc((0, 0), 2) | disc((2, 0), 2)
    # Two arcs of 240 degrees, each in three parts of a quarter turn at most.
    assert [type(edge) for edge in both.edges] == [Arc] * 6
    assert all(abs(edge.bulge) <= math.tan(math.pi / 8) + 1e-12 for edge in both.edges)
    assert len((disc((0, 0), 2) & disc((2, 0), 2)).edges) == 4
    half = disc((0, 0), 2) - rectangle((0, -3), (3, 3))
    assert sorted(type(edge).__name__ for edge in half.edges) == ["Arc", "Arc", "Line"]


@pytest.mark.parametrize(
    "shape",
    [
        disc((0.1, 0.2), 3.25),
        stadium((0, 0), 11.5, 20),
        rectangle((-1, -2), (3, 4)),
        disc((0, 0), 3) - disc((1, 0), 0.5),
    ],
)
def test_a_shape_with_itself(shape: Region) -> None:
    for angle in (0, 17.3):
        turned = shape.turned(angle)
        assert turned | turned == turned
        assert turned & turned == turned
        assert (turned - turned).is_empty


def test_the_same_disc_three_times_is_one_circle() -> None:
    again = union([disc((1, 1), 2), disc((1, 1), 2), disc((1, 1), 2).turned(180, (1, 1))])
    (contour,) = again.contours
    assert contour.circle == ((1, 1), 2)
    assert again.area == pytest.approx(4 * math.pi)


def test_circles_tangent_outside_stay_two_circles() -> None:
    for angle in (0, 13.7, 45, 90):
        pair = disc((0, 0), 2) | disc((2.5, 0), 0.5).turned(angle)
        assert sorted(c.circle[1] for c in pair.contours if c.circle) == [0.5, 2]
        assert pair.area == pytest.approx(4.25 * math.pi)
        assert (disc((0, 0), 2) & disc((2.5, 0), 0.5).turned(angle)).is_empty


def test_circles_tangent_inside_stay_two_circles() -> None:
    for angle in (0, 13.7, 45, 90):
        small = disc((1.5, 0), 0.5).turned(angle)
        assert disc((0, 0), 2) | small == disc((0, 0), 2)
        assert disc((0, 0), 2) & small == small
        moon = disc((0, 0), 2) - small
        assert len(moon.contours) == 2
        assert all(contour.circle for contour in moon.contours)
        assert moon.area == pytest.approx(3.75 * math.pi)


@pytest.mark.parametrize("gap", [1e-7, 1e-6, 2e-6, 4e-6, 1e-5, 1e-4])
@pytest.mark.parametrize("sign", [-1, 1])
def test_circles_that_all_but_touch(gap: float, sign: int) -> None:
    a, b = disc((0.3, 0.7), 3.25), disc((0.3 + 3.75 + sign * gap, 0.7), 0.5)
    total = math.pi * (3.25**2 + 0.25)
    # The lens of an overlap that small is far below 1e-5 mm2.
    assert (a | b).area == pytest.approx(total, abs=1e-5)
    assert (a & b).area == pytest.approx(0, abs=1e-5)
    assert (a - b).area == pytest.approx(math.pi * 3.25**2, abs=1e-5)


def test_rectangles_that_share_a_seam_become_one() -> None:
    joined = rectangle((0, 0), (2, 3)) | rectangle((2, 0), (5, 3))
    assert joined == rectangle((0, 0), (5, 3))
    assert len(joined.edges) == 4
    assert (rectangle((0, 0), (2, 3)) & rectangle((2, 0), (5, 3))).is_empty


def test_a_part_of_a_seam_is_shared() -> None:
    joined = rectangle((0, 0), (2, 3)) | rectangle((2, 1), (5, 2))
    assert joined.area == pytest.approx(9)
    assert len(joined.contours) == 1
    assert len(joined.edges) == 8


def test_overlapping_collinear_strips() -> None:
    for angle in (0, 17.3, 45):
        a = strip((0, 0), (4, 0), 1.6).turned(angle)
        b = strip((3, 0), (9, 0), 1.6).turned(angle)
        assert a | b == strip((0, 0), (9, 0), 1.6).turned(angle)
        assert (a & b).area == pytest.approx(1.6)
        assert (a - b).area == pytest.approx(3 * 1.6)


def test_squares_that_touch_at_a_corner_stay_two_pieces() -> None:
    pair = rectangle((0, 0), (1, 1)) | rectangle((1, 1), (2, 2))
    assert len(pair.pieces) == 2
    assert pair.area == pytest.approx(2)


def test_a_checkerboard_keeps_its_holes() -> None:
    board = rectangle((0, 0), (3, 3)) - (
        rectangle((0, 1), (1, 2)) | rectangle((1, 0), (2, 1)) | rectangle((1, 2), (2, 3))
    )
    board = board - rectangle((2, 1), (3, 2))
    assert board.area == pytest.approx(5)
    assert len(board.pieces) == 5


def test_a_hole_that_touches_the_rim_cuts_the_disc_apart() -> None:
    diamond = polygon([(2, 0), (0, 2), (-2, 0), (0, -2)])
    segments = disc((0, 0), 2) - diamond
    assert segments.area == pytest.approx(4 * math.pi - 8)
    assert len(segments.pieces) == 4
    assert not segments.holes


def test_a_mask_flush_with_its_bore_leaves_nothing_between() -> None:
    wall = disc((0, 0), 3.25) - disc((0, 0), 0.5)
    mask = disc((0, 0), 2.5) - disc((0, 0), 0.5)
    bond = wall - mask
    assert bond.area == pytest.approx(math.pi * (3.25**2 - 2.5**2))
    assert [contour.circle for contour in bond.contours] == [((0, 0), 3.25), ((0, 0), 2.5)]
    assert wall & mask == mask
    assert mask - wall == Region()


def test_a_hole_flush_with_the_edge_opens_it() -> None:
    opened = rectangle((0, 0), (4, 2)) - rectangle((1, 1), (3, 2))
    assert opened.area == pytest.approx(6)
    assert len(opened.contours) == 1
    assert len(opened.edges) == 8


def test_a_tab_that_starts_on_the_rim() -> None:
    """Disc 3.25 with a tab 3.1 wide: where both end, the rim meets the tab's sides."""
    tab = strip((0, 0), (8.25, 0), 3.1)
    plate = disc((0, 0), 3.25) | tab
    half = 1.55
    foot = math.sqrt(3.25**2 - half**2)
    within = 2 * (half * foot / 2 + 3.25**2 * math.asin(half / 3.25) / 2)
    assert plate.area == pytest.approx(math.pi * 3.25**2 + 3.1 * 8.25 - within)
    lines = [edge for edge in plate.edges if isinstance(edge, Line)]
    assert sorted(edge.length for edge in lines) == pytest.approx([3.1, 8.25 - foot, 8.25 - foot])


def test_a_disc_in_a_hole_of_its_own_size_closes_it() -> None:
    plate = rectangle((-4, -4), (4, 4))
    assert (plate - disc((1, 1), 2)) | disc((1, 1), 2) == plate
    assert (plate - disc((1, 1), 2)) & disc((1, 1), 2) == Region()


@pytest.mark.parametrize("nudge", [1e-9, 1e-7, 1e-6])
def test_shifts_below_the_tolerance_do_not_matter(nudge: float) -> None:
    a = stadium((0, 0), 5, 12) - disc((0, 2), 1)
    b = a.moved(nudge, -nudge)
    for angle in (0, 31):
        c, d = a.turned(angle), b.turned(angle)
        assert (c | d).area == pytest.approx(a.area, abs=1e-4)
        assert (c & d).area == pytest.approx(a.area, abs=1e-4)
        assert (c - d).area == pytest.approx(0, abs=1e-4)


def test_empty_regions() -> None:
    shape = disc((0, 0), 1)
    nothing = Region()
    assert shape | nothing == shape
    assert shape - nothing == shape
    assert (shape & nothing).is_empty
    assert (nothing - shape).is_empty
    assert union([]).is_empty
    assert (shape - disc((0, 0), 2)).is_empty


def test_operations_add_up_on_turned_lobed_plates() -> None:
    """Areas of union and intersection sum to those of the two, at every small difference."""
    lobes = [disc((4.25, 0), 3.25).turned(angle) for angle in (0, 120, 240)]
    plate = union([*lobes, disc((0, 0), 1.75)]) - disc((0, 0), 1)
    partners = [
        plate.turned(2),
        plate.turned(1e-4),
        plate.turned(120),
        plate.moved(0.15, 0),
        plate.moved(1e-4, 0),
        plate.moved(0, 1e-6),
        plate.scaled(1.002),
        plate.mirrored(),
    ]
    # Slivers thinner than four times the tolerance count as nothing.
    dust = 8e-6 * plate.outers[0].length
    for b in partners:
        total = plate.area + b.area
        common = plate & b
        assert (plate | b).area + common.area == pytest.approx(total, abs=dust)
        assert (plate - b).area == pytest.approx(plate.area - common.area, abs=dust)


@pytest.mark.parametrize("seed", range(4))
def test_discs_apart_are_what_laying_them_over_each_other_gives(seed: int) -> None:
    draw = random.Random(seed)
    for _ in range(20):
        discs = [
            disc((draw.uniform(-9, 9), draw.uniform(-9, 9)), draw.uniform(0.3, 2)).turned(33)
            for _ in range(draw.randint(2, 5))
        ]
        laid_over = wound([edge for a in discs for edge in a.edges], 0)
        assert union(discs).contours == laid_over.contours
    for apart in (0.0, 1e-6, 3e-6, 7e-6, 9e-6, 1e-3):
        pair = disc((0, 0), 1), disc((2 + apart, 0), 1)
        assert union(pair).contours == wound([edge for a in pair for edge in a.edges], 0).contours
