"""Runs of the real ccx, where it is installed, and of programs that stand in for it."""

from __future__ import annotations

import json
import re
import shutil
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from docs.scripts.axisymmetric import axisymmetric_strokes
from sbafab.actuators import build, load_design
from sbafab.cli import app
from sbafab.errors import OutputError, VoidError
from sbafab.meshing.conforming.layup import MeshSettings
from sbafab.simulators.calculix import (
    DeckSettings,
    deck_mesh,
    run_ccx,
    simulate,
)
from sbafab.simulators.simulator import Result
from tests.simulators.conftest import StandIn
from tests.site.formats import hold

pytest.importorskip("netgen")
needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx is not installed")

# CAX8R, 133 nodes, of the paper's balloon: pocket 5, ring 0.75, films 0.038, E 10 MPa, nu 0.2.
ORACLE = {0.95: 0.867, 6.0: 1.559}


def inflated(folder: Path, settings: DeckSettings, h: float, minutes: float = 5) -> Result:
    """A quarter of the paper's balloon."""
    laminate = build(load_design("1dof-5mm", ("stack.balloons=1",)))
    mesh = MeshSettings(h=h, symmetry="quarter")
    return simulate(laminate, mesh, settings, folder, 60 * minutes, lambda what, done, total: None)


@needs_ccx
@pytest.mark.long
def test_the_balloon_in_3d_before_it_wrinkles(tmp_path: Path) -> None:
    settings = DeckSettings({"chamber1": 0.95}, "static", outputs=8)
    found = inflated(tmp_path, settings, 0.5)
    assert found.stopped is None
    last = found.states[-1]
    assert last.pressures == pytest.approx({"chamber1": 0.95})
    assert last.stroke == pytest.approx(ORACLE[0.95], rel=0.04)
    # A parabola pair of this height (paper Eqs. 1 to 3) over the drawn-in radius holds 8 ul.
    assert last.volumes["chamber1"] == pytest.approx(8.2, rel=0.1)
    # What the air has done, the films of four quarters store, as ccx says, but for what is damped.
    stored = re.findall(r"internal energy.*\n\n +(\S+)", (tmp_path / "actuator.dat").read_text())
    assert last.work == pytest.approx(4 * 1000 * float(stored[-1]), rel=0.05)


@needs_ccx
def test_simulate_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ["simulate", "1dof-5mm", "--set", "stack.balloons=1", "--with", "calculix"]
    arguments += ["--symmetry", "quarter", "--h", "0.75", "--pressure", "5 mbar"]
    arguments += ["--procedure", "static", "--json", "-o", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    hold("simulate", told)
    assert told["stopped"] is None
    assert told["states"][-1]["pressures"] == told["pressures"] == {"chamber1": 0.5}
    assert told["height"] == pytest.approx(told["tip"][2] + 0.076, abs=1e-3)
    folder = tmp_path / "1dof-5mm"
    made = {path.name for path in (folder / "calculix").iterdir()}
    assert made == {
        *(f"actuator.{suffix}" for suffix in ("inp", "frd", "sta", "dat")),
        "history.csv",
        "deformed.vtu",
        "mesh.inp",
        "abaqus.inp",
        "result.json",
    }
    listed = json.loads((folder / "manifest.json").read_text())["files"]
    assert {f"calculix/{name}" for name in made} <= set(listed)


GIVES_UP = """
import re
nodes = re.search(r"NSET=all_nodes.(.*?).[*]ELEMENT", open("mesh.inp").read(), re.S)[1]
heights = [float(line.split(",")[3]) for line in nodes.split("\\n") if line.count(",") == 3]
count = len(heights)
def block(time, name, size):
    values = [f"{time * height:12.5E}" * size for height in heights]
    rows = "".join(f" -1{node:10d}{value}\\n" for node, value in enumerate(values, 1))
    parts = "".join(f" -5  {n}\\n" for n in range(size))
    head = f"  100CL  101{time:12.5E}{count:12d}   0    1   1\\n -4  {name}  {size}\\n"
    return head + parts + rows + " -3\\n"
times = 0.25, 0.5, 0.6
with open("actuator.frd", "w") as frd:
    frd.write("    1C\\n    1UDATE   21.november.2026\\n")
    frd.writelines(block(time, "DISP", 3) + block(time, "STRESS", 6) for time in times)
with open("actuator.sta", "w") as sta:
    sta.write("head\\nhead\\n 1 1 1 8 0.25 0.25 0.25\\n 1 2 1 8 0.5 0.5 0.25\\n")
    sta.write(" 1 3 1 2 0.55 0.55 0.05\\n 1 4 1U 8 0.6 0.6 0.05\\n")
print("*ERROR: increment size smaller than minimum")
raise SystemExit(201)
"""


def test_a_run_that_gives_up_keeps_what_it_has(tmp_path: Path, stand_in: StandIn) -> None:
    stand_in("ccx", GIVES_UP)
    settings = DeckSettings({"chamber1": 8.0}, "static", outputs=4)
    found = inflated(tmp_path / "run", settings, 0.75)
    # A quarter of the pressure is on at half of the time; what came after 0.55 s did not converge.
    assert [state.pressures["chamber1"] for state in found.states] == pytest.approx([0, 0.5, 2])
    # Every node has moved by half its height: so have two films of 0.038 mm.
    assert found.states[-1].stroke == pytest.approx(0.038, rel=0.01)
    assert found.stopped == (
        "ccx stopped at 0.55 s, 2.5 of 8 kPa: its iterations no longer converge, however small "
        "the step; results up to 2 kPa are kept; take --procedure dynamic, which gets past wrinkles"
    )
    assert len((tmp_path / "run" / "history.csv").read_text().splitlines()) == 1 + 3
    assert b"november" not in (tmp_path / "run" / "actuator.frd").read_bytes()


def test_results_end_where_a_chamber_would_hold_less_than_no_air(
    tmp_path: Path, stand_in: StandIn
) -> None:
    """All heights shrink to a quarter, then turn over: so does what the pocket holds."""
    stand_in("ccx", GIVES_UP.replace("time * height", "-3 * time * height"))
    laminate = build(load_design("1dof-5mm", ("stack.balloons=1",)))
    mesh = MeshSettings(0.75, symmetry="quarter", gaps=True)
    settings = DeckSettings({"chamber1": 8.0}, outputs=4)
    found = simulate(laminate, mesh, settings, tmp_path / "run", 300, lambda *_: None)
    start, last = found.states
    assert last.volumes["chamber1"] == pytest.approx(start.volumes["chamber1"] / 4, rel=0.01)
    assert found.stopped is not None
    assert "beyond 0.5 kPa the result cannot be: chamber1 holds -" in found.stopped
    assert len((tmp_path / "run" / "history.csv").read_text().splitlines()) == 1 + 2
    # The first result itself.
    stand_in("ccx", GIVES_UP.replace("time * height", "-8 * time * height"))
    with pytest.raises(VoidError, match=r"at 0\.5 kPa, is impossible: chamber1 holds -"):
        simulate(laminate, mesh, settings, tmp_path / "void", 300, lambda *_: None)
    assert not (tmp_path / "void" / "history.csv").exists()
    stand_in("ccx", 'print("*ERROR in nothing: no memory left.")\nraise SystemExit(201)')
    with pytest.raises(OutputError, match="at 0 s, 0 of 8 kPa, before the first result: it repor"):
        simulate(laminate, mesh, settings, tmp_path / "none", 300, lambda *_: None)


def test_a_run_of_hours_is_warned_of_before_it(
    tmp_path: Path, stand_in: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Six balloons of three chambers have 127,618 nodes; ccx took 30.7 s for an iteration."""
    stand_in("ccx", 'print("*ERROR in nothing: no memory left.")')
    settings = DeckSettings({"chamber1": 6.0})
    small = build(load_design("1dof-5mm", ("stack.balloons=1",)))
    with warnings.catch_warnings(), pytest.raises(OutputError):
        warnings.simplefilter("error")
        simulate(small, MeshSettings(0.75), settings, tmp_path / "run", 60, lambda *_: None)
    mesh = deck_mesh(small, MeshSettings(0.75))
    large = replace(mesh, points=np.zeros((127_618 * 3, 3)))
    monkeypatch.setattr("sbafab.simulators.calculix.deck_mesh", lambda *_: large)
    monkeypatch.setattr("sbafab.simulators.calculix.write_deck", lambda *_: None)
    monkeypatch.setattr("sbafab.simulators.calculix.started", lambda *_: large)
    with pytest.warns(UserWarning, match="not end in an hour") as told, pytest.raises(OutputError):
        simulate(small, MeshSettings(0.75), settings, tmp_path / "run", 60, lambda *_: None)
    (hours,) = re.findall(r"take (\S+) hours, right within", str(told[0].message))
    # Three times as many equations take 3 to 9 times as long: a band of a matrix is solved in
    # proportion to its width, a whole one at worst with the square of the number.
    assert 3 * 30.7 * 100 / 3600 < float(hours) < 9 * 30.7 * 100 / 3600


HALF_WAY = """
open("job.sta", "w").write("head\\nhead\\n 1 1 1 8 0.5 0.5 0.5\\n")
"""


@pytest.mark.parametrize(
    ("says", "code", "reason"),
    [
        ("*ERROR: increment size smaller than minimum", 201, "no longer converge"),
        ("*ERROR in calinput: no material was found.", 201, "it reports: no material was found"),
        ("", 11, "it ended with code 11"),
        ("Job finished", 0, "it ended with code 0"),
        ("divergence; the increment is cut back. Job finished", 0, "None"),
    ],
)
def test_what_ended_a_run(
    tmp_path: Path, stand_in: StandIn, says: str, code: int, reason: str
) -> None:
    stand_in("ccx", f"{HALF_WAY}\nprint({says!r})\nraise SystemExit({code})")
    # A step that is tried again is no failure where the end is reached.
    reached, stopped = run_ccx(tmp_path, "job", 0.5 if reason == "None" else 1.0, 30.0)
    assert reached == 0.5
    assert reason in str(stopped)


@needs_ccx
def test_a_run_that_diverges() -> None:
    # A film as soft as this thins faster than its curvature grows: it bursts.
    with pytest.raises(OutputError, match="kPa: its iterations no longer converge"):
        axisymmetric_strokes([6.0, 3000.0])


def test_a_run_that_takes_too_long_is_stopped(tmp_path: Path, stand_in: StandIn) -> None:
    stand_in("ccx", f"{HALF_WAY}\nimport time\ntime.sleep(600)")
    told: list[float] = []
    ending = run_ccx(tmp_path, "job", 1.0, 1.5, told.append)
    assert ending == (0.5, ("time", "it was stopped after 0.025 minutes"))
    assert told[-1] == 0.5
