"""Process control from a lab's records: charts, capability, what changed when, where to look first.

A device failed if its first attempt did not pass the leak test, or if an entry of that attempt
rejects it or sends it back. What differs between failed and sound devices is tested one by one
(Mann-Whitney, Fisher), and Holm's method accounts for the number of tests.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median
from typing import Any, NamedTuple

from sbafab.errors import DesignError, OutputError
from sbafab.output.schema_ids import CONTROL_SCHEMA
from sbafab.output.swap import replace_text
from sbafab.reports.charts import ChartCurve, ChartPoints, Panel, chart_svg
from sbafab.reports.html_templates import environment
from sbafab.results.control_charts import (
    FEWEST,
    RULES,
    Capability,
    ControlChart,
    ControlLimits,
    capability,
    defects_chart,
    ewma_chart,
    individuals_chart,
    moving_range_chart,
    proportions_chart,
    sigma_of,
    statistics,
)
from sbafab.results.history import REJECT, REWORK, StoredEntry, standing_entries
from sbafab.results.recording import RecordRow, all_rows
from sbafab.results.records import ERRORS, FAIL, NUMBERS, TOLERANCES, Build, Record
from sbafab.results.report import standing
from sbafab.results.store import Lab

CERTAIN = 0.05
"""Largest p, after Holm, of a difference that is named."""
LEAK = "leak test"


class ChartPoint(NamedTuple):
    """A value of a series; ``when`` (day, time of the record) orders points and changes."""

    value: float
    when: tuple[str, str]
    serial: str


@dataclass(frozen=True)
class Device:
    """The first attempt of a device, and the defects of all its attempts.

    ``failures`` are step and reason of each; ``readings`` by step and quantity; ``factors`` what
    it was made with and by whom.
    """

    serial: str
    when: tuple[str, str]
    is_tested: bool
    failures: tuple[tuple[str, str], ...]
    defects: int
    readings: Mapping[tuple[str, str], float]
    factors: Mapping[str, str]

    @property
    def day(self) -> str:
        return self.when[0]


class ProcessChange(NamedTuple):
    """A factor that has another value than before."""

    when: tuple[str, str]
    factor: str
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.factor}: {self.before} to {self.after}"


class Suspect(NamedTuple):
    """A difference between failed and sound devices; ``p`` is adjusted for the number of tests."""

    step: str
    words: str
    p: float


@dataclass(frozen=True)
class ChartSet:
    """Charts of one quantity over its points; ``marks`` are changes at points, from 0.

    Limits come from the first ``baseline`` points, or from all where it is None.
    """

    name: str
    labels: tuple[str, ...]
    charts: tuple[ControlChart, ...]
    marks: tuple[tuple[int, str], ...]
    capability: Capability | None = None
    baseline: int | None = None

    @property
    def signals(self) -> list[tuple[str, str, list[str]]]:
        """Chart, rule and the points at which it speaks, for each rule that does."""
        points: dict[tuple[str, int], list[str]] = defaultdict(list)
        for chart in self.charts:
            first = len(self.labels) - len(chart.values)
            for signal in chart.signals:
                points[chart.kind, signal.rule].append(self.labels[first + signal.point])
        return [(kind, RULES[rule], labels) for (kind, rule), labels in points.items()]

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "points": list(self.labels),
            "baseline_points": self.baseline,
            "charts": [chart.as_dict() for chart in self.charts],
            "changes": [{"point": point, "what": words} for point, words in self.marks],
            "capability": None if self.capability is None else self.capability.as_dict(),
        }


@dataclass(frozen=True)
class ProcessControl:
    """All charts of a lab, its failures by step and reason, and the step to look at first."""

    sets: tuple[ChartSet, ...]
    changes: tuple[ProcessChange, ...]
    failures: tuple[tuple[str, str, int], ...]
    suspects: tuple[Suspect, ...]
    advice: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        return {
            "schema": CONTROL_SCHEMA,
            "charts": [chart_set.as_dict() for chart_set in self.sets],
            "changes": [
                {"day": change.when[0], "what": change.factor}
                | {"before": change.before, "after": change.after}
                for change in self.changes
            ],
            "failures": [
                {"step": step, "reason": reason, "count": count}
                for step, reason, count in self.failures
            ],
            "suspects": [suspect._asdict() for suspect in self.suspects],
            "advice": list(self.advice),
        }


def process_control(
    lab: Lab, limits: Mapping[str, ControlLimits], baseline: str = ""
) -> ProcessControl:
    """Return the process control of all records of a lab.

    ``limits`` by quantity, such as stroke_mm or temperature_c; the tolerances of placement and
    cutting are taken from the designs. Control limits come from the points until the day
    ``baseline``, of quantities with enough of them; else from all. Raises DesignError.
    """
    stored, builds = lab.contents()
    records, entries = standing(stored), standing_entries(lab.entries())
    devices = _devices(records, entries, builds)
    changes = tuple(_changes(records, entries, builds))
    stated = {**_tolerances(builds), **limits}
    series = _series(records, entries)
    unknown = sorted(set(limits) - {name.split(", ")[0] for name in series})
    if unknown:
        raise DesignError(
            f"nothing is recorded of {', '.join(unknown)}; recorded are "
            f"{', '.join(sorted({name.split(', ')[0] for name in series})) or 'no numbers'}"
        )
    sets = [*_failure_sets(devices, changes, baseline)]
    for name, points in series.items():
        if len(points) >= FEWEST:
            within = stated.get(name.split(", ")[0])
            sets.append(_value_set(name, points, changes, within, baseline))
    if not sets:
        raise DesignError(
            f"{lab.path} has too few records for a chart: two days of tested devices or {FEWEST} "
            "values of a quantity"
        )
    if baseline and all(chart_set.baseline is None for chart_set in sets):
        raise DesignError(
            f"until {baseline} there are too few points for limits: two days of tested devices or "
            f"{FEWEST} values of a quantity; give a later day, or leave --baseline out"
        )
    failures = Counter(failure for device in devices for failure in device.failures)
    suspects = tuple(_suspects(devices))
    return ProcessControl(
        tuple(sets),
        changes,
        tuple((step, reason, n) for (step, reason), n in failures.most_common()),
        suspects,
        tuple(_advice(devices, failures, suspects)),
    )


# Devices, series and changes from the rows.


def _when(row: RecordRow) -> tuple[str, str]:
    return (row.day if isinstance(row, StoredEntry) else row.recorded[:10], row.recorded)


def _devices(
    records: Sequence[Record], entries: Sequence[StoredEntry], builds: Mapping[str, Build]
) -> list[Device]:
    """Return the devices in the order of their first rows."""
    by_device: dict[tuple[str, str], tuple[list[Record], list[StoredEntry]]]
    by_device = defaultdict(lambda: ([], []))
    for record in records:
        by_device[builds[record.design_sha256].actuator, record.serial][0].append(record)
    for entry in entries:
        by_device[builds[entry.design_sha256].actuator, entry.serial][1].append(entry)
    devices = [_device(serial, *rows) for (_, serial), rows in by_device.items()]
    return sorted(devices, key=lambda device: device.when)


def _device(serial: str, records: Sequence[Record], entries: Sequence[StoredEntry]) -> Device:
    sent_back = [entry for entry in entries if entry.decision in (REJECT, REWORK)]
    leaks = [record for record in records if record.leak]
    failures = [(e.step or "not stated", e.reason) for e in sent_back if e.attempt == 1]
    if not failures and any(r.leak == FAIL and r.attempt == 1 for r in leaks):
        failures = [(LEAK, "leaks")]
    first = [entry for entry in entries if entry.attempt == 1]
    factors: dict[str, str] = {}
    for record in records:
        for name, value in (("kit", record.kit), ("operator", record.operator)):
            factors |= {name: value} if value else {}
    for entry in first:
        factors |= {f"lot of {entry.item}": entry.lot} if entry.lot else {}
        if entry.step and entry.initials:
            factors[f"initials at step {entry.step}"] = entry.initials
    return Device(
        serial,
        min(map(_when, all_rows(records, entries))),
        bool(leaks or failures or any(e.decision and e.step in (LEAK, "device") for e in entries)),
        tuple(failures),
        max(len(sent_back), sum(record.leak == FAIL for record in leaks)),
        {(e.step, name): value for e in first if e.step for name, value in e.readings.items()},
        factors,
    )


def _series(
    records: Sequence[Record], entries: Sequence[StoredEntry]
) -> dict[str, list[ChartPoint]]:
    """Return the points of each quantity, in the order of the work.

    A reading that one record gives to several devices is that of one press cycle: one point.
    """
    series: dict[str, list[ChartPoint]] = defaultdict(list)
    for entry in sorted(entries, key=_when):
        for name, value in entry.readings.items():
            where = f"step {entry.step}" if entry.step else entry.item
            point = ChartPoint(value, _when(entry), entry.serial)
            points = series[f"{name}, {where}" if where else name]
            if not points or points[-1][:2] != point[:2]:
                points.append(point)
    for record in sorted(records, key=_when):
        for quantity in NUMBERS:
            if quantity.name in record.numbers:
                value = record.numbers[quantity.name]
                series[quantity.name].append(ChartPoint(value, _when(record), record.serial))
        for quantity in ERRORS:
            series[quantity.name] += [
                ChartPoint(size, _when(record), record.serial)
                for size in record.errors.get(quantity.name, ())
            ]
    return {name: points for name, points in series.items() if points}


def _changes(
    records: Sequence[Record], entries: Sequence[StoredEntry], builds: Mapping[str, Build]
) -> Iterator[ProcessChange]:
    """Yield each new value of a factor: kit, operator, design, lots, initials.

    A value that comes back, as of two operators by turns, is no change.
    """
    values_of: dict[str, list[str]] = defaultdict(list)
    for row in sorted(all_rows(records, entries), key=_when):
        build = builds[row.design_sha256]
        stated = {"design": f"{build.name} {build.actuator[:8]}"}
        if isinstance(row, Record):
            stated |= {"kit": row.kit, "operator": row.operator}
        else:
            stated |= {f"lot of {row.item}": row.lot}
            stated |= {f"initials at step {row.step}": row.initials} if row.step else {}
        for factor, value in stated.items():
            values = values_of[factor]
            if value and value not in values:
                if values:
                    yield ProcessChange(_when(row), factor, values[-1], value)
                values.append(value)


def _tolerances(builds: Mapping[str, Build]) -> dict[str, ControlLimits]:
    """Return the limits of errors that all recorded designs keep."""
    return {
        name: ControlLimits(None, min(build.tolerances[name] for build in builds.values()))
        for name in TOLERANCES
        if builds and all(name in build.tolerances for build in builds.values())
    }


# Charts.


def _failure_sets(
    devices: Sequence[Device], changes: Sequence[ProcessChange], baseline: str
) -> Iterator[ChartSet]:
    """Yield the p and u charts, a point a day."""
    days: dict[str, list[Device]] = defaultdict(list)
    for device in devices:
        if device.is_tested:
            days[device.day].append(device)
    if len(days) < 2:
        return
    groups = [days[day] for day in sorted(days)]
    first = _points_until(baseline, sorted(days), 2)
    sizes = [len(group) for group in groups]
    failures = [sum(bool(device.failures) for device in group) for group in groups]
    defects = [sum(device.defects for device in group) for group in groups]
    labels = tuple(f"{day}: {n} devices" for day, n in zip(sorted(days), sizes, strict=True))
    charts = (proportions_chart(failures, sizes, first), defects_chart(defects, sizes, first))
    marks = _marks(changes, [(day,) for day in sorted(days)])
    yield ChartSet("failures by day", labels, charts, marks, baseline=first)


def _points_until(baseline: str, days: Sequence[str], fewest: int) -> int | None:
    """Return the number of points until the day ``baseline``; None for fewer than ``fewest``."""
    count = sum(day <= baseline for day in days)
    return count if baseline and count >= fewest else None


def _value_set(
    name: str,
    points: Sequence[ChartPoint],
    changes: Sequence[ProcessChange],
    limits: ControlLimits | None,
    baseline: str,
) -> ChartSet:
    values = [point.value for point in points]
    first = _points_until(baseline, [point.when[0] for point in points], FEWEST)
    centre, sigma = fmean(values[:first]), sigma_of(values[:first])
    charts = (
        individuals_chart(values, first),
        moving_range_chart(values, first),
        ewma_chart(values, centre, sigma),
    )
    is_spread = len(set(values)) > 1
    return ChartSet(
        name,
        tuple(f"{point.when[0]}: {point.serial}" for point in points),
        charts,
        _marks(changes, [point.when for point in points]),
        capability(values, limits) if limits is not None and is_spread else None,
        first,
    )


def _marks(
    changes: Sequence[ProcessChange], whens: Sequence[tuple[str, ...]]
) -> tuple[tuple[int, str], ...]:
    """Return each change at the first point that is not before it; none before the first point."""
    marks = []
    for change in changes:
        later = [n for n, when in enumerate(whens) if when >= change.when[: len(when)]]
        if later and later[0] > 0:
            marks.append((later[0], str(change)))
    return tuple(marks)


# Where to look first.


class _Test(NamedTuple):
    step: str
    words: str
    p: float


def _suspects(devices: Sequence[Device]) -> list[Suspect]:
    """Return the differences between failed and sound devices, the most certain first."""
    tested = [device for device in devices if device.is_tested]
    failed = [device for device in tested if device.failures]
    sound = [device for device in tested if not device.failures]
    if len(failed) < 2 or len(sound) < 2:
        return []
    tests = sorted([*_reading_tests(failed, sound), *_factor_tests(failed, sound)], key=_p)
    suspects, least = [], 0.0
    for place, test in enumerate(tests):
        least = max(least, min(1.0, test.p * (len(tests) - place)))
        suspects.append(Suspect(test.step, test.words, least))
    return suspects


def _p(test: _Test) -> float:
    return test.p


def _reading_tests(failed: Sequence[Device], sound: Sequence[Device]) -> Iterator[_Test]:
    keys = dict.fromkeys(key for device in failed for key in device.readings)
    for step, name in keys:
        values = [
            [device.readings[step, name] for device in group if (step, name) in device.readings]
            for group in (failed, sound)
        ]
        if min(map(len, values)) < FEWEST or len({*values[0], *values[1]}) < 2:
            continue
        p = float(statistics().mannwhitneyu(*values).pvalue)
        middles = " and ".join(f"{median(group):g}" for group in values)
        yield _Test(step, f"{name} of failed and sound devices: medians {middles}", p)


def _factor_tests(failed: Sequence[Device], sound: Sequence[Device]) -> Iterator[_Test]:
    """Test each value of each factor against all other values."""
    factors = dict.fromkeys(f for device in (*failed, *sound) for f in device.factors)
    for factor in factors:
        groups = [[d.factors[factor] for d in g if factor in d.factors] for g in (failed, sound)]
        levels = sorted({*groups[0], *groups[1]})
        for level in levels if len(levels) > 2 else levels[: len(levels) - 1]:
            counts = [(group.count(level), len(group) - group.count(level)) for group in groups]
            (bad, bad_rest), (good, good_rest) = counts
            if not bad + good or not bad_rest + good_rest:
                continue
            p = float(statistics().fisher_exact(counts).pvalue)
            words = (
                f"{factor} {level}: {bad} of {bad + good} failed, {bad_rest} of "
                f"{bad_rest + good_rest} with another"
            )
            step = factor.partition("step ")[2]
            yield _Test(step or factor, words, p)


def _advice(
    devices: Sequence[Device],
    failures: Counter[tuple[str, str]],
    suspects: Sequence[Suspect],
) -> Iterator[str]:
    """Yield sentences: the run of failures at the end, and the step to look at first."""
    tested = [device for device in devices if device.is_tested]
    run = next((n for n, d in enumerate(reversed(tested)) if not d.failures), len(tested))
    earlier = tested[: len(tested) - run]
    if run >= 2 and earlier:
        share = sum(bool(device.failures) for device in earlier) / len(earlier)
        yield (
            f"the last {run} devices failed; of the {len(earlier)} before, {share:.0%} did"
            + (f", which makes such a run one in {share**-run:,.0f}" if share else "")
        )
    by_step: Counter[str] = Counter()
    for (step, _), count in failures.items():
        by_step[step] += count
    certain = [suspect for suspect in suspects if suspect.p <= CERTAIN]
    if certain:
        first = certain[0]
        where = f"step {first.step}" if first.step[:1].isdigit() else first.step
        yield (
            f"look first at {where}: {first.words} (p = {first.p:.2g}, adjusted for "
            f"{len(suspects)} tests)"
        )
    if by_step:
        [(step, count)] = by_step.most_common(1)
        total = sum(by_step.values())
        where = f"step {step}" if step[:1].isdigit() else f"the {step}"
        lead = "most failures are recorded" if certain else "look first where most are recorded"
        yield f"{lead} at {where}: {count} of {total}"


# Page, pictures and numbers.


PAGE, NUMBERS_FILE = "charts.html", "charts.json"


def write_charts(control: ProcessControl, folder: Path) -> list[str]:
    """Write page, numbers and a picture a quantity, each swapped in; return their names."""
    pictures = [
        (f"chart-{number:02d}.svg", chart_set_svg(chart_set), chart_set)
        for number, chart_set in enumerate(control.sets, start=1)
    ]
    page = (
        environment(Path(__file__).parent)
        .get_template("charts.html.j2")
        .render(control=control, pictures=pictures)
    )
    numbers = json.dumps(control.as_dict(), indent=2, ensure_ascii=False) + "\n"
    texts = {name: svg for name, svg, _ in pictures} | {NUMBERS_FILE: numbers, PAGE: page}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            replace_text(folder / name, text)
    except OSError as error:
        raise OutputError(
            f"{folder} cannot be written: {error.strerror or error}; choose another folder"
        ) from None
    return sorted(texts)


AXES = {"p": "share of failed devices", "u": "defects per device"}


def chart_set_svg(chart_set: ChartSet) -> str:
    """Return the charts of one quantity beside each other."""
    return chart_svg(
        chart_set.name,
        [_panel(chart_set, chart) for chart in chart_set.charts],
    )


def _panel(chart_set: ChartSet, chart: ControlChart) -> Panel:
    # A moving range belongs to the second of its two values.
    first = 1 + len(chart_set.labels) - len(chart.values)
    x = [float(first + n) for n in range(len(chart.values))]
    curves = [
        ChartCurve(chart.kind, x, chart.values, dotted=True),
        ChartCurve("centre and limits", x, chart.centre, is_reference=True),
        ChartCurve("", x, chart.lower, is_reference=True),
        ChartCurve("", x, chart.upper, is_reference=True),
    ]
    low = min(*chart.values, *chart.lower)
    high = max(*chart.values, *chart.upper)
    for point in dict.fromkeys(point for point, _ in chart_set.marks):
        place = [point + 0.5, point + 0.5]
        curves.append(ChartCurve("", place, [low, high], is_reference=True))
    signals = sorted({signal.point for signal in chart.signals})
    points = [
        ChartPoints(
            "signal",
            [x[n] for n in signals],
            [chart.values[n] for n in signals],
            [0] * len(signals),
        )
    ]
    label = AXES.get(chart.kind, chart_set.name)
    return Panel(f"{chart.kind} chart", "point", label, curves, points if signals else (), False)
