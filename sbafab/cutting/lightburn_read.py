"""A LightBurn project read back: what it would cut, in which order."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from sbafab.cutting.verify import TOLERANCE
from sbafab.errors import OutputError
from sbafab.geometry.edges import Point

EIGHTHS = 8
_NUM = r"[-+]?\d+(?:\.\d+)?"
_VERTEX = re.compile(rf"V({_NUM}) ({_NUM})(c0x{_NUM}(?:c0y{_NUM})?)?(c1x{_NUM}(?:c1y{_NUM})?)?")
"""A vertex, the control point with which the next curve leaves it and that with which one comes."""
_PRIMITIVE = re.compile(r"([LB])(\d+) (\d+)")
_PLACE = re.compile(rf"1 0 0 1 ({_NUM}) ({_NUM})")


class Bezier(NamedTuple):
    """A line, or a cubic curve with its two inner control points."""

    start: Point
    handles: tuple[Point, Point] | None
    end: Point

    def at(self, t: float) -> Point:
        (x, y), (u, v), rest = self.start, self.end, 1 - t
        if self.handles is None:
            return rest * x + t * u, rest * y + t * v
        (px, py), (qx, qy) = self.handles
        a, b, c, d = rest**3, 3 * rest * rest * t, 3 * rest * t * t, t**3
        return a * x + b * px + c * qx + d * u, a * y + b * py + c * qy + d * v

    def moved(self, x: float, y: float, times: float) -> Bezier:
        """The curve ``times`` as large, then moved."""

        def placed(p: Point) -> Point:
            return x + times * p[0], y + times * p[1]

        handles = self.handles and (placed(self.handles[0]), placed(self.handles[1]))
        return Bezier(placed(self.start), handles, placed(self.end))


@dataclass(frozen=True)
class LaserShape:
    """Curves one after the other on the layer of an index; of a ``circle``, those of its eighths.

    ``rows`` hold a path's curves from ``place``: x and y of start, both handles and end; handles of
    a line are at its thirds, and ``is_line`` tells which are lines. Shapes that are written alike
    have the same rows.
    """

    index: int
    circle: tuple[Point, float] | None = None
    place: Point = (0.0, 0.0)
    rows: tuple[tuple[float, ...], ...] = ()
    is_line: tuple[bool, ...] = ()

    @cached_property
    def curves(self) -> tuple[Bezier, ...]:
        if self.circle is not None:
            (x, y), radius = self.circle
            return tuple(curve.moved(x, y, radius) for curve in unit_circle())
        return tuple(
            Bezier((a, b), None if straight else ((c, d), (e, f)), (g, h)).moved(*self.place, 1.0)
            for (a, b, c, d, e, f, g, h), straight in zip(self.rows, self.is_line, strict=True)
        )

    @property
    def is_closed(self) -> bool:
        return (
            self.circle is not None or math.dist(self.rows[-1][6:], self.rows[0][:2]) <= TOLERANCE
        )


class Project(NamedTuple):
    """What a project cuts: settings of each index as they stand, shapes in the file's order."""

    settings: dict[int, dict[str, str]]
    shapes: tuple[LaserShape, ...]


def read_project(path: Path) -> Project:
    """A project as this program writes it. Raises OutputError for any other file."""
    try:
        root = ElementTree.parse(path).getroot()
        if root.tag != "LightBurnProject":
            raise OutputError("it is no LightBurn project")
        if (root.get("MirrorX"), root.get("MirrorY")) != ("False", "False"):
            raise OutputError("it is mirrored")
        settings = [
            {"type": item.get("type", ""), **{child.tag: child.get("Value", "") for child in item}}
            for item in root.iterfind("CutSetting")
        ]
        paths = _Paths()
        shapes = tuple(_shape(item, paths) for item in root.iterfind("Shape"))
        return Project({int(told["index"]): told for told in settings}, shapes)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error}") from error
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise OutputError(f"{path.name}: it is no sound project ({error})") from error


def _shape(item: ElementTree.Element, paths: _Paths) -> LaserShape:
    kind, index = item.get("Type"), int(item.get("CutIndex", ""))
    place = _PLACE.fullmatch(item.findtext("XForm") or "")
    if place is None:
        raise OutputError("it turns or stretches a shape")
    x, y = float(place[1]), float(place[2])
    if kind == "Ellipse" and item.get("Rx") == item.get("Ry"):
        return LaserShape(index, ((x, y), float(item.get("Rx", ""))))
    if kind != "Path":
        raise OutputError(f"it holds a shape of the type {kind} that no sheet has")
    rows, is_line = paths[item.findtext("VertList") or "", item.findtext("PrimList") or ""]
    return LaserShape(index, None, (x, y), rows, is_line)


@cache
def unit_circle() -> tuple[Bezier, ...]:
    """A circle of radius 1 round the origin, as curves of an eighth each."""
    step = 2 * math.pi / EIGHTHS
    reach = 4 / 3 * math.tan(step / 4)
    curves = []
    for k in range(EIGHTHS):
        (c, s), (u, v) = ((math.cos(t), math.sin(t)) for t in (k * step, (k + 1) * step))
        handles = (c - reach * s, s + reach * c), (u + reach * v, v - reach * u)
        curves.append(Bezier((c, s), handles, (u, v)))
    return tuple(curves)


_Rows = tuple[tuple[tuple[float, ...], ...], tuple[bool, ...]]


class _Paths(dict[tuple[str, str], _Rows]):
    """The rows of paths and which of them are lines, by vertices and primitives, read once each."""

    def __missing__(self, written: tuple[str, str]) -> _Rows:
        self[written] = _path(*written)
        return self[written]


def _path(vertices: str, primitives: str) -> _Rows:
    places = [
        (float(x), float(y), leaving, coming)
        for x, y, leaving, coming in _matches(_VERTEX, vertices)
    ]
    rows: list[tuple[float, ...]] = []
    is_line: list[bool] = []
    for kind, first, last in _matches(_PRIMITIVE, primitives):
        (x, y, leaving, _), (u, v, _, coming) = places[int(first)], places[int(last)]
        inner: tuple[float, ...]
        if kind == "B":
            inner = *_handle(leaving), *_handle(coming)
        else:
            inner = x + (u - x) / 3, y + (v - y) / 3, u - (u - x) / 3, v - (v - y) / 3
        if rows and rows[-1][6:] != (x, y):
            raise OutputError("a path falls apart")
        rows.append((x, y, *inner, u, v))
        is_line.append(kind == "L")
    if not rows:
        raise OutputError("a path has no line")
    return tuple(rows), tuple(is_line)


def _handle(text: str) -> tuple[float, float]:
    """A control point as it stands behind its vertex. Raises ValueError where there is none."""
    x, y = text[3:].split(text[:2] + "y")
    return float(x), float(y)


def _matches(pattern: re.Pattern[str], text: str) -> Iterator[tuple[str, ...]]:
    """What a text holds that is nothing but one match of a pattern after the other."""
    place = 0
    for found in pattern.finditer(text):
        if found.start() != place:
            break
        yield found.groups("")
        place = found.end()
    if place != len(text):
        raise OutputError(f"it says {text[place : place + 20]!r} in a path")
