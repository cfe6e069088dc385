"""``sbafab calibrate``: a calibration from measuring to the folder."""

from __future__ import annotations

import json
import shutil
import sys
import tomllib
from pathlib import Path

import pytest

from sbafab.models.calibration import FOLDER, read_calibration
from sbafab.validation import fit
from tests.cli.conftest import Run

LAB = """curve,quantity,design,x_name,x,y,error,pressure_kpa,tip,fluid,error_source
flat-force,force_n,1dof-5mm,height_share,0,1.60,0.05,100,held,air,repeats
stroke,stroke_mm,1dof-5mm,pressure_kpa,5,4.4,0.2,,free,air,repeats
stroke,stroke_mm,1dof-5mm,pressure_kpa,10,5.4,0.2,,free,air,repeats
"""


@pytest.mark.long
def test_a_labs_curves_become_a_calibration_that_a_folder_holds(run: Run) -> None:
    Path("lab.csv").write_text(LAB)
    code, out, _ = run("calibrate lab.csv --name lab --json")
    assert code == 0
    assert {row["curve"] for row in json.loads(out)["held_out"]} == {"flat-force", "stroke"}
    fitted = read_calibration(Path("lab.toml"))
    assert fitted.evidence == ("lab",)
    # Measured forces that are larger than the drawn pocket less the prior's loss would give.
    assert 0 < fitted.values["pocket_loss"] < 0.4
    assert run("new 1dof-5mm own.toml")[0] == 0
    with Path("own.toml").open("a") as opened:
        opened.write('\n[models]\ncalibration = "lab.toml"\n')
    assert run("predict own.toml")[0] == 0
    assert run("generate own.toml -q")[0] == 0
    (folder,) = (path for path in Path("out").iterdir() if path.is_dir())
    tables = tomllib.loads((folder / "design.toml").read_text())
    assert tables["models"] == {"calibration": "calibration.toml"}
    assert (folder / "calibration.toml").read_bytes() == Path("lab.toml").read_bytes()
    assert run("check", str(folder))[0] == 0


def test_curves_that_no_design_describes_are_not_fitted(run: Run) -> None:
    pytest.importorskip("emcee")
    Path("bench.csv").write_text("quantity,y\nforce_n,1\n")
    code, out, err = run("calibrate bench.csv")
    assert (code, out) == (2, "")
    assert "no curve can be fitted (force_n: no design describes the actuator)" in err


def test_a_kit_is_not_overwritten(run: Run) -> None:
    assert run("new kit lab.toml")[0] == 0
    kit = Path("lab.toml").read_bytes()
    code, _, err = run("calibrate --name lab")
    assert code == 2
    assert "lab.toml exists and is not a calibration; give another --name" in err
    assert Path("lab.toml").read_bytes() == kit


def test_a_calibration_may_be_overwritten_and_a_sampler_is_missed_before_anything_is_computed(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(FOLDER / "paper.toml", "lab.toml")
    monkeypatch.setitem(sys.modules, "emcee", None)
    monkeypatch.delattr(fit, "usable_curves")
    code, _, err = run("calibrate --name lab")
    assert (code, "needs emcee, which is not installed" in err) == (2, True)
