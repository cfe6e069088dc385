"""How work that takes its time tells how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Told what is being done, and how much of how much is done."""
Counted = Callable[[int, int], None]
"""Told how many of how many are done."""


def unheard(what: str, done: int, total: int) -> None:
    """A progress that nobody watches."""
