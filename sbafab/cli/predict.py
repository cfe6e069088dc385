"""``sbafab predict``: the behaviour of an actuator or assembly by closed formulas."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from sbafab.api import predictions as api
from sbafab.api.designs import either_of
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.cli.exit import print_error
from sbafab.errors import OutputError

ELASTIC_OPTIONS = ("tip_load", "measured", "serial", "sensitivity")
"""Options of the model of elastic balloons alone."""
FORMULA_OPTIONS = ("flow_ml_min", "volumes_ul")
"""Options of formulas that need round or oblong pockets."""


@click.command()
@opt.run_options(either_of)
@opt.pressures_option(
    "Gauge pressure of force and work, negative for a vacuum",
    "10, 100; of a design that works under a vacuum -10, -100",
)
@opt.flow_option("Flow for the actuation time")
@opt.option(
    "--volume volumes_ul...",
    "Volume of each balloon for the stroke, ul or with a unit.",
    opt.VOLUME,
)
@opt.option(
    "--tip-load tip_load G",
    "Weight on the free tip, g; for elastic models.",
    opt.FiniteRange(min=0, max=1000),
    default=0.0,
)
@opt.option(
    "--measured Q=V...",
    "What was measured on this actuator, such as stroke@10kPa=16.6mm or force@0mm@100kPa=4.8N: "
    "narrows the intervals to those of this one.",
)
@opt.option("--serial NAME", "Actuator whose recorded force and height count as measured.")
@opt.option(
    "--lab FILE",
    "File of the lab's records, for --serial.",
    click.Path(path_type=Path),
    default=Path("lab.sqlite"),
)
@opt.option(
    "--load load_g G",
    "Assemblies: mass at the tips, g; the default is the paper's marble.",
    opt.FiniteRange(min=0, max=1000),
    default=1.2,
)
@opt.option(
    "--sensitivity", "Add by how much 1 % of a key moves stroke and bend; takes some seconds.", bool
)
@opt.option("-v --verbose", "All figures, with their models and validity.", bool)
def predict(
    design: api.Design | api.Assembly,
    out: Path,
    as_json: bool,
    pressures_kpa: tuple[float, ...],
    load_g: float,
    sensitivity: bool,
    verbose: bool,
    **conditions: Any,
) -> None:
    """Predict size, stroke, force, time and bending.

    Prints the main figures, with the paper's measurements if models deviate from them by more than
    a quarter. -v and predict.json, which is written with plots, give all figures with their models
    and validity. For a design that fails a rule, the prediction is only printed (exit code 1). If
    the folder holds another design's files, the prediction goes into a folder beside it. For an
    assembly it prints reach, load, grip in its lumen, and collisions of inflated parts, at one
    pressure (default 10 kPa).
    """
    if not isinstance(design, api.Design):
        _refuse_for_assembly(design, pressures_kpa)
        _predict_assembly(design, as_json, pressures_kpa[0] if pressures_kpa else 10.0, load_g)
        return
    _refuse_for_design(design)
    rows: Sequence[api.SensitivityRow] = ()
    with show.progress(as_json) as progress:
        progress("predicting", 0, 1)
        prediction = api.predict(design, pressures_kpa=pressures_kpa or None, **conditions)
        write = api.RunRequest(design, out, ("predict",), prediction=prediction)
        try:
            run = api.generate(write, progress)
        except OutputError:
            # The prediction exists, though it cannot be written.
            if not as_json:
                print_prediction(prediction, verbose)
            raise
        if sensitivity:
            progress("sensitivity", 0, 1)
            rows = api.sensitivity_table(design, prediction.asked.pressures_kpa[0])
    failed = show.failed_rules(run.findings)
    if as_json:
        more = {"sensitivity": [asdict(row) for row in rows]} if sensitivity else {}
        document = {**api.prediction_json(design, prediction), **more}
        show.document({**document, "failed": failed, "folder": str(run.folder)})
    else:
        show.phrases("size", api.size_phrases(design, run.laminate, prediction.asked.factors))
        print_prediction(prediction, verbose)
        if rows:
            _print_sensitivity(rows, prediction.asked.pressures_kpa[0])
        if not run.failed:
            details = "" if verbose else " Details: -v"
            show.verdict(
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
        show.end_failed()


def _print_sensitivity(rows: Sequence[api.SensitivityRow], pressure: float) -> None:
    """Print the changes of stroke and bend for 1 % more of each key."""
    show.line(f"\nat {pressure:g} kPa 1 % more of     moves the free stroke    the bend")
    for row in rows:
        bend = "" if row.bend is None else f"{row.bend:+.2f} %"
        show.line(f"{row.key:<26} {row.stroke:>+20.2f} % {bend:>11}".rstrip())


def _refuse_for_design(design: api.Design) -> None:
    """Raise UsageError for an option that no model of the design uses."""
    form = api.model_form(design)
    reason = f"and {design.name} has others; leave it out"
    opt.refuse_options(
        f"is for an assembly, and {design.name} is one actuator; leave it out", "load_g"
    )
    if not api.has_balloons(form):
        opt.refuse_options(
            f"is for elastic balloons, round pockets on flat plates, {reason}", *ELASTIC_OPTIONS
        )
    if isinstance(form.pockets, api.Drawn):
        opt.refuse_options(f"is for pockets that are round or oblong, {reason}", *FORMULA_OPTIONS)


def _refuse_for_assembly(assembly: api.Assembly, pressures: tuple[float, ...]) -> None:
    """Raise UsageError for an option that applies only to a single design."""
    reason = (
        f"is for one actuator, and {assembly.name} is an assembly; predict the part's own design"
    )
    opt.refuse_options(reason, *FORMULA_OPTIONS, *ELASTIC_OPTIONS)
    reason = f"is for written files, and the prediction of {assembly.name} is only printed"
    opt.refuse_options(f"{reason}; leave it out", "out", "waivers")
    if len(pressures) > 1:
        raise click.UsageError("an assembly needs a single pressure; give --pressure once")


def _predict_assembly(
    assembly: api.Assembly, as_json: bool, pressure_kpa: float, load_g: float
) -> None:
    """Predict an assembly and print it; exit with 1 if inflated parts collide."""
    prediction = api.predict_assembly(assembly, pressure_kpa=pressure_kpa, load_g=load_g)
    if as_json:
        show.document({"schema": api.SCHEMA, **asdict(prediction)})
    else:
        print_assembly_prediction(prediction)
    if prediction.touches:
        show.end_failed()


# Printing: main figures of a design, or with -v all and their models; figures of an assembly.


NAME_WIDTH, VALUE_WIDTH = 56, 10
"""Columns of a name, at most, and of a value."""


def print_prediction(prediction: api.Prediction, verbose: bool = False) -> None:
    """Print the main figures; ``verbose`` also all figures and the validity of their models."""
    lines = prediction.verdict
    label = max((len(line.quantity) for line in lines), default=0) + 2
    previous = ""
    for number, line in enumerate(lines, start=1):
        head = "" if line.quantity == previous else f"{line.quantity}:"
        previous = line.quantity
        is_left_out = line.quantity == api.LEFT_OUT
        text = f"{line.figure}: {line.note}" if is_left_out else line.figure
        show.wrapped(text, indent=" " * label, first=head.ljust(label))
        # What intervals are stands once, under the last of them.
        later = [other.note for other in lines[number:]]
        if not is_left_out and not (line.note == api.INTERVAL_NOTE and line.note in later):
            show.wrapped(line.note, indent=" " * (label + 2))
    if verbose:
        _print_figures(prediction)


def _print_figures(prediction: api.Prediction) -> None:
    """Print all figures, alternative models last, and the validity of the models."""
    groups = {
        "Figures to design with": [f for f in prediction.figures if not f.other],
        "Alternative models: design with the figures above": [
            f for f in prediction.figures if f.other
        ],
    }
    models = list(dict.fromkeys(f.model for figures in groups.values() for f in figures))
    for title, figures in groups.items():
        if figures:
            show.line(f"\n{title}", "bold")
        for line in _figure_lines(figures, models, show.width()):
            # The heading of a group starts at the margin.
            show.line(line, "" if line.startswith(" ") else "bold")
    show.line("\nModels and validity", "bold")
    for number, model in enumerate(models, start=1):
        text = f"{model.title}: {model.trust}"
        show.wrapped(text, indent=" " * 5, first=f"[{number}]".ljust(5))
    show.line("")


def _figure_lines(
    figures: Sequence[api.Figure], models: Sequence[api.Model], width: int
) -> Iterator[str]:
    """Yield a heading for each model of a group, and below it a line for each figure."""
    unit = max((len(figure.unit) for figure in figures), default=0)
    spans = max((len(figure.range) + 4 for figure in figures if figure.interval), default=0)
    room = min(NAME_WIDTH, width - VALUE_WIDTH - unit - spans - 4)
    for group in dict.fromkeys(figure.group for figure in figures):
        for number, model in enumerate(models, start=1):
            members = [f for f in figures if f.group == group and f.model == model]
            if members:
                yield f"{group}: {model.name} [{number}]"
            for figure in members:
                *over, last = textwrap.wrap(figure.name, room, subsequent_indent="  ") or [""]
                yield from (f"  {line}" for line in over)
                interval = f"({figure.range})" if figure.interval else ""
                value = f"{figure.value:>{VALUE_WIDTH}.4g}  {figure.unit:<{unit}}  {interval}"
                yield f"  {last:{room}}{value}".rstrip()
                if figure.aside:
                    yield from (f"    {line}" for line in textwrap.wrap(figure.aside, width - 4))


def print_assembly_prediction(prediction: api.AssemblyPrediction) -> None:
    """Print the figures of an assembly and, last, the parts that collide when inflated."""
    pressure = f"at {prediction.pressure_kpa:g} kPa"
    rows, previous = [], ""
    for figure in prediction.figures:
        part = "" if figure.part == previous else figure.part
        previous = figure.part
        value = f"{figure.value:.4g}"
        rows.append((part, figure.name, value, figure.unit, figure.model, figure.paper))
    names = ("part", "figure", "value", "unit", "model", "paper")
    show.table(f"{prediction.name} {pressure}", names, rows)
    measured: dict[str, dict[str, None]] = {}
    for figure in prediction.figures:
        if figure.measured:
            measured.setdefault(figure.measured, {})[figure.name] = None
    for sentence, figures in measured.items():
        show.wrapped(f"{'; '.join(figures)}: {sentence}")
    for reason in prediction.left_out:
        show.line(f"left out: {reason}")
    for part in prediction.near_burst:
        show.line(f"{part}: {api.FLAGS[api.NEAR_BURST]}")
    for sentence in prediction.met():
        show.line(sentence)
    if prediction.touches:
        show.failure(f"{prediction.name} failed: inflated parts collide {pressure}")
    else:
        show.verdict(f"{prediction.name} predicted {pressure}: {len(prediction.figures)} figures")
