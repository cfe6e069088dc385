"""``sbafab map``: files for other programs."""

from __future__ import annotations

import csv
import json
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

import sbafab
from sbafab.models.balloon_map import BalloonMap
from tests.cli.conftest import Run
from tests.site.formats import hold


@pytest.fixture(scope="module")
def balloon() -> BalloonMap:
    return sbafab.stack("1dof-5mm").maps[0]


def test_csv_holds_force_and_volume(balloon: BalloonMap, run: Run) -> None:
    code, out, _ = run("map", "1dof-5mm", "--points", "4")
    assert code == 0
    rows = list(csv.DictReader(out.splitlines()))
    # The sixteen places without those at which the map does not hold.
    assert 8 <= len(rows) < 16
    for row in rows:
        p, h = float(row["pressure_kpa"]), float(row["height_mm"])
        force = float(balloon.force(p, h))
        assert float(row["force_mn"]) == pytest.approx(force, rel=1e-4, abs=1e-4)
        assert float(row["volume_ul"]) == pytest.approx(float(balloon.volume(p, h)), rel=1e-4)


def test_models_of_robots_are_files_of_xml(tmp_path: Path, run: Run) -> None:
    for file, options, root in (
        ("stack.xml", ["--pressures", "10,0 kPa,0"], "mujoco"),
        ("even.xml", [], "mujoco"),
    ):
        path = tmp_path / file
        design = ["3dof-15mm", "--set", "stack.balloons=2"]
        assert run("map", *design, "--to", str(path), *options)[0] == 0
        assert ET.parse(path).getroot().tag == root
    assert "for 10, 0, 0 kPa" in (tmp_path / "stack.xml").read_text()
    assert "for 10, 10, 10 kPa" in (tmp_path / "even.xml").read_text()


@pytest.mark.long
def test_reproduce_writes_every_figure_with_the_papers_error_bars(tmp_path: Path, run: Run) -> None:
    code, out, _ = run("reproduce", "-o", str(tmp_path), "--json")
    assert code == 0
    folder = tmp_path / "reproduction"
    hold("reproduction", json.loads(out))
    rows = json.loads(out)["rows"]
    assert rows == json.loads((folder / "reproduction.json").read_text())["rows"]
    # One question, one answer: the calibrated values are those that predict gives by default.
    calibrated = json.loads(out)["calibrated"]
    assert (calibrated["held_out"]["points"], calibrated["held_out"]["inside"]) == (28, 27)
    curves = {curve["curve"]: curve["points"] for curve in calibrated["curves"]}
    _, out, _ = run("predict", "3dof-15mm", "--pressure", "100", "--json", "-o", str(tmp_path))
    told = {
        figure["name"]: figure["value"]
        for figure in json.loads(out)["figures"]
        if figure["model"].startswith(("elastic stack", "sum of the films"))
    }
    (flat,) = curves["flat-height"]
    assert flat["model"] == pytest.approx([told["folded height"]] * 2, rel=1e-6)
    held = curves["force-3dof"][0]
    assert held["model"] == pytest.approx([told["blocked force at 100 kPa, flat"]] * 2, rel=1e-3)
    for point, angle in zip(curves["force-bent"], (30, 60, 90), strict=True):
        forces = [
            told[f"force at 100 kPa in {chambers}, bent by {angle} deg"]
            for chambers in ("one chamber", "2 chambers")
        ]
        # With all chambers filled in the end it pushes more.
        assert point["model"][0] == pytest.approx(min(forces), rel=1e-3)
        assert point["model"][1] > max(forces)
    for points in curves.values():
        for point in points:
            low, high = point["interval"]
            assert point["within"] is (low <= point["measured"] <= high)
            # Set-ups that are unlikely by the fit may lie outside.
            assert low < point["model"][1]
            assert point["model"][0] < high
    assert len(list(folder.glob("figure-*.svg"))) == 7
    assert "1.48 +- 0.04 N" in (folder / "reproduction.md").read_text(encoding="utf-8")
    assert "paper: 3-DoF, 100 kPa" in (folder / "figure-8a-force-3dof.svg").read_text()
