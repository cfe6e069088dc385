"""The factors of a design's calibration, and the 90 % intervals of its predictions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from sbafab.models.calibrated import DESIGN_UNKNOWNS, SHARE, ModelCalibration, load_calibration
from sbafab.models.figures import Factors, Figure, LeftOut
from sbafab.models.paper import BALLOON, FLAT_HEIGHT_OF_FILMS, LOST_WORK, STACK
from sbafab.models.unknowns import UNKNOWNS

if TYPE_CHECKING:
    from sbafab.design.records import Design

Items = Sequence[Figure | LeftOut]
MODULUS_RATIO, LOSS = (
    next(n for n, unknown in enumerate(UNKNOWNS) if unknown.field == field)
    for field in ("modulus_ratio", "loss_share")
)
DELAYS = {"water": "water_delay", "air": "air_delay"}


def calibration_of(design: Design) -> ModelCalibration | None:
    """Return the calibration of a design, as it holds ``for_film``. Raises DesignError where there
    is no such calibration.
    """
    calibration = load_calibration(design.models.calibration, design.folder)
    return None if calibration is None else for_film(calibration, design.films.tpe.product)


def for_film(calibration: ModelCalibration, product: str) -> ModelCalibration:
    """Return a calibration as it holds for a film; for another one than the evidence's the modulus
    ratio is 1, as uncertain as the prior has it, and the share of work lost is the prior's.
    """
    if product == calibration.film:
        return calibration
    mean = list(calibration.mean)
    covariance = [list(row) for row in calibration.covariance]
    mean[MODULUS_RATIO] = 0.0
    mean[LOSS] = UNKNOWNS[LOSS].coordinate(UNKNOWNS[LOSS].middle)
    for row in (MODULUS_RATIO, LOSS):
        for other in range(len(mean)):
            covariance[row][other] = covariance[other][row] = 0.0
        covariance[row][row] = UNKNOWNS[row].spread ** 2
    return replace(
        calibration, mean=tuple(mean), covariance=tuple(tuple(row) for row in covariance)
    )


def given_factors(overrides: Mapping[str, float | None]) -> dict[str, float]:
    """Return the values that a user gave, by field of ``Factors``."""
    return {field: value for field, value in overrides.items() if value is not None}


@dataclass(frozen=True)
class Uncertainty:
    """A calibration with the user's own values (``overrides``, by field of ``Factors``), which are
    exact, in place of its own.
    """

    calibration: ModelCalibration
    overrides: Mapping[str, float | None]

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
        field of an unknown that the value is the sum of with others: the delay of a time.
        """
        value = value_at(self.factors)
        moved = [
            (change, value if change == 0 else value_at(factors))
            for change, factors in self.shifted()
        ]
        terms = self._term_slopes(value, term)
        return value, self._interval(group, value, moved, terms, share=share)

    def bounded(
        self, items: Items, evaluated: Callable[[Factors], Items]
    ) -> list[Figure | LeftOut]:
        """Return the items with the intervals of figures that the calibration covers.

        ``evaluated`` gives the same figures with other factors. A figure that one of them lacks has
        no interval.
        """
        moved: list[tuple[float, dict[tuple[str, str], float]]] = []
        for change, factors in self.shifted():
            values = {} if change == 0 else _by_name(evaluated(factors))
            moved.append((change, values))
        return [self._bounded(item, moved) if isinstance(item, Figure) else item for item in items]

    def _bounded(
        self, figure: Figure, moved: Sequence[tuple[float, Mapping[tuple[str, str], float]]]
    ) -> Figure:
        group = discrepancy_group(figure)
        if group is None:
            return figure
        key = figure.name, _kind(figure)
        values = [figure.value if change == 0 else each.get(key) for change, each in moved]
        present = [value for value in values if value is not None]
        if len(present) < len(values) or not all(map(math.isfinite, present)):
            return figure
        interval = self._interval(
            group,
            figure.value,
            [(change, value) for value, (change, _) in zip(present, moved, strict=True)],
            self._term_slopes(figure.value / (100 if figure.unit == "%" else 1), _term(figure)),
            may_be_negative=figure.name.startswith(CLEARANCES),
        )
        return replace(figure, interval=interval)

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
        low, high = self.calibration.interval(group, value, slopes, is_log, share)
        return (max(low, 0.0) if value >= 0 and not may_be_negative else low), high

    def _term_slopes(self, value: float, term: str) -> list[float]:
        """Return slopes of a value's logarithm by the logarithms of the unknowns that change no
        design, of which it may have one as a term; 0 without one, or where the user gave it.
        """
        return [
            self.calibration.values[unknown.field] / value
            if unknown.field == term and unknown.field not in self._given
            else 0.0
            for unknown in UNKNOWNS[DESIGN_UNKNOWNS:]
        ]


CLEARANCES = ("room between rims", "clearance between chambers")


def _term(figure: Figure) -> str:
    """Return the field of the unknown that a figure has as a term; "" without one."""
    if figure.name == LOST_WORK:
        return "loss_share"
    fluid = next((name for name in DELAYS if name in figure.name), "")
    return DELAYS[fluid] if fluid and figure.unit == "s" else ""


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


def _kind(figure: Figure) -> str:
    """Return the model of a figure without its factors."""
    return next((name for name in KINDS if figure.model.name.startswith(name)), "")


KINDS = (STACK, BALLOON, FLAT_HEIGHT_OF_FILMS)


def _by_name(items: Items) -> dict[tuple[str, str], float]:
    return {(item.name, _kind(item)): item.value for item in items if isinstance(item, Figure)}


def discrepancy_group(figure: Figure) -> str | None:
    """Return the group of a figure's discrepancy; None where no calibrated model gives it."""
    kind = _kind(figure)
    if not kind:
        return None
    if kind == FLAT_HEIGHT_OF_FILMS:
        return "flat height"
    if figure.name == LOST_WORK:
        return "loss"
    return GROUP_BY_UNIT.get(figure.unit, "motion")


GROUP_BY_UNIT = {"N": "force", "mJ": "work", "s": "time", "N/mm": "stiffness"}


def uncertainty_of(
    design: Design, overrides: Mapping[str, float | None] | None = None
) -> Uncertainty | None:
    """Return the calibration of a design with the user's own values; None without one."""
    calibration = calibration_of(design)
    return None if calibration is None else Uncertainty(calibration, overrides or {})


def factors_of(design: Design, overrides: Mapping[str, float | None] | None = None) -> Factors:
    """Return the factors of a design's calibration, with the user's own values in place of its own.

    Raises DesignError where there is no such calibration, or for values out of range.
    """
    uncertainty = uncertainty_of(design, overrides)
    if uncertainty is None:
        return Factors(**given_factors(overrides or {}))  # type: ignore[arg-type]
    return uncertainty.factors
