"""``sbafab sweep``: a design with varied keys, every variant checked and predicted."""

from __future__ import annotations

from typing import Any

import click

from sbafab.actuators import load_design
from sbafab.cli.exit import print_error
from sbafab.cli.options import FiniteRange, Request, pressures_option, run_options
from sbafab.cli.printing import print_json, print_verdict, several
from sbafab.cli.progress import shown_progress
from sbafab.search.sweep import SweepDocument, SweepRequest, SweepStopped
from sbafab.search.sweep import sweep as run_sweep
from sbafab.search.vary import varied_keys


@click.command()
@run_options()
@click.option(
    "--vary",
    "varied",
    metavar="KEY=VALUES",
    multiple=True,
    required=True,
    help="Vary a key: KEY=START:STOP:STEP or KEY=a,b,c. Repeatable; all combinations of the values "
    "are swept.",
)
@click.option(
    "--samples",
    type=click.IntRange(1),
    metavar="N",
    help="Sample N designs by Latin hypercube instead of the full grid; ranges need no step.",
)
@click.option("--seed", type=int, default=0, metavar="S", help="Seed of the sampling.")
@pressures_option("Force and stroke at this pressure", "10, 100")
@click.option(
    "--workers",
    type=click.IntRange(1, 256),
    metavar="K",
    help="Parallel processes.  [default: one for each processor]",
)
@click.option(
    "--dask",
    metavar="ADDRESS",
    help='Run on the Dask cluster with this scheduler (pip install "sbafab[dask]").',
)
@click.option(
    "--timeout",
    "seconds",
    type=FiniteRange(0, min_open=True),
    default=300.0,
    metavar="S",
    help="Time limit for one design, seconds.",
)
@click.option(
    "--all-columns",
    is_flag=True,
    help="Write every key, rule and figure, not only those varied, requested and binding.",
)
def sweep(
    request: Request, varied: tuple[str, ...], pressures: tuple[float, ...], **settings: Any
) -> None:
    """Check and predict variants of a design.

    OUT/<name>-sweep/ receives sweep.csv (and sweep.parquet if pyarrow is installed) with a row for
    each design, times.csv, and the page sweep.html. Run the same command again to resume a sweep
    that was stopped.
    """
    design = load_design(request.design, request.assignments, request.waivers)
    wanted = SweepRequest(design, varied_keys(varied), pressures_kpa=pressures, **settings)
    try:
        with shown_progress(request.as_json) as progress:
            designs = run_sweep(wanted, request.out, progress)
    except SweepStopped as stop:
        print_error(
            f"{stop.measured} of {stop.designs} designs are computed; run the same command again "
            "to resume"
        )
        raise
    if request.as_json:
        print_json(SweepDocument.of(designs))
        return
    if designs.no_longer_asked:
        click.echo(
            f"The tables leave out {designs.no_longer_asked} designs of an earlier sweep; its "
            "command restores them from the journal"
        )
    if not wanted.all_columns:
        click.echo(
            "columns: varied, requested and binding; --all-columns writes all without computing "
            "again"
        )
    if "sweep.parquet" not in designs.files:
        click.echo('for Parquet as well: pip install "sbafab[parquet]"')
    words = {"passes": "passed", "fails": "failed"}
    outcomes = ", ".join(
        f"{count} {words.get(outcome, outcome)}" for outcome, count in designs.outcomes.items()
    )
    resumed = designs.designs - designs.measured
    earlier = f"; {resumed} from an earlier run" if resumed else ""
    print_verdict(
        f"{design.name} swept: {several(designs.designs, 'design')}, {outcomes}{earlier}. Written "
        f"to {designs.folder}: {', '.join(designs.files)}",
        designs.folder,
    )
