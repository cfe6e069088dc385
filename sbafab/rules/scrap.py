"""scrap: the scrap of registered sheets comes off the parts, and the inlets stay free.

A piece of scrap comes off upward or downward if no part lies over it, or none under it, and if it
is bonded to none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.nearby import widened
from sbafab.geometry.region import Region, rectangle, strip, union
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


class _Stuck(NamedTuple):
    layer: Layer
    at: Point
    fault: str


def check(measures: Measures) -> list[Finding]:
    """Return the number of pieces of scrap that do not come off the parts, or close an inlet."""
    laminate = measures.laminate
    panel = laminate.panel
    if panel is None:
        message = "no sheet is left round the parts"
        return [Finding(NAME, "pass", 0.0, 0.0, "pieces", Place(), message)]
    faults = [*_stuck_scrap(laminate, panel), *_closed(laminate, panel)]
    if not faults:
        message = "all scrap comes off after the second cut, and every inlet is free"
        return [Finding(NAME, "pass", 0.0, 0.0, "pieces", Place(), message)]
    first = faults[0]
    place = Place(None, (first.layer.index,), *first.at)
    message = f"{first.fault}, {at(first.at)}; give every sheet the window of the whole laminate"
    return [Finding(NAME, "fail", 0.0, float(len(faults)), "pieces", place, message)]


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


def _stuck_scrap(laminate: Laminate, panel: SheetPanel) -> Iterator[_Stuck]:
    """Scrap that is bonded to a part, or has parts over and under it."""
    placed = {layer.pattern: _copied(layer.profile, panel) for layer in laminate.tpe_layers}
    film_union = union({layer.pattern: layer.profile for layer in laminate.tpe_layers}.values())
    everywhere = _copied(film_union, panel)
    free: set[str] = set()
    for kind in (sheeted(laminate), sheeted(laminate, masks=True)):
        for layer in kind:
            remains = freed(panel, layer)
            for piece in (remains.frame, *remains.crumbs):
                if all(_is_free(piece, place, film_union, panel, free) for place in panel.places):
                    continue
                if _area(piece & everywhere) < DUST:
                    continue
                obstacle = _obstacle(laminate, panel, layer, piece, placed)
                if obstacle is not None:
                    yield _Stuck(layer, *obstacle)


def _copied(part: Region, panel: SheetPanel) -> Region:
    """A part at the places of all copies, which lie apart."""
    return Region(tuple(c for place in panel.places for c in part.moved(*place).contours))


def _is_free(
    piece: Region, place: Point, film_union: Region, panel: SheetPanel, free: set[str]
) -> bool:
    """True if the piece lies beside the part of a copy; ``free`` caches keys of such pieces."""
    here = _round(piece, place, panel)
    if here.key not in free and _area(here & film_union) < DUST:
        free.add(here.key)
    return here.key in free


def _round(piece: Region, place: Point, panel: SheetPanel) -> Region:
    """The piece within the room of one copy, in that copy's frame.

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


def _obstacle(
    laminate: Laminate, panel: SheetPanel, layer: Layer, piece: Region, placed: dict[str, Region]
) -> tuple[Point, str] | None:
    """Place at which a piece is bonded or locked in, with the reason; every equal layer counts."""
    key = panel.sheets[layer.index - 1].key
    for twin in laminate.layers:
        if twin.pattern != layer.pattern or panel.sheets[twin.index - 1].key != key:
            continue
        over = {
            film.index: piece & placed[film.pattern]
            for film in laminate.tpe_layers
            if film.index != twin.index
        }
        over = {index: region for index, region in over.items() if _area(region) >= DUST}
        for index, region in over.items():
            between = _between(laminate, panel, twin.index, index)
            if not twin.is_mask and between is not None and _area(region - between) >= DUST:
                fault = (
                    f"scrap of layer {twin.index} ({twin.name}) bonds to the part of layer {index}"
                )
                return (region - between).edges[0].at(0.5), fault
        if over and min(over) < twin.index < max(over):
            fault = (
                f"scrap of layer {twin.index} ({twin.name}) is locked in between the parts of "
                f"layers {min(over)} and {max(over)}"
            )
            return next(iter(over.values())).edges[0].at(0.5), fault
    return None


def _between(laminate: Laminate, panel: SheetPanel, index_a: int, index_b: int) -> Region | None:
    """The mask sheets between two films; None where another film lies there."""
    low, high = sorted((index_a, index_b))
    within: Sequence[Layer] = laminate.layers[low : high - 1]
    if not all(layer.is_mask for layer in within):
        return None
    return union(panel.sheets[layer.index - 1] for layer in within)


def _closed(laminate: Laminate, panel: SheetPanel) -> Iterator[_Stuck]:
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
                    fault = (
                        f"layer {layer.index} ({layer.name}) closes the inlet of {inlet.chamber}"
                    )
                    yield _Stuck(layer, inside.edges[0].at(0.5), fault)


def _area(region: Region) -> float:
    return 0.0 if region.is_empty else region.area
