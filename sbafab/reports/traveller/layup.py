"""Long stacks in few words: what repeats is a round, named once and counted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sbafab.laminate.assembly import AssemblyStep, distinct_layers
from sbafab.laminate.laminate import Inlet, Laminate, Layer

LONGEST_ROUND = 12
INSIDE = 0.1
"""mm inward of its mouth at which a tab is looked for."""


@dataclass(frozen=True)
class Round:
    """Layers that are laid again and again in the same order; ``turns`` holds every turn of it."""

    turns: tuple[tuple[Layer, ...], ...]

    @property
    def count(self) -> int:
        return len(self.turns)

    @property
    def first(self) -> Layer:
        return self.turns[0][0]

    @property
    def last(self) -> Layer:
        return self.turns[-1][-1]

    @property
    def places(self) -> tuple[tuple[Layer, ...], ...]:
        """The layers of all turns that take the same place in the round."""
        return tuple(zip(*self.turns, strict=True))

    @property
    def layers(self) -> tuple[Layer, ...]:
        return tuple(layer for turn in self.turns for layer in turn)


def rounds(layers: Sequence[Layer]) -> tuple[Round, ...]:
    """The layers in order, repetitions gathered; what does not repeat is a round of one layer."""
    keys = [(layer.pattern, layer.role) for layer in layers]
    found: list[Round] = []
    start = 0
    while start < len(layers):
        period, count = _repetition(keys[start : start + len(keys)])
        turns = tuple(
            tuple(layers[start + turn * period : start + (turn + 1) * period])
            for turn in range(count)
        )
        found.append(Round(turns))
        start += period * count
    return tuple(found)


def _repetition(keys: Sequence[object]) -> tuple[int, int]:
    """Period and count of the repetition at the start that covers most; (1, 1) without one."""
    best = 1, 1
    for period in range(1, min(LONGEST_ROUND, len(keys) // 2) + 1):
        count = 1
        while keys[count * period : (count + 1) * period] == keys[:period]:
            count += 1
        if count > 1 and count * period > best[0] * best[1]:
            best = period, count
    return best


@dataclass(frozen=True)
class Bed:
    """One of the stacks that a step lays on each other; ``made_in`` is the step it comes from.

    Single layers come off the sheet: ``made_in`` is None.
    """

    layers: tuple[int, ...]
    made_in: int | None


def beds(steps: Sequence[AssemblyStep], step: AssemblyStep) -> tuple[Bed, ...]:
    """The stacks of a step, lowest first."""
    before = [earlier for earlier in steps if earlier.number < step.number]
    found = []
    for stack in step.stacks:
        maker = next((e.number for e in reversed(before) if set(e.layers) == set(stack)), None)
        found.append(Bed(stack, maker))
    return tuple(found)


def inlets_in(laminate: Laminate, layers: Sequence[int]) -> tuple[Inlet, ...]:
    """The inlets whose tab is part of at least one of the layers."""
    shapes = [layer.profile for layer in distinct_layers(laminate, layers)]
    return tuple(
        inlet
        for inlet in laminate.inlets
        if any(
            shape.contains(
                (
                    inlet.mouth[0] - INSIDE * inlet.direction[0],
                    inlet.mouth[1] - INSIDE * inlet.direction[1],
                )
            )
            for shape in shapes
        )
    )
