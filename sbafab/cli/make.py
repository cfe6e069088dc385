"""``sbafab generate``, ``cut``, ``press``, ``mesh`` and ``nest``: commands that write a folder.

Each runs a design, prints the table of its files, and exits by the verdict.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import click

from sbafab.actuators import load_design
from sbafab.assemblies.files import load
from sbafab.cli.exit import RULE_FAILED, Exit, end, print_error
from sbafab.cli.options import (
    LENGTH,
    VOLUME,
    OfChamber,
    Request,
    by_chamber,
    dxf_options,
    run_options,
    sheet_options,
    target_yield_option,
)
from sbafab.cli.printing import (
    groups_of,
    notes_of,
    print_facts,
    print_failed,
    print_json,
    print_line,
    print_open,
    print_passed,
    print_table,
    print_wrapped,
    print_written,
    several,
)
from sbafab.cli.progress import shown_progress
from sbafab.cutting.properties import Curves
from sbafab.design.files import changed_keys
from sbafab.design.records import Design
from sbafab.documents import Document, attribute
from sbafab.errors import DesignError
from sbafab.folders.artefacts import EVERYTHING, RunPart
from sbafab.folders.checks import FindingEntry
from sbafab.folders.run import Conforming, Run, RunRequest
from sbafab.folders.run import generate as run_design
from sbafab.meshing.conforming.layup import Element, MeshSettings, Symmetry
from sbafab.meshing.formats import CONFORMING_ENDINGS
from sbafab.pressing.cycles import batch_times, design_runs
from sbafab.simulators.simulator import NAMES


@click.command()
@run_options()
@dxf_options
@sheet_options
@target_yield_option(
    "Change the design as little as this share of good random builds needs, e.g. 0.95: order of "
    "stacking, bond and overhang, plate, ears. Keys of --set stay."
)
@click.option("--decks", is_flag=True, help="Also write the input files of the simulators.")
def generate(request: Request, curves: Curves, target_yield: float | None, decks: bool) -> None:
    """Write everything: cut files, schedule, traveller, meshes.

    --decks also writes calculix/, sofa/ and mujoco/, like `sbafab simulate --export`. An assembly
    has a folder for each of its designs, and sheets, a traveller and a solid of the whole.
    --target-yield prints what it changed and what that costs, and the folder's design.toml is the
    changed design; if the share is not reached, nothing is written and the exit code is 1.
    """
    source = load(request.design, request.assignments, request.waivers)
    if decks and not isinstance(source, Design):
        raise click.UsageError("--decks goes with one design; leave it out for an assembly")
    parts = (*EVERYTHING, *NAMES) if decks else EVERYTHING
    wanted = RunRequest(source, request.out, parts, curves)
    if target_yield is None:
        run_request(wanted, request)
    elif isinstance(source, Design):
        _generate_for_yield(source, target_yield, wanted, request)
    else:
        raise DesignError(
            "--target-yield goes with a design, and this is an assembly; generate its parts' "
            "designs one by one, and name the files it writes in the assembly"
        )


@click.command()
@run_options()
@dxf_options
@sheet_options
def cut(request: Request, curves: Curves) -> None:
    """Write the cut files: a DXF for each layer, and film sheets."""
    _run_parts(request, ("cut",), curves=curves)


@click.command()
@run_options()
def press(request: Request) -> None:
    """Write the heat-press schedule."""
    _run_parts(request, ("press",))


def _positive(ctx: click.Context, param: click.Parameter, value: float) -> float:
    if value <= 0:
        raise click.BadParameter("must be a length above 0 mm", ctx, param)
    return value


def _fill(
    ctx: click.Context, param: click.Parameter, values: tuple[tuple[str, float], ...]
) -> float | dict[str, float] | None:
    """Return one volume for all balloons, one by chamber, or None."""
    volumes = by_chamber(ctx, param, values)
    if "" in volumes and len(volumes) > 1:
        raise click.BadParameter("give one volume for all, or one for each chamber", ctx, param)
    return volumes.get("", volumes) if volumes else None


@click.command()
@run_options()
@click.option(
    "--h",
    "h",
    type=LENGTH.read,
    callback=_positive,
    default="0.35",
    metavar="MM",
    help="Edge length of the triangles.",
)
@click.option(
    "--element",
    type=click.Choice(get_args(Element)),
    default="wedge",
    help="Second-order wedges or tetrahedra.",
)
@click.option(
    "--symmetry",
    type=click.Choice(get_args(Symmetry)),
    default="full",
    help="Part of the actuator that is meshed.",
)
@click.option(
    "--fill",
    "fill_ul",
    multiple=True,
    type=OfChamber(VOLUME, all_chambers=True).read,
    callback=_fill,
    metavar="UL|CHAMBER=UL",
    help="Air volume of each balloon, e.g. 5ul. Repeatable for chambers.  [default: flat]",
)
@click.option("--gaps", is_flag=True, help="Keep films a mask thickness apart.")
@click.option("--flat", is_flag=True, help="Do not wrap designs for a tube.")
@click.option(
    "--format",
    "formats",
    type=click.Choice(CONFORMING_ENDINGS),
    multiple=True,
    help="Formats of the volume, shell and cavity meshes. Repeatable.  [default: all]",
)
def mesh(request: Request, formats: tuple[str, ...], flat: bool, **settings: Any) -> None:
    """Write meshes: solid, cavities, volume and shell.

    Volume and shell meshes need the extra "mesh": pip install "sbafab[mesh]".
    """
    conforming = Conforming(
        MeshSettings(wrapped=not flat, **settings), formats or CONFORMING_ENDINGS
    )
    _run_parts(request, ("mesh",), conforming=conforming)


@click.command()
@run_options(is_several=True)
@click.option("--name", default="job", help="Name of the folder OUT/<name>/.")
@dxf_options
@sheet_options
def nest(request: Request, name: str, curves: Curves) -> None:
    """Cut several designs from the same film sheets.

    OUT/<name>/ receives a folder for each DESIGN, and sheets/ with the parts of all. Overrides
    apply to every design. Copies: --copies of every design, else each design's order.copies.
    """
    designs = [load_design(name, request.assignments, request.waivers) for name in request.designs]
    wanted = RunRequest(designs, request.out, curves=curves, name=name)
    run_request(wanted, request, _print_job, _job_json)


# Running a request.


def _run_parts(request: Request, parts: Sequence[RunPart], **settings: Any) -> None:
    """Load a design, write ``parts`` of it and exit with 1 if a rule failed."""
    design = load_design(request.design, request.assignments, request.waivers)
    run_request(RunRequest(design, request.out, parts, **settings), request)


def run_request(
    wanted: RunRequest,
    request: Request,
    show: Callable[[Run], None] | None = None,
    as_json: Callable[[Run], object] | None = None,
) -> None:
    """Write a folder, print it (by ``show`` or ``as_json``) and exit with 1 if a rule failed."""
    with shown_progress(request.as_json) as progress:
        run = run_design(wanted, progress)
    for name, reason in run.left_out:
        print_error(f"left out: {name}. {reason}")
    if request.as_json:
        print_json((as_json or _run_json)(run))
    else:
        (show or _print_run)(run)
    if run.failed:
        click.get_current_context().exit(RULE_FAILED)


def _generate_for_yield(
    design: Design, target: float, wanted: RunRequest, request: Request
) -> None:
    """Write the folder of a design changed for a yield; exits with 1 if none reaches it."""
    # Both designs are predicted, which a plain run does not do: models load slowly.
    from sbafab.cli.compare import print_figures
    from sbafab.search.compare import DESIGNS, reach_yield
    from sbafab.search.vary import format_value

    with shown_progress(request.as_json) as progress:
        fixed = frozenset(changed_keys(request.assignments))
        reached = reach_yield(design, target, fixed, progress)
    if reached.design is None:
        end(Exit("yield", reached.sentence, RULE_FAILED), request.as_json)

    def show(run: Run) -> None:
        if reached.comparison is not None:
            names = ("", *DESIGNS)
            rows = [(row.key, *map(format_value, row.values)) for row in reached.changes]
            print_table("Changed for the yield", names, rows)
            print_figures(reached.comparison, names)
        print_wrapped(reached.sentence)
        print_line("")
        _print_run(run)

    def as_json(run: Run) -> dict[str, object]:
        return {**_run_json(run), "yield": reached.as_dict()}

    run_request(replace(wanted, source=reached.design), request, show, as_json)


# The documents of runs.


class RunDocument(Document, schema="sbafab/run@1"):
    """Output of a command that writes a folder."""

    folder: Path
    failed: bool
    findings: list[FindingEntry]
    notes: list[str]
    files: list[str]
    """contents of the folder"""


def _run_json(run: Run) -> dict[str, Any]:
    files = [] if run.kept else sorted(run.manifest["files"])
    return RunDocument.of(run, notes=notes_of(run.builds), files=files)


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


def _job_json(job: Run) -> dict[str, Any]:
    designs = [NestedDesign.read(each, notes=notes_of([each])) for each in job.builds]
    return NestedDocument.of(job, designs=designs, files=sorted(job.manifest.get("files", ())))


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
    """Print the files of a design or an assembly, remedies and, last, the verdict."""
    is_design = run.between is None
    if not run.kept:
        print_facts(_run_facts(run) if is_design else _assembly_facts(run))
        print_line("")
    groups = groups_of(run.builds, run.between)
    for group in groups:
        print_open(group.findings)
    if not run.failed:
        print_passed(run.folder.name, groups, f"sbafab check {run.folder}", run.folder)
        return
    if run.kept:
        print_line(f"{run.folder} {UNCHANGED}")
    change = "design" if is_design else "assembly"
    print_failed(run.folder.name, run.findings, "No cut files were written", change)
    print_written(None if run.kept else run.folder)


def _print_job(job: Run) -> None:
    """Print the files of several designs, the findings of those that failed, and the verdict."""
    print_facts(_batch_facts(job))
    print_line("")
    for checked in job.builds:
        if checked.failed:
            print_line(checked.design.name, "bold red")
            print_open(checked.findings)
    if job.failed:
        findings = [finding for checked in job.builds for finding in checked.findings]
        consequence = f"Nothing was written; {job.folder} is unchanged"
        print_failed(job.folder.name, findings, consequence, "designs")
    else:
        print_passed(job.folder.name, groups_of(job.builds), written=job.folder)


def _assembly_facts(run: Run) -> Facts:
    index = run.manifest
    yield "assembly", f"{index['name']}, {index['design_sha256'][:12]}"
    yield "parts", ", ".join(f"{p['name']} ({p['design'] or p['kind']})" for p in index["parts"])
    yield from _batch_facts(run)


def _batch_facts(run: Run) -> Facts:
    """Yield rows on several designs: copies, verdict, notes, film, meshes and folder."""
    for checked in run.builds:
        warnings = sorted({f.rule for f in checked.findings if f.verdict == "warn"})
        warned = f"; warnings: {', '.join(warnings)}" if warnings else ""
        waived = f"; waived: {', '.join(checked.waived)}" if checked.waived else ""
        verdict = "failed" if checked.failed else "passed"
        copies = several(checked.design.order.quantity, "copy", "copies")
        yield checked.design.name, f"{copies}, {verdict}{waived}{warned}"
    for note in notes_of(run.builds):
        yield "note", note
    index = run.manifest
    for film in index.get("films", ()):
        yield f"{film['material']} film", _film_text(film, index["sheets"], 1)
    for mesh in index.get("meshes", ()):
        yield "solid", f"{mesh['file']}, with a node for each part"
    yield from _stale_facts(run.dropped)
    if index:
        yield "folder", str(run.folder)


def _run_facts(run: Run) -> Facts:
    """Yield rows on a design's run."""
    index, laminate = run.manifest, run.laminate
    balloons = several(laminate.balloons, "balloon")
    sha256 = index["design_sha256"][:12]
    yield "design", f"{laminate.name} ({laminate.family}, {balloons}), {sha256}"
    yield "kit", f"{index['kit']['name']}, version {index['kit']['version']}"
    sizes = index["sizes"].items()
    yield "sizes", ", ".join(f"{k.replace('_', ' ')} {v:.3f}" for k, v in sizes) + " mm"
    kinds = Counter(f"{layer.film.material} {layer.role}" for layer in laminate.layers)
    listed = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    yield "layers", f"{len(laminate.layers)} in {len(laminate.patterns)} patterns: {listed}"
    yield from _stale_facts(run.dropped)
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
    for warning in index["warnings"] if files else ():
        yield "warning", warning
    for note in laminate.notes:
        yield "note", note
    for warning in run.schedule.warnings if run.schedule is not None else ():
        yield "warning", warning
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
            f"{runs.copies} copies in {several(runs.count, 'press cycle')} of {sizes}: "
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


def _stale_facts(dropped: Sequence[str]) -> Facts:
    if dropped:
        names = ", ".join(dict.fromkeys(path.partition("/")[0] for path in dropped))
        count = several(len(dropped), "stale file")
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
        f"{several(len(film_sheets), 'sheet')} of {', '.join(sizes)} mm{many}, "
        f"{film['density']:.0%} used, {film['waste'] / 100:.0f} cm2 waste, about {minutes:.1f} min "
        f"of cutting; {', '.join(sheet['file'] for sheet in film_sheets)}"
        f"{unlabelled if bare else ''}"
    )
