"""The heat-press schedule: which layers are pressed together, in what order (paper Sec. 2).

Temperatures are C, pressures kPa, forces N, times minutes, lengths mm.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import NamedTuple

from sbafab.laminate.assembly import (
    AssemblyStep,
    BondState,
    StepName,
    assembly,
    is_laid_by_hand,
    stack_count,
)
from sbafab.laminate.base_plate import PlateMachine
from sbafab.laminate.laminate import Laminate
from sbafab.pressing import build_up, sheets
from sbafab.pressing.build_up import (
    BASE_PLATE,
    LAMINATE,
    PAD,
    RELEASE,
    UNDERLAY,
    BuildUpPart,
    Footprint,
    Pad,
)
from sbafab.pressing.cautions import refuse_temperature, warnings
from sbafab.pressing.dowels import (
    PinHole,
    PinSetting,
    Standard,
    pin_holes,
    plate_thickness,
    settings_by_step,
    shortest_in,
)
from sbafab.pressing.words import listed, named

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
    underlay_thickness: float = 0.1
    pin_standard: Standard = "ISO 8734"
    pin_lengths: tuple[float, ...] = ()
    plate_made_by: PlateMachine = "jig-borer"
    tack: float = 1.0
    carrier_limit: float | None = None

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
        """Height of the stack's top over the base plate, with all that lies under the stack."""
        under = 0.0
        for item in self.build_up:
            if item.part == LAMINATE:
                break
            under += 0.0 if item.part == BASE_PLATE else item.thickness_mm
        return under + self.stack_mm


@dataclass(frozen=True)
class Schedule:
    """All steps, the time they take, and what the technician should know beforehand."""

    steps: tuple[Step, ...]
    total_press_minutes: float
    estimated_build_minutes: float
    estimate_basis: str
    warnings: tuple[str, ...]
    tacking: sheets.Tacking | None = None


def schedule(laminate: Laminate, press: PressSettings, together: Sequence[int] = (1,)) -> Schedule:
    """The press steps of a laminate, bottom balloon first.

    Flash bonds hold layers in place on their pins. Full bonds are pressed without any, as in the
    paper; with ears a flash bond on the pins comes before each. Raises DesignError at a temperature
    that would not bond the films or that one of them or the pad does not stand, and where pad, pins
    or plate do not do for the laminate. ``together`` are the laminates that lie in the press at
    once, one number for each size of cycle, the largest first: they share the force.
    """
    refuse_temperature(laminate, press)
    parts = assembly(laminate)
    under, *others = (
        [build_up.footprint(laminate, part.layers, count) for part in parts]
        for count in dict.fromkeys(together)
    )
    stacks = [*under, *chain.from_iterable(others)]
    pad = build_up.pad_thickness(press.pressure_kpa, press.platen, press.pad, stacks)
    pins = pins_by_step(laminate, press)
    plate = plate_thickness(press.plate_thickness, pins)
    steps = tuple(
        _step(
            laminate,
            part,
            press,
            _Setting(pad, plate, stack, own, _under(laminate, part, press)),
            f" {SNIP}" if laminate.registration == "ears" and part is parts[-1] else "",
        )
        for part, stack, own in zip(parts, under, pins, strict=True)
    )
    total = sum(step.minutes for step in steps)
    tacking = None
    if laminate.panel is not None:
        low = tack_pins(laminate, press)
        tacking = sheets.tacking(laminate, press.tack, press.temperature_c, plate, low)
    tacked = 0.0 if tacking is None else tacking.total_minutes
    return Schedule(
        steps,
        total,
        total + tacked + HANDLING_MINUTES,
        f"{total:g} min in the press{_tacked(tacking)} and {HANDLING_MINUTES:g} min to cut, lay "
        "up, pin and fit the tubing; the latter is assumed the same for every design (paper: "
        "1.75 h in all)",
        tuple(warnings(laminate, press, parts, steps)),
        tacking,
    )


def pins_by_step(laminate: Laminate, press: PressSettings) -> list[tuple[PinSetting, ...]]:
    """Return the pins of every press step. Raises DesignError where pins or plate do not do."""
    parts = assembly(laminate)
    heights = [build_up.footprint(laminate, part.layers).height for part in parts]
    if laminate.panel is not None:
        # Registered sheets stay on their pins from step to step, so these are set once.
        heights = [max(heights)] * len(heights)
    return settings_by_step(
        [
            (round(height + _under(laminate, part, press) + press.release_thickness, 6), part.pins)
            for height, part in zip(heights, parts, strict=True)
        ],
        press.pin_standard,
        press.pin_lengths,
        press.plate_thickness,
    )


def tack_pins(laminate: Laminate, press: PressSettings) -> tuple[PinSetting, ...]:
    """Return the corner pins for tacks of registered sheets: shorter ones in the same holes."""
    top = sheets.tack_stack(laminate) + press.release_thickness
    return tuple(
        shortest_in(setting, top, press.pin_standard, press.pin_lengths)
        for setting in pins_by_step(laminate, press)[0]
    )


def plate_holes(laminate: Laminate, press: PressSettings) -> dict[str, PinHole]:
    """Return the base plate's hole of every pin that some step or tack uses, by the pin's name."""
    tacks = [] if laminate.panel is None else [tack_pins(laminate, press)]
    return pin_holes([*pins_by_step(laminate, press), *tacks])


def _under(laminate: Laminate, part: AssemblyStep, press: PressSettings) -> float:
    """Thickness of the underlay of a step, mm; 0 where nothing is laid by hand."""
    return press.underlay_thickness if is_laid_by_hand(laminate, part) else 0.0


def _tacked(tacking: sheets.Tacking | None) -> str:
    if tacking is None:
        return ""
    return (
        f", {tacking.total_minutes:.0f} min to tack the masks of {tacking.sheets} sheets to their "
        f"films ({tacking.basis})"
    )


class _Setting(NamedTuple):
    """Thickness of pad, plate and underlay, mm, and what one step's stack and pins are like."""

    pad: float
    plate: float
    under: Footprint
    pins: tuple[PinSetting, ...]
    underlay: float


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
    beneath = own.under.height + press.release_thickness + own.underlay
    out = max((pin.stands_mm + pin.tolerance_mm - beneath for pin in own.pins), default=0.0)
    if not out:
        return ""
    free = build_up.unpressed(press.pressure_kpa, press.pad, out)
    return f"; up to {free:.1f} mm round a pin none"


def _items(press: PressSettings, own: _Setting) -> Iterator[BuildUpPart]:
    """From the lower platen up; the films take the size that they have."""
    release = BuildUpPart(RELEASE, press.release_film, press.release_thickness, press.platen)
    pad = f"{press.pad.material}, {press.pad.hardness:g} Shore A"
    yield BuildUpPart(BASE_PLATE, press.plate_material, own.plate, press.platen)
    if own.underlay:
        yield BuildUpPart(UNDERLAY, "plain paper, printed", own.underlay, press.platen)
    yield release
    yield BuildUpPart(LAMINATE, "films of this step", round(own.under.height, 6), (0.0, 0.0))
    yield release
    yield BuildUpPart(PAD, pad, own.pad, press.platen)


def _instructions(part: AssemblyStep, count: int) -> str:
    """What to do in a step that makes ``count`` stacks beside each other."""
    pins = [pin.name for pin in part.pins]
    stacks = ", then ".join(named(stack) for stack in part.stacks if stack)
    on_pins = f"on the pin{'s' if len(pins) > 1 else ''} {listed(pins)}"
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
