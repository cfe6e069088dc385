"""``sbafab generate``, ``cut``, ``press``, ``mesh``, ``nest`` and ``import``: commands that write.

Each runs a design, prints the table of its files, and exits by the verdict.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import click

from sbafab.actuators import load_design
from sbafab.api import runs
from sbafab.assemblies.files import load
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.cli.exit import RULE_FAILED, end, print_error
from sbafab.design.files import changed_keys
from sbafab.design.records import Design
from sbafab.documents import Document, attribute
from sbafab.errors import DesignError
from sbafab.folders.checks_json import FindingEntry
from sbafab.folders.order import JOB_SCHEMA
from sbafab.folders.run import Run
from sbafab.meshing.conforming.layup import Element, MeshSettings, Symmetry
from sbafab.meshing.formats import conforming_endings
from sbafab.pressing.cycles import batch_times, design_runs


@click.command()
@opt.run_options()
@opt.cut_options
@opt.target_yield_option(
    "Change the design as little as this share of good random builds needs, e.g. 0.95: order of "
    "stacking, bond and overhang, plate, ears. Keys of --set stay."
)
@opt.option("--decks", "Also write the input files of the simulators.", bool)
def generate(request: opt.Request, target_yield: float | None, **settings: Any) -> None:
    """Write everything: cut files, schedule, traveller, meshes.

    --decks also writes calculix/, sofa/ and mujoco/, like `sbafab simulate --export`. An assembly
    has a folder for each of its designs, and sheets, a traveller and a solid of the whole.
    --target-yield prints what it changed and what that costs, and the folder's design.toml is the
    changed design; if the share is not reached, nothing is written and the exit code is 1.
    """
    source = load(*request.source)
    if target_yield is None:
        _run(request, runs.generate, source, **settings)
    elif isinstance(source, Design):
        _generate_for_yield(source, target_yield, request, settings)
    else:
        raise DesignError(
            "--target-yield goes with a design, and this is an assembly; generate its parts' "
            "designs one by one, and name the files it writes in the assembly"
        )


@click.command()
@opt.run_options()
@opt.cut_options
def cut(request: opt.Request, **curves: Any) -> None:
    """Write the cut files: a DXF for each layer, and film sheets."""
    _run(request, runs.cut, load_design(*request.source), **curves)


@click.command()
@opt.run_options()
def press(request: opt.Request) -> None:
    """Write the heat-press schedule."""
    _run(request, runs.press, load_design(*request.source))


@click.command()
@opt.run_options()
@opt.option("--h", "Edge length of the triangles.", opt.POSITIVE_LENGTH, default=MeshSettings.h)
@opt.option(
    "--element",
    "Second-order wedges or tetrahedra.",
    get_args(Element),
    default=MeshSettings.element,
)
@opt.option(
    "--symmetry",
    "Part of the actuator that is meshed.",
    get_args(Symmetry),
    default=MeshSettings.symmetry,
)
@opt.option(
    "--fill fill_ul...",
    "Air volume of each balloon, or of each of a chamber, e.g. 5ul.  [default: flat]",
    opt.OfChamber(opt.VOLUME, all_chambers=True),
)
@opt.option("--gaps", "Keep films a mask thickness apart.", bool)
@opt.option("--flat", "Do not wrap designs for a tube.", bool)
@opt.option(
    "--format formats...",
    "Formats of the volume, shell and cavity meshes.  [default: all]",
    conforming_endings(),
)
def mesh(
    request: opt.Request,
    formats: tuple[str, ...],
    flat: bool,
    fill_ul: dict[str, float],
    **more: Any,
) -> None:
    """Write meshes: solid, cavities, volume and shell.

    Volume and shell meshes need the extra "mesh": pip install "sbafab[mesh]".
    """
    if "" in fill_ul and len(fill_ul) > 1:
        raise click.UsageError("--fill takes one volume for all, or one for each chamber")
    fill = fill_ul.get("", fill_ul) if fill_ul else None
    more |= {"formats": formats or conforming_endings(), "wrapped": not flat, "fill_ul": fill}
    _run(request, runs.mesh, load_design(*request.source), **more)


@click.command()
@opt.run_options(is_several=True)
@opt.option("--name", "Name of the folder OUT/<name>/.", default="job")
@opt.cut_options
def nest(request: opt.Request, **settings: Any) -> None:
    """Cut several designs from the same film sheets.

    OUT/<name>/ receives a folder for each DESIGN, and sheets/ with the parts of all. Overrides
    apply to every design. Copies: --copies of every design, else each design's order.copies.
    """
    designs = [load_design(name, request.assignments, request.waivers) for name in request.designs]
    _run(request, runs.nest, designs, **settings)


@click.command("import")
@click.argument("source", type=opt.file_path())
@opt.folder_option("Folder in which NAME.toml and a folder of its drawings are written.")
@opt.file_option("NAME.toml")
@opt.json_option
def import_(source: Path, out: Path, to: Path | None, as_json: bool) -> None:
    """Write a design of drawn layers from other files.

    SOURCE is a folder of drawings with a table layers.csv, an output folder, a laminate.json, a
    ParchMint circuit (JSON), or a laminate of foldable_robotics or popupCAD. What is not carried
    over is named.
    """
    # A tenth of the time that `generate` takes to load.
    from sbafab.importing.records import default_file, write_imported
    from sbafab.importing.sources import import_source

    name, imported = import_source(source)
    file = opt.design_file(to, out, default_file(imported).name)
    written = write_imported(imported, file, source.name)
    layers, patterns = len(written.laminate.layers), len(written.laminate.patterns)
    if as_json:
        document = {"file": str(written.file), "format": name, "layers": layers}
        show.document({**document, "patterns": patterns, "remarks": list(imported.remarks)})
        return
    for remark in imported.remarks:
        show.note(remark)
    show.verdict(
        f"{written.file} written: {layers} layers in {patterns} patterns, from {name}. Next: "
        f"sbafab generate {shlex.quote(str(written.file))}",
        written.file,
    )


# Running a request.


def _run(
    request: opt.Request,
    write: Callable[..., Run],
    source: object,
    before: Callable[[], None] = lambda: None,
    more: Mapping[str, object] | None = None,
    **settings: Any,
) -> None:
    """Write a folder, print it and exit with 1 if a rule failed.

    ``before`` prints what comes before the files, ``more`` has further keys of the document.
    """
    with show.progress(request.as_json) as progress:
        run = write(source, out=request.out, progress=progress, **settings)
    for name, reason in run.left_out:
        print_error(f"left out: {name}. {reason}")
    if request.as_json:
        show.document({**_document(run), **(more or {})})
    else:
        before()
        _print_run(run)
    if run.failed:
        show.end_failed()


def _generate_for_yield(
    design: Design, target: float, request: opt.Request, settings: dict[str, Any]
) -> None:
    """Write the folder of a design changed for a yield; exits with 1 if none reaches it."""
    # Both designs are predicted, which a plain run does not do: models load slowly.
    from sbafab.cli.search import print_changes
    from sbafab.search.compare import reach_yield, yield_document

    with show.progress(request.as_json) as progress:
        fixed = frozenset(changed_keys(request.assignments))
        reached = reach_yield(design, target, fixed, progress)
    if reached.design is None:
        end("yield", reached.sentence, RULE_FAILED, request.as_json)

    def before() -> None:
        print_changes(reached)
        show.wrapped(reached.sentence)
        show.line("")

    more = {"yield": yield_document(reached)} if request.as_json else {}
    _run(request, runs.generate, reached.design, before, more, **settings)


# The documents of runs.


class RunDocument(Document, schema="sbafab/run@1"):
    """Output of a command that writes a folder."""

    folder: Path
    failed: bool
    findings: list[FindingEntry]
    notes: list[str]
    files: list[str]
    """contents of the folder"""


class NestedDesign(Document):
    """One of the designs."""

    name: str = attribute("design.name")
    failed: bool
    findings: list[FindingEntry]
    notes: list[str]


class NestedDocument(Document, schema="sbafab/nested@1"):
    """Output of ``nest --json``."""

    folder: Path
    failed: bool
    designs: list[NestedDesign]
    files: list[str]
    """contents of the folder"""


def _document(run: Run) -> dict[str, Any]:
    files = [] if run.kept else sorted(run.manifest["files"])
    if run.order.schema == JOB_SCHEMA:
        designs = [NestedDesign.read(each, notes=show.notes_of([each])) for each in run.builds]
        return NestedDocument.of(run, designs=designs, files=files)
    return RunDocument.of(run, notes=show.notes_of(run.builds), files=files)


# Printing: a table of facts, and the verdict.


UNCHANGED = (
    "is unchanged: it holds an earlier design or version. To see the findings and pictures of this "
    "one, give it another folder with --set name=NAME"
)
DECKS = ("calculix/actuator.inp", "sofa/actuator.scn", "mujoco/actuator.xml")
"""The file of each deck that its simulator opens."""
Facts = Iterator[tuple[str, str]]
"""Label and text of each row."""


def _print_run(run: Run) -> None:
    """Print the files of an order, remedies and, last, the verdict."""
    is_job, is_design = run.order.schema == JOB_SCHEMA, len(show.groups_of(run)) == 1
    if is_job or not run.kept:
        show.facts(_design_facts(run) if is_design and not is_job else _order_facts(run))
        show.line("")
    groups = show.groups_of(run)
    if is_design:
        show.remedies(run.findings)
    else:
        show.findings(groups)
    name, change = run.folder.name, "design" if is_design else "designs" if is_job else "assembly"
    if not run.failed:
        show.passed(name, groups, "" if is_job else f"sbafab check {run.folder}", run.folder)
        return
    consequence = "No cut files were written"
    if is_job:
        consequence = f"Nothing was written; {run.folder} is unchanged"
    elif run.kept:
        show.line(f"{run.folder} {UNCHANGED}")
    show.failed(name, run.findings, consequence, change)
    show.written(None if run.kept else run.folder)


def _order_facts(run: Run) -> Facts:
    """Yield rows on several designs: parts, copies, verdict, notes, film, meshes and folder."""
    index = run.manifest
    if run.between is not None:
        yield "assembly", f"{index['name']}, {index['design_sha256'][:12]}"
        parts = (f"{part['name']} ({part['design'] or part['kind']})" for part in index["parts"])
        yield "parts", ", ".join(parts)
    for build in run.builds:
        words = [show.several(build.design.order.quantity, "copy", "copies") + ", "]
        words += ["failed" if build.failed else "passed"]
        words += [f"; waived: {', '.join(build.waived)}"] if build.waived else []
        warned = sorted({f.rule for f in build.findings if f.verdict == "warn"})
        words += [f"; warnings: {', '.join(warned)}"] if warned else []
        yield build.design.name, "".join(words)
    for note in show.notes_of(run.builds):
        yield "note", note
    for film in index.get("films", ()):
        yield f"{film['material']} film", _film_text(film, index["sheets"], 1)
    for mesh in index.get("meshes", ()):
        yield "solid", f"{mesh['file']}, with a node for each part"
    yield from _stale_facts(run)
    if index:
        yield "folder", str(run.folder)


def _design_facts(run: Run) -> Facts:
    """Yield rows on a design's run."""
    index, laminate = run.manifest, run.laminate
    balloons = show.several(laminate.balloons, "balloon")
    sha256 = index["design_sha256"][:12]
    yield "design", f"{laminate.name} ({laminate.family}, {balloons}), {sha256}"
    yield "kit", f"{index['kit']['name']}, version {index['kit']['version']}"
    sizes = index["sizes"].items()
    yield "sizes", ", ".join(f"{k.replace('_', ' ')} {v:.3f}" for k, v in sizes) + " mm"
    kinds = Counter(f"{layer.film.material} {layer.role}" for layer in laminate.layers)
    listed = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    yield "layers", f"{len(laminate.layers)} in {len(laminate.patterns)} patterns: {listed}"
    yield from _stale_facts(run)
    # Layers of a folded film share a file.
    files = {layer["file"] for layer in index["layers"] if layer["file"]}
    if files:
        plate = f", and the base plate {index['fixture']}" if index["fixture"] else ""
        read = "each read back and compared with the design"
        yield "cut files", f"{len(files)} in layers/{plate}, {read}"
    if run.design.order.why:
        yield "order", run.design.order.why
    for film in index["films"]:
        if "sheets" in film:
            yield f"{film['material']} film", _film_text(film, index["sheets"], index["copies"])
    yield from _press_facts(run)
    yield from _mesh_facts(run)
    scheduled = run.schedule.warnings if run.schedule is not None else ()
    yield from (("warning", warning) for warning in (index["warnings"] if files else ()))
    yield from (("note", note) for note in laminate.notes)
    yield from (("warning", warning) for warning in scheduled)
    yield "folder", str(run.folder)


def _press_facts(run: Run) -> Facts:
    """Yield rows on folds, seams, press steps and press cycles."""
    schedule = run.schedule
    if schedule is None:
        return
    if schedule.folds:
        yield "folds", f"{len(schedule.folds)}, each film cut flat as one part; press.json"
    if schedule.seams:
        tools = ", ".join(dict.fromkeys(seam.tool for seam in schedule.seams))
        yield "seams", f"{len(schedule.seams)} by {tools}; press.json"
    if not schedule.steps:
        return
    first = schedule.steps[0]
    yield (
        "press",
        f"{len(schedule.steps)} steps, {_minutes(schedule.total_press_minutes)} at "
        f"{first.temperature_c:g} C, {first.force_n / 1000:.3f} kN; press.json, press.csv",
    )
    runs = design_runs(run.design, run.laminate)
    if runs.copies > 1:
        times = batch_times(runs, schedule)
        sizes = ", ".join(map(str, dict.fromkeys(runs.cycles)))
        yield (
            "batch",
            f"{runs.copies} copies in {show.several(runs.count, 'press cycle')} of {sizes}: "
            f"{_minutes(times.press)} in the press, {_minutes(times.total)} in all",
        )


def _minutes(value: float | None) -> str:
    return "minutes not stated" if value is None else f"{value:g} min"


def _mesh_facts(run: Run) -> Facts:
    """Yield rows on meshes and simulator decks."""
    index = run.manifest
    if index["meshes"]:
        yield "meshes", ", ".join(mesh["file"] for mesh in index["meshes"])
    decks = [path for path in DECKS if path in index["files"]]
    if decks:
        yield "simulators", ", ".join(decks)
    conforming = run.conforming
    if conforming is None:
        return
    for name, figures in conforming.statistics.items():
        yield (
            f"{name} mesh",
            f"{figures['elements']:,} {figures['element']} elements, {figures['nodes']:,} nodes, "
            f"least scaled Jacobian {figures['least_scaled_jacobian']:.3f}, worst aspect "
            f"{figures['worst_aspect']:.1f}, {figures['volume_mm3']:.3f} mm3",
        )
    for note in conforming.volume.notes:
        yield "", note
    if conforming.fill is not None:
        yield "", "solid.* and cavity_<chamber>.stl are flat; skin.* is filled"


def _stale_facts(run: Run) -> Facts:
    if run.dropped:
        names = ", ".join(dict.fromkeys(path.partition("/")[0] for path in run.dropped))
        count = show.several(len(run.dropped), "stale file")
        own = "--set name=NAME gives a design another folder"
        yield "replaced", f"removed {count} ({names}); {own}"


def _film_text(film: Mapping[str, Any], sheets: Sequence[Mapping[str, Any]], copies: int) -> str:
    """Return the use of a film as text: sheets, size, density, waste and cutting time."""
    film_sheets = [sheet for sheet in sheets if sheet["material"] == film["material"]]
    sizes = dict.fromkeys(f"{sheet['width']:g} x {sheet['length']:g}" for sheet in film_sheets)
    minutes = sum(sheet["estimated_minutes"] for sheet in film_sheets)
    many = f" for {copies} copies" if copies > 1 else ""
    bare = any(sheet["label"] == "no room" for sheet in film_sheets)
    unlabelled = "; their borders have no room for labels: label them by hand"
    return (
        f"{show.several(len(film_sheets), 'sheet')} of {', '.join(sizes)} mm{many}, "
        f"{film['density']:.0%} used, {film['waste'] / 100:.0f} cm2 waste, about {minutes:.1f} min "
        f"of cutting; {', '.join(sheet['file'] for sheet in film_sheets)}"
        f"{unlabelled if bare else ''}"
    )
