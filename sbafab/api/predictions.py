"""Predictions by models, of designs and assemblies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sbafab.api.designs import Source, assemble, command, load, numbers
from sbafab.assemblies.build import Assembled, PlacedSba
from sbafab.assemblies.records import Assembly
from sbafab.design.files import Change
from sbafab.design.records import Design, Drawn
from sbafab.errors import DesignError
from sbafab.folders.artefacts import PredictDocument, prediction_json
from sbafab.folders.run import RunRequest, generate
from sbafab.lab.report import items
from sbafab.lab.store import Lab
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Surface
from sbafab.models.actuator import model_form
from sbafab.models.balloons import has_balloons
from sbafab.models.calibration import factors_of
from sbafab.models.figures import (
    FLAGS,
    INTERVAL_NOTE,
    LEFT_OUT,
    NEAR_BURST,
    Figure,
    Model,
    Prediction,
    PredictionRequest,
)
from sbafab.models.pneumatics import FLUIDS, Line, usual_pressures
from sbafab.models.prediction import predict as predict_design
from sbafab.models.sensitivities import SensitivityRow, sensitivity_table
from sbafab.models.sizes import size_phrases
from sbafab.models.stack import MOST_PRESSURE, Motion, Pose, Stack
from sbafab.models.stack import stack as stack_of
from sbafab.reports.assembly_prediction import SCHEMA, AssemblyPrediction, Grip
from sbafab.reports.assembly_prediction import grip as grip_of
from sbafab.reports.assembly_prediction import predict_assembly as predict_assembled
from sbafab.reports.inflated import gripping
from sbafab.search.quantities import read_measured


class PrintedPrediction(PredictDocument, schema=PredictDocument.SCHEMA):
    """The contents of ``predict.json`` and further printed figures."""

    failed: tuple[str, ...] = ()
    folder: str = ""
    sensitivity: tuple[SensitivityRow, ...] = ()


@command
def predict(
    source: Source,
    *changes: Change,
    pressures_kpa: float | Sequence[float] | None = None,
    flow_ml_min: float = PredictionRequest.flow_ml_min,
    volumes_ul: float | Sequence[float] = PredictionRequest.volumes_ul,
    tip_load: float = 0.0,
    measured: Sequence[str] = (),
    serial: str | None = None,
    lab: str | Path = "lab.sqlite",
    quick: bool = False,
    laminate: Laminate | None = None,
    **tables: Any,
) -> Prediction:
    """Predict the behaviour of a design; each figure has a unit, a model and a level of trust.

    Forces and works are at ``pressures_kpa`` (gauge; by default 10 and 100, or -10 and -100 for a
    design that works under vacuum), times at ``flow_ml_min`` into each chamber, strokes with
    ``volumes_ul`` in each balloon. ``quick`` omits the curves and the figures of the elastic stack,
    which take seconds; ``laminate`` is the design's, if already built. ``tip_load`` is the mass in
    g on the free tip. Values ``measured`` on an actuator, such as "stroke@10kPa=16.6mm", narrow the
    prediction to that actuator, as do the force and height of a ``serial`` in the records of a
    ``lab``. ``tables`` override tables of the design, such as ``models={"calibration": "none"}``.
    Figures of calibrated models have a 90 % ``interval``. Raises DesignError if a request is
    outside every model's range. Models: the paper's Eqs. 1-4 (Sec. 3), and elastic balloons of
    axisymmetric film in equilibrium.
    """
    design = load(source, *changes, **tables)
    usual = usual_pressures(design.form)
    request = PredictionRequest(
        usual if pressures_kpa is None else numbers("pressures_kpa", pressures_kpa),
        flow_ml_min,
        numbers("volumes_ul", volumes_ul),
        tip_load=tip_load,
        measured=tuple(
            map(read_measured, [*measured, *(_recorded(serial, lab) if serial else ())])
        ),
    )
    return predict_design(design, request, laminate, quick)


def _recorded(serial: str, lab: str | Path) -> list[str]:
    """Return the lab's records of an actuator, as ``measured`` of ``predict``: its blocked force,
    flat at 100 kPa, and its folded height.

    A recorded stroke has no pressure. Raises DesignError if there is neither.
    """
    texts = {"force_n": "force@0mm@100kPa={:g}N", "height_mm": "height={:g}mm"}
    records, _, builds = Lab(Path(lab)).contents()
    of_serial = [each for each in items(records, builds) if each.records[0].serial == serial]
    found = [
        text.format(each.numbers[name])
        for each in of_serial
        for name, text in texts.items()
        if name in each.numbers
    ]
    if not found:
        raise DesignError(
            f"{lab} has neither force nor height of {serial}; record one, such as sbafab record "
            f"DESIGN --serial {serial} --force 4.8"
        )
    return found


@command
def predict_assembly(
    source: str | Path | Assembly | Assembled,
    *changes: Change,
    pressure_kpa: float = 10.0,
    load_g: float = 1.2,
    pause: Callable[[], None] | None = None,
    **tables: Any,
) -> AssemblyPrediction:
    """Predict the inflated parts of an assembly: reach, load, grip, and contacts.

    All actuators are at ``pressure_kpa``, and ``load_g`` is the mass in g carried by their tips, by
    default the paper's marble (Sec. 5). ``pause`` is called between parts of the work, which takes
    seconds; an exception in it stops the work. Raises DesignError for pressures beyond the models'
    range.
    """
    assembled = source if isinstance(source, Assembled) else assemble(source, *changes, **tables)
    return predict_assembled(assembled, pressure_kpa, load_g, pause or (lambda: None))


def grip(assembled: Assembled, part: str) -> tuple[Grip, Surface] | None:
    """Return the grip of a radial part of an assembly and its inflated balloons; None for others.

    The surface is in mm in the part's frame, as high as the lumen allows, or free: lenses of two
    arcs of inextensible film (as for the paper's Sec. 5). Raises DesignError if the assembly does
    not have the part.
    """
    names = [placed.name for placed in assembled.parts]
    if part not in names:
        raise DesignError(f"there is no part {part!r}; use {', '.join(names)}")
    placed = assembled[part]
    outcome = grip_of(assembled, placed) if isinstance(placed, PlacedSba) else None
    if outcome is None or not isinstance(placed, PlacedSba):
        return None
    free = (outcome.free - outcome.deflated) / 2 / placed.made.laminate.balloons
    return outcome, gripping(placed, outcome.deflated, outcome.room or free)


@command
def stack(
    source: Source,
    *changes: Change,
    most_pressure: float = MOST_PRESSURE,
    **tables: Any,
) -> Stack:
    """Return the actuator as plates joined by balloons; ``stack.pose((5, 5, 0))`` is in real time.

    ``most_pressure`` in kPa is the highest pressure of any pose: use ``most_pressure=300`` for
    ``stack.pose((300, 300, 300))``; ``tables`` override tables of the design. Balloons lengthen and
    tilt but do not carry shear (paper, Sec. 4.4). Raises DesignError for pockets that are not
    round.
    """
    design = load(source, *changes, **tables)
    return stack_of(design, most_pressure=most_pressure, factors=factors_of(design))


def motion(
    stack: Stack,
    length: float = 150.0,
    diameter: float = 0.635,
    *,
    fluid: str = "air",
    dead_volume: float = 0.0,
    delay: float = 0.0,
    pressures: Sequence[float] | None = None,
    **load: Any,
) -> Motion:
    """A stack that is fed through tubes, over time.

    Call ``motion.step(dt, pressures=...)`` with pressures (kPa) at the valves, or
    ``motion.step(dt, flows=...)`` with flows (ul/s) of the pumps.

    ``length`` and inner ``diameter`` of each chamber's tube are mm (the default is the paper's
    tube, Sec. 2); ``fluid`` is air or water; ``dead_volume`` are ul between pump and tube (syringe,
    valve, fittings), ``delay`` s until they act; ``pressures`` (kPa, by default 0) are the initial
    ones; ``load`` holds the arguments of ``stack.pose`` other than pressures. Flow is laminar
    (Poiseuille) or turbulent (Blasius), air isothermal. Raises DesignError.
    """
    if fluid not in FLUIDS:
        raise DesignError(f'fluid = "{fluid}" must be one of {", ".join(sorted(FLUIDS))}')
    line = Line(FLUIDS[fluid], length, diameter, dead_volume, delay)
    return stack.motion(pressures, line, **load)
