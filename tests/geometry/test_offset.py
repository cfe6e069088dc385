"""Growing, shrinking and filleting against closed formulas."""

from __future__ import annotations

import math
from random import Random

import pytest

from sbafab.geometry.edges import Arc, edge_from_bulge
from sbafab.geometry.offset import dragged, fillet, grow, shrink, swept
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium, union

CONVEX = [
    disc((1, 2), 3.25),
    rectangle((0, 0), (7, 3)),
    stadium((0, 0), 11.5, 20).turned(17.3),
    polygon([(0, 0), (5, 1), (2, 4)]),
    disc((0, 0), 2) & disc((1.5, 0.3), 2),
]
FULL_CORNER = 1 - math.pi / 4
"""Area between a right-angled corner and the unit arc that rounds it."""


def perimeter(region: Region) -> float:
    return sum(contour.length for contour in region.contours)


@pytest.mark.parametrize("shape", CONVEX)
@pytest.mark.parametrize("distance", [0.05, 0.5, 2.0])
def test_growing_a_convex_shape_adds_a_band(shape: Region, distance: float) -> None:
    """Steiner: A + P d + pi d^2."""
    grown = grow(shape, distance)
    expected = shape.area + perimeter(shape) * distance + math.pi * distance**2
    assert grown.area == pytest.approx(expected)
    assert perimeter(grown) == pytest.approx(perimeter(shape) + math.tau * distance)
    back = shrink(grown, distance)
    assert back.area == pytest.approx(shape.area, abs=1e-7)
    assert back.bounds == pytest.approx(shape.bounds, abs=1e-5)
    assert len(back.edges) == len(shape.edges)
    assert fillet(shape, distance).area == pytest.approx(shape.area, abs=1e-7)


@pytest.mark.parametrize("radius", [0.3, 1.0, 1.999])
@pytest.mark.parametrize("angle", [0, 17.3, 45])
def test_the_fillet_of_a_corner_adds_its_area(radius: float, angle: float) -> None:
    corner = rectangle((0, 0), (6, 2)) | rectangle((0, 0), (2, 6))
    rounded = fillet(corner.turned(angle), radius)
    assert rounded.area == pytest.approx(corner.area + radius**2 * FULL_CORNER)
    (arc,) = [edge for edge in rounded.edges if isinstance(edge, Arc)]
    assert arc.radius == pytest.approx(radius)
    assert not arc.ccw
    assert len(rounded.edges) == 7


def segment(radius: float, height: float) -> Region:
    """What a straight cut ``height`` below its top takes off a disc."""
    far = 2 * radius
    return disc((0, 0), radius) - rectangle((-far, -far), (far, radius - height))


def cap_area(radius: float, height: float) -> float:
    half = math.acos(1 - height / radius)
    return radius**2 * (half - math.sin(half) * math.cos(half))


@pytest.mark.parametrize("radius", [1.5, 7.5, 40])
@pytest.mark.parametrize("distance", [0.02, 0.05, 0.75])
def test_segments_grow_round_their_sharp_tips(radius: float, distance: float) -> None:
    """Steiner again: from 1 um to 0.3 mm high, where line and arc meet at under a degree or two."""
    for i in range(40):
        height = 1e-3 * 300 ** (i / 39)
        half = math.acos(1 - height / radius)
        around = 2 * radius * (half + math.sin(half))
        shape = segment(radius, height).turned(17.3 * i)
        expected = cap_area(radius, height) + around * distance + math.pi * distance**2
        # The line and the arc each end within 4 nm of the tip.
        assert grow(shape, distance).area == pytest.approx(expected, abs=1e-5 * around)


@pytest.mark.parametrize("seed", range(8))
def test_a_tool_covers_what_lies_within_half_its_width_of_its_path(seed: int) -> None:
    """Paths that cross, touch and retrace themselves, open and closed, against plain distances."""
    random = Random(seed)
    corners = [(random.randint(-9, 9) / 1.5, random.uniform(-6, 6)) for _ in range(6)]
    if seed % 4 == 0:
        corners += corners[-2:0:-1]
    if seed % 2 == 0:
        corners.append(corners[0])
    bulges = [random.choice((0.0, 0.0, random.uniform(-1, 1))) for _ in corners]
    path = [
        edge_from_bulge(start, end, bulge)
        for start, end, bulge in zip(corners, corners[1:], bulges, strict=False)
    ]
    half = random.uniform(0.2, 2)
    covered = swept(path, 2 * half, True)
    for _ in range(300):
        p = random.uniform(-9, 9), random.uniform(-9, 9)
        away = min(math.dist(p, edge.nearest(p)) for edge in path)
        assert covered.contains(p) == (away < half) or abs(away - half) < 1e-6


@pytest.mark.parametrize("seed", range(8))
def test_a_region_covers_on_its_way_all_sums_of_points(seed: int) -> None:
    """A region dragged along a line or an arc, against copies of it along the way."""
    random = Random(seed)
    hole, plate = disc((0.9, 0), 0.5), polygon([(0, 0), (5, 1), (2, 4)])
    shapes = [disc((1, 2), 1.2) - hole, grow(plate, 0.4), stadium((0, 0), 2, 5), disc((0, 0), 1)]
    shape = shapes[seed % 4].turned(random.uniform(0, 360)) - hole
    start, end = ((random.uniform(-3, 3), random.uniform(-3, 3)) for _ in range(2))
    way = edge_from_bulge(start, end, random.choice((0.0, random.uniform(-1, 1), 1.0)))
    covered = dragged(shape, way)
    stops = [way.at(k / 400) for k in range(401)]
    for _ in range(150):
        p = random.uniform(-8, 8), random.uniform(-8, 8)
        copies = [(p[0] - x, p[1] - y) for x, y in stops]
        if covered.contains(p) != any(map(shape.contains, copies)):
            # Between two copies, or on the edge.
            assert min(map(shape.distance_to_edge, copies)) < way.length / 400


def test_shrinking_past_the_inner_radius_leaves_nothing() -> None:
    assert shrink(disc((0, 0), 1), 1.1).is_empty
    assert shrink(disc((0, 0), 1), 1.0).is_empty
    assert shrink(rectangle((0, 0), (9, 2)), 1.0).is_empty
    assert shrink(stadium((0, 0), 2, 9), 1.0).is_empty
    assert shrink(disc((0, 0), 3) - disc((0, 0), 1), 1.0).is_empty


def test_growing_closes_holes_it_reaches_across() -> None:
    plate = rectangle((-5, -5), (5, 5))
    for radius in (0.3, 0.5):
        assert grow(plate - disc((1, 1), radius), 0.5) == grow(plate, 0.5)


def test_gaps_of_exactly_twice_the_distance_close() -> None:
    pair = rectangle((0, 0), (2, 4)) | rectangle((3, 0), (5, 4))
    grown = grow(pair, 0.5)
    assert len(grown.pieces) == 1
    # Two notches remain above and below the seam, between the corner arcs.
    assert grown.area == pytest.approx(6 * 5 - 4 * FULL_CORNER / 4 - 4 * FULL_CORNER / 4)
    apart = grow(pair, 0.499)
    assert len(apart.pieces) == 2
    slot = rectangle((0, 0), (9, 4)) - rectangle((4, 1), (5, 4))
    assert grow(slot, 0.5).area == pytest.approx(10 * 5 - FULL_CORNER - 2 * FULL_CORNER / 4)


def test_necks_of_exactly_twice_the_distance_part() -> None:
    bell = union([rectangle((0, 0), (4, 4)), rectangle((4, 1.5), (8, 2.5))])
    bell |= rectangle((8, 0), (12, 4))
    assert len(shrink(bell, 0.5).pieces) == 2
    # Each half runs out in a cusp between the two quarter circles of the neck's corners.
    assert shrink(bell, 0.5).area == pytest.approx(2 * (9 + 0.5 - math.pi / 8))
    assert len(shrink(bell, 0.49).pieces) == 1
