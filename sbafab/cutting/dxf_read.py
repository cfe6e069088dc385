"""Cut files read back by ezdxf: entities, appearance, exact contours."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sbafab.cutting.chaining import check_clear, closed_loops, nested_region
from sbafab.cutting.properties import COLOURS, CUT_INNER, CUT_OUTER, REFERENCE, SEAM
from sbafab.errors import OutputError
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import EPSILON, Arc, Edge, Line, Point, edge_from_bulge, quarter_arcs
from sbafab.geometry.region import Region

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.entities.dxfentity import DXFEntity
    from ezdxf.entities.dxfgfx import DXFGraphic
    from ezdxf.entities.layer import Layer
    from ezdxf.entities.polyline import Polyline

QUARTER = math.tan(math.pi / 8)
"""The bulge of a quarter turn."""


class DrawnEntity(NamedTuple):
    """The drawing of one entity on a layer: the closed contour, or else the loose edges."""

    kind: str
    layer: str
    contour: Contour | None
    edges: Sequence[Edge]


def of_polyline(kind: str, layer: str, edges: Sequence[Edge], closed: bool) -> DrawnEntity:
    """Return the drawing of a polyline of these edges."""
    if closed:
        return DrawnEntity(kind, layer, Contour(tuple(edges)), ())
    return DrawnEntity(kind, layer, None, edges)


def arc(centre: Point, radius: float, first_degrees: float, last_degrees: float) -> list[Edge]:
    """An ARC, counter-clockwise from one angle to the other, in quarters."""
    first = math.radians(first_degrees)
    sweep = math.radians((last_degrees - first_degrees) % 360.0)
    start, end = (
        (centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle))
        for angle in (first, first + sweep)
    )
    return quarter_arcs(start, end, centre, radius, sweep)


def polyline(
    rows: Sequence[tuple[float, ...]], closed: bool, width: float, may_be_open: bool
) -> list[Edge]:
    """The edges of a polyline's rows: x, y, start and end width, bulge."""
    x, y = rows[0][:2] if rows else (0.0, 0.0)
    place = f"polyline at x {x:.3f}, y {y:.3f}"
    if len(rows) < 2 or not (closed or may_be_open):
        raise OutputError(f"{place} is open; close it.")
    if width or any(row[2] or row[3] for row in rows):
        raise OutputError(f"{place} has a width; draw the cut's middle without width.")
    edges: list[Edge] = []
    followers = [*rows[1:], rows[0]] if closed else rows[1:]
    for row, following in zip(rows, followers, strict=False):
        start, end = (row[0], row[1]), (following[0], following[1])
        if start == end:
            raise OutputError(
                f"{place} repeats its vertex x {row[0]:.3f}, y {row[1]:.3f}; remove one."
            )
        edges += _bulge_edges(start, end, row[4])
    return edges


def _bulge_edges(start: Point, end: Point, bulge: float) -> list[Edge]:
    """Return edges from a vertex of a polyline to the next; arcs may turn more than half round."""
    edge = edge_from_bulge(start, end, bulge)
    if isinstance(edge, Line) or abs(bulge) <= QUARTER:
        return [edge]
    return quarter_arcs(start, end, edge.centre, edge.radius, 4 * math.atan(bulge))


# Appearance: entities are shown, plotted and coloured as the shop takes them.


BY_LAYER = 256
PAPER = re.compile(r"(?m)^ *67\r?\n *1\r?$")
"""Places at which an entity may be marked as belonging to paper space."""
SOLID = ("continuous", "bylayer")
"""Linetypes that are drawn without gaps, in small letters; no model space entity has a block's."""


def check_appearance(document: Drawing) -> None:
    """Raises OutputError if a laser program would skip, break or re-order the drawing.

    Every entity has to be visible, in an unbroken line, on a layer that is on, thawed and (but
    REFERENCE) plotted, and in that layer's colour. Other programs may state this differently: an
    entity colour equal to the layer's, a true colour of the same red, green and blue, ``ByLayer``
    in any case. Empty layers and line weights are not checked.
    """
    entities = list(document.modelspace())
    for name in dict.fromkeys(entity.dxf.layer for entity in entities):
        if name in COLOURS:
            if name not in document.layers:
                raise OutputError(f"layer {name} is not in the layer table; regenerate it.")
            _check_layer(document.layers.get(name), name)
    for entity in entities:
        if entity.dxf.layer in COLOURS:
            _check_entity(entity)


def check_space(text: str) -> None:
    """Raises OutputError for an entity that says it is in paper space, in a DXF text.

    ezdxf goes by an entity's owner alone, other programs by this.
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


def _check_layer(layer: Layer, name: str) -> None:
    states = (
        ("off", layer.is_off()),
        ("frozen", layer.is_frozen()),
        ("not plotted", name != REFERENCE and not layer.dxf.get("plot", 1)),
    )
    for state, holds in states:
        if holds:
            raise OutputError(f"layer {name} is {state}, so it would not be cut; regenerate it.")
    colour, linetype = abs(layer.dxf.color), layer.dxf.get("linetype", "Continuous")
    if colour != COLOURS[name] or not _is_true(layer.dxf.get("true_color"), name):
        raise OutputError(
            f"layer {name} has the colour {_shown(layer)}, not {COLOURS[name]}; regenerate it."
        )
    if linetype.lower() not in SOLID:
        raise OutputError(f"layer {name} has the linetype {linetype}; make it Continuous.")


def _check_entity(entity: DXFGraphic) -> None:
    dxf, layer = entity.dxf, entity.dxf.layer
    place = f"{entity.dxftype()} (handle {dxf.handle}) on layer {layer}"
    if dxf.get("invisible", 0):
        raise OutputError(f"{place} is invisible; show it or remove it.")
    if dxf.get("transparency") and entity.transparency > 0:
        raise OutputError(f"{place} is transparent; make it solid.")
    if dxf.get("color", BY_LAYER) not in (BY_LAYER, COLOURS[layer]) or not _is_true(
        dxf.get("true_color"), layer
    ):
        raise OutputError(
            f"{place} has the colour {_shown(entity)}, not its layer's; regenerate it."
        )
    linetype = dxf.get("linetype", "ByLayer")
    if linetype.lower() not in SOLID:
        raise OutputError(f"{place} has the linetype {linetype}; make it Continuous.")
    if dxf.get("thickness", 0.0):
        raise OutputError(f"{place} stands {dxf.thickness:g} mm high; make it flat.")


def _is_true(colour: int | None, layer: str) -> bool:
    """Return True if the true colour, if any, equals the colour of the layer's index."""
    if colour is None:
        return True
    from ezdxf.colors import aci2rgb, int2rgb

    layer_colour = {tuple(aci2rgb(COLOURS[layer]))}
    # Index 7 is black on white and white on black.
    both = {(0, 0, 0), (255, 255, 255)}
    return tuple(int2rgb(colour & 0xFFFFFF)) in (both if COLOURS[layer] == 7 else layer_colour)


def _shown(item: Layer | DXFGraphic) -> str:
    colour = item.dxf.get("true_color")
    return str(item.dxf.get("color")) if colour is None else f"#{colour & 0xFFFFFF:06x}"


# Reading back into exact contours, refused where they could not be cut.


DRAWN = ("LWPOLYLINE", "POLYLINE", "CIRCLE", "LINE", "ARC")
R12 = "AC1009"
CLOSED = 1
"""Flag of a closed POLYLINE; all others are of splines and meshes."""
FLAT = 1e-9
"""Heights and widths up to this, in mm, count as 0."""


@dataclass(frozen=True)
class ReadBack:
    """The content of a cut file.

    ``region``: the contours on CUT_INNER and CUT_OUTER; ``properties``: the custom properties,
    which a DXF before R2004 cannot hold; ``units`` is "mm", or empty in R12, which cannot say;
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
    """The cut file at a path, or given as text.

    Raises OutputError unless it is a complete DXF in millimetres of closed, separate contours of
    lines and arcs at z = 0, holes on CUT_INNER and outlines on CUT_OUTER. Ends of loose edges
    within 1 um of each other are joined.
    """
    name = source.name if isinstance(source, Path) else "the DXF text"
    try:
        return _read_text(_text(source) if isinstance(source, Path) else source)
    except OutputError as error:
        raise OutputError(f"{name}: {error}") from error


@lru_cache(maxsize=64)
def _read_text(text: str) -> ReadBack:
    """Equal texts hold the same, and are parsed once: a run reads its files when it writes them,
    and again, from the disk, when it checks the folder.
    """
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
    return _put_together(document, "mm" if says_units else "")


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
        raise OutputError(f"not a sound DXF document ({error}); regenerate it.") from error


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="surrogateescape")
    except OSError as error:
        raise OutputError(f"cannot be read ({error.strerror}); regenerate it.") from error


def _put_together(document: Drawing, units: str) -> ReadBack:
    """The contours that the entities of a document draw."""
    closed: dict[str, list[Contour]] = {CUT_INNER: [], CUT_OUTER: []}
    loose: dict[str, list[Edge]] = {CUT_INNER: [], CUT_OUTER: []}
    layers: list[str] = []
    other_kinds: list[str] = []
    strokes: list[tuple[str, tuple[Edge, ...]]] = []
    for kind, layer, contour, edges in map(drawn_entity, document.modelspace()):
        drawn = contour.edges if contour else edges
        if any(map(_is_short, drawn[:1] if kind == "CIRCLE" else drawn)):
            raise OutputError(f"{_place(kind, drawn)} has an edge of no length; remove it.")
        if layer not in COLOURS and layer != SEAM:
            on = f"is on layer {layer}; use {', '.join(COLOURS)}."
            raise OutputError(f"{_place(kind, drawn)} {on}")
        layers.append(layer)
        if layer not in closed:
            other_kinds.append(kind)
            strokes.append((layer, tuple(drawn)))
        elif contour:
            closed[layer].append(contour)
        else:
            loose[layer] += edges
    check_appearance(document)
    contours = {layer: [*closed[layer], *closed_loops(loose[layer])] for layer in closed}
    check_clear([*contours[CUT_INNER], *contours[CUT_OUTER]])
    region = nested_region(contours[CUT_INNER], contours[CUT_OUTER])
    properties = dict(document.header.custom_vars.properties)
    return ReadBack(region, properties, units, tuple(layers), tuple(other_kinds), tuple(strokes))


def _place(kind: str, drawn: Sequence[Edge]) -> str:
    x, y = drawn[0].start
    return f"{kind} at x {x:.3f}, y {y:.3f}"


def _is_short(edge: Edge) -> bool:
    """Return True if an edge has no length.

    An edge is at least as long as its chord, unless its radius is negative.
    """
    may_be = math.dist(edge.start, edge.end) < EPSILON or (
        isinstance(edge, Arc) and edge.radius < EPSILON
    )
    return may_be and edge.length < EPSILON


def drawn_entity(entity: DXFEntity, may_be_open: bool = False) -> DrawnEntity:
    """Return the drawing of an entity; polylines on the layers of strokes may be open, or all.

    Raises OutputError for one that cannot be cut.
    """
    from ezdxf.entities.lwpolyline import LWPolyline
    from ezdxf.entities.polyline import Polyline

    kind, dxf = entity.dxftype(), entity.dxf
    may_be_open = may_be_open or dxf.layer not in (CUT_INNER, CUT_OUTER)
    if kind not in DRAWN or (isinstance(entity, Polyline) and not _is_plain(entity)):
        raise OutputError(f"{kind} (handle {dxf.handle}) cannot be cut; use {', '.join(DRAWN)}.")
    if not all(math.isfinite(value) for value in _numbers(entity)):
        raise OutputError(f"{kind} (handle {dxf.handle}) has a coordinate that is no number.")
    if isinstance(entity, LWPolyline):
        _check_flat(entity, dxf.elevation)
        rows = [tuple(map(float, row)) for row in entity.lwpoints]
        edges = polyline(rows, entity.closed, dxf.get("const_width", 0.0), may_be_open)
        return of_polyline(kind, dxf.layer, edges, entity.closed)
    if isinstance(entity, Polyline):
        _check_flat(entity, *(vertex.dxf.location.z for vertex in entity.vertices))
        edges = polyline(list(_old_rows(entity)), entity.is_closed, 0.0, may_be_open)
        return of_polyline(kind, dxf.layer, edges, entity.is_closed)
    if kind == "LINE":
        _check_flat(entity, dxf.start.z, dxf.end.z)
        line = Line((dxf.start.x, dxf.start.y), (dxf.end.x, dxf.end.y))
        return DrawnEntity(kind, dxf.layer, None, [line])
    _check_flat(entity, dxf.center.z)
    centre = dxf.center.x, dxf.center.y
    if kind == "CIRCLE":
        return DrawnEntity(kind, dxf.layer, circle(centre, dxf.radius), ())
    return DrawnEntity(
        kind, dxf.layer, None, arc(centre, dxf.radius, dxf.start_angle, dxf.end_angle)
    )


def _numbers(entity: DXFEntity) -> Iterator[float]:
    """Every real number an entity is drawn with."""
    for value in entity.dxfattribs().values():
        if isinstance(value, float):
            yield value
        elif hasattr(value, "xyz"):
            yield from value.xyz
    for row in getattr(entity, "lwpoints", ()):
        yield from row
    if entity.dxftype() == "POLYLINE":
        for vertex in getattr(entity, "vertices", ()):
            yield from _numbers(vertex)


def _is_plain(entity: Polyline) -> bool:
    """Return True if an old polyline is flat and drawn as given: not a mesh, not curve-fitted."""
    return bool(entity.is_2d_polyline) and not entity.dxf.flags & ~CLOSED


def _old_rows(entity: Polyline) -> Iterator[tuple[float, ...]]:
    """Its vertices as an LWPOLYLINE has them: x, y, start and end width, bulge."""
    widths = entity.dxf.default_start_width, entity.dxf.default_end_width
    for vertex in entity.vertices:
        dxf = vertex.dxf
        start, end = dxf.get("start_width", widths[0]), dxf.get("end_width", widths[1])
        yield dxf.location.x, dxf.location.y, start, end, dxf.get("bulge", 0.0)


def _check_flat(entity: DXFEntity, *heights: float) -> None:
    upright = entity.dxf.get("extrusion", (0.0, 0.0, 1.0))
    if max(map(abs, heights)) > FLAT or math.dist(upright, (0.0, 0.0, 1.0)) > FLAT:
        raise OutputError(
            f"{entity.dxftype()} (handle {entity.dxf.handle}) is not at z = 0; move it there."
        )
