"""Measurements of the paper, and the counterparts of predicted figures that deviate from them by
more than a quarter.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sbafab.documents import Document, PlainNumber, attribute
from sbafab.laminate.films import PAPER_BURST
from sbafab.models.quantity import OF_STACK, Conditions, ModelId, Quantity

if TYPE_CHECKING:
    from sbafab.design.records import Form


class Measured(NamedTuple):
    """A value +- its error (0 if none is given), its unit, and its section."""

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
FORCE_1DOF = tuple(
    Measured(value, error, "N", "Sec. 4.3")
    for value, error in ((1.48, 0.04), (1.01, 0.01), (0.64, 0.01))
)
FORCE_3DOF = tuple(
    Measured(value, error, "N", "Sec. 4.3")
    for value, error in ((4.87, 0.02), (4.07, 0.07), (2.40, 0.03))
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
MODULUS_1DOF = Measured(35, 0, "kPa", "Sec. 4.4")
MODULUS_3DOF = Measured(60, 0, "kPa", "Sec. 4.4")
BURST = Measured(*PAPER_BURST, "kPa", "Sec. 4")
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

EQ_4_RATIOS = (0.75992, 1.240135)
"""Least and largest of the six forces over virtual work on Eq. 4."""


# Measured counterparts of figures that are off by more than a quarter of them, for predictions,
# searches, sweeps, pictures, pages and the studio. A row applies to every design whose figure comes
# from the row's model: other designs were not measured, and a model that is off for the paper's
# actuators is not better for them.


MISFIT = 0.25
"""Relative error up to which a figure may stand without its measured counterpart."""
CALIBRATED_MODELS = (*OF_STACK, ModelId.ELASTIC_BALLOON, ModelId.FILMS)
"""Models that a calibration changes; its intervals say how far they may be off."""


@dataclass(frozen=True)
class Counterpart:
    """A measured value, and the model's value for the actuator on which it was measured: a row of
    ``paper_counterparts.csv``.

    It accompanies figures of its ``quantities`` by its ``models`` (none: by any), at conditions
    that match ``at`` and are at least ``at_least``; ``state`` is the quantity or state that was
    ``measured``. ``parallel``: it applies to actuators that bend (True), to others (False), or to
    all (None). ``source`` names the template and the figure that was ``gave``, or the value that
    ``docs/validation.md`` computes from its figures, in the unit of ``measured``; ``where`` is the
    state of the model if it differs from the measurement's. ``calibrated`` is the value with the
    calibration "paper" in the unit of ``measured``, None if it is close or unchanged. A row may
    deviate with that calibration only. A row ``of_papers`` accompanies only figures of the paper's
    3-DoF.
    """

    quantities: tuple[Quantity, ...]
    models: tuple[ModelId, ...]
    measured: Measured
    state: str
    actuator: str
    gave: float
    where: str
    source: str
    parallel: bool | None
    calibrated: float | None
    of_papers: bool
    at: Conditions
    at_least: Conditions

    def stands_beside(
        self, quantity: Quantity, at: Conditions, model: ModelId, is_parallel: bool
    ) -> bool:
        """Return True for a figure of this quantity by this model."""
        return (
            quantity in self.quantities
            and (not self.models or model in self.models)
            and self.parallel in (None, is_parallel)
            and at.meet(self.at)
            and all(
                (getattr(at, name) or 0) >= least for name, least in self.at_least.as_dict().items()
            )
        )

    @property
    def ratio(self) -> float:
        """The model's value over the measured one."""
        return self.gave / self.measured.value

    @property
    def sentence(self) -> str:
        """The clause in parentheses beside a figure."""
        at = f" {self.where}" if self.where else ""
        return (
            f"the paper measured {self.measured} {self.state} on its {self.actuator}; "
            f"this model gives it {self.gave:.4g}{at}"
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


class CounterpartEntry(Document):
    """The paper's measurement, if the model deviates from it by more than a quarter."""

    sentence: str
    value: PlainNumber = attribute("measured.value")
    error: PlainNumber = attribute("measured.error")
    """0 where the paper gives none"""
    unit: str = attribute("measured.unit")
    actuator: str
    source: str = attribute("measured.where")
    model_gave: PlainNumber = attribute("gave")
    """the same model for that actuator, in the unit"""


@cache
def counterparts() -> tuple[Counterpart, ...]:
    """Return all figures of predictions that validation shows to deviate by more than MISFIT."""
    path = Path(__file__).with_name("paper_counterparts.csv")
    with path.open(encoding="utf-8", newline="") as opened:
        return tuple(_row(cells) for cells in csv.DictReader(opened))


def _row(cells: dict[str, str]) -> Counterpart:
    error = float(cells["error"] or 0)
    return Counterpart(
        tuple(map(Quantity.of, cells["quantities"].split())),
        tuple(map(ModelId, cells["models"].split())),
        Measured(float(cells["value"]), error, cells["unit"], cells["section"]),
        cells["state"],
        cells["actuator"],
        float(cells["gave"]),
        cells["where"],
        cells["source"],
        {"yes": True, "no": False}.get(cells["parallel"]),
        float(cells["calibrated"]) if cells["calibrated"] else None,
        cells["of_papers"] == "yes",
        Conditions.read(cells["at"]),
        Conditions.read(cells["at_least"]),
    )


def counterpart(
    form: Form,
    quantity: Quantity,
    at: Conditions,
    model: ModelId,
    calibration: str = "",
    of_papers: bool = False,
) -> Counterpart | None:
    """Return the measured counterpart of a figure of this quantity by this model, for a design of
    this ``form``, which may be the paper's 3-DoF (``of_papers``); None if no deviation above MISFIT
    is known.

    With a ``calibration`` (its name) it has the calibrated value.
    """
    row = _counterpart(quantity, at, model, form.is_parallel)
    if row is None or (row.of_papers and not of_papers):
        return None
    if not calibration:
        return row if abs(row.ratio - 1) > MISFIT else None
    if calibration == "paper" and row.calibrated is not None:
        return replace(row, gave=row.calibrated)
    # A calibration changes these models, and its intervals give their possible error.
    return None if set(row.models) & set(CALIBRATED_MODELS) else row


def _counterpart(
    quantity: Quantity, at: Conditions, model: ModelId, is_parallel: bool
) -> Counterpart | None:
    beside = (row for row in counterparts() if row.stands_beside(quantity, at, model, is_parallel))
    return next(beside, None)


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
