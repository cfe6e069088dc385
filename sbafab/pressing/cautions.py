"""What a press schedule cannot do, and what the technician should know beforehand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from sbafab.errors import DesignError
from sbafab.laminate.assembly import AssemblyStep, distinct_layers
from sbafab.laminate.films import FIRST
from sbafab.laminate.laminate import Laminate
from sbafab.pressing import build_up, sheets
from sbafab.pressing.dowels import is_sold
from sbafab.pressing.words import listed, named

if TYPE_CHECKING:
    from sbafab.pressing.schedule import PressSettings, Step

PINS_OUT = (
    "untested: with ears each full bond comes after a flash bond on the pins, and is pressed "
    "without them; that the flash bond keeps the layers in register was not tried on a bench"
)
PINS_IN = (
    "untested: the ears' pins stay in through the full bonds, where molten TPE can grip them; put "
    "a release sleeve on each or coat it with a release agent, and try it on a sample first"
)

HOTTEST_TRIED = 150.0
PRESSURES_TRIED = (70.0, 200.0)


def refuse_temperature(laminate: Laminate, press: PressSettings) -> None:
    for film in dict.fromkeys(layer.film for layer in laminate.layers):
        melts = not film.is_mask and film.softens_above is not None
        if melts and press.temperature_c <= (film.softens_above or 0.0):
            raise DesignError(
                f"press.temperature_c = {press.temperature_c:g} does not bond {film.product}, "
                f"which melts at {film.softens_above:g} C; raise it (the paper presses at 135 C)"
            )
        if film.material == "PTFE" and press.temperature_c >= film.limit:
            raise DesignError(
                f"press.temperature_c = {press.temperature_c:g} reaches the limit of the masks, "
                f"{film.limit:g} C for {film.product}; lower it, for hotter PTFE gives off toxic "
                "fumes"
            )
        if film.material not in FIRST and press.temperature_c >= film.limit:
            raise DesignError(
                f"press.temperature_c = {press.temperature_c:g} reaches the limit of "
                f"{film.material}, {film.limit:g} C for {film.product}; lower it"
            )
    limit = press.carrier_limit
    if laminate.panel is not None and limit is not None and press.temperature_c >= limit:
        raise DesignError(
            f"press.temperature_c = {press.temperature_c:g} reaches panel.carrier_limit_c = "
            f"{limit:g}, what the transfer film stands that is pressed with the masks; take another"
        )
    for interface in laminate.interfaces:
        below, above = interface.below, interface.above
        if below.film.softens_above is None and above.film.softens_above is None:
            roles = " or the ".join(dict.fromkeys((below.role, above.role)))
            raise DesignError(
                f"layers {below.index} and {above.index} are of {below.film.material} and "
                f"{above.film.material}, which both stay solid in the press and do not bond; give "
                f"the {roles} another film in [layup]"
            )
    if press.temperature_c > build_up.PAD_LIMIT_C:
        raise DesignError(
            f"press.temperature_c = {press.temperature_c:g} is more than the press pad of "
            f"{press.pad.material} stands, {build_up.PAD_LIMIT_C:g} C; lower it"
        )


def warnings(
    laminate: Laminate,
    press: PressSettings,
    parts: Sequence[AssemblyStep],
    steps: Sequence[Step],
) -> Iterator[str]:
    if laminate.panel is not None:
        yield sheets.UNTRIED
        if press.carrier_limit is None:
            yield (
                "nobody stated what temperature the transfer film of the masks stands; it is "
                f"pressed at {press.temperature_c:g} C (panel.carrier_limit_c)"
            )
    if press.temperature_c > HOTTEST_TRIED:
        yield (
            f"{press.temperature_c:g} C is hotter than the {HOTTEST_TRIED:g} C of earlier work, "
            "which already over-melted more than 135 C does"
        )
    low, high = PRESSURES_TRIED
    if not low <= press.pressure_kpa <= high:
        yield (
            f"{press.pressure_kpa:g} kPa lies outside {low:g} to {high:g} kPa; 110 kPa is "
            "validated, and earlier work pressed at 70 kPa"
        )
    if laminate.balloons > press.validated_balloons:
        yield (
            f"{laminate.balloons} balloons are more than the {press.validated_balloons} validated; "
            "heat must pass the whole laminate, so try the bond on a sample first"
        )
    uneven = [step for step in steps if not low <= step.film_kpa <= high]
    if uneven and low <= press.pressure_kpa <= high:
        worst = max(uneven, key=lambda step: abs(step.film_kpa - press.pressure_kpa))
        yield (
            f"step {worst.step}: the films get about {worst.film_kpa:.0f} kPa (estimate), outside "
            f"{low:g} to {high:g} kPa; take a thicker or softer pad (press.pad_thickness, "
            "press.pad_hardness)"
        )
    if laminate.registration == "ears" and laminate.pins:
        yield PINS_IN if laminate.pins_in_full_bonds else PINS_OUT
    pad = next(item.thickness_mm for item in steps[0].build_up if item.part == build_up.PAD)
    if (pile := build_up.pieces(pad)) > 1:
        yield (
            f"the press pad is a pile of {pile} sheets, {pad:g} mm high together, which may "
            "slide aside: hold it in a frame, and see whether the press opens so far"
        )
    unsold = {
        pin.diameter for pin in laminate.pins if not is_sold(pin.diameter, press.pin_standard)
    }
    if unsold and not press.pin_lengths:
        yield (
            f"{press.pin_standard} has no dowel pin of diameter "
            f"{listed([f'{diameter:g}' for diameter in sorted(unsold)])}: change the diameter, or "
            "make the pins and give their lengths in registration.pin_lengths"
        )
    for step, part in zip(steps, parts, strict=True):
        if step.bond == "flash" and (layers := _unpinned(laminate, part)):
            which = named(layers) if len(layers) < 4 else _by_role(laminate, layers)
            yield f"step {step.step}: no pin holds {which}; align by hand"


def _unpinned(laminate: Laminate, part: AssemblyStep) -> list[int]:
    """Layers that join in a step, or lie in a bonded stack, that none of its pins holds."""
    held = {
        layer.pattern
        for layer in distinct_layers(laminate, part.layers)
        if not set(part.pins).isdisjoint(laminate.pins_holding(layer))
    }
    bodies: list[tuple[int, ...]] = [(index,) for index in part.adds]
    bodies += [stack for stack in part.stacks if set(stack).isdisjoint(part.adds)]
    loose = [b for b in bodies if held.isdisjoint(laminate.layer(i).pattern for i in b)]
    return sorted(index for body in loose for index in body)


def _by_role(laminate: Laminate, layers: Sequence[int]) -> str:
    counts = Counter(laminate.layer(index).role for index in layers)
    return listed([f"the {count} {role}s" for role, count in counts.items()])
