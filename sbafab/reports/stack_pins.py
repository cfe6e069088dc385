"""The dowel pins that the section cuts: through which layers each stands, and in which steps."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sbafab.geometry.edges import Point
from sbafab.geometry.section import Interval
from sbafab.laminate.assembly import assembly
from sbafab.laminate.laminate import Laminate, Pin


@dataclass(frozen=True)
class Rod:
    """A pin in the plane of the section, from ``span`` start to end.

    It holds layers ``stacks``, lowest and highest index of each stack that is pressed by itself,
    and is in at the press steps ``steps``.
    """

    name: str
    span: Interval
    stacks: tuple[tuple[int, int], ...]
    steps: tuple[int, ...]

    @property
    def middle(self) -> float:
        return (self.span[0] + self.span[1]) / 2

    @property
    def words(self) -> str:
        many = "s" if len(self.steps) > 1 else ""
        return f"pin {self.name}, step{many} {', '.join(map(str, self.steps))}"


def rods(laminate: Laminate, origin: Point, direction: Point) -> tuple[Rod, ...]:
    """The pins that a vertical plane meets, in the laminate's order; places from ``origin``."""
    found = []
    for pin in laminate.pins:
        dx, dy = pin.centre[0] - origin[0], pin.centre[1] - origin[1]
        along, aside = dx * direction[0] + dy * direction[1], dx * direction[1] - dy * direction[0]
        radius = pin.diameter / 2
        if abs(aside) < radius:
            half = math.sqrt(radius**2 - aside**2)
            stacks, steps = _stands(laminate, pin)
            found.append(Rod(pin.name, (along - half, along + half), stacks, steps))
    return tuple(rod for rod in found if rod.stacks)


def _stands(laminate: Laminate, pin: Pin) -> tuple[tuple[tuple[int, int], ...], tuple[int, ...]]:
    """Lowest and highest layer that the pin holds, stack by stack, and the steps."""
    held = {
        layer.index
        for layers in laminate.patterns.values()
        if pin in laminate.pins_holding(layers[0])
        for layer in layers
    }
    steps = [step for step in assembly(laminate) if pin in step.pins]
    spans = [(min(own), max(own)) for step in steps if (own := held.intersection(step.layers))]
    whole = [
        span
        for span in dict.fromkeys(spans)
        if not any(a <= span[0] and span[1] <= b for a, b in spans if (a, b) != span)
    ]
    return tuple(whole), tuple(step.number for step in steps)
