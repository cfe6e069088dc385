"""Worker processes: they run the newest job of a tab and cancel the one that it replaces.

A pool starts another process only if a job waits and none is idle, up to the number of processors.
A process that dies or takes too long is replaced, and its request gets an error.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import json
import multiprocessing
import signal
import threading
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

from sbafab import api
from sbafab.errors import SbafabError
from sbafab.runtime import processors

END = b""  # the last message of a job
READY = 0  # the number that means the process accepts jobs; jobs count from 1
MOST_WAITING = 24  # most waiting jobs of a pool
PATIENCE = 2.0  # time for a cancelled job to reach its next step, s; then its process is replaced
Key = tuple[str, str]
"""A tab and its kind of job; a newer job with the same key replaces the older one."""


class BusyError(Exception):
    """Too many jobs are already waiting."""


@dataclass(eq=False)
class WaitingJob:
    """A job with a waiting client, and its answers as they arrive."""

    pool: WorkerPool
    key: Key
    job: dict[str, Any]
    answers: asyncio.Queue[bytes] = field(default_factory=asyncio.Queue)

    def end(self, kind: str, message: str = "") -> None:
        """Add a last answer of this kind."""
        self.answers.put_nowait(json.dumps({"kind": kind, "message": message}).encode())
        self.answers.put_nowait(END)

    async def lines(self) -> AsyncIterator[bytes]:
        """Each answer as a line of JSON; they end early if a newer job replaces this one."""
        while (answer := await self.answers.get()) != END:
            yield answer + b"\n"


class WorkerPool:
    """Processes and their waiting jobs. All methods run in the event loop.

    ``seconds`` is the time limit of a job, ``processes`` the most that run at once (0: by the
    machine), and ``patience`` the seconds for a cancelled job to end.
    """

    def __init__(
        self, seconds: float, processes: int = 0, warm: bool = True, patience: float = PATIENCE
    ) -> None:
        self.seconds, self.warm, self.patience = seconds, warm, patience
        # At least two, so that a slow design in one tab never blocks another.
        self.processes = processes or max(2, processors())
        self.waiting: dict[Key, WaitingJob] = {}
        self.workers: list[Worker] = []
        self.closed = False

    def start(self) -> None:
        """Start one more process; it gets jobs once it is ready."""
        self.workers.append(Worker(self))

    def stop(self) -> None:
        """Stop all processes."""
        self.closed = True
        for worker in self.workers:
            worker.kill()

    def ask(self, key: Key, job: dict[str, Any]) -> WaitingJob:
        """Return the queued job; an older one of the same key is cancelled.

        The caller calls :meth:`forget` at the end. Raises BusyError if too many wait.
        """
        self._give_up(key)
        if len(self.waiting) >= MOST_WAITING:
            raise BusyError
        waiting = self.waiting[key] = WaitingJob(self, key, job)
        self.assign()
        return waiting

    def forget(self, waiting: WaitingJob) -> None:
        """Cancel a job without a waiting client; do nothing if it has ended."""
        if self.waiting.get(waiting.key) is waiting:
            del self.waiting[waiting.key]
        for worker in self.workers:
            if worker.current is waiting:
                worker.cancel()

    def _give_up(self, key: Key) -> None:
        old = self.waiting.pop(key, None)
        if old is not None:
            old.end("superseded")
        for worker in self.workers:
            if worker.current is not None and worker.current.key == key:
                worker.cancel()

    def assign(self) -> None:
        """Give every idle process its next eligible job; start one if none is idle."""
        if self.closed:
            return
        for waiting in list(self.waiting.values()):
            worker = self._idle(waiting.key)
            if worker is not None:
                del self.waiting[waiting.key]
                for other in self.workers:
                    other.keys.discard(waiting.key)
                worker.keys.add(waiting.key)
                worker.work(waiting)
        starting = sum(not worker.ready for worker in self.workers)
        needed = sum(not self._ends_soon(key) for key in self.waiting) - starting
        for _ in range(min(needed, self.processes - len(self.workers))):
            self.start()

    def _idle(self, key: Key) -> Worker | None:
        """Return an idle process, preferably the last one for this key, which has its motion."""
        if self._ends_soon(key):
            return None
        idle = [worker for worker in self.workers if worker.ready and worker.current is None]
        return next((worker for worker in idle if key in worker.keys), next(iter(idle), None))

    def _ends_soon(self, key: Key) -> bool:
        """Return True if a process is running a cancelled job of the key."""
        return any(worker.current and worker.current.key == key for worker in self.workers)

    def remove(self, worker: Worker, message: str) -> None:
        """Remove a process that has ended, and inform its client; others continue."""
        if worker not in self.workers:
            return
        self.workers.remove(worker)
        worker.kill()
        if worker.current is not None:
            worker.current.end("superseded" if worker.cancelled else "crashed", message)
        elif not worker.ready and self.waiting:
            # Otherwise a process that cannot start would be restarted endlessly.
            self.waiting.pop(next(iter(self.waiting))).end("crashed", message)
        worker.done()
        self.assign()


class Worker:
    """A process and its current job."""

    def __init__(self, pool: WorkerPool) -> None:
        self.pool = pool
        self.current: WaitingJob | None = None
        self.keys: set[Key] = set()  # whose last job it had
        self.number = 0
        self.ready = False
        self.timers: list[asyncio.TimerHandle] = []
        context = multiprocessing.get_context("spawn")
        self.given_up = context.Value("Q", 0, lock=False)
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(
            target=serve, args=(theirs, self.given_up, pool.warm), daemon=True
        )
        self.process.start()
        theirs.close()
        threading.Thread(
            target=_listen, args=(self.pipe, asyncio.get_running_loop(), self), daemon=True
        ).start()

    @property
    def cancelled(self) -> bool:
        """True if the current job has been cancelled."""
        return self.number > 0 and self.given_up.value == self.number

    def work(self, waiting: WaitingJob) -> None:
        """Make the process work on the job."""
        self.current = waiting
        self.number += 1
        self._after(
            self.pool.seconds, f"this took more than {self.pool.seconds:g} s and was stopped"
        )
        with contextlib.suppress(OSError):  # the listener notices a process that just died
            self.pipe.send((self.number, waiting.job))

    def cancel(self) -> None:
        """Make the current job end at its next step, or kill its process if that takes too long."""
        if not self.cancelled:
            self.given_up.value = self.number
            self._after(self.pool.patience, "")

    def _after(self, seconds: float, message: str) -> None:
        loop = asyncio.get_running_loop()
        self.timers.append(loop.call_later(seconds, self.pool.remove, self, message))

    def receive(self, number: int, answer: bytes) -> None:
        """Handle an answer from the process."""
        if number == READY:
            self.ready = True
        elif self.current is not None and self.number == number:
            self.current.answers.put_nowait(answer)
            if answer == END:
                self.done()
        self.pool.assign()

    def done(self) -> None:
        """Mark the process as idle."""
        self.current = None
        while self.timers:
            self.timers.pop().cancel()

    def kill(self) -> None:
        """Kill the process, whatever it is doing."""
        if self.process.is_alive():
            self.process.kill()


def _listen(pipe: Any, loop: asyncio.AbstractEventLoop, worker: Worker) -> None:
    """Pass messages from the pipe to the event loop, in a separate thread."""
    with contextlib.suppress(RuntimeError):  # the loop has closed
        try:
            while True:
                number, answer = pipe.recv()
                loop.call_soon_threadsafe(worker.receive, number, answer)
        except (EOFError, OSError):
            message = "the process that worked on this ended; it was started again"
            loop.call_soon_threadsafe(worker.pool.remove, worker, message)


# The loop of a worker process: one job after the other, answers sent as they come.


FIRST_DESIGN = "1dof-5mm"


def serve(pipe: Connection, cancelled: Any, warm: bool) -> None:
    """Answer (number, job) with (number, JSON) until the pipe closes."""
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    # In the worker only: the server need not load the modules for its jobs.
    from sbafab.studio.jobs import SupersededError, answers

    if warm:
        _warm_up()
    # Imported modules stay; the collector need not look through it again at every change.
    gc.collect()
    gc.freeze()
    with contextlib.suppress(EOFError, OSError):
        pipe.send((READY, END))
        while True:
            number, job = pipe.recv()

            def send(answer: dict[str, Any], current: int = number) -> None:
                pipe.send((current, json.dumps(answer, separators=(",", ":")).encode()))

            def pause(current: int = number) -> None:
                if cancelled.value == current:
                    raise SupersededError

            for answer in answers({**job, "tell": send}, pause):
                send(answer)
            pipe.send((number, END))


def _warm_up() -> None:
    """Import everything and check one small design, so that the first answer is fast."""
    # As in `serve`: in the worker alone.
    from sbafab.studio.jobs import design_keys

    with contextlib.suppress(SbafabError):
        design = api.load(FIRST_DESIGN, {"stack.balloons": 1})
        list(api.checking(design))
        design_keys()
