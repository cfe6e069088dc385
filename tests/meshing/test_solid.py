from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from sbafab.errors import OutputError
from sbafab.geometry.region import Region, disc, rectangle
from sbafab.laminate.laminate import Laminate, Role
from sbafab.meshing.solid import Slab, closed_surface, fuse, solid, solid_slabs
from sbafab.meshing.surface import Surface, open_edges

Profiles = list[tuple[Role, Region]]
Stack = Callable[[Profiles], Laminate]


def beyond(radius: float, width: float, reach: float) -> float:
    """Area of a strip of this width from a disc's edge out to ``reach`` from its centre."""
    half = width / 2
    under = half * math.sqrt(radius**2 - half**2) + radius**2 * math.asin(half / radius)
    return width * reach - under


def euler(surface: Surface) -> int:
    edges = len(surface.faces) * 3 // 2
    return len(surface.points) - edges + len(surface.faces)


def test_volume_is_the_hand_calculation(two_balloons: Laminate) -> None:
    plate, bore = math.pi * 3.25**2, math.pi * 0.5**2
    tab, inlet = beyond(3.25, 3.1, 8.25), beyond(2.5, 1.6, 8.25)
    films = 4 * plate + 2 * tab - 2 * bore
    chamber_bonds = 2 * plate + tab - 2 * math.pi * 2.5**2 - inlet
    neck_ring = math.pi * (1.25**2 - 0.5**2)
    expected = 0.038 * films + 0.025 * (chamber_bonds + neck_ring)
    assert sum(slab.volume for slab in solid_slabs(two_balloons)) == pytest.approx(expected)
    assert solid(two_balloons).volume == pytest.approx(expected, rel=2e-4)


def test_the_surface_is_one_closed_body(two_balloons: Laminate) -> None:
    from manifold3d import Error, Manifold, Mesh64

    surface = solid(two_balloons)
    body = Manifold(Mesh64(surface.points, surface.faces.astype(np.uint64)))
    assert len(open_edges(surface)) == 0
    assert body.status() == Error.NoError
    assert len(body.decompose()) == 1
    assert body.volume() == pytest.approx(surface.volume, rel=1e-9)
    # A bottle: all its air is reached through one mouth.
    assert euler(surface) == 2


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


def test_pocket_and_bore_are_real_voids(two_balloons: Laminate) -> None:
    surface = solid(two_balloons)
    heights = np.unique(surface.points[:, 2].round(6))
    films = [0.038, 0.025, 0.038, 0.025, 0.038, 0.025, 0.038]
    assert heights == pytest.approx(np.concatenate([[0.0], np.cumsum(films)]))
    radii = np.hypot(surface.points[:, 0], surface.points[:, 1])
    assert np.isclose(radii, 0.5, atol=0.002).sum() > 40


def test_slabs_that_overlap_count_once() -> None:
    low = Slab(rectangle((0, 0), (2, 2)), 0.0, 2.0)
    high = Slab(rectangle((1, 1), (3, 3)), 1.0, 3.0)
    surface = fuse([low, high], 0.002)
    assert surface.volume == pytest.approx(8 + 8 - 1)
    assert len(open_edges(surface)) == 0
    assert euler(surface) == 2


def test_a_missing_triangle_is_found_with_its_place() -> None:
    cube = fuse([Slab(rectangle((0, 0), (2, 2)), 0.0, 2.0)], 0.002)
    torn = Surface(cube.points, cube.faces[:-1])
    lost = cube.points[cube.faces[-1]]
    middles = (lost + np.roll(lost, -1, axis=0)) / 2
    assert sorted(open_edges(torn).tolist()) == sorted(middles.tolist())


def test_a_flipped_triangle_is_found() -> None:
    cube = fuse([Slab(rectangle((0, 0), (2, 2)), 0.0, 2.0)], 0.002)
    faces = cube.faces.copy()
    faces[0] = faces[0][::-1]
    assert len(open_edges(Surface(cube.points, faces))) > 0


def test_bodies_that_touch_along_an_edge_are_refused() -> None:
    slabs = [
        Slab(rectangle((0, 0), (1, 1)), 0.0, 1.0),
        Slab(rectangle((1, 1), (2, 2)), 0.0, 1.0),
    ]
    with pytest.raises(OutputError, match=r"x 1\.000, y 1\.000, z 0\.500"):
        closed_surface("the solid", slabs, 0.002)


def test_a_volume_that_does_not_add_up_is_refused() -> None:
    twice = [Slab(disc((0, 0), 1.0), 0.0, 1.0)] * 2
    with pytest.raises(OutputError, match=r"the solid holds 3\.1416 mm3 .* 6\.2832 mm3"):
        closed_surface("the solid", twice, 0.002)


def test_films_without_a_mask_between_them_touch(stack: Stack, profiles: Profiles) -> None:
    (_, base), (_, mask), *_, cap = profiles
    laminate = stack([("sheet", base), ("base", base), ("chamber-mask", mask), cap])
    surface = solid(laminate)
    assert len(open_edges(surface)) == 0
    flat = np.ptp(surface.points[surface.faces][:, :, 2], axis=1) == 0
    heights = surface.points[surface.faces[flat, 0], 2]
    assert np.unique(heights.round(6)).tolist() == [0.0, 0.076, 0.101, 0.139]
