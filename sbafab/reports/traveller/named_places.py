"""Names beside the places of a picture, where they cover neither each other nor what they name."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.geometry.edges import Bounds, Point
from sbafab.reports import drawing as draw
from sbafab.reports.traveller.shapes import label

DIRECTIONS = 16
STEPS = (0.0, 2.0, 4.0, 6.5, 9.0)
"""mm from where a name would touch its place, in the order in which they are tried."""
LED = 1.5
"""mm from which on a thin line leads from the name to its place."""
ASIDE, FAR = 0.4, 0.25
"""What a name out of its direction costs, and a mm of distance, in mm2 of covering."""
ROUNDED = 1e-6
"""mm2, far more than sums of costs are off."""


class PlanName(NamedTuple):
    """A name to be put beside ``at``, a place ``clear`` mm round, best in the direction ``out``."""

    words: str
    at: Point
    clear: float
    out: Point


def named(names: list[PlanName], size: float, room: Bounds, taken: list[Bounds]) -> list[str]:
    """The names as SVG, each where it covers least of ``taken`` and of those before it."""
    taken, drawn = list(taken), []
    for name in names:
        half = draw.text_width(name.words, size) / 2, size / 2
        middle, away = _best(name, half, room, taken)
        taken.append(_box(middle, half))
        if away >= LED:
            drawn.append(draw.line([name.at, middle], width=0.12))
        drawn.append(label((middle[0], middle[1] + 0.35 * size), name.words, size))
    return drawn


def _best(
    name: PlanName, half: Point, room: Bounds, taken: Sequence[Bounds]
) -> tuple[Point, float]:
    """The middle of the place that costs least, and how far it stands off; the first of several.

    ``half`` of the name's width and height.
    """
    least, best = math.inf, (name.at, 0.0)
    for away in STEPS:
        # Nothing costs less than the distance alone, but for rounding.
        if FAR * away > least + ROUNDED:
            break
        for middle in _places(name, half, away):
            cost = _cost(name, middle, half, room, taken) + FAR * away
            if cost < least:
                least, best = cost, (middle, away)
    return best


def _places(name: PlanName, half: Point, away: float) -> Iterator[Point]:
    """Middles of the name that stand so far off, from its own direction round."""
    reach = name.clear + away
    for step in range(DIRECTIONS):
        turn = 2 * math.pi * step / DIRECTIONS + math.atan2(name.out[1], name.out[0])
        u, v = math.cos(turn), math.sin(turn)
        yield name.at[0] + (reach + half[0]) * u, name.at[1] + (reach + half[1]) * v


def _box(middle: Point, half: Point) -> Bounds:
    x, y = middle
    return x - half[0], y - half[1], x + half[0], y + half[1]


def _cost(
    name: PlanName, middle: Point, half: Point, room: Bounds, taken: Sequence[Bounds]
) -> float:
    """What a place costs but for its distance."""
    box = _box(middle, half)
    covered = sum([_shared(box, other) for other in taken])
    outside = _area(box) - _shared(box, room)
    u, v = middle[0] - name.at[0], middle[1] - name.at[1]
    along = (u * name.out[0] + v * name.out[1]) / (math.hypot(u, v) or 1.0)
    return covered + 4 * outside + ASIDE * (1 - along)


def _area(box: Bounds) -> float:
    return (box[2] - box[0]) * (box[3] - box[1])


def _shared(a: Bounds, b: Bounds) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return width * height if width > 0 and height > 0 else 0.0
