"""What styles and attributes of an SVG do to an element's shape: hidden or not, or refused."""

from __future__ import annotations

import re
from collections.abc import Iterator
from xml.etree import ElementTree

from sbafab.errors import DesignError

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
        known = _VENDOR.sub("", name.lower())
        if known in SHAPING | MOVING | CLIPPING | HIDING or known == "vector-effect":
            raise DesignError(
                f"sets {name} in a style sheet, which programs read differently; write it as an "
                "attribute of the element itself, or delete it"
            )


def is_displayed(element: ElementTree.Element) -> bool:
    """Whether the element and what is in it is drawn at all."""
    value = _set(element, "display")
    return value != "none"


def is_visible(element: ElementTree.Element, inherited: bool) -> bool:
    """Whether the element itself is drawn; what is in it may say otherwise."""
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
        known = _VENDOR.sub("", key)
        if known in SHAPING | MOVING:
            raise DesignError(
                f"sets {key} in the style of <{name}>, which programs read differently; write it "
                "as an attribute, or apply it to the path"
            )
        _refuse_effect(name, known, value)
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
