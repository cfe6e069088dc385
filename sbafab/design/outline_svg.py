"""The strands of an SVG drawing, in mm and with y upward."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from sbafab.design.strands import MOST_EDGES, Strand, place, refuse_more_than_limit
from sbafab.errors import DesignError
from sbafab.geometry.biarc import bezier, elliptical_arc, fit_arcs
from sbafab.geometry.edges import EPSILON, Edge, Line, Point

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6, "q": 0.25}
MM_PER_PIXEL = 25.4 / 96
MOST_ELEMENTS = 2000
LONGEST_STYLE = 10_000
Placement = Callable[[Any], Point]
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
MARK = re.compile(rf"{NUMBER.pattern}|[A-Za-z]")
"""What a path is written with: numbers, and letters for its commands."""


def svg_strands(path: Path) -> Iterator[Strand]:
    """Every path and basic shape that is drawn, transforms applied. Raises DesignError.

    The origin is that of the user coordinates, wherever the viewBox begins. A drawing whose width
    and height carry no physical unit (none, px or %) is read as 1 unit = 1 mm.
    """
    from svgelements import SVG, Shape

    root = _root(path)
    across, down = _scales(root)
    for name in ("width", "height", "viewBox"):
        root.attrib.pop(name, None)
    try:
        text = ElementTree.tostring(root, encoding="unicode")
        drawing = SVG.parse(io.StringIO(text), reify=False, ppi=96.0)
        shapes = [element for element in drawing.elements() if isinstance(element, Shape)]
        drawn = [(shape.transform, list(shape.segments(transformed=False))) for shape in shapes]
    except Exception as error:
        # A damaged attribute fails anywhere in the parser, with any of the built-in errors.
        raise DesignError(
            f"holds a shape that cannot be read ({type(error).__name__}); save it as plain SVG"
        ) from None
    for matrix, segments in drawn:
        yield from _subpaths(segments, _placement(matrix, across, -down))


def _root(path: Path) -> ElementTree.Element:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise DesignError("is not text in UTF-8; save it as plain SVG") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DesignError("declares a DOCTYPE or entities; save it as plain SVG without them")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise DesignError(f"is not valid SVG ({error}); save it as plain SVG") from None
    if root.tag.rpartition("}")[2] != "svg":
        raise DesignError("is not an SVG drawing; its outermost element is not svg")
    _refuse_excess(root)
    return root


def _refuse_excess(root: ElementTree.Element) -> None:
    """Raises DesignError for a drawing that would take long to read."""
    elements = numbers = 0
    for element in root.iter():
        elements += 1
        if str(element.tag).rpartition("}")[2] == "use":
            raise DesignError("holds a clone (use); unlink it, so that the path itself is there")
        if (
            str(element.tag).rpartition("}")[2] == "style"
            and len(element.text or "") > LONGEST_STYLE
        ):
            raise DesignError("holds a long style sheet; save it as plain SVG")
        for name in ("d", "points"):
            numbers += len(MARK.findall(element.get(name, "")))
    if elements > MOST_ELEMENTS:
        raise DesignError(
            f"has more than {MOST_ELEMENTS} elements; save a drawing of the outline alone"
        )
    # A letter and seven numbers make the longest segment, an arc.
    if numbers > 8 * MOST_EDGES:
        refuse_more_than_limit(numbers)


def _scales(root: ElementTree.Element) -> tuple[float, float]:
    """Millimetres a user unit, across and down."""
    sizes = [_physical(root.get(name, "")) for name in ("width", "height")]
    if sizes == [None, None]:
        return 1.0, 1.0
    view = [float(number) for number in NUMBER.findall(root.get("viewBox", ""))]
    if not view:
        return MM_PER_PIXEL, MM_PER_PIXEL
    if len(view) != 4 or not (0 < view[2] < 1e9 and 0 < view[3] < 1e9):
        raise DesignError("has a viewBox that is not four numbers with a positive size")
    scales = [size / span for size, span in zip(sizes, view[2:], strict=True) if size]
    if root.get("preserveAspectRatio", "").startswith("none") and len(scales) == 2:
        return scales[0], scales[1]
    return min(scales), min(scales)


def _physical(text: str) -> float | None:
    """A width or height in mm, None where it has no physical unit."""
    match = re.fullmatch(rf"\s*({NUMBER.pattern})\s*([a-zA-Z]+)\s*", text)
    if match is None or match[2].lower() not in MM_PER_UNIT:
        return None
    size = float(match[1]) * MM_PER_UNIT[match[2].lower()]
    if not 0 < size < 1e9:
        raise DesignError(f"has a width or height of {text.strip()}; it must be positive")
    return size


def _placement(matrix: Any, across: float, up: float) -> Placement:
    """Takes a point of a shape to mm: by the shape's own transform, then by the drawing's scale."""

    def point(p: Any) -> Point:
        x = matrix.a * p.x + matrix.c * p.y + matrix.e
        y = matrix.b * p.x + matrix.d * p.y + matrix.f
        return place(across * x, up * y)

    return point


def _subpaths(segments: list[Any], point: Placement) -> Iterator[Strand]:
    """One strand from every move to the next."""
    edges: list[Edge] = []
    for segment in segments:
        if type(segment).__name__ == "Move":
            if edges:
                yield tuple(edges)
            edges = []
        else:
            edges += _edges(segment, point)
            refuse_more_than_limit(len(edges))
    if edges:
        yield tuple(edges)


def _edges(segment: Any, point: Placement) -> tuple[Edge, ...]:
    kind = type(segment).__name__
    if segment.start is None or segment.end is None:
        return ()
    start, end = point(segment.start), point(segment.end)
    if kind == "Arc":
        centre = point(segment.center)
        major, minor = (
            (p[0] - centre[0], p[1] - centre[1]) for p in (point(segment.prx), point(segment.pry))
        )
        first = segment.get_start_t()
        return elliptical_arc(centre, major, minor, first, first + segment.sweep)
    if kind in ("QuadraticBezier", "CubicBezier"):
        names = ("control",) if kind == "QuadraticBezier" else ("control1", "control2")
        inner = [point(getattr(segment, name)) for name in names]
        if all(p == start for p in (*inner, end)):
            return ()
        return fit_arcs(bezier([start, *inner, end]), 0.0, 1.0)
    return (Line(start, end),) if math.dist(start, end) > EPSILON else ()
