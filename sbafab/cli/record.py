"""``sbafab record``: results of builds in the lab's file, and a report about them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from sbafab.api import lab as api
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.errors import DesignError

MEASUREMENTS = (
    opt.option("--leak", "Result of the leak test.", ("pass", "fail")),
    opt.option("--burst burst_kpa P", "Burst pressure, kPa.", opt.PRESSURE),
    opt.option("--proof proof_kpa P", "Pressure held in the proof test, kPa.", opt.PRESSURE),
    opt.option("--stroke stroke_mm MM", "Stroke when full, as the paper measured it.", opt.LENGTH),
    opt.option("--force force_n N", "Blocked force at 100 kPa, flat.", float),
    opt.option("--height height_mm MM", "Pressed height, deflated.", opt.LENGTH),
    opt.option("--mass mass_g G", "Mass without tubes.", float),
    opt.option("--offset offset_mm MM...", "Placement error of a layer laid by hand.", opt.LENGTH),
    opt.option("--turn turn_deg DEG...", "Angle error of a layer laid by hand.", float),
    opt.option("--cut-error cut_mm MM...", "Position error of a cut edge.", opt.LENGTH),
    opt.option("--operator NAME", "Name of the builder."),
    opt.option("--kit NAME", "Kit that it was built with."),
    opt.option("--note TEXT", "Free text."),
)
"""Options of a result, each with the name of its column."""
RESULTS = tuple(name for name in api.columns(api.Record) if name != "serial")


def _measurement_options(command: opt.Command) -> opt.Command:
    """Add the options of measurements, in the order of the help."""
    for option in reversed(MEASUREMENTS):
        command = option(command)
    return command


def _row_key(
    context: click.Context, parameter: click.Parameter, value: str | None
) -> tuple[type[api.Record | api.HistoryEntry], int] | None:
    """Return the kind of a row such as 3 or e3, and its number."""
    if value is None:
        return None
    match = re.fullmatch(r"(e?)(\d{1,9})", value)
    if match is None:
        raise click.BadParameter(
            f"{value!r} is neither a record, such as 3, nor an entry, such as e3"
        )
    return api.HistoryEntry if match[1] else api.Record, int(match[2])


@click.command()
@opt.design_argument("design", metavar="[DESIGN]", required=False)
@opt.option("--serial NAME", "Serial of the actuator, on its traveller.", default="")
@_measurement_options
@opt.option(
    "--table CSV",
    "Table with a row for each actuator, instead of --serial and measurements.",
    opt.file_path(),
)
@opt.option(
    "--entry TEXT...",
    "A line of the device's history: 'step=1 temperature_c=134 initials=AL'. Fields: "
    f"{', '.join(api.columns(api.HistoryEntry))}.",
)
@opt.option(
    "--history FILE",
    "Lines of history from the filled record page: CSV, TOML or JSON.",
    opt.file_path(),
)
@opt.option("--again", "A new attempt, after a repair.", bool)
@opt.option(
    "--correct N",
    "Add a record that corrects record N, or entry N, such as e3.",
    callback=_row_key,
)
@opt.option("--withdraw", "With --correct: withdraw record or entry N.", bool)
@opt.option("--find TEXT", "Show the records of a serial, a design or a scanned code.")
@opt.option("--report", "Report on all records.", bool)
@opt.option(
    "--export FILE",
    "Write the rows of all devices, or of --find or --serial: CSV or JSON.",
    opt.file_path(dir_okay=False),
)
@opt.option(
    "--chart SVG",
    "Draw the share of actuators that passed the leak test, with its interval.",
    opt.file_path(dir_okay=False),
)
@opt.option(
    "--lab FILE",
    "File of the lab's records.",
    opt.file_path(dir_okay=False),
    default=Path("lab.sqlite"),
    envvar="SBAFAB_LAB",
    show_envvar=True,
)
@opt.set_option
@opt.json_option
def record(lab: Path, assignments: tuple[str, ...], as_json: bool, **values: Any) -> None:
    """Record the results of builds, and report on them.

    DESIGN is a template's name, a TOML file or the output folder of the build, also for an
    assembly. Records are never changed: --correct adds a record that replaces another. No data
    leaves this computer.

    \b
    sbafab record 3dof-15mm --serial A1 --leak pass --stroke 16.8
    sbafab record 3dof-15mm --serial A1 --entry "step=1 temperature_c=134 minutes=20"
    sbafab record 3dof-15mm --table batch.csv
    sbafab record --report
    """  # noqa: D301 (click reads the backspace as a mark)
    store = api.Lab(lab)
    values = {k: v for k, v in values.items() if v not in (None, "", ()) and v is not False}
    task = _task(values)
    if task == "report":
        records, _, builds = store.contents()
        _print_report(api.report_of(records, builds), as_json)
    elif task == "chart":
        records, _, builds = store.contents()
        api.recording.save_text(values["chart"], api.success_svg(records, builds))
        show.verdict(str(values["chart"]))
    elif task == "export":
        count = api.recording.write_history(_matches(store, values), values["export"])
        show.verdict(f"{values['export']}: {show.several(count, 'device')}")
    elif task == "find":
        matches = _matches(store, values)
        _print_rows([*matches.entries, *matches.records], store, as_json, "found in")
    elif task == "correct":
        _print_rows([_correct(store, values)], store, as_json, "added to")
    else:
        rows = _new_rows(values)
        built = api.recording.built_from(values["design"], assignments)
        rows = api.recording.record(store, built, rows, "again" in values)
        _print_rows(rows, store, as_json, "added to")


GOES_WITH: Mapping[str, tuple[str, ...]] = {
    "report": (),
    "chart": (),
    "export": ("find", "serial"),
    "find": ("serial",),
    "correct": ("withdraw", "entry", "serial", *RESULTS),
    "table": ("design", "again"),
    "history": ("design", "again", "serial", "entry"),
    "entry": ("design", "again", "serial"),
    "design": ("again", "serial", *RESULTS),
}
"""Actions: a call does the first that it names; and the options that go with each."""


def _task(values: Mapping[str, Any]) -> str:
    """Return the name of the requested task. Raises UsageError."""
    task = next((name for name in GOES_WITH if name in values), "design")
    for name in values:
        if name not in (task, *GOES_WITH[task]):
            raise click.UsageError(
                f"{_flag(name)} cannot be combined with {_flag(task)}; use them separately"
            )
    if "design" not in values and "design" in (task, *GOES_WITH[task]):
        raise click.UsageError("give the DESIGN that was built, --find or --report")
    return task


def _flag(name: str) -> str:
    flags = {param.name: param.opts[0] for param in record.params}
    return "DESIGN" if name == "design" else flags[name]


def _new_rows(values: Mapping[str, Any]) -> Sequence[api.LabRow]:
    """Return the results, or the history entries, in the options."""
    if "table" in values:
        return api.recording.read_batch(values["table"])
    if not values.keys() & {"entry", "history"}:
        return [api.row_of(api.Record, _result(values))]
    serial = {"serial": values.get("serial")}
    entries: list[api.HistoryEntry] = []
    for text in values.get("entry", ()):
        entries += api.recording.entries_of({**serial, **_pairs(text)}, f"--entry {text!r}")
    if "history" in values:
        entries += api.recording.read_history(values["history"], serial)
    return entries


def _result(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the result in the options, by column."""
    return {column: values[column] for column in ("serial", *RESULTS) if column in values}


def _pairs(text: str) -> dict[str, str]:
    """Return the fields of a line such as ``step=1 reason='leaks at the rim'``."""
    try:
        words = shlex.split(text)
    except ValueError:
        raise click.UsageError(f"--entry {text!r} has an unmatched quotation mark") from None
    pairs = [word.partition("=") for word in words]
    if not all(name and sign for name, sign, _ in pairs):
        raise click.UsageError(f"--entry {text!r} must be fields such as step=1 minutes=20")
    return {name: value for name, _, value in pairs}


def _correct(store: api.Lab, values: Mapping[str, Any]) -> api.LabRow:
    """Store a row that corrects another."""
    kind, number = values["correct"]
    is_entry = kind is api.HistoryEntry
    change = _pairs(" ".join(values.get("entry", ()))) if is_entry else _result(values)
    is_other = values.keys() & ({"serial", *RESULTS} if is_entry else {"entry"})
    if is_other or not (change or "withdraw" in values):
        wanted = "an --entry with the correct text" if is_entry else "the correct result"
        raise click.UsageError(f"give {wanted}, or --withdraw")
    row: api.LabRow = store.correct(kind, number, {**change, "withdrawn": "withdraw" in values})
    return row


def _matches(store: api.Lab, values: Mapping[str, Any]) -> api.Contents:
    """The rows that match --find and --serial, or all. Raises DesignError if there are none."""
    records, entries, builds = store.contents()
    serial = values.get("serial", "")
    text = values.get("find", serial)
    if text:
        records = api.recording.matching(text, serial, records, builds)
        entries = api.recording.matching(text, serial, entries, builds)
    if not records and not entries:
        raise DesignError(
            f"no record matches {text[:60]!r}; give a serial, a design's name, at least 8 digits "
            "of its sha256, or the text of the traveller's code"
        )
    return api.Contents(records, entries, builds)


# Printing: rows as lines, the tables of the report.


def _print_rows(rows: Sequence[api.LabRow], store: api.Lab, as_json: bool, action: str) -> None:
    """Print a line for each row, and their count with ``action``."""
    records, entries, builds = store.contents()
    newer = {(row.NOUN, row.corrects): row.id for row in (*records, *entries)}
    documents: dict[str, list[api.RowEntry]] = {"record": [], "entry": []}
    for row in rows:
        build, corrected_by = builds[row.design_sha256], newer.get((row.NOUN, row.id))
        kind = api.HistoryRow if isinstance(row, api.HistoryEntry) else api.RecordEntry
        more = {"design": build.name, "corrected_by": corrected_by}
        documents[row.NOUN].append(kind.read(row, actuator_sha256=build.actuator, **more))
        if not as_json:
            click.echo(_line(row, build.name, corrected_by))
            _print_expired(row)
    if as_json:
        lists = {"records": documents["record"], "entries": documents["entry"]}
        show.document(api.RecordsDocument.of(None, **lists))
        return
    counts = {"record": "records", "entry": "entries"}
    each = [
        show.several(len(documents[noun]), noun, counts[noun]) for noun in counts if documents[noun]
    ]
    show.verdict(f"{' and '.join(each)} {action} {store.path}")


def _line(row: api.LabRow, design: str, corrected_by: int | None) -> str:
    parts = [f"{name} {value}" for name, value in row.cells.items() if name != "serial"]
    parts += [f"attempt {row.attempt}"] if row.attempt > 1 else []
    parts += [f"corrects {row.SIGN}{row.corrects}"] if row.corrects is not None else []
    parts += ["withdrawn"] if row.withdrawn else []
    parts += [f"corrected by {row.SIGN}{corrected_by}"] if corrected_by is not None else []
    head = f"{row.NOUN} {row.number}, {row.recorded}: {design} {row.design_sha256[:8]}"
    return f"{head}, serial {row.serial}: {', '.join(parts)}"


def _print_expired(row: api.LabRow) -> None:
    """Print a warning if the lot of an entry had expired."""
    if isinstance(row, api.HistoryEntry) and row.is_expired and not row.withdrawn:
        day = row.date or row.recorded[:10]
        click.echo(
            f"warning: entry {row.number}: {row.item} lot {row.lot} expired on {row.expires}, "
            f"before {day}"
        )


FITTED = ("stroke_mm", "force_n", "height_mm")
"""Quantities that ``sbafab calibrate`` fits the models to."""


def _print_report(report: api.Report, as_json: bool) -> None:
    """Print success rates, measured against predicted values, advice, and last the counts."""
    document = api.ReportDocument.of(report)
    if as_json:
        show.document(document)
        return
    titles = {
        "success": "Success: leak test passed at the first attempt, with 95 % Wilson interval; "
        "promised by registration-yield",
        "measured": "Measured mean with 95 % interval, against predicted",
    }
    for name, title in titles.items():
        # Unit and model are in JSON alone.
        rows = [{k: row[k] for k in row if k not in ("unit", "model")} for row in document[name]]
        if rows:
            names = [key.removeprefix("passed_") for key in rows[0]]
            show.table(title, names, [[*row.values()] for row in rows])
            click.echo()
    off: dict[str, list[str]] = {}
    for compared in report.comparisons:
        if compared.verdict == "differs" and compared.quantity in FITTED:
            off.setdefault(compared.design, []).append(compared.quantity)
    for design, quantities in off.items():
        click.echo(f"{design}: sbafab calibrate fits the models to its {', '.join(quantities)}")
    actuators = show.several(report.items, "actuator")
    show.verdict(f"Report on {actuators}, {show.several(report.records, 'record')}")
