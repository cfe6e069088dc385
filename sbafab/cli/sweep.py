"""``sbafab sweep``: a design with varied keys, every variant checked and predicted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from sbafab.actuators import load_design
from sbafab.cli.exit import print_error
from sbafab.cli.options import PRESSURE, Request, finite, run_options
from sbafab.cli.printing import print_json, print_verdict
from sbafab.cli.progress import shown_progress
from sbafab.documents import Document, attribute
from sbafab.search import sweep as search
from sbafab.search.sweep import SweepRequest, SweptDesigns
from sbafab.search.vary import read_varied


@click.command()
@run_options
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
@click.option(
    "--seed", type=int, default=0, show_default=True, metavar="S", help="Seed of the sampling."
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
    type=click.FloatRange(0, min_open=True),
    callback=finite,
    default=300.0,
    show_default=True,
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
    design = load_design(request.designs[0], request.assignments, request.waivers)
    ranges = tuple(read_varied(text) for text in varied)
    sweep_request = search.SweepRequest(design, ranges, pressures_kpa=pressures, **settings)
    try:
        with shown_progress(request.as_json) as progress:
            designs = search.sweep(sweep_request, request.out, progress)
    except search.SweepStopped as stop:
        print_error(
            f"{stop.measured} of {stop.designs} designs are computed; run the same command again "
            "to resume"
        )
        raise
    if request.as_json:
        print_json(SweepDocument.of(designs))
    else:
        _print(sweep_request, designs)


class SweepDocument(Document, schema="sbafab/sweep@1"):
    """What ``sweep --json`` prints."""

    folder: Path
    designs: int
    measured_now: int = attribute("measured")
    no_longer_asked: int
    outcomes: dict[str, int]
    """designs by what became of them"""
    files: list[str]
    """what lies in the folder"""


def _print(request: SweepRequest, designs: SweptDesigns) -> None:
    """Print hints on the tables and, last, the verdict."""
    if designs.no_longer_asked:
        click.echo(
            f"The tables leave out {designs.no_longer_asked} designs of an earlier sweep; its "
            "command restores them from the journal"
        )
    if not request.all_columns:
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
    count = "1 design" if designs.designs == 1 else f"{designs.designs} designs"
    print_verdict(
        f"{request.design.name} swept: {count}, {outcomes}{earlier}. Written to {designs.folder}: "
        f"{', '.join(designs.files)}",
        designs.folder,
    )
