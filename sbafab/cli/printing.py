"""Lines and labelled facts on standard output, coloured where somebody looks at them."""

from __future__ import annotations

import json
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from sbafab.process import Progress, unheard
from sbafab.rules.finding import counted

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from sbafab.output.checked import Checked
    from sbafab.reports.assembly_prediction import AssemblyPrediction
    from sbafab.rules.finding import Finding, Verdict
    from sbafab.runs.run import Run

KEPT = "\u00a0"
"""A space at which no line is broken."""


def console() -> Console:
    """A console on standard output; 80 columns where there is no terminal and no COLUMNS."""
    from rich.console import Console

    class Told(Console):
        """A console that leaves it to its caller what a closed pipe means."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    return Told(highlight=False, soft_wrap=False)


def wrapped(said: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """Lines of a sentence, broken between words; ``first`` stands before the first, ``rest`` before
    the others.
    """
    return textwrap.wrap(
        said,
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )


def print_wrapped(said: str, style: str = "", indent: str = "") -> None:
    """A sentence, broken between words where it is longer than a line; the rest indented.

    All of it stands behind ``indent``.

    Words joined by ``KEPT`` stay on one line.
    """
    rest = indent or "  "
    for line in wrapped(said, console().width, indent, rest):
        print_line(line.replace(KEPT, " "), style)


def print_line(said: str, style: str = "") -> None:
    """One line, however long."""
    from rich.text import Text

    console().print(Text(said, style=style), soft_wrap=True)


def print_facts(facts: Iterable[tuple[str, str]]) -> None:
    """Labels, and beside them what is said of each."""
    from rich.text import Text

    made = facts_table()
    for label, text in facts:
        made.add_row(label, Text(text))
    console().print(made)


def facts_table() -> Table:
    """Without rows yet: a bold label and what is said of it."""
    from rich.table import Table

    made = Table(box=None, pad_edge=False, show_header=False)
    made.add_column(no_wrap=True, style="bold")
    made.add_column(ratio=1, overflow="fold")
    return made


# What commands print: progress, findings, the closing table.


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
    from sbafab.output.schema_ids import NESTED_SCHEMA

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
    from sbafab.pressing.cycles import batch_times, design_runs

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
            f"{len(run.schedule.steps)} steps, {_minutes(run.schedule.total_press_minutes)} at "
            f"{run.schedule.steps[0].temperature_c:g} C, {force:.3f} kN; press.json, press.csv",
        )
        runs = design_runs(run.design, lam)
        if runs.copies > 1:
            took = batch_times(runs, run.schedule)
            sizes = ", ".join(map(str, dict.fromkeys(runs.cycles)))
            yield (
                "batch",
                f"{runs.copies} copies in {runs.count} press cycle{'s' if runs.count > 1 else ''} "
                f"of {sizes}: {_minutes(took.press)} in the press, {_minutes(took.total)} in all",
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


def _minutes(value: float | None) -> str:
    return "minutes not stated" if value is None else f"{value:g} min"


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
    from sbafab.output.schema_ids import RUN_SCHEMA

    return {
        "schema": RUN_SCHEMA,
        "folder": str(run.folder),
        "failed": run.failed,
        "findings": [finding.as_dict() for finding in run.findings],
        "notes": notes_of(run.checked),
        "files": [] if run.kept else sorted(run.manifest["files"]),
    }


# What the rules found, as people read it: a line a rule, what to do, a summary last.


SHARES = {"pin-fit": "stretch", "registration-yield": "hold"}
"""Rules that measure a share, and what it is of: a film stretches over its pin, builds hold."""


class Group(NamedTuple):
    """Findings that belong together: of one design, or between the parts of an assembly."""

    name: str
    findings: Sequence[Finding]


def groups_of(
    checked: Iterable[Checked], between: Sequence[Finding] | None = None
) -> tuple[Group, ...]:
    """A group a design, and one for what lies between parts."""
    own = tuple(Group(one.design.name, one.findings) for one in checked)
    return own if between is None else (*own, Group("between the parts", between))


def print_findings(groups: Sequence[Group], verbose: bool = False) -> None:
    """A line for every rule; for several groups, and below, what needs something done."""
    out = console()
    for group in groups:
        if len(groups) > 1:
            out.print(f"{group.name}: {counted(group.findings)}", style="bold", markup=False)
        if verbose:
            print_lines(group.findings, verbose)
            continue
        if len(groups) == 1:
            print_lines(group.findings)
        print_open(group.findings)


def print_lines(findings: Sequence[Finding], verbose: bool = False) -> None:
    """A line a rule: the finding that decides; ``verbose`` all of them, each with what it says."""
    from rich.text import Text

    from sbafab.rules.finding import decisive

    out = console()
    shown = findings if verbose else list(decisive(findings).values())
    wide = max((len(one.rule) for one in shown), default=0)
    out.print(Text(f"{'rule':{wide}}  verdict  {'measured':>13}  {'limit':>14}", style="bold"))
    for one in shown:
        line = Text(f"{one.rule:{wide}}  ")
        line.append(f"{one.verdict:7}", style=COLOURS[one.verdict])
        measured = short_figure(one.measured, _unit(one))
        line.append(f"  {measured:>13}  {limit_said(one):>14}")
        line.rstrip()
        out.print(line, soft_wrap=True)
        for said in wrapped(one.message, out.width, "    ", "    ") if verbose else ():
            out.print(Text(said), soft_wrap=True)


def print_open(findings: Sequence[Finding]) -> None:
    """What to do about each warning, and what is wrong in each failure."""
    # Bond and overhang may ask for the same.
    for said, verdict in dict.fromkeys(_told(findings)):
        print_wrapped(said, COLOURS[verdict])


def _told(findings: Sequence[Finding]) -> Iterator[tuple[str, Verdict]]:
    for one in findings:
        if one.verdict in ("fail", "warn") or one.by_user:
            yield f"{one.rule}: {one.remedy or one.message}", one.verdict


def verdict_said(name: str, groups: Sequence[Group], more: str) -> str:
    """The closing line of what holds; ``more`` tells where the details are."""
    if len(groups) == 1:
        return f"{name} holds: {counted(groups[0].findings)}. {more}"
    return f"{name} holds. {more}"


def limit_said(finding: Finding) -> str:
    """A limit with its sense: ">=" the least that may be measured, "<=" the most."""
    if finding.limit is None:
        return "no target" if finding.rule in SHARES else ""
    sense = "<=" if _is_most(finding.rule) else ">="
    return f"{sense} {short_figure(finding.limit, _unit(finding))}"


def _unit(finding: Finding) -> str:
    """The unit of a finding's figures; of a share what is counted, after a per cent sign."""
    return f"% {SHARES[finding.rule]}" if finding.rule in SHARES else finding.unit


def _is_most(rule: str) -> bool:
    from sbafab.rules.deck import AT_MOST, rule_names

    if rule in rule_names():
        return rule in AT_MOST
    from sbafab.assemblies.checks import AT_MOST as BETWEEN_PARTS

    return rule in BETWEEN_PARTS


def short_figure(value: float | None, unit: str) -> str:
    """A measured value in a column; none where nothing was measured."""
    if value is None:
        return ""
    if unit.startswith("%"):
        return f"{100 * value:.3g}{unit}"
    digits = f"{value:.3f}" if unit == "mm" else f"{value:.4g}"
    return f"{digits} {unit}".strip()


# What ``sbafab generate`` prints of an assembly.


def print_assembly(run: Run) -> None:
    """What was made of an assembly, what the rules found, and the checks between its parts."""
    out = console()
    if not run.kept:
        out.print(_assembly_table(run))
        out.print()
    print_verdict(run, "assembly")


def _assembly_table(run: Run) -> Table:
    from rich.text import Text

    made = facts_table()
    index = run.manifest
    parts = (f"{p['name']} ({p['design'] or p['kind']})" for p in index["parts"])
    made.add_row("assembly", Text(f"{index['name']}, {index['design_sha256'][:12]}"))
    made.add_row("parts", Text(", ".join(parts)))
    add_batch(made, run)
    return made


def print_assembly_prediction(found: AssemblyPrediction) -> None:
    """What the parts of an assembly do inflated, and what they then touch."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("part", no_wrap=True)
    table.add_column("figure")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("model")
    table.add_column("paper")
    part = ""
    for figure in found.figures:
        table.add_row(
            figure.part if figure.part != part else "",
            Text(figure.name),
            f"{figure.value:.4g}",
            figure.unit,
            Text(figure.model),
            Text(figure.paper),
        )
        part = figure.part
    out = console()
    out.print(Text(f"{found.name} at {found.pressure_kpa:g} kPa", style="bold"))
    out.print(table)
    for measured in dict.fromkeys(figure.measured for figure in found.figures if figure.measured):
        names = [figure.name for figure in found.figures if figure.measured == measured]
        print_wrapped(f"{'; '.join(dict.fromkeys(names))}: {measured}")
    for sentence in found.met():
        out.print(Text(sentence))
    for one in found.left_out:
        out.print(Text(f"left out: {one}"))
