"""The scenes in SOFA itself, where runSofa is on the path."""

from __future__ import annotations

import shutil
from functools import cache
from pathlib import Path

import pytest

import sbafab
from sbafab.laminate.laminate import Laminate
from sbafab.runtime import ignore_progress
from sbafab.simulators.simulator import Result, SimulationRequest
from sbafab.simulators.sofa import run

pytestmark = pytest.mark.skipif(shutil.which("runSofa") is None, reason="runSofa is not installed")

LOBED = ("3dof-15mm",)
CAX8R = {1: 0.678, 2: 0.861, 5: 1.150, 10: 1.399}
"""Stroke in mm at so many kPa of an inner balloon of 5 mm with neck and bore, as CalculiX finds it
in a section through the axis, which cannot ripple."""


@cache
def built(*design: str) -> Laminate:
    return sbafab.build(*design)


def ran(
    folder: Path,
    design: tuple[str, ...],
    kpa: float | dict[str, float],
    seconds: float,
    scene: str = "shell",
    volumes: dict[str, float] | None = None,
) -> Result:
    """A run at one pressure in all chambers, or with pressures by chamber."""
    told = {"chambers": kpa} if isinstance(kpa, dict) else {"pressure": kpa}
    request = SimulationRequest(**told, scene=scene, seconds=seconds, volumes=volumes or {})  # type: ignore[arg-type]
    return run(built(*design), request, folder, ignore_progress)


@pytest.mark.parametrize("scene", ["shell", "volume", "frames"])
def test_a_lone_balloon_in_every_scene_it_has(tmp_path: Path, scene: str) -> None:
    done = ran(tmp_path, ("1dof-5mm", "stack.balloons=1"), 5.0, 3.0, scene)
    # One film held at its middle, the other free; the Mylar balloon is 2.29 mm high.
    assert 0.8 < done.last.stroke < 2.29 * 1.1
    assert done.tilt is not None
    assert done.tilt < 0.2


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "kpa", "seconds"),
    [("shell", 10, 9.0), ("frames", 5, 4.0), ("volume", 5, 4.0)],
)
def test_three_chambers_stand_and_rise_in_every_scene(
    tmp_path: Path, scene: str, kpa: int, seconds: float
) -> None:
    done = ran(tmp_path, LOBED, kpa, seconds, scene)
    assert done.tilt is not None
    assert done.tilt < (0.1 if scene == "shell" else 0.5)
    assert done.last.stroke == pytest.approx(15 * CAX8R[kpa], rel=0.1)


@pytest.mark.long
def test_it_bends_away_from_two_chambers_by_what_the_paper_measured(tmp_path: Path) -> None:
    """81 +- 6 degrees (paper, Sec. 4): chambers lie at 0, 120 and 240 degrees."""
    done = ran(tmp_path, LOBED, {"chamber1": 5.0, "chamber2": 5.0}, 10.0)
    assert done.tip is not None
    x, y, _ = done.tip
    assert done.tilt == pytest.approx(81, abs=6)
    assert max(x, y) < 0
    assert y / x == pytest.approx(3**0.5, rel=0.15)


@pytest.mark.long
@pytest.mark.parametrize("scene", ["shell", "frames", "volume"])
def test_one_chamber_along_x_bends_it_in_that_plane(tmp_path: Path, scene: str) -> None:
    volumes = {"chamber1": 80.0} if scene == "volume" else None
    done = ran(tmp_path, LOBED, {"chamber1": 5.0}, 3.0, scene, volumes)
    assert done.tip is not None
    x, y, _ = done.tip
    assert x < -1
    # The volume scene is mirrored less exactly, for a reason not known: 0.3 to 0.5 % were seen.
    assert abs(y) < (0.01 if scene == "volume" else 0.002) * abs(x)


@pytest.mark.long
def test_a_radial_actuator_swells_round_its_tube(tmp_path: Path) -> None:
    """A flat pocket 10 wide becomes a cylinder of 6.37: 27.7 mm over mid-surfaces at most."""
    done = ran(tmp_path, ("radial-15mm",), 1.0, 3.0)
    assert 25 < done.figures["diameter"] < 27.74 * 1.02
    assert done.tip is None


THREE = {1: 2.17, 2: 2.77, 5: 3.73, 10: 4.59}
"""Stroke of three balloons on one axis: a quarter of C3D15 wedges in CalculiX, which ripples."""


@pytest.mark.long
@pytest.mark.parametrize("kpa", [1, 10])
def test_three_balloons_rise_as_calculix_s_do(tmp_path: Path, kpa: int) -> None:
    done = ran(tmp_path, ("1dof-5mm", "stack.balloons=3"), kpa, 6.0)
    assert done.figures["drift"] < 0.025
    assert done.last.stroke == pytest.approx(THREE[kpa], rel=0.1)


@pytest.mark.long
def test_six_balloons_driven_by_volume(tmp_path: Path) -> None:
    """As much air as pressure lets in lifts them as high."""
    done = ran(tmp_path, ("1dof-5mm",), 5.0, 4.0, "volume")
    assert done.figures["drift"] < 0.05
    assert done.last.stroke == pytest.approx(6 * CAX8R[5], rel=0.1)


@pytest.mark.long
def test_a_drawn_pocket_rises(tmp_path: Path, square: Path) -> None:
    """A square of 5 mm is higher than the disc in it, lower than that round it."""
    design = ("1dof-5mm", "stack.balloons=3", f"chamber.outline={square}")
    done = ran(tmp_path / "sofa", design, 5.0, 6.0)
    assert THREE[5] < done.last.stroke < 2 * THREE[5]
