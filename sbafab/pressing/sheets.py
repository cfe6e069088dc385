"""What the press schedule says of registered sheets; no bench has tried it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sbafab.laminate.assembly import AssemblyStep
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.heating import ROOM, WARM
from sbafab.pressing.dowels import PinSetting

UNTRIED = (
    "no bench has tried registered sheets; the times are the paper's for single parts, so try one "
    "copy of two balloons first"
)
CUT_FREE = (
    "Draw the pins. Lay the second cut by the fiducials and cut the bridges: the actuators come "
    "out, and the sheets round them come off."
)


def title(part: AssemblyStep) -> str:
    """The name of a step in which whole sheets are pressed."""
    return "All sheets but the cap's" if part.bond == "flash" else "The whole stack of sheets"


def instructions(part: AssemblyStep) -> str:
    """What to do with the sheets in a step."""
    if part.bond == "full":
        return (
            f"Lay the sheet of layer {part.adds[-1]} on its pins over the stack. Press to the full "
            f"bond and let the stack cool flat. {CUT_FREE}"
        )
    return (
        f"Stack the sheets of layers {part.layers[0]} to {part.layers[-1]} on the corner pins, "
        "lowest first, every film with its masks tacked on. Press to the flash bond; the stack "
        "stays on its pins."
    )


TOUCH = 40.0
"""C of a plate that can be touched."""
STEEL = 3.8e6
"""J/(m3 K): heat of a base plate; 7,850 kg/m3 of steel with 490 J/(kg K)."""
CONTACT, AIR = 500.0, 10.0
"""W/(m2 K): from a platen into a plate that lies dry on it, and from each face of a plate into
still air. Handbook orders, ours: neither was measured in a press."""


@dataclass(frozen=True)
class Tacking:
    """How masks are tacked to their films: so many sheets, each by itself, on a plate that goes in
    cold and is cooled again. Minutes are those of one sheet; ``pins`` are the corner pins' then.
    """

    sheets: int
    warm_minutes: float
    press_minutes: float
    cool_minutes: float
    stack_mm: float
    pins: tuple[PinSetting, ...]
    basis: str

    @property
    def each_minutes(self) -> float:
        """Minutes of one sheet, from cold to cold."""
        return self.warm_minutes + self.press_minutes + self.cool_minutes

    @property
    def total_minutes(self) -> float:
        """Minutes of all sheets, one after the other on one plate."""
        return self.sheets * self.each_minutes


def tack_stack(laminate: Laminate) -> float:
    """Height of the highest film with its mask, mm; the transfer film stops short of the pins."""
    masks = [layer.film.thickness for layer in laminate.layers if layer.is_mask]
    films = [layer.film.thickness for layer in laminate.layers if not layer.is_mask]
    return round(max(films) + max(masks), 6)


def tacking(
    laminate: Laminate, minutes: float, platen_c: float, plate: float, pins: tuple[PinSetting, ...]
) -> Tacking:
    """Return how the masks of registered sheets are tacked, on a base plate ``plate`` mm thick.

    First order: a plate that heat reaches through one face, and leaves through both.
    """
    heat = STEEL * plate / 1000
    warm = heat / CONTACT * math.log((platen_c - ROOM) / WARM) / 60
    cool = heat / (2 * AIR) * math.log((platen_c - ROOM) / (TOUCH - ROOM)) / 60
    return Tacking(
        sheets=sum(layer.is_mask for layer in laminate.layers),
        warm_minutes=round(warm, 1),
        press_minutes=minutes,
        cool_minutes=round(cool, 1),
        stack_mm=tack_stack(laminate),
        pins=pins,
        basis=(
            f"first-order estimate: a steel plate of {plate:g} mm from {ROOM:g} C to {WARM:g} C "
            f"short of the platen with {CONTACT:g} W/(m2 K), and in still air down to {TOUCH:g} C "
            f"with {AIR:g} W/(m2 K) from each face; not measured"
        ),
    )
