"""Some of the figures on the pages of CalculiX, SOFA and MuJoCo, measured again."""

from __future__ import annotations

import shutil

import pytest

from docs.scripts import calculix_runs, mujoco_runs
from docs.scripts.measured import record

pytestmark = pytest.mark.long

needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx is not installed")
needs_sofa = pytest.mark.skipif(shutil.which("runSofa") is None, reason="SOFA is not installed")


@needs_ccx
def test_calculix_finds_the_pages_strokes_of_one_balloon() -> None:
    pytest.importorskip("netgen")
    states = calculix_runs.inflated(1)
    table = record("calculix").tables["one"]
    for kpa in ("0.95", "6"):
        section = float(table.cell(kpa, "section through the axis, CAX8R"))
        assert calculix_runs.section_at(float(kpa)) == pytest.approx(section, abs=0.002)
        quarter = float(table.cell(kpa, "quarter, default"))
        assert calculix_runs.stroke_at(states, float(kpa)) == pytest.approx(quarter, rel=0.01)


@pytest.mark.parametrize(("kpa", "ring"), [("0.95", 8), ("6", 8), ("6", 16)])
def test_mujoco_finds_the_pages_strokes_of_one_balloon(kpa: str, ring: int) -> None:
    column = "16 (default)" if ring == 16 else str(ring)
    said = float(record("mujoco").tables["one"].cell(kpa, column))
    found = float(mujoco_runs.stroke(1, float(kpa), ring))
    assert found == pytest.approx(said, rel=0.002)


def test_mujoco_finds_the_pages_strokes_of_three_balloons() -> None:
    said = record("mujoco").tables["stacks"]
    for ring in (8, 16):
        found = float(mujoco_runs.stroke(3, 6.0, ring))
        assert found == pytest.approx(float(said.cell("3, 6", str(ring))), rel=0.005)


@needs_sofa
@pytest.mark.parametrize("kpa", ["5, 5, 5", "5, 5, 0"])
def test_sofa_finds_the_pages_height_and_tilt(kpa: str) -> None:
    from docs.scripts import sofa_runs

    done, _ = sofa_runs.ran([float(one) for one in kpa.split(", ")])
    height, tilt = record("sofa").tables["pressures"].cell(kpa, "A shell").split(", ")
    assert done.last.stroke == pytest.approx(float(height), abs=0.05)
    assert done.tilt == pytest.approx(float(tilt), abs=0.5)


def test_the_fast_stack_finds_what_stands_beside_sofa() -> None:
    from docs.scripts import sofa_runs

    pose = sofa_runs.OTHERS["fast stack"]
    assert pose is not None
    table = record("sofa").tables["pressures"]
    for row in table.rows:
        if row[0] == "steps/s":
            continue
        height, tilt = pose([float(one) for one in row[0].split(", ")])
        said = [float(one) for one in table.cell(row[0], "fast stack").split(", ")]
        assert [height, tilt] == pytest.approx(said, rel=0.01, abs=0.02), row[0]
