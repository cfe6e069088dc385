"""The film sheet as a LightBurn project: its cuts in order, without any guessed power.

The format (``.lbrn2``) is not documented; this module writes only elements found in files that
LightBurn saved. The format has lines, cubic Bezier curves and ellipses, so an arc becomes Bezier
curves of at most 45 degrees, which deviate from it by 4e-6 of its radius.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from sbafab.cutting.beam_check import BeamRun
from sbafab.cutting.beam_paths import LaserRun
from sbafab.cutting.properties import (
    CUT_INNER,
    CUT_OUTER,
    CUT_SHEET,
    ENGRAVE,
    REFERENCE,
    CutSettings,
    Recipes,
)
from sbafab.cutting.verify import TOLERANCE
from sbafab.design.recipes import Recipe
from sbafab.errors import OutputError
from sbafab.geometry.contour import Contour, Copies
from sbafab.geometry.edges import Arc, Edge, Line, Point, distance_to
from sbafab.geometry.region import coord
from sbafab.laminate.films import Material
from sbafab.markup import quoteattr

ENDING = ".lbrn2"
INDICES = {ENGRAVE: 0, CUT_INNER: 1, CUT_OUTER: 2, CUT_SHEET: 7, REFERENCE: 8}
"""LightBurn's colours: black, blue, red, magenta, grey, as in the sheet's picture."""
CUT_MODE = "Cut"
"""LightBurn's mode Line: the beam follows the line."""
MOST_TURN = math.radians(45)
POWERS = ("minPower", "maxPower", "minPower2", "maxPower2")
PASSES = "numPasses"
"""Number of passes of a layer; LightBurn's default is 1."""
NO_RECIPES: Recipes = {}
ORDER = {"Optimize_ByLayer": 0, "Optimize_ByGroup": -1, "Optimize_ByPriority": 1}
"""Layers in their order, then shapes in the order of the file."""
NOT_OPTIMIZED = (
    "WhichDirection",
    "InnerToOuter",
    "ByDirection",
    "ReduceTravel",
    "HideBacklash",
    "ReduceDirChanges",
    "ChooseCorners",
    "AllowReverse",
    "RemoveOverlaps",
    "OptimalEntryPoint",
)
CHECKS = (
    "Leave kerf offset 0 and the "
    "frame (REFERENCE) without output. The engraved label must read from left to right"
)
ADVICE = f"Powers are 0: set power and speed of each layer for this film. {CHECKS}"


class LaserLayer(NamedTuple):
    """Settings of a layer of a project: power in %, speed in mm/s; at power 0 nothing is fired."""

    layer: str
    cut_index: int
    name: str
    power: float = 0.0
    speed: float | None = None
    passes: int = 1
    is_output: bool = True

    def values(self, rank: int) -> dict[str, str]:
        """The settings as they stand in the project, at this place of the order."""
        # A power of 0 fires nothing, where one left out is the reader's guess.
        at_power = {} if self.speed is None else {"speed": f"{self.speed:g}", PASSES: self.passes}
        values = {
            "index": self.cut_index,
            "name": self.name,
            **dict.fromkeys(POWERS, f"{self.power:g}"),
            **at_power,
            "kerf": 0,
            "priority": rank,
            "doOutput": int(self.is_output),
        }
        return {name: str(value) for name, value in values.items()}


def sheet_layers(used: Collection[str], recipes: Recipes) -> list[LaserLayer]:
    """Return the layers of a sheet in their order, with power and speed if they have a recipe."""
    return [_sheet_layer(layer, recipes) for layer in INDICES if layer in used]


def _sheet_layer(layer: str, recipes: Recipes) -> LaserLayer:
    index = INDICES[layer]
    if layer == REFERENCE:
        return LaserLayer(layer, index, f"{layer}: not cut", is_output=False)
    recipe = recipes.get("engrave" if layer == ENGRAVE else "cut")
    if recipe is None:
        return LaserLayer(layer, index, f"{layer}: set power and speed")
    name = f"{layer}: {recipe.settings}"
    return LaserLayer(layer, index, name, recipe.power_percent, recipe.speed_mm_s, recipe.passes)


def advice_of(settings: CutSettings, material: Material) -> str:
    """Return the note for the user on a film's project: which powers are set, and their source."""
    if settings.machine is None:
        return ADVICE
    recipes = settings.recipes.get(material, NO_RECIPES)
    lines = [
        f"To {recipe.operation} {recipe.film}, {recipe.thickness_mm:g} mm, on {recipe.machine}: "
        f"{recipe.settings}{_measured_kerf(recipe)}. Source: {recipe.source}"
        + (f", {recipe.date}" if recipe.date else "")
        for recipe in recipes.values()
    ]
    open_ones = [name for name in ("cut", "engrave") if name not in recipes]
    if open_ones:
        lines.append(
            f"There is no recipe to {' or '.join(open_ones)} this film on {settings.machine}: "
            "those powers are 0"
        )
    return "\n".join((*lines, CHECKS))


def _measured_kerf(recipe: Recipe) -> str:
    return "" if recipe.kerf_mm is None else f", kerf {recipe.kerf_mm:g} mm"


def parts_of(edge: Edge) -> Sequence[Edge]:
    """The edge, or the pieces of an arc that become a curve each."""
    if isinstance(edge, Line):
        return (edge,)
    count = max(1, math.ceil(abs(edge.sweep) / MOST_TURN - 1e-9))
    stops = [edge.start, *(edge.at(k / count) for k in range(1, count)), edge.end]
    return [edge.part(*stops[k : k + 2]) for k in range(count)]


def runs_text(
    layers: Sequence[LaserLayer],
    shapes: Sequence[LaserRun],
    properties: Mapping[str, str],
    advice: str,
) -> str:
    """The project of runs on layers, both in the order of cutting; ``advice`` heads its notes.

    Lower left corner at the origin, y upwards, mm.
    """
    outlines = _Outlines()
    indices = {layer.layer: layer.cut_index for layer in layers}
    prefs = {**ORDER, **{f"Optimize_{name}": 0 for name in NOT_OPTIMIZED}}
    notes = "\n".join((advice, *(f"{name}: {value}" for name, value in properties.items())))
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<LightBurnProject AppVersion="1.0.00" FormatVersion="1" MaterialHeight="0" '
        'MirrorX="False" MirrorY="False">',
        "<UIPrefs>",
        *(f'<{name} Value="{value}"/>' for name, value in prefs.items()),
        "</UIPrefs>",
        *(_setting(layer, rank) for rank, layer in enumerate(layers)),
        *(
            _shape(serial, shape, indices[shape.layer], outlines)
            for serial, shape in enumerate(shapes)
        ),
        f'<Notes ShowOnLoad="1" Notes={quoteattr(notes)}/>',
        "</LightBurnProject>\n",
    ]
    return "\n".join(lines)


def _setting(layer: LaserLayer, rank: int) -> str:
    inner = "".join(
        f"<{name} Value={quoteattr(value)}/>" for name, value in layer.values(rank).items()
    )
    return f'<CutSetting type="{CUT_MODE}">{inner}</CutSetting>'


def _shape(serial: int, run: LaserRun, index: int, outlines: _Outlines) -> str:
    if run.circle is not None:
        (x, y), radius = run.circle
        size = f'Rx="{coord(radius)}" Ry="{coord(radius)}"'
        place = f"<XForm>1 0 0 1 {coord(x)} {coord(y)}</XForm>"
        return f'<Shape Type="Ellipse" CutIndex="{index}" {size}>{place}</Shape>'
    vertices, primitives = outlines.drawn(run)
    x, y = run.edges[0].start
    return (
        f'<Shape Type="Path" CutIndex="{index}" VertID="{serial}" PrimID="{serial}">'
        f"<XForm>1 0 0 1 {coord(x)} {coord(y)}</XForm><VertList>{vertices}</VertList>"
        f"<PrimList>{primitives}</PrimList></Shape>"
    )


class _Outlines:
    """The paths of a sheet, each shape written once: vertices from its first, and primitives."""

    def __init__(self) -> None:
        self._copies = Copies()
        self._known: dict[int, tuple[str, str]] = {}

    def drawn(self, run: LaserRun) -> tuple[str, str]:
        """Vertices and primitives of a run."""
        if not run.closed:
            return _outline(Contour(run.edges), False)
        first = self._copies.first(Contour(run.edges))
        if id(first) not in self._known:
            self._known[id(first)] = _outline(first, True)
        return self._known[id(first)]


def _outline(contour: Contour, closed: bool) -> tuple[str, str]:
    parts = [part for edge in contour.edges for part in parts_of(edge)]
    count = len(parts) + (not closed)
    leaving = [_handles(part) for part in parts]
    x, y = contour.edges[0].start
    vertices = []
    for k in range(count):
        u, v = parts[k].start if k < len(parts) else parts[-1].end
        vertices.append(f"V{coord(u - x)} {coord(v - y)}")
        handles = (
            ("c0", leaving[k][0] if k < len(parts) else None),
            ("c1", leaving[k - 1][1] if closed or k else None),
        )
        for name, place in handles:
            # A control point that is not there is said by a 1.
            vertices.append(
                f"{name}x{coord(place[0] - x)}{name}y{coord(place[1] - y)}"
                if place is not None
                else f"{name}x1"
            )
    primitives = "".join(
        f"{'L' if isinstance(part, Line) else 'B'}{k} {(k + 1) % count}"
        for k, part in enumerate(parts)
    )
    return "".join(vertices), primitives


def _handles(part: Edge) -> tuple[Point, Point] | tuple[None, None]:
    """The two inner control points of the curve that stands for a short arc."""
    if not isinstance(part, Arc):
        return None, None
    reach = 4 / 3 * math.tan(abs(part.sweep) / 4) * part.radius
    (x, y), (u, v) = part.start, part.end
    (px, py), (qx, qy) = part.direction(part.start), part.direction(part.end)
    return (x + reach * px, y + reach * py), (u - reach * qx, v - reach * qy)


# A LightBurn project read back: what it would cut, in which order.


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
    """Consecutive curves on the layer of an index; a ``circle`` has one curve for each eighth.

    ``rows`` hold a path's curves from ``place``: x and y of start, both handles and end; handles of
    a line are at its thirds, and ``is_line`` tells which are lines. Shapes with equal text
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
    """A project: settings of each index as they stand, shapes in the file's order."""

    settings: dict[int, dict[str, str]]
    shapes: tuple[LaserShape, ...]

    @property
    def cut_runs(self) -> list[BeamRun]:
        """The paths that cut parts of a sheet, in the file's order."""
        layers = {INDICES[layer]: layer for layer in (CUT_INNER, CUT_OUTER)}
        return [
            BeamRun(layers[shape.index], shape.curves)
            for shape in self.shapes
            if shape.index in layers
        ]


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
        shapes = tuple(_read_shape(item, paths) for item in root.iterfind("Shape"))
        return Project({int(setting["index"]): setting for setting in settings}, shapes)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error}") from error
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise OutputError(f"{path.name}: it is no sound project ({error})") from error


def _read_shape(item: ElementTree.Element, paths: _Paths) -> LaserShape:
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
        self[written] = _read_path(*written)
        return self[written]


def _read_path(vertices: str, primitives: str) -> _Rows:
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
    """A control point as written after its vertex. Raises ValueError if it is missing."""
    x, y = text[3:].split(text[:2] + "y")
    return float(x), float(y)


def _matches(pattern: re.Pattern[str], text: str) -> Iterator[tuple[str, ...]]:
    """Yield the matches of a pattern; raise for a text that holds anything between them."""
    place = 0
    for match in pattern.finditer(text):
        if match.start() != place:
            break
        yield match.groups("")
        place = match.end()
    if place != len(text):
        raise OutputError(f"it says {text[place : place + 20]!r} in a path")


# Verification that a LightBurn project is the expected film sheet.


BETWEEN = (0.25, 0.5, 0.75)
"""Shares of a curve at which it is sampled."""
SURE = 0.99
"""Share of the tolerance: shapes within it in the joint check are not checked one by one."""


def verify_runs(path: Path, layers: Sequence[LaserLayer], expected: Sequence[LaserRun]) -> None:
    """Reads the project at ``path`` and compares it with layers and runs.

    Every shape is on its layer, in its order, and within TOLERANCE of its run; layers are in order,
    the frame is not cut and only a recipe sets power. Raises OutputError with the first deviation
    and its place.
    """
    project = read_project(path)
    indices = {layer.layer: layer.cut_index for layer in layers}
    try:
        _check_settings(project, layers)
        if len(project.shapes) != len(expected):
            raise OutputError(f"it has {len(project.shapes)} shapes, not {len(expected)}")
        pairs = list(zip(project.shapes, expected, strict=True))
        for (shape, run), is_on in zip(pairs, _surely_on(pairs), strict=True):
            if shape.index != indices[run.layer] or shape.is_closed != run.closed:
                x, y = shape.curves[0].start
                raise OutputError(f"the shape at x {x:.3f}, y {y:.3f} is not one of {run.layer}")
            if not is_on:
                _check_shape(shape, run.edges)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error}; regenerate it") from error


def _check_settings(project: Project, layers: Sequence[LaserLayer]) -> None:
    if list(project.settings) != [layer.cut_index for layer in layers]:
        raise OutputError("its layers are others, or in another order")
    for rank, layer in enumerate(layers):
        expected = {"type": CUT_MODE, **layer.values(rank)}
        setting = project.settings[layer.cut_index]
        for name in dict.fromkeys((*expected, *setting)):
            if setting.get(name) != expected.get(name):
                raise OutputError(
                    f"{name} of layer {layer.layer} is {setting.get(name)}, "
                    f"not {expected.get(name)}"
                )


def _surely_on(pairs: Sequence[tuple[LaserShape, LaserRun]]) -> list[bool]:
    """For each shape, True if every value that ``_check_shape`` checks is within the tolerance.

    All shapes are checked at once; ``_check_shape`` reports the faults of the others.
    """
    surely = [False] * len(pairs)
    rounds = [i for i, (shape, run) in enumerate(pairs) if shape.circle and run.circle]
    paths = [i for i, (shape, run) in enumerate(pairs) if shape.rows and run.circle is None]
    for indices, offs in (
        (rounds, _circle_offs([pairs[i] for i in rounds])),
        (paths, _path_offs([pairs[i] for i in paths])),
    ):
        for i, off in zip(indices, offs, strict=True):
            surely[i] = off < SURE * TOLERANCE
    return surely


def _circle_offs(pairs: Sequence[tuple[LaserShape, LaserRun]]) -> list[float]:
    """Return the distance of the curves of drawn circles from the expected ones, mm."""
    if not pairs:
        return []
    drawn_as = np.array([(*shape.circle[0], shape.circle[1]) for shape, _ in pairs if shape.circle])
    expected = np.array([(*run.circle[0], run.circle[1]) for _, run in pairs if run.circle])
    unit = np.array([p for curve in unit_circle() for p in (curve.start, curve.at(0.5))])
    x, y = (
        drawn_as[:, k, None] + drawn_as[:, 2:] * unit[:, k] - expected[:, k, None] for k in (0, 1)
    )
    offs: list[float] = np.abs(np.hypot(x, y) - expected[:, 2:]).max(axis=1).tolist()
    return offs


def _path_offs(pairs: Sequence[tuple[LaserShape, LaserRun]]) -> list[float]:
    """Return the distance of the curves of paths from the expected edges, mm; infinite for other
    kinds.
    """
    if not pairs:
        return []
    edges = np.array([_numbers(edge) for _, run in pairs for edge in run.edges])
    owner_of_edge = np.repeat(np.arange(len(pairs)), [len(run.edges) for _, run in pairs])
    sweep = _sweep(edges)
    # As many curves for an edge as ``parts_of`` makes parts.
    counts = np.maximum(1, np.ceil(np.abs(sweep) / MOST_TURN - 1e-9)).astype(int)
    expected = np.bincount(owner_of_edge, counts, len(pairs)).astype(int)
    same_kind = expected == [len(shape.rows) for shape, _ in pairs]
    offs = np.where(same_kind, 0.0, np.inf)
    chosen = np.flatnonzero(same_kind[owner_of_edge])
    if len(chosen):
        shapes = [
            shape
            for (shape, _), is_comparable in zip(pairs, same_kind, strict=True)
            if is_comparable
        ]
        which = np.repeat(chosen, counts[chosen])
        step = np.arange(len(which)) - np.repeat(
            np.cumsum(counts[chosen]) - counts[chosen], counts[chosen]
        )
        by_key = {id(shape.rows): np.array(shape.rows) for shape in shapes}
        rows = np.concatenate(
            [by_key[id(shape.rows)] + np.tile(np.array(shape.place), 4) for shape in shapes]
        )
        straight = np.array([flag for shape in shapes for flag in shape.is_line])
        share = np.array([step, step + 1]) / counts[which]
        off = _row_offs(rows, straight, edges[which], sweep[which], share)
        np.maximum.at(offs, owner_of_edge[which], off)
    farthest: list[float] = offs.tolist()
    return farthest


def _numbers(edge: Edge) -> tuple[float, ...]:
    """Ends, centre, radius (0 of a line) and sense of an edge."""
    if isinstance(edge, Line):
        return *edge.start, *edge.end, 0.0, 0.0, 0.0, 0.0
    return *edge.start, *edge.end, *edge.centre, edge.radius, 1.0 if edge.ccw else -1.0


def _sweep(edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """The angle that each edge turns through, of a line 0."""
    ax, ay, bx, by = (edges[:, k] - edges[:, 4 + k % 2] for k in range(4))
    turn = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    sense = edges[:, 7]
    back = turn * sense <= -1e-9
    return np.where(sense == 0, 0.0, np.where(back, turn + sense * math.tau, turn))


def _row_offs(
    rows: NDArray[np.float64],
    straight: NDArray[np.bool_],
    edges: NDArray[np.float64],
    sweep: NDArray[np.float64],
    share: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the distance of each curve from its part of an edge; ``share`` is from and to, mm."""
    centre, radius = edges[:, 4:6], edges[:, 6]
    first = np.arctan2(edges[:, 1] - edges[:, 5], edges[:, 0] - edges[:, 4])
    off = np.zeros(len(rows))
    for place, part, end in ((rows[:, 0:2], share[0], 0.0), (rows[:, 6:8], share[1], 1.0)):
        angle = first + sweep * part
        on = centre + radius[:, None] * np.array([np.cos(angle), np.sin(angle)]).T
        ends = edges[:, 0:2] if end == 0.0 else edges[:, 2:4]
        expected = np.where((part == end)[:, None], ends, on)
        off = np.maximum(off, np.hypot(*(place - expected).T))
    is_arc = radius > 0
    for t in BETWEEN:
        weights = np.array([(1 - t) ** 3, 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t * t, t**3])
        beside = np.einsum("i,nik->nk", weights, rows.reshape(-1, 4, 2)) - centre
        off = np.where(is_arc, np.maximum(off, np.abs(np.hypot(*beside.T) - radius)), off)
    return np.where(is_arc | straight, off, np.inf)


def _check_shape(shape: LaserShape, edges: Sequence[Edge]) -> None:
    """A full circle's curves may start anywhere; a path's curves are its edges one by one."""
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
    """Return distance of ends, and of points between them, from the edge or the arc's circle."""
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
