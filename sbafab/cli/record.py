"""``sbafab record``: what came out, kept in the lab's own file, and what it says together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sbafab.cli.options import json_option, set_option
from sbafab.cli.quantities import LENGTH, PRESSURE

if TYPE_CHECKING:
    from sbafab.results.records import LabResult
    from sbafab.results.store import Lab

Wrapped = Callable[..., Any]


def _measured(command: Wrapped) -> Wrapped:
    """Options for what was measured, in the order of the help."""
    options = (
        click.option(
            "--leak", type=click.Choice(["pass", "fail"]), help="Result of the leak test."
        ),
        click.option(
            "--burst", type=PRESSURE.read, metavar="P", help="Pressure at which it burst, kPa."
        ),
        click.option("--stroke", type=LENGTH.read, metavar="MM", help="Full stroke."),
        click.option("--force", type=float, metavar="N", help="Blocked force at 100 kPa, flat."),
        click.option("--height", type=LENGTH.read, metavar="MM", help="Height pressed, deflated."),
        click.option("--mass", type=float, metavar="G", help="Mass without tubes."),
        click.option(
            "--offset",
            type=LENGTH.read,
            multiple=True,
            metavar="MM",
            help="How far a layer laid by hand lies off. Repeatable.",
        ),
        click.option(
            "--turn",
            type=float,
            multiple=True,
            metavar="DEG",
            help="How far a layer laid by hand is turned. Repeatable.",
        ),
        click.option(
            "--cut-error",
            type=LENGTH.read,
            multiple=True,
            metavar="MM",
            help="How far a cut edge lies off its place. Repeatable.",
        ),
        click.option("--operator", default="", metavar="NAME", help="Who built it."),
        click.option("--kit", default="", metavar="NAME", help="What it was built with."),
        click.option("--note", default="", metavar="TEXT", help="Anything else."),
    )
    for option in reversed(options):
        command = option(command)
    return command


@click.command()
@click.argument("design", metavar="[DESIGN]", required=False)
@click.option("--serial", default="", metavar="NAME", help="Which actuator; see its traveller.")
@_measured
@click.option(
    "--table",
    type=click.Path(path_type=Path),
    metavar="CSV",
    help="A row an actuator, instead of --serial and what follows it.",
)
@click.option(
    "--again", is_flag=True, help="A new attempt: the actuator was mended and tested again."
)
@click.option("--correct", type=int, metavar="N", help="Add a record that corrects record N.")
@click.option("--withdraw", is_flag=True, help="With --correct: record N should not be there.")
@click.option("--find", metavar="TEXT", help="Show records: a serial, a design, a scanned code.")
@click.option("--report", is_flag=True, help="What all records say together.")
@click.option(
    "--lab",
    type=click.Path(path_type=Path, dir_okay=False),
    default=Path("lab.sqlite"),
    envvar="SBAFAB_LAB",
    show_default=True,
    show_envvar=True,
    metavar="FILE",
    help="The lab's file of records.",
)
@set_option
@json_option
def record(
    design: str | None, lab: Path, assignments: tuple[str, ...], as_json: bool, **said: Any
) -> None:
    """Record what came out, and see what all records say.

    DESIGN is a template's name, a TOML file or the folder that was built from, an assembly's
    likewise. Records are only added: --correct adds one that names the record it corrects. Nothing
    leaves this machine.

    \b
    sbafab record 3dof-15mm --serial A1 --leak pass --stroke 16.8
    sbafab record 3dof-15mm --table batch.csv
    sbafab record --report
    """  # noqa: D301 (click reads the backspace as a mark)
    from sbafab.cli.printing_results import print_records, print_report
    from sbafab.results.finding import found_by
    from sbafab.results.report import report
    from sbafab.results.store import Lab

    store = Lab(lab)
    _one_task(design, said)
    if said["report"]:
        print_report(report(*store.contents()), as_json)
    elif said["find"] is not None:
        records, builds = store.contents()
        found = found_by(said["find"], said["serial"], records, builds)
        print_records(found, records, builds, as_json)
    else:
        if said["correct"] is not None:
            added = [store.correct(said["correct"], _change(said))]
        else:
            added = _recorded(store, str(design), assignments, said)
        print_records(added, added, store.contents()[1], as_json, f"recorded in {lab}")


def _one_task(design: str | None, said: Mapping[str, Any]) -> None:
    """Raises UsageError unless exactly one thing is asked for."""
    asked = [name for name in ("report", "find", "correct") if said[name] not in (None, False)]
    if len(asked) > 1 or (asked and (design or said["table"])):
        raise click.UsageError("give either DESIGN, --correct, --find or --report")
    if not asked and design is None:
        raise click.UsageError("name the DESIGN that was built, or give --find or --report")
    if said["again"] and asked:
        raise click.UsageError("--again goes with DESIGN, --serial and what came out this time")
    if said["withdraw"] and said["correct"] is None:
        raise click.UsageError("--withdraw goes with --correct N")
    is_said = not _result(said).is_empty or said["operator"] or said["kit"]
    if (is_said or (said["serial"] and said["report"])) and asked not in ([], ["correct"]):
        raise click.UsageError(f"--{asked[0]} only shows records; leave out what was measured")
    if said["table"] and (is_said or said["serial"]):
        raise click.UsageError("--table holds serials and what was measured; leave those out")


def _result(said: Mapping[str, Any]) -> LabResult:
    from sbafab.results.records import ERRORS, NUMBERS, LabResult

    given = {name.replace("-", "_"): value for name, value in said.items()}
    return LabResult(
        serial=said["serial"],
        leak=said["leak"] or "",
        operator=said["operator"],
        kit=said["kit"],
        note=said["note"],
        numbers={q.name: given[q.option] for q in NUMBERS if given[q.option] is not None},
        errors={
            q.name: given[q.option.replace("-", "_")]
            for q in ERRORS
            if given[q.option.replace("-", "_")]
        },
    )


def _change(said: Mapping[str, Any]) -> LabResult:
    from dataclasses import replace

    change = _result(said)
    if change.is_empty and not (change.serial or change.operator or change.kit or said["withdraw"]):
        raise click.UsageError("say what is right instead, such as --leak fail, or --withdraw")
    return replace(change, withdrawn=said["withdraw"])


def _recorded(
    store: Lab, source: str, assignments: tuple[str, ...], said: Mapping[str, Any]
) -> list[Any]:
    """Loads what was built, reads what came out and stores both."""
    from sbafab.results.batch import read_batch
    from sbafab.results.recording import built_from
    from sbafab.results.recording import record as record_results
    from sbafab.results.records import checked

    if said["table"] is not None:
        results = read_batch(said["table"])
    else:
        results = [checked(_result(said))]
        if not results[0].serial:
            raise click.UsageError("give --serial, the actuator's number on its traveller")
        if results[0].is_empty:
            raise click.UsageError("say what came out, such as --leak pass or --note TEXT")
    return record_results(store, built_from(source, assignments), results, said["again"])
