"""Least widths against closed formulas and against shapely's distances between rings."""

from __future__ import annotations

import math
import random
import textwrap
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import shapely

from sbafab.actuators import build, load_design
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Point, unit
from sbafab.geometry.offset import fillet, grow
from sbafab.geometry.overlap_pairs import overlap_pairs
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium, strip, union
from sbafab.geometry.width import Width, inscribed_disc, least_gap, least_width
from sbafab.rules import bond_width
from sbafab.rules.film_limits import SHARP
from sbafab.rules.measures import Measures

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


# A slot is as narrow as its flanks are where its bottom begins: round, flat or a point.


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


# A line that runs into the arc of a round corner does not face it, whatever its radius.


@pytest.mark.parametrize("radius", [0.5, 1.0, 2.0, 4.0])
def test_the_width_of_a_rounded_rectangle_is_its_shorter_side(radius: float) -> None:
    width = least_width(grow(rectangle((-8.0, -3.0), (8.0, 3.0)), radius))
    assert width is not None
    assert width.value == pytest.approx(6.0 + 2 * radius)


# A web between two corners of which no edge faces the other was taken for 0.750 mm wide.
#
# Strips of film cross the hollow between two drawn pockets and enclose a gap there; between the gap
# and the outside the web is narrowest along a strip's side.


POCKET = """\
M7.4385,-0.5690 L7.1693,0.5514 L6.4333,1.4903 L5.4036,2.1357 L4.2995,2.4855 L3.3106,2.6463
L2.5349,2.7889 L1.9536,3.0784 L1.4512,3.6046 L0.8727,4.3405 L0.0950,5.1447 L-0.9149,5.8070
L-2.0789,6.1209 L-3.2302,5.9565 L-4.1733,5.3053 L-4.7559,4.2815 L-4.9272,3.0795
L-4.7578,1.9034 L-4.4150,0.8963 L-4.1010,0.0956 L-3.9778,-0.5690 L-4.1065,-1.2344
L-4.4243,-2.0372 L-4.7684,-3.0468 L-4.9365,-4.2242 L-4.7620,-5.4255 L-4.1755,-6.4462
L-3.2293,-7.0927 L-2.0767,-7.2520 L-0.9133,-6.9342 L0.0950,-6.2706 L0.8710,-5.4678
L1.4490,-4.7357 L1.9527,-4.2146 L2.5371,-3.9299 L3.3167,-3.7903 L4.3088,-3.6302
L5.4143,-3.2790 L6.4427,-2.6313 L7.1748,-1.6902 Z
"""
DESIGN = """
    name = "web"
    family = "lobed"
    [stack]
    balloons = 2
    [bore]
    diameter = 1.04
    [fillet]
    radius = 1
    [inlet]
    tab_length = 10.214
    width = 3.572
    [lumen]
    diameter = 4.194
    [chamber]
    outline = "pocket.svg"
    count = 3
    axis_radius = 9.384
"""
STRIPS = union(
    strip((0.0, 0.0), (9.5703 * x, 9.5703 * y), 1.0) for x, y in map(unit, (60, 180, 300))
)


def test_the_web_is_as_wide_as_shapely_finds_it(tmp_path: Path) -> None:
    view = 'viewBox="-50 -50 100 100" width="100mm" height="100mm"'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" {view}><path d="{POCKET}"/></svg>'
    (tmp_path / "pocket.svg").write_text(svg)
    (tmp_path / "web.toml").write_text(textwrap.dedent(DESIGN))
    design = load_design(str(tmp_path / "web.toml"))
    laminate = build(design)
    layers = [
        layer if layer.is_mask else replace(layer, profile=layer.profile | STRIPS)
        for layer in laminate.layers
    ]
    laminate = replace(laminate, layers=tuple(layers))
    (bond,) = laminate.interfaces[0].bond.shapely().geoms
    web = min(bond.exterior.distance(hole) for hole in bond.interiors)
    (finding,) = bond_width.check(Measures(laminate, design))
    assert finding.verdict == "fail"
    assert finding.measured == pytest.approx(web, abs=2e-3)
    assert web < 0.6
