"""One run: a request becomes a folder, which is written beside the old one, verified, and swapped
in as a whole.

Request -> order of builds -> artefacts -> folder. Command line, Python interface and studio all use
``generate``.
"""

from __future__ import annotations

import shutil
import tempfile
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab import plugins
from sbafab.assemblies.records import Assembly
from sbafab.cutting.cut_settings import TRUE_ARCS, Curves
from sbafab.design.records import Design
from sbafab.errors import OccupiedError, OutputError
from sbafab.folders.artefacts import (
    EVERYTHING,
    PICTURES,
    RunPart,
    artefacts,
    close_folder,
    tops_of,
    write_folder,
    write_text,
)
from sbafab.folders.as_cut import refuse_coarse
from sbafab.folders.build import Build, make_build
from sbafab.folders.manifest import as_json, carried_over, file_hash, file_names, identity
from sbafab.folders.order import Order, make_order
from sbafab.folders.swap import (
    JOB_SCHEMA,
    SCHEMA,
    listed_files,
    read_manifest,
    refuse_busy,
    replaced_folder,
    writing,
)
from sbafab.laminate.burst import burst
from sbafab.laminate.laminate import Laminate
from sbafab.markup import table_html
from sbafab.models.figures import Prediction
from sbafab.pressing.schedule import Schedule
from sbafab.rules.finding import Finding, Findings
from sbafab.runtime import Progress, ignore_progress
from sbafab.simulators.simulator import NAMES as SIMULATORS
from sbafab.simulators.simulator import (
    UNITS,
    Result,
    SimulationRequest,
    refuse_unused,
    simulator,
    under_vacuum,
)

if TYPE_CHECKING:
    from sbafab.meshing.conforming.layup import MeshSettings
    from sbafab.meshing.conforming.meshes import ConformingMeshes


@dataclass(frozen=True)
class RunRequest:
    """A folder to be written: ``out/<name>/`` of a design, an assembly or several designs.

    ``name`` is for several designs; a design or assembly has its own. ``parts`` and the following
    fields are for one design. Volume and shell ``meshes``, in the ``formats`` of these file
    suffixes, need the extra "mesh" and the part "mesh"; ``prediction`` needs "predict". For a part
    named after a simulator, ``simulated`` is the folder of its finished run; without it only the
    simulator's input is written.
    """

    source: Design | Assembly | Sequence[Design]
    out: Path = Path("out")
    parts: Sequence[RunPart] = EVERYTHING
    curves: Curves = TRUE_ARCS
    name: str = "job"
    meshes: MeshSettings | None = None
    formats: tuple[str, ...] = ()
    prediction: Prediction | None = None
    simulated: Path | None = None


@dataclass(frozen=True, repr=False)
class Run:
    """The outcome of a run on one design or several; there are no cut files if it ``failed``.

    ``manifest`` is empty if nothing was written. ``conforming`` holds requested volume and shell
    meshes.
    """

    order: Order
    folder: Path
    manifest: dict[str, Any] = field(default_factory=dict)
    conforming: ConformingMeshes | None = None
    dropped: tuple[str, ...] = ()
    """Files of an older run of another design or version that this one removed."""
    kept: bool = False
    """True if it failed and ``folder`` was left as it was."""
    beside: str = ""
    """Why ``folder`` is one beside the design's own: that one holds another design's files."""
    left_out: tuple[tuple[str, str], ...] = ()
    """Simulators that got no input, with the reason."""

    @property
    def builds(self) -> tuple[Build, ...]:
        """The designs with their findings."""
        return self.order.builds

    @property
    def between(self) -> tuple[Finding, ...] | None:
        """The findings between the parts of an assembly."""
        return self.order.between

    @property
    def design(self) -> Design:
        """The design, or the first of several."""
        return self.builds[0].design

    @property
    def laminate(self) -> Laminate:
        """The laminate of the first design."""
        return self.builds[0].laminate

    @property
    def schedule(self) -> Schedule | None:
        """The press schedule of the first design; None if none was written."""
        is_written = any(path.endswith("press.json") for path in self.manifest.get("files", ()))
        return self.builds[0].schedule if is_written else None

    @property
    def findings(self) -> Findings:
        """The findings of the rules; for several designs, each with its design's name."""
        return Findings(self.order.findings)

    @property
    def failed(self) -> bool:
        """True if a rule failed without a waiver of the design; no cut file was written then."""
        return self.order.failed

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r}, {'failed' if self.failed else 'holds'})"

    def _repr_html_(self) -> str:
        files = [(str(self.folder / name),) for name in self.manifest.get("files", ())]
        table = table_html(("files written",), files)
        pictures = "".join(build.laminate._repr_html_() for build in self.builds)
        return pictures + self.findings._repr_html_() + table


def generate(request: RunRequest, progress: Progress | None = None) -> Run:
    """Write the folder of a request and return the outcome.

    A design that breaks a rule gets its findings and pictures, but no cut files, schedule or
    meshes; a folder that holds another design's cut files is then left untouched (``Run.kept``). A
    prediction alone goes into a folder beside it (``Run.beside``). If one of several designs fails,
    nothing is written. If only some of the ``parts`` are written, the others stay if they are of
    the same design. Raises DesignError, OutputError (also if other parts belong to another design)
    or DefectError if a cut file was changed after it had been read back; the old folder is then
    unchanged.
    """
    progress = progress or ignore_progress
    order = make_order(request.source, request.name, progress, request.curves)
    target = request.out / order.name
    beside = ""
    try:
        parts = _parts_to_write(request, order, target)
    except OccupiedError as reason:
        if set(request.parts) != {"predict"}:
            raise
        beside = str(reason)
        target = request.out / f"{order.name}-predict"
        parts = _parts_to_write(request, order, target)
    if parts is None:
        return Run(order, target, kept=True)
    refuse_unmakable(order, parts)
    nests = order.nests(target, progress) if "cut" in parts else ()
    extras = {} if order.schema != SCHEMA else _extras(request, order.builds[0], parts, progress)
    listed = listed_files(target)
    with replaced_folder(target) as folder:
        index, verified, left_out = write_folder(order, parts, nests, folder, progress, **extras)
        if order.schema == SCHEMA and not order.failed:
            carry_over(target, folder, index)
        close_folder(folder, index, verified)
    dropped = tuple(path for path in listed if path not in index["files"])
    meshes = extras.get("conforming")
    return Run(order, target, index, meshes, dropped, beside=beside, left_out=left_out)


def _parts_to_write(request: RunRequest, order: Order, target: Path) -> set[RunPart] | None:
    """Return the parts to write; of an order that failed, only pictures; None to leave everything
    unchanged.

    Raises OutputError if some parts alone would replace another design's files.
    """
    parts = set(request.parts) if order.schema == SCHEMA else set(EVERYTHING)
    build = order.builds[0]
    if order.failed:
        mine = identity(build) if order.schema == SCHEMA else None
        if order.schema == JOB_SCHEMA or would_replace(target, mine):
            return None
        return parts & set(PICTURES)
    if not parts >= set(EVERYTHING):
        refuse_to_replace(target, build, tops_of(*(parts - set(PICTURES))))
    return parts


def refuse_unmakable(order: Order, parts: Collection[RunPart]) -> None:
    """Raise DesignError, before anything is written, if press, kerf or chords are unsuitable for an
    order.
    """
    for build in order.builds:
        if {"press", "predict"} & set(parts):
            # Computing it refuses what the press cannot do.
            _ = build.schedule
        if "cut" in parts and build.curves.in_chords:
            refuse_coarse(build)


def _extras(
    request: RunRequest, build: Build, parts: Collection[RunPart], progress: Progress
) -> dict[str, Any]:
    """Return what a run on one design writes in addition to files derived from the design."""
    extras = {"prediction": request.prediction, "simulated": request.simulated}
    if request.meshes is None or "mesh" not in parts:
        return extras
    progress("meshing", 0, 1)
    conforming_meshes = plugins.load("sbafab.meshing.conforming.meshes:conforming_meshes")
    meshes = conforming_meshes(build.laminate, request.meshes)
    return {**extras, "conforming": meshes, "formats": request.formats}


# A simulator run on a design, its results in the design's folder.


@dataclass(frozen=True)
class Simulated:
    """The outcome of a simulation; no result and no folder if a rule ``failed`` before.

    An export has no result. ``beside`` is one sentence if ``folder`` is not in the design's own
    folder, which could not be written at the end.
    """

    findings: Sequence[Finding]
    folder: Path | None
    result: Result | None = None
    beside: str = ""

    @property
    def failed(self) -> bool:
        """True if a rule failed without a waiver of the design; no simulator ran then."""
        return self.folder is None


def result_json(result: Result | None) -> dict[str, Any]:
    """Return the contents of ``result.json``, only its head if nothing has run."""
    document = Result(units=UNITS) if result is None else result
    return {"schema": Result.SCHEMA, **document.model_dump(mode="json", exclude_unset=True)}


def simulate(
    design: Design,
    name: str,
    wish: SimulationRequest,
    out: Path = Path("out"),
    progress: Progress | None = None,
    export: bool = False,
) -> Simulated:
    """Run the simulator into ``out/<design name>/<name>/``; ``export`` only writes its input.

    Raises DesignError or OutputError for what it cannot do, if possible before it starts, and
    VoidError where its result cannot be. It runs in a folder beside the design's, which stays if it
    has a log that says what went wrong, or results whose place was taken meanwhile.
    """
    progress = progress or ignore_progress
    refuse_unused(name, wish)
    wish = under_vacuum(name, wish) if design.form.works_under_vacuum else wish
    build = make_build(design, progress)
    if build.failed:
        return Simulated(build.findings, None)
    # Said before a run of hours, not after it.
    refuse_to_replace(out / design.name, build, (name,))
    refuse_busy(out / design.name)
    _warn_past_burst(build.laminate, wish)
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=f"{design.name}-{name}-", dir=out))
        folder.chmod(0o755)
    result, stays = None, False
    try:
        if export:
            simulator(name).export(build.laminate, wish, folder)
        else:
            result = simulator(name).run(build.laminate, wish, folder, progress)
            write_text(folder / "result.json", as_json(result_json(result)))
        run = generate(RunRequest(design, out, (name,), simulated=folder), progress)
    except OutputError as error:
        stays = result is not None or any(folder.glob("*.log"))
        if result is None:
            raise
        return Simulated(build.findings, folder, result, str(error))
    finally:
        if not stays:
            shutil.rmtree(folder, ignore_errors=True)
    return Simulated(build.findings, run.folder / name, result)


def _warn_past_burst(laminate: Laminate, wish: SimulationRequest) -> None:
    estimate = burst(laminate)
    highest = max(wish.pressure or 0.0, *wish.chambers.values(), 0.0)
    if estimate is not None and highest > estimate.kpa:
        warnings.warn(
            f"{highest:g} kPa is past the estimated burst pressure, {estimate.kpa:.3g} kPa; films "
            "cannot tear or yield in the simulation, so its results there are not physical",
            stacklevel=3,
        )


# The earlier run that lies where a new one is to be written: which of its files stay, and when.


RESULTS = "result.json"
"""Result of a simulator; a folder without it holds input only."""
CUT_KEYS = {"layers": ("fixture", "curves", "seams"), "sheets": ("films",)}
"""Keys of a manifest that belong to layer files, and to film sheets."""
WHOLE = {"layers", "sheets", "preview", "predict"}
"""Folders that a run which writes into them writes whole."""


def would_replace(
    target: Path, mine: Mapping[str, Any] | None, replaced: Collection[str] = ()
) -> list[str]:
    """Return files worth keeping of another design's run in ``target`` that a new run would delete.

    ``mine`` identifies the new run's design and version as its manifest does; ``replaced`` are the
    files and folders that it writes itself.
    """
    old = read_manifest(target)
    if old is None or (mine is not None and carried_over(old, mine)):
        return []
    # What a design that breaks a rule does not get.
    worth = {*tops_of("cut", "press", "mesh", "predict", *SIMULATORS)} - set(replaced)
    return [path for path in listed_files(target) if worth & set(path.split("/"))]


def refuse_to_replace(target: Path, build: Build, replaced: Collection[str]) -> None:
    """Raise OccupiedError if a run that writes ``replaced`` would delete others' files."""
    mine = identity(build)
    lost = would_replace(target, mine, replaced)
    if lost:
        names = dict.fromkeys(path.partition("/")[0] for path in lost)
        raise OccupiedError(
            f"{target} holds {', '.join(names)} of another design or version (sbafab compare "
            f"shows what differs); use {target / 'design.toml'} for the design of that run, or "
            "choose another folder with --set name=NAME or -o"
        )


def carry_over(old_folder: Path, folder: Path, index: dict[str, Any]) -> None:
    """Copy files of the old run that this one did not write, if they are of the same design.

    ``index`` is the new manifest, to which their entries are added. Raises OutputError if results
    of a simulator would be lost to input with other settings.
    """
    old = read_manifest(old_folder)
    if old is None or not carried_over(old, index):
        return
    written, existing = file_names(folder), file_names(old_folder)
    # Results belong to the input beside them: with other input they go, whole.
    inputs = [path for path in written if path.startswith(tuple(f"{name}/" for name in SIMULATORS))]
    anew = {path.partition("/")[0] for path in inputs if _differs(path, old_folder, folder)}
    for name in anew:
        if f"{name}/{RESULTS}" in existing and f"{name}/{RESULTS}" not in written:
            raise OutputError(
                f"{old_folder / name} holds results of other settings; choose another folder "
                "with -o, or remove it"
            )
    old_meshes = old.get("mesh_statistics")
    if "mesh_statistics" in index and old_meshes not in (None, index["mesh_statistics"]):
        anew.update(tops_of("mesh"))
    anew |= WHOLE & {path.partition("/")[0] for path in written}
    files, carried = old.get("files"), set()
    tops = {row.top for row in artefacts() if row.part} - anew
    for path, digest in (files if isinstance(files, dict) else {}).items():
        may_stay = path.partition("/")[0] in tops and path not in written and path in existing
        if may_stay and file_hash(old_folder / path) == digest:
            target = folder / path
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(old_folder / path, target)
            carried.add(path)
    for key, belonging in CUT_KEYS.items():
        if _are_files(old.get(key), carried):
            # How the layers that stay were cut stays with them.
            index.update({name: old[name] for name in (key, *belonging) if name in old})
    meshes = [mesh for mesh in old.get("meshes") or () if _are_files([mesh], carried)]
    index["meshes"] += meshes
    if any(mesh.get("kind") == "volume" for mesh in meshes):
        index["mesh_statistics"] = old.get("mesh_statistics", {})


def _differs(path: str, old_folder: Path, folder: Path) -> bool:
    """Return True if a file of the new run is not in the old folder, or differs from it."""
    old = old_folder / path
    return not old.is_file() or old.read_bytes() != (folder / path).read_bytes()


def _are_files(entries: object, carried: set[str]) -> bool:
    """Return True if manifest entries name files that were all carried over."""
    return (
        isinstance(entries, list)
        and bool(entries)
        and all(isinstance(entry, dict) and entry.get("file") in carried for entry in entries)
    )
