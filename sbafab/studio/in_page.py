"""Requests answered by Python in the page itself, without a server: the same jobs, one process.

The page's worker calls :func:`answers` with what it would have asked a server and hands on every
line as it comes; between two lines it may give up. Files are written into the page's memory alone.
"""

from __future__ import annotations

import importlib.util
import json
import secrets
import shutil
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from sbafab import api
from sbafab.errors import SbafabError
from sbafab.studio import forms, jobs
from sbafab.studio.places import RunFolder, zipped

FOLDER = Path("/studio")
"""Where a design would lie; there is nothing in it that one could refer to."""
OUT = FOLDER / "out"
JOBS = {
    "/api/live": "live",
    "/api/motion": "motion",
    "/api/generate": "cut",
}
"""Paths that are answered line by line; what generate writes beside cut files takes a computer."""
OPTIONAL = ("numpy",)
"""Modules that the page may have been made without."""
_RUNS: dict[str, RunFolder] = {}


def answers(
    path: str, body: str = "{}", progress: Callable[[str], None] | None = None
) -> Iterator[str]:
    """The answer to a request, line by line as JSON; what refuses it is a line too.

    ``tell`` gets what is known between two lines, such as progress.
    """
    try:
        for answer in _answered(path, body, progress):
            yield json.dumps(answer, separators=(",", ":"))
    except SbafabError as error:
        yield json.dumps(jobs.refusal(str(error)))


def _answered(
    path: str, body: str, progress: Callable[[str], None] | None
) -> Iterator[dict[str, Any]]:
    if path == "/api/start":
        lacks = [name for name in OPTIONAL if importlib.util.find_spec(name) is None]
        yield {**forms.started(None), "lacks": lacks}
    elif path.startswith("/api/template/"):
        yield {"text": api.template(path.rpartition("/")[2])}
    elif path in JOBS:
        FOLDER.mkdir(exist_ok=True)
        job = {**forms.job(FOLDER, forms.table(body)), "do": JOBS[path]}
        if progress is not None:
            job["tell"] = lambda answer: progress(json.dumps(answer))
        yield from _cut(job) if path == "/api/generate" else jobs.answers(job, _never)
    else:
        raise SbafabError(f"a page without a server does not answer {path}")


def _cut(job: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The answers of a cut; what an earlier one wrote is gone."""
    _RUNS.clear()
    # The page's memory has no file locks; nobody else writes there.
    warnings.filterwarnings("ignore", "only soft file lock")
    shutil.rmtree(OUT, ignore_errors=True)
    for answer in jobs.answers({**job, "out": str(OUT)}, _never):
        if answer["kind"] == "made":
            key = secrets.token_hex(8)
            _RUNS[key] = RunFolder(OUT / answer["name"], answer["name"])
            answer["key"] = key
        yield answer


def made_bytes(path: str) -> bytes | None:
    """A file of the last run, or all of it as ``KEY.zip``; None for any other path."""
    key, _, name = path.removeprefix("/made/").partition("/")
    run = _RUNS.get(key.removesuffix(".zip"))
    if run is None:
        return None
    if not name:
        return zipped(run)
    file = run.file(name)
    return file.read_bytes() if file else None


def _never() -> None:
    """Who gives up closes the answers."""
