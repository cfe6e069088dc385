"""``sbafab find``: requirements in, a design file out that generates and passes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sbafab.cli.options import json_option, set_option
from sbafab.cli.working import RULE_FAILED
from sbafab.search.quantity_names import quantity_lines

if TYPE_CHECKING:
    from collections.abc import Callable

    from sbafab.progress import Progress
    from sbafab.search.find import FindRequest, FoundDesign
    from sbafab.search.requirements import Goal, Requirement


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
def find(source: str | None, **asked: Any) -> None:
    from sbafab.cli.ending import say
    from sbafab.cli.printing import print_json, shown_progress
    from sbafab.cli.printing_find import as_json, print_found
    from sbafab.design.templates import name_of
    from sbafab.search.design_file import found_file, found_toml, write_found

    if asked["storage"] is not None and not asked["optuna"]:
        raise click.UsageError("--storage goes with --optuna; add it")
    requests = _requests(source, asked)
    target = found_file(asked["out"])
    try:
        with shown_progress(asked["as_json"]) as tell:
            started, found = _found(requests, tell)
    except KeyboardInterrupt:
        kept = "; the same command goes on in its storage" if asked["storage"] else ""
        say(f"the search was stopped, and no file was written{kept}")
        raise
    if found.holds:
        write_found(
            found_toml(started, asked["assignments"], name_of(target) or started, found), target
        )
    if asked["as_json"]:
        print_json(as_json(found, started, target))
    else:
        print_found(found, started, target)
    if not found.holds:
        click.get_current_context().exit(RULE_FAILED)


def _requests(source: str | None, asked: dict[str, Any]) -> dict[str, FindRequest]:
    """What is looked for, by the design to start from: the one that is named, or one a family.

    A family that cannot be asked for it is left out. Raises DesignError where none can.
    """
    from sbafab.errors import DesignError
    from sbafab.search.requirements import read_all

    requirements, goal = read_all(asked["least"], asked["most"], asked["best"])
    found: dict[str, FindRequest] = {}
    problems: list[str] = []
    for name in [source] if source else _one_of_each_family():
        try:
            found[name] = _request(name, requirements, goal, asked)
        except DesignError as error:
            problems.append(str(error))
    if not found:
        raise DesignError("; ".join(dict.fromkeys(problems)))
    return found


def _request(
    name: str, requirements: tuple[Requirement, ...], goal: Goal, asked: dict[str, Any]
) -> FindRequest:
    from sbafab.actuators import load_design
    from sbafab.design.reading import changed_keys
    from sbafab.search.find import FindRequest, free_keys
    from sbafab.search.free import read_free

    assignments = asked["assignments"]
    design = load_design(name, assignments)
    free = read_free(design, asked["free"], asked["fixed"], tuple(changed_keys(assignments)))
    request = FindRequest(
        design, requirements, goal, free, asked["tries"], asked["optuna"], asked["storage"]
    )
    free_keys(request)
    return request


def _found(requests: dict[str, FindRequest], tell: Progress) -> tuple[str, FoundDesign]:
    """The best of what is found, and the name of the design that it started from."""
    from sbafab.errors import DesignError
    from sbafab.search.find import find as search

    results: list[tuple[str, FoundDesign]] = []
    problems = []
    for number, (name, request) in enumerate(requests.items()):

        def told(what: str, done: int, total: int, before: int = number) -> None:
            tell(what, before * total + done, len(requests) * total)

        try:
            results.append((name, search(request, told)))
        except DesignError as error:
            problems.append(str(error))
    if not results:
        raise DesignError("; ".join(dict.fromkeys(problems)))
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
