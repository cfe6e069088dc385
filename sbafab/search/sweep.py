"""A sweep: measure every design once, journal its rows, then write tables and a page."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from filelock import FileLock, Timeout

from sbafab.design.files import KIT, OUTLINE, kit_names
from sbafab.design.identity import design_sha256
from sbafab.design.records import Design, Free, plain_tables
from sbafab.documents import Document, attribute
from sbafab.errors import OutputError, Stopped
from sbafab.folders.swap import MANIFEST, replace_text, writing
from sbafab.markup import data_frame
from sbafab.models.calibration import factors_of
from sbafab.models.pneumatics import refuse_pressure, usual_pressures
from sbafab.runtime import Progress, ignore_progress
from sbafab.search.quantities import Requirement, refuse_absent, shown_value
from sbafab.search.sweep_report import (
    CSV,
    JOURNAL,
    PAGE,
    Table,
    designs_before,
    sweep_html,
    write_table,
)
from sbafab.search.trials import (
    MeasureJob,
    SweepOutcome,
    SweepRow,
    dask_pool,
    failure,
    fingerprint,
    local_pool,
    run_jobs,
)
from sbafab.search.vary import Values, grid, latin_hypercube, refuse_unknown

if TYPE_CHECKING:
    from pandas import DataFrame

SECONDS = 300.0
"""Time limit per design, s."""
MEASURED = "measuring designs"


@dataclass(frozen=True)
class SweepRequest:
    """Designs and settings of a sweep: ``samples`` drawn by Latin hypercube, or the whole grid.

    ``workers`` processes of this machine (as many as processors by default), or the cluster behind
    ``dask``; each design may take ``seconds``. ``pressures_kpa`` default to a prediction's. A
    design that misses one of the ``requirements`` fails.
    """

    design: Design
    varied: tuple[Free, ...]
    samples: int | None = None
    seed: int = 0
    pressures_kpa: tuple[float, ...] = ()
    workers: int | None = None
    dask: str | None = None
    seconds: float = SECONDS
    requirements: tuple[Requirement, ...] = ()

    def __post_init__(self) -> None:
        form = self.design.form
        pressures = self.pressures_kpa or usual_pressures(form)
        refuse_pressure(pressures, form.works_under_vacuum)
        object.__setattr__(self, "pressures_kpa", pressures)
        for row in self.requirements:
            refuse_absent(row.quantity, self.design, [key.key for key in self.varied], "--vary")


@dataclass(frozen=True)
class SweptDesigns:
    """The result of a sweep: its folder, number of designs by outcome, number measured in this run.

    ``table`` holds the rows; ``no_longer_asked`` counts designs of an earlier sweep in the tables
    that it has replaced.
    """

    folder: Path
    designs: int
    measured: int
    outcomes: dict[SweepOutcome, int]
    files: tuple[str, ...]
    table: Table = field(repr=False, compare=False)
    no_longer_asked: int = 0

    @property
    def failed(self) -> dict[str, int]:
        """The number of designs that fail each rule and limit."""
        return {
            cause: len(told)
            for cause, told in self.table.causes.items()
            if cause not in self.outcomes
        }

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One row per design, with the columns of ``sweep.csv``; their names include units."""
        names = self.table.written
        return [dict(zip(names, cells, strict=True)) for cells in self.table.cells(names)]

    def frame(self) -> DataFrame:
        """Return ``rows`` as a pandas DataFrame. Raises DesignError without pandas."""
        return data_frame(self.rows)


class SweepDocument(Document, schema="sbafab/sweep@1"):
    """The output of ``sweep --json``."""

    folder: Path
    designs: int
    measured_now: int = attribute("measured")
    no_longer_asked: int
    outcomes: dict[str, int]
    """designs by outcome"""
    failed: dict[str, int]
    """designs by each rule and limit that they fail"""
    files: list[str]
    """files in the folder"""


def designs_of(request: SweepRequest) -> list[Values]:
    """Return the values of every design, in the tables' order. Raises DesignError."""
    varied = [_from_here(varied_key) for varied_key in request.varied]
    refuse_unknown(request.design, varied)
    if request.samples is None:
        return list(grid(varied))
    return list(latin_hypercube(varied, request.samples, request.seed))


def sweep(request: SweepRequest, out: Path, progress: Progress = ignore_progress) -> SweptDesigns:
    """Measure all designs into ``out/<name>-sweep/`` and return the result.

    Measurements of an earlier run are reused if design, values and program are the same. Raises
    DesignError for bad input, OutputError if nothing can be written or no worker answers.
    """
    values = designs_of(request)
    folder = out / f"{request.design.name}-sweep"
    with _locked(folder):
        before = designs_before(folder / CSV)
        with closing(Journal(folder / JOURNAL, request.seconds)) as journal:
            keys = _keys(request, values)
            missing = {
                key: each for key, each in zip(keys, values, strict=True) if key not in journal
            }
            try:
                _measure(request, missing, journal, progress)
            except KeyboardInterrupt as stop:
                done = sum(key in journal for key in keys)
                sentence = f"{done} of {len(keys)} designs are computed; run the same command again"
                raise Stopped(f"{sentence} to resume", *stop.args) from stop
        progress("writing tables", 0, 1)
        judge = partial(_judged, requirements=request.requirements)
        table = Table(
            lambda: map(judge, journal.rows(keys)),
            values,
            request.pressures_kpa,
            bool(factors_of(request.design).calibration),
            _labels(request),
        )
        write_table(table, folder / CSV)
        limit_lines = [f"{row.quantity.label}: {row.bound}" for row in request.requirements]
        page = sweep_html(request.design, request.varied, table, limit_lines)
        replace_text(folder / PAGE, page)
    files, gone = (CSV, PAGE, JOURNAL), len(before - table.hashes)
    outcomes = dict(table.outcomes)
    return SweptDesigns(folder, len(values), len(missing), outcomes, files, table, gone)


def _measure(
    request: SweepRequest, missing: Mapping[str, Values], journal: Journal, progress: Progress
) -> None:
    """Measure the values of each key and add their rows to the journal."""
    if not missing:
        return
    base: MeasureJob = {
        "program": fingerprint(),
        "tables": plain_tables(request.design),
        "folder": str(request.design.folder.absolute()),
        "pressures": list(request.pressures_kpa),
        "quantities": _labels(request),
    }
    pool = local_pool(request.workers) if request.dask is None else dask_pool(request.dask)
    jobs = ((key, {**base, "values": dict(values)}) for key, values in missing.items())
    done = 0
    progress(MEASURED, done, len(missing))
    with pool as workers, closing(run_jobs(workers, jobs, request.seconds)) as rows:
        for measured in rows:
            if measured is not None:
                journal.add(*measured)
                done += 1
            progress(MEASURED, done, len(missing))


def _labels(request: SweepRequest) -> list[str]:
    """Return the labels of the quantities with limits."""
    return list(dict.fromkeys(row.quantity.label for row in request.requirements))


def _judged(row: SweepRow, requirements: Sequence[Requirement]) -> SweepRow:
    """Return the row with each limited quantity as a rule, which fails if its limit is missed."""
    if "quantities" not in row:
        return row
    rules, failed = dict(row["rules"]), dict(row.get("failed", {}))
    for each in requirements:
        label, limit = each.quantity.label, each.limit
        value, _, problem = row["quantities"][label]
        is_met = value is not None and each.holds(value)
        margin = None
        if value is not None:
            margin = round(value - limit if each.at_least else limit - value, 6)
        cells = ["pass" if is_met else "fail", margin, value, limit, each.quantity.unit]
        # Of a lower and an upper limit the one that is missed, or nearer.
        both = rules.get(label, cells), cells
        rules[label] = min(both, key=lambda cells: (cells[0] != "fail", cells[1] or 0.0))
        if not is_met:
            failed[label] = problem or f"{shown_value(each.quantity, value)}, not {each.bound}"
    is_failure = row["outcome"] in ("passes", "fails") and failed
    return {**row, "rules": rules, **(failure(failed) if is_failure else {})}


def _keys(request: SweepRequest, values: Sequence[Values]) -> list[str]:
    """Return a hash of each design and of the request, for this program version."""
    question = [fingerprint(), design_sha256(request.design), list(request.pressures_kpa)]
    question += [_labels(request)] if request.requirements else []
    return [
        hashlib.sha256(json.dumps([*question, _contents(design_values)]).encode()).hexdigest()
        for design_values in values
    ]


def _contents(values: Values) -> dict[str, Any]:
    """Return the values, with the file's content for a drawing or kit."""
    return {
        key: hashlib.sha256(Path(value).read_bytes()).hexdigest()
        if key in (OUTLINE, KIT) and isinstance(value, str) and Path(value).is_file()
        else value
        for key, value in values.items()
    }


def _from_here(varied: Free) -> Free:
    """Return the tables with paths of drawings and kits relative to the working directory."""
    if varied.key not in (OUTLINE, KIT):
        return varied
    paths = tuple(
        path if varied.key == KIT and path in kit_names() else str(Path(str(path)).absolute())
        for path in varied.values
    )
    return Free.of_choices(varied.key, paths)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Create and lock the folder. Raises OutputError."""
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / MANIFEST).exists():
            raise OutputError(
                f"{folder} contains a design of that name; choose another folder with -o"
            )
        try:
            with FileLock(folder / ".lock", timeout=0):
                yield
        except Timeout:
            raise OutputError(
                f"another sweep is writing {folder}; wait for it to end or choose another folder "
                "with -o"
            ) from None


# The journal: one line per measured design, append-only, from which a sweep resumes.


class Journal:
    """Rows of measured designs in a file, by the hash of design and request; read on demand.

    An incomplete line of a killed run is skipped and its design measured again, as is a design that
    timed out at a limit below ``seconds``. Raises OutputError if the file cannot be written.
    """

    def __init__(self, path: Path, seconds: float) -> None:
        self.path = path
        self._places: dict[str, int] = {}
        with writing(path):
            self._file: IO[bytes] = path.open("a+b")
            self._file.seek(0)
            at, line = 0, b""
            for line in self._file:
                key = _key_of(line, seconds)
                if key is not None:
                    self._places[key] = at
                at += len(line)
            if line and not line.endswith(b"\n"):
                self._file.write(b"\n")

    def __contains__(self, key: str) -> bool:
        return key in self._places

    def add(self, key: str, row: SweepRow) -> None:
        """Write a row, unless it exists already."""
        if key in self._places:
            return
        line = json.dumps({"key": key, "row": row}, ensure_ascii=False, separators=(",", ":"))
        self._file.seek(0, os.SEEK_END)
        self._places[key] = self._file.tell()
        self._file.write(line.encode() + b"\n")
        self._file.flush()

    def rows(self, keys: Iterable[str]) -> Iterator[SweepRow]:
        """Yield the rows of these keys in order, with one in memory at a time."""
        with self.path.open("rb") as opened:
            for key in keys:
                opened.seek(self._places[key])
                yield json.loads(opened.readline())["row"]

    def close(self) -> None:
        """Flush the written rows to disk."""
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()


def _key_of(line: bytes, seconds: float) -> str | None:
    """Return the key of a complete line that need not be measured again."""
    try:
        entry = json.loads(line)
        key, row = entry["key"], entry["row"]
        was_short = row["outcome"] == "too long" and row["seconds"] < seconds
    except (ValueError, KeyError, TypeError):
        return None
    is_whole = line.endswith(b"\n") and isinstance(key, str)
    return key if is_whole and not was_short else None
