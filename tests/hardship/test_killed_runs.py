"""Runs that are killed or stopped leave one whole run: the old one or the new one.

``SBAFAB_KILLS`` sets at how many moments.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
from typing import TYPE_CHECKING

import pytest

from sbafab.folders import swap
from sbafab.folders.swap import replaced_folder

pytestmark = pytest.mark.long

if TYPE_CHECKING:
    from conftest import Output, Runs

KILLS = int(os.environ.get("SBAFAB_KILLS", "5"))
OTHER = {"0.8": "0.75", "0.75": "0.8"}
ON_MESH = """
import os, sys
def hook(event, values):
    if event == "open" and ".part/mesh/" in str(values[0]):
        os.kill(os.getpid(), {number})
sys.addaudithook(hook)
"""
"""Sends the run a signal when it opens its first mesh file, half way through."""


AT_STEP = """
import atexit, os, sys
from pathlib import Path
count = 0
def hook(event, values):
    global count
    if event in {"open", "os.rename", "os.remove", "os.rmdir", "os.mkdir", "ctypes.dlsym"}:
        if count == STEP:
            os.kill(os.getpid(), 9)
        count += 1
sys.addaudithook(hook)
atexit.register(lambda: Path(COUNT).write_text(str(count)))
"""
"""Kills a run just before its file operation number STEP, and counts them in a run that ends."""


def test_killed_before_random_file_operations(runs: Runs, output: Output) -> None:
    counted = output.folder.parent / "count"

    def before(step: int) -> str:
        constants = f"STEP, COUNT = {step}, {str(counted)!r}\n"
        return f"exec({constants + AT_STEP!r}, dict())"

    assert runs.run(output.arguments("0.75"), output.folder, before(-1)).code == 0
    assert output.held() == "0.75"
    steps = int(counted.read_text())
    dice = random.Random(8)
    seen = set()
    for number in range(KILLS):
        held = output.held()
        assert held is not None
        # Each run begins alike, so that its operations are those that were counted.
        for name in output.leftovers():
            shutil.rmtree(output.folder / name)
        # The last one dies while it removes the old folder, its own being in place.
        late = number == KILLS - 1
        step = steps - 5 if late else int(steps * (number + dice.random()) / KILLS)
        ended = runs.run(output.arguments(OTHER[held]), output.folder, before(step))
        assert ended.code == -signal.SIGKILL
        seen.add(output.held() == held)
        assert output.held() is not None, f"killed before operation {step} of {steps}"
    # Some died before the exchange and some after it, while they removed the old folder.
    assert seen == {True, False}
    last = output.held()
    assert last is not None
    assert runs.run(output.arguments(OTHER[last]), output.folder).code == 0
    assert output.leftovers() == set()


@pytest.mark.parametrize(
    ("place", "holds"), [("before exchange", "0.8"), ("after exchange", "0.75")]
)
def test_killed_on_either_side_of_the_exchange(
    place: str, holds: str, runs: Runs, output: Output
) -> None:
    kill = f"os.kill(os.getpid(), {signal.SIGKILL:d})"
    first, second = (kill, "real(a, b)") if place == "before exchange" else ("real(a, b)", kill)
    before = (
        "import os; from sbafab.folders import swap; real = swap._exchange\n"
        f"swap._exchange = lambda a, b, os=os, real=real: ({first}, {second})"
    )
    ended = runs.run(output.arguments("0.75"), output.folder, before)
    assert ended.code == -signal.SIGKILL
    assert output.held() == holds
    assert len(output.leftovers()) == 1
    assert runs.run(output.arguments(OTHER[holds]), output.folder).code == 0
    assert output.held() == OTHER[holds]
    assert output.leftovers() == set()


def test_killed_between_two_renames_the_old_folder_comes_back(
    runs: Runs, output: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = (
        "import os; from pathlib import Path; from sbafab.folders import swap\n"
        "swap._exchange = lambda a, b: False\n"
        "rename = Path.rename\n"
        "def once(self, target, rename=rename, os=os):\n"
        "    rename(self, target)\n"
        f"    os.kill(os.getpid(), {signal.SIGKILL:d})\n"
        "Path.rename = once\n"
    )
    ended = runs.run(output.arguments("0.75"), output.folder, before)
    assert ended.code == -signal.SIGKILL
    assert not output.run_folder.exists()
    with pytest.raises(RuntimeError), replaced_folder(output.run_folder):
        raise RuntimeError
    assert output.held() == "0.8"
    assert output.leftovers() == set()
    monkeypatch.setattr(swap, "_exchange", lambda a, b: False)
    assert runs.run(output.arguments("0.75"), output.folder).code == 0
    assert output.held() == "0.75"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_stopped_half_way_it_tidies_up(number: signal.Signals, runs: Runs, output: Output) -> None:
    ended = runs.run(output.arguments("0.75"), output.folder, ON_MESH.format(number=int(number)))
    assert ended.code == 128 + number
    assert ended.err.strip().startswith("sbafab: stopped")
    assert "Traceback" not in ended.err
    assert output.held() == "0.8"
    assert output.leftovers() == set()


def test_a_tidied_name_does_not_take_anothers_folder(output: Output) -> None:
    """Of designs named 1dof-5mm and 1dof-5mm.b, neither removes what the other is writing."""
    with replaced_folder(output.folder / "1dof-5mm.b") as theirs:
        (theirs / "file").write_text("begun")
        with pytest.raises(RuntimeError), replaced_folder(output.run_folder):
            raise RuntimeError
        assert (theirs / "file").read_text() == "begun"
