"""Steps of the lay-up: the stacks joined in each closing of the press, and its pins; the height of
the films after the press.

The paper's four steps (Sec. 2), except steps with nothing to press. Ears also register layers in
full bonds: a flash bond on the pins comes first, then the full bond without pins.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from sbafab.geometry.cache import stored
from sbafab.laminate.films import Film
from sbafab.laminate.joining import Joining, is_only_pressed, joinings
from sbafab.laminate.joints import PRESS
from sbafab.laminate.laminate import Laminate, Layer, Pin

BondState = Literal["flash", "full"]
StepName = Literal[
    "flash_bottom", "tack_bottom", "bond_bottom", "flash_middle", "tack_all", "bond_all"
]
PLATE_MARGIN = 6.0
"""Margin of the base plate around the lay-up, mm."""


@dataclass(frozen=True)
class LayUpStep:
    """One closing of the press, or a seam; steps count from 1.

    ``stacks`` are laid on each other, lowest first, and ``adds`` are their layers that are new in
    this step, both by layer index; ``pins`` are the dowel pins in place. ``joining`` is the joining
    operation of the step, if films are also joined outside the press.
    """

    number: int
    name: StepName
    bond: BondState
    stacks: tuple[tuple[int, ...], ...]
    adds: tuple[int, ...]
    pins: tuple[Pin, ...]
    joining: Joining | None = None

    @property
    def layers(self) -> tuple[int, ...]:
        return tuple(index for stack in self.stacks for index in stack)


def press_steps(laminate: Laminate) -> tuple[LayUpStep, ...]:
    """Return the steps of a laminate, bottom balloon first.

    Flash bonds hold layers in place on their pins. With channel pins, full bonds are pressed
    without pins: base and cap have no bore, and a lumen pin would fit but is omitted, as in the
    paper. ``laminate.middle_first`` tacks all layers between base and cap in one step, and presses
    no balloon separately. With ears, base and cap are tacked on the pins by a flash bond, and the
    subsequent full bond also has no pins, unless ``laminate.pins_in_full_bonds``.
    """
    return stored(laminate, "_steps", _steps)


def lay_up_steps(laminate: Laminate) -> tuple[LayUpStep, ...]:
    """Return all steps in which layers are joined: presses, seams and folds, in order.

    A seam or fold has no pins, and is labelled as a flash bond.
    """
    return stored(laminate, "_laying", _laying)


def _laying(laminate: Laminate) -> tuple[LayUpStep, ...]:
    if is_only_pressed(laminate):
        return press_steps(laminate)
    steps: list[LayUpStep] = []
    for joining in joinings(laminate):
        is_pressed = joining.process == PRESS
        adds = tuple(body[0] for body in joining.bodies if len(body) == 1)
        plans = [_plan("flash_middle", "flash", joining.bodies, adds)]
        if is_pressed and adds == joining.layers:
            plans = _plans(laminate, joining.layers)
        elif is_pressed:
            plans = [_plan("bond_all", "full", joining.bodies, adds)]
        for plan in plans:
            step = _step(len(steps) + 1, plan, laminate)
            pins = step.pins if is_pressed else ()
            steps.append(replace(step, joining=joining, pins=pins))
    return tuple(steps)


def _steps(laminate: Laminate) -> tuple[LayUpStep, ...]:
    if not is_only_pressed(laminate):
        steps = lay_up_steps(laminate)
        return tuple(step for step in steps if step.joining and step.joining.process == PRESS)
    plans = _plans(laminate, tuple(layer.index for layer in laminate.layers))
    if laminate.registration == "ears" and not laminate.pins_in_full_bonds:
        plans = [step for plan in plans for step in _tacked(plan)]
    return tuple(_step(number, plan, laminate) for number, plan in enumerate(plans, 1))


Stacks = tuple[tuple[int, ...], ...]


def _plan(name: StepName, bond: BondState, stacks: Stacks, adds: tuple[int, ...]) -> LayUpStep:
    """A step before it has a number and pins."""
    return LayUpStep(0, name, bond, tuple(stack for stack in stacks if stack), adds, ())


def _plans(laminate: Laminate, indices: tuple[int, ...]) -> list[LayUpStep]:
    """Return the press steps that add any of these layers."""
    films = [layer for layer in map(laminate.layer, indices) if not layer.is_mask]
    base = next((layer for layer in films if layer.role == "base"), films[0]).index
    wall = next((layer.index for layer in films if layer.index > base), base)
    upper = tuple(index for index in indices if base < index <= wall)
    under = tuple(index for index in indices if index < base)
    *core, last = (index for index in indices if index >= base)
    between = tuple(core[1:])
    if laminate.middle_first and len(between) > 1:
        return [
            _plan("flash_middle", "flash", (between,), between),
            _plan("bond_all", "full", (under, (base,), between, (last,)), (*under, base, last)),
        ]
    bottom = (base, *upper)
    over = tuple(index for index in indices if index > wall)
    middle, cap = (over[:-1], over[-1:]) if len(over) > 2 else ((), over)
    plans = [
        _plan("flash_bottom", "flash", (upper,), upper),
        _plan("bond_bottom", "full", ((base,), upper), (base,)),
    ]
    if len(upper) < 2:
        plans = [_plan("bond_bottom", "full", (bottom,), bottom)]
    plans += [
        _plan("flash_middle", "flash", (middle,), middle),
        _plan("bond_all", "full", (under, bottom, middle, cap), under + cap),
    ]
    return [plan for plan in plans if plan.adds]


def _tacked(plan: LayUpStep) -> tuple[LayUpStep, ...]:
    """Split a full bond into two steps: a flash bond of the same stacks, then their full bond."""
    if plan.bond == "flash":
        return (plan,)
    tack: StepName = "tack_bottom" if plan.name == "bond_bottom" else "tack_all"
    return replace(plan, name=tack, bond="flash"), replace(plan, stacks=(plan.layers,), adds=())


def _step(number: int, plan: LayUpStep, laminate: Laminate) -> LayUpStep:
    is_eared = laminate.registration == "ears" and laminate.pins_in_full_bonds
    pins = _pins_in(laminate, plan.layers) if plan.bond == "flash" or is_eared else ()
    return replace(plan, number=number, pins=pins)


def _pins_in(laminate: Laminate, layers: Sequence[int]) -> tuple[Pin, ...]:
    """Return the pins that hold at least one of the layers and meet no film in any of them."""
    shapes = distinct_layers(laminate, layers)
    return tuple(
        pin
        for pin in laminate.pins
        if any(pin in laminate.pins_holding(layer) for layer in shapes)
        and not any(layer.profile.contains(pin.centre) for layer in shapes)
    )


def pressed_layers(laminate: Laminate) -> list[Layer]:
    """Return the layers that are pressed in some step."""
    pressed = {index for step in press_steps(laminate) for index in step.layers}
    return [layer for layer in laminate.layers if layer.index in pressed]


def films_without_minutes(
    laminate: Laminate, stated: Iterable[tuple[str, float]]
) -> tuple[Film, ...]:
    """The pressed structural films whose product and thickness (mm) are not in ``stated``."""
    pairs = tuple(stated)
    films = dict.fromkeys(layer.film for layer in pressed_layers(laminate) if not layer.is_mask)
    return tuple(film for film in films if not any(film.is_a(*pair) for pair in pairs))


@dataclass(frozen=True)
class FoldedHeight:
    """Height of a flat laminate after the press.

    ``solid`` is the thickness in mm of masks, films that do not melt in a press step and the
    ``unmeasured`` ones, whose flow is unknown; ``factor`` is the press factor on the others,
    ``molten`` mm as bought.
    """

    solid: float
    molten: float
    factor: float
    unmeasured: tuple[Film, ...]

    @property
    def height(self) -> float:
        """The height in mm."""
        return self.solid + self.factor * self.molten

    @property
    def nominal(self) -> float:
        """The sum of the films as bought, in mm."""
        return self.solid + self.molten

    @property
    def remark(self) -> str:
        """Which films have an unknown flow, as text; empty if none."""
        names = sorted({film.product for film in self.unmeasured})
        return f"{' and '.join(names)} as bought: no press factor is known" if names else ""


def folded_height(laminate: Laminate, factor: float, product: str) -> FoldedHeight:
    """Return the folded height of a laminate, the only definition for all commands, pages and
    files.

    ``factor`` is the press factor on the thickness of melting films of one ``product``, or of all
    if that is empty; 1 if not stated.
    """
    melts = [layer.film for layer in pressed_layers(laminate) if layer.film.melts]
    melting = [film for film in melts if product in ("", film.product)]
    molten = sum(film.thickness for film in melting)
    unknown = () if factor == 1 else dict.fromkeys(film for film in melts if film not in melting)
    return FoldedHeight(laminate.thickness - molten, molten, factor, tuple(unknown))


def is_laid_by_hand(laminate: Laminate, step: LayUpStep) -> bool:
    """Return True if a layer or an earlier stack is placed by hand, without a pin.

    A whole stack that is laid down again needs no alignment.
    """
    pins = set(step.pins)
    for stack in step.stacks if step.adds else ():
        is_pinned = [
            not pins.isdisjoint(laminate.pins_holding(layer))
            for layer in distinct_layers(laminate, stack)
        ]
        if not (any(is_pinned) if set(stack).isdisjoint(step.adds) else all(is_pinned)):
            return True
    return False


def pins_when_added(laminate: Laminate) -> dict[int, tuple[Pin, ...]]:
    """Return, by layer index, the pins that hold the layer in the step that adds it.

    A fitting hole does not hold a layer if its pin is out.
    """
    fitting = {
        pattern: laminate.pins_holding(layers[0]) for pattern, layers in laminate.patterns.items()
    }
    return {
        index: tuple(pin for pin in fitting[laminate.layer(index).pattern] if pin in step.pins)
        for step in lay_up_steps(laminate)
        for index in step.adds
    }


def stack_count(laminate: Laminate, layers: Sequence[int]) -> int:
    """Return the number of stacks side by side: the least number of pieces of any layer."""
    return min(len(layer.profile.pieces) for layer in distinct_layers(laminate, layers))


def distinct_layers(laminate: Laminate, layers: Sequence[int]) -> tuple[Layer, ...]:
    """Return one layer of each pattern."""
    return tuple({laminate.layer(i).pattern: laminate.layer(i) for i in layers}.values())
