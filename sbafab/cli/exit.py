"""The end of commands: exit codes, one sentence for an error or a signal, and no traceback."""

from __future__ import annotations

import io
import json
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Literal, NoReturn

import click

from sbafab.errors import (
    BY_SIGNAL,
    ERROR_SCHEMA,
    STOPPED,
    DefectError,
    SbafabError,
    Stopped,
    TooLargeError,
    VoidError,
)

RULE_FAILED = 1
BAD_INPUT = 2
ErrorKind = Literal[
    "usage", "input", "void", "too-large", "yield", "defect", "stopped", "memory", "files"
]
KINDS: dict[type[SbafabError], ErrorKind] = {
    DefectError: "defect",
    VoidError: "void",
    TooLargeError: "too-large",
}
"""Errors that end as a failed rule does; all others are of the input."""
RAISE_AGAIN_SECONDS = 0.01
"""Seconds after which a lost interrupt is raised again."""


def end(kind: ErrorKind, sentence: str, code: int, as_json: bool) -> NoReturn:
    """Print an error as one sentence, with ``as_json`` also as JSON on standard output, and exit
    with ``code``.
    """
    print_error(sentence)
    if as_json:
        document = {"kind": kind, "message": " ".join(sentence.split()), "exit_code": code}
        # Standard output may be what failed.
        with suppress(OSError):
            click.echo(json.dumps({"schema": ERROR_SCHEMA, "error": document}, indent=1))
    sys.exit(code)


def print_error(sentence: str) -> None:
    """Print a sentence on standard error, on one line."""
    click.echo(f"sbafab: {' '.join(sentence.split())}", err=True)


def prepared_streams() -> None:
    """Replace closed standard streams, and escape characters that they cannot encode."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            # Closed by the caller (``>&-``).
            setattr(sys, name, io.StringIO())
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


@contextmanager
def exit_plainly(as_json: bool = False) -> Iterator[None]:
    """Convert any error or signal in the block to one sentence and an exit code."""
    received: list[int] = []
    try:
        try:
            with _interrupted_by_signals(received):
                yield
        finally:
            # An interrupt amid an import or a callback may come out as any error, or as none.
            if received and not isinstance(sys.exception(), Stopped):
                raise KeyboardInterrupt(received[0])
            sys.stdout.flush()
    except click.UsageError as error:
        sentence = error.format_message().rstrip(".")
        if error.ctx is not None:
            see = " See" if sentence.endswith("?") else "; see"
            sentence += f"{see} {error.ctx.command_path} --help"
        end("usage", sentence, BAD_INPUT, as_json)
    except SbafabError as error:
        kinds: list[ErrorKind] = [name for of, name in KINDS.items() if isinstance(error, of)]
        kind = kinds[0] if kinds else "input"
        end(kind, str(error), BAD_INPUT if kind == "input" else RULE_FAILED, as_json)
    except KeyboardInterrupt as stop:
        sentence = stop.sentence if isinstance(stop, Stopped) else STOPPED
        number = stop.args[0] if stop.args else signal.SIGINT
        end("stopped", sentence, BY_SIGNAL + number, as_json)
    except BrokenPipeError:
        # The reader of standard output has closed it (``| head``); the files are written.
        _discard_output()
        sys.exit(BY_SIGNAL + getattr(signal, "SIGPIPE", 13))
    except MemoryError:
        sentence = "there is not enough memory; make the design smaller"
        end("memory", sentence, BAD_INPUT, as_json)
    except OSError as error:
        if error.filename is None:
            _discard_output()
        reason = error.strerror or str(error)
        where = f"{error.filename or 'standard output'}: {reason[:1].lower()}{reason[1:]}"
        end("files", f"{where}; free space there or name another folder", BAD_INPUT, as_json)


def _discard_output() -> None:
    """Discard the rest of standard output, so that flushing it at exit does not fail."""
    with suppress(io.UnsupportedOperation), Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


@contextmanager
def _interrupted_by_signals(received: list[int]) -> Iterator[None]:
    """Raise KeyboardInterrupt for SIGINT, SIGTERM and SIGHUP, so that a run cleans up.

    ``received`` collects the numbers of the signals.
    """

    def stop(number: int, frame: FrameType | None) -> None:
        received.append(number)
        if number != signal.SIGINT:
            # Batch systems send it twice; the second must not cut short what the first tidies up.
            signal.signal(number, signal.SIG_IGN)
        raise KeyboardInterrupt(number)

    def lost(unraisable: sys.UnraisableHookArgs) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            threading.Timer(RAISE_AGAIN_SECONDS, signal.raise_signal, [signal.SIGINT]).start()
        else:
            sys.__unraisablehook__(unraisable)

    numbers = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
    # An ignored signal (nohup) stays ignored.
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
