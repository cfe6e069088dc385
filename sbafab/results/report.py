"""What a lab's records say together: success, measured against predicted, tolerances."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from sbafab.results.builds import TOLERANCES
from sbafab.results.intervals import Most, mean_of, most_of
from sbafab.results.records import ERRORS, NUMBERS, PASS, Build, Record
from sbafab.rules.registration_yield import Share

By = Literal["all", "design", "kit", "method", "operator"]
UNSAID = "not said"
CUT = "cut_mm"
DIMENSIONS = {"offset_mm": 2, "turn_deg": 1, CUT: 1}
"""Of the space that an error is spread over."""


@dataclass(frozen=True)
class Built:
    """An actuator that was built: all that its records say together."""

    sha256: str
    serial: str
    design: str
    method: str
    kit: str
    operator: str
    leak: str
    numbers: Mapping[str, float]
    errors: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class Success:
    """How many actuators of a group passed the leak test, of those that were tested."""

    by: By
    name: str
    share: Share


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
        """Whether the prediction lies in the interval of the mean, in words."""
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
        """Whether the stated tolerance holds, in words."""
        if self.found.largest > self.stated:
            return "too small"
        return "holds" if self.stated <= self.found.highest else "wider than needed"


@dataclass(frozen=True)
class Promise:
    """Success of a design against the share ``promised`` (rule registration-yield)."""

    design: str
    success: Share
    promised: float

    @property
    def verdict(self) -> str:
        """Whether success agrees with what the tolerances promise, in words."""
        low, high = self.success.interval
        if high < self.promised:
            return "fewer hold than the tolerances promise"
        return "more hold than the limits ask" if low > self.promised else "as promised"


@dataclass(frozen=True)
class Report:
    """All of it; ``records`` counts every row, ``items`` the actuators."""

    records: int
    items: int
    success: tuple[Success, ...]
    comparisons: tuple[Comparison, ...]
    tolerances: tuple[Tolerance, ...]
    promises: tuple[Promise, ...]

    def as_dict(self) -> dict[str, Any]:
        """The report for JSON; every value has its unit beside it or is a share."""
        return {
            "records": self.records,
            "actuators": self.items,
            "success": [{"by": s.by, "name": s.name, **_share(s.share)} for s in self.success],
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
                    **_share(p.success),
                    "verdict": p.verdict,
                }
                for p in self.promises
            ],
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
    """The records that no other one corrects and none withdraws."""
    records = list(records)
    corrected = {record.corrects for record in records}
    return [r for r in records if r.id not in corrected and not r.withdrawn]


def items(records: Iterable[Record], builds: Mapping[str, Build]) -> list[Built]:
    """The actuators, by design and serial, in the order of their first record."""
    gathered: dict[tuple[str, str], list[Record]] = defaultdict(list)
    for record in standing(records):
        gathered[record.design_sha256, record.serial].append(record)
    names = _names(builds)
    found = []

    def told(own: Sequence[Record], name: str) -> str:
        return next((said for said in (getattr(record, name) for record in own) if said), "")

    for (sha256, serial), own in gathered.items():
        errors: dict[str, tuple[float, ...]] = {}
        for record in own:
            for name, values in record.errors.items():
                errors[name] = (*errors.get(name, ()), *values)
        found.append(
            Built(
                sha256=sha256,
                serial=serial,
                design=names[sha256],
                method=builds[sha256].method,
                kit=told(own, "kit"),
                operator=told(own, "operator"),
                leak=told(own, "leak"),
                numbers={name: value for record in own for name, value in record.numbers.items()},
                errors=errors,
            )
        )
    return found


def _names(builds: Mapping[str, Build]) -> dict[str, str]:
    """Names of the designs; of several with one name also the first digits of the hash."""
    names = [build.name for build in builds.values()]
    return {
        sha: build.name if names.count(build.name) == 1 else f"{build.name} {sha[:8]}"
        for sha, build in builds.items()
    }


def report(records: Sequence[Record], builds: Mapping[str, Build]) -> Report:
    """What the records say; every design recorded must be among ``builds``."""
    found = items(records, builds)
    return Report(
        len(records),
        len(found),
        tuple(_success(found)),
        tuple(_comparisons(found, builds)),
        tuple(_tolerances(found, builds)),
        tuple(_promises(found, builds)),
    )


def _groups(found: Iterable[Built], key: Callable[[Built], Any]) -> list[tuple[Any, list[Built]]]:
    groups: dict[Any, list[Built]] = defaultdict(list)
    for item in found:
        groups[key(item)].append(item)
    return sorted(groups.items())


def _passed(own: Sequence[Built]) -> Share:
    return Share(sum(item.leak == PASS for item in own), len(own))


def _success(found: Sequence[Built]) -> Iterable[Success]:
    tested = [item for item in found if item.leak]
    if tested:
        yield Success("all", "all", _passed(tested))
    told: dict[By, Callable[[Built], str]] = {
        "design": lambda item: item.design,
        "kit": lambda item: item.kit or UNSAID,
        "method": lambda item: item.method,
        "operator": lambda item: item.operator or UNSAID,
    }
    for by, key in told.items():
        for name, own in _groups(tested, key):
            yield Success(by, name, _passed(own))


def _comparisons(found: Sequence[Built], builds: Mapping[str, Build]) -> Iterable[Comparison]:
    for (design, sha256), own in _groups(found, lambda item: (item.design, item.sha256)):
        for quantity in NUMBERS:
            name = quantity.name
            values = [item.numbers[name] for item in own if name in item.numbers]
            if not values:
                continue
            predicted, model = builds[sha256].predicted.get(name, (None, ""))
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


def _tolerances(found: Sequence[Built], builds: Mapping[str, Build]) -> Iterable[Tolerance]:
    for quantity in ERRORS:
        name = quantity.name
        measured = [item for item in found if item.errors.get(name)]

        def stated(item: Built, name: str = name) -> tuple[str, str, float]:
            hand = (item.operator or UNSAID) if name != CUT else ""
            return item.kit or UNSAID, hand, builds[item.sha256].tolerances[name]

        for (kit, operator, value), own in _groups(measured, stated):
            errors = [error for item in own for error in item.errors[name]]
            most = most_of(errors, DIMENSIONS[name])
            key = f"registration.{TOLERANCES[name]}"
            yield Tolerance(kit, operator, name, quantity.unit, key, value, most)


def _promises(found: Sequence[Built], builds: Mapping[str, Build]) -> Iterable[Promise]:
    tested = [item for item in found if item.leak]
    for (design, sha256), own in _groups(tested, lambda item: (item.design, item.sha256)):
        good, drawn = builds[sha256].good_builds
        yield Promise(design, _passed(own), good / drawn)
