"""What moves in an assembly, and what the whole does inflated, as the page is told."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sbafab import api
from sbafab.errors import DesignError
from sbafab.studio.jobs import JOBS
from tests.studio.test_parts import BASE
from tests.studio.worked import EnoughError, answers, given_up_at, job


def asked(folder: Path, text: str, do: str, pose: dict[str, Any]) -> dict[str, Any]:
    """The last answer."""
    return answers({**job(folder, text), "do": do, "tab": "a", "pose": pose})[-1]


def test_a_grip_in_its_lumen_touches_the_wall_and_free_is_as_wide_as_the_paper_s() -> None:
    brace = api.assemble("brace")
    found = api.grip(brace, "grip")
    assert found is not None
    held, surface = found
    # Sec. 2.1: about 28 mm inflated; the balloons that stand in the lumen of 25.4 mm reach it.
    assert held.free == pytest.approx(28, rel=0.035)
    # A cylinder of an inextensible pocket 10 wide on the films, of which the press leaves a share.
    films = 3 * 0.038 * 0.204 + 2 * 0.025
    assert held.free < held.most == pytest.approx(15 + 2 * (20 / np.pi + films), abs=0.005)
    across = np.hypot(surface.points[:, 0], surface.points[:, 1])
    assert across.max() == pytest.approx(25.4 / 2, abs=1e-6)
    assert across.min() == pytest.approx(held.deflated / 2, abs=1e-6)
    # Three lenses of film that keeps its width: an arc 10 mm long rises half of 5.036 mm.
    x, y, _ = surface.points.T
    ring = np.abs(surface.points[:, 2]) < 1e-9
    third = ring & (np.abs(np.degrees(np.arctan2(y, x))) < 60)
    arc = surface.points[third][: third.sum() // 2]
    assert np.hypot(*np.diff(arc[:, :2], axis=0).T).sum() == pytest.approx(10, rel=0.02)
    nowhere = type(brace.assembly.deploy)()
    free = api.grip(api.assemble(brace.assembly.model_copy(update={"deploy": nowhere})), "grip")
    assert free is not None
    across = np.hypot(free[1].points[:, 0], free[1].points[:, 1])
    assert 2 * across.max() == pytest.approx(held.free, abs=1e-6)
    assert api.grip(brace, "arm") is None
    with pytest.raises(DesignError, match="there are tube, grip, arm"):
        api.grip(brace, "hand")


def test_a_prediction_of_the_whole_ends_where_nobody_waits_for_it(tmp_path: Path) -> None:
    with pytest.raises(EnoughError):
        list(JOBS["elastic"](job(tmp_path, api.template("brace")), given_up_at(2)))


@pytest.mark.parametrize("pose", [{"pressure_kpa": 0}, {"load_g": -1}, {"load_g": "much"}])
def test_what_is_asked_of_the_whole_has_a_range(tmp_path: Path, pose: dict[str, Any]) -> None:
    with pytest.raises(DesignError, match="must be"):
        asked(tmp_path, BASE, "elastic", pose)


@pytest.mark.long
def test_the_parts_move_as_their_stacks_say(tmp_path: Path) -> None:
    text = api.template("brace")
    grip, arm = asked(tmp_path, text, "motion", {})["movers"]
    points = np.frombuffer(base64.b64decode(grip["surface"]["points"]), "<f4").reshape(-1, 3)
    assert np.hypot(points[:, 0], points[:, 1]).max() == pytest.approx(25.4 / 2, abs=1e-4)
    # The arm stands on the end of a tube of 40 mm, turned by 60 degrees.
    frame = np.array(arm["frame"])
    assert frame[:, 3] == pytest.approx([0, 0, 40])
    assert frame[:, 0] == pytest.approx([0.5, np.sqrt(0.75), 0], abs=1e-4)
    pressures = (6.0, 2.0, 0.0)
    theirs = api.stack("3dof-15mm").pose(pressures)
    ours = asked(tmp_path, text, "motion", {"parts": {"arm": list(pressures)}})["poses"]
    assert ours["arm"]["height"] == pytest.approx(theirs.height, abs=1e-3)
    assert ours["arm"]["bend"] == pytest.approx(theirs.bend, abs=1e-2)
    with pytest.raises(DesignError, match="pressures must be 3 finite"):
        asked(tmp_path, text, "motion", {"parts": {"arm": [1]}})


@pytest.mark.long
def test_the_whole_is_predicted_as_by_the_command(tmp_path: Path) -> None:
    text = api.template("brace")
    ours = asked(tmp_path, text, "elastic", {"pressure_kpa": 5, "load_g": 2})
    theirs = api.predict_assembly("brace", pressure_kpa=5, load_g=2)
    assert [(f["group"], f["name"], f["value"]) for f in ours["figures"]] == [
        (f.part, f.name, f.value) for f in theirs.figures
    ]
    assert ours["met"] == theirs.met()
    assert not ours["meets"]
