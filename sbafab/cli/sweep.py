"""``sbafab sweep``: one design with keys varied, every one checked and predicted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from sbafab.cli.options import PRESSURE, Request, finite, run_options

if TYPE_CHECKING:
    from sbafab.search.sweep import SweepRequest, SweptDesigns


@click.command()
@run_options
@click.option(
    "--vary",
    "varied",
    metavar="KEY=VALUES",
    multiple=True,
    required=True,
    help="Vary a key: KEY=START:STOP:STEP or KEY=a,b,c. Repeatable; every value of one is combined "
    "with every value of the others.",
)
@click.option(
    "--samples",
    type=click.IntRange(1),
    metavar="N",
    help="Draw N designs by Latin hypercube in place of the whole grid; ranges then need no step.",
)
@click.option(
    "--seed", type=int, default=0, show_default=True, metavar="S", help="Of what is drawn."
)
@click.option(
    "--pressure",
    "pressures",
    type=PRESSURE.read,
    multiple=True,
    metavar="P",
    help="Force and stroke at this pressure, kPa or with a unit. Repeatable.  [default: 10, 100]",
)
@click.option(
    "--workers",
    type=click.IntRange(1, 256),
    metavar="K",
    help="Processes that measure side by side.  [default: one a processor]",
)
@click.option(
    "--dask",
    metavar="ADDRESS",
    help='Measure on the Dask cluster with this scheduler (pip install "sbafab[dask]").',
)
@click.option(
    "--timeout",
    "seconds",
    type=click.FloatRange(0, min_open=True),
    callback=finite,
    default=300.0,
    show_default=True,
    metavar="S",
    help="Seconds that one design may take.",
)
@click.option(
    "--all-columns",
    is_flag=True,
    help="Tables with every key, rule and figure, not only those varied, asked for and binding.",
)
def sweep(
    request: Request, varied: tuple[str, ...], pressures: tuple[float, ...], **asked: Any
) -> None:
    """Check and predict many designs: one with keys varied.

    OUT/<name>-sweep/ gets sweep.csv (and sweep.parquet where pyarrow is installed) with a row a
    design, times.csv, and the page sweep.html. A run that was stopped goes on where it was.
    """
    from sbafab.actuators import load_design
    from sbafab.cli.exit import say
    from sbafab.cli.printing import print_json, shown_progress
    from sbafab.models.figures import Asked
    from sbafab.models.formulas import force
    from sbafab.search import sweep as search
    from sbafab.search.vary import read_varied

    design = load_design(request.designs[0], request.assignments, request.waivers)
    kpa = pressures or Asked.pressures_kpa
    force(kpa, 0.0)  # raises for pressures out of range
    ranges = tuple(read_varied(text) for text in varied)
    wanted = search.SweepRequest(design, ranges, pressures_kpa=kpa, **asked)
    try:
        with shown_progress(request.as_json) as progress:
            found = search.sweep(wanted, request.out, progress)
    except search.SweepStopped as stop:
        say(
            f"{stop.measured} of {stop.designs} designs are measured; the same command goes on "
            "from there"
        )
        raise
    if request.as_json:
        print_json(_as_json(found))
    else:
        _print(wanted, found)


def _as_json(found: SweptDesigns) -> dict[str, object]:
    from sbafab.output.schema_ids import SWEEP_SCHEMA

    return {
        "schema": SWEEP_SCHEMA,
        "folder": str(found.folder),
        "designs": found.designs,
        "measured_now": found.measured,
        "no_longer_asked": found.no_longer_asked,
        "outcomes": found.outcomes,
        "files": list(found.files),
    }


def _print(wanted: SweepRequest, found: SweptDesigns) -> None:
    said = ", ".join(f"{count} {outcome}" for outcome, count in found.outcomes.items())
    before = found.designs - found.measured
    earlier = f"; {before} were measured by an earlier run" if before else ""
    many = "s" if found.designs > 1 else ""
    click.echo(f"{found.designs} design{many} of {wanted.design.name}: {said}{earlier}")
    click.echo(f"written to {found.folder}: {', '.join(found.files)}")
    if found.no_longer_asked:
        click.echo(
            f"{found.no_longer_asked} of the designs that an earlier sweep had in these tables are "
            "not asked for now; its command brings them back from the journal"
        )
    if not wanted.all_columns:
        click.echo(
            "columns: what was varied, asked for and binding; --all-columns has all, and measures "
            "nothing anew"
        )
    if "sweep.parquet" not in found.files:
        click.echo('for Parquet as well: pip install "sbafab[parquet]"')
