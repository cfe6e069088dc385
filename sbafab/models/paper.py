"""Measurements of the paper, and the counterparts of predicted figures that are off by more than a
quarter of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

from sbafab.documents import Document, PlainNumber, attribute
from sbafab.laminate.films import PAPER_BURST
from sbafab.models.quantity import (
    ANYWHERE,
    OF_STACK,
    Conditions,
    ModelId,
    Quantity,
    chamber_count,
    share_of_stroke,
)

if TYPE_CHECKING:
    from sbafab.design.records import Form


class Measured(NamedTuple):
    """A value +- its error (0 where none is given), its unit, and its section."""

    value: float
    error: float
    unit: str
    where: str

    def __str__(self) -> str:
        shown = f"{self.value:g} +- {self.error:g}" if self.error else f"{self.value:g}"
        return f"{shown} {self.unit}"


HEIGHTS = (0.0, 0.25, 0.75)
"""Shares of the largest height at which forces were measured."""
FORCE_KPA = 100.0
FORCE_1DOF = (
    Measured(1.48, 0.04, "N", "Sec. 4.3"),
    Measured(1.01, 0.01, "N", "Sec. 4.3"),
    Measured(0.64, 0.01, "N", "Sec. 4.3"),
)
FORCE_3DOF = (
    Measured(4.87, 0.02, "N", "Sec. 4.3"),
    Measured(4.07, 0.07, "N", "Sec. 4.3"),
    Measured(2.40, 0.03, "N", "Sec. 4.3"),
)
FORCE_BENT = (
    (30, Measured(3.22, 0.12, "N", "Sec. 4.3")),
    (60, Measured(1.41, 0.05, "N", "Sec. 4.3")),
    (90, Measured(0.55, 0.02, "N", "Sec. 4.3")),
)
BENDING = (
    (0.56, Measured(30.3, 1.3, "deg", "Sec. 4.6")),
    (0.78, Measured(58.5, 1.2, "deg", "Sec. 4.6")),
    (0.91, Measured(89.7, 2.0, "deg", "Sec. 4.6")),
)
"""Seconds at 35 ml/min, and the angle reached."""
LARGEST_BEND = Measured(81, 6, "deg", "Sec. 4.6")
FULL_HEIGHT = Measured(17.5, 0, "mm", "Sec. 4.6")
FLAT_HEIGHT = Measured(0.95, 0, "mm", "Sec. 4.6")
LONGEST_STROKE = Measured(20, 0, "mm", "Sec. 4.2")
"""Stroke of 15 balloons of d = 5 in the geometric regime: "almost 2 cm"."""
BALLOONS = 15
"""Balloons in a stack of the 3-DoF actuator that was measured."""
WATER_FLOW = 35.0
"""ml/min (Sec. 7)."""
AIR_FLOW = 2500.0
"""ml/min (Sec. 7)."""
FULL_KPA = 10.0
"""Pressure that counts as full actuation (Sec. 4.5)."""
WATER_TIME = Measured(0.92, 0.08, "s", "Sec. 4.5")
AIR_TIME = Measured(0.067, 0.011, "s", "Sec. 4.5")
MODULUS_1DOF = Measured(35, 0, "kPa", "Sec. 4.4")
MODULUS_3DOF = Measured(60, 0, "kPa", "Sec. 4.4")
SUCCESS = Measured(0.9, 0, "", "Sec. 6")
"""Share of the actuators built that held."""
WORK = Measured(45.3, 0, "mJ", "Sec. 4.1")
"""Pneumatic input work at 10 kPa, 6 balloons of d = 10."""
BURST = Measured(*PAPER_BURST, "kPa", "Sec. 4")
FOLDED = Measured(9.25, 0, "mm", "Sec. 2")
RADIAL_FLAT = Measured(15.33, 0, "mm", "Sec. 2.1")
RADIAL_FULL = Measured(28, 0, "mm", "Sec. 2.1")
VALID = (
    ("air", 45.0, Measured(0.13, 0, "mm", "Sec. 4.2")),
    ("water", 86.0, Measured(0.12, 0, "mm", "Sec. 4.2")),
)
"""ul a balloon up to which Eq. 4 held for d = 10, and its largest error there."""
VALID_RADIUS = 5.0
"""Pocket radius to which VALID belongs."""

FULL_SHARE = FULL_HEIGHT.value / BALLOONS / 2.5
"""Stroke of a full balloon over its pocket's radius: 17.5 mm of 15 balloons of radius 2.5."""


# Measured counterparts of figures that are off by more than a quarter of them.
#
# One table for all users of such figures: predictions, searches, sweeps, pictures, pages and the
# studio. A row applies to every design whose figure comes from the row's model: other designs were
# not measured, and a model that is off for the paper's actuators is not better for them.


MISFIT = 0.25
"""Relative error up to which a figure may stand without its measured counterpart."""
BALLOON, FILMS = (ModelId.ELASTIC_BALLOON,), (ModelId.FILMS,)
CALIBRATED_MODELS = (*OF_STACK, *BALLOON, *FILMS)
"""Models that a calibration changes; its intervals say how far they may be off."""
ONE_DOF, THREE_DOF = "1-DoF", "3-DoF"
DerivedValue = Literal["time-with-air", "pocket-area", "cantilever-modulus"]
"""Values that ``docs/validation.md`` computes from a prediction's figures."""


@dataclass(frozen=True)
class Counterpart:
    """A measured value, and the model's value for the actuator on which it was measured.

    It stands beside figures of its ``quantities`` by its ``models`` (none: by any), at conditions
    that meet ``at`` and that it ``fits``; ``state`` is the quantity or state that was ``measured``.
    ``parallel``: it holds for actuators that bend (True), for the others (False), or for all
    (None). ``template`` and ``recorded`` name the design and the figure from which ``gave`` was
    taken, in the unit of ``measured``; ``where`` is the state in which the model gave it, if that
    is not the one of the measurement. ``calibrated`` is the value with the calibration "paper" in
    the unit of ``measured``, None if it is close or unchanged. A row may be far off with that
    calibration only. A row ``of_papers`` stands beside figures of the paper's own 3-DoF only.
    """

    quantities: tuple[Quantity, ...]
    models: tuple[ModelId, ...]
    measured: Measured
    state: str
    actuator: str
    gave: float
    where: str
    template: str
    recorded: tuple[Quantity, Conditions] | DerivedValue
    parallel: bool | None = None
    calibrated: float | None = None
    of_papers: bool = False
    at: Conditions = ANYWHERE
    fits: Callable[[Conditions], bool] | None = None

    def stands_beside(
        self, quantity: Quantity, at: Conditions, model: ModelId, is_parallel: bool
    ) -> bool:
        """Return True for a figure of this quantity by this model."""
        return (
            quantity in self.quantities
            and (not self.models or model in self.models)
            and self.parallel in (None, is_parallel)
            and at.meet(self.at)
            and (self.fits is None or self.fits(at))
        )

    @property
    def ratio(self) -> float:
        """The model's value over the measured one."""
        return self.gave / self.measured.value

    def sentence(self, is_calibrated: bool = False) -> str:
        """Return the clause that stands in parentheses beside a figure."""
        by = "this model without factors" if is_calibrated else "this model"
        at = f" {self.where}" if self.where else ""
        return (
            f"the paper measured {self.measured} {self.state} on its {self.actuator}; "
            f"{by} gives it {self.gave:.4g}{at}"
        )

    @property
    def short(self) -> str:
        """The counterpart for a caption or a column."""
        measured = f"{self.measured} {self.state}".rstrip(",")
        return f"the paper's {self.actuator}: {measured}; this model gives it {self.gave:.4g}"

    @property
    def brief(self) -> str:
        """The counterpart in parentheses, for a line of sizes."""
        return f"(paper's {self.actuator} {self.measured.value:g}, not {self.gave:.4g})"

    def entry(self, is_calibrated: bool = False) -> CounterpartEntry:
        """Return the row for programs, its sentence first."""
        return CounterpartEntry.read(self, sentence=self.sentence(is_calibrated))


class CounterpartEntry(Document):
    """What the paper measured, where the model is off by more than a quarter of it."""

    sentence: str
    value: PlainNumber = attribute("measured.value")
    error: PlainNumber = attribute("measured.error")
    """0 where the paper gives none"""
    unit: str = attribute("measured.unit")
    actuator: str
    source: str = attribute("measured.where")
    model_gave: PlainNumber = attribute("gave")
    """the same model for that actuator, in the unit"""


def _forces() -> Iterator[Counterpart]:
    """Yield straight forces at 100 kPa (Sec. 4.3) that a model misses by more than MISFIT."""
    stack = OF_STACK[:1]
    eq_4, eqs_1_to_3 = (ModelId.WORK_ON_EQ_4,), (ModelId.WORK_ON_EQS_1_TO_3,)
    calibrated = {(ONE_DOF, stack): (None, 1.394, 0.9436)}
    gave = {
        (ONE_DOF, stack): (1.888, 1.709, 1.355),
        (ONE_DOF, eq_4): (None, None, 0.8422),
        (ONE_DOF, eqs_1_to_3): (0.9817, None, 0.8631),
        (THREE_DOF, stack): (None, 5.129, 4.069),
        (THREE_DOF, eqs_1_to_3): (2.945, 2.905, None),
    }
    measured_at = {ONE_DOF: FORCE_1DOF, THREE_DOF: FORCE_3DOF}
    for (actuator, models), values in gave.items():
        fitted = calibrated.get((actuator, models), (None, None, None))
        rows = zip(HEIGHTS, measured_at[actuator], values, fitted, strict=True)
        for share, measured, value, calibrated_value in rows:
            if value is None:
                continue
            yield Counterpart(
                (Quantity.BLOCKED_FORCE,),
                models,
                measured,
                f"at 100 kPa, {share_of_stroke(share)},",
                actuator,
                value,
                "",
                "1dof-5mm" if actuator == ONE_DOF else "3dof-15mm",
                (Quantity.BLOCKED_FORCE, Conditions(kpa=FORCE_KPA, share=share)),
                actuator == THREE_DOF,
                calibrated_value,
                at=Conditions(share=share),
            )


def _bent_forces() -> Iterator[Counterpart]:
    """Yield bent forces at 100 kPa (Sec. 4.3); the paper does not name the chambers."""
    gave = {30: (1.667, None), 60: (1.434, 2.829), 90: (1.194, 2.341)}
    calibrated = {30: (1.345, None), 60: (1.054, 1.982), 90: (0.7642, 0.7656)}
    for angle, measured in FORCE_BENT:
        rows = zip((1, 2), gave[angle], calibrated[angle], strict=True)
        for chambers, value, calibrated_value in rows:
            if value is None:
                continue
            at = Conditions(chambers=chambers, angle=angle)
            yield Counterpart(
                (Quantity.BENT_FORCE,),
                OF_STACK,
                measured,
                f"at 100 kPa, bent by {angle} deg,",
                THREE_DOF,
                value,
                f"with {chamber_count(chambers)}",
                "3dof-15mm",
                (Quantity.BENT_FORCE, at._replace(kpa=FORCE_KPA)),
                True,
                calibrated_value,
                at=at,
            )


def _has_several(at: Conditions) -> bool:
    return at.chambers is not None and at.chambers > 1


def _is_of_air(at: Conditions) -> bool:
    """Return True for a flow in ml/min that only air has."""
    return at.flow is not None and at.flow >= 1000


def _further_counterparts() -> Iterator[Counterpart]:
    """Yield heights, bends, energy, time and stiffness (Sec. 4.1, 4.4 to 4.6)."""
    three, bend, full = "3dof-15mm", "of bend at most", "of full height"
    yield Counterpart(
        (Quantity.FOLDED_HEIGHT,), FILMS, FLAT_HEIGHT, "of deflated height",
        THREE_DOF, 1.865, "", three, (Quantity.FOLDED_HEIGHT, ANYWHERE), of_papers=True,
    )  # fmt: skip
    yield Counterpart(
        (Quantity.FREE_STROKE, Quantity.FREE_HEIGHT), BALLOON, FULL_HEIGHT, full,
        THREE_DOF, 24.55, "at 10 kPa", three, (Quantity.FREE_HEIGHT, Conditions(kpa=FULL_KPA)),
    )  # fmt: skip
    yield Counterpart(
        (Quantity.LARGEST_STROKE,), (ModelId.EQS_1_TO_3,), FULL_HEIGHT, full,
        THREE_DOF, 39.82, "", three, (Quantity.LARGEST_STROKE, ANYWHERE),
    )  # fmt: skip
    yield Counterpart(
        (Quantity.REFERENCE_BEND, Quantity.LARGEST_ASIDE), (ModelId.CONSTANT_CURVATURE,),
        LARGEST_BEND, bend, THREE_DOF, 140.5, "", three,
        (Quantity.REFERENCE_BEND, Conditions(chambers=1)), True, 148.7,
    )  # fmt: skip
    for chambers, kpa, value in ((1, FULL_KPA, 128.3), (2, FORCE_KPA, 105.5)):
        yield Counterpart(
            (Quantity.BEND, Quantity.ASIDE), OF_STACK, LARGEST_BEND, bend, THREE_DOF, value,
            f"at {kpa:g} kPa in {chamber_count(chambers)}", three,
            (Quantity.BEND, Conditions(kpa=kpa, chambers=chambers)), True,
            at=Conditions(chambers=1) if chambers == 1 else ANYWHERE,
            fits=None if chambers == 1 else _has_several,
        )  # fmt: skip
    large, air = "1-DoF of d = 10", "to 10 kPa with air"
    for quantity, models, value, calibrated_value in (
        (Quantity.FREE_WORK, BALLOON, 1.770, 1.588),
        (Quantity.WORK_BOUND, (ModelId.P_V_EQ_4,), 5.820, None),
    ):
        yield Counterpart(
            (quantity,), models, WORK, "at 10 kPa", large, value, "", "1dof-10mm",
            (quantity, Conditions(kpa=FULL_KPA)), None, calibrated_value,
        )  # fmt: skip
    yield Counterpart(
        (Quantity.POWER_DENSITY,), (ModelId.POWER,), AIR_TIME, air, THREE_DOF,
        0.01439, "", three, "time-with-air",
    )  # fmt: skip
    yield Counterpart(
        (Quantity.REFERENCE_TIME,), (), AIR_TIME,
        air, THREE_DOF, 0.01439, "", three, "time-with-air", fits=_is_of_air,
    )  # fmt: skip
    yield Counterpart(
        (Quantity.FORCE_BOUND,), (ModelId.FLAT_PLATES,),
        FORCE_1DOF[0], "at 100 kPa, flat,", ONE_DOF, 1.963, "", "1dof-5mm",
        "pocket-area", False,
    )  # fmt: skip
    for actuator, measured, value, calibrated_value, template, parallel in (
        (ONE_DOF, MODULUS_1DOF, 6.431, 5.248, "1dof-5mm", False),
        (THREE_DOF, MODULUS_3DOF, 13.06, 13.3, three, True),
    ):
        yield Counterpart(
            (Quantity.HELD_STIFFNESS, Quantity.SHUT_STIFFNESS), OF_STACK, measured,
            "of modulus in bending", actuator, value, "at 10 kPa, chambers shut", template,
            "cantilever-modulus", parallel, calibrated_value,
        )  # fmt: skip


COUNTERPARTS = (*_forces(), *_bent_forces(), *_further_counterparts())
"""All figures of predictions that validation shows to be off by more than MISFIT."""
CALIBRATION = "paper"
"""The calibration of ``Counterpart.calibrated``."""


def counterpart(
    form: Form,
    quantity: Quantity,
    at: Conditions,
    model: ModelId,
    calibration: str = "",
    of_papers: bool = False,
) -> Counterpart | None:
    """Return the measured counterpart of a figure of this quantity by this model, for a design
    of this ``form``, which may be the paper's own 3-DoF (``of_papers``); None if the model is
    not known to be off by more than MISFIT.

    With a ``calibration`` (its name) it has the calibrated value.
    """
    row = _counterpart(quantity, at, model, form.is_parallel)
    if row is None or (row.of_papers and not of_papers):
        return None
    return _calibrated(row, calibration)


def _counterpart(
    quantity: Quantity, at: Conditions, model: ModelId, is_parallel: bool
) -> Counterpart | None:
    beside = (row for row in COUNTERPARTS if row.stands_beside(quantity, at, model, is_parallel))
    return next(beside, None)


def _calibrated(row: Counterpart, calibration: str) -> Counterpart | None:
    """Return a row with the value of a calibration (its name, "" for none); None if it is not known
    to be off.
    """
    if not calibration:
        return row if abs(row.ratio - 1) > MISFIT else None
    if calibration == CALIBRATION and row.calibrated is not None:
        return replace(row, gave=row.calibrated)
    # A calibration changes these models, and its intervals give their possible error.
    return None if set(row.models) & set(CALIBRATED_MODELS) else row


def counterparts_of_pose(chambers: int, calibration: str = "") -> dict[str, Counterpart]:
    """Return the counterparts of a pose of the elastic stack by quantity: "height", and for several
    chambers "bend"; empty if the stack has a ``calibration``, with which both are close.
    """
    if calibration:
        return {}
    at = Conditions(kpa=FULL_KPA)
    sought = {"height": (Quantity.FREE_HEIGHT, at, ModelId.ELASTIC_BALLOON)}
    if chambers > 1:
        sought["bend"] = (Quantity.BEND, at._replace(chambers=1), ModelId.ELASTIC_STACK)
    rows = {quantity: _counterpart(*figure, chambers > 1) for quantity, figure in sought.items()}
    return {quantity: row for quantity, row in rows.items() if row is not None}
