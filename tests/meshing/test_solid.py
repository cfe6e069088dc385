"""The flat solid and the cavities of a stack put together by hand, against hand calculations."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sbafab.errors import OutputError
from sbafab.geometry.region import Region, disc, rectangle
from sbafab.laminate.laminate import Chamber, Laminate, Role
from sbafab.meshing.solid import (
    Slab,
    cavity,
    cavity_slabs,
    closed_surface,
    fuse,
    solid,
    solid_slabs,
)
from sbafab.meshing.surface import Surface, open_edges

Profiles = list[tuple[Role, Region]]
Stack = Callable[[Profiles], Laminate]
CUBE = [Slab(rectangle((0, 0), (2, 2)), 0.0, 2.0)]


def beyond(radius: float, width: float, reach: float) -> float:
    """Area of a strip of this width from a disc's edge out to ``reach`` from its centre."""
    half = width / 2
    under = half * math.sqrt(radius**2 - half**2) + radius**2 * math.asin(half / radius)
    return width * reach - under


def euler(surface: Surface) -> int:
    return len(surface.points) - len(surface.faces) // 2


def test_the_solid_is_one_closed_body_of_the_volume_calculated_by_hand(
    two_balloons: Laminate,
) -> None:
    plate, bore = math.pi * 3.25**2, math.pi * 0.5**2
    tab, inlet = beyond(3.25, 3.1, 8.25), beyond(2.5, 1.6, 8.25)
    films = 4 * plate + 2 * tab - 2 * bore
    chamber_bonds = 2 * plate + tab - 2 * math.pi * 2.5**2 - inlet
    neck_ring = math.pi * (1.25**2 - 0.5**2)
    expected = 0.038 * films + 0.025 * (chamber_bonds + neck_ring)
    assert sum(slab.volume for slab in solid_slabs(two_balloons)) == pytest.approx(expected)
    surface = solid(two_balloons)
    assert surface.volume == pytest.approx(expected, rel=2e-4)
    assert len(open_edges(surface)) == 0
    # A bottle: all its air is reached through one mouth.
    assert euler(surface) == 2
    heights = np.unique(surface.points[:, 2].round(6))
    layers = [0.038, 0.025, 0.038, 0.025, 0.038, 0.025, 0.038]
    assert heights == pytest.approx(np.concatenate([[0.0], np.cumsum(layers)]))


def test_it_is_what_manifold3d_makes_of_the_same_prisms(two_balloons: Laminate) -> None:
    from manifold3d import CrossSection, Manifold, OpType

    prisms = []
    for slab in solid_slabs(two_balloons):
        rings = [ring for piece in slab.region.polygons(0.0002) for ring in piece]
        prism = Manifold.extrude(CrossSection([np.array(r) for r in rings]), slab.top - slab.bottom)
        prisms.append(prism.translate((0.0, 0.0, slab.bottom)))
    union = Manifold.batch_boolean(prisms, OpType.Add)
    surface = solid(two_balloons, sagitta=0.0002)
    assert surface.volume == pytest.approx(union.volume(), rel=2e-4)
    corners = [surface.points.min(axis=0), surface.points.max(axis=0)]
    assert np.ravel(corners) == pytest.approx(union.bounding_box(), abs=0.001)


def test_faulty_surfaces_are_found_with_the_place() -> None:
    cube = fuse(CUBE, 0.002)
    torn = Surface(cube.points, cube.faces[:-1])
    lost = cube.points[cube.faces[-1]]
    middles = (lost + np.roll(lost, -1, axis=0)) / 2
    assert sorted(open_edges(torn).tolist()) == sorted(middles.tolist())
    flipped = np.concatenate([cube.faces[:1, ::-1], cube.faces[1:]])
    assert len(open_edges(Surface(cube.points, flipped))) > 0
    # Bodies that touch along an edge.
    touching = [Slab(rectangle((n, n), (n + 1, n + 1)), 0.0, 1.0) for n in (0, 1)]
    with pytest.raises(OutputError, match=r"x 1\.000, y 1\.000, z 0\.500"):
        closed_surface("the solid", touching, 0.002)
    twice = [Slab(disc((0, 0), 1.0), 0.0, 1.0)] * 2
    with pytest.raises(OutputError, match=r"the solid holds 3\.1416 mm3.* 6\.2832 mm3"):
        closed_surface("the solid", twice, 0.002)


def test_films_without_a_mask_between_them_touch(stack: Stack, profiles: Profiles) -> None:
    (_, base), (_, mask), *_, cap = profiles
    laminate = stack([("sheet", base), ("base", base), ("chamber-mask", mask), cap])
    surface = solid(laminate)
    assert len(open_edges(surface)) == 0
    flat = np.ptp(surface.points[surface.faces][:, :, 2], axis=1) == 0
    heights = surface.points[surface.faces[flat, 0], 2]
    assert np.unique(heights.round(6)).tolist() == [0.0, 0.076, 0.101, 0.139]


# Cavities.


def test_the_cavity_is_one_closed_body_of_the_volume_calculated_by_hand(
    two_balloons: Laminate,
) -> None:
    (chamber,) = two_balloons.chambers
    pockets = 0.025 * (2 * math.pi * 2.5**2 + beyond(2.5, 1.6, 8.25))
    expected = pockets + math.pi * 0.5**2 * (2 * 0.038 + 0.025)
    exact = sum(slab.volume for slab in cavity_slabs(two_balloons, chamber))
    assert exact == pytest.approx(expected, rel=1e-9)
    surface = cavity(two_balloons, chamber)
    # Normals point out of the air, or it would be below 0.
    assert surface.volume == pytest.approx(exact, rel=2e-4)
    assert len(open_edges(surface)) == 0
    assert euler(surface) == 2
    assert surface.points[:, 0].max() == pytest.approx(8.25, abs=1e-5)
    assert surface.points[:, 2].min() == pytest.approx(0.038)
    assert surface.points[:, 2].max() == pytest.approx(0.038 * 3 + 0.025 * 3)


def test_chambers_without_pocket_or_channel_are_named(
    two_balloons: Laminate, stack: Stack, profiles: Profiles
) -> None:
    profiles[4] = ("wall", profiles[6][1])
    laminate = stack(profiles)
    with pytest.raises(OutputError, match=r"chamber A is closed at layer 5, x 0\.000, y 0\.000"):
        cavity(laminate, laminate.chambers[0])
    astray = replace(two_balloons, chambers=(Chamber("B", ((20.0, 0.0),)),))
    with pytest.raises(OutputError, match=r"Chamber B has no pocket at x 20\.000, y 0\.000"):
        cavity(astray, astray.chambers[0])


def test_air_and_film_share_no_room(two_balloons: Laminate) -> None:
    films = solid_slabs(two_balloons)
    air = cavity_slabs(two_balloons, two_balloons.chambers[0])
    together = fuse([*films, *air], 0.002)
    volume = sum(slab.volume for slab in films + air)
    assert together.volume == pytest.approx(volume, rel=1e-4)
    # Where they meet they meet face to face, so nothing but the outside is left.
    assert len(open_edges(together)) == 0
    assert euler(together) == 2
