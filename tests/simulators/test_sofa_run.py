"""Running scenes: a script stands in for runSofa and does what runSofa has been seen to do."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import sbafab
from sbafab.errors import DesignError, OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.simulators.coarse.shell import nearly_flat
from sbafab.simulators.simulator import State, drift, impossible, limits, overlap, tilt_of
from sbafab.simulators.sofa.run import (
    RecordedFilms,
    SofaJob,
    SofaRun,
    read_log,
    read_points,
    run_scene,
    simulate,
)
from sbafab.simulators.sofa.scenes import write_scenes
from sbafab.simulators.sofa.shell import round_actuator, round_shell

HALF_TURN = "T= 0.3\n  X= 0 0 5 0 1 5 0 0 6\n"
"""Three points whose plane has the normal (1, 0, 0)."""
RECORD = (
    "T= 0\n  X= 1 0 4 0 1 4 -1 -1 4\nT= 0.1\n  X= 1 0 4.5 0 1 4.5 -1 -1 4.5\n"
    "T= 0.2\n  X= 1 0 5 0 1 5 -1 -1 5\n"
)
DONE = "[INFO]    [BatchGUI] 11 iterations done in 0.1875 s ( 58.6667 FPS)."
BRIEF = SofaJob(seconds=0.2)
Fake = Callable[[str], None]


@cache
def laminate() -> Laminate:
    return sbafab.build("1dof-5mm", "stack.balloons=1")


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Fake:
    """Puts a runSofa with this body on PATH."""

    def put(body: str) -> None:
        program = tmp_path / "bin" / "runSofa"
        program.parent.mkdir(exist_ok=True)
        program.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
        program.chmod(0o755)
        monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")

    return put


def writing(record: str, said: str = DONE) -> str:
    return f"cat > tip.state <<'END'\n{record}END\necho '{said}'\necho \"$@\" > arguments"


def run(tmp_path: Path, job: SofaJob = BRIEF) -> SofaRun:
    return simulate(laminate(), tmp_path / "sofa", {"chamber1": 5.0}, job)


def test_a_good_run_is_read_back(tmp_path: Path, fake: Fake) -> None:
    fake(writing(RECORD))
    told: list[tuple[str, int, int]] = []
    done = simulate(
        laminate(), tmp_path / "sofa", job=BRIEF, progress=lambda *news: told.append(news)
    )
    assert [state.time for state in done.states] == [0, 0.1, 0.2]
    assert done.states[1].tip == pytest.approx((0, 0, 4.5))
    assert done.states[1].tilt == pytest.approx(0)
    assert done.last.tip == pytest.approx((0, 0, 5))
    # Two films of 0.038 mm; a fifth of the second is over in which the pressure rises.
    assert done.last.height == pytest.approx(5.076)
    assert done.last.pressures == pytest.approx({"chamber1": 1.0})
    assert drift(done.states) == pytest.approx(1.0)
    assert (done.steps, done.seconds, done.rate) == (11, 0.1875, 58.6667)
    assert told[-1] == ("runSofa", 11, 11)
    arguments = (tmp_path / "sofa" / "arguments").read_text(encoding="utf-8").split()
    assert arguments == ["-g", "batch", "-n", "11", "recorded.scn"]


@pytest.mark.parametrize(
    "line",
    [
        "[ERROR]   [SparseLDLSolver(SparseLDLSolver1)] Invalid Linear System",
        "[WARNING] [TriangularFEMForceField] Division by zero",
        "Null determinant",
        "residual = -nan",
    ],
)
def test_trouble_in_the_log_voids_a_run_that_ended_with_0(
    tmp_path: Path, fake: Fake, line: str
) -> None:
    fake(writing(RECORD, f"{DONE}\n{line}"))
    with pytest.raises(OutputError) as failed:
        run(tmp_path)
    assert line in str(failed.value)
    assert "the tip is known to 0.2 s" in str(failed.value)


def test_a_plugin_that_the_scene_does_not_ask_for_may_be_missing(
    tmp_path: Path, fake: Fake
) -> None:
    missing = '[ERROR]   [PluginManager] Plugin not found: "{}"'
    fake(writing(RECORD, f"{missing.format('SofaOpenGL')}\n{DONE}"))
    assert run(tmp_path).last.time == pytest.approx(0.2)
    fake(writing(RECORD, f"{missing.format('Sofa.Component.Mass')}\n{DONE}"))
    with pytest.raises(OutputError, match=r"Plugin not found: .Sofa\.Component\.Mass"):
        run(tmp_path)


@pytest.mark.parametrize(
    ("last", "words"),
    [
        ("0 0 0 0 0 0 0 0 0", "the tip lies at 0, 0, 0"),
        ("1 1 0 0 2 0 -1 0 0", "the tip has not risen"),
        ("1 0 7 0 1 7 -1 -1 7", r"7\.000 mm high, and the films reach 6\.5 mm at most"),
        ("1 0 4 0 1 4 -1 -1 4.1", r"the tip leans by 2\.\d degrees \(more than 1\)"),
    ],
)
def test_what_cannot_be_voids_a_run_whose_log_is_clean(
    tmp_path: Path, fake: Fake, last: str, words: str
) -> None:
    fake(writing(RECORD.replace("1 0 5 0 1 5 -1 -1 5", last)))
    with pytest.raises(OutputError, match=f"its result cannot be: .*{words}"):
        run(tmp_path)


def test_unlike_chambers_may_lean_and_a_tip_may_hang_below_its_base() -> None:
    laminate = sbafab.build("3dof-15mm", "stack.balloons=2")
    limit = limits(laminate, (5.0, 0.0, 0.0))
    assert limit.highest is not None
    # Two balloons of two films, each 2.5 mm from axis to edge, stretched by 30 %; with the
    # inlet's strip the lower pocket is a little wider.
    assert 2 * 2 * 2.5 * 1.3 <= limit.highest < 1.2 * 2 * 2 * 2.5 * 1.3
    hanging = State(1.0, {"chamber1": 5.0}, 0.1, (-5.0, 0.0, -1.0), 100.0, {"chamber2": 0.0})
    assert impossible(hanging, limit) is None
    assert impossible(replace(hanging, tip=(0.0, 0.0, 16.0)), limit) is not None
    assert limits(sbafab.build("radial-15mm"), (5.0,)).highest is None


def test_negative_air_and_films_through_films_cannot_be() -> None:
    limit = limits(sbafab.build("3dof-15mm"), (5.0, 0.0, 0.0))
    state = State(1.0, {"chamber1": 5.0}, 6.0, (-5.0, 0.0, 5.0), 100.0, {"chamber3": -62.046})
    assert impossible(state, limit) == (
        "chamber3 holds -62 ul of air, less than none: its films have passed through each other"
    )
    whole = replace(state, volumes={"chamber3": 1.0})
    assert impossible(whole, limit, passed=0.19) is None
    assert "passed through each other in 0.21 ul" in str(impossible(whole, limit, passed=0.21))
    assert "no finite number" in str(impossible(replace(whole, tilt=math.nan), limit))


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


def test_air_is_that_of_the_recorded_films(tmp_path: Path) -> None:
    """At the start a balloon is the paper's parabola; rings of 12 have the area of its circles."""
    write_scenes(laminate(), tmp_path, {"chamber1": 5.0})
    films = RecordedFilms(tmp_path / "actuator.scn")
    shell = round_shell(round_actuator(laminate(), {"chamber1": 5.0}))
    tip = [shell.position[node] for node in shell.tip]
    state = films.state(laminate(), 0.5, tip, shell.position)
    balloon = nearly_flat(2.5, 1.25)
    assert state.volumes["chamber1"] == pytest.approx(balloon.volume, rel=0.05)
    assert state.pressures == {"chamber1": 2.5}
    assert films.overlap(shell.position) == 0
    # Upside down, all the air is where films have passed through each other.
    lowered = [(x, y, -z) for x, y, z in shell.position]
    assert films.overlap(lowered) == pytest.approx(balloon.volume, rel=0.1)
    assert "nodes.state" in films.recording()
    assert "nodes.state" not in (tmp_path / "actuator.scn").read_text()


def test_nan_in_the_record_voids_a_run(tmp_path: Path, fake: Fake) -> None:
    fake(writing(RECORD.replace("4.5 0 1 4.5", "nan 0 -nan 4.5")))
    with pytest.raises(OutputError, match=r"no finite number .* known to 0 s"):
        run(tmp_path)


@pytest.mark.parametrize("record", ["", "T= 0\n", "T= 0\n  X= 1 2 3\n"])
def test_a_record_without_a_place_is_a_failure(tmp_path: Path, fake: Fake, record: str) -> None:
    fake(writing(record))
    with pytest.raises(OutputError, match=r"no place of the tip into tip\.state; nothing is known"):
        run(tmp_path)


def test_no_record_is_a_failure_and_an_old_one_is_not_taken(tmp_path: Path, fake: Fake) -> None:
    fake(writing(RECORD))
    run(tmp_path)
    fake(f"echo '{DONE}'")
    with pytest.raises(OutputError, match="no place of the tip"):
        run(tmp_path)


def test_a_run_that_is_killed_says_by_what_and_how_far_it_came(tmp_path: Path, fake: Fake) -> None:
    fake(writing(RECORD) + "\nkill -9 $$")
    with pytest.raises(OutputError, match=r"signal 9 \(SIGKILL\); the tip is known to 0\.2 s"):
        run(tmp_path)


def test_an_exit_code_is_a_failure(tmp_path: Path, fake: Fake) -> None:
    fake(writing(RECORD) + "\nexit 3")
    with pytest.raises(OutputError, match="exit code 3"):
        run(tmp_path)


def test_a_run_that_takes_too_long_is_ended(tmp_path: Path, fake: Fake) -> None:
    fake("echo $$ > process\nexec sleep 60")
    with pytest.raises(OutputError, match=r"it was stopped after 0\.005 minutes"):
        run(tmp_path, SofaJob(seconds=0.2, limit=0.3))
    process = int((tmp_path / "sofa" / "process").read_text(encoding="utf-8"))
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


def test_progress_is_told_while_it_runs(tmp_path: Path, fake: Fake) -> None:
    fake(f"printf 'T= 0.1\\n  X= 1 0 4 0 1 4 -1 -1 4\\n' > tip.state\nsleep 0.4\n{writing(RECORD)}")
    told: list[int] = []
    simulate(
        laminate(), tmp_path / "sofa", job=BRIEF, progress=lambda _, done, of: told.append(done)
    )
    assert told[0] == 5
    assert told[-1] == 11


def test_a_missing_program_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(OutputError, match=r"install SOFA 25\.06"):
        run(tmp_path)


@pytest.mark.parametrize("seconds", [0.0, -1.0, math.nan, math.inf])
def test_times_that_cannot_be(tmp_path: Path, fake: Fake, seconds: float) -> None:
    fake(writing(RECORD))
    with pytest.raises(DesignError, match="simulated time"):
        run(tmp_path, SofaJob(seconds=seconds))


def test_a_single_chamber_has_no_beam(tmp_path: Path, fake: Fake) -> None:
    fake(writing(RECORD))
    with pytest.raises(DesignError, match="scene beam needs three chambers or more"):
        run(tmp_path, SofaJob("beam", 0.2))


def test_each_scene_is_run_with_its_own_step(tmp_path: Path, fake: Fake) -> None:
    fake(writing(RECORD))
    run(tmp_path, SofaJob("frames", 0.2))
    arguments = (tmp_path / "sofa" / "arguments").read_text(encoding="utf-8").split()
    assert arguments[-2:] == ["5", "recorded.scn"]


def test_a_record_cut_short_keeps_what_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "tip.state"
    for end in range(len(RECORD)):
        path.write_text(RECORD[:end], encoding="utf-8")
        assert [time for time, _ in read_points(path)] == [0, 0.1, 0.2][
            : RECORD[:end].count("\n") // 2
        ]


def test_a_tilt_is_that_of_the_points_plane(tmp_path: Path) -> None:
    path = tmp_path / "tip.state"
    path.write_text(RECORD + HALF_TURN, encoding="utf-8")
    _, points = read_points(path)[-1]
    assert np.mean(points, axis=0) == pytest.approx((0, 1 / 3, 16 / 3))
    assert tilt_of(points) == pytest.approx(90)


def test_a_log_without_times_is_read() -> None:
    assert read_log("nanometre and banana\n").trouble is None
    assert read_log("").rate is None


def test_a_program_that_cannot_start_is_an_error(tmp_path: Path) -> None:
    write_scenes(laminate(), tmp_path)
    with pytest.raises(OutputError, match="nowhere could not be started"):
        run_scene(str(tmp_path / "nowhere"), laminate(), tmp_path / "actuator.scn", 0.2, 0.02)


def test_a_run_that_takes_too_long_keeps_what_it_has_reached(tmp_path: Path, fake: Fake) -> None:
    fake(writing(RECORD) + "\nexec sleep 60")
    found = run(tmp_path, SofaJob(seconds=0.9, limit=0.6))
    assert found.last.time == pytest.approx(0.2)
    assert found.stopped is not None
    assert "ran to 0.2 of 0.9 s: it was stopped after 0.01 minutes" in found.stopped


def test_what_runs_below_the_program_is_ended_with_it(tmp_path: Path, fake: Fake) -> None:
    fake("sleep 60 &\necho $! > process\nwait")
    with pytest.raises(OutputError, match="it was stopped after"):
        run(tmp_path, SofaJob(seconds=0.2, limit=0.3))
    process = int((tmp_path / "sofa" / "process").read_text(encoding="utf-8"))
    for _ in range(50):
        state = Path(f"/proc/{process}/stat")
        if not state.exists() or state.read_text().split()[2] == "Z":
            break
        time.sleep(0.05)
    else:
        pytest.fail("the program's own child still runs")
