"""The benchmarks' tasks are done as they say; how fast is for them to tell."""

from __future__ import annotations

from pathlib import Path

from benchmarks import checking, plates_sbafab
from benchmarks.scaling import rules_and_cut_files
from benchmarks.task import plates


def test_plates_are_right_and_have_true_arcs(tmp_path: Path) -> None:
    plates_sbafab.main(tmp_path)
    assert len(list(tmp_path.iterdir())) == len(plates())
    assert checking.complaint(tmp_path) is None
    assert checking.has_true_arcs(tmp_path)


def test_rules_and_cut_files_are_timed() -> None:
    assert rules_and_cut_files(1, 0) > 0
