"""Jobs of the studio run here and now, without a process of their own."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

from sbafab.studio.jobs import JOBS


def job(folder: Path, text: str) -> dict[str, Any]:
    """The job of showing a design whose file would lie in the folder."""
    return {
        "do": "live",
        "text": text,
        "edits": [],
        "has": [],
        "folder": str(folder),
        "path": "design.toml",
    }


def answers(asked: dict[str, Any], beat: Callable[[], None] = lambda: None) -> list[dict[str, Any]]:
    """Everything that the job answers."""
    return list(JOBS[asked["do"]](asked, beat))


class EnoughError(Exception):
    """Nobody waits for the work any more."""


def given_up_at(beat: int) -> Callable[[], None]:
    """What a job calls as it goes on; that beat, counted from 1, raises EnoughError."""
    beats = count(1)

    def called() -> None:
        if next(beats) == beat:
            raise EnoughError

    return called
