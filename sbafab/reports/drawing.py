"""Engineering drawings in SVG: text, lines, arrows and leaders, and the dimensions of a profile.

Every function returns SVG elements. Coordinates are millimetres on the page, y down.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Point
from sbafab.geometry.region import Region, coord, section
from sbafab.laminate.films import MASKS, Film, ink
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.markup import escape

Anchor = Literal["start", "middle", "end"]

TEXT = 3.0
SMALL = 2.6
THIN = 0.15
ARROW = 1.7
KEY_SIGN = 7.6  # mm from the sign of a legend's row to its words
TIMES = "\u00d7"
DARK = "#1a1a1a"
GREY = "#5a5a5a"
BOND = "#2a7ab9"
FONT = "Helvetica, Arial, 'Liberation Sans', sans-serif"
FOLD = "fold: the film goes on in its other half"
HATCHES = "PTFE", "mask2", "mask3"  # patterns of the masks' inks


def document(width: float, height: float, title: str, elements: Iterable[str]) -> str:
    """Return a whole SVG file, ``width`` x ``height`` mm, on white."""
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
    """Return the fill of a film: masks are hatched, so that they differ in a grey print."""
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
    """Return one line of text on its baseline; ``turned`` reads upward."""
    x, y = map(coord, at)
    extra = f' font-size="{coord(size)}"' if size != TEXT else ""
    extra += f' text-anchor="{anchor}"' if anchor != "start" else ""
    extra += ' font-weight="bold"' if bold else ""
    extra += f' fill="{colour}"' if colour != DARK else ""
    extra += f' transform="rotate(-90 {x} {y})"' if turned else ""
    return f'<text x="{x}" y="{y}"{extra}>{escape(words)}</text>'


def text_width(words: str, size: float = TEXT) -> float:
    """Return an upper estimate of a text's width in mm (Helvetica digits are 0.556 em)."""
    narrow = sum(words.count(letter) for letter in " .,:;ijlt|-")
    return size * (0.58 * (len(words) - narrow) + 0.34 * narrow)


def style(
    stroke: str = "none", width: float = THIN, *, fill: str = "none", dashes: str = ""
) -> str:
    """Return the attributes that fill and stroke a shape; holes stay open by the even-odd rule."""
    extra = ' fill-rule="evenodd"' if fill != "none" else ""
    extra += f' stroke-dasharray="{dashes}"' if dashes else ""
    return f'fill="{fill}" stroke="{stroke}" stroke-width="{coord(width)}"{extra}'


def seam_styles(width: float, thin: float = THIN, is_round: bool = True) -> tuple[str, str]:
    """Return the attributes of a seam's bond, ``width`` wide, and of the tool's path over it."""
    ends = "round" if is_round else "butt"
    joints = f'stroke-opacity="0.4" stroke-linecap="{ends}" stroke-linejoin="round"'
    return f"{style(BOND, width)} {joints}", style(DARK, thin)


def fold_style() -> str:
    """Return the attributes of a fold line: dash and dot."""
    return style(DARK, 0.35, dashes="2.6 0.7 0.5 0.7")


def path(data: str, look: str) -> str:
    """Return a path; ``look`` are its attributes."""
    return f'<path d="{data}" {look}/>'


def line(points: Sequence[Point], *, colour: str = DARK, width: float = THIN) -> str:
    data = "M" + "L".join(f"{coord(x)} {coord(y)}" for x, y in points)
    return path(data, style(colour, width))


def circle(centre: Point, radius: float, look: str) -> str:
    return f'<circle cx="{coord(centre[0])}" cy="{coord(centre[1])}" r="{coord(radius)}" {look}/>'


def box(low: Point, high: Point, *, fill: str, stroke: str = "none", width: float = THIN) -> str:
    """Return a rectangle between two corners."""
    return (
        f'<rect x="{coord(low[0])}" y="{coord(low[1])}" width="{coord(high[0] - low[0])}" '
        f'height="{coord(high[1] - low[1])}" fill="{fill}" stroke="{stroke}" '
        f'stroke-width="{coord(width)}"/>'
    )


def swatch(fill: str, stroke: str = GREY) -> str:
    """Return the sample of a fill in a legend."""
    return box((0.0, -2.6), (6.0, 0.6), fill=fill, stroke=stroke)


def strokes(looks: Iterable[str]) -> str:
    """Return the sample of superimposed lines in a legend."""
    return "".join(path("M0 -1h6", look) for look in looks)


def key(at: Point, sign: str, words: str) -> str:
    """A row of a legend, whose baseline starts at a point: a symbol drawn at (0, 0), and words."""
    x, y = at
    moved = f'<g transform="translate({coord(x)} {coord(y)})">{sign}</g>'
    return moved + text((x + KEY_SIGN, y), words)


def arrow(tip: Point, toward: Point) -> str:
    """Return a slender arrow head at ``tip`` that points along the unit vector ``toward``."""
    (x, y), (u, v) = tip, toward
    bx, by = x - ARROW * u, y - ARROW * v
    half = ARROW * 0.18
    corners = [tip, (bx - half * v, by + half * u), (bx + half * v, by - half * u)]
    data = "M" + "L".join(f"{coord(px)} {coord(py)}" for px, py in corners) + "Z"
    return f'<path d="{data}"/>'


def dimension(a: Point, b: Point, words: str, away: Point, distance: float) -> list[str]:
    """Return a dimension between two points, drawn ``distance`` from them along unit vector
    ``away``.

    ``away`` is perpendicular to the line from a to b, along x or y. If the arrows do not fit
    between the extension lines, they point inward from outside.
    """
    (u, v) = away
    start, end = _shifted(a, away, distance), _shifted(b, away, distance)
    parts = [
        line([_shifted(p, away, 0.8), _shifted(p, away, distance + 1.0)], colour=GREY)
        for p in (a, b)
    ]
    parts += _arrows(start, end, 3.2, 2.2)
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
    """A leader from a feature by an elbow to a label; a dot or an arrow marks the feature."""
    end = circle(feature, 0.45, style(fill=DARK)) if dot else arrow(feature, _unit(elbow, feature))
    return [line([feature, elbow, label], colour=GREY), end]


def across(a: Point, b: Point) -> list[str]:
    """A width marked on the part, with its label elsewhere; arrows are outside if it is narrow."""
    return _arrows(a, b, 6.0, 2.0)


def _arrows(a: Point, b: Point, least: float, tail: float) -> list[str]:
    """Return a line with arrows between two points; outside them, on tails, if the gap is less than
    ``least`` arrows.
    """
    (u, v), is_near = _unit(a, b), math.dist(a, b) < least * ARROW
    out, back = (u, v), (-u, -v)
    if not is_near:
        return [line([a, b], colour=GREY), arrow(a, back), arrow(b, out)]
    tails = _shifted(a, back, tail * ARROW), _shifted(b, out, tail * ARROW)
    return [line(tails, colour=GREY), arrow(a, out), arrow(b, back)]


def spread(targets: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Return positions as near as possible to the (sorted) desired ones, at least ``gap`` apart.

    They stay between ``low`` and ``high`` if all fit.
    """
    groups: list[tuple[float, int]] = []
    for target in targets:
        centre, count = target, 1
        while groups and centre - groups[-1][0] < gap * (groups[-1][1] + count) / 2:
            before, more = groups.pop()
            centre = (before * more + centre * count) / (more + count)
            count += more
        groups.append((centre, count))
    places = [centre + (i - (n - 1) / 2) * gap for centre, n in groups for i in range(n)]
    places = [max(place, low + i * gap) for i, place in enumerate(places)]
    last = len(places) - 1
    return [min(place, high - (last - i) * gap) for i, place in enumerate(places)]


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
    """A circle or arc for a leader, and the label for all of its kind.

    ``centre`` and ``radius`` are in mm, as is ``toward``, the target point on an arc; a ``phantom``
    is not an edge of the profile.
    """

    words: str
    centre: Point
    radius: float
    toward: Point | None = None
    phantom: bool = False


@dataclass(frozen=True)
class WidthDimension:
    """A width to draw across a part, from ``start`` to ``end`` in mm, and its label."""

    words: str
    start: Point
    end: Point


Dimension = Circle | WidthDimension


def dimensions(laminate: Laminate, layer: Layer) -> list[Dimension]:
    """Return the dimensions on a layer's drawing: circles, radii and widths in mm, with labels.

    The overall width and height are drawn separately.
    """
    profile = layer.profile
    return [
        *_circles(laminate, layer),
        *_radii(profile),
        *_circumscribed(profile),
        *_inlet_width(laminate, layer),
        *_piece_width(profile),
    ]


def balloons(laminate: Laminate) -> str:
    """Return the number of balloons as text: 15 balloons, or 3 stacks of 1 balloon side by side."""
    high = f"{laminate.balloons} balloon{'s' if laminate.balloons > 1 else ''}"
    stacks = sum(len(chamber.centres) for chamber in laminate.chambers)
    on_sheet = any(layer.role == "sheet" for layer in laminate.layers)
    return f"{stacks} stacks of {high}" if on_sheet and stacks > 1 else high


def length(value: float) -> str:
    """Return millimetres as in drawings: 6.50."""
    return f"{value:.2f}"


def _circles(laminate: Laminate, layer: Layer) -> Iterator[Circle]:
    """Yield the full circles of a profile, equal ones together, named by function.

    The outline of a single disc is omitted, because its overall width defines it.
    """
    groups: dict[tuple[str, float], list[Point]] = {}
    for contour in layer.profile.contours:
        if contour.circle is not None and not is_disc(layer.profile, contour):
            centre, radius = contour.circle
            name = _hole_name(laminate, layer, centre) if contour.is_hole else ""
            groups.setdefault((name, round(radius, 4)), []).append(centre)
    for (name, radius), centres in groups.items():
        words = f"{name} ⌀{length(2 * radius)}".strip()
        yield Circle(_counted(len(centres), words), max(centres), radius)


def is_disc(profile: Region, outer: Contour) -> bool:
    """Return True if a contour is the round outline of a one-piece profile."""
    return outer.circle is not None and profile.outers == (outer,)


def _hole_name(laminate: Laminate, layer: Layer, centre: Point) -> str:
    if any(math.dist(centre, bore.centre) < SAME for bore in laminate.bores):
        return "neck ring" if layer.role == "separator-mask" else "bore"
    if laminate.lumen and math.hypot(*centre) < SAME:
        return "lumen"
    is_pinned = any(math.dist(centre, pin.centre) < SAME for pin in laminate.pins)
    tooling = "tail" if layer.role == "chamber-mask" else "ear"
    return tooling if is_pinned else ""


def _radii(profile: Region) -> Iterator[Circle]:
    """Yield the arcs of edges that are not full circles, equal radii together, largest first."""
    groups: dict[float, list[Arc]] = {}
    for contour in profile.contours:
        for edge in contour.edges if contour.circle is None else ():
            if isinstance(edge, Arc):
                groups.setdefault(round(edge.radius, 3), []).append(edge)
    for radius in sorted(groups, reverse=True)[:MOST_RADII]:
        arcs = groups[radius]
        pointed = max(arcs, key=lambda arc: round(sum(arc.at(0.5)), 6))
        words = _counted(len({_rounded(arc.centre) for arc in arcs}), f"R{length(radius)}")
        yield Circle(words, pointed.centre, pointed.radius, pointed.at(0.5))


def _circumscribed(profile: Region) -> Iterator[Circle]:
    """Yield the circle about the axis around a lobed profile, without inlet tabs and strips."""
    reaches = {
        _rounded(edge.centre): math.hypot(*edge.centre) + edge.radius
        for contour in profile.outers
        for edge in contour.edges
        if isinstance(edge, Arc) and edge.ccw and math.hypot(*edge.centre) > SAME
    }
    radius = max(reaches.values(), default=0.0)
    if len(reaches) > 1 and radius - min(reaches.values()) <= SAME:
        yield Circle(f"fits ⌀{length(2 * radius)}", (0.0, 0.0), radius, phantom=True)


def _inlet_width(laminate: Laminate, layer: Layer) -> Iterator[WidthDimension]:
    """Yield the width of the rightmost inlet strip or tab, if any."""
    cuts = []
    for inlet in laminate.inlets if layer.role != "separator-mask" else ():
        # On the tab, clear of the fillets at its root.
        back, (u, v) = min(0.3 * inlet.length, 1.0), inlet.direction
        x, y = inlet.mouth[0] - back * u, inlet.mouth[1] - back * v
        spans = section(layer.profile, (x, y), (-v, u))
        for span in [span for span in spans if span[0] < 0 < span[1]][:1]:
            ends = sorted([(x - s * v, y + s * u) for s in span], key=lambda p: (p[1], p[0]))
            cuts.append((inlet.mouth, span[1] - span[0], ends))
    if cuts:
        _, width, (start, end) = max(cuts)
        words = f"{'strip' if layer.is_mask else 'tab'} {length(width)} wide"
        yield WidthDimension(_counted(len(cuts), words), start, end)


def _piece_width(profile: Region) -> Iterator[WidthDimension]:
    """Yield the width of one of several equal pieces that are not discs (oblong chambers)."""
    boxes = [outer.bounds for outer in profile.outers]
    sizes = {(round(b[2] - b[0], 4), round(b[3] - b[1], 4)) for b in boxes}
    if len(boxes) > 1 and len(sizes) == 1 and profile.outers[0].circle is None:
        low_x, low_y, high_x, high_y = max(boxes)
        y = low_y + 0.3 * (high_y - low_y)
        words = _counted(len(boxes), f"{length(high_x - low_x)} wide")
        yield WidthDimension(words, (low_x, y), (high_x, y))


def layer_numbers(indices: Sequence[int]) -> str:
    """Return layer numbers with arithmetic sequences shortened: ``3, 7, 11 ... 59``; ``2 to 5``."""
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


def _rounded(p: Point) -> Point:
    return round(p[0], 3) + 0.0, round(p[1], 3) + 0.0
