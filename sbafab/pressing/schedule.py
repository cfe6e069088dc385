"""The heat-press schedule: which layers are pressed together, in what order (paper Sec. 2).

Temperatures are C, pressures kPa, forces N, times minutes, lengths mm.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import NamedTuple

from sbafab.errors import DesignError
from sbafab.laminate.assembly import (
    AssemblyStep,
    BondState,
    StepName,
    assembly,
    distinct_layers,
    stack_count,
)
from sbafab.laminate.films import FIRST
from sbafab.laminate.laminate import Laminate
from sbafab.pressing import build_up, sheets
from sbafab.pressing.build_up import BuildUpPart, Footprint, Pad
from sbafab.pressing.dowels import PinSetting, Standard, is_sold, plate_thickness, settings_by_step

TITLES: dict[StepName, str] = {
    "flash_bottom": "Bottom balloon, upper two layers",
    "tack_bottom": "Bottom balloon, its base tacked on",
    "bond_bottom": "Bottom balloon, with its base",
    "flash_middle": "Middle layers",
    "tack_all": "Whole laminate, tacked",
    "bond_all": "Whole laminate",
}
TITLES_OF_SEVERAL = {
    **TITLES,
    "flash_bottom": "Bottom balloons, upper two layers of each",
    "tack_bottom": "Bottom balloons, their bases tacked on",
    "bond_bottom": "Bottom balloons, each with its base",
}
"""Where stacks are pressed beside each other."""

SNIP = (
    "Snip off the ears along the outline, and the tails of the inlet strips at the tab's end; the "
    "masks stay in their pockets."
)

PINS_OUT = (
    "untested: with ears each full bond comes after a flash bond on the pins, and is pressed "
    "without them; that the flash bond keeps the layers in register was not tried on a bench"
)
PINS_IN = (
    "untested: the ears' pins stay in through the full bonds, where molten TPE can grip them; put "
    "a release sleeve on each or coat it with a release agent, and try it on a sample first"
)

BASE_PLATE, RELEASE, LAMINATE, PAD = "base plate", "release film", "laminate", "press pad"
"""The parts of the build-up, between the platens."""

HOTTEST_TRIED = 150.0
PRESSURES_TRIED = (70.0, 200.0)
HANDLING_MINUTES = 60.0
"""The paper's total build time of 1.75 h less its 45 minutes in the press."""


@dataclass(frozen=True)
class PressSettings:
    """What the press is set to; the defaults are the paper's (Sec. 2)."""

    temperature_c: float = 135.0
    pressure_kpa: float = 110.0
    platen: tuple[float, float] = (152.4, 152.4)
    flash_bottom: float = 3.0
    bond_bottom: float = 12.0
    flash_middle: float = 10.0
    bond_all: float = 20.0
    validated_balloons: int = 20
    pad: Pad = field(default_factory=Pad)
    plate_material: str = "steel"
    plate_thickness: float | None = None
    release_film: str = "PTFE film"
    release_thickness: float = 0.05
    pin_standard: Standard = "ISO 8734"
    pin_lengths: tuple[float, ...] = ()
    tack: float = 1.0

    @property
    def force_n(self) -> float:
        """Force on the whole platen."""
        return self.pressure_kpa * self.platen[0] * self.platen[1] / 1000

    def minutes(self, step: StepName) -> float:
        """How long the press stays closed in a step; tacking is a flash bond."""
        return {
            "flash_bottom": self.flash_bottom,
            "tack_bottom": self.flash_bottom,
            "bond_bottom": self.bond_bottom,
            "flash_middle": self.flash_middle,
            "tack_all": self.flash_middle,
            "bond_all": self.bond_all,
        }[step]


@dataclass(frozen=True)
class Step:
    """One closing of the press.

    ``layers`` are pressed together, ``adds`` those of them that join in this step, both by layer
    index; ``pins`` names the dowel pins that are in, ``pin_settings`` how long they are and how
    deep they sit. ``pressure_kpa`` is the force on the whole platen, ``film_kpa`` and the others
    what the pad makes of it (``build_up.Pressures``). ``build_up`` goes from the lower platen up.
    """

    step: int
    title: str
    bond: BondState
    layers: tuple[int, ...]
    adds: tuple[int, ...]
    pins: tuple[str, ...]
    temperature_c: float
    pressure_kpa: float
    force_n: float
    platen_mm: tuple[float, float]
    minutes: float
    film_kpa: float
    edge_kpa: float
    bond_kpa: float
    plate_kpa: float
    pressure_basis: str
    build_up: tuple[BuildUpPart, ...]
    pin_settings: tuple[PinSetting, ...]
    instructions: str

    @property
    def stack_mm(self) -> float:
        """Height of the stack that is pressed."""
        return next(item.thickness_mm for item in self.build_up if item.part == LAMINATE)

    @property
    def top_mm(self) -> float:
        """Height of the stack's top over the base plate: the stack lies on a release film."""
        release = next(item.thickness_mm for item in self.build_up if item.part == RELEASE)
        return self.stack_mm + release


@dataclass(frozen=True)
class Schedule:
    """All steps, the time they take, and what the technician should know beforehand."""

    steps: tuple[Step, ...]
    total_press_minutes: float
    estimated_build_minutes: float
    estimate_basis: str
    warnings: tuple[str, ...]


def schedule(laminate: Laminate, press: PressSettings, together: Sequence[int] = (1,)) -> Schedule:
    """The press steps of a laminate, bottom balloon first.

    Flash bonds hold layers in place on their pins. Full bonds are pressed without any, as in the
    paper; with ears a flash bond on the pins comes before each. Raises DesignError at a temperature
    that would not bond the films or that one of them or the pad does not stand, and where pad, pins
    or plate do not do for the laminate. ``together`` are the laminates that lie in the press at
    once, one number for each size of cycle, the largest first: they share the force.
    """
    _refuse_temperature(laminate, press)
    parts = assembly(laminate)
    under, *others = (
        [build_up.footprint(laminate, part.layers, count) for part in parts]
        for count in dict.fromkeys(together)
    )
    stacks = [*under, *chain.from_iterable(others)]
    pad = build_up.pad_thickness(press.pressure_kpa, press.platen, press.pad, stacks)
    pins = settings_by_step(
        [
            (height + press.release_thickness, part.pins)
            for height, part in zip(_pinned_heights(laminate, under), parts, strict=True)
        ],
        press.pin_standard,
        press.pin_lengths,
    )
    plate = plate_thickness(press.plate_thickness, pins)
    steps = tuple(
        _step(
            laminate,
            part,
            press,
            _Setting(pad, plate, stack, own),
            f" {SNIP}" if laminate.registration == "ears" and part is parts[-1] else "",
        )
        for part, stack, own in zip(parts, under, pins, strict=True)
    )
    total = sum(step.minutes for step in steps)
    tacking = press.tack * sheets.tackings(laminate)
    return Schedule(
        steps,
        total,
        total + tacking + HANDLING_MINUTES,
        f"{total:g} min in the press{_tacked(tacking)} and {HANDLING_MINUTES:g} min to cut, lay "
        "up, pin and fit the tubing; the latter is assumed the same for every design (paper: "
        "1.75 h in all)",
        tuple(_warnings(laminate, press, parts, steps)),
    )


def _pinned_heights(laminate: Laminate, under: Sequence[Footprint]) -> list[float]:
    """Height of the stack that the pins of each step reach through, mm.

    Registered sheets stay on their pins from step to step, so these are set once.
    """
    heights = [stack.height for stack in under]
    return heights if laminate.panel is None else [max(heights)] * len(heights)


def _tacked(minutes: float) -> str:
    return f", {minutes:g} min to tack masks to their films" if minutes else ""


class _Setting(NamedTuple):
    """Thickness of pad and plate, mm, and what one step's stack and pins are like."""

    pad: float
    plate: float
    under: Footprint
    pins: tuple[PinSetting, ...]


def _step(
    laminate: Laminate, part: AssemblyStep, press: PressSettings, own: _Setting, after: str
) -> Step:
    count = stack_count(laminate, part.layers)
    found = build_up.pressures(press.pressure_kpa, press.platen, press.pad, own.pad, own.under)
    title = TITLES[part.name] if count == 1 else TITLES_OF_SEVERAL[part.name]
    words = _instructions(part, count) + after
    if laminate.panel is not None:
        title, words = sheets.title(part), sheets.instructions(part)
    return Step(
        step=part.number,
        title=title,
        bond=part.bond,
        layers=part.layers,
        adds=part.adds,
        pins=tuple(pin.name for pin in part.pins),
        temperature_c=press.temperature_c,
        pressure_kpa=press.pressure_kpa,
        force_n=round(press.force_n, 1),
        platen_mm=press.platen,
        minutes=press.minutes(part.name),
        film_kpa=found.film,
        edge_kpa=found.edge,
        bond_kpa=found.bond,
        plate_kpa=found.plate,
        pressure_basis=build_up.said(press.pressure_kpa, press.pad, own.pad, own.under, found)
        + _round_pins(press, own),
        build_up=tuple(_items(press, own)),
        pin_settings=own.pins,
        instructions=words,
    )


def _round_pins(press: PressSettings, own: _Setting) -> str:
    beneath = own.under.height + press.release_thickness
    out = max((pin.stands_mm - beneath for pin in own.pins), default=0.0)
    if not out:
        return ""
    free = build_up.unpressed(press.pressure_kpa, press.pad, out)
    return f"; up to {free:.1f} mm round a pin none"


def _items(press: PressSettings, own: _Setting) -> Iterator[BuildUpPart]:
    """From the lower platen up; the films take the size that they have."""
    release = BuildUpPart(RELEASE, press.release_film, press.release_thickness, press.platen)
    pad = f"{press.pad.material}, {press.pad.hardness:g} Shore A"
    yield BuildUpPart(BASE_PLATE, press.plate_material, own.plate, press.platen)
    yield release
    yield BuildUpPart(LAMINATE, "films of this step", round(own.under.height, 6), (0.0, 0.0))
    yield release
    yield BuildUpPart(PAD, pad, own.pad, press.platen)


def _instructions(part: AssemblyStep, count: int) -> str:
    """What to do in a step that makes ``count`` stacks beside each other."""
    pins = [pin.name for pin in part.pins]
    stacks = ", then ".join(named(stack) for stack in part.stacks if stack)
    on_pins = f"on the pin{'s' if len(pins) > 1 else ''} {_listed(pins)}"
    if not part.adds:
        return f"Lay {stacks} down again, with no pin. Press to the full bond and let it cool flat."
    if part.bond == "full":
        how = on_pins if pins else "by eye, with no pin"
        return (
            f"Lay down {stacks}, {how}. Press to the full bond and let the laminate cool flat"
            + (", then draw the pins." if pins else ".")
        )
    by = on_pins if pins else "by hand"
    after = "Press to the flash bond" + (" and draw the pins." if pins else ".")
    own = "a stack" if count == 1 else f"{count} stacks"
    return f"Lay {stacks} on each other {by}, lowest first, as {own} of their own. {after}"


def _listed(words: Sequence[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def named(layers: Sequence[int]) -> str:
    """Layer indices in words; never 2-3, which a spreadsheet takes for a date."""
    runs: list[list[int]] = []
    for index in layers:
        if runs and index == runs[-1][1] + 1:
            runs[-1][1] = index
        else:
            runs.append([index, index])
    if not runs:
        return "none"
    words = [
        word
        for first, last in runs
        for word in (
            [f"{first} to {last}"] if last > first + 1 else map(str, range(first, last + 1))
        )
    ]
    return f"layer{'s' if len(layers) > 1 else ''} {_listed(words)}"


def _refuse_temperature(laminate: Laminate, press: PressSettings) -> None:
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


def _warnings(
    laminate: Laminate,
    press: PressSettings,
    parts: Sequence[AssemblyStep],
    steps: Sequence[Step],
) -> Iterator[str]:
    if laminate.panel is not None:
        yield sheets.UNTRIED
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
    pad = next(item.thickness_mm for item in steps[0].build_up if item.part == PAD)
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
            f"{_listed([f'{diameter:g}' for diameter in sorted(unsold)])}: change the diameter, or "
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
    return _listed([f"the {count} {role}s" for role, count in counts.items()])
