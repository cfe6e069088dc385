"""The factors of a design's calibration, the 90 % intervals of its predictions, and how much wider
they are assumed to be off the evidence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from sbafab.design.records import Design, Discs, Form
from sbafab.laminate.burst import RADIUS, Burst
from sbafab.laminate.films import PAPER_BURST, PAPER_THICKNESS
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.lay_up import folded_height
from sbafab.models.calibrated import (
    DESIGN_UNKNOWNS,
    SHARE,
    UNKNOWNS,
    ModelCalibration,
    SizeRange,
    deviations,
    load_calibration,
)
from sbafab.models.figures import EXTRAPOLATION, Factors, Figure, FigureItem, Flag
from sbafab.models.paper import BALLOONS, CALIBRATED_MODELS
from sbafab.models.quantity import FigureKey, Quantity

Items = Sequence[FigureItem]
FLAT = "flat height"
"""The group of folded heights."""
MODULUS_RATIO, LOSS = (
    next(n for n, unknown in enumerate(UNKNOWNS) if unknown.field == field)
    for field in ("modulus_ratio", "loss_share")
)


def calibration_of(design: Design) -> ModelCalibration | None:
    """Return the calibration of a design, adapted by ``for_film``. Raises DesignError if it is
    unknown.
    """
    calibration = load_calibration(design.models.calibration, design.folder)
    return None if calibration is None else for_film(calibration, design.films.tpe.product)


def for_film(calibration: ModelCalibration, product: str) -> ModelCalibration:
    """Return a calibration adapted to a film; for a film other than the evidence's the modulus
    ratio is 1, with the prior's uncertainty, and the share of work lost is the prior's.
    """
    if product == calibration.film:
        return calibration
    mean, covariance = np.array(calibration.mean), np.array(calibration.covariance)
    for row, middle in ((MODULUS_RATIO, 1.0), (LOSS, UNKNOWNS[LOSS].middle)):
        mean[row] = UNKNOWNS[row].coordinate(middle)
        covariance[row] = covariance[:, row] = 0.0
        covariance[row, row] = UNKNOWNS[row].spread ** 2
    changed = {"mean": mean.tolist(), "covariance": covariance.tolist()}
    return ModelCalibration.model_validate({**calibration.as_dict(), **changed})


def given_factors(overrides: Mapping[str, float | None]) -> dict[str, Any]:
    """Return the values that a user gave, by field of ``Factors``."""
    return {field: value for field, value in overrides.items() if value is not None}


# Off the evidence. From d = 5 to 10 the elastic balloon comes to differ from finite elements by up
# to 19 % in stroke, and the paper's forces of a chamber differ by 10 to 34 % between two actuators
# of the same pockets; nothing was measured elsewhere. So these are assumptions, ours: standard
# deviations of the logarithm, which add up as independent ones.


PER_DOUBLING = (0.15, 0.15, 0.05)
"""For each doubling beyond the evidence: of diameter, film thickness, number of balloons."""
OTHER_FILM = 0.2
"""For a film of another product."""
OTHER_SHAPE = 0.2
"""For the burst of pockets that are not round."""
FAR = 0.25
"""Limit above which a figure is an extrapolation: a factor of 1.5 either way by assumption."""
PAPER_3DOF = SizeRange((5.0, 5.0), (PAPER_THICKNESS,) * 2, (BALLOONS,) * 2)
"""The actuator from which the reference stroke is scaled."""


def sizes_of(form: Form, laminate: Laminate) -> SizeRange:
    """Return the sizes of an actuator of this form."""
    thick = [layer.film.thickness for layer in laminate.tpe_layers]
    round_ones = form.pockets.diameters if isinstance(form.pockets, Discs) else ()
    return SizeRange(
        (min(round_ones), max(round_ones)) if round_ones else None,
        (min(thick), max(thick)),
        (laminate.balloons, laminate.balloons),
    )


def farther(sizes: SizeRange, evidence: SizeRange, is_other_film: bool) -> float:
    """Return the relative standard deviation that is assumed for sizes off the evidence."""
    missed = [OTHER_FILM if is_other_film else 0.0]
    for of, known, rate in zip(sizes, evidence, PER_DOUBLING, strict=True):
        if of is not None and known is not None:
            ratio = max(known[0] / of[0], of[1] / known[1], 1.0)
            missed.append(rate * math.log2(ratio))
    return math.hypot(*missed)


def flags_at(missed: float) -> tuple[Flag, ...]:
    """Return the flags of a figure with this assumed standard deviation."""
    return (EXTRAPOLATION,) if missed > FAR else ()


def burst_uncertainty(estimate: Burst, share: float = SHARE) -> tuple[tuple[float, float], float]:
    """Return the interval in kPa that holds the burst pressure with a probability of ``share``, and
    the relative standard deviation that is assumed in it.
    """
    sizes = SizeRange((2 * estimate.radius,) * 2, (estimate.thickness,) * 2, (1, 1))
    missed = farther(sizes, SizeRange((2 * RADIUS,) * 2, (PAPER_THICKNESS,) * 2, (1, 1)), False)
    missed = math.hypot(missed, 0.0 if estimate.is_round else OTHER_SHAPE)
    measured, error = PAPER_BURST
    factor = math.exp(deviations(share) * math.hypot(error / measured, missed))
    return (estimate.kpa / factor, estimate.kpa * factor), missed


class ActuatorSizes(NamedTuple):
    """The actuator data for intervals: its ``sizes``, the ``products`` of its films that bond, and
    the bounds of its folded height, with all films flown away and with the films as bought.
    """

    sizes: SizeRange
    products: frozenset[str]
    flat: tuple[float, float]

    @classmethod
    def of(cls, form: Form, laminate: Laminate, film: str) -> ActuatorSizes:
        """Return the subject of a design's form and laminate; ``film`` is the one that flows."""
        folded = folded_height(laminate, 1.0, film)
        products = frozenset(layer.film.product for layer in laminate.tpe_layers)
        return cls(sizes_of(form, laminate), products, (folded.solid, folded.nominal))


@dataclass(frozen=True)
class Uncertainty:
    """A calibration with the user's own values (``overrides``, by field of ``Factors``), which are
    exact, in place of its values; for a ``subject``, by default like its evidence.
    """

    calibration: ModelCalibration
    overrides: Mapping[str, float | None]
    subject: ActuatorSizes | None = None

    def farther(self, group: str) -> float:
        """Return the relative standard deviation assumed for a group of quantities, off what the
        calibration's evidence has of it. Folded heights take no diameter.
        """
        subject, known = self.subject, self.calibration.ranges
        if subject is None or not known:
            return 0.0
        evidence = known.get(group) or reduce(SizeRange.joined, known.values())
        sizes = subject.sizes._replace(diameters=None) if group == FLAT else subject.sizes
        is_other = group != FLAT and subject.products != {self.calibration.film}
        return farther(sizes, evidence, is_other)

    @property
    def factors(self) -> Factors:
        """The factors at the median."""
        return self._with_overrides(self.calibration.factors)

    def shifted(self) -> list[tuple[float, Factors]]:
        """Return factors moved in one design unknown each; by 0 where the user gave it."""
        return [
            (0.0 if unknown.field in self._given else change, self._with_overrides(factors))
            for unknown, (change, factors) in zip(
                UNKNOWNS, self.calibration.shifted(), strict=False
            )
        ]

    @property
    def _given(self) -> set[str]:
        """Fields of the unknowns that the user gave, a modulus in place of its ratio included."""
        given = set(given_factors(self.overrides))
        return given | ({"modulus_ratio"} if "modulus_mpa" in given else set())

    def _with_overrides(self, factors: Factors) -> Factors:
        values = given_factors(self.overrides)
        if "modulus_mpa" in values:
            values.setdefault("modulus_ratio", 1.0)
        label = self.calibration.name
        if "press_factor" in values:
            factors = replace(factors, press_film="")
        if values:
            label += " but " + ", ".join(
                f"{field.removesuffix('_mpa').replace('_', ' ')} {value:g}"
                for field, value in values.items()
                if field != "modulus_ratio"
            )
        return replace(factors, calibration=label, **values)

    def interval_of(
        self,
        group: str,
        value_at: Callable[[Factors], float],
        share: float = SHARE,
        term: str = "",
    ) -> tuple[float, tuple[float, float]]:
        """Return a value at the median, and the interval that holds what would be measured with a
        probability of ``share``; ``value_at`` gives the value with other factors. ``term`` is the
        field of an unknown that is one summand of the value, such as the delay of a time.
        """
        value = value_at(self.factors)
        moved = [
            (change, value if change == 0 else value_at(factors))
            for change, factors in self.shifted()
        ]
        terms = self._term_slopes(value, term)
        return value, self._interval(group, value, moved, terms, share=share)

    @property
    def moved(self) -> list[Factors]:
        """The factors of ``shifted`` that differ from the median."""
        return [factors for change, factors in self.shifted() if change]

    def bounded(self, items: Items, moved: Iterable[Items]) -> list[FigureItem]:
        """Return the items with the intervals of figures that the calibration covers; ``moved`` are
        the same figures at each of the ``moved`` factors. A figure that one of them lacks has no
        interval.
        """
        others = iter(moved)
        pairs = [(change, _by_key(next(others)) if change else {}) for change, _ in self.shifted()]
        return [self._bounded(item, pairs) if isinstance(item, Figure) else item for item in items]

    def _bounded(
        self, figure: Figure, moved: Sequence[tuple[float, Mapping[FigureKey, float]]]
    ) -> Figure:
        group = discrepancy_group(figure)
        pairs = [
            (change, figure.value if change == 0 else values.get(figure.key, math.nan))
            for change, values in moved
        ]
        if group is None or not all(math.isfinite(value) for _, value in pairs):
            return figure
        if group == FLAT and all(value == figure.value for _, value in pairs):
            return figure
        share = figure.value / (100 if figure.unit == "%" else 1)
        terms = self._term_slopes(share, TERMS.get(figure.quantity, ""))
        is_signed = figure.quantity in CLEARANCES
        interval = self._interval(group, figure.value, pairs, terms, may_be_negative=is_signed)
        flags = (*figure.flags, *flags_at(self.farther(group)))
        return replace(figure, interval=interval, flags=flags)

    def _interval(
        self,
        group: str,
        value: float,
        moved: Sequence[tuple[float, float]],
        terms: Sequence[float],
        *,
        share: float = SHARE,
        may_be_negative: bool = False,
    ) -> tuple[float, float]:
        """Return the interval of a value, from changes of the design unknowns, each with the value
        that it gives, and the slopes by the others (``terms``). A clearance, which may be negative,
        is linear in them.
        """
        is_log = not may_be_negative and _is_log(value, [each for _, each in moved])
        slopes = [_slope(value, each, change, is_log) for change, each in moved]
        slopes += terms
        low, high = self.calibration.interval(
            group, value, slopes, is_log, share, self.farther(group)
        )
        if group == FLAT and self.subject is not None:
            least, most = self.subject.flat
            return max(low, least), min(high, most)
        return (max(low, 0.0) if value >= 0 and not may_be_negative else low), high

    def _term_slopes(self, value: float, term: str) -> list[float]:
        """Return slopes of a value's logarithm by the logarithms of the unknowns that change no
        design; one of them may be a term of it. 0 without one, or if the user gave it.
        """
        return [
            self.calibration.values[unknown.field] / value
            if unknown.field == term and unknown.field not in self._given
            else 0.0
            for unknown in UNKNOWNS[DESIGN_UNKNOWNS:]
        ]


CLEARANCES = (Quantity.RIM_ROOM, Quantity.CHAMBER_CLEARANCE)
TERMS = {Quantity.LOST_WORK: "loss_share", Quantity.WATER_TIME: "water_delay"}
"""Fields of the unknowns that figures have as a term."""


def _slope(value: float, moved: float, change: float, is_log: bool) -> float:
    if change == 0:
        return 0.0
    return (math.log(moved / value) if is_log else moved - value) / change


def _is_log(value: float, moved: Sequence[float]) -> bool:
    """Return True where the logarithm of a value is near enough to linear: one that has almost
    vanished with other factors, such as a force near the end of the stroke, changes by itself.
    """
    return min(value, *moved) > 0 and max(moved) < LOG_RANGE * value < LOG_RANGE**2 * min(moved)


# A value that changes by more than this factor is not near enough to linear in its logarithm.
LOG_RANGE = 3.0


def _by_key(items: Items) -> dict[FigureKey, float]:
    return {item.key: item.value for item in items if isinstance(item, Figure)}


GROUP_BY_UNIT = {"N": "force", "mJ": "work", "s": "time", "N/mm": "stiffness"}


def discrepancy_group(figure: Figure) -> str | None:
    """Return the group of a figure's discrepancy; None if no calibrated model gives it."""
    if figure.model.id not in CALIBRATED_MODELS:
        return None
    named = {Quantity.FOLDED_HEIGHT: FLAT, Quantity.LOST_WORK: "loss"}
    return named.get(figure.quantity) or GROUP_BY_UNIT.get(figure.unit, "motion")


def uncertainty_of(
    design: Design,
    overrides: Mapping[str, float | None] | None = None,
    laminate: Laminate | None = None,
    form: Form | None = None,
) -> Uncertainty | None:
    """Return the calibration of a design with the user's own values; None without one. Intervals
    apply to its ``laminate``; ``form`` replaces the design's.
    """
    calibration = calibration_of(design)
    if calibration is None:
        return None
    subject = None
    if laminate is not None:
        subject = ActuatorSizes.of(form or design.form, laminate, calibration.film)
    return Uncertainty(calibration, overrides or {}, subject)


def factors_of(design: Design, overrides: Mapping[str, float | None] | None = None) -> Factors:
    """Return the factors of a design's calibration, replaced by the user's values where given.

    Raises DesignError if the calibration is unknown, or for values out of range.
    """
    uncertainty = uncertainty_of(design, overrides)
    if uncertainty is None:
        return Factors(**given_factors(overrides or {}))
    return uncertainty.factors
