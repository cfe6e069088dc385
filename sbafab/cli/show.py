"""Output of commands: lines, tables, JSON, findings, verdicts; and their progress meanwhile."""

from __future__ import annotations

import functools
import io
import json
import os
import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from sbafab import catalogue, plugins
from sbafab.api.files import Finding, counted, decisive
from sbafab.cli.exit import RULE_FAILED, print_error
from sbafab.runtime import Progress, ignore_progress

if TYPE_CHECKING:
    from rich.table import Table

NO_BREAK = "\u00a0"
"""No-break space: `wrapped` keeps the words on both sides on one line."""


STYLES: Mapping[str, Mapping[str, Any]] = {
    "": {},
    "bold": {"bold": True},
    "bold red": {"bold": True, "fg": "red"},
    "green": {"fg": "green"},
    "yellow": {"fg": "yellow"},
}
"""Styles of text on a terminal."""


def line(words: str, style: str = "") -> None:
    """Print a line without breaking it."""
    _print_styled(click.style(words, **STYLES[style]))


def _print_styled(words: str) -> None:
    """Print a line, plain without a terminal that shows styles."""
    is_plain = "NO_COLOR" in os.environ or os.environ.get("TERM") == "dumb"
    click.echo(words, color=False if is_plain else None)


def width() -> int:
    """Return the columns of the terminal; 80 without a terminal and COLUMNS."""
    return shutil.get_terminal_size().columns


def _print_grid(grid: Table) -> None:
    """Print a table with rich, whose import takes longer than printing lines."""
    from rich.console import Console

    class PipedConsole(Console):
        """A console that raises BrokenPipeError when the reader closes the pipe."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    PipedConsole(highlight=False, soft_wrap=False).print(grid)


def wrapped(words: str, style: str = "", indent: str = "", first: str | None = None) -> None:
    """Print a text broken between words, except at ``NO_BREAK``.

    Every line is indented by ``indent``; without it, all but the first by two spaces. The first one
    begins with ``first`` if that is given.
    """
    lines = textwrap.wrap(
        words,
        width(),
        initial_indent=indent if first is None else first,
        subsequent_indent=indent or "  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    for each in lines:
        line(each.replace(NO_BREAK, " "), style)


def phrases(label: str, each: Iterable[str]) -> None:
    """Print ``label: a, b, c``, with lines broken only between phrases."""
    words = ", ".join(phrase.replace(" ", NO_BREAK) for phrase in each)
    wrapped(words, indent=" " * (len(label) + 2), first=f"{label}: ")


def table(title: str, names: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print a table below its title; nothing without rows. Numbers have four digits."""
    from rich.table import Table
    from rich.text import Text

    if not rows:
        return
    if title:
        line(title, "bold")
    grid = Table(box=None, pad_edge=False, header_style="bold", show_header=any(names))
    for name in names:
        grid.add_column(Text(name), overflow="fold")
    for row in rows:
        grid.add_row(*(Text(_cell(value)) for value in row))
    _print_grid(grid)


def _cell(value: object) -> str:
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def facts(rows: Iterable[tuple[str, str]]) -> None:
    """Print a table of labels and texts."""
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=None, pad_edge=False, show_header=False)
    grid.add_column(no_wrap=True, style="bold")
    grid.add_column(ratio=1, overflow="fold")
    for label, words in rows:
        grid.add_row(label, Text(words))
    _print_grid(grid)


def names(meanings: Mapping[str, str]) -> None:
    """Print a line for each name and its meaning."""
    width = max(map(len, meanings))
    for name, meaning in meanings.items():
        click.echo(f"{name:<{width}}  {meaning}")


FILES = "files"
"""The thing to change when a folder was checked, for `failed`."""
COLOURS = {"pass": "green", "fail": "bold red", "waived": "yellow", "warn": "yellow"}


def document(value: object) -> None:
    """Print a value as indented JSON."""
    result(json.dumps(value, indent=1, ensure_ascii=False))


def several(number: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"


# Findings, one line per rule; remedies; the verdict in the last line.


Groups = Mapping[str, Sequence[Finding]]
"""Findings of each design by its name, and those between the parts of an assembly."""
SHARE_OF = {"pin-fit": "stretch", "registration-yield": "hold"}
"""Words after the per cent sign, by rule: a film stretches over its pin, builds hold."""


def findings(groups: Groups, verbose: bool = False) -> None:
    """Print a line for every rule (for several groups only if ``verbose``), and the remedies."""
    for name, group in groups.items():
        if len(groups) > 1:
            line(f"{name}: {counted(group)}", "bold")
        if verbose or len(groups) == 1:
            _print_rules(group, verbose)
        if not verbose:
            remedies(group)


def _print_rules(group: Sequence[Finding], verbose: bool) -> None:
    """Print a line for each rule's decisive finding; ``verbose``: for all, with their messages."""
    of_folders = catalogue.names("folders")
    shown = group if verbose else list(decisive(group).values())
    wide = max((len(finding.rule) for finding in shown), default=0)
    line(f"{'rule':{wide}}  verdict  {'measured':>13}  {'limit':>14}", "bold")
    for finding in shown:
        measured = short_figure(finding.measured, _unit(finding))
        is_empty = finding.measured is finding.limit is None
        if finding.verdict == "pass" and is_empty and finding.rule not in of_folders:
            measured = "not compared"
        values = f"  {measured:>13}  {limit_text(finding):>14}".rstrip()
        verdict_cell = f"{finding.verdict:7}" if values else finding.verdict
        styled = click.style(verdict_cell, **STYLES[COLOURS[finding.verdict]])
        _print_styled(f"{finding.rule:{wide}}  {styled}{values}")
        if verbose:
            wrapped(finding.message, indent="    ")


def remedies(group: Sequence[Finding]) -> None:
    """Print the remedy, or the message, of each warning, failure and rule waived by the user."""
    # Bond and overhang may have one remedy.
    sentences = {
        f"{finding.rule}: {finding.remedy or finding.message}": COLOURS[finding.verdict]
        for finding in group
        if finding.verdict in ("fail", "warn") or finding.by_user
    }
    for sentence, colour in sentences.items():
        wrapped(sentence, colour)


def verdict(sentence: str, path: Path | None = None) -> None:
    """Print the last line of a finished command; with -q only the ``path`` written."""
    line(sentence, "bold")
    written(path)


def written(path: Path | None) -> None:
    """With -q: print the folder or file written by a command, if any."""
    if is_requested(QUIET) and path is not None:
        result(path)


def failure(sentence: str) -> None:
    """Print the last line of a command that failed; with -q on standard error."""
    if is_requested(QUIET):
        print_error(sentence.replace(NO_BREAK, " "))
    else:
        wrapped(sentence, "bold red")


def note(words: str) -> None:
    """Print a note on standard error, except with -q."""
    if not is_requested(QUIET):
        click.echo(f"note: {words}", err=True)


def passed(name: str, groups: Groups, details: str = "", path: Path | None = None) -> None:
    """Print the verdict of a design or assembly that passed; ``details``: the command for more."""
    more = f" Details: {details}" if details else ""
    verdict(f"{name} passed: {counted(*groups.values())}.{more}", path)


def failed(name: str, group: Iterable[Finding], consequence: str, change: str) -> None:
    """Print the verdict of a failure: the rules, the consequence and two remedies.

    A rule cannot be waived for files on disk, only for their design (``change`` is FILES).
    """
    broken = failed_rules(group)
    explain = f"sbafab explain {broken[0]}".replace(" ", NO_BREAK)
    waive = " ".join(f"--waive{NO_BREAK}{rule}" for rule in broken)
    other = f"waive by name: {waive}" if change != FILES else "regenerate the folder"
    failure(
        f"{name} failed: {', '.join(broken)}. {consequence}. Change the {change} ({explain}), "
        f"or {other}"
    )


def failed_rules(group: Iterable[Finding]) -> list[str]:
    """Return the names of the rules that failed."""
    return sorted({finding.rule for finding in group if finding.verdict == "fail"})


def end_failed() -> NoReturn:
    """End the command because its design failed."""
    click.get_current_context().exit(RULE_FAILED)


def limit_text(finding: Finding) -> str:
    """Return a limit after ">=" for a lower one, "<=" for an upper one."""
    if finding.limit is None:
        return "no target" if finding.rule in SHARE_OF else ""
    # By name: what prints no findings loads neither rules nor numpy.
    sense = "<=" if finding.rule in plugins.load("sbafab.rules.deck:AT_MOST") else ">="
    return f"{sense} {short_figure(finding.limit, _unit(finding))}"


def _unit(finding: Finding) -> str:
    """Return the unit of a finding's figures; for a share, a per cent sign and its denominator."""
    return f"% {SHARE_OF[finding.rule]}" if finding.rule in SHARE_OF else finding.unit


def short_figure(value: float | None, unit: str) -> str:
    """Return a measured value with its unit as text, "" for None."""
    if value is None:
        return ""
    if unit.startswith("%"):
        return f"{100 * value:.3g}{unit}"
    digits = f"{value:.3f}" if unit == "mm" else f"{value:.4g}"
    return f"{digits} {unit}".strip()


# Progress: a live line on a terminal, plain lines elsewhere. A line names the stage, the time
# elapsed and, once there is a rate, the rate and the time left.


QUIET, VERBOSE = "sbafab.quiet", "sbafab.verbose"
RESULTS = "sbafab.results"
"""The stream for results while -q discards the rest."""
FIRST_LINE_SECONDS = 5.0
"""Before the first plain line, so that quick commands leave no lines in a log."""
LINE_SECONDS = 10.0
"""Between two plain lines."""
VERBOSE_LINE_SECONDS = 1.0
SHOWN_AFTER_SECONDS = 1.0
"""Before the line appears on a terminal."""
RATE_AFTER_SECONDS = 1.0
"""Duration of a stage before its rate is used."""


def add_verbosity(command: click.Command) -> None:
    """Add the option -v to a command, unless it has one, and -q to a command that writes or checks
    files.
    """
    taken = {name for option in command.params for name in option.opts}
    if "-v" not in taken:
        _add_flag(command, "-v", VERBOSE, "Print the progress of every stage as lines.")
    if taken & {"-o", "--to"} or command.name == "check":
        _add_flag(command, "-q", QUIET, "Print errors only, and the folder or file written.")
        command.callback = _quietly(command.callback)


def _add_flag(command: click.Command, short: str, key: str, words: str) -> None:
    """Add a flag that ``is_requested`` knows."""

    def set_key(ctx: click.Context, _: click.Parameter, value: bool) -> None:
        ctx.meta[key] = ctx.meta.get(key, False) or value

    names = [short, f"--{key.rpartition('.')[2]}"]
    command.params.append(
        click.Option(names, is_flag=True, expose_value=False, callback=set_key, help=words)
    )


def _quietly(callback: Callable[..., Any] | None) -> Callable[..., Any]:
    """Return a callback that, with -q, prints only through ``result``."""
    assert callback is not None

    @functools.wraps(callback)
    def call(*args: Any, **parameters: Any) -> Any:
        if not is_requested(QUIET):
            return callback(*args, **parameters)
        click.get_current_context().meta[RESULTS] = sys.stdout
        with redirect_stdout(io.StringIO()):
            return callback(*args, **parameters)

    return call


def result(value: object) -> None:
    """Print a line on standard output, also with -q."""
    context = click.get_current_context(silent=True)
    click.echo(value, file=context.meta.get(RESULTS) if context else None)


def is_requested(key: str) -> bool:
    """Return True if the running command has the option -q (``QUIET``) or -v (``VERBOSE``)."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(key, False))


@contextmanager
def progress(quiet: bool) -> Iterator[Progress]:
    """Show the progress of the block on standard error, according to ``quiet``, -q and -v.

    On a terminal it is a live line; elsewhere plain lines, the first after some seconds.
    """
    if quiet or is_requested(QUIET):
        yield ignore_progress
    elif sys.stderr.isatty() and not is_requested(VERBOSE):
        with live_line() as report:
            yield report
    else:
        yield plain_lines(is_requested(VERBOSE))


class Stages:
    """A clock of a command and its current stage, in seconds."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._start = self._stage_start = clock()
        self._current = ("starting", 0, 0)

    def report(self, stage: str, done: int, total: int) -> bool:
        """Record progress; return True if a stage begins: a new total, or a smaller count."""
        _, previous, previous_total = self._current
        begins = total != previous_total or done < previous
        if begins:
            self._stage_start = self._clock()
        self._current = (stage, done, total)
        return begins

    @property
    def elapsed(self) -> float:
        """Seconds since the command began."""
        return self._clock() - self._start

    @property
    def text(self) -> str:
        """Stage and counts; the rate for several; remaining time if known; elapsed time."""
        stage, done, total = self._current
        seconds = self._clock() - self._stage_start
        elapsed = f"{_clock(self.elapsed)} elapsed"
        head = f"{stage}: {done} of {total}" if total > 1 else stage
        if not 0 < done <= total or seconds < RATE_AFTER_SECONDS:
            return f"{head}, {elapsed}"
        each, seconds_left = seconds / done, seconds * (total - done) / done
        rate = f", {60 / each:.3g} per minute" if each > 1 else f", {1 / each:.3g} per second"
        time_left = "less than 1 s" if seconds_left < 1 else f"about {_clock(seconds_left)}"
        return f"{head}{rate if total > 1 else ''}, {elapsed}, {time_left} left"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


@contextmanager
def live_line() -> Iterator[Progress]:
    """Show a line on standard error, removed when the block ends."""
    from rich.console import Console
    from rich.live import Live
    from rich.spinner import Spinner
    from rich.text import Text

    stages = Stages()
    spinner = Spinner("dots")

    def renderable() -> Any:
        spinner.update(text=Text(stages.text))
        return spinner if stages.elapsed >= SHOWN_AFTER_SECONDS else Text("")

    def report(stage: str, done: int, total: int) -> None:
        stages.report(stage, done, total)

    # Four times a second, so that the clock runs between reports; the command prints as it likes.
    with Live(
        get_renderable=renderable,
        console=Console(stderr=True),
        refresh_per_second=4,
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    ):
        yield report


def plain_lines(
    verbose: bool,
    write: Callable[[str], object] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Progress:
    """A progress function that writes a line at intervals; ``verbose``: also at every stage."""
    stages = Stages(clock)
    write = write or functools.partial(click.echo, err=True)
    interval = VERBOSE_LINE_SECONDS if verbose else LINE_SECONDS
    last = clock() + (0.0 if verbose else FIRST_LINE_SECONDS - LINE_SECONDS)

    def report(stage: str, done: int, total: int) -> None:
        nonlocal last
        begins = stages.report(stage, done, total)
        if (verbose and begins) or clock() - last >= interval:
            last = clock()
            write(f"sbafab: {stages.text}")

    return report
