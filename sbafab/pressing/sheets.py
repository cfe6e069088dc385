"""What the press schedule says of registered sheets; no bench has tried it."""

from __future__ import annotations

from sbafab.laminate.assembly import AssemblyStep
from sbafab.laminate.laminate import Laminate

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


def tackings(laminate: Laminate) -> int:
    """How often the press closes to tack masks to a film: once for every mask sheet."""
    return 0 if laminate.panel is None else sum(layer.is_mask for layer in laminate.layers)
