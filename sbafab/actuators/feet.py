"""Where ears of an outline of any shape start: inside it, two below and two above beside its tab.

The tab stands on the outline's upper side, on its axis at x = 0.
"""

from __future__ import annotations

import math
from typing import Literal

from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.geometry.section import section
from sbafab.geometry.shapes import rectangle

Side = Literal[-1, 1]
STEP = 0.25
"""mm between the places that are tried along an outline."""


def film_feet(design: Design, outline: Region) -> tuple[Point, Point]:
    """Starts of two film ears at the lower side, a quarter of the width beside its middle.

    Raises DesignError where the outline has no room for both.
    """
    low_x, _, high_x, _ = outline.bounds
    middle, apart = round((low_x + high_x) / 2, 6), _apart(design)
    beside = max(round((high_x - low_x) / 4, 6), apart)
    first = _nearest(outline, middle - beside, -1, design)
    second = first and _nearest(outline, middle + beside, -1, design, first[0])
    if first is None or second is None:
        raise DesignError(_no_room(2 * apart + design.bond.width))
    return first, second


def mask_feet(
    design: Design, outline: Region, head: float
) -> tuple[tuple[Point, Point | None], ...]:
    """Starts of two mask ears at the upper side, clear of the tab and the ``head`` of its tail.

    With each the point of the outline that it is joined from, where it starts beside the outline.
    """
    half, overhang = _half(design), design.mask.overhang
    tab = max(design.strip_width / 2 + design.bond.width, head)
    beside = tab + 2 * overhang + half
    found: list[tuple[Point, Point | None]] = []
    for x in (-beside, beside):
        # A mask reaches past the outline: an ear may stand half beside it.
        inner = x - math.copysign(half - design.bond.width, x)
        start = _foot(outline, x, 1, design) or _foot(outline, inner, 1, design)
        joint = None if start else _nearest(outline, x, 1, design)
        start = start or joint
        if start is None:
            raise DesignError(_no_room(design.bond.width))
        found.append(((x, start[1]), joint))
    return tuple(found)


def _no_room(width: float) -> str:
    return (
        f"the outline of an SBA has no room for ears, which take {width:.3f} mm of its width; make "
        "the chamber wider or registration.pin_diameter smaller, or use "
        'registration.method = "channel-pin"'
    )


def _half(design: Design) -> float:
    """Half the width of an ear."""
    return design.registration.hole_diameter / 2 + design.bond.width


def _apart(design: Design) -> float:
    """Half the distance of two film ears: the fillets beside both, and a little more."""
    return _half(design) + design.fillet.radius + design.mask.overhang / 2


def _foot(outline: Region, x: float, side: Side, design: Design) -> Point | None:
    """A point of the outermost stretch of the outline at ``x``; none where that is too short."""
    stretches = section(outline, (x, 0.0), (0.0, float(side)))
    if not stretches or stretches[-1][1] - stretches[-1][0] < design.bond.width:
        return None
    start, end = stretches[-1]
    return x, side * (end - min((end - start) / 2, 2 * _half(design)))


def _nearest(
    outline: Region, preferred: float, side: Side, design: Design, clear_of: float | None = None
) -> Point | None:
    """The foot nearest to ``preferred`` from which no other part of the outline lies ahead.

    Where it does everywhere: the one with the least ahead. ``clear_of``: the x of another ear.
    """
    low_x, _, high_x, _ = outline.bounds
    reach = max(high_x, preferred) - min(low_x, preferred)
    steps = [STEP * k for k in range(round(reach / STEP) + 1)]
    best: tuple[float, Point] | None = None
    for x in (preferred + sign * step for step in steps for sign in (1, -1)):
        if clear_of is not None and abs(x - clear_of) < 2 * _apart(design) - 1e-9:
            continue
        start = _foot(outline, x, side, design)
        if start is None:
            continue
        ahead = _ahead(outline, start, side, design)
        if ahead < 4 * _half(design):
            return start
        if best is None or ahead < best[0]:
            best = ahead, start
    return best and best[1]


def _ahead(outline: Region, start: Point, side: Side, design: Design) -> float:
    """How far the outline reaches past ``start`` in the way of an ear."""
    half = _half(design) + 2 * design.mask.overhang
    _, low, _, high = outline.bounds
    band = outline & rectangle((start[0] - half, low - 1), (start[0] + half, high + 1))
    _, low, _, high = band.bounds
    return (high - start[1]) if side > 0 else (start[1] - low)
