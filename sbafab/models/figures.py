"""Records of a prediction: figures and curves with their models, its verdict, and the choice of the
design model.
"""

from __future__ import annotations

import csv
import difflib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import AfterValidator, Field, PlainSerializer, WithJsonSchema

from sbafab.documents import Document, PlainNumber, attribute
from sbafab.errors import DesignError
from sbafab.laminate.lay_up import folded_height
from sbafab.markup import data_frame, table_html
from sbafab.models import paper
from sbafab.models.paper import Counterpart, CounterpartEntry
from sbafab.models.quantity import (
    ANYWHERE,
    OF_STACK,
    Conditions,
    FigureKey,
    ModelId,
    Quantity,
)

if TYPE_CHECKING:
    from pandas import DataFrame

    from sbafab.laminate.laminate import Laminate
    from sbafab.laminate.lay_up import FoldedHeight

BY_DISC = "disc of equal area"
"""In the name of a model of discs that is applied to a drawn pocket."""
MEASURED = "measured (paper)"
"""Stands for a model's name."""
Flag = Literal["extrapolation", "near-burst"]
EXTRAPOLATION: Flag = "extrapolation"
NEAR_BURST: Flag = "near-burst"
FLAGS: Mapping[Flag, str] = {
    EXTRAPOLATION: "an extrapolation: nothing like it was measured",
    NEAR_BURST: "above half of the estimated burst pressure",
}
"""Texts of a figure's flags."""


@dataclass(frozen=True)
class Model:
    """Origin of a number: ``source`` is an equation or section, ``trust`` the model's validity.

    ``press_factor`` is that of the films in it, ``calibration`` the name of the model's
    calibration. ``by_disc``: a drawn pocket is replaced by a disc.
    """

    id: ModelId
    source: str
    trust: str
    press_factor: float = 1.0
    calibration: str = ""
    by_disc: bool = False

    @property
    def name(self) -> str:
        """The display name, with calibration or press factor."""
        parts = [self.id.words]
        parts += [f"calibration {self.calibration}"] if self.calibration else []
        parts += [f"press factor {self.press_factor:.3g}"] if self.press_factor != 1 else []
        parts += [BY_DISC] if self.by_disc else []
        return ", ".join(parts)

    @property
    def title(self) -> str:
        """The name and source as one text."""
        return f"{self.name} ({self.source})" if self.source else self.name

    def filled(self, **facts: object) -> Model:
        """Return the model with facts inserted in its source and validity."""
        source, trust = self.source.format(**facts), self.trust.format(**facts)
        return replace(self, source=source, trust=trust)


def _models() -> Iterator[tuple[str, Model]]:
    """Yield models with source and validity, from ``models.csv``."""
    with Path(__file__).with_name("models.csv").open(encoding="utf-8", newline="") as opened:
        for name, source, trust in list(csv.reader(opened))[1:]:
            yield name, Model(ModelId(name.split()[0]), source, trust)


MODELS = dict(_models())
"""Models by id; of several with one id with a word more."""


@dataclass(frozen=True)
class Figure:
    """One predicted number: the ``value`` of a ``quantity``, in its unit, ``at`` its conditions.

    ``other``: shown for comparison; design with the other model's figure of the same quantity.
    ``measured``: the paper's measurement, if the model deviates from it by more than a quarter. The
    value lies ``between`` two of the same unit, if a drawn pocket is replaced by a disc. The
    ``interval``, in the same unit, contains a measurement with a probability of 90 %, if the
    calibration gives one. ``flags`` are warnings about its validity.
    """

    quantity: Quantity
    value: float
    model: Model
    at: Conditions = ANYWHERE
    other: bool = False
    measured: Counterpart | None = None
    between: tuple[float, float] | None = None
    interval: tuple[float, float] | None = None
    flags: tuple[Flag, ...] = ()

    @property
    def name(self) -> str:
        """The display name: quantity and conditions."""
        return self.quantity.named(self.at)

    @property
    def key(self) -> FigureKey:
        """The key that identifies the figure in its prediction."""
        return FigureKey(self.quantity, self.at, self.model.id)

    @property
    def group(self) -> str:
        """The heading of its group."""
        return self.quantity.group

    @property
    def unit(self) -> str:
        """The unit of the value."""
        return self.quantity.unit

    def is_of(self, quantity: Quantity, at: Conditions | None = None) -> bool:
        """Return True for a figure of a quantity, at conditions that match ``at``."""
        return self.quantity is quantity and (at is None or self.at.meet(at))

    @property
    def counterpart(self) -> str:
        """The measured counterpart as a clause; empty without one."""
        return self.measured.sentence if self.measured else ""

    @property
    def range(self) -> str:
        """The 90 % interval without its unit; empty without one."""
        if self.interval is None:
            return ""
        low, high = self.interval
        return f"{low:.3g} to {high:.3g}"

    @property
    def aside(self) -> str:
        """Bounds, flags and measured counterpart in parentheses; empty without any."""
        parts = [FLAGS[flag] for flag in self.flags]
        if self.between is not None:
            low, high = self.between
            parts.append(
                f"between {low:.4g} and {high:.4g} {self.unit} by discs within and round it"
            )
        parts += [self.counterpart] if self.measured else []
        return " ".join(f"({part})" for part in parts)

    @property
    def design_with(self) -> bool:
        """False if another model of the same quantity should be used for design."""
        return not self.other

    def as_dict(self) -> dict[str, Any]:
        """Return the figure as ``predict.json`` holds it."""
        return PredictedFigure.of(self)


@dataclass(frozen=True)
class Trace:
    """A predicted curve or, without a model, one measured by the paper.

    Its points have an ``error`` +- (0 if not given). The labels of the relation contain the unit of
    ``x``, and the unit of ``y`` and its ``error``.
    """

    label: str
    x: Sequence[float]
    y: Sequence[float]
    model: Model | None = None
    error: Sequence[float] = ()

    @property
    def title(self) -> str:
        """The model's title, or a note that the figure is measured."""
        return self.model.title if self.model else MEASURED

    @property
    def trust(self) -> str:
        """The model's validity; empty for measurements."""
        return self.model.trust if self.model else ""


@dataclass(frozen=True)
class Relation:
    """One quantity against another: ``name`` is a file's stem; labels include their units."""

    name: str
    title: str
    x_label: str
    y_label: str
    lines: Sequence[Trace]
    points: Sequence[Trace] = ()

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One flat row per point of each curve, and per measurement: ``x`` and ``y`` in the units
        of ``x_label`` and ``y_label``, ``error`` of y only for measurements.
        """
        return [
            {"curve": of.label, "x": float(x), "y": float(y), "error": error, "model": of.title}
            for of in (*self.lines, *self.points)
            for x, y, error in zip(of.x, of.y, of.error or (None,) * len(of.x), strict=True)
        ]

    def frame(self) -> DataFrame:
        """Return ``rows`` as a pandas DataFrame whose ``attrs`` hold the title and the labels of
        the axes. Raises DesignError without pandas.
        """
        frame = data_frame(self.rows)
        frame.attrs.update(title=self.title, x=self.x_label, y=self.y_label)
        return frame


QuantityKey = Annotated[str, WithJsonSchema({"enum": [quantity.key for quantity in Quantity]})]
QuantityEntry = Annotated[Quantity, PlainSerializer(attrgetter("key"), return_type=QuantityKey)]


@dataclass(frozen=True)
class LeftOut:
    """An omitted figure and the reason.

    ``quantities`` are the affected ones, if specific; ``error`` is the one that was raised, if any.
    """

    name: str
    reason: str
    quantities: tuple[QuantityEntry, ...] = ()
    error: Annotated[Any, Field(exclude=True)] = field(default=None, repr=False, compare=False)
    group: ClassVar = ""

    @classmethod
    def of(cls, name: str, error: DesignError, *quantities: Quantity) -> LeftOut:
        """Return the omission caused by an error."""
        return cls(name, str(error), quantities, error)


FigureItem = Figure | LeftOut


@dataclass(frozen=True)
class Factors:
    """What a calibration says of an actuator; the defaults leave models unchanged.

    ``press_factor`` is the ratio of thickness after and before the press for films that melt in it,
    for the product ``press_film`` (for all melting films if empty). The elastic balloon uses
    ``pocket_loss``, the loss of pocket radius in the press in mm, and ``modulus_ratio``, the ratio
    of the pressed film's modulus to the design's. ``water_delay`` and ``air_delay`` in s are the
    lag of pump and valve, ``loss_share`` the share of the input work lost in inflating and
    deflating; 0 means unknown. ``tip_load`` in g is what stands on the free tip.
    """

    press_factor: float = 1.0
    pocket_loss: float = 0.0
    modulus_ratio: float = 1.0
    water_delay: float = 0.0
    air_delay: float = 0.0
    loss_share: float = 0.0
    tip_load: float = 0.0
    press_film: str = ""
    calibration: str = ""
    """Name of the calibration that the others come from."""

    def __post_init__(self) -> None:
        if not 0 <= self.tip_load <= 1000:
            raise DesignError(f"tip load = {self.tip_load:g} g must be from 0 to 1000 g")

    def folded(self, laminate: Laminate) -> FoldedHeight:
        """Return the folded height of a laminate with these factors."""
        return folded_height(laminate, self.press_factor, self.press_film)


USUAL_PRESSURES = (10.0, 100.0)
"""Default pressures of predictions, kPa."""


class MeasuredValue(NamedTuple):
    """A value measured on one actuator, in the unit of its quantity, and its input ``text``."""

    text: str
    quantity: Quantity
    at: Conditions
    value: float


@dataclass(frozen=True)
class PredictionRequest:
    """Conditions of a prediction: gauge pressures in kPa, flow in ml/min into each chamber or all,
    volumes in ul per balloon, and factors.

    Without ``calibration`` the factors come from the design's calibration, with ``tip_load`` g on
    the free tip. Intervals contain a measurement with this ``probability`` (a share). If one figure
    is ``wanted``, other slow ones are omitted. Values ``measured`` on an actuator narrow the
    prediction to that actuator.
    """

    pressures_kpa: tuple[float, ...] = USUAL_PRESSURES
    flow_ml_min: float = 35.0
    volumes_ul: tuple[float, ...] = ()
    calibration: Factors | None = None
    tip_load: float = 0.0
    wanted: tuple[Quantity, Conditions] | None = None
    probability: float = 0.9
    measured: tuple[MeasuredValue, ...] = ()

    def wants(self, *groups: str) -> bool:
        """Return True if figures of one of the groups are wanted."""
        return self.wanted is None or self.wanted[0].group in groups

    def places(self, usual: Iterable[Conditions], *of: Quantity) -> list[Conditions]:
        """Return the conditions at which any ``of`` these quantities is wanted: the ``usual`` ones,
        or those of the one figure.
        """
        if self.wanted is None:
            return list(usual)
        return [self.wanted[1]] if self.wanted[0] in of else []

    @property
    def factors(self) -> Factors:
        """The factors used in predictions; the defaults if they are not resolved yet."""
        return self.calibration or Factors()

    @property
    def measured_texts(self) -> list[str]:
        """The measured values as entered."""
        return [one.text for one in self.measured]


@dataclass(frozen=True, repr=False)
class Prediction:
    """The prediction of one design; if it is that of an actuator on which values were measured,
    ``before`` has the figures without these. ``curves`` computes its relations.
    """

    asked: PredictionRequest
    figures: tuple[Figure, ...]
    left_out: tuple[LeftOut, ...]
    before: tuple[Figure, ...] = ()
    curves: Callable[[], Iterable[Relation]] = field(default=tuple, compare=False)

    @cached_property
    def relations(self) -> tuple[Relation, ...]:
        """The curves, computed when they are first asked for."""
        return tuple(self.curves())

    def __getstate__(self) -> dict[str, Any]:
        # Functions that compute curves are not pickled.
        return {**self.__dict__, "relations": self.relations, "curves": tuple}

    def figure(self, quantity: Quantity | str, model: str = "", **at: Any) -> Figure:
        """Return the figure of a quantity at conditions (distinguishing fields of ``Conditions``),
        by a model (its id) or by the design model.

        Raises DesignError if no figure or several match.
        """
        sought = Quantity.of(quantity) if isinstance(quantity, str) else quantity
        named = [figure for figure in self.figures if figure.is_of(sought, Conditions(**at))]
        matching = [figure for figure in named if model in ("", figure.model.id)]
        if len(matching) > 1:
            matching = [figure for figure in matching if not figure.other]
        if len(matching) == 1:
            return matching[0]
        every = named or [figure for figure in self.figures if figure.quantity is sought]
        reasons = [omitted.reason for omitted in self.left_out if sought in omitted.quantities]
        why = "; ".join(f"{figure.at.as_dict()} by {figure.model.id}" for figure in every)
        why = f"there are {why}" if why else (reasons or ["it is not predicted"])[0]
        by = (f" at {at}" if at else "") + (f" by {model}" if model else "")
        kpa = at.get("kpa")
        is_asked = kpa is None or kpa in self.asked.pressures_kpa
        how = "" if is_asked else f"; predict it with pressures_kpa=[{kpa:g}]"
        raise DesignError(f"{sought.key}{by} is not one figure: {why}{how}")

    def value(self, quantity: Quantity | str, model: str = "", **at: Any) -> float:
        """Return the value of ``figure``, in its unit: ``value("blocked_force", kpa=100,
        share=0.25, model="elastic-stack")``.
        """
        return self.figure(quantity, model, **at).value

    def relation(self, name: str) -> Relation:
        """Return the curves of this name, such as "force". Raises DesignError if there are none."""
        for relation in self.relations:
            if relation.name == name:
                return relation
        names = [relation.name for relation in self.relations]
        near = difflib.get_close_matches(name, names, 3) or names
        raise DesignError(f"there is no relation {name!r}; did you mean {' or '.join(near)}?")

    @property
    def verdict(self) -> tuple[VerdictLine, ...]:
        """The lines with the main figures, their validity, and the omitted figures with reasons."""
        before = {figure.key: figure for figure in self.before}
        lines = [
            VerdictLine(quantity, _shown(figure), _note(figure, before.get(figure.key)))
            for quantity, figure in _main_figures(self.figures)
        ]
        why: dict[str, list[str]] = {}
        for omission in self.left_out:
            why.setdefault(omission.reason, []).append(omission.name)
        lines += [VerdictLine(LEFT_OUT, ", ".join(names), reason) for reason, names in why.items()]
        return tuple(lines)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One flat row per figure; ``measured`` is the paper's measurement as text, or empty."""
        return [{**figure.as_dict(), "measured": figure.counterpart} for figure in self.figures]

    def frame(self) -> DataFrame:
        """Return ``rows`` as a pandas DataFrame. Raises DesignError without pandas."""
        return data_frame(self.rows)

    def __repr__(self) -> str:
        omitted = f", {len(self.left_out)} left out" if self.left_out else ""
        return f"Prediction({len(self.figures)} figures{omitted})"

    def _repr_html_(self) -> str:
        rows: list[tuple[str, float | None, str, str, str]] = []
        for f in sorted(self.figures, key=lambda figure: figure.other):
            name = f"{f.name} (other model)" if f.other else f.name
            validity = f"{f.model.trust} {f.aside}".strip()
            rows.append((name, f.value, f.unit, f.model.title, validity))
        rows += [(item.name, None, "", "not predicted", item.reason) for item in self.left_out]
        return table_html(("", "", "unit", "model", "validity"), rows)

    def as_dict(self) -> dict[str, Any]:
        """Return the content of ``predict.json``, except its schema."""
        return PredictionDocument.of(self)


def _rounded(value: float) -> float:
    """Return a value rounded to seven digits, without floating-point noise."""
    if value == 0 or not math.isfinite(value):
        return 0.0
    digits = 6 - math.floor(math.log10(abs(value)))
    return 0.0 if abs(value) < 1e-9 else round(float(value), digits)


# The verdict: the first lines of a prediction.


LEFT_OUT = "left out"
STROKES = (
    Quantity.REFERENCE_STROKE,
    Quantity.FREE_STROKE,
    Quantity.REACHED_DIAMETER,
    Quantity.CONTRACTION,
)
CALIBRATED_STROKES = (STROKES[1], STROKES[0], *STROKES[2:])
BLOCKED = (Quantity.BLOCKED_FORCE, Quantity.FORCE_BOUND)
LOADS = (Quantity.WRINKLING_LOAD, Quantity.COLLAPSE_LOAD, Quantity.SLIP_LOAD)
MAIN = (
    ("bend", (Quantity.BEND, Quantity.REFERENCE_BEND, Quantity.FREE_BEND)),
    ("force", BLOCKED),
    ("force", (Quantity.PULL,)),
    ("moment", (Quantity.MOMENT,)),
    ("force", LOADS),
    ("burst", (Quantity.BURST,)),
)
"""Lines of a verdict after the strokes: of each the first quantity that has a figure."""
INTERVAL_NOTE = (
    "in parentheses the 90 % interval: from the calibration's uncertainty, and from what the model "
    "missed of the measured curves"
)
SCALED_NOTE = (
    "what the paper measured of one actuator of d = 5, in proportion to d, at a pressure that it "
    "does not give: what shares of the stroke are of, not the most that it rises"
)


@dataclass(frozen=True)
class VerdictLine:
    """One line of a verdict: the ``quantity`` ("stroke", "bend", "force", "burst"...), its
    ``figure``, and its validity in ``note``.
    """

    quantity: str
    figure: str
    note: str


def _main_figures(figures: Sequence[Figure]) -> Iterator[tuple[str, Figure]]:
    """Yield strokes, a bend, forces and burst with their quantities, each by the design model."""
    of: dict[Quantity, list[Figure]] = {}
    for figure in figures:
        is_flat = figure.quantity is not Quantity.BLOCKED_FORCE or not figure.at.share
        if is_flat and not figure.other:
            of.setdefault(figure.quantity, []).append(figure)
    is_calibrated = any(figure.interval is not None for each in of.values() for figure in each)
    strokes = CALIBRATED_STROKES if is_calibrated else STROKES
    for words, quantities in (*(("stroke", (stroke,)) for stroke in strokes), *MAIN):
        each = next((of[quantity] for quantity in quantities if quantity in of), [])
        if words in ("force", "moment"):
            # At the highest pressure, or the largest vacuum, that the film withstands.
            each = sorted(each, key=lambda figure: -abs(figure.at.kpa or 0.0))
        yield from ((words, figure) for figure in each[:1])


def _shown(figure: Figure) -> str:
    """Return value, 90 % interval, name and model of a figure as one line."""
    value = f"{figure.value:.4g} {figure.unit}"
    if figure.interval is not None:
        value = f"{figure.value:.3g} {figure.unit} ({figure.range})"
    return f"{value}, {figure.name} ({figure.model.name})"


def _note(figure: Figure, before: Figure | None = None) -> str:
    """Return the figure's value without measured values, else flags and counterpart, else the
    interval of measurements, else the validity.
    """
    if before is not None and figure.interval != before.interval:
        return (
            f"{before.value:.3g} {before.unit} ({before.range}) without what was measured on this "
            f"actuator{'; ' * bool(figure.aside)}{figure.aside}"
        )
    if figure.measured or figure.between or figure.flags:
        return figure.aside
    if figure.interval is not None and figure.quantity is not Quantity.BURST:
        return INTERVAL_NOTE
    if figure.model.id is ModelId.SCALED_HEIGHT:
        return SCALED_NOTE
    if figure.model.id is ModelId.WORK_ON_EQ_4:
        low, high = paper.EQ_4_RATIOS
        return (
            f"{low * figure.value:.3g} to {high * figure.value:.3g} N by the paper's six forces at "
            f"{paper.FORCE_KPA:g} kPa on pockets of 5 mm, {low:.2f} to {high:.2f} times this model"
        )
    return figure.model.trust


# Choice of the figure to design with where several models give one quantity.


SUPERSEDED: tuple[tuple[str, tuple[ModelId, ...], tuple[ModelId, ...]], ...] = (
    # An upper bound: it says 140 degrees where the paper measured 81 and the stack says 69 to 83.
    ("bending", (ModelId.CONSTANT_CURVATURE,), OF_STACK),
    # The modulus was measured at an unknown pressure; the stack's is a tenth of it.
    ("stiffness", OF_STACK, (ModelId.CANTILEVER,)),
    # No air drives a balloon to the cylinder that its film could be: short ones stay far below it.
    ("size", (ModelId.CYLINDER,), (ModelId.LENS,)),
)
"""(group, superseded models, preferred models)."""


def chosen(
    figures: Iterable[Figure], to_come: tuple[ModelId, ...] = (), is_calibrated: bool = False
) -> tuple[Figure, ...]:
    """Return the figures with those not for design marked as ``other``.

    ``to_come`` are models whose figures are omitted for now; if calibrated ones, all blocked forces
    are marked. Among figures of one name the first with an interval is chosen, which comes from a
    calibrated model. Without a calibration it is the first one: the paper's Eq. 4, whose force is
    nearest to the paper's six measurements at 100 kPa (0.76 to 1.24 times it; 0.74 to 1.65 times
    Eqs. 1-3, 0.47 to 0.86 times the elastic stack).
    """
    candidates = tuple(figures)
    given = {(figure.group, figure.model.id) for figure in candidates}
    preferred: dict[tuple[Quantity, Conditions], Figure] = {}
    for figure in candidates:
        best = preferred.setdefault((figure.quantity, figure.at), figure)
        if best.interval is None and figure.interval is not None:
            preferred[figure.quantity, figure.at] = figure

    def is_other(figure: Figure) -> bool:
        if preferred[figure.quantity, figure.at] is not figure:
            return True
        if figure.quantity is Quantity.WORK_BOUND:
            return (Quantity.FREE_WORK, figure.at) in preferred
        if to_come and is_calibrated and figure.quantity in BLOCKED:
            return True
        return any(
            figure.group == group
            and figure.model.id in behind
            and any(model in to_come or (group, model) in given for model in first)
            for group, behind, first in SUPERSEDED
        )

    return tuple(replace(each, other=each.other or is_other(each)) for each in candidates)


# The documents.


Rounded = Annotated[float, AfterValidator(_rounded)]
FlagList = Annotated[
    tuple[Flag, ...],
    Field(description="; ".join(f"{flag}: {words}" for flag, words in FLAGS.items())),
]
ConditionsEntry = Annotated[
    Conditions, PlainSerializer(Conditions.as_dict, return_type=dict[str, int | float | str])
]


class AskedEntry(Document):
    """What a prediction was asked for: kPa, ml/min, ul, mm, s, g, and factors."""

    pressures_kpa: list[PlainNumber]
    flow_ml_min: PlainNumber
    volumes_ul: list[PlainNumber]
    press_factor: Rounded = attribute("factors.press_factor")
    pocket_loss: Rounded = attribute("factors.pocket_loss")
    modulus_ratio: Rounded = attribute("factors.modulus_ratio")
    water_delay: Rounded = attribute("factors.water_delay")
    air_delay: Rounded = attribute("factors.air_delay")
    loss_share: Rounded = attribute("factors.loss_share")
    calibration: str = attribute("factors.calibration")
    tip_load: PlainNumber = attribute("factors.tip_load")
    measured: list[str] = attribute("measured_texts")


class PredictedFigure(Document):
    """A figure, at the conditions on which it depends."""

    quantity: QuantityEntry
    at: ConditionsEntry
    group: str
    name: str
    value: Rounded
    unit: str
    model_id: ModelId = attribute("model.id")
    model: str = attribute("model.title")
    trust: str = attribute("model.trust")
    design_with: bool
    """false where another model gives the same quantity, and that one is to design with"""
    measured: CounterpartEntry | None
    between: tuple[Rounded, Rounded] | None
    """bounds of a drawn pocket that is taken for a disc"""
    interval: tuple[Rounded, Rounded] | None
    """90 % interval of what would be measured, where a calibration says so"""
    pressure_kpa: PlainNumber | None = attribute("at.kpa")
    """gauge, a vacuum below 0; null at none"""
    flags: FlagList


class TraceEntry(Document):
    """A predicted curve."""

    label: str
    model: str = attribute("title")
    trust: str
    x: list[Rounded]
    y: list[Rounded]


class PointsEntry(Document):
    """Measured points, each +- its error (0 if the paper gives none)."""

    label: str
    x: list[Rounded]
    y: list[Rounded]
    error: list[PlainNumber]


class RelationEntry(Document):
    """Curves and points; ``x`` and ``y`` are axis labels with units."""

    name: str
    title: str
    x: str = attribute("x_label")
    y: str = attribute("y_label")
    lines: list[TraceEntry]
    measured: list[PointsEntry] = attribute("points")
    plot: str = ""
    """its file in the folder"""


class PredictionDocument(Document):
    """All predictions for one design."""

    asked: AskedEntry
    verdict: list[VerdictLine]
    figures: list[PredictedFigure]
    left_out: list[LeftOut]
    relations: list[RelationEntry]
