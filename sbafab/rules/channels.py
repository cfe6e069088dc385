"""The channels of a laminate: chamber bores and the lumen, and the layers each runs through."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from sbafab.geometry.edges import Point
from sbafab.laminate.laminate import Laminate, Layer


class Channel(NamedTuple):
    """A channel and one layer of every pattern that it must be open in."""

    name: str
    centre: Point
    diameter: float
    layers: tuple[Layer, ...]


def channels(laminate: Laminate) -> list[Channel]:
    """Bores run from above the first base to below the cap, the lumen through every layer."""
    chamber_gaps = [gap for gap in laminate.interfaces if gap.kind == "chamber"]
    found = []
    if laminate.bores and chamber_gaps:
        bottom, top = chamber_gaps[0].below.index, chamber_gaps[-1].above.index
        bored = _distinct(layer for layer in laminate.layers if bottom < layer.index < top)
        found = [
            Channel(f"bore of {bore.chamber}", bore.centre, bore.diameter, bored)
            for bore in laminate.bores
        ]
    if laminate.lumen is not None:
        layers = _distinct(laminate.layers)
        found.append(Channel("lumen", (0.0, 0.0), laminate.lumen, layers))
    return found


def _distinct(layers: Iterable[Layer]) -> tuple[Layer, ...]:
    first: dict[str, Layer] = {}
    for layer in layers:
        first.setdefault(layer.pattern, layer)
    return tuple(first.values())
