"""The page of an SVG and the lengths on it: what a user unit is in mm (SVG 2, sections 7 and 8)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree

from sbafab.errors import DesignError

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
    def said(self) -> str:
        """How large a unit was taken to be, in words."""
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


def length(text: str, what: str) -> SvgLength:
    """A length as it is written. Raises DesignError where programs do not agree on it."""
    match = _LENGTH.fullmatch(text)
    if match is None or (match[2] not in PER_PIXEL and match[2] not in ("", "px", "%")):
        raise DesignError(
            f'has {what} "{text.strip()[:40]}"; write a number, alone or with mm, cm, in, pt, pc, '
            "px or %"
        )
    number = float(match[1])
    if not math.isfinite(number):
        raise DesignError(f'has {what} "{match[1][:40]}", a coordinate out of all bounds')
    return SvgLength(number, "" if match[2] == "px" else match[2])


def user_units(size: SvgLength, whole: float | None, what: str) -> float:
    """A length in user units; ``whole`` is what a percentage is of."""
    if size.unit != "%":
        return size.number * PER_PIXEL.get(size.unit, 1.0)
    if whole is None:
        raise DesignError(
            f'has {what} "{size.number:g}%" on a page without a size; write it as a number'
        )
    return size.number / 100 * whole


def diagonal(page: Page) -> float | None:
    """What a percentage that is neither across nor down is of."""
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
    for found in pixels:
        if found is not None and not 0 < found < FARTHEST_PAGE:
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
    """Whether the view is stretched to the page, and whether it covers it."""
    text = root.get("preserveAspectRatio", "xMidYMid")
    match = _FIT.fullmatch(text)
    if match is None:
        raise DesignError(f'has preserveAspectRatio "{text[:40]}", which is not one; remove it')
    return match[1] == "none", match[2] == "slice"
