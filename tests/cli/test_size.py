"""check and predict open with the size: across with tabs and without, flat, folded height."""

from __future__ import annotations

import json
from pathlib import Path

from click.testing import CliRunner

import sbafab
from sbafab.cli import app
from sbafab.models.intervals import factors_of

QUICK = ("--set", "rules.yield_builds=100")


def test_check_opens_with_the_size_and_gives_it_to_programs() -> None:
    said = CliRunner().invoke(app, ["check", "1dof-5mm", *QUICK]).output.splitlines()[:2]
    # The farthest corner of the tab's mask: 2.5 + 0.75 + 5 + 0.5 out, half of a 1.95 strip aside,
    # which lies farther than the tab's own, 8.25 out and 1.725 aside.
    # Eleven masks keep their thickness, of twelve films the press leaves a share.
    height = 11 * 0.025 + 12 * 0.038 * factors_of(sbafab.load("1dof-5mm")).press_factor
    assert said == [
        "size: 17.61 mm overall diameter with 1 inlet tab, 6.50 without, 12.50 x 7.50 mm,",
        f"      folded height {height:.3f} mm",
    ]
    told = json.loads(CliRunner().invoke(app, ["check", "1dof-5mm", *QUICK, "--json"]).output)
    assert round(told["sizes"]["1dof-5mm"]["overall_diameter"], 2) == 17.61


def test_predict_opens_with_the_size_also_round_a_tube(tmp_path: Path) -> None:
    arguments = ["predict", "radial-15mm", "-o", str(tmp_path), *QUICK]
    drawn = [*arguments, "--set", "models.calibration=none"]
    said = CliRunner().invoke(app, drawn).output.splitlines()[0]
    # The paper's 15.33 (Sec. 2.1).
    assert said.startswith("size: 15.33 mm round its tube, flat, ")
    # Pressed, it is the tube and twice the pressed films, as in the figures below it.
    said = CliRunner().invoke(app, [*arguments, "--set", "models.calibration=paper"]).output
    pressed = sbafab.predict("radial-15mm").value("deflated_diameter")
    assert said.startswith(f"size: {pressed:.2f} mm round its tube, flat, ")
    assert 15 < pressed < 15.33


def test_a_solved_chamber_is_said(tmp_path: Path) -> None:
    arguments = ["check", "1dof-5mm", "--set", "fits.diameter=20", *QUICK]
    said = CliRunner().invoke(app, arguments).output
    assert "note: 19.995 mm across with 1 inlet tab, within fits.diameter = 20" in said
