"""registration-nominal: as drawn, holes lie on their axes and pins, a balloon's films congruent."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from sbafab.geometry.cache import cached
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate, Layer, Pin
from sbafab.rules.channel_clear import ON_ONE_PIN, Channel, channels, tooling_pins
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import TOLERANCE, at
from sbafab.rules.measures import Measures, distinct_interfaces
from sbafab.rules.rule import Explanation, Rule

NAME = "registration-nominal"


class _Departure(NamedTuple):
    value: float
    at: Point
    layers: tuple[int, ...]
    fault: str


def check(measures: Measures) -> list[Finding]:
    """The largest departure of a hole from its axis or pin, or of an outline from its twin."""
    laminate = measures.laminate
    limit = TOLERANCE
    departures = [*_off_axis(laminate), *_off_pins(laminate), *_off_outline(laminate)]
    if not departures:
        message = "no two layers have to lie over each other"
        return [Finding(NAME, "pass", limit, None, "mm", Place(), message)]
    worst = max(departures, key=lambda departure: departure.value)
    good = worst.value <= limit + 1e-9
    message = f"{worst.fault} by {worst.value:.4f} mm, {at(worst.at)}"
    if good:
        message = f"bores are coaxial and outlines congruent to {max(worst.value, 1e-6):.6f} mm"
    else:
        message += f"; {limit:g} is allowed: draw both from the same edge"
    place = Place(None, worst.layers, *worst.at)
    return [Finding(NAME, "pass" if good else "fail", limit, worst.value, "mm", place, message)]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "bores are coaxial and the two outlines of a balloon congruent, to 1 um",
        "What is drawn off its place is off before any hand has touched it.",
        "Draw both from the same edge.",
    ),
    at_most=True,
)


def _off_axis(laminate: Laminate) -> Iterator[_Departure]:
    for channel in channels(laminate):
        for layer in channel.layers if channel.has_axis else ():
            centre = _opening_centre(layer, channel)
            if centre is not None:
                yield _Departure(
                    math.dist(centre, channel.centre),
                    centre,
                    (layer.index,),
                    f"the hole in layer {layer.index} ({layer.name}) misses the axis of the "
                    f"{channel.name}",
                )


def _opening_centre(layer: Layer, channel: Channel) -> Point | None:
    """The centre of the innermost round hole about the channel's axis."""
    round_ones = [
        hole.circle
        for hole in layer.profile.holes
        if hole.circle is not None and hole.winding(channel.centre) != 0
    ]
    return min(round_ones, key=lambda circle: circle[1])[0] if round_ones else None


def _off_pins(laminate: Laminate) -> Iterator[_Departure]:
    """Tooling holes off their pin; one that a layer lacks is off by the pin's diameter."""
    for pin in tooling_pins(laminate):
        off = {name: _off_pin(layers[0], pin) for name, layers in laminate.patterns.items()}
        for roles in ON_ONE_PIN:
            siblings = [layer for layer in laminate.layers if layer.role in roles]
            holed = sum(off[layer.pattern] < pin.diameter for layer in siblings)
            if 2 * holed > len(siblings):
                for layer in siblings:
                    yield _Departure(
                        off[layer.pattern],
                        pin.centre,
                        (layer.index,),
                        f"layer {layer.index} ({layer.name}) misses the pin {pin.name}",
                    )


def _off_pin(layer: Layer, pin: Pin) -> float:
    """Distance of the nearest round hole from the pin, at most its diameter, mm."""
    circles = [hole.circle for hole in layer.profile.holes if hole.circle is not None]
    return min([pin.diameter, *(math.dist(centre, pin.centre) for centre, _ in circles)])


def _off_outline(laminate: Laminate) -> Iterator[_Departure]:
    for distinct in distinct_interfaces(laminate):
        interface = distinct.interface
        if interface.kind != "chamber" or interface.below.pattern == interface.above.pattern:
            continue
        below, above = (
            Region(layer.profile.outers) for layer in (interface.below, interface.above)
        )
        value, p = max(_farthest(below, above), _farthest(above, below), key=lambda entry: entry[0])
        yield _Departure(
            value,
            p,
            (interface.below.index, interface.above.index),
            f"the outlines of layers {interface.below.index} and {interface.above.index}, one "
            "balloon, depart from each other",
        )


@cached
def _farthest(region: Region, target: Region) -> tuple[float, Point]:
    """Greatest distance of a region's edges (ends and middles) from ``target``, and where."""
    return max(
        (
            (target.index.distance(p), p)
            for edge in region.edges
            for p in (edge.start, edge.at(0.5))
        ),
        key=lambda entry: entry[0],
        default=(0.0, (0.0, 0.0)),
    )
