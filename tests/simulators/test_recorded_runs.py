"""Runs of models whose nodes are recorded: a script does what runSofa has been seen to do."""

from __future__ import annotations

import math
import os
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import sbafab
from sbafab.errors import OutputError, VoidError
from sbafab.laminate.laminate import Laminate
from sbafab.runtime import ignore_progress
from sbafab.simulators.shell_model import nearly_flat
from sbafab.simulators.simulator import (
    Result,
    SimulationRequest,
    State,
    impossible,
    overlap,
    read_nodes,
    run_program,
    tilt_of,
)
from sbafab.simulators.sofa import read_log, run, scenes_of
from tests.simulators.conftest import StandIn

SOFA = """
import math, os, re, sys, time
text = open("recorded.scn").read()
flat = [float(word) for word in re.search('rest_position="([^"]*)"', text)[1].split()]
places = [flat[i : i + 3] for i in range(0, len(flat), 3)]
def write(time, rise, lean=0.0, whole=True):
    with open("nodes.state", "a") as file:
        numbers = " ".join(f"{x} {y} {z + rise + lean * x}" for x, y, z in places)
        file.write(f"T= {time}\\n  X= {numbers}" + "\\n" * whole)
        file.flush()
"""
DONE = "print('[INFO]    [BatchGUI] 11 iterations done in 0.1875 s ( 58.6667 FPS).')\n"
GOOD = f"{SOFA}\nfor t, rise in ((0, 1), (0.1, 1.5), (0.2, 2)): write(t, rise)\n{DONE}"


@cache
def laminate() -> Laminate:
    return sbafab.build("1dof-5mm", "stack.balloons=1")


def ran(tmp_path: Path, scene: str = "shell", minutes: float = 1.0) -> Result:
    request = SimulationRequest(5.0, scene=scene, seconds=0.2, minutes=minutes)
    return run(laminate(), request, tmp_path / "sofa", ignore_progress)


def test_a_good_run_is_read_back(tmp_path: Path, stand_in: StandIn) -> None:
    stand_in("runSofa", f"{GOOD}open('arguments', 'w').write(' '.join(sys.argv[1:]))")
    told: list[tuple[str, int, int]] = []
    request = SimulationRequest(5.0, seconds=0.2)
    done = run(laminate(), request, tmp_path / "sofa", lambda *news: told.append(news))
    assert [state.time for state in done.states] == [0, 0.1, 0.2]
    assert done.tip == pytest.approx((0, 0, 2), abs=1e-9)
    assert done.tilt == pytest.approx(0, abs=1e-6)
    # Two films of 0.038 mm; a fifth of the second is over in which the pressure rises.
    assert done.height == pytest.approx(2.076)
    assert done.pressures == pytest.approx({"chamber1": 1.0})
    assert done.figures == pytest.approx({"drift": 1.0, "overlap": 0.0, "rate": 58.6667})
    assert told[-1] == ("runSofa", 2, 2)
    assert (tmp_path / "sofa" / "arguments").read_text() == "-g batch -n 11 recorded.scn"
    left = {path.name for path in (tmp_path / "sofa").iterdir()}
    assert {"actuator.scn", "runSofa.log"} < left
    assert not left & {"recorded.scn", "nodes.state"}


VOID = {
    "[ERROR]   [SparseLDLSolver(SparseLDLSolver1)] Invalid Linear System": "its log says",
    "Null determinant": "its log says .Null determinant",
    "residual = -nan": "its log says",
    '[ERROR] [PluginManager] Plugin not found: \\"Sofa.Component.Mass\\"': "Plugin not found",
}


@pytest.mark.parametrize(("line", "words"), VOID.items())
def test_trouble_in_the_log_voids_a_run_that_ended_with_0(
    tmp_path: Path, stand_in: StandIn, line: str, words: str
) -> None:
    stand_in("runSofa", f'{GOOD}print("{line}")')
    with pytest.raises(VoidError, match=f"{words}.*; the tip is known to 0.2 s"):
        ran(tmp_path)


@pytest.mark.parametrize(
    ("last", "words"),
    [
        ("write(0.2, 0)", "its result is impossible: the tip lies at 0, 0, 0"),
        ("write(0.2, 0.005)", "its result is impossible: .*the tip has not risen"),
        ("write(0.2, 7)", r"7\.000 mm high, and the films reach 6\.5 mm at most"),
        ("write(0.2, 2, 0.05)", r"the tip leans by 2\.9 degrees \(more than 1\)"),
        ("write(0.2, math.nan)", "not finite from there on; the tip is known to 0.1 s"),
        ("write(0.2, 2, whole=False)", "its record ends before 0.3 s"),
        ("sys.exit(3)", "exit code 3"),
        ("os.kill(os.getpid(), 9)", r"signal 9 \(SIGKILL\); the tip is known to 0\.1 s"),
        ("os.remove('nodes.state')", "no place of a node into nodes.state; nothing is known"),
    ],
)
def test_what_cannot_be_voids_a_run_whose_log_is_clean(
    tmp_path: Path, stand_in: StandIn, last: str, words: str
) -> None:
    stand_in("runSofa", f"{SOFA}\nwrite(0, 1)\nwrite(0.1, 1.5)\n{last}\n{DONE}")
    with pytest.raises(VoidError, match=words):
        # Half a recorded interval may be missing at the end, but not a whole one.
        request = SimulationRequest(5.0, seconds=0.3)
        run(laminate(), request, tmp_path / "sofa", ignore_progress)


def test_what_runs_below_a_program_is_ended_with_it(tmp_path: Path, stand_in: StandIn) -> None:
    child = "subprocess.Popen(['sleep', '60'])"
    stand_in(
        "runSofa",
        f"import subprocess, time\nmade = {child}\n"
        "open('child', 'w').write(str(made.pid))\ntime.sleep(60)",
    )
    with pytest.raises(OutputError, match=r"it was stopped after 0\.01 minutes"):
        ran(tmp_path, minutes=0.01)
    process = int((tmp_path / "sofa" / "child").read_text(encoding="utf-8"))
    for _ in range(50):
        state = Path(f"/proc/{process}/stat")
        if not state.exists() or state.read_text().split()[2] == "Z":
            break
        time.sleep(0.05)
    else:
        os.kill(process, 9)
        pytest.fail("the program's own child still runs")


def test_a_program_that_is_missing_or_cannot_start_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(OutputError, match=r"install SOFA 25\.06"):
        ran(tmp_path)
    with pytest.raises(OutputError, match="nowhere could not be started"):
        run_program([str(tmp_path / "nowhere")], tmp_path / "log", 1.0, lambda: None)


# What is read and judged.


def test_a_record_cut_short_keeps_what_is_whole(tmp_path: Path) -> None:
    record = "T= 0\n  X= 1 0 4 0 1 4 -1 -1 4\nT= 0.1\n  X= 1 0 4.5 0 1 4.5 -1 -1 4.5\n"
    path = tmp_path / "nodes.state"
    for end in range(len(record) + 1):
        path.write_text(record[:end], encoding="utf-8")
        assert [time for time, _ in read_nodes(path)] == [0, 0.1][: record[:end].count("\n") // 2]
    path.write_text("T= 0\n  X= 1 2 3\n")
    assert read_nodes(path) == []


def test_air_is_that_of_the_recorded_films() -> None:
    """At the start a balloon is the paper's parabola; rings of 12 have the area of its circles."""
    films = scenes_of(laminate(), {"chamber1": 5.0})["shell"].films
    state = films.state(0.5, films.shell.position)
    balloon = nearly_flat(2.5, 1.25)
    assert state.volumes["chamber1"] == pytest.approx(balloon.volume, rel=0.05)
    assert state.pressures == {"chamber1": 2.5}
    assert films.figures([state], films.shell.position)["overlap"] == 0
    # Upside down, all the air is where films have passed through each other.
    lowered = films.shell.position * [1, 1, -1]
    passed = films.figures([state], lowered)["overlap"]
    assert passed == pytest.approx(balloon.volume, rel=0.1)


def test_what_a_laminate_cannot_do_is_told() -> None:
    """Two balloons of two films, each 2.5 mm from axis to edge, stretched by 30 %: 13 mm; with the
    inlet's strip the lower pocket is a little wider. Unlike chambers may lean, and a tip hang.
    """
    two = sbafab.build("3dof-15mm", "stack.balloons=2")
    unlike = (5.0, 0.0, 0.0)
    state = State(
        time=1.0,
        pressures={"chamber1": 5.0},
        height=0.1,
        tip=(-5.0, 0.0, -1.0),
        tilt=100.0,
        volumes={"chamber2": 1.0},
    )
    for change, passed, words in (
        ({}, 0.19, None),
        ({}, 0.21, "passed through each other in 0.21 ul"),
        ({"tip": (0.0, 0.0, 13.0)}, 0.0, None),
        ({"tip": (0.0, 0.0, 16.0)}, 0.0, "16.000 mm high"),
        ({"tilt": math.nan}, 0.0, "not finite"),
        ({"volumes": {"chamber3": -62.046}}, 0.0, "chamber3 holds -62 ul of air, less than none"),
    ):
        told = impossible(two, state.model_copy(update=change), unlike, passed)
        assert (told is None) if words is None else (words in str(told))
    high = state.model_copy(update={"tip": (0.0, 0.0, 99.0)})
    assert impossible(sbafab.build("radial-15mm"), high, (5.0,)) is None


def test_films_in_each_other_are_measured_along_their_normal() -> None:
    """Two films of two triangles, the upper one facing down, turned by 60 degrees together."""
    square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], dtype=float)
    flat = np.concatenate([square, square])
    start = flat + np.repeat([[0, 0, 0], [0, 0, 1]], 4, axis=0)
    films = np.array([[0, 1, 2], [0, 2, 3], [6, 5, 4], [7, 6, 4]])
    half, tall = 0.5, 3**0.5 / 2
    turn = np.array([[half, 0, -tall], [0, 1, 0], [tall, 0, half]])
    # A square of 2 mm, so deep in the other.
    for apart, volume in ((0.4, 0.0), (-0.3, 4 * 0.3)):
        end = (flat + np.repeat([[0, 0, 0], [0, 0, apart]], 4, axis=0)) @ turn.T
        assert overlap(end, flat, start, films) == pytest.approx(volume)


def test_a_run_that_takes_too_long_keeps_what_it_has_reached(
    tmp_path: Path, stand_in: StandIn
) -> None:
    stand_in("runSofa", f"{SOFA}\nwrite(0, 1)\nwrite(0.1, 1.5)\ntime.sleep(60)")
    found = ran(tmp_path, minutes=0.02)
    assert found.last.time == pytest.approx(0.1)
    assert "ran to 0.1 of 0.2 s: it was stopped after 0.02 minutes" in str(found.stopped)


def test_each_scene_is_run_with_its_own_step(tmp_path: Path, stand_in: StandIn) -> None:
    stand_in("runSofa", f"{GOOD}open('arguments', 'w').write(' '.join(sys.argv[1:]))")
    ran(tmp_path, "frames")
    assert (tmp_path / "sofa" / "arguments").read_text() == "-g batch -n 5 recorded.scn"


def test_other_words_of_a_log_and_other_plugins_void_nothing() -> None:
    assert read_log("nanometre and banana\n", []) == (None, None)
    missing = '[ERROR] [PluginManager] Plugin not found: "SofaOpenGL"'
    assert read_log(missing, ["Sofa.Component.Mass"]) == (None, None)


def test_tilt_is_the_angle_that_a_plane_has_turned_past_a_right_angle_too() -> None:
    # The corners of two stacks by two, row by row, so that their own order would cross itself.
    flat = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [4, 4, 0.0]])
    for degrees in (0.0, 30.0, 90.0, 135.0):
        turn = np.radians(degrees)
        cos, sin = np.cos(turn), np.sin(turn)
        turned = flat @ np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]]).T
        assert tilt_of(flat, turned + 3) == pytest.approx(degrees, abs=1e-9)
    assert tilt_of(flat[:2], flat[:2]) is None
