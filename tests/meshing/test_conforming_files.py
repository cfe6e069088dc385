"""Every format is written, read back by another program's reader, and compared."""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh

from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.layup import MeshSettings
from sbafab.meshing.conforming.mesh import FACES, volumes
from sbafab.meshing.conforming.meshes import (
    ConformingMeshes,
    conforming_meshes,
    write_conforming,
)
from sbafab.meshing.formats import MeshFile

Written = tuple[ConformingMeshes, list[MeshFile], Path]


@pytest.fixture(scope="module", params=["wedge", "tet"])
def written(
    request: pytest.FixtureRequest,
    two_balloons: Laminate,
    tmp_path_factory: pytest.TempPathFactory,
) -> Written:
    settings = MeshSettings(h=0.75, element=request.param, fill_ul=2.0)
    meshes = conforming_meshes(two_balloons, settings)
    folder = tmp_path_factory.mktemp("conforming")
    return meshes, write_conforming(meshes, folder), folder / "mesh"


@pytest.fixture(autouse=True)
def _wedges_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """The reader knows the wedge of second order, but has no dimension for it."""
    monkeypatch.setitem(meshio._mesh.topological_dimension, "wedge15", 3)


@pytest.mark.parametrize("name", ["volume", "shell"])
def test_vtu_keeps_nodes_cells_and_sets(written: Written, name: str) -> None:
    meshes, _, folder = written
    mesh = getattr(meshes, name)
    read = meshio.read(folder / f"{name}.vtu")
    assert np.array_equal(read.points, mesh.points)
    assert read.cells[0].type == mesh.kind
    assert np.array_equal(read.cells[0].data, mesh.cells)
    assert np.array_equal(np.flatnonzero(read.point_data["tip"]), mesh.node_sets["tip"])
    (part,) = read.cell_data["part"]
    for number, cells in enumerate(mesh.parts.values(), start=1):
        assert np.array_equal(np.flatnonzero(part == number), cells)
    (marked,) = read.cell_data["cavity_A"]
    assert np.array_equal(np.flatnonzero(marked), np.unique(mesh.face_sets["cavity_A"][:, 0]))


@pytest.mark.parametrize("name", ["volume", "shell"])
def test_msh_keeps_nodes_cells_and_groups(written: Written, name: str) -> None:
    meshes, _, folder = written
    mesh = getattr(meshes, name)
    read = meshio.read(folder / f"{name}.msh")
    assert np.allclose(read.points, mesh.points, rtol=0, atol=1e-9)
    found = members(read, mesh.kind)
    ordered = np.concatenate(list(mesh.parts.values()))
    # A volume's walls are triangles too; its own cells come first.
    count = len(mesh.cells)
    assert np.array_equal(found[:count, 1:], mesh.cells[ordered])
    groups = read.field_data
    for part, cells in mesh.parts.items():
        assert np.count_nonzero(found[:count, 0] == groups[part][0]) == len(cells)
    places = members(read, "vertex")
    tips = places[places[:, 0] == groups["tip"][0], 1]
    assert np.array_equal(tips, mesh.node_sets["tip"])
    assert groups["base"][1] == 0


def members(read: meshio.Mesh, kind: str) -> np.ndarray:
    """Physical group and nodes of each element of a type."""
    rows = [
        np.column_stack([tags, block.data])
        for block, tags in zip(read.cells, read.cell_data["gmsh:physical"], strict=True)
        if block.type == kind
    ]
    return np.concatenate(rows)


@pytest.mark.parametrize("name", ["volume", "shell"])
def test_legacy_vtk_has_first_order_cells_that_fill_the_space(written: Written, name: str) -> None:
    meshes, _, folder = written
    mesh = getattr(meshes, name)
    assert (folder / f"{name}.vtk").read_text().splitlines()[2:4] == [
        "ASCII",
        "DATASET UNSTRUCTURED_GRID",
    ]
    read = meshio.read(folder / f"{name}.vtk")
    (block,) = read.cells
    assert block.type == ("tetra" if name == "volume" else "triangle")
    assert np.unique(block.data).tolist() == list(range(len(read.points)))
    a, *others = (read.points[block.data[:, corner]] for corner in range(block.data.shape[1]))
    sides = [other - a for other in others]
    if name == "volume":
        sizes = np.einsum("ij,ij->i", np.cross(sides[0], sides[1]), sides[2]) / 6
        assert sizes.min() > 0
    else:
        sizes = np.linalg.norm(np.cross(sides[0], sides[1]), axis=1) / 2
    # Chords cut a little off every arc.
    exact = volumes(mesh.kind, mesh.points, mesh.cells).sum()
    assert sizes.sum() == pytest.approx(exact, rel=0.05)


@pytest.mark.parametrize("name", ["volume", "shell"])
def test_inp_keeps_nodes_elements_and_sets(written: Written, name: str) -> None:
    meshes, _, folder = written
    mesh = getattr(meshes, name)
    nodes, elements, sets = read_inp(folder / f"{name}.inp")
    assert np.allclose(nodes[:, 1:], mesh.points, rtol=0, atol=1e-8)
    assert elements[:, 0].tolist() == [
        cell + 1 for cells in mesh.parts.values() for cell in cells.tolist()
    ]
    assert np.array_equal(elements[:, 1:] - 1, mesh.cells[elements[:, 0] - 1])
    for key, chosen in mesh.node_sets.items():
        assert [int(number) - 1 for number in sets["NSET", key]] == chosen.tolist()
    sides = {"SNEG": 0, "SPOS": 1, **{f"S{face + 1}": face for face in range(5)}}
    surface = sets["SURFACE", "cavity_A"]
    pairs = zip(surface[::2], surface[1::2], strict=True)
    found = [[int(cell) - 1, sides[side]] for cell, side in pairs]
    assert found == mesh.face_sets["cavity_A"].tolist()
    lines = (folder / f"{name}.inp").read_text().splitlines()
    assert "2 ul of air a balloon. A start shape, not an equilibrium" in lines[2]
    longest = max(len(line.split(",")) for line in lines)
    assert longest <= 16


def read_inp(path: Path) -> tuple[np.ndarray, np.ndarray, dict[tuple[str, str], list[str]]]:
    """Nodes, elements and sets of an Abaqus input file, as its manual describes them."""
    nodes: list[list[float]] = []
    elements: list[list[int]] = []
    sets: dict[tuple[str, str], list[str]] = {}
    keyword, name = "", ""
    for line in path.read_text().splitlines():
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            keyword = line[1:].split(",")[0]
            match = re.search(r"(?:NSET|NAME|ELSET)=(\w+)", line)
            name = match[1] if match else ""
            continue
        values = [value.strip() for value in line.split(",")]
        if keyword == "NODE":
            nodes.append([float(value) for value in values])
        elif keyword == "ELEMENT":
            elements.append([int(value) for value in values])
        else:
            sets.setdefault((keyword, name), []).extend(values)
    return np.array(nodes), np.array(elements), sets


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply"])
def test_standalone_cavities_are_closed_and_look_outward(written: Written, suffix: str) -> None:
    meshes, files, folder = written
    read = trimesh.load(folder / f"cavity_A_conforming.{suffix}")
    assert read.is_watertight
    assert read.volume == pytest.approx(meshes.volume.cavity("A")[0].volume, rel=1e-6)
    (listed,) = (file for file in files if file.file.endswith(f"_conforming.{suffix}"))
    assert listed.volume_mm3 == pytest.approx(read.volume, rel=1e-6)


def test_only_the_formats_asked_for_are_written(two_balloons: Laminate, tmp_path: Path) -> None:
    meshes = conforming_meshes(two_balloons, MeshSettings(h=0.75, gaps=True))
    told: list[tuple[int, int]] = []
    files = write_conforming(meshes, tmp_path, lambda *step: told.append(step), ("inp", "ply"))
    assert [file.file for file in files] == [
        "mesh/volume.inp",
        "mesh/shell.inp",
        "mesh/skin.ply",
        "mesh/cavity_A_conforming.ply",
    ]
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_faces_of_every_element_look_out() -> None:
    corners = {
        "wedge15": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
        "tetra10": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    }
    for kind, places in corners.items():
        points = np.array(places, dtype=float)
        for local in FACES[kind]:  # type: ignore[index]
            face = points[[node for node in local if node < len(points)]]
            normal = np.cross(face[1] - face[0], face[2] - face[0])
            assert normal @ (face.mean(axis=0) - points.mean(axis=0)) > 0
