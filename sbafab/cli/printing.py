"""What commands print: progress, findings, the closing table."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from sbafab.cli.lines import KEPT, console, facts_table, print_facts, print_line, print_wrapped
from sbafab.progress import Progress, unheard

if TYPE_CHECKING:
    from rich.table import Table

    from sbafab.output.planned import Checked
    from sbafab.output.run import Run
    from sbafab.rules.finding import Finding

DECKS = ("calculix/actuator.inp", "sofa/actuator.scn", "mujoco/actuator.xml")
"""What a simulator opens."""
LEFT_AS_IT_WAS = (
    "is unchanged: it holds an earlier design or version; with "
    "--set name=NAME this one gets its findings and pictures into a folder of its own"
)
FILES = "files"
"""What is to be changed where a folder was checked."""
COLOURS = {"pass": "green", "fail": "bold red", "waived": "yellow", "warn": "yellow"}


def print_json(value: object) -> None:
    click.echo(json.dumps(value, indent=1, ensure_ascii=False))


def print_listed(label: str, phrases: Sequence[str]) -> None:
    """``label: one, two, three``, over several lines where one would be too long, none torn."""
    from rich.text import Text

    out = console()
    line = f"{label}: {phrases[0]}"
    for phrase in phrases[1:]:
        if len(f"{line}, {phrase},") > out.width:
            out.print(Text(f"{line},"), soft_wrap=True)
            line = f"{' ' * len(label)}  {phrase}"
        else:
            line += f", {phrase}"
    out.print(Text(line), soft_wrap=True)


@contextmanager
def shown_progress(quiet: bool) -> Iterator[Progress]:
    """Tells on standard error how far the work in the block is, as -q and -v ask for.

    A line that stays fresh on a terminal; elsewhere plain lines, the first after some seconds.
    """
    from sbafab.cli.progress_line import QUIET, VERBOSE, asked_for, live_line, plain_lines

    if quiet or asked_for(QUIET):
        yield unheard
    elif sys.stderr.isatty() and not asked_for(VERBOSE):
        with live_line() as tell:
            yield tell
    else:
        yield plain_lines(asked_for(VERBOSE))


def notes_of(checked: Iterable[Checked]) -> list[str]:
    """What is to be known of several designs: each sentence once, with the names it is true of."""
    names: dict[str, list[str]] = {}
    designs = list(checked)
    for one in designs:
        for note in one.laminate.notes:
            names.setdefault(note, []).append(one.design.name)
    return [
        note if len(of) == len(designs) else f"{', '.join(of)}: {note}"
        for note, of in names.items()
    ]


def add_batch(table: Table, run: Run) -> None:
    """Rows on several designs: how many of each, whether it holds, what was written of them."""
    from rich.text import Text

    for one in run.checked:
        warned = sorted({f.rule for f in one.findings if f.verdict == "warn"})
        said = f"; warns: {', '.join(warned)}" if warned else ""
        waived = f"; waived: {', '.join(one.waived)}" if one.waived else ""
        verdict = "a rule failed" if one.failed else "every rule holds"
        words = f"{one.design.order.quantity} x, {verdict}{waived}{said}"
        table.add_row(one.design.name, Text(words))
    for note in notes_of(run.checked):
        table.add_row("note", Text(note))
    index = run.manifest
    for film in index.get("films", ()):
        table.add_row(f"{film['material']} film", Text(film_said(film, index["sheets"], 1)))
    for mesh in index.get("meshes", ()):
        table.add_row("solid", Text(f"{mesh['file']}, a node a part"))
    for label, text in replaced(run.dropped):
        table.add_row(label, Text(text))
    if index:
        table.add_row("folder", Text(str(run.folder)))


def print_failed(findings: Iterable[Finding], written: str, change: str) -> None:
    """What failed, what was ``written`` all the same, and the two ways on.

    What lies on disk cannot be waived: its design can.
    """
    failed = sorted({finding.rule for finding in findings if finding.verdict == "fail"})
    explain = f"sbafab explain {failed[0]}".replace(" ", KEPT)
    waive = " ".join(f"--waive{KEPT}{name}" for name in failed)
    other = f"waive by name: {waive}" if change != FILES else "regenerate the folder"
    words = f"{written}: {', '.join(failed)} failed. Change the {change} ({explain}), or {other}"
    print_wrapped(words, "bold red")


def print_run(run: Run) -> None:
    """The closing table of a run: sizes, what was made, what the rules found."""
    if not run.kept:
        print_facts(_made(run))
        click.echo()
    print_verdict(run, "design")


def print_verdict(run: Run, change: str) -> None:
    """What needs something done, and last whether the design or assembly holds."""
    from sbafab.cli.verdicts import groups_of, print_open, verdict_said

    groups = groups_of(run.checked, run.between)
    for group in groups:
        print_open(group.findings)
    if run.failed:
        print_failed(run.findings, "No cut files were written", change)
        if run.kept:
            print_line(f"{run.folder} {LEFT_AS_IT_WAS}")
        return
    more = f"sbafab check {run.folder} says more"
    print_line(verdict_said(run.folder.name, groups, more), "bold")


def print_job(job: Run) -> None:
    """What a job made; for a design that a rule stopped, what the rules found."""
    from rich.text import Text

    from sbafab.cli.verdicts import print_open

    out = console()
    made = facts_table()
    add_batch(made, job)
    out.print(made)
    for one in job.checked:
        if one.failed:
            out.print()
            out.print(Text(one.design.name, style="bold red"))
            print_open(one.findings)
    if job.failed:
        every = (finding for one in job.checked for finding in one.findings)
        print_failed(every, f"Nothing was written; {job.folder} is as it was", "designs")


def job_json(job: Run) -> dict[str, object]:
    """The result of a job for programs."""
    from sbafab.output.printed import NESTED_SCHEMA

    return {
        "schema": NESTED_SCHEMA,
        "folder": str(job.folder),
        "failed": job.failed,
        "designs": [
            {
                "name": one.design.name,
                "failed": one.failed,
                "findings": [finding.as_dict() for finding in one.findings],
                "notes": notes_of([one]),
            }
            for one in job.checked
        ],
        "files": sorted(job.manifest.get("files", ())),
    }


def _made(run: Run) -> Iterator[tuple[str, str]]:
    from sbafab.pressing.together import batch_times, design_runs

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
    yield from replaced(run.dropped)
    cut = [layer["file"] for layer in index["layers"] if layer["file"]]
    if cut:
        plate = f", and the base plate {index['fixture']}" if index["fixture"] else ""
        yield (
            "cut files",
            f"{len(cut)} in layers/{plate}, each read back and compared with its profile",
        )
    panel = index.get("panel")
    if panel:
        width, length = panel["size"]
        batches = "1 batch" if panel["batches"] == 1 else f"{panel['batches']} batches"
        yield (
            "panel",
            f"one sheet a layer, {width:.2f} x {length:.2f} mm; {batches} with places for "
            f"{len(panel['places'])} each; freed by {panel['second_cut']}",
        )
    yield from _ordered(run)
    for film in index["films"]:
        if "sheets" in film:
            yield f"{film['material']} film", film_said(film, index["sheets"], index["copies"])
    if run.schedule is not None:
        force = run.schedule.steps[0].force_n / 1000
        yield (
            "press",
            f"{len(run.schedule.steps)} steps, {run.schedule.total_press_minutes:g} min at "
            f"{run.schedule.steps[0].temperature_c:g} C, {force:.3f} kN; press.json, press.csv",
        )
        runs = design_runs(run.design, lam)
        if runs.copies > 1:
            took = batch_times(runs, run.schedule)
            sizes = ", ".join(map(str, dict.fromkeys(runs.cycles)))
            yield (
                "batch",
                f"{runs.copies} copies in {runs.count} press cycle{'s' if runs.count > 1 else ''} "
                f"of {sizes}: {took.press:g} min in the press, {took.total:g} min in all",
            )
    yield from _for_simulation(run)
    if cut:
        for said in index["warnings"]:
            yield "warning", said
    for note in lam.notes:
        yield "note", note
    for warning in run.schedule.warnings if run.schedule is not None else ():
        yield "warning", warning
    yield "folder", str(run.folder)


def replaced(dropped: Sequence[str]) -> Iterator[tuple[str, str]]:
    """The row on the files of an earlier run that were removed, if there were any."""
    if dropped:
        count = "1 stale file" if len(dropped) == 1 else f"{len(dropped)} stale files"
        names = ", ".join(dict.fromkeys(path.partition("/")[0] for path in dropped))
        yield (
            "replaced",
            f"removed {count} ({names}); --set name=NAME gives a design a folder of its own",
        )


def _for_simulation(run: Run) -> Iterator[tuple[str, str]]:
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
        yield "", "solid.* and cavity_<chamber>.stl show it flat, skin.* shows it filled."


def _ordered(run: Run) -> Iterator[tuple[str, str]]:
    """A row on an order of good actuators."""
    if run.design.order.why:
        yield "order", run.design.order.why


def film_said(film: Mapping[str, Any], sheets: Sequence[Mapping[str, Any]], copies: int) -> str:
    """How a film is used: sheets, their size, density, waste and estimated time."""
    own = [sheet for sheet in sheets if sheet["material"] == film["material"]]
    count = f"{len(own)} sheet{'s' if len(own) > 1 else ''}"
    sizes = dict.fromkeys(f"{sheet['width']:g} x {sheet['length']:g}" for sheet in own)
    minutes = sum(sheet["estimated_minutes"] for sheet in own)
    many = f" for {copies} copies" if copies > 1 else ""
    bare = any(sheet["label"] == "no room" for sheet in own)
    unlabelled = "; the border has no room for labels, so write on them what they are"
    return (
        f"{count} of {', '.join(sizes)} mm{many}, {film['density']:.0%} used, "
        f"{film['waste'] / 100:.0f} cm2 waste, about {minutes:.1f} min of cutting; "
        f"{', '.join(sheet['file'] for sheet in own)}{unlabelled if bare else ''}"
    )


def run_json(run: Run) -> dict[str, object]:
    """The result of a run for programs."""
    from sbafab.output.printed import RUN_SCHEMA

    return {
        "schema": RUN_SCHEMA,
        "folder": str(run.folder),
        "failed": run.failed,
        "findings": [finding.as_dict() for finding in run.findings],
        "notes": notes_of(run.checked),
        "files": [] if run.kept else sorted(run.manifest["files"]),
    }
