"""The polylines of a DXF drawing: the visible content of its model space, read by ezdxf, in mm."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.design.polylines import Polyline, nothing_on, place, polyline, refuse_more_than_limit
from sbafab.errors import DesignError
from sbafab.geometry.arcs import FitError, elliptical_arc, fit_arcs
from sbafab.geometry.edges import EPSILON, Edge, Line, Point

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts.layout import Modelspace

UNITS = {
    0: (1.0, "read at 1 mm a unit, for the file names no unit ($INSUNITS)"),
    1: (25.4, "drawn in inches"),
    4: (1.0, "drawn in mm"),
    5: (10.0, "drawn in cm"),
    6: (1000.0, "drawn in m"),
}
"""Size of a unit in mm, and as text, by $INSUNITS."""
NO_PATHS = frozenset(
    {
        *("ACAD_TABLE", "ACIDBLOCKREFERENCE", "ARC_DIMENSION", "ATTDEF", "ATTRIB", "DIMENSION"),
        *("HATCH", "IMAGE", "LARGE_RADIAL_DIMENSION", "LEADER", "LIGHT", "MLEADER", "MPOLYGON"),
        *("MTEXT", "MULTILEADER", "OLE2FRAME", "OLEFRAME", "PDFUNDERLAY", "POINT", "SUN", "TEXT"),
        *("TOLERANCE", "VIEWPORT", "WIPEOUT"),
    }
)
"""Lettering, dimensions, fills and pictures: never an outline."""
COMPENSATED = "compensated"
"""Value of a cut file's custom property KERF_STATE if its edges are moved."""
LEVEL = 1e-6
HIGHEST_DEGREE = 10
MOST_ITEMS = 20_000
"""Most entities, table entries and flags of a drawing; the reader's time grows faster than
these."""

Read = tuple[Polyline, list[float]]
"""The polyline of an entity in mm, and the z of every point that defines it, in its own units."""


def dxf_polylines(
    path: Path, layer: str | None = None, is_plot: bool = False
) -> tuple[Iterator[Polyline], str]:
    """Return every line, arc, circle, polyline, ellipse and spline that the model space shows, and
    the size of its unit as text.

    They must lie in one plane at one height. Only entities on ``layer`` count if it is given;
    otherwise, for a plot, those on plotted layers. Raises DesignError, also for other visible
    entities, such as block references.
    """
    content = path.read_bytes()
    _refuse_excess(content)
    drawing, space = _drawing(path)
    # A cut path would be compensated for its kerf once more.
    properties = dict(drawing.header.custom_vars.properties)
    if properties.get("KERF_STATE") == COMPENSATED:
        raise DesignError(
            f"is a cut file compensated for a kerf of {properties.get('KERF_WIDTH')} mm; give the "
            "outline itself, without kerf"
        )
    # If a file has no header at all, the reader invents one in metres.
    unit = drawing.header.get("$INSUNITS", 0) if b"$INSUNITS" in content else 0
    if unit not in UNITS:
        raise DesignError(
            f"has $INSUNITS {unit}; save it in millimetres (4), centimetres (5), metres (6) or "
            "inches (1)"
        )
    factor, words = UNITS[unit]
    return _polylines(_shown(drawing, space, layer, is_plot), factor), words


def _refuse_excess(content: bytes) -> None:
    """Raise DesignError for a drawing that would take too long to read."""
    if content.startswith(b"AutoCAD Binary DXF"):
        items = len(re.findall(rb"\0[A-Z]", content))
    else:
        items = sum(line.strip() == b"0" for line in content.splitlines())
    if items > MOST_ITEMS:
        raise DesignError(
            f"has more than {MOST_ITEMS:,} entities and settings; save a drawing of only the "
            "outline"
        )


def _drawing(path: Path) -> tuple[Drawing, Modelspace]:
    from ezdxf.filemanagement import readfile

    try:
        drawing = readfile(path)
        return drawing, drawing.modelspace()
    except Exception:
        # A damaged file fails anywhere in the parser, with any of the built-in errors.
        raise DesignError("is not a valid DXF file; save it again as DXF R2010") from None


def _shown(drawing: Drawing, space: Modelspace, layer: str | None, is_plot: bool) -> list[Any]:
    """Yield the entities that count; text and the like do not."""

    def is_shown(entity: Any) -> bool:
        if not (entity.dxf.is_supported("layer") and entity.dxf.is_supported("invisible")):
            return True  # not an entity, such as a BLOCK: refused by its kind
        if entity.dxf.get("invisible", 0) or _layer(entity) not in drawing.layers:
            return not entity.dxf.get("invisible", 0)
        record = drawing.layers.get(_layer(entity))
        return not (record.is_off() or record.is_frozen())

    def is_plotted(name: str) -> bool:
        return name not in drawing.layers or bool(drawing.layers.get(name).dxf.get("plot", 1))

    every = [entity for entity in space if entity.dxftype() not in NO_PATHS]
    drawn = every
    if layer is not None:
        drawn = [entity for entity in every if _layer(entity) == layer]
        if not drawn:
            raise nothing_on(layer, map(_layer, every))
    elif is_plot:
        drawn = [entity for entity in every if is_plotted(_layer(entity))]
    shown = [entity for entity in drawn if is_shown(entity)]
    if drawn and not shown:
        raise DesignError("has only hidden entities; thaw and switch on the outline's layer")
    return shown


def _layer(entity: Any) -> str:
    return str(entity.dxf.get("layer", "0")) if entity.dxf.is_supported("layer") else "0"


def _polylines(shown: list[Any], factor: float) -> Iterator[Polyline]:
    level: float | None = None
    for entity in shown:
        kind = entity.dxftype()
        if kind not in READERS:
            raise DesignError(
                f"has the unsupported entity {kind}; explode blocks and the like to lines, "
                "arcs and curves, or delete it"
            )
        try:
            chain, heights = READERS[kind](entity, factor)
        except (DesignError, FitError):
            raise
        except Exception:
            # Missing values of a damaged entity may raise anything.
            raise DesignError(f"has a damaged {kind}; draw it again") from None
        for height in heights:
            level = height if level is None else level
            if not abs(height - level) * factor <= LEVEL:
                raise DesignError(
                    f"has a {kind} at z {height:g}, but another point at z {level:g}; flatten "
                    "the whole outline"
                )
        yield chain


def _side(entity: Any) -> float:
    """Return 1, or -1 for an entity drawn on the back of the plane (its x is reversed)."""
    x, y, z = entity.dxf.extrusion
    if abs(x) > LEVEL or abs(y) > LEVEL or abs(abs(z) - 1) > LEVEL:
        raise DesignError(f"has a {entity.dxftype()} tilted out of the xy plane; flatten it")
    return 1.0 if z > 0 else -1.0


def _line(entity: Any, factor: float) -> Read:
    start, end = entity.dxf.start, entity.dxf.end
    edge = Line(place(start.x * factor, start.y * factor), place(end.x * factor, end.y * factor))
    return (edge,) if edge.length > EPSILON else (), [start.z, end.z]


def _round(entity: Any, factor: float) -> Read:
    """A circle, or an arc."""
    side, radius, centre = _side(entity), entity.dxf.radius * factor, entity.dxf.center
    first, last = 0.0, math.tau
    if entity.dxftype() == "ARC":
        first, last = map(math.radians, (entity.dxf.start_angle, entity.dxf.end_angle))
    place(first, last)
    place(radius, 0.0)
    if radius <= 0:
        raise DesignError(f"has a {entity.dxftype()} of radius {radius:g}; delete it")
    turn = (last - first) % math.tau or math.tau
    middle = place(side * centre.x * factor, centre.y * factor)
    chain = elliptical_arc(middle, (side * radius, 0.0), (0.0, radius), first, first + turn)
    return chain, [side * centre.z]


def _ellipse(entity: Any, factor: float) -> Read:
    _side(entity)
    tool = entity.construction_tool()
    first = tool.start_param
    place(first, tool.end_param)
    turn = (tool.end_param - first) % math.tau or math.tau
    centre, major, minor = (
        place(v.x * factor, v.y * factor) for v in (tool.center, tool.major_axis, tool.minor_axis)
    )
    if min(math.hypot(*major), math.hypot(*minor)) == 0:
        raise DesignError("has an ELLIPSE without width; delete it")
    # A rising axis means a tilted ellipse.
    heights = [tool.center.z, tool.center.z + tool.major_axis.z]
    return elliptical_arc(centre, major, minor, first, first + turn), heights


def _polyline(entity: Any, factor: float) -> Read:
    """A polyline, light or heavy."""
    if entity.dxftype() == "LWPOLYLINE":
        points, flat = entity.vertices_in_wcs(), True
        bulges = [float(bulge) for (bulge,) in entity.get_points("b")]
        rows = list(zip(points, bulges, strict=True))
        is_closed = entity.closed
    else:
        flat, is_closed = entity.is_2d_polyline, entity.is_closed
        if not (flat or entity.is_3d_polyline):
            raise DesignError("has a POLYLINE that is a mesh; draw only the outline")
        # Flag 16 marks the frame points of a curve-fitted polyline, which it does not pass through.
        rows = [
            (point, vertex.dxf.get("bulge", 0.0))
            for point, vertex in zip(entity.points_in_wcs(), entity.vertices, strict=True)
            if not vertex.dxf.flags & 16
        ]
    refuse_more_than_limit(len(rows))
    side = _side(entity) if flat else 1.0
    for _, bulge in rows:
        place(bulge, 0.0)
    vertices = [(*place(x * factor, y * factor), side * bulge) for (x, y, _), bulge in rows]
    return polyline(vertices, is_closed), [z for (_, _, z), _ in rows]


def _spline(entity: Any, factor: float) -> Read:
    refuse_more_than_limit(max(len(entity.control_points), len(entity.fit_points)))
    if entity.dxf.degree > HIGHEST_DEGREE:
        raise DesignError(
            f"has a SPLINE of degree {entity.dxf.degree}; the limit is {HIGHEST_DEGREE}; draw it "
            "with degree 3"
        )
    tool = entity.construction_tool()
    for point in tool.control_points:
        place(point.x * factor, point.y * factor)

    def curve(t: float) -> tuple[Point, Point]:
        at, rate = tool.evaluator.derivative(t, 1)
        return (at.x * factor, at.y * factor), (rate.x * factor, rate.y * factor)

    knots = list(tool.knots())
    first, last = knots[tool.degree], knots[tool.count]
    # A knot repeated as often as the degree lets the curve turn a corner there.
    corners = {knot for knot in knots if first < knot < last and knots.count(knot) >= tool.degree}
    edges: list[Edge] = []
    for a, b in pairwise([first, *sorted(corners), last]):
        edges += fit_arcs(curve, a, b)
        refuse_more_than_limit(len(edges))
    points = [*entity.control_points, *entity.fit_points]
    return tuple(edges), [float(point[2]) for point in points]


READERS: Mapping[str, Callable[[Any, float], Read]] = {
    "LINE": _line,
    "ARC": _round,
    "CIRCLE": _round,
    "LWPOLYLINE": _polyline,
    "POLYLINE": _polyline,
    "ELLIPSE": _ellipse,
    "SPLINE": _spline,
}
