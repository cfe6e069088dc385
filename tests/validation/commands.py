"""``sbafab predict`` run in this process."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from sbafab.cli import main


def run_predict(
    arguments: Sequence[str], capsys: pytest.CaptureFixture[str]
) -> tuple[int, str, str]:
    """Return exit code, output and errors."""
    with pytest.raises(SystemExit) as ended:
        main(["predict", *arguments])
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err
