"""``sbafab predict``: what the actuator will do, by closed formulas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from sbafab.cli.options import Request, calibration_options, finite, run_options
from sbafab.cli.quantities import FLOW, PRESSURE, VOLUME
from sbafab.cli.working import RULE_FAILED

if TYPE_CHECKING:
    from rich.table import Table

    from sbafab.assemblies.records import Assembly
    from sbafab.models.figures import Prediction


WIDE = 110
"""Columns from which on a figure's row names its model; the list below it does so anyway."""


@click.command()
@run_options
@click.option(
    "--pressure",
    "pressures",
    type=PRESSURE.read,
    multiple=True,
    metavar="P",
    help="Force and work at this pressure, kPa or with a unit. Repeatable.  [default: 10, 100]",
)
@click.option(
    "--flow",
    type=FLOW.read,
    default="35 ml/min",
    show_default=True,
    metavar="Q",
    help="Time to actuate at this flow, ml/min or with a unit.",
)
@click.option(
    "--volume",
    "volumes",
    type=VOLUME.read,
    multiple=True,
    metavar="V",
    help="Stroke with this much in each balloon, ul or with a unit. Repeatable.",
)
@click.option(
    "--press-factor",
    type=float,
    default=1.0,
    callback=finite,
    metavar="F",
    help="Thickness after pressing over that of the films, if measured.  [default: 1, off]",
)
@click.option(
    "--contact-factor",
    type=float,
    default=1.0,
    callback=finite,
    metavar="F",
    help="Measured force over the one of Eqs. 1-4, if measured.  [default: 1, off]",
)
@calibration_options
@click.option(
    "--load",
    "load_g",
    type=click.FloatRange(min=0, max=1000),
    callback=finite,
    default=1.2,
    show_default=True,
    metavar="G",
    help="Assemblies: mass at the tips, g; the paper's marble by default.",
)
def predict(
    request: Request,
    pressures: tuple[float, ...],
    flow: float,
    volumes: tuple[float, ...],
    load_g: float,
    **factors: Any,
) -> None:
    """Predict sizes, stroke, force, time and bending.

    Writes predict.json and plots. Every figure names its model and how far that is trusted. A
    design that fails a rule is predicted on the screen only (exit code 1). Of an assembly: reach,
    load, grip in its lumen, and whether inflated parts meet, at the first pressure given (default
    10 kPa), on the screen.
    """
    from sbafab.assemblies.reading import load
    from sbafab.assemblies.records import Assembly
    from sbafab.cli.printing import print_json, shown_progress
    from sbafab.errors import OutputError
    from sbafab.models.figures import Asked, Factors
    from sbafab.models.prediction import predict as predicted
    from sbafab.models.sizes import size_said
    from sbafab.output.earlier import PREDICTION
    from sbafab.output.predicting import prediction_json, with_prediction
    from sbafab.output.run import Extras, generate

    design = load(request.designs[0], request.assignments, request.waivers)
    if isinstance(design, Assembly):
        _predict_assembly(design, request, pressures[0] if pressures else 10.0, load_g)
        return
    wish = Asked(pressures or Asked.pressures_kpa, flow, volumes, Factors(**factors))
    found = predicted(design, wish)
    with shown_progress(request.as_json) as tell:
        extras = Extras(also=with_prediction(design, found), own=PREDICTION)
        try:
            run = generate(design, request.out, (), tell, extras=extras)
        except OutputError:
            # What was asked is known, only not written.
            if not request.as_json:
                _print(found)
            raise
    failed = sorted({finding.rule for finding in run.findings if finding.verdict == "fail"})
    if request.as_json:
        print_json({**prediction_json(design, found), "failed": failed, "folder": str(run.folder)})
    else:
        click.echo(size_said(design, run.laminate))
        _print(found)
        if not run.failed:
            click.echo(f"written to {run.folder}: predict.json, predict/")
    if run.failed:
        click.echo(
            f"sbafab: {', '.join(failed)} failed, so this actuator may not hold and no prediction "
            "was written; change the design or waive the rule by name",
            err=True,
        )
        click.get_current_context().exit(RULE_FAILED)


def _predict_assembly(
    assembly: Assembly, request: Request, pressure_kpa: float, load_g: float
) -> None:
    from sbafab.assemblies.build import assemble
    from sbafab.cli.printing import print_json
    from sbafab.cli.printing_assembly import print_assembly_prediction
    from sbafab.reports.assembly_prediction import as_json, predict_assembly

    found = predict_assembly(assemble(assembly), pressure_kpa, load_g)
    if request.as_json:
        print_json(as_json(found))
    else:
        print_assembly_prediction(found)
    if found.touches:
        click.get_current_context().exit(RULE_FAILED)


def _print(found: Prediction) -> None:
    """The table, with a number for each model, and below what the numbers stand for."""
    from rich.text import Text

    from sbafab.cli.printing import console

    models = list(dict.fromkeys(figure.model for figure in found.figures))
    out = console()
    out.print(_table(found, models, out.width >= WIDE))
    out.print()
    out.print(Text("Models and validity", style="bold"))
    notes = _grid()
    for number, model in enumerate(models, start=1):
        notes.add_row(Text(f"[{number}]"), Text(f"{model.title}: {model.trust}"))
    out.print(notes)
    if found.left_out:
        out.print()
        out.print(Text("Left out", style="bold"))
        left = _grid()
        for item in found.left_out:
            left.add_row("-", Text(f"{item.name}: {item.reason}"))
        out.print(left)
    out.print()


def _table(found: Prediction, models: list[Any], named: bool) -> Table:
    """The figures, each with the number of its model, and its name where there is room."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("", no_wrap=True)
    table.add_column("figure", ratio=1)
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("model", no_wrap=True)
    group = ""
    for figure in found.figures:
        number = models.index(figure.model) + 1
        table.add_row(
            figure.group if figure.group != group else "",
            Text(figure.name),
            f"{figure.value:.4g}",
            figure.unit,
            Text(f"[{number}] {figure.model.name}" if named else f"[{number}]"),
        )
        group = figure.group
    return table


def _grid() -> Table:
    from rich.table import Table

    grid = Table.grid(padding=(0, 1))
    grid.add_column(no_wrap=True)
    grid.add_column(ratio=1)
    return grid
