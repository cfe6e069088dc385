"""A calibration from evidence: a fit to all curves, and fits to all but the curves of one test,
whose points are then predicted.
"""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import tomli_w

from sbafab.errors import DesignError
from sbafab.models.calibrated import GROUPS, SHARE, ModelCalibration, SizeRange
from sbafab.models.film_elements import Array
from sbafab.models.intervals import sizes_of
from sbafab.models.unknowns import UNKNOWNS, factors_at
from sbafab.process import Progress
from sbafab.validation.model_values import ModelledActuator, NoModel, model_values
from sbafab.validation.posterior import (
    LEAST_ERROR,
    Posterior,
    SampledCurve,
    correlations,
    sampled,
    set_up_probabilities,
)
from sbafab.validation.records import Evidence, MeasuredCurve
from sbafab.validation.surface import ValueSurface, surfaces

DIGITS = 6
TOLD_APART = 0.3
"""Correlation from which two unknowns are said not to be told apart well."""


@dataclass(frozen=True)
class HeldOutPoint:
    """A measured value, and its prediction with 90 % interval by a fit without its test; ``place``
    is its place on the curve's axis, None without one.
    """

    curve: str
    place: float | None
    measured: float
    median: float
    low: float
    high: float
    unit: str

    @property
    def is_inside(self) -> bool:
        """True if the measured value lies in the interval."""
        return self.low <= self.measured <= self.high


class LeftOutFit(NamedTuple):
    """A fit without the curves of a ``test``, and the ``seed`` of its random numbers."""

    test: str
    seed: int
    posterior: Posterior


@dataclass(frozen=True)
class OpenSetUp:
    """The set-ups that a curve's source leaves open: each assumed ``phrase`` with its probability.

    The probabilities are the fit's, from equal prior ones.
    """

    curve: str
    probabilities: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Fit:
    """A calibration, its held-out points, the set-ups that sources leave open, and the curves that
    were not fitted, each with its reason.
    """

    calibration: ModelCalibration
    points: tuple[HeldOutPoint, ...]
    open_set_ups: tuple[OpenSetUp, ...]
    left_out: tuple[tuple[str, str], ...]


GROUP_OF = {
    "force_n": "force",
    "stroke_mm": "motion",
    "balloon_stroke_mm": "motion",
    "height_mm": "motion",
    "bend_deg": "motion",
    "flat_height_mm": "flat height",
    "energy_mj": "work",
    "time_s": "time",
    "modulus_kpa": "stiffness",
    "loss_share": "loss",
}
"""Quantities that calibration is fitted to, and the groups of their discrepancies."""


def usable_curves(
    sources: Sequence[Evidence],
) -> tuple[list[MeasuredCurve], list[tuple[str, str]]]:
    """Return the curves that a calibration can be fitted to, and the others with their reasons."""
    curves, left_out = [], []
    for source in sources:
        for curve in source.curves:
            reason = "" if curve.comparable else curve.reason
            if not reason and curve.quantity not in GROUP_OF:
                reason = f"the unknowns do not change the {curve.y_name}"
            if not reason and min(curve.y) <= 0:
                reason = "its values are not all above 0"
            if not reason:
                answer = model_values(curve, factors_at(MIDDLES))
                reason = answer.reason if isinstance(answer, NoModel) else ""
            if reason:
                left_out.append((curve.id, reason))
            else:
                curves.append(curve)
    return curves, left_out


MIDDLES = {unknown.field: unknown.middle for unknown in UNKNOWNS}
"""Values in the middle of the priors."""


def fit(name: str, sources: Sequence[Evidence], progress: Progress, about: str = "") -> Fit:
    """Return the calibration of sources of evidence.

    Raises DesignError if no curve of theirs can be fitted, or without emcee.
    """
    usable, left_out = usable_curves(sources)
    if not usable:
        reasons = "; ".join(f"{curve}: {reason}" for curve, reason in left_out)
        raise DesignError(f"no curve can be fitted to ({reasons})")
    films = sorted({film_of(curve) for curve in usable})
    if len(films) > 1:
        raise DesignError(
            f"the curves are of {len(films)} films ({', '.join(films)}); calibrate each by itself"
        )
    curves = [
        sampled_curve(curve, surface)
        for curve, surface in zip(usable, surfaces(usable, progress), strict=True)
    ]
    progress("posterior", 0, 1)
    posterior = sampled(curves)
    points = held_out(usable, curves, progress)
    return Fit(
        as_calibration(name, about, films[0], sources, posterior, points, sizes_of_groups(usable)),
        tuple(points),
        tuple(open_set_ups(usable, curves, posterior)),
        tuple(left_out),
    )


def open_set_ups(
    measured: Sequence[MeasuredCurve], curves: Sequence[SampledCurve], posterior: Posterior
) -> Iterator[OpenSetUp]:
    """Yield the set-ups of each curve whose source leaves some open."""
    for source, curve in zip(measured, curves, strict=True):
        answer = model_values(source, factors_at(MIDDLES))
        if isinstance(answer, NoModel) or len(answer.series) < 2:
            continue
        shares = set_up_probabilities(curve, posterior)
        pairs = zip(answer.series, shares.tolist(), strict=True)
        yield OpenSetUp(source.id, tuple(pairs))


def film_of(curve: MeasuredCurve) -> str:
    """Return the product of the film of the actuator that was measured."""
    return ModelledActuator(curve.actuator, factors_at(MIDDLES)).design.films.tpe.product


def sampled_curve(curve: MeasuredCurve, surface: ValueSurface) -> SampledCurve:
    """Return a curve in the form for the posterior."""
    fields = [unknown.field for unknown in UNKNOWNS]
    term = term_of(curve)
    return SampledCurve(
        curve.id,
        curve.group or curve.id,
        GROUPS.index(GROUP_OF[curve.quantity]),
        surface,
        np.log(curve.y),
        relative_errors(curve),
        fields.index(term) if term else -1,
    )


def term_of(curve: MeasuredCurve) -> str:
    """Return the field of the unknown that a curve's values have as a term: the delay of times, or
    the share itself that a cycle loses; "" without one.
    """
    if curve.quantity == "time_s":
        return "water_delay" if curve.setup.fluid == "water" else "air_delay"
    return "loss_share" if curve.quantity == "loss_share" else ""


def relative_errors(curve: MeasuredCurve) -> Array:
    """Return standard errors of the logarithms of a curve's values (points,)."""
    stated = np.array([error or 0.0 for error in curve.errors])
    return np.asarray(np.maximum(stated / np.array(curve.y), LEAST_ERROR))


def held_out(
    measured: Sequence[MeasuredCurve], curves: Sequence[SampledCurve], progress: Progress
) -> list[HeldOutPoint]:
    """Return each curve's points, predicted by a fit without its test.

    Empty if all curves are of one test.
    """
    return [
        point
        for left_out in left_out_fits(curves, progress)
        for source, curve in zip(measured, curves, strict=True)
        if curve.test == left_out.test
        for point in predicted_points(source, curve, left_out.posterior, left_out.seed)
    ]


def left_out_fits(
    curves: Sequence[SampledCurve], progress: Progress, only: Collection[str] = ()
) -> Iterator[LeftOutFit]:
    """Yield fits that each leave out one test: every test in turn, or each of ``only``.

    Yields nothing if all curves are of one test.
    """
    tests = list(dict.fromkeys(curve.test for curve in curves))
    for done, test in enumerate(tests if len(tests) > 1 else ()):
        if only and test not in only:
            continue
        progress("held out", done, len(tests))
        seed = zlib.crc32(test.encode())
        rest = [curve for curve in curves if curve.test != test]
        yield LeftOutFit(test, seed, sampled(rest, seed))


def predicted_points(
    curve: MeasuredCurve, values: SampledCurve, posterior: Posterior, seed: int
) -> list[HeldOutPoint]:
    """Return a curve's points with their intervals by a posterior."""
    drawn = posterior.predicted(values, np.random.default_rng(seed))
    ends = (1 - SHARE) / 2, 0.5, (1 + SHARE) / 2
    low, median, high = np.exp(np.quantile(drawn, ends, axis=0))
    places: Sequence[float | None] = curve.x or (None,) * len(curve.y)
    return [
        HeldOutPoint(curve.id, place, y, float(m), float(a), float(b), curve.y_unit)
        for place, y, m, a, b in zip(places, curve.y, median, low, high, strict=True)
    ]


def sizes_of_groups(curves: Sequence[MeasuredCurve]) -> dict[str, SizeRange]:
    """Return the sizes of the actuators that were measured, by group of quantities."""
    by_group: dict[str, SizeRange] = {}
    for curve in curves:
        of = ModelledActuator(curve.actuator, factors_at(MIDDLES))
        sizes, group = sizes_of(of.design.form, of.laminate), GROUP_OF[curve.quantity]
        by_group[group] = by_group[group].joined(sizes) if group in by_group else sizes
    return by_group


def as_calibration(
    name: str,
    about: str,
    film: str,
    sources: Sequence[Evidence],
    posterior: Posterior,
    points: Sequence[HeldOutPoint],
    sizes: Mapping[str, SizeRange],
) -> ModelCalibration:
    """Return the calibration that a posterior stands for."""
    sentences = tuple(
        f"{row['first']} and {row['second']}: correlation {row['correlation']:.2f}"
        for row in correlations(posterior.covariance, TOLD_APART)
    )
    return ModelCalibration(
        name=name,
        about=about,
        film=film,
        evidence=tuple(source.id for source in sources),
        mean=tuple(round(float(value), DIGITS) for value in posterior.mean),
        covariance=tuple(
            tuple(round(float(value), DIGITS + 2) for value in row) for row in posterior.covariance
        ),
        discrepancy={group: round(value, DIGITS) for group, value in posterior.discrepancy.items()},
        sizes=sizes,
        points=len(points),
        inside=sum(point.is_inside for point in points),
        sentences=sentences,
    )


def calibration_text(calibration: ModelCalibration) -> str:
    """Return the text of a calibration's file; comments at the top describe its unknowns."""
    lines = ["# Written by sbafab calibrate. Medians, with 90 % intervals in parentheses:"]
    for unknown in UNKNOWNS:
        low, high = calibration.bounds(unknown.field)
        value = unknown.shown(calibration.values[unknown.field])
        lines.append(f"# {unknown.title} {value} ({low:.3g} to {high:.3g})")
    return "\n".join(lines) + "\n\n" + tomli_w.dumps(calibration.as_dict())
