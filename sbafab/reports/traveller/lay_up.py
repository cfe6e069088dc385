"""The contents of a lay-up step: stacks, rounds of layers, and alignment by hand."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.geometry.cache import cached
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Inlet, Laminate, Layer
from sbafab.laminate.lay_up import LayUpStep, distinct_layers
from sbafab.reports.drawing import layer_numbers

LONGEST_ROUND = 12
INSIDE = 0.1  # mm inward of its mouth at which a tab is searched
STATION = 0.25  # spacing of the points at which two edges are compared, mm
EQUAL = 0.02  # distances that differ by less are the same to a hand, mm


class Round:
    """Layers laid repeatedly in one order; ``turns`` holds every turn, ``places`` the layers of all
    turns at the same place in the round.
    """

    def __init__(self, turns: Sequence[tuple[Layer, ...]]) -> None:
        self.turns, self.count = turns, len(turns)
        self.places = tuple(zip(*turns, strict=True))
        self.layers = [layer for turn in turns for layer in turn]
        self.first, self.last = self.layers[0], self.layers[-1]


def rounds(layers: Sequence[Layer]) -> tuple[Round, ...]:
    """Return the layers in order, with repetitions grouped; a layer without repetition is a round
    of one.
    """
    keys = [(layer.pattern, layer.role) for layer in layers]
    gathered: list[Round] = []
    start = 0
    while start < len(layers):
        period, count = _repetition(keys[start:])
        ends = range(start + period, start + period * count + 1, period)
        gathered.append(Round([tuple(layers[end - period : end]) for end in ends]))
        start += period * count
    return tuple(gathered)


def _repetition(keys: Sequence[object]) -> tuple[int, int]:
    """Return period and count of the longest repetition at the start; (1, 1) without one."""
    best = 1, 1
    for period in range(1, min(LONGEST_ROUND, len(keys) // 2) + 1):
        count = 1
        while keys[count * period : (count + 1) * period] == keys[:period]:
            count += 1
        if count > 1 and count * period > best[0] * best[1]:
            best = period, count
    return best


@dataclass(frozen=True)
class Bed:
    """One of the stacks that a step lays on each other; ``made_in`` is its step, or None for single
    layers from the sheet.
    """

    layers: tuple[int, ...]
    made_in: int | None


def beds(steps: Sequence[LayUpStep], step: LayUpStep) -> tuple[Bed, ...]:
    """Return the stacks of a step, lowest first."""
    before = [earlier for earlier in reversed(steps) if earlier.number < step.number]
    makers = (
        next((e.number for e in before if set(e.layers) == set(stack)), None)
        for stack in step.stacks
    )
    return tuple(map(Bed, step.stacks, makers))


def inlets_in(laminate: Laminate, layers: Sequence[int]) -> tuple[Inlet, ...]:
    """Return the inlets with a tab in at least one of the layers."""
    shapes = [layer.profile for layer in distinct_layers(laminate, layers)]

    def tab(inlet: Inlet) -> Point:
        (x, y), (u, v) = inlet.mouth, inlet.direction
        return x - INSIDE * u, y - INSIDE * v

    return tuple(
        inlet for inlet in laminate.inlets if any(shape.contains(tab(inlet)) for shape in shapes)
    )


# Alignment of layers laid by hand: along an edge, or at a place on their sheet.


@dataclass(frozen=True)
class PiecePlace:
    """The place of a piece: mm from the lower left corner of its sheet.

    ``x`` and ``y`` are those of the balloon's middle, ``left`` and ``low`` of the piece's edges.
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
    ``layer`` is the one in a stack, 0 for a single layer. The edge may also lie ``on`` the edge of
    a film of the same stack. Neighbours are named, and numbered by ``numbers``.
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
    """The items of a lay-up step, lowest first: single layers, and each stack of earlier steps."""

    def __init__(self, laminate: Laminate, lying: Sequence[Bed]) -> None:
        self.laminate = laminate
        self.things: list[tuple[int, ...]] = []
        for bed in lying:
            self.things += [(i,) for i in bed.layers] if bed.made_in is None else [bed.layers]

    def is_lowest(self, index: int) -> bool:
        """Return True if the layer is the lowest in the step."""
        return self.things[0][0] == index

    def alignment(self, index: int) -> Alignment | None:
        """Return the alignment of the edge of a layer, or of the stack above it; None if there is
        none.

        It is the edge below, or for the lowest layer the one above; a sheet's edges are too far
        away.
        """
        place = next(i for i, thing in enumerate(self.things) if thing[0] == index)
        if len(self.things) < 2:
            return None
        beside = self.things[place - 1 if place else 1]
        layer = _widest(self.laminate, self.things[place])
        neighbour = _widest(self.laminate, beside[::-1] if place else beside)
        layer_index = layer.index if len(self.things[place]) > 1 else 0
        edge = layer_index, len(layer.profile.pieces) > 1, film_name(neighbour), place == 0
        lip = _lip(layer.profile, neighbour.profile)
        if lip is None:
            return Alignment(*edge) if neighbour.role == "sheet" else None
        films = [i for i in beside if not self.laminate.layer(i).is_mask] or beside
        upper = self.laminate.layer(films[-1]) if place else neighbour
        is_on = upper is not neighbour and _lip(layer.profile, upper.profile) == (0.0, True)
        outside, on = 0.0 if abs(lip[0]) < EQUAL else lip[0], film_name(upper) if is_on else ""
        return Alignment(*edge, outside, lip[1], on, (neighbour.index, upper.index))


def face_down(layer: Layer, is_turned_over: bool = False) -> str:
    """Return the face of a layer that is laid down, ", tpu face down", also on turned work; empty
    for a film with equal faces, laid as cut.
    """
    upper, lower = layer.faces
    if upper != lower:
        return f", {upper if is_turned_over else lower} face down"
    return "" if layer.turned == is_turned_over else ", upper face down"


def layer_words(layer: Layer) -> str:
    """Return material, use, pattern and pieces of a layer, and its orientation."""
    pieces = len(layer.profile.pieces)
    loose = f" in {pieces} pieces" if pieces > 1 else ""
    return f"{film_name(layer)} {layer.pattern}{loose}{face_down(layer)}"


def film_name(layer: Layer) -> str:
    """Return the material and the use of a layer: "TPE wall"."""
    return f"{layer.film.material} {layer.role.replace('-', ' ')}"


def over_tab(laminate: Laminate, layers: Sequence[int]) -> Layer | None:
    """Return the lowest separator mask among layers around one axis that extends to one side.

    It extends over the inlet tab, under a balloon larger than those between. None if there is none.
    """
    if len(laminate.chambers) != 1 or len(laminate.chambers[0].centres) > 1:
        return None
    (x, y), (dx, dy) = laminate.chambers[0].centres[0], laminate.inlets[0].direction
    turn = -math.degrees(math.atan2(dy, dx))
    for mask in map(laminate.layer, layers):
        if mask.role == "separator-mask":
            low_x, _, high_x, _ = mask.profile.moved(-x, -y).turned(turn).bounds
            if high_x + low_x > EQUAL:
                return mask
    return None


@cached
def _lip(region: Region, reference: Region) -> tuple[float, bool] | None:
    """Return the distance in mm of a region's outline outside another's, negative inside, and True
    if it is outside everywhere; None if the distance mostly varies.
    """
    outline = Region(reference.outers)
    distances = []
    for edge in (edge for contour in region.outers for edge in contour.edges):
        count = math.ceil(edge.length / STATION)
        for p in (edge.at((i + 0.5) / count) for i in range(count)):
            distance = outline.distance_to_edge(p)
            distances.append(-distance if outline.contains(p) else distance)
    distances.sort()
    usual = distances[len(distances) // 2]
    near = sum(abs(distance - usual) < EQUAL for distance in distances)
    if 2 * near < len(distances):
        return None
    return round(usual, 2) + 0.0, near == len(distances)


def places(laminate: Laminate, step: LayUpStep, lying: Sequence[Bed]) -> list[PiecePlace]:
    """Return the places of all parts laid on a sheet by hand; empty for steps without a sheet."""
    sheet = laminate.layers[0]
    if step.pins or sheet.role != "sheet" or sheet.index not in step.layers:
        return []
    things = Things(laminate, lying).things
    return [place for thing in things[1:] for place in _piece_places(laminate, sheet, thing)]


def pitch(piece_places: Sequence[PiecePlace]) -> float | None:
    """Return the pitch of the pieces along x; None for a single piece."""
    xs = {place.piece: place.x for place in reversed(piece_places)}
    return xs[2] - xs[1] if 2 in xs else None


def _piece_places(laminate: Laminate, sheet: Layer, thing: Sequence[int]) -> Iterator[PiecePlace]:
    layer = _widest(laminate, thing)
    sheet_left, sheet_low = sheet.profile.bounds[:2]
    single = f"layer {layer.index}, {film_name(layer)}"
    words = single if len(thing) == 1 else f"stack of layers {layer_numbers(thing)}"
    centres = [centre for chamber in laminate.chambers for centre in chamber.centres]
    for number, piece in enumerate(sorted(layer.profile.pieces, key=lambda p: p.bounds), 1):
        outline, (left, low, right, high) = Region(piece.outers), piece.bounds
        middle = (left + right) / 2, (low + high) / 2
        inside = [centre for centre in centres if outline.contains(centre)] or [middle]
        x, y = (sum(values) / len(inside) for values in zip(*inside, strict=True))
        ends = x - sheet_left, y - sheet_low, left - sheet_left, low - sheet_low
        yield PiecePlace(words, number, *ends)


def _widest(laminate: Laminate, layers: Sequence[int]) -> Layer:
    """Return the first layer whose outline is visible around all others."""
    reach = {
        layer.pattern: round(sum(contour.area for contour in layer.profile.outers), 6)
        for layer in distinct_layers(laminate, layers)
    }
    most = max(reach.values())
    layer = (laminate.layer(index) for index in layers)
    return next(candidate for candidate in layer if reach[candidate.pattern] == most)
