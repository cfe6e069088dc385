"""scrap: what the registered sheets leave round the parts comes off, and the inlets stay free.

A piece of scrap comes off upward or downward where no part lies over it, or none under it, and
where it is bonded to none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.geometry.boolean import union
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.nearby import widened
from sbafab.geometry.region import Region, rectangle, strip
from sbafab.laminate.laminate import Laminate, Layer, SheetPanel, freed
from sbafab.rules.bridges import sheeted
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import at
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Explanation, Rule

NAME = "scrap"
AHEAD = 1.0
"""mm in front of an inlet that no sheet reaches into."""
DUST = 1e-4
"""mm2 of overlap that rounding may leave."""


class _Held(NamedTuple):
    layer: Layer
    at: Point
    what: str


def check(measures: Measures) -> list[Finding]:
    """How many pieces of scrap do not come off the parts, or close an inlet."""
    laminate = measures.laminate
    panel = laminate.panel
    if panel is None:
        message = "no sheet is left round the parts"
        return [Finding(NAME, "pass", 0.0, 0.0, "pieces", Place(), message)]
    found = [*_held(laminate, panel), *_closed(laminate, panel)]
    if not found:
        message = "all scrap comes off after the second cut, and every inlet is free"
        return [Finding(NAME, "pass", 0.0, 0.0, "pieces", Place(), message)]
    first = found[0]
    place = Place(None, (first.layer.index,), *first.at)
    message = f"{first.what}, {at(first.at)}; give every sheet the window of the whole laminate"
    return [Finding(NAME, "fail", 0.0, float(len(found)), "pieces", place, message)]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "all scrap of registered sheets comes off, and every inlet is free",
        "Scrap that is welded to a part, or locked in it, cannot be taken away after pressing.",
        "Move the copies apart with panel.web, or make the tab longer.",
        ("panel.web", "inlet.tab_length"),
    ),
    at_most=True,
)


def _held(laminate: Laminate, panel: SheetPanel) -> Iterator[_Held]:
    """Scrap that is bonded to a part, or has parts over and under it."""
    placed = {layer.pattern: _copied(layer.profile, panel) for layer in laminate.tpe_layers}
    own = union({layer.pattern: layer.profile for layer in laminate.tpe_layers}.values())
    everywhere = _copied(own, panel)
    free: set[str] = set()
    for kind in (sheeted(laminate), sheeted(laminate, masks=True)):
        for layer in kind:
            left = freed(panel, layer)
            for piece in (left.frame, *left.crumbs):
                if all(_is_free(piece, place, own, panel, free) for place in panel.places):
                    continue
                if _area(piece & everywhere) < DUST:
                    continue
                what = _why_held(laminate, panel, layer, piece, placed)
                if what is not None:
                    yield _Held(layer, *what)


def _copied(part: Region, panel: SheetPanel) -> Region:
    """A part at the places of all copies, which lie apart."""
    return Region(tuple(c for place in panel.places for c in part.moved(*place).contours))


def _is_free(piece: Region, place: Point, own: Region, panel: SheetPanel, free: set[str]) -> bool:
    """Whether what a piece has round one copy lies beside its part; ``free`` names those known."""
    here = _round(piece, place, panel)
    if here.key not in free and _area(here & own) < DUST:
        free.add(here.key)
    return here.key in free


def _round(piece: Region, place: Point, panel: SheetPanel) -> Region:
    """What a piece has in the room of one copy, in that one's frame.

    All of the piece where holes of it run on past that room.
    """
    x0, y0, x1, y1 = widened(panel.window.moved(*place).bounds, 1e-3)
    holes = [hole for hole in piece.holes if not _apart(hole.bounds, (x0, y0, x1, y1))]
    here = piece
    if all(_within(hole.bounds, (x0, y0, x1, y1)) for hole in holes):
        here = Region((*rectangle((x0, y0), (x1, y1)).contours, *holes))
    return here.moved(-place[0], -place[1])


def _apart(a: Bounds, b: Bounds) -> bool:
    return a[2] < b[0] or b[2] < a[0] or a[3] < b[1] or b[3] < a[1]


def _within(a: Bounds, b: Bounds) -> bool:
    return a[0] >= b[0] and a[1] >= b[1] and a[2] <= b[2] and a[3] <= b[3]


def _why_held(
    laminate: Laminate, panel: SheetPanel, layer: Layer, piece: Region, placed: dict[str, Region]
) -> tuple[Point, str] | None:
    """Where and by what a piece is held; every layer that is cut so is looked at."""
    key = panel.sheets[layer.index - 1].key
    for own in laminate.layers:
        if own.pattern != layer.pattern or panel.sheets[own.index - 1].key != key:
            continue
        over = {
            other.index: piece & placed[other.pattern]
            for other in laminate.tpe_layers
            if other.index != own.index
        }
        over = {index: region for index, region in over.items() if _area(region) >= DUST}
        for index, region in over.items():
            between = _between(laminate, panel, own.index, index)
            if not own.is_mask and between is not None and _area(region - between) >= DUST:
                said = f"scrap of layer {own.index} ({own.name}) bonds to the part of layer {index}"
                return (region - between).edges[0].at(0.5), said
        if over and min(over) < own.index < max(over):
            said = (
                f"scrap of layer {own.index} ({own.name}) is locked in between the parts of layers "
                f"{min(over)} and {max(over)}"
            )
            return next(iter(over.values())).edges[0].at(0.5), said
    return None


def _between(laminate: Laminate, panel: SheetPanel, one: int, other: int) -> Region | None:
    """The mask sheets between two films; None where another film lies there."""
    low, high = sorted((one, other))
    within: Sequence[Layer] = laminate.layers[low : high - 1]
    if not all(layer.is_mask for layer in within):
        return None
    return union(panel.sheets[layer.index - 1] for layer in within)


def _closed(laminate: Laminate, panel: SheetPanel) -> Iterator[_Held]:
    """Film sheets that reach in front of an inlet, where its tube goes in."""
    free: set[str] = set()
    for layer in sheeted(laminate):
        for place in panel.places:
            here = _round(panel.sheets[layer.index - 1], place, panel)
            if here.key in free:
                continue
            free.add(here.key)
            for inlet in laminate.inlets:
                (x, y), (dx, dy) = inlet.mouth, inlet.direction
                # The tab itself ends at the mouth.
                start, end = (x + 0.01 * dx, y + 0.01 * dy), (x + AHEAD * dx, y + AHEAD * dy)
                inside = here & strip(start, end, inlet.width)
                if _area(inside) >= DUST:
                    said = f"layer {layer.index} ({layer.name}) closes the inlet of {inlet.chamber}"
                    yield _Held(layer, inside.edges[0].at(0.5), said)


def _area(region: Region) -> float:
    return 0.0 if region.is_empty else region.area
