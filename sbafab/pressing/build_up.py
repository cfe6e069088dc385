"""What lies between the platens, and the pressure that reaches the films: an estimate.

The press gives a force. A pad, as large as the platen, spreads it: where a laminate lies the pad
is pressed together by the laminate's thickness more than beside it, and pushes back there the more.

Nothing here was measured in a press. The pad is taken as linear, its modulus from its hardness.
Lengths are mm, pressures kPa.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from sbafab.errors import DesignError
from sbafab.laminate.assembly import distinct_layers
from sbafab.laminate.laminate import Laminate

PadMaterial = Literal["silicone sponge", "silicone rubber"]

BASE_PLATE, UNDERLAY, RELEASE = "base plate", "underlay", "release film"
LAMINATE, PAD = "laminate", "press pad"
"""The parts of the build-up, between the platens."""
PADS = (3.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 25.0)
"""Thicknesses in which silicone sheet is sold; thicker pads are piled of the last."""
HARDEST_SPONGE = 30.0
"""Shore A above which no silicone sponge is sold."""
PAD_LIMIT_C = 200.0
"""What silicone sponge and rubber stand in lasting use (suppliers' sheets: -60 to 200 C)."""
EVEN = 1.5
"""A pad is chosen so thick that the films get at most this many times the pressure asked for."""
MOST = 2.0
"""Beyond this many times the pressure asked for a set-up is refused: ours."""
FULL = 0.6
"""Share of its thickness by which a pad can be pressed together; then its cells are shut."""


@dataclass(frozen=True)
class Pad:
    """The compliant sheet: ``thickness`` None stands for the thinnest that is even enough.

    ``hardness`` is Shore A. The default is a soft closed-cell sponge, 0.41 MPa by Gent's formula:
    103 kPa at a quarter of its height, where grade 3 of ASTM D1056 ends for silicone (class D, 9 to
    15 psi) and grade 4 begins (15 to 22 psi; suppliers' summaries, the standard was not opened).
    """

    material: PadMaterial = "silicone sponge"
    thickness: float | None = None
    hardness: float = 10.0

    @property
    def modulus(self) -> float:
        return gent_modulus(self.hardness)


@dataclass(frozen=True)
class BuildUpPart:
    """A part of the build-up: what it is of, its thickness and size in mm (0: as the laminate)."""

    part: str
    material: str
    thickness_mm: float
    size_mm: tuple[float, float]


@dataclass(frozen=True)
class Footprint:
    """What the stacks show the pad: their height, area and rim, and the masks that bonds lie below.

    ``below`` is how much lower the lowest bonded place is than the highest.
    """

    height: float
    area: float
    rim: float
    below: float


@dataclass(frozen=True)
class Pressures:
    """Estimated kPa: over the films, over their outer edge, over the lowest bond, and on the bare
    plate beside them. ``free`` is how many mm beside the edge the pad does not reach the plate.
    """

    film: float
    edge: float
    bond: float
    plate: float
    free: float


def gent_modulus(shore_a: float) -> float:
    """Young's modulus in kPa of rubber of a Shore A hardness.

    A. N. Gent, On the relation between indentation hardness and Young's modulus, Trans. Inst.
    Rubber Ind. 34 (1958) 46-57; its abstract says the relation with Shore hardness is approximate.
    The numbers are those that other programs quote of it (the paper itself was not opened). Below
    40 degrees it is stretched past what its abstract claims, and for a sponge it is an order.
    """
    return 1000 * 0.0981 * (56 + 7.62336 * shore_a) / (0.137505 * (254 - 2.54 * shore_a))


def footprint(laminate: Laminate, layers: Sequence[int], together: int = 1) -> Footprint:
    """Of a stack of layers, given by index, or of the registered sheets that they are part of.

    ``together`` such stacks lie below the pad side by side, far enough apart to be pressed alike.
    """
    films = [laminate.layer(index) for index in layers]
    widest = max(
        (layer.profile for layer in distinct_layers(laminate, layers)), key=lambda part: part.area
    )
    if laminate.panel is not None:
        widest = laminate.panel.outline
    masks = {
        role: sum(layer.film.thickness for layer in films if layer.role == role)
        for role in ("chamber-mask", "separator-mask")
    }
    return Footprint(
        sum(layer.film.thickness for layer in films),
        together * widest.area,
        together * sum(contour.length for contour in widest.outers),
        max(masks.values()),
    )


def column_modulus(pad: Pad, thickness: float, under: Footprint) -> float:
    """What the pad resists a stack's height with, kPa.

    A sponge gives way column by column. Solid rubber keeps its volume and must flow aside: E (1 +
    2 S^2), S the pressed area over the free rim (Gent and Lindley, Proc. Inst. Mech. Eng. 173
    (1959) 111, as Strojniski vestnik 60 (2014) 506, Eq. 1, quotes it: 2 is for unfilled rubber
    between plates it is bonded to).
    """
    if pad.material == "silicone sponge":
        return pad.modulus
    shape = under.area / (under.rim * thickness)
    return pad.modulus * (1 + 2 * shape * shape)


def pressures(
    asked: float, platen: tuple[float, float], pad: Pad, thickness: float, under: Footprint
) -> Pressures:
    """What a stack gets of a pressure on the whole platen, in balance with the force.

    Near the edge the pad spans from the stack to the plate, as long as a soft half-space does
    under its pressure (a gap of width w closes by about 2 p w / E), and half of what it carries
    there lies on the outermost film.
    """
    share = min(1.0, under.area / (platen[0] * platen[1]))
    more = column_modulus(pad, thickness, under) * under.height / thickness
    plate = asked - more * share
    film = plate + more
    free = under.height * pad.modulus / (2 * asked)
    lower = pad.modulus * under.below / thickness
    return Pressures(
        round(film, 1),
        round(film + max(plate, 0.0) / 2, 1),
        round(max(0.0, film - lower), 1),
        round(plate, 1),
        round(free, 1),
    )


def pad_thickness(
    asked: float, platen: tuple[float, float], pad: Pad, stacks: Sequence[Footprint]
) -> float:
    """The pad's thickness: as given, or the thinnest sold, or pile of these, that is even enough.

    Raises DesignError where the set-up cannot give the pressure asked for.
    """
    if pad.material == "silicone sponge" and pad.hardness > HARDEST_SPONGE:
        raise DesignError(
            f"press.pad_hardness = {pad.hardness:g} Shore A is none of a silicone sponge, which "
            f"has at most {HARDEST_SPONGE:g}; lower it, or set press.pad_material = "
            '"silicone rubber"'
        )
    if pad.thickness is not None:
        reasons = (_refusal(asked, platen, pad, pad.thickness, under) for under in stacks)
        why = next((reason for reason in reasons if reason), "")
        if why:
            raise DesignError(
                f"press.pad_thickness = {pad.thickness:g} of {pad.material} of {pad.hardness:g} "
                f"Shore A cannot press with {asked:g} kPa: {why}"
            )
        return pad.thickness
    for thickness in (*PADS, *(PADS[-1] * number for number in range(2, 9))):
        if all(
            pressures(asked, platen, pad, thickness, under).film <= EVEN * asked
            and not _refusal(asked, platen, pad, thickness, under)
            for under in stacks
        ):
            return thickness
    highest = max(stacks, key=lambda under: under.height)
    why = (
        _refusal(asked, platen, pad, 8 * PADS[-1], highest) or "it is too uneven; take a softer one"
    )
    raise DesignError(
        f"no press pad of {pad.material} of {pad.hardness:g} Shore A (press.pad_hardness) can "
        f"press with {asked:g} kPa: {why}"
    )


def _refusal(
    asked: float, platen: tuple[float, float], pad: Pad, thickness: float, under: Footprint
) -> str:
    """Why a pad cannot give the pressure, and what would help; empty where it can."""
    found = pressures(asked, platen, pad, thickness, under)
    pressed = found.plate / pad.modulus + under.height / thickness
    if found.plate <= 0:
        return (
            f"over a stack {under.height:.3f} mm high it does not reach the base plate, and the "
            f"films take the whole force, {asked * platen[0] * platen[1] / under.area:.0f} kPa; "
            "make it thicker or softer"
        )
    if found.film > MOST * asked:
        return (
            f"over a stack {under.height:.3f} mm high the films would get {found.film:.0f} kPa; "
            "make it thicker or softer"
        )
    if pad.material == "silicone sponge" and pressed > FULL:
        return (
            f"it would be pressed together by {pressed:.0%}, and can be by {FULL:.0%}; make it "
            "harder or thicker"
        )
    return ""


def said(asked: float, pad: Pad, thickness: float, under: Footprint, found: Pressures) -> str:
    """One sentence: why the films get what they get."""
    return (
        f"estimate: {asked:g} kPa on the platen are about {found.film:.0f} on the films, as the "
        f"pad ({thickness:g} mm, {pad.modulus / 1000:.2f} MPa) gives way {under.height:.3f} mm "
        f"more there; {found.edge:.0f} within {found.free:.1f} mm of their edge, {found.bond:.0f} "
        f"over the lowest bond, {found.plate:.0f} beside them"
    )


def unpressed(asked: float, pad: Pad, stands_out: float) -> float:
    """How far round a pin, mm, the pad does not press that stands so far out of the stack."""
    return stands_out * pad.modulus / (2 * asked)


def pieces(thickness: float) -> int:
    """How many sheets a pad is piled of."""
    return max(1, math.ceil(thickness / PADS[-1] - 1e-9))
