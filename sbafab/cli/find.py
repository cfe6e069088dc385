"""``sbafab find``: requirements in, a design file out that generates and passes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sbafab.cli.options import json_option, set_option
from sbafab.cli.working import RULE_FAILED

if TYPE_CHECKING:
    from sbafab.progress import Progress
    from sbafab.search.find import FoundDesign
    from sbafab.search.trial import Trial


@click.command()
@click.argument("source", metavar="[DESIGN]", required=False)
@click.option(
    "--min",
    "least",
    metavar="QUANTITY=VALUE",
    multiple=True,
    help='At least this much, e.g. lumen=3, stroke@50kPa=25 or "force@12.5mm@50kPa=3". Repeatable.',
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
    help="Of what meets all: the most stroke, force, yield or lumen, or the least of another.",
)
@click.option(
    "--free",
    metavar="KEY=LOW:HIGH:STEP",
    multiple=True,
    help="Let this key change, beside those of its family. Repeatable.",
)
@click.option(
    "--fix", "fixed", metavar="KEY", multiple=True, help="Leave this key as it is. Repeatable."
)
@click.option(
    "--tries", type=click.IntRange(4, 100_000), default=120, show_default=True, metavar="N",
    help="Designs that are tried, about.",
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
    "target",
    type=click.Path(path_type=Path),
    default=Path("found.toml"),
    show_default=True,
    metavar="FILE",
    help="The design file to write; its stem names the design.",
)
@set_option
@json_option
def find(source: str | None, **asked: Any) -> None:
    """Find the best design that meets requirements.

    Without DESIGN it starts from every family. Exit code 1 where nothing meets all: then the
    nearest miss is shown and no file written.
    """
    from sbafab.cli.printing import print_json, shown_progress
    from sbafab.search.design_file import found_toml, refuse_present, write_found

    if asked["storage"] is not None and not asked["optuna"]:
        raise click.UsageError("--storage goes with --optuna; add it")
    target: Path = asked["target"]
    refuse_present(target)
    with shown_progress(asked["as_json"]) as tell:
        started, found = _found(source, asked, tell)
    if found.holds:
        write_found(found_toml(started, asked["assignments"], target.stem, found), target)
    if asked["as_json"]:
        print_json(_as_json(found, started, target))
    else:
        _print(found, started, target)
    if not found.holds:
        click.get_current_context().exit(RULE_FAILED)


def _found(source: str | None, asked: dict[str, Any], tell: Progress) -> tuple[str, FoundDesign]:
    """The best of what is found from the design, or from one template of each family."""
    from sbafab.errors import DesignError

    results: list[tuple[str, FoundDesign]] = []
    problems = []
    for name in [source] if source else _one_of_each_family():
        try:
            results.append((name, _from(name, asked, tell)))
        except DesignError as error:
            if source:
                raise
            problems.append(f"{name}: {error}")
    if not results:
        raise DesignError("; ".join(problems))
    return min(results, key=lambda result: result[1].best.rank)


def _one_of_each_family() -> list[str]:
    from sbafab.actuators import load_design
    from sbafab.design.templates import template_names
    from sbafab.errors import DesignError

    found: dict[type, str] = {}
    for name in template_names():
        try:
            found.setdefault(type(load_design(name)), name)
        except DesignError:
            continue
    return list(found.values())


def _from(name: str, asked: dict[str, Any], tell: Progress) -> FoundDesign:
    from sbafab.actuators import load_design
    from sbafab.search.find import FindRequest
    from sbafab.search.find import find as search
    from sbafab.search.free import read_free
    from sbafab.search.requirements import read_all

    design = load_design(name, asked["assignments"])
    requirements, goal = read_all(asked["least"], asked["most"], asked["best"])
    free = None
    if asked["free"] or asked["fixed"]:
        free = read_free(design, asked["free"], asked["fixed"])
    request = FindRequest(
        design, requirements, goal, free, asked["tries"], asked["optuna"], asked["storage"]
    )
    return search(request, tell)


def _as_json(found: FoundDesign, started: str, target: Path) -> dict[str, Any]:
    from sbafab.output.schemas import FIND_SCHEMA

    def shown(trial: Trial) -> dict[str, Any]:
        return {"keys": dict(trial.values), "figures": dict(trial.figures)}

    return {
        "schema": FIND_SCHEMA,
        "holds": found.holds,
        "file": str(target) if found.holds else None,
        "started_from": started,
        "tries": found.tries,
        "best": shown(found.best),
        "missed": found.missed,
        "binds": [{"key": b.key, "value": b.value, "breaks": b.breaks} for b in found.binds],
        "without_room": [
            {"rule": s.rule, "measured": s.measured, "unit": s.unit, "place": s.place}
            for s in found.without_room
        ],
        "front": [shown(trial) for trial in found.front],
    }


def _print(found: FoundDesign, started: str, target: Path) -> None:
    from rich.text import Text

    from sbafab.cli.lines import console

    out = console()
    keys = _keys(found.best)
    head = f"{target}: {keys}, from {started}" if found.holds else f"Nearest miss: {keys}"
    out.print(Text(head, style="bold" if found.holds else "bold red"), soft_wrap=True)
    for one in found.wanted.requirements:
        value = found.best.value(one)
        mark = "" if one.holds(value) else "  MISSED"
        out.print(Text(f"  {one.quantity.said} {value:.4g} {one.quantity.unit}; {one.bound}{mark}"))
    goal = found.wanted.goal
    out.print(Text(f"  {goal.said}: {found.best.value(goal):.4g} {goal.quantity.unit}".rstrip()))
    if not found.holds:
        for said in found.missed:
            out.print(Text(f"  {said}"), soft_wrap=True)
        words = f"None of {found.tries} designs meets all, and nothing was written: ask for less, "
        out.print(Text(words + "or free more with --free KEY=LOW:HIGH:STEP"), soft_wrap=True)
        return
    if found.binds or found.without_room:
        out.print(Text("What binds", style="bold"))
    for bind in found.binds:
        out.print(Text(f"  {bind.key} = {bind.value:g}: {bind.breaks}"), soft_wrap=True)
    for spare in found.without_room:
        words = f"  {spare.rule} {spare.place}: {spare.measured:g} {spare.unit}, nothing to spare"
        out.print(Text(words), soft_wrap=True)
    if len(found.front) > 1:
        out.print(Text("Pareto front", style="bold"))
        for trial in found.front:
            figures = ", ".join(f"{name} {value:.4g}" for name, value in trial.figures.items())
            out.print(Text(f"  {_keys(trial)}: {figures}"), soft_wrap=True)
    out.print(Text(f"Next: sbafab generate {target}"), soft_wrap=True)


def _keys(trial: Trial) -> str:
    return ", ".join(f"{key} = {value:g}" for key, value in trial.values.items())
