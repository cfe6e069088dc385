"""channel-clear: the common opening of all layers along a channel passes its diameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from sbafab.geometry.edges import Edge, Point, distance_to
from sbafab.laminate.laminate import LOOSE, Laminate, Layer, Pin
from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.limits import holds
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import Clause, explained, layer_name, say

# Channels: chamber bores and the lumen, and the layers each runs through; pins that stand in none.


class Channel(NamedTuple):
    """A channel, with one layer of each pattern that must be open along it.

    ``has_axis``: all openings must be coaxial, since a pin or tube stands in the channel.
    """

    name: Clause
    centre: Point
    diameter: float
    layers: tuple[Layer, ...]
    has_axis: bool = True


def channels(laminate: Laminate) -> list[Channel]:
    """Return the bores, each through the balloons of its chamber, and the lumen, through every
    layer.

    If nets declare the connections, a bore consists of the holes in the films at its position:
    masks continue over them, and air may pass a film elsewhere.
    """
    gaps = [gap for gap in laminate.interfaces if gap.kind == "chamber"]
    spans = {
        chamber.name: [gap for number, gap in enumerate(gaps, start=1) if chamber.is_in(number)]
        for chamber in laminate.chambers
    }
    passages = []
    for bore in laminate.bores if gaps else ():
        span = spans.get(bore.chamber) or gaps
        bottom, top = span[0].below.index, span[-1].above.index
        within = [layer for layer in laminate.layers if bottom < layer.index < top]
        if laminate.nets:
            films = (layer for layer in within if not layer.is_mask)
            within = [film for film in films if not film.profile.contains(bore.centre)]
        if within:
            name = say("channel-clear.bore", chamber=bore.chamber)
            bored = _distinct(within)
            passages.append(Channel(name, bore.centre, bore.diameter, bored, not laminate.nets))
    if laminate.lumen is not None:
        layers = _distinct(laminate.layers)
        passages.append(Channel(say("channel-clear.lumen"), (0.0, 0.0), laminate.lumen, layers))
    return passages


ON_ONE_PIN = (("base", "wall", "cap"), ("separator-mask",), ("sheet",))
"""Roles whose layers have the same tooling holes."""


def tooling_pins(laminate: Laminate) -> list[Pin]:
    """Return the pins outside all bores and the lumen."""
    axes = [channel.centre for channel in channels(laminate)]
    return [
        pin for pin in laminate.pins if all(math.dist(pin.centre, axis) > LOOSE for axis in axes)
    ]


def _distinct(layers: Iterable[Layer]) -> tuple[Layer, ...]:
    first: dict[str, Layer] = {}
    for layer in layers:
        first.setdefault(layer.pattern, layer)
    return tuple(first.values())


NAME = "channel-clear"

GOLDEN = (math.sqrt(5) - 1) / 2
FINE = 2e-5
"""mm: how near the place of the best clearance is found; the clearance itself is far nearer."""


def check(measures: Measures) -> list[Finding]:
    """Return the diameter that passes through each channel, worst case first."""
    laminate = measures.laminate
    clearances = [(channel, *_clear(channel)) for channel in channels(laminate)]
    if not clearances:
        sentence = "no-bore" if laminate.nets else "none"
        return [judged(NAME, True, None, None, "mm", Place(), sentence)]
    channel, diameter, p, layer = min(clearances, key=lambda row: row[1] - row[0].diameter)
    place, limit = Place(None, (layer.index,), *p), channel.diameter
    facts = {"channel": channel.name, "layer": layer_name(layer)}
    good = holds(diameter, limit)
    return [judged(NAME, good, limit, diameter, "mm", place, "passes", **facts)]


RULE = Rule(NAME, check, explained(NAME))


def _clear(channel: Channel) -> tuple[float, Point, Layer]:
    """Return the diameter that passes through a channel, its position, and the tightest layer."""
    closed = next((a for a in channel.layers if a.profile.contains(channel.centre)), None)
    if closed is not None:
        return 0.0, channel.centre, closed
    room = {layer.index: layer.profile.distance_to_edge(channel.centre) for layer in channel.layers}
    tightest = min(channel.layers, key=lambda layer: room[layer.index])
    radius = room[tightest.index]
    # A circle round the axis cannot be beaten from any other place.
    circles = [hole.circle for hole in tightest.profile.holes if hole.circle is not None]
    if any(math.dist(c, channel.centre) < 1e-6 and abs(r - radius) < 1e-6 for c, r in circles):
        return 2 * radius, channel.centre, tightest
    near = [layer for layer in channel.layers if room[layer.index] < 2 * channel.diameter]
    # The nearest edge to any place within reach is no further from the axis than this.
    edges = {
        layer.index: [
            edge
            for edge in layer.profile.edges
            if distance_to(edge, channel.centre) <= room[layer.index] + 1.5 * channel.diameter
        ]
        for layer in near
    }

    def clearance(p: Point) -> float:
        return min(_signed_room(layer, edges[layer.index], p) for layer in near)

    best = _highest(clearance, channel.centre, channel.diameter / 2)
    tightest = min(near, key=lambda layer: _signed_room(layer, edges[layer.index], best))
    return max(0.0, 2 * clearance(best)), best, tightest


def _signed_room(layer: Layer, edges: Sequence[Edge], p: Point) -> float:
    """Return the distance to the nearest edge, negative inside the film."""
    room = min(distance_to(edge, p) for edge in edges)
    return -room if layer.profile.contains(p) else room


def _highest(value: Callable[[Point], float], start: Point, reach: float) -> Point:
    """Return the maximum of a concave function, by nested golden-section search in x and y."""

    def best_y(x: float) -> float:
        return _golden(lambda y: value((x, y)), start[1] - reach, start[1] + reach)

    x = _golden(lambda x: value((x, best_y(x))), start[0] - reach, start[0] + reach)
    return x, best_y(x)


def _golden(value: Callable[[float], float], low: float, high: float) -> float:
    points: Sequence[float] = (high - GOLDEN * (high - low), low + GOLDEN * (high - low))
    a, b = points
    at_a, at_b = value(a), value(b)
    while high - low > FINE:
        if at_a > at_b:
            high, b, at_b = b, a, at_a
            a = high - GOLDEN * (high - low)
            at_a = value(a)
        else:
            low, a, at_a = a, b, at_b
            b = low + GOLDEN * (high - low)
            at_b = value(b)
    return (low + high) / 2
