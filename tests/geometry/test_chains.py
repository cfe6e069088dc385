"""Chains that stay clear of each other against the arrangement of all of them."""

from __future__ import annotations

import math
import random

import pytest

from sbafab.geometry.boolean import FAR, alone, chains_of, grouped
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import Edge
from sbafab.geometry.offset import grow, shrink
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium, union, wound


def laid_over(above: int, *regions: Region) -> Region:
    """What the edges of all regions wind round more often, each cut where it meets another."""
    return wound([edge for region in regions for edge in region.edges], above)


def back(region: Region) -> Region:
    return Region(tuple(contour.reversed() for contour in region.contours))


def some(draw: random.Random) -> Region:
    """A shape on a coarse grid, so that many are twins, lie in each other or meet."""
    centre = (3.0 * draw.randint(0, 2), 3.0 * draw.randint(0, 1))
    size = draw.choice([0.5, 1.0, 1.4, 1.8, 4.0])
    kind = draw.choice(["disc", "disc", "ring", "stadium", "turned"])
    if kind == "ring":
        inner = circle(centre, size / 2).reversed()
        return Region((circle(centre, size), inner))
    if kind == "stadium":
        return stadium(centre, 2 * size, 3 * size)
    return disc(centre, size).turned(33 if kind == "turned" else 0)


@pytest.mark.parametrize("seed", range(3))
def test_the_same_as_laying_all_over_each_other(seed: int) -> None:
    draw = random.Random(seed)
    met = clear = 0
    for _ in range(30):
        shapes = [some(draw) for _ in range(draw.randint(2, 4))]
        a, b = shapes[0], union(shapes[1:])
        groups = grouped(chains_of((c, 1) for region in (a, b) for c in region.contours))
        clear += sum(group.is_alone for group in groups)
        met += sum(not group.is_alone for group in groups)
        for result, whole in (
            (union(shapes), laid_over(0, *shapes)),
            (a & b, laid_over(1, a, b)),
            (a - b, laid_over(0, a, back(b))),
        ):
            assert result == whole
            assert result.area == pytest.approx(whole.area, abs=1e-9)
            assert [c.is_hole for c in result.contours] == [c.is_hole for c in whole.contours]
    assert met > 5
    assert clear > 40


def test_a_group_may_lie_in_the_hole_of_a_chain_that_meets_none() -> None:
    ring = Region((circle((0, 0), 9), circle((0, 0), 8).reversed()))
    crossing = [disc((0, 0), 2), disc((1, 0), 2)]
    lens = 2 * (4 * math.acos(1 / 4) - math.sqrt(15) / 4)
    whole = union([ring, *crossing])
    assert whole.area == pytest.approx(math.pi * 17 + 8 * math.pi - lens)
    assert (disc((0, 0), 9) & union(crossing)).area == pytest.approx(8 * math.pi - lens)
    assert (disc((0, 0), 9) - union(crossing)).area == pytest.approx(
        81 * math.pi - 8 * math.pi + lens
    )


def test_a_chain_between_two_of_a_group_has_all_laid_over_each_other() -> None:
    # Long boxes that meet, one of them round a disc that meets neither.
    frame = Region((*rectangle((0, 0), (9, 9)).contours, *back(rectangle((1, 1), (8, 8))).contours))
    crossing, within = rectangle((8.5, 4), (12, 5)), disc((4, 4), 1)
    assert union([frame, crossing, within]).area == pytest.approx(32 + 3 + math.pi)


def test_circles_the_other_way_round_cancel_each_other() -> None:
    holed = Region((circle((0, 0), 3), circle((1, 0), 1).reversed()))
    assert (holed | disc((1, 0), 1)).contours == disc((0, 0), 3).contours
    assert (disc((0, 0), 3) - disc((0, 0), 3)).is_empty


@pytest.mark.parametrize("gap", [FAR / 2, 2 * FAR])
def test_what_comes_near_is_laid_over(gap: float) -> None:
    pair = circle((0, 0), 1), circle((2 + gap, 0), 1)
    groups = grouped(chains_of((a, 1) for a in pair))
    assert len(groups) == (1 if gap < FAR else 2)
    assert union([Region((a,)) for a in pair]).area == pytest.approx(2 * math.pi)


def closed(*points: tuple[float, float]) -> Contour:
    return polygon(points).contours[0]


@pytest.mark.parametrize(
    "contour",
    [
        closed((0, 0), (4, 0), (0, 2), (4, 3)),
        closed((0, 0), (4, 0), (4, 2), (2, FAR / 2), (0, 2)),
        closed((0, 0), (4, 0), (4, FAR / 2), (0, 2)),
        closed((0, 0), (4, 0), (4, 4), (2, 4), (2, 2), (2 + FAR / 4, 4), (0, 4)),
    ],
    ids=["crosses itself", "comes near", "short edge", "spike"],
)
def test_what_comes_near_to_itself_is_not_alone(contour: Contour) -> None:
    assert alone(contour) is None


def test_a_circle_that_is_run_through_twice_is_not_alone() -> None:
    edges: tuple[Edge, ...] = circle((0, 0), 2).edges
    assert alone(Contour(edges)) is not None
    assert alone(Contour((*edges, *edges))) is None


@pytest.mark.parametrize("distance", [0.3, 1.2])
def test_offsets_of_rings(distance: float) -> None:
    ring = Region((circle((0, 0), 5), circle((0, 0), 1).reversed()))
    hole = max(0.0, 1 - distance)
    assert grow(ring, distance).area == pytest.approx(math.pi * ((5 + distance) ** 2 - hole**2))
    left = math.pi * ((5 - distance) ** 2 - (1 + distance) ** 2)
    assert shrink(ring, distance).area == pytest.approx(left)
    assert shrink(ring, 2.1).is_empty
