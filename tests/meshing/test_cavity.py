from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sbafab.errors import OutputError
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Chamber, Laminate, Role
from sbafab.meshing.solid import cavity, cavity_slabs, fuse, solid_slabs
from sbafab.meshing.surface import open_edges

Profiles = list[tuple[Role, Region]]
Stack = Callable[[Profiles], Laminate]


def expected_volume() -> float:
    half, pocket = 0.8, 2.5
    under = half * math.sqrt(pocket**2 - half**2) + pocket**2 * math.asin(half / pocket)
    inlet = 1.6 * 8.25 - under
    pockets = 0.025 * (2 * math.pi * pocket**2 + inlet)
    channel = math.pi * 0.5**2 * (2 * 0.038 + 0.025)
    return pockets + channel


def test_volume_is_the_hand_calculation(two_balloons: Laminate) -> None:
    (chamber,) = two_balloons.chambers
    exact = sum(slab.volume for slab in cavity_slabs(two_balloons, chamber))
    assert exact == pytest.approx(expected_volume(), rel=1e-9)
    assert cavity(two_balloons, chamber).volume == pytest.approx(exact, rel=2e-4)


def test_it_is_one_closed_body_without_handles(two_balloons: Laminate) -> None:
    surface = cavity(two_balloons, two_balloons.chambers[0])
    assert len(open_edges(surface)) == 0
    assert len(surface.points) - len(surface.faces) // 2 == 2


def test_it_ends_at_the_inlets_mouth_and_the_pocket_faces(two_balloons: Laminate) -> None:
    points = cavity(two_balloons, two_balloons.chambers[0]).points
    assert points[:, 0].max() == pytest.approx(8.25, abs=1e-5)
    assert points[:, 2].min() == pytest.approx(0.038)
    assert points[:, 2].max() == pytest.approx(0.038 * 3 + 0.025 * 3)


def test_air_and_film_share_no_room(two_balloons: Laminate) -> None:
    films = solid_slabs(two_balloons)
    air = cavity_slabs(two_balloons, two_balloons.chambers[0])
    together = fuse([*films, *air], 0.002)
    volume = sum(slab.volume for slab in films + air)
    assert together.volume == pytest.approx(volume, rel=1e-4)
    # Where they meet they meet face to face, so nothing but the outside is left.
    assert len(open_edges(together)) == 0
    assert len(together.points) - len(together.faces) // 2 == 2


def test_a_wall_without_a_bore_is_named(stack: Stack, profiles: Profiles) -> None:
    profiles[4] = ("wall", profiles[6][1])
    laminate = stack(profiles)
    with pytest.raises(OutputError, match=r"chamber A is closed at layer 5, x 0\.000, y 0\.000"):
        cavity(laminate, laminate.chambers[0])


def test_a_chamber_without_a_pocket_is_named(two_balloons: Laminate) -> None:
    astray = replace(two_balloons, chambers=(Chamber("B", ((20.0, 0.0),)),))
    with pytest.raises(OutputError, match=r"Chamber B has no pocket at x 20\.000, y 0\.000"):
        cavity(astray, astray.chambers[0])


def test_normals_point_out_of_the_air(two_balloons: Laminate) -> None:
    surface = cavity(two_balloons, two_balloons.chambers[0])
    a, b, c = (surface.points[surface.faces[:, corner]] for corner in range(3))
    lowest = np.all(np.isclose(np.stack([a, b, c])[:, :, 2], 0.038), axis=0)
    assert np.all(np.cross(b - a, c - a)[lowest, 2] < 0)
