"""``sbafab check``: rules on a design or on an output folder, once or after every change."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import click

from sbafab.actuators import load_design
from sbafab.assemblies.files import load
from sbafab.cli.exit import RULE_FAILED, print_error
from sbafab.cli.options import (
    designs_or_folders,
    json_option,
    set_option,
    target_yield_option,
    waive_option,
)
from sbafab.cli.printing import (
    FILES,
    Group,
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
from sbafab.laminate.netlist import read_netlist
from sbafab.models.formulas import size_phrases, sizes
from sbafab.output.advice import Advice, advise
from sbafab.output.checked import checks, refuse_undoable
from sbafab.output.job import Order, check_job
from sbafab.rules.deck import has_failed
from sbafab.rules.finding import Finding
from sbafab.rules.nets import netlist_findings

YIELD_RULE = "registration-yield"
DEFAULT_KIT = "paper"
"""The kit of a design that names none."""


class CheckRequest(NamedTuple):
    """Arguments and options of the command."""

    source: str
    assignments: tuple[str, ...]
    waivers: tuple[str, ...]
    target: float | None
    as_json: bool
    verbose: bool
    nets: Path | None = None

    @property
    def is_folder(self) -> bool:
        return self.source not in template_names() and Path(self.source).is_dir()


class CheckOutcome(NamedTuple):
    """Result of a check: ``kind`` is "design" or "as-built".

    ``sizes`` and ``size_descriptions`` are by design; ``has_target`` is True if the design itself
    sets ``rules.target_yield``.
    """

    kind: str
    name: str
    findings: Sequence[Finding]
    groups: Sequence[Group]
    notes: Sequence[str] = ()
    designs: Sequence[Design] = ()
    sizes: Mapping[str, Mapping[str, float]] = {}
    size_descriptions: Mapping[str, Sequence[str]] = {}
    has_target: bool = False


@click.command()
@click.argument("source", metavar="DESIGN|FOLDER", shell_complete=designs_or_folders)
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
    request = CheckRequest(source, assignments, waivers, target_yield, as_json, verbose, nets)
    if watch:
        if as_json:
            raise click.UsageError("--watch and --json exclude each other; leave one out")
        watch_source(lambda: _run_check(request), Path(source))
    elif _run_check(request):
        click.get_current_context().exit(RULE_FAILED)


def _run_check(request: CheckRequest) -> bool:
    """Check and print the outcome; return True if a rule failed."""
    outcome = _check_folder(request) if request.is_folder else _check_source(request)
    advice = None if request.target is None else _advice(request, request.target)
    if request.as_json:
        more: dict[str, object] = {"sizes": outcome.sizes} if outcome.sizes else {}
        more |= {"notes": outcome.notes} | ({"advice": advice} if advice else {})
        print_json(checks(outcome.findings, outcome.kind, outcome.name, outcome.designs, **more))
    else:
        _print(outcome, advice, request.verbose)
    return has_failed(outcome.findings)


def _print(outcome: CheckOutcome, advice: Advice | None, verbose: bool) -> None:
    """Print sizes, kit, notes and findings, and last the verdict."""
    if outcome.kind == "as-built":
        print_line(f"as built: {outcome.name}")
    for name, phrases in outcome.size_descriptions.items():
        print_listed(f"{name}, size" if len(outcome.size_descriptions) > 1 else "size", phrases)
    kits = [cited(design) for design in outcome.designs if verbose or design.kit != DEFAULT_KIT]
    for line in dict.fromkeys(kits):
        print_wrapped(line)
    for note in outcome.notes:
        print_wrapped(f"note: {note}")
    print_findings(outcome.groups, verbose)
    if advice:
        print_wrapped(advice.sentence)
    failed = {finding.rule for finding in outcome.findings if finding.verdict == "fail"}
    if advice and failed == {YIELD_RULE} and not outcome.has_target:
        print_failure(
            f"{outcome.name} failed: yield below the requested {advice.target:g}. Without "
            "--target-yield all rules pass, and it may be cut"
        )
    elif failed:
        change = FILES if outcome.kind == "as-built" else "design"
        print_failed(outcome.name, outcome.findings, "It must not be cut", change)
    else:
        print_passed(outcome.name, outcome.groups, "" if verbose else "-v")


def _check_source(request: CheckRequest) -> CheckOutcome:
    """Check a design or an assembly."""
    source = load(request.source, request.assignments, request.waivers)
    with shown_progress(request.as_json) as progress:
        if not isinstance(source, Design):
            if request.target is not None:
                raise DesignError(
                    "--target-yield goes with a design, and this is an assembly; check its "
                    "parts' designs one by one"
                )
            if request.nets is not None:
                raise DesignError(
                    "--nets goes with a design, and this is an assembly; check its parts' designs "
                    "one by one"
                )
            return _outcome(check_job(source, progress=progress))
        has_target = source.rules.target_yield is not None
        if request.target is not None:
            assignments = _with_target(request, request.target)
            source = load_design(request.source, assignments, request.waivers)
        job = check_job(source, progress=progress)
        outcome = _outcome(job)._replace(has_target=has_target)
        return outcome if request.nets is None else _against_netlist(outcome, job, request.nets)


def _against_netlist(outcome: CheckOutcome, job: Order, file: Path) -> CheckOutcome:
    """Return the outcome with the findings of a design against a netlist."""
    (checked,) = job.builds
    netlist = read_netlist(file)
    more = netlist_findings(checked.laminate, checked.design, netlist, file.name)
    findings = (*outcome.findings, *more)
    return outcome._replace(findings=findings, groups=[Group(outcome.name, findings)])


def _outcome(job: Order) -> CheckOutcome:
    """Return the outcome; raises DesignError for a design that press or sheets cannot make."""
    if not job.failed:
        refuse_undoable(job.builds)
    return CheckOutcome(
        "design",
        job.name,
        job.findings,
        groups_of(job.builds, job.between),
        notes_of(job.builds),
        [each.design for each in job.builds],
        {each.design.name: sizes(each.design, each.laminate) for each in job.builds},
        {each.design.name: size_phrases(each.design, each.laminate) for each in job.builds},
    )


def _advice(request: CheckRequest, target: float) -> Advice:
    """Return the advice on bond and overhang for a target yield."""
    with shown_progress(request.as_json) as progress:
        return advise(load_design(request.source, _with_target(request, target)), target, progress)


def _with_target(request: CheckRequest, target: float) -> tuple[str, ...]:
    return (*request.assignments, f"rules.target_yield={target}")


def _check_folder(request: CheckRequest) -> CheckOutcome:
    """Check the files of an output folder."""
    import logging

    # Reading a folder back takes as long to load as all that checks a design.
    from sbafab.as_built.check import check_folder

    if request.assignments or request.waivers or request.target is not None:
        raise DesignError(
            "--set, --waive and --target-yield go with a design; leave them out to check a folder"
        )
    # A broken file becomes a finding; the log of ezdxf would repeat it on the screen.
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())
    findings = check_folder(Path(request.source), request.nets)
    return CheckOutcome("as-built", request.source, findings, [Group(request.source, findings)])


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
    for path in _watched_files(source):
        # A file that an editor is replacing is there again at the next poll.
        with suppress(OSError):
            state = path.stat()
            states[path] = state.st_mtime_ns, state.st_size
    return states


def _watched_files(source: Path) -> Iterator[Path]:
    if source.is_dir():
        yield from (path for path in source.rglob("*") if path.is_file())
    elif source.parent.is_dir():
        yield from (
            path for path in source.parent.iterdir() if path.suffix.lower() in WATCHED_SUFFIXES
        )
