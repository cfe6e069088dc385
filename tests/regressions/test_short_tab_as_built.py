"""A tab no longer than its fillet has no straight sides, and is an inlet all the same."""

from __future__ import annotations

from pathlib import Path

from sbafab.actuators import load_design
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate


def test_a_tab_no_longer_than_its_fillet_is_found_as_built(tmp_path: Path) -> None:
    short = ["stack.balloons=2", "inlet.tab_length=1.0", "fillet.radius=1.0"]
    wide = ["chamber.width=25.5", "chamber.length=8", "tube.outer_diameter=47", "chamber.count=1"]
    film = "sheets.tpe.width=200"
    run = generate(RunRequest(load_design("radial-15mm", [*short, *wide, film]), tmp_path, ["cut"]))
    assert not run.failed
    assert [finding.rule for finding in check_folder(run.folder) if finding.verdict == "fail"] == []


def test_a_tab_that_its_fillet_takes_whole_is_found_as_built(tmp_path: Path) -> None:
    short = ["stack.balloons=1", "inlet.tab_length=1.0", "fillet.radius=2.561"]
    run = generate(
        RunRequest(load_design("1dof-5mm", [*short, "chamber.diameter=4.743"]), tmp_path, ["cut"])
    )
    assert not run.failed
    assert [finding.rule for finding in check_folder(run.folder) if finding.verdict == "fail"] == []
