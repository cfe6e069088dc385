"""The polylines of a plain SVG drawing, in mm and with y upward.

Paths and basic shapes are read, in groups, with their transforms. Elements, attributes and styles
that do not change a shape are listed here; a drawing with others is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from sbafab.design.files import read_text
from sbafab.design.polylines import MOST_BYTES, Polyline, nothing_on, place, refuse_more_than_limit
from sbafab.errors import DesignError
from sbafab.geometry.arcs import bezier, elliptical_arc, fit_arcs
from sbafab.geometry.edges import EPSILON, Edge, Line, Point

PLAIN = (
    "save it as plain SVG: paths and basic shapes in groups, numbers without units, clones "
    "unlinked, clips and effects released"
)
DRAW_AGAIN = "draw it again"
MOST_ELEMENTS = 2000
WHITE = " \t\r\n"
"""Exactly the characters that are space in SVG."""
NUMBER = r"(?>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_NUMBER = re.compile(NUMBER, re.ASCII)


def svg_polylines(path: Path, layer: str | None = None) -> tuple[Iterator[Polyline], str]:
    """Return every drawn path and basic shape, with transforms applied, and the size of its unit as
    text. Raises DesignError.

    Only shapes in the group with the label or id ``layer`` count if it is given. The origin is that
    of the user coordinates, regardless of the viewBox. A page without a size in mm, cm or the like
    is read as 1 unit = 1 mm.
    """
    root = _root(path)
    groups = [element for element in root.iter() if local(element) in GROUPS]
    if layer is not None and not any(layer in _names(group) for group in groups):
        raise nothing_on(layer, (name for group in groups for name in _names(group)[:1]))
    scale, words = _unit(root)
    return _polylines(list(_drawn(root, layer)), scale), words


# Numbers, paths and transforms as SVG 2 writes them: the library reads damaged ones in its own way.


# Numbers and separators are atomic, so that repetitions of them cannot backtrack.
# Possessive repetitions of groups would say the same, and end in the wrong place before Python
# 3.11.5 (python/cpython issue 106052).
_SPACE = r"[ \t\r\n]*+"
_BETWEEN = rf"(?>{_SPACE},?{_SPACE})"


def _row(*kinds: str) -> str:
    return _BETWEEN.join(kinds)


def _repeated(*kinds: str) -> str:
    return rf"{_SPACE}{_row(*kinds)}(?:{_BETWEEN}{_row(*kinds)})*"


_ARC = (*[NUMBER] * 3, "[01]", "[01]", NUMBER, NUMBER)
_COMMAND = "|".join(
    f"[{letters}]{_repeated(*kinds)}"
    for letters, kinds in (
        ("MmLlTt", [NUMBER] * 2),
        ("HhVv", [NUMBER]),
        ("SsQq", [NUMBER] * 4),
        ("Cc", [NUMBER] * 6),
        ("Aa", _ARC),
    )
)
_PATH = re.compile(rf"{_SPACE}(?:(?:{_COMMAND}|[Zz]){_SPACE})*", re.ASCII)
_POINTS = re.compile(rf"(?:{_repeated(NUMBER, NUMBER)})?{_SPACE}", re.ASCII)
_VIEW = re.compile(rf"{_SPACE}{_row(*[f'({NUMBER})'] * 4)}{_SPACE}", re.ASCII)
_CALL = "|".join(
    rf"{name}{_SPACE}\({_SPACE}{_row(*[NUMBER] * count)}{_SPACE}\)"
    for name, counts in {
        "matrix": (6,),
        "rotate": (3, 1),
        "scale": (2, 1),
        "skew[XY]": (1,),
        "translate": (2, 1),
    }.items()
    for count in counts
)
_TRANSFORM = re.compile(rf"{_SPACE}(?:(?:{_CALL}){_BETWEEN})*", re.ASCII)
_UNLIKE = re.compile(r"([CcSs][^A-DF-Za-df-z]*)(?=[Tt])|([QqTt][^A-DF-Za-df-z]*)(?=[Ss])")
"""Curves before smooth ones of the other degree, which begin without a tangent to continue. The
library would mirror one; a line of zero length between them prevents it."""


def _sound(pattern: re.Pattern[str], text: str, what: str, remedy: str) -> str:
    """Return a text that matches, in the library's format. Raises DesignError otherwise."""
    match = pattern.match(text)
    end = match.end() if match else 0
    if end < len(text):
        raise DesignError(f'has {what} that is damaged at "{text[end : end + 20]}"; {remedy}')
    # The library stops at a number that ends in a dot.
    return re.sub(r"(?<=\d)\.(?!\d)", "", text)


# The page: what a user unit is in mm (SVG 2, sections 7 and 8).


MM_PER_PIXEL = 25.4 / 96
PER_PIXEL = {"mm": 96 / 25.4, "cm": 96 / 2.54, "in": 96.0, "pt": 96 / 72, "pc": 16.0}
"""User units per physical unit, as in CSS: 96 per inch."""
FARTHEST_PAGE = 1e9
_PAGE_SIZE = re.compile(rf"({NUMBER})(mm|cm|in|pt|pc|px|%|)", re.ASCII)
_FIT = re.compile(r"x(?:Min|Mid|Max)Y(?:Min|Mid|Max)(?:\s+meet)?", re.ASCII)


def _unit(root: ElementTree.Element) -> tuple[float, str]:
    """Return mm per user unit from width, height and viewBox, and as text. Raises DesignError."""
    if not _FIT.fullmatch(root.get("preserveAspectRatio", "xMidYMid").strip(WHITE)):
        raise DesignError("has a preserveAspectRatio that stretches or crops it; remove that")
    sizes = [_page_size(root, key) for key in ("width", "height")]
    view = _view(root)
    units = {unit for _, unit in sizes}
    if not units & set(PER_PIXEL):
        return 1.0, "read at 1 mm a unit, for the page has no size in mm"
    if "%" in units:
        raise DesignError("gives only one of width and height in mm; give both")
    ratios = [size / span for (size, _), span in zip(sizes, view or (), strict=False) if size]
    if view is None or min(ratios) == 1:
        return MM_PER_PIXEL, f"read at {MM_PER_PIXEL:.6g} mm a unit, 96 units an inch"
    return min(ratios) * MM_PER_PIXEL, f"read at {min(ratios) * MM_PER_PIXEL:.6g} mm a unit"


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
    match = _VIEW.fullmatch(text)
    width, height = (float(match[3]), float(match[4])) if match else (0.0, 0.0)
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
        *("foreignObject", "image", "text"),
    }
)
"""Never drawn in place, whatever they contain; and lettering and pictures, never an outline."""
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
LONGEST_TRANSFORM = 10_000


def local(element: ElementTree.Element) -> str:
    """Return an element's name without its namespace."""
    return str(element.tag).rpartition("}")[2]


def _root(path: Path) -> ElementTree.Element:
    text = read_text(path, MOST_BYTES)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DesignError("has a DOCTYPE or entities; save it as plain SVG without them")
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
                f"has more than {MOST_ELEMENTS} elements; save a drawing of only the outline"
            )
        if local(element) in CHANGING:
            raise DesignError(f"holds <{local(element)}>; {PLAIN}")
        if local(element) == "style":
            # A sheet that sets more than paint is refused, wherever it applies.
            sheet = "{" + "".join(element.itertext())
            names = [n for n in _DECLARATION.findall(sheet) if not _PAINT.fullmatch(n)]
            if names or any(mark in sheet for mark in ("@", "\\", "/*")):
                what = names[0] if names else "imports, escapes or comments"
                raise DesignError(f"has {what[:40]} in a style sheet; {PLAIN}")
    return root


def _names(element: ElementTree.Element) -> list[str]:
    """Return the label and the id of a group."""
    names = element.get(LABEL), element.get("id")
    return [name for name in names if name] if local(element) in GROUPS else []


def _drawn(
    root: ElementTree.Element, layer: str | None
) -> Iterator[tuple[ElementTree.Element, str]]:
    """Yield the drawn shapes, of one layer if it is named, in order, each with its transforms, the
    outermost first.
    """
    space = root.tag.removesuffix("svg")
    # Outermost last, so that the next one is the last of the list.
    waiting = [(root, "", layer is None)]
    while waiting:
        element, outer, inside = waiting.pop()
        name = local(element)
        inside = inside or layer in _names(element)
        holds = inside or any(layer in _names(inner) for inner in element.iter())
        if element.tag != space + name or name in UNDRAWN or not holds:
            continue
        if name not in ATTRIBUTES or (name == "svg" and element is not root):
            raise DesignError(f"holds <{name}>; {PLAIN}")
        if not _is_displayed(element):
            continue
        own = element.get("transform", "").strip(WHITE).removeprefix("none")
        outer += " " + _sound(_TRANSFORM, own, "a transform", "apply it to the path")
        if len(outer) > LONGEST_TRANSFORM:
            raise DesignError("has a very long transform; apply it to the path")
        if name in SHAPES:
            yield element, outer
        else:
            waiting += [(inner, outer, inside) for inner in reversed(element)]


def _is_displayed(element: ElementTree.Element) -> bool:
    """Return True if the element is drawn. Raises DesignError for anything that may change that."""
    name = local(element)
    values = {key: value for key, value in element.attrib.items() if not key.startswith("{")}
    style = values.get("style", "").split(";")
    parts = [part.partition(":") for part in style if part.strip(WHITE)]
    styles = {key.strip(WHITE): value.strip(WHITE) for key, _, value in parts}
    attributes = {
        key: value.strip(WHITE)
        for key, value in values.items()
        if key not in ATTRIBUTES[name] and not _NAMES.fullmatch(key)
    }
    if {**attributes, **styles}.get("display") == "none":
        return False
    for key, value in (*attributes.items(), *styles.items()):
        if not _PAINT.fullmatch(key) and value not in VALUES.get(key, ()):
            raise DesignError(f'has {key[:40]} "{value[:40]}" on <{name}>; {PLAIN}')
    return True


# Shapes as strands, by the library.


SIZES = frozenset({"height", "r", "rx", "ry", "width"})


def _polylines(drawn: list[tuple[ElementTree.Element, str]], scale: float) -> Iterator[Polyline]:
    from svgelements import Matrix

    for element, transform in drawn:
        try:
            segments = _segments(element)
            matrix = Matrix(transform)
        except DesignError:
            raise
        except Exception:
            # Extremely large numbers fail anywhere in the library, with any built-in error.
            raise DesignError(f"has an unreadable <{local(element)}>; draw it again") from None

        def point(p: Any, matrix: Any = matrix) -> Point:
            x, y = matrix.point_in_matrix_space(p)
            return place(scale * x, -scale * y)

        edges: list[Edge] = []
        for segment in segments:
            if type(segment).__name__ != "Move":
                edges += _edges(segment, point)
                refuse_more_than_limit(len(edges))
            if type(segment).__name__ in ("Move", "Close"):
                yield tuple(edges)
                edges = []
        yield tuple(edges)


def _segments(element: ElementTree.Element) -> list[Any]:
    """Return the segments of a shape, in user units; none if nothing is drawn.

    Raises DesignError for a damaged shape, and for lengths with units.
    """
    import svgelements

    name = local(element)
    if name == "path":
        return list(svgelements.Path(_path_data(element.get("d", ""))))
    values = {key: element.get(key, "").strip(WHITE) for key in SHAPES[name]}
    if name in ("polyline", "polygon"):
        refuse_more_than_limit(len(_NUMBER.findall(values["points"])) // 2)
        values["points"] = _sound(_POINTS, values["points"], f"<{name}> with points", DRAW_AGAIN)
    else:
        for key, text in values.items():
            _refuse_length(name, key, text.removesuffix("px"))
    if name == "ellipse" and (values["rx"] == "") != (values["ry"] == ""):
        raise DesignError("has <ellipse> with only one of rx and ry; give both")
    kind = {"line": "SimpleLine"}.get(name, name.capitalize())
    given = {key: text for key, text in values.items() if text}
    return list(getattr(svgelements, kind)(given).segments(transformed=False))


def _refuse_length(name: str, key: str, text: str) -> None:
    if text and (_NUMBER.fullmatch(text) is None or not math.isfinite(float(text))):
        raise DesignError(
            f'has {key} "{text[:40]}" on <{name}>, which is not a coordinate; {PLAIN}'
        )
    if text and key in SIZES and float(text) < 0:
        raise DesignError(f"has <{name}> with {key} {text}, which is negative")


def _path_data(text: str) -> str:
    """Return the data of a path in the library's format. Raises DesignError if it is damaged."""
    text = text.strip(WHITE).removeprefix("none")
    # A letter and seven numbers make the longest segment, an arc; a closing is its letter alone.
    closings = text.count("z") + text.count("Z")
    refuse_more_than_limit(len(_NUMBER.findall(text)) // 8 + closings)
    if text and text[0] not in "Mm":
        raise DesignError("has <path> with d that does not begin with a move; draw it again")
    return _UNLIKE.sub(r"\g<0>l0 0", _sound(_PATH, text, "<path> with d", DRAW_AGAIN))


def _edges(segment: Any, point: Callable[[Any], Point]) -> tuple[Edge, ...]:
    kind = type(segment).__name__
    if segment.start is None or segment.end is None:
        return ()
    start, end = point(segment.start), point(segment.end)
    if kind == "Arc" and min(segment.rx, segment.ry) > 0:
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
