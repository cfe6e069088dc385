"""Cut files read back into exact contours, and refused where they could not be cut.

Those that stand letter by letter as this program writes them are read by that form; of all others,
and so of all that was touched by hand or another program, ezdxf says what they hold.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

from sbafab.cutting.appearance import check_appearance, check_space
from sbafab.cutting.chaining import check_clear, closed_loops, nested_region
from sbafab.cutting.cut_layers import COLOURS, CUT_INNER, CUT_OUTER
from sbafab.cutting.dxf_own import as_written
from sbafab.cutting.dxf_shapes import DrawnEntity, arc, of_polyline, polyline
from sbafab.errors import OutputError
from sbafab.geometry.copies import Copies
from sbafab.geometry.edges import EPSILON, Arc, Edge, Line
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.shapes import circle

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.entities.dxfentity import DXFEntity
    from ezdxf.entities.polyline import Polyline

DRAWN = ("LWPOLYLINE", "POLYLINE", "CIRCLE", "LINE", "ARC")
R12 = "AC1009"
CLOSED = 1
"""Flag of a closed POLYLINE; all others are of splines and meshes."""
FLAT = 1e-9
"""Heights and widths up to this, in mm, are none."""


@dataclass(frozen=True)
class ReadBack:
    """What a cut file holds.

    ``region``: the contours on CUT_INNER and CUT_OUTER; ``properties``: the custom properties,
    which a DXF before R2004 has none of; ``units`` is "mm", or empty in R12, which cannot say;
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

    Raises OutputError for what is no whole DXF in millimetres of closed, separate contours of
    lines and arcs at z = 0, holes on CUT_INNER and outlines on CUT_OUTER. Ends of loose edges
    within 1 um of each other are one.
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
    own = as_written(text)
    if own is not None:
        return _put_together(own.drawn, own.properties, "mm")
    return read_with_ezdxf(text)


def read_with_ezdxf(text: str) -> ReadBack:
    """What ezdxf says that a text holds. Raises OutputError as ``read_profile`` does."""
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
    return _put_together(
        map(_drawn, model),
        dict(document.header.custom_vars.properties),
        "mm" if says_units else "",
        document,
    )


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


def _put_together(
    entities: Iterable[DrawnEntity],
    properties: dict[str, str],
    units: str,
    document: Drawing | None = None,
) -> ReadBack:
    """The contours that entities draw; the ``document`` they are of, if it may look otherwise."""
    closed: dict[str, list[Contour]] = {CUT_INNER: [], CUT_OUTER: []}
    loose: dict[str, list[Edge]] = {CUT_INNER: [], CUT_OUTER: []}
    layers: list[str] = []
    other: list[str] = []
    strokes: list[tuple[str, tuple[Edge, ...]]] = []
    for kind, layer, contour, edges in entities:
        drawn = contour.edges if contour else edges
        if any(map(_is_short, drawn[:1] if kind == "CIRCLE" else drawn)):
            raise OutputError(f"{_place(kind, drawn)} has an edge of no length; remove it.")
        if layer not in COLOURS:
            on = f"is on layer {layer}; use {', '.join(COLOURS)}."
            raise OutputError(f"{_place(kind, drawn)} {on}")
        layers.append(layer)
        if layer not in closed:
            other.append(kind)
            strokes.append((layer, tuple(drawn)))
        elif contour:
            closed[layer].append(contour)
        else:
            loose[layer] += edges
    if document is not None:
        check_appearance(document)
    contours = {layer: [*closed[layer], *closed_loops(loose[layer])] for layer in closed}
    copies = Copies()
    check_clear([*contours[CUT_INNER], *contours[CUT_OUTER]], copies)
    region = nested_region(contours[CUT_INNER], contours[CUT_OUTER], copies)
    return ReadBack(region, properties, units, tuple(layers), tuple(other), tuple(strokes))


def _place(kind: str, drawn: Sequence[Edge]) -> str:
    x, y = drawn[0].start
    return f"{kind} at x {x:.3f}, y {y:.3f}"


def _is_short(edge: Edge) -> bool:
    """Whether an edge has no length: none is shorter than its chord, but for a radius below 0."""
    may_be = math.dist(edge.start, edge.end) < EPSILON or (
        isinstance(edge, Arc) and edge.radius < EPSILON
    )
    return may_be and edge.length < EPSILON


def _drawn(entity: DXFEntity) -> DrawnEntity:
    """What an entity draws; polylines on the layers of strokes may be open."""
    from ezdxf.entities.lwpolyline import LWPolyline
    from ezdxf.entities.polyline import Polyline

    kind, dxf = entity.dxftype(), entity.dxf
    may_be_open = dxf.layer not in (CUT_INNER, CUT_OUTER)
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
    """Whether an old polyline is flat and drawn as it stands: no mesh, no curve fitted to it."""
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
