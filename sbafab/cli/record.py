"""``sbafab record``: results of builds in the lab's file, and a report on all of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from sbafab.cli.options import LENGTH, PRESSURE, Command, json_option, set_option
from sbafab.cli.printing import console, print_json, print_verdict
from sbafab.output.schema_ids import (
    CHAIN_SCHEMA,
    GAUGE_SCHEMA,
    RECORDS_SCHEMA,
    REPORT_SCHEMA,
)
from sbafab.results.control_charts import ControlLimits
from sbafab.results.history import (
    ENTRY_FIELDS,
    HistoryEntry,
    StoredEntry,
    entries_of,
    read_history,
    unchecked_entry,
)
from sbafab.results.recording import (
    RecordRow,
    all_rows,
    built_from,
    found_by,
    matching,
    read_batch,
    record_history,
    row_number,
    row_words,
)
from sbafab.results.recording import record as record_results
from sbafab.results.records import ERRORS, NUMBERS, Build, LabResult, Record, checked
from sbafab.results.report import Comparison, Promise, Report, report
from sbafab.results.store import Lab

if TYPE_CHECKING:
    from sbafab.rules.registration_yield import Share


def _measurement_options(command: Command) -> Command:
    """Add the options of measurements, in the order of the help."""
    options = (
        click.option(
            "--leak", type=click.Choice(["pass", "fail"]), help="Result of the leak test."
        ),
        click.option("--burst", type=PRESSURE.read, metavar="P", help="Burst pressure, kPa."),
        click.option(
            "--proof", type=PRESSURE.read, metavar="P", help="Pressure held in the proof test, kPa."
        ),
        click.option(
            "--stroke",
            type=LENGTH.read,
            metavar="MM",
            help="Stroke when full, as the paper measured it.",
        ),
        click.option("--force", type=float, metavar="N", help="Blocked force at 100 kPa, flat."),
        click.option("--height", type=LENGTH.read, metavar="MM", help="Pressed height, deflated."),
        click.option("--mass", type=float, metavar="G", help="Mass without tubes."),
        click.option(
            "--offset",
            type=LENGTH.read,
            multiple=True,
            metavar="MM",
            help="Placement error of a layer laid by hand. Repeatable.",
        ),
        click.option(
            "--turn",
            type=float,
            multiple=True,
            metavar="DEG",
            help="Angle error of a layer laid by hand. Repeatable.",
        ),
        click.option(
            "--cut-error",
            type=LENGTH.read,
            multiple=True,
            metavar="MM",
            help="Position error of a cut edge. Repeatable.",
        ),
        click.option("--operator", default="", metavar="NAME", help="Name of the builder."),
        click.option("--kit", default="", metavar="NAME", help="Kit that it was built with."),
        click.option("--note", default="", metavar="TEXT", help="Free text."),
    )
    for option in reversed(options):
        command = option(command)
    return command


def _row_key(
    context: click.Context, parameter: click.Parameter, value: str | None
) -> tuple[bool, int] | None:
    """Return whether a number such as e3 is that of an entry of history, and the number."""
    match = re.fullmatch(r"(e?)(\d{1,9})", value or "")
    if value is not None and match is None:
        raise click.BadParameter(f"{value!r} is no record such as 3 and no entry such as e3")
    return None if match is None else (match[1] == "e", int(match[2]))


def _day(context: click.Context, option: click.Parameter, text: str) -> str:
    try:
        return date.fromisoformat(text).isoformat() if text else ""
    except ValueError:
        raise click.BadParameter(f"{text!r} is no day; write it such as 2026-11-30") from None


def _history_options(command: Command) -> Command:
    """Add the options of a device's history."""
    options = (
        click.option(
            "--entry",
            multiple=True,
            metavar="TEXT",
            help="A line of the device's history: 'step=1 temperature_c=134 initials=AL'. Fields: "
            f"{', '.join(ENTRY_FIELDS)}. Repeatable.",
        ),
        click.option(
            "--history",
            type=click.Path(path_type=Path),
            metavar="FILE",
            help="Lines of history from the filled record page: CSV, TOML or JSON.",
        ),
        click.option("--verify", is_flag=True, help="Compute the hash chain of all rows again."),
        click.option(
            "--head", default="", metavar="HASH", help="With --verify: a head noted earlier."
        ),
        click.option(
            "--export",
            type=click.Path(path_type=Path, dir_okay=False),
            metavar="FILE",
            help="Write the history of all devices, or of --find or --serial: CSV, JSON or PDF.",
        ),
        click.option(
            "--charts",
            type=click.Path(path_type=Path, file_okay=False),
            metavar="FOLDER",
            help="Write control charts of all records, and which step to look at first.",
        ),
        click.option(
            "--baseline",
            metavar="DAY",
            default="",
            callback=_day,
            help="With --charts: control limits come from the points until this day, 2026-11-30.",
        ),
        click.option(
            "--gauge",
            type=click.Path(path_type=Path),
            metavar="CSV",
            help="Repeatability and reproducibility of readings: part, operator, trial, reading.",
        ),
        click.option(
            "--limit",
            multiple=True,
            metavar="NAME=LOW:HIGH",
            help="With --charts, limits of a quantity; with --gauge, of the reading. Repeatable.",
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


@click.command()
@click.argument("design", metavar="[DESIGN]", required=False)
@click.option(
    "--serial", default="", metavar="NAME", help="Serial of the actuator, on its traveller."
)
@_measurement_options
@click.option(
    "--table",
    type=click.Path(path_type=Path),
    metavar="CSV",
    help="Table with a row for each actuator, instead of --serial and measurements.",
)
@click.option("--again", is_flag=True, help="A new attempt, after a repair.")
@click.option(
    "--correct",
    callback=_row_key,
    metavar="N",
    help="Add a record that corrects record N, or entry N, such as e3.",
)
@click.option("--withdraw", is_flag=True, help="With --correct: withdraw record or entry N.")
@click.option(
    "--find", metavar="TEXT", help="Show the records of a serial, a design or a scanned code."
)
@click.option("--report", is_flag=True, help="Report on all records.")
@_history_options
@click.option(
    "--lab",
    type=click.Path(path_type=Path, dir_okay=False),
    default=Path("lab.sqlite"),
    envvar="SBAFAB_LAB",
    show_default=True,
    show_envvar=True,
    metavar="FILE",
    help="File of the lab's records.",
)
@set_option
@json_option
def record(
    design: str | None, lab: Path, assignments: tuple[str, ...], as_json: bool, **values: Any
) -> None:
    """Record the results of builds, and report on them.

    DESIGN is the name of a template, a TOML file or the output folder of the build, of an assembly
    too. Records are never changed: --correct adds a record that replaces another. No data leaves
    this computer.

    \b
    sbafab record 3dof-15mm --serial A1 --leak pass --stroke 16.8
    sbafab record 3dof-15mm --serial A1 --entry "step=1 temperature_c=134 minutes=20"
    sbafab record 3dof-15mm --table batch.csv
    sbafab record --report
    sbafab record --verify
    """  # noqa: D301 (click reads the backspace as a mark)
    store = Lab(lab)
    _one_task(design, values)
    if values["report"]:
        print_report(report(*store.contents()), as_json)
    elif values["verify"]:
        _verify(store, values["head"], as_json)
    elif values["export"] is not None:
        _export(store, values)
    elif values["charts"] is not None:
        _write_charts(store, values, as_json)
    elif values["gauge"] is not None:
        _print_gauge(values, as_json)
    elif values["find"] is not None:
        _find(store, values, as_json)
    else:
        _store(store, design, assignments, values, as_json)


TASKS = ("report", "find", "correct", "verify", "export", "charts", "gauge")


def _one_task(design: str | None, values: Mapping[str, Any]) -> None:
    """Raise UsageError unless the options name exactly one task."""
    tasks = [name for name in TASKS if values[name] not in (None, False)]
    if tasks == ["find", "export"]:
        tasks = ["export"]
    is_filled = values["table"] or values["history"]
    if len(tasks) > 1 or (tasks and (design or is_filled)):
        names = ", ".join(f"--{name}" for name in sorted(TASKS)[:-1])
        raise click.UsageError(f"give only one of DESIGN, {names} and --{sorted(TASKS)[-1]}")
    if not tasks and design is None:
        raise click.UsageError("give the DESIGN that was built, --find or --report")
    if values["again"] and tasks:
        raise click.UsageError("--again goes with DESIGN, --serial and results")
    if values["withdraw"] and values["correct"] is None:
        raise click.UsageError("--withdraw goes with --correct N")
    if values["head"] and not values["verify"]:
        raise click.UsageError("--head goes with --verify")
    if values["baseline"] and tasks != ["charts"]:
        raise click.UsageError("--baseline goes with --charts")
    if values["limit"] and tasks not in (["charts"], ["gauge"]):
        raise click.UsageError("--limit goes with --charts and --gauge")
    _one_kind(tasks, values)


def _one_kind(tasks: Sequence[str], values: Mapping[str, Any]) -> None:
    """Raise UsageError where measurements stand beside what leaves no room for them."""
    has_result = not _result(values).is_empty or values["operator"] or values["kit"]
    is_shown = tasks not in ([], ["correct"])
    if is_shown and (has_result or values["entry"] or (values["serial"] and values["report"])):
        raise click.UsageError(f"--{tasks[0]} only shows records; leave out the measurements")
    if values["table"] and (has_result or values["serial"]):
        raise click.UsageError("--table holds serials and measurements; leave out their options")
    if (values["entry"] or values["history"]) and (has_result or values["table"]):
        raise click.UsageError("record history and results one after the other")


def _store(
    store: Lab,
    design: str | None,
    assignments: tuple[str, ...],
    values: Mapping[str, Any],
    as_json: bool,
) -> None:
    """Store what the options state, and print it."""
    records: list[Record] = []
    entries: list[StoredEntry] = []
    if values["correct"] is not None:
        is_entry, number = values["correct"]
        if is_entry:
            entries = [store.correct_entry(number, _entry_change(values))]
        else:
            records = [store.correct(number, _change(values))]
    elif values["entry"] or values["history"]:
        lines = _entries(values)
        built = built_from(str(design), assignments)
        entries = record_history(store, built, lines, values["again"])
    else:
        records = _add_records(store, str(design), assignments, values)
    shown = Shown(records, entries, records, entries, store.contents()[1])
    print_records(shown, as_json, f"added to {store.path}")


def _entries(values: Mapping[str, Any]) -> list[HistoryEntry]:
    """Return the lines of history that the options state."""
    serial = {"serial": values["serial"]} if values["serial"] else {}
    lines: list[HistoryEntry] = []
    for text in values["entry"]:
        lines += entries_of({**serial, **_pairs(text)}, f"--entry {text!r}")
    if values["history"] is not None:
        lines += read_history(values["history"], serial)
    return lines


def _pairs(text: str) -> dict[str, str]:
    """Return the fields of a line such as ``step=1 reason='leaks at the rim'``."""
    import shlex

    try:
        words = shlex.split(text)
    except ValueError:
        raise click.UsageError(f"--entry {text!r} has a quotation mark without its other") from None
    pairs = [word.partition("=")[::2] for word in words]
    if not all(name and "=" in word for (name, _), word in zip(pairs, words, strict=True)):
        raise click.UsageError(f"--entry {text!r} must be fields such as step=1 minutes=20")
    return dict(pairs)


def _entry_change(values: Mapping[str, Any]) -> HistoryEntry:
    if len(values["entry"]) > 1 or not (values["entry"] or values["withdraw"]):
        raise click.UsageError("give one --entry with what is right, or --withdraw")
    pairs = _pairs(values["entry"][0]) if values["entry"] else {}
    return unchecked_entry({**pairs, "withdrawn": values["withdraw"]})


def _verify(store: Lab, head: str, as_json: bool) -> None:
    """Print whether the chain holds, and its head; end with code 1 where it does not."""
    chain = store.check(head)
    if as_json:
        print_json({"schema": CHAIN_SCHEMA, "holds": not chain.broken, **chain.as_dict()})
    elif chain.broken:
        click.echo(f"broken: {chain.broken}")
    else:
        click.echo(f"head {chain.head}")
        if head:
            click.echo(f"the noted head is in the chain; rows added since: {chain.later}")
        if chain.adopted:
            click.echo(
                f"{chain.adopted} rows are older than the chain: it covers them from the day on "
                "which they were linked"
            )
    if not as_json:
        verdict = "does not hold" if chain.broken else "holds"
        print_verdict(f"{store.path}: the chain of {chain.links} rows {verdict}")
    if chain.broken:
        raise SystemExit(1)


def _export(store: Lab, values: Mapping[str, Any]) -> None:
    from sbafab.results.export import lab_history, write_history

    history = lab_history(store, values["find"] or "", values["serial"])
    write_history(history, values["export"])
    count = len(history.devices)
    print_verdict(f"{values['export']}: {count} device{'s' if count != 1 else ''}")


def _limits(texts: Sequence[str]) -> dict[str, ControlLimits]:
    """Return limits by quantity, of texts such as ``stroke_mm=16:18``; a side may be empty."""
    limits = {}
    for text in texts:
        name, _, span = text.partition("=")
        low, colon, high = span.partition(":")
        try:
            pair = ControlLimits(*(float(side) if side else None for side in (low, high)))
        except ValueError:
            colon = ""
        if not name or not colon or pair == ControlLimits(None, None):
            raise click.UsageError(
                f"--limit {text!r} must be such as stroke_mm=16:18 or force_n=4:"
            )
        if None not in pair and float(low) >= float(high):
            raise click.UsageError(f"--limit {text!r} has a low limit that is not below the high")
        limits[name.strip()] = pair
    return limits


def _write_charts(store: Lab, values: Mapping[str, Any], as_json: bool) -> None:
    from sbafab.results.process_control import PAGE, process_control, write_charts

    control = process_control(store, _limits(values["limit"]), values["baseline"])
    write_charts(control, values["charts"])
    if as_json:
        print_json(control.as_dict())
        return
    for chart_set in control.sets:
        for kind, words, points in chart_set.signals:
            more = f" and at {len(points) - 1} more" if len(points) > 1 else ""
            click.echo(f"{chart_set.name}, {kind} chart: {words} at {points[0]}{more}")
    for sentence in control.advice:
        click.echo(sentence)
    print_verdict(f"Charts: {len(control.sets)}, in {values['charts'] / PAGE}")


def _print_gauge(values: Mapping[str, Any], as_json: bool) -> None:
    from sbafab.results.gauge_study import gauge_study, read_readings

    limits = _limits(values["limit"])
    if set(limits) - {"reading"} or any(None in pair for pair in limits.values()):
        raise click.UsageError("with --gauge give --limit reading=LOW:HIGH")
    study = gauge_study(read_readings(values["gauge"]), _width(limits.get("reading")))
    if as_json:
        print_json({"schema": GAUGE_SCHEMA, **study.as_dict()})
        return
    _print_table(
        "Analysis of variance",
        ("source", "degrees", "sum of squares", "mean square", "F", "p"),
        (
            (row.source, str(row.degrees), *(_figure(value) for value in row[2:]))
            for row in study.rows
        ),
    )
    names = ("repeatability", "operators", "interaction", "gauge", "parts", "total")
    _print_table(
        "Standard deviations" + (", interaction pooled" if study.is_pooled else ""),
        ("of", "deviation", "of the total"),
        ((n, _figure(getattr(study, n)), _share(getattr(study, n), study.total)) for n in names),
    )
    if study.of_tolerance is not None:
        click.echo(f"6 deviations of the gauge take {study.of_tolerance:.1%} of the limits' width")
    print_verdict(
        f"The gauge takes {study.share:.1%} of the total deviation and tells {study.categories} "
        f"classes apart: {study.verdict}"
    )


def _width(limits: ControlLimits | None) -> float | None:
    if limits is None or limits.low is None or limits.high is None:
        return None
    return limits.high - limits.low


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _share(value: float, total: float) -> str:
    return f"{value / total:.1%}" if total else ""


def _find(store: Lab, values: Mapping[str, Any], as_json: bool) -> None:
    records, builds = store.contents()
    entries = store.entries()
    lines = matching(values["find"], values["serial"], entries, builds)
    find = matching if lines else found_by
    matches = find(values["find"], values["serial"], records, builds)
    shown = Shown(matches, lines, records, entries, builds)
    print_records(shown, as_json, f"found in {store.path}")


def _result(values: Mapping[str, Any]) -> LabResult:
    options = {name.replace("-", "_"): value for name, value in values.items()}
    return LabResult(
        serial=values["serial"],
        leak=values["leak"] or "",
        operator=values["operator"],
        kit=values["kit"],
        note=values["note"],
        numbers={q.name: options[q.option] for q in NUMBERS if options[q.option] is not None},
        errors={
            q.name: options[q.option.replace("-", "_")]
            for q in ERRORS
            if options[q.option.replace("-", "_")]
        },
    )


def _change(values: Mapping[str, Any]) -> LabResult:
    from dataclasses import replace

    change = _result(values)
    if change.is_empty and not (
        change.serial or change.operator or change.kit or values["withdraw"]
    ):
        raise click.UsageError("give the correct result, such as --leak fail, or --withdraw")
    return replace(change, withdrawn=values["withdraw"])


def _add_records(
    store: Lab, source: str, assignments: tuple[str, ...], values: Mapping[str, Any]
) -> list[Any]:
    """Load the design that was built, read the results and store both."""
    if values["table"] is not None:
        results = read_batch(values["table"])
    else:
        results = [checked(_result(values))]
        if not results[0].serial:
            raise click.UsageError("give --serial, the actuator's number on its traveller")
        if results[0].is_empty:
            raise click.UsageError("give a result, such as --leak pass or --note TEXT")
    return record_results(store, built_from(source, assignments), results, values["again"])


# Printing: records as lines, the four tables of the report.


class Shown(NamedTuple):
    """Records and entries to print, all those among which corrections are looked for, designs."""

    records: Sequence[Record]
    entries: Sequence[StoredEntry]
    all_records: Sequence[Record]
    all_entries: Sequence[StoredEntry]
    builds: Mapping[str, Build]

    def newer(self) -> dict[str, str]:
        """Return the number of the row that corrects another, by the number of that."""
        return {
            row_number(row, row.corrects): row_number(row)
            for row in all_rows(self.all_records, self.all_entries)
            if row.corrects is not None
        }


def print_records(shown: Shown, as_json: bool, action: str) -> None:
    """Print a line for each record and entry, and their count with ``action``."""
    newer = shown.newer()
    if as_json:
        print_json({"schema": RECORDS_SCHEMA, **_rows(shown, newer)})
        return
    for row in all_rows(shown.records, shown.entries):
        click.echo(_line(row, shown.builds[row.design_sha256].name, newer.get(row_number(row))))
    for entry in shown.entries:
        if entry.is_expired and not entry.withdrawn:
            click.echo(
                f"warning: entry e{entry.id}: {entry.item} lot {entry.lot} expired on "
                f"{entry.expires}, before {entry.day}"
            )
    counts = [(len(shown.records), "record", "records"), (len(shown.entries), "entry", "entries")]
    words = [f"{n} {name if n == 1 else names}" for n, name, names in counts if n]
    print_verdict(f"{' and '.join(words)} {action}")


def _rows(shown: Shown, newer: Mapping[str, str]) -> dict[str, Any]:
    def row(stored: RecordRow) -> dict[str, Any]:
        build = shown.builds[stored.design_sha256]
        number = newer.get(row_number(stored), "").removeprefix("e")
        return {
            **stored.as_dict(),
            "design": build.name,
            "corrected_by": int(number) if number else None,
            "actuator_sha256": build.actuator,
        }

    return {
        "records": [row(record) for record in shown.records],
        "entries": [row(entry) for entry in shown.entries],
    }


def _line(row: RecordRow, design: str, newer: str | None) -> str:
    parts = [row_words(row)]
    parts += [f"attempt {row.attempt}"] if row.attempt > 1 else []
    parts += [f"corrects {row_number(row, row.corrects)}"] if row.corrects is not None else []
    parts += ["withdrawn"] if row.withdrawn else []
    parts += [f"corrected by {newer}"] if newer is not None else []
    kind = "entry" if isinstance(row, StoredEntry) else "record"
    name = f"{design} {row.design_sha256[:8]}"
    words = ", ".join(part for part in parts if part)
    return f"{kind} {row_number(row)}, {row.recorded}: {name}, serial {row.serial}: {words}"


def print_report(report: Report, as_json: bool) -> None:
    """Print success, measured against predicted values, tolerances, advice, and last the counts."""
    if as_json:
        print_json({"schema": REPORT_SCHEMA, **report.as_dict()})
        return
    _print_table(
        "Success: leak test passed at the first attempt, with 95 % Wilson interval",
        ("by", "", "passed", "share", "interval", "passed later"),
        (
            (
                s.by,
                s.name,
                f"{s.share.good} of {s.share.builds}",
                f"{s.share.value:.1%}",
                _range(s.share),
                str(s.passed_later or ""),
            )
            for s in report.success
        ),
    )
    _print_table(
        "Measured mean with 95 % interval, against predicted",
        ("design", "quantity", "n", "measured", "predicted", "ratio", ""),
        (
            (
                *(c.design, c.quantity, str(c.count), _mean(c)),
                "" if c.predicted is None else f"{c.predicted:.4g}",
                "" if c.ratio is None else f"{c.ratio:.3f}",
                f"{c.verdict}{f': {c.model}' if c.model else ''}",
            )
            for c in report.comparisons
        ),
    )
    _print_table(
        "Tolerances: largest measured error, and upper limit (95 %)",
        ("kit", "hand", "key", "stated", "n", "largest", "at most", ""),
        (
            (
                *(t.kit, t.operator, t.key, f"{t.stated:g} {t.unit}", str(t.found.errors)),
                *(f"{t.found.largest:.3g}", f"{t.found.highest:.3g}", t.verdict),
            )
            for t in report.tolerances
        ),
    )
    _print_table(
        "Success against registration-yield, the share of builds within all limits",
        ("design", "passed", "interval", "as stated", "as measured", ""),
        (
            (
                *(p.design, f"{p.success.good} of {p.success.builds}"),
                *(_range(p.success), f"{p.promised:.1%}", _measured_range(p), p.verdict),
            )
            for p in report.promises
        ),
    )
    for sentence in report.contradictions:
        click.echo(f"\nwarning: {sentence}")
    for advice in _advice(report):
        click.echo(f"\n{advice}")
    count = len(report.contradictions)
    warned = f", {count} warning{'s' if count > 1 else ''}" if count else ""
    actuators = "1 actuator" if report.items == 1 else f"{report.items} actuators"
    records = "1 record" if report.records == 1 else f"{report.records} records"
    print_verdict(f"\nReport on {actuators}, {records}{warned}")


def _range(share: Share) -> str:
    low, high = share.interval
    return f"{low:.1%} to {high:.1%}"


def _measured_range(promise: Promise) -> str:
    if promise.measured is None:
        return ""
    return f"{promise.measured.low:.1%} to {promise.measured.high:.1%}"


def _mean(comparison: Comparison) -> str:
    if comparison.low is None or comparison.high is None:
        return f"{comparison.mean:.4g} {comparison.unit}"
    return (
        f"{comparison.mean:.4g} ({comparison.low:.4g} to {comparison.high:.4g}) {comparison.unit}"
    )


def _advice(report: Report) -> Iterable[str]:
    for tolerance in report.tolerances:
        errors = tolerance.found
        whose = f"with kit {tolerance.kit}"
        whose += f" by {tolerance.operator}" if tolerance.operator else ""
        if tolerance.verdict == "too small":
            yield (
                f"{tolerance.key} = {tolerance.stated:g} is too small {whose}: an error of "
                f"{errors.largest:g} {tolerance.unit} was measured; set it to "
                f"{errors.highest:.3g} at most, or find the cause"
            )
        elif tolerance.verdict == "wider than needed":
            yield (
                f"{tolerance.key} = {tolerance.stated:g} is wider than needed {whose}: "
                f"{errors.highest:.3g} {tolerance.unit} covers {errors.errors} measurements"
            )
    for compared in report.comparisons:
        if compared.verdict != "differs":
            continue
        value = compared.ratio or 0.0
        if compared.quantity == "force_n" and 0 < value <= 10:
            yield (
                f"{compared.design}: sbafab predict --contact-factor {value:.3f} uses the measured "
                "force_n"
            )
        if compared.quantity == "height_mm":
            yield f"{compared.design}: sbafab calibrate fits the press factor to its height_mm"


def _print_table(title: str, names: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    from rich.table import Table
    from rich.text import Text

    rows = list(rows)
    if not rows:
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in names:
        table.add_column(name, overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    out = console()
    out.print()
    out.print(Text(title, style="bold"))
    out.print(table)
