"""What is read back: files written here line by line, shapes whose volume is known."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest

from sbafab.actuators import build, load_design
from sbafab.errors import OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.layup import MeshSettings, Symmetry
from sbafab.meshing.conforming.mesh import Mesh
from sbafab.simulators.calculix import (
    DeckSettings,
    Frame,
    deck_mesh,
    history,
    history_csv,
    read_frd,
    write_deformed,
)
from sbafab.simulators.simulator import State

pytest.importorskip("netgen")


def block(time: float, name: str, rows: list[list[float]]) -> str:
    """One field as ccx 2.20 prints it."""
    lines = [
        f"    1PSTEP{1:26d}{1:12d}{1:12d}          ",
        f"  100CL  101{time:12.5E}{len(rows):12d}                     0{1:5d}           1",
        f" -4  {name:8s}{len(rows[0]):5d}    1",
        *(f" -5  {name[0]}{n}          1    2    1    0" for n in range(len(rows[0]))),
    ]
    for node, values in enumerate(rows, start=1):
        lines.append(f" -1{node:10d}" + "".join(f"{value:12.5E}" for value in values))
    return "\n".join([*lines, " -3", ""])


def frd(*times: float) -> str:
    """A result file of two nodes; displacements are the time, stresses ten times it."""
    found = "    1C\n    2C                             2                                     1\n"
    for time in times:
        found += block(time, "DISP", [[time, -time, 0.0], [0.0, 0.0, 2 * time]])
        found += block(time, "STRESS", [[10 * time, 0, 0, 0, 0, 0], [0, 0, 0, 10 * time, 0, 0]])
    return found + " 9999\n"


def test_frd(tmp_path: Path) -> None:
    path = tmp_path / "actuator.frd"
    path.write_text(frd(0.25, 0.5))
    first, last = read_frd(path, 2)
    assert (first.time, last.time) == (0.25, 0.5)
    np.testing.assert_allclose(last.displacement, [[0.5, -0.5, 0], [0, 0, 1]])
    # Pull along x, and shear: von Mises is the stress itself, and the root of three times it.
    np.testing.assert_allclose(last.von_mises, [5, 5 * 3**0.5], rtol=1e-5)


@pytest.mark.parametrize("cut", [1, 40, 400])
def test_frd_cut_short(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "actuator.frd"
    path.write_text(frd(0.25, 0.5)[: -5 - cut])
    with pytest.raises(OutputError, match=r"actuator\.frd is cut short: .*run ccx again"):
        read_frd(path, 2)
    # Of a run that was stopped, what is whole counts.
    assert [frame.time for frame in read_frd(path, 2, whole=False)][:1] == [0.25]


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "actuator.frd"
    with pytest.raises(OutputError, match="cannot be read"):
        read_frd(path, 2)
    path.write_text(frd(0.25))
    with pytest.raises(OutputError, match="a mesh of 2 nodes, not of this one of 3"):
        read_frd(path, 3)
    path.write_text(frd(0.25).replace(" 2.50000E+00", "      wrong "))
    with pytest.raises(OutputError, match=r"not a number at time 0\.25 s"):
        read_frd(path, 2)


SETTINGS = DeckSettings({"chamber1": 6.0}, imperfection=0.0)


def lone(symmetry: Symmetry) -> tuple[Laminate, Mesh]:
    laminate = build(load_design("1dof-5mm", ("stack.balloons=1",)))
    return laminate, deck_mesh(laminate, MeshSettings(h=0.6, symmetry=symmetry, gaps=True))


def stretched(mesh: Mesh, by: float) -> Frame:
    """Every length ``by`` times what it was."""
    return Frame(SETTINGS.ramp, (by - 1) * mesh.points, np.zeros((len(mesh.points), 6)))


def states_of(symmetry: Symmetry, by: float = 2.0) -> tuple[Laminate, Mesh, list[State]]:
    laminate, mesh = lone(symmetry)
    return (
        laminate,
        mesh,
        history(mesh, laminate, symmetry, SETTINGS, [stretched(mesh, by)]),
    )


@pytest.mark.parametrize("symmetry", ["full", "quarter"])
def test_air_is_what_the_pocket_holds(symmetry: Symmetry) -> None:
    laminate, mesh, (start, end) = states_of(symmetry)
    # Pocket area x mask thickness; the quarter stands for a balloon without inlet.
    (interface,) = laminate.interfaces
    area = interface.unbonded.area if symmetry == "full" else np.pi * 2.5**2
    assert start.volumes["chamber1"] == pytest.approx(0.025 * area, rel=2e-3)
    assert end.volumes["chamber1"] == pytest.approx(8 * start.volumes["chamber1"], rel=1e-9)
    # The tip is as far from the base as the films' heights have grown.
    assert start.tip == (0, 0, 0)
    assert end.stroke == pytest.approx(np.ptp(mesh.points[:, 2]), rel=1e-9)
    assert (end.pressures, end.tilt) == ({"chamber1": 6.0}, None)


def test_tilt_is_the_angle_of_the_tip() -> None:
    laminate = build(load_design("3dof-15mm", ("stack.balloons=1",)))
    mesh = deck_mesh(laminate, MeshSettings(h=0.75))
    angle = np.radians(30)
    turn = np.array(
        [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    )
    moved = mesh.points @ turn.T - mesh.points
    frame = Frame(1.0, moved, np.zeros((len(moved), 6)))
    pressures = {f"chamber{n}": 1.0 for n in (1, 2, 3)}
    start, end = history(mesh, laminate, "full", DeckSettings(pressures), [frame])
    assert start.tilt == pytest.approx(0, abs=1e-6)
    assert end.tilt == pytest.approx(30, abs=1e-6)
    assert end.volumes["chamber2"] == pytest.approx(start.volumes["chamber2"], rel=1e-9)


@pytest.mark.parametrize("symmetry", ["half", "sector"])
def test_air_of_chambers_that_are_images(symmetry: Symmetry) -> None:
    laminate = build(load_design("3dof-15mm", ("stack.balloons=1",)))
    mesh = deck_mesh(laminate, MeshSettings(h=0.75, symmetry=symmetry, gaps=True))
    pressures = {f"chamber{n}": 1.0 for n in (1, 2, 3)}
    frame = Frame(1.0, np.zeros_like(mesh.points), np.zeros((len(mesh.points), 6)))
    *_, last = history(mesh, laminate, symmetry, DeckSettings(pressures, imperfection=0), [frame])
    # Each lobe's pocket with its inlet: mask thickness times the area that is not bonded.
    pockets = laminate.interfaces[0].unbonded
    assert list(last.volumes.values()) == pytest.approx([0.025 * pockets.area / 3] * 3, rel=5e-3)


def test_csv() -> None:
    _, _, states = states_of("quarter")
    first, last = csv.DictReader(io.StringIO(history_csv(states)))
    named = "time_s pressure_chamber1_kPa stroke_mm tip_x_mm tip_y_mm volume_chamber1_ul"
    assert list(last) == [*named.split(), "von_mises_max_MPa", "work_uJ"]
    assert float(last["pressure_chamber1_kPa"]) == 6
    # 3 kPa in the mean; seven times the volume has come in.
    came = 7 * states[0].volumes["chamber1"]
    assert float(last["work_uJ"]) == pytest.approx(3 * came, rel=1e-5)
    assert float(last["stroke_mm"]) == pytest.approx(states[1].stroke, rel=1e-5)
    assert set(first.values()) >= {"0"}


def test_deformed_vtu_holds_moved_points_and_stress(tmp_path: Path) -> None:
    _, mesh = lone("quarter")
    frame = stretched(mesh, 2.0)
    frame.stress[:, 3] = 1.0
    write_deformed(mesh, frame, tmp_path / "deformed.vtu")
    pyvista = pytest.importorskip("pyvista", reason="PyVista is not installed")
    grid = pyvista.read(tmp_path / "deformed.vtu")
    np.testing.assert_allclose(grid.points, 2 * mesh.points, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(grid.point_data["von_mises"], 3**0.5, rtol=1e-6)
    np.testing.assert_allclose(grid.point_data["displacement"], mesh.points)
    np.testing.assert_array_equal(grid.point_data["stress"], frame.stress)
    np.testing.assert_array_equal(grid.cells_dict[pyvista.CellType.QUADRATIC_WEDGE], mesh.cells)
