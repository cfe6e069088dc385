"""Radial actuators round their tube, judged by trimesh and closed formulas."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.optimize import minimize_scalar

from sbafab.api import build, predict
from sbafab.errors import DesignError, OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.layup import MeshSettings, flat, formed, layup
from sbafab.meshing.conforming.meshes import conforming_meshes, write_conforming
from sbafab.meshing.formats import write_meshes


@pytest.fixture(scope="module")
def radial() -> Laminate:
    return build("radial-15mm")


def test_the_solid_lies_round_its_tube(radial: Laminate, tmp_path: Path) -> None:
    written = {mesh.file: mesh for mesh in write_meshes(radial, tmp_path)[0]}
    solid = trimesh.load(tmp_path / "mesh/solid_wrapped.stl")
    assert isinstance(solid, trimesh.Trimesh)
    assert solid.is_watertight
    radii = np.hypot(*solid.vertices[:, :2].T)
    # Paper, Sec. 2.1: 15 for the tube, 15.33 for the deflated actuator.
    assert 2 * radii.max() == pytest.approx(15.33, abs=0.01)
    assert 2 * radii.min() == pytest.approx(15.0, abs=1e-4)
    assert solid.volume == pytest.approx(written["mesh/solid.stl"].volume_mm3, rel=0.01)
    angles = np.sort(np.arctan2(solid.vertices[:, 1], solid.vertices[:, 0]))
    assert np.diff(angles).max() < math.radians(6)
    cavity = trimesh.load(tmp_path / "mesh/cavity_chamber2_wrapped.stl")
    assert isinstance(cavity, trimesh.Trimesh)
    assert cavity.is_watertight
    assert solid.bounds[0, 2] < cavity.centroid[2] < solid.bounds[1, 2]
    assert np.hypot(*cavity.centroid[:2]) < 7.664


def test_an_overlapping_sheet_lies_on_itself(tmp_path: Path) -> None:
    write_meshes(build("radial-15mm", "sheet.overlap=4"), tmp_path)
    solid = trimesh.load(tmp_path / "mesh/solid_wrapped.stl")
    assert isinstance(solid, trimesh.Trimesh)
    assert solid.is_watertight
    # A cut along the axis beside the ends that lie on each other, away from the balloons.
    cut = solid.section(plane_normal=[0.1, -1.0, 0.0], plane_origin=[0.0, 0.0, 0.0])
    radii = np.sort(np.hypot(*cut.vertices[:, :2].T)[cut.vertices[:, 0] < 0])
    assert radii[0] == pytest.approx(7.5, abs=0.01)
    assert 7.576 < radii[-1] < 7.6
    # Nothing lies in the gap between the two: faces at 7.538 and at 7.554, less their chords.
    assert not ((radii > 7.541) & (radii < 7.545)).any()


@pytest.mark.parametrize("fill", [None, pytest.param(20.0, marks=pytest.mark.long)])
def test_meshes_stand_round_the_tube(radial: Laminate, fill: float | None, tmp_path: Path) -> None:
    meshes = conforming_meshes(radial, MeshSettings(h=0.75, fill_ul=fill))
    for mesh, least in ((meshes.volume, 7.5), (meshes.shell, 7.5)):
        radii = np.hypot(*mesh.points[:, :2].T)
        assert radii.min() == pytest.approx(least, abs=1e-6)
        sheet = mesh.points[np.unique(mesh.cells[mesh.cell_sets["film_001_TPE_sheet"]])]
        assert np.hypot(*sheet[:, :2].T).max() < 7.5 + 0.0381
        films = mesh.points[np.unique(mesh.cells[mesh.cell_sets["film_003_TPE_base"]])]
        assert np.hypot(*films[:, :2].T).min() > 7.5 - 1e-6
        angles = np.degrees(np.arctan2(films[:, 1], films[:, 0]))
        assert np.ptp(angles) > 240
    files = write_conforming(meshes, tmp_path, formats=("stl",))
    if fill is None:
        # Films that lie on each other enclose nothing.
        assert files == []
        return
    for chamber in radial.chambers:
        held = trimesh.load(tmp_path / f"mesh/cavity_{chamber.name}_conforming.stl")
        assert isinstance(held, trimesh.Trimesh)
        assert held.volume == pytest.approx(fill, rel=0.02)
    outer = trimesh.load(tmp_path / "mesh/skin.stl")
    assert isinstance(outer, trimesh.Trimesh)
    assert outer.is_watertight
    assert outer.volume == pytest.approx(meshes.statistics["volume"]["volume_mm3"], rel=0.01)


def test_an_oblong_balloon_holds_as_much_as_predict_says(radial: Laminate) -> None:
    # Films 10 wide keep their length as two arcs: a prism 8.5 long and two spherical caps.
    def held(b: float) -> float:
        r = 10 / (2 * b)
        rise = r * (1 - math.cos(b))
        caps = 2 * math.pi * rise**2 * (3 * r - rise) / 3
        return r * r * (2 * b - math.sin(2 * b)) * 8.5 + caps

    best = minimize_scalar(lambda b: -held(b), bounds=(0.5, math.pi / 2), method="bounded")
    most = -float(best.fun)
    assert most == pytest.approx(410, abs=1)
    with pytest.raises(DesignError, match=rf"use at most {math.floor(most * 100) / 100:.2f} ul"):
        conforming_meshes(radial, MeshSettings(h=0.75, fill_ul=most + 0.1))
    with pytest.raises(DesignError, match=f"{most:.1f}"):
        predict("radial-15mm", volumes_ul=(most + 0.1,))


def test_balloons_that_meet_or_lie_in_their_sheet_are_refused() -> None:
    stack = layup(
        build("radial-15mm", "chamber.count=2", "tube.outer_diameter=8.2"), MeshSettings(h=0.75)
    )
    heights = flat(stack)
    points = stack.plane.points * np.array([1.3, 1.0])
    wide = replace(stack, plane=stack.plane._replace(points=points))
    with pytest.raises(DesignError, match=r"filled balloons meet around the tube of 8\.2 mm"):
        formed(wide, heights)
    above = np.arange(len(heights))[:, None] > 0
    with pytest.raises(OutputError, match=r"film 3 would pass through one below it by 0\.10 mm"):
        formed(stack, heights - 0.1 * above)


def test_flat_is_flat() -> None:
    small = build("radial-15mm", "chamber.count=1", "tube.outer_diameter=4")
    meshes = conforming_meshes(small, MeshSettings(h=0.75, wrapped=False))
    assert meshes.volume.points[:, 2].max() == pytest.approx(3 * 0.038)
    assert meshes.volume.rest is None
