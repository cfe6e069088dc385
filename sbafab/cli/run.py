"""Commands that write a folder: run a design, print the table of its files, exit by the verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sbafab.actuators import load_design
from sbafab.cli.exit import RULE_FAILED, print_error
from sbafab.cli.options import Request
from sbafab.cli.printing import (
    groups_of,
    notes_of,
    print_facts,
    print_failed,
    print_json,
    print_line,
    print_open,
    print_passed,
    print_written,
)
from sbafab.cli.progress import shown_progress
from sbafab.cutting.properties import TRUE_ARCS, Curves
from sbafab.documents import Document
from sbafab.output.checked import FindingEntry
from sbafab.pressing.cycles import batch_times, design_runs
from sbafab.runs.run import Conforming, Run, RunRequest, generate

if TYPE_CHECKING:
    from rich.table import Table

    from sbafab.output.checked import RunPart


def run_parts(
    request: Request,
    parts: Sequence[RunPart],
    curves: Curves | None = None,
    conforming: Conforming | None = None,
) -> None:
    """Load a design, generate ``parts`` of it and exit with 1 if a rule failed."""
    design = load_design(request.designs[0], request.assignments, request.waivers)
    run_request(
        RunRequest(design, request.out, parts, curves or TRUE_ARCS, conforming=conforming), request
    )


def run_request(
    wanted: RunRequest,
    request: Request,
    show: Callable[[Run], None] | None = None,
    as_json: Callable[[Run], object] | None = None,
) -> None:
    """Write a folder, print it (by ``show`` or ``as_json``) and exit with 1 if a rule failed."""
    with shown_progress(request.as_json) as progress:
        run = generate(wanted, progress)
    for name, reason in run.left_out:
        print_error(f"left out: {name}. {reason}")
    finish(run, request, as_json or run_json, show or print_run)


def finish(
    run: Run,
    request: Request,
    as_json: Callable[[Run], object],
    show: Callable[[Run], None],
) -> None:
    """Print a run, as JSON if requested, and exit with 1 if a rule failed."""
    if request.as_json:
        print_json(as_json(run))
    else:
        show(run)
    if run.failed:
        click.get_current_context().exit(RULE_FAILED)


DECKS = ("calculix/actuator.inp", "sofa/actuator.scn", "mujoco/actuator.xml")
"""The file of each deck that its simulator opens."""


UNCHANGED = (
    "is unchanged: it holds an earlier design or version. To see the findings and pictures of this "
    "one, give it a folder of its own with --set name=NAME"
)


def add_batch(table: Table, run: Run) -> None:
    """Add rows on several designs: copies, verdict, notes, film, meshes and folder."""
    from rich.text import Text

    for checked in run.builds:
        warnings = sorted({f.rule for f in checked.findings if f.verdict == "warn"})
        warned = f"; warnings: {', '.join(warnings)}" if warnings else ""
        waived = f"; waived: {', '.join(checked.waived)}" if checked.waived else ""
        verdict = "failed" if checked.failed else "passed"
        copies = checked.design.order.quantity
        words = f"{copies} {'copy' if copies == 1 else 'copies'}, {verdict}{waived}{warned}"
        table.add_row(checked.design.name, Text(words))
    for note in notes_of(run.builds):
        table.add_row("note", Text(note))
    index = run.manifest
    for film in index.get("films", ()):
        table.add_row(f"{film['material']} film", Text(film_text(film, index["sheets"], 1)))
    for mesh in index.get("meshes", ()):
        table.add_row("solid", Text(f"{mesh['file']}, with a node for each part"))
    for label, text in stale_rows(run.dropped):
        table.add_row(label, Text(text))
    if index:
        table.add_row("folder", Text(str(run.folder)))


def print_run(run: Run) -> None:
    """Print the table of a run's files and its verdict."""
    if not run.kept:
        print_facts(_run_facts(run))
        click.echo()
    print_run_verdict(run, "design")


def print_run_verdict(run: Run, change: str) -> None:
    """Print remedies and, last, the verdict; ``change``: "design" or "assembly"."""
    groups = groups_of(run.builds, run.between)
    for group in groups:
        print_open(group.findings)
    if run.failed:
        if run.kept:
            print_line(f"{run.folder} {UNCHANGED}")
        print_failed(run.folder.name, run.findings, "No cut files were written", change)
        print_written(None if run.kept else run.folder)
    else:
        print_passed(run.folder.name, groups, f"sbafab check {run.folder}", run.folder)


def _joint_facts(run: Run) -> Iterator[tuple[str, str]]:
    """Yield the folds and seams of a run, if it has any."""
    if run.schedule is None:
        return
    if run.schedule.folds:
        yield "folds", f"{len(run.schedule.folds)}, each film cut flat as one part; press.json"
    if run.schedule.seams:
        tools = ", ".join(dict.fromkeys(seam.tool for seam in run.schedule.seams))
        yield "seams", f"{len(run.schedule.seams)} by {tools}; press.json"


def _run_facts(run: Run) -> Iterator[tuple[str, str]]:
    """Yield label and text of each row of a design's run."""
    index = run.manifest
    lam = run.laminate
    counts: dict[str, int] = {}
    for layer in lam.layers:
        kind = f"{layer.film.material} {layer.role}"
        counts[kind] = counts.get(kind, 0) + 1
    sizes = index["sizes"]
    balloons = "1 balloon" if lam.balloons == 1 else f"{lam.balloons} balloons"
    yield (
        "design",
        f"{lam.name} ({lam.family}, {balloons}), {index['design_sha256'][:12]}",
    )
    yield "kit", f"{index['kit']['name']}, version {index['kit']['version']}"
    yield "sizes", ", ".join(f"{k.replace('_', ' ')} {v:.3f}" for k, v in sizes.items()) + " mm"
    yield (
        "layers",
        f"{len(lam.layers)} in {len(lam.patterns)} patterns: "
        + ", ".join(f"{count} {kind}" for kind, count in counts.items()),
    )
    yield from stale_rows(run.dropped)
    # Layers of a folded film share a file.
    cut = {layer["file"] for layer in index["layers"] if layer["file"]}
    if cut:
        plate = f", and the base plate {index['fixture']}" if index["fixture"] else ""
        yield (
            "cut files",
            f"{len(cut)} in layers/{plate}, each read back and compared with the design",
        )
    if run.design.order.why:
        yield "order", run.design.order.why
    for film in index["films"]:
        if "sheets" in film:
            yield f"{film['material']} film", film_text(film, index["sheets"], index["copies"])
    yield from _joint_facts(run)
    if run.schedule is not None and run.schedule.steps:
        force = run.schedule.steps[0].force_n / 1000
        yield (
            "press",
            f"{len(run.schedule.steps)} steps, {_minutes(run.schedule.total_press_minutes)} at "
            f"{run.schedule.steps[0].temperature_c:g} C, {force:.3f} kN; press.json, press.csv",
        )
        runs = design_runs(run.design, lam)
        if runs.copies > 1:
            times = batch_times(runs, run.schedule)
            sizes = ", ".join(map(str, dict.fromkeys(runs.cycles)))
            yield (
                "batch",
                f"{runs.copies} copies in {runs.count} press cycle{'s' if runs.count > 1 else ''} "
                f"of {sizes}: {_minutes(times.press)} in the press, {_minutes(times.total)} in all",
            )
    yield from _simulation_rows(run)
    if cut:
        yield from (("warning", sentence) for sentence in index["warnings"])
    yield from (("note", note) for note in lam.notes)
    if run.schedule is not None:
        yield from (("warning", sentence) for sentence in run.schedule.warnings)
    yield "folder", str(run.folder)


def _minutes(value: float | None) -> str:
    return "minutes not stated" if value is None else f"{value:g} min"


def stale_rows(dropped: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield a row on the stale files of an earlier run that were removed, if any."""
    if dropped:
        count = "1 stale file" if len(dropped) == 1 else f"{len(dropped)} stale files"
        names = ", ".join(dict.fromkeys(path.partition("/")[0] for path in dropped))
        yield (
            "replaced",
            f"removed {count} ({names}); --set name=NAME gives a design a folder of its own",
        )


def _simulation_rows(run: Run) -> Iterator[tuple[str, str]]:
    """Yield rows on meshes and simulator decks."""
    index = run.manifest
    if index["meshes"]:
        names = ", ".join(mesh["file"] for mesh in index["meshes"])
        yield "meshes", names
    decks = [path for path in DECKS if path in index["files"]]
    if decks:
        yield "simulators", ", ".join(decks)
    for name, figures in run.conforming.statistics.items() if run.conforming else ():
        yield (
            f"{name} mesh",
            f"{figures['elements']:,} {figures['element']} elements, {figures['nodes']:,} nodes, "
            f"least scaled Jacobian {figures['least_scaled_jacobian']:.3f}, worst aspect "
            f"{figures['worst_aspect']:.1f}, {figures['volume_mm3']:.3f} mm3",
        )
    for note in run.conforming.volume.notes if run.conforming else ():
        yield "", note
    if run.conforming is not None and run.conforming.fill is not None:
        yield "", "solid.* and cavity_<chamber>.stl are flat; skin.* is filled"


def film_text(film: Mapping[str, Any], sheets: Sequence[Mapping[str, Any]], copies: int) -> str:
    """Return the use of a film in words: sheets, size, density, waste and cutting time."""
    film_sheets = [sheet for sheet in sheets if sheet["material"] == film["material"]]
    count = f"{len(film_sheets)} sheet{'s' if len(film_sheets) > 1 else ''}"
    sizes = dict.fromkeys(f"{sheet['width']:g} x {sheet['length']:g}" for sheet in film_sheets)
    minutes = sum(sheet["estimated_minutes"] for sheet in film_sheets)
    many = f" for {copies} copies" if copies > 1 else ""
    bare = any(sheet["label"] == "no room" for sheet in film_sheets)
    unlabelled = "; their borders have no room for labels: label them by hand"
    return (
        f"{count} of {', '.join(sizes)} mm{many}, {film['density']:.0%} used, "
        f"{film['waste'] / 100:.0f} cm2 waste, about {minutes:.1f} min of cutting; "
        f"{', '.join(sheet['file'] for sheet in film_sheets)}{unlabelled if bare else ''}"
    )


class RunDocument(Document, schema="sbafab/run@1"):
    """What commands print of a folder that they write."""

    folder: Path
    failed: bool
    findings: list[FindingEntry]
    notes: list[str]
    files: list[str]
    """what lies in the folder"""


def run_json(run: Run) -> dict[str, Any]:
    """Return a run as JSON."""
    files = [] if run.kept else sorted(run.manifest["files"])
    return RunDocument.of(run, notes=notes_of(run.builds), files=files)
