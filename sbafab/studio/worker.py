"""The loop of a worker process: one job after the other, answers out as they come."""

from __future__ import annotations

import contextlib
import json
import signal
import sys
import traceback
from functools import lru_cache
from multiprocessing.connection import Connection
from typing import Any

from sbafab import api
from sbafab.errors import SbafabError

END = b""
"""The last message of a job."""
FIRST_DESIGN = "1dof-5mm"


class SupersededError(Exception):
    """Nobody waits for this answer any more."""


def serve(pipe: Connection, cancelled: Any, warm: bool) -> None:
    """Answers (number, job) with (number, JSON) until the pipe closes."""
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    if warm:
        _warm_up()
    from sbafab.studio.jobs import JOBS

    with contextlib.suppress(EOFError, OSError):
        while True:
            number, job = pipe.recv()
            send = _sender(pipe, number)

            def beat(own: int = number) -> None:
                if cancelled.value == own:
                    raise SupersededError

            try:
                for answer in JOBS[job["do"]]({**job, "tell": send}, beat):
                    send(answer)
                    beat()
            except SupersededError:
                send({"kind": "superseded"})
            except SbafabError as error:
                send({"kind": "error", "message": str(error), **_place(str(error))})
            except MemoryError:
                send({"kind": "error", "message": "the design takes more memory than there is"})
            except Exception:
                traceback.print_exc(file=sys.stderr)
                send({"kind": "defect", "message": _defect()})
            pipe.send((number, END))


def _sender(pipe: Connection, number: int) -> Any:
    def send(answer: dict[str, Any]) -> None:
        pipe.send((number, json.dumps(answer, separators=(",", ":")).encode()))

    return send


def _defect() -> str:
    kind, what = sys.exc_info()[:2]
    name = kind.__name__ if kind else "error"
    return (
        f"this is a defect of sbafab ({name}: {' '.join(str(what).split())[:200]}); go back with "
        "Undo, and report the design file"
    )


def _place(sentence: str) -> dict[str, str]:
    """The first key of a design file that a sentence names, so that it can stand at its field."""
    words = (word.strip(",;:()[]'\"") for word in sentence.split())
    field = next((word for word in words if word in _keys()), None)
    return {"field": field} if field else {}


@lru_cache(maxsize=1)
def _keys() -> frozenset[str]:
    from sbafab.studio.forms import keys

    return frozenset(keys(api.schema()))


def _warm_up() -> None:
    """Has everything imported and one small design checked, so that the first answer is quick."""
    with contextlib.suppress(SbafabError):
        design = api.load(FIRST_DESIGN, {"stack.balloons": 1})
        list(api.checking(design))
        _keys()
