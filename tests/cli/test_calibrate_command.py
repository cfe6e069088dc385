"""``sbafab calibrate``: what it refuses, and a calibration from measuring to the folder."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from sbafab.cli import app
from sbafab.models.calibrated import read_calibration

LAB = """curve,quantity,design,x_name,x,y,error,pressure_kpa,tip,fluid,error_source
flat-force,force_n,1dof-5mm,height_share,0,1.60,0.05,100,held,air,repeats
stroke,stroke_mm,1dof-5mm,pressure_kpa,5,4.4,0.2,,free,air,repeats
stroke,stroke_mm,1dof-5mm,pressure_kpa,10,5.4,0.2,,free,air,repeats
"""


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nosuch"], "neither evidence that ships"),
        (["--name", "paper"], "which stands for another one"),
        (["--name", "none"], "which stands for another one"),
        (["--name", "my lab"], "use letters, digits"),
        (["textile-array"], "no curve can be fitted to (force-8mm: "),
    ],
)
def test_what_it_cannot_do_is_one_sentence(
    arguments: list[str], sentence: str, tmp_path: Path
) -> None:
    result = run("calibrate", *arguments, "-o", tmp_path)
    assert result.exit_code == 2
    assert sentence in " ".join(result.output.split())
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_not_there_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    change = ["--set", "models.calibration=lab.toml"]
    result = run("generate", "1dof-5mm", *change, "-o", tmp_path, "-q")
    assert result.exit_code == 2
    assert "sbafab calibrate writes one" in " ".join(result.output.split())
    assert not (tmp_path / "1dof-5mm").exists()


@pytest.mark.long
def test_a_labs_curves_become_a_calibration_that_a_folder_holds(tmp_path: Path) -> None:
    (tmp_path / "lab.csv").write_text(LAB)
    result = run("calibrate", tmp_path / "lab.csv", "--name", "lab", "-o", tmp_path, "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert {row["curve"] for row in document["held_out"]} == {"flat-force", "stroke"}
    fitted = read_calibration(tmp_path / "lab.toml")
    assert fitted.evidence == ("lab",)
    # Measured forces that are larger than the drawn pocket less the prior's loss would give.
    assert 0 < fitted.values["pocket_loss"] < 0.4
    assert run("new", "1dof-5mm", tmp_path / "own.toml").exit_code == 0
    text = (tmp_path / "own.toml").read_text()
    (tmp_path / "own.toml").write_text(text + '\n[models]\ncalibration = "lab.toml"\n')
    out = tmp_path / "out"
    assert run("predict", tmp_path / "own.toml", "-o", out).exit_code == 0
    assert run("generate", tmp_path / "own.toml", "-o", out, "-q").exit_code == 0
    (folder,) = (path for path in out.iterdir() if path.is_dir())
    tables = tomllib.loads((folder / "design.toml").read_text())
    assert tables["models"] == {"calibration": "calibration.toml"}
    assert (folder / "calibration.toml").read_bytes() == (tmp_path / "lab.toml").read_bytes()
    assert run("check", folder).exit_code == 0
