"""Filled meshes and parts by symmetry."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sbafab.api import build
from sbafab.errors import DesignError
from sbafab.geometry.region import disc
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.layup import MeshSettings
from sbafab.meshing.conforming.meshes import conforming_meshes, thinning
from tests.quick import few

AXIS = (0.0, 0.0)
FILM = 0.038


@pytest.fixture(scope="module")
def one_balloon() -> Laminate:
    return build("1dof-5mm", "stack.balloons=1")


def test_a_balloon_rises_as_the_paraboloid(one_balloon: Laminate) -> None:
    settings = MeshSettings(h=0.5, symmetry="quarter", fill_ul=3.0)
    meshes = conforming_meshes(one_balloon, settings)
    mesh = meshes.volume
    # Volume of two paraboloids of height a over radius 2.5: pi 2.5^2 a.
    apex = 3.0 / (math.pi * 2.5**2)
    cap = mesh.points[np.unique(mesh.cells[mesh.cell_sets["film_003_TPE_cap"]])]
    radii = np.hypot(*cap[:, :2].T)
    lowest = {r: cap[np.isclose(radii, r, atol=1e-6), 2].min() for r in (0.0, 1.25, 2.5)}
    assert lowest[0.0] == pytest.approx(FILM + apex, rel=2e-3)
    assert lowest[1.25] == pytest.approx(FILM + 0.75 * apex, rel=2e-3)
    assert lowest[2.5] == pytest.approx(FILM)
    area = math.pi * 2.5 / (6 * apex**2) * ((2.5**2 + 4 * apex**2) ** 1.5 - 2.5**3)
    assert thinning(meshes.shell)[0] == pytest.approx(area / (math.pi * 2.5**2) - 1, rel=0.01)


@pytest.mark.parametrize(
    ("template", "changes", "fill"),
    few(
        [
            ("1dof-5mm", ("stack.balloons=3",), 5.0),
            ("1dof-5mm", ("stack.balloons=2",), 16.9),
            ("3dof-15mm", ("stack.balloons=2",), 8.0),
            ("radial-15mm", ("chamber.count=1", "tube.outer_diameter=4"), 40.0),
            ("1dof-5mm", ("stack.balloons=2", "registration.method=ears"), 4.0),
            ("1dof-5mm", ("chamber.diameter=[5, 4]", "stack.balloons=2"), 3.0),
            ("3dof-15mm", ("stack.balloons=1", "chamber.count=5"), 3.0),
        ],
        2,
        names=3,
    ),
)
def test_cavities_hold_what_was_asked(template: str, changes: tuple[str, ...], fill: float) -> None:
    laminate = build(template, *changes)
    meshes = conforming_meshes(laminate, MeshSettings(h=0.7, fill_ul=fill, wrapped=False))
    asked = fill * laminate.balloons
    for chamber in laminate.chambers:
        bores = math.pi * 0.5**2 * FILM * 2 * (laminate.balloons - 1)
        held = meshes.volume.cavity(chamber.name)[0].volume - bores
        assert held == pytest.approx(asked, rel=0.02)
        assert meshes.shell.cavity(chamber.name)[0].volume == pytest.approx(asked, rel=0.02)
    films = sum(layer.profile.area * layer.film.thickness for layer in laminate.tpe_layers)
    assert meshes.statistics["volume"]["volume_mm3"] == pytest.approx(films, rel=1e-3)
    assert meshes.statistics["volume"]["least_scaled_jacobian"] > 0.02


@pytest.mark.parametrize(
    ("fill", "message"),
    [
        (17.0, r"use at most 16\.94 ul"),
        (-1.0, "must be 0 ul or more"),
        (math.nan, "must be 0 ul or more"),
    ],
)
def test_fills_out_of_range_are_refused(one_balloon: Laminate, fill: float, message: str) -> None:
    with pytest.raises(DesignError, match=message):
        conforming_meshes(one_balloon, MeshSettings(h=0.7, fill_ul=fill))


def test_gaps_count_as_air(one_balloon: Laminate) -> None:
    settings = MeshSettings(h=0.7, gaps=True, fill_ul=2.0)
    mesh = conforming_meshes(one_balloon, settings).volume
    assert mesh.cavity("chamber1")[0].volume == pytest.approx(2.0, rel=0.02)
    with pytest.raises(DesignError, match="less than the gaps"):
        conforming_meshes(one_balloon, replace(settings, fill_ul=0.1))


def test_a_quarter_is_the_actuator_without_its_inlet(one_balloon: Laminate) -> None:
    meshes = conforming_meshes(one_balloon, MeshSettings(h=0.5, symmetry="quarter"))
    plates = 2 * disc(AXIS, 3.25).area * FILM
    figures = meshes.statistics["volume"]
    assert 4 * figures["volume_mm3"] == pytest.approx(plates, rel=5e-4)
    for axis, name in enumerate(("symmetry_x", "symmetry_y")):
        nodes = meshes.volume.node_sets[name]
        on_plane = np.flatnonzero(np.abs(meshes.volume.points[:, axis]) < 1e-9)
        assert np.array_equal(nodes, on_plane)
        assert len(nodes) > 20
    assert meshes.volume.cavities == {}
    assert len(meshes.volume.face_sets["cavity_chamber1"]) > 100


@pytest.mark.parametrize(("symmetry", "copies"), [("half", 2), ("sector", 3)])
def test_parts_add_up_to_the_whole(symmetry: str, copies: int) -> None:
    laminate = build("3dof-15mm", "stack.balloons=1")
    settings = MeshSettings(h=0.7, symmetry=symmetry, fill_ul=4.0)  # type: ignore[arg-type]
    meshes = conforming_meshes(laminate, settings)
    films = sum(layer.profile.area * layer.film.thickness for layer in laminate.tpe_layers)
    assert copies * meshes.statistics["volume"]["volume_mm3"] == pytest.approx(films, rel=1e-3)
    inlets = [name for name in meshes.volume.node_sets if name.startswith("inlet")]
    assert len(inlets) == {"half": 2, "sector": 1}[symmetry]
    assert any(symmetry in note.lower() or "lobe" in note for note in meshes.volume.notes)


def test_ears_have_no_quarter() -> None:
    laminate = build("1dof-5mm", "stack.balloons=1", "registration.method=ears")
    with pytest.raises(DesignError, match="lacks the mesh symmetry quarter"):
        conforming_meshes(laminate, MeshSettings(symmetry="quarter"))
