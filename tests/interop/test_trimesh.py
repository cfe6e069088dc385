"""What trimesh reads from the mesh files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from sbafab.actuators import build, load_design
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.formats import write_meshes
from sbafab.meshing.solid import cavity_slabs, solid_slabs
from tests.quick import few

TEMPLATES = ["1dof-5mm", "3dof-15mm", "radial-15mm"]


@pytest.fixture(scope="module", params=TEMPLATES)
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Made:
    laminate = build(load_design(request.param, ["stack.balloons=2"]))
    folder = tmp_path_factory.mktemp(request.param)
    write_meshes(laminate, folder)
    return laminate, folder / "mesh"


Made = tuple[Laminate, Path]


def read(path: Path) -> trimesh.Trimesh:
    """The one mesh of a file, placed as its scene places it."""
    mesh: trimesh.Trimesh = trimesh.load_scene(path).to_mesh()
    mesh.merge_vertices()
    return mesh


def is_closed(mesh: trimesh.Trimesh) -> bool:
    return bool(mesh.is_watertight and mesh.is_winding_consistent)


def bodies(mesh: trimesh.Trimesh) -> int:
    groups = trimesh.graph.connected_components(
        mesh.face_adjacency, nodes=np.arange(len(mesh.faces)), engine="networkx"
    )
    return len(list(groups))


@pytest.mark.parametrize(
    ("suffix", "millimetre"), few([("stl", 1.0), ("3mf", 1.0), ("glb", 1e-3)], 2, names=2)
)
def test_the_solid_is_one_closed_body_of_the_right_volume(
    made: Made, suffix: str, millimetre: float
) -> None:
    laminate, folder = made
    mesh = read(folder / f"solid.{suffix}")
    expected = sum(slab.volume for slab in solid_slabs(laminate))
    assert is_closed(mesh)
    assert bodies(mesh) == 1
    assert mesh.volume == pytest.approx(expected * millimetre**3, rel=0.0005)
    assert sorted(mesh.extents)[0] == pytest.approx(laminate.thickness * millimetre, rel=1e-4)


def test_each_cavity_is_one_closed_body_of_the_right_volume(made: Made) -> None:
    laminate, folder = made
    for chamber in laminate.chambers:
        mesh = read(folder / f"cavity_{chamber.name}.stl")
        expected = sum(slab.volume for slab in cavity_slabs(laminate, chamber))
        assert is_closed(mesh)
        assert bodies(mesh) == 1
        assert mesh.euler_number == 2
        assert mesh.volume == pytest.approx(expected, rel=0.0005)


def test_units_are_stated_where_the_format_can(made: Made) -> None:
    _, folder = made
    assert trimesh.load_scene(folder / "solid.3mf").units in ("mm", "millimeter")
    # glTF is in metres with y up: the laminate's height lies along y.
    laminate, _ = made
    extents = read(folder / "solid.glb").extents
    assert extents[1] == pytest.approx(laminate.thickness / 1000, rel=1e-4)
