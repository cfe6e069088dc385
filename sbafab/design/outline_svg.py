"""The strands of a plain SVG drawing, in mm and with y upward.

Paths and basic shapes are read, in groups, with their transforms. Elements, attributes and styles
that do not change a shape are listed here; a drawing with any other is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from sbafab.design.strands import (
    Strand,
    Traced,
    nothing_on,
    place,
    refuse_more_than_limit,
)
from sbafab.errors import DesignError
from sbafab.geometry.arcs import bezier, elliptical_arc, fit_arcs
from sbafab.geometry.edges import EPSILON, Edge, Line, Point

PLAIN = (
    "save it as plain SVG: paths and basic shapes in groups, numbers without units, clones "
    "unlinked, clips and effects released"
)
MOST_ELEMENTS = 2000
WHITE = " \t\r\n"
"""Exactly the characters that are space in SVG."""
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER = re.compile(NUMBER, re.ASCII)
_FLAG = re.compile(r"[01]")
_BETWEEN = re.compile(r"\s*(?:,\s*)?", re.ASCII)


def svg_strands(path: Path, layer: str | None = None) -> Traced:
    """Return every path and basic shape that is drawn, transforms applied. Raises DesignError.

    Only shapes in the group with the label or id ``layer`` count if it is given.

    The origin is the origin of the user coordinates, wherever the viewBox begins. A page without a
    size in mm, cm or the like is read as 1 unit = 1 mm.
    """
    root = _root(path)
    if layer is not None:
        _keep_layer(root, layer)
    page = page_of(root)
    return Traced(_strands(list(_drawn(root)), page.scale), page.description)


def _strands(drawn: list[DrawnShape], scale: float) -> Iterator[Strand]:
    from svgelements import Path as PathData

    for element, matrix in drawn:
        text = path_data(element)
        try:
            segments = list(PathData(text))
        except Exception:
            # Extremely large numbers fail anywhere in the library, with any built-in error.
            raise DesignError(
                f"holds a <{local(element)}> that cannot be read; draw it again"
            ) from None
        yield from _subpaths(segments, _placement(matrix, scale))


def _numbers(text: str, are_arcs: bool = False) -> Iterator[str]:
    """Yield the numbers of a list separated by spaces or commas.

    ``are_arcs``: in each group of seven the fourth and fifth are flags, which need no separator.
    Raises ValueError, with the text from there on, for anything else.
    """
    at, count = len(text) - len(text.lstrip(WHITE)), 0
    while at < len(text):
        is_flag = are_arcs and count % 7 in (3, 4)
        match = (_FLAG if is_flag else _NUMBER).match(text, at)
        if match is None:
            raise ValueError(text[at : at + 20])
        yield match[0] if is_flag else repr(float(match[0]))
        count += 1
        between = _BETWEEN.match(text, match.end())
        at = between.end() if between else match.end()
        if at == len(text) and text.rstrip(WHITE).endswith(","):
            raise ValueError(",")


# The page: what a user unit is in mm (SVG 2, sections 7 and 8).


MM_PER_PIXEL = 25.4 / 96
PER_PIXEL = {"mm": 96 / 25.4, "cm": 96 / 2.54, "in": 96.0, "pt": 96 / 72, "pc": 16.0}
"""User units per physical unit, as in CSS: 96 per inch."""
FARTHEST_PAGE = 1e9
_PAGE_SIZE = re.compile(rf"({NUMBER})(mm|cm|in|pt|pc|px|%|)", re.ASCII)
_FIT = re.compile(r"x(?:Min|Mid|Max)Y(?:Min|Mid|Max)(?:\s+meet)?", re.ASCII)


class Page(NamedTuple):
    """``scale``: mm per user unit; ``physical``: the page has a size in mm, cm or the like."""

    scale: float
    physical: bool

    @property
    def description(self) -> str:
        """Size of a unit as text."""
        if not self.physical:
            return "read at 1 mm a unit, for the page has no size in mm"
        inch = ", 96 units an inch" if self.scale == MM_PER_PIXEL else ""
        return f"read at {self.scale:.6g} mm a unit{inch}"


def page_of(root: ElementTree.Element) -> Page:
    """Return the page by width, height and viewBox. Raises DesignError."""
    if not _FIT.fullmatch(root.get("preserveAspectRatio", "xMidYMid").strip(WHITE)):
        raise DesignError("has a preserveAspectRatio that stretches or crops it; remove that")
    sizes = {key: _page_size(root, key) for key in ("width", "height")}
    view = _view(root)
    units = {unit for _, unit in sizes.values()}
    if not units & set(PER_PIXEL):
        return Page(1.0, physical=False)
    if "%" in units:
        raise DesignError("gives only one of width and height in mm; give both")
    if view is None:
        return Page(MM_PER_PIXEL, physical=True)
    ratios = [
        pixels / span
        for (pixels, _), span in zip(sizes.values(), view, strict=True)
        if pixels is not None
    ]
    return Page(min(ratios) * MM_PER_PIXEL, physical=True)


def _page_size(root: ElementTree.Element, key: str) -> tuple[float | None, str]:
    """Return a page's size in user units, None if it is missing or a percentage, and its unit."""
    text = root.get(key, "").strip(WHITE)
    if text in ("", "auto"):
        return None, ""
    match = _PAGE_SIZE.fullmatch(text)
    if match is None:
        raise DesignError(
            f'has a {key} of "{text[:40]}"; write a number, alone or with mm, cm, in, pt, pc or px'
        )
    size = float(match[1]) * PER_PIXEL.get(match[2], 1.0)
    if not 0 < size < FARTHEST_PAGE:
        raise DesignError("has a width or height that is not positive; give the page's size")
    return (None if match[2] == "%" else size), match[2]


def _view(root: ElementTree.Element) -> tuple[float, float] | None:
    text = root.get("viewBox")
    if text is None:
        return None
    try:
        _, _, width, height = map(float, _numbers(text))
    except ValueError:
        width = height = 0.0
    if not (0 < width < FARTHEST_PAGE and 0 < height < FARTHEST_PAGE):
        raise DesignError("has a viewBox that is not four numbers with a positive size")
    return width, height


# The tree: the drawn elements, and those refused because they might change them.


NAMESPACES = ("{http://www.w3.org/2000/svg}", "")
GROUPS = frozenset({"a", "g"})
UNDRAWN = frozenset(
    {
        *("clipPath", "cursor", "defs", "desc", "filter", "font", "font-face", "hatch"),
        *("linearGradient", "marker", "mask", "meshgradient", "metadata", "pattern"),
        *("radialGradient", "solidcolor", "style", "symbol", "title", "view"),
    }
)
"""Never drawn in place, whatever they contain."""
NO_PATHS = frozenset({"foreignObject", "image", "text"})
"""Drawn, but no outline: lettering and pictures beside it, as in a DXF."""
CHANGING = frozenset({"animate", "animateMotion", "animateTransform", "script", "set", "link"})
"""Elements that change others, wherever they are."""
SHAPES = {
    "circle": ("cx", "cy", "r"),
    "ellipse": ("cx", "cy", "rx", "ry"),
    "line": ("x1", "y1", "x2", "y2"),
    "path": ("d",),
    "polygon": ("points",),
    "polyline": ("points",),
    "rect": ("x", "y", "width", "height", "rx", "ry"),
}
"""The attributes that define a shape."""
ATTRIBUTES = {
    "svg": {"x", "y", "width", "height", "viewBox", "preserveAspectRatio", "version", "baseProfile"}
    | {"contentScriptType", "contentStyleType", "zoomAndPan"},
    "g": {"transform"},
    "a": {"transform", "href", "target"},
    **{name: {"transform", "pathLength", *keys} for name, keys in SHAPES.items()},
}
"""Attributes that are read, or have no effect."""
_NAMES = re.compile(r"id|class|style|lang|role|tabindex|(?:data|aria)-.*")
_PAINT = re.compile(
    r"(?:-inkscape|background|fill|stroke|marker|stop|solid|flood|lighting|color|opacity|font|text|letter|word"
    r"|line)(?:-.*)?|(?:paint|shape|image|clip|glyph|unicode|writing|white|block|baseline|dominant"
    r"|alignment|enable|mix|pointer)-(?:order|rendering|rule|orientation.*|bidi|mode|space"
    r"|progression|shift|baseline|background|blend-mode|events)"
    r"|isolation|overflow|kerning|direction|cursor"
)
"""Properties of paint and lettering."""
VALUES = {
    "clip": ("auto",),
    "clip-path": ("none",),
    "display": ("inline", "block"),
    "filter": ("none",),
    "mask": ("none",),
    "vector-effect": ("none", "non-scaling-stroke"),
    "visibility": ("visible", "inherit"),
}
"""Properties that change the drawing, and the supported values."""
_DECLARATION = re.compile(r"[{;]\s*([^\s{};:]+)\s*:")
LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
"""The name of a layer or group as shown by Inkscape."""
Matrix = tuple[float, float, float, float, float, float]
"""a to f, as SVG's matrix() has them."""
UNIT: Matrix = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)


class DrawnShape(NamedTuple):
    """A shape and its transform to the drawing's user units."""

    element: ElementTree.Element
    matrix: Matrix


def local(element: ElementTree.Element) -> str:
    """Return an element's name without its namespace."""
    return str(element.tag).rpartition("}")[2]


def _root(path: Path) -> ElementTree.Element:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise DesignError("is not text in UTF-8; save it as plain SVG") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DesignError("declares a DOCTYPE or entities; save it as plain SVG without them")
    if "<?xml-stylesheet" in text:
        raise DesignError(f"refers to a style sheet of another file; {PLAIN}")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise DesignError(f"is not valid SVG ({error}); save it as plain SVG") from None
    if root.tag not in {f"{space}svg" for space in NAMESPACES}:
        raise DesignError("is not an SVG drawing; its outermost element is not svg")
    for count, element in enumerate(root.iter(), start=1):
        if count > MOST_ELEMENTS:
            raise DesignError(
                f"has more than {MOST_ELEMENTS} elements; save a drawing of the outline alone"
            )
        if local(element) in CHANGING:
            raise DesignError(f"holds <{local(element)}>; {PLAIN}")
        if local(element) == "style":
            _refuse_sheet("{" + "".join(element.itertext()))
    return root


def _refuse_sheet(text: str) -> None:
    """Raise DesignError for a style sheet that sets more than paint, wherever it applies."""
    others = [name for name in _DECLARATION.findall(text) if not _PAINT.fullmatch(name)]
    if "@" in text or "\\" in text or "/*" in text or others:
        what = others[0] if others else "imports, escapes or comments"
        raise DesignError(f"has {what[:40]} in a style sheet; {PLAIN}")


def _drawn(root: ElementTree.Element) -> Iterator[DrawnShape]:
    """Yield the drawn shapes, in order."""
    space = root.tag.removesuffix("svg")
    # Outermost last, so that the next one is the last of the list.
    waiting = [(root, UNIT)]
    while waiting:
        element, outer = waiting.pop()
        name = local(element)
        if element.tag != space + name or name in UNDRAWN | NO_PATHS:
            continue
        if name not in ATTRIBUTES or (name == "svg" and element is not root):
            raise DesignError(f"holds <{name}>; {PLAIN}")
        if not _is_displayed(element):
            continue
        matrix = _product(outer, _transform(element.get("transform", "")))
        if name in SHAPES:
            yield DrawnShape(element, matrix)
        else:
            waiting += [(inner, matrix) for inner in reversed(element)]


def _is_displayed(element: ElementTree.Element) -> bool:
    """Return True if the element is drawn. Raises DesignError for anything that may change that."""
    name = local(element)
    own = {key: value for key, value in element.attrib.items() if not key.startswith("{")}
    style = own.get("style", "").split(";")
    parts = [part.partition(":") for part in style if part.strip(WHITE)]
    styles = {key.strip(WHITE): value.strip(WHITE) for key, _, value in parts}
    attributes = {
        key: value.strip(WHITE)
        for key, value in own.items()
        if key not in ATTRIBUTES[name] and not _NAMES.fullmatch(key)
    }
    if {**attributes, **styles}.get("display") == "none":
        return False
    for key, value in (*attributes.items(), *styles.items()):
        if not _PAINT.fullmatch(key) and value not in VALUES.get(key, ()):
            raise DesignError(f'has {key[:40]} "{value[:40]}" on <{name}>; {PLAIN}')
    return True


def _keep_layer(root: ElementTree.Element, layer: str) -> None:
    """Remove everything except one layer, and the groups that contain it, from a drawing."""
    groups = [element for element in root.iter() if local(element) in GROUPS]
    named = [group for group in groups if layer in (group.get(LABEL), group.get("id"))]
    if not named:
        others = sorted({name for group in groups if (name := group.get(LABEL) or group.get("id"))})
        raise nothing_on(layer, others)
    holder_of = {child: element for element in root.iter() for child in element}
    holders = set()
    for group in named:
        inner = group
        while (holder := holder_of.get(inner)) is not None:
            holders.add(holder)
            inner = holder
    for holder in holders.difference(named):
        for child in list(holder):
            if child not in holders and child not in named:
                holder.remove(child)


LONGEST_TRANSFORM = 10_000
TRANSFORMS = {
    "matrix": (6,),
    "rotate": (1, 3),
    "scale": (1, 2),
    "skewX": (1,),
    "skewY": (1,),
    "translate": (1, 2),
}
"""Allowed counts of numbers, by name."""
_TRANSFORM = re.compile(r"\s*(?:,\s*)?([A-Za-z]+)\s*\(([^()]*)\)\s*", re.ASCII)


def _transform(text: str) -> Matrix:
    """Return the matrix of a transform attribute. Raises DesignError if it is damaged."""
    if text.strip(WHITE) in ("", "none"):
        return UNIT
    if len(text) > LONGEST_TRANSFORM:
        raise DesignError("has a very long transform; apply it to the path")
    from svgelements import Matrix as ReadMatrix

    matrix, end = UNIT, 0
    while end < len(text):
        match = _TRANSFORM.match(text, end)
        try:
            values = list(_numbers(match[2])) if match else []
        except ValueError:
            values = []
        if match is None or len(values) not in TRANSFORMS.get(match[1], ()):
            raise DesignError(
                f'has a transform that is damaged at "{text[end : end + 20]}"; apply it to the path'
            )
        step = ReadMatrix(f"{match[1]}({' '.join(values)})")
        matrix = _product(matrix, (step.a, step.b, step.c, step.d, step.e, step.f))
        end = match.end()
    return matrix


def _product(outer: Matrix, inner: Matrix) -> Matrix:
    """Return the matrix that applies ``inner`` and then ``outer``."""
    a, b, c, d, e, f = outer
    x, y, z, w, u, v = inner
    return (
        *(a * x + c * y, b * x + d * y),
        *(a * z + c * w, b * z + d * w),
        *(a * u + c * v + e, b * u + d * v + f),
    )


# Basic shapes of SVG as the paths that they stand for (SVG 2, sections 9 and 10).


SIZES = frozenset({"height", "r", "rx", "ry", "width"})
TAKES = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
"""Numbers per repetition of a path command."""
UNLIKE = frozenset({"CT", "ST", "QS", "TS"})
"""Smooth curves after curves of the other degree: these begin without a tangent to continue. The
library would mirror one; a line of zero length between them prevents it."""
_COMMANDS = re.compile(r"([MmLlHhVvCcSsQqTtAaZz])")


def path_data(element: ElementTree.Element) -> str:
    """Return the path data of a shape, in user units; empty if nothing is drawn.

    Raises DesignError for a damaged shape, and for lengths with units.
    """
    name = local(element)
    if name == "path":
        return " ".join(_commands(element.get("d", "")))
    if name in ("polyline", "polygon"):
        return _corners(element.get("points", ""), name)
    value = {key: _length(element, key) for key in SHAPES[name]}
    number = {key: quantity or 0.0 for key, quantity in value.items()}
    if name == "line":
        return "M {x1!r} {y1!r} L {x2!r} {y2!r}".format_map(number)
    if name == "circle":
        return _ellipse(number["cx"], number["cy"], number["r"], number["r"])
    if name == "ellipse":
        if (value["rx"] is None) != (value["ry"] is None):
            raise DesignError("has <ellipse> with only one of rx and ry; give both")
        return _ellipse(*number.values())
    # A missing radius equals the other one.
    rx, ry = (value["rx"], value["ry"]) if value["rx"] is not None else (value["ry"],) * 2
    return _rect(number, rx or 0.0, rx or 0.0 if ry is None else ry)


def _length(element: ElementTree.Element, key: str) -> float | None:
    text = element.get(key, "").strip(WHITE).removesuffix("px")
    if text == "":
        return None
    match = _NUMBER.fullmatch(text)
    if match is None or not math.isfinite(float(text)):
        raise DesignError(f'has {key} "{text[:40]}" on <{local(element)}>, no coordinate; {PLAIN}')
    if key in SIZES and float(text) < 0:
        raise DesignError(f"has <{local(element)}> with {key} {text}, which is negative")
    return float(text)


def _ellipse(cx: float, cy: float, rx: float, ry: float) -> str:
    if rx == 0 or ry == 0:
        return ""
    stops = ((cx, cy + ry), (cx - rx, cy), (cx, cy - ry), (cx + rx, cy))
    arcs = (f"A {rx!r} {ry!r} 0 0 1 {x!r} {y!r}" for x, y in stops)
    return f"M {cx + rx!r} {cy!r} {' '.join(arcs)} Z"


def _rect(number: dict[str, float], rx: float, ry: float) -> str:
    x, y, width, height = (number[key] for key in ("x", "y", "width", "height"))
    if width == 0 or height == 0:
        return ""
    rx, ry = min(rx, width / 2), min(ry, height / 2)
    right, bottom = x + width, y + height
    if rx == 0 or ry == 0:
        return f"M {x!r} {y!r} H {right!r} V {bottom!r} H {x!r} Z"
    turn = f"A {rx!r} {ry!r} 0 0 1"
    return (
        f"M {x + rx!r} {y!r} H {right - rx!r} {turn} {right!r} {y + ry!r} "
        f"V {bottom - ry!r} {turn} {right - rx!r} {bottom!r} "
        f"H {x + rx!r} {turn} {x!r} {bottom - ry!r} V {y + ry!r} {turn} {x + rx!r} {y!r} Z"
    )


def _corners(text: str, name: str) -> str:
    try:
        coordinates = list(_numbers(text))
    except ValueError as error:
        raise DesignError(
            f'has <{name}> with points that stop at "{error}"; draw it again'
        ) from None
    if len(coordinates) % 2:
        raise DesignError(f"has <{name}> with an odd count of numbers in points; draw it again")
    if not coordinates:
        return ""
    refuse_more_than_limit(len(coordinates) // 2)
    pairs = [f"{x} {y}" for x, y in zip(coordinates[::2], coordinates[1::2], strict=True)]
    return f"M {' L '.join(pairs)}{' Z' if name == 'polygon' else ''}"


def _commands(text: str) -> Iterator[str]:
    """Yield path data with every command and number separate. Raises DesignError if it is
    damaged.
    """
    if text.strip(WHITE) in ("", "none"):
        return
    # A move and a closing beside each segment at most.
    refuse_more_than_limit(sum(1 for _ in _COMMANDS.finditer(text)) // 3)
    start, *rest = _COMMANDS.split(text)
    letters, bodies = rest[::2], rest[1::2]
    if start.strip(WHITE) or not letters or letters[0] not in "Mm":
        raise DesignError("has <path> with d that does not begin with a move; draw it again")
    # A letter and seven numbers make the longest segment, an arc.
    refuse_more_than_limit(len(_NUMBER.findall(text)) // 8)
    for before, letter, body in zip(["", *letters], letters, bodies, strict=False):
        takes = TAKES[letter.upper()]
        try:
            values = list(_numbers(body, takes == 7))
        except ValueError as error:
            raise DesignError(
                f'has <path> with d that is damaged at "{error}"; draw it again'
            ) from None
        if (takes == 0 and values) or (takes and (not values or len(values) % takes)):
            raise DesignError(
                f'has <path> with d that is damaged at "{letter}{body.strip()[:20]}"; draw it again'
            )
        if before.upper() + letter.upper() in UNLIKE:
            yield from ("l", "0", "0")
        if takes == 7:
            yield from _arcs(letter, values)
        else:
            yield letter
            yield from values


def _arcs(letter: str, values: list[str]) -> Iterator[str]:
    """Yield arcs one by one; those without a radius are lines."""
    for first in range(0, len(values), 7):
        rx, ry, *rest = values[first : first + 7]
        if float(rx) == 0 or float(ry) == 0:
            yield from ("L" if letter == "A" else "l", *rest[-2:])
        else:
            yield from (letter, rx, ry, *rest)


ToMillimetres = Callable[[Any], Point]


def _placement(matrix: Matrix, scale: float) -> ToMillimetres:
    """Return the map from a shape's points to mm, by the shape's transform and the page's scale."""
    a, b, c, d, e, f = matrix

    def point(p: Any) -> Point:
        return place(scale * (a * p.x + c * p.y + e), -scale * (b * p.x + d * p.y + f))

    return point


def _subpaths(segments: list[Any], point: ToMillimetres) -> Iterator[Strand]:
    """Yield a strand from every move to the next, or to where the path is closed."""
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


def _edges(segment: Any, point: ToMillimetres) -> tuple[Edge, ...]:
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
