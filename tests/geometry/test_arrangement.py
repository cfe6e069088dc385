"""What is carried from face to face is refused where it is wrong, never returned."""

from __future__ import annotations

import math

import pytest

from sbafab.errors import GeometryError, InconsistentError
from sbafab.geometry import arrangement
from sbafab.geometry.arrangement import Arrangement, Overlay, Piece, by_owner, overlaid, split_edges
from sbafab.geometry.edges import EPSILON, Arc, Line, Point, distance_to, left_normal
from sbafab.geometry.region import Region, disc, rectangle, union, wound


def arranged(*regions: Region) -> Arrangement:
    return Arrangement(overlaid([[edge for region in regions for edge in region.edges]]))


def test_windings_of_nested_and_crossing_shapes() -> None:
    arrangement = arranged(
        disc((0, 0), 3), disc((0, 0), 2), disc((2.5, 0), 1), rectangle((9, 0), (10, 1))
    )
    assert set(arrangement.left) == {0, 1, 2, 3}
    for half in range(len(arrangement.origin)):
        edge = arrangement.edge(half)
        (x, y), (ux, uy) = edge.at(0.5), edge.direction(edge.at(0.5))
        p = (x - 1e-4 * uy, y + 1e-4 * ux)
        inside = [r.contains(p) for r in (disc((0, 0), 3), disc((0, 0), 2), disc((2.5, 0), 1))]
        assert arrangement.left[half] == sum(inside) + rectangle((9, 0), (10, 1)).contains(p)


def test_each_owner_has_its_own_windings() -> None:
    first, second = disc((0, 0), 3), rectangle((0, -9), (9, 9))
    rows = [first, second, *([disc((0, 0), 1)] * 30), second]
    arrangement = Arrangement(overlaid([region.edges for region in rows]))
    for half, turns in enumerate(arrangement.left):
        edge = arrangement.edge(half)
        nx, ny = left_normal(edge, edge.at(0.5))
        x, y = edge.at(0.5)
        p = (x + 1e-4 * nx, y + 1e-4 * ny)
        assert by_owner(turns, len(rows)) == [int(region.contains(p)) for region in rows]


def test_a_wrong_order_round_a_point_of_touch_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the touch only curvature tells which circle is the inner one."""
    assert arranged(disc((0, 0), 3), disc((2, 0), 1)).tangled
    right = arrangement._by_side
    monkeypatch.setattr(arrangement, "_by_side", lambda a, b: -right(a, b))
    with pytest.raises(InconsistentError):
        arranged(disc((0, 0), 3), disc((2, 0), 1))
    with pytest.raises(GeometryError, match="change a size"):
        union([disc((0, 0), 3), disc((2, 0), 1)])


def test_an_open_chain_is_refused() -> None:
    with pytest.raises(GeometryError, match="change a size"):
        wound([Line((0.0, 0.0), (1.0, 0.0)), Line((1.0, 0.0), (1.0, 1.0))], 0)


def test_bent_pieces_that_cross_between_their_ends_are_found() -> None:
    """One closed chain that crosses itself where nothing was cut: a bow tie."""
    corners: list[Point] = [(0.0, 0.0), (4.0, 3.0), (4.0, 0.0), (0.0, 3.0)]
    loop = [Line(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]
    pieces = [Piece(edge, 1) for edge in loop]
    with pytest.raises(InconsistentError):
        Arrangement(Overlay(pieces, bent=True))
    # As it is cut, each half is wound round once, and one of them the other way.
    assert wound(loop, 0).area == pytest.approx(3)


def test_an_arc_that_starts_beside_its_circle_meets_what_crosses_it_there() -> None:
    """Taken as a part of its circle it misses the line by 2.5 nm; from end to end, by 1 nm."""
    bent = Arc((0.0, -3.5e-6), (-1.0, 1.0), (0.0, 1.0), 1.0, False)
    touched = Line((-1e-4, -2.5e-6), (-1e-4, -1.0))
    assert distance_to(bent, touched.start) > EPSILON
    cut = split_edges([bent, touched])
    assert [len(parts) for parts in cut.parts] == [2, 1]


@pytest.mark.parametrize("left", [-18.1424, math.nextafter(-18.1424, -20.0)])
def test_a_line_that_touches_a_circle_from_the_left_is_outside_of_it(left: float) -> None:
    """By rounding the circle reaches farther left than the line that it only touches."""
    (x, y), radius = (-11.807, -18.859), 6.3354
    assert x - radius < -18.1424
    angles = [math.pi / 4 + k * math.pi / 2 for k in range(4)]
    corners = [(x + radius * math.cos(t), y + radius * math.sin(t)) for t in angles]
    circle = [
        Arc(start, end, (x, y), radius, ccw=True)
        for start, end in zip(corners, [*corners[1:], corners[0]], strict=True)
    ]
    around = rectangle((left, y - radius), (x + radius, y + radius))
    assert wound([*circle, *around.edges], 1).area == pytest.approx(math.pi * radius**2)
