"""The scenes in SOFA itself, where runSofa is on the path."""

from __future__ import annotations

import shutil
from functools import cache
from pathlib import Path

import pytest

import sbafab
from sbafab.errors import OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.simulators.simulator import drift
from sbafab.simulators.sofa import scenes
from sbafab.simulators.sofa.run import SofaJob, SofaRun, read_points, simulate

pytestmark = pytest.mark.skipif(shutil.which("runSofa") is None, reason="runSofa is not installed")

LOBED = ("3dof-15mm",)
CAX8R = {1: 0.678, 2: 0.861, 5: 1.150, 10: 1.399}
"""Stroke in mm at so many kPa of an inner balloon of 5 mm with neck and bore, as CalculiX finds it
in a section through the axis, which cannot ripple."""
THREE = {1: 2.17, 2: 2.77, 5: 3.73, 10: 4.59}
"""Stroke of three balloons on one axis: a quarter of C3D15 wedges in CalculiX, which ripples."""
ALL = ("chamber1", "chamber2", "chamber3")


@cache
def built(*design: str) -> Laminate:
    return sbafab.build(*design)


def ran(
    folder: Path, design: tuple[str, ...], pressures: dict[str, float], job: SofaJob
) -> SofaRun:
    return simulate(built(*design), folder, pressures, job)


def evenly(pressure: float) -> dict[str, float]:
    return dict.fromkeys(ALL, pressure)


def settled(done: SofaRun, mm: float) -> bool:
    return drift(done.states) < mm / 2


@pytest.mark.parametrize("scene", ["shell", "volume", "frames"])
def test_a_lone_balloon_in_every_scene_it_has(tmp_path: Path, scene: str) -> None:
    design = ("1dof-5mm", "stack.balloons=1")
    job = SofaJob(scene, 3.0)  # type: ignore[arg-type]
    done = ran(tmp_path, design, {"chamber1": 5.0}, job)
    # One film held at its middle, the other free; the Mylar balloon is 2.29 mm high.
    assert 0.8 < done.last.tip[2] < 2.29 * 1.1
    assert done.last.tilt < 0.2


@pytest.mark.long
@pytest.mark.parametrize("kpa", [1, 2, 5, 10])
def test_three_balloons_rise_as_calculix_s_do(tmp_path: Path, kpa: int) -> None:
    done = ran(tmp_path, ("1dof-5mm", "stack.balloons=3"), {"chamber1": kpa}, SofaJob(seconds=6))
    assert settled(done, 0.05)
    assert done.last.tip[2] == pytest.approx(THREE[kpa], rel=0.1)


@pytest.mark.long
def test_six_balloons_driven_by_volume(tmp_path: Path) -> None:
    """As much air as pressure lets in lifts them as high."""
    done = ran(tmp_path, ("1dof-5mm",), {"chamber1": 5.0}, SofaJob("volume", 4.0))
    assert settled(done, 0.1)
    assert done.last.tip[2] == pytest.approx(6 * CAX8R[5], rel=0.1)


@pytest.mark.long
@pytest.mark.parametrize("kpa", [1, 10])
def test_the_shell_of_three_chambers_stands_and_rises(tmp_path: Path, kpa: int) -> None:
    done = ran(tmp_path, LOBED, evenly(kpa), SofaJob(seconds=9))
    assert done.last.tilt < 0.1
    assert done.last.tip[2] == pytest.approx(15 * CAX8R[kpa], rel=0.1)


@pytest.mark.long
def test_it_bends_away_from_two_chambers_by_what_the_paper_measured(tmp_path: Path) -> None:
    """81 +- 6 degrees (paper, Sec. 4): chambers lie at 0, 120 and 240 degrees."""
    done = ran(tmp_path, LOBED, {"chamber1": 5.0, "chamber2": 5.0}, SofaJob(seconds=10))
    x, y, _ = done.last.tip
    assert done.last.tilt == pytest.approx(81, abs=6)
    assert max(x, y) < 0
    assert y / x == pytest.approx(3**0.5, rel=0.15)


@pytest.mark.long
@pytest.mark.parametrize("scene", ["shell", "frames", "volume"])
def test_one_chamber_along_x_bends_it_in_that_plane(tmp_path: Path, scene: str) -> None:
    job = SofaJob(scene, 3.0, volumes={"chamber1": 80.0})  # type: ignore[arg-type]
    done = ran(tmp_path, LOBED, {"chamber1": 5.0}, job)
    x, y, _ = done.last.tip
    assert x < -1
    # The volume scene is mirrored less exactly, for a reason not known: 0.3 to 0.5 % were seen.
    assert abs(y) < (0.01 if scene == "volume" else 0.002) * abs(x)


@pytest.mark.long
@pytest.mark.parametrize(("scene", "seconds"), [("frames", 4.0), ("volume", 4.0), ("beam", 6.0)])
def test_the_other_scenes_come_as_high_as_the_shell(
    tmp_path: Path, scene: str, seconds: float
) -> None:
    job = SofaJob(scene, seconds)  # type: ignore[arg-type]
    done = ran(tmp_path, LOBED, evenly(5.0), job)
    assert done.last.tilt < 0.5
    assert done.last.tip[2] == pytest.approx(15 * CAX8R[5], rel=0.1)


@pytest.mark.long
def test_a_radial_actuator_swells_round_its_tube(tmp_path: Path) -> None:
    """A flat pocket 10 wide becomes a cylinder of 6.37: 27.7 mm over mid-surfaces at most."""
    pressures = evenly(1.0)
    done = ran(tmp_path, ("radial-15mm",), pressures, SofaJob(seconds=3))
    _, crowns = read_points(done.scene.with_name("tip.state"))[-1]
    across = [2 * (x * x + y * y) ** 0.5 for x, y, _ in crowns]
    assert min(across) == pytest.approx(max(across), rel=0.04)
    assert 25 < max(across) < 27.74 * 1.02


@pytest.mark.long
def test_a_drawn_pocket_rises(tmp_path: Path) -> None:
    """A square of 5 mm is higher than the disc in it, lower than that round it."""
    drawn = tmp_path / "square.svg"
    drawn.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="6mm" height="6mm" viewBox="-3 -3 6 6">'
        '<path d="M -2.5 -2.5 L 2.5 -2.5 L 2.5 2.5 L -2.5 2.5 Z"/></svg>'
    )
    design = ("1dof-5mm", "stack.balloons=3", f"chamber.outline={drawn}")
    done = ran(tmp_path / "sofa", design, {"chamber1": 5.0}, SofaJob(seconds=6))
    assert THREE[5] < done.last.tip[2] < 2 * THREE[5]


def test_dead_frames_are_told_by_where_the_tip_lies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A weight of 0 before the other ends a node's weights; runSofa's log is clean."""
    monkeypatch.setattr(scenes, "pair_of_frames", lambda z, height, count: ((0, 1), (0.0, 1.0)))
    design = ("3dof-15mm", "stack.balloons=2")
    with pytest.raises(OutputError, match="its result cannot be: the tip lies at 0, 0, 0"):
        ran(tmp_path, design, evenly(5.0), SofaJob("beam", 0.5))
