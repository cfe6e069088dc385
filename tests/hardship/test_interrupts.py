"""Ctrl-C at any moment, amid imports too, ends the command with one line and exit code 130.

``SBAFAB_KILLS`` sets at how many moments.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.hardship.starting import ANSWERING, ignored_signals
from tests.quick import few

INTERRUPTS = int(os.environ.get("SBAFAB_KILLS", "4"))
PROGRAM = """
import os, sys
from sbafab import entry
count = 0
def hook(event, values):
    global count
    if event == "import":
        count += 1
        if count == {step}:
            os.kill(os.getpid(), {number})
if {step}:
    sys.addaudithook(hook)
else:
    import atexit
    sys.addaudithook(hook)
    atexit.register(lambda: print(count))
sys.argv = ["sbafab", *{arguments!r}]
entry.main()
"""
"""Sends itself a signal at import number ``step``, or prints their count where that is 0."""
COMMANDS = {
    "help": ["--help"],
    "check": ["check", "1dof-5mm", "--set", "stack.balloons=1"],
}


def run(arguments: list[str], step: int, folder: Path) -> subprocess.CompletedProcess[str]:
    program = ANSWERING + PROGRAM.format(step=step, number=int(signal.SIGINT), arguments=arguments)
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=folder, check=False
    )


@pytest.mark.parametrize("command", few(COMMANDS, 1, setting="SBAFAB_KILLS"))
def test_interrupted_at_random_imports(command: str, tmp_path: Path) -> None:
    arguments = COMMANDS[command]
    whole = run(arguments, 0, tmp_path)
    assert whole.returncode == 0, whole.stderr
    imports = int(whole.stdout.splitlines()[-1])
    dice = random.Random(4)
    for number in range(INTERRUPTS):
        step = 1 + int(imports * (number + dice.random()) / INTERRUPTS)
        ended = run(arguments, step, tmp_path)
        assert (ended.returncode, ended.stderr.count("\n")) == (130, 1), (step, ended.stderr)
        assert ended.stderr.startswith("sbafab: stopped")


def test_started_where_ctrl_c_is_ignored_a_program_is_stopped_all_the_same(tmp_path: Path) -> None:
    """As these tests are under ``nohup`` or in the background."""
    with ignored_signals():
        ended = run(COMMANDS["help"], 9, tmp_path)
    assert ended.returncode == 130
    assert ended.stderr.startswith("sbafab: stopped")


def test_an_interrupt_that_is_ignored_stays_so(tmp_path: Path) -> None:
    program = PROGRAM.format(step=9, number=int(signal.SIGINT), arguments=["--help"])
    ignoring = f"import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n{program}"
    ended = subprocess.run(
        [sys.executable, "-c", ignoring], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert (ended.returncode, ended.stderr) == (0, "")


LOST = """
import os, sys
from sbafab.cli import exit as ending
class Watched:
    def __del__(self):
        os.kill(os.getpid(), {number})
with ending.exit_plainly():
    watched = Watched()
    del watched
    import time
    time.sleep(0.2)
"""
CONVERTED = """
import os
from sbafab.cli import exit as ending
with ending.exit_plainly():
    try:
        os.kill(os.getpid(), {number})
        for _ in range(1000): pass
    except BaseException:
        raise ImportError("a module failed to import") from None
"""


@pytest.mark.parametrize("program", [LOST, CONVERTED], ids=["lost", "converted"])
def test_an_interrupt_that_comes_out_as_something_else_stops_all_the_same(program: str) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", ANSWERING + program.format(number=int(signal.SIGINT))],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert (ended.returncode, ended.stderr.count("\n")) == (130, 1), ended.stderr
    assert ended.stderr.startswith("sbafab: stopped")


def test_the_door_loads_nothing_before_it_is_guarded() -> None:
    program = "import sys; known = set(sys.modules); import sbafab.entry\n"
    found = subprocess.run(
        [sys.executable, "-c", f"{program}print(*sorted(set(sys.modules) - known))"],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )
    assert set(found.stdout.split()) <= {
        "__future__",
        "os",
        "sbafab",
        "sbafab.entry",
        "sbafab.errors",
        "sbafab.version",
    }
