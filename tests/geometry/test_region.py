"""Regions: area, containment, names of shapes, similarities, flattening."""

from __future__ import annotations

import itertools
import math

import pytest

from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Point
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium, union

RING = disc((0, 0), 3) - disc((0.5, 0), 1)


def test_area_of_a_disc_minus_a_disc() -> None:
    assert RING.area == pytest.approx(math.pi * 8)
    assert (len(RING.outers), len(RING.holes)) == (1, 1)
    assert RING.outers[0].area == pytest.approx(math.pi * 9)
    assert RING.holes[0].area == pytest.approx(-math.pi)


def test_holes_run_clockwise() -> None:
    assert RING.outers[0].winding((2.0, 2.0)) == 1
    assert RING.holes[0].winding((0.5, 0.1)) == -1
    assert RING.holes[0].winding((2.0, 2.0)) == 0


@pytest.mark.parametrize(
    ("point", "inside"),
    [
        # Level with the compass vertices of one circle or the other, and with none.
        ((-2.9, 0.0), True),
        ((-0.6, 0.0), True),
        ((0.0, 0.0), False),
        ((1.4, 0.0), False),
        ((2.9, 0.0), True),
        ((3.1, 0.0), False),
        ((-3.1, 0.0), False),
        ((1.6, 1.0), True),
        ((-2.0, -1.0), True),
        ((-4.0, -3.0), False),
        ((0.1, 2.9), True),
        ((0.5, 0.99), False),
        ((0.5, 1.01), True),
        ((0.5, -0.99), False),
        ((0.0, 2.999), True),
        ((0.0, -3.001), False),
        # On the chord of a quarter arc, which is no edge.
        ((1.5, 1.5), True),
        ((1.0, 0.5), False),
        ((0.0, 0.5), False),
    ],
)
def test_containment_level_with_vertices_and_on_chords(point: Point, inside: bool) -> None:
    assert RING.contains(point) is inside
    assert RING.mirrored().contains((-point[0], point[1])) is inside
    assert RING.turned(90).contains((-point[1], point[0])) is inside


def test_containment_agrees_with_distance_on_a_grid_of_a_stadium() -> None:
    region = stadium((0, 0), 4, 10)
    for i, j in itertools.product(range(-13, 14), repeat=2):
        x, y = i / 4, j / 2
        distance = math.hypot(x, max(0.0, abs(y) - 3))
        if distance != 2:
            assert region.contains((x, y)) is (distance < 2), (x, y)


def test_containment_level_with_corners_of_a_star() -> None:
    star = polygon([(0, 0), (2, 2), (4, 0), (3, 2), (4, 4), (2, 2.5), (0, 4), (1, 2)])
    assert star.contains((1.5, 2.0))
    assert star.contains((2.9, 2.0))
    assert not star.contains((0.9, 2.0))
    assert not star.contains((3.1, 2.0))
    assert not star.contains((2.0, 0.0))
    assert not star.contains((-1.0, 0.0))
    assert not star.contains((2.0, 4.0))


def started_elsewhere(region: Region, by: int) -> Region:
    return Region(tuple(Contour((*c.edges[by:], *c.edges[:by])) for c in region.contours))


@pytest.mark.parametrize("by", [1, 2, 3])
def test_the_key_forgets_where_a_contour_starts(by: int) -> None:
    for region in (disc((1, 2), 3), stadium((0, 0), 2, 7), RING, rectangle((0, 0), (3, 4))):
        assert started_elsewhere(region, by).key == region.key
        assert started_elsewhere(region, by) == region


def test_the_key_forgets_the_order_of_construction() -> None:
    discs = [disc((2 * math.cos(a), 2 * math.sin(a)), 1.5) for a in (0, 2, 4)]
    keys = {union(order).key for order in itertools.permutations(discs)}
    assert len(keys) == 1
    holes = [disc((x, 0.2), 0.4) for x in (-1, 0, 1)]
    body = rectangle((-3, -2), (3, 2))
    drilled = {((body - a) - b) - c for a, b, c in itertools.permutations(holes)}
    assert drilled == {body - union(holes)}


def test_the_key_tells_shapes_apart() -> None:
    shapes = [
        disc((0, 0), 3),
        disc((0, 0), 3.00001),
        disc((1e-5, 0), 3),
        rectangle((0, 0), (2, 3)),
        rectangle((0, 0), (3, 2)),
        RING,
    ]
    assert len({shape.key for shape in shapes}) == len(shapes)


def test_pieces_take_their_own_holes() -> None:
    left = rectangle((0, 0), (4, 4)) - rectangle((1, 1), (3, 3))
    island = disc((2, 2), 0.5) - disc((2, 2), 0.25)
    right = rectangle((6, 0), (9, 3)) - disc((7, 1), 0.5)
    areas = sorted(piece.area for piece in union([left, island, right]).pieces)
    expected = [math.pi * (0.25 - 0.0625), 9 - math.pi / 4, 16 - 4]
    assert areas == pytest.approx(expected)


def test_similarities_keep_area_and_place() -> None:
    assert RING.moved(5, -2).bounds == pytest.approx((2, -5, 8, 1))
    assert RING.turned(37).area == pytest.approx(RING.area)
    assert RING.turned(90).holes[0].circle == (pytest.approx((0, 0.5)), 1)
    assert RING.mirrored().holes[0].circle == (pytest.approx((-0.5, 0)), 1)
    assert RING.mirrored().area == pytest.approx(RING.area)
    assert RING.scaled(2).area == pytest.approx(4 * RING.area)
    assert RING.turned(37).turned(-37).moved(1, 1).moved(-1, -1) == RING


def test_vertices_carry_the_bulge_of_quarter_arcs() -> None:
    bulges = [bulge for _, _, bulge in disc((0, 0), 2).contours[0].vertices]
    assert bulges == pytest.approx([math.tan(math.pi / 8)] * 4)
    assert [bulge for _, _, bulge in rectangle((0, 0), (1, 1)).contours[0].vertices] == [0] * 4


@pytest.mark.parametrize("sagitta", [0.1, 0.01, 0.0005])
def test_flattened_arcs_stay_within_the_sagitta(sagitta: float) -> None:
    ((outer, hole),) = RING.polygons(sagitta)
    for ring, centre, radius in ((outer, (0.0, 0.0), 3.0), (hole, (0.5, 0.0), 1.0)):
        for a, b in itertools.pairwise([*ring, ring[0]]):
            middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
            assert math.dist(a, centre) == pytest.approx(radius)
            assert radius - math.dist(middle, centre) <= sagitta * (1 + 1e-9)


def rounded(points: list[Point]) -> set[Point]:
    return {(round(x, 9) + 0.0, round(y, 9) + 0.0) for x, y in points}


def test_shared_arcs_give_shared_vertices() -> None:
    whole = disc((0.3, 0.2), 2)
    cut = rectangle((0, -5), (5, 5))
    ((inside,),) = (whole & cut).polygons(0.001)
    ((outside,),) = (whole - cut).polygons(0.001)
    ((ring,),) = whole.polygons(0.001)
    _, hole = (rectangle((-3, -3), (3, 3)) - whole).polygons(0.001)[0]
    corners = rounded([(0, 0.2 + s * math.sqrt(4 - 0.09)) for s in (-1, 1)])
    assert rounded(inside) & rounded(outside) == corners
    assert rounded(inside) | rounded(outside) == rounded(ring) | corners
    assert rounded(hole) == rounded(ring)


def test_even_the_thinnest_lens_flattens_to_a_ring() -> None:
    lens = disc((-0.9995, 0), 1) & disc((0.9995, 0), 1)
    ((ring,),) = lens.polygons(0.001)
    assert len(ring) >= 3


def test_a_circle_is_known_whatever_its_edges_are_split_into() -> None:
    halves = Contour(
        (
            Arc((2, 0), (-2, 0), (0, 0), 2.0, True),
            Arc((-2, 0), (2, 0), (0, 0), 2.0, True),
        )
    )
    assert halves.circle == ((0, 0), 2)
    assert halves.area == pytest.approx(4 * math.pi)
    assert stadium((0, 0), 2, 3).contours[0].circle is None


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
    turned = Region(tuple(Contour((*c.edges[1:], c.edges[0])) for c in shape.contours))
    assert turned.moved(1e-6, 0) == shape
