"""``sbafab predict``: what it prints and writes, what a later run keeps, bad input."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

import sbafab
from sbafab.cli import main
from sbafab.output.manifest import file_hashes
from sbafab.runs.run import RunRequest, generate
from tests.site.formats import hold

OVAL = str(Path(__file__).parents[2] / "docs" / "gallery" / "oval.toml")


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["predict", *arguments])
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


def test_writes_figures_and_plots_that_the_manifest_lists(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = run(["3dof-15mm", "-v", "-o", str(tmp_path), "--volume", "5"], capsys)
    assert code == 0
    assert "0.9353  s" in out
    _table_reads_well(out)
    assert "geometric regime only" in " ".join(out.split())
    folder = tmp_path / "3dof-15mm"
    found = json.loads((folder / "predict.json").read_text(encoding="utf-8"))
    hold("predict", found)
    for figure in found["figures"]:
        assert all(figure[key] for key in ("name", "unit", "model", "trust"))
    chosen = [figure["name"] for figure in found["figures"] if figure["design_with"]]
    assert len(chosen) == len(set(chosen)) < len(found["figures"])
    assert {figure["name"] for figure in found["figures"] if "blocked" in figure["name"]} <= {
        *chosen
    }
    plots = {relation["plot"] for relation in found["relations"]}
    assert plots == {
        f"predict/{name}.svg" for name in ("stroke", "force", "bend", "bending", "workspace")
    }
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
    first, second = (" ".join(lines[heads[1] + row].split()) for row in (1, 2))
    assert first == "blocked force at 10 kPa, flat 0.3927 N"
    assert second.startswith("at 25 % of the reference stroke")
    # Above the heading of other models each quantity stands once.
    others = lines.index("Alternative models: design with the figures above")
    assert heads[0] < others < heads[1]
    above = [line[:58] for line in lines[:others] if line.startswith("  ")]
    assert sum("10 kPa, flat" in line for line in above) == 1
    assert "constant curvature" not in "".join(lines[:others])


def test_json_is_what_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(["1dof-5mm", "-o", str(tmp_path), "--json", "--pressure", "50"], capsys)
    assert code == 0
    printed = json.loads(out)
    folder = Path(printed.pop("folder"))
    assert printed.pop("failed") == []
    assert printed == json.loads((folder / "predict.json").read_text(encoding="utf-8"))
    assert printed["asked"]["pressures_kpa"] == [50]


def test_twice_the_same_bytes_and_a_later_run_keeps_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(["1dof-5mm", "-o", str(tmp_path / "a")], capsys)
    run(["1dof-5mm", "-o", str(tmp_path / "b")], capsys)
    a, b = (
        {p.relative_to(f).as_posix(): p.read_bytes() for p in f.rglob("*") if p.is_file()}
        for f in (tmp_path / "a" / "1dof-5mm", tmp_path / "b" / "1dof-5mm")
    )
    assert a == b
    kept = generate(RunRequest(sbafab.load("1dof-5mm"), tmp_path / "a", ("press",)))
    assert {"predict.json", "predict/force.svg", "press.json"} <= set(kept.manifest["files"])


def test_a_prediction_goes_beside_another_designs_folder_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wide = sbafab.load("1dof-5mm", "stack.balloons=1", "chamber.diameter=6")
    folder = generate(RunRequest(wide, tmp_path, ("cut",))).folder
    before = file_hashes(folder)
    beside = tmp_path / "1dof-5mm-predict"
    arguments = ["1dof-5mm", "--set", "stack.balloons=1", "-o", str(tmp_path)]
    code, out, err = run(arguments, capsys)
    assert code == 0
    assert f"Written to {beside}" in " ".join(out.split())
    told = " ".join(err.split())
    assert f"{folder} holds layers, sheets" in told
    assert "another design (chamber.diameter = 6.0 there, 5.0 here); take" in told
    assert f"the prediction was put into {beside}" in told
    code, out, _ = run([*arguments, "--json"], capsys)
    assert code == 0
    hold("predict", json.loads(out))
    assert json.loads(out)["folder"] == str(beside)
    assert (beside / "predict.json").is_file()
    assert file_hashes(folder) == before


def test_failing_design_is_predicted_but_not_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["1dof-5mm", "--set", "bond.width=0.6", "-o", str(tmp_path)]
    code, out, err = run(arguments, capsys)
    assert code == 1
    assert "reference stroke" in out
    assert "bond-width" in err
    assert "no prediction was written" in err
    assert not (tmp_path / "1dof-5mm" / "predict.json").exists()
    code, _, _ = run([*arguments, "--waive", "bond-width"], capsys)
    assert (code == 0) == (tmp_path / "1dof-5mm" / "predict.json").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--volume", "17"], "give 0 to 16.94 ul a balloon"),
        (["--volume", "-1"], "give 0 to 16.94 ul a balloon"),
        (["--volume", "nan"], "the units are ul, ml, mm3"),
        (["--volume", "0.02 ml"], "give 0 to 16.94 ul a balloon"),
        (["--pressure", "11 bar"], "give 0 to 1000 kPa"),
        (["--pressure", "4 atm"], "'4 atm' must be a pressure such as"),
        (["--pressure", "-20"], "a vacuum does nothing"),
        (["--flow", "0"], "must be from 1e-06 to 1e+06 ml/min"),
        (["--flow", "1e-30"], "must be from 1e-06 to 1e+06 ml/min"),
        (["--load", "5"], "--load is for an assembly, and 1dof-5mm is one actuator"),
        (["--flow", "inf"], "must be a flow such as"),
        (["--flow", "1e999"], "must be a finite flow"),
        (["--press-factor", "2"], "at most 1"),
        (["--contact-factor", "-1"], "must be above 0"),
    ],
)
def test_out_of_range_is_one_sentence_exit_2_and_nothing_on_disk(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = run(["1dof-5mm", "-o", str(tmp_path / "out"), *arguments], capsys)
    assert code == 2
    assert out == ""
    assert said in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["brace", "--flow", "30"], "--flow is for one actuator, and brace is an assembly"),
        (["brace", "--volume", "5"], "--volume is for one actuator"),
        (["brace", "--modulus", "3"], "--modulus is for one actuator"),
        (["brace", "--pocket-loss", "0"], "--pocket-loss is for one actuator"),
        (["brace", "--press-factor", "0.5"], "--press-factor is for one actuator"),
        (["brace", "--contact-factor", "2"], "--contact-factor is for one actuator"),
        (["brace", "--waive", "seat"], "--waive is for written files"),
        (["brace", "-o", "x"], "--out is for written files"),
        (
            ["brace", "--pressure", "5", "--pressure", "6"],
            "an assembly is predicted at one pressure",
        ),
        (["radial-15mm", "--modulus", "3"], "--modulus is for elastic balloons, round pockets"),
        (["radial-15mm", "--load", "1.2"], "--load is for an assembly"),
        ([OVAL, "--volume", "5"], "--volume is for pockets that are round or oblong"),
    ],
)
def test_an_option_that_nothing_takes_is_refused(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = run(arguments, capsys)
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
