"""Control charts: p, u, individuals with moving range, EWMA; run rules; capability.

Formulas as in the NIST/SEMATECH e-Handbook of Statistical Methods, 6.1.6 and 6.3. Run rules are
those of Western Electric (Statistical Quality Control Handbook, 1956). All four together signal
once in 92 points of a stable process (Champ and Woodall, Technometrics 29, 1987).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist, fmean, stdev
from typing import Any, Literal, NamedTuple

from sbafab.errors import DesignError

D2 = 1.128
"""Mean range of two values of a normal distribution, in standard deviations."""
D4 = 3.267
"""Upper limit of a range of two over its mean."""
WEIGHT = 0.2
"""Of the newest value in an EWMA."""
FEWEST = 3
"""Points of a chart."""
ChartKind = Literal["p", "u", "individuals", "moving range", "EWMA"]
RULES = {
    1: "one point beyond 3 sigma",
    2: "two of three points beyond 2 sigma on one side",
    3: "four of five points beyond 1 sigma on one side",
    4: "eight points in a row on one side of the centre",
}
"""Western Electric."""


class Signal(NamedTuple):
    """A point, counted from 0, at which a rule of RULES speaks."""

    point: int
    rule: int


@dataclass(frozen=True)
class ControlChart:
    """Points of a chart with centre and limits, a value a point, in the quantity's unit."""

    kind: ChartKind
    values: tuple[float, ...]
    centre: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    signals: tuple[Signal, ...]

    def as_dict(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "values": list(self.values),
            "centre": list(self.centre),
            "lower": list(self.lower),
            "upper": list(self.upper),
            "signals": [
                {"point": signal.point, "rule": signal.rule, "words": RULES[signal.rule]}
                for signal in self.signals
            ],
        }


def western_electric(z: Sequence[float], rules: Sequence[int] = tuple(RULES)) -> Iterator[Signal]:
    """Yield the signals of standardised points, a rule at most once a point, at its last point.

    ``z`` are distances from the centre in standard deviations.
    """
    windows = {1: (1, 1, 3.0), 2: (2, 3, 2.0), 3: (4, 5, 1.0), 4: (8, 8, 0.0)}
    for last in range(len(z)):
        for rule in rules:
            least, length, beyond = windows[rule]
            points = z[max(0, last + 1 - length) : last + 1]
            for side in (1, -1):
                # The newest point is among those that count: the rule speaks once for each.
                if side * z[last] > beyond and sum(side * x > beyond for x in points) >= least:
                    yield Signal(last, rule)


def proportions_chart(
    failures: Sequence[int], sizes: Sequence[int], baseline: int | None = None
) -> ControlChart:
    """Return the p chart of ``failures`` among ``sizes`` units of each group.

    Centre and limits come from the first ``baseline`` groups, by default from all.
    """
    _check_counts(failures[:baseline], sizes[:baseline])
    centre = sum(failures[:baseline]) / sum(sizes[:baseline])
    sigmas = [math.sqrt(centre * (1 - centre) / size) for size in sizes]
    values = [count / size for count, size in zip(failures, sizes, strict=True)]
    return _attributes_chart("p", values, centre, sigmas, 1.0)


def defects_chart(
    defects: Sequence[int], units: Sequence[int], baseline: int | None = None
) -> ControlChart:
    """Return the u chart: defects per unit, of ``defects`` on ``units`` of each group.

    Centre and limits come from the first ``baseline`` groups, by default from all.
    """
    _check_counts(defects[:baseline], units[:baseline])
    centre = sum(defects[:baseline]) / sum(units[:baseline])
    sigmas = [math.sqrt(centre / count) for count in units]
    values = [count / size for count, size in zip(defects, units, strict=True)]
    return _attributes_chart("u", values, centre, sigmas, math.inf)


def _check_counts(counts: Sequence[int], sizes: Sequence[int]) -> None:
    if len(counts) < 2 or min(sizes) < 1 or min(counts) < 0:
        raise DesignError("a chart of counts needs two groups or more, each of a unit or more")


def _attributes_chart(
    kind: ChartKind, values: Sequence[float], centre: float, sigmas: Sequence[float], most: float
) -> ControlChart:
    """Return a chart whose limits vary with the groups; zone rules do not hold for counts."""
    z = [
        (value - centre) / sigma if sigma else 0.0
        for value, sigma in zip(values, sigmas, strict=True)
    ]
    return ControlChart(
        kind,
        tuple(values),
        (centre,) * len(values),
        tuple(max(0.0, centre - 3 * sigma) for sigma in sigmas),
        tuple(min(most, centre + 3 * sigma) for sigma in sigmas),
        tuple(western_electric(z, (1, 4))),
    )


def sigma_of(values: Sequence[float]) -> float:
    """Return the standard deviation from one value to the next: mean moving range over 1.128."""
    return fmean(_moving_ranges(values)) / D2


def _moving_ranges(values: Sequence[float]) -> list[float]:
    if len(values) < FEWEST:
        raise DesignError(f"a chart of single values needs {FEWEST} or more; there are fewer")
    return [abs(b - a) for a, b in zip(values, values[1:], strict=False)]


def individuals_chart(values: Sequence[float], baseline: int | None = None) -> ControlChart:
    """Return the chart of single values, with limits from the moving range.

    Centre and limits come from the first ``baseline`` values, by default from all.
    """
    centre, sigma = fmean(values[:baseline]), sigma_of(values[:baseline])
    count = len(values)
    return ControlChart(
        "individuals",
        tuple(values),
        (centre,) * count,
        (centre - 3 * sigma,) * count,
        (centre + 3 * sigma,) * count,
        tuple(western_electric([(v - centre) / sigma if sigma else 0.0 for v in values])),
    )


def moving_range_chart(values: Sequence[float], baseline: int | None = None) -> ControlChart:
    """Return the chart of the ranges from one value to the next; its first is that to value 2.

    Centre and limit come from the first ``baseline`` values, by default from all.
    """
    ranges = _moving_ranges(values)
    centre, count = fmean(_moving_ranges(values[:baseline])), len(ranges)
    upper = D4 * centre
    signals = tuple(Signal(n, 1) for n, value in enumerate(ranges) if value > upper)
    zeros = (0.0,) * count
    return ControlChart(
        "moving range", tuple(ranges), (centre,) * count, zeros, (upper,) * count, signals
    )


def ewma_chart(
    values: Sequence[float],
    target: float | None = None,
    sigma: float | None = None,
    weight: float = WEIGHT,
) -> ControlChart:
    """Return the chart of exponentially weighted averages, with limits that hold from the start.

    ``target`` and ``sigma`` are those of a stable process; by default the mean of the values and
    their deviation by moving range.
    """
    target = fmean(values) if target is None else target
    sigma = sigma_of(values) if sigma is None else sigma
    averages, average = [], target
    for value in values:
        average = weight * value + (1 - weight) * average
        averages.append(average)
    spans = [
        3 * sigma * math.sqrt(weight / (2 - weight) * (1 - (1 - weight) ** (2 * (n + 1))))
        for n in range(len(values))
    ]
    signals = [
        Signal(n, 1)
        for n, (average, span) in enumerate(zip(averages, spans, strict=True))
        if abs(average - target) > span
    ]
    return ControlChart(
        "EWMA",
        tuple(averages),
        (target,) * len(values),
        tuple(target - span for span in spans),
        tuple(target + span for span in spans),
        tuple(signals),
    )


# Capability.


class ControlLimits(NamedTuple):
    """Specification limits of a quantity; None where there is none on that side."""

    low: float | None
    high: float | None


@dataclass(frozen=True)
class Capability:
    """Process capability against limits, with intervals of 95 %; None where it has no meaning.

    ``sigma`` is the standard deviation of all values, ``within`` that from one value to the next.
    """

    limits: ControlLimits
    count: int
    mean: float
    sigma: float
    within: float
    cp: float | None
    cp_interval: tuple[float, float] | None
    cpk: float
    cpk_interval: tuple[float, float]

    def as_dict(self) -> dict[str, Any]:
        plain = {name: getattr(self, name) for name in ("count", "mean", "sigma", "within")}
        return {
            "low": self.limits.low,
            "high": self.limits.high,
            **plain,
            "cp": self.cp,
            "cp_interval": None if self.cp_interval is None else list(self.cp_interval),
            "cpk": self.cpk,
            "cpk_interval": list(self.cpk_interval),
        }


def capability(values: Sequence[float], limits: ControlLimits) -> Capability:
    """Return Cp and Cpk of ``values``; their spread is that of all of them.

    The interval of Cp is that of a normal distribution's deviation, that of Cpk Bissell's
    approximation (e-Handbook 6.1.6). Raises DesignError where there are too few values, where they
    are all equal, or without scipy.
    """
    if len(values) < FEWEST or stdev(values) == 0:
        raise DesignError(f"capability needs {FEWEST} values or more that are not all equal")
    mean, sigma, count = fmean(values), stdev(values), len(values)
    sides = [] if limits.high is None else [(limits.high - mean) / (3 * sigma)]
    sides += [] if limits.low is None else [(mean - limits.low) / (3 * sigma)]
    if not sides:
        raise DesignError("capability needs a limit; give one, such as --limit stroke_mm=16:18")
    cpk = min(sides)
    half = NormalDist().inv_cdf(0.975) * math.sqrt(1 / (9 * count) + cpk**2 / (2 * (count - 1)))
    whole = Capability(
        *(limits, count, mean, sigma, sigma_of(values), None, None),
        *(cpk, (cpk - half, cpk + half)),
    )
    if limits.low is None or limits.high is None:
        return whole
    cp = (limits.high - limits.low) / (6 * sigma)
    return replace(whole, cp=cp, cp_interval=_cp_interval(cp, count))


def _cp_interval(cp: float, count: int) -> tuple[float, float]:
    chi2 = statistics().chi2
    low, high = (math.sqrt(chi2.ppf(share, count - 1) / (count - 1)) for share in (0.025, 0.975))
    return float(cp * low), float(cp * high)


def statistics() -> Any:
    """Return scipy's module of statistics. Raises DesignError where it is not installed."""
    try:
        from scipy import stats
    except ImportError:
        raise DesignError(
            'scipy is not installed; add it with pip install "sbafab[quality]"'
        ) from None
    return stats
