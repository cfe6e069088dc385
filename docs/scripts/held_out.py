"""Coverage and sharpness of the calibration's intervals: docs/measured/held_out.json.

python -m docs.scripts.held_out takes about fifteen minutes; it needs the extra "calibrate". Each
curve is predicted by a fit without its test, and by one without its actuator. What right intervals
would hold is drawn from the same predictions, as those have points of one test depend on each
other. Variants leave out what the calibration assumes beyond one loss of pocket radius for all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from datetime import date
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from docs.scripts.measured import Record, keep, texts, versions
from docs.scripts.tables import Table
from sbafab.models.calibration import BENT, FIELDS, GROUPS
from sbafab.validation.comparison import curve_intervals, uncertainty_for
from sbafab.validation.evidence import Evidence, MeasuredCurve, load_evidence
from sbafab.validation.fit import (
    as_calibration,
    film_of,
    left_out_fits,
    sampled_curves,
    sizes_of_groups,
    usable_curves,
)
from sbafab.validation.posterior import Posterior, SampledCurve

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array

COMMAND = "python -m docs.scripts.held_out"
NAME = "held_out"
SHARES = (0.5, 0.8, 0.9, 0.95)
"""Probabilities of the intervals whose coverage is counted."""
POINTS = (
    "curve",
    "test",
    "at",
    "measured",
    "predicted",
    "low",
    "high",
    "rank",
    "predict low",
    "predict high",
)
COVERAGE = (
    "left out",
    "interval",
    "points inside",
    "right intervals would hold",
    "that many or more by chance",
    "curves inside",
)
SOURCES = ("source", "values", "held out", "curves", "tests", "in 90 % intervals", "not predicted")
VARIANTS = (
    "calibration",
    "left out",
    "log score",
    "in 90 % intervals",
    "axial force, a factor",
    "height, a factor",
)
ALL = "all"
KEYS: Mapping[str, Callable[[SampledCurve], str]] = {
    "test": lambda curve: curve.test,
    "actuator": lambda curve: curve.actuators[0],
}
"""What is left out, and the key of a curve by which it is."""


def _with_axial(curve: SampledCurve) -> SampledCurve:
    is_bent = GROUPS[curve.group] == BENT
    return curve._replace(group=GROUPS.index("force")) if is_bent else curve


def _with_one_loss(curve: SampledCurve) -> SampledCurve:
    return curve._replace(actuators=(ALL,) * len(curve.actuators))


def _unloaded(curve: SampledCurve) -> SampledCurve:
    column = FIELDS.index("tip_load")
    if column not in curve.axes:
        return curve
    table = curve.table.take(0, curve.axes.index(column))
    return curve._replace(axes=tuple(axis for axis in curve.axes if axis != column), table=table)


CHANGES: Mapping[str, Sequence[Callable[[SampledCurve], SampledCurve]]] = {
    "as it is": (),
    "bent forces miss as axial ones do": (_with_axial,),
    "one pocket loss for all actuators": (_with_one_loss,),
    "nothing on the tip": (_unloaded,),
    "all three": (_with_axial, _with_one_loss, _unloaded),
}
"""Calibrations that are scored: what they do to the curves."""


class LeftOutCurve(NamedTuple):
    """A curve, its prediction by the fit without its test, drawn logarithms (n, points) of what
    would be measured, and the 90 % intervals (mm, N, ...) as ``predict`` states them.
    """

    source: str
    measured: MeasuredCurve
    curve: SampledCurve
    drawn: Array
    stated: Sequence[tuple[float, float] | None]

    def ranks(self, values: Array) -> Array:
        """Return the share of the drawn values below each one (rows, points): its rank."""
        ordered = np.sort(self.drawn, axis=0)
        pairs = zip(ordered.T, values.T, strict=True)
        return np.stack([np.searchsorted(*pair) for pair in pairs], -1) / len(ordered)


def left_out_curves(
    sources: Sequence[Evidence], only: Collection[str] = ()
) -> Iterator[LeftOutCurve]:
    """Yield each curve that the models can predict, or those of ``only`` some tests, by a fit to all
    of its source but its test.
    """
    for source in sources:
        usable, _ = usable_curves([source])
        if usable:
            curves = sampled_curves(usable, _print_progress)
            yield from _left_out("test", source, usable, curves, only)


def _left_out(
    what: str,
    source: Evidence,
    usable: Sequence[MeasuredCurve],
    curves: Sequence[SampledCurve],
    only: Collection[str] = (),
) -> Iterator[LeftOutCurve]:
    """Yield curves by fits without their test or their actuator; ``predict`` is asked for the
    former.
    """
    keys = [KEYS[what](curve) for curve in curves]
    for key, seed, posterior in left_out_fits(curves, keys, _print_progress, only):
        generator = np.random.default_rng(seed)
        for measured, curve, its in zip(usable, curves, keys, strict=True):
            if its == key:
                drawn = posterior.predicted(curve, generator)
                is_asked = what == "test"
                none = [None] * len(measured.y)
                stated = _stated(source, measured, posterior) if is_asked else none
                # What is left out together stands together in a draw.
                yield LeftOutCurve(source.id, measured, curve._replace(test=key), drawn, stated)


def _print_progress(step: str, done: int, total: int) -> None:
    print(step, done, total, flush=True)


def _stated(
    source: Evidence, measured: MeasuredCurve, posterior: Posterior
) -> Sequence[tuple[float, float] | None]:
    rest, _ = usable_curves([source])
    sizes = sizes_of_groups([curve for curve in rest if curve.test != measured.test])
    calibration = as_calibration(NAME, film_of(measured), [source], posterior, [], sizes, {})
    intervals = curve_intervals(measured, uncertainty_for(measured, calibration))
    return intervals or [None] * len(measured.y)


def variant_rows(curves: Sequence[SampledCurve]) -> Iterator[list[str]]:
    """Yield a row a variant and what is left out, by VARIANTS: the sum of the log scores of all
    curves, and the median half widths of the 90 % intervals as factors.
    """
    for name, changes in CHANGES.items():
        changed = list(curves)
        for change in changes:
            changed = [change(curve) for curve in changed]
        for what, key_of in KEYS.items():
            keys = [key_of(curve) for curve in curves]
            score, inside, wide = 0.0, 0, {"force": [], "motion": []}  # type: ignore[var-annotated]
            for key, seed, posterior in left_out_fits(changed, keys, _print_progress):
                generator = np.random.default_rng(seed)
                for old, curve, its in zip(curves, changed, keys, strict=True):
                    if its != key:
                        continue
                    score += posterior.log_score(curve)
                    drawn = posterior.predicted(curve, generator)
                    low, high = np.quantile(drawn, (0.05, 0.95), axis=0)
                    inside += int(((low < curve.measured) & (curve.measured < high)).sum())
                    wide.get(GROUPS[old.group], []).extend(((high - low) / 2).tolist())
            factors = [f"{math.exp(float(np.median(each))):.2f}" for each in wide.values()]
            yield [name, what, f"{score:.1f}", f"{inside}", *factors]


def point_rows(curves: Sequence[LeftOutCurve]) -> Iterator[list[str]]:
    """Yield a row a point, by POINTS."""
    for each in curves:
        ranks = each.ranks(each.curve.measured[None])[0]
        low, median, high = np.exp(np.quantile(each.drawn, (0.05, 0.5, 0.95), axis=0))
        places = each.measured.x or ("",) * len(ranks)
        for n, place in enumerate(places):
            values = each.measured.y[n], median[n], low[n], high[n], ranks[n]
            ends = each.stated[n] or ("", "")
            yield [
                f"{each.source}: {each.measured.id}",
                each.curve.test,
                f"{place}",
                *(f"{value:.4g}" for value in values),
                *(end if isinstance(end, str) else f"{end:.4g}" for end in ends),
            ]


def coverage_rows(what: str, curves: Sequence[LeftOutCurve]) -> Iterator[list[str]]:
    """Yield a row an interval, by COVERAGE, of curves left out by their test or actuator."""
    tests = dict.fromkeys((each.source, each.curve.test) for each in curves)
    ranks = [each.ranks(each.curve.measured[None])[0] for each in curves]
    for share in SHARES:
        inside = [np.abs(rank - 0.5) < share / 2 for rank in ranks]
        held, points = sum(int(one.sum()) for one in inside), sum(map(len, inside))
        whole = sum(bool(one.all()) for one in inside)
        # Points of one test stand together in a draw, tests are drawn apart.
        numbers, expected = np.random.default_rng(0), np.zeros(0)
        for source, test in tests:
            group = [each for each in curves if (each.source, each.curve.test) == (source, test)]
            count = sum((np.abs(each.ranks(each.drawn) - 0.5) < share / 2).sum(1) for each in group)
            drawn = numbers.permutation(count)
            expected = expected + drawn if expected.size else drawn
        yield [
            what,
            f"{100 * share:g} %",
            f"{held} of {points}",
            f"{expected.mean():.1f} +- {expected.std():.1f}",
            f"{100 * (expected >= held).mean():.0f} %",
            f"{whole} of {len(curves)}",
        ]


def source_rows(sources: Sequence[Evidence], curves: Sequence[LeftOutCurve]) -> Iterator[list[str]]:
    """Yield a row a source and one of all, by SOURCES."""
    totals = np.zeros(5, dtype=int)
    for source in sources:
        mine = [each for each in curves if each.source == source.id]
        ranks = [each.ranks(each.curve.measured[None])[0] for each in mine]
        inside = sum(int((np.abs(rank - 0.5) < 0.45).sum()) for rank in ranks)
        points, tests = sum(map(len, ranks)), len({each.curve.test for each in mine})
        values = sum(len(curve.y) for curve in source.curves)
        counts = np.array([values, points, len(mine), tests, inside])
        totals += counts
        reasons = "; ".join(f"{name}: {why}" for name, why in usable_curves([source])[1])
        yield [source.id, *texts([counts.tolist()])[0], reasons]
    yield [ALL, *texts([totals.tolist()])[0], ""]


def main() -> None:
    """Predict all curves and keep the record."""
    sources = [load_evidence("paper")]
    by_test: list[LeftOutCurve] = []
    by_actuator: list[LeftOutCurve] = []
    variants: list[list[str]] = []
    for source in sources:
        usable, _ = usable_curves([source])
        if usable:
            curves = sampled_curves(usable, _print_progress)
            by_test += _left_out("test", source, usable, curves)
            by_actuator += _left_out("actuator", source, usable, curves)
            variants += variant_rows(curves)
    coverage = [*coverage_rows("test", by_test), *coverage_rows("actuator", by_actuator)]
    tables = {
        "sources": Table(SOURCES, list(source_rows(sources, by_test))),
        "coverage": Table(COVERAGE, coverage),
        "variants": Table(VARIANTS, variants),
        "points": Table(POINTS, list(point_rows(by_test))),
    }
    used = versions(sbafab="sbafab", emcee="emcee", numpy="numpy")
    keep(NAME, Record(COMMAND, date.today().isoformat(), used, tables))


if __name__ == "__main__":
    main()
