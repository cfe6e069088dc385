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

from sbafab.design.strands import (
    MOST_OF_ENTITY,
    Strand,
    Traced,
    nothing_on,
    place,
    refuse_more_than_limit,
)
from sbafab.errors import DesignError
from sbafab.geometry.arcs import bezier, elliptical_arc, fit_arcs
from sbafab.geometry.edges import EPSILON, Edge, Line, Point

# The page of an SVG and the lengths on it: what a user unit is in mm (SVG 2, sections 7 and 8).


MM_PER_PIXEL = 25.4 / 96
PER_PIXEL = {
    "mm": 96 / 25.4,
    "cm": 96 / 2.54,
    "in": 96.0,
    "pt": 96 / 72,
    "pc": 16.0,
}
"""User units to one of a physical unit, as CSS has it: 96 an inch."""
FARTHEST_PAGE = 1e9
WHITE = " \t\r\n"
"""What SVG takes for space, and no more."""
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_LENGTH = re.compile(rf"\s*({NUMBER})(%|[A-Za-z]*)\s*", re.ASCII)
_FIT = re.compile(
    r"\s*(?:defer\s+)?(none|x(?:Min|Mid|Max)Y(?:Min|Mid|Max))(?:\s+(meet|slice))?\s*", re.ASCII
)
_NUMBER = re.compile(NUMBER, re.ASCII)
_BETWEEN = re.compile(r"\s*(?:,\s*)?", re.ASCII)


class Page(NamedTuple):
    """``across`` and ``down``: mm a user unit. ``width`` and ``height``: what percentages are of.

    ``physical``: whether the page has a size in mm, cm or the like; ``has_view``: a viewBox.
    """

    across: float
    down: float
    width: float | None
    height: float | None
    physical: bool
    has_view: bool

    @property
    def description(self) -> str:
        """Size of a unit in words."""
        if not self.physical:
            return "read at 1 mm a unit, for the page has no size in mm"
        if self.across == self.down:
            inch = ", 96 units an inch" if self.across == MM_PER_PIXEL else ""
            return f"read at {self.across:.6g} mm a unit{inch}"
        return f"read at {self.across:.6g} mm a unit across and {self.down:.6g} down"


class SvgLength(NamedTuple):
    """A number and its unit, "" for user units."""

    number: float
    unit: str

    @property
    def is_physical(self) -> bool:
        return self.unit in PER_PIXEL


def numbers(text: str) -> Iterator[str]:
    """The numbers of a list parted by spaces or commas. Raises ValueError for anything else."""
    place = len(text) - len(text.lstrip(WHITE))
    while place < len(text):
        match = _NUMBER.match(text, place)
        if match is None:
            raise ValueError(text[place : place + 20])
        yield match[0]
        place = match.end()
        between = _BETWEEN.match(text, place)
        place = between.end() if between else place
        if between and "," in between[0] and place == len(text):
            raise ValueError(",")


def length(text: str, attribute: str) -> SvgLength:
    """Return a length as written. Raises DesignError where programs do not agree on it."""
    match = _LENGTH.fullmatch(text)
    if match is None or (match[2] not in PER_PIXEL and match[2] not in ("", "px", "%")):
        raise DesignError(
            f'has {attribute} "{text.strip()[:40]}"; write a number, alone or with mm, cm, in, '
            "pt, pc, px or %"
        )
    number = float(match[1])
    if not math.isfinite(number):
        raise DesignError(f'has {attribute} "{match[1][:40]}", a coordinate out of all bounds')
    return SvgLength(number, "" if match[2] == "px" else match[2])


def user_units(size: SvgLength, whole: float | None, attribute: str) -> float:
    """Return a length in user units; a percentage is of ``whole``."""
    if size.unit != "%":
        return size.number * PER_PIXEL.get(size.unit, 1.0)
    if whole is None:
        raise DesignError(
            f'has {attribute} "{size.number:g}%" on a page without a size; write it as a number'
        )
    return size.number / 100 * whole


def diagonal(page: Page) -> float | None:
    """Return the length that percentages neither across nor down refer to."""
    if page.width is None or page.height is None:
        return None
    return math.hypot(page.width, page.height) / math.sqrt(2)


def page_of(root: ElementTree.Element) -> Page:
    """The page by width, height, viewBox and preserveAspectRatio. Raises DesignError."""
    sizes = [_size(root, name) for name in ("width", "height")]
    view, stretched, slices = _view(root), *_fit(root)
    pixels = [
        None if size is None or size.unit == "%" else user_units(size, None, "a page of")
        for size in sizes
    ]
    for pixel_count in pixels:
        if pixel_count is not None and not 0 < pixel_count < FARTHEST_PAGE:
            raise DesignError("has a width or height that is not positive; give the page's size")
    physical = any(size is not None and size.is_physical for size in sizes)
    if physical and any(size is not None and size.unit == "%" for size in sizes):
        raise DesignError("gives only one of width and height in mm; give both")
    ratios = [
        pixel / span
        for pixel, span in zip(pixels, view or (1.0, 1.0), strict=True)
        if pixel is not None
    ]
    uneven = stretched and view is not None and len(set(ratios)) == 2
    if not physical:
        if uneven:
            raise DesignError(
                'has preserveAspectRatio "none" and no size in mm; give width and height in mm'
            )
        width, height = view or pixels
        return Page(1.0, 1.0, width, height, False, view is not None)
    if view is None:
        return Page(MM_PER_PIXEL, MM_PER_PIXEL, pixels[0], pixels[1], True, False)
    if uneven:
        return Page(ratios[0] * MM_PER_PIXEL, ratios[1] * MM_PER_PIXEL, *view, True, True)
    scale = (max(ratios) if slices else min(ratios)) * MM_PER_PIXEL
    return Page(scale, scale, *view, True, True)


def with_physical_lengths(page: Page) -> Page:
    """The page of a drawing that holds lengths in mm or the like: 96 units are an inch then."""
    if page.physical:
        return page
    if page.has_view:
        raise DesignError(
            "has lengths in mm or the like and a viewBox, but no page size in mm; give width and "
            "height in mm"
        )
    return page._replace(across=MM_PER_PIXEL, down=MM_PER_PIXEL, physical=True)


def _size(root: ElementTree.Element, name: str) -> SvgLength | None:
    text = root.get(name, "").strip(WHITE)
    return None if text in ("", "auto") else length(text, f"a {name} of")


def _view(root: ElementTree.Element) -> tuple[float, float] | None:
    text = root.get("viewBox")
    if text is None:
        return None
    try:
        _, _, width, height = map(float, numbers(text))
    except ValueError:
        width = height = 0.0
    if not (0 < width < FARTHEST_PAGE and 0 < height < FARTHEST_PAGE):
        raise DesignError("has a viewBox that is not four numbers with a positive size")
    return width, height


def _fit(root: ElementTree.Element) -> tuple[bool, bool]:
    """True if the view is stretched to the page, and True if it covers it."""
    text = root.get("preserveAspectRatio", "xMidYMid")
    match = _FIT.fullmatch(text)
    if match is None:
        raise DesignError(f'has preserveAspectRatio "{text[:40]}", which is not one; remove it')
    return match[1] == "none", match[2] == "slice"


# Basic shapes of SVG as the paths that they stand for (SVG 2, sections 9 and 10).


SHAPES = frozenset({"circle", "ellipse", "line", "path", "polygon", "polyline", "rect"})
LENGTHS = {
    "circle": ("cx", "cy", "r"),
    "ellipse": ("cx", "cy", "rx", "ry"),
    "line": ("x1", "y1", "x2", "y2"),
    "rect": ("x", "y", "width", "height", "rx", "ry"),
}
"""The lengths that a shape is drawn with; each is 0 where it is not given."""
ACROSS = frozenset({"cx", "rx", "width", "x", "x1", "x2"})
DOWN = frozenset({"cy", "ry", "height", "y", "y1", "y2"})
SIZES = frozenset({"height", "r", "rx", "ry", "width"})
TAKES = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
"""How many numbers a path command takes, over and over."""
UNLIKE = frozenset({"CT", "ST", "QS", "TS"})
"""Smooth curves after curves of the other degree: these begin without a tangent to go on with. The
library would mirror one, which a line of no length between them keeps it from."""
FLAGS = (3, 4)
"""Which of an arc's seven are 0 or 1, and may stand without a space after them."""

_COMMANDS = re.compile(r"([MmLlHhVvCcSsQqTtAaZz])")
_FLAGS_OF_ARC = re.compile(r"[01]")
_SPACE = re.compile(r"\s*(?:,\s*)?", re.ASCII)


class Sized(NamedTuple):
    """A shape with its lengths as they are written; None where one is not given, or "auto"."""

    name: str
    lengths: dict[str, SvgLength | None]
    text: str = ""
    """Of a path and of polylines: what they are drawn by."""

    @property
    def is_physical(self) -> bool:
        return any(value is not None and value.is_physical for value in self.lengths.values())


def sized(element: ElementTree.Element) -> Sized:
    """The shape of an element. Raises DesignError where programs would not agree on it."""
    name = local(element)
    lengths: dict[str, SvgLength | None] = {}
    for key in LENGTHS.get(name, ()):
        text = element.get(key, "").strip(WHITE)
        absent = text == "" or (text == "auto" and key in SIZES)
        lengths[key] = None if absent else length(text, f"<{name}> with {key}")
    for key, value in lengths.items():
        if key in SIZES and value is not None and value.number < 0:
            raise DesignError(f"has <{name}> with {key} {value.number:g}, which is negative")
    if name == "ellipse" and (lengths["rx"] is None) != (lengths["ry"] is None):
        raise DesignError("has <ellipse> with only one of rx and ry; give both")
    return Sized(name, lengths, element.get("points" if name.startswith("poly") else "d", ""))


def path_of(shape: Sized, page: Page) -> str:
    """The path data of a shape, in user units; empty where nothing is drawn."""
    whole = {**dict.fromkeys(ACROSS, page.width), **dict.fromkeys(DOWN, page.height)}
    value = {
        key: None
        if quantity is None
        else user_units(quantity, whole.get(key, diagonal(page)), f"<{shape.name}> with {key}")
        for key, quantity in shape.lengths.items()
    }
    if shape.name == "path":
        return " ".join(_commands(shape.text))
    if shape.name in ("polyline", "polygon"):
        return _corners(shape.text, shape.name)
    number = {key: quantity or 0.0 for key, quantity in value.items()}
    if shape.name == "line":
        return "M {x1!r} {y1!r} L {x2!r} {y2!r}".format_map(number)
    if shape.name == "rect":
        # A radius that is not given is the other one.
        rx, ry = (value["rx"], value["ry"]) if value["rx"] is not None else (value["ry"],) * 2
        return _rect(number, rx or 0.0, rx or 0.0 if ry is None else ry)
    radii = (number["r"],) * 2 if shape.name == "circle" else (number["rx"], number["ry"])
    return _ellipse(number["cx"], number["cy"], *radii)


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
        coordinates = list(numbers(text))
    except ValueError as error:
        raise DesignError(
            f'has <{name}> with points that stop at "{error}"; draw it again'
        ) from None
    if len(coordinates) % 2:
        raise DesignError(f"has <{name}> with an odd count of numbers in points; draw it again")
    if not coordinates:
        return ""
    pairs = [f"{x} {y}" for x, y in zip(coordinates[::2], coordinates[1::2], strict=True)]
    return f"M {' L '.join(pairs)}{' Z' if name == 'polygon' else ''}"


def _commands(text: str) -> Iterator[str]:
    """Path data with every command and number apart. Raises DesignError where it is damaged."""
    if text.strip(WHITE) in ("", "none"):
        return
    start, *rest = _COMMANDS.split(text)
    letters, bodies = rest[::2], rest[1::2]
    if start.strip(WHITE) or not letters or letters[0] not in "Mm":
        raise DesignError("has <path> with d that does not begin with a move; draw it again")
    for before, letter, body in zip(["", *letters], letters, bodies, strict=False):
        takes = TAKES[letter.upper()]
        values = list(_numbers(body, takes == 7))
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
    """Arcs one by one; those without a radius are lines."""
    for first in range(0, len(values), 7):
        rx, ry, *rest = values[first : first + 7]
        if float(rx) == 0 or float(ry) == 0:
            yield from ("L" if letter == "A" else "l", *rest[-2:])
        else:
            yield from (letter, rx, ry, *rest)


def _numbers(text: str, arcs: bool) -> Iterator[str]:
    """The numbers after a path command; the flags of arcs need nothing between them."""
    place, count = len(text) - len(text.lstrip(WHITE)), 0
    while place < len(text):
        is_flag = arcs and count % 7 in FLAGS
        match = (_FLAGS_OF_ARC if is_flag else _NUMBER).match(text, place)
        if match is None:
            raise DesignError(
                f'has <path> with d that is damaged at "{text[place : place + 20]}"; draw it again'
            )
        yield match[0] if is_flag else repr(float(match[0]))
        count += 1
        between = _SPACE.match(text, match.end())
        place = between.end() if between else match.end()


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


def svg_strands(path: Path, layer: str | None = None) -> Traced:
    """Every path and basic shape that is drawn, transforms applied. Raises DesignError.

    Only what stands in the group of the label or id ``layer`` counts where that is given.

    The origin is that of the user coordinates, wherever the viewBox begins. A page without a size
    in mm, cm or the like is read as 1 unit = 1 mm, unless lengths in it have such a unit: then 96
    units are an inch, as SVG says.
    """
    root = _root(path)
    if layer is not None:
        _keep_layer(root, layer)
    drawn = list(_drawn(root))
    page = page_of(root)
    if any(shape.is_physical for shape, _ in drawn):
        page = with_physical_lengths(page)
    if not drawn:
        _refuse_undrawn(root)
    return Traced(_strands(drawn, page), page.description)


def _strands(drawn: list[DrawnShape], page: Page) -> Iterator[Strand]:
    from svgelements import Path as PathData

    for shape, matrix in drawn:
        text = path_of(shape, page)
        try:
            segments = list(PathData(text))
        except Exception:
            # Numbers out of all bounds fail anywhere in the library, with any built-in error.
            raise DesignError(
                f"holds a <{shape.name}> that cannot be read; draw it again"
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
    if count > 8 * MOST_OF_ENTITY:
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


LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
"""The name that Inkscape shows of a layer or group."""


def _keep_layer(root: ElementTree.Element, layer: str) -> None:
    """Take all but one layer, and the groups that it stands in, out of a drawing."""
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
        step = ReadMatrix(f"{match[1]}({' '.join(values)})")
        matrix = _product(matrix, (step.a, step.b, step.c, step.d, step.e, step.f))
        end = match.end()
    return matrix


def _product(outer: Matrix, inner: Matrix) -> Matrix:
    """The matrix that applies ``inner`` and then ``outer``."""
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


# Styles and attributes that hide an element or change its shape, or are refused.


LONGEST_STYLE = 10_000
SHAPING = frozenset({"cx", "cy", "r", "rx", "ry", "x", "y", "width", "height", "d"})
MOVING = frozenset(
    {
        "all",
        "offset",
        "offset-path",
        "perspective",
        "rotate",
        "scale",
        "transform",
        "transform-box",
        "transform-origin",
        "translate",
        "zoom",
    }
)
CLIPPING = frozenset({"clip", "clip-path", "content-visibility", "filter", "mask", "mask-image"})
HIDING = frozenset({"display", "visibility"})
CONDITIONS = ("requiredExtensions", "requiredFeatures", "systemLanguage")
NO_EFFECT = frozenset({"", "none", "auto", "visible"})
STROKE_ONLY = frozenset({"none", "non-scaling-stroke"})
"""Values of vector-effect that leave the shape as it is."""

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_DECLARATION = re.compile(r"[{;]\s*([-\w]+)\s*:")
_VENDOR = re.compile(r"^-(?:webkit|moz|ms|o)-")


def refuse_style_sheet(text: str) -> None:
    """Raises DesignError for a style sheet that may change what is drawn, wherever it applies."""
    if len(text) > LONGEST_STYLE:
        raise DesignError("holds a long style sheet; save it as plain SVG")
    plain = _COMMENT.sub(" ", text)
    if "@import" in plain.lower() or "\\" in plain:
        raise DesignError("holds a style sheet with imports or escapes; save it as plain SVG")
    for name in _DECLARATION.findall(plain):
        property_name = _VENDOR.sub("", name.lower())
        if (
            property_name in SHAPING | MOVING | CLIPPING | HIDING
            or property_name == "vector-effect"
        ):
            raise DesignError(
                f"sets {name} in a style sheet, which programs read differently; write it as an "
                "attribute of the element itself, or delete it"
            )


def is_displayed(element: ElementTree.Element) -> bool:
    """Return True if the element and its children are drawn at all."""
    value = _set(element, "display")
    return value != "none"


def is_visible(element: ElementTree.Element, inherited: bool) -> bool:
    """Return True if the element itself is drawn; its children may differ."""
    value = _set(element, "visibility")
    if value in ("", "inherit"):
        return inherited
    if value in ("visible", "hidden", "collapse"):
        return value == "visible"
    raise DesignError(
        f'has visibility "{value[:40]}" on <{local(element)}>; write visible or hidden'
    )


def refuse_effects(element: ElementTree.Element) -> None:
    """Raises DesignError where a drawn element is clipped, moved or shaped by other means."""
    name = local(element)
    for condition in CONDITIONS:
        if condition in element.attrib:
            raise DesignError(f"draws <{name}> only under {condition}; remove that attribute")
    for key, value in _declared(element):
        property_name = _VENDOR.sub("", key)
        if property_name in SHAPING | MOVING:
            raise DesignError(
                f"sets {key} in the style of <{name}>, which programs read differently; write it "
                "as an attribute, or apply it to the path"
            )
        _refuse_effect(name, property_name, value)
    for key in (*sorted(CLIPPING), "vector-effect"):
        _refuse_effect(name, key, element.get(key, "").strip().lower())
    for key in ("transform-origin", "transform-box"):
        if key in element.attrib and "transform" in element.attrib:
            raise DesignError(
                f"has {key} on <{name}>, which programs read differently; write the transform "
                "without it, or apply it to the path"
            )


def _refuse_effect(name: str, key: str, value: str) -> None:
    if key in CLIPPING and value not in NO_EFFECT:
        raise DesignError(
            f"has a {key} on <{name}>; release it and draw the outline as it shall be cut"
        )
    if key == "vector-effect" and value and value not in STROKE_ONLY:
        raise DesignError(f"has vector-effect {value[:40]} on <{name}>; remove it")


def _set(element: ElementTree.Element, name: str) -> str:
    """A property's value: by the style, or else by the attribute of that name."""
    _refuse_capitals(element, element.get(name, ""))
    values = [value for key, value in _declared(element) if key == name]
    return values[-1] if values else element.get(name, "").strip().lower()


def _refuse_capitals(element: ElementTree.Element, text: str) -> None:
    if text != text.lower():
        raise DesignError(
            f'writes "{text.strip()[:40]}" on <{local(element)}> in capitals, which programs read '
            "differently; write it in small letters"
        )


def _declared(element: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Properties and values of the style attribute, in small letters."""
    text = element.get("style", "")
    if len(text) > LONGEST_STYLE or "\\" in text:
        raise DesignError(f"holds a long or escaped style on <{local(element)}>; save plain SVG")
    for part in _COMMENT.sub(" ", text).split(";"):
        key, _, value = part.partition(":")
        name = key.strip().lower()
        if name in HIDING:
            _refuse_capitals(element, part)
        yield name, value.lower().replace("!important", "").strip()


def local(element: ElementTree.Element) -> str:
    """An element's name without its namespace."""
    return str(element.tag).rpartition("}")[2]
