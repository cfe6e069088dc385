"""Strands: the chains of edges that a drawing holds, how their ends join, and those of DXF files.

All coordinates are mm.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab.errors import DesignError
from sbafab.geometry.arcs import FitError, elliptical_arc, fit_arcs
from sbafab.geometry.edges import EPSILON, Edge, Line, Point, edge_from_bulge

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts.layout import Modelspace
    from ezdxf.math import BSpline

Strand = tuple[Edge, ...]

JOIN = 0.001
"""Largest gap between joined ends, mm."""
MOST_EDGES = 500
"""Most edges of an outline."""
MOST_OF_ENTITY = 5000
"""Most edges of a whole drawing."""
FARTHEST = 10_000.0
"""No coordinate of a drawing may be larger, in mm."""


class Traced(NamedTuple):
    """Strands of a drawing in mm, and the size of its unit as text."""

    strands: Iterator[Strand]
    scale: str


def place(x: float, y: float) -> Point:
    """A point of a drawing. Raises DesignError unless it is finite and of a sensible size."""
    if not abs(x) <= FARTHEST or not abs(y) <= FARTHEST:
        raise DesignError(
            f"has a coordinate of x {x:g}, y {y:g} mm, where at most {FARTHEST:g} is allowed; "
            "check its units"
        )
    return float(x), float(y)


def nothing_on(layer: str, others: Sequence[str]) -> DesignError:
    """Return the error for an empty layer, with the names of ``others`` that are not."""
    hint = f"paths lie on {', '.join(others)}" if others else "no layer has any"
    return DesignError(f"has no paths on a layer {layer!r}; {hint}")


def counted(strands: Iterable[Strand], most: int = MOST_EDGES) -> Iterator[Strand]:
    """Yield the strands; raises DesignError once they have more than ``most`` edges."""
    total = 0
    for strand in strands:
        total += len(strand)
        refuse_more_than_limit(total, most)
        yield strand


def refuse_more_than_limit(edges: int, most: int = MOST_OF_ENTITY) -> None:
    if edges > most:
        raise DesignError(f"has more than {most} edges; draw the outline with fewer, longer curves")


def polyline(vertices: Sequence[tuple[float, float, float]], closed: bool) -> Strand:
    """Lines and arcs through vertices of x, y and bulge."""
    points = [(x, y) for x, y, _ in vertices]
    ends = [*points[1:], *points[:1]] if closed else points[1:]
    edges: list[Edge] = []
    for start, end, (_, _, bulge) in zip(points, ends, vertices, strict=False):
        if math.dist(start, end) > EPSILON:
            edges += _bulged(start, end, bulge)
    return tuple(edges)


def _bulged(start: Point, end: Point, bulge: float) -> list[Edge]:
    """One edge, or two where the arc turns by more than half a turn."""
    if abs(bulge) <= 1:
        return [edge_from_bulge(start, end, bulge)]
    half = math.tan(math.atan(bulge) / 2)
    # The apex stands off the chord's middle, to the right of an arc that runs counter-clockwise.
    apex = (
        (start[0] + end[0] + bulge * (end[1] - start[1])) / 2,
        (start[1] + end[1] - bulge * (end[0] - start[0])) / 2,
    )
    return [edge_from_bulge(start, apex, half), edge_from_bulge(apex, end, half)]


def reverse(strand: Strand) -> Strand:
    return tuple(edge.reversed() for edge in reversed(strand))


def is_closed(strand: Strand) -> bool:
    return _near(strand[0].start, strand[-1].end)


def joined(strands: Iterable[Strand]) -> tuple[list[Strand], list[Strand]]:
    """Closed loops, and the remaining open strands, after joining ends that meet."""
    whole = [strand for strand in strands if sum(edge.length for edge in strand) > JOIN]
    loops = [strand for strand in whole if is_closed(strand)]
    rest = [strand for strand in whole if not is_closed(strand)]
    opens: list[Strand] = []
    while rest:
        strand = _extended(rest.pop(0), rest)
        if not is_closed(strand):
            strand = _extended(reverse(strand), rest)
        (loops if is_closed(strand) else opens).append(strand)
    return loops, opens


def _extended(strand: Strand, rest: list[Strand]) -> Strand:
    """The strand extended by every continuing strand of ``rest``; these are removed from it."""
    while not is_closed(strand):
        for candidate in rest:
            if _near(strand[-1].end, candidate[0].start):
                follower = candidate
            elif _near(strand[-1].end, candidate[-1].end):
                follower = reverse(candidate)
            else:
                continue
            rest.remove(candidate)
            strand += follower
            break
        else:
            return strand
    return strand


def _near(a: Point, b: Point) -> bool:
    return math.dist(a, b) <= JOIN


def sealed(loop: Strand) -> Strand:
    """The loop with exactly matching ends and no edge shorter than JOIN."""
    edges: list[Edge] = []
    here = loop[-1].end
    for edge in loop:
        if edge.length > 2 * JOIN or not _near(here, edge.end):
            edges.append(_from(here, edge))
            here = edge.end
    if edges:
        edges[0] = _from(here, edges[0])
    return tuple(edges)


def _from(start: Point, edge: Edge) -> Edge:
    if edge.start == start:
        return edge
    if isinstance(edge, Line):
        return Line(start, edge.end)
    return edge_from_bulge(start, edge.end, edge.bulge)


def widest_gap(opens: Sequence[Strand]) -> tuple[float, Point]:
    """The least distance from the first strand's last end to another loose end, and that end."""
    here = opens[0][-1].end
    ends = [opens[0][0].start]
    ends += [end for strand in opens[1:] for end in (strand[0].start, strand[-1].end)]
    return min(math.dist(here, other_end) for other_end in ends), here


# The outline of a pocket.


MM_PER_UNIT = {0: 1.0, 1: 25.4, 4: 1.0, 5: 10.0, 6: 1000.0}
"""Units by $INSUNITS: none (taken as mm), inch, mm, cm, m."""
SCALES = {
    0: "read at 1 mm a unit, for the file names no unit ($INSUNITS)",
    1: "drawn in inches",
    4: "drawn in mm",
    5: "drawn in cm",
    6: "drawn in m",
}
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


def dxf_strands(path: Path, layer: str | None = None, is_plot: bool = False) -> Traced:
    """Every line, arc, circle, polyline, ellipse and spline that the model space shows.

    They must lie in one plane at one height. Only entities on ``layer`` count if it is given;
    otherwise, for a plot, those on plotted layers. Raises DesignError, also for entities that draw
    by other means, such as block references.
    """
    content = path.read_bytes()
    _refuse_excess(content)
    drawing, space = _drawing(path)
    _refuse_compensated(drawing)
    # If a file has no header at all, the reader invents one in metres.
    unit = drawing.header.get("$INSUNITS", 0) if b"$INSUNITS" in content else 0
    if unit not in MM_PER_UNIT:
        raise DesignError(
            f"has $INSUNITS {unit}; save it in millimetres (4), centimetres (5), metres (6) or "
            "inches (1)"
        )
    return Traced(_strands(drawing, space, MM_PER_UNIT[unit], layer, is_plot), SCALES[unit])


def _strands(
    drawing: Drawing, space: Modelspace, factor: float, layer: str | None, is_plot: bool
) -> Iterator[Strand]:
    level: float | None = None
    drawn = [entity for entity in space if entity.dxftype() not in NO_PATHS]
    if layer is not None:
        on_layer = [entity for entity in drawn if _layer_of(entity) == layer]
        if not on_layer:
            raise nothing_on(layer, sorted({_layer_of(entity) for entity in drawn}))
        drawn = on_layer
    elif is_plot:
        drawn = [entity for entity in drawn if _is_plotted(_layer_of(entity), drawing)]
    shown = [entity for entity in drawn if _is_shown(entity, drawing)]
    if drawn and not shown:
        raise DesignError("holds hidden entities only; thaw and switch on the outline's layer")
    for entity in shown:
        kind = entity.dxftype()
        if kind not in READERS:
            raise DesignError(
                f"holds an entity {kind}, which is not read; explode blocks and the like to lines, "
                "arcs and curves, or delete it"
            )
        strand, heights = _read(entity, factor)
        for height in heights:
            level = height if level is None else level
            if not abs(height - level) * factor <= LEVEL:
                raise DesignError(
                    f"holds a {kind} at z {height:g} where another point is at z {level:g}; lay "
                    "the whole outline flat"
                )
        yield strand


def _layer_of(entity: Any) -> str:
    return str(entity.dxf.get("layer", "0")) if entity.dxf.is_supported("layer") else "0"


def _is_plotted(layer: str, drawing: Drawing) -> bool:
    return layer not in drawing.layers or bool(drawing.layers.get(layer).dxf.get("plot", 1))


def _is_shown(entity: Any, drawing: Drawing) -> bool:
    """Return True if a program shows the entity: it is visible, and its layer on and thawed."""
    if not (entity.dxf.is_supported("layer") and entity.dxf.is_supported("invisible")):
        return True  # not an entity, such as a BLOCK: refused by its kind
    name = str(entity.dxf.get("layer", "0"))
    if entity.dxf.get("invisible", 0) or name not in drawing.layers:
        return not entity.dxf.get("invisible", 0)
    layer = drawing.layers.get(name)
    return not (layer.is_off() or layer.is_frozen())


def _refuse_excess(content: bytes) -> None:
    """Raises DesignError for a drawing that would take too long to read."""
    if content.startswith(b"AutoCAD Binary DXF"):
        items = len(re.findall(rb"\0[A-Z]", content))
    else:
        items = sum(line.strip() == b"0" for line in content.splitlines())
    if items > MOST_ITEMS:
        raise DesignError(
            f"has more than {MOST_ITEMS:,} entities and settings; save a drawing of the outline "
            "alone"
        )


def _drawing(path: Path) -> tuple[Drawing, Modelspace]:
    from ezdxf.filemanagement import readfile

    try:
        drawing = readfile(path)
        return drawing, drawing.modelspace()
    except Exception:
        # A damaged file fails anywhere in the parser, with any of the built-in errors.
        raise DesignError("is not a sound DXF file; save it again as DXF R2010") from None


def _refuse_compensated(drawing: Drawing) -> None:
    """Raises DesignError for a cut path: it would be compensated for its kerf once more."""
    properties = dict(drawing.header.custom_vars.properties)
    if properties.get("KERF_STATE") == COMPENSATED:
        raise DesignError(
            f"is a cut file compensated for a kerf of {properties.get('KERF_WIDTH')} mm; give the "
            "outline itself, without kerf"
        )


def _read(entity: Any, factor: float) -> tuple[Strand, list[float]]:
    """The strand of an entity, and the z of every point that defines it, in its own units."""
    strand, heights = READERS[entity.dxftype()]
    try:
        levels = [float(z) for z in heights(entity)]
        return strand(entity, factor), levels
    except (DesignError, FitError):
        raise
    except Exception:
        # As above: missing values of a damaged entity may raise anything.
        raise DesignError(f"holds a damaged {entity.dxftype()}; draw it again") from None


def _polyline_heights(entity: Any) -> list[float]:
    if entity.is_2d_polyline:
        elevation = entity.dxf.get("elevation")
        return [_side(entity) * elevation.z if elevation is not None else 0.0]
    return [vertex.dxf.location.z for vertex in entity.vertices]


def _spline_heights(entity: Any) -> list[float]:
    points = [*entity.control_points, *entity.fit_points]
    return [float(point[2]) for point in points]


def _side(entity: Any) -> float:
    """1, or -1 for an entity drawn on the back of the plane (its x runs the other way)."""
    x, y, z = entity.dxf.extrusion
    if abs(x) > LEVEL or abs(y) > LEVEL or abs(abs(z) - 1) > LEVEL:
        raise DesignError(
            f"holds a {entity.dxftype()} that is tilted out of the xy plane; lay it flat"
        )
    return 1.0 if z > 0 else -1.0


def _line(entity: Any, factor: float) -> Strand:
    start, end = entity.dxf.start, entity.dxf.end
    edge = Line(place(start.x * factor, start.y * factor), place(end.x * factor, end.y * factor))
    return (edge,) if edge.length > EPSILON else ()


def _arc(entity: Any, factor: float) -> Strand:
    first = math.radians(entity.dxf.get("start_angle", 0.0))
    last = math.radians(entity.dxf.get("end_angle", 360.0))
    place(first, last)
    turn = (last - first) % math.tau or math.tau
    return _turn(entity, factor, first, first + turn)


def _circle(entity: Any, factor: float) -> Strand:
    return _turn(entity, factor, 0.0, math.tau)


def _turn(entity: Any, factor: float, first: float, last: float) -> Strand:
    side, radius = _side(entity), entity.dxf.radius * factor
    place(radius, 0.0)
    if radius <= 0:
        raise DesignError(f"holds a {entity.dxftype()} of radius {radius:g}; delete it")
    centre = place(side * entity.dxf.center.x * factor, entity.dxf.center.y * factor)
    return elliptical_arc(centre, (side * radius, 0.0), (0.0, radius), first, last)


def _light_polyline(entity: Any, factor: float) -> Strand:
    return _through(entity.get_points("xyb"), _side(entity), factor, entity.closed)


def _heavy_polyline(entity: Any, factor: float) -> Strand:
    if not (entity.is_2d_polyline or entity.is_3d_polyline):
        raise DesignError("holds a POLYLINE that is a mesh; draw the outline alone")
    # Flag 16 marks the frame points of a curve-fitted polyline, which it does not pass through.
    points = [
        (vertex.dxf.location.x, vertex.dxf.location.y, vertex.dxf.get("bulge", 0.0))
        for vertex in entity.vertices
        if not vertex.dxf.flags & 16
    ]
    side = _side(entity) if entity.is_2d_polyline else 1.0
    return _through(points, side, factor, entity.is_closed)


def _through(points: Any, side: float, factor: float, closed: bool) -> Strand:
    vertices = []
    for x, y, bulge in (map(float, point) for point in points):
        place(bulge, 0.0)
        vertices.append((*place(side * x * factor, y * factor), side * bulge))
    refuse_more_than_limit(len(vertices))
    return polyline(vertices, closed)


def _ellipse(entity: Any, factor: float) -> Strand:
    _side(entity)
    tool = entity.construction_tool()
    place(tool.start_param, tool.end_param)
    first = tool.start_param
    turn = (tool.end_param - first) % math.tau or math.tau
    centre, major, minor = (
        place(v.x * factor, v.y * factor) for v in (tool.center, tool.major_axis, tool.minor_axis)
    )
    if min(math.hypot(*major), math.hypot(*minor)) == 0:
        raise DesignError("holds an ELLIPSE without width; delete it")
    return elliptical_arc(centre, major, minor, first, first + turn)


def _spline(entity: Any, factor: float) -> Strand:
    refuse_more_than_limit(max(len(entity.control_points), len(entity.fit_points)))
    if entity.dxf.degree > HIGHEST_DEGREE:
        raise DesignError(
            f"holds a SPLINE of degree {entity.dxf.degree}, where at most {HIGHEST_DEGREE} is "
            "allowed; draw it with degree 3"
        )
    tool: BSpline = entity.construction_tool()
    for point in tool.control_points:
        place(point.x * factor, point.y * factor)

    evaluator = tool.evaluator

    def curve(t: float) -> tuple[Point, Point]:
        at, rate = evaluator.derivative(t, 1)
        return (at.x * factor, at.y * factor), (rate.x * factor, rate.y * factor)

    knots = list(tool.knots())
    first, last = knots[tool.degree], knots[tool.count]
    # A knot repeated as often as the degree lets the curve turn a corner there.
    corners = sorted(
        {knot for knot in knots if first < knot < last and knots.count(knot) >= tool.degree}
    )
    stops = [first, *corners, last]
    edges: list[Edge] = []
    for a, b in pairwise(stops):
        edges += fit_arcs(curve, a, b)
        refuse_more_than_limit(len(edges))
    return tuple(edges)


READERS: Mapping[str, tuple[Callable[[Any, float], Strand], Callable[[Any], list[float]]]] = {
    "LINE": (_line, lambda e: [e.dxf.start.z, e.dxf.end.z]),
    "ARC": (_arc, lambda e: [_side(e) * e.dxf.center.z]),
    "CIRCLE": (_circle, lambda e: [_side(e) * e.dxf.center.z]),
    "LWPOLYLINE": (_light_polyline, lambda e: [_side(e) * e.dxf.get("elevation", 0.0)]),
    "POLYLINE": (_heavy_polyline, _polyline_heights),
    # Both are in world coordinates; an axis that rises means a tilted ellipse.
    "ELLIPSE": (_ellipse, lambda e: [e.dxf.center.z, e.dxf.center.z + e.dxf.major_axis.z]),
    "SPLINE": (_spline, _spline_heights),
}
"""Strand of an entity, and heights of its points, by its type."""
