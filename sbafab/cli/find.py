"""``sbafab find``: the search for a design that meets requirements."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from sbafab.actuators import load_design
from sbafab.cli.exit import RULE_FAILED, print_error
from sbafab.cli.options import (
    design_file,
    file_option,
    flow_option,
    folder_option,
    json_option,
    set_option,
)
from sbafab.cli.printing import (
    print_failure,
    print_json,
    print_line,
    print_note,
    print_verdict,
    print_wrapped,
)
from sbafab.cli.progress import shown_progress
from sbafab.design.files import changed_keys, name_of, template_names
from sbafab.documents import Document, PlainNumber, attribute
from sbafab.errors import DesignError
from sbafab.models.figures import FLAGS, FlagList
from sbafab.models.formulas import MOST_PRESSURE, is_near_burst
from sbafab.models.paper import CounterpartEntry
from sbafab.search.find import (
    FOUND,
    Binding,
    FindRequest,
    FoundDesign,
    Spare,
    found_toml,
    free_keys,
    refuse_existing,
    write_found,
)
from sbafab.search.find import find as search
from sbafab.search.quantities import (
    RequestedQuantity,
    quantity_lines,
    read_sure,
    shown_interval,
    shown_value,
)
from sbafab.search.trial import (
    Goal,
    Requirement,
    figure_text,
    keys_said,
    read_all,
    read_free,
    value_said,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from sbafab.process import Progress

HELP = """Find the best design that meets requirements.

Without DESIGN the search starts from every family. If no design meets all requirements, the nearest
miss is shown, no file is written, and the exit code is 1. A quantity may name its pressure P and
height H with units, such as force@12.5mm@50kPa or, flat, force@0mm@50kPa. Without a pressure it is
at the highest that another one names, or at 10 kPa. H in % is of the reference stroke, force@50%,
which round pockets have of the paper's film alone:

\b
{quantities}
"""


def _with_quantities(command: Callable[..., None]) -> Callable[..., None]:
    """Set the help text of a command, with all quantities and their units."""
    command.__doc__ = HELP.format(quantities=quantity_lines())
    return command


def _sure(ctx: click.Context, param: click.Parameter, text: str | None) -> float | None:
    if text is None:
        return None
    try:
        return read_sure(text)
    except ValueError as error:
        raise click.BadParameter(f"{text!r} {error}", ctx, param) from None


@click.command()
@click.argument("source", metavar="[DESIGN]", required=False)
@click.option(
    "--min",
    "least",
    metavar="QUANTITY=VALUE",
    multiple=True,
    help='At least this much, e.g. lumen=3, stroke=25 or "force@12.5mm@50kPa=3". Repeatable.',
)
@click.option(
    "--max",
    "most",
    metavar="QUANTITY=VALUE",
    multiple=True,
    help="At most this much, e.g. overall_diameter=20, mass=0.5 or time=0.5. Repeatable.",
)
@click.option(
    "--sure",
    callback=_sure,
    metavar="P",
    help="Probability with which each requirement on a predicted quantity must hold, e.g. 0.9.",
)
@flow_option("Flow of water in all, for the time")
@click.option(
    "--best",
    default="mass",
    show_default=True,
    metavar="QUANTITY",
    help="Goal among the designs that meet all: largest stroke, bend, force, yield or lumen, or "
    "smallest of another quantity.",
)
@click.option(
    "--free",
    metavar="KEY=LOW:HIGH:STEP",
    multiple=True,
    help="Vary this key as well as those of the family, or set its range; of a key that is a word "
    "KEY=WORD,WORD. Repeatable.",
)
@click.option(
    "--fix",
    "fixed",
    metavar="KEY",
    multiple=True,
    help="Do not vary this key; keys of --set are not varied either. Repeatable.",
)
@click.option(
    "--tries", type=click.IntRange(4, 100_000), default=240, show_default=True, metavar="N",
    help="Largest number of designs to try, for each family.",
)  # fmt: skip
@click.option("--optuna", is_flag=True, help='Search with Optuna (pip install "sbafab[optuna]").')
@click.option(
    "--storage",
    metavar="URL",
    help="Database of Optuna, to resume the search from, e.g. sqlite:///search.db.",
)
@folder_option(f"Folder in which {FOUND} is written.")
@file_option(FOUND)
@set_option
@json_option
@_with_quantities
def find(source: str | None, **options: Any) -> None:
    if options["storage"] is not None and not options["optuna"]:
        raise click.UsageError("--storage goes with --optuna; add it")
    requests = _requests(source, options)
    target = design_file(options["to"], options["out"], FOUND)
    refuse_existing(target)
    if any(_counts_tabs(request) for request in requests.values()):
        print_note(TABS_HINT)
    try:
        with shown_progress(options["as_json"]) as progress:
            origin, result = _best_result(requests, progress)
    except KeyboardInterrupt:
        resume = "; run the same command again to resume it" if options["storage"] else ""
        print_error(f"the search was stopped, and no file was written{resume}")
        raise
    if result.holds:
        write_found(
            found_toml(origin, options["assignments"], name_of(target) or origin, result, target),
            target,
        )
    if options["as_json"]:
        print_json(as_json(result, origin, target))
    else:
        print_result(result, origin, target)
    if not result.holds:
        click.get_current_context().exit(RULE_FAILED)


def _requests(source: str | None, options: dict[str, Any]) -> dict[str, FindRequest]:
    """Return the searches by the design to start from: ``source``, or a template of each family.

    Families without the requested quantities are left out. Raises DesignError if none remains.
    """
    requirements, goal = read_all(
        options["least"], options["most"], options["best"], options["flow_ml_min"]
    )
    requests: dict[str, FindRequest] = {}
    problems: list[str] = []
    for name in [source] if source else _family_templates():
        try:
            requests[name] = _request(name, requirements, goal, options)
        except DesignError as error:
            problems.append(str(error))
    if not requests:
        raise DesignError("; ".join(dict.fromkeys(problems)))
    return requests


def _request(
    name: str, requirements: tuple[Requirement, ...], goal: Goal, options: dict[str, Any]
) -> FindRequest:
    assignments = options["assignments"]
    design = load_design(name, assignments)
    free = read_free(design, options["free"], options["fixed"], tuple(changed_keys(assignments)))
    settings = {name: options[name] for name in ("tries", "optuna", "storage", "sure")}
    request = FindRequest(design, requirements, goal, free, **settings)
    free_keys(request)  # raises DesignError for keys that cannot vary
    return request


def _best_result(requests: dict[str, FindRequest], progress: Progress) -> tuple[str, FoundDesign]:
    """Run the searches; return the best result and the design that it started from."""
    results: list[tuple[str, FoundDesign]] = []
    problems = []
    for number, (name, request) in enumerate(requests.items()):

        def report(stage: str, done: int, total: int, searched: int = number) -> None:
            progress(stage, searched * total + done, len(requests) * total)

        try:
            results.append((name, search(request, report)))
        except DesignError as error:
            problems.append(str(error))
    if not results:
        raise DesignError("; ".join(dict.fromkeys(problems)))
    return min(results, key=lambda result: result[1].best.rank)


def _family_templates() -> list[str]:
    """Return the first template of each family."""
    templates: dict[type, str] = {}
    for name in template_names():
        try:
            templates.setdefault(type(load_design(name)), name)
        except DesignError:
            continue
    return list(templates.values())


# Printing of a result, and its JSON.


TABS_HINT = (
    "overall_diameter counts the inlet tabs; use outline_diameter if they may stand out, or add "
    "--free inlet.tab_length=3:5:0.5"
)


def _counts_tabs(request: FindRequest) -> bool:
    """Return True if a search limits the diameter with tabs, and may not shorten these."""
    names = [requirement.quantity.name for requirement in request.requirements]
    free = [free.key for free in free_keys(request)]
    return "overall_diameter" in names and "inlet.tab_length" not in free


class TrialEntry(Document):
    """A design that was tried."""

    keys: dict[str, Any] = attribute("values")
    """keys of the design that were found"""
    figures: dict[str, PlainNumber]
    """quantities in mm, deg, N, N/mm, s, g or a share"""


class RequirementEntry(Document):
    """A requirement, with the figures of the best design."""

    quantity: str = attribute("quantity.label")
    unit: str = attribute("quantity.unit")
    sense: Literal["at least", "at most"]
    limit: PlainNumber
    median: PlainNumber
    """of the best; force below 0 where it rises less"""
    bound: PlainNumber | None
    """kept with the probability `sure`, and held against the limit"""
    holds: bool


class RangeEndEntry(Document):
    """A key that only its range stops."""

    key: str
    value: Any
    low: PlainNumber
    high: PlainNumber


class FindDocument(Document, schema="sbafab/find@1"):
    """What ``find --json`` prints; by quantity where names are keys."""

    holds: bool
    file: str | None
    """the design file, null where none holds"""
    started_from: str
    tries: int
    is_cut_short: bool
    """whether more tries might lead further"""
    sure: PlainNumber | None = attribute("problem.sure")
    """probability with which requirements must hold"""
    best: TrialEntry
    intervals: dict[str, tuple[float, float]]
    """90 % intervals of the best, where a calibration says so"""
    flags: dict[str, FlagList]
    """what figures of the best are not to be trusted for"""
    requirements: list[RequirementEntry]
    measured: dict[str, CounterpartEntry]
    missed: list[str]
    binds: list[Binding]
    range_ends: list[RangeEndEntry] = attribute("ends")
    without_room: list[Spare]
    front: list[TrialEntry]
    on_front: int


def as_json(result: FoundDesign, origin: str, target: Path) -> dict[str, Any]:
    """Return a result as JSON."""
    return FindDocument.of(
        result,
        file=str(target) if result.holds else None,
        started_from=origin,
        requirements=[_requirement(result, row) for row in result.problem.requirements],
        measured={name: row.entry() for name, row in result.measured.items()},
    )


def _requirement(result: FoundDesign, requirement: Requirement) -> RequirementEntry:
    """Return a requirement with the figures of the best design; ``bound`` is null without sure."""
    best = result.best
    bound = best.judged(requirement)
    return RequirementEntry.read(
        requirement,
        sense="at least" if requirement.at_least else "at most",
        median=best.value(requirement),
        bound=bound if requirement.quantity.label in best.intervals else None,
        holds=requirement.holds(bound),
    )


def print_result(result: FoundDesign, origin: str, target: Path) -> None:
    """Print the design with its figures, what binds and the front; or the nearest miss."""
    keys = keys_said(result.best.values)
    title = "Best design" if result.holds else "Nearest miss"
    print_line(f"{title}: {keys}, from {origin}", "bold" if result.holds else "bold red")
    _print_quantities(result)
    for rule in result.broken_rules:
        print_line(f"  {rule}")
    if result.binds or result.ends or (result.holds and result.without_room):
        print_line("Binding limits", "bold")
    for bind in result.binds:
        print_line(f"  {bind.key} = {value_said(bind.value)}: {bind.breaks}")
    _print_ends(result)
    if not result.holds:
        _print_miss(result)
        return
    for spare in result.without_room:
        print_line(f"  {spare.rule} {spare.place}: {spare.measured:g} {spare.unit}, at its limit")
    _print_front(result)
    _print_more_tries(result)
    count = _counted_requirements(result)
    print_verdict(
        f"{target} meets {count}. Next: sbafab generate {shlex.quote(str(target))}",
        target,
    )


def _counted_requirements(result: FoundDesign) -> str:
    rows = result.problem.requirements
    is_sure = result.problem.sure is not None
    is_median = not is_sure and any(row.quantity.label in result.intervals for row in rows)
    every = "the requirement" if len(rows) == 1 else f"all {len(rows)} requirements"
    return f"{every if rows else 'all rules'}{' in the median' if is_median else ''}"


def _print_quantities(result: FoundDesign) -> None:
    """Print the required quantities and the goal of the best design."""
    requirements = result.problem.requirements
    for requirement in requirements:
        value = figure_text(result.problem, result.best, requirement)
        value += "" if result.problem.sure else _interval_text(result, requirement)
        is_met = requirement.holds(result.best.judged(requirement))
        missed = "" if is_met else ": MISSED"
        print_line(f"  {requirement.quantity.label} {value}; {requirement.bound}{missed}")
        _print_measured(result, requirement.quantity)
    goal = result.problem.goal
    label = goal.label if result.holds else goal.quantity.label
    value = shown_value(goal.quantity, result.best.value(goal)) + _interval_text(result, goal)
    print_line(f"  {label}: {value}")
    if goal.quantity.label not in [requirement.quantity.label for requirement in requirements]:
        _print_measured(result, goal.quantity)
    is_sure = result.problem.sure is not None
    if goal.quantity.label in result.intervals or (result.intervals and not is_sure):
        hint = "" if is_sure else "; --sure 0.9 asks that each requirement holds so"
        note = f"in parentheses the 90 % interval of what would be measured{hint}"
        print_wrapped(note, indent="  ")


def _interval_text(result: FoundDesign, subject: Requirement | Goal) -> str:
    """Return the 90 % interval in parentheses; empty without one."""
    interval = result.intervals.get(subject.quantity.label)
    if interval is None or result.best.value(subject) < 0:
        return ""
    return f" ({shown_interval(interval)})"


def _print_measured(result: FoundDesign, quantity: RequestedQuantity) -> None:
    for flag in result.flags.get(quantity.label, ()):
        print_wrapped(f"({FLAGS[flag]})", indent="    ")
    measured = result.measured.get(quantity.label)
    if measured is not None:
        print_wrapped(f"({measured.sentence()})", indent="    ")


def _print_more_tries(result: FoundDesign) -> None:
    if result.is_cut_short:
        more = 2 * result.tries
        print_line(f"All {result.tries} tries were used; --tries {more} may find a better design")


def _print_ends(result: FoundDesign) -> None:
    for end in result.ends:
        low, high = end.wider
        print_line(
            f"  {end.key} = {end.value:g} is at the end of its range, {end.low:g} to {end.high:g}; "
            f"widen it with --free {end.key}={low:g}:{high:g}:{end.step:g}"
        )


def _print_miss(result: FoundDesign) -> None:
    """Print the verdict of a search without success."""
    _print_more_tries(result)
    print_failure(
        f"Search failed: none of {result.tries} designs meets all requirements; nothing was "
        f"written. Relax a requirement{_more_pressure(result)}, or vary more keys with --free "
        "KEY=LOW:HIGH:STEP"
    )


def _more_pressure(result: FoundDesign) -> str:
    """Return the advice for a missed force: the same one at more pressure; empty for others."""
    for row in result.problem.requirements:
        quantity, laminate = row.quantity, result.best.laminate
        if quantity.name != "force" or not row.at_least or laminate is None:
            continue
        kpa = max(USEFUL_KPA, 2 * (quantity.kpa or 0.0))
        is_allowed = kpa <= MOST_PRESSURE and not is_near_burst(laminate, kpa)
        if is_allowed and not row.holds(result.best.judged(row)):
            return f", ask for the force at more pressure, {replace(quantity, kpa=kpa).label}"
    return ""


USEFUL_KPA = 50.0
"""Pressure that is proposed for a force, unless it was missed at half of it or more."""


def _print_front(result: FoundDesign) -> None:
    """Print the Pareto front, if it has several designs."""
    if len(result.front) < 2:
        return
    part = f"{len(result.front)} of " if result.on_front > len(result.front) else ""
    print_line(f"Pareto front, {part}{result.on_front} of the {result.tries} designs tried", "bold")
    for trial in result.front:
        figures = ", ".join(f"{name} {value:.4g}" for name, value in trial.figures.items())
        print_line(f"  {keys_said(trial.values)}: {figures}")
    for name, measured in result.measured.items():
        print_wrapped(f"({name}: {measured.sentence()})", indent="    ")
