"""``sbafab predict``: the behaviour of an actuator or assembly by closed formulas."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import click

from sbafab.assemblies.build import assemble
from sbafab.assemblies.files import load
from sbafab.assemblies.records import Assembly
from sbafab.cli.exit import RULE_FAILED, print_error
from sbafab.cli.options import (
    VOLUME,
    FiniteFloat,
    FiniteRange,
    Request,
    calibration_options,
    flow_option,
    pressures_option,
    refuse_options,
    run_options,
)
from sbafab.cli.printing import (
    console,
    print_failure,
    print_json,
    print_line,
    print_listed,
    print_table,
    print_verdict,
    print_wrapped,
    wrapped,
)
from sbafab.cli.progress import shown_progress
from sbafab.design.records import Design, Drawn
from sbafab.errors import OutputError
from sbafab.folders.artefacts import prediction_json
from sbafab.folders.run import RunRequest, generate
from sbafab.models.balloons import has_balloons
from sbafab.models.drawn_pockets import model_form
from sbafab.models.figures import (
    FLAGS,
    LEFT_OUT,
    NEAR_BURST,
    Figure,
    Model,
    Prediction,
    PredictionRequest,
)
from sbafab.models.formulas import size_phrases, usual_pressures
from sbafab.models.prediction import predict as predicted
from sbafab.models.sensitivities import SensitivityRow, sensitivity_table
from sbafab.reports.assembly_prediction import SCHEMA, AssemblyPrediction, predict_assembly

ELASTIC_OPTIONS = ("pocket_loss", "modulus_mpa", "sensitivity")
"""Options of the model of elastic balloons alone."""
FORMULA_OPTIONS = ("flow_ml_min", "volumes", "contact_factor")
"""Options of formulas that need round or oblong pockets."""


@click.command()
@run_options()
@pressures_option(
    "Gauge pressure of force and work, negative for a vacuum",
    "10, 100; of a design that works under a vacuum -10, -100",
)
@flow_option("Flow for the actuation time")
@click.option(
    "--volume",
    "volumes",
    type=VOLUME.read,
    multiple=True,
    metavar="V",
    help="Volume of each balloon for the stroke, ul or with a unit. Repeatable.",
)
@click.option(
    "--press-factor",
    type=FiniteFloat(),
    metavar="F",
    help="Measured thickness after the press over that before, of films that melt in it.  "
    "[default: the calibration's]",
)
@click.option(
    "--contact-factor",
    type=FiniteFloat(),
    metavar="F",
    help="Measured ratio of force to Eqs. 1-4.  [default: 1, off]",
)
@calibration_options
@click.option(
    "--load",
    "load_g",
    type=FiniteRange(min=0, max=1000),
    default=1.2,
    metavar="G",
    help="Assemblies: mass at the tips, g; the default is the paper's marble.",
)
@click.option(
    "--sensitivity",
    is_flag=True,
    help="Add by how much 1 % of a key moves stroke and bend; takes some seconds.",
)
@click.option("-v", "--verbose", is_flag=True, help="All figures, with their models and validity.")
def predict(
    request: Request,
    pressures: tuple[float, ...],
    flow_ml_min: float,
    volumes: tuple[float, ...],
    load_g: float,
    sensitivity: bool,
    verbose: bool,
    **factors: Any,
) -> None:
    """Predict size, stroke, force, time and bending.

    Prints the main figures, with the paper's measurements where models differ from them by more
    than a quarter. -v and predict.json, which is written with plots, hold all figures with their
    models and validity. A design that fails a rule is predicted on the screen only (exit code 1).
    Where the folder holds another design's files, the prediction goes into one beside it.
    Of an assembly it prints reach, load, grip in its lumen, and collisions of inflated parts, at
    one pressure (default 10 kPa).
    """
    design = load(request.design, request.assignments, request.waivers)
    if not isinstance(design, Design):
        _refuse_for_assembly(design, pressures)
        _predict_assembly(design, request, pressures[0] if pressures else 10.0, load_g)
        return
    _refuse_for_design(design)
    wanted = PredictionRequest(
        pressures or usual_pressures(design.form), flow_ml_min, volumes, overrides=factors
    )
    with shown_progress(request.as_json) as progress:
        progress("predicting", 0, 1)
        prediction = predicted(design, wanted)
        try:
            run = generate(
                RunRequest(design, request.out, ("predict",), prediction=prediction), progress
            )
        except OutputError:
            # The prediction exists, though it cannot be written.
            if not request.as_json:
                print_prediction(prediction, verbose)
            raise
        rows = []
        if sensitivity:
            progress("sensitivity", 0, 1)
            rows = sensitivity_table(design, wanted.pressures_kpa[0])
    failed = sorted({finding.rule for finding in run.findings if finding.verdict == "fail"})
    if request.as_json:
        more = {"sensitivity": [asdict(row) for row in rows]} if sensitivity else {}
        document = {**prediction_json(design, prediction), **more}
        print_json({**document, "failed": failed, "folder": str(run.folder)})
    else:
        print_listed("size", size_phrases(design, run.laminate, prediction.asked.factors))
        print_prediction(prediction, verbose)
        if sensitivity:
            _print_sensitivity(rows, wanted.pressures_kpa[0])
        if not run.failed:
            details = "" if verbose else " Details: -v"
            print_verdict(
                f"{design.name} predicted: {len(prediction.figures)} figures with models and "
                f"validity. Written to {run.folder}: predict.json, predict/.{details}",
                run.folder,
            )
    if run.beside:
        print_error(f"{run.beside}; the prediction was put into {run.folder}")
    if run.failed:
        print_error(
            f"{design.name} failed: {', '.join(failed)}. It may leak or burst, and no prediction "
            "was written. Change the design or waive the rule by name"
        )
        click.get_current_context().exit(RULE_FAILED)


def _print_sensitivity(rows: Sequence[SensitivityRow], pressure: float) -> None:
    """Print by how much 1 % more of each key moves stroke and bend."""
    print_line(f"\nat {pressure:g} kPa 1 % more of     moves the free stroke    the bend")
    for row in rows:
        bend = "" if row.bend is None else f"{row.bend:+.2f} %"
        print_line(f"{row.key:<26} {row.stroke:>+20.2f} % {bend:>11}".rstrip())


def _refuse_for_design(design: Design) -> None:
    """Raise UsageError for an option that no model of the design uses."""
    form = model_form(design)
    reason = f"and {design.name} has others; leave it out"
    refuse_options(f"is for an assembly, and {design.name} is one actuator; leave it out", "load_g")
    if not has_balloons(form):
        refuse_options(
            f"is for elastic balloons, round pockets on flat plates, {reason}", *ELASTIC_OPTIONS
        )
    if isinstance(form.pockets, Drawn):
        refuse_options(f"is for pockets that are round or oblong, {reason}", *FORMULA_OPTIONS)


def _refuse_for_assembly(assembly: Assembly, pressures: tuple[float, ...]) -> None:
    """Raise UsageError for an option that only the prediction of a single design uses."""
    reason = (
        f"is for one actuator, and {assembly.name} is an assembly; predict the part's own design"
    )
    refuse_options(reason, *FORMULA_OPTIONS, *ELASTIC_OPTIONS, "press_factor")
    reason = f"is for written files, and the prediction of {assembly.name} is only printed"
    refuse_options(f"{reason}; leave it out", "out", "waivers")
    if len(pressures) > 1:
        raise click.UsageError("an assembly is predicted at one pressure; give --pressure once")


def _predict_assembly(
    assembly: Assembly, request: Request, pressure_kpa: float, load_g: float
) -> None:
    prediction = predict_assembly(assemble(assembly), pressure_kpa, load_g)
    if request.as_json:
        print_json({"schema": SCHEMA, **asdict(prediction)})
    else:
        print_assembly_prediction(prediction)
    if prediction.touches:
        click.get_current_context().exit(RULE_FAILED)


# Printing: main figures of a design, or with -v all and their models; figures of an assembly.


NAME_WIDTH, VALUE_WIDTH = 56, 10
"""Columns of a name, at most, and of a value."""
MAIN_TITLE = "Figures to design with"
ALTERNATIVES_TITLE = "Alternative models: design with the figures above"


def print_prediction(prediction: Prediction, verbose: bool = False) -> None:
    """Print the main figures; ``verbose`` also all figures and the validity of their models."""
    width = console().width
    label = max((len(line.quantity) for line in prediction.verdict), default=0) + 2
    lines = prediction.verdict
    previous = ""
    for number, line in enumerate(lines):
        head = "" if line.quantity == previous else f"{line.quantity}:"
        previous = line.quantity
        text = f"{line.figure}: {line.note}" if line.quantity == LEFT_OUT else line.figure
        for row in wrapped(text, width, head.ljust(label), " " * label):
            print_line(row)
        # A note of several lines stands once, under the last of them.
        is_last = all(line.note != other.note for other in lines[number + 1 :])
        if line.quantity != LEFT_OUT and is_last:
            for row in wrapped(line.note, width, " " * (label + 2), " " * (label + 2)):
                print_line(row)
    if verbose:
        _print_figures(prediction)


def _print_figures(prediction: Prediction) -> None:
    """Print all figures, alternative models last, and the validity of the models."""
    width = console().width
    main = [figure for figure in prediction.figures if not figure.other]
    alternatives = [figure for figure in prediction.figures if figure.other]
    models = list(dict.fromkeys(figure.model for figure in (*main, *alternatives)))
    for title, figures in ((MAIN_TITLE, main), (ALTERNATIVES_TITLE, alternatives)):
        if figures:
            print_line(f"\n{title}", "bold")
        for line in figure_lines(figures, models, width):
            # The heading of a group starts at the margin.
            print_line(line, "" if line.startswith(" ") else "bold")
    print_line("\nModels and validity", "bold")
    for number, model in enumerate(models, start=1):
        text = f"{model.title}: {model.trust}"
        for line in wrapped(text, width, f"[{number}]".ljust(5), " " * 5):
            print_line(line)
    print_line("")


def figure_lines(figures: Sequence[Figure], models: Sequence[Model], width: int) -> Iterator[str]:
    """Yield a heading for each model of a group, and below it a line for each figure.

    A name that begins like the one above it, up to a comma, has blanks in place of that part.
    """
    unit = max((len(figure.unit) for figure in figures), default=0)
    spans = max((len(figure.range) + 4 for figure in figures if figure.interval), default=0)
    room = min(NAME_WIDTH, width - VALUE_WIDTH - unit - spans - 4)
    for group in dict.fromkeys(figure.group for figure in figures):
        for number, model in enumerate(models, start=1):
            members = [f for f in figures if f.group == group and f.model == model]
            if members:
                yield f"{group}: {model.name} [{number}]"
            previous = ""
            for figure in members:
                head, comma, rest = figure.name.partition(", ")
                name = figure.name
                if comma and head != previous and len(name) > room >= len(head):
                    yield f"  {head},"
                    previous = head
                if comma and head == previous:
                    name = " " * max(min(len(head) + 2, room - len(rest)), 2) + rest
                previous = head
                *over, last = textwrap.wrap(name, room, subsequent_indent="  ") or [name]
                yield from (f"  {line}" for line in over)
                interval = f"({figure.range})" if figure.interval else ""
                value = f"{figure.value:>{VALUE_WIDTH}.4g}  {figure.unit:<{unit}}  {interval}"
                yield f"  {last:{room}}{value}".rstrip()
                yield from wrapped(figure.aside, width, "    ", "    ") if figure.aside else ()


def print_assembly_prediction(prediction: AssemblyPrediction) -> None:
    """Print the figures of an assembly and, last, the parts that collide when inflated."""
    pressure = f"at {prediction.pressure_kpa:g} kPa"
    rows, previous = [], ""
    for figure in prediction.figures:
        part = "" if figure.part == previous else figure.part
        previous = figure.part
        value = f"{figure.value:.4g}"
        rows.append((part, figure.name, value, figure.unit, figure.model, figure.paper))
    names = ("part", "figure", "value", "unit", "model", "paper")
    print_table(f"{prediction.name} {pressure}", names, rows)
    measured: dict[str, dict[str, None]] = {}
    for figure in prediction.figures:
        if figure.measured:
            measured.setdefault(figure.measured, {})[figure.name] = None
    for sentence, figures in measured.items():
        print_wrapped(f"{'; '.join(figures)}: {sentence}")
    for reason in prediction.left_out:
        print_line(f"left out: {reason}")
    for part in prediction.near_burst:
        print_line(f"{part}: {FLAGS[NEAR_BURST]}")
    for sentence in prediction.met():
        print_line(sentence)
    if prediction.touches:
        print_failure(f"{prediction.name} failed: inflated parts collide {pressure}")
    else:
        print_verdict(f"{prediction.name} predicted {pressure}: {len(prediction.figures)} figures")
