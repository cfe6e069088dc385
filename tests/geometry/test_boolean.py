"""Booleans against closed formulas, above all where edges coincide or only touch."""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sbafab.errors import GeometryError, InconsistentError
from sbafab.geometry import arrangement
from sbafab.geometry.arrangement import (
    Arrangement,
    Piece,
    PointPool,
    by_owner,
    overlaid,
    split_edges,
)
from sbafab.geometry.boolean import FAR, alone
from sbafab.geometry.contour import circle
from sbafab.geometry.edges import EPSILON, SAME, Arc, Line, Point, distance_to, left_normal
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium, strip, union
from tests.hunt.oracle import laid_over

AXIS = (0.0, 0.0)


def lens(r: float, s: float, gap: float) -> float:
    """Common area of two circles with their centres ``gap`` apart."""
    a = math.acos((gap**2 + r**2 - s**2) / (2 * gap * r))
    b = math.acos((gap**2 + s**2 - r**2) / (2 * gap * s))
    kite = math.sqrt((r + s - gap) * (gap + r - s) * (gap - r + s) * (gap + r + s)) / 2
    return r**2 * a + s**2 * b - kite


SQUARES = rectangle(AXIS, (3, 3)) - union(
    [rectangle((x, y), (x + 1, y + 1)) for x, y in ((0, 1), (1, 0), (1, 2), (2, 1))]
)
DIAMOND = polygon([(2, 0), (0, 2), (-2, 0), (0, -2)])
FLUSH = rectangle(AXIS, (4, 2)) - rectangle((1, 1), (3, 2))
# Area, and numbers of pieces, of holes and of edges.
COINCIDENT = {
    "a seam": (rectangle(AXIS, (2, 3)) | rectangle((2, 0), (5, 3)), 15, 1, 0, 4),
    "part of a seam": (rectangle(AXIS, (2, 3)) | rectangle((2, 1), (5, 2)), 9, 1, 0, 8),
    "a common corner": (rectangle(AXIS, (1, 1)) | rectangle((1, 1), (2, 2)), 2, 2, 0, 8),
    "a checkerboard": (SQUARES, 5, 5, 0, 20),
    "a hole flush with the edge": (FLUSH, 6, 1, 0, 8),
    "a hole that touches the rim": (disc(AXIS, 2) - DIAMOND, 4 * math.pi - 8, 4, 0, 8),
    "strips along one line": (strip(AXIS, (4, 0), 1) | strip((3, 0), (9, 0), 1), 9, 1, 0, 4),
    "a disc in its own hole": (
        (rectangle((-4, -4), (4, 4)) - disc((1, 1), 2)) | disc((1, 1), 2), 64, 1, 0, 4,
    ),
    "one disc three times": (union([disc(AXIS, 2)] * 2 + [disc(AXIS, 2).turned(33)]),
                             4 * math.pi, 1, 0, 4),
    "a bond flush with its bore": (
        disc(AXIS, 3.25) - disc(AXIS, 0.5) - (disc(AXIS, 2.5) - disc(AXIS, 0.5)),
        math.pi * (3.25**2 - 2.5**2), 1, 1, 8,
    ),
    "a ring round two that meet": (
        union([disc(AXIS, 9) - disc(AXIS, 8), disc(AXIS, 2), disc((1, 0), 2)]),
        25 * math.pi - lens(2, 2, 1), 2, 1, 14,
    ),
    # Long boxes that meet, one of them round a disc that meets neither.
    "a disc between two that meet": (
        union([rectangle(AXIS, (9, 9)) - rectangle((1, 1), (8, 8)),
               rectangle((8.5, 4), (12, 5)), disc((4, 4), 1)]),
        35 + math.pi, 2, 1, 16,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COINCIDENT)
@pytest.mark.parametrize("angle", [0, 17.3])
def test_edges_that_coincide_or_touch(name: str, angle: float) -> None:
    region, area, pieces, holes, edges = COINCIDENT[name]
    assert region.area == pytest.approx(area)
    assert (len(region.pieces), len(region.holes), len(region.edges)) == (pieces, holes, edges)
    turned = region.turned(angle)
    assert turned | turned == turned & turned == turned
    assert (turned - turned).is_empty


# Chains that stay clear of each other, against the arrangement of all of them.


def some(draw: random.Random) -> Region:
    """A shape on a coarse grid, so that many are twins, lie in each other or meet."""
    centre = (3.0 * draw.randint(0, 2), 3.0 * draw.randint(0, 1))
    size = draw.choice([0.5, 1.0, 1.4, 1.8, 4.0])
    kind = draw.choice(["disc", "disc", "ring", "stadium", "turned"])
    if kind == "ring":
        return Region((circle(centre, size), circle(centre, size / 2).reversed()))
    if kind == "stadium":
        return stadium(centre, 2 * size, 3 * size)
    return disc(centre, size).turned(33 if kind == "turned" else 0)


@given(st.integers(0, 10_000))
def test_the_same_as_laying_all_over_each_other(seed: int) -> None:
    draw = random.Random(seed)
    shapes = [some(draw) for _ in range(draw.randint(2, 4))]
    a, b = shapes[0], union(shapes[1:])
    back = [contour.reversed() for contour in b.contours]
    for result, edges, above in (
        (union(shapes), [edge for shape in shapes for edge in shape.edges], 0),
        (a & b, [*a.edges, *b.edges], 1),
        (a - b, [*a.edges, *(edge for contour in back for edge in contour.edges)], 0),
    ):
        whole = laid_over(edges, above)
        assert result == whole
        assert result.area == pytest.approx(whole.area, abs=1e-9)


NOT_CLEAR: dict[str, list[Point]] = {
    "crosses itself": [(0, 0), (4, 0), (0, 2), (4, 3)],
    "comes near": [(0, 0), (4, 0), (4, 2), (2, FAR / 2), (0, 2)],
    "short edge": [(0, 0), (4, 0), (4, FAR / 2), (0, 2)],
    "spike": [(0, 0), (4, 0), (4, 4), (2, 4), (2, 2), (2 + FAR / 4, 4), (0, 4)],
}


@pytest.mark.parametrize("name", NOT_CLEAR)
def test_what_comes_near_to_itself_is_not_alone(name: str) -> None:
    assert alone(polygon(NOT_CLEAR[name]).contours[0]) is None


# Arrangements: what is carried from face to face is refused where it is wrong, never returned.


def test_each_owner_has_its_own_windings() -> None:
    first, second = disc(AXIS, 3), rectangle((0, -9), (9, 9))
    rows = [first, second, *([disc(AXIS, 1)] * 30), disc((2.5, 0), 1), second]
    laid = Arrangement(overlaid([region.edges for region in rows]))
    for half, turns in enumerate(laid.left):
        edge = laid.edge(half)
        (x, y), (nx, ny) = edge.at(0.5), left_normal(edge, edge.at(0.5))
        p = (x + 1e-4 * nx, y + 1e-4 * ny)
        assert by_owner(turns, len(rows)) == [int(region.contains(p)) for region in rows]


def test_a_wrong_order_round_a_point_of_touch_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the touch only curvature tells which circle is the inner one."""
    pair = disc(AXIS, 3), disc((2, 0), 1)
    right = arrangement._by_side
    monkeypatch.setattr(arrangement, "_by_side", lambda a, b: -right(a, b))
    with pytest.raises(InconsistentError):
        Arrangement(overlaid([[edge for region in pair for edge in region.edges]]))
    with pytest.raises(GeometryError, match="change a dimension"):
        union(pair)


def test_bent_pieces_that_cross_between_their_ends_are_found() -> None:
    """One closed chain that crosses itself where nothing was cut: a bow tie."""
    corners: list[Point] = [(0.0, 0.0), (4.0, 3.0), (4.0, 0.0), (0.0, 3.0)]
    loop = [Line(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]
    with pytest.raises(InconsistentError):
        Arrangement(([Piece(edge, 1) for edge in loop], True))
    # As it is cut, each half is wound round once, and one of them the other way.
    assert laid_over(loop).area == pytest.approx(3)


steps = st.floats(-40, 40).map(lambda step: step * SAME)


@given(st.lists(st.tuples(steps, steps), max_size=60), st.randoms(use_true_random=False))
def test_pooled_points_hang_together_by_short_steps(
    points: list[Point], shuffler: random.Random
) -> None:
    points += [(0.95 * SAME * i, 0.0) for i in range(5)]
    expected: list[set[Point]] = []
    for p in points:
        near = [g for g in expected if any(math.dist(p, q) < SAME for q in g)]
        expected = [g for g in expected if g not in near] + [{p}.union(*near)]
    shuffler.shuffle(points)
    pool = PointPool(points)
    assert {p: pool.snapped(p) for p in points} == {p: min(g) for g in expected for p in g}


def test_arcs_stay_arcs() -> None:
    both = disc(AXIS, 2) | disc((2, 0), 2)
    # Two arcs of 240 degrees, each in three parts of a quarter turn at most.
    assert [type(edge) for edge in both.edges] == [Arc] * 6
    assert all(abs(edge.bulge) <= math.tan(math.pi / 8) + 1e-12 for edge in both.edges)
    half = disc(AXIS, 2) - rectangle((0, -3), (3, 3))
    assert sorted(type(edge).__name__ for edge in half.edges) == ["Arc", "Arc", "Line"]


def test_an_open_chain_is_refused() -> None:
    with pytest.raises(GeometryError, match="change a dimension"):
        laid_over([Line(AXIS, (1.0, 0.0)), Line((1.0, 0.0), (1.0, 1.0))])


@pytest.mark.parametrize("left", [-18.1424, math.nextafter(-18.1424, -20.0)])
def test_a_line_that_touches_a_circle_from_the_left_is_outside_of_it(left: float) -> None:
    """By rounding the circle reaches farther left than the line that it only touches."""
    (x, y), radius = (-11.807, -18.859), 6.3354
    assert x - radius < -18.1424
    around = rectangle((left, y - radius), (x + radius, y + radius))
    edges = [*disc((x, y), radius).turned(45, (x, y)).edges, *around.edges]
    assert laid_over(edges, 1).area == pytest.approx(math.pi * radius**2)


def test_an_arc_that_starts_beside_its_circle_meets_what_crosses_it_there() -> None:
    """Taken as a part of its circle it misses the line by 2.5 nm; from end to end, by 1 nm."""
    bent = Arc((0.0, -3.5e-6), (-1.0, 1.0), (0.0, 1.0), 1.0, False)
    touched = Line((-1e-4, -2.5e-6), (-1e-4, -1.0))
    assert distance_to(bent, touched.start) > EPSILON
    assert [len(parts) for parts in split_edges([bent, touched])[0]] == [2, 1]
