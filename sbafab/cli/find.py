"""``sbafab find``: the search for a design that meets requirements."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

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
from sbafab.errors import DesignError
from sbafab.models.figures import FLAGS
from sbafab.models.formulas import MOST_PRESSURE, is_near_burst
from sbafab.process import Progress
from sbafab.search.find import (
    FoundDesign,
    find_document,
    found_toml,
    free_keys,
    refuse_existing,
    write_found,
)
from sbafab.search.find import find as search
from sbafab.search.quantities import (
    Goal,
    Requirement,
    quantity_lines,
    read_all,
    read_sure,
    shown_value,
)
from sbafab.search.space import FindRequest, figure_text, read_free
from sbafab.search.vary import format_keys, format_value

Value = TypeVar("Value")
FOUND = "found.toml"
"""The default file name in the folder of ``-o``."""
HELP = """Find the best design that meets requirements.

Without DESIGN the search starts from every family. If no design meets all requirements, the nearest
miss is shown, no file is written, and the exit code is 1. A quantity may name its pressure P and
height H with units, such as force@12.5mm@50kPa or, flat, force@0mm@50kPa. Without a pressure it is
at the highest that another one names, or at 10 kPa. H in % is of the reference stroke, force@50%,
which round pockets have of the paper's film alone:

\b
{quantities}
"""


def _sure(ctx: click.Context, param: click.Parameter, text: str | None) -> float | None:
    if text is None:
        return None
    try:
        return read_sure(text)
    except ValueError as error:
        raise click.BadParameter(f"{text!r} {error}", ctx, param) from None


@click.command(help=HELP.format(quantities=quantity_lines()))
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
    metavar="QUANTITY",
    help="Goal among the designs that meet all: largest stroke, bend, force, yield or lumen, or "
    "smallest of another quantity.",
)
@click.option(
    "--free",
    metavar="KEY=LOW:HIGH:STEP",
    multiple=True,
    help="Vary this key too, beside keys of the family, or set its range; of a key that is a word "
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
    "--tries", type=click.IntRange(4, 100_000), default=240, metavar="N",
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
        print_json(find_document(result, origin, target))
    else:
        print_result(result, origin, target)
    if not result.holds:
        click.get_current_context().exit(RULE_FAILED)


def _requests(source: str | None, options: dict[str, Any]) -> dict[str, FindRequest]:
    """Return the searches by the design to start from: ``source``, or a template of each family.

    Families without the requested quantities are left out. Raises DesignError if none remains.
    """
    limits = (options[name] for name in ("least", "most", "best", "flow_ml_min"))
    requirements, goal = read_all(*limits)
    assigned = options["assignments"]
    settings = {name: options[name] for name in ("tries", "optuna", "storage", "sure")}

    def request(name: str) -> FindRequest:
        design = load_design(name, assigned)
        free = read_free(design, options["free"], options["fixed"], tuple(changed_keys(assigned)))
        wanted = FindRequest(design, requirements, goal, free, **settings)
        free_keys(wanted)  # raises DesignError for keys that cannot vary
        return wanted

    return _each([source] if source else _family_templates(), request)


def _each(names: Iterable[str], value: Callable[[str], Value]) -> dict[str, Value]:
    """Return a value for each name that has one. Raises DesignError if none has."""
    values: dict[str, Value] = {}
    problems = []
    for name in names:
        try:
            values[name] = value(name)
        except DesignError as error:
            problems.append(str(error))
    if not values:
        raise DesignError("; ".join(dict.fromkeys(problems)))
    return values


def _best_result(requests: dict[str, FindRequest], progress: Progress) -> tuple[str, FoundDesign]:
    """Run the searches; return the best result and the design that it started from."""
    names = list(requests)

    def result(name: str) -> FoundDesign:
        def report(stage: str, done: int, total: int) -> None:
            progress(stage, names.index(name) * total + done, len(names) * total)

        return search(requests[name], report)

    return min(_each(names, result).items(), key=lambda item: item[1].best.rank)


def _family_templates() -> list[str]:
    """Return the first template of each family."""
    templates: dict[type, str] = {}
    for name in template_names():
        with suppress(DesignError):
            templates.setdefault(type(load_design(name)), name)
    return list(templates.values())


# Printing of a result.


TABS_HINT = (
    "overall_diameter counts the inlet tabs; use outline_diameter if they may stand out, or add "
    "--free inlet.tab_length=3:5:0.5"
)


def _counts_tabs(request: FindRequest) -> bool:
    """Return True if a search limits the diameter with tabs, and may not shorten these."""
    names = [requirement.quantity.name for requirement in request.requirements]
    free = [free.key for free in free_keys(request)]
    return "overall_diameter" in names and "inlet.tab_length" not in free


def print_result(result: FoundDesign, origin: str, target: Path) -> None:
    """Print the design with its figures, what binds and the front; or the nearest miss."""
    title = "Best design" if result.holds else "Nearest miss"
    style = "bold" if result.holds else "bold red"
    print_line(f"{title}: {format_keys(result.best.values)}, from {origin}", style)
    _print_quantities(result)
    for rule in result.best.broken_rules:
        print_line(f"  {rule}")
    limits = list(_binding_limits(result))
    if limits:
        print_line("Binding limits", "bold")
    for limit in limits:
        print_line(f"  {limit}")
    if result.holds and len(result.front) > 1:
        _print_front(result)
    if result.is_cut_short:
        more = f"--tries {2 * result.tries} may find a better design"
        print_line(f"All {result.tries} tries were used; {more}")
    if not result.holds:
        print_failure(
            f"Search failed: none of {result.tries} designs meets all requirements; nothing was "
            f"written. Relax a requirement{_more_pressure(result)}, or vary more keys with --free "
            "KEY=LOW:HIGH:STEP"
        )
        return
    command = f"sbafab generate {shlex.quote(str(target))}"
    print_verdict(f"{target} meets {_counted_requirements(result)}. Next: {command}", target)


def _binding_limits(result: FoundDesign) -> Iterator[str]:
    """Yield what single steps would break, ranges, and rules without room of a design that
    holds.
    """
    for bind in result.binds:
        yield f"{bind.key} = {format_value(bind.value)}: {bind.breaks}"
    for end in result.ends:
        low, high = end.wider
        yield (
            f"{end.key} = {end.value:g} is at the end of its range, {end.low:g} to {end.high:g}; "
            f"widen it with --free {end.key}={low:g}:{high:g}:{end.step:g}"
        )
    for spare in result.without_room if result.holds else ():
        yield f"{spare.rule} {spare.place}: {spare.measured:g} {spare.unit}, at its limit"


def _counted_requirements(result: FoundDesign) -> str:
    rows = result.request.requirements
    is_sure = result.request.sure is not None
    is_median = not is_sure and any(row.quantity.label in result.intervals for row in rows)
    every = "the requirement" if len(rows) == 1 else f"all {len(rows)} requirements"
    return f"{every if rows else 'all rules'}{' in the median' if is_median else ''}"


def _print_quantities(result: FoundDesign) -> None:
    """Print the required quantities and the goal of the best design."""
    request, best = result.request, result.best
    is_sure = request.sure is not None
    shown = set()
    for row in request.requirements:
        value = figure_text(request, best, row) + ("" if is_sure else _interval_text(result, row))
        missed = "" if best.meets(row) else ": MISSED"
        print_line(f"  {row.quantity.label} {value}; {row.bound}{missed}")
        shown.add(row.quantity.label)
        _print_trust(result, row.quantity.label)
    goal = request.goal
    label = goal.label if result.holds else goal.quantity.label
    value = shown_value(goal.quantity, best.value(goal)) + _interval_text(result, goal)
    print_line(f"  {label}: {value}")
    if goal.quantity.label not in shown:
        _print_trust(result, goal.quantity.label)
    if goal.quantity.label in result.intervals or (result.intervals and not is_sure):
        hint = "" if is_sure else "; --sure 0.9 requires each requirement with that probability"
        note = f"in parentheses the 90 % interval of what would be measured{hint}"
        print_wrapped(note, indent="  ")


def _interval_text(result: FoundDesign, subject: Requirement | Goal) -> str:
    """Return the 90 % interval in parentheses; empty without one."""
    ends = result.interval_text(subject)
    return f" ({ends})" if ends else ""


def _print_trust(result: FoundDesign, label: str) -> None:
    """Print the flags of a quantity, and the paper's measured value."""
    for flag in result.flags.get(label, ()):
        print_wrapped(f"({FLAGS[flag]})", indent="    ")
    if label in result.measured:
        print_wrapped(f"({result.measured[label].sentence()})", indent="    ")


USEFUL_KPA = 50.0
"""Pressure that is proposed for a force, unless it was missed at half of it or more."""


def _more_pressure(result: FoundDesign) -> str:
    """Return the advice for a missed force: the same one at more pressure; empty for others."""
    for row in result.request.requirements:
        quantity, laminate = row.quantity, result.best.laminate
        if quantity.name != "force" or not row.at_least or laminate is None:
            continue
        kpa = max(USEFUL_KPA, 2 * (quantity.kpa or 0.0))
        is_allowed = kpa <= MOST_PRESSURE and not is_near_burst(laminate, kpa)
        if is_allowed and not result.best.meets(row):
            return f", ask for the force at more pressure, {replace(quantity, kpa=kpa).label}"
    return ""


def _print_front(result: FoundDesign) -> None:
    part = f"{len(result.front)} of " if result.on_front > len(result.front) else ""
    print_line(f"Pareto front, {part}{result.on_front} of the {result.tries} designs tried", "bold")
    for trial in result.front:
        figures = ", ".join(f"{name} {value:.4g}" for name, value in trial.figures.items())
        print_line(f"  {format_keys(trial.values)}: {figures}")
    for name, measured in result.measured.items():
        print_wrapped(f"({name}: {measured.sentence()})", indent="    ")
