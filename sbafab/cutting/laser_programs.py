"""Film sheets as files of laser programs: one row per program, each written and read back.

LightBurn's format (``.lbrn2``) is undocumented; only elements found in files saved by LightBurn are
written. It has lines, cubic Bezier curves and ellipses, so an arc becomes Bezier curves of at most
45 degrees, with a deviation of 4e-6 of its radius.

RDWorks (Ruida controllers) makes a layer of each colour of a drawing; its file is DXF R12, the
oldest, with a colour on every entity and arcs as bulges of polylines. Epilog's software cuts lines
that are hairlines, 0.001 in wide, and maps red, green and blue to settings; its file is an SVG in
millimetres. Neither file has the sheet's frame, since these programs cut every line. Both files
follow general knowledge of the programs and have not been tested with them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple
from xml.etree import ElementTree

from sbafab.cutting.beam_paths import BeamCurve, BeamRun, run_difference
from sbafab.cutting.cut_settings import (
    COLOURS,
    CUT_INNER,
    CUT_OUTER,
    CUT_SHEET,
    ENGRAVE,
    REFERENCE,
    CutSettings,
    Recipes,
)
from sbafab.cutting.dxf_read import drawn_entity
from sbafab.cutting.dxf_write import LaserRun, number
from sbafab.cutting.verify import TOLERANCE
from sbafab.errors import OutputError
from sbafab.geometry.contour import circle
from sbafab.geometry.edges import Arc, Edge, Line, Point
from sbafab.geometry.region import chain_data, coord
from sbafab.laminate.films import Material
from sbafab.markup import quoteattr

Settings = Mapping[str, Mapping[str, str]]
"""Settings of each layer of a file, by name, in the order of the layers."""


NONE: Mapping[Any, Any] = MappingProxyType({})


class LaserSheet(NamedTuple):
    """The content of a film sheet's file: the beam's runs in order, and the sheet size in mm."""

    runs: Sequence[LaserRun]
    size: Point
    title: str
    recipes: Recipes = NONE
    notes: str = ""


class LaserReading(NamedTuple):
    """A file read back: its runs in order, and each layer's settings if the file holds any."""

    runs: list[BeamRun]
    settings: Settings = NONE


# LightBurn: XML with settings, without any guessed power.


INDICES = {ENGRAVE: 0, CUT_INNER: 1, CUT_OUTER: 2, CUT_SHEET: 7, REFERENCE: 8}
"""LightBurn's colours: black, blue, red, magenta, grey, as in the sheet's picture."""
CUT_MODE = "Cut"
"""LightBurn's mode Line: the beam follows the line."""
MOST_TURN = math.radians(45)
POWERS = ("minPower", "maxPower", "minPower2", "maxPower2")
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


def laser_notes(settings: CutSettings, material: Material, properties: Mapping[str, str]) -> str:
    """The notes of a film's file: the powers that are set, their source, and its properties."""
    advice = ADVICE if settings.machine is None else _recipe_notes(settings, material)
    return "\n".join((advice, *(f"{name}: {value}" for name, value in properties.items())))


def _recipe_notes(settings: CutSettings, material: Material) -> str:
    recipes = settings.recipes.get(material, {})
    lines = []
    for recipe in recipes.values():
        kerf = "" if recipe.kerf_mm is None else f", kerf {recipe.kerf_mm:g} mm"
        date = f", {recipe.date}" if recipe.date else ""
        lines.append(
            f"To {recipe.operation} {recipe.film}, {recipe.thickness_mm:g} mm, on "
            f"{recipe.machine}: {recipe.settings}{kerf}. Source: {recipe.source}{date}"
        )
    open_ones = [name for name in ("cut", "engrave") if name not in recipes]
    if open_ones:
        lines.append(
            f"There is no recipe to {' or '.join(open_ones)} this film on {settings.machine}: "
            "those powers are 0"
        )
    return "\n".join((*lines, CHECKS))


def _lightburn_settings(sheet: LaserSheet) -> dict[str, dict[str, str]]:
    """Return the settings of the layers on a sheet; power and speed only from a recipe.

    A power of 0 never fires, while a missing power is left to the reader.
    """
    used = {run.layer for run in sheet.runs}
    settings = {}
    for rank, layer in enumerate(layer for layer in INDICES if layer in used):
        recipe = sheet.recipes.get("engrave" if layer == ENGRAVE else "cut")
        name, power, at_power = "set power and speed", 0.0, {}
        if layer == REFERENCE:
            name = "not cut"
        elif recipe is not None:
            name, power = recipe.settings, recipe.power_percent
            at_power = {"speed": f"{recipe.speed_mm_s:g}", "numPasses": recipe.passes}
        values = {
            "type": CUT_MODE,
            "index": INDICES[layer],
            "name": f"{layer}: {name}",
            **dict.fromkeys(POWERS, f"{power:g}"),
            **at_power,
            "kerf": 0,
            "priority": rank,
            "doOutput": int(layer != REFERENCE),
        }
        settings[layer] = {key: str(value) for key, value in values.items()}
    return settings


def _lightburn(sheet: LaserSheet) -> str:
    """Return a project: lower left corner at the origin, y upwards, mm."""
    prefs = {**ORDER, **{f"Optimize_{name}": 0 for name in NOT_OPTIMIZED}}
    settings = []
    for layer in _lightburn_settings(sheet).values():
        values = {name: quoteattr(value) for name, value in layer.items() if name != "type"}
        inner = "".join(f"<{name} Value={value}/>" for name, value in values.items())
        settings.append(f'<CutSetting type="{layer["type"]}">{inner}</CutSetting>')
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<LightBurnProject AppVersion="1.0.00" FormatVersion="1" MaterialHeight="0" '
        'MirrorX="False" MirrorY="False">',
        "<UIPrefs>",
        *(f'<{name} Value="{value}"/>' for name, value in prefs.items()),
        "</UIPrefs>",
        *settings,
        *(_lightburn_shape(serial, run) for serial, run in enumerate(sheet.runs)),
        f'<Notes ShowOnLoad="1" Notes={quoteattr(sheet.notes)}/>',
        "</LightBurnProject>\n",
    ]
    return "\n".join(lines)


def _lightburn_shape(serial: int, run: LaserRun) -> str:
    index = INDICES[run.layer]
    (x, y), radius = run.circle or (run.edges[0].start, 0.0)
    place = f"<XForm>1 0 0 1 {coord(x)} {coord(y)}</XForm>"
    if run.circle is not None:
        size = f'Rx="{coord(radius)}" Ry="{coord(radius)}"'
        return f'<Shape Type="Ellipse" CutIndex="{index}" {size}>{place}</Shape>'
    curves = [_bezier(part) for edge in run.edges for part in _short_arcs(edge)]
    count = len(curves) + (not run.closed)
    vertices = []
    for k in range(count):
        before = curves[k - 1] if k or run.closed else None
        after = curves[k] if k < len(curves) else None
        u, v = after.start if after else curves[-1].end
        vertices.append(f"V{coord(u - x)} {coord(v - y)}")
        for name, handle in (
            ("c0", after.handles[:1] if after else ()),
            ("c1", before.handles[1:] if before else ()),
        ):
            # A control point that is not there is said by a 1.
            vertices += [f"{name}x{coord(u - x)}{name}y{coord(v - y)}" for u, v in handle] or [
                f"{name}x1"
            ]
    primitives = "".join(
        f"{'B' if curve.handles else 'L'}{k} {(k + 1) % count}" for k, curve in enumerate(curves)
    )
    return (
        f'<Shape Type="Path" CutIndex="{index}" VertID="{serial}" PrimID="{serial}">{place}'
        f"<VertList>{''.join(vertices)}</VertList><PrimList>{primitives}</PrimList></Shape>"
    )


class Bezier(NamedTuple):
    """A cubic curve with its two inner control points; a line if it has none."""

    start: Point
    handles: tuple[Point, ...]
    end: Point

    def at(self, t: float) -> Point:
        (x, y), (u, v), rest = self.start, self.end, 1 - t
        if not self.handles:
            return rest * x + t * u, rest * y + t * v
        (px, py), (qx, qy) = self.handles
        a, b, c, d = rest**3, 3 * rest * rest * t, 3 * rest * t * t, t**3
        return a * x + b * px + c * qx + d * u, a * y + b * py + c * qy + d * v


def _short_arcs(edge: Edge) -> Sequence[Edge]:
    """Return the edge, or an arc split into pieces that become one curve each."""
    if isinstance(edge, Line):
        return (edge,)
    count = max(1, math.ceil(abs(edge.sweep) / MOST_TURN - 1e-9))
    stops = [edge.start, *(edge.at(k / count) for k in range(1, count)), edge.end]
    return [edge.part(*stops[k : k + 2]) for k in range(count)]


def _bezier(edge: Edge) -> Bezier:
    """Return the curve that approximates a short arc, or the line."""
    if not isinstance(edge, Arc):
        return Bezier(edge.start, (), edge.end)
    reach = 4 / 3 * math.tan(abs(edge.sweep) / 4) * edge.radius
    (x, y), (u, v) = edge.start, edge.end
    (px, py), (qx, qy) = edge.direction(edge.start), edge.direction(edge.end)
    handles = (x + reach * px, y + reach * py), (u - reach * qx, v - reach * qy)
    return Bezier(edge.start, handles, edge.end)


_NUM = r"[-+]?\d+(?:\.\d+)?"
_VERTEX = re.compile(rf"V({_NUM}) ({_NUM})c0x({_NUM})(?:c0y({_NUM}))?c1x({_NUM})(?:c1y({_NUM}))?")
"""A vertex, the control point with which the next curve leaves it and that with which one comes."""
_PRIMITIVE = re.compile(r"([LB])(\d+) (\d+)")
_PLACE = re.compile(rf"1 0 0 1 ({_NUM}) ({_NUM})")


def _read_lightburn(path: Path) -> LaserReading:
    """Return a project in this program's format. Raises OutputError for any other file."""
    root = ElementTree.parse(path).getroot()
    if root.tag != "LightBurnProject":
        raise OutputError("it is not a LightBurn project")
    if (root.get("MirrorX"), root.get("MirrorY")) != ("False", "False"):
        raise OutputError("it is mirrored")
    layers = {str(index): layer for layer, index in INDICES.items()}
    rows = [
        {"type": item.get("type", ""), **{child.tag: child.get("Value", "") for child in item}}
        for item in root.iterfind("CutSetting")
    ]
    runs = [
        BeamRun(layers[item.get("CutIndex", "")], list(_read_shape(item)))
        for item in root.iterfind("Shape")
    ]
    return LaserReading(runs, {layers[row["index"]]: row for row in rows})


def _read_shape(item: ElementTree.Element) -> Iterator[BeamCurve]:
    place = _PLACE.fullmatch(item.findtext("XForm") or "")
    if place is None:
        raise OutputError("it rotates or scales a shape")
    x, y = float(place[1]), float(place[2])
    kind = item.get("Type")
    if kind == "Ellipse" and item.get("Rx") == item.get("Ry"):
        yield from circle((x, y), float(item.get("Rx", ""))).edges
        return
    if kind != "Path":
        raise OutputError(f"it holds a shape of type {kind}, which sheets do not use")

    def point(u: str, v: str) -> Point:
        return x + float(u), y + float(v)

    vertices = _matches(_VERTEX, item.findtext("VertList") or "")
    end: Point | None = None
    for curve, first, last in _matches(_PRIMITIVE, item.findtext("PrimList") or ""):
        leaving, coming = vertices[int(first)], vertices[int(last)]
        start = point(*leaving[:2])
        if end not in (None, start):
            raise OutputError("a path is not continuous")
        end = point(*coming[:2])
        handles = () if curve == "L" else (point(*leaving[2:4]), point(*coming[4:6]))
        yield Bezier(start, handles, end)
    if end is None:
        raise OutputError("a path has no line")


def _matches(pattern: re.Pattern[str], text: str) -> list[tuple[str, ...]]:
    """Return the matches of a pattern. Raises OutputError if the text holds anything else."""
    rest = pattern.sub("", text)
    if rest:
        raise OutputError(f"it has {rest[:20]!r} in a path")
    return [match.groups("") for match in pattern.finditer(text)]


# RDWorks: DXF R12.


RGB = {
    ENGRAVE: "#000000",
    CUT_INNER: "#0000ff",
    CUT_OUTER: "#ff0000",
    CUT_SHEET: "#ff00ff",
    REFERENCE: "#808080",
}
"""Colours of the layers in the order of cutting, pure ones that a driver can map; ENGRAVE is black,
as its DXF colour is on white."""
UNITLESS, MILLIMETRES = 0, 4
"""Values of $INSUNITS."""


def _rdworks(sheet: LaserSheet) -> str:
    layers = [layer for layer in RGB if any(run.layer == layer for run in sheet.runs)]
    table = "".join(
        f"  0\nLAYER\n  2\n{layer}\n 70\n0\n 62\n{COLOURS[layer]}\n  6\nCONTINUOUS\n"
        for layer in layers
    )
    return "".join(
        (
            "  0\nSECTION\n  2\nHEADER\n  9\n$ACADVER\n  1\nAC1009\n  0\nENDSEC\n",
            "  0\nSECTION\n  2\nTABLES\n  0\nTABLE\n  2\nLAYER\n",
            f" 70\n{len(layers)}\n{table}  0\nENDTAB\n  0\nENDSEC\n",
            "  0\nSECTION\n  2\nENTITIES\n",
            *map(_r12_entity, sheet.runs),
            "  0\nENDSEC\n  0\nEOF\n",
        )
    )


def _r12_entity(run: LaserRun) -> str:
    head = f"  8\n{run.layer}\n 62\n{COLOURS[run.layer]}\n"
    if run.circle is not None:
        (x, y), radius = run.circle
        return f"  0\nCIRCLE\n{head} 10\n{number(x)}\n 20\n{number(y)}\n 40\n{number(radius)}\n"
    rows = [(*edge.start, edge.bulge) for edge in run.edges]
    if not run.closed:
        rows.append((*run.edges[-1].end, 0.0))
    vertices = "".join(
        f"  0\nVERTEX\n{head} 10\n{number(x)}\n 20\n{number(y)}\n"
        + (f" 42\n{number(bulge)}\n" if bulge else "")
        for x, y, bulge in rows
    )
    return (
        f"  0\nPOLYLINE\n{head} 66\n1\n 10\n0.0\n 20\n0.0\n 70\n{int(run.closed)}\n"
        f"{vertices}  0\nSEQEND\n{head}"
    )


def _read_rdworks(path: Path) -> LaserReading:
    """Return a DXF as ezdxf reads it, with layers by entity colour.

    Its polylines may be of a later DXF version than written. Its unit is mm or unstated, which
    RDWorks takes as mm.
    """
    from ezdxf.filemanagement import readfile
    from ezdxf.lldxf.const import BYLAYER, DXFError

    layers = {COLOURS[layer]: layer for layer in RGB}
    try:
        document = readfile(path)
    except DXFError as error:
        raise OutputError(f"it is not a valid DXF ({error})") from error
    unit = document.header.get("$INSUNITS", UNITLESS)
    if unit not in (UNITLESS, MILLIMETRES):
        raise OutputError(f"not in millimetres: $INSUNITS is {unit}")
    runs = []
    for entity in document.modelspace():
        colour = entity.dxf.color
        if colour == BYLAYER and entity.dxf.layer in document.layers:
            colour = abs(document.layers.get(entity.dxf.layer).dxf.color)
        if colour not in layers:
            raise OutputError(f"a line has colour {colour}, which does not belong to a layer")
        runs.append(BeamRun(layers[colour], drawn_entity(entity, may_be_open=True).edges))
    return LaserReading(runs)


# Epilog: SVG with hairlines.


HAIRLINE = 0.0254
"""mm: 0.001 in."""
SVG = "{http://www.w3.org/2000/svg}"


def _epilog(sheet: LaserSheet) -> str:
    return svg_text(sheet.runs, sheet.size, sheet.title, HAIRLINE)


def svg_text(runs: Iterable[LaserRun], size: Point, title: str, stroke: float = 0.1) -> str:
    """Return runs as an SVG on a page of a size in mm: a group for each layer, with true arcs.

    The page's lower left corner is the origin; coordinates have no transforms. The beam follows the
    centre of a line, which is ``stroke`` mm wide.
    """
    by_layer: dict[str, list[LaserRun]] = {layer: [] for layer in RGB}
    for run in runs:
        by_layer[run.layer].append(run)
    across, up = (coord(side) for side in size)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{across}mm" height="{up}mm" '
        f'viewBox="0 0 {across} {up}">',
        f"<title>{escape(title)}</title>",
    ]
    for layer, drawn in by_layer.items():
        if drawn:
            look = f'fill="none" stroke="{RGB[layer]}" stroke-width="{coord(stroke)}"'
            lines += [f'<g id="{layer}" {look}>', *(_svg_shape(run, size[1]) for run in drawn)]
            lines.append("</g>")
    return "\n".join((*lines, "</svg>\n"))


def _svg_shape(run: LaserRun, height: float) -> str:
    if run.circle is not None:
        (x, y), radius = run.circle
        return f'<circle cx="{coord(x)}" cy="{coord(height - y)}" r="{coord(radius)}"/>'
    edges = [_turned_over(edge, height) for edge in run.edges]
    return f'<path d="{chain_data(edges)}{"Z" if run.closed else ""}"/>'


def _turned_over(edge: Edge, height: float) -> Edge:
    """Return the edge with y downwards, measured from an upper edge at ``height``."""

    def flip(p: Point) -> Point:
        return p[0], height - p[1]

    if isinstance(edge, Line):
        return Line(flip(edge.start), flip(edge.end))
    return Arc(flip(edge.start), flip(edge.end), flip(edge.centre), edge.radius, not edge.ccw)


class _SvgCurve(NamedTuple):
    """A segment of a path from svgelements, with y upwards."""

    segment: Any
    height: float

    @property
    def start(self) -> Point:
        return self.at(0.0)

    @property
    def end(self) -> Point:
        return self.at(1.0)

    def at(self, t: float) -> Point:
        p = self.segment.point(t)
        return float(p.x), self.height - float(p.y)


def _read_epilog(path: Path) -> LaserReading:
    """Read an SVG with svgelements; stroke colours identify the layers."""
    from svgelements import Close
    from svgelements import Path as SvgPath

    root = ElementTree.parse(path).getroot()
    box = [float(word) for word in root.get("viewBox", "").split()]
    if len(box) != 4 or root.get("width") != f"{coord(box[2])}mm":
        raise OutputError("its page is not in millimetres")
    layers = {colour: layer for layer, colour in RGB.items()}
    runs = []
    for group in root.iter(f"{SVG}g"):
        layer = layers.get(group.get("stroke", ""))
        if layer is None or group.get("stroke-width") != f"{HAIRLINE:g}":
            name = group.get("id")
            raise OutputError(f"the lines of {name} are not hairlines in a layer colour")
        for shape in group:
            curves: Sequence[BeamCurve]
            if shape.tag == f"{SVG}circle":
                x, y, r = (float(shape.get(key, "")) for key in ("cx", "cy", "r"))
                curves = circle((x, box[3] - y), r).edges
            else:
                curves = [
                    _SvgCurve(segment, box[3])
                    for segment in [*SvgPath(shape.get("d", ""))][1:]
                    # A closing line of length 0 belongs to a path that is already closed.
                    if not isinstance(segment, Close)
                    or abs(segment.end - segment.start) > TOLERANCE / 10
                ]
            runs.append(BeamRun(layer, curves))
    return LaserReading(runs)


# The table of programs.


class LaserProgram(NamedTuple):
    """A laser program's file: its name suffix, its writer and its reader.

    ``settings`` returns the settings that a file must hold. Without ``has_frame`` the program would
    cut the sheet's frame, so it is omitted.
    """

    ending: str
    text: Callable[[LaserSheet], str]
    read: Callable[[Path], LaserReading]
    settings: Callable[[LaserSheet], Settings] = lambda _sheet: NONE
    has_frame: bool = False

    def drawn(self, sheet: LaserSheet) -> LaserSheet:
        """Return the parts of a sheet that the file holds."""
        runs = [run for run in sheet.runs if self.has_frame or run.layer != REFERENCE]
        return sheet._replace(runs=runs)


ENDING = ".lbrn2"
PROGRAMS = {
    "lightburn": LaserProgram(ENDING, _lightburn, _read_lightburn, _lightburn_settings, True),
    "rdworks": LaserProgram("_rdworks.dxf", _rdworks, _read_rdworks),
    "epilog": LaserProgram("_epilog.svg", _epilog, _read_epilog),
}


def laser_text(program: str, sheet: LaserSheet) -> str:
    """Return the file of a film sheet for a laser program."""
    row = PROGRAMS[program]
    return row.text(row.drawn(sheet))


def read_laser_file(path: Path, program: str) -> LaserReading:
    """Return the content of a laser program's file. Raises OutputError."""
    try:
        return PROGRAMS[program].read(path)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error}; regenerate it") from error
    except (OSError, ValueError, LookupError, ArithmeticError, SyntaxError) as error:
        raise OutputError(f"{path.name}: it cannot be read ({error}); regenerate it") from error


def verify_laser_file(path: Path, program: str, sheet: LaserSheet) -> None:
    """Compare the file at ``path`` with a sheet. Raises OutputError with the first deviation."""
    row, read = PROGRAMS[program], read_laser_file(path, program)
    sheet_drawn = row.drawn(sheet)
    difference = _settings_difference(read.settings, row.settings(sheet_drawn))
    difference = difference or run_difference(read.runs, sheet_drawn.runs)
    if difference:
        raise OutputError(f"{path.name}: {difference}; regenerate it")


def _settings_difference(read: Settings, expected: Settings) -> str:
    if list(read) != list(expected):
        return "its layers are others, or in another order"
    for layer, values in expected.items():
        for name in dict.fromkeys((*values, *read[layer])):
            actual, value = read[layer].get(name), values.get(name)
            if actual != value:
                return f"{name} of layer {layer} is {actual}, not {value}"
    return ""


def rdworks_difference(path: Path, expected: Path) -> str:
    """Return the difference of an RDWorks file from the expected one; "" if it cuts the same.

    Raises OutputError if the file cannot be read.
    """
    read, runs = (read_laser_file(file, "rdworks").runs for file in (path, expected))
    expected_runs = [
        LaserRun(layer, tuple(edge for edge in curves if isinstance(edge, Line | Arc)), False)
        for layer, curves in runs
    ]
    return run_difference(read, expected_runs)
