"""One run: a design becomes a folder with all that was asked for, written whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab.cutting.properties import TRUE_ARCS, Curves
from sbafab.design.files import design_sha256
from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.models.figures import Prediction
from sbafab.notebook import table_html
from sbafab.output.batch import Batch, close_folder, plan_batch, write_batch, write_text
from sbafab.output.checked import EVERYTHING, GENERATOR, PICTURES, Checked, RunPart, check, plan
from sbafab.output.earlier import (
    CUT,
    MESH,
    PRESS,
    carry_over,
    refuse_to_replace,
    removed_files,
    would_replace,
)
from sbafab.output.manifest import as_json, identity
from sbafab.output.schema_ids import SIMULATE_SCHEMA
from sbafab.output.self_check import refuse_unlike
from sbafab.output.swap import SCHEMA, listed_files, replaced_folder
from sbafab.pressing.schedule import Schedule
from sbafab.process import Progress, unheard
from sbafab.rules.deck import has_failed
from sbafab.rules.finding import Finding, Findings
from sbafab.simulators.simulator import Name, Result, Wish, simulator

if TYPE_CHECKING:
    from sbafab.meshing.conforming.layup import MeshSettings
    from sbafab.meshing.conforming.meshes import ConformingMeshes

ExtraFiles = Callable[[Laminate, Path], None]
"""Writes something of its own for a laminate into the folder of a run."""
OWN: dict[RunPart, tuple[str, ...]] = {"cut": CUT, "press": PRESS, "mesh": MESH, "preview": ()}
"""What of an earlier run is made again with a part."""


@dataclass(frozen=True)
class Conforming:
    """Volume and shell meshes that are asked for, in the formats of these file endings."""

    settings: MeshSettings
    formats: tuple[str, ...]


class Extras(NamedTuple):
    """What a run may be asked for beside its parts.

    ``conforming``: volume and shell meshes, which take the extra "mesh"; ``also`` writes files and
    folders with the names ``own`` into the folder of a design that holds.
    """

    conforming: Conforming | None = None
    also: ExtraFiles | None = None
    own: tuple[str, ...] = ()


NO_EXTRAS = Extras()


@dataclass(frozen=True, repr=False)
class Run:
    """What a run made of one design or several; nothing to cut where it ``failed``.

    ``manifest`` is empty where nothing was written. ``between``: what was found between the parts
    of an assembly.
    """

    checked: tuple[Checked, ...]
    folder: Path
    manifest: dict[str, Any] = field(default_factory=dict)
    batch: Batch | None = None
    between: tuple[Finding, ...] | None = None
    dropped: tuple[str, ...] = ()
    """Files of an older run of another design or version that this one removed."""
    kept: bool = False
    """Whether it failed and ``folder`` was left as it was."""

    @property
    def design(self) -> Design:
        """The design, the first one of several."""
        return self.checked[0].design

    @property
    def laminate(self) -> Laminate:
        """The laminate, that of the first design of several."""
        return self.checked[0].laminate

    @property
    def schedule(self) -> Schedule | None:
        """The press schedule, of the first design of several; None where nothing was written."""
        return self.batch.designs[0].pressing if self.batch is not None else None

    @property
    def conforming(self) -> ConformingMeshes | None:
        """The volume and shell meshes, where they were asked for."""
        return self.batch.designs[0].conforming if self.batch is not None else None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the rules found; of several designs, each with its design's name."""
        if len(self.checked) == 1 and self.between is None:
            return self.checked[0].findings
        return found_in(self.checked, self.between or ())

    @property
    def failed(self) -> bool:
        """Whether a rule failed that the design does not waive; no cut file was written then."""
        return has_failed(self.findings)

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r}, {'failed' if self.failed else 'holds'})"

    def _repr_html_(self) -> str:
        files = [(str(self.folder / name),) for name in self.manifest.get("files", ())]
        table = table_html(("files written",), files)
        pictures = "".join(one.laminate._repr_html_() for one in self.checked)
        return pictures + Findings(self.findings)._repr_html_() + table


def found_in(checked: Sequence[Checked], between: Sequence[Finding]) -> tuple[Finding, ...]:
    """Findings in designs, each with its design's name, then those between parts."""
    named = (
        replace(finding, message=f"{one.design.name}: {finding.message}")
        for one in checked
        for finding in one.findings
    )
    return (*named, *between)


def generate(
    design: Design,
    out: Path = Path("out"),
    parts: Sequence[RunPart] = EVERYTHING,
    progress: Progress | None = None,
    curves: Curves = TRUE_ARCS,
    extras: Extras = NO_EXTRAS,
) -> Run:
    """Writes ``out/<design name>/`` and returns what was made.

    A design that breaks a rule gets its findings and pictures, but no cut files, schedule or
    meshes; where another design's lie, it gets nothing and they stay (``Run.kept``). With some of
    the ``parts`` only, the others stay if they are of the same design.
    Raises DesignError or OutputError, also where other parts are another design's, and DefectError
    where the cut files read back are not what was checked; the old folder is then whole.
    """
    tell = progress or unheard
    checked = Checked(design, *check(design, tell))
    wanted = set(parts)
    target = out / design.name
    if checked.failed:
        if would_replace(target, identity(design, checked.waived)):
            return Run((checked,), target, kept=True)
        wanted &= set(PICTURES)
    elif wanted < set(EVERYTHING):
        own = [name for part in wanted for name in OWN[part]]
        refuse_to_replace(target, design, checked.waived, (*own, *extras.own))
    # Schedule, nest and meshes are made before anything is written: they may refuse the design.
    planned = plan(checked, wanted, curves)
    batch = plan_batch(SCHEMA, design.name, [planned], target, tell)
    if extras.conforming is not None and "mesh" in wanted:
        from sbafab.meshing.conforming.meshes import conforming_meshes

        tell("meshing", 0, 1)
        meshes = conforming_meshes(checked.laminate, extras.conforming.settings)
        planned = replace(planned, conforming=meshes, formats=extras.conforming.formats)
        batch = replace(batch, designs=(planned,))

    def write(folder: Path) -> dict[str, Any]:
        index, _ = write_batch(batch, folder, tell)
        if not checked.failed:
            if extras.also is not None:
                extras.also(checked.laminate, folder)
            carry_over(target, folder, index)
        return index

    return swapped_in(batch, target, write, tell)


def swapped_in(
    batch: Batch,
    target: Path,
    write: Callable[[Path], dict[str, Any]],
    tell: Progress,
    between: tuple[Finding, ...] | None = None,
) -> Run:
    """Has a folder written, reads it back and puts it in the place of ``target``.

    ``write`` returns the manifest without the files' hashes. Raises as ``generate`` does.
    """
    listed = listed_files(target)
    with replaced_folder(target) as folder:
        index = write(folder)
        close_folder(folder, index)
        if batch.is_cut:
            refuse_unlike(batch, folder, tell)
    checked = tuple(one.checked for one in batch.designs)
    return Run(checked, target, index, batch, between, removed_files(listed, index))


def with_folder(made: Path) -> ExtraFiles:
    """Puts a folder that was made elsewhere into that of a run, under its own name."""

    def put(_: Laminate, folder: Path) -> None:
        shutil.copytree(made, folder / made.name)

    return put


# ``predict.json`` and its plots, in the folder of a design.


PREDICTION_SCHEMA = "sbafab/predict@1"
FOLDER = "predict"


def prediction_json(design: Design, prediction: Prediction) -> dict[str, Any]:
    """What ``predict.json`` holds; ``plot`` of a relation is its file in the folder."""
    found = prediction.as_dict()
    for relation in found["relations"]:
        relation["plot"] = f"{FOLDER}/{relation['name']}.svg"
    return {
        "schema": PREDICTION_SCHEMA,
        "name": design.name,
        "family": design.family,
        "design_sha256": design_sha256(design),
        "generator": GENERATOR,
        **found,
    }


def with_prediction(design: Design, prediction: Prediction) -> ExtraFiles:
    """Writes ``predict.json`` and ``predict/<relation>.svg`` into the folder of a run."""

    def put(_: Laminate, folder: Path) -> None:
        from sbafab.reports.charts import relation_svg

        write_text(folder / "predict.json", as_json(prediction_json(design, prediction)))
        if prediction.relations:
            (folder / FOLDER).mkdir()
        for relation in prediction.relations:
            plot = relation_svg(design.name, relation)
            write_text(folder / FOLDER / f"{relation.name}.svg", plot)

    return put


# A simulator run on a design, its results in the design's folder.


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
