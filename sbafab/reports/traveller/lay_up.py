"""Alignment of layers laid by hand: along an edge, or at a place on their sheet."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.geometry.cache import cached
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.laminate.lay_up import LayUpStep, distinct_layers
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.traveller.shapes import Bed

STATION = 0.25
"""Spacing of the points at which two edges are compared, mm."""


EQUAL = 0.02
"""Distances that differ by less than this are the same to a hand, mm."""


class Lip(NamedTuple):
    """Distance in mm by which an edge lies outside another, below 0 inside; ``all_round`` if it
    does so without breaks.
    """

    outside: float
    all_round: bool


@dataclass(frozen=True)
class PiecePlace:
    """The place of a piece: mm from the lower left corner of its sheet.

    ``x`` and ``y`` are of the balloon's middle, ``left`` and ``low`` of the piece's edges.
    """

    what: str
    piece: int
    x: float
    y: float
    left: float
    low: float


class Alignment(NamedTuple):
    """The edge of a layer and of its neighbour in a step, or of the stack above the layer.

    It lies ``outside`` the ``neighbour``, mm; None if each piece has its place in the table.
    ``layer`` is the one in a stack, 0 for a layer by itself. The edge may also lie ``on`` the edge
    of a film of the same stack. Neighbours are named, and numbered by ``numbers``.
    """

    layer: int
    is_several: bool
    neighbour: str
    is_above: bool
    outside: float | None = None
    all_round: bool = False
    on: str = ""
    numbers: tuple[int, int] = (0, 0)


class Things:
    """The items that a step lays, lowest first: single layers, and each stack of earlier steps."""

    def __init__(self, laminate: Laminate, lying: Sequence[Bed]) -> None:
        self.laminate = laminate
        self.things: list[tuple[int, ...]] = []
        for bed in lying:
            self.things += [(i,) for i in bed.layers] if bed.made_in is None else [bed.layers]

    def is_lowest(self, index: int) -> bool:
        """Return True if nothing lies under this layer in the step."""
        return self.things[0][0] == index

    def alignment(self, index: int) -> Alignment | None:
        """Return what the edge of a layer, or of the stack above it, is aligned with; None for
        nothing.

        It is the edge below, or for the lowest layer the one above; a sheet's edges are too far
        off.
        """
        place = next(i for i, thing in enumerate(self.things) if thing[0] == index)
        if len(self.things) < 2:
            return None
        beside = self.things[place - 1 if place else 1]
        layer = _widest(self.laminate, self.things[place], highest=False)
        neighbour = _widest(self.laminate, beside, highest=place > 0)
        own = layer.index if len(self.things[place]) > 1 else 0
        edge = Alignment(own, len(layer.profile.pieces) > 1, film_name(neighbour), place == 0)
        edge_lip = lip(layer.profile, neighbour.profile)
        if edge_lip is None:
            return edge if neighbour.role == "sheet" else None
        films = [i for i in beside if not self.laminate.layer(i).is_mask] or beside
        upper = self.laminate.layer(films[-1]) if place else neighbour
        is_on = upper is not neighbour and lip(layer.profile, upper.profile) == (0.0, True)
        return edge._replace(
            outside=0.0 if abs(edge_lip.outside) < EQUAL else edge_lip.outside,
            all_round=edge_lip.all_round,
            on=film_name(upper) if is_on else "",
            numbers=(neighbour.index, upper.index),
        )


def face_down(layer: Layer, is_turned_over: bool = False) -> str:
    """Return the face of a layer that is laid down, ", tpu face down", also on work that is turned
    over; empty for a film with equal faces, laid as it was cut.
    """
    upper, lower = layer.faces
    if upper != lower:
        return f", {upper if is_turned_over else lower} face down"
    return "" if layer.turned == is_turned_over else ", upper face down"


def layer_words(layer: Layer) -> str:
    """Return material, use, pattern and pieces of a layer, and how it is laid."""
    pieces = len(layer.profile.pieces)
    loose = f" in {pieces} pieces" if pieces > 1 else ""
    return f"{film_name(layer)} {layer.pattern}{loose}{face_down(layer)}"


def over_tab(laminate: Laminate, layers: Sequence[int]) -> Layer | None:
    """Return the lowest separator mask among layers around one axis that reaches out to one side.

    It reaches out over the inlet tab, under a balloon larger than those between. None without one.
    """
    if len(laminate.chambers) != 1 or len(laminate.chambers[0].centres) > 1:
        return None
    (x, y), (dx, dy) = laminate.chambers[0].centres[0], laminate.inlets[0].direction
    turn = -math.degrees(math.atan2(dy, dx))
    masks = [layer for layer in map(laminate.layer, layers) if layer.role == "separator-mask"]
    for mask in masks:
        low_x, _, high_x, _ = mask.profile.moved(-x, -y).turned(turn).bounds
        if high_x + low_x > EQUAL:
            return mask
    return None


@cached
def lip(region: Region, reference: Region) -> Lip | None:
    """Return the distance between the outlines of two regions; None if it mostly varies."""
    outline = Region(reference.outers)
    distances = []
    for contour in region.outers:
        for edge in contour.edges:
            count = math.ceil(edge.length / STATION)
            for i in range(count):
                p = edge.at((i + 0.5) / count)
                distance = outline.distance_to_edge(p)
                distances.append(-distance if outline.contains(p) else distance)
    distances.sort()
    usual = distances[len(distances) // 2]
    near = sum(abs(distance - usual) < EQUAL for distance in distances)
    if 2 * near < len(distances):
        return None
    return Lip(round(usual, 2) + 0.0, near == len(distances))


def places(laminate: Laminate, step: LayUpStep, lying: Sequence[Bed]) -> tuple[PiecePlace, ...]:
    """Return the places of everything laid on a sheet by hand; empty for steps without a sheet."""
    sheet = laminate.layers[0]
    if step.pins or sheet.role != "sheet" or sheet.index not in step.layers:
        return ()
    things = Things(laminate, lying).things
    return tuple(place for thing in things[1:] for place in _piece_places(laminate, sheet, thing))


def pitch(piece_places: Sequence[PiecePlace]) -> float | None:
    """Return the distance from one piece to the next along x; None for a single piece."""
    first, second = (
        next((p for p in piece_places if p.piece == number), None) for number in (1, 2)
    )
    return second.x - first.x if first and second else None


def _piece_places(laminate: Laminate, sheet: Layer, thing: Sequence[int]) -> Iterator[PiecePlace]:
    layer = _widest(laminate, thing, highest=False)
    sheet_left, sheet_low = sheet.profile.bounds[:2]
    single = f"layer {layer.index}, {film_name(layer)}"
    words = single if len(thing) == 1 else f"stack of layers {layer_numbers(thing)}"
    centres = [centre for chamber in laminate.chambers for centre in chamber.centres]
    pieces = sorted(layer.profile.pieces, key=lambda piece: piece.bounds)
    for number, piece in enumerate(pieces, 1):
        outline = Region(piece.outers)
        inside = [centre for centre in centres if outline.contains(centre)] or [
            _middle(piece.bounds)
        ]
        x, y = (sum(values) / len(inside) for values in zip(*inside, strict=True))
        yield PiecePlace(
            words,
            number,
            x - sheet_left,
            y - sheet_low,
            piece.bounds[0] - sheet_left,
            piece.bounds[1] - sheet_low,
        )


def _middle(bounds: Bounds) -> Point:
    return (bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2


def _widest(laminate: Laminate, layers: Sequence[int], highest: bool) -> Layer:
    """Return the layer whose outline is visible around all others; the highest or lowest of
    several.
    """
    reach = {
        layer.pattern: round(sum(contour.area for contour in layer.profile.outers), 6)
        for layer in distinct_layers(laminate, layers)
    }
    most = max(reach.values())
    wide = [i for i in layers if reach[laminate.layer(i).pattern] == most]
    return laminate.layer(wide[-1] if highest else wide[0])


def film_name(layer: Layer) -> str:
    """Return the material and the use of a layer: "TPE wall"."""
    return f"{layer.film.material} {layer.role.replace('-', ' ')}"
