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
from sbafab.simulators.coarse.rounds import round_stack, why_not_round
from sbafab.simulators.coarse.shell import (
    CoarseMesh,
    Meridian,
    Triangle,
    area,
    coarse_mesh,
    fullest,
    holding,
    standing,
)

LOBED = "3dof-15mm"
DESIGNS = [
    (LOBED,),
    ("1dof-5mm",),
    ("1dof-10mm",),
    *[(LOBED, f"chamber.count={count}", "stack.balloons=3") for count in (2, 4, 5, 6, 7, 8)],
    (LOBED, "stack.balloons=1"),
    (LOBED, "stack.balloons=4", "registration.method=ears"),
    (LOBED, "stack.balloons=3", "chamber.diameter=[6, 5, 4]"),
    (LOBED, "stack.balloons=3", "chamber.axis_radius=9"),
    ("1dof-5mm", "stack.balloons=2", "films.tpe.thickness=0.05"),
]


@cache
def mesh_of(*design: str) -> CoarseMesh:
    return coarse_mesh(round_stack(sbafab.build(*design)))


def edges(triangles: tuple[Triangle, ...]) -> Counter[tuple[int, int]]:
    return Counter((t[i], t[i - 2]) for t in triangles for i in range(3))


def test_the_paper_s_actuator_has_the_size_that_was_run() -> None:
    mesh = mesh_of(LOBED)
    assert len(mesh.rest) == len(mesh.position) == 2304
    assert len(mesh.single) + len(mesh.double) == 4596


@pytest.mark.parametrize("design", DESIGNS, ids=" ".join)
def test_groups_are_manifold_and_use_every_node(design: tuple[str, ...]) -> None:
    mesh = mesh_of(*design)
    for group in (mesh.lower, mesh.upper, mesh.web, mesh.necks):
        directed = edges(group)
        assert all(count == 1 for count in directed.values())
    used = {node for triangle in mesh.single + mesh.double for node in triangle}
    assert used == set(range(len(mesh.rest)))


@pytest.mark.parametrize("design", DESIGNS, ids=" ".join)
def test_triangles_are_no_slivers_flat_or_inflated(design: tuple[str, ...]) -> None:
    mesh = mesh_of(*design)
    for points in (mesh.rest, mesh.position):
        assert min(area(points, triangle) for triangle in mesh.single + mesh.double) > 0.05
        for a, b, c in mesh.web + mesh.necks:
            (ax, ay, _), (bx, by, _), (cx, cy, _) = points[a], points[b], points[c]
            assert (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0.05


@pytest.mark.parametrize("design", DESIGNS, ids=" ".join)
def test_cavities_are_closed_and_look_outward(design: tuple[str, ...]) -> None:
    mesh = mesh_of(*design)
    laminate = sbafab.build(*design)
    assert [name for name, _ in mesh.cavities] == [c.name for c in laminate.chambers]
    stack = round_stack(laminate)
    meridians = [fullest(pocket, stack.neck) for pocket in stack.pockets]
    for name, triangles in mesh.cavities:
        directed = edges(triangles)
        assert all(n == 1 and directed[end, start] == 1 for (start, end), n in directed.items())
        surface = trimesh.Trimesh(mesh.position, triangles, process=False)
        assert surface.is_watertight
        assert surface.is_winding_consistent
        assert mesh.volume(name) == pytest.approx(surface.volume, rel=1e-9)
        expected = sum(
            eight_sided(meridian, pocket)
            for meridian, pocket in zip(meridians, stack.pockets, strict=True)
        )
        assert surface.volume == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("sectors", [12, 16, 24])
def test_finer_rings_hold_nearly_what_round_ones_do(sectors: int) -> None:
    stack = round_stack(sbafab.build(LOBED, "stack.balloons=2"))
    mesh = coarse_mesh(stack, sectors=sectors)
    for group in (mesh.lower, mesh.upper, mesh.web, mesh.necks):
        assert all(count == 1 for count in edges(group).values())
    eight = coarse_mesh(stack)
    # Areas of polygons of so many corners, against that of eight.
    ratio = sectors * math.sin(math.tau / sectors) / (8 * math.sin(math.tau / 8))
    for name, triangles in mesh.cavities:
        assert trimesh.Trimesh(mesh.position, triangles, process=False).is_watertight
        assert mesh.volume(name) / eight.volume(name) == pytest.approx(ratio, rel=0.02)


def eight_sided(meridian: Meridian, pocket: float) -> float:
    """Volume of a balloon of eight-sided frustums between points of its meridian."""
    steps = max(2, round(meridian.length / (pocket / 4)))
    points = [meridian.point(meridian.length * i / steps) for i in range(steps + 1)]
    sides = 4 * math.sin(math.tau / 8)
    return 2 * sum(
        sides * (h - i) / 3 * (r * r + r * s + s * s)
        for (r, h), (s, i) in zip(points, points[1:], strict=False)
    )


def test_ends_are_where_they_belong() -> None:
    mesh = mesh_of(LOBED)
    assert len(mesh.fixed) == 3 * 17
    assert {mesh.position[node][2] for node in mesh.fixed} == {0.0}
    axes = [chamber.centres[0] for chamber in sbafab.build(LOBED).chambers]
    for node, (x, y) in zip(mesh.tip, axes, strict=True):
        assert mesh.rest[node][:2] == pytest.approx((x, y), abs=1e-6)
        assert mesh.position[node][2] == mesh.height
        assert node in mesh.poles
    assert [mesh.rest[node][:2] for node in mesh.roots] == [mesh.rest[n][:2] for n in mesh.poles]
    assert all(z == 0 for _, _, z in mesh.rest)


@pytest.mark.parametrize("design", [("1dof-5mm",), (LOBED, "chamber.count=2"), (LOBED,)])
def test_the_tip_s_mean_is_on_the_axis_and_level(design: tuple[str, ...]) -> None:
    mesh = mesh_of(*design)
    points = np.array([mesh.position[node] for node in mesh.tip])
    assert points.mean(axis=0)[:2] == pytest.approx([0, 0], abs=1e-6)
    assert np.cross(points[1] - points[0], points[2] - points[1])[2] > 0.5


def test_the_parabola_without_a_neck_is_the_paper_s() -> None:
    """At l = 2.5 no parabola pair holds more than 16.95 ul: h = 1.33, rho = 2.01."""
    most = max((Meridian(0.0, 2.5, slope / 100) for slope in range(1, 500)), key=lambda m: m.volume)
    assert most.volume == pytest.approx(16.95, abs=0.005)
    assert most.height == pytest.approx(1.33, abs=0.005)
    assert most.edge == pytest.approx(2.01, abs=0.005)


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


def test_starts_hold_what_they_promise() -> None:
    assert fullest(2.5, 1.25).volume == pytest.approx(16.95, abs=0.005)
    assert fullest(5.0, 1.25).volume == pytest.approx(8 * 16.95, abs=0.05)
    assert 2 * standing(0.48)(2.5, 1.25).height == pytest.approx(0.48)
    assert holding(1.25, 1.25, 1e9).volume < 19.04


def test_the_true_mass_is_that_of_the_films() -> None:
    """Of one balloon: two films of the plate's area; chords lose a few per cent of it."""
    design = ("1dof-5mm", "stack.balloons=1")
    plate = math.pi * 3.25**2 * 0.038 * 1122e-9
    chords = 4 * math.sin(math.tau / 8) / math.pi
    assert mesh_of(*design).mass(0.038, 1122) == pytest.approx(2 * plate * chords, rel=1e-6)


def test_unsuited_designs_are_refused_with_the_reason(tmp_path: Path) -> None:
    drawn = tmp_path / "square.svg"
    drawn.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="6mm" height="6mm" viewBox="-3 -3 6 6">'
        '<path d="M -2.5 -2.5 L 2.5 -2.5 L 2.5 2.5 L -2.5 2.5 Z"/></svg>'
    )
    square = sbafab.build("1dof-5mm", "stack.balloons=2", f"chamber.outline={drawn}")
    with pytest.raises(DesignError, match=r"x 0\.000, y 0\.000 is drawn otherwise"):
        round_stack(square)
    assert "lie on a sheet" in (why_not_round(sbafab.build("radial-15mm")) or "")
    assert why_not_round(sbafab.build("1dof-5mm")) is None


@pytest.mark.parametrize("sectors", [8, 12, 16])
@pytest.mark.parametrize("count", [2, 3, 4])
def test_a_mirrored_mesh_is_the_same_and_begins_its_triangles_alike(
    count: int, sectors: int
) -> None:
    """Corotational elements take their axes from a triangle's first edge: where mirrored triangles
    begin with others, a chamber on the axis of x bends the actuator out of its plane.
    """
    design = (LOBED, f"chamber.count={count}", "stack.balloons=2")
    mesh = coarse_mesh(round_stack(sbafab.build(*design)), sectors=sectors)
    nodes = {
        (round(x, 4), round(y, 4) + 0.0, round(z, 4)): i
        for i, (x, y, z) in enumerate(mesh.position)
    }
    mirror = [nodes[round(x, 4), round(-y, 4) + 0.0, round(z, 4)] for x, y, z in mesh.position]
    for group in (mesh.lower, mesh.upper, mesh.web, mesh.necks):
        begun = {(frozenset((a, b)), c) for a, b, c in group}
        mirrored = {(frozenset((mirror[a], mirror[b])), mirror[c]) for a, b, c in group}
        assert begun == mirrored
