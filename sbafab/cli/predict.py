"""``sbafab predict``: what the actuator will do, by closed formulas."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from sbafab.cli.exit import RULE_FAILED
from sbafab.cli.options import (
    FLOW,
    PRESSURE,
    VOLUME,
    Request,
    calibration_options,
    finite,
    refuse_given,
    run_options,
)
from sbafab.cli.printing import console, wrapped
from sbafab.models.figures import LEFT_OUT

if TYPE_CHECKING:
    from sbafab.assemblies.records import Assembly
    from sbafab.design.records import Design
    from sbafab.models.figures import Figure, Model, Prediction

OF_ELASTIC = ("pocket_loss", "modulus_mpa")
"""Options that elastic balloons take, and no other model."""
OF_FORMULAS = ("flow", "volumes", "contact_factor")
"""Those that a formula of the pocket's form takes."""


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
@click.option(
    "-v", "--verbose", is_flag=True, help="All figures, with their models and what these hold for."
)
def predict(
    request: Request,
    pressures: tuple[float, ...],
    flow: float,
    volumes: tuple[float, ...],
    load_g: float,
    verbose: bool,
    **factors: Any,
) -> None:
    """Predict sizes, stroke, force, time and bending.

    Shows a verdict, and what the paper measured beside what is off by more than a quarter; -v and
    predict.json, which it writes with plots, have every figure with its model and validity. A
    design that fails a rule is predicted on the screen only (exit code 1). Of an assembly: reach,
    load, grip in its lumen, and whether inflated parts meet, at one pressure (default 10 kPa), on
    the screen.
    """
    from sbafab.assemblies.files import load
    from sbafab.cli.printing import print_json, print_listed, shown_progress
    from sbafab.design.records import Design
    from sbafab.errors import OutputError
    from sbafab.models.figures import Asked, Factors
    from sbafab.models.formulas import size_said
    from sbafab.models.prediction import predict as predicted
    from sbafab.output.artefacts import prediction_json
    from sbafab.runs.run import RunRequest, generate

    design = load(request.designs[0], request.assignments, request.waivers)
    if not isinstance(design, Design):
        _refuse_for_assembly(design, pressures)
        _predict_assembly(design, request, pressures[0] if pressures else 10.0, load_g)
        return
    _refuse_for_one(design)
    wish = Asked(pressures or Asked.pressures_kpa, flow, volumes, Factors(**factors))
    with shown_progress(request.as_json) as tell:
        tell("predicting", 0, 1)
        found = predicted(design, wish)
        asked = RunRequest(design, request.out, ("predict",), prediction=found)
        try:
            run = generate(asked, tell)
        except OutputError:
            # What was asked is known, only not written.
            if not request.as_json:
                print_prediction(found, verbose)
            raise
    failed = sorted({finding.rule for finding in run.findings if finding.verdict == "fail"})
    if request.as_json:
        print_json({**prediction_json(design, found), "failed": failed, "folder": str(run.folder)})
    else:
        print_listed("size", size_said(design, run.laminate))
        print_prediction(found, verbose)
        if not run.failed:
            click.echo(f"written to {run.folder}: predict.json, predict/")
    if run.failed:
        click.echo(
            f"sbafab: {', '.join(failed)} failed, so this actuator may not hold and no prediction "
            "was written; change the design or waive the rule by name",
            err=True,
        )
        click.get_current_context().exit(RULE_FAILED)


def _refuse_for_one(design: Design) -> None:
    """Raises UsageError for an option that no model of the design takes."""
    from sbafab.design.records import Drawn
    from sbafab.models.balloons import has_balloons
    from sbafab.models.drawn import model_form

    form = model_form(design)
    of = f"and {design.name} has other ones; leave it out"
    refuse_given(f"is for an assembly, and {design.name} is one actuator; leave it out", "load_g")
    if not has_balloons(form):
        refuse_given(f"is for elastic balloons, round pockets on flat plates, {of}", *OF_ELASTIC)
    if isinstance(form.pockets, Drawn):
        refuse_given(f"is for pockets that are round or oblong, {of}", *OF_FORMULAS)


def _refuse_for_assembly(assembly: Assembly, pressures: tuple[float, ...]) -> None:
    """Raises UsageError for an option that only a design's own prediction takes."""
    one = f"is for one actuator, and {assembly.name} is an assembly; predict the part's own design"
    refuse_given(one, *OF_FORMULAS, *OF_ELASTIC, "press_factor")
    writes = f"is for what is written, and of an assembly nothing is; predict {assembly.name} "
    refuse_given(f"{writes}without it", "out", "waivers")
    if len(pressures) > 1:
        raise click.UsageError("--pressure is given once for an assembly; leave the others out")


def _predict_assembly(
    assembly: Assembly, request: Request, pressure_kpa: float, load_g: float
) -> None:
    from sbafab.assemblies.build import assemble
    from sbafab.cli.printing import print_assembly_prediction, print_json
    from sbafab.output.schema_ids import ASSEMBLY_PREDICT_SCHEMA
    from sbafab.reports.assembly_prediction import as_json, predict_assembly

    found = predict_assembly(assemble(assembly), pressure_kpa, load_g)
    if request.as_json:
        print_json({"schema": ASSEMBLY_PREDICT_SCHEMA, **as_json(found)})
    else:
        print_assembly_prediction(found)
    if found.touches:
        click.get_current_context().exit(RULE_FAILED)


# What ``sbafab predict`` prints of a design: a verdict, on request all figures and their validity.
#
# Of the figures what to design with comes first, each quantity once; other models of the same
# follow.


NAME, VALUE = 56, 10
"""Columns of a name, at most, and of a value."""
FIRST = "Figures to design with"
OTHERS = "Other models of the same: design with the figures above"


def print_prediction(found: Prediction, verbose: bool = False) -> None:
    """The verdict; ``verbose`` also all figures, and what each model is good for."""
    from rich.text import Text

    out = console()
    label = max((len(line.quantity) for line in found.verdict), default=0) + 2
    before = ""
    for line in found.verdict:
        head = "" if line.quantity == before else f"{line.quantity}:"
        before = line.quantity
        said = f"{line.figure}: {line.note}" if line.quantity == LEFT_OUT else line.figure
        for row in wrapped(said, out.width, head.ljust(label), " " * label):
            out.print(Text(row), soft_wrap=True)
        if line.quantity != LEFT_OUT:
            for row in wrapped(line.note, out.width, " " * (label + 2), " " * (label + 2)):
                out.print(Text(row), soft_wrap=True)
    if verbose:
        _print_figures(found)
    else:
        out.print(Text(f"{len(found.figures)} figures, each with its model and validity: -v"))


def _print_figures(found: Prediction) -> None:
    """All figures, then what each model is good for."""
    from rich.text import Text

    out = console()
    first = sorted(found.figures, key=lambda figure: figure.other)
    models = list(dict.fromkeys(figure.model for figure in first))
    others = [figure for figure in first if figure.other]
    own = first[: len(first) - len(others)]

    def part(title: str, lines: Iterator[str]) -> None:
        out.print(Text(f"\n{title}", style="bold"))
        for line in lines:
            # A heading starts at the margin.
            is_head = title in (FIRST, OTHERS) and not line.startswith(" ")
            out.print(Text(line, style="bold" if is_head else ""), soft_wrap=True)

    part(FIRST, figure_lines(own, models, out.width))
    if others:
        part(OTHERS, figure_lines(others, models, out.width))
    part("Models and validity", _numbered(models, out.width))
    out.print()


def figure_lines(figures: Sequence[Figure], models: Sequence[Model], width: int) -> Iterator[str]:
    """A heading for each model of a group, and below it a line a figure.

    What a name has in common with the one above it, up to a comma, is left blank.
    """
    unit = max((len(figure.unit) for figure in figures), default=0)
    room = min(NAME, width - VALUE - unit - 4)
    for group in dict.fromkeys(figure.group for figure in figures):
        for number, model in enumerate(models, start=1):
            own = [one for one in figures if one.group == group and one.model == model]
            if own:
                yield f"{group}: {model.name} [{number}]"
            before = ""
            for one in own:
                head, comma, _ = one.name.partition(", ")
                name = one.name
                if comma and head == before:
                    name = " " * (len(head) + 2) + name.removeprefix(f"{head}, ")
                before = head
                *over, last = textwrap.wrap(name, room, subsequent_indent="  ") or [name]
                yield from (f"  {line}" for line in over)
                yield f"  {last:{room}}{one.value:>{VALUE}.4g}  {one.unit}".rstrip()
                yield from wrapped(one.aside, width, "    ", "    ") if one.aside else ()


def _numbered(models: Sequence[Model], width: int) -> Iterator[str]:
    for number, model in enumerate(models, start=1):
        said = f"{model.title}: {model.trust}"
        yield from wrapped(said, width, f"[{number}]".ljust(5), " " * 5)
