"""What a command sets for its whole process, and that a caller's process stays as it is."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from sbafab.process import YOUNG

KEYS = ("OPENBLAS_NUM_THREADS", "PYDANTIC_DISABLE_PLUGINS")
PROGRAM = """
import contextlib, gc, io, os, sys
from {door} import main
sys.argv = ["sbafab", "--version"]
with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
    main({arguments})
print(gc.get_threshold()[0], *(os.environ.get(key) for key in {keys}))
"""


def settings_after(door: str, arguments: str = "") -> list[str]:
    """The threshold of the collector and the variables, in a fresh interpreter."""
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(door=door, arguments=arguments, keys=KEYS)],
        capture_output=True,
        text=True,
        check=True,
        env={name: value for name, value in os.environ.items() if name not in KEYS},
    )
    return run.stdout.split()


@pytest.mark.parametrize("door", ["sbafab.entry", "sbafab.cli"])
def test_the_command_sets_its_process_up(door: str) -> None:
    assert settings_after(door) == [str(YOUNG), "1", "__all__"]


def test_a_caller_with_arguments_of_its_own_keeps_its_process() -> None:
    threshold, *variables = settings_after("sbafab.cli", '["--version"]')
    assert int(threshold) < YOUNG
    assert variables == ["None", "None"]
