"""One thing to do, with its box to tick."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Action:
    """One thing to do. ``layers`` are laid in it; ``ticks`` label one box each, or there is one."""

    text: str
    layers: tuple[int, ...] = ()
    ticks: tuple[str, ...] = ()
