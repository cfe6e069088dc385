"""The triangulation has every edge of every region in it, arcs as arcs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sbafab.geometry.offset import fillet
from sbafab.geometry.region import disc, stadium, strip
from sbafab.meshing.conforming.mesh import scaled_jacobians
from sbafab.meshing.conforming.plane import Plane, triangulation

AXIS = (0.0, 0.0)
PLATE, POCKET, BORE = disc(AXIS, 3.25), disc(AXIS, 2.5), disc(AXIS, 0.5)
TABBED = fillet(PLATE | strip(AXIS, (8.25, 0.0), 3.1), 1.0)
REGIONS = [TABBED, PLATE, POCKET, PLATE - BORE, PLATE - POCKET]


@pytest.fixture(scope="module")
def plane() -> Plane:
    return triangulation(REGIONS, 0.4)


def border(plane: Plane, row: int) -> np.ndarray:
    """Edges (k, 3) of a region: ends and middle."""
    triangles = plane.triangles[plane.inside[row]]
    edges = np.concatenate(
        [triangles[:, [0, 1, 3]], triangles[:, [1, 2, 4]], triangles[:, [2, 0, 5]]]
    )
    _, first, times = np.unique(edges[:, 2], return_index=True, return_counts=True)
    return edges[first[times == 1]]


def test_corners_and_middles_of_a_pocket_lie_on_its_circle(plane: Plane) -> None:
    nodes = np.unique(border(plane, 2))
    assert np.hypot(*plane.points[nodes].T) == pytest.approx(2.5, abs=1e-9)
    # A polygon through the same corners would have its middles inside.
    assert len(border(plane, 2)) < 2 * math.pi * 2.5 / 0.25


def test_regions_keep_their_area_without_slivers(plane: Plane) -> None:
    for region, inside in zip(REGIONS, plane.inside, strict=True):
        assert plane.areas()[inside].sum() == pytest.approx(region.area, rel=6e-4)
    # Not even where a fillet runs into the plate.
    assert scaled_jacobians("triangle6", plane.points, plane.triangles).min() > 0.1


def test_no_edge_crosses_a_ring_from_side_to_side(plane: Plane) -> None:
    on_border = np.unique(border(plane, 4)[:, :2])
    sides = set(border(plane, 4)[:, 2].tolist())
    for triangle in plane.triangles[plane.inside[4]].tolist():
        for a, b, middle in ((0, 1, 3), (1, 2, 4), (2, 0, 5)):
            ends = np.isin([triangle[a], triangle[b]], on_border)
            assert not ends.all() or triangle[middle] in sides


def test_triangles_shrink_in_a_narrow_slot_and_bend_with_a_small_hole() -> None:
    slot, hole = stadium((0.0, 0.0), 0.4, 6.0), disc((3.0, 0.0), 0.3)
    plate = disc(AXIS, 5.0)
    plane = triangulation([plate - slot - hole, slot], 0.8)
    inner = plane.triangles[plane.inside[1]]
    assert np.median(plane.areas()[plane.inside[1]]) < 0.8**2 / 8
    assert len(inner) > 20
    area = plane.areas()[plane.inside[0]].sum()
    assert area == pytest.approx((plate - slot - hole).area, rel=3e-4)
