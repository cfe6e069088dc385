"""How often the press runs for several copies of one laminate."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sbafab.geometry.edges import Bounds

APART = 5.0
"""mm between two copies in the press, ours: so far do films flow and hands need."""


@dataclass(frozen=True)
class Runs:
    """``together`` copies lie side by side in the press, in ``columns`` columns."""

    copies: int
    together: int
    columns: int

    @property
    def count(self) -> int:
        return math.ceil(self.copies / self.together)


def press_runs(copies: int, bounds: Bounds, platen: tuple[float, float]) -> Runs:
    """As many copies at once as the heated area (mm) takes; ``bounds`` are those of one.

    Copies are equal layer by layer, so every place of the press holds the same films at every
    height: the paper (Sec. 2) splits pressing where stacks of unlike cuts would share the pressure
    unevenly. Unlike designs are therefore never pressed together.
    """
    low_x, low_y, high_x, high_y = bounds
    columns = _in_a_row(platen[0], high_x - low_x)
    rows = _in_a_row(platen[1], high_y - low_y)
    together = min(copies, columns * rows)
    return Runs(copies, together, min(together, columns))


def _in_a_row(room: float, size: float) -> int:
    return max(1, math.floor((room + APART + 1e-9) / (size + APART)))
