"""``sbafab predict``: what it prints and writes, and what a later run keeps."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from types import SimpleNamespace

import pytest

import sbafab
from sbafab.cli.predict import print_prediction
from sbafab.design.kits import write_kit
from sbafab.folders.manifest import file_hashes
from sbafab.folders.run import RunRequest, generate
from sbafab.models.figures import FLAGS, INTERVAL_NOTE, VerdictLine
from tests.cli.conftest import Run
from tests.site.formats import hold


def test_writes_figures_and_plots_that_the_manifest_lists(run: Run) -> None:
    code, out, _ = run("predict 3dof-15mm -v --volume 5")
    assert code == 0
    assert "0.9353  s" in out
    _table_reads_well(out)
    assert "geometric regime only" in " ".join(out.split())
    folder = Path("out/3dof-15mm")
    found = json.loads((folder / "predict.json").read_text(encoding="utf-8"))
    hold("predict", found)
    for figure in found["figures"]:
        assert all(figure[key] for key in ("name", "unit", "model", "trust"))
    chosen = [figure["name"] for figure in found["figures"] if figure["design_with"]]
    assert len(chosen) == len(set(chosen)) < len(found["figures"])
    blocked = {figure["name"] for figure in found["figures"] if "blocked" in figure["name"]}
    assert blocked <= {*chosen}
    plots = {relation["plot"] for relation in found["relations"]}
    names = ("stroke", "force", "bend", "bending", "workspace")
    assert plots == {f"predict/{name}.svg" for name in names}
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    assert found["design_sha256"] == manifest["design_sha256"]
    for path in (*plots, "predict.json"):
        digest = hashlib.sha256((folder / path).read_bytes()).hexdigest()
        assert manifest["files"][path] == digest


def _table_reads_well(out: str) -> None:
    """No line is longer than 80, each model's figures stand below its name, and none is doubled."""
    assert max(len(line) for line in out.splitlines() if "Written to" not in line) <= 80
    lines = out.partition("Figures to design with")[2].splitlines()
    heads = [place for place, line in enumerate(lines) if line.startswith("force: ")]
    assert [lines[place].partition(" [")[0] for place in heads] == [
        "force: elastic stack, calibration paper",
        "force: virtual work on Eq. 4",
        "force: virtual work on Eqs. 1-3",
    ]
    assert lines[heads[1] + 1].split() == [
        "blocked",
        "force",
        "at",
        "10",
        "kPa,",
        "flat",
        "0.3927",
        "N",
    ]
    # Above the heading of other models each quantity stands once.
    others = lines.index("Alternative models: design with the figures above")
    assert heads[0] < others < heads[1]
    assert sum("force at 10 kPa, flat" in line for line in lines[:others]) == 1


def test_json_is_what_is_written(run: Run) -> None:
    code, out, _ = run("predict 1dof-5mm --json --pressure 50")
    assert code == 0
    printed = json.loads(out)
    folder = Path(printed.pop("folder"))
    assert printed.pop("failed") == []
    assert printed == json.loads((folder / "predict.json").read_text(encoding="utf-8"))
    assert printed["asked"]["pressures_kpa"] == [50]


def test_twice_the_same_bytes_and_a_later_run_keeps_them(run: Run) -> None:
    for out in "ab":
        run(f"predict 1dof-5mm -o {out}")
    a, b = (
        {p.relative_to(out).as_posix(): p.read_bytes() for p in Path(out).rglob("*") if p.is_file()}
        for out in "ab"
    )
    assert a == b
    kept = generate(RunRequest(sbafab.load("1dof-5mm"), Path("a"), ("press",)))
    assert {"predict.json", "predict/force.svg", "press.json"} <= set(kept.manifest["files"])


def test_a_prediction_goes_beside_another_designs_folder_and_says_so(run: Run) -> None:
    # The kit is the same, whatever path it is under there and here.
    kit = write_kit(Path("lab.toml"))
    wide = sbafab.load("1dof-5mm", "stack.balloons=1", "chamber.diameter=6", f"kit={kit}")
    folder = generate(RunRequest(wide, Path("out"), ("cut",))).folder
    before = file_hashes(folder)
    code, out, err = run("predict 1dof-5mm --set stack.balloons=1 --set kit=lab.toml --json")
    assert code == 0
    told = " ".join(err.split())
    assert f"{folder} holds layers, sheets" in told
    assert "of another design or version" in told
    assert "the prediction was put into out/1dof-5mm-predict" in told
    hold("predict", json.loads(out))
    assert json.loads(out)["folder"] == "out/1dof-5mm-predict"
    assert Path("out/1dof-5mm-predict/predict.json").is_file()
    assert file_hashes(folder) == before


def test_failing_design_is_predicted_but_not_written(run: Run) -> None:
    code, out, err = run("predict 1dof-5mm --set bond.width=0.6")
    assert code == 1
    assert "reference stroke" in out
    assert "bond-width" in err
    assert "no prediction was written" in err
    assert not Path("out/1dof-5mm/predict.json").exists()


def test_every_figure_that_is_an_extrapolation_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    flag = FLAGS["extrapolation"]
    notes = {"stroke": flag, "bend": flag, "force": flag, "burst": INTERVAL_NOTE}
    lines = tuple(VerdictLine(name, "1", note) for name, note in notes.items())
    print_prediction(SimpleNamespace(verdict=(*lines, lines[-1])))  # type: ignore[arg-type]
    out = " ".join(capsys.readouterr().out.split())
    assert (out.count(flag), out.count(INTERVAL_NOTE)) == (3, 1)
