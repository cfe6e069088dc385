"""Running ``sbafab import`` in a folder of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from sbafab.cli import app

Importing = Callable[..., Result]


@pytest.fixture
def importing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Importing:
    """Imports a source in an empty folder, and checks that a refused one leaves nothing there."""
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)

    def run(source: Path, *options: str) -> Result:
        before = sorted(here.rglob("*"))
        result = CliRunner().invoke(app, ["import", str(source), *options])
        if result.exit_code:
            assert result.exit_code == 2, result.output
            assert sorted(here.rglob("*")) == before
            assert result.output.startswith("sbafab: ")
            assert "\n" not in result.output.strip()
        return result

    return run
