"""registration-nominal: as drawn, holes lie on their axes and pins, and balloon films coincide."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from sbafab.geometry.cache import cached
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.rules.channel_clear import ON_ONE_PIN, Channel, channels, tooling_pins
from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.measures import Measures, distinct_interfaces
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained, layer_name

NAME = "registration-nominal"


def check(measures: Measures) -> list[Finding]:
    """Return the largest deviation of a hole from its axis or pin, or of an outline."""
    laminate = measures.laminate
    departures = [*_off_axis(laminate), *_off_pins(laminate), *_off_outline(laminate)]
    if not departures:
        return [judged(NAME, True, TOLERANCE, None, "mm", Place(), "none")]
    _, worst = max(departures, key=lambda departure: departure[0])
    return [worst]


RULE = Rule(NAME, check, explained(NAME), at_most=True)


def _departure(
    off: float, layers: tuple[int, ...], p: Point, says: str, **facts: Any
) -> tuple[float, Finding]:
    """Return a deviation before rounding, and its finding."""
    good = off <= TOLERANCE + 1e-9
    sentence = "aligned" if good else says
    facts |= {"off": max(off, 1e-6)} if good else {}
    place = Place(None, layers, *p)
    return off, judged(NAME, good, TOLERANCE, off, "mm", place, sentence, **facts)


def _off_axis(laminate: Laminate) -> Iterator[tuple[float, Finding]]:
    for channel in channels(laminate):
        for layer in channel.layers if channel.has_axis else ():
            centre = _opening_centre(layer, channel)
            if centre is not None:
                off, of_layer = math.dist(centre, channel.centre), layer_name(layer)
                facts = {"layer": of_layer, "channel": channel.name}
                yield _departure(off, (layer.index,), centre, "off-axis", **facts)


def _opening_centre(layer: Layer, channel: Channel) -> Point | None:
    """Return the centre of the innermost round hole about the channel's axis."""
    round_ones = [
        hole.circle
        for hole in layer.profile.holes
        if hole.circle is not None and hole.winding(channel.centre) != 0
    ]
    return min(round_ones, key=lambda circle: circle[1])[0] if round_ones else None


def _off_pins(laminate: Laminate) -> Iterator[tuple[float, Finding]]:
    """Return tooling holes and their offset from the pin; a missing hole counts as its diameter."""
    for pin in tooling_pins(laminate):
        # The nearest round hole, at most the pin's diameter away.
        off = {
            name: min(
                [
                    pin.diameter,
                    *(math.dist(h.circle[0], pin.centre) for h in first.profile.holes if h.circle),
                ]
            )
            for name, (first, *_) in laminate.patterns.items()
        }
        for roles in ON_ONE_PIN:
            siblings = [layer for layer in laminate.layers if layer.role in roles]
            holed = sum(off[layer.pattern] < pin.diameter for layer in siblings)
            if 2 * holed > len(siblings):
                for layer in siblings:
                    facts = {"layer": layer_name(layer), "pin": pin.name}
                    value, index = off[layer.pattern], layer.index
                    yield _departure(value, (index,), pin.centre, "off-pin", **facts)


def _off_outline(laminate: Laminate) -> Iterator[tuple[float, Finding]]:
    for distinct in distinct_interfaces(laminate):
        interface = distinct.interface
        if interface.kind != "chamber" or interface.below.pattern == interface.above.pattern:
            continue
        below, above = (
            Region(layer.profile.outers) for layer in (interface.below, interface.above)
        )
        value, p = max(_farthest(below, above), _farthest(above, below), key=lambda entry: entry[0])
        pair = interface.below.index, interface.above.index
        yield _departure(value, pair, p, "off-outline", below=pair[0], above=pair[1])


@cached
def _farthest(region: Region, target: Region) -> tuple[float, Point]:
    """Return the largest distance of a region's edge points from ``target``, and where."""
    return max(
        (
            (target.index.distance(p), p)
            for edge in region.edges
            for p in (edge.start, edge.at(0.5))
        ),
        key=lambda entry: entry[0],
        default=(0.0, (0.0, 0.0)),
    )
