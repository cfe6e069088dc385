"""Decks of the drawn templates: supports, a vacuum's sign, and runs of the real ccx."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from docs.scripts.drawn_runs import DECKS
from docs.scripts.measured import record
from sbafab.actuators import build, load_design
from sbafab.meshing.conforming.layup import MeshSettings
from sbafab.meshing.conforming.mesh import Mesh
from sbafab.simulators.calculix import (
    DeckSettings,
    Frame,
    deck_mesh,
    deck_settings,
    films_meet,
    find_ccx,
    history,
    read_frd,
    run_ccx,
    simulate,
    started,
    write_deck,
)
from sbafab.simulators.simulator import SimulationRequest

pytest.importorskip("netgen")
needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx is not installed")


def test_a_vacuum_is_a_negative_load_on_the_same_faces(tmp_path: Path) -> None:
    laminate = build(load_design("vacuum"))
    mesh = deck_mesh(laminate, MeshSettings(h=4, gaps=True, symmetry="half"))
    loads = {}
    for pressure in (5.0, -5.0):
        settings = deck_settings(laminate, SimulationRequest(pressure), "static")
        write_deck(mesh, settings, tmp_path)
        text = (tmp_path / "actuator.inp").read_text("ascii")
        loads[pressure] = re.findall(r"(faces_stack_\d, P\d), (\S+)", text)
    assert [face for face, _ in loads[5.0]] == [face for face, _ in loads[-5.0]] != []
    assert {float(value) for _, value in loads[5.0]} == {0.005}
    assert {float(value) for _, value in loads[-5.0]} == {-0.005}


def test_films_that_pass_through_each_other_are_seen() -> None:
    """The gap of eight sheets of 0.05 mm is 0.4 mm; the upper film sinks by more or less."""
    laminate = build(load_design("vacuum"))
    mesh = deck_mesh(laminate, MeshSettings(h=4, gaps=True, symmetry="half"))
    x, y, z = np.abs(mesh.points).T
    upper = (z > 0.038 + 0.4 - 1e-6) & (x < 39.9) & (y < 9.9)
    for sink, meets in ((0.399, False), (0.401, True)):
        moved = np.zeros_like(mesh.points)
        moved[upper, 2] = -sink
        assert films_meet(mesh, "stack", Frame(1.0, moved, np.zeros((len(moved), 6)))) is meets


@pytest.mark.parametrize(("template", "free"), [("finger", True), ("1dof-5mm", False)])
def test_only_a_stack_stands_on_its_base(template: str, free: bool, tmp_path: Path) -> None:
    laminate = build(load_design(template))
    settings = deck_settings(laminate)
    assert settings.is_free is free
    mesh = deck_mesh(laminate, MeshSettings(h=0.7 if template == "1dof-5mm" else 3.0))
    write_deck(mesh, settings, tmp_path)
    text = (tmp_path / "actuator.inp").read_text("ascii")
    assert ("base, 1, 3" in text) is not free
    # Tubes are glued into the mouths of what is drawn; the paper's balloons have none.
    assert ("*EQUATION" in text) is free
    if free:
        # As many as a rigid body has freedoms.
        boundary = text.split("*BOUNDARY\n")[1].split("*")[0]
        assert len(boundary.splitlines()) == 6


def test_lips_at_a_mouth_move_as_one(tmp_path: Path) -> None:
    laminate = build(load_design("array"))
    mesh = deck_mesh(laminate, MeshSettings(h=2, symmetry="half"))
    write_deck(mesh, deck_settings(laminate), tmp_path)
    bonded = np.concatenate([nodes for name, nodes in mesh.node_sets.items() if "bond" in name])
    # Of three mouths one lies across the plane of symmetry, one beyond it.
    (mid, row) = (set(mesh.node_sets[f"inlet_row{n}"]) - set(bonded) for n in (2, 3))
    tied: dict[int, set[int]] = {}
    for (upper, axis, one), (lower, other, minus) in _equations(tmp_path / "actuator.inp"):
        assert (one, minus, axis) == (1, -1, other)
        np.testing.assert_allclose(mesh.points[upper], mesh.points[lower], atol=1e-9)
        assert upper != lower
        assert {upper, lower} <= mid | row
        for node in (upper, lower):
            tied.setdefault(node, set()).add(axis)
    assert set(tied) == mid | row
    on_plane = set(mesh.node_sets["symmetry_y"])
    assert mid & on_plane
    assert all(axes == ({3} if node in on_plane else {1, 2, 3}) for node, axes in tied.items())


def _equations(deck: Path) -> list[tuple[tuple[int, int, float], tuple[int, int, float]]]:
    """Return the two terms of each equation: node from 0, axis, factor."""
    rows = re.findall(r"\*EQUATION\n2\n(.+)\n", deck.read_text("ascii"))
    terms = []
    for row in rows:
        a, i, p, b, j, q = (float(value) for value in row.split(","))
        terms.append(((int(a) - 1, int(i), p), (int(b) - 1, int(j), q)))
    return terms


RUN = ("array", "finger", "folded")
"""A row of pouches, two unlike films, a fold. ``python -m docs.scripts.drawn_runs`` runs all."""
LOW = 0.05
"""Share of a deck's pressure that is reached in one increment: a few iterations show what films do.
"""


@pytest.mark.long
@needs_ccx
@pytest.mark.parametrize("template", RUN)
def test_the_deck_of_a_drawn_template_runs(template: str, tmp_path: Path) -> None:
    mesh, settings = deck_of(template)
    settings = replace(settings, outputs=1)
    deck = write_deck(mesh, settings, tmp_path)[0]
    text, steps = re.subn(r"(\*STATIC\n)0\.1, ", r"\g<1>1, ", deck.read_text("ascii"))
    assert steps == 1
    deck.write_text(text, "ascii")
    assert run_ccx(tmp_path, "actuator", 1.0, 600.0) == (1.0, None)
    run_mesh = started(mesh, settings)
    frames = read_frd(tmp_path / "actuator.frd", len(mesh.points))
    laminate = build(load_design(template))
    first, last = history(run_mesh, laminate, DECKS[template].symmetry, settings, frames[-1:])
    assert last.stroke > 0
    assert all(last.volumes[name] > first.volumes[name] + 0.01 for name in last.volumes)
    assert last.stress > 0
    # Lips stay together in ccx as in the deck.
    moved = frames[-1].displacement
    equations = _equations(deck)
    assert equations
    for (upper, axis, _), (lower, _, _) in equations:
        assert moved[upper, axis - 1] == pytest.approx(moved[lower, axis - 1], abs=1e-5)
    if template == "finger":
        # It bends away from the layer that does not stretch: the pouches lie on the upper side,
        # which becomes the hollow one.
        x, lower_side = np.abs(run_mesh.points[:, 0]), run_mesh.points[:, 2] < 0.2
        ends, middle = (lower_side & (x > at) & (x < at + 2) for at in (27, 8))
        assert moved[ends, 2].mean() > moved[middle, 2].mean()


@pytest.mark.long
@needs_ccx
def test_films_drawn_together_end_a_run(tmp_path: Path) -> None:
    """Sheets are not meshed: the films meet at a vacuum that is next to none."""
    laminate, mesh = build(load_design("vacuum")), MeshSettings(4.0, symmetry="half", gaps=True)
    settings = replace(deck_settings(laminate, SimulationRequest(-5e-5), "static"), outputs=2)
    found = simulate(laminate, mesh, settings, tmp_path, 600, lambda *_: None)
    assert "the films meet" in str(found.stopped)
    assert found.last.stroke < 0
    assert found.volumes["stack"] < found.states[0].volumes["stack"]


def deck_of(template: str) -> tuple[Mesh, DeckSettings]:
    case = DECKS[template]
    laminate = build(load_design(template))
    mesh = deck_mesh(laminate, MeshSettings(h=case.h, symmetry=case.symmetry))
    return mesh, deck_settings(laminate, SimulationRequest(LOW * case.pressure), "static")


def test_the_array_rose_as_two_clamped_plates() -> None:
    """2 p a^4 / 64 D of 8 mm pouches, D of 0.2 mm at 300 MPa; the strips give a little."""
    rise = float(record("drawn_decks").tables["decks"].cell("array", "thicker by, mm"))
    stiffness = 300 * 0.2**3 / (12 * (1 - 0.3**2))
    pressure = DECKS["array"].pressure / 1000
    assert rise == pytest.approx(2 * pressure * 4**4 / (64 * stiffness), rel=0.12)


def test_inertia_is_little_where_a_working_pressure_was_reached() -> None:
    table = record("drawn_decks_furthest").tables["decks"]
    reached = [row for row in table.rows if row[-1] == "reached"]
    assert reached
    for name, *_ in reached:
        assert float(table.cell(name, "kinetic energy, %")) < 1


@pytest.mark.long
@needs_ccx
@pytest.mark.parametrize("template", sorted(DECKS.keys() - {*RUN, "vacuum"}))
def test_ccx_reads_the_deck_of_every_other_drawn_template(template: str, tmp_path: Path) -> None:
    """As far as the matrix of the flat films."""
    mesh, settings = deck_of(template)
    write_deck(started(mesh, settings), settings, tmp_path)
    deck = tmp_path / "actuator.inp"
    text, steps = re.subn(r"\*STATIC\n.*\n", "*NO ANALYSIS\n", deck.read_text("ascii"))
    assert steps == 1
    deck.write_text(text, "ascii")
    # Without an analysis it ends with a code of its own, whatever it has read.
    ended = subprocess.run(
        [find_ccx(), "-i", "actuator"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert "*ERROR" not in ended.stdout
    assert "stiffness/mass contributions" in ended.stdout
