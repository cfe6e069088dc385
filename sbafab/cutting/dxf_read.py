"""Reading of cut files: entities, appearance, exact contours. Foreign files are parsed by ezdxf."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab.cutting.chaining import check_clear, closed_loops, nested_region
from sbafab.cutting.cut_settings import COLOURS, CUT_INNER, CUT_OUTER, REFERENCE, SEAM
from sbafab.cutting.dxf_write import document_text
from sbafab.errors import OutputError
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import EPSILON, Arc, Edge, Line, Point, edge_from_bulge, quarter_arcs
from sbafab.geometry.region import Region

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.entities.dxfentity import DXFEntity

QUARTER = math.tan(math.pi / 8)
"""The bulge of a quarter turn."""
DRAWN = ("LWPOLYLINE", "POLYLINE", "CIRCLE", "LINE", "ARC")
CLOSED = 1
"""Flag of a closed POLYLINE; all others are of splines and meshes."""
FLAT = 1e-9
"""Heights and widths up to this, in mm, count as 0."""
UPRIGHT = (0.0, 0.0, 1.0)


# An entity as edges, refused where it could not be cut.


class DrawnEntity(NamedTuple):
    """The edges of one entity on a layer; those of a closed entity form a contour."""

    kind: str
    layer: str
    edges: Sequence[Edge]
    closed: bool

    @property
    def place(self) -> str:
        x, y = self.edges[0].start
        return f"{self.kind} at x {x:.3f}, y {y:.3f}"


def drawn_entity(entity: DXFEntity, may_be_open: bool = False) -> DrawnEntity:
    """Return the drawing of an entity; polylines may be open on stroke layers, or on all if
    requested.

    Raises OutputError for an entity that cannot be cut.
    """
    kind, dxf, layer = entity.dxftype(), entity.dxf, entity.dxf.layer
    name = f"{kind} (handle {dxf.handle})"
    if kind not in DRAWN or (kind == "POLYLINE" and not _is_plain(entity)):
        raise OutputError(f"{name} cannot be cut; use {', '.join(DRAWN)}.")
    if not all(math.isfinite(value) for value in _numbers(entity)):
        raise OutputError(f"{name} has a coordinate that is not a number.")
    tilt = math.dist(dxf.get("extrusion", UPRIGHT), UPRIGHT)
    if max(tilt, *map(abs, _heights(entity))) > FLAT:
        raise OutputError(f"{name} is not at z = 0; move it there.")
    if kind == "LINE":
        line = Line((dxf.start.x, dxf.start.y), (dxf.end.x, dxf.end.y))
        return DrawnEntity(kind, layer, [line], False)
    if kind == "ARC":
        centre = dxf.center.x, dxf.center.y
        edges = _arc_edges(centre, dxf.radius, dxf.start_angle, dxf.end_angle)
        return DrawnEntity(kind, layer, edges, False)
    if kind == "CIRCLE":
        round_edges = circle((dxf.center.x, dxf.center.y), dxf.radius).edges
        return DrawnEntity(kind, layer, round_edges, True)
    polyline: Any = entity
    closed = polyline.is_closed if kind == "POLYLINE" else polyline.closed
    rows = list(_rows(polyline))
    x, y = rows[0][:2] if rows else (0.0, 0.0)
    place = f"polyline at x {x:.3f}, y {y:.3f}"
    if len(rows) < 2 or not (closed or may_be_open or layer not in (CUT_INNER, CUT_OUTER)):
        raise OutputError(f"{place} is open; close it.")
    if entity.dxfattribs().get("const_width") or any(row[2] or row[3] for row in rows):
        raise OutputError(f"{place} has a width; draw the centre line of the cut without width.")
    return DrawnEntity(kind, layer, list(_bulge_edges(rows, closed, place)), closed)


def _arc_edges(centre: Point, radius: float, begin: float, stop: float) -> list[Edge]:
    """Return an arc, counter-clockwise from one angle (degrees) to the other, in quarters."""
    (x, y), first, sweep = centre, math.radians(begin), math.radians((stop - begin) % 360.0)
    start, end = (
        (x + radius * math.cos(angle), y + radius * math.sin(angle))
        for angle in (first, first + sweep)
    )
    return quarter_arcs(start, end, (x, y), radius, sweep)


def _rows(polyline: Any) -> Iterator[tuple[float, ...]]:
    """Yield the vertices of a polyline: x, y, start and end width, bulge."""
    if polyline.dxftype() == "LWPOLYLINE":
        yield from (tuple(map(float, row)) for row in polyline.lwpoints)
        return
    widths = polyline.dxf.default_start_width, polyline.dxf.default_end_width
    for vertex in polyline.vertices:
        dxf = vertex.dxf
        start, end = dxf.get("start_width", widths[0]), dxf.get("end_width", widths[1])
        yield dxf.location.x, dxf.location.y, start, end, dxf.get("bulge", 0.0)


def _bulge_edges(rows: Sequence[tuple[float, ...]], closed: bool, place: str) -> Iterator[Edge]:
    """Yield the edges of a polyline; arcs of more than a quarter turn in quarters."""
    followers = [*rows[1:], rows[0]] if closed else rows[1:]
    for (x, y, *_, bulge), following in zip(rows, followers, strict=False):
        start, end = (x, y), (following[0], following[1])
        if start == end:
            raise OutputError(f"{place} repeats its vertex x {x:.3f}, y {y:.3f}; remove one.")
        edge = edge_from_bulge(start, end, bulge)
        if isinstance(edge, Line) or abs(bulge) <= QUARTER:
            yield edge
        else:
            yield from quarter_arcs(start, end, edge.centre, edge.radius, 4 * math.atan(bulge))


def _heights(entity: Any) -> list[float]:
    """Return every z of an entity."""
    if entity.dxftype() == "POLYLINE":
        return [vertex.dxf.location.z for vertex in entity.vertices] or [0.0]
    attributes = entity.dxfattribs()
    points = [attributes[name] for name in ("start", "end", "center") if name in attributes]
    return [attributes.get("elevation", 0.0), *(point.z for point in points)]


def _numbers(entity: Any) -> Iterator[float]:
    """Yield every real number in the definition of an entity."""
    for value in entity.dxfattribs().values():
        if isinstance(value, float):
            yield value
        elif hasattr(value, "xyz"):
            yield from value.xyz
    for row in getattr(entity, "lwpoints", ()):
        yield from row
    for vertex in entity.vertices if entity.dxftype() == "POLYLINE" else ():
        yield from _numbers(vertex)


def _is_plain(entity: Any) -> bool:
    """Return True if an old polyline is flat and not a mesh or curve-fitted."""
    return bool(entity.is_2d_polyline) and not entity.dxf.flags & ~CLOSED


# Appearance: entities are shown, plotted and coloured as the shop takes them.


BY_LAYER = 256
PAPER = re.compile(r"(?m)^ *67\r?\n *1\r?$")
"""Places at which an entity may be marked as belonging to paper space."""
SOLID = ("continuous", "bylayer")
"""Linetypes that are drawn without gaps, in small letters; no model space entity has a block's."""


def check_appearance(document: Drawing) -> None:
    """Raise OutputError if a laser program would skip, break or re-order the drawing.

    Every entity must be visible, in a continuous line, on a layer that is on, thawed and (except
    REFERENCE) plotted, and in that layer's colour. Other programs may state this differently: an
    entity colour equal to the layer's, a true colour with the same red, green and blue, ``ByLayer``
    in upper or lower case. Empty layers and line weights are not checked.
    """
    entities = [entity for entity in document.modelspace() if entity.dxf.layer in COLOURS]
    for name in dict.fromkeys(entity.dxf.layer for entity in entities):
        if name not in document.layers:
            raise OutputError(f"layer {name} is not in the layer table; regenerate it.")
        layer = document.layers.get(name)
        states = {
            "off": layer.is_off(),
            "frozen": layer.is_frozen(),
            "not plotted": name != REFERENCE and not layer.dxf.get("plot", 1),
        }
        for state in (state for state, holds in states.items() if holds):
            raise OutputError(f"layer {name} is {state}, so it would not be cut; regenerate it.")
        _check_line(layer.dxf, f"layer {name}", name, str(COLOURS[name]), "Continuous")
    for entity in entities:
        dxf, name = entity.dxf, entity.dxf.layer
        place = f"{entity.dxftype()} (handle {dxf.handle}) on layer {name}"
        if dxf.get("invisible", 0):
            raise OutputError(f"{place} is invisible; show it or remove it.")
        if dxf.get("transparency") and entity.transparency > 0:
            raise OutputError(f"{place} is transparent; make it opaque.")
        _check_line(dxf, place, name, "its layer's", "ByLayer")
        if dxf.get("thickness", 0.0):
            raise OutputError(f"{place} has a thickness of {dxf.thickness:g} mm; set it to 0.")


def _check_line(dxf: Any, place: str, layer: str, colour: str, linetype: str) -> None:
    """Raise OutputError unless an entity or layer has its layer's colour and linetype."""
    index, true = dxf.get("color", BY_LAYER), dxf.get("true_color")
    is_layers = abs(index) in (BY_LAYER, COLOURS[layer]) and (true is None or _is_true(true, layer))
    if not is_layers:
        shown = index if true is None else f"#{true & 0xFFFFFF:06x}"
        raise OutputError(f"{place} has the colour {shown}, not {colour}; regenerate it.")
    linetype = dxf.get("linetype", linetype)
    if linetype.lower() not in SOLID:
        raise OutputError(f"{place} has the linetype {linetype}; make it Continuous.")


def _is_true(colour: int, layer: str) -> bool:
    """Return True if a true colour equals the colour of the layer's index."""
    from ezdxf.colors import aci2rgb, int2rgb

    layer_colour = {tuple(aci2rgb(COLOURS[layer]))}
    # Index 7 is black on white and white on black.
    both = {(0, 0, 0), (255, 255, 255)}
    return tuple(int2rgb(colour & 0xFFFFFF)) in (both if COLOURS[layer] == 7 else layer_colour)


def check_space(text: str) -> None:
    """Raise OutputError for an entity marked as paper space in a DXF text.

    ezdxf uses only an entity's owner, other programs this mark.
    """
    if PAPER.search(text) is None:
        return
    lines = [line.strip() for line in text.splitlines()]
    kind, is_drawn = "", False
    for code, value in zip(lines[::2], lines[1::2], strict=False):
        if code == "0":
            kind = value
        elif code == "2" and kind == "SECTION":
            is_drawn = value == "ENTITIES"
        elif is_drawn and code == "67" and value != "0" and kind != "VIEWPORT":
            raise OutputError(f"a {kind} is in paper space; draw in model space only.")


# A whole file.


R12 = "AC1009"


@dataclass(frozen=True)
class ReadBack:
    """The content of a cut file.

    ``region``: the contours on CUT_INNER and CUT_OUTER; ``properties``: the custom properties,
    which a DXF before R2004 cannot hold; ``units`` is "mm", or empty in R12, which has none;
    ``layers``: the layer of every entity in file order; ``other``: types of the entities that are
    not part of the region (datum, engraving, sheet), and ``strokes`` their layers and edges.
    """

    region: Region
    properties: dict[str, str]
    units: str
    layers: tuple[str, ...]
    other: tuple[str, ...]
    strokes: tuple[tuple[str, tuple[Edge, ...]], ...]


def read_profile(source: Path | str) -> ReadBack:
    """Return the content of the cut file at a path, or given as text."""
    name = source.name if isinstance(source, Path) else "the DXF text"
    try:
        if isinstance(source, Path):
            source = source.read_text(encoding="utf-8", errors="surrogateescape")
        return _read_text(source)
    except OutputError as error:
        raise OutputError(f"{name}: {error}") from error
    except OSError as error:
        raise OutputError(f"{name}: cannot be read ({error.strerror}); regenerate it.") from error


@lru_cache(maxsize=64)
def _read_text(text: str) -> ReadBack:
    """Return the content of a text, cached: a run reads its files when it writes them, and again,
    from the disk, when it checks the folder.
    """
    plain = _as_written(text)
    if plain is not None:
        return _read_back(*plain, units="mm")
    check_space(text)
    document = _parsed(text)
    units = document.header.get("$INSUNITS"), document.header.get("$MEASUREMENT")
    says_units = document.dxfversion != R12 or units != (None, None)
    if says_units and units != (4, 1):
        raise OutputError(
            f"not in millimetres: $INSUNITS is {units[0]} and $MEASUREMENT {units[1]}; "
            "set them to 4 and 1."
        )
    model = document.modelspace()
    for layout in document.layouts:
        if layout is not model and any(entity.dxftype() != "VIEWPORT" for entity in layout):
            raise OutputError(f"layout {layout.name} is not empty; draw in model space only.")
    drawn = [*map(drawn_entity, model)]
    _refuse_uncut(drawn)
    check_appearance(document)
    properties = dict(document.header.custom_vars.properties)
    return _read_back(drawn, properties, "mm" if says_units else "")


def _refuse_uncut(drawn: Sequence[DrawnEntity]) -> None:
    """Raise OutputError for a zero-length edge or an unknown layer."""
    for entity in drawn:
        if any(map(_is_short, entity.edges)):
            raise OutputError(f"{entity.place} has a zero-length edge; remove it.")
        if entity.layer not in COLOURS and entity.layer != SEAM:
            raise OutputError(
                f"{entity.place} is on layer {entity.layer}; use {', '.join(COLOURS)}."
            )


def _read_back(drawn: Sequence[DrawnEntity], properties: Mapping[str, str], units: str) -> ReadBack:
    cut = {layer: _contours(drawn, layer) for layer in (CUT_INNER, CUT_OUTER)}
    check_clear([*cut[CUT_INNER], *cut[CUT_OUTER]])
    strokes = [entity for entity in drawn if entity.layer not in cut]
    return ReadBack(
        region=nested_region(cut[CUT_INNER], cut[CUT_OUTER]),
        properties=dict(properties),
        units=units,
        layers=tuple(entity.layer for entity in drawn),
        other=tuple(entity.kind for entity in strokes),
        strokes=tuple((entity.layer, tuple(entity.edges)) for entity in strokes),
    )


# A file that is byte for byte what the writer makes of it is read without ezdxf, which
# takes longer to load than all files of a run take to be read. Any other file is left to ezdxf.


NUMBER = r"(-?\d+\.\d+)\n"
CORNER = rf" 10\n{NUMBER} 20\n{NUMBER}"
EXTENTS = re.compile(rf"\$EXTMIN\n{CORNER} 30\n0\.0\n  9\n\$EXTMAX\n{CORNER}")
PROPERTY = re.compile(r"\$CUSTOMPROPERTYTAG\n  1\n(.*)\n  9\n\$CUSTOMPROPERTY\n  1\n(.*)\n")
ENTITY = re.compile(
    r"  0\n(\w+)\n  5\n\w+\n330\n\w+\n100\nAcDbEntity\n  8\n(\w+)\n100\n(\w+)\n((?:(?!  0\n).*\n)*)"
)
ROUND = rf"{CORNER} 30\n0\.0\n 40\n{NUMBER}"
PLAIN = {
    ("LINE", "AcDbLine"): rf"{CORNER} 30\n0\.0\n 11\n{NUMBER} 21\n{NUMBER} 31\n0\.0\n",
    ("CIRCLE", "AcDbCircle"): ROUND,
    ("ARC", "AcDbCircle"): rf"{ROUND}100\nAcDbArc\n 50\n{NUMBER} 51\n{NUMBER}",
    ("LWPOLYLINE", "AcDbPolyline"): r" 90\n(\d+)\n 70\n([01])\n((?:.*\n)*)",
}
"""Bodies of entities, flat and without any attribute, by type and subclass."""
VERTEX = re.compile(rf"{CORNER}(?: 42\n{NUMBER})?")


def _as_written(text: str) -> tuple[list[DrawnEntity], dict[str, str]] | None:
    """Return entities and properties of a file in this writer's format; None for any other."""
    extents, begin = EXTENTS.search(text), text.find("  2\nENTITIES\n")
    if extents is None or begin < 0:
        return None
    section = text[begin + len("  2\nENTITIES\n") : text.find("  0\nENDSEC\n", begin)]
    entities = [(e[1], e[2], e[3], e[4]) for e in ENTITY.finditer(section)]
    properties = dict(PROPERTY.findall(text))
    left, low, right, high = map(float, extents.groups())
    if document_text(entities, [(left, low, right, high)], properties) != text:
        return None
    drawn = [_plain_entity(*entity) for entity in entities]
    plain = [entity for entity in drawn if entity is not None]
    if len(plain) < len(drawn):
        return None
    _refuse_uncut(plain)
    return plain, properties


def _plain_entity(kind: str, layer: str, subclass: str, body: str) -> DrawnEntity | None:
    """Return an entity from its body; None unless it is plain and flat."""
    read = re.fullmatch(PLAIN.get((kind, subclass), "(?!)"), body)
    if read is None:
        return None
    if kind == "LWPOLYLINE":
        return _plain_polyline(layer, *read.groups())
    x, y, *rest = map(float, read.groups())
    edges: Sequence[Edge]
    if kind == "LINE":
        edges = [Line((x, y), (rest[0], rest[1]))]
    elif kind == "CIRCLE":
        edges = circle((x, y), rest[0]).edges
    else:
        edges = _arc_edges((x, y), *rest)
    return DrawnEntity(kind, layer, edges, kind == "CIRCLE")


def _plain_polyline(layer: str, count: str, flag: str, vertices: str) -> DrawnEntity | None:
    matches, closed = list(VERTEX.finditer(vertices)), flag == str(CLOSED)
    rows = [tuple(float(value or 0.0) for value in match.groups()) for match in matches]
    is_whole = "".join(match[0] for match in matches) == vertices and int(count) == len(rows) > 1
    if not is_whole or (layer in (CUT_INNER, CUT_OUTER) and not closed):
        return None
    x, y = rows[0][:2]
    edges = list(_bulge_edges(rows, closed, f"polyline at x {x:.3f}, y {y:.3f}"))
    return DrawnEntity("LWPOLYLINE", layer, edges, closed)


def _parsed(text: str) -> Drawing:
    from ezdxf.filemanagement import read
    from ezdxf.lldxf.const import DXFError

    words = text.split()
    if words[:2] != ["0", "SECTION"]:
        raise OutputError("not an ASCII DXF document; regenerate it.")
    if words[-2:] != ["0", "EOF"]:
        raise OutputError("the document ends early; regenerate it.")
    try:
        return read(StringIO(text))
    except (DXFError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise OutputError(f"not a valid DXF document ({error}); regenerate it.") from error


def _contours(drawn: Sequence[DrawnEntity], layer: str) -> list[Contour]:
    """Return the closed contours of a layer, and those formed by its loose edges."""
    mine = [entity for entity in drawn if entity.layer == layer]
    loose = [edge for entity in mine if not entity.closed for edge in entity.edges]
    closed = [Contour(tuple(entity.edges)) for entity in mine if entity.closed]
    return [*closed, *closed_loops(loose)]


def _is_short(edge: Edge) -> bool:
    """Return True if an edge has no length.

    An edge is at least as long as its chord, unless its radius is negative.
    """
    is_tight = isinstance(edge, Arc) and edge.radius < EPSILON
    return (is_tight or math.dist(edge.start, edge.end) < EPSILON) and edge.length < EPSILON
