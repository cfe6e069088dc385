"""A LightBurn project read back: what it would cut, in which order, and whether that was meant."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from sbafab.cutting.cut_layers import REFERENCE
from sbafab.cutting.dxf_write import Surroundings
from sbafab.cutting.lightburn import CUT_MODE, INDICES, POWERS, drawn, parts_of
from sbafab.cutting.verify import TOLERANCE
from sbafab.errors import OutputError
from sbafab.geometry.edges import Edge, Line, Point, distance_to
from sbafab.geometry.region import Contour

EIGHTHS = 8
BETWEEN = (0.25, 0.5, 0.75)
"""Of a curve, where it is looked at."""
_NUM = r"[-+]?\d+(?:\.\d+)?"
_VERTEX = re.compile(rf"V({_NUM}) ({_NUM})((?:c[01][xy]{_NUM})*)")
_HANDLE = re.compile(rf"(c[01][xy])({_NUM})")
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
    """Curves one after the other on the layer of an index."""

    index: int
    curves: tuple[Bezier, ...]

    @property
    def is_closed(self) -> bool:
        return math.dist(self.curves[-1].end, self.curves[0].start) <= TOLERANCE


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
        shapes = tuple(_shape(item) for item in root.iterfind("Shape"))
        return Project({int(told["index"]): told for told in settings}, shapes)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error}") from error
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise OutputError(f"{path.name}: it is no sound project ({error})") from error


def _shape(item: ElementTree.Element) -> LaserShape:
    kind, index = item.get("Type"), int(item.get("CutIndex", ""))
    place = _PLACE.fullmatch(item.findtext("XForm") or "")
    if place is None:
        raise OutputError("it turns or stretches a shape")
    x, y = float(place[1]), float(place[2])
    if kind == "Ellipse" and item.get("Rx") == item.get("Ry"):
        radius = float(item.get("Rx", ""))
        return LaserShape(index, tuple(curve.moved(x, y, radius) for curve in _unit_circle()))
    if kind != "Path" or (x, y) != (0.0, 0.0):
        raise OutputError(f"it holds a shape of the type {kind} that no sheet has")
    curves = _path(item.findtext("VertList") or "", item.findtext("PrimList") or "")
    return LaserShape(index, tuple(curves))


@cache
def _unit_circle() -> tuple[Bezier, ...]:
    """A circle of radius 1 round the origin, as curves of an eighth each."""
    step = 2 * math.pi / EIGHTHS
    reach = 4 / 3 * math.tan(step / 4)
    curves = []
    for k in range(EIGHTHS):
        (c, s), (u, v) = ((math.cos(t), math.sin(t)) for t in (k * step, (k + 1) * step))
        handles = (c - reach * s, s + reach * c), (u + reach * v, v - reach * u)
        curves.append(Bezier((c, s), handles, (u, v)))
    return tuple(curves)


def _path(vertices: str, primitives: str) -> list[Bezier]:
    places: list[Point] = []
    handles: list[dict[str, float]] = []
    for x, y, behind in _matches(_VERTEX, vertices):
        places.append((float(x), float(y)))
        handles.append({name: float(value) for name, value in _HANDLE.findall(behind)})
    curves: list[Bezier] = []
    for kind, first, last in _matches(_PRIMITIVE, primitives):
        i, j = int(first), int(last)
        inner = None
        if kind == "B":
            leaving, coming = handles[i], handles[j]
            inner = (leaving["c0x"], leaving["c0y"]), (coming["c1x"], coming["c1y"])
        curves.append(Bezier(places[i], inner, places[j]))
        if len(curves) > 1 and curves[-2].end != places[i]:
            raise OutputError("a path falls apart")
    if not curves:
        raise OutputError("a path has no line")
    return curves


def _matches(pattern: re.Pattern[str], text: str) -> Iterator[tuple[str, ...]]:
    place = 0
    while place < len(text):
        found = pattern.match(text, place)
        if found is None:
            raise OutputError(f"it says {text[place : place + 20]!r} in a path")
        yield found.groups()
        place = found.end()


def verify_project(path: Path, contours: Sequence[Contour], sheet: Surroundings) -> None:
    """Reads the project at ``path`` and compares it with the sheet that was meant.

    Every shape is on its layer, in its order, and within TOLERANCE of its contour; layers are in
    order, the frame is not cut and no power is set. Raises OutputError with what is not, and where.
    """
    found = read_project(path)
    try:
        wanted = list(drawn(contours, sheet))
        _check_settings(found, {layer for layer, _, _ in wanted})
        if len(found.shapes) != len(wanted):
            raise OutputError(f"it has {len(found.shapes)} shapes, not {len(wanted)}")
        for shape, (layer, edges, closed) in zip(found.shapes, wanted, strict=True):
            if shape.index != INDICES[layer] or shape.is_closed != closed:
                x, y = shape.curves[0].start
                raise OutputError(f"the shape at x {x:.3f}, y {y:.3f} is not one of {layer}")
            _check_shape(shape, edges)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error}; regenerate it") from error


def _check_settings(found: Project, layers: set[str]) -> None:
    own = [layer for layer in INDICES if layer in layers]
    if list(found.settings) != [INDICES[layer] for layer in own]:
        raise OutputError("its layers are others, or in another order")
    for rank, layer in enumerate(own):
        wanted = {
            "type": CUT_MODE,
            "priority": str(rank),
            "doOutput": str(int(layer != REFERENCE)),
            **dict.fromkeys(("kerf", *POWERS), "0"),
        }
        told = found.settings[INDICES[layer]]
        for name, value in wanted.items():
            if told.get(name) != value:
                raise OutputError(f"{name} of layer {layer} is {told.get(name)}, not {value}")


def _check_shape(shape: LaserShape, edges: Sequence[Edge]) -> None:
    """A full circle's curves may start anywhere; those of a path are its edges one by one."""
    circle = Contour(tuple(edges)).circle
    if circle is not None:
        centre, radius = circle
        points = [p for curve in shape.curves for p in (curve.start, curve.at(0.5))]
        offs = [(abs(math.dist(p, centre) - radius), p) for p in points]
        far = max(math.dist(p, q) for p, q in zip(points, points[len(points) // 2 :], strict=False))
        if far < 1.9 * radius:
            raise OutputError(f"the circle at x {centre[0]:.3f}, y {centre[1]:.3f} is not whole")
    else:
        parts = [part for edge in edges for part in parts_of(edge)]
        if len(parts) != len(shape.curves):
            x, y = edges[0].start
            raise OutputError(f"the shape at x {x:.3f}, y {y:.3f} has {len(shape.curves)} edges")
        pairs = zip(shape.curves, parts, strict=True)
        offs = [off for curve, part in pairs for off in _offs(curve, part)]
    off, (x, y) = max(offs)
    if off > TOLERANCE:
        raise OutputError(f"an edge is {off:.6f} mm off at x {x:.3f}, y {y:.3f}")


def _offs(curve: Bezier, part: Edge) -> Iterator[tuple[float, Point]]:
    """How far ends lie off, and what lies between them off the edge or the arc's circle."""
    yield math.dist(curve.start, part.start), curve.start
    yield math.dist(curve.end, part.end), curve.end
    if isinstance(part, Line) and curve.handles is None:
        return
    for t in BETWEEN:
        p = curve.at(t)
        if isinstance(part, Line):
            yield distance_to(part, p), p
        else:
            yield abs(math.dist(p, part.centre) - part.radius), p
