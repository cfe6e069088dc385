"""``sbafab check``: rules on a design or on an output folder, once or after every change."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import click

from sbafab.actuators import load_design
from sbafab.assemblies.files import load
from sbafab.cli.exit import RULE_FAILED, print_error
from sbafab.cli.options import (
    designs,
    json_option,
    set_option,
    target_yield_option,
    waive_option,
)
from sbafab.cli.printing import (
    FILES,
    FindingGroup,
    groups_of,
    notes_of,
    print_failed,
    print_failure,
    print_findings,
    print_json,
    print_line,
    print_listed,
    print_passed,
    print_wrapped,
)
from sbafab.cli.progress import shown_progress
from sbafab.design.files import template_names
from sbafab.design.identity import cited
from sbafab.design.records import Design
from sbafab.errors import DesignError, SbafabError
from sbafab.folders.build import Build, refuse_undoable
from sbafab.folders.checks import checks
from sbafab.folders.order import Order, make_order
from sbafab.laminate.netlist import read_netlist
from sbafab.models.formulas import size_phrases, sizes
from sbafab.process import Progress
from sbafab.rules.deck import has_failed
from sbafab.rules.finding import Finding
from sbafab.rules.nets import netlist_findings
from sbafab.search.advice import Advice, advise

YIELD_RULE = "registration-yield"
DEFAULT_KIT = "paper"
"""The kit of a design that names none."""


class CheckOutcome(NamedTuple):
    """Result of a check: ``findings`` in the designs of ``job``, or in a folder without one.

    ``has_target`` is True if the design itself sets ``rules.target_yield``.
    """

    name: str
    findings: Sequence[Finding]
    groups: Sequence[FindingGroup]
    job: Order | None = None
    advice: Advice | None = None
    has_target: bool = False

    @property
    def designs(self) -> Sequence[Build]:
        return () if self.job is None else self.job.builds


@click.command()
@click.argument("source", metavar="DESIGN|FOLDER", shell_complete=designs)
@set_option
@waive_option("Accept the failure of this rule; cut files would state it. Repeatable.")
@target_yield_option(
    "Fail if fewer random builds are good than this share, e.g. 0.99, and advise the smallest bond "
    "and overhang that reach it."
)
@click.option(
    "--nets",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Also compare what the layers join with a netlist: JSON of sbafab/nets@1 or ParchMint.",
)
@click.option("-v", "--verbose", is_flag=True, help="All findings, with places and reasons.")
@click.option("--watch", is_flag=True, help="Check again whenever a file of the design changes.")
@json_option
def check(  # noqa: PLR0913, PLR0917 - one an option
    source: str,
    assignments: tuple[str, ...],
    waivers: tuple[str, ...],
    target_yield: float | None,
    nets: Path | None,
    verbose: bool,
    watch: bool,
    as_json: bool,
) -> None:
    """Run the rules on a design or on an output folder.

    Nothing is written. FOLDER was written by sbafab generate; the files on disk are checked.
    """

    def run() -> bool:
        """Check and print the outcome; return True if a rule failed."""
        if is_folder:
            outcome = _check_folder(Path(source), nets)
        else:
            with shown_progress(as_json) as progress:
                outcome = _check_source(source, assignments, waivers, target_yield, nets, progress)
        if as_json:
            _print_json(outcome)
        else:
            _print(outcome, verbose)
        return has_failed(outcome.findings)

    is_folder = source not in template_names() and Path(source).is_dir()
    if is_folder and (assignments or waivers or target_yield is not None):
        raise DesignError(
            "--set, --waive and --target-yield go with a design; leave them out to check a folder"
        )
    if watch and as_json:
        raise click.UsageError("--watch and --json exclude each other; leave one out")
    if watch:
        watch_source(run, Path(source))
    elif run():
        click.get_current_context().exit(RULE_FAILED)


def _print_json(outcome: CheckOutcome) -> None:
    more: dict[str, object] = {"notes": notes_of(outcome.designs)}
    if outcome.job is not None:
        more["sizes"] = {
            each.design.name: sizes(each.design, each.laminate) for each in outcome.designs
        }
    if outcome.advice is not None:
        more["advice"] = outcome.advice
    kind = "as-built" if outcome.job is None else "design"
    designs = [each.design for each in outcome.designs]
    print_json(checks(outcome.findings, kind, outcome.name, designs, **more))


def _print(outcome: CheckOutcome, verbose: bool) -> None:
    """Print sizes, kit, notes and findings, and last the verdict."""
    if outcome.job is None:
        print_line(f"as built: {outcome.name}")
    for each in outcome.designs:
        label = "size" if len(outcome.designs) == 1 else f"{each.design.name}, size"
        print_listed(label, size_phrases(each.design, each.laminate))
    designs = [each.design for each in outcome.designs]
    kits = [cited(design) for design in designs if verbose or design.kit != DEFAULT_KIT]
    for line in dict.fromkeys(kits):
        print_wrapped(line)
    for note in notes_of(outcome.designs):
        print_wrapped(f"note: {note}")
    print_findings(outcome.groups, verbose)
    if outcome.advice:
        print_wrapped(outcome.advice.sentence)
    failed = {finding.rule for finding in outcome.findings if finding.verdict == "fail"}
    if outcome.advice and failed == {YIELD_RULE} and not outcome.has_target:
        print_failure(
            f"{outcome.name} failed: yield below the requested {outcome.advice.target:g}. Without "
            "--target-yield all rules pass, and it may be cut"
        )
    elif failed:
        change = FILES if outcome.job is None else "design"
        print_failed(outcome.name, outcome.findings, "It must not be cut", change)
    else:
        print_passed(outcome.name, outcome.groups, "" if verbose else "-v")


def _check_source(
    name: str,
    assignments: tuple[str, ...],
    waivers: tuple[str, ...],
    target: float | None,
    nets: Path | None,
    progress: Progress,
) -> CheckOutcome:
    """Check a design or an assembly. Raises DesignError, also if press or sheets cannot make it."""
    source = load(name, assignments, waivers)
    for option, value in (("--target-yield", target), ("--nets", nets)):
        if value is not None and not isinstance(source, Design):
            raise DesignError(
                f"{option} goes with a design, and this is an assembly; check its parts' designs "
                "one by one"
            )
    advice, has_target = None, False
    if target is not None and isinstance(source, Design):
        wanted = (*assignments, f"rules.target_yield={target}")
        advice = advise(load_design(name, wanted), target, progress)
        has_target = source.rules.target_yield is not None
        source = load_design(name, wanted, waivers)
    job = make_order(source, progress=progress)
    if not job.failed:
        refuse_undoable(job.builds)
    findings, groups = job.findings, groups_of(job.builds, job.between)
    if nets is not None:
        (checked,) = job.builds
        more = netlist_findings(checked.laminate, checked.design, read_netlist(nets), nets.name)
        findings = (*findings, *more)
        groups = (FindingGroup(job.name, findings),)
    return CheckOutcome(job.name, findings, groups, job, advice, has_target)


def _check_folder(folder: Path, nets: Path | None) -> CheckOutcome:
    """Check the files of an output folder."""
    import logging

    # Modules that read a folder back take as long to load as those that check a design.
    from sbafab.folders.check import check_folder

    # A broken file becomes a finding; the log of ezdxf would repeat it on the screen.
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())
    findings = check_folder(folder, nets)
    return CheckOutcome(str(folder), findings, [FindingGroup(str(folder), findings)])


# Checking again after every change of a file, until Ctrl-C.


WATCHED_SUFFIXES = (".toml", ".dxf", ".svg")
"""Files of a design: its own, a kit, drawings, the designs of an assembly."""
POLL_SECONDS = 0.4
"""Polling works on every file system; notifications of changes do not."""

FileStates = dict[Path, tuple[int, int]]


def watch_source(action: Callable[[], object], source: Path, polls: int | None = None) -> None:
    """Call ``action`` now and after every change in the folder of ``source``.

    Errors of the design are printed. ``polls`` limits the number of polls (None: no limit).
    """
    previous: FileStates | None = None
    while polls is None or polls > 0:
        current = file_states(source)
        if current != previous:
            previous = current
            click.echo(f"{datetime.now():%H:%M:%S}  watching {source}; Ctrl-C stops")
            try:
                action()
            except SbafabError as error:
                print_error(str(error))
        polls = None if polls is None else polls - 1
        time.sleep(POLL_SECONDS)


def file_states(source: Path) -> FileStates:
    """Return time, ns, and size, bytes, of every file that the source may consist of."""
    states: FileStates = {}
    is_folder = source.is_dir()
    for path in source.rglob("*") if is_folder else source.parent.glob("*"):
        is_watched = path.is_file() if is_folder else path.suffix.lower() in WATCHED_SUFFIXES
        # A file that an editor is replacing is there again at the next poll.
        with suppress(OSError):
            if is_watched:
                state = path.stat()
                states[path] = state.st_mtime_ns, state.st_size
    return states
