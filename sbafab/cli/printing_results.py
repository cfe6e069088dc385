"""What ``sbafab record`` prints: records as rows, and the report's four tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import click

from sbafab.cli.lines import console
from sbafab.cli.printing import print_json
from sbafab.output.printed import RECORDS_SCHEMA, REPORT_SCHEMA

if TYPE_CHECKING:
    from sbafab.results.records import Build, Record
    from sbafab.results.report import Comparison, Promise, Report
    from sbafab.rules.registration_yield import Share


FACTORS = {"height_mm": ("--press-factor", 1.0), "force_n": ("--contact-factor", 10.0)}
"""Options of ``sbafab predict`` that take a measured ratio, and the most they take."""


def print_records(
    shown: Sequence[Record],
    every: Sequence[Record],
    builds: Mapping[str, Build],
    as_json: bool,
    ending: str = "",
) -> None:
    """Records a line each, with what they correct and what corrects them."""
    newer = {record.corrects: record.id for record in every if record.corrects is not None}
    if as_json:
        told = [
            {**record.as_dict(), "design": builds[record.design_sha256].name}
            | {"corrected_by": newer.get(record.id)}
            | {"actuator_sha256": builds[record.design_sha256].actuator}
            for record in shown
        ]
        print_json({"schema": RECORDS_SCHEMA, "records": told})
        return
    for record in shown:
        click.echo(_line(record, builds[record.design_sha256].name, newer.get(record.id)))
    if ending:
        click.echo(ending)


def _line(record: Record, design: str, newer: int | None) -> str:
    told = [f"{name} {value}" for name, value in record.once.items()]
    told += [f"{name} {' '.join(f'{v:g}' for v in found)}" for name, found in record.errors.items()]
    told += [record.note] if record.note else []
    told += [f"attempt {record.attempt}"] if record.attempt > 1 else []
    told += [f"corrects {record.corrects}"] if record.corrects is not None else []
    told += ["withdrawn"] if record.withdrawn else []
    told += [f"corrected by {newer}"] if newer is not None else []
    name = f"{design} {record.design_sha256[:8]}"
    return (
        f"record {record.id}, {record.recorded}: {name}, serial {record.serial}: {', '.join(told)}"
    )


def print_report(report: Report, as_json: bool) -> None:
    """Success, measured against predicted, tolerances, and what to do about them."""
    if as_json:
        print_json({"schema": REPORT_SCHEMA, **report.as_dict()})
        return
    click.echo(f"actuators: {report.items}, records: {report.records}")
    _print_table(
        "Success: leak test passed at the first attempt, with Wilson's interval of 95 %",
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
        "Measured, mean with its interval of 95 %, against predicted",
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
        "Tolerances: the largest error measured, and the most that it leaves room for (95 %)",
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
        "Success against registration-yield, the share of builds that keep every limit",
        ("design", "passed", "interval", "as stated", "as measured", ""),
        (
            (
                *(p.design, f"{p.success.good} of {p.success.builds}"),
                *(_range(p.success), f"{p.promised:.1%}", _measured(p), p.verdict),
            )
            for p in report.promises
        ),
    )
    for sentence in report.contradictions:
        click.echo(f"\nwarning: {sentence}")
    for advice in _advice(report):
        click.echo(f"\n{advice}")


def _range(share: Share) -> str:
    low, high = share.interval
    return f"{low:.1%} to {high:.1%}"


def _measured(promise: Promise) -> str:
    if promise.measured is None:
        return ""
    return f"{promise.measured.low:.1%} to {promise.measured.high:.1%}"


def _mean(found: Comparison) -> str:
    if found.low is None or found.high is None:
        return f"{found.mean:.4g} {found.unit}"
    return f"{found.mean:.4g} ({found.low:.4g} to {found.high:.4g}) {found.unit}"


def _advice(report: Report) -> Iterable[str]:
    for tolerance in report.tolerances:
        found = tolerance.found
        whose = f"with kit {tolerance.kit}"
        whose += f" by {tolerance.operator}" if tolerance.operator else ""
        if tolerance.verdict == "too small":
            yield (
                f"{tolerance.key} = {tolerance.stated:g} does not describe what came out "
                f"{whose}: {found.largest:g} {tolerance.unit} was measured; set it to "
                f"{found.highest:.3g} at most, or find what went wrong there"
            )
        elif tolerance.verdict == "wider than needed":
            yield (
                f"{tolerance.key} = {tolerance.stated:g} is wider than needed {whose}: "
                f"{found.highest:.3g} {tolerance.unit} describes {found.errors} measurements"
            )
    for compared in report.comparisons:
        factor, most = FACTORS.get(compared.quantity, ("", 0.0))
        ratio = compared.ratio
        if factor and ratio and ratio <= most and compared.verdict == "differs":
            yield (
                f"{compared.design}: sbafab predict {factor} {ratio:.3f} takes the measured "
                f"{compared.quantity} into account"
            )


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
