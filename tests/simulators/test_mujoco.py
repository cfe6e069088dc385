"""The model for MuJoCo, and balloons that MuJoCo inflates."""

from __future__ import annotations

import math
import subprocess
import sys
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import sbafab
from sbafab.errors import OutputError
from sbafab.runtime import ignore_progress
from sbafab.simulators import mujoco as of_mujoco
from sbafab.simulators.mujoco import export, inflate, run, shell_of, why_not
from sbafab.simulators.shell_model import round_stack
from sbafab.simulators.simulator import Result, SimulationRequest
from tests.quick import few

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")

BALLOON = ("1dof-5mm", "stack.balloons=1")
LOBED = ("3dof-15mm", "stack.balloons=2")
CALCULIX = {0.95: 0.866, 6.0: 1.557}
"""Stroke in mm by kPa of one balloon, CalculiX 2.20, axisymmetric elements of second order."""


def written(folder: Path, *design: str, pressure: float = 5.0, sectors: int = 8) -> Path:
    """The path of a model with rings of eight nodes."""
    export(sbafab.build(*design), SimulationRequest(pressure), folder, sectors)
    return folder / "actuator.xml"


@cache
def inflated(
    pressures: tuple[float, ...], design: tuple[str, ...], sectors: int, seconds: float
) -> Result:
    laminate = sbafab.build(*design)
    names = [chamber.name for chamber in laminate.chambers]
    told = dict(zip(names, pressures, strict=True))
    request = SimulationRequest(chambers=told, seconds=seconds)
    with TemporaryDirectory() as folder:
        return run(laminate, request, Path(folder), ignore_progress, sectors)


# The model.


@pytest.mark.parametrize("design", [BALLOON, LOBED], ids=" ".join)
def test_mujoco_reads_the_mesh_as_it_was_meant(tmp_path: Path, design: tuple[str, ...]) -> None:
    """Node i is body i + 1: flat at qpos0, where MuJoCo takes its lengths, inflated in the key.

    The model's lengths are cm.
    """
    mesh = shell_of(round_stack(sbafab.build(*design)), {"chamber1": 5.0}, 8)
    model = mujoco.MjModel.from_xml_path(str(written(tmp_path, *design)))
    state = mujoco.MjData(model)
    mujoco.mj_kinematics(model, state)
    assert 10 * state.xpos[1:] == pytest.approx(mesh.rest, abs=1e-7)
    mujoco.mj_resetDataKeyframe(model, state, model.key("inflated").id)
    mujoco.mj_kinematics(model, state)
    still = model.body_dofnum[1:, None] == 0
    # The base stands still, or the centre of a lone balloon.
    fixed = [0] if design == BALLOON else mesh.fixed.tolist()
    assert np.flatnonzero(still).tolist() == fixed
    assert 10 * state.xpos[1:] == pytest.approx(np.where(still, mesh.rest, mesh.position), abs=1e-7)
    bodies = model.flex_vertbodyid - 1
    corners = model.flex_elem.reshape(-1, 3)
    first = np.repeat(model.flex_vertadr, model.flex_elemnum)
    read = {tuple(map(int, bodies[t + start])) for t, start in zip(corners, first, strict=True)}
    assert read == {tuple(t) for group in mesh.bending for t in group.triangles.tolist()}
    assert model.opt.gravity.tolist() == [0, 0, 0]


def test_the_film_is_the_design_s(tmp_path: Path) -> None:
    """E t of a film (paper, Sec. 3.2.1), twice that where two are bonded, and their mass."""
    path = written(tmp_path, "1dof-5mm", "stack.balloons=2", "films.tpe.thickness=0.05")
    told = {
        flex.attrib["name"]: next(flex.iter("elasticity")).attrib
        for flex in ET.parse(path).getroot().iter("flex")
    }
    stretch = {name: float(e["young"]) * float(e["thickness"]) for name, e in told.items()}
    assert stretch == pytest.approx({"lower": 500, "upper": 500, "web": 1000, "necks": 1000})
    assert {(e["poisson"], e["elastic2d"]) for e in told.values()} == {("0.2", "both")}
    # Of a balloon: two octagons round the plate, less what is held at its centre.
    model = mujoco.MjModel.from_xml_path(str(written(tmp_path, *BALLOON)))
    octagon = 4 * math.sin(math.tau / 8) * 0.038 * 1122e-9
    assert model.body_mass.sum() == pytest.approx(octagon * (2 * 3.25**2 - 0.5**2 / 3), rel=1e-6)


def test_films_in_contact_have_the_memory_that_they_take(tmp_path: Path) -> None:
    """MuJoCo's own count: 320 MB for four balloons, and that of a lone chamber is left to it."""
    design = sbafab.build("3dof-15mm", "stack.balloons=4")
    export(design, SimulationRequest(chambers={"chamber1": 20.0}), tmp_path)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "actuator.xml"))
    assert 2 * 320e6 < 1.1 * model.narena < 4 * 320e6
    assert "<size" not in written(tmp_path, *BALLOON).read_text()


def test_a_run_says_what_mujoco_said_of_it() -> None:
    words = "mujoco.FatalError: mj_stackAlloc: out of memory, stack overflow at mj_ipc, line 1130"
    log = f"Traceback (most recent call last):\n{words}\n  max = 13\n  nefc = 0, ncon = 0\n"
    assert of_mujoco.read_log(log) == (words, None)


# Runs.


@pytest.mark.parametrize(("sectors", "within"), [(8, 0.15), (16, 0.08)])
@pytest.mark.parametrize("pressure", few(CALCULIX, 1))
def test_one_balloon_rises_as_in_calculix(pressure: float, sectors: int, within: float) -> None:
    found = inflated((pressure,), BALLOON, sectors, 3)
    assert found.last.stroke == pytest.approx(CALCULIX[pressure], rel=within)
    assert found.tip is not None
    assert found.tip[:2] == pytest.approx((0, 0), abs=1e-3)
    assert found.tilt == pytest.approx(0, abs=0.1)
    assert found.figures["drift"] < 1e-3
    assert found.figures["rate"] > 0
    assert [state.time for state in found.states] == pytest.approx([0.1 * i for i in range(31)])


def test_the_actuator_bends_away_from_the_chamber_that_is_inflated() -> None:
    """Chamber 1 lies along +x: its side grows, so that the tip goes to -x and leans there."""
    found = inflated((5.0, 0.0, 0.0), LOBED, 8, 2.5)
    assert found.tip is not None
    assert found.tilt is not None
    x, y, z = found.tip
    assert x < -0.03
    assert y == pytest.approx(0, abs=0.05)
    assert z > 0.5
    assert 10 < found.tilt < 60
    assert found.volumes["chamber1"] > 1.5 * found.volumes["chamber2"]
    assert found.volumes["chamber2"] == pytest.approx(found.volumes["chamber3"], rel=0.02)


def test_films_of_a_chamber_at_rest_touch_and_do_not_pass_through_each_other(
    tmp_path: Path,
) -> None:
    """Without MuJoCo's contact of films, which the model asks for, they do."""
    request = SimulationRequest(chambers={"chamber1": 5.0}, seconds=2)
    films = export(sbafab.build(*LOBED), request, tmp_path, 8)
    touching = inflate(films, request, tmp_path, ignore_progress).figures["overlap"]
    assert touching < 0.02
    model = tmp_path / "actuator.xml"
    model.write_text(model.read_text().replace('ipc="enable"', 'contact="disable"'))
    apart = inflate(films, request, tmp_path, ignore_progress).figures["overlap"]
    assert apart > 10 * touching + 0.1


def spoil(folder: Path, file: str, before: str, after: str) -> None:
    path = folder / file
    assert before in path.read_text()
    path.write_text(path.read_text().replace(before, after))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        # An explicit integrator cannot do steps of 0.01 s.
        (("actuator.xml", 'integrator="discrete"', 'integrator="Euler"'), "unstable|finite"),
        (("actuator.json", '"chamber1":5.0', '"chamber1":NaN'), "a force is not finite"),
        (("actuator.xml", "<worldbody>", "<flux /><worldbody>"), "flux"),
    ],
)
def test_a_run_that_goes_wrong_is_not_believed(
    tmp_path: Path, change: tuple[str, str, str], words: str
) -> None:
    request = SimulationRequest(seconds=2)
    films = export(sbafab.build(*BALLOON), request, tmp_path, 8)
    spoil(tmp_path, *change)
    with pytest.raises(OutputError, match=rf"ended prematurely: its log says .*({words})"):
        inflate(films, request, tmp_path, ignore_progress)


def test_without_a_fitting_mujoco_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask = sbafab.build(*BALLOON), SimulationRequest(), tmp_path, ignore_progress
    monkeypatch.setattr(of_mujoco, "version", lambda name: "3.17.0")
    with pytest.raises(OutputError, match=r"mujoco 3\.17\.0 stretches films with a quarter"):
        run(*ask)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(OutputError, match=r'pip install "sbafab\[mujoco\]"'):
        run(*ask)


def test_a_name_with_two_hyphens_is_no_end_of_a_comment(tmp_path: Path) -> None:
    path = written(tmp_path, *BALLOON, "name=a--b")
    assert mujoco.MjModel.from_xml_path(str(path)).nflex == 3


def test_the_script_says_the_same(tmp_path: Path) -> None:
    written(tmp_path, *BALLOON, pressure=6)
    command = [sys.executable, "inflate.py", "--seconds=3"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    words = done.stdout.splitlines()[-1].split()
    assert words[:3] == ["3.00", "s", "tip"]
    found = inflated((6.0,), BALLOON, 8, 3)
    assert float(words[5]) == pytest.approx(found.last.stroke, abs=2e-3)
    assert float(words[-2]) == pytest.approx(found.volumes["chamber1"], abs=2e-2)


def test_it_is_one_of_the_simulators(tmp_path: Path) -> None:
    laminate = sbafab.build(*BALLOON)
    assert why_not(laminate) is None
    assert "lie on a sheet" in (why_not(sbafab.build("radial-15mm")) or "")
    found = run(laminate, SimulationRequest(6.0, seconds=2.0), tmp_path, ignore_progress)
    assert {file.name for file in tmp_path.iterdir()} == {
        "actuator.xml",
        "actuator.json",
        "inflate.py",
    }
    rows = {name: value for name, value, _ in found.rows}
    assert rows["air chamber1"] == found.volumes["chamber1"]
    found.model_dump_json()


def test_a_balloon_holds_less_than_a_mylar_balloon_that_stretches() -> None:
    """1.2185 l^3 = 19.04 ul at l = 2.5, if it folds freely; films of 6 kPa stretch by some 3 %."""
    (volume,) = inflated((6.0,), BALLOON, 16, 3).volumes.values()
    assert 0.6 * 19.04 < volume < 19.04 * 1.03**3


def test_a_stack_rises_more_than_a_balloon() -> None:
    one = inflated((6.0,), BALLOON, 8, 3).last.stroke
    stack = inflated((6.0,), ("1dof-5mm", "stack.balloons=3"), 8, 3)
    assert 2 * one < stack.last.stroke < 4 * one
