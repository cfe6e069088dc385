"""How a command ends when it does not end well: one sentence, an exit code, no traceback."""

from __future__ import annotations

import io
import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NamedTuple, NoReturn

import click

from sbafab.cli.options import Request
from sbafab.errors import (
    BY_SIGNAL,
    ERROR_SCHEMA,
    STOPPED,
    DefectError,
    SbafabError,
    Stopped,
    TooLargeError,
)

if TYPE_CHECKING:
    from sbafab.cutting.properties import Curves
    from sbafab.output.checked import RunPart
    from sbafab.runs.run import Conforming, Run, RunRequest

BAD_INPUT = 2
LATER = 0.01
"""Seconds after which an interrupt that got lost is raised once more."""


class Exit(NamedTuple):
    """What ended a command: its kind, one sentence, the exit code."""

    kind: str
    sentence: str
    code: int


def end(ending: Exit, as_json: bool) -> NoReturn:
    """Says what ended the command, for programs as well where they asked, and leaves."""
    say(ending.sentence)
    if as_json:
        kind, sentence, code = ending
        found = {"kind": kind, "message": " ".join(sentence.split()), "exit_code": code}
        # Where standard output is what failed, there is nobody to tell.
        with suppress(OSError):
            click.echo(json.dumps({"schema": ERROR_SCHEMA, "error": found}, indent=1))
    sys.exit(ending.code)


def say(sentence: str) -> None:
    click.echo(f"sbafab: {' '.join(sentence.split())}", err=True)


def prepared_streams() -> None:
    """Streams that are there, and that print what they cannot encode as escapes."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            # Closed by the caller (``>&-``).
            setattr(sys, name, io.StringIO())
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


@contextmanager
def ended_plainly(as_json: bool = False) -> Iterator[None]:
    """Turns what may stop a command into one sentence and an exit code; as JSON too if asked."""
    asked: list[int] = []
    try:
        try:
            with _stopped_by_signals(asked):
                yield
        finally:
            # An interrupt amid an import or a callback may come out as any error, or as none.
            if asked and not isinstance(sys.exception(), Stopped):
                raise KeyboardInterrupt(asked[0])
            sys.stdout.flush()
    except click.UsageError as error:
        sentence = error.format_message().rstrip(".")
        if error.ctx is not None:
            see = " See" if sentence.endswith("?") else "; see"
            sentence += f"{see} {error.ctx.command_path} --help"
        end(Exit("usage", sentence, BAD_INPUT), as_json)
    except DefectError as error:
        end(Exit("defect", str(error), RULE_FAILED), as_json)
    except TooLargeError as error:
        end(Exit("too-large", str(error), RULE_FAILED), as_json)
    except SbafabError as error:
        end(Exit("input", str(error), BAD_INPUT), as_json)
    except KeyboardInterrupt as stop:
        code = BY_SIGNAL + (stop.args[0] if stop.args else signal.SIGINT)
        sentence = stop.sentence if isinstance(stop, Stopped) else STOPPED
        end(Exit("stopped", sentence, code), as_json)
    except BrokenPipeError:
        # The reader of standard output has seen enough (``| head``); the files are written.
        _silence()
        sys.exit(BY_SIGNAL + getattr(signal, "SIGPIPE", 13))
    except MemoryError:
        sentence = "there is not enough memory; make the design smaller"
        end(Exit("memory", sentence, BAD_INPUT), as_json)
    except OSError as error:
        if error.filename is None:
            _silence()
        where = error.filename or "standard output"
        reason = error.strerror or str(error)
        told = f"{where}: {reason[:1].lower()}{reason[1:]}; make room there or name another place"
        end(Exit("files", told, BAD_INPUT), as_json)


def _silence() -> None:
    """Sends what is left of standard output nowhere, so that leaving does not fail on it."""
    with suppress(io.UnsupportedOperation), Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


@contextmanager
def _stopped_by_signals(asked: list[int]) -> Iterator[None]:
    """Lets Ctrl-C, a polite kill and a closed terminal stop a run alike: tidied up.

    ``asked`` receives the numbers of the signals that came.
    """

    def stop(number: int, frame: FrameType | None) -> None:
        asked.append(number)
        if number != signal.SIGINT:
            # Batch systems ask twice; what is being kept then must not be lost to the second time.
            signal.signal(number, signal.SIG_IGN)
        raise KeyboardInterrupt(number)

    def lost(unraisable: sys.UnraisableHookArgs) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            threading.Timer(LATER, signal.raise_signal, [signal.SIGINT]).start()
        else:
            sys.__unraisablehook__(unraisable)

    numbers = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
    # One that is ignored (nohup) stays so.
    before = {n: signal.getsignal(n) for n in numbers if signal.getsignal(n) != signal.SIG_IGN}
    hook = sys.unraisablehook
    try:
        sys.unraisablehook = lost
        for number in before:
            signal.signal(number, stop)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = hook


# What the commands that write a folder do alike: load, run, print, choose the exit code.


RULE_FAILED = 1


def run_parts(
    request: Request,
    parts: Sequence[RunPart],
    curves: Curves | None = None,
    conforming: Conforming | None = None,
) -> None:
    """Generates the parts of a design and exits with 1 if a rule failed."""
    from sbafab.actuators import load_design
    from sbafab.cutting.properties import TRUE_ARCS
    from sbafab.runs.run import RunRequest

    design = load_design(request.designs[0], request.assignments, request.waivers)
    run_request(
        RunRequest(design, request.out, parts, curves or TRUE_ARCS, conforming=conforming), request
    )


def run_request(asked: RunRequest, request: Request) -> None:
    """Writes a folder, prints what was made and exits with 1 if a rule failed."""
    from sbafab.cli.printing import print_assembly, print_run, run_json, shown_progress
    from sbafab.runs.run import generate

    with shown_progress(request.as_json) as progress:
        run = generate(asked, progress)
    for name, reason in run.left_out:
        say(f"nothing for {name}: {reason}")
    tell(run, request, run_json, print_run if run.between is None else print_assembly)


def tell(
    run: Run,
    request: Request,
    as_json: Callable[[Run], object],
    show: Callable[[Run], None],
) -> None:
    """Prints what a run made, for programs or people, and exits with 1 if a rule failed."""
    from sbafab.cli.printing import print_json

    if request.as_json:
        print_json(as_json(run))
    else:
        show(run)
    if run.failed:
        click.get_current_context().exit(RULE_FAILED)
