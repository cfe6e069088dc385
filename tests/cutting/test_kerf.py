"""Kerf compensation is exact, and refuses what it would change in kind."""

from __future__ import annotations

import math
import os
import random
from collections.abc import Callable

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely.affinity import scale

from sbafab.actuators import load_design
from sbafab.api import build
from sbafab.cutting.chaining import check_clear
from sbafab.cutting.cut_settings import kerf_of, kerf_properties, kerf_suffix
from sbafab.cutting.kerf import compensate, in_chords
from sbafab.cutting.verify import check_contours
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.arcs import bezier, fit_arcs
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Edge, Line, Point
from sbafab.geometry.offset import Kerf, fillet, grow, shrink
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium, union
from tests.cutting.shapes import shapes
from tests.quick import few


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
    with pytest.raises(OutputError, match="do not define"):
        kerf_of({"KERF_STATE": "compensated", "KERF_WIDTH": width})


# The path of a beam of two widths round smooth outlines, slots and stars, judged by shapely.
#
# SBAFAB_KERF_SHAPES=300 asks for as many random shapes; the default takes two seconds.


COUNT = int(os.environ.get("SBAFAB_KERF_SHAPES", "8"))
PAIRS = ((0.12, 0.1), (0.1, 0.12), (0.05, 0.2), (0.3, 0.1), (0.08, 0.085))
OFF = 0.0002
"""mm: the path's own 0.1 um, and the judge's chords."""
DROPPED = 0.01
"""Share of a beam's half width by which shapely may simplify a shape before it grows it."""


def blob(rng: random.Random) -> Region:
    """A closed path of Bézier curves through random points round the origin, often concave."""
    count, size, rough = rng.randint(5, 14), rng.uniform(2.5, 6), rng.uniform(0.05, 0.45)
    turns = [math.tau * i / count for i in range(count)]
    points = [
        (r * math.cos(t), r * math.sin(t))
        for t in turns
        for r in [size * rng.uniform(1 - rough, 1 + rough)]
    ]

    def handle(i: int, sign: int) -> Point:
        (x0, y0), (x, y), (x1, y1) = points[i - 1], points[i], points[(i + 1) % count]
        return x + sign * (x1 - x0) / 6, y + sign * (y1 - y0) / 6

    edges: list[Edge] = []
    for i in range(count):
        after = (i + 1) % count
        curve = bezier([points[i], handle(i, 1), handle(after, -1), points[after]])
        edges += fit_arcs(curve, 0.0, 1.0)
    return union([Region((Contour(tuple(edges)),))])


def slot(rng: random.Random) -> Region:
    return stadium((0.0, 0.0), rng.uniform(1, 4), rng.uniform(5, 12)).turned(rng.uniform(0, 180))


def star(rng: random.Random) -> Region:
    count, inner = 2 * rng.randint(3, 9), rng.uniform(0.45, 0.85)
    size, first = rng.uniform(3.5, 7), rng.uniform(0, 6)
    return polygon(
        [
            (r * math.cos(first + math.tau * i / count), r * math.sin(first + math.tau * i / count))
            for i in range(count)
            for r in [size * (inner if i % 2 else 1)]
        ]
    )


def assert_sum(path: Region, region: Region, pair: tuple[float, float]) -> None:
    """The path is the edge of the numeric sum with the ellipse, in place and area.

    The sum: squeezed along y until the ellipse is a disc, grown in fine chords, pulled back.
    """

    def drawn(shape: Region) -> shapely.Geometry:
        rings = shape.polygons(0.00005)
        return shapely.union_all([shapely.Polygon(ring[0], ring[1:]) for ring in rings])

    squeeze = pair[0] / pair[1]
    round_one = scale(drawn(region), 1, squeeze, origin=(0, 0)).buffer(pair[0] / 2, quad_segs=60)
    judged = scale(round_one, 1, 1 / squeeze, origin=(0, 0))
    own = drawn(path)
    assert own.is_valid
    off = OFF + DROPPED * max(pair) / 2
    assert shapely.hausdorff_distance(own, judged) < off
    assert abs(own.area - judged.area) < off / 10 * own.length


@pytest.mark.parametrize("number", few(range(COUNT), 4, setting="SBAFAB_KERF_SHAPES"))
def test_path_is_the_sum_with_the_beam_s_ellipse(number: int) -> None:
    rng = random.Random(f"kerf {number}")
    makers: tuple[Callable[[random.Random], Region], ...] = (blob, blob, slot, star)
    pocket, pair = makers[number % 4](rng), PAIRS[number % len(PAIRS)]
    # The outline a bond outside, with the corners of the pocket round, and the pocket as a hole.
    for region in (pocket, grow(pocket, 0.75), grow(pocket, 2.0) - grow(pocket, 0.5)):
        path = compensate(region, pair)
        assert len(path.contours) == len(region.contours)
        assert_sum(path, region, pair)


def test_a_hollow_narrower_than_the_beam_leaves_no_loop() -> None:
    """The beam's flat side bends less than the hole: its path crosses itself there, and ends."""
    for radius in (0.12, 0.2, 0.3, 0.39):
        region = polygon([(-2, -2), (2, -2), (2, 2), (-2, 2)]) - stadium((0, 0), 2 * radius, 2.5)
        path = compensate(region, (0.05, 0.2))
        (hole,) = path.holes
        points = np.array([edge.start for edge in hole.edges])
        assert shapely.LinearRing(points).is_simple
        assert_sum(path, region, (0.05, 0.2))
        assert any(isinstance(edge, Arc) for edge in hole.edges)


def test_a_loop_under_a_micrometre_where_tracks_cross_twice_is_taken_out() -> None:
    """Seven tapered chambers with ears: an edge of a separator's path went back by 0.2 um."""
    keys = {
        "stack.balloons": 3,
        "registration.method": "ears",
        "bond.width": 1.48,
        "mask.overhang": 0.889,
        "fillet.radius": 1.0,
        "chamber.count": 7,
        "chamber.diameter": "[7.675,7.941,7.941]",
        "lumen.diameter": 4.254,
    }
    design = load_design("3dof-15mm", [f"{key}={value}" for key, value in keys.items()])
    separator = build(design).layers[3].profile
    path = compensate(separator, (0.169, 0.064))
    check_clear(path.contours)
    assert_sum(path, separator, (0.169, 0.064))
