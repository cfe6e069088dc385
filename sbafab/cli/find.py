"""``sbafab find``: requirements in, a design file out that generates and passes."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sbafab.cli.exit import RULE_FAILED
from sbafab.cli.options import json_option, set_option
from sbafab.cli.printing import print_line, print_wrapped
from sbafab.output.schemas import FIND_SCHEMA
from sbafab.search.find import FoundDesign
from sbafab.search.quantities import AskedQuantity, shown_value
from sbafab.search.quantity_names import quantity_lines
from sbafab.search.trial import Trial, keys_said, value_said

if TYPE_CHECKING:
    from collections.abc import Callable

    from sbafab.process import Progress
    from sbafab.search.find import FindRequest
    from sbafab.search.trial import Goal, Requirement

HELP = """Find the best design that meets requirements.

Without DESIGN it starts from every family. Exit code 1 where nothing meets all: then the nearest
miss is shown and no file written. A quantity may name its pressure P and height H with units, such
as force@12.5mm@50kPa:

\b
{quantities}
"""


def _with_quantities(command: Callable[..., None]) -> Callable[..., None]:
    """Gives a command its help, which lists every quantity with its unit."""
    command.__doc__ = HELP.format(quantities=quantity_lines())
    return command


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
    help="At most this much, e.g. overall_diameter=20, mass=0.5 or height=2. Repeatable.",
)
@click.option(
    "--best",
    default="mass",
    show_default=True,
    metavar="QUANTITY",
    help="Of what meets all: the most stroke, bend, force, yield or lumen, or the least of "
    "another.",
)
@click.option(
    "--free",
    metavar="KEY=LOW:HIGH:STEP",
    multiple=True,
    help="Let this key change, beside those of its family, or in this range. Repeatable.",
)
@click.option(
    "--fix",
    "fixed",
    metavar="KEY",
    multiple=True,
    help="Leave this key as it is, like one named by --set. Repeatable.",
)
@click.option(
    "--tries", type=click.IntRange(4, 100_000), default=240, show_default=True, metavar="N",
    help="Designs that are tried at most, of each family.",
)  # fmt: skip
@click.option("--optuna", is_flag=True, help='Search with Optuna (pip install "sbafab[optuna]").')
@click.option(
    "--storage",
    metavar="URL",
    help="Optuna's database, in which the search goes on, e.g. sqlite:///search.db.",
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, readable=False),
    default=Path(),
    show_default="this folder",
    metavar="OUT",
    help="Folder that receives found.toml, or a file that ends in .toml; its stem names the "
    "design.",
)
@set_option
@json_option
@_with_quantities
def find(source: str | None, **options: Any) -> None:
    from sbafab.cli.exit import print_error
    from sbafab.cli.printing import print_json
    from sbafab.cli.progress import shown_progress
    from sbafab.design.files import name_of
    from sbafab.search.find import found_file, found_toml, write_found

    if options["storage"] is not None and not options["optuna"]:
        raise click.UsageError("--storage goes with --optuna; add it")
    requests = _requests(source, options)
    target = found_file(options["out"])
    try:
        with shown_progress(options["as_json"]) as progress:
            origin, result = _best_result(requests, progress)
    except KeyboardInterrupt:
        resume = "; the same command goes on in its storage" if options["storage"] else ""
        print_error(f"the search was stopped, and no file was written{resume}")
        raise
    if result.holds:
        write_found(
            found_toml(origin, options["assignments"], name_of(target) or origin, result), target
        )
    if options["as_json"]:
        print_json(as_json(result, origin, target))
    else:
        print_result(result, origin, target)
    if not result.holds:
        click.get_current_context().exit(RULE_FAILED)


def _requests(source: str | None, options: dict[str, Any]) -> dict[str, FindRequest]:
    """What is looked for, by the design to start from: the one that is named, or one a family.

    A family that cannot be asked for it is left out. Raises DesignError where none can.
    """
    from sbafab.errors import DesignError
    from sbafab.search.trial import read_all

    requirements, goal = read_all(options["least"], options["most"], options["best"])
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
    from sbafab.actuators import load_design
    from sbafab.design.files import changed_keys
    from sbafab.search.find import FindRequest, free_keys
    from sbafab.search.vary import read_free

    assignments = options["assignments"]
    design = load_design(name, assignments)
    free = read_free(design, options["free"], options["fixed"], tuple(changed_keys(assignments)))
    request = FindRequest(
        design, requirements, goal, free, options["tries"], options["optuna"], options["storage"]
    )
    free_keys(request)
    return request


def _best_result(requests: dict[str, FindRequest], progress: Progress) -> tuple[str, FoundDesign]:
    """The best of what is found, and the name of the design that it started from."""
    from sbafab.errors import DesignError
    from sbafab.search.find import find as search

    results: list[tuple[str, FoundDesign]] = []
    problems = []
    for number, (name, request) in enumerate(requests.items()):

        def report(what: str, done: int, total: int, before: int = number) -> None:
            progress(what, before * total + done, len(requests) * total)

        try:
            results.append((name, search(request, report)))
        except DesignError as error:
            problems.append(str(error))
    if not results:
        raise DesignError("; ".join(dict.fromkeys(problems)))
    return min(results, key=lambda result: result[1].best.rank)


def _family_templates() -> list[str]:
    from sbafab.actuators import load_design
    from sbafab.design.files import template_names
    from sbafab.errors import DesignError

    templates: dict[type, str] = {}
    for name in template_names():
        try:
            templates.setdefault(type(load_design(name)), name)
        except DesignError:
            continue
    return list(templates.values())


# How the end of a search is told: for people, and for programs.


TABS_HINT = (
    "overall_diameter counts the inlet tabs: ask for outline_diameter where they may stand out, or "
    "add --free inlet.tab_length=3:5:0.5"
)


def as_json(result: FoundDesign, origin: str, target: Path) -> dict[str, Any]:
    """What ``find --json`` prints."""

    def shown(trial: Trial) -> dict[str, Any]:
        return {"keys": dict(trial.values), "figures": dict(trial.figures)}

    return {
        "schema": FIND_SCHEMA,
        "holds": result.holds,
        "file": str(target) if result.holds else None,
        "started_from": origin,
        "tries": result.tries,
        "is_cut_short": result.is_cut_short,
        "best": shown(result.best),
        "full_stroke": result.full_stroke,
        "measured": {name: one.as_dict() for name, one in result.measured.items()},
        "missed": result.missed,
        "binds": [{"key": b.key, "value": b.value, "breaks": b.breaks} for b in result.binds],
        "range_ends": [
            {"key": one.key, "value": one.value, "low": one.low, "high": one.high}
            for one in result.ends
        ],
        "without_room": [
            {"rule": s.rule, "measured": s.measured, "unit": s.unit, "place": s.place}
            for s in result.without_room
        ],
        "front": [shown(trial) for trial in result.front],
        "on_front": result.on_front,
    }


def print_result(result: FoundDesign, origin: str, target: Path) -> None:
    """The design with its figures, what binds and the front; or the nearest miss."""
    keys = keys_said(result.best.values)
    if result.holds:
        print_line(f"{target}: {keys}, from {origin}", "bold")
    else:
        print_line(f"Nearest miss: {keys}, from {origin}", "bold red")
    for one in result.wanted.requirements:
        value = result.best.value(one)
        said = f"  {one.quantity.said} {shown_value(one.quantity, value)}"
        print_line(
            f"{said}; {one.bound}" if one.holds(value) else f"{said}, not {one.bound}  MISSED"
        )
        _print_measured(result, one.quantity)
    goal = result.wanted.goal
    value = result.best.value(goal)
    said = goal.said if result.holds else goal.quantity.said
    print_line(f"  {said}: {shown_value(goal.quantity, value)}")
    if goal.quantity.said not in [one.quantity.said for one in result.wanted.requirements]:
        _print_measured(result, goal.quantity)
    asked = result.wanted.quantities
    is_told = any(one.is_full_stroke for one in asked)
    if (
        any(one.name == "stroke" for one in asked)
        and not is_told
        and result.full_stroke is not None
    ):
        print_line(f"  full stroke {result.full_stroke:.4g} mm, as the paper's in proportion")
    for said in result.broken_rules:
        print_line(f"  {said}")
    told = result.binds or result.ends or (result.holds and result.without_room)
    if told:
        print_line("What binds" if result.holds else "What stops it there", "bold")
    for bind in result.binds:
        print_line(f"  {bind.key} = {value_said(bind.value)}: {bind.breaks}")
    _print_ends(result)
    if not result.holds:
        _print_miss(result)
        return
    for spare in result.without_room:
        print_line(
            f"  {spare.rule} {spare.place}: {spare.measured:g} {spare.unit}, nothing to spare"
        )
    _print_front(result)
    _print_more_tries(result)
    print_line(f"Next: sbafab generate {shlex.quote(str(target))}")


def _print_measured(result: FoundDesign, quantity: AskedQuantity) -> None:
    measured = result.measured.get(quantity.said)
    if measured is not None:
        print_wrapped(f"({measured.sentence()})", indent="    ")


def _print_more_tries(result: FoundDesign) -> None:
    if result.is_cut_short:
        more = 2 * result.tries
        print_line(f"All {result.tries} tries are used up; --tries {more} may lead to a better one")


def _print_ends(result: FoundDesign) -> None:
    for end in result.ends:
        span = end.high - end.low
        low, high = end.low, end.high + span
        if end.value <= end.low:
            low, high = max(end.step, end.low - span), end.high
        print_line(
            f"  {end.key} = {end.value:g} is the end of its range, {end.low:g} to {end.high:g}; "
            f"--free {end.key}={low:g}:{high:g}:{end.step:g} lets it go further"
        )


def _print_miss(result: FoundDesign) -> None:
    missed = {
        one.quantity.name
        for one in result.wanted.requirements
        if not one.holds(result.best.value(one))
    }
    is_free = any(one.key == "inlet.tab_length" for one in result.free)
    if "overall_diameter" in missed and not is_free:
        print_line(TABS_HINT)
    _print_more_tries(result)
    words = f"None of {result.tries} designs meets all, and nothing was written: ask for less, "
    print_line(words + "or free more with --free KEY=LOW:HIGH:STEP")


def _print_front(result: FoundDesign) -> None:
    if len(result.front) < 2:
        return
    some = f"{len(result.front)} of " if result.on_front > len(result.front) else ""
    print_line(f"Pareto front, {some}{result.on_front} of the {result.tries} designs tried", "bold")
    for trial in result.front:
        figures = ", ".join(f"{name} {value:.4g}" for name, value in trial.figures.items())
        print_line(f"  {keys_said(trial.values)}: {figures}")
    for name, measured in result.measured.items():
        print_wrapped(f"({name}: {measured.sentence()})", indent="    ")
