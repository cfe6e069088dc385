"""``sbafab record``: results of builds in the lab's file, and a report on all of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sbafab.cli.options import LENGTH, PRESSURE, Command, json_option, set_option
from sbafab.cli.printing import console, print_json, print_verdict
from sbafab.output.schema_ids import RECORDS_SCHEMA, REPORT_SCHEMA
from sbafab.results.recording import built_from, found_by, read_batch
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
        click.option("--stroke", type=LENGTH.read, metavar="MM", help="Full stroke."),
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
@click.option("--correct", type=int, metavar="N", help="Add a record that corrects record N.")
@click.option("--withdraw", is_flag=True, help="With --correct: withdraw record N.")
@click.option(
    "--find", metavar="TEXT", help="Show the records of a serial, a design or a scanned code."
)
@click.option("--report", is_flag=True, help="Report on all records.")
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
    sbafab record 3dof-15mm --table batch.csv
    sbafab record --report
    """  # noqa: D301 (click reads the backspace as a mark)
    store = Lab(lab)
    _one_task(design, values)
    if values["report"]:
        print_report(report(*store.contents()), as_json)
    elif values["find"] is not None:
        records, builds = store.contents()
        matches = found_by(values["find"], values["serial"], records, builds)
        print_records(matches, records, builds, as_json, f"found in {lab}")
    else:
        if values["correct"] is not None:
            added = [store.correct(values["correct"], _change(values))]
        else:
            added = _add_records(store, str(design), assignments, values)
        print_records(added, added, store.contents()[1], as_json, f"added to {lab}")


def _one_task(design: str | None, values: Mapping[str, Any]) -> None:
    """Raise UsageError unless the options name exactly one task."""
    tasks = [name for name in ("report", "find", "correct") if values[name] not in (None, False)]
    if len(tasks) > 1 or (tasks and (design or values["table"])):
        raise click.UsageError("give only one of DESIGN, --correct, --find and --report")
    if not tasks and design is None:
        raise click.UsageError("give the DESIGN that was built, --find or --report")
    if values["again"] and tasks:
        raise click.UsageError("--again goes with DESIGN, --serial and results")
    if values["withdraw"] and values["correct"] is None:
        raise click.UsageError("--withdraw goes with --correct N")
    has_result = not _result(values).is_empty or values["operator"] or values["kit"]
    if (has_result or (values["serial"] and values["report"])) and tasks not in ([], ["correct"]):
        raise click.UsageError(f"--{tasks[0]} only shows records; leave out the measurements")
    if values["table"] and (has_result or values["serial"]):
        raise click.UsageError("--table holds serials and measurements; leave out their options")


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


FACTORS = {"height_mm": ("--press-factor", 1.0), "force_n": ("--contact-factor", 10.0)}
"""Options of ``sbafab predict`` for a measured ratio, and its largest value."""


def print_records(
    shown: Sequence[Record],
    every: Sequence[Record],
    builds: Mapping[str, Build],
    as_json: bool,
    action: str,
) -> None:
    """Print a line for each record, with its corrections, and their count with ``action``."""
    newer = {record.corrects: record.id for record in every if record.corrects is not None}
    if as_json:
        rows = [
            {**record.as_dict(), "design": builds[record.design_sha256].name}
            | {"corrected_by": newer.get(record.id)}
            | {"actuator_sha256": builds[record.design_sha256].actuator}
            for record in shown
        ]
        print_json({"schema": RECORDS_SCHEMA, "records": rows})
        return
    for record in shown:
        click.echo(_line(record, builds[record.design_sha256].name, newer.get(record.id)))
    count = "1 record" if len(shown) == 1 else f"{len(shown)} records"
    print_verdict(f"{count} {action}")


def _line(record: Record, design: str, newer: int | None) -> str:
    parts = [f"{name} {value}" for name, value in record.once.items()]
    parts += [
        f"{name} {' '.join(f'{v:g}' for v in errors)}" for name, errors in record.errors.items()
    ]
    parts += [record.note] if record.note else []
    parts += [f"attempt {record.attempt}"] if record.attempt > 1 else []
    parts += [f"corrects {record.corrects}"] if record.corrects is not None else []
    parts += ["withdrawn"] if record.withdrawn else []
    parts += [f"corrected by {newer}"] if newer is not None else []
    name = f"{design} {record.design_sha256[:8]}"
    return (
        f"record {record.id}, {record.recorded}: {name}, serial {record.serial}: {', '.join(parts)}"
    )


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
        factor, most = FACTORS.get(compared.quantity, ("", 0.0))
        value = (compared.ratio or 0.0) * _predicted_factor(compared)
        if factor and 0 < value <= most and compared.verdict == "differs":
            yield (
                f"{compared.design}: sbafab predict {factor} {value:.3f} uses the measured "
                f"{compared.quantity}"
            )


def _predicted_factor(compared: Comparison) -> float:
    """Return the press factor that a prediction has in it already; 1 without one."""
    found = re.search(r" x press factor ([\d.]+)", compared.model)
    return float(found[1]) if found else 1.0


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
