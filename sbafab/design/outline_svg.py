"""The strands of an SVG drawing, in mm and with y upward.

What SVG 2 defines and programs agree on is read; an element or property that they read differently
is refused by its name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from sbafab.design.strands import MOST_EDGES, Strand, Traced, place, refuse_more_than_limit
from sbafab.design.svg_lengths import WHITE, Page, numbers, page_of, with_physical_lengths
from sbafab.design.svg_shapes import SHAPES, Sized, path_of, sized
from sbafab.design.svg_style import (
    is_displayed,
    is_visible,
    local,
    refuse_effects,
    refuse_style_sheet,
)
from sbafab.errors import DesignError
from sbafab.geometry.biarc import bezier, elliptical_arc, fit_arcs
from sbafab.geometry.edges import EPSILON, Edge, Line, Point

MOST_ELEMENTS = 2000
LONGEST_TRANSFORM = 10_000
NAMESPACES = ("{http://www.w3.org/2000/svg}", "")
GROUPS = frozenset({"a", "g"})
UNDRAWN = frozenset(
    {
        *("clipPath", "cursor", "defs", "desc", "filter", "font", "font-face", "hatch"),
        *("linearGradient", "marker", "mask", "meshgradient", "metadata", "pattern"),
        *("radialGradient", "solidcolor", "style", "symbol", "title", "view"),
    }
)
"""Never drawn where they stand, whatever they hold."""
NO_PATHS = frozenset({"foreignObject", "image", "text"})
"""Drawn, but no outline: lettering and pictures beside it, as in a DXF."""
CHANGING = frozenset({"animate", "animateMotion", "animateTransform", "script", "set", "link"})
REMEDIES = {
    "use": "holds a clone (use); unlink it, so that the path itself is there",
    "svg": "holds an svg in the svg; move what is in it to the outer one",
    "switch": "holds a switch; ungroup it and keep the outline alone",
}
Matrix = tuple[float, float, float, float, float, float]
"""a to f, as SVG's matrix() has them."""
UNIT: Matrix = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
TRANSFORMS = {
    "matrix": (6,),
    "rotate": (1, 3),
    "scale": (1, 2),
    "skewX": (1,),
    "skewY": (1,),
    "translate": (1, 2),
}
"""By name, how many numbers each may take."""
_TRANSFORM = re.compile(r"\s*(?:,\s*)?([A-Za-z]+)\s*\(([^()]*)\)\s*", re.ASCII)
MARK = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[A-Za-z]")
"""What a path is written with: numbers, and letters for its commands."""


class DrawnShape(NamedTuple):
    """A shape and what takes it to the drawing's user units."""

    shape: Sized
    matrix: Matrix


def svg_strands(path: Path) -> Traced:
    """Every path and basic shape that is drawn, transforms applied. Raises DesignError.

    The origin is that of the user coordinates, wherever the viewBox begins. A page without a size
    in mm, cm or the like is read as 1 unit = 1 mm, unless lengths in it have such a unit: then 96
    units are an inch, as SVG says.
    """
    root = _root(path)
    drawn = list(_drawn(root))
    page = page_of(root)
    if any(shape.is_physical for shape, _ in drawn):
        page = with_physical_lengths(page)
    if not drawn:
        _refuse_undrawn(root)
    return Traced(_strands(drawn, page), page.said)


def _strands(drawn: list[DrawnShape], page: Page) -> Iterator[Strand]:
    from svgelements import Path as PathData

    for shape, matrix in drawn:
        text = path_of(shape, page)
        try:
            segments = list(PathData(text))
        except Exception as error:
            # Numbers out of all bounds fail anywhere in the library, with any built-in error.
            raise DesignError(
                f"holds a <{shape.name}> that cannot be read ({type(error).__name__}); "
                "draw it again"
            ) from None
        yield from _subpaths(segments, _placement(matrix, page.across, -page.down))


def _root(path: Path) -> ElementTree.Element:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise DesignError("is not text in UTF-8; save it as plain SVG") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DesignError("declares a DOCTYPE or entities; save it as plain SVG without them")
    if "<?xml-stylesheet" in text:
        raise DesignError("refers to a style sheet of another file; save it as plain SVG")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise DesignError(f"is not valid SVG ({error}); save it as plain SVG") from None
    if root.tag not in {f"{space}svg" for space in NAMESPACES}:
        raise DesignError("is not an SVG drawing; its outermost element is not svg")
    _refuse_excess(root)
    return root


def _refuse_excess(root: ElementTree.Element) -> None:
    """Raises DesignError for a drawing that would take long to read, or that changes itself."""
    count = 0
    for elements, element in enumerate(root.iter(), start=1):
        if elements > MOST_ELEMENTS:
            raise DesignError(
                f"has more than {MOST_ELEMENTS} elements; save a drawing of the outline alone"
            )
        name = local(element)
        if name in CHANGING:
            raise DesignError(f"holds <{name}>, which may change what is drawn; remove it")
        if name == "style":
            refuse_style_sheet("{" + "".join(element.itertext()))
        for key in ("d", "points"):
            count += len(MARK.findall(element.get(key, "")))
    # A letter and seven numbers make the longest segment, an arc.
    if count > 8 * MOST_EDGES:
        refuse_more_than_limit(count)


def _drawn(root: ElementTree.Element) -> Iterator[DrawnShape]:
    """The shapes that are drawn, in their order."""
    if "transform" in root.attrib:
        raise DesignError("has a transform on svg, which programs read differently; put it on a g")
    space = root.tag.removesuffix("svg")
    # Outermost last, so that the next one to look at is the last of the list.
    waiting = [(root, UNIT, True)]
    while waiting:
        element, outer, shown = waiting.pop()
        name = local(element)
        if element.tag != space + name or name in UNDRAWN | NO_PATHS or not is_displayed(element):
            continue
        is_group = name in GROUPS or element is root
        if name in REMEDIES and not is_group:
            raise DesignError(REMEDIES[name])
        if not is_group and name not in SHAPES:
            raise DesignError(f"holds <{name}>, which is not read; remove it, or draw it as a path")
        refuse_effects(element)
        shown = is_visible(element, shown)
        matrix = _product(outer, _transform(element.get("transform", "")))
        if is_group:
            waiting += [(inner, matrix, shown) for inner in reversed(element)]
        elif shown:
            yield DrawnShape(sized(element), matrix)


def _refuse_undrawn(root: ElementTree.Element) -> None:
    """Raises DesignError for a drawing whose shapes all stand where nothing is drawn."""
    for element in root.iter():
        if local(element) in UNDRAWN and any(local(inner) in SHAPES for inner in element.iter()):
            name = local(element)
            raise DesignError(f"holds paths in <{name}> only, which is not drawn; move them out")
    if any(local(element) in SHAPES for element in root.iter()):
        raise DesignError("holds hidden paths only; show the outline")


def _transform(text: str) -> Matrix:
    """The matrix of a transform attribute. Raises DesignError where it is damaged."""
    if text.strip(WHITE) in ("", "none"):
        return UNIT
    if len(text) > LONGEST_TRANSFORM:
        raise DesignError("has a very long transform; apply it to the path")
    from svgelements import Matrix as ReadMatrix

    matrix, end = UNIT, 0
    while end < len(text):
        match = _TRANSFORM.match(text, end)
        try:
            values = list(numbers(match[2])) if match else []
        except ValueError:
            values = []
        if match is None or len(values) not in TRANSFORMS.get(match[1], ()):
            raise DesignError(
                f'has a transform that is damaged at "{text[end : end + 20]}"; apply it to the path'
            )
        one = ReadMatrix(f"{match[1]}({' '.join(values)})")
        matrix = _product(matrix, (one.a, one.b, one.c, one.d, one.e, one.f))
        end = match.end()
    return matrix


def _product(outer: Matrix, inner: Matrix) -> Matrix:
    """What takes a point by ``inner`` and then by ``outer``."""
    a, b, c, d, e, f = outer
    x, y, z, w, u, v = inner
    return (
        *(a * x + c * y, b * x + d * y),
        *(a * z + c * w, b * z + d * w),
        *(a * u + c * v + e, b * u + d * v + f),
    )


ToUserUnits = Callable[[Any], Point]


def _placement(matrix: Matrix, across: float, up: float) -> ToUserUnits:
    """Takes a point of a shape to mm: by the shape's own transform, then by the drawing's scale."""
    a, b, c, d, e, f = matrix

    def point(p: Any) -> Point:
        return place(across * (a * p.x + c * p.y + e), up * (b * p.x + d * p.y + f))

    return point


def _subpaths(segments: list[Any], point: ToUserUnits) -> Iterator[Strand]:
    """One strand from every move to the next, or to where the path is closed."""
    edges: list[Edge] = []
    for segment in segments:
        kind = type(segment).__name__
        if kind != "Move":
            edges += _edges(segment, point)
            refuse_more_than_limit(len(edges))
        if kind in ("Move", "Close"):
            if edges:
                yield tuple(edges)
            edges = []
    if edges:
        yield tuple(edges)


def _edges(segment: Any, point: ToUserUnits) -> tuple[Edge, ...]:
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
