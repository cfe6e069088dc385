"""Similarities of the plane, by what they do to points."""

from __future__ import annotations

from collections.abc import Callable

from sbafab.geometry.edges import Point

Similarity = Callable[[Point], Point]


def shift(dx: float, dy: float) -> Similarity:
    return lambda p: (p[0] + dx, p[1] + dy)


def turn(direction: Point, about: Point) -> Similarity:
    """What turns the x axis into a direction."""
    (c, s), (ax, ay) = direction, about
    return lambda p: (
        ax + (p[0] - ax) * c - (p[1] - ay) * s,
        ay + (p[0] - ax) * s + (p[1] - ay) * c,
    )


def scale(factor: float) -> Similarity:
    return lambda p: (p[0] * factor, p[1] * factor)


def flip(p: Point) -> Point:
    """What makes x -x."""
    return -p[0], p[1]
