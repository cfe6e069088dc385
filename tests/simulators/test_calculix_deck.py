"""The deck says what the design says: parsed line by line and held against the mesh."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from sbafab.actuators import build, load_design
from sbafab.meshing.conforming.layup import MeshSettings, Symmetry
from sbafab.meshing.conforming.mesh import Mesh
from sbafab.simulators.calculix import DeckSettings, deck_mesh, deck_settings, started, write_deck

pytest.importorskip("netgen")

PLAIN = DeckSettings({"chamber1": 6.0})


@dataclass
class Block:
    """A keyword of the deck with its options and the rows below it."""

    keyword: str
    options: dict[str, str]
    rows: list[list[str]] = field(default_factory=list)


def read_deck(path: Path) -> list[Block]:
    """Keywords in order, with included files in their place."""
    blocks: list[Block] = []
    for line in path.read_text(encoding="ascii").splitlines():
        if line.startswith("**"):
            continue
        if not line.startswith("*"):
            blocks[-1].rows.append([part.strip() for part in line.split(",")])
            continue
        keyword, *parts = [part.strip() for part in line.split(",")]
        options = {}
        for part in parts:
            name, _, value = part.partition("=")
            options[name.strip()] = value.strip()
        if keyword == "*INCLUDE":
            assert "/" not in options["INPUT"], "relative, beside the deck"
            blocks += read_deck(path.parent / options["INPUT"])
        else:
            blocks.append(Block(keyword, options))
    return blocks


def named(blocks: list[Block], keyword: str, **options: str) -> list[Block]:
    return [
        block
        for block in blocks
        if block.keyword == keyword
        and all(block.options.get(name) == value for name, value in options.items())
    ]


def numbers(block: Block) -> list[int]:
    return [int(value) for row in block.rows for value in row if value]


def mesh_of(template: str, *assignments: str, h: float, symmetry: Symmetry = "full") -> Mesh:
    laminate = build(load_design(template, assignments))
    return deck_mesh(laminate, MeshSettings(h=h, symmetry=symmetry))


@pytest.fixture(scope="module")
def lobed() -> Mesh:
    return mesh_of("3dof-15mm", "stack.balloons=2", h=0.75)


@pytest.fixture(scope="module")
def lone() -> Mesh:
    return mesh_of("1dof-5mm", "stack.balloons=1", h=0.75)


def test_each_cavity_face_is_pressed_once(lobed: Mesh, tmp_path: Path) -> None:
    pressures = {"chamber1": 6.0, "chamber2": 2.0, "chamber3": 0.0}
    blocks = read_deck(write_deck(lobed, DeckSettings(pressures), tmp_path)[0])
    for chamber, kilopascals in pressures.items():
        (load,) = named(blocks, "*DLOAD", AMPLITUDE=f"ramp_{chamber}")
        pressed: Counter[tuple[int, int]] = Counter()
        for name, face, value in load.rows:
            assert float(value) == pytest.approx(kilopascals / 1000)
            (cells,) = named(blocks, "*ELSET", ELSET=name)
            pressed.update((cell, int(face.removeprefix("P"))) for cell in numbers(cells))
        wanted = {(cell + 1, face + 1) for cell, face in lobed.face_sets[f"cavity_{chamber}"]}
        assert set(pressed) == wanted
        assert set(pressed.values()) == {1}
        (surface,) = named(blocks, "*SURFACE", NAME=f"cavity_{chamber}")
        listed = {(int(cell), int(side.removeprefix("S"))) for cell, side in surface.rows}
        assert listed == wanted


def test_a_stack_of_film_stands_on_its_base_and_each_chamber_has_a_ramp(
    lobed: Mesh, tmp_path: Path
) -> None:
    pressures = dict.fromkeys(("chamber1", "chamber2", "chamber3"), 6.0)
    blocks = read_deck(write_deck(lobed, DeckSettings(pressures, ramp=2.0), tmp_path)[0])
    ramps = named(blocks, "*AMPLITUDE")
    assert [ramp.options["NAME"] for ramp in ramps] == [f"ramp_{name}" for name in pressures]
    for ramp in ramps:
        time, share = np.array(ramp.rows, dtype=float).T
        assert time[[0, -1]].tolist() == [0, 2]
        np.testing.assert_allclose(share, (time / 2) ** 2, rtol=1e-6)
    assert [block.rows for block in named(blocks, "*BOUNDARY")] == [[["base", "1", "3"]]]
    (base,) = named(blocks, "*NSET", NSET="base")
    assert numbers(base) == [node + 1 for node in lobed.node_sets["base"]]
    assert [block.options["TYPE"] for block in named(blocks, "*ELEMENT")] == ["C3D15"] * 4
    (everything,) = named(blocks, "*ELSET", ELSET="all_elements")
    parts = {block.options["ELSET"] for block in named(blocks, "*ELEMENT")}
    assert {row[0] for row in everything.rows} == parts
    (section,) = named(blocks, "*SOLID SECTION")
    assert section.options == {"ELSET": "all_elements", "MATERIAL": "TPE"}
    assert named(blocks, "*ELASTIC")[0].rows == [["10", "0.2"]]
    assert named(blocks, "*DENSITY")[0].rows == [["1.122e-09"]]


@pytest.mark.parametrize(
    ("symmetry", "axes"), [("full", "112333"), ("half", "133"), ("quarter", "3")]
)
def test_a_lone_balloon_is_held_as_little_as_may_be(
    symmetry: Symmetry, axes: str, tmp_path: Path
) -> None:
    mesh = mesh_of("1dof-5mm", "stack.balloons=1", h=0.75, symmetry=symmetry)
    blocks = read_deck(write_deck(mesh, PLAIN, tmp_path)[0])
    rows = named(blocks, "*BOUNDARY")[0].rows
    assert "".join(sorted(axis for _, axis in rows)) == axes
    assert {int(node) - 1 for node, _ in rows} <= set(mesh.node_sets["bond_001"])
    # What a rigid body can do, held by these and the planes: of full rank, or it would drift.
    held = [_freedom(mesh, int(node) - 1, int(axis)) for node, axis in rows]
    for name, nodes in mesh.node_sets.items():
        if name.startswith("symmetry"):
            held += [_freedom(mesh, node, 1 if name.endswith("x") else 2) for node in nodes]
    assert np.linalg.matrix_rank(np.array(held)) == 6


def _freedom(mesh: Mesh, node: int, axis: int) -> np.ndarray:
    """How far each of a rigid body's six motions moves a node along an axis."""
    place = mesh.points[node]
    return np.concatenate([np.eye(3), [np.cross(turn, place) for turn in np.eye(3)]])[:, axis - 1]


def test_nodes_of_a_sector_stay_on_its_planes(tmp_path: Path) -> None:
    mesh = mesh_of("3dof-15mm", "stack.balloons=1", h=0.75, symmetry="sector")
    blocks = read_deck(write_deck(mesh, DeckSettings({"chamber1": 6.0}), tmp_path)[0])
    tied = set()
    for equation in named(blocks, "*EQUATION"):
        (node, first, a, other, second, b) = equation.rows[1]
        assert node == other
        assert {first, second} == {"1", "2"}
        factors = {first: float(a), second: float(b)}
        place = mesh.points[int(node) - 1]
        # Along the plane a node may go: the equation holds for the way from the axis to it.
        along = place[:2] / np.hypot(*place[:2])
        assert factors["1"] * along[0] + factors["2"] * along[1] == pytest.approx(0, abs=1e-5)
        tied.add(int(node) - 1)
    planes = {*mesh.node_sets["symmetry_sector_1"], *mesh.node_sets["symmetry_sector_2"]}
    assert tied <= planes
    on_axis = set(np.flatnonzero(np.hypot(*mesh.points[:, :2].T) < 1e-6))
    assert planes - tied == on_axis


def test_imperfection_leaves_films_as_thick_and_bonded(lobed: Mesh) -> None:
    settings = DeckSettings({"chamber1": 6.0}, imperfection=0.01)
    mesh = started(lobed, settings)
    moved = mesh.points - lobed.points
    assert not moved[:, :2].any()
    assert 0.005 < np.abs(moved[:, 2]).max() <= 0.01 + 1e-9
    # What lies above each other moves as one.
    places, column = np.unique(lobed.points[:, :2].round(9), axis=0, return_inverse=True)
    mean = np.bincount(column.ravel(), moved[:, 2]) / np.bincount(column.ravel())
    assert len(places) < len(moved) / 4
    np.testing.assert_allclose(moved[:, 2], mean[column.ravel()], atol=1e-9)


def test_abaqus_is_told_the_same_but_for_outputs_and_files_are_the_same_twice(
    lone: Mesh, tmp_path: Path
) -> None:
    first, second = (write_deck(lone, PLAIN, tmp_path / name) for name in ("a", "b"))
    assert [path.name for path in first] == ["actuator.inp", "abaqus.inp", "mesh.inp"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    calculix, abaqus, _ = (path.read_text("ascii") for path in first)
    assert "*STEP, NLGEOM" in calculix
    assert "*DYNAMIC, ALPHA=-0.3" in calculix
    static = write_deck(lone, DeckSettings({"chamber1": 6.0}, "static"), tmp_path)[0]
    assert "*STATIC" in static.read_text("ascii").splitlines()
    same, _, outputs = abaqus.partition("*OUTPUT")
    assert calculix.startswith(same)
    assert "*DLOAD" in same
    # Abaqus's result file knows no TIME POINTS; its output database does.
    assert "FILE" not in outputs
    assert outputs.endswith("*END STEP\n")


def test_settings_of_a_design_take_its_density() -> None:
    laminate = build(load_design("1dof-5mm", ("films.tpe.density=1000",)))
    settings = deck_settings(laminate)
    assert settings.films["TPE"] == pytest.approx((10, 0.2, 1e-9))
    assert settings.pressures == {"chamber1": 6.0}
