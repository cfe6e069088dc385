"""Templates kept compiled: made anew when they change, left out where they cannot be kept."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from jinja2 import Environment, FileSystemLoader

from sbafab.reports.html_templates import compiled_beside


def rendered(folder: Path) -> str:
    kept = compiled_beside(folder)
    environment = Environment(loader=FileSystemLoader(folder), bytecode_cache=kept)
    return environment.get_template("page.j2").render(name="1dof")


def test_a_template_is_kept_and_made_anew_when_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    page = tmp_path / "page.j2"
    page.write_text("design {{ name }}")
    assert rendered(tmp_path) == "design 1dof"
    (kept,) = (tmp_path / "__pycache__").iterdir()
    first = kept.read_bytes()
    assert rendered(tmp_path) == "design 1dof"
    assert kept.read_bytes() == first
    page.write_text("press {{ name }}")
    assert rendered(tmp_path) == "press 1dof"
    kept.write_bytes(b"no template")
    assert rendered(tmp_path) == "press 1dof"


def test_nothing_is_kept_where_python_keeps_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "page.j2").write_text("design {{ name }}")
    assert rendered(tmp_path) == "design 1dof"
    assert not (tmp_path / "__pycache__").exists()


def test_what_is_kept_is_read_where_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    (tmp_path / "page.j2").write_text("design {{ name }}")
    rendered(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(Environment, "compile", None)
    assert rendered(tmp_path) == "design 1dof"


def test_a_folder_that_takes_no_file_goes_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    (tmp_path / "page.j2").write_text("design {{ name }}")
    (tmp_path / "__pycache__").write_text("a file in the folder's place")
    assert rendered(tmp_path) == "design 1dof"
