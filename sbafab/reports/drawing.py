"""What an engineering drawing in SVG is made of: text, lines, arrows, dimensions, leaders.

Every function returns SVG elements. Coordinates are millimetres on the page, y down.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Literal

from sbafab.geometry.edges import Point
from sbafab.geometry.svg import number
from sbafab.laminate.films import Film
from sbafab.laminate.inks import MASKS, Ink, ink
from sbafab.markup import escape

Anchor = Literal["start", "middle", "end"]

TEXT = 3.0
SMALL = 2.6
THIN = 0.15
ARROW = 1.7
TIMES = "\u00d7"
DARK = "#1a1a1a"
GREY = "#5a5a5a"
FONT = "Helvetica, Arial, 'Liberation Sans', sans-serif"


def document(width: float, height: float, title: str, elements: Iterable[str]) -> str:
    """A whole SVG file, ``width`` x ``height`` mm, on white."""
    w, h = number(width), number(height)
    drawn = "\n".join(elements)
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{w}mm" height="{h}mm" '
            f'viewBox="0 0 {w} {h}" font-family="{FONT}" font-size="{TEXT}" fill="{DARK}">',
            f"<title>{escape(title)}</title>",
            _definitions(drawn),
            f'<rect width="{w}" height="{h}" fill="#ffffff"/>',
            drawn,
            "</svg>",
            "",
        ]
    )


def film_fill(film: Film) -> str:
    """What a film is filled with: masks are hatched, so that a grey print still tells them."""
    return f"url(#{_hatch_id(film.shade % len(MASKS))})" if film.is_mask else ink(film).fill


def _hatch_id(shade: int) -> str:
    return f"mask{shade + 1}" if shade else "PTFE"


def _definitions(drawn: str) -> str:
    """The hatch of PTFE, and those of the further masks that are drawn."""
    hatches = {_hatch_id(shade): own for shade, own in enumerate(MASKS)}
    used = [_hatch(n, own) for n, own in hatches.items() if n == "PTFE" or f"url(#{n})" in drawn]
    return f"<defs>{''.join(used)}</defs>"


def _hatch(name: str, own: Ink) -> str:
    return (
        f'<pattern id="{name}" patternUnits="userSpaceOnUse" width="1.2" height="1.2" '
        f'patternTransform="rotate(45)"><rect width="1.2" height="1.2" fill="{own.fill}"/>'
        f'<rect width="0.16" height="1.2" fill="{own.line}" fill-opacity="0.55"/></pattern>'
    )


def text(
    at: Point,
    words: str,
    *,
    size: float = TEXT,
    anchor: Anchor = "start",
    bold: bool = False,
    colour: str = DARK,
    turned: bool = False,
) -> str:
    """One line of text on its baseline; ``turned`` reads upward."""
    x, y = map(number, at)
    extra = f' font-size="{number(size)}"' if size != TEXT else ""
    extra += f' text-anchor="{anchor}"' if anchor != "start" else ""
    extra += ' font-weight="bold"' if bold else ""
    extra += f' fill="{colour}"' if colour != DARK else ""
    extra += f' transform="rotate(-90 {x} {y})"' if turned else ""
    return f'<text x="{x}" y="{y}"{extra}>{escape(words)}</text>'


def text_width(words: str, size: float = TEXT) -> float:
    """Upper estimate of a text's width in mm (digits of Helvetica are 0.556 em)."""
    narrow = sum(words.count(letter) for letter in " .,:;ijlt|-")
    return size * (0.58 * (len(words) - narrow) + 0.34 * narrow)


def line(points: Sequence[Point], *, colour: str = DARK, width: float = THIN) -> str:
    path = "M" + "L".join(f"{number(x)} {number(y)}" for x, y in points)
    return f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="{number(width)}"/>'


def box(low: Point, high: Point, *, fill: str, stroke: str = "none", width: float = THIN) -> str:
    """A rectangle between two corners."""
    return (
        f'<rect x="{number(low[0])}" y="{number(low[1])}" width="{number(high[0] - low[0])}" '
        f'height="{number(high[1] - low[1])}" fill="{fill}" stroke="{stroke}" '
        f'stroke-width="{number(width)}"/>'
    )


def arrow(tip: Point, toward: Point) -> str:
    """A slender arrow head at ``tip`` that points along the unit vector ``toward``."""
    (x, y), (u, v) = tip, toward
    bx, by = x - ARROW * u, y - ARROW * v
    half = ARROW * 0.18
    corners = [tip, (bx - half * v, by + half * u), (bx + half * v, by - half * u)]
    data = "M" + "L".join(f"{number(px)} {number(py)}" for px, py in corners) + "Z"
    return f'<path d="{data}"/>'


def dimension(a: Point, b: Point, words: str, away: Point, distance: float) -> list[str]:
    """A dimension between two points, drawn ``distance`` from them along unit vector ``away``.

    ``away`` stands square to the line from a to b, along x or y. Where the arrows do not fit
    between the extension lines they point inward from outside.
    """
    (u, v) = away
    along = _unit(a, b)
    start, end = _shifted(a, away, distance), _shifted(b, away, distance)
    parts = [
        line([_shifted(p, away, 0.8), _shifted(p, away, distance + 1.0)], colour=GREY)
        for p in (a, b)
    ]
    back = (-along[0], -along[1])
    if math.dist(start, end) >= 3.2 * ARROW:
        parts += [line([start, end], colour=GREY), arrow(start, back), arrow(end, along)]
    else:
        tails = _shifted(start, back, 2.2 * ARROW), _shifted(end, along, 2.2 * ARROW)
        parts += [line(tails, colour=GREY), arrow(start, along), arrow(end, back)]
    middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    if abs(v) > abs(u):
        clear = 0.8 if math.dist(start, end) > text_width(words) else 1.5
        rise = -clear if v < 0 else TEXT - 0.5 + clear
        return [*parts, text((middle[0], middle[1] + rise), words, anchor="middle")]
    if math.dist(start, end) >= text_width(words) + 1.0:
        lean = -0.8 if u < 0 else TEXT + 0.3
        at = (middle[0] + lean, middle[1])
        return [*parts, text(at, words, anchor="middle", turned=True)]
    side: Anchor = "end" if u < 0 else "start"
    return [*parts, text((middle[0] + 1.2 * u, middle[1] + 0.9), words, anchor=side)]


def leader(feature: Point, elbow: Point, label: Point, *, dot: bool = True) -> list[str]:
    """A leader line from a feature by an elbow to a label; a dot or an arrow on the feature."""
    end = (
        f'<circle cx="{number(feature[0])}" cy="{number(feature[1])}" r="0.45" fill="{DARK}"/>'
        if dot
        else arrow(feature, _unit(elbow, feature))
    )
    return [line([feature, elbow, label], colour=GREY), end]


def across(a: Point, b: Point) -> list[str]:
    """A width marked on the part itself, its words elsewhere; arrows outside where it is narrow."""
    (u, v) = _unit(a, b)
    if math.dist(a, b) >= 6 * ARROW:
        return [line([a, b], colour=GREY), arrow(a, (-u, -v)), arrow(b, (u, v))]
    tails = _shifted(a, (-u, -v), 2 * ARROW), _shifted(b, (u, v), 2 * ARROW)
    return [line(tails, colour=GREY), arrow(a, (u, v)), arrow(b, (-u, -v))]


def spread(wanted: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Positions as near as may be to the wanted ones (sorted), at least ``gap`` apart.

    They stay between ``low`` and ``high`` where there is room for all of them.
    """
    if not wanted:
        return []
    groups: list[list[float]] = []
    for place in wanted:
        groups.append([place, 1])
        while len(groups) > 1 and _overlap(groups[-2], groups[-1], gap):
            centre, count = groups.pop()
            before = groups[-1]
            before[0] = (before[0] * before[1] + centre * count) / (before[1] + count)
            before[1] += count
    places = [
        centre + (i - (count - 1) / 2) * gap for centre, count in groups for i in range(int(count))
    ]
    for i, place in enumerate(places):
        places[i] = max(place, low + i * gap)
    last = len(places) - 1
    for i in range(last, -1, -1):
        places[i] = min(places[i], high - (last - i) * gap)
    return places


def _overlap(below: list[float], above: list[float], gap: float) -> bool:
    return above[0] - below[0] < gap * (below[1] + above[1]) / 2


def _unit(a: Point, b: Point) -> Point:
    length = math.dist(a, b)
    return (b[0] - a[0]) / length, (b[1] - a[1]) / length


def _shifted(p: Point, unit: Point, distance: float) -> Point:
    return p[0] + unit[0] * distance, p[1] + unit[1] * distance
