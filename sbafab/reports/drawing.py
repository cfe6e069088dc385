"""Engineering drawings in SVG: text, lines, arrows and leaders, and the dimensions of a profile.

Every function returns SVG elements. Coordinates are millimetres on the page, y down.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Point
from sbafab.geometry.region import Region, coord, section
from sbafab.laminate.films import MASKS, Film, ink
from sbafab.laminate.laminate import Inlet, Laminate, Layer
from sbafab.markup import escape

Anchor = Literal["start", "middle", "end"]

TEXT = 3.0
SMALL = 2.6
THIN = 0.15
ARROW = 1.7
KEY_SIGN = 7.6
"""mm from the sign of a legend's row to its words."""
TIMES = "\u00d7"
DARK = "#1a1a1a"
GREY = "#5a5a5a"
BOND = "#2a7ab9"
FONT = "Helvetica, Arial, 'Liberation Sans', sans-serif"
FOLD = "fold: the film goes on in its other half"
HATCHES = "PTFE", "mask2", "mask3"
"""Patterns of the masks' inks."""


def document(width: float, height: float, title: str, elements: Iterable[str]) -> str:
    """A whole SVG file, ``width`` x ``height`` mm, on white."""
    w, h = coord(width), coord(height)
    drawn = "\n".join(elements)
    hatches = [
        f'<pattern id="{name}" patternUnits="userSpaceOnUse" width="1.2" height="1.2" '
        f'patternTransform="rotate(45)"><rect width="1.2" height="1.2" fill="{colours.fill}"/>'
        f'<rect width="0.16" height="1.2" fill="{colours.line}" fill-opacity="0.55"/></pattern>'
        for name, colours in zip(HATCHES, MASKS, strict=True)
        if f"url(#{name})" in drawn
    ]
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{w}mm" height="{h}mm" '
        f'viewBox="0 0 {w} {h}" font-family="{FONT}" font-size="{TEXT}" fill="{DARK}">\n'
        f"<title>{escape(title)}</title>\n<defs>{''.join(hatches)}</defs>\n"
        f'<rect width="{w}" height="{h}" fill="#ffffff"/>\n{drawn}\n</svg>\n'
    )


def film_fill(film: Film) -> str:
    """Return the fill of a film: masks are hatched, so that a grey print still shows them."""
    return f"url(#{HATCHES[film.shade % len(MASKS)]})" if film.is_mask else ink(film).fill


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
    x, y = map(coord, at)
    extra = f' font-size="{coord(size)}"' if size != TEXT else ""
    extra += f' text-anchor="{anchor}"' if anchor != "start" else ""
    extra += ' font-weight="bold"' if bold else ""
    extra += f' fill="{colour}"' if colour != DARK else ""
    extra += f' transform="rotate(-90 {x} {y})"' if turned else ""
    return f'<text x="{x}" y="{y}"{extra}>{escape(words)}</text>'


def text_width(words: str, size: float = TEXT) -> float:
    """Upper estimate of a text's width in mm (digits of Helvetica are 0.556 em)."""
    narrow = sum(words.count(letter) for letter in " .,:;ijlt|-")
    return size * (0.58 * (len(words) - narrow) + 0.34 * narrow)


def style(
    stroke: str = "none", width: float = THIN, *, fill: str = "none", dashes: str = ""
) -> str:
    """The attributes that fill and stroke a shape; holes stay open by the even-odd rule."""
    extra = ' fill-rule="evenodd"' if fill != "none" else ""
    extra += f' stroke-dasharray="{dashes}"' if dashes else ""
    return f'fill="{fill}" stroke="{stroke}" stroke-width="{coord(width)}"{extra}'


def seam_styles(width: float, thin: float = THIN, is_round: bool = True) -> tuple[str, str]:
    """Return the attributes of a seam's bond, ``width`` wide, and of the tool's path over it."""
    ends = "round" if is_round else "butt"
    joints = f'stroke-opacity="0.4" stroke-linecap="{ends}" stroke-linejoin="round"'
    return f"{style(BOND, width)} {joints}", style(DARK, thin)


def fold_style() -> str:
    """Return the attributes of a fold's line: dash and dot."""
    return style(DARK, 0.35, dashes="2.6 0.7 0.5 0.7")


def path(data: str, look: str) -> str:
    """A path; ``look`` are its attributes."""
    return f'<path d="{data}" {look}/>'


def line(points: Sequence[Point], *, colour: str = DARK, width: float = THIN) -> str:
    data = "M" + "L".join(f"{coord(x)} {coord(y)}" for x, y in points)
    return path(data, style(colour, width))


def circle(centre: Point, radius: float, look: str) -> str:
    return f'<circle cx="{coord(centre[0])}" cy="{coord(centre[1])}" r="{coord(radius)}" {look}/>'


def box(low: Point, high: Point, *, fill: str, stroke: str = "none", width: float = THIN) -> str:
    """A rectangle between two corners."""
    return (
        f'<rect x="{coord(low[0])}" y="{coord(low[1])}" width="{coord(high[0] - low[0])}" '
        f'height="{coord(high[1] - low[1])}" fill="{fill}" stroke="{stroke}" '
        f'stroke-width="{coord(width)}"/>'
    )


def swatch(fill: str, stroke: str = GREY) -> str:
    """The sign of a fill in a legend."""
    return box((0.0, -2.6), (6.0, 0.6), fill=fill, stroke=stroke)


def strokes(looks: Iterable[str]) -> str:
    """The sign of lines in a legend, which lie on each other."""
    return "".join(path("M0 -1h6", look) for look in looks)


def key(at: Point, sign: str, words: str) -> str:
    """A row of a legend, whose baseline begins at a point: a sign drawn at (0, 0), and words."""
    x, y = at
    moved = f'<g transform="translate({coord(x)} {coord(y)})">{sign}</g>'
    return moved + text((x + KEY_SIGN, y), words)


def arrow(tip: Point, toward: Point) -> str:
    """A slender arrow head at ``tip`` that points along the unit vector ``toward``."""
    (x, y), (u, v) = tip, toward
    bx, by = x - ARROW * u, y - ARROW * v
    half = ARROW * 0.18
    corners = [tip, (bx - half * v, by + half * u), (bx + half * v, by - half * u)]
    data = "M" + "L".join(f"{coord(px)} {coord(py)}" for px, py in corners) + "Z"
    return f'<path d="{data}"/>'


def dimension(a: Point, b: Point, words: str, away: Point, distance: float) -> list[str]:
    """A dimension between two points, drawn ``distance`` from them along unit vector ``away``.

    ``away`` is perpendicular to the line from a to b, along x or y. If the arrows do not fit
    between the extension lines, they point inward from outside.
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
    end = circle(feature, 0.45, style(fill=DARK)) if dot else arrow(feature, _unit(elbow, feature))
    return [line([feature, elbow, label], colour=GREY), end]


def across(a: Point, b: Point) -> list[str]:
    """A width marked on the part itself, its label elsewhere; arrows outside if it is narrow."""
    (u, v) = _unit(a, b)
    if math.dist(a, b) >= 6 * ARROW:
        return [line([a, b], colour=GREY), arrow(a, (-u, -v)), arrow(b, (u, v))]
    tails = _shifted(a, (-u, -v), 2 * ARROW), _shifted(b, (u, v), 2 * ARROW)
    return [line(tails, colour=GREY), arrow(a, (u, v)), arrow(b, (-u, -v))]


def spread(targets: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Positions as near as possible to the wanted ones (sorted), at least ``gap`` apart.

    They stay between ``low`` and ``high`` if all fit.
    """
    if not targets:
        return []
    groups: list[list[float]] = []
    for place in targets:
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


# Dimensions of a profile, measured on the profile itself.


SAME = 1e-4
MOST_RADII = 3


@dataclass(frozen=True)
class Circle:
    """A circle or arc to point at, and the label for all of its kind.

    ``centre`` and ``radius`` are mm, like ``toward``, the point of an arc to point at; a
    ``phantom`` is not an edge of the profile.
    """

    words: str
    centre: Point
    radius: float
    toward: Point | None = None
    phantom: bool = False


@dataclass(frozen=True)
class WidthDimension:
    """A width to draw across, from ``start`` to ``end`` in mm, and its label."""

    words: str
    start: Point
    end: Point


Dimension = Circle | WidthDimension


def dimensions(laminate: Laminate, layer: Layer) -> list[Dimension]:
    """Everything dimensioned in a drawing of a layer, beside its overall width and height."""
    profile = layer.profile
    around = circumscribed(profile)
    widths = inlet_width(laminate, layer), piece_width(profile)
    return [
        *circles(laminate, layer),
        *radii(profile),
        *([around] if around is not None else []),
        *(width for width in widths if width is not None),
    ]


def balloons(laminate: Laminate) -> str:
    """Return the number of balloons as text: 15 balloons, or 3 stacks of 1 balloon side by side."""
    high = f"{laminate.balloons} balloon{'s' if laminate.balloons > 1 else ''}"
    stacks = sum(len(chamber.centres) for chamber in laminate.chambers)
    on_sheet = any(layer.role == "sheet" for layer in laminate.layers)
    return f"{stacks} stacks of {high}" if on_sheet and stacks > 1 else high


def length(value: float) -> str:
    """Millimetres as drawings give them: 6.50."""
    return f"{value:.2f}"


def circles(laminate: Laminate, layer: Layer) -> list[Circle]:
    """The full circles of a profile, equal ones together, named by their meaning.

    The outline of a single disc is left out: its overall width gives it.
    """
    groups: dict[tuple[str, float], list[Contour]] = {}
    for contour in layer.profile.contours:
        if contour.circle is not None and not is_disc(layer.profile, contour):
            name = _circle_name(laminate, layer, contour)
            groups.setdefault((name, round(contour.circle[1], 4)), []).append(contour)
    callouts = []
    for (name, radius), contours in groups.items():
        centre = max((c.circle[0] for c in contours if c.circle), key=lambda p: (p[0], p[1]))
        words = f"{name} ⌀{length(2 * radius)}".strip()
        callouts.append(Circle(_counted(len(contours), words), centre, radius))
    return callouts


def is_disc(profile: Region, outer: Contour) -> bool:
    """Return True if a contour is the round outline of a profile of one piece."""
    return outer.circle is not None and profile.outers == (outer,)


def _circle_name(laminate: Laminate, layer: Layer, contour: Contour) -> str:
    assert contour.circle is not None
    centre = contour.circle[0]
    if not contour.is_hole:
        return ""
    if any(math.dist(centre, bore.centre) < SAME for bore in laminate.bores):
        return "neck ring" if layer.role == "separator-mask" else "bore"
    if laminate.lumen and math.hypot(*centre) < SAME:
        return "lumen"
    is_pinned = any(math.dist(centre, pin.centre) < SAME for pin in laminate.pins)
    tooling = "tail" if layer.role == "chamber-mask" else "ear"
    return tooling if is_pinned else ""


def radii(profile: Region) -> list[Circle]:
    """The arcs of edges that are not full circles, equal radii together, largest first."""
    groups: dict[float, list[Arc]] = {}
    for contour in profile.contours:
        if contour.circle is None:
            for edge in contour.edges:
                if isinstance(edge, Arc):
                    groups.setdefault(round(edge.radius, 3), []).append(edge)
    callouts = []
    for radius in sorted(groups, reverse=True)[:MOST_RADII]:
        arcs = groups[radius]
        pointed = max(arcs, key=lambda arc: round(arc.at(0.5)[0] + arc.at(0.5)[1], 6))
        words = _counted(len(_distinct(arc.centre for arc in arcs)), f"R{length(radius)}")
        callouts.append(Circle(words, pointed.centre, pointed.radius, pointed.at(0.5)))
    return callouts


def circumscribed(profile: Region) -> Circle | None:
    """The circle about the axis that a lobed profile fits, inlet tabs and strips aside."""
    axis = (0.0, 0.0)
    reaches: dict[Point, float] = {}
    for contour in profile.outers:
        for edge in contour.edges:
            if isinstance(edge, Arc) and edge.ccw and math.dist(edge.centre, axis) > SAME:
                centre = _rounded(edge.centre)
                reaches[centre] = math.dist(edge.centre, axis) + edge.radius
    if len(reaches) < 2 or max(reaches.values()) - min(reaches.values()) > SAME:
        return None
    radius = max(reaches.values())
    return Circle(f"fits ⌀{length(2 * radius)}", axis, radius, phantom=True)


def piece_width(profile: Region) -> WidthDimension | None:
    """The width of one of several equal pieces that are not discs (oblong chambers)."""
    boxes = [outer.bounds for outer in profile.outers]
    sizes = {(round(b[2] - b[0], 4), round(b[3] - b[1], 4)) for b in boxes}
    if len(boxes) < 2 or len(sizes) != 1 or profile.outers[0].circle is not None:
        return None
    low_x, low_y, high_x, high_y = max(boxes)
    y = low_y + 0.3 * (high_y - low_y)
    words = _counted(len(boxes), f"{length(high_x - low_x)} wide")
    return WidthDimension(words, (low_x, y), (high_x, y))


def inlet_width(laminate: Laminate, layer: Layer) -> WidthDimension | None:
    """The width of the inlet strip or tab, if any, at the inlet farthest right."""
    if layer.role == "separator-mask":
        return None
    spans = [(inlet, span) for inlet in laminate.inlets if (span := _across(layer, inlet))]
    if not spans:
        return None
    inlet, (start, end) = max(spans, key=lambda item: (item[0].mouth[0], item[0].mouth[1]))
    name = "strip" if layer.is_mask else "tab"
    (x, y), (u, v) = _station(inlet), inlet.direction
    ends = sorted(((x - s * v, y + s * u) for s in (start, end)), key=lambda p: (p[1], p[0]))
    words = _counted(len(spans), f"{name} {length(end - start)} wide")
    return WidthDimension(words, ends[0], ends[1])


def _across(layer: Layer, inlet: Inlet) -> tuple[float, float] | None:
    u, v = inlet.direction
    for start, end in section(layer.profile, _station(inlet), (-v, u)):
        if start < 0 < end:
            return start, end
    return None


def _station(inlet: Inlet) -> Point:
    """On the tab, clear of the fillets at its root."""
    (x, y), (u, v) = inlet.mouth, inlet.direction
    back = min(0.3 * inlet.length, 1.0)
    return x - back * u, y - back * v


def layer_numbers(indices: Sequence[int]) -> str:
    """Layer numbers with even steps shortened: ``3, 7, 11 ... 59``; ``2 to 5`` for neighbours."""
    runs: list[list[int]] = []
    for index in indices:
        run = runs[-1] if runs else []
        if len(run) == 1 or (len(run) > 1 and index - run[-1] == run[1] - run[0]):
            run.append(index)
        else:
            runs.append([index])
    return ", ".join(map(_run_words, runs))


def _run_words(run: list[int]) -> str:
    if len(run) < 4:
        return ", ".join(map(str, run))
    if run[1] - run[0] == 1:
        return f"{run[0]} to {run[-1]}"
    return f"{run[0]}, {run[1]}, {run[2]} … {run[-1]}"


def _counted(count: int, words: str) -> str:
    return words if count == 1 else f"{count}{TIMES} {words}"


def _distinct(points: Iterable[Point]) -> set[Point]:
    return {_rounded(p) for p in points}


def _rounded(p: Point) -> Point:
    return round(p[0], 3) + 0.0, round(p[1], 3) + 0.0
