"""registration-nominal: as drawn, bores are coaxial and the two films of a balloon congruent."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from sbafab.geometry.edges import Point, distance_to
from sbafab.geometry.region import Contour
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.rules.alike import distinct_interfaces
from sbafab.rules.channels import Channel, channels
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import Limits, at

NAME = "registration-nominal"


class _Departure(NamedTuple):
    value: float
    at: Point
    layers: tuple[int, ...]
    what: str


def check(laminate: Laminate, limits: Limits) -> list[Finding]:
    """The largest departure of a hole from its channel's axis, or of an outline from its twin."""
    limit = limits.registration_tolerance
    departures = [*_off_axis(laminate), *_off_outline(laminate)]
    if not departures:
        message = "no two layers have to lie over each other"
        return [Finding(NAME, "pass", limit, None, "mm", Place(), message)]
    worst = max(departures, key=lambda departure: departure.value)
    good = worst.value <= limit + 1e-9
    message = f"{worst.what} by {worst.value:.4f} mm, {at(worst.at)}"
    if good:
        message = f"bores are coaxial and outlines congruent to {max(worst.value, 1e-6):.6f} mm"
    else:
        message += f"; {limit:g} is allowed: draw both from the same edge"
    place = Place(None, worst.layers, *worst.at)
    return [Finding(NAME, "pass" if good else "fail", limit, worst.value, "mm", place, message)]


def _off_axis(laminate: Laminate) -> Iterator[_Departure]:
    for channel in channels(laminate):
        for layer in channel.layers:
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


def _off_outline(laminate: Laminate) -> Iterator[_Departure]:
    for alike in distinct_interfaces(laminate):
        interface = alike.interface
        if interface.kind != "chamber" or interface.below.pattern == interface.above.pattern:
            continue
        below, above = interface.below.profile.outers, interface.above.profile.outers
        yield max(
            (
                _Departure(
                    value,
                    p,
                    (interface.below.index, interface.above.index),
                    f"the outlines of layers {interface.below.index} and {interface.above.index}, "
                    "one balloon, depart from each other",
                )
                for one, other in ((below, above), (above, below))
                for value, p in _distances(one, other)
            ),
            key=lambda departure: departure.value,
        )


def _distances(
    one: tuple[Contour, ...], other: tuple[Contour, ...]
) -> Iterator[tuple[float, Point]]:
    """How far the ends and middles of all edges of ``one`` lie from ``other``."""
    edges = [edge for contour in other for edge in contour.edges]
    for contour in one:
        for edge in contour.edges:
            for p in (edge.start, edge.at(0.5)):
                yield min((distance_to(e, p) for e in edges), default=math.inf), p
