"""Worker processes: the newest wish of a tab is worked on, what it replaces is given up.

A process that dies or takes too long is replaced, and who waits for it is told so.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import multiprocessing
import threading
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from typing import Any

from sbafab.studio.worker import END, serve

MOST_WAITING = 24
Key = tuple[str, str]
"""A tab and what it asks for; a newer wish with the same key replaces the older one."""


class BusyError(Exception):
    """Too many tabs wait for this worker."""


@dataclass(eq=False)
class WaitingJob:
    """A job that somebody waits for."""

    key: Key
    job: dict[str, Any]
    answers: asyncio.Queue[bytes] = field(default_factory=asyncio.Queue)
    number: int = 0


class Worker:
    """One process and the wishes that wait for it. All methods belong to the event loop."""

    def __init__(self, seconds: float, warm: bool = True) -> None:
        self.seconds, self.warm = seconds, warm
        self.context = multiprocessing.get_context("spawn")
        self.cancelled = self.context.Value("Q", 0, lock=False)
        self.waiting: dict[Key, WaitingJob] = {}
        self.current: WaitingJob | None = None
        self.number = 0
        self.timer: asyncio.TimerHandle | None = None
        self.closed = False
        self.process: Any = None

    def start(self) -> None:
        """Starts the process; what it answers comes back into this event loop."""
        self.pipe, theirs = self.context.Pipe()
        self.process = self.context.Process(
            target=serve, args=(theirs, self.cancelled, self.warm), daemon=True
        )
        self.process.start()
        theirs.close()
        loop = asyncio.get_running_loop()
        threading.Thread(target=_listen, args=(self.pipe, loop, self), daemon=True).start()

    def stop(self) -> None:
        """Ends the process."""
        self.closed = True
        if self.process is not None and self.process.is_alive():
            self.process.terminate()

    async def answers(self, key: Key, job: dict[str, Any]) -> AsyncIterator[bytes]:
        """The job's answers, each a line of JSON; ends early where a newer wish replaces it."""
        wish = WaitingJob(key, job)
        self._give_up(key)
        if len(self.waiting) >= MOST_WAITING:
            raise BusyError
        self.waiting[key] = wish
        self._next()
        try:
            while (answer := await wish.answers.get()) != END:
                yield answer
        finally:
            self._forget(wish)

    def _give_up(self, key: Key) -> None:
        old = self.waiting.pop(key, None)
        if old is not None:
            old.answers.put_nowait(_line("superseded"))
            old.answers.put_nowait(END)
        if self.current is not None and self.current.key == key:
            self.cancelled.value = self.current.number

    def _forget(self, wish: WaitingJob) -> None:
        """Whoever waited went away."""
        if self.waiting.get(wish.key) is wish:
            del self.waiting[wish.key]
        if self.current is wish:
            self.cancelled.value = wish.number

    def _next(self) -> None:
        if self.current is not None or not self.waiting:
            return
        if self.process is None or not self.process.is_alive():
            self.start()
        key = next(iter(self.waiting))
        self.current = self.waiting.pop(key)
        self.number += 1
        self.current.number = self.number
        self.timer = asyncio.get_running_loop().call_later(
            self.seconds, self._overtime, self.number
        )
        with contextlib.suppress(OSError):  # a process that just died is seen by who listens
            self.pipe.send((self.number, self.current.job))

    def heard(self, number: int, answer: bytes) -> None:
        """An answer of the process arrived."""
        if self.current is None or self.current.number != number:
            return
        self.current.answers.put_nowait(answer)
        if answer == END:
            self._done()

    def died(self, pipe: Any) -> None:
        """The process of this pipe has ended."""
        if pipe is not self.pipe or self.closed:
            return
        self.process = None
        if self.current is not None:
            self._end("crashed", "the process that worked on this ended; it was started again")
        self._next()

    def _overtime(self, number: int) -> None:
        if self.current is not None and self.current.number == number:
            process, self.process = self.process, None
            process.kill()
            self._end("crashed", f"this took more than {self.seconds:g} s and was stopped")
            self._next()

    def _end(self, kind: str, message: str) -> None:
        assert self.current is not None
        self.current.answers.put_nowait(_line(kind, message))
        self.current.answers.put_nowait(END)
        self._done()

    def _done(self) -> None:
        self.current = None
        if self.timer is not None:
            self.timer.cancel()
        self._next()


def _listen(pipe: Any, loop: asyncio.AbstractEventLoop, worker: Worker) -> None:
    """Hands what comes through the pipe to the event loop, in a thread of its own."""
    with contextlib.suppress(RuntimeError):  # the loop has closed
        try:
            while True:
                number, answer = pipe.recv()
                loop.call_soon_threadsafe(worker.heard, number, answer)
        except (EOFError, OSError):
            loop.call_soon_threadsafe(worker.died, pipe)


def _line(kind: str, message: str = "") -> bytes:
    return json.dumps({"kind": kind, "message": message}).encode()
