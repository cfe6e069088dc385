"""Runs of the command line as processes that can be starved, stopped and killed."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.hardship.starting import ANSWERING, ignored_signals

# Forks a child a run from an interpreter that has imported all it needs, so that a run takes
# a fraction of a second and a random moment falls into its work, not into its imports.
SERVER = f"""{ANSWERING}
import contextlib, io, json, os, sys
from sbafab.cli import main
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    main(["generate", "1dof-5mm", "-o", sys.argv[1]])
for line in sys.stdin:
    job = json.loads(line)
    if "wait" in job:
        print(os.waitstatus_to_exitcode(os.waitpid(job["wait"], 0)[1]), flush=True)
        continue
    child = os.fork()
    if child:
        print(child, flush=True)
        continue
    for number, path in ((1, job["out"]), (2, job["err"])):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    os.chdir(job["folder"])
    exec(job["before"], {{}})
    main(job["arguments"])
"""


@dataclass(frozen=True)
class Ended:
    """How a run ended: the exit code, or minus the signal's number."""

    code: int
    out: str
    err: str


class Runs:
    """Starts runs of the command line in a folder, each after some Python code ``before`` it."""

    def __init__(self, server: subprocess.Popen[str], logs: Path) -> None:
        self._server = server
        self._logs = logs

    def start(
        self, arguments: Sequence[str], folder: Path, before: str = "", out: str | None = None
    ) -> int:
        """The process id of a run that has begun."""
        number = len(list(self._logs.iterdir()))
        err = self._logs / f"{number}.err"
        printed = out or str(self._logs / f"{number}.out")
        job = {"arguments": list(arguments), "folder": str(folder), "before": before}
        pid = int(self._ask({**job, "out": printed, "err": str(err)}))
        self._last = {**getattr(self, "_last", {}), pid: (Path(printed), err)}
        return pid

    def wait(self, pid: int) -> Ended:
        code = int(self._ask({"wait": pid}))
        out, err = self._last[pid]
        return Ended(code, out.read_text() if out.is_file() else "", err.read_text())

    def run(
        self, arguments: Sequence[str], folder: Path, before: str = "", out: str | None = None
    ) -> Ended:
        return self.wait(self.start(arguments, folder, before, out))

    def _ask(self, job: dict[str, Any]) -> str:
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.write(json.dumps(job) + "\n")
        self._server.stdin.flush()
        return self._server.stdout.readline()


@pytest.fixture(scope="session")
def runs() -> Iterator[Runs]:
    """Return one server for all tests; its folders are open to every user.

    It is started as under ``nohup``, so that tests which stop runs ask for what they need.
    """
    with tempfile.TemporaryDirectory() as place:
        logs = Path(place) / "logs"
        logs.mkdir()
        for folder in (Path(place), logs):
            folder.chmod(0o777)
        with ignored_signals():
            server = subprocess.Popen(
                [sys.executable, "-c", SERVER, str(Path(place) / "scratch")],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        with server:
            yield Runs(server, logs)
            server.send_signal(signal.SIGTERM)


def hashes(folder: Path) -> dict[str, str]:
    """sha256 of every file of a folder."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


@dataclass(frozen=True)
class Output:
    """A folder that receives runs of one design, and what whole runs into it look like."""

    folder: Path
    whole: Mapping[str, dict[str, str]]
    """Hashes of all files by bond width."""

    @property
    def run_folder(self) -> Path:
        return self.folder / "1dof-5mm"

    def arguments(self, width: str, command: str = "generate") -> list[str]:
        return [command, "1dof-5mm", "-o", str(self.folder), "--set", f"bond.width={width}"]

    def held(self) -> str | None:
        """The bond width whose whole run lies in the folder, None of anything else."""
        found = hashes(self.run_folder) if self.run_folder.is_dir() else {}
        return next((width for width, files in self.whole.items() if files == found), None)

    def leftovers(self) -> set[str]:
        return set(os.listdir(self.folder)) - {"1dof-5mm", ".1dof-5mm.lock"}


@dataclass(frozen=True)
class WholeRuns:
    """Undisturbed runs by bond width: where they lie, and their hashes."""

    folders: Mapping[str, Path]
    hashes: Mapping[str, dict[str, str]]


@pytest.fixture(scope="session")
def whole_runs(runs: Runs, tmp_path_factory: pytest.TempPathFactory) -> WholeRuns:
    """Two designs run undisturbed; each holds what its own manifest claims."""
    whole, folders = {}, {}
    for width in ("0.8", "0.75"):
        output = Output(tmp_path_factory.mktemp("whole"), {})
        assert runs.run(output.arguments(width), output.folder).code == 0
        files = hashes(output.run_folder)
        manifest = json.loads((output.run_folder / "manifest.json").read_text())
        assert files == {**manifest["files"], "manifest.json": files["manifest.json"]}
        whole[width] = files
        folders[width] = output.folder
    return WholeRuns(folders, whole)


@pytest.fixture
def output(whole_runs: WholeRuns) -> Iterator[Output]:
    """A folder that already holds a whole run of bond width 0.8, open to every user."""
    with tempfile.TemporaryDirectory() as place:
        Path(place).chmod(0o777)
        made = Output(Path(place) / "out", whole_runs.hashes)
        shutil.copytree(whole_runs.folders["0.8"], made.folder)
        assert made.held() == "0.8"
        yield made
        for path in (made.folder, made.run_folder):
            if path.is_dir() and not path.is_symlink():
                path.chmod(0o755)
