"""Evaluation of a lab's records: success rates, and measured against predicted values.

Designs of the same actuator (``RecordedDesign.actuator``) count as one. A repaired and retested
actuator counts with its first attempt.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from statistics import fmean, stdev
from typing import Literal

from sbafab.documents import Document, attribute
from sbafab.errors import DesignError
from sbafab.lab.builds import RecordedDesign
from sbafab.lab.coupon import student_t
from sbafab.lab.records import NUMBERS, PASS, Record, standing
from sbafab.reports.charts import ChartCurve, Panel, chart_svg
from sbafab.rules.registration_yield import Share

By = Literal["all", "design", "kit", "method", "operator"]
Agreement = Literal["agrees", "differs", "one measurement", "not predicted"]
UNSAID = "not said"


@dataclass(frozen=True)
class Built:
    """A built actuator: its ``records`` by attempt, the ``build`` of the first record, and the name
    of its ``design`` in the report.
    """

    design: str
    build: RecordedDesign
    records: tuple[Record, ...]

    def first(self, name: str) -> str:
        """Return the first non-empty text of this name; empty if there is none."""
        return next((text for record in self.records if (text := getattr(record, name))), "")

    @property
    def numbers(self) -> dict[str, float]:
        """The measured values, from the first attempt with any."""
        return {k: v for record in reversed(self.records) for k, v in record.numbers.items()}

    @property
    def passed(self) -> bool:
        """True if the first leak test passed."""
        return self.first("leak") == PASS

    @property
    def passed_later(self) -> bool:
        """True if only a later attempt passed the leak test."""
        return not self.passed and any(record.leak == PASS for record in self.records)


@dataclass(frozen=True)
class Success:
    """The number of actuators in a group that passed the leak test at the first attempt, and the
    number tested.

    ``passed_later`` counts those that passed at a later attempt. ``promised`` is the share of good
    builds by rule registration-yield; None for a group of several designs.
    """

    by: By
    name: str
    share: Share
    passed_later: int
    promised: float | None = None


@dataclass(frozen=True)
class Comparison:
    """The measured mean of a quantity of a design compared with its prediction, all in ``unit``.

    ``mean`` is over ``count`` actuators. ``low`` and ``high``, the ends of its 95 % interval in
    that unit, are None for one measurement; ``predicted`` and ``ratio``, measured over predicted,
    are None without a model.
    """

    design: str
    quantity: str
    unit: str
    count: int
    mean: float
    low: float | None
    high: float | None
    predicted: float | None
    model: str
    ratio: float | None
    verdict: Agreement


@dataclass(frozen=True)
class Report:
    """The whole report; ``records`` counts every row, ``items`` the actuators."""

    records: int
    items: int
    success: tuple[Success, ...]
    comparisons: tuple[Comparison, ...]


class SuccessDocument(Document):
    """A share of actuators that passed, with its 95 % interval."""

    by: By
    name: str
    passed: int = attribute("share.good")
    tested: int = attribute("share.builds")
    share: float = attribute("share.value")
    low: float = attribute("share.interval.0")
    high: float = attribute("share.interval.1")
    promised: float | None
    """from registration-yield; null for several designs"""
    passed_later: int


class ReportDocument(Document, schema="sbafab/report@1"):
    """A report; every value is a share or has an adjacent unit."""

    records: int
    actuators: int = attribute("items")
    success: list[SuccessDocument]
    measured: list[Comparison] = attribute("comparisons")


def report(records: Sequence[Record], builds: Mapping[str, RecordedDesign]) -> Report:
    """Evaluate the records; ``builds`` must include every recorded design."""
    actuators = items(records, builds)
    success = tuple(_success([item for item in actuators if item.first("leak")]))
    return Report(len(records), len(actuators), success, tuple(_comparisons(actuators, builds)))


def items(records: Iterable[Record], builds: Mapping[str, RecordedDesign]) -> list[Built]:
    """Return the actuators, by design and serial, in the order of their first record."""
    groups: dict[tuple[str, str], list[Record]] = defaultdict(list)
    for record in standing(records):
        groups[builds[record.design_sha256].actuator, record.serial].append(record)
    named: dict[str, dict[str, None]] = defaultdict(dict)
    for build in builds.values():
        named[build.actuator][build.name] = None
    names = {actuator: ", ".join(designs) for actuator, designs in named.items()}
    counts = Counter(names.values())
    actuators = []
    for (actuator, _), group in groups.items():
        ordered = sorted(group, key=lambda record: record.attempt)
        # Designs of the same name get the hash's first digits.
        name = names[actuator]
        name = name if counts[name] == 1 else f"{name} {actuator[:8]}"
        actuators.append(Built(name, builds[ordered[0].design_sha256], tuple(ordered)))
    return actuators


def _groups(
    actuators: Iterable[Built], key: Callable[[Built], str]
) -> list[tuple[str, list[Built]]]:
    groups: dict[str, list[Built]] = defaultdict(list)
    for item in actuators:
        groups[key(item)].append(item)
    return sorted(groups.items())


def _success(tested: Sequence[Built]) -> Iterable[Success]:
    groupings: dict[By, Callable[[Built], str]] = {
        "all": lambda _: "all",
        "design": lambda item: item.design,
        "kit": lambda item: item.first("kit") or UNSAID,
        "method": lambda item: item.build.method,
        "operator": lambda item: item.first("operator") or UNSAID,
    }
    for by, key in groupings.items():
        for name, group in _groups(tested, key):
            share = Share(sum(item.passed for item in group), len(group))
            promised = fmean(item.build.promise for item in group)
            later = sum(item.passed_later for item in group)
            is_one = len({item.design for item in group}) == 1
            yield Success(by, name, share, later, promised if is_one else None)


def _comparisons(
    actuators: Sequence[Built], builds: Mapping[str, RecordedDesign]
) -> Iterable[Comparison]:
    newest = {build.actuator: build for build in builds.values()}
    for design, group in _groups(actuators, lambda item: item.design):
        for quantity, unit in NUMBERS.items():
            values = [item.numbers[quantity] for item in group if quantity in item.numbers]
            if not values:
                continue
            predicted, model = newest[group[0].build.actuator].predicted.get(quantity, (None, ""))
            mean, count, half = fmean(values), len(values), math.inf
            if count > 1:
                # Student's 95 % interval of the mean.
                half = student_t(count - 1) * stdev(values) / math.sqrt(count)
            verdict: Agreement = "one measurement" if count == 1 else "differs"
            if predicted is None:
                verdict = "not predicted"
            elif count > 1 and abs(predicted - mean) <= half:
                verdict = "agrees"
            low, high = (None, None) if count == 1 else (mean - half, mean + half)
            ratio = mean / predicted if predicted else None
            yield Comparison(
                design, quantity, unit, count, mean, low, high, predicted, model, ratio, verdict
            )


RECENT = 20  # number of actuators in the moving share
MOST_DRAWN = 400
"""Most points of a curve; with more actuators only every second, third ... is drawn."""


def success_svg(records: Sequence[Record], builds: Mapping[str, RecordedDesign]) -> str:
    """Return the chart of success over the actuators, in the order of their first records.

    It shows the cumulative share with its 95 % interval, and the share of the last RECENT
    actuators. Raises DesignError without a leak test.
    """
    passed = [item.passed for item in items(records, builds) if item.first("leak")]
    if not passed:
        raise DesignError("no leak test is recorded yet; record one, such as --leak pass")
    totals = [*accumulate(passed)]
    counts = range(len(passed), 0, -math.ceil(len(passed) / MOST_DRAWN))[::-1]
    so_far = [Share(totals[count - 1], count) for count in counts]
    recent = [count for count in counts if count >= RECENT]
    last = [fmean(passed[count - RECENT : count]) for count in recent]
    curves = [
        ChartCurve("all so far", counts, [share.value for share in so_far], dotted=True),
        ChartCurve("95 % interval", counts, [share.interval[0] for share in so_far], True),
        ChartCurve("", counts, [share.interval[1] for share in so_far], True),
        ChartCurve(f"last {RECENT}", recent, last),
    ]
    panel = Panel(
        "Leak test passed at the first attempt",
        "actuators tested",
        "share that passed",
        [curve for curve in curves if curve.x],
    )
    return chart_svg(f"Success of {len(passed)} actuators", [panel])
