"""The program as a user calls it, but without starting Python anew: the only door to it here."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import NamedTuple


class Ended(NamedTuple):
    """How a command ended: exit code, and what it printed for the user to read."""

    code: int
    out: str
    said: str


def sbafab(*arguments: str | Path) -> Ended:
    """``sbafab ARGUMENTS``. Whatever is raised but an exit is a traceback that a user would see."""
    from sbafab.cli import main

    out, said = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(said):
        try:
            main([str(argument) for argument in arguments])
            code = 0
        except SystemExit as ending:
            code = ending.code if isinstance(ending.code, int) else int(ending.code is not None)
    return Ended(code, out.getvalue(), said.getvalue())
