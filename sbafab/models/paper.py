"""Measurements of the paper, and the counterparts of predicted figures that are off by more than a
quarter of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab.laminate.films import PAPER_BURST

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
# One table for all who show such figures: predictions, searches, sweeps, pictures, pages and the
# studio. A row holds for every design whose figure comes from the row's model: the others were not
# measured, and a model that is off on the paper's actuators is not better on theirs.


MISFIT = 0.25
"""Relative error up to which a figure may stand without its measured counterpart."""
STACK, BALLOON = "elastic stack", "elastic balloon"
EQ_4, EQS_1_TO_3 = "virtual work on Eq. 4", "virtual work on Eqs. 1-3"
FACTORS = re.compile(r"(, (press factor|pocket loss|E =)| x (press|contact) factor) ")
"""Marks of a calibration in the name of a model."""
FLAT_HEIGHT_OF_FILMS = "sum of the films"
FOLDED_HEIGHT = "folded height"
LOST_WORK = "input work lost in a cycle"
"""Name of a figure, as FOLDED_HEIGHT is."""
ONE_DOF, THREE_DOF = "1-DoF", "3-DoF"


@dataclass(frozen=True)
class Counterpart:
    """A measured value, and the model's value for the actuator on which it was measured.

    ``figure`` is a regular expression of the names of the figures that it stands beside, ``model``
    the beginning of their models' names; ``state`` is the quantity or state that was ``measured``.
    ``parallel``: it holds for actuators that bend (True), for the others (False), or for all
    (None). ``template`` and ``recorded`` name the design and the figure from which ``gave`` was
    taken, in the unit of ``measured``; ``at`` is the state in which the model gave it, if that is
    not the one of the measurement. ``calibrated`` is the value with the calibration "paper" in
    the unit of ``measured``, None where that is near or changes nothing. A row may be far off with
    that calibration alone. One ``of_papers`` stands beside figures of the paper's own 3-DoF alone.
    """

    figure: str
    model: str
    measured: Measured
    state: str
    actuator: str
    gave: float
    at: str
    template: str
    recorded: str
    parallel: bool | None = None
    calibrated: float | None = None
    of_papers: bool = False

    @property
    def ratio(self) -> float:
        """The model's value over the measured one."""
        return self.gave / self.measured.value

    def sentence(self, is_calibrated: bool = False) -> str:
        """Return the clause that stands in parentheses beside a figure."""
        by = "this model without factors" if is_calibrated else "this model"
        at = f" {self.at}" if self.at else ""
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

    def as_dict(self, is_calibrated: bool = False) -> dict[str, Any]:
        """Return the row for programs, its sentence first."""
        return {
            "sentence": self.sentence(is_calibrated),
            "value": self.measured.value,
            "error": self.measured.error,
            "unit": self.measured.unit,
            "actuator": self.actuator,
            "source": self.measured.where,
            "model_gave": self.gave,
        }


def _forces() -> Iterator[Counterpart]:
    """Yield straight forces at 100 kPa (Sec. 4.3) that a model misses by more than MISFIT."""
    calibrated = {(ONE_DOF, STACK): (None, 1.394, 0.9436)}
    gave = {
        (ONE_DOF, STACK): (1.888, 1.709, 1.355),
        (ONE_DOF, EQ_4): (None, None, 0.8422),
        (ONE_DOF, EQS_1_TO_3): (0.9817, None, 0.8631),
        (THREE_DOF, STACK): (None, 5.129, 4.069),
        (THREE_DOF, EQS_1_TO_3): (2.945, 2.905, None),
    }
    measured_at = {ONE_DOF: FORCE_1DOF, THREE_DOF: FORCE_3DOF}
    for (actuator, model), values in gave.items():
        fitted = calibrated.get((actuator, model), (None, None, None))
        rows = zip(HEIGHTS, measured_at[actuator], values, fitted, strict=True)
        for share, measured, value, calibrated_value in rows:
            if value is None:
                continue
            at = f"at {100 * share:g} % of the reference stroke" if share else "flat"
            yield Counterpart(
                rf"blocked force( of one SBA)? at \S+ kPa, {at}",
                model,
                measured,
                f"at 100 kPa, {at},",
                actuator,
                value,
                "",
                "1dof-5mm" if actuator == ONE_DOF else "3dof-15mm",
                f"blocked force at 100 kPa, {at}",
                actuator == THREE_DOF,
                calibrated_value,
            )


def _bent_forces() -> Iterator[Counterpart]:
    """Yield bent forces at 100 kPa (Sec. 4.3); the paper does not name the chambers."""
    gave = {30: (1.667, None), 60: (1.434, 2.829), 90: (1.194, 2.341)}
    calibrated = {30: (1.345, None), 60: (1.054, 1.982), 90: (0.7642, 0.7656)}
    for angle, measured in FORCE_BENT:
        rows = zip(("one chamber", "2 chambers"), gave[angle], calibrated[angle], strict=True)
        for chambers, value, calibrated_value in rows:
            if value is None:
                continue
            yield Counterpart(
                rf"force at \S+ kPa in {chambers}, bent by {angle} deg",
                STACK,
                measured,
                f"at 100 kPa, bent by {angle} deg,",
                THREE_DOF,
                value,
                f"with {chambers}",
                "3dof-15mm",
                f"force at 100 kPa in {chambers}, bent by {angle} deg",
                True,
                calibrated_value,
            )


def _further_counterparts() -> Iterator[Counterpart]:
    """Yield heights, bends, energy, time and stiffness (Sec. 4.1, 4.4 to 4.6)."""
    three, bend, full = "3dof-15mm", "of bend at most", "of full height"
    yield Counterpart(
        FOLDED_HEIGHT, FLAT_HEIGHT_OF_FILMS, FLAT_HEIGHT, "of deflated height",
        THREE_DOF, 1.865, "", three, FOLDED_HEIGHT, of_papers=True,
    )  # fmt: skip
    yield Counterpart(
        r"free (stroke|height) at \S+ kPa", BALLOON, FULL_HEIGHT, full,
        THREE_DOF, 24.55, "at 10 kPa", three, "free height at 10 kPa",
    )  # fmt: skip
    yield Counterpart(
        "stroke at the largest volume", "Eqs. 1-3", FULL_HEIGHT, full,
        THREE_DOF, 39.82, "", three, "stroke at the largest volume",
    )  # fmt: skip
    flat = "bend with one chamber at the reference stroke, the others flat"
    yield Counterpart(
        "bend with .* at the reference stroke, the others flat|maximum lateral tip displacement",
        "constant curvature", LARGEST_BEND, bend, THREE_DOF, 140.5, "", three, flat, True,
        148.7,
    )  # fmt: skip
    for some, chambers, kpa, value in (
        ("one chamber", "one chamber", 10, 128.3),
        (r"\d+ chambers", "2 chambers", 100, 105.5),
    ):
        yield Counterpart(
            rf"(bend|lateral tip displacement) at \S+ kPa in {some}, the others empty", STACK,
            LARGEST_BEND, bend, THREE_DOF, value, f"at {kpa} kPa in {chambers}", three,
            f"bend at {kpa} kPa in {chambers}, the others empty", True,
        )  # fmt: skip
    large, air = "1-DoF of d = 10", "to 10 kPa with air"
    for figure, model, value, calibrated_value in (
        ("pneumatic input work at {} kPa, free", BALLOON, 1.770, 1.588),
        ("pneumatic input work at {} kPa", "p v with Eq. 4", 5.820, None),
    ):
        yield Counterpart(
            figure.format(r"\S+"), model, WORK, "at 10 kPa", large, value, "", "1dof-10mm",
            figure.format(10), None, calibrated_value,
        )  # fmt: skip
    yield Counterpart(
        "power density, .*", "F v / m", AIR_TIME, air, THREE_DOF,
        0.01439, "", three, TIME_WITH_AIR,
    )  # fmt: skip
    yield Counterpart(
        r"time to the reference stroke at \d{4,}\S* ml/min", "", AIR_TIME,
        air, THREE_DOF, 0.01439, "", three, TIME_WITH_AIR,
    )  # fmt: skip
    yield Counterpart(
        r"blocked force at \S+ kPa, flat, at most", "pressure x pocket area",
        FORCE_1DOF[0], "at 100 kPa, flat,", ONE_DOF, 1.963, "", "1dof-5mm",
        POCKET_AREA, False,
    )  # fmt: skip
    for actuator, measured, value, calibrated_value, template, parallel in (
        (ONE_DOF, MODULUS_1DOF, 6.431, 5.248, "1dof-5mm", False),
        (THREE_DOF, MODULUS_3DOF, 13.06, 13.3, three, True),
    ):
        yield Counterpart(
            r"lateral tip stiffness at \S+ kPa, .*", STACK, measured, "of modulus in bending",
            actuator, value, "at 10 kPa, chambers shut", template, MODULUS, parallel,
            calibrated_value,
        )  # fmt: skip


TIME_WITH_AIR = "time to 10 kPa with air"
POCKET_AREA = "pressure x pocket area, flat"
MODULUS = "cantilever modulus"
"""Values that ``docs/validation.md`` computes from a prediction's figures."""
COUNTERPARTS = (*_forces(), *_bent_forces(), *_further_counterparts())
"""All figures of predictions that validation shows to be off by more than MISFIT."""


@lru_cache(maxsize=4096)
def _counterpart(name: str, model: str, is_parallel: bool) -> Counterpart | None:
    for row in COUNTERPARTS:
        if row.parallel is not None and row.parallel != is_parallel:
            continue
        if model.startswith(row.model) and re.fullmatch(row.figure, name):
            return row
    return None


def counterpart(
    form: Form, name: str, model: str, calibration: str = "", of_papers: bool = False
) -> Counterpart | None:
    """Return the measured counterpart of a figure of this ``name`` by this ``model``, for a design
    of this ``form``, which may be the paper's own 3-DoF (``of_papers``); None where the model is
    not known to be off by more than MISFIT.

    With a ``calibration`` (its name) it has the calibrated value. A folded height by a measured
    press factor has none.
    """
    if model.startswith(FLAT_HEIGHT_OF_FILMS) and FACTORS.search(model):
        return None
    row = _counterpart(name, model, form.is_parallel)
    if row is None or (row.of_papers and not of_papers):
        return None
    return _calibrated(row, calibration)


def _calibrated(row: Counterpart, calibration: str) -> Counterpart | None:
    """Return a row with the value of a calibration (its name, "" for none); None where that is not
    known to be off.
    """
    if not calibration:
        return row if abs(row.ratio - 1) > MISFIT else None
    if calibration == CALIBRATION and row.calibrated is not None:
        return replace(row, gave=row.calibrated)
    # A calibration changes these models; its intervals say how far they may be off.
    return None if row.model in (STACK, BALLOON, FLAT_HEIGHT_OF_FILMS) else row


CALIBRATION = "paper"
"""The calibration of ``Counterpart.calibrated``."""


def counterparts_of_pose(chambers: int, calibration: str = "") -> dict[str, Counterpart]:
    """Return the counterparts of a pose of the elastic stack by quantity: "height", and for several
    chambers "bend"; none where the stack has a ``calibration``, with which both are near.
    """
    if calibration:
        return {}
    sought = {"height": ("free height at 10 kPa", BALLOON)}
    if chambers > 1:
        sought["bend"] = ("bend at 10 kPa in one chamber, the others empty", STACK)
    rows = {quantity: _counterpart(*names, chambers > 1) for quantity, names in sought.items()}
    return {quantity: row for quantity, row in rows.items() if row is not None}


def counterpart_of_column(form: Form, column: str, calibration: str = "") -> Counterpart | None:
    """Return the counterpart of a column of a sweep: "name [unit]" or "name, model [unit]"."""
    figure = column.partition(" [")[0]
    name, _, model = figure.rpartition(", ")
    for row in COUNTERPARTS:
        if (
            not row.of_papers
            and row.parallel in (None, form.is_parallel)
            and (
                re.fullmatch(row.figure, figure)
                or (model.startswith(row.model) and re.fullmatch(row.figure, name))
            )
        ):
            return _calibrated(row, calibration)
    return None


def is_calibrated(model: str) -> bool:
    """Return True for the name of a model that took a factor measured by the user."""
    return FACTORS.search(model) is not None
