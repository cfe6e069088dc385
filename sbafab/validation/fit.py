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
    DESIGN_UNKNOWNS,
    FIELDS,
    GROUPS,
    SHARE,
    UNKNOWNS,
    ModelCalibration,
    SizeRange,
    bonding_products,
    sizes_of,
)
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Array
from sbafab.runtime import Progress
from sbafab.validation.evidence import Evidence, MeasuredCurve
from sbafab.validation.model_values import ModelledActuator, model_values
from sbafab.validation.posterior import (
    LEAST_ERROR,
    LONG,
    LOSS,
    NODE_COORDINATES,
    Posterior,
    SampledCurve,
    installed_emcee,
    sampled,
    set_up_probabilities,
)

DIGITS = 6
TOLD_APART = 0.3
"""Correlation from which two unknowns are said not to be told apart well."""
NO_CHANGE = 0.01
"""Change of a logarithm from end to end of an unknown which does not count."""
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
    reason.
    """

    calibration: ModelCalibration
    points: Sequence[HeldOutPoint]
    left_out: Sequence[tuple[str, str]]


def usable_curves(
    sources: Sequence[Evidence],
) -> tuple[list[MeasuredCurve], list[tuple[str, str]]]:
    """Return the curves usable for a calibration, and the others with their reasons."""
    curves, left_out = [], []
    for source in sources:
        for curve in source.curves:
            reason = "" if curve.comparable else curve.reason
            if not reason and not curve.discrepancy_group:
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
    """Return the calibration to sources of evidence.

    Raises DesignError if none of their curves can be fitted, or without emcee.
    """
    installed_emcee()
    usable, left_out = usable_curves(sources)
    if not usable:
        reasons = "; ".join(f"{curve}: {reason}" for curve, reason in left_out)
        raise DesignError(f"no curve can be fitted ({reasons})")
    films = sorted({film_of(curve) for curve in usable})
    if len(films) > 1:
        raise DesignError(
            f"the curves are of {len(films)} films ({', '.join(films)}); calibrate each separately"
        )
    curves = sampled_curves(usable, progress)
    progress("posterior", 0, 1)
    posterior = sampled(curves, steps=LONG)
    points = [
        point
        for test, seed, rest in left_out_fits(curves, [each.test for each in curves], progress)
        for source, curve in zip(usable, curves, strict=True)
        if curve.test == test
        for point in predicted_points(source, curve, rest, seed)
    ]
    sizes, set_ups = sizes_of_groups(usable), open_set_ups(usable, curves, posterior)
    return CalibrationFit(
        as_calibration(name, films[0], sources, posterior, points, sizes, set_ups), points, left_out
    )


def open_set_ups(
    measured: Sequence[MeasuredCurve], curves: Sequence[SampledCurve], posterior: Posterior
) -> dict[str, dict[str, float]]:
    """The candidate set-ups of each curve with an ambiguous source, with their probabilities."""
    shares = {}
    for source, curve in zip(measured, curves, strict=True):
        series = model_values(source, Factors(**MIDDLES)).series
        if len(series) > 1:
            probabilities = set_up_probabilities(curve, posterior).tolist()
            shares[source.id] = dict(zip(series, probabilities, strict=True))
    return shares


def film_of(curve: MeasuredCurve) -> str:
    """Return the products of the films of the measured actuator."""
    return " and ".join(bonding_products(ModelledActuator(curve, Factors(**MIDDLES)).laminate))


def sampled_curves(curves: Sequence[MeasuredCurve], progress: Progress) -> list[SampledCurve]:
    """Return curves in the form for the posterior: the models' values at all nodes of the unknowns
    that affect them.
    """
    sampled_ones = []
    for done, curve in enumerate(curves):
        progress("models", done, len(curves))
        axes = axes_of(curve)
        nodes = [NODE_COORDINATES[axis] for axis in axes]
        counts = [len(each) for each in nodes]
        # Maps of balloons depend on the pocket loss alone, and are kept for some losses only.
        order = sorted(
            np.ndindex(*counts), key=lambda at: [at[axes.index(LOSS)]] if LOSS in axes else []
        )
        table: dict[tuple[int, ...], Array] = {}
        for place in order:
            at = {axis: float(each[k]) for axis, each, k in zip(axes, nodes, place, strict=True)}
            table[place] = logarithms(curve, factors_at(at))
        joined = np.stack([table[place] for place in np.ndindex(*counts)])
        sampled_ones.append(
            SampledCurve(
                curve.test,
                curve.actuator_of_points,
                GROUPS.index(curve.discrepancy_group),
                axes,
                joined.reshape(*counts, *joined.shape[1:]),
                np.log(curve.y),
                relative_errors(curve),
                FIELDS.index(term) if (term := term_of(curve)) else -1,
            )
        )
    return sampled_ones


def factors_at(coordinates: Mapping[int, float]) -> Factors:
    """Return the factors with some unknowns at coordinates, by their column, the others at the
    middle of their priors; without delay and loss, which are terms of a figure.
    """
    values: dict[str, Any] = {
        unknown.field: unknown.value(coordinates[at]) if at in coordinates else unknown.middle
        for at, unknown in enumerate(UNKNOWNS[:DESIGN_UNKNOWNS])
    }
    return Factors(**values)


def axes_of(curve: MeasuredCurve) -> tuple[int, ...]:
    """Return the columns of the unknowns that affect the models' values of a curve."""
    axes = []
    for axis, nodes in enumerate(NODE_COORDINATES):
        ends = [logarithms(curve, factors_at({axis: float(nodes[end])})) for end in (0, -1)]
        if np.abs(ends[0] - ends[1]).max() > NO_CHANGE:
            axes.append(axis)
    return tuple(axes)


def logarithms(curve: MeasuredCurve, factors: Factors) -> Array:
    """Return logarithms of the models' values of a curve (open set-ups, points).

    A state that an actuator does not reach has IMPOSSIBLE times the measured value. Raises
    DesignError if no model predicts the curve.
    """
    try:
        series = model_values(curve, factors, shares_maps=True).series
    except DesignError as error:
        raise DesignError(f"{curve.id}: {error}") from None
    rows = [[value or 0.0 for value in values] for values in series.values()]
    return np.asarray(np.log(np.maximum(rows, IMPOSSIBLE * np.array(curve.y))))


def term_of(curve: MeasuredCurve) -> str:
    """Return the field of the unknown that is a term of a curve's values: the delay of times, or
    the share of work lost in a cycle; "" if there is none.
    """
    if curve.quantity == "time_s":
        return "water_delay" if curve.setup.fluid == "water" else "air_delay"
    return "loss_share" if curve.quantity == "loss_share" else ""


def relative_errors(curve: MeasuredCurve) -> Array:
    """Return standard errors of the logarithms of a curve's values (points,)."""
    stated = np.array([error or 0.0 for error in curve.errors])
    return np.asarray(np.maximum(stated / np.array(curve.y), LEAST_ERROR))


def left_out_fits(
    curves: Sequence[SampledCurve],
    keys: Sequence[str],
    progress: Progress,
    only: Collection[str] = (),
) -> Iterator[tuple[str, int, Posterior]]:
    """Yield fits that each leave out the curves of one key, such as their test or actuator. Every
    key in turn or each of ``only``: the key, the seed of its random numbers, and the posterior.
    Yields nothing if all curves have one key.
    """
    names = list(dict.fromkeys(keys))
    for done, name in enumerate(names if len(names) > 1 else ()):
        if only and name not in only:
            continue
        progress("held out", done, len(names))
        seed = zlib.crc32(name.encode())
        rest = [curve for curve, key in zip(curves, keys, strict=True) if key != name]
        yield name, seed, sampled(rest, seed)


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
    """Return the sizes of the measured actuators, by group of quantities."""
    by_group: dict[str, SizeRange] = {}
    for curve in curves:
        of = ModelledActuator(curve, Factors(**MIDDLES))
        sizes, group = sizes_of(of.design.form, of.laminate), curve.discrepancy_group
        by_group[group] = by_group[group].joined(sizes) if group in by_group else sizes
    return by_group


def as_calibration(
    name: str,
    film: str,
    sources: Sequence[Evidence],
    posterior: Posterior,
    points: Sequence[HeldOutPoint],
    sizes: Mapping[str, SizeRange],
    set_ups: Mapping[str, Mapping[str, float]],
) -> ModelCalibration:
    """Return a posterior as a calibration."""
    table = {
        "schema": "sbafab/calibration@3",
        "name": name,
        "about": "",
        "film": film,
        "evidence": [source.id for source in sources],
        "unknowns": FIELDS,
        "mean": posterior.mean.round(DIGITS).tolist(),
        "covariance": posterior.covariance.round(DIGITS + 2).tolist(),
        "pressing_spread": round(float(np.median(posterior.spread)), DIGITS),
        "set_ups": {
            curve: {phrase: round(share, 4) for phrase, share in shares.items()}
            for curve, shares in set_ups.items()
        },
        "discrepancy": {
            group: round(each, DIGITS) for group, each in posterior.discrepancy.items()
        },
        "sizes": {group: each.model_dump(exclude_none=True) for group, each in sizes.items()},
        "held_out": {"points": len(points), "inside": sum(point.inside for point in points)},
        "sentences": list(correlated(posterior.covariance)),
    }
    return ModelCalibration.model_validate(table)


def correlated(covariance: Array) -> Iterator[str]:
    """Yield the pairs of unknowns with a correlation of magnitude TOLD_APART or more."""
    deviations = np.sqrt(np.diag(covariance))
    table = covariance / np.outer(deviations, deviations)
    for (i, first), (j, second) in combinations(enumerate(UNKNOWNS), 2):
        if abs(table[i, j]) >= TOLD_APART:
            yield f"{first.title} and {second.title}: correlation {table[i, j]:.2f}"


def calibration_text(calibration: ModelCalibration) -> str:
    """Return the text of a calibration file; comments at the top describe its unknowns."""
    lines = ["# Written by sbafab calibrate. Medians, with 90 % intervals in parentheses:"]
    for unknown in UNKNOWNS:
        low, high = calibration.bounds(unknown.field)
        value = unknown.shown(calibration.values[unknown.field])
        lines.append(f"# {unknown.title} {value} ({low:.3g} to {high:.3g})")
    return "\n".join(lines) + "\n\n" + tomli_w.dumps(calibration.as_dict())
