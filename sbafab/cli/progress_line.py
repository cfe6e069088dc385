"""How far a command is: a line that keeps itself fresh on a terminal, plain lines elsewhere.

Each says what is being done, the time gone and, where it can be told, the time left and the rate.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import click

from sbafab.process import Progress

QUIET, VERBOSE = "sbafab.quiet", "sbafab.verbose"
FIRST_LINE = 5.0
"""Seconds of silence where there is no terminal: quick commands leave no lines in a log."""
EVERY = 10.0
"""Seconds between two plain lines."""
EVERY_VERBOSE = 1.0
APPEARS = 1.0
"""Seconds after which a line appears on a terminal: what is done before needs none."""
TELLING = 1.0
"""Seconds of a stage after which its pace says something of what is left."""


def add_verbosity(command: click.Command) -> None:
    """Gives a command -q and -v, unless it has options of that name."""
    taken = {name for option in command.params for name in option.opts}
    for short, long, key, words in (
        ("-q", "--quiet", QUIET, "No progress, only results and errors."),
        ("-v", "--verbose", VERBOSE, "Progress of every stage, as lines."),
    ):
        if short not in taken:
            option = click.Option(
                [short, long], is_flag=True, expose_value=False, callback=_kept(key), help=words
            )
            command.params.append(option)


def _kept(key: str) -> Callable[[click.Context, click.Parameter, bool], None]:
    def keep(ctx: click.Context, _: click.Parameter, value: bool) -> None:
        ctx.meta[key] = ctx.meta.get(key, False) or value

    return keep


def asked_for(key: str) -> bool:
    """Whether the running command was given -q (``QUIET``) or -v (``VERBOSE``)."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(key, False))


@dataclass(frozen=True)
class Pace:
    """How far a stage is: seconds gone since the command began and in the stage itself."""

    what: str
    done: int
    total: int
    gone: float
    in_stage: float

    @property
    def left(self) -> float | None:
        """Seconds left at the pace so far, None where nothing tells."""
        if not 0 < self.done <= self.total or self.in_stage < TELLING:
            return None
        return self.in_stage * (self.total - self.done) / self.done

    @property
    def is_shown(self) -> bool:
        """Whether there is work enough for a line that comes and goes on a terminal."""
        return self.gone >= APPEARS

    @property
    def said(self) -> str:
        """All of it in one line."""
        parts = [self.what]
        if self.total > 1:
            parts[0] += f": {self.done} of {self.total}"
        if self.left is not None and self.total > 1:
            parts.append(_rate(self.done / self.in_stage))
        parts.append(f"{_clock(self.gone)} gone")
        if self.left is not None:
            parts.append(f"about {_clock(self.left)} left")
        return ", ".join(parts)


def _rate(a_second: float) -> str:
    if a_second >= 1:
        return f"{a_second:.3g} a second"
    return f"{60 * a_second:.3g} a minute"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


class Stages:
    """Keeps the time of what it is told; ``pace`` is where things stand now."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began = self._stage_began = clock()
        self._now = ("starting", 0, 0)
        self._lock = threading.Lock()

    def told(self, what: str, done: int, total: int) -> bool:
        """Takes it in; whether a stage begins: the total is another one, or less is done."""
        with self._lock:
            _, before, of = self._now
            begins = total != of or done < before
            if begins:
                self._stage_began = self._clock()
            self._now = (what, done, total)
        return begins

    def pace(self) -> Pace:
        with self._lock:
            now = self._clock()
            return Pace(*self._now, now - self._began, now - self._stage_began)


@contextmanager
def live_line() -> Iterator[Progress]:
    """A line on standard error, gone when the block ends."""
    from rich.console import Console
    from rich.live import Live
    from rich.spinner import Spinner
    from rich.text import Text

    stages = Stages()
    spinner = Spinner("dots")

    def line() -> Any:
        pace = stages.pace()
        if not pace.is_shown:
            return Text("")
        spinner.update(text=Text(pace.said))
        return spinner

    # Drawn anew four times a second, so that the clock goes on while nothing is told.
    with Live(
        get_renderable=line,
        console=Console(stderr=True),
        refresh_per_second=4,
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    ):
        yield lambda what, done, total: _without_answer(stages.told(what, done, total))


def _without_answer(_: bool) -> None:
    return None


def plain_lines(
    verbose: bool,
    write: Callable[[str], object] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Progress:
    """A progress that writes a line now and then; a verbose one at every stage as well."""
    stages = Stages(clock)
    put = write or (lambda text: click.echo(text, err=True))
    every = EVERY_VERBOSE if verbose else EVERY
    last = clock() + (0.0 if verbose else FIRST_LINE - EVERY)

    def tell(what: str, done: int, total: int) -> None:
        nonlocal last
        begins = stages.told(what, done, total)
        if (verbose and begins) or clock() - last >= every:
            last = clock()
            put(f"sbafab: {stages.pace().said}")

    return tell
