"""The film sheet as a LightBurn project: its cuts in order, without any guessed power.

The format (``.lbrn2``) is not documented; this module writes only elements found in files that
LightBurn saved. The format has lines, cubic Bezier curves and ellipses, so an arc becomes Bezier
curves of at most 45 degrees, which deviate from it by 4e-6 of its radius.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from sbafab.cutting.beam_paths import BeamCurve, BeamRun, LaserRun, check_runs
from sbafab.cutting.properties import (
    CUT_INNER,
    CUT_OUTER,
    CUT_SHEET,
    ENGRAVE,
    REFERENCE,
    CutSettings,
    Recipes,
)
from sbafab.design.recipes import Recipe
from sbafab.errors import OutputError
from sbafab.geometry.contour import circle
from sbafab.geometry.edges import Arc, Edge, Line, Point
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
        *(_shape(serial, shape, indices[shape.layer]) for serial, shape in enumerate(shapes)),
        f'<Notes ShowOnLoad="1" Notes={quoteattr(notes)}/>',
        "</LightBurnProject>\n",
    ]
    return "\n".join(lines)


def _setting(layer: LaserLayer, rank: int) -> str:
    inner = "".join(
        f"<{name} Value={quoteattr(value)}/>" for name, value in layer.values(rank).items()
    )
    return f'<CutSetting type="{CUT_MODE}">{inner}</CutSetting>'


def _shape(serial: int, run: LaserRun, index: int) -> str:
    if run.circle is not None:
        (x, y), radius = run.circle
        size = f'Rx="{coord(radius)}" Ry="{coord(radius)}"'
        place = f"<XForm>1 0 0 1 {coord(x)} {coord(y)}</XForm>"
        return f'<Shape Type="Ellipse" CutIndex="{index}" {size}>{place}</Shape>'
    vertices, primitives = _outline(run)
    x, y = run.edges[0].start
    return (
        f'<Shape Type="Path" CutIndex="{index}" VertID="{serial}" PrimID="{serial}">'
        f"<XForm>1 0 0 1 {coord(x)} {coord(y)}</XForm><VertList>{vertices}</VertList>"
        f"<PrimList>{primitives}</PrimList></Shape>"
    )


def _outline(run: LaserRun) -> tuple[str, str]:
    """Vertices from the run's first, and primitives."""
    parts = [part for edge in run.edges for part in parts_of(edge)]
    count = len(parts) + (not run.closed)
    leaving = [_handles(part) for part in parts]
    x, y = run.edges[0].start
    vertices = []
    for k in range(count):
        u, v = parts[k].start if k < len(parts) else parts[-1].end
        vertices.append(f"V{coord(u - x)} {coord(v - y)}")
        handles = (
            ("c0", leaving[k][0] if k < len(parts) else None),
            ("c1", leaving[k - 1][1] if run.closed or k else None),
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


_NUM = r"[-+]?\d+(?:\.\d+)?"
_VERTEX = re.compile(rf"V({_NUM}) ({_NUM})(c0x{_NUM}(?:c0y{_NUM})?)?(c1x{_NUM}(?:c1y{_NUM})?)?")
"""A vertex, the control point with which the next curve leaves it and that with which one comes."""
_PRIMITIVE = re.compile(r"([LB])(\d+) (\d+)")
_PLACE = re.compile(rf"1 0 0 1 ({_NUM}) ({_NUM})")
LAYERS = {index: layer for layer, index in INDICES.items()}


class Bezier(NamedTuple):
    """A cubic curve with its two inner control points."""

    start: Point
    handles: tuple[Point, Point]
    end: Point

    def at(self, t: float) -> Point:
        (x, y), ((px, py), (qx, qy)), (u, v), rest = self.start, self.handles, self.end, 1 - t
        a, b, c, d = rest**3, 3 * rest * rest * t, 3 * rest * t * t, t**3
        return a * x + b * px + c * qx + d * u, a * y + b * py + c * qy + d * v


class Project(NamedTuple):
    """A project: settings of each index as they stand, runs in the file's order."""

    settings: dict[int, dict[str, str]]
    runs: list[BeamRun]


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
        runs = [_read_shape(item) for item in root.iterfind("Shape")]
        return Project({int(setting["index"]): setting for setting in settings}, runs)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error}") from error
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise OutputError(f"{path.name}: it is no sound project ({error})") from error


def _read_shape(item: ElementTree.Element) -> BeamRun:
    kind, layer = item.get("Type"), LAYERS[int(item.get("CutIndex", ""))]
    place = _PLACE.fullmatch(item.findtext("XForm") or "")
    if place is None:
        raise OutputError("it turns or stretches a shape")
    x, y = float(place[1]), float(place[2])
    if kind == "Ellipse" and item.get("Rx") == item.get("Ry"):
        return BeamRun(layer, circle((x, y), float(item.get("Rx", ""))).edges)
    if kind != "Path":
        raise OutputError(f"it holds a shape of the type {kind} that no sheet has")
    vertices, primitives = item.findtext("VertList") or "", item.findtext("PrimList") or ""
    return BeamRun(layer, _read_path(vertices, primitives, (x, y)))


def _read_path(vertices: str, primitives: str, place: Point) -> list[BeamCurve]:
    """The curves of a path whose vertices are relative to a place."""
    vertex = [
        (_moved(x, y, place), leaving, coming)
        for x, y, leaving, coming in _matches(_VERTEX, vertices)
    ]
    curves: list[BeamCurve] = []
    for kind, first, last in _matches(_PRIMITIVE, primitives):
        (start, leaving, _), (end, _, coming) = vertex[int(first)], vertex[int(last)]
        if curves and curves[-1].end != start:
            raise OutputError("a path falls apart")
        if kind == "L":
            curves.append(Line(start, end))
        else:
            handles = _handle(leaving, place), _handle(coming, place)
            curves.append(Bezier(start, handles, end))
    if not curves:
        raise OutputError("a path has no line")
    return curves


def _handle(text: str, place: Point) -> Point:
    """A control point as written after its vertex. Raises ValueError if it is missing."""
    x, y = text[3:].split(text[:2] + "y")
    return _moved(x, y, place)


def _moved(x: str, y: str, place: Point) -> Point:
    return place[0] + float(x), place[1] + float(y)


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


def verify_project(path: Path, layers: Sequence[LaserLayer], expected: Sequence[LaserRun]) -> None:
    """Reads the project at ``path`` and compares it with layers and runs.

    Layers are in order, the frame is not cut and only a recipe sets power. Raises OutputError with
    the first deviation and its place.
    """
    project = read_project(path)
    if list(project.settings) != [layer.cut_index for layer in layers]:
        raise OutputError(f"{path.name}: its layers are others, or in another order; regenerate it")
    for rank, layer in enumerate(layers):
        setting = project.settings[layer.cut_index]
        wanted = {"type": CUT_MODE, **layer.values(rank)}
        for name in dict.fromkeys((*wanted, *setting)):
            if setting.get(name) != wanted.get(name):
                raise OutputError(
                    f"{path.name}: {name} of layer {layer.layer} is {setting.get(name)}, "
                    f"not {wanted.get(name)}; regenerate it"
                )
    check_runs(path, project.runs, expected)
