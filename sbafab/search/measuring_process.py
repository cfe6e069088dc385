"""A process that measures designs, one after the other, and may be killed at any moment.

It reads a job a line from standard input and writes a row a line to standard output. When its
input ends, because whoever started it is gone, so does it, in the middle of a job if need be.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
from typing import IO, Any

from sbafab.process import prepare
from sbafab.search.measure import fingerprint, measured


def main() -> None:
    """Measures until standard input ends."""
    # Ctrl-C goes to all processes of a terminal; the one that started this ends it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    prepare()
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8", newline="\n")
    # What a library prints must not stand among the answers.
    os.dup2(2, 1)
    jobs: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(sys.stdin, jobs), daemon=True).start()
    while True:
        job = json.loads(jobs.get())
        answers.write(json.dumps(_answer(job)) + "\n")
        answers.flush()


def _read(lines: IO[str], jobs: queue.SimpleQueue[str]) -> None:
    for line in lines:
        jobs.put(line)
    os._exit(0)


def _answer(job: dict[str, Any]) -> dict[str, Any]:
    import time

    if job.pop("program") != fingerprint():
        return {"outcome": "unlike", "reason": fingerprint()}
    began = time.perf_counter()
    try:
        row = measured(**job)
    except Exception as error:
        message = " ".join(str(error).split())
        row = {"outcome": "crashed", "reason": f"{type(error).__name__}: {message}"}
    row["seconds"] = round(time.perf_counter() - began, 4)
    return row


if __name__ == "__main__":
    main()
