"""bridges: they hold every part in its registered sheet, and the second cut frees just the part."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from sbafab.geometry.edges import Point
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region
from sbafab.geometry.width import least_width
from sbafab.laminate.laminate import Laminate, Layer, SheetPanel, freed
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import TOLERANCE, Limits, at, holds
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Explanation, Rule

NAME = "bridges"
LEAST = 0.5
"""mm that a bridge is wide at least, so that it holds while the sheet is handled (ours)."""
FEWEST = 2
"""Bridges that keep a part from turning in its sheet."""


class _Bridge(NamedTuple):
    width: float
    at: Point
    layer: Layer


class _Wrong(NamedTuple):
    layer: Layer
    at: Point
    message: str


def check(measures: Measures) -> list[Finding]:
    """The narrowest bridge; fails as well where a part is loose, or not freed as it should be."""
    laminate, limits = measures.laminate, measures.limits
    limit = max(LEAST, limits.least_feature)
    panel = laminate.panel
    if panel is None:
        message = "no part is held by bridges"
        return [Finding(NAME, "pass", limit, None, "mm", Place(), message)]
    wrong = next(_wrong(laminate, panel, limits), None)
    if wrong is not None:
        layer, spot, message = wrong
        place = Place(None, (layer.index,), *spot)
        return [Finding(NAME, "fail", limit, None, "mm", place, message)]
    narrow = min(
        (bridge for layer in sheeted(laminate) for bridge in _bridges(panel, layer)),
        key=lambda bridge: round(bridge.width, 6),
    )
    message = (
        f"every part hangs on {FEWEST} bridges or more, the narrowest {narrow.width:.3f} mm wide "
        f"in layer {narrow.layer.index} ({narrow.layer.name}), {at(narrow.at)}"
    )
    good = holds(narrow.width, limit)
    if not good:
        message += f"; {limit:g} is needed: make panel.bridge_width larger"
    place = Place(None, (narrow.layer.index,), *narrow.at)
    return [Finding(NAME, "pass" if good else "fail", limit, narrow.width, "mm", place, message)]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "every part hangs in its registered sheet by bridges that the second cut frees",
        "A part that hangs on too little shifts; one that is not freed is torn off.",
        "Make panel.bridge_width larger, or move the copies apart with panel.web.",
        ("panel.bridge_width", "panel.second_cut_error"),
    ),
)


def sheeted(laminate: Laminate, masks: bool = False) -> list[Layer]:
    """One layer of every distinct film sheet, or of every mask sheet."""
    panel = laminate.panel
    if panel is None:
        return []
    distinct: dict[tuple[str, str], Layer] = {}
    for layer in laminate.layers:
        if layer.is_mask == masks:
            distinct.setdefault((panel.sheets[layer.index - 1].key, layer.pattern), layer)
    return list(distinct.values())


def _wrong(laminate: Laminate, panel: SheetPanel, limits: Limits) -> Iterator[_Wrong]:
    """Faults of the sheets that no width measures."""
    films, masks = sheeted(laminate), sheeted(laminate, masks=True)
    for layer in films:
        yield from _loose(panel, layer)
    for layer in (*films, *masks):
        yield from _misfreed(panel, layer)
    needed = limits.bond_width + limits.tolerances.second_cut
    for layer in masks:
        if layer.role == "chamber-mask":
            near = grow(layer.profile, needed - TOLERANCE)
            yield from _cut_into(panel, layer, near, needed)
        else:
            yield from _welded(laminate, panel, layer, limits.tolerances.second_cut)


def _loose(panel: SheetPanel, layer: Layer) -> Iterator[_Wrong]:
    """Film that too few bridges hold."""
    named = f"layer {layer.index} ({layer.name})"
    spot = _beyond(panel.sheets[layer.index - 1])
    if spot is not None:
        yield _Wrong(layer, spot, f"no bridge holds what {named} has at {at(spot)}; add one")
    bridges = _bridges(panel, layer)
    for place in panel.places:
        count = sum(panel.holds(bridge.at, place) for bridge in bridges)
        if count < FEWEST:
            fault = f"{named} hangs on {count} bridges in the copy at {at(place)}"
            yield _Wrong(layer, place, f"{fault}, and needs {FEWEST}; add bridges")


def _misfreed(panel: SheetPanel, layer: Layer) -> Iterator[_Wrong]:
    """Parts that the cuts free otherwise than designed."""
    for place, part in zip(panel.places, freed(panel, layer).parts, strict=True):
        room = TOLERANCE * sum(contour.length for contour in layer.profile.contours)
        if part != layer.profile and mismatch_area(part, layer.profile) > room:
            state = "is still held after the second cut" if part.is_empty else "is cut otherwise"
            fault = f"layer {layer.index} ({layer.name}) {state} in the copy at {at(place)}"
            yield _Wrong(layer, place, f"{fault}; regenerate the sheets")


def mismatch_area(region: Region, reference: Region) -> float:
    """Area of the symmetric difference of two regions, mm2."""
    return sum(rest.area for rest in (region - reference, reference - region) if not rest.is_empty)


def _cut_into(panel: SheetPanel, layer: Layer, near: Region, needed: float) -> Iterator[_Wrong]:
    """Slots that an error of the second cut may bring too near to a pocket."""
    for place in panel.places:
        met = near.moved(*place) & panel.second
        if not met.is_empty:
            spot = met.edges[0].start
            fault = f"the second cut comes nearer than {needed:g} mm to the pocket of layer"
            text = f"{fault} {layer.index}, {at(spot)}; make panel.stub larger"
            yield _Wrong(layer, spot, text)


def _welded(laminate: Laminate, panel: SheetPanel, mask: Layer, error: float) -> Iterator[_Wrong]:
    """Rests of bridges past the mask between two balloons after an error of the second cut.

    There the bridges of all balloons weld to each other.
    """
    film = laminate.layer(mask.index - 1)
    rest = (grow(film.profile, error - TOLERANCE) & panel.second) - mask.profile
    if not rest.is_empty and rest.area > TOLERANCE * error:
        spot = rest.edges[0].start
        text = (
            f"a second cut {error:g} mm off leaves a bridge past the edge of layer {mask.index} "
            f"({mask.name}), where balloons weld together, {at(spot)}; make mask.overhang larger"
        )
        yield _Wrong(mask, spot, text)


def _beyond(sheet: Region) -> Point | None:
    """A place of a piece that is not joined to the sheet, or None."""
    pieces = sorted(sheet.pieces, key=lambda piece: -Region(piece.outers).area)
    return pieces[1].outers[0].edges[0].start if len(pieces) > 1 else None


def _bridges(panel: SheetPanel, layer: Layer) -> list[_Bridge]:
    """Bridges of a sheet, which the second cut removes; width is area by the slot's least width."""
    slot = least_width(panel.second)
    if slot is None:
        return []
    cut = panel.sheets[layer.index - 1] & panel.second
    return [
        _Bridge(piece.area / slot.value, _middle(piece), layer)
        for piece in cut.pieces
        if not piece.is_empty
    ]


def _middle(piece: Region) -> Point:
    x0, y0, x1, y1 = piece.bounds
    return (x0 + x1) / 2, (y0 + y1) / 2
