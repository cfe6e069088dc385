"""pin-holes: every pin of the plate finds its holes, and no film stands in its way."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from sbafab.geometry.edges import Point
from sbafab.laminate.assembly import AssemblyStep, assembly, distinct_layers
from sbafab.laminate.laminate import Laminate, Layer, Pin
from sbafab.rules.channel_clear import ON_ONE_PIN, tooling_pins
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import TOLERANCE, at
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Explanation, Rule

NAME = "pin-holes"


class _Miss(NamedTuple):
    fault: str
    at: Point
    layers: tuple[int, ...]


def check(measures: Measures) -> list[Finding]:
    """Return the number of pins that miss a hole, meet film, or leave a layer loose."""
    laminate = measures.laminate
    misses = [*_unholed(laminate), *_loose(laminate), *_blocked(laminate), *_idle(laminate)]
    if misses:
        first = misses[0]
        message = f"{first.fault}; draw pins and holes from the same outline"
        place = Place(None, first.layers, *first.at)
        return [Finding(NAME, "fail", 0.0, float(len(misses)), "misses", place, message)]
    message = "every pin finds its holes, and no film stands in its way"
    if not laminate.pins:
        message = "no pin holds a layer"
    return [Finding(NAME, "pass", 0.0, 0.0, "misses", Place(), message)]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "every pin finds its holes, no film stands in its way, two pins hold what ears pin",
        "A pin without a hole lifts the film; a film on one pin turns about it.",
        "Use the registration method's own holes; see the place named.",
        ("registration.method", "registration.pin_diameter"),
    ),
    at_most=True,
)


def _idle(laminate: Laminate) -> Iterator[_Miss]:
    """Pins that no layer has a hole for."""
    for pin in laminate.pins:
        if not any(
            pin in laminate.pins_holding(layers[0]) for layers in laminate.patterns.values()
        ):
            fault = f"the pin {pin.name} at {at(pin.centre)} finds a hole in no layer"
            yield _Miss(fault, pin.centre, ())


def _unholed(laminate: Laminate) -> Iterator[_Miss]:
    """Layers that lack a hole at a tooling pin although others of their kind have one."""
    for pin in tooling_pins(laminate):
        for roles in ON_ONE_PIN:
            holed: dict[bool, list[Layer]] = {True: [], False: []}
            for layers in laminate.patterns.values():
                if layers[0].role in roles:
                    holed[pin in laminate.pins_holding(layers[0])] += layers
            if holed[True]:
                for layer in holed[False]:
                    fault = (
                        f"layer {layer.index} ({layer.name}) has no hole for the pin {pin.name} "
                        f"at {at(pin.centre)}, which holds layer {holed[True][0].index}"
                    )
                    yield _Miss(fault, pin.centre, (layer.index,))


def _loose(laminate: Laminate) -> Iterator[_Miss]:
    """Pieces that ears should hold, and that hang on too few pins in the step that lays them."""
    if laminate.registration != "ears":
        return
    masks = [layer.index for layer in laminate.layers if layer.role == "chamber-mask"]
    for step in assembly(laminate):
        for layer in distinct_layers(laminate, step.adds):
            # An upper chamber mask has its bore's pin alone.
            needed = 1 if layer.role == "chamber-mask" and layer.index != masks[0] else 2
            for piece in layer.profile.pieces:
                pins = [pin for pin in laminate.pins_in(piece) if pin in step.pins]
                if len(pins) < needed:
                    low_x, low_y, high_x, high_y = piece.bounds
                    middle = (low_x + high_x) / 2, (low_y + high_y) / 2
                    fault = (
                        f"layer {layer.index} ({layer.name}) hangs on {_listed(pins)} in step "
                        f"{step.number}, {at(middle)}, and needs {needed} to keep its place"
                    )
                    yield _Miss(fault, middle, (layer.index,))


def _blocked(laminate: Laminate) -> Iterator[_Miss]:
    """Tooling pins blocked by film in a step that lays a layer on them.

    The channels' pins have the channels' room, which channel-clear measures.
    """
    for step in assembly(laminate):
        added = distinct_layers(laminate, step.adds)
        for pin in tooling_pins(laminate):
            laid = next((layer for layer in added if pin in laminate.pins_holding(layer)), None)
            if laid is not None or pin in step.pins:
                yield from _in_the_way(pin, laid, step, laminate)


def _in_the_way(
    pin: Pin, laid: Layer | None, step: AssemblyStep, laminate: Laminate
) -> Iterator[_Miss]:
    for layer in distinct_layers(laminate, step.layers):
        if pin in laminate.pins_holding(layer):
            continue
        profile = layer.profile
        inside = profile.contains(pin.centre)
        if inside or profile.distance_to_edge(pin.centre) < pin.diameter / 2 - TOLERANCE:
            whose = "" if laid is None else f", which layer {laid.index} is laid on"
            fault = (
                f"layer {layer.index} ({layer.name}) stands in the way of the pin {pin.name} at "
                f"{at(pin.centre)}{whose} in step {step.number}"
            )
            yield _Miss(fault, pin.centre, (layer.index,))


def _listed(pins: list[Pin]) -> str:
    return f"the pin {pins[0].name} alone" if pins else "no pin"
