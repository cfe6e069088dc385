"""Running commands in this process, in a folder of their own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from sbafab.cli import main

Run = Callable[..., tuple[int, str, str]]
"""Takes a command's arguments, the first in one text; returns exit code, output and errors."""


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SBAFAB_LAB", raising=False)

    def call(command: str, *more: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            main([*command.split(), *more])
        out, err = capsys.readouterr()
        return int(ended.value.code or 0), out, err

    return call
