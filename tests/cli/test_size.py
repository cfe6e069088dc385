"""check and predict open with the size; what was understood of a drawn outline is kept."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import sbafab
from sbafab.cli import show
from sbafab.models.calibration import factors_of
from tests.cli.conftest import Run

QUICK = "--set rules.yield_builds=100"


def test_check_opens_with_the_size_and_gives_it_to_programs(run: Run) -> None:
    _, out, _ = run(f"check 1dof-5mm {QUICK}")
    # The farthest corner of the tab's mask: 2.5 + 0.75 + 5 + 0.5 out, half of a 1.95 strip aside,
    # which lies farther than the tab's own, 8.25 out and 1.725 aside.
    # Eleven masks keep their thickness, of twelve films the press leaves a share.
    height = 11 * 0.025 + 12 * 0.038 * factors_of(sbafab.load("1dof-5mm")).press_factor
    assert out.splitlines()[:2] == [
        "size: 17.61 mm overall diameter with 1 inlet tab, 6.50 without, 12.50 x 7.50 mm,",
        f"      folded height {height:.3f} mm",
    ]
    told = json.loads(run(f"check 1dof-5mm {QUICK} --json")[1])
    assert round(told["sizes"]["1dof-5mm"]["overall_diameter"], 2) == 17.61


def test_predict_opens_with_the_size_also_round_a_tube(run: Run) -> None:
    drawn = run(f"predict radial-15mm {QUICK} --set models.calibration=none")[1]
    # The paper's 15.33 (Sec. 2.1).
    assert drawn.startswith("size: 15.33 mm round its tube, flat, ")
    # Pressed, it is the tube and twice the pressed films, as in the figures below it.
    out = run(f"predict radial-15mm {QUICK}")[1]
    pressed = sbafab.predict("radial-15mm").value("deflated_diameter")
    assert out.startswith(f"size: {pressed:.2f} mm round its tube, flat, ")
    assert 15 < pressed < 15.33


def test_a_solved_chamber_is_said(run: Run) -> None:
    out = run(f"check 1dof-5mm --set fits.diameter=20 {QUICK}")[1]
    assert "note: 19.995 mm across with 1 inlet tab, within fits.diameter = 20" in out


SAID = "drawn outline: 8.000 x 8.000 mm, read at 1 mm a unit"
PAGE = 'xmlns="http://www.w3.org/2000/svg" width="40mm" height="40mm" viewBox="-20 -20 40 40"'


def test_the_size_of_an_outline_is_printed_and_kept(run: Run) -> None:
    Path("pocket.svg").write_text(f'<svg {PAGE}><circle r="4"/></svg>')
    design = "1dof-5mm --set stack.balloons=1 --set chamber.outline=pocket.svg"
    assert f"note: {SAID}" in run(f"check {design}")[1]
    assert json.loads(run(f"check {design} --json")[1])["notes"] == [SAID]
    assert f"note {SAID}" in " ".join(run(f"generate {design}")[1].split())
    folder = Path("out/1dof-5mm")
    before = (folder / "manifest.json").read_text()
    assert json.loads(before)["notes"] == [SAID]
    assert SAID in (folder / "preview" / "layers.svg").read_text()
    # The folder's own design gives the same bytes, though its drawing has another name there.
    out = run("generate out/1dof-5mm/design.toml -o again --json")[1]
    assert json.loads(out)["notes"] == [SAID]
    assert Path("again/1dof-5mm/manifest.json").read_text() == before


def test_a_path_longer_than_the_line_is_printed_whole(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    folder = "/home/lab/" + "actuators/" * 9 + "3dof-15mm"
    show.facts([("folder", folder)])
    told = capsys.readouterr().out.splitlines()
    assert "".join(line[len("folder") :].strip() for line in told) == folder
