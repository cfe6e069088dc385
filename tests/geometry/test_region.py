"""Regions: profiles, containment, names of shapes, similarities, sections, flattening, caches."""

from __future__ import annotations

import itertools
import math

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from svgelements import Arc as SvgArc
from svgelements import Path

from sbafab.geometry.cache import MOST, cached
from sbafab.geometry.contour import (
    Contour,
    circle,
    facets,
    in_reading_order,
    nanometres,
)
from sbafab.geometry.edges import Arc, Line, Point
from sbafab.geometry.offset import fillet, grow
from sbafab.geometry.region import (
    Region,
    centroid,
    difference,
    disc,
    path_data,
    polygon,
    rectangle,
    section,
    stadium,
    strip,
    union,
)
from tests.cutting.shapes import coarse, shapes
from tests.hunt.oracle import flat

RING = disc((0, 0), 3) - disc((0.5, 0), 1)
STAR = polygon([(0, 0), (2, 2), (4, 0), (3, 2), (4, 4), (2, 2.5), (0, 4), (1, 2)])
PLATE = fillet(disc((0.0, 0.0), 3.25) | strip((0.0, 0.0), (8.25, 0.0), 3.1), 1.0)
# Shape, area, bounds, perimeter, and numbers of arcs and of lines.
PROFILES = {
    "disc": (disc((1.5, -2.0), 3.25), math.pi * 3.25**2, (-1.75, -5.25, 4.75, 1.25),
             math.tau * 3.25, 4, 0),
    "stadium": (stadium((1, 2), 11.5, 20), math.pi * 5.75**2 + 11.5 * 8.5, (-4.75, -8, 6.75, 12),
                math.pi * 11.5 + 17, 4, 2),
    "rectangle": (rectangle((1, 1), (3, 4)), 6, (1, 1, 3, 4), 10, 0, 4),
    "strip": (strip((1, 1), (4, 5), 0.8), 4, (0.68, 0.76, 4.32, 5.24), 11.6, 0, 4),
    "triangle, clockwise": (polygon([(0, 3), (4, 0), (0, 0)]), 6, (0, 0, 4, 3), 12, 0, 3),
    "ring": (RING, 8 * math.pi, (-3, -3, 3, 3), 8 * math.pi, 8, 0),
}  # fmt: skip


@pytest.mark.parametrize("name", PROFILES)
def test_profiles_and_similar_ones_by_their_formulas(name: str) -> None:
    shape, area, bounds, length, arcs, lines = PROFILES[name]
    assert shape.bounds == pytest.approx(bounds)
    assert sum(contour.is_hole for contour in shape.contours) == len(shape.holes)
    images = [shape, shape.turned(37), shape.mirrored(), shape.moved(5, -2)]
    for image, factor in (*((image, 1) for image in images), (shape.scaled(2), 2)):
        assert image.area == pytest.approx(factor**2 * area, rel=1e-14)
        assert sum(c.length for c in image.contours) == pytest.approx(factor * length)
        kinds = [type(edge) for edge in image.edges]
        assert (kinds.count(Arc), kinds.count(Line)) == (arcs, lines)
    assert shape.turned(37).turned(-37).moved(1, 1).moved(-1, -1) == shape
    assert shape.moved(5, -2).bounds == pytest.approx(
        (bounds[0] + 5, bounds[1] - 2, bounds[2] + 5, bounds[3] - 2)
    )


# Level with corners, compass points of circles and chords of quarter arcs, and with none.
LEVELS = [k / 8 for k in range(-26, 40)]


@pytest.mark.parametrize("region", [RING, STAR, stadium((0, 0), 2, 5) - disc((0, 1), 0.5)])
def test_containment_level_with_corners_and_on_chords(region: Region) -> None:
    flat = region.shapely(1e-6)
    for p in itertools.product(LEVELS, repeat=2):
        if region.distance_to_edge(p) > 1e-5:
            inside = flat.contains(shapely.Point(p))
            assert region.contains(p) is inside, p
            assert region.mirrored().contains((-p[0], p[1])) is inside, p
            assert region.turned(90).contains((-p[1], p[0])) is inside, p


def started_elsewhere(region: Region, by: int) -> Region:
    return Region(tuple(Contour((*c.edges[by:], *c.edges[:by])) for c in region.contours))


def test_the_key_forgets_starts_and_order_and_tells_shapes_apart() -> None:
    listed = [disc((1, 2), 3), disc((1, 2), 3.00001), disc((1.00001, 2), 3), RING]
    listed += [rectangle((0, 0), (3, 4)), rectangle((0, 0), (4, 3)), stadium((0, 0), 2, 7)]
    assert len({shape.key for shape in listed}) == len(set(listed)) == len(listed)
    for shape, by in itertools.product(listed, (1, 2, 3)):
        assert started_elsewhere(shape, by).key == shape.key
        assert started_elsewhere(shape, by).moved(1e-6, 0) == shape
    discs = [disc((2 * math.cos(a), 2 * math.sin(a)), 1.5) for a in (0, 2, 4)]
    assert len({union(order).key for order in itertools.permutations(discs)}) == 1
    holes = [disc((x, 0.2), 0.4) for x in (-1, 0, 1)]
    body = rectangle((-3, -2), (3, 2))
    drilled = {((body - a) - b) - c for a, b, c in itertools.permutations(holes)}
    assert drilled == {body - union(holes)}


def test_pieces_take_their_own_holes() -> None:
    left = rectangle((0, 0), (4, 4)) - rectangle((1, 1), (3, 3))
    island = disc((2, 2), 0.5) - disc((2, 2), 0.25)
    right = rectangle((6, 0), (9, 3)) - disc((7, 1), 0.5)
    areas = sorted(piece.area for piece in union([left, island, right]).pieces)
    assert areas == pytest.approx([math.pi * (0.25 - 0.0625), 9 - math.pi / 4, 16 - 4])


# Flattening: shared chords, area kept or sagitta kept.


def shoelace(points: list[Point]) -> float:
    pairs = zip(points, points[1:] + points[:1], strict=True)
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in pairs) / 2


def rounded(points: list[Point]) -> set[Point]:
    return {(round(x, 9) + 0.0, round(y, 9) + 0.0) for x, y in points}


@given(st.floats(0.05, 40), st.sampled_from([0.0005, 0.002, 0.02]), st.floats(0.1, 0.9))
def test_facets_of_a_circle_keep_its_area_however_it_is_split(
    radius: float, sagitta: float, share: float
) -> None:
    whole = circle((1.7, -0.3), radius)
    points = facets(whole, sagitta)
    assert shoelace(points) == pytest.approx(math.pi * radius**2, rel=1e-12)
    reach = math.dist((1.7, -0.3), points[0])
    middle = math.dist((1.7, -0.3), [(a + b) / 2 for a, b in zip(*points[:2], strict=True)])
    assert middle < radius < reach
    assert reach - middle <= sagitta * 1.01 or len(points) == 12
    first = whole.edges[0]
    split = (first.part(first.start, first.at(share)), first.part(first.at(share), first.end))
    for other in (whole.reversed(), Contour((*split, *whole.edges[1:]))):
        assert rounded(facets(other, sagitta)) == rounded(points)


# Sections by lines, and SVG paths.


SLANT = math.sqrt(0.5)
SECTIONS = [
    *((disc((1, 0), 2.5), (0, y), (1, 0), [(1 - (6.25 - y * y) ** 0.5, 1 + (6.25 - y * y) ** 0.5)])
      for y in (0.0, 0.3, 2.49)),
    (disc((0, 0), 3.25) - disc((0, 0), 0.5), (0, 0), (SLANT, SLANT), [(-3.25, -0.5), (0.5, 3.25)]),
    (rectangle((2, -1), (5, 1)), (10, 0), (-1, 0), [(5, 8)]),
    (strip((-9, 0), (9, 0), 1.6), (0, 0), (0.6, 0.8), [(-1, 1)]),
    (disc((0, 0), 1), (0, 1.5), (1, 0), []),
    (disc((0, 0), 1), (0, 1), (1, 0), []),
    (Region(), (0, 0), (1, 0), []),
]  # fmt: skip


@pytest.mark.parametrize(("region", "origin", "direction", "expected"), SECTIONS)
def test_sections_by_closed_formulas(
    region: Region, origin: Point, direction: Point, expected: list[Point]
) -> None:
    stretches = section(region, origin, direction)
    assert stretches == [pytest.approx(stretch, abs=1e-9) for stretch in expected]


@pytest.mark.parametrize("region", [PLATE - disc((0, 0), 0.5), stadium((1, 2), 11.5, 20)])
def test_area_survives_the_way_through_svg(region: Region) -> None:
    area = 0.0
    for piece in Path(path_data(region)).as_subpaths():
        points = []
        for segment in list(Path(piece))[1:]:
            steps = 2000 if isinstance(segment, SvgArc) else 1
            points += [segment.point(i / steps) for i in range(steps)]
        area += shoelace([(p.x, p.y) for p in points])
    assert area == pytest.approx(region.area, rel=1e-4)


# Caches by exact numbers.


def test_a_hair_makes_another_key_and_few_results_are_kept() -> None:
    calls: list[Region] = []

    @cached
    def area(region: Region, times: float = 1.0) -> float:
        calls.append(region)
        return times * region.area

    exact, hair = disc((0.0, 0.0), 2.0), disc((0.0, 0.0), 2.0 + 1e-9)
    assert exact == hair, "regions are equal within SAME"
    assert area(exact) == area(disc((0.0, 0.0), 2.0)) != area(hair)
    assert area(exact, 2.0) == 2 * area(exact)
    assert len(calls) == 3
    for k in range(MOST + 1):
        area(disc((0.0, 0.0), 3.0 + k))
    area(exact)
    assert len(calls) == 3 + MOST + 1 + 1
    cut, cutter = rectangle((0.0, 0.0), (7.0, 3.0)), disc((0.0, 0.0), 2.25)
    assert difference(cut, cutter) is difference(cut.moved(0, 0), cutter)


def test_shapes_a_hair_apart_are_equal_wherever_their_numbers_round_to() -> None:
    """Coordinates half way between two nanometres: a hair decides what they round to."""
    for x in (0.0000005, 1.2345675, -3.0000015):
        for shape in (disc((x, 0), 2), rectangle((x, 0), (3, 2)), stadium((x, x), 2, 5)):
            assert len({shape, shape.moved(1e-11, -1e-11), shape.moved(-1e-11, 1e-11)}) == 1
    shape = stadium((0, 0), 2, 5) - disc((0, 1), 0.5)
    assert shape == shape.moved(1e-6, 1e-6)
    assert shape != shape.moved(1e-5, 0)
    assert shape != stadium((0, 0), 2, 5) - disc((0, 1), 0.50001)
    assert rectangle((0, 0), (2, 2)) != disc((1, 1), 1)


def test_contours_are_read_in_one_order_whatever_differs_by_less_than_a_nanometre() -> None:
    values = (0.0, 1.2e-6, -1.2e-6, 1.7e-6, -1.7e-6, 12.345678)
    assert [nanometres(x) for x in values] == [0, 1, -1, 2, -2, 12_345_678]
    hair = 3e-7
    left, lower = rectangle((-2.0, -1.0), (-1.0, 1.0)), rectangle((1.0, -3.0), (2.0, -2.0))
    upper = rectangle((1.0 - hair, 2.0), (2.0, 3.0))
    hole = circle((0.0, 0.0), 0.25).reversed()
    expected = (left.contours[0], lower.contours[0], upper.contours[0], hole)
    for order in itertools.permutations(expected):
        assert in_reading_order(order) == expected


HALF = disc((3.0, -1.0), 2.0) & rectangle((3.0, -5.0), (9.0, 5.0))


def test_centres_of_area() -> None:
    assert centroid(HALF) == pytest.approx((3.0 + 4 * 2.0 / (3 * math.pi), -1.0), abs=1e-9)
    for region in (HALF, PLATE - disc((1.5, 0.5), 1.0), disc((0, 0), 1) | disc((7, 3), 2)):
        centre = region.shapely(1e-6).centroid
        assert centroid(region) == pytest.approx((centre.x, centre.y), abs=1e-5)


@pytest.mark.parametrize("sagitta", [0.1, 0.01, 0.0005])
def test_flattened_arcs_stay_within_the_sagitta(sagitta: float) -> None:
    ((outer, hole),) = RING.polygons(sagitta)
    for ring, centre, radius in ((outer, (0.0, 0.0), 3.0), (hole, (0.5, 0.0), 1.0)):
        for a, b in itertools.pairwise([*ring, ring[0]]):
            middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
            assert math.dist(a, centre) == pytest.approx(radius)
            assert radius - math.dist(middle, centre) <= sagitta * (1 + 1e-9)


# What the hunt does not ask: pieces, fillets and the order of a union, on grids of shapes.
#
# Edges of drawn shapes often coincide, only touch, or lie a hair apart; shapely is the judge.


FINE = 2e-5
"""mm a chord may leave its arc."""
QUADRANT = 128
"""Chords a quadrant in shapely's buffers."""


@given(st.lists(shapes(), min_size=2, max_size=4), st.randoms(use_true_random=False))
def test_the_order_of_a_union_does_not_matter(parts: list[Region], random: object) -> None:
    mixed = list(parts)
    random.shuffle(mixed)  # type: ignore[attr-defined]
    assert union(mixed).area == pytest.approx(union(parts).area, abs=1e-4)


@given(
    st.lists(st.tuples(coarse, coarse), min_size=2, max_size=6, unique=True),
    st.sampled_from([0.2, 0.3, 0.45, 0.6, 0.8]),
    shapes(),
)
def test_the_number_of_pieces(
    spots: list[tuple[float, float]], radius: float, tool: Region
) -> None:
    """Of dots that neither coincide nor touch: shapely counts them dependably."""
    dots, wider = union([disc((2 * x, y), radius) for x, y in spots]), grow(tool, 0.01)
    theirs, other = flat(dots, FINE), flat(tool, FINE).buffer(0.01)
    for ours, expected in (
        (dots, theirs),
        (dots - wider, theirs.difference(other)),
        (dots | wider, theirs.union(other)),
    ):
        # Slivers this small are made or lost by flattening.
        count = sum(part.area > 1e-3 for part in shapely.get_parts(expected))
        assert sum(piece.area > 1e-3 for piece in ours.pieces) == count


@given(
    st.lists(shapes(), min_size=1, max_size=4), shapes(), st.sampled_from([0.11, 0.25, 0.37, 0.5])
)
def test_fillets(parts: list[Region], tool: Region, radius: float) -> None:
    """Where a gap is just twice the radius wide, a hair more or less decides: both are right."""
    region = union(parts) - tool
    shape, ends = flat(region, FINE), []
    for reach in (radius * (1 - 2e-4), radius, radius * (1 + 2e-4)):
        grown = shape.buffer(reach, quad_segs=QUADRANT)
        ends.append(grown.buffer(-reach, quad_segs=QUADRANT).area)
    # Shapely first drops detail of up to a hundredth of the radius.
    error = 1e-4 + (FINE + 2e-4) * sum(contour.length for contour in region.contours)
    assert min(ends) - error <= fillet(region, radius).area <= max(ends) + error
