"""Whether a program's files do the 40-plate task: a time counts only if they do."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmarks.task import LOBES, file_name, plates

SAME = 1e-4
"""Ends of edges nearer than this, in mm, are one point."""
AREA_ERROR = 1e-4
MILLIMETRES = 4
MARKS = "REFERENCE"
"""Layer of what is not cut."""

Edge = tuple[complex, complex, float]
"""Start, end and bulge."""


def complaint(folder: Path) -> str | None:
    """What is wrong with the first bad file, or None."""
    for index, plate in enumerate(plates()):
        wrong = _file_complaint(folder / file_name(index), plate.area)
        if wrong is not None:
            return f"{file_name(index)}: {wrong}"
    return None


def has_true_arcs(folder: Path) -> bool:
    """Whether curves are written as arcs and circles, not as chains of chords."""
    edges = [edge for loop in _loops(folder / file_name(0)) for edge in loop]
    return len(edges) < 100 and any(bulge for _, _, bulge in edges)


def _file_complaint(path: Path, expected: float) -> str | None:
    import ezdxf

    if not path.exists():
        return "was not written"
    if ezdxf.filemanagement.readfile(path).header.get("$INSUNITS") != MILLIMETRES:
        return "is not in millimetres"
    try:
        loops = _loops(path)
    except ValueError as error:
        return str(error)
    if len(loops) != LOBES + 2:
        return f"has {len(loops)} closed contours"
    middles = [_middle(edge) for loop in loops for edge in loop]
    if len({(round(p.real, 4), round(p.imag, 4)) for p in middles}) != len(middles):
        return "has a doubled edge"
    sizes = sorted((abs(_area(loop)) for loop in loops), reverse=True)
    area = sizes[0] - sum(sizes[1:])
    if abs(area / expected - 1) > AREA_ERROR:
        return f"has an area of {area:.4f} in place of {expected:.4f}"
    return None


def _loops(path: Path) -> list[list[Edge]]:
    """Closed contours of a file, marks aside; raises ValueError where one stays open."""
    import ezdxf

    loops: list[list[Edge]] = []
    loose: list[Edge] = []
    for entity in ezdxf.filemanagement.readfile(path).modelspace():
        kind = entity.dxftype()
        if entity.dxf.layer == MARKS:
            continue
        if kind == "LWPOLYLINE":
            if not entity.closed:
                raise ValueError("has an open polyline")
            loops.append(_polyline(entity))
        elif kind == "CIRCLE":
            left = complex(*entity.dxf.center.vec2) - entity.dxf.radius
            right = left + 2 * entity.dxf.radius
            loops.append([(left, right, 1.0), (right, left, 1.0)])
        elif kind == "ARC":
            sweep = math.radians((entity.dxf.end_angle - entity.dxf.start_angle) % 360)
            start, end = complex(*entity.start_point.vec2), complex(*entity.end_point.vec2)
            loose.append((start, end, math.tan(sweep / 4)))
        elif kind == "LINE":
            loose.append((complex(*entity.dxf.start.vec2), complex(*entity.dxf.end.vec2), 0.0))
        else:
            raise ValueError(f"has a {kind}")
    return loops + _chained(loose)


def _polyline(entity: Any) -> list[Edge]:
    points = [(complex(x, y), bulge) for x, y, bulge in entity.get_points("xyb")]
    return [(a, b, bulge) for (a, bulge), (b, _) in pairwise([*points, points[0]])]


def _chained(edges: list[Edge]) -> list[list[Edge]]:
    rest = list(edges)
    loops = []
    while rest:
        loop = [rest.pop()]
        while abs(loop[-1][1] - loop[0][0]) > SAME:
            here = loop[-1][1]
            near = [e for e in rest if min(abs(e[0] - here), abs(e[1] - here)) < SAME]
            if not near:
                raise ValueError("has an open contour")
            follower = near[0]
            rest.remove(follower)
            start, end, bulge = follower
            loop.append(follower if abs(start - here) < SAME else (end, start, -bulge))
        loops.append(loop)
    return loops


def _area(loop: list[Edge]) -> float:
    area = 0.0
    for a, b, bulge in loop:
        sweep = 4 * math.atan(bulge)
        area += (a.conjugate() * b).imag / 2
        if bulge:
            radius = abs(b - a) * (1 + bulge**2) / (4 * abs(bulge))
            area += radius**2 * (sweep - math.sin(sweep)) / 2
    return area


def _middle(edge: Edge) -> complex:
    a, b, bulge = edge
    return (a + b) / 2 - 1j * (b - a) / 2 * bulge
