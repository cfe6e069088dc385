"""Names beside the places of a picture, where they cover neither each other nor what they name."""

from __future__ import annotations

import math
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
        middle, away = min(
            _places(name, size), key=lambda place: _cost(name, place, size, room, taken)
        )
        taken.append(_box(name, middle, size))
        if away >= LED:
            drawn.append(draw.line([name.at, middle], width=0.12))
        drawn.append(label((middle[0], middle[1] + 0.35 * size), name.words, size))
    return drawn


def _places(name: PlanName, size: float) -> list[tuple[Point, float]]:
    """Middles of the name, each with how far it stands off."""
    half = draw.text_width(name.words, size) / 2
    found = []
    for away in STEPS:
        for step in range(DIRECTIONS):
            turn = 2 * math.pi * step / DIRECTIONS + math.atan2(name.out[1], name.out[0])
            u, v = math.cos(turn), math.sin(turn)
            reach = name.clear + away
            found.append(
                (
                    (
                        name.at[0] + (reach + half) * u,
                        name.at[1] + (reach + size / 2) * v,
                    ),
                    away,
                )
            )
    return found


def _box(name: PlanName, middle: Point, size: float) -> Bounds:
    half = draw.text_width(name.words, size) / 2
    x, y = middle
    return x - half, y - size / 2, x + half, y + size / 2


def _cost(
    name: PlanName, place: tuple[Point, float], size: float, room: Bounds, taken: list[Bounds]
) -> float:
    middle, away = place
    box = _box(name, middle, size)
    covered = sum(_shared(box, other) for other in taken)
    outside = _area(box) - _shared(box, room)
    u, v = middle[0] - name.at[0], middle[1] - name.at[1]
    along = (u * name.out[0] + v * name.out[1]) / (math.hypot(u, v) or 1.0)
    return covered + 4 * outside + ASIDE * (1 - along) + FAR * away


def _area(box: Bounds) -> float:
    return (box[2] - box[0]) * (box[3] - box[1])


def _shared(a: Bounds, b: Bounds) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return width * height if width > 0 and height > 0 else 0.0
