"""Freedoms: the possible displacement of each layer in the finished laminate.

Layers are joined in the steps of the lay-up. A body is a piece of a layer, or all pieces that an
earlier step has joined. Two pins locate a body to within the pin error and the play in its holes;
on one pin it may also rotate; a body without pins is placed by hand on the film below it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import chain, combinations, count, pairwise, repeat, takewhile
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.design.sections import Registration
from sbafab.geometry.contour import nanometres
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, centroid
from sbafab.geometry.spatial_index import boxes_meet
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import LOOSE, Laminate
from sbafab.laminate.lay_up import LayUpStep, lay_up_steps


def error_on_pins(design: Design, laminate: Laminate) -> float:
    """Return the largest displacement of a layer on its pins, mm."""
    return design.pin_error if len(laminate.pins) > 1 else design.lone_pin_error


class Part(NamedTuple):
    """A piece of a layer: the layer's index and the piece's index in ``profile.pieces``."""

    layer: int
    piece: int


class Freedom(NamedTuple):
    """One possible displacement of a body: up to ``most`` mm in any direction or, with a
    ``centre``, a rotation about it of up to ``most`` radians.

    The body extends from layer ``lowest`` to ``highest``; ``body`` distinguishes it from others in
    the same ``step``. ``pins`` are the pins that hold it. ``seam`` is the seam's name if the body
    is a seam's path.
    """

    step: int
    body: int
    lowest: int
    highest: int
    pins: int
    most: float
    centre: Point | None = None
    seam: str = ""

    @property
    def by_hand(self) -> bool:
        """True for every rotation, and for the placement of a body without pins.

        A seam's position depends on its tool, as a cut edge's position depends on the laser.
        """
        return not self.seam and (self.centre is not None or self.pins == 0)

    def like(self) -> tuple[object, ...]:
        """The key of freedoms that differ only in step and body."""
        centre = self.centre and (nanometres(self.centre[0]), nanometres(self.centre[1]))
        return self.most, centre, self.pins, bool(self.seam)


Ways = tuple[Freedom, ...]


Freedoms = Mapping[Part, Ways]
"""Freedoms of each piece of each layer; pieces that share a freedom share the object."""


def unshared(moves: Freedoms, layers: Iterable[int]) -> list[Ways]:
    """Return the freedoms of each piece of these layers, in order, without those shared by all."""
    parts = (takewhile(moves.__contains__, map(Part, repeat(layer), count())) for layer in layers)
    every = [moves[part] for part in chain.from_iterable(parts)]
    shared = set.intersection(*(set(map(id, ways)) for ways in every))
    return [tuple([way for way in ways if id(way) not in shared]) for ways in every]


class Laid(NamedTuple):
    """A body as laid in a step, with its play on the ``pins`` that hold it.

    A body without pins is laid on the part ``under`` it. ``centre`` is its point of rotation.
    ``stays``: it is the lowest body of a step without pins.
    """

    body: Sequence[Part]
    step: int
    pins: Mapping[Point, float]
    centre: Point
    under: Part | None
    stays: bool


def lay_up(laminate: Laminate) -> list[Laid]:
    """Return all bodies in the order of laying, for any tolerances."""
    shapes = _Shapes(laminate)
    bodies = [[part] for layer in laminate.layers for part in shapes.parts(layer.index)]
    laid: list[Laid] = []
    for step in lay_up_steps(laminate):
        layers = frozenset(step.layers)
        present = sorted(body for body in bodies if body[0].layer in layers)
        pins_of_bodies = [shapes.pins(body, step) for body in present]
        for body, pins in zip(present, pins_of_bodies, strict=True):
            under = None if pins else shapes.under(body, present)
            # The lowest body of a step without pins stays: the others are laid on it.
            stays = not pins and under is None and not any(pins_of_bodies)
            centre = next(iter(pins), None) or shapes.centre(body)
            laid.append(Laid(body, step.number, pins, centre, under, stays))
        bodies = [body for body in bodies if body[0].layer not in layers]
        bodies += shapes.joined(present)
    return laid


def freedoms(laminate: Laminate, design: Design, laid: Sequence[Laid]) -> Freedoms:
    """Return the freedoms of each piece of each layer, from all its steps.

    The relative displacement of two pieces depends on the freedoms that they do not share. ``laid``
    is the result of ``lay_up``.
    """
    counts = {name: len(layers[0].profile.pieces) for name, layers in laminate.patterns.items()}
    by_part: dict[Part, Ways] = {
        Part(layer.index, piece): ()
        for layer in laminate.layers
        for piece in range(counts[layer.pattern])
    }
    on_pins = error_on_pins(design, laminate)
    for number, item in enumerate(laid, 1):
        ways = () if item.stays else _body_freedoms(item, number, design.registration, on_pins)
        if item.under is not None:
            ways = (*by_part[item.under], *ways)
        for part in item.body:
            by_part[part] += ways
    for seam in laminate.seams:
        by_part |= _of_seam(laminate, seam, by_part, design)
    return by_part


def seam_part(seam: Seam, piece: int = 0) -> Part:
    """Return a seam's region as a part with a negative layer index, which no film has."""
    return Part(-seam.order, piece)


def _of_seam(
    laminate: Laminate, seam: Seam, by_part: Mapping[Part, Ways], design: Design
) -> dict[Part, Ways]:
    """Return the freedoms of a seam: its tool's, and those of the film above, its base."""
    films = laminate.layer(seam.above).profile.pieces
    under = next((n for n, film in enumerate(films) if not (film & seam.region).is_empty), 0)
    steps = (s.number for s in lay_up_steps(laminate) if s.joining and s.joining.seam is seam)
    most, layer = design.registration.error_of_seam(seam.tool), seam_part(seam).layer
    step = next(steps, seam.order)
    off = Freedom(step, layer, seam.below, seam.above, 0, most, seam=seam.name)
    ways = (*by_part[Part(seam.above, under)], *((off,) if most > 0 else ()))
    return {seam_part(seam, piece): ways for piece in range(len(seam.region.pieces))}


def _body_freedoms(laid: Laid, number: int, hand: Registration, on_pins: float) -> Ways:
    """Return the freedoms that a step gives a body, up to ``on_pins`` mm off on its pins."""
    pins = laid.pins
    shift = on_pins + min(pins.values()) if pins else hand.hand_placement
    turn, centre = math.radians(hand.hand_turn), laid.centre
    if len(pins) >= 2:
        turn, centre = _turn_on(pins)
    lowest, highest = min(laid.body).layer, max(laid.body).layer
    both = ((shift, None), (turn, centre))
    return tuple(
        Freedom(laid.step, number, lowest, highest, len(pins), most, about)
        for most, about in both
        if most > 0
    )


def _turn_on(pins: Mapping[Point, float]) -> tuple[float, Point]:
    """Return the largest rotation (radians) that play on pins allows a body, and its centre.

    The pair of pins that restrains it most decides; their play divides the distance between them at
    the centre.
    """
    turns = []
    for (a, loose_a), (b, loose_b) in combinations(pins.items(), 2):
        both = loose_a + loose_b
        share = loose_a / both if both else 0.0
        centre = a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share
        turns.append((both / math.dist(a, b), centre))
    return min(turns)


class _Shapes:
    """The pieces of the layers; each pattern is examined once."""

    def __init__(self, laminate: Laminate) -> None:
        self.laminate = laminate
        pieces = {name: layers[0].profile.pieces for name, layers in laminate.patterns.items()}
        self.pieces = {layer.index: pieces[layer.pattern] for layer in laminate.layers}
        # Not methods: what is cached must not hold these shapes. Equal patterns share regions.
        self.centroid = cache(centroid)
        self.meet = cache(_overlap)
        self.play = cache(lambda region: _play_on_pins(laminate, region))

    def parts(self, layer: int) -> list[Part]:
        return [Part(layer, i) for i in range(len(self.pieces[layer]))]

    def _region(self, part: Part) -> Region:
        return self.pieces[part.layer][part.piece]

    def pins(self, body: Iterable[Part], step: LayUpStep) -> dict[Point, float]:
        """Return the centres of the step's pins that hold a part, and the play on each, mm."""
        play: dict[str, float] = {}
        for part in body if step.pins else ():
            for name, loose in self.play(self._region(part)).items():
                play[name] = min(loose, play.get(name, loose))
        return {pin.centre: play[pin.name] for pin in step.pins if pin.name in play}

    def centre(self, body: Sequence[Part]) -> Point:
        """Return the area centroid of all the body's parts."""
        area = x = y = 0.0
        for part in body:
            region = self._region(part)
            px, py = self.centroid(region)
            area, x, y = area + region.area, x + px * region.area, y + py * region.area
        return x / area, y / area

    def under(self, body: Sequence[Part], present: Sequence[Sequence[Part]]) -> Part | None:
        """Return the part under a body placed by hand: the highest film of the body below."""
        lowest = min(body).layer
        feet = [self._region(part) for part in body if part.layer == lowest]
        below = [(part, lower) for lower in present for part in lower if part.layer < lowest]
        for part, lower in sorted(below, reverse=True):
            if any(self.meet(self._region(part), foot) for foot in feet):
                films = [p for p in lower if not self.laminate.layer(p.layer).is_mask]
                return max(films or lower)
        return None

    def joined(self, present: Sequence[list[Part]]) -> list[list[Part]]:
        """Return the bodies after a step: overlapping parts are joined."""
        leader = {part: body[0] for body in present for part in body}

        def first(part: Part) -> Part:
            while leader[part] != part:
                part = leader[part]
            return part

        for lower, upper in pairwise(sorted({part.layer for part in leader})):
            for a in self.parts(lower):
                for b in self.parts(upper):
                    if self.meet(self._region(a), self._region(b)):
                        low, high = sorted((first(a), first(b)))
                        leader[high] = low
        merged: dict[Part, list[Part]] = {}
        for part in sorted(leader):
            merged.setdefault(first(part), []).append(part)
        return list(merged.values())


def _overlap(a: Region, b: Region) -> bool:
    """Return True if two regions overlap."""
    return boxes_meet(a.bounds, b.bounds) and not (a & b).is_empty


def _play_on_pins(laminate: Laminate, part: Region) -> dict[str, float]:
    """Return the pins that hold a part, and its play on each in the drawn hole, mm."""
    circles = [hole.circle for hole in part.holes if hole.circle is not None]
    return {
        pin.name: max(
            0.0,
            min(r for centre, r in circles if math.dist(centre, pin.centre) < LOOSE)
            - pin.diameter / 2,
        )
        for pin in laminate.pins_in(part)
    }
