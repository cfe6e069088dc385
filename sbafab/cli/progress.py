"""Progress of a command: a live line on a terminal, plain lines elsewhere.

A line names the stage, the time elapsed and, once there is a rate, the rate and the time left.
"""

from __future__ import annotations

import io
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from functools import wraps
from typing import Any, NamedTuple

import click

from sbafab.process import Progress, ignore_progress

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
    """Add the option -v to a command, unless it has one of that name, and -q to one that writes
    files or checks them.
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
    """Return a callback that with -q prints nothing but by ``print_result``."""
    assert callback is not None

    @wraps(callback)
    def call(*args: Any, **parameters: Any) -> Any:
        if not is_requested(QUIET):
            return callback(*args, **parameters)
        click.get_current_context().meta[RESULTS] = sys.stdout
        with redirect_stdout(io.StringIO()):
            return callback(*args, **parameters)

    return call


def print_result(value: object) -> None:
    """Print a line on standard output, with -q too."""
    context = click.get_current_context(silent=True)
    click.echo(value, file=context.meta.get(RESULTS) if context else None)


def is_requested(key: str) -> bool:
    """Return True if the running command has the option -q (``QUIET``) or -v (``VERBOSE``)."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(key, False))


@contextmanager
def shown_progress(quiet: bool) -> Iterator[Progress]:
    """Show the progress of the block on standard error, as ``quiet``, -q and -v require.

    On a terminal a live line; elsewhere plain lines, the first after some seconds.
    """
    if quiet or is_requested(QUIET):
        yield ignore_progress
    elif sys.stderr.isatty() and not is_requested(VERBOSE):
        with live_line() as progress:
            yield progress
    else:
        yield plain_lines(is_requested(VERBOSE))


class Pace(NamedTuple):
    """Progress of a stage; seconds elapsed since the start of the command and of the stage."""

    stage: str
    done: int
    total: int
    elapsed: float
    stage_elapsed: float

    @property
    def remaining(self) -> float | None:
        """Seconds left at the present rate, None before a rate is known."""
        if not 0 < self.done <= self.total or self.stage_elapsed < RATE_AFTER_SECONDS:
            return None
        return self.stage_elapsed * (self.total - self.done) / self.done

    @property
    def text(self) -> str:
        """Stage, counts, rate, time elapsed and time left in a line."""
        counts = f": {self.done} of {self.total}" if self.total > 1 else ""
        parts = [f"{self.stage}{counts}"]
        if self.remaining is not None and self.total > 1:
            per_second = self.done / self.stage_elapsed
            is_slow = per_second < 1
            unit = "minute" if is_slow else "second"
            parts.append(f"{60 * per_second if is_slow else per_second:.3g} per {unit}")
        parts.append(f"{_clock(self.elapsed)} elapsed")
        if self.remaining is not None:
            less = self.remaining < 1
            parts.append("less than 1 s left" if less else f"about {_clock(self.remaining)} left")
        return ", ".join(parts)


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


class Stages:
    """Clock of a command and its present stage."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._start = self._stage_start = clock()
        self._current = ("starting", 0, 0)
        self._lock = threading.Lock()

    def report(self, stage: str, done: int, total: int) -> bool:
        """Record progress; return True if a stage begins: another total, or less done."""
        with self._lock:
            _, previous, previous_total = self._current
            begins = total != previous_total or done < previous
            if begins:
                self._stage_start = self._clock()
            self._current = (stage, done, total)
        return begins

    def pace(self) -> Pace:
        """Return the progress at this moment."""
        with self._lock:
            now = self._clock()
            return Pace(*self._current, now - self._start, now - self._stage_start)


@contextmanager
def live_line() -> Iterator[Progress]:
    """Show a line on standard error, removed when the block ends."""
    from rich.console import Console
    from rich.live import Live
    from rich.spinner import Spinner
    from rich.text import Text

    stages = Stages()
    spinner = Spinner("dots")

    def line() -> Any:
        pace = stages.pace()
        spinner.update(text=Text(pace.text))
        return spinner if pace.elapsed >= SHOWN_AFTER_SECONDS else Text("")

    def progress(stage: str, done: int, total: int) -> None:
        stages.report(stage, done, total)

    # Four times a second, so that the clock runs between reports; the command prints as it likes.
    with Live(
        get_renderable=line,
        console=Console(stderr=True),
        refresh_per_second=4,
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    ):
        yield progress


def plain_lines(
    verbose: bool,
    write: Callable[[str], object] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Progress:
    """Return a progress that writes a line at intervals; ``verbose``: also at every stage."""
    stages = Stages(clock)
    write_line = write or (lambda text: click.echo(text, err=True))
    interval = VERBOSE_LINE_SECONDS if verbose else LINE_SECONDS
    last = clock() + (0.0 if verbose else FIRST_LINE_SECONDS - LINE_SECONDS)

    def progress(stage: str, done: int, total: int) -> None:
        nonlocal last
        begins = stages.report(stage, done, total)
        if (verbose and begins) or clock() - last >= interval:
            last = clock()
            write_line(f"sbafab: {stages.pace().text}")

    return progress
