"""A calibration from evidence: a fit to all curves, and fits to all but the curves of one test,
whose points are then predicted.
"""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import tomli_w

from sbafab.documents import Document
from sbafab.errors import DesignError
from sbafab.models.calibration import (
    FIELDS,
    GROUPS,
    SHARE,
    UNKNOWNS,
    ModelCalibration,
    SizeRange,
    sizes_of,
)
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Array
from sbafab.runtime import Progress
from sbafab.validation.evidence import QUANTITIES, Evidence, MeasuredCurve
from sbafab.validation.model_values import ModelledActuator, model_values
from sbafab.validation.posterior import (
    LEAST_ERROR,
    NODE_COORDINATES,
    NODES,
    Posterior,
    SampledCurve,
    sampled,
    set_up_probabilities,
)

DIGITS = 6
TOLD_APART = 0.3
"""Correlation from which two unknowns are said not to be told apart well."""
IMPOSSIBLE = 1e-3
"""Share of a curve's measured values that stands for a state which an actuator cannot reach."""


class HeldOutPoint(Document):
    """A measured value, and its prediction with 90 % interval by a fit without its test."""

    curve: str
    place: float | None
    """on the curve's axis"""
    measured: float
    median: float
    low: float
    high: float
    unit: str
    inside: bool


class CalibrationFit(NamedTuple):
    """A calibration, its held-out points, and the curves that were not fitted, each with its
    reason; ``open_set_ups`` are the set-ups that a curve's source leaves open: each assumed phrase
    with its probability by the fit, from equal prior ones.
    """

    calibration: ModelCalibration
    points: Sequence[HeldOutPoint]
    open_set_ups: Mapping[str, Mapping[str, float]]
    left_out: Sequence[tuple[str, str]]


GROUP_OF = {name: each.group for name, each in QUANTITIES.items() if each.group}
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
                try:
                    model_values(curve, Factors(**MIDDLES))
                    curves.append(curve)
                except DesignError as error:
                    reason = str(error)
            if reason:
                left_out.append((curve.id, reason))
    return curves, left_out


MIDDLES: dict[str, Any] = {unknown.field: unknown.middle for unknown in UNKNOWNS}
"""Values in the middle of the priors."""


def fit(name: str, sources: Sequence[Evidence], progress: Progress) -> CalibrationFit:
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
    curves = sampled_curves(usable, progress)
    progress("posterior", 0, 1)
    posterior = sampled(curves)
    points = [
        point
        for test, seed, rest in left_out_fits(curves, progress)
        for source, curve in zip(usable, curves, strict=True)
        if curve.test == test
        for point in predicted_points(source, curve, rest, seed)
    ]
    sizes = sizes_of_groups(usable)
    return CalibrationFit(
        as_calibration(name, films[0], sources, posterior, points, sizes),
        points,
        open_set_ups(usable, curves, posterior),
        left_out,
    )


def open_set_ups(
    measured: Sequence[MeasuredCurve], curves: Sequence[SampledCurve], posterior: Posterior
) -> dict[str, dict[str, float]]:
    """Return the set-ups of each curve whose source leaves some open, with their probabilities."""
    shares = {}
    for source, curve in zip(measured, curves, strict=True):
        series = model_values(source, Factors(**MIDDLES)).series
        if len(series) > 1:
            probabilities = set_up_probabilities(curve, posterior).tolist()
            shares[source.id] = dict(zip(series, probabilities, strict=True))
    return shares


def film_of(curve: MeasuredCurve) -> str:
    """Return the product of the film of the actuator that was measured."""
    return ModelledActuator(curve, Factors(**MIDDLES)).design.films.tpe.product


def sampled_curves(curves: Sequence[MeasuredCurve], progress: Progress) -> list[SampledCurve]:
    """Return curves in the form for the posterior: the models' values at all nodes."""
    tables: list[dict[tuple[int, ...], Array]] = [{} for _ in curves]
    # Maps of balloons hang on the pocket loss alone.
    for loss, ratio, press in np.ndindex(NODES[1], NODES[0], NODES[2]):
        progress("models", loss, NODES[1])
        place = ratio, loss, press
        values = [
            unknown.value(float(nodes[at]))
            for unknown, nodes, at in zip(UNKNOWNS, NODE_COORDINATES, place, strict=False)
        ]
        factors = Factors(**dict(zip(FIELDS, values, strict=False)))  # type: ignore[arg-type]
        for table, curve in zip(tables, curves, strict=True):
            table[place] = logarithms(curve, factors)
    sampled_ones = []
    for curve, table in zip(curves, tables, strict=True):
        joined = np.stack([table[place] for place in np.ndindex(NODES)])
        sampled_ones.append(
            SampledCurve(
                curve.test,
                GROUPS.index(GROUP_OF[curve.quantity]),
                joined.reshape(*NODES, *joined.shape[1:]),
                np.log(curve.y),
                relative_errors(curve),
                FIELDS.index(term) if (term := term_of(curve)) else -1,
            )
        )
    return sampled_ones


def logarithms(curve: MeasuredCurve, factors: Factors) -> Array:
    """Return logarithms of the models' values of a curve (open set-ups, points).

    A state that an actuator does not reach has IMPOSSIBLE times the measured value. Raises
    DesignError if no model gives the curve.
    """
    try:
        series = model_values(curve, factors, shares_maps=True).series
    except DesignError as error:
        raise DesignError(f"{curve.id}: {error}") from None
    rows = [[value or 0.0 for value in values] for values in series.values()]
    return np.asarray(np.log(np.maximum(rows, IMPOSSIBLE * np.array(curve.y))))


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


def left_out_fits(
    curves: Sequence[SampledCurve], progress: Progress, only: Collection[str] = ()
) -> Iterator[tuple[str, int, Posterior]]:
    """Yield fits that each leave out one test, every test in turn or each of ``only``: the test,
    the seed of its random numbers, and the posterior.

    Yields nothing if all curves are of one test.
    """
    tests = list(dict.fromkeys(curve.test for curve in curves))
    for done, test in enumerate(tests if len(tests) > 1 else ()):
        if only and test not in only:
            continue
        progress("held out", done, len(tests))
        seed = zlib.crc32(test.encode())
        yield test, seed, sampled([curve for curve in curves if curve.test != test], seed)


def predicted_points(
    curve: MeasuredCurve, values: SampledCurve, posterior: Posterior, seed: int
) -> list[HeldOutPoint]:
    """Return a curve's points with their intervals by a posterior."""
    drawn = posterior.predicted(values, np.random.default_rng(seed))
    ends = (1 - SHARE) / 2, 0.5, (1 + SHARE) / 2
    columns = np.exp(np.quantile(drawn, ends, axis=0)).T.tolist()
    return [
        HeldOutPoint(
            curve=curve.id,
            place=place,
            measured=y,
            median=median,
            low=low,
            high=high,
            unit=curve.y_unit,
            inside=low <= y <= high,
        )
        for (place, y, _), (low, median, high) in zip(curve.points(), columns, strict=True)
    ]


def sizes_of_groups(curves: Sequence[MeasuredCurve]) -> dict[str, SizeRange]:
    """Return the sizes of the actuators that were measured, by group of quantities."""
    by_group: dict[str, SizeRange] = {}
    for curve in curves:
        of = ModelledActuator(curve, Factors(**MIDDLES))
        sizes, group = sizes_of(of.design.form, of.laminate), GROUP_OF[curve.quantity]
        by_group[group] = by_group[group].joined(sizes) if group in by_group else sizes
    return by_group


def as_calibration(
    name: str,
    film: str,
    sources: Sequence[Evidence],
    posterior: Posterior,
    points: Sequence[HeldOutPoint],
    sizes: Mapping[str, SizeRange],
) -> ModelCalibration:
    """Return the calibration that a posterior stands for."""
    table = {
        "schema": "sbafab/calibration@2",
        "name": name,
        "about": "",
        "film": film,
        "evidence": [source.id for source in sources],
        "unknowns": FIELDS,
        "mean": posterior.mean.round(DIGITS).tolist(),
        "covariance": posterior.covariance.round(DIGITS + 2).tolist(),
        "discrepancy": {
            group: round(each, DIGITS) for group, each in posterior.discrepancy.items()
        },
        "sizes": {group: each.model_dump(exclude_none=True) for group, each in sizes.items()},
        "held_out": {"points": len(points), "inside": sum(point.inside for point in points)},
        "sentences": list(correlated(posterior.covariance)),
    }
    return ModelCalibration.model_validate(table)


def correlated(covariance: Array) -> Iterator[str]:
    """Yield the pairs of unknowns that are correlated by TOLD_APART or more either way."""
    deviations = np.sqrt(np.diag(covariance))
    table = covariance / np.outer(deviations, deviations)
    for (i, first), (j, second) in combinations(enumerate(UNKNOWNS), 2):
        if abs(table[i, j]) >= TOLD_APART:
            yield f"{first.title} and {second.title}: correlation {table[i, j]:.2f}"


def calibration_text(calibration: ModelCalibration) -> str:
    """Return the text of a calibration's file; comments at the top describe its unknowns."""
    lines = ["# Written by sbafab calibrate. Medians, with 90 % intervals in parentheses:"]
    for unknown in UNKNOWNS:
        low, high = calibration.bounds(unknown.field)
        value = unknown.shown(calibration.values[unknown.field])
        lines.append(f"# {unknown.title} {value} ({low:.3g} to {high:.3g})")
    return "\n".join(lines) + "\n\n" + tomli_w.dumps(calibration.as_dict())
