"""``sbafab find``, ``sweep`` and ``compare``: searches among designs, and two side by side."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from sbafab.api import search as api
from sbafab.api.designs import Design, design_of
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.cli.exit import RULE_FAILED, end

FOUND = "found.toml"
"""The default file name in the folder of ``-o``."""
HELP = """Find the best design that meets requirements.

If no design meets all requirements, the nearest miss is shown, no file is written, and the exit
code is 1. A quantity may name its pressure P and height H with units, such as force@12.5mm@50kPa
or, flat, force@0mm@50kPa. Without a pressure it is at the highest that another one names, or at
10 kPa. H in % is of the reference stroke, force@50%, which round pockets have of the paper's film
alone:

\b
{quantities}
"""


LEAST = opt.option(
    "--min least QUANTITY=VALUE...",
    'At least this much, e.g. lumen=3, stroke=25 or "force@12.5mm@50kPa=3".',
)
MOST = opt.option(
    "--max most QUANTITY=VALUE...",
    "At most this much, e.g. overall_diameter=20, mass=0.5 or time=0.5.",
)


@click.command(help=HELP.format(quantities=api.quantity_lines()))
@opt.design_argument()
@LEAST
@MOST
@opt.option(
    "--sure P",
    "Probability with which each requirement on a predicted quantity must hold, e.g. 0.9.",
    opt.PARTIAL_SHARE,
)
@opt.flow_option("Flow of water in all, for the time")
@opt.option(
    "--best QUANTITY",
    "Goal among the designs that meet all: largest stroke, bend, force, yield or lumen, or "
    "smallest of another quantity.",
    default="mass",
)
@opt.option(
    "--free KEY=LOW:HIGH:STEP...",
    "Vary this key too, beside keys of the family, or set its range; of a key that is a word "
    "KEY=WORD,WORD.",
)
@opt.option("--fix fixed KEY...", "Do not vary this key; keys of --set are not varied either.")
@opt.option(
    "--tries N",
    "Largest number of designs to try.",
    click.IntRange(4, 100_000),
    default=api.FindRequest.tries,
)
@opt.folder_option(f"Folder in which {FOUND} is written.")
@opt.file_option(FOUND)
@opt.set_option
@opt.json_option
def find(source: str, to: Path | None, out: Path, as_json: bool, **options: Any) -> None:
    target = opt.design_file(to, out, FOUND)
    request = _request(source, options)
    api.refuse_existing(target)
    if _counts_tabs(request):
        show.note(
            "overall_diameter counts the inlet tabs; use outline_diameter if they may stand out, "
            "or add --free inlet.tab_length=3:5:0.5"
        )
    with show.progress(as_json) as progress:
        result = api.run_find(request, progress)
    if result.holds:
        name = api.name_of(target.stem) or source
        api.write_found(
            api.found_toml(source, options["assignments"], name, result, target), target
        )
    if as_json:
        show.document(api.find_document(result, source, target))
    else:
        _print_found(result, source, target)
    if not result.holds:
        show.end_failed()


def _request(source: str, options: dict[str, Any]) -> api.FindRequest:
    """Return the search request of a design. Raises DesignError without a requested quantity."""
    limits = (options[name] for name in ("least", "most", "best", "flow_ml_min"))
    requirements, goal = api.read_all(*limits)
    assigned = options["assignments"]
    design = api.load_design(source, assigned)
    free = api.read_free(
        design, options["free"], options["fixed"], tuple(api.changed_keys(assigned))
    )
    return api.FindRequest(
        design, requirements, goal, free, tries=options["tries"], sure=options["sure"]
    )


def _counts_tabs(request: api.FindRequest) -> bool:
    """Return True if a search limits the diameter with tabs, and may not shorten these."""
    names = [requirement.quantity.name for requirement in request.requirements]
    free = [free.key for free in api.free_keys(request)]
    return "overall_diameter" in names and "inlet.tab_length" not in free


# Printing of a result.


def _print_found(result: api.FoundDesign, origin: str, target: Path) -> None:
    """Print the design with its figures, binding constraints and the front; or the nearest miss."""
    title, style = ("Best design", "bold") if result.holds else ("Nearest miss", "bold red")
    show.line(f"{title}: {api.format_keys(result.best.values)}, from {origin}", style)
    _print_quantities(result)
    for rule in result.best.broken_rules:
        show.line(f"  {rule}")
    for number, limit in enumerate(_binding_limits(result)):
        if number == 0:
            show.line("Binding limits", "bold")
        show.line(f"  {limit}")
    if result.holds and len(result.front) > 1:
        _print_front(result)
    if result.is_cut_short:
        more = f"--tries {2 * result.tries} may find a better design"
        show.line(f"All {result.tries} tries were used; {more}")
    if not result.holds:
        show.failure(
            f"Search failed: none of {result.tries} designs meets all requirements; nothing was "
            f"written. Relax a requirement{_more_pressure(result)}, or vary more keys with --free "
            "KEY=LOW:HIGH:STEP"
        )
        return
    rows = result.request.requirements
    is_median = any(row.quantity.label in result.intervals for row in rows)
    every = "the requirement" if len(rows) == 1 else f"all {len(rows)} requirements"
    median = " in the median" if is_median and result.request.sure is None else ""
    command = f"sbafab generate {shlex.quote(str(target))}"
    show.verdict(
        f"{target} meets {every if rows else 'all rules'}{median}. Next: {command}", target
    )


def _binding_limits(result: api.FoundDesign) -> Iterator[str]:
    """Yield the constraints that single steps would break, ranges, and rules without margin, for a
    passing design.
    """
    for bind in result.binds:
        yield f"{bind.key} = {api.format_value(bind.value)}: {bind.breaks}"
    for stop in result.ends:
        low, high = stop.wider
        yield (
            f"{stop.key} = {stop.value:g} is at the end of its range, {stop.low:g} to "
            f"{stop.high:g}; widen it with --free {stop.key}={low:g}:{high:g}:{stop.step:g}"
        )
    for spare in result.without_room if result.holds else ():
        yield f"{spare.rule} {spare.place}: {spare.measured:g} {spare.unit}, at its limit"


def _print_quantities(result: api.FoundDesign) -> None:
    """Print the required quantities and the goal of the best design, each with its notes."""
    for text, notes in result.lines:
        show.line(f"  {text}")
        for note in notes:
            show.wrapped(f"({note})", indent="    ")
    if result.has_medians:
        is_sure = result.request.sure is not None
        hint = "" if is_sure else "; --sure 0.9 requires each requirement with that probability"
        show.wrapped(f"{api.MEDIANS}{hint}", indent="  ")


USEFUL_KPA = 50.0
"""Pressure that is proposed for a force, unless it was missed at half of it or more."""


def _more_pressure(result: api.FoundDesign) -> str:
    """The advice for a missed force: the same force at a higher pressure; empty for others."""
    for row in result.request.requirements:
        quantity, laminate = row.quantity, result.best.laminate
        if quantity.name != "force" or not row.at_least or laminate is None:
            continue
        kpa = max(USEFUL_KPA, 2 * (quantity.kpa or 0.0))
        is_allowed = kpa <= api.MOST_PRESSURE and not api.is_near_burst(laminate, kpa)
        if is_allowed and not result.best.meets(row):
            more = replace(quantity, at=quantity.at._replace(kpa=kpa))
            return f", ask for the force at more pressure, {more.label}"
    return ""


def _print_front(result: api.FoundDesign) -> None:
    part = f"{len(result.front)} of " if result.on_front > len(result.front) else ""
    show.line(f"Pareto front, {part}{result.on_front} of the {result.tries} designs tried", "bold")
    for trial in result.front:
        figures = ", ".join(f"{name} {value:.4g}" for name, value in trial.figures.items())
        show.line(f"  {api.format_keys(trial.values)}: {figures}")
    for name, measured in result.measured.items():
        show.wrapped(f"({name}: {measured.sentence})", indent="    ")


# Sweeps.


@click.command()
@opt.run_options(design_of)
@opt.option(
    "--vary KEY=VALUES...",
    "Vary a key: KEY=START:STOP:STEP or KEY=a,b,c. Repeatable; all combinations of the values are "
    "swept.",
    required=True,
)
@LEAST
@MOST
@opt.option(
    "--samples N",
    "Sample N designs by Latin hypercube instead of the full grid; ranges need no step.",
    click.IntRange(1),
)
@opt.option("--seed S", "Seed of the sampling.", int, default=api.SweepRequest.seed)
@opt.pressures_option("Force and stroke at this pressure", "10, 100")
@opt.option(
    "--workers K", "Parallel processes.  [default: one for each processor]", click.IntRange(1, 256)
)
@opt.option(
    "--dask ADDRESS", 'Run on the Dask cluster with this scheduler (pip install "sbafab[dask]").'
)
@opt.option(
    "--timeout seconds S",
    "Time limit for one design, seconds.",
    opt.FiniteRange(0, min_open=True),
    default=api.SweepRequest.seconds,
)
def sweep(
    design: Design,
    out: Path,
    as_json: bool,
    **settings: Any,
) -> None:
    """Check and predict variants of a design.

    OUT/<name>-sweep/ receives sweep.csv with a row for
    each design, and the page sweep.html. Run the same command again to resume a sweep
    that was stopped. A design that misses a --min or --max fails; `sbafab find --help` lists the
    quantities.
    """
    with show.progress(as_json) as progress:
        swept = api.sweep(design, out=out, progress=progress, **settings)
    if as_json:
        show.document(api.SweepDocument.of(swept))
        return
    if swept.no_longer_asked:
        show.line(
            f"The tables leave out {show.several(swept.no_longer_asked, 'design')} of an earlier "
            "sweep; its command restores them from the journal"
        )
    failed = ", ".join(f"{cause} {number}" for cause, number in swept.failed.items())
    words = {"passes": "passed", "fails": f"failed ({failed})"}
    counts = [f"{count} {words.get(each, each)}" for each, count in swept.outcomes.items()]
    resumed = swept.designs - swept.measured
    counts[-1] += f"; {resumed} from an earlier run" if resumed else ""
    count = show.several(swept.designs, "design")
    show.verdict(
        f"{design.name} swept: {count}, {', '.join(counts)}. Written to {swept.folder}: "
        f"{', '.join(swept.files)}",
        swept.folder,
    )


# Comparisons.


@click.command()
@opt.design_argument("first", metavar="A")
@opt.design_argument("second", metavar="B")
@opt.pressures_option("Pressure of the figures, and the first of them of the pictures", "10")
@opt.flow_option("Flow for the times")
@opt.out_option
@opt.set_option
@opt.json_option
def compare(
    first: str,
    second: str,
    pressures_kpa: tuple[float, ...],
    flow_ml_min: float,
    out: Path,
    assignments: tuple[str, ...],
    as_json: bool,
) -> None:
    """Compare two designs: their differences and figures.

    A and B are templates, design files or output folders. OUT/compare/compare.html has pictures of
    both side by side.
    """
    a, b = (api.comparing.load_compared(source, assignments) for source in (first, second))
    with show.progress(as_json) as progress:
        comparison = api.comparing.compare(
            a, b, (first, second), pressures_kpa or None, flow_ml_min, progress
        )
        folder = api.comparing.write_page(comparison, out)
    if as_json:
        show.document({**comparison.as_dict(), "folder": str(folder)})
        return
    names = ("", *comparison.names)
    show.table("Keys", names, api.comparing.key_rows(comparison.keys))
    show.table("Rules", names, api.comparing.rule_rows(comparison.rules))
    _print_figures(comparison, names)
    counts = len(comparison.keys), len(comparison.rules), sum(p.differs for p in comparison.figures)
    keys, rules, figures = map(show.several, counts, ("key", "rule", "figure"))
    show.verdict(
        f"{first} and {second} differ in {keys}, {rules} and {figures}. Written to {folder}: "
        f"{api.comparing.PAGE}",
        folder,
    )


def changed_for_yield(
    design: Design, target: float, as_json: bool
) -> tuple[Design, dict[str, Any], Callable[[], None]]:
    """Return a design changed for a yield, its entry as JSON, and a function that prints the
    changes.

    Exits with 1 if no change reaches it.
    """
    with show.progress(as_json) as progress:
        fixed = frozenset(api.changed_keys(click.get_current_context().params["assignments"]))
        reached = api.run_reach_yield(design, target, fixed, progress)
    if reached.design is None:
        end("yield", reached.sentence, RULE_FAILED, as_json)

    def print_changes() -> None:
        if reached.comparison is not None:
            names = ("", *api.comparing.DESIGNS)
            show.table("Changed for the yield", names, api.comparing.key_rows(reached.changes))
            _print_figures(reached.comparison, names)
        show.wrapped(reached.sentence)
        show.line("")

    return reached.design, {"yield": api.YieldEntry.of(reached)}, print_changes


def _print_figures(comparison: api.comparing.DesignComparison, names: Sequence[str]) -> None:
    """Print the main figures of both designs, below the column names."""
    main = api.comparing.figure_rows(pair for pair in comparison.figures if pair.main)
    show.table("Figures, in parentheses the 90 % interval", names, main)
