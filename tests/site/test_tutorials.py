"""Every tutorial works as it is written."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from tests.site.tutorial import follow

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "learn").glob("*.md"))
NOTEBOOKS = {"python"}
"""Run by the build of the site."""


def environment(folder: Path) -> dict[str, str]:
    """With an ``sbafab`` that runs this source with this Python."""
    bin_ = folder / "bin"
    bin_.mkdir()
    command = bin_ / "sbafab"
    command.write_text(
        f'#!/bin/sh\nexec "{sys.executable}" -c "from sbafab.entry import main; main()" "$@"\n'
    )
    command.chmod(0o755)
    path = os.pathsep.join((str(bin_), os.environ["PATH"]))
    return {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "COLUMNS": "80"}


@pytest.mark.long
@pytest.mark.parametrize(
    "page", [p for p in PAGES if p.stem not in NOTEBOOKS], ids=lambda p: p.stem
)
def test_a_tutorial_works_as_written(page: Path, tmp_path: Path) -> None:
    desk = tmp_path / "desk"
    desk.mkdir()
    assert follow(page, desk, environment(tmp_path)) > 0


def test_a_tutorial_that_says_something_else_fails(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```sh\necho one two\n```\n\n```output\none\ntwo\n```\n")
    assert follow(page, tmp_path, dict(os.environ)) == 1
    page.write_text("```sh\necho one two\n```\n\n```output\ntwo\none\n```\n")
    with pytest.raises(AssertionError, match="'one' is not printed"):
        follow(page, tmp_path, dict(os.environ))
    page.write_text("```sh\nfalse\n```\n")
    with pytest.raises(AssertionError):
        follow(page, tmp_path, dict(os.environ))
