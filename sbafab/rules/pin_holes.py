"""pin-holes: every pin of the plate has its holes, and no film blocks it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from sbafab.geometry.edges import Point
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.laminate.lay_up import distinct_layers, press_steps
from sbafab.rules.boundary import middle
from sbafab.rules.channel_clear import ON_ONE_PIN, tooling_pins
from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained, layer_name

NAME = "pin-holes"


def check(measures: Measures) -> list[Finding]:
    """Return the number of pins that miss a hole, meet film, or leave a layer loose."""
    laminate = measures.laminate
    misses = [*_unholed(laminate), *_loose(laminate), *_blocked(laminate), *_idle(laminate)]
    if not misses:
        sentence = "clear" if laminate.pins else "no-pin"
        return [judged(NAME, True, 0.0, 0.0, "misses", Place(), sentence)]
    return [replace(misses[0], measured=float(len(misses)))]


RULE = Rule(NAME, check, explained(NAME), at_most=True)


def _miss(p: Point, layer: Layer | None, sentence: str, **facts: Any) -> Finding:
    place = Place(None, (layer.index,) if layer else (), *p)
    facts |= {"layer": layer_name(layer)} if layer else {}
    return judged(NAME, False, 0.0, 1.0, "misses", place, sentence, **facts)


def _idle(laminate: Laminate) -> Iterator[Finding]:
    """Yield the pins for which no layer has a hole."""
    used = {pin for layer, *_ in laminate.patterns.values() for pin in laminate.pins_holding(layer)}
    for pin in laminate.pins:
        if pin not in used:
            yield _miss(pin.centre, None, "idle", pin=pin.name)


def _unholed(laminate: Laminate) -> Iterator[Finding]:
    """Yield layers without a hole at a tooling pin for which similar layers have one."""
    for pin in tooling_pins(laminate):
        for roles in ON_ONE_PIN:
            holed: dict[bool, list[Layer]] = {True: [], False: []}
            for layers in laminate.patterns.values():
                if layers[0].role in roles:
                    holed[pin in laminate.pins_holding(layers[0])] += layers
            for layer in holed[False] if holed[True] else ():
                like = holed[True][0].index
                yield _miss(pin.centre, layer, "no-hole", pin=pin.name, other=like)


def _loose(laminate: Laminate) -> Iterator[Finding]:
    """Yield pieces that ears should hold but that have too few pins in their laying step."""
    if laminate.registration != "ears":
        return
    masks = [layer.index for layer in laminate.layers if layer.role == "chamber-mask"]
    for step in press_steps(laminate):
        for layer in distinct_layers(laminate, step.adds):
            # An upper chamber mask has its bore's pin alone.
            needed = 1 if layer.role == "chamber-mask" and layer.index != masks[0] else 2
            for piece in layer.profile.pieces:
                pins = [pin.name for pin in laminate.pins_in(piece) if pin in step.pins]
                if len(pins) < needed:
                    facts = {"pin": pins, "step": step.number, "needed": needed}
                    yield _miss(middle(piece), layer, "on-one" if pins else "loose", **facts)


def _blocked(laminate: Laminate) -> Iterator[Finding]:
    """Yield layers with film at a tooling pin, in a step that lays a layer on it.

    channel-clear checks the openings for channel pins.
    """
    for step in press_steps(laminate):
        added = distinct_layers(laminate, step.adds)
        for pin in tooling_pins(laminate):
            laid = next((layer for layer in added if pin in laminate.pins_holding(layer)), None)
            if laid is None and pin not in step.pins:
                continue
            facts = {"pin": pin.name, "step": step.number, "other": laid and laid.index}
            for layer in distinct_layers(laminate, step.layers):
                if pin in laminate.pins_holding(layer):
                    continue
                room = layer.profile.distance_to_edge(pin.centre)
                if layer.profile.contains(pin.centre) or room < pin.diameter / 2 - TOLERANCE:
                    yield _miss(pin.centre, layer, "blocked-laid" if laid else "blocked", **facts)
