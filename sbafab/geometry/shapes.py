"""The primitive profiles: disc, rectangle, stadium, polygon."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

from sbafab.geometry.edges import Arc, Line, Point
from sbafab.geometry.region import Contour, Region


@lru_cache(maxsize=256)
def circle(centre: Point, radius: float) -> Contour:
    """A full circle, counter-clockwise, as four quarter arcs.

    The same one for all layers that a bore goes through, with what is known of it.
    """
    x, y = centre
    compass = [(x + radius, y), (x, y + radius), (x - radius, y), (x, y - radius)]
    contour = Contour(
        tuple([Arc(compass[i], compass[(i + 1) % 4], centre, radius, True) for i in range(4)])
    )
    # Known without a look at the arcs.
    contour.__dict__.update(
        circle=(centre, radius),
        area=math.pi * radius * radius,
        length=math.tau * radius,
        bounds=(x - radius, y - radius, x + radius, y + radius),
    )
    return contour


def disc(centre: Point, radius: float) -> Region:
    return Region((circle(centre, radius),))


def polygon(points: Sequence[Point]) -> Region:
    """The region inside straight edges through ``points``, in either order."""
    contour = Contour(
        tuple(Line(points[i], points[(i + 1) % len(points)]) for i in range(len(points)))
    )
    return Region((contour if contour.area > 0 else contour.reversed(),))


def rectangle(low: Point, high: Point) -> Region:
    return polygon([low, (high[0], low[1]), high, (low[0], high[1])])


def strip(start: Point, end: Point, width: float) -> Region:
    """A straight strip of the given width with square ends."""
    length = math.dist(start, end)
    nx = -(end[1] - start[1]) / length * width / 2
    ny = (end[0] - start[0]) / length * width / 2
    return polygon(
        [
            (start[0] + nx, start[1] + ny),
            (start[0] - nx, start[1] - ny),
            (end[0] - nx, end[1] - ny),
            (end[0] + nx, end[1] + ny),
        ]
    )


def stadium(centre: Point, width: float, length: float) -> Region:
    """A slot shape ``width`` across x and ``length`` along y; a disc where they are equal."""
    x, y = centre
    r = width / 2
    half = length / 2 - r
    if half <= 0:
        return disc(centre, r)
    top, bottom = (x, y + half), (x, y - half)
    right_low, right_high = (x + r, bottom[1]), (x + r, top[1])
    left_low, left_high = (x - r, bottom[1]), (x - r, top[1])
    return Region(
        (
            Contour(
                (
                    Line(right_low, right_high),
                    Arc(right_high, (x, top[1] + r), top, r, True),
                    Arc((x, top[1] + r), left_high, top, r, True),
                    Line(left_high, left_low),
                    Arc(left_low, (x, bottom[1] - r), bottom, r, True),
                    Arc((x, bottom[1] - r), right_low, bottom, r, True),
                )
            ),
        )
    )
