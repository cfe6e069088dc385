"""The coarse shell that several simulators take."""

from __future__ import annotations

import math
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh

import sbafab
from sbafab.errors import DesignError
from sbafab.simulators.shell_model import (
    Meridian,
    Shell,
    Triangles,
    areas,
    coarse_shell,
    fullest,
    holding,
    nearly_flat,
    round_stack,
    why_not_round,
)

LOBED = "3dof-15mm"
DESIGNS = [
    (LOBED,),
    ("1dof-5mm",),
    *[(LOBED, f"chamber.count={count}", "stack.balloons=3") for count in (2, 4, 5, 8)],
    (LOBED, "stack.balloons=1"),
    (LOBED, "stack.balloons=4", "registration.method=ears"),
    (LOBED, "stack.balloons=3", "chamber.diameter=[6, 5, 4]"),
    (LOBED, "stack.balloons=3", "chamber.axis_radius=9"),
]


@cache
def mesh_of(*design: str) -> Shell:
    return coarse_shell(round_stack(sbafab.build(*design)))


def edges(triangles: Triangles) -> Counter[tuple[int, int]]:
    return Counter((t[i], t[i - 2]) for t in triangles.tolist() for i in range(3))


def test_the_paper_s_actuator_has_the_size_that_was_run() -> None:
    mesh = mesh_of(LOBED)
    assert mesh.rest.shape == mesh.position.shape == (2304, 3)
    assert len(mesh.triangles) == 4596
    assert len(mesh.fixed) == 3 * 17
    assert not mesh.position[mesh.fixed, 2].any()
    assert not mesh.rest[:, 2].any()
    axes = [chamber.centres[0] for chamber in sbafab.build(LOBED).chambers]
    for ends in (mesh.tip, mesh.poles, mesh.roots):
        assert mesh.rest[ends, :2] == pytest.approx(np.array(axes), abs=1e-6)
    assert (mesh.position[mesh.tip, 2] == mesh.height).all()


@pytest.mark.parametrize("design", DESIGNS, ids=" ".join)
def test_groups_are_manifold_without_slivers_and_cavities_are_closed(
    design: tuple[str, ...],
) -> None:
    mesh, laminate = mesh_of(*design), sbafab.build(*design)
    triangles = mesh.triangles
    for group in mesh.bending:
        assert set(edges(group.triangles).values()) == {1}
    assert set(triangles.ravel().tolist()) == set(range(len(mesh.rest)))
    for points in (mesh.rest, mesh.position):
        assert areas(points, triangles).min() > 0.05
        a, b, c = points[mesh.membranes[1].triangles].transpose(1, 0, 2)
        assert np.cross(b - a, c - a)[:, 2].min() > 0.05
    tip = mesh.position[mesh.tip]
    assert np.cross(tip[1] - tip[0], tip[2] - tip[1])[2] > 0.5
    assert list(mesh.cavities) == [chamber.name for chamber in laminate.chambers]
    stack = round_stack(laminate)
    expected = sum(eight_sided(fullest(pocket, stack.neck), pocket) for pocket in stack.pockets)
    for name, walls in mesh.cavities.items():
        surface = trimesh.Trimesh(mesh.position, walls, process=False)
        assert surface.is_watertight
        assert surface.is_winding_consistent
        assert mesh.volume(name) == pytest.approx(surface.volume, rel=1e-9)
        assert surface.volume == pytest.approx(expected, rel=0.02)


def eight_sided(meridian: Meridian, pocket: float) -> float:
    """Volume of a balloon of eight-sided frustums between points of its meridian."""
    steps = max(2, round(meridian.length / (pocket / 4)))
    points = [meridian.point(meridian.length * i / steps) for i in range(steps + 1)]
    sides = 4 * math.sin(math.tau / 8)
    return 2 * sum(
        sides * (h - i) / 3 * (r * r + r * s + s * s)
        for (r, h), (s, i) in zip(points, points[1:], strict=False)
    )


@pytest.mark.parametrize("sectors", [12, 16])
@pytest.mark.parametrize("count", [2, 3, 4])
def test_a_mirrored_mesh_is_the_same_and_begins_its_triangles_alike(
    count: int, sectors: int
) -> None:
    """Corotational elements take their axes from a triangle's first edge: where mirrored triangles
    begin with others, a chamber on the axis of x bends the actuator out of its plane.
    """
    design = (LOBED, f"chamber.count={count}", "stack.balloons=2")
    mesh = coarse_shell(round_stack(sbafab.build(*design)), sectors=sectors)
    places = (mesh.position.round(4) + 0.0).tolist()
    nodes = {(x, y, z): i for i, (x, y, z) in enumerate(places)}
    mirror = [nodes[x, -y + 0.0, z] for x, y, z in places]
    for group in mesh.bending:
        rows = group.triangles.tolist()
        begun = {(frozenset((a, b)), c) for a, b, c in rows}
        mirrored = {(frozenset((mirror[a], mirror[b])), mirror[c]) for a, b, c in rows}
        assert begun == mirrored


def test_fair_rings_have_the_area_of_circles() -> None:
    stack = round_stack(sbafab.build("1dof-5mm", "stack.balloons=1"))
    for sectors in (8, 12):
        mesh = coarse_shell(stack, sectors, is_fair=True)
        assert areas(mesh.rest, mesh.bending[0].triangles).sum() == pytest.approx(
            math.pi * 2.5**2, rel=1e-6
        )


def test_the_parabola_without_a_neck_is_the_paper_s() -> None:
    """At l = 2.5 no parabola pair holds more than 16.95 ul: h = 1.33, rho = 2.01."""
    most = max((Meridian(0.0, 2.5, slope / 100) for slope in range(1, 500)), key=lambda m: m.volume)
    assert most.volume == pytest.approx(16.95, abs=0.005)
    assert most.height == pytest.approx(1.33, abs=0.005)
    assert most.edge == pytest.approx(2.01, abs=0.005)
    assert fullest(2.5, 1.25).volume == pytest.approx(16.95, abs=0.005)
    assert fullest(5.0, 1.25).volume == pytest.approx(8 * 16.95, abs=0.05)
    assert 2 * nearly_flat(2.5, 1.25).height == pytest.approx(0.15)
    assert holding(1.25, 1.25, 1e9).volume < 19.04


@pytest.mark.parametrize(("neck", "length", "slope"), [(1.25, 1.25, 1.65), (0.5, 3.0, 4.0)])
def test_the_meridian_keeps_its_length_and_volume(neck: float, length: float, slope: float) -> None:
    meridian = Meridian(neck, length, slope)
    x = np.linspace(neck, meridian.edge, 20001)
    y = meridian.height * (1 - ((x - neck) / meridian.run) ** 2)
    assert np.hypot(np.diff(x), np.diff(y)).sum() == pytest.approx(length, rel=1e-6)
    ring = np.diff(x) * math.tau * (x[1:] + x[:-1]) / 2 * (y[1:] + y[:-1]) / 2
    both = 2 * (ring.sum() + math.pi * neck**2 * meridian.height)
    assert meridian.volume == pytest.approx(both, rel=1e-6)
    place = int(np.searchsorted(np.cumsum(np.hypot(np.diff(x), np.diff(y))), 0.4 * length))
    assert meridian.point(0.4 * length) == pytest.approx((x[place], y[place]), abs=1e-3)


def test_mass_and_stiffness_are_those_of_the_film() -> None:
    """Of one balloon: two films of the plate's area; chords lose a few per cent of it."""
    one = mesh_of("1dof-5mm", "stack.balloons=1")
    plate = math.pi * 3.25**2 * 0.038 * 1122e-9
    assert one.mass == pytest.approx(2 * plate * 4 * math.sin(math.tau / 8) / math.pi, rel=1e-6)
    thick = mesh_of("1dof-5mm", "films.tpe.thickness=0.05")
    assert [group.stiffness for group in thick.membranes] == pytest.approx([500, 1000])
    bending = {group.name: group.stiffness for group in thick.bending}
    single = 10_000 * 0.05**3 / 12 / 0.96
    assert bending["bend_lower"] == pytest.approx(single)
    assert bending["bend_web"] == pytest.approx(8 * single)


def test_unsuited_designs_are_refused_with_the_reason(square: Path) -> None:
    drawn = sbafab.build("1dof-5mm", "stack.balloons=2", f"chamber.outline={square}")
    with pytest.raises(DesignError, match=r"x 0\.000, y 0\.000 is drawn otherwise"):
        round_stack(drawn)
    assert "lie on a sheet" in (why_not_round(sbafab.build("radial-15mm")) or "")
    assert why_not_round(sbafab.build("1dof-5mm")) is None
