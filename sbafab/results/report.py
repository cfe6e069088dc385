"""Evaluation of a lab's records: success, measured against predicted, tolerances.

Designs that build the same actuator (``Build.actuator``) count as one. An actuator that was mended
and tested again counts by its first attempt.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import mean, stdev
from typing import Any, Literal, NamedTuple

from sbafab.cutting.calibration import Value, student_t
from sbafab.errors import DesignError
from sbafab.results.records import ERRORS, NUMBERS, PASS, TOLERANCES, Build, Record
from sbafab.results.store import rebuilt, yield_with
from sbafab.rules.registration_yield import Share

# Intervals of 95 % for what a few measurements say, by closed formulas.


DOUBT = 0.05


class Most(NamedTuple):
    """The largest of some errors, and the most that it leaves room for (95 %).

    An error is never larger than its tolerance, so the tolerance lies between both.
    """

    errors: int
    largest: float
    highest: float


def mean_of(values: Sequence[float]) -> Value | None:
    """Return the mean with Student's interval; None for fewer than two values."""
    if len(values) < 2:
        return None
    uncertainty = stdev(values) / math.sqrt(len(values))
    return Value(mean(values), uncertainty, student_t(len(values) - 1) * uncertainty)


def most_of(errors: Sequence[float], dimensions: int) -> Most:
    """The bound of errors that are spread evenly within it, as registration-yield assumes.

    On a line (1 dimension) the largest of n stays below m with (m / bound) ** n, over a disc (2)
    with (m / bound) ** 2n; the highest bound is the one under which that is 5 %.
    """
    largest = max(errors)
    return Most(len(errors), largest, largest / DOUBT ** (1 / (dimensions * len(errors))))


By = Literal["all", "design", "kit", "method", "operator"]
UNSAID = "not said"
CUT = "cut_mm"
DIMENSIONS = {"offset_mm": 2, "turn_deg": 1, CUT: 1}
"""Of the space that an error is spread over."""
ERROR_NAMES = {"offset_mm": "placement", "turn_deg": "turn", CUT: "cutting"}
"""What rule registration-yield calls a measured error."""


@dataclass(frozen=True)
class Built:
    """An actuator that was built: all that its records say together.

    ``actuator`` is the hash of what was built, ``design_sha256`` that of the design it was first
    recorded with. ``leak`` is the first attempt's; ``passed_later`` whether a later one passed.
    """

    actuator: str
    design_sha256: str
    serial: str
    design: str
    method: str
    kit: str
    operator: str
    leak: str
    numbers: Mapping[str, float]
    errors: Mapping[str, tuple[float, ...]]
    passed_later: bool = False


@dataclass(frozen=True)
class Success:
    """Actuators of a group that passed the leak test at once, of those that were tested.

    ``passed_later`` more passed at a later attempt.
    """

    by: By
    name: str
    share: Share
    passed_later: int


@dataclass(frozen=True)
class Comparison:
    """The mean of a quantity of a design against what was predicted, all in ``unit``.

    ``mean`` is that of ``count`` actuators in ``unit``; ``low`` and ``high``, its 95 % interval in
    this unit, are None for a single measurement, ``predicted`` (same unit) where no model gives it.
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

    @property
    def ratio(self) -> float | None:
        """Measured over predicted."""
        return self.mean / self.predicted if self.predicted else None

    @property
    def verdict(self) -> str:
        """The place of the prediction relative to the interval of the mean, in words."""
        if self.predicted is None:
            return "not predicted"
        if self.low is None or self.high is None:
            return "one measurement"
        return "agrees" if self.low <= self.predicted <= self.high else "differs"


@dataclass(frozen=True)
class Tolerance:
    """Measured errors against the tolerance that designs built with a kit state.

    ``stated`` is the design's key in ``unit``, ``found`` what was measured. ``operator`` whose hand
    it was; "" for the laser, which cuts alike for all.
    """

    kit: str
    operator: str
    quantity: str
    unit: str
    key: str
    stated: float
    found: Most

    @property
    def verdict(self) -> str:
        """The measured errors relative to the stated tolerance, in words."""
        if self.found.largest > self.stated:
            return "too small"
        return "holds" if self.stated <= self.found.highest else "wider than needed"


class MeasuredYield(NamedTuple):
    """The share of random builds that keep every limit with the errors that were measured.

    ``low`` at the most that the measured errors leave room for, ``high`` at the largest measured;
    each end takes its own 95 % interval of the draws. ``tolerances`` are those ends by key.
    """

    low: float
    high: float
    tolerances: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Promise:
    """Success of a design against what rule registration-yield promises.

    ``promised`` is the share by the stated tolerances, ``measured`` that by the errors that were
    recorded with the same kits and hands; None where there are none, or the design cannot be read
    again. ``is_stated_enough`` is False where a larger error than stated was measured.
    """

    design: str
    success: Share
    promised: float
    measured: MeasuredYield | None
    is_stated_enough: bool

    @property
    def verdict(self) -> str:
        """Return how success compares with the yield by measured errors, or else by stated ones."""
        errors = "stated tolerances" if self.measured is None else "measured errors"
        lowest, highest = (self.measured or (self.promised, self.promised))[:2]
        low, high = self.success.interval
        if high < lowest:
            return f"fewer hold than the {errors} promise"
        if self.measured is None and not self.is_stated_enough:
            return "not comparable: larger errors than stated were measured"
        if low > highest:
            return f"more hold than the limits ask, by the {errors}"
        return f"as the {errors} promise"


@dataclass(frozen=True)
class Report:
    """All of it; ``records`` counts every row, ``items`` the actuators."""

    records: int
    items: int
    success: tuple[Success, ...]
    comparisons: tuple[Comparison, ...]
    tolerances: tuple[Tolerance, ...]
    promises: tuple[Promise, ...]
    contradictions: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """The report for JSON; every value has its unit beside it or is a share."""
        return {
            "records": self.records,
            "actuators": self.items,
            "success": [
                {"by": s.by, "name": s.name, **_share(s.share), "passed_later": s.passed_later}
                for s in self.success
            ],
            "measured": [
                {**asdict(c), "ratio": c.ratio, "verdict": c.verdict} for c in self.comparisons
            ],
            "tolerances": [
                {**asdict(t), "found": t.found._asdict(), "verdict": t.verdict}
                for t in self.tolerances
            ],
            "promises": [
                {
                    "design": p.design,
                    "promised": p.promised,
                    "by_measured_errors": p.measured
                    and {
                        "low": p.measured.low,
                        "high": p.measured.high,
                        "tolerances": {
                            key: list(ends) for key, ends in p.measured.tolerances.items()
                        },
                    },
                    **_share(p.success),
                    "verdict": p.verdict,
                }
                for p in self.promises
            ],
            "contradictions": list(self.contradictions),
        }


def _share(share: Share) -> dict[str, Any]:
    low, high = share.interval
    return {
        "passed": share.good,
        "tested": share.builds,
        "share": share.value,
        "low": low,
        "high": high,
    }


def standing(records: Iterable[Record]) -> list[Record]:
    """Return the records that no other one corrects and none withdraws."""
    records = list(records)
    corrected = {record.corrects for record in records}
    return [r for r in records if r.id not in corrected and not r.withdrawn]


def items(records: Iterable[Record], builds: Mapping[str, Build]) -> list[Built]:
    """Return the actuators, by what was built and serial, in the order of their first record."""
    names = _names(builds)
    actuators = []
    for (actuator, serial), unsorted in _by_actuator(records, builds).items():
        # The first attempt comes first; in each, the first record.
        history = sorted(unsorted, key=lambda record: record.attempt)
        errors: dict[str, tuple[float, ...]] = {}
        numbers: dict[str, float] = {}
        for record in history:
            for name, values in record.errors.items():
                errors[name] = (*errors.get(name, ()), *values)
            numbers = {**record.numbers, **numbers}
        tests = [(record.attempt, record.leak) for record in history if record.leak]
        first = min(tests, default=(1, ""))[0]
        actuators.append(
            Built(
                actuator=actuator,
                design_sha256=history[0].design_sha256,
                serial=serial,
                design=names[actuator],
                method=builds[history[0].design_sha256].method,
                kit=_first(history, "kit"),
                operator=_first(history, "operator"),
                leak=_first(history, "leak"),
                numbers=numbers,
                errors=errors,
                passed_later=_first(history, "leak") != PASS
                and any(attempt > first and leak == PASS for attempt, leak in tests),
            )
        )
    return actuators


def _first(history: Iterable[Record], name: str) -> str:
    """Return the first value that a record states."""
    return next((text for text in (getattr(record, name) for record in history) if text), "")


def _by_actuator(
    records: Iterable[Record], builds: Mapping[str, Build]
) -> dict[tuple[str, str], list[Record]]:
    """The records that stand, by what was built and serial."""
    gathered: dict[tuple[str, str], list[Record]] = defaultdict(list)
    for record in standing(records):
        gathered[builds[record.design_sha256].actuator, record.serial].append(record)
    return gathered


def contradictions(records: Iterable[Record], builds: Mapping[str, Build]) -> list[str]:
    """Return a sentence for each serial of which one attempt is recorded in two ways.

    None are taken any more; a file of an earlier version may hold them, of one actuator recorded
    by designs that differ in order or sheets alone.
    """
    sentences = []
    for (_, serial), history in _by_actuator(records, builds).items():
        before: dict[tuple[int, str], tuple[object, int]] = {}
        for record in history:
            for name, value in record.once.items():
                earlier, number = before.setdefault((record.attempt, name), (value, record.id))
                if earlier != value:
                    sentences.append(
                        f"serial {serial} has {name} = {earlier} in record {number} and {value} in "
                        f"record {record.id}; correct one of them with --correct"
                    )
    return sentences


def _names(builds: Mapping[str, Build]) -> dict[str, str]:
    """Names of what was built, by hash: of several with one name also the hash's first digits."""
    names: dict[str, dict[str, None]] = defaultdict(dict)
    for build in builds.values():
        names[build.actuator][build.name] = None
    joined = {actuator: ", ".join(designs) for actuator, designs in names.items()}
    shared = [*joined.values()]
    return {
        actuator: name if shared.count(name) == 1 else f"{name} {actuator[:8]}"
        for actuator, name in joined.items()
    }


def report(records: Sequence[Record], builds: Mapping[str, Build]) -> Report:
    """Evaluate the records; every design recorded must be among ``builds``."""
    actuators = items(records, builds)
    return Report(
        len(records),
        len(actuators),
        tuple(_success(actuators)),
        tuple(_comparisons(actuators, builds)),
        tuple(_tolerances(actuators, builds)),
        tuple(_promises(actuators, builds)),
        tuple(contradictions(records, builds)),
    )


def _groups(
    actuators: Iterable[Built], key: Callable[[Built], Any]
) -> list[tuple[Any, list[Built]]]:
    groups: dict[Any, list[Built]] = defaultdict(list)
    for item in actuators:
        groups[key(item)].append(item)
    return sorted(groups.items())


def _passed(group: Sequence[Built]) -> Share:
    return Share(sum(item.leak == PASS for item in group), len(group))


def _later(group: Sequence[Built]) -> int:
    return sum(item.passed_later for item in group)


def _success(actuators: Sequence[Built]) -> Iterable[Success]:
    tested = [item for item in actuators if item.leak]
    if tested:
        yield Success("all", "all", _passed(tested), _later(tested))
    groupings: dict[By, Callable[[Built], str]] = {
        "design": lambda item: item.design,
        "kit": lambda item: item.kit or UNSAID,
        "method": lambda item: item.method,
        "operator": lambda item: item.operator or UNSAID,
    }
    for by, key in groupings.items():
        for name, group in _groups(tested, key):
            yield Success(by, name, _passed(group), _later(group))


def _comparisons(actuators: Sequence[Built], builds: Mapping[str, Build]) -> Iterable[Comparison]:
    newest = {build.actuator: build for build in builds.values()}
    for (design, actuator), group in _groups(actuators, lambda item: (item.design, item.actuator)):
        for quantity in NUMBERS:
            name = quantity.name
            values = [item.numbers[name] for item in group if name in item.numbers]
            if not values:
                continue
            predicted, model = newest[actuator].predicted.get(name, (None, ""))
            mean = mean_of(values)
            low, high = (None, None) if mean is None else mean.interval
            yield Comparison(
                design=design,
                quantity=name,
                unit=quantity.unit,
                count=len(values),
                mean=sum(values) / len(values),
                low=low,
                high=high,
                predicted=predicted,
                model=model,
            )


def _tolerances(actuators: Sequence[Built], builds: Mapping[str, Build]) -> Iterable[Tolerance]:
    for quantity in ERRORS:
        name = quantity.name
        measured = [item for item in actuators if item.errors.get(name)]

        def stated(item: Built, name: str = name) -> tuple[str, str, float]:
            hand = (item.operator or UNSAID) if name != CUT else ""
            return item.kit or UNSAID, hand, builds[item.design_sha256].tolerances[name]

        for (kit, operator, value), group in _groups(measured, stated):
            errors = [error for item in group for error in item.errors[name]]
            most = most_of(errors, DIMENSIONS[name])
            key = f"registration.{TOLERANCES[name]}"
            yield Tolerance(kit, operator, name, quantity.unit, key, value, most)


def _promises(actuators: Sequence[Built], builds: Mapping[str, Build]) -> Iterable[Promise]:
    tested = [item for item in actuators if item.leak]
    for (design, _), group in _groups(tested, lambda item: (item.design, item.actuator)):
        stated = [builds[item.design_sha256] for item in group]
        promised = sum(build.good_builds[0] / build.good_builds[1] for build in stated) / len(group)
        bounds = _bounds(group, actuators)
        is_enough = all(
            bound.largest <= build.tolerances[name]
            for name, bound in bounds.items()
            for build in stated
        )
        measured = _measured_yield(stated[-1], bounds) if bounds else None
        yield Promise(design, _passed(group), promised, measured, is_enough)


def _bounds(group: Iterable[Built], every: Iterable[Built]) -> dict[str, Most]:
    """The errors of the hands and lasers that built these, measured on whatever they built."""
    hands = {(item.kit, item.operator) for item in group}
    kits = {kit for kit, _ in hands}
    bounds = {}
    for name, dimensions in DIMENSIONS.items():
        errors = [
            error
            for item in every
            if (item.kit in kits if name == CUT else (item.kit, item.operator) in hands)
            for error in item.errors.get(name, ())
        ]
        if errors:
            bounds[name] = most_of(errors, dimensions)
    return bounds


def _measured_yield(build: Build, bounds: Mapping[str, Most]) -> MeasuredYield | None:
    """The yield of a recorded design with measured errors for stated ones."""
    design = rebuilt(build)
    if design is None:
        return None
    try:
        best = yield_with(design, {ERROR_NAMES[n]: b.largest for n, b in bounds.items()})
        worst = yield_with(design, {ERROR_NAMES[n]: b.highest for n, b in bounds.items()})
    except DesignError:
        return None
    ends = {f"registration.{TOLERANCES[n]}": (b.largest, b.highest) for n, b in bounds.items()}
    return MeasuredYield(worst.interval[0], best.interval[1], ends)
