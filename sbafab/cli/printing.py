"""Printing that commands share: lines, tables of facts, JSON, findings and verdicts."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from sbafab import catalogue
from sbafab.cli.exit import print_error
from sbafab.cli.progress import QUIET, is_requested, print_result
from sbafab.rules.finding import Finding, counted, decisive

if TYPE_CHECKING:
    from rich.console import Console

    from sbafab.folders.build import Build

NO_BREAK = "\u00a0"
"""No-break space: `print_wrapped` keeps the words on both sides on one line."""


def console() -> Console:
    """Return a console on standard output; 80 columns without a terminal and COLUMNS."""
    from rich.console import Console

    class PipedConsole(Console):
        """A console that raises BrokenPipeError when the reader closes the pipe."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    return PipedConsole(highlight=False, soft_wrap=False)


def wrapped(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """Break a text between words into lines; ``first`` and ``rest`` are their indents."""
    return textwrap.wrap(
        text,
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )


def print_wrapped(text: str, style: str = "", indent: str = "") -> None:
    """Print a text broken between words, except at ``NO_BREAK``.

    Every line is indented by ``indent``; without it, all but the first by two spaces.
    """
    rest = indent or "  "
    for line in wrapped(text, console().width, indent, rest):
        print_line(line.replace(NO_BREAK, " "), style)


def print_line(text: str, style: str = "") -> None:
    """Print a line without breaking it."""
    from rich.text import Text

    console().print(Text(text, style=style), soft_wrap=True)


def print_table(title: str, names: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table below its title; nothing without rows."""
    from rich.table import Table
    from rich.text import Text

    if not rows:
        return
    print_line(title, "bold")
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in names:
        table.add_column(Text(name), overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    console().print(table)


def print_facts(facts: Iterable[tuple[str, str]]) -> None:
    """Print a table of labels and texts."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(no_wrap=True, style="bold")
    table.add_column(ratio=1, overflow="fold")
    for label, text in facts:
        table.add_row(label, Text(text))
    console().print(table)


def cell_text(value: str | float | None) -> str:
    """Return a value for a table: a number in four digits, None as an empty cell."""
    return "" if value is None else value if isinstance(value, str) else f"{value:.4g}"


FILES = "files"
"""The thing to change when a folder was checked, for `print_failed`."""
COLOURS = {"pass": "green", "fail": "bold red", "waived": "yellow", "warn": "yellow"}


def print_json(value: object) -> None:
    """Print a value as indented JSON."""
    print_result(json.dumps(value, indent=1, ensure_ascii=False))


def print_listed(label: str, phrases: Sequence[str]) -> None:
    """Print ``label: a, b, c``, with lines broken between phrases only."""
    text = ", ".join(phrase.replace(" ", NO_BREAK) for phrase in phrases)
    for line in wrapped(text, console().width, f"{label}: ", " " * (len(label) + 2)):
        print_line(line.replace(NO_BREAK, " "))


def several(number: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"


def notes_of(checked: Iterable[Build]) -> list[str]:
    """Return the notes of designs without repeats, each after the names of its designs.

    A note of all of them stands without names.
    """
    notes = {each.design.name: each.laminate.notes for each in checked}
    names = {
        note: [name for name, of in notes.items() if note in of]
        for of in notes.values()
        for note in of
    }
    return [
        note if len(of) == len(notes) else f"{', '.join(of)}: {note}" for note, of in names.items()
    ]


# Findings, one line per rule; remedies; the verdict in the last line.


SHARE_OF = {"pin-fit": "stretch", "registration-yield": "hold"}
"""Words after the per cent sign, by rule: a film stretches over its pin, builds hold."""


class FindingGroup(NamedTuple):
    """Findings of one design, or between the parts of an assembly."""

    name: str
    findings: Sequence[Finding]


def groups_of(
    checked: Iterable[Build], between: Sequence[Finding] | None = None
) -> tuple[FindingGroup, ...]:
    """Return a group of findings for each design, and one for the checks between parts."""
    groups = tuple(FindingGroup(design.design.name, design.findings) for design in checked)
    return groups if between is None else (*groups, FindingGroup("between the parts", between))


def print_findings(groups: Sequence[FindingGroup], verbose: bool = False) -> None:
    """Print a line for every rule (of several groups only if ``verbose``), and the remedies."""
    for group in groups:
        if len(groups) > 1:
            print_line(f"{group.name}: {counted(group.findings)}", "bold")
        if verbose or len(groups) == 1:
            print_lines(group.findings, verbose)
        if not verbose:
            print_open(group.findings)


def print_lines(findings: Sequence[Finding], verbose: bool = False) -> None:
    """Print a line for each rule's decisive finding; ``verbose``: for all, with their messages."""
    from rich.text import Text

    out, of_folders = console(), catalogue.names("folders")
    shown = findings if verbose else list(decisive(findings).values())
    wide = max((len(finding.rule) for finding in shown), default=0)
    out.print(Text(f"{'rule':{wide}}  verdict  {'measured':>13}  {'limit':>14}", style="bold"))
    for finding in shown:
        line = Text(f"{finding.rule:{wide}}  ")
        line.append(f"{finding.verdict:7}", style=COLOURS[finding.verdict])
        measured = short_figure(finding.measured, _unit(finding))
        is_empty = finding.measured is finding.limit is None
        if finding.verdict == "pass" and is_empty and finding.rule not in of_folders:
            measured = "not compared"
        line.append(f"  {measured:>13}  {limit_text(finding):>14}")
        line.rstrip()
        out.print(line, soft_wrap=True)
        for row in wrapped(finding.message, out.width, "    ", "    ") if verbose else ():
            out.print(Text(row), soft_wrap=True)


def print_open(findings: Sequence[Finding]) -> None:
    """Print the remedy, or the message, of each warning, failure and rule waived by the user."""
    sentences = {
        f"{finding.rule}: {finding.remedy or finding.message}": finding.verdict
        for finding in findings
        if finding.verdict in ("fail", "warn") or finding.by_user
    }
    # Bond and overhang may have one remedy.
    for sentence, verdict in sentences.items():
        print_wrapped(sentence, COLOURS[verdict])


def print_verdict(sentence: str, written: Path | None = None) -> None:
    """Print the last line of a command that is done; with -q only the ``written`` path."""
    print_line(sentence, "bold")
    print_written(written)


def print_written(path: Path | None) -> None:
    """With -q: print the folder or file that a command wrote, if any."""
    if is_requested(QUIET) and path is not None:
        print_result(path)


def print_failure(sentence: str) -> None:
    """Print the last line of a command that failed; with -q on standard error."""
    if is_requested(QUIET):
        print_error(sentence.replace(NO_BREAK, " "))
    else:
        print_wrapped(sentence, "bold red")


def print_note(text: str) -> None:
    """Print a note on standard error, unless -q is given."""
    if not is_requested(QUIET):
        click.echo(f"note: {text}", err=True)


def print_passed(
    name: str, groups: Sequence[FindingGroup], details: str = "", written: Path | None = None
) -> None:
    """Print the verdict of a design or assembly that passed; ``details``: the command for more."""
    more = f" Details: {details}" if details else ""
    counts = counted(*(group.findings for group in groups))
    print_verdict(f"{name} passed: {counts}.{more}", written)


def print_failed(name: str, findings: Iterable[Finding], consequence: str, change: str) -> None:
    """Print the verdict of what failed: the rules, the consequence and two remedies.

    A rule cannot be waived for files on disk, only for their design (``change`` is FILES).
    """
    failed = sorted({finding.rule for finding in findings if finding.verdict == "fail"})
    explain = f"sbafab explain {failed[0]}".replace(" ", NO_BREAK)
    waive = " ".join(f"--waive{NO_BREAK}{rule}" for rule in failed)
    other = f"waive by name: {waive}" if change != FILES else "regenerate the folder"
    print_failure(
        f"{name} failed: {', '.join(failed)}. {consequence}. Change the {change} ({explain}), "
        f"or {other}"
    )


def limit_text(finding: Finding) -> str:
    """Return a limit behind ">=" if it is a lower one, behind "<=" if it is an upper one."""
    if finding.limit is None:
        return "no target" if finding.rule in SHARE_OF else ""
    # What prints no findings loads neither rules nor numpy.
    from sbafab.rules.deck import AT_MOST

    sense = "<=" if finding.rule in AT_MOST else ">="
    return f"{sense} {short_figure(finding.limit, _unit(finding))}"


def _unit(finding: Finding) -> str:
    """Return the unit of a finding's figures; a share's is a per cent sign and its denominator."""
    return f"% {SHARE_OF[finding.rule]}" if finding.rule in SHARE_OF else finding.unit


def short_figure(value: float | None, unit: str) -> str:
    """Return a measured value with its unit as text, "" for None."""
    if value is None:
        return ""
    if unit.startswith("%"):
        return f"{100 * value:.3g}{unit}"
    digits = f"{value:.3f}" if unit == "mm" else f"{value:.4g}"
    return f"{digits} {unit}".strip()
