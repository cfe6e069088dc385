"""SVG path data of regions: lines as L, arcs as A, nothing flattened."""

from __future__ import annotations

import math

from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.region import Contour, Region


def path_data(region: Region) -> str:
    """The ``d`` of an SVG path in mm, y up (the caller flips); holes by either fill rule."""
    return " ".join(map(_contour_data, region.contours))


def number(value: float) -> str:
    """A length to the nanometre without trailing zeros."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _contour_data(contour: Contour) -> str:
    commands = [f"M{_point(contour.edges[0].start)}", *map(_command, contour.edges), "Z"]
    return "".join(commands)


def _command(edge: Edge) -> str:
    if not isinstance(edge, Arc):
        return f"L{_point(edge.end)}"
    radius = number(edge.radius)
    large = int(abs(edge.sweep) > math.pi + 1e-9)
    return f"A{radius} {radius} 0 {large} {int(edge.ccw)} {_point(edge.end)}"


def _point(p: Point) -> str:
    return f"{number(p[0])} {number(p[1])}"
