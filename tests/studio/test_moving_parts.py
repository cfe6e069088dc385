"""What moves in an assembly, and what the whole does inflated, as the page is told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sbafab import api
from sbafab.errors import DesignError
from tests.studio.test_parts import BASE
from tests.studio.worked import answers, job


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


@pytest.mark.parametrize("pose", [{"pressure_kpa": 0}, {"load_g": -1}, {"load_g": "much"}])
def test_what_is_asked_of_the_whole_has_a_range(tmp_path: Path, pose: dict[str, Any]) -> None:
    with pytest.raises(DesignError, match="must be"):
        asked(tmp_path, BASE, "elastic", pose)
