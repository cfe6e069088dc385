"""The ends of arms that taper: nothing stands square on both sides there, yet they are narrow.

An end lies between two flanks that come together towards it: a rounded corner, or an edge between
two bends, each a corner or its fillet. It is as wide as its flanks are apart where they stop.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from sbafab.geometry.edges import Arc, Edge, Point, left_turn
from sbafab.geometry.facets import run_sweep
from sbafab.geometry.region import Contour

SMOOTH: Final = 1e-4
"""Corners that turn by less, in radians, are none."""
TAPER: Final = 30.0
"""Degrees; flanks at a wider angle are two sides of a corner, not of an arm."""
LEAST_TURN: Final = math.pi - math.radians(TAPER + 1)
ROUNDED: Final = 0.1
"""Degrees a corner may miss its angle by: coordinates read from a file are rounded."""


class _Run:
    """Consecutive edges on one line or circle, and how far they turn (radians, left positive)."""

    __slots__ = ("first", "last", "radius", "sweep")

    def __init__(self, first: Edge, last: Edge, sweep: float) -> None:
        self.first: Final[Edge] = first
        self.last: Final[Edge] = last
        self.sweep: Final[float] = sweep
        self.radius: Final[float] = first.radius if isinstance(first, Arc) else math.inf

    def corner(self, after: _Run) -> float:
        """How far the path turns from this run to the next."""
        return left_turn(self.last, after.first)

    def is_fillet(self, bottom: _Run) -> bool:
        """Whether it rounds a corner of the run beside it, which turns less tightly."""
        return self.sweep > 0 and (bottom.sweep <= 0 or self.radius < bottom.radius)


def tapered_ends(contour: Contour, sharp: float) -> Iterator[tuple[Point, Point]]:
    """Where the flanks of every end of an arm stop, in a contour with the arm on its left.

    A rounded corner is an end where the corner itself would have less than ``sharp`` degrees.
    """
    runs = [_Run(own[0], own[-1], run_sweep(own)) for own in contour.runs]
    corners = [runs[i - 1].corner(run) for i, run in enumerate(runs)]
    # No end where the path can not turn far enough from the run before to the one after.
    most = [abs(run.sweep) + abs(corner) for run, corner in zip(runs, corners, strict=True)]
    ahead = [*range(1, len(runs)), 0]
    for i, run in enumerate(runs):
        turns = most[i - 1] + most[i] + most[ahead[i]] + abs(corners[ahead[ahead[i]]])
        if turns < LEAST_TURN:
            continue
        before, after = runs[i - 1], runs[(i + 1) % len(runs)]
        into, out = corners[i], corners[(i + 1) % len(runs)]
        # A round end that turns further is wider than between its flanks.
        if abs(into) < SMOOTH and abs(out) < SMOOTH and run.sweep < math.pi + SMOOTH:
            yield from _between_flanks(runs, corners, i, i, min(TAPER, sharp - ROUNDED))
        start = i - 1 if abs(into) < SMOOTH and before.is_fillet(run) else i
        stop = i + 1 if abs(out) < SMOOTH and after.is_fillet(run) else i
        if (start < i or into > SMOOTH) and (stop > i or out > SMOOTH):
            yield from _between_flanks(runs, corners, start, stop, TAPER)


def _between_flanks(
    runs: Sequence[_Run], corners: Sequence[float], start: int, stop: int, taper: float
) -> Iterator[tuple[Point, Point]]:
    """The ends of the path along runs ``start`` to ``stop``, if it turns back between flanks.

    ``corners``: how far it turns into each run.
    """
    if stop - start + 3 > len(runs):
        return
    count = len(runs)
    turn: float = sum([runs[i % count].sweep for i in range(start, stop + 1)])
    turn += sum([corners[i % count] for i in range(start, stop + 2)])
    if abs(turn - math.pi) < math.radians(taper):
        yield runs[start % len(runs)].first.start, runs[stop % len(runs)].last.end
