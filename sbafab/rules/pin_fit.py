"""pin-fit: every film fits over its pins in the worst case of hole and pin.

A cut edge deviates by up to the cutting error all around, so a hole may be narrower than drawn by
twice that error, including its position error. A film whose hole is then narrower than its pin must
stretch over it. An uncompensated kerf makes holes wider: they fit more easily and hold less.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.laminate.base_plate import pin_deviations
from sbafab.laminate.laminate import LOOSE, Laminate, Layer, Pin
from sbafab.laminate.lay_up import distinct_layers, press_steps
from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.measures import Measures
from sbafab.rules.placement_errors import error_on_pins
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained, layer_name, say

NAME = "pin-fit"


class _Fit(NamedTuple):
    """A hole on a pin: its drawn diameter and its least diameter as cut, mm."""

    pin: Pin
    layer: Layer
    drawn: float
    least: float

    @property
    def most(self) -> float:
        """The pin's largest diameter, mm."""
        return self.pin.diameter + pin_deviations(self.pin.diameter)[1]

    @property
    def stretch(self) -> float:
        """The strain of the hole over the pin; infinite if cutting may close the hole."""
        if self.least <= 0:
            return math.inf
        return max(0.0, self.most / self.least - 1)


def check(measures: Measures) -> list[Finding]:
    """Return the largest strain of a film over a pin, against the allowed strain."""
    laminate, design = measures.laminate, measures.design
    limit = design.registration.pin_stretch
    fits = list(_fits(laminate, design))
    if not fits:
        return [judged(NAME, True, limit, None, "", Place(), "no-pin")]
    worst = max(fits, key=lambda fit: round(fit.stretch, 9))
    # What a hole may miss its drawing by counts for it.
    good = worst.stretch <= limit + 2 * TOLERANCE / max(worst.least, TOLERANCE)
    is_closed, pin, layer = math.isinf(worst.stretch), worst.pin, worst.layer
    stretch = "closed" if is_closed else "stretches" if worst.stretch > 0 else "to-spare"
    is_known = design.kerf_widths.get(layer.film.material) is not None
    facts = {
        "stretch": say(f"pin-fit.{stretch}", spare=worst.least - worst.most),
        "percent": 100 * limit,
        "as_drawn": worst.drawn,
        "layer": layer_name(layer),
        "least": max(worst.least, 0.0),
        "pin": pin.name,
        "most": worst.most,
        "threaded": _threaded(laminate, pin),
        "kerf": say("pin-fit.kerf-known" if is_known else "pin-fit.kerf-unknown"),
    }
    value = None if is_closed else worst.stretch
    place = Place(None, (layer.index,), *pin.centre)
    return [judged(NAME, good, limit, value, "", place, "fit", **facts)]


RULE = Rule(NAME, check, explained(NAME), at_most=True)


def _fits(laminate: Laminate, design: Design) -> Iterator[_Fit]:
    """Return every pin with each pattern that hangs on it in a step."""
    visited = set()
    on_pins = error_on_pins(design, laminate)
    for step in press_steps(laminate):
        for layer in distinct_layers(laminate, step.adds):
            for pin in step.pins:
                if (layer.pattern, pin) in visited:
                    continue
                visited.add((layer.pattern, pin))
                for hole in layer.profile.holes:
                    circle = hole.circle
                    if circle is None or math.dist(circle[0], pin.centre) >= LOOSE:
                        continue
                    if abs(2 * circle[1] - pin.hole) < LOOSE:
                        # A hole off its place leaves the pin that much less room.
                        drawn = 2 * (circle[1] - math.dist(circle[0], pin.centre))
                        least = drawn - 2 * (design.registration.cutting_error + on_pins)
                        yield _Fit(pin, layer, 2 * circle[1], least)


def most_on_a_pin(laminate: Laminate) -> int:
    """Return the largest number of layers threaded on one pin in one step."""
    return max((_threaded(laminate, pin) for pin in laminate.pins), default=0)


def _threaded(laminate: Laminate, pin: Pin) -> int:
    """Return the largest number of layers on the pin in any step."""
    counts = [
        sum(pin in laminate.pins_holding(laminate.layer(index)) for index in step.adds)
        for step in press_steps(laminate)
        if pin in step.pins
    ]
    return max(counts, default=0)
