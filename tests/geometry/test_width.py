"""Least widths against closed formulas and against shapely's distances between rings."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import pytest
import shapely

from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Point
from sbafab.geometry.overlap_pairs import overlap_pairs
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium, strip, union
from sbafab.geometry.width import Width, inscribed_disc, least_gap, least_width

AXIS = (0.0, 0.0)
EXACT = 1e-9


def rounded_arm(taper: float) -> Region:
    """An arm 4 long and 1 wide at its flat end, one side leaning outward by ``taper`` degrees."""
    rise = 4 * math.tan(math.radians(taper))
    arm = polygon([(0, 0), (4, 0), (4, 1), (0, 1 + rise)])
    return arm | disc((-1.0, 0.5), 3.0)


WIDTHS = {
    "ring": (disc(AXIS, 3.25) - disc(AXIS, 2.5), 0.75),
    "thin ring": (disc((0.1, 1 / 3), 1.25) - disc((0.1, 1 / 3), 0.5), 0.75),
    "eccentric ring": (disc(AXIS, 3) - disc((0.3, 0.4), 2), 0.5),
    "disc": (disc((1.0, 2.0), 2.5), 5.0),
    "rectangle": (rectangle(AXIS, (4.0, 1.0)), 1.0),
    "turned rectangle": (rectangle(AXIS, (4.0, 1.0)).turned(33.0), 1.0),
    "stadium": (stadium(AXIS, 2.0, 6.0), 2.0),
    "slot near edge": (rectangle((-5, -5), (5, 5)) - stadium((3.0, 0.0), 2.0, 6.0), 1.0),
    "web between holes": (disc(AXIS, 9) - disc((-2.0, 0.0), 1.5) - disc((2, 1), 1.5), 17**0.5 - 3),
    "hole near line": (rectangle((-5, -5), (5, 5)) - disc((0.0, 3.0), 1.25), 0.75),
    "reflex corner": (polygon([AXIS, (5, 0), (5, 2), (1.5, 2), (1.5, 5), (0, 5)]), 1.5),
    "two reflex corners": (
        rectangle((-5, -5), (5, 5)) - rectangle((-3, -3), (0, 0)) - rectangle((0.3, 0.4), (3, 3)),
        0.5,
    ),
    # A web that is narrowest where it leaves a bar: both corners have an edge along the bar.
    "corners along one line": (
        rectangle((-5, -5), (5, 5))
        - polygon([(-6, -2), (-1, -2), (-0.3, -0.5), (-6, -0.5)])
        - polygon([(0.3, -0.5), (1, -2), (3, -2), (3, -0.5)]),
        0.6,
    ),
    "reflex corner near arc": (disc(AXIS, 5) - rectangle((-1, -1), (3, 3)), 5 - 18**0.5),
    "tapering strip": (polygon([AXIS, (6, 0), (6, 1), (0, 1.003)]) | disc(AXIS, 2), 1.0),
    "flat end of a taper": (rounded_arm(10.0), 1.0),
    "arc facing a line": (rectangle((-5, 0), (5, 3.4)) - disc((0.0, 3.4), 3.0), 0.4),
    "crescent tip": (disc(AXIS, 2) - disc((0.5, 0.0), 1.5), 0.0),
    "cusp": (rectangle(AXIS, (3.0, 1.0)) - disc((0.0, 1.0), 1.0), 0.0),
    "leaning side": (polygon([AXIS, (4, 0), (4, 1), (0.01, 1)]), 0.0),
    "triangle tip": (polygon([AXIS, (4, 0), (0, 3)]), 0.0),
    "pieces that touch": (rectangle(AXIS, (1, 1)) | rectangle((1, 1), (2, 2)), 0.0),
    "lobes in a plate": (union([disc((x, 0.0), 2.0) for x in (-1.5, 1.5)]), 2 * (4 - 2.25) ** 0.5),
}
GAPS = {
    "hole": (disc(AXIS, 3.25) - disc(AXIS, 0.5), 1.0),
    "between discs": (disc((-2.0, 0.0), 1.5) | disc((2.0, 1.0), 1.5), 17**0.5 - 3),
    "slit": (rectangle((-5, -5), (5, 5)) - rectangle((0.0, -1.0), (0.15, 1.0)), 0.15),
    "notch from outside": (disc(AXIS, 5.0) - strip((2.0, 0.0), (6.0, 0.0), 0.3), 0.3),
    "disc beside strip": (disc((0.0, 2.0), 1.5) | rectangle((-4, -1), (4, 0)), 0.5),
    # A disc resting on a bar, filled on its left: the notch on its right ends in nothing.
    "notch that ends in nothing": (
        union([rectangle((-1, -1), (3, 0)), rectangle((-1, -1), (0, 2)), disc((0.0, 1.0), 1.0)]),
        0.0,
    ),
    "island": ((disc(AXIS, 5) - disc(AXIS, 3)) | disc((0.5, 0.0), 1.0), 1.5),
}


ALLOWED = {
    "leaning side": (polygon([AXIS, (4, 0), (4, 1), (0.01, 1)]), 1.0),
    "altitude of a triangle": (polygon([AXIS, (4, 0), (0, 3)]), 2.4),
}
"""Shapes with corners sharper than 90 degrees, which are allowed here."""


@pytest.mark.parametrize(
    ("least", "sharp", "region", "expected"),
    [
        *((least_width, 90.0, *case) for case in WIDTHS.values()),
        *((least_gap, 90.0, *case) for case in GAPS.values()),
        *((least_width, 15.0, *case) for case in ALLOWED.values()),
    ],
)
def test_width_and_gap_are_the_closed_formulas(
    least: Callable[..., Width | None], sharp: float, region: Region, expected: float
) -> None:
    width = least(region, sharp)
    assert width is not None
    assert width.value == pytest.approx(expected, abs=EXACT)
    assert math.dist(width.start, width.end) == pytest.approx(expected, abs=EXACT)
    for limit, is_below in ((expected + 0.01, True), (expected, expected == 0.0)):
        below = least(region, sharp, limit)
        assert (below is not None) == is_below
        assert below is None or below.value == pytest.approx(expected, abs=EXACT)


def ring_of(contour: Contour) -> shapely.LinearRing:
    return shapely.LinearRing(contour.polygon(sagitta=1e-5))


def sharp_holes_in_a_plate(seed: int) -> Region:
    """A 24 mm disc with up to sixty triangular and quadrangular holes of any angles, apart."""
    draw = random.Random(seed)
    taken: list[shapely.Polygon] = []
    for _ in range(60):
        radius, distance = draw.uniform(0.4, 1.5), draw.uniform(0, 10)
        angle = draw.uniform(0, math.tau)
        x, y = distance * math.cos(angle), distance * math.sin(angle)
        ways = sorted(draw.uniform(0, math.tau) for _ in range(draw.choice([3, 4])))
        hole = shapely.Polygon(
            [(x + radius * math.cos(way), y + radius * math.sin(way)) for way in ways]
        )
        if hole.area > 0.2 and all(hole.distance(b) > 0.02 for b in taken):
            taken.append(hole)
    holes = [polygon(list(hole.exterior.coords)[:-1]) for hole in taken]
    return disc((0.0, 0.0), 12.0) - union(holes)


@pytest.mark.parametrize("seed", range(10))
def test_webs_between_sharp_corners_agree_with_shapely(seed: int) -> None:
    """Corners face each other where none of their edges does."""
    region = sharp_holes_in_a_plate(seed)
    tree = [ring_of(contour) for contour in region.contours]
    apart = min(a.distance(b) for i, a in enumerate(tree) for b in tree[:i])
    width = least_width(region, 15.0)
    assert width is not None
    assert width.value == pytest.approx(apart, abs=2.1e-5)


def _ring(count: int) -> Region:
    """A disc of radius 3 in chords, whose inscribed disc has the apothem."""
    turns = (math.tau * n / count for n in range(count))
    return polygon([(3 * math.cos(turn), 3 * math.sin(turn)) for turn in turns])


@pytest.mark.parametrize(
    ("region", "radius", "centre"),
    [
        (union([disc((0, 0), 2), disc((9, 0), 3)]), 3.0, (9.0, 0.0)),
        (rectangle((0, 0), (4, 4)), 2.0, (2.0, 2.0)),
        (polygon([(0, 0), (3, 0), (0, 4)]), 1.0, (1.0, 1.0)),
        (stadium((5, 5), 3, 11), 1.5, None),
        (disc((0, 0), 5) - disc((0, 0), 1), 2.0, None),
        (disc((0, 0), 5) - disc((2, 0), 1), 3.0, (-2.0, 0.0)),
        (_ring(4000), 3 * math.cos(math.pi / 4000), (0.0, 0.0)),
    ],
)
def test_the_inscribed_disc_by_hand(region: Region, radius: float, centre: Point | None) -> None:
    found = inscribed_disc(region)
    assert found.radius == pytest.approx(radius, rel=1e-4)
    assert found.radius <= radius + 1e-9
    if centre is not None:
        assert found.centre == pytest.approx(centre, abs=3e-2)


# All narrow places of a region, not only the narrowest.


FRAME = rectangle((0.0, 0.0), (10.0, 6.0)) - rectangle((1.0, 1.5), (9.0, 4.0))


def facing_pairs(region: Region, slack: float) -> list[Width]:
    places = overlap_pairs(region, slack, 90.0)
    ends = zip(places.start.T.tolist(), places.end.T.tolist(), places.value.tolist(), strict=True)
    return [Width(value, tuple(start), tuple(end)) for start, end, value in ends]


def test_a_ring_is_narrow_in_every_direction() -> None:
    pairs = facing_pairs(disc(AXIS, 3.0) - disc(AXIS, 2.0), 0.1)
    assert [pair.value for pair in pairs] == pytest.approx([1.0] * len(pairs))
    angles = sorted(math.degrees(math.atan2(*reversed(pair.middle))) % 360 for pair in pairs)
    steps = [after - before for before, after in zip(angles, angles[1:], strict=False)]
    assert max(*steps, 360 - angles[-1] + angles[0]) <= 15 + 1e-6


def test_slack_says_how_much_wider_a_place_may_be() -> None:
    # Webs of 1 left and right, 1.5 below and 2 above the window.
    for slack, widths in ((0.4, {1.0}), (0.6, {1.0, 1.5}), (1.1, {1.0, 1.5, 2.0})):
        pairs = facing_pairs(FRAME, slack)
        assert {round(pair.value, 6) for pair in pairs} == widths
        ends = {frozenset((tuple(pair.start), tuple(pair.end))) for pair in pairs}
        assert len(ends) == len(pairs)
    # Both ends of the narrowest webs.
    assert {1.5, 4.0} <= {round(pair.middle[1], 6) for pair in facing_pairs(FRAME, 0.1)}


def test_the_place_is_where_the_ring_is_thinnest() -> None:
    width = least_width(disc(AXIS, 3) - disc((0.6, 0.8), 1.5))
    assert width is not None
    assert width.middle == pytest.approx((2.75 * 0.6, 2.75 * 0.8), abs=EXACT)


def test_the_least_width_of_a_finely_drawn_ring_is_found_among_far_and_near_edges() -> None:
    """Two polygons of 180 sides about one centre are nearest where their flats lie side by side."""

    def ring(radius: float) -> Region:
        return polygon(
            [
                (radius * math.cos(k * math.pi / 90), radius * math.sin(k * math.pi / 90))
                for k in range(180)
            ]
        )

    width = least_width(ring(6.0) - ring(5.0), 15.0)
    gap = least_gap(ring(6.0) - ring(5.0), 15.0)
    flat = math.cos(math.pi / 180)
    assert width is not None
    assert width.value == pytest.approx(flat, abs=EXACT)
    assert gap is not None
    assert gap.value == pytest.approx(10.0 * flat, abs=EXACT)
