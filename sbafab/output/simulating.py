"""A simulator run on a design, its results in the design's folder."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.output.checking import check
from sbafab.output.earlier import refuse_to_replace
from sbafab.output.manifest import as_json
from sbafab.output.planned import Checked
from sbafab.output.printed import SIMULATE_SCHEMA
from sbafab.output.run import Extras, generate, with_folder
from sbafab.progress import Progress, unheard
from sbafab.rules.finding import Finding
from sbafab.simulators.simulator import Name, Result, Wish, simulator

UNITS = {
    "length": "mm",
    "pressure": "kPa",
    "volume": "ul",
    "stress": "MPa",
    "work": "uJ",
    "angle": "degrees",
    "time": "s",
    "rate": "steps/s",
}
"""Of what ``result.json`` holds."""


@dataclass(frozen=True)
class Simulated:
    """What a simulator found; nothing, and no folder, where a rule ``failed`` before."""

    findings: Sequence[Finding]
    folder: Path | None
    result: Result

    @property
    def failed(self) -> bool:
        """Whether a rule failed that the design does not waive; no simulator ran then."""
        return self.folder is None


def result_json(found: Result) -> dict[str, Any]:
    """What ``result.json`` holds."""
    head = {"schema": SIMULATE_SCHEMA, "units": UNITS}
    return {**head, **found.figures, "stopped": found.stopped}


def simulate(
    design: Design,
    name: Name,
    wish: Wish,
    out: Path = Path("out"),
    progress: Progress | None = None,
    export: bool = False,
) -> Simulated:
    """Runs the simulator into ``out/<design name>/<name>/``; ``export`` only writes its input.

    Raises DesignError or OutputError for what it cannot do, before it starts where that can be
    told.
    """
    tell = progress or unheard
    found = Result((), {})
    with tempfile.TemporaryDirectory() as place:
        checked = Checked(design, *check(design, tell))
        if checked.failed:
            return Simulated(checked.findings, None, found)
        # Said before a run of hours, not after it.
        refuse_to_replace(out / design.name, design, checked.waived, (name,))
        # A folder in the temporary one has the usual rights, the temporary one itself has not.
        folder = Path(place) / name
        if export:
            simulator(name).export(checked.laminate, wish, folder)
        else:
            try:
                found = simulator(name).run(checked.laminate, wish, folder, tell)
            except OutputError as error:
                raise _with_log(error, folder, out / f"{design.name}-{name}-failed.log") from None
            told = as_json(result_json(found))
            (folder / "result.json").write_text(told, encoding="utf-8", newline="\n")
        extras = Extras(also=with_folder(folder), own=(name,))
        run = generate(design, out, (), tell, extras=extras)
    return Simulated(checked.findings, run.folder / name, found)


def _with_log(error: OutputError, folder: Path, place: Path) -> OutputError:
    """The same error, its log copied to a place that stays and named there."""
    for log in sorted(folder.glob("*.log")):
        said = str(error)
        if str(log) in said:
            try:
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(log, place)
            except OSError:
                return OutputError(said.replace(f" (see {log})", ""))
            return OutputError(said.replace(str(log), str(place)))
    return error
