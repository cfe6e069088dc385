"""Edges of regions: sides, shared stretches, reaches along normals, and voids that touch."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from sbafab.geometry.contour import circle
from sbafab.geometry.edge_table import EdgeTable
from sbafab.geometry.edges import Arc, Edge, Line, Point
from sbafab.geometry.region import disc, polygon, rectangle, union
from sbafab.geometry.spatial_index import EdgeIndex
from sbafab.rules.boundary import beside, edges_along, outward_reach
from sbafab.rules.margins import Rays, first_met
from sbafab.rules.voids import _gap

AXIS = (0.0, 0.0)
UP = Line((1.0, 0.0), (1.0, 4.0))
RIGHT = Line((0.0, 1.0), (4.0, 1.0))
QUARTER = Arc((2.0, 0.0), (0.0, 2.0), AXIS, 2.0, True)
HALF = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("edge", "left"),
    [
        (UP, (0.5, 2.0)),
        (RIGHT, (2.0, 1.5)),
        (QUARTER, (1.5 * HALF, 1.5 * HALF)),
        (QUARTER.reversed(), (2.5 * HALF, 2.5 * HALF)),
    ],
)
def test_left_of_an_edges_middle(edge: Edge, left: Point) -> None:
    assert beside(edge, 0.5) == pytest.approx(left)
    middle = edge.at(0.5)
    mirrored = (2 * middle[0] - left[0], 2 * middle[1] - left[1])
    assert beside(edge, -0.5) == pytest.approx(mirrored)


def test_edges_that_run_the_same_way_are_shared() -> None:
    low, high = rectangle((0.0, 0.0), (4.0, 2.0)), rectangle((1.0, 0.0), (3.0, 1.0))
    [shared] = edges_along(low, high)
    assert sorted((shared.start, shared.end)) == [(1.0, 0.0), (3.0, 0.0)]
    # Side by side their common edge runs opposite ways.
    assert not edges_along(low, rectangle((4.0, 0.0), (6.0, 2.0)))


def test_an_arc_is_not_shared_with_its_chord() -> None:
    # Both go from one end of the diameter to the other.
    half = disc(AXIS, 2.0) & rectangle((-3.0, 0.0), (3.0, 3.0))
    shared = edges_along(half, disc(AXIS, 2.0))
    assert sum(edge.length for edge in shared) == pytest.approx(2 * math.pi)
    assert all(isinstance(edge, Arc) for edge in shared)


NORTH = Line((0.0, 0.0), (0.0, 4.0))
"""Its right-hand normal points along x."""
ALONG = Line((0.0, 0.0), (4.0, 0.0))
"""Its right-hand normal points down y."""
REACHES: list[tuple[Edge, Edge, float | None]] = [
    (NORTH, Line((1.5, -1.0), (1.5, 5.0)), 1.5),
    (NORTH, Line((1.0, -1.0), (3.0, 1.0)), 2.0 + 1e-5),
    (NORTH, Line((0.5, 4.0), (3.0, 4.0)), None),
    (NORTH, Line((0.3, 4.0), (0.3, 9.0)), None),
    (NORTH, Arc((3.0, 1.0), (3.0, 3.0), (3.0, 2.0), 1.0, False), 2.0),
    (NORTH, Line((-0.5, 1.0), (-0.5, 2.0)), None),
    (QUARTER, Line((5.0, 0.0), (0.0, 5.0)), 12.5**0.5 - 2),
    (QUARTER, circle(AXIS, 2.5).edges[0], 0.5),
    (QUARTER, circle(AXIS, 2.5).edges[2], None),
    (QUARTER, circle((4.0, 3.0), 1.0).edges[2], 2.0),
    (QUARTER.reversed(), circle(AXIS, 1.25).edges[0], 0.75),
    (QUARTER.reversed(), Line((-1.0, 0.5), (5.0, 0.5)), 1.5),
    (QUARTER.reversed(), circle((0.5, 0.5), 0.5).edges[0], 1.5 - 0.5**0.5),
    # Slanting away from a side of the band, or from its end: nearest on that side.
    (QUARTER, Line((3.0, -2.0), (5.0, 2.0)), 2.0),
    (QUARTER, Line((-2.0, 3.0), (2.0, 5.0)), 2.0),
    (ALONG, Line((-1.0, -1.0), (1.0, -3.0)), 2.0),
    (ALONG, Line((5.0, -1.0), (3.0, -3.0)), 2.0),
]


@pytest.mark.parametrize(("edge", "other", "expected"), REACHES)
def test_reach_along_the_normal(edge: Edge, other: Edge, expected: float | None) -> None:
    reach = outward_reach(edge, EdgeIndex([other]))
    if expected is None:
        assert reach is None
    else:
        assert reach is not None
        assert reach.value == pytest.approx(expected, abs=1.5e-5)


@pytest.mark.parametrize("far", [0.5, 3.0, 40.0])
def test_a_reach_is_found_however_far(far: float) -> None:
    others = [Line((1.0 + far, -9.0), (1.0 + far, 9.0)), Line((60.0, -9.0), (60.0, 9.0))]
    reach = outward_reach(UP, EdgeIndex(others))
    assert reach is not None
    assert reach.value == pytest.approx(far)
    assert reach.at[0] == pytest.approx(1.0 + far)


Sample = tuple[Point, Point, float, Point]


def samples(edge: Edge, others: Sequence[Edge], within: float) -> list[Sample]:
    """Start, outward normal, distance and end of each ray that meets another edge."""
    rays = Rays.of([edge])
    ray, value, end = first_met(rays, EdgeTable.of(others), within)
    columns = rays.start[:, ray], rays.outward[:, ray], value, end
    return list(zip(*(column.T.tolist() for column in columns), strict=True))


def test_samples_look_along_the_normal_to_the_first_edge() -> None:
    others = [Line((2.5, -9.0), (2.5, 9.0)), Line((4.0, -9.0), (4.0, 9.0))]
    found = samples(UP, others, 5.0)
    assert min(start[1] for start, *_ in found) == pytest.approx(0.0, abs=1e-4)
    assert max(start[1] for start, *_ in found) == pytest.approx(4.0, abs=1e-4)
    for start, outward, value, end in found:
        assert outward == pytest.approx((1.0, 0.0))
        assert value == pytest.approx(1.5)
        assert end == pytest.approx((2.5, start[1]))


def test_samples_on_an_arc_look_away_from_its_centre() -> None:
    found = samples(QUARTER, disc(AXIS, 2.75).edges, 1.0)
    assert len(found) > 1
    for start, outward, value, _ in found:
        assert outward == pytest.approx((start[0] / 2, start[1] / 2))
        assert value == pytest.approx(0.75)


def test_edges_behind_give_no_sample() -> None:
    assert samples(UP, [Line((0.0, -9.0), (0.0, 9.0))], 5.0) == []


def test_voids_that_touch_at_a_point_are_told_apart() -> None:
    """A pocket round a hole of radius 2. A square of film stands in the hole on its corners and
    leaves four voids; or two wedges of bond reach the hole's edge and leave two pockets.
    """
    hole, frame = disc((0, 0), 2), disc((0, 0), 9)
    ring, film = disc((0, 0), 3) - hole, disc((0, 0), 5) - hole
    square = polygon([(2, 0), (0, 2), (-2, 0), (0, -2)])
    gap = _gap(ring, film | square, frame, ())
    # Four segments of 4 (pi / 4 - 1 / 2) each, and what is round the film.
    segments = [number for number, void in enumerate(gap.missing) if void.area < 2]
    assert [gap.missing[n].area for n in segments] == [pytest.approx(math.pi - 2)] * 4
    assert sorted({(pocket, void) for pocket, void, _ in gap.touching}) == [
        (0, number) for number in segments
    ]
    wedges = union(polygon([(way * 2, 0), (way * 4, 1), (way * 4, -1)]) for way in (1, -1))
    gap = _gap(ring - wedges, film, frame, ())
    assert len(gap.unbonded) == 2
    joined = {(pocket, gap.missing[void].area) for pocket, void, _ in gap.touching}
    assert sorted(joined) == [(0, pytest.approx(4 * math.pi)), (1, pytest.approx(4 * math.pi))]
