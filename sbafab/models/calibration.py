"""A calibration: the posterior of the models' unknowns and the remaining discrepancy, as a file
that designs and kits name; the factors of a design, and the 90 % intervals of its predictions.

Unknowns have a normal posterior in their coordinates, for an actuator without measurements: its
pocket loss differs between pressings. A prediction is linear in them: its logarithm, or the
prediction itself where it may be 0 or below, changes by its slope times the change of each unknown.
The remaining model error is a relative discrepancy, one standard deviation for each group of
quantities; farther from the evidence of a group, in size, film or number of balloons, a larger
error is assumed.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, reduce
from pathlib import Path
from statistics import NormalDist
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from sbafab.actuators import build
from sbafab.design.files import checked, is_file, listed, read_toml, shown
from sbafab.design.records import Design, Discs, Form
from sbafab.design.toml_table import Section
from sbafab.errors import DesignError
from sbafab.laminate.burst import RADIUS, Burst
from sbafab.laminate.films import PAPER_BURST, PAPER_THICKNESS
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.lay_up import folded_height
from sbafab.models.figures import EXTRAPOLATION, Factors, Figure, FigureItem, Flag
from sbafab.models.film_elements import Array
from sbafab.models.paper import BALLOONS, CALIBRATED_MODELS
from sbafab.models.quantity import Quantity

FOLDER = Path(__file__).parent / "calibrations"
NONE: Literal["none"] = "none"
"""The name for using no calibration: films as drawn and bought, without intervals."""
PAPER = "paper"
"""The name of the paper's evidence, and of the calibration that ships."""
FILE = "calibration.toml"
"""A calibration's copy in the output folder of a design."""
FLAT, BENT = "flat height", "force in bending"
"""The groups of folded heights, and of forces on a plate square to a bent tip."""
GROUPS = ("force", BENT, "motion", FLAT, "time", "work", "stiffness", "loss")
"""Groups of quantities, each with its discrepancy."""
SHARE = 0.9
"""Probability that an interval holds the measured value."""
SHARED = 0.5
"""Share of the discrepancy's variance that the points of a curve, and the values of a group that
are measured on one actuator, have in common."""


Ends = tuple[float, float]
"""Least and largest value."""


class Unknown(NamedTuple):
    """An unknown of the models; ``field`` names the field of ``Factors``.

    The prior is normal in the coordinate, which is the logarithm of the value (``is_log``) or the
    value itself: ``middle`` is the value at its mean, ``spread`` its standard deviation in the
    coordinate, and ``source`` its reason. Values lie from ``least`` to ``most``.
    """

    field: str
    title: str
    unit: str
    is_log: bool
    middle: float
    spread: float
    least: float
    most: float
    source: str

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value."""
        return math.log(value) if self.is_log else value

    def value(self, coordinate: float) -> float:
        """Return the value at a coordinate, within its bounds."""
        value = math.exp(coordinate) if self.is_log else coordinate
        return min(max(value, self.least), self.most)

    def shown(self, value: float) -> str:
        """Return a value to three digits, with its unit."""
        return f"{value:.3g} {self.unit}".rstrip()


def _priors() -> Iterator[Unknown]:
    with Path(__file__).with_name("priors.csv").open(encoding="utf-8", newline="") as opened:
        for name, title, unit, is_log, *numbers, source in list(csv.reader(opened))[1:]:
            middle, spread, least, most = map(float, numbers)
            yield Unknown(name, title, unit, is_log == "yes", middle, spread, least, most, source)


UNKNOWNS = tuple(_priors())
"""What calibration estimates, in the order of a calibration's mean and covariance."""
DESIGN_UNKNOWNS = 4
"""The first of UNKNOWNS, which change what an actuator does; the others are terms of a figure."""
FIELDS = [unknown.field for unknown in UNKNOWNS]


# Off the evidence. From d = 5 to 10 the elastic balloon comes to differ from finite elements by up
# to 19 % in stroke, and the paper's forces of a chamber differ by 10 to 34 % between two actuators
# of the same pockets; nothing was measured elsewhere. So these are assumptions, ours: standard
# deviations of the logarithm, which add up as independent ones.


PER_DOUBLING = {"diameters": 0.15, "thicknesses": 0.15, "balloons": 0.05}
"""For each doubling beyond the evidence."""
OTHER_FILM = 0.2
"""For a film of another product."""
OTHER_SHAPE = 0.2
"""For the burst of pockets that are not round."""
FAR = 0.25
"""Limit above which a figure is an extrapolation: a factor of 1.5 either way by assumption."""
_Size = Annotated[int | float, Field(gt=0)]
_Range = Annotated[tuple[_Size, _Size], Field(strict=False)]
_Row = Annotated[tuple[float, ...], Field(strict=False)]
_Texts = Annotated[tuple[str, ...], Field(strict=False)]


class SizeRange(Section):
    """The range of diameters of round pockets and thicknesses of films that bond, mm, and of
    numbers of balloons in a stack, for one actuator or several.
    """

    diameters: _Range | None = None
    thicknesses: _Range
    balloons: _Range

    @classmethod
    def of(cls, diameters: Sequence[float], thicknesses: Sequence[float], balloons: int) -> Self:
        """Return the sizes of an actuator with these pockets and films."""
        return cls.model_construct(
            diameters=(min(diameters), max(diameters)) if diameters else None,
            thicknesses=(min(thicknesses), max(thicknesses)),
            balloons=(balloons, balloons),
        )

    def joined(self, other: SizeRange) -> SizeRange:
        """Return the union of both ranges."""
        ends: dict[str, Any] = {}
        for name, mine in self:
            both = [each for each in (mine, getattr(other, name)) if each is not None]
            ends[name] = (min(a for a, _ in both), max(b for _, b in both)) if both else None
        return SizeRange.model_construct(**ends)

    def farther(self, evidence: SizeRange, is_other_film: bool = False) -> float:
        """Return the relative standard deviation assumed for sizes outside the evidence."""
        missed = [OTHER_FILM if is_other_film else 0.0]
        for name, rate in PER_DOUBLING.items():
            of, evidence_range = getattr(self, name), getattr(evidence, name)
            if of is not None and evidence_range is not None:
                missed.append(
                    rate * math.log2(max(evidence_range[0] / of[0], of[1] / evidence_range[1], 1.0))
                )
        return math.hypot(*missed)


PAPER_3DOF = SizeRange.of([5.0], [PAPER_THICKNESS], BALLOONS)
"""The actuator from which the reference stroke is scaled."""


def sizes_of(form: Form, laminate: Laminate) -> SizeRange:
    """Return the sizes of an actuator of this form."""
    thick = [layer.film.thickness for layer in laminate.tpe_layers]
    diameters = form.pockets.diameters if isinstance(form.pockets, Discs) else ()
    return SizeRange.of(diameters, thick, laminate.balloons)


def flags_at(missed: float) -> tuple[Flag, ...]:
    """Return the flags of a figure with this assumed standard deviation."""
    return (EXTRAPOLATION,) if missed > FAR else ()


def burst_uncertainty(estimate: Burst, share: float = SHARE) -> tuple[Ends, float]:
    """Return the interval in kPa that contains the burst pressure with a probability of ``share``,
    and the relative standard deviation assumed in it.
    """
    evidence = SizeRange.of([2 * RADIUS], [PAPER_THICKNESS], 1)
    sizes = SizeRange.of([2 * estimate.radius], [estimate.thickness], 1)
    missed = math.hypot(sizes.farther(evidence), 0.0 if estimate.is_round else OTHER_SHAPE)
    measured, error = PAPER_BURST
    factor = math.exp(deviations(share) * math.hypot(error / measured, missed))
    return (estimate.kpa / factor, estimate.kpa * factor), missed


# The file.


class HeldOut(Section):
    """Measured values excluded from the calibration, and the number inside its intervals."""

    points: int = Field(ge=0)
    inside: int = Field(ge=0)


class ModelCalibration(Section):
    """A posterior for an actuator without measurements.

    ``mean`` and ``covariance`` (n, n) are those of the coordinates of ``unknowns``; ``discrepancy``
    is the relative standard deviation of the model error, by group. ``pressing_spread`` is the
    standard deviation in mm of the pocket loss between pressings, which the covariance contains.
    ``set_ups`` are the probabilities of the set-ups that the source of a curve leaves open, by the
    curve's id.

    ``film`` is the product of the evidence, ``evidence`` lists its sources, ``sizes`` those of its
    actuators by group of quantities; ``held_out`` gives the number of left-out points in their
    intervals. ``sentences`` state what the evidence cannot distinguish.
    """

    schema_name: Literal["sbafab/calibration@3"] = Field(alias="schema")
    name: str
    about: str
    film: str
    evidence: _Texts
    unknowns: _Texts
    mean: _Row
    covariance: Annotated[tuple[_Row, ...], Field(strict=False)]
    sentences: _Texts
    pressing_spread: float = Field(ge=0, le=1)
    discrepancy: dict[str, Annotated[float, Field(ge=0, le=10)]]
    set_ups: dict[str, dict[str, Annotated[float, Field(ge=0, le=1)]]]
    sizes: dict[str, SizeRange]
    held_out: HeldOut

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Self:
        count = len(FIELDS)
        if list(self.unknowns) != FIELDS:
            raise ValueError(f"must have the unknowns {listed(FIELDS)}, in this order")
        if len(self.mean) != count:
            raise ValueError(f"has a mean of {len(self.mean)} numbers; it must be {count}")
        if {len(self.covariance), *map(len, self.covariance)} != {count}:
            raise ValueError(f"has a covariance that is not {count} by {count}")
        covariance = np.array(self.covariance)
        if not np.allclose(covariance, covariance.T) or np.linalg.eigvalsh(covariance).min() <= 0:
            raise ValueError("has a covariance that is not symmetric and positive definite")
        for unknown, coordinate in zip(UNKNOWNS, self.mean, strict=True):
            low, high = unknown.coordinate(unknown.least or 1e-9), unknown.coordinate(unknown.most)
            if not low - 1e-9 <= coordinate <= high + 1e-9:
                of = " (a logarithm)" if unknown.is_log else ""
                raise ValueError(
                    f"has a mean of {unknown.field}{of} of {coordinate:.3g}; it must be from "
                    f"{low:.3g} to {high:.3g}"
                )
        if set(self.discrepancy) != set(GROUPS) or not set(self.sizes) <= set(GROUPS):
            raise ValueError(f"must have a discrepancy, and may have sizes, for {listed(GROUPS)}")
        return self

    @cached_property
    def values(self) -> dict[str, Any]:
        """The median of each unknown, by field of ``Factors``."""
        return {u.field: u.value(z) for u, z in zip(UNKNOWNS, self.mean, strict=True)}

    @cached_property
    def factors(self) -> Factors:
        """The factors at the median."""
        return self._factors_at(self.values)

    def _factors_at(self, values: dict[str, Any]) -> Factors:
        return replace(Factors(**values), press_film=self.film)

    def bounds(self, field: str) -> tuple[float, float]:
        """Return the 90 % interval of an unknown."""
        row = FIELDS.index(field)
        unknown, half = UNKNOWNS[row], deviations(SHARE) * math.sqrt(self.covariance[row][row])
        return unknown.value(self.mean[row] - half), unknown.value(self.mean[row] + half)

    def shifted(self) -> list[tuple[float, Factors]]:
        """Return, for each design unknown, a change of its coordinate by about one standard
        deviation, and the changed factors.
        """
        moved = []
        for row in range(DESIGN_UNKNOWNS):
            unknown, step = UNKNOWNS[row], math.sqrt(self.covariance[row][row])
            # A smaller loss, with which an actuator reaches more; the other way where an end of the
            # range is near: a press factor is at most 1.
            step = -step if unknown.field == "pocket_loss" else step
            value = unknown.value(self.mean[row] + step)
            if abs(unknown.coordinate(value) - self.mean[row]) < abs(step) / 2:
                value = unknown.value(self.mean[row] - step)
            start = unknown.coordinate(self.values[unknown.field])
            change = unknown.coordinate(value) - start
            moved.append((change, self._factors_at({**self.values, unknown.field: value})))
        return moved

    def as_dict(self) -> dict[str, Any]:
        """Return the tables of the file."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)

    def moved_to(self, mean: Array, covariance: Array) -> ModelCalibration:
        """Return the calibration with another posterior of the coordinates."""
        rows = tuple(map(tuple, covariance.tolist()))
        posterior = {"mean": tuple(mean.tolist()), "covariance": rows}
        return ModelCalibration.model_construct(**{**dict(self), **posterior})

    def for_films(self, products: Collection[str]) -> ModelCalibration:
        """Return the calibration adapted to films that bond, by product.

        If the evidence's product is not among them, the modulus ratio is 1, with the prior's
        uncertainty, and the share of work lost is the prior's.
        """
        if self.film in products:
            return self
        mean, covariance = np.array(self.mean), np.array(self.covariance)
        for name, middle in (("modulus_ratio", 1.0), ("loss_share", None)):
            row = FIELDS.index(name)
            unknown = UNKNOWNS[row]
            mean[row] = unknown.coordinate(unknown.middle if middle is None else middle)
            covariance[row] = covariance[:, row] = 0.0
            covariance[row, row] = unknown.spread**2
        return self.moved_to(mean, covariance)


@cache
def deviations(share: float) -> float:
    """The half width of the central ``share`` of a normal distribution, in standard deviations."""
    return NormalDist().inv_cdf((1 + share) / 2)


def load_calibration(
    name: object, folder: Path | None = None, key: str = "models.calibration"
) -> ModelCalibration | None:
    """Return the calibration of a name, or of a file in ``folder``; None for "none".

    ``key`` is the key with the name. Raises DesignError for an unknown name or an invalid file.
    """
    if not isinstance(name, str):
        raise DesignError(
            f"{key} = {shown(name)} must be a quoted text: the name or file of a calibration"
        )
    if name == NONE:
        return None
    if name == PAPER:
        return _papers()
    path = (folder or Path()) / name
    if not is_file(path):
        raise DesignError(
            f'{key} = {shown(name)} is neither "none", nor a bundled one ({PAPER}), nor a file'
            + (" beside the design" if folder else "")
            + "; sbafab calibrate writes one"
        )
    return read_calibration(path)


@cache
def _papers() -> ModelCalibration:
    return read_calibration(FOLDER / f"{PAPER}.toml")


def read_calibration(path: Path) -> ModelCalibration:
    """The calibration in a file. Raises DesignError with one sentence if the file is invalid."""
    try:
        return checked(ModelCalibration, read_toml(path), {}, file="calibration")
    except DesignError as error:
        message = str(error).strip().removeprefix(f"{path} ")
        raise DesignError(f"{path}: {message}; write it again with sbafab calibrate") from None


# Factors and intervals of a design.


TERMS = {Quantity.LOST_WORK: "loss_share", Quantity.WATER_TIME: "water_delay"}
"""Fields of the unknowns that figures have as a term."""
CLEARANCES = (Quantity.RIM_ROOM, Quantity.CHAMBER_CLEARANCE)
CONTRADICTION = 3.0
"""Standard deviations between a reading and its prediction from which one of them is wrong."""
LOG_RANGE = 3.0
"""A value that changes by more than this factor is not near enough to linear in its logarithm."""
GROUP_BY_UNIT = {"N": "force", "mJ": "work", "s": "time", "N/mm": "stiffness"}


def discrepancy_group(figure: Figure) -> str | None:
    """Return the group of a figure's discrepancy; None if no calibrated model predicts it."""
    if figure.model.id not in CALIBRATED_MODELS:
        return None
    named = {Quantity.FOLDED_HEIGHT: FLAT, Quantity.LOST_WORK: "loss", Quantity.BENT_FORCE: BENT}
    return named.get(figure.quantity) or GROUP_BY_UNIT.get(figure.unit, "motion")


class Reading(NamedTuple):
    """A value measured on one actuator.

    ``text`` is the input, with the ``measured`` value, its relative standard ``error``, and the
    ``figures`` predicted at the median and at each of the ``moved`` factors of an ``Uncertainty``.
    """

    text: str
    measured: float
    error: float
    figures: Sequence[Figure]


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """A calibration for a ``laminate`` of a ``form``, by default like its evidence, with exactly
    ``tip_load`` g on the tip; None if a probe is on it, as in the evidence.

    Of an actuator on which values were ``measured`` it has the mean logarithms by which these
    exceed the models' values, by group, and the covariance (n + groups) of ``joint``.
    """

    calibration: ModelCalibration
    laminate: Laminate | None = None
    form: Form | None = None
    tip_load: float | None = 0.0
    measured: tuple[Array, Array] | None = None

    @cached_property
    def joint(self) -> Array:
        """Covariance (n + groups) of the coordinates, and of what the values of each group miss in
        common on one actuator.
        """
        if self.measured is not None:
            return self.measured[1]
        count, missed = len(UNKNOWNS), self.calibration.discrepancy
        joint = np.diag([0.0] * count + [SHARED * missed[each] ** 2 for each in GROUPS])
        joint[:count, :count] = self.calibration.covariance
        return joint

    def factor(self, group: str) -> float:
        """Return the factor by which an actuator's measured values exceed the models'."""
        return 1.0 if self.measured is None else math.exp(self.measured[0][GROUPS.index(group)])

    def rates(self, group: str, slopes: Sequence[float], size: float = 1.0) -> Array:
        """Return the derivatives (n + groups,) of a quantity of a group with these ``slopes`` in
        the coordinates; omitted ones at the end are 0.

        ``size`` is the derivative with respect to the group's model error: 1 for a logarithm, the
        value for a value.
        """
        rates = np.zeros(len(UNKNOWNS) + len(GROUPS))
        rates[: len(slopes)] = slopes
        rates[len(UNKNOWNS) + GROUPS.index(group)] = size
        return rates

    def own_miss(self, group: str) -> float:
        """Return the relative standard deviation of the model error specific to one value of a
        group; ``farther`` is assumed outside the evidence.
        """
        missed = math.sqrt(1 - SHARED) * self.calibration.discrepancy[group]
        return math.hypot(missed, self.farther(group))

    def interval(
        self,
        group: str,
        value: float,
        slopes: Sequence[float],
        is_log: bool,
        share: float = SHARE,
    ) -> tuple[float, float]:
        """Return the interval that holds the measured value with a probability of ``share``;
        ``slopes`` are those of the logarithm of the value (``is_log``) or of the value, by
        coordinate.
        """
        size = 1.0 if is_log else abs(value)
        rates, own = self.rates(group, slopes, size), size * self.own_miss(group)
        half = deviations(share) * math.sqrt(float(rates @ self.joint @ rates) + own**2)
        if is_log:
            return value * math.exp(-half), value * math.exp(half)
        return value - half, value + half

    def conditioned(self, rates: Array, missed: Array, own: Array) -> Uncertainty:
        """Return the calibration conditioned on values measured on an actuator: the logarithms
        ``missed`` (m,) of measured over predicted ones, their ``rates`` (m, n + groups), and the
        standard deviations ``own`` (m,) specific to each, from models and measurement. It is the
        posterior of a linear normal model.
        """
        gain = np.linalg.solve(rates @ self.joint @ rates.T + np.diag(own**2), rates @ self.joint).T
        change, joint, count = gain @ missed, self.joint - gain @ rates @ self.joint, len(UNKNOWNS)
        ends = [[u.coordinate(u.least or 1e-9), u.coordinate(u.most)] for u in UNKNOWNS]
        mean = np.clip(np.array(self.calibration.mean) + change[:count], *np.transpose(ends))
        posterior = self.calibration.moved_to(mean, joint[:count, :count])
        return replace(self, calibration=posterior, measured=(change[count:], joint))

    def farther(self, group: str) -> float:
        """Return the relative standard deviation assumed for a group of quantities outside the
        sizes of its evidence. Folded heights use no diameter.
        """
        known = self.calibration.sizes
        if self.laminate is None or self.form is None or not known:
            return 0.0
        evidence = known.get(group) or reduce(SizeRange.joined, known.values())
        sizes = sizes_of(self.form, self.laminate)
        if group == FLAT:
            return sizes.model_copy(update={"diameters": None}).farther(evidence)
        products = {layer.film.product for layer in self.laminate.tpe_layers}
        return sizes.farther(evidence, products != {self.calibration.film})

    def flags(self, group: str) -> tuple[Flag, ...]:
        """Return the flags of figures of a group; a group without evidence is an extrapolation."""
        known = self.calibration.sizes
        if known and group not in known:
            return (EXTRAPOLATION,)
        return flags_at(self.farther(group))

    @cached_property
    def factors(self) -> Factors:
        """The factors at the median."""
        return self._with_tip(self.calibration.factors)

    def shifted(self) -> list[tuple[float, Factors]]:
        """Return factors moved in one design unknown each; by 0 if it is known."""
        return [
            (change if name != "tip_load" or self.tip_load is None else 0.0, self._with_tip(moved))
            for name, (change, moved) in zip(FIELDS, self.calibration.shifted(), strict=False)
        ]

    @property
    def moved(self) -> list[Factors]:
        """The factors of ``shifted`` that differ from the median."""
        return [factors for change, factors in self.shifted() if change]

    def _with_tip(self, factors: Factors) -> Factors:
        label = self.calibration.name
        if self.measured is not None:
            label += " with values of this actuator"
        if self.tip_load is None:
            return replace(factors, calibration=label)
        label += f" but tip load {self.tip_load:g}" if self.tip_load else ""
        return replace(factors, calibration=label, tip_load=self.tip_load)

    def interval_of(
        self,
        group: str,
        value_at: Callable[[Factors], float],
        share: float = SHARE,
        term: str = "",
        may_be_negative: bool = False,
    ) -> tuple[float, Ends]:
        """Return a value at the median, and the interval that contains its measurement with a
        probability of ``share``.

        ``value_at`` gives the value with other factors. ``term`` is the field of an unknown that is
        one summand of the value, such as the delay of a time. A clearance, which may be negative,
        is linear in the unknowns, as is a value that nearly vanishes for other factors, such as a
        force near the end of the stroke.
        """
        value, slopes, is_log = self.slopes(group, value_at, term, may_be_negative)
        low, high = self.interval(group, value, slopes, is_log, share)
        if group == FLAT and self.laminate is not None:
            # From all films flown away to the films as bought.
            folded = folded_height(self.laminate, 1.0, self.calibration.film)
            return value, (max(low, folded.solid), min(high, folded.nominal))
        return value, (max(low, 0.0) if value >= 0 and not may_be_negative else low, high)

    def slopes(
        self,
        group: str,
        value_at: Callable[[Factors], float],
        term: str = "",
        may_be_negative: bool = False,
    ) -> tuple[float, list[float], bool]:
        """Return a value at the median, its slopes in the coordinates of the unknowns, and True if
        these are slopes of its logarithm; arguments as for ``interval_of``.
        """
        factor = self.factor(group)
        value = factor * value_at(self.factors)
        moved = [
            (change, factor * value_at(of) if change else value) for change, of in self.shifted()
        ]
        values = [value, *(each for _, each in moved)]
        least, most = min(values), max(values)
        is_log = least > 0 and most < LOG_RANGE * value < LOG_RANGE**2 * least
        is_log = is_log and not may_be_negative
        slopes = [
            (math.log(each / value) if is_log else each - value) / change if change else 0.0
            for change, each in moved
        ]
        # The unknowns that change no design may be a term of the value, or all of it.
        is_delay = term and term != "loss_share"
        slope = self.calibration.values[term] / value if is_delay else 1.0
        slopes += [slope if name == term else 0.0 for name in FIELDS[DESIGN_UNKNOWNS:]]
        return value, slopes, is_log

    def built(self, readings: Sequence[Reading]) -> Uncertainty:
        """Return the uncertainty for an actuator on which ``readings`` were measured.

        Raises DesignError for a reading that no calibrated model predicts, or that differs from the
        prediction by more than CONTRADICTION standard deviations.
        """
        rows, missed, own = [], [], []
        for reading in readings:
            group = discrepancy_group(reading.figures[0])
            values = [figure.value for figure in reading.figures]
            if group is None or not all(math.isfinite(each) and each > 0 for each in values):
                raise DesignError(
                    f"{reading.text}: no calibrated model predicts the "
                    f"{reading.figures[0].name}; give a height, stroke, bend or force that it "
                    "predicts"
                )
            by_factors = dict(zip((self.factors, *self.moved), values, strict=True))
            term = TERMS.get(reading.figures[0].quantity, "")
            value, slopes, is_log = self.slopes(group, by_factors.__getitem__, term)
            logs = slopes if is_log else [slope / value for slope in slopes]
            rows.append(self.rates(group, logs))
            missed.append(math.log(reading.measured / value))
            own.append(math.hypot(self.own_miss(group), reading.error))
        rates, misses, alone = np.array(rows), np.array(missed), np.array(own)
        self._refuse_contradictions(readings, rates, misses, alone)
        return self.conditioned(rates, misses, alone)

    def _refuse_contradictions(
        self, readings: Sequence[Reading], rates: Array, missed: Array, own: Array
    ) -> None:
        # By each unknown, and by what the values of a group miss in common.
        variances = rates * (rates @ self.joint)
        for reading, miss, part, alone in zip(readings, missed, variances, own, strict=True):
            away = float(miss) / math.sqrt(float(part.sum()) + float(alone) ** 2)
            if abs(away) > CONTRADICTION:
                most = int(np.argmax(part))
                against = (
                    f"the calibration's {UNKNOWNS[most].title}"
                    if most < len(UNKNOWNS)
                    else "the model, beyond what it has missed so far"
                )
                raise DesignError(
                    f"{reading.text} lies {abs(away):.1f} standard deviations "
                    f"{('above' if away > 0 else 'below')} the predicted "
                    f"{reading.figures[0].value:.3g} {reading.figures[0].unit}, and contradicts "
                    f"mostly {against}; check the reading, its unit and its pressure, and the "
                    "design's film"
                )

    def bounded(
        self,
        items: Sequence[FigureItem],
        moved: Iterable[Sequence[FigureItem]],
        share: float = SHARE,
    ) -> list[FigureItem]:
        """Return the items with the intervals of figures that the calibration covers.

        ``moved`` are the same figures at each of the ``moved`` factors. A figure that one of them
        lacks has no interval.
        """
        others = [
            {item.key: item.value for item in each if isinstance(item, Figure)} for each in moved
        ]
        return [
            self._bounded(item, [values.get(item.key, math.nan) for values in others], share)
            if isinstance(item, Figure)
            else item
            for item in items
        ]

    def _bounded(self, figure: Figure, moved: Sequence[float], share: float) -> Figure:
        """Return a figure with its interval, from its values at each of the ``moved`` factors."""
        group, value, quantity = discrepancy_group(figure), figure.value, figure.quantity
        if group is None:
            return figure
        flags = (*figure.flags, *self.flags(group))
        if not all(map(math.isfinite, moved)):
            return replace(figure, flags=flags)
        if group == FLAT and all(each == value for each in moved):
            return self._of_unknown_flow(figure)
        values = dict(zip((self.factors, *self.moved), (value, *moved), strict=True))
        value, interval = self.interval_of(
            group,
            values.__getitem__,
            share,
            term=TERMS.get(quantity, ""),
            may_be_negative=quantity in CLEARANCES,
        )
        return replace(figure, value=value, interval=interval, flags=flags)

    def _of_unknown_flow(self, figure: Figure) -> Figure:
        """Return the folded height of films that the calibration does not cover: from the height as
        bought to the largest flow in the press that the prior allows, or as solid films.
        """
        if self.laminate is None:
            return figure
        prior = UNKNOWNS[FIELDS.index("press_factor")]
        lowest = prior.value(prior.coordinate(prior.middle) - deviations(SHARE) * prior.spread)
        low = folded_height(self.laminate, lowest, "").height
        if low == figure.value:
            return figure
        flags = (*figure.flags, EXTRAPOLATION)
        return replace(figure, interval=(low, figure.value), flags=flags)


def calibration_of(design: Design, laminate: Laminate | None = None) -> ModelCalibration | None:
    """Return the calibration of a design, adapted to the bonding films of its laminate. Raises
    DesignError if it is unknown.
    """
    calibration = load_calibration(design.models.calibration, design.folder)
    return calibration and calibration.for_films(bonding_products(laminate or build(design)))


def bonding_products(laminate: Laminate) -> list[str]:
    """Return the products of the films that bond."""
    return list(dict.fromkeys(layer.film.product for layer in laminate.tpe_layers))


def uncertainty_of(
    design: Design,
    laminate: Laminate | None = None,
    form: Form | None = None,
    tip_load: float = 0.0,
) -> Uncertainty | None:
    """Return the calibration of a design, with ``tip_load`` g on its tip; None without one.
    Intervals apply to its ``laminate``; ``form`` replaces the design's.
    """
    calibration = calibration_of(design, laminate)
    if calibration is None:
        return None
    return Uncertainty(calibration, laminate, form or design.form, tip_load)


def factors_of(design: Design) -> Factors:
    """Return the factors of a design's calibration. Raises DesignError if it is unknown."""
    uncertainty = uncertainty_of(design)
    return uncertainty.factors if uncertainty else Factors()
