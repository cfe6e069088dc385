"""``sbafab check``: the rule deck on a design or on an output folder; nothing is written."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from sbafab.cli.exit import RULE_FAILED, say
from sbafab.cli.options import designs_or_folders, json_option, set_option, waive_option
from sbafab.errors import SbafabError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from sbafab.cli.printing import Group
    from sbafab.design.records import Design
    from sbafab.output.advice import Advice
    from sbafab.output.job import CheckedJob
    from sbafab.rules.finding import Finding

YIELD = "registration-yield"
PAPER = "paper"
"""The kit that a design has by itself."""


class CheckRequest(NamedTuple):
    """What the command line asks for."""

    source: str
    assignments: tuple[str, ...]
    waivers: tuple[str, ...]
    target: float | None
    as_json: bool
    verbose: bool

    @property
    def is_folder(self) -> bool:
        from sbafab.design.files import template_names

        return self.source not in template_names() and Path(self.source).is_dir()


class Told(NamedTuple):
    """What was checked ("design" or "as-built"), its name, findings, notes, and the designs.

    ``sizes``: those of each design by name, and in words. ``has_target``: the design itself asks
    for a yield.
    """

    kind: str
    name: str
    findings: Sequence[Finding]
    groups: Sequence[Group]
    notes: Sequence[str] = ()
    designs: Sequence[Design] = ()
    sizes: Mapping[str, Mapping[str, float]] = {}
    sizes_said: Mapping[str, Sequence[str]] = {}
    has_target: bool = False


@click.command()
@click.argument("source", metavar="DESIGN|FOLDER", shell_complete=designs_or_folders)
@set_option
@waive_option("Take this rule's failure as accepted; cut files would say so. Repeatable.")
@click.option(
    "--target-yield",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    metavar="SHARE",
    help="Fail below this share of good random builds, and advise the least bond and overhang "
    "that reach it, e.g. 0.99.",
)
@click.option("-v", "--verbose", is_flag=True, help="All findings with their places and reasons.")
@click.option("--watch", is_flag=True, help="Check again whenever a file of the design changes.")
@json_option
def check(
    source: str,
    assignments: tuple[str, ...],
    waivers: tuple[str, ...],
    target_yield: float | None,
    verbose: bool,
    watch: bool,
    as_json: bool,
) -> None:
    """Run the rules on a design or on a written folder.

    Nothing is written. FOLDER is one that sbafab generate has written: its files are read back as
    they lie on disk.
    """
    asked = CheckRequest(source, assignments, waivers, target_yield, as_json, verbose)
    if watch:
        if as_json:
            raise click.UsageError("--watch is for people; leave out --json or --watch")
        repeated(lambda: _checked(asked), Path(source))
    elif _checked(asked):
        click.get_current_context().exit(RULE_FAILED)


def _checked(asked: CheckRequest) -> bool:
    """Checks once and prints what was found; whether a rule failed."""
    from sbafab.cli.printing import print_json
    from sbafab.output.checked import checks
    from sbafab.rules.deck import has_failed

    told = _of_folder(asked) if asked.is_folder else _of_source(asked)
    advice = None if asked.target is None else _advice(asked, asked.target)
    if asked.as_json:
        advised = {"advice": advice.as_dict()} if advice else {}
        found = checks(told.findings, told.kind, told.name, told.designs)
        sized = {"sizes": told.sizes} if told.sizes else {}
        print_json({**found, **sized, "notes": list(told.notes), **advised})
    else:
        _print(told, advice, asked.verbose)
    return has_failed(told.findings)


def _print(told: Told, advice: Advice | None, verbose: bool) -> None:
    from rich.text import Text

    from sbafab.cli.printing import (
        FILES,
        console,
        print_failed,
        print_findings,
        print_listed,
        print_wrapped,
        verdict_said,
    )
    from sbafab.design.kits import cited

    out = console()
    if told.kind == "as-built":
        out.print(f"as built: {told.name}", markup=False, soft_wrap=True)
    for name, phrases in told.sizes_said.items():
        print_listed(f"{name}, size" if len(told.sizes_said) > 1 else "size", phrases)
    # The paper's kit is what everyone has; one's own is told of.
    kits = [cited(design) for design in told.designs if verbose or design.kit != PAPER]
    for said in dict.fromkeys(kits):
        print_wrapped(said)
    for note in told.notes:
        print_wrapped(f"note: {note}")
    print_findings(told.groups, verbose)
    if advice:
        print_wrapped(advice.sentence)
    failed = {one.rule for one in told.findings if one.verdict == "fail"}
    if advice and failed == {YIELD} and not told.has_target:
        print_wrapped(
            f"{told.name} misses the yield of {advice.target:g} that was asked for. Without that "
            "target no rule fails, and it may be cut.",
            "bold red",
        )
        return
    if failed:
        change = FILES if told.kind == "as-built" else "design"
        print_failed(told.findings, f"{told.name} must not be cut", change)
        return
    more = "" if verbose else "Details: -v"
    out.print(Text(verdict_said(told.name, told.groups, more).strip(), style="bold"))


def _of_source(asked: CheckRequest) -> Told:
    """What is found in a design or an assembly."""
    from sbafab.actuators import load_design
    from sbafab.assemblies.files import load
    from sbafab.cli.printing import shown_progress
    from sbafab.design.records import Design
    from sbafab.errors import DesignError
    from sbafab.output.job import check_job

    found = load(asked.source, asked.assignments, asked.waivers)
    with shown_progress(asked.as_json) as progress:
        if not isinstance(found, Design):
            if asked.target is not None:
                raise DesignError(
                    "--target-yield goes with a design, and this is an assembly; check its "
                    "parts' designs one by one"
                )
            return _of_job(check_job(found, progress=progress))
        has_target = found.rules.target_yield is not None
        if asked.target is not None:
            found = load_design(asked.source, _asking(asked, asked.target), asked.waivers)
        return _of_job(check_job(found, progress=progress))._replace(has_target=has_target)


def _of_job(job: CheckedJob) -> Told:
    """Findings and notes; what press and sheets cannot do is refused, as a run would do."""
    from sbafab.cli.printing import groups_of, notes_of
    from sbafab.models.formulas import size_said, sizes
    from sbafab.output.checked import refuse_undoable

    if not job.failed:
        refuse_undoable(job.designs)
    designs = [checked.design for checked in job.designs]
    groups = groups_of(job.designs, job.between)
    measured = {each.design.name: sizes(each.design, each.laminate) for each in job.designs}
    said = {each.design.name: size_said(each.design, each.laminate) for each in job.designs}
    notes = notes_of(job.designs)
    return Told("design", job.name, job.findings, groups, notes, designs, measured, said)


def _advice(asked: CheckRequest, target: float) -> Advice:
    from sbafab.actuators import load_design
    from sbafab.cli.printing import shown_progress
    from sbafab.output.advice import advise

    with shown_progress(asked.as_json) as tell:
        return advise(load_design(asked.source, _asking(asked, target)), target, tell)


def _asking(asked: CheckRequest, target: float) -> tuple[str, ...]:
    return (*asked.assignments, f"rules.target_yield={target}")


def _of_folder(asked: CheckRequest) -> Told:
    """What is found in the files of an output folder."""
    import logging

    from sbafab.cli.printing import Group
    from sbafab.errors import DesignError
    from sbafab.runs.check_folder import check_folder

    if asked.assignments or asked.waivers or asked.target is not None:
        raise DesignError(
            "--set, --waive and --target-yield go with a design; a folder is checked as it lies, "
            "so leave them out"
        )
    # A broken file is told of in a finding; what ezdxf logs of it would stand in between.
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())
    findings = check_folder(Path(asked.source))
    return Told("as-built", asked.source, findings, [Group(asked.source, findings)])


# Doing a thing again whenever a file changes, until Ctrl-C.


READ = (".toml", ".dxf", ".svg")
"""What a design is made of: its file, a kit, drawings, the designs of an assembly."""
EVERY = 0.4
"""Seconds between two looks: a file system tells of changes in as many ways as there are."""

Stamps = dict[Path, tuple[int, int]]


def repeated(once: Callable[[], object], source: Path, looks: int | None = None) -> None:
    """Calls ``once`` now and after every change in the folder of ``source``.

    Bad input is said and waited out. ``looks`` bounds how often is looked (None: for ever).
    """
    seen: Stamps | None = None
    while looks is None or looks > 0:
        now = stamps(source)
        if now != seen:
            seen = now
            click.echo(f"{datetime.now():%H:%M:%S}  watching {source}; Ctrl-C ends")
            try:
                once()
            except SbafabError as error:
                say(str(error))
        looks = None if looks is None else looks - 1
        time.sleep(EVERY)


def stamps(source: Path) -> Stamps:
    """Time and size of every file that the source may be made of."""
    found: Stamps = {}
    for path in _files(source):
        # One that an editor is just replacing is there again at the next look.
        with suppress(OSError):
            state = path.stat()
            found[path] = state.st_mtime_ns, state.st_size
    return found


def _files(source: Path) -> Iterator[Path]:
    if source.is_dir():
        yield from (path for path in source.rglob("*") if path.is_file())
    elif source.parent.is_dir():
        yield from (path for path in source.parent.iterdir() if path.suffix.lower() in READ)
