"""The loop of a worker process: one job after the other, answers out as they come."""

from __future__ import annotations

import contextlib
import gc
import json
import signal
from multiprocessing.connection import Connection
from typing import Any

from sbafab import api
from sbafab.errors import SbafabError

END = b""
"""The last message of a job."""
READY = 0
"""The number that says that the process takes jobs; those count from 1."""
FIRST_DESIGN = "1dof-5mm"


def serve(pipe: Connection, cancelled: Any, warm: bool) -> None:
    """Answers (number, job) with (number, JSON) until the pipe closes."""
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    from sbafab.studio.jobs import SupersededError, answers

    if warm:
        _warm_up()
    # What is imported stays; the collector need not look through it again at every change.
    gc.collect()
    gc.freeze()
    with contextlib.suppress(EOFError, OSError):
        pipe.send((READY, END))
        while True:
            number, job = pipe.recv()
            send = _sender(pipe, number)

            def beat(own: int = number) -> None:
                if cancelled.value == own:
                    raise SupersededError

            for answer in answers({**job, "tell": send}, beat):
                send(answer)
            pipe.send((number, END))


def _sender(pipe: Connection, number: int) -> Any:
    def send(answer: dict[str, Any]) -> None:
        pipe.send((number, json.dumps(answer, separators=(",", ":")).encode()))

    return send


def _warm_up() -> None:
    """Has everything imported and one small design checked, so that the first answer is quick."""
    from sbafab.studio.jobs import design_keys

    with contextlib.suppress(SbafabError):
        design = api.load(FIRST_DESIGN, {"stack.balloons": 1})
        list(api.checking(design))
        design_keys()
