"""Balloons that MuJoCo inflates."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

import sbafab
from sbafab.errors import DesignError, OutputError
from sbafab.simulators.mujoco.model import write_model
from sbafab.simulators.mujoco.run import USES, MujocoRun, export, run, run_model, simulate, why_not
from sbafab.simulators.simulator import SimulationRequest, drift
from tests.quick import few

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")

BALLOON = ("1dof-5mm", "stack.balloons=1")
CALCULIX = {0.95: 0.866, 6.0: 1.557}
"""Stroke in mm by kPa of one balloon, CalculiX 2.20, axisymmetric elements of second order."""


@cache
def inflated(
    pressures: tuple[float, ...], design: tuple[str, ...], sectors: int, seconds: float
) -> MujocoRun:
    laminate = sbafab.build(*design)
    names = [chamber.name for chamber in laminate.chambers]
    told = dict(zip(names, pressures, strict=True))
    with TemporaryDirectory() as folder:
        return simulate(laminate, Path(folder), told, seconds, sectors=sectors)


@pytest.mark.parametrize(("sectors", "within"), [(8, 0.15), (16, 0.08)])
@pytest.mark.parametrize("pressure", few(CALCULIX, 1))
def test_one_balloon_rises_as_in_calculix(pressure: float, sectors: int, within: float) -> None:
    found = inflated((pressure,), BALLOON, sectors, 3)
    assert found.last.stroke == pytest.approx(CALCULIX[pressure], rel=within)
    assert found.last.tip[:2] == pytest.approx((0, 0), abs=1e-3)
    assert found.last.tilt == pytest.approx(0, abs=0.1)
    assert drift(found.states) < 1e-3


def test_a_balloon_holds_less_than_a_mylar_balloon_that_stretches() -> None:
    """1.2185 l^3 = 19.04 ul at l = 2.5, if it folds freely; films of 6 kPa stretch by some 3 %."""
    (volume,) = inflated((6.0,), BALLOON, 16, 3).last.volumes.values()
    assert 0.6 * 19.04 < volume < 19.04 * 1.03**3


def test_more_pressure_lifts_more_and_a_stack_more_than_a_balloon() -> None:
    low, high = (inflated((p,), BALLOON, 8, 3).last.stroke for p in CALCULIX)
    assert low < high
    stack = inflated((6.0,), ("1dof-5mm", "stack.balloons=3"), 8, 3)
    assert 2 * high < stack.last.stroke < 4 * high


def test_the_actuator_bends_away_from_the_chamber_that_is_inflated() -> None:
    """Chamber 1 lies along +x: its side grows, so that the tip goes to -x and leans there."""
    found = inflated((5.0, 0.0, 0.0), ("3dof-15mm", "stack.balloons=2"), 8, 2.5)
    x, y, z = found.last.tip
    assert x < -0.03
    assert y == pytest.approx(0, abs=0.05)
    assert z > 0.5
    assert 10 < found.last.tilt < 60
    volumes = found.last.volumes
    assert volumes["chamber1"] > 1.5 * volumes["chamber2"]
    assert volumes["chamber2"] == pytest.approx(volumes["chamber3"], rel=0.02)


def test_films_of_a_chamber_at_rest_touch_and_do_not_pass_through_each_other(
    tmp_path: Path,
) -> None:
    """Without MuJoCo's contact of films, which the model asks for, they do."""
    bent = sbafab.build("3dof-15mm", "stack.balloons=3")
    touching = simulate(bent, tmp_path, {"chamber1": 5.0}, 2, sectors=8)
    assert touching.overlap < 0.02
    model = tmp_path / "actuator.xml"
    model.write_text(model.read_text().replace('ipc="enable"', 'contact="disable"'))
    assert run_model(tmp_path, 2).overlap > 10 * touching.overlap + 0.1


def test_the_script_says_the_same(tmp_path: Path) -> None:
    write_model(sbafab.build(*BALLOON), tmp_path, {"chamber1": 6}, 8)
    command = [sys.executable, "inflate.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    words = done.stdout.splitlines()[-1].split()
    assert words[:3] == ["5.00", "s", "tip"]
    found = inflated((6.0,), BALLOON, 8, 3)
    assert float(words[5]) == pytest.approx(found.last.tip[2], abs=2e-3)
    assert float(words[-2]) == pytest.approx(found.last.volumes["chamber1"], abs=2e-2)


def test_progress_is_told_and_time_recorded(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    found = simulate(sbafab.build(*BALLOON), tmp_path, None, 2, lambda *step: told.append(step))
    assert told[0] == ("mujoco", 10, 200)
    assert told[-1] == ("mujoco", 200, 200)
    assert [state.time for state in found.states] == pytest.approx([0.1 * i for i in range(21)])
    assert found.steps == 200
    assert found.rate > 0


def test_as_one_of_the_simulators(tmp_path: Path) -> None:
    laminate = sbafab.build(*BALLOON)
    assert why_not(laminate) is None
    assert USES == ("seconds",)
    export(laminate, SimulationRequest(3.0), tmp_path)
    assert json.loads((tmp_path / "actuator.json").read_text())["pressures"] == {"chamber1": 3}
    found = run(laminate, SimulationRequest(6.0, seconds=3.0), tmp_path, lambda *_: None)
    rows = {name: value for name, value, _ in found.rows}
    assert rows["tip z"] == pytest.approx(inflated((6.0,), BALLOON, 16, 3).last.stroke, abs=1e-9)
    assert rows["air chamber1"] == pytest.approx(found.volumes["chamber1"])
    json.dumps(found.as_dict())


def test_an_unstable_run_is_not_believed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An explicit integrator cannot do steps of 0.01 s; no log of MuJoCo is left behind."""
    monkeypatch.chdir(tmp_path)
    model, *_ = write_model(sbafab.build(*BALLOON), tmp_path / "run")
    model.write_text(model.read_text().replace('integrator="discrete"', 'integrator="Euler"'))
    with pytest.raises(OutputError, match=r"did not run to its end: MuJoCo says .*known to 0 s"):
        run_model(tmp_path / "run", 2)
    assert [file.name for file in tmp_path.iterdir()] == ["run"]


def test_a_pressure_that_is_no_number_is_not_believed(tmp_path: Path) -> None:
    write_model(sbafab.build(*BALLOON), tmp_path)
    data = tmp_path / "actuator.json"
    told = json.loads(data.read_text()) | {"pressures": {"chamber1": float("nan")}}
    data.write_text(json.dumps(told))
    with pytest.raises(
        OutputError, match="a force or a place is no finite number; the tip is known to 0 s"
    ):
        run_model(tmp_path, 2)


def test_a_model_that_does_not_load_is_named(tmp_path: Path) -> None:
    model, *_ = write_model(sbafab.build(*BALLOON), tmp_path)
    model.write_text("<mujoco><flux/></mujoco>")
    with pytest.raises(OutputError, match=r"actuator\.xml does not load in MuJoCo: .*flux"):
        run_model(tmp_path, 2)


def test_a_run_that_takes_too_long_keeps_what_it_has_reached(tmp_path: Path) -> None:
    found = simulate(sbafab.build(*BALLOON), tmp_path, limit=0.0)
    assert found.steps == 1
    assert len(found.states) == 2
    assert found.stopped is not None
    assert "it was stopped after 0 minutes; what it reached is kept" in found.stopped


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), 1e9])
def test_times_out_of_range_are_refused(tmp_path: Path, seconds: float) -> None:
    with pytest.raises(DesignError, match="simulated time"):
        simulate(sbafab.build(*BALLOON), tmp_path, seconds=seconds)


def test_without_mujoco_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(OutputError, match=r'pip install "sbafab\[mujoco\]"'):
        simulate(sbafab.build(*BALLOON), tmp_path)


def test_a_mujoco_that_stretches_too_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mujoco, "__version__", "3.17.0")
    with pytest.raises(OutputError, match=r"mujoco 3\.17\.0 stretches films with a quarter"):
        simulate(sbafab.build(*BALLOON), tmp_path)
