"""The build-up between the platens, and the pressure that reaches the films: an estimate.

The press applies a force. A pad, as large as the platen, spreads it: over a laminate the pad is
compressed by the laminate's thickness more than beside it, so its pressure there is higher.

These are estimates, not measurements. The pad is assumed linear, with a modulus from its hardness.
Lengths are mm, pressures kPa.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.design.sections import Press
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.lay_up import distinct_layers

BASE_PLATE, UNDERLAY, RELEASE = "base plate", "underlay", "release film"
LAMINATE, PAD = "laminate", "press pad"
"""The parts of the build-up, between the platens."""
PADS = (3.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 25.0)
"""Thicknesses in which silicone sheet is sold, mm; thicker pads are piles of the last."""
HARDEST_SPONGE = 30.0
"""Shore A above which no silicone sponge is sold."""
PAD_LIMIT_C = 200.0
"""Limit of silicone sponge and rubber in lasting use, C (suppliers' sheets: -60 to 200 C)."""
EVEN = 1.5
"""Largest pressure on the films over that on the platen, with a pad that is chosen here."""
MOST_UNEVEN = 2.0
"""Largest pressure on the films over that on the platen, beyond which a set-up is refused: ours."""
LARGEST_COMPRESSION = 0.6
"""Share of its thickness by which a pad can be compressed; then its cells are shut."""


@dataclass(frozen=True)
class BuildUpPart:
    """A part of the build-up: its material, thickness and size in mm."""

    part: str
    material: str
    thickness_mm: float
    size_mm: tuple[float, float]


class StackShape(NamedTuple):
    """The shape of the stacks under the pad: height, area and length of rim, mm.

    ``below`` is the height of the highest bond above the lowest, due to the masks over the latter.
    """

    height: float
    area: float
    rim: float
    below: float


class Pressures(NamedTuple):
    """Estimated pressures in kPa: over the films, over their outer edge, over the lowest bond, and
    on the bare plate beside them.

    ``free`` is the width in mm beside the edge where the pad does not touch the plate.
    """

    film: float
    edge: float
    bond: float
    plate: float
    free: float


def gent_modulus(shore_a: float) -> float:
    """Return Young's modulus in kPa of rubber with a Shore A hardness.

    A. N. Gent, On the relation between indentation hardness and Young's modulus, Trans. Inst.
    Rubber Ind. 34 (1958) 46-57; its abstract calls the relation with Shore hardness approximate.
    The constants are quoted from other programs (the paper itself was not opened). Below 40 degrees
    it is extrapolated beyond its abstract's claim; for a sponge it gives the order of magnitude.
    """
    return 1000 * 0.0981 * (56 + 7.62336 * shore_a) / (0.137505 * (254 - 2.54 * shore_a))


def pad_modulus(press: Press) -> float:
    """Return Young's modulus of the press pad, kPa.

    The default pad is a soft closed-cell sponge, 0.41 MPa by Gent's formula: 103 kPa at a quarter
    of its height, where grade 3 of ASTM D1056 ends for silicone (class D, 9 to 15 psi) and grade 4
    begins (15 to 22 psi; suppliers' summaries, the standard was not opened).
    """
    return gent_modulus(press.pad_hardness)


def footprint(laminate: Laminate, layers: Sequence[int], together: int = 1) -> StackShape:
    """Return the footprint of a stack of layers, given by index.

    ``together`` such stacks lie side by side below the pad, far enough apart for equal pressure.
    """
    films = [laminate.layer(index) for index in layers]
    widest = max(
        (layer.profile for layer in distinct_layers(laminate, layers)), key=lambda part: part.area
    )
    masks = {
        role: sum(layer.film.thickness for layer in films if layer.role == role)
        for role in ("chamber-mask", "separator-mask")
    }
    return StackShape(
        sum(layer.film.thickness for layer in films),
        together * widest.area,
        together * sum(contour.length for contour in widest.outers),
        max(masks.values()),
    )


def column_modulus(press: Press, thickness: float, under: StackShape) -> float:
    """Return the pad's modulus in kPa against the height of a stack.

    A sponge compresses column by column. Solid rubber is incompressible and must flow sideways: E
    (1 + 2 S^2), S the pressed area over the free rim (Gent and Lindley, Proc. Inst. Mech. Eng. 173
    (1959) 111, as Strojniski vestnik 60 (2014) 506, Eq. 1, quotes it: 2 is for unfilled rubber
    between plates it is bonded to).
    """
    if press.pad_material == "silicone sponge":
        return pad_modulus(press)
    shape = under.area / (under.rim * thickness)
    return pad_modulus(press) * (1 + 2 * shape * shape)


def pressures(press: Press, thickness: float, under: StackShape) -> Pressures:
    """Return the pressures on a stack from the platen's pressure, in equilibrium with the force.

    Near the edge the pad spans from the stack to the plate, with the span of a soft half-space
    under its pressure (a gap of width w closes by about 2 p w / E), and half of the load on that
    span lies on the outermost film.
    """
    share = min(1.0, under.area / press.platen_area)
    more = column_modulus(press, thickness, under) * under.height / thickness
    plate = press.pressure_kpa - more * share
    film = plate + more
    free = under.height * pad_modulus(press) / (2 * press.pressure_kpa)
    lower = pad_modulus(press) * under.below / thickness
    return Pressures(
        round(film, 1),
        round(film + max(plate, 0.0) / 2, 1),
        round(max(0.0, film - lower), 1),
        round(plate, 1),
        round(free, 1),
    )


def pad_thickness(press: Press, stacks: Sequence[StackShape]) -> float:
    """Return the pad's thickness in mm: the setting, or the thinnest sold pad or pile with an even
    enough pressure.

    Raises DesignError if the set-up cannot give the pressure on the platen.
    """
    if press.pad_material == "silicone sponge" and press.pad_hardness > HARDEST_SPONGE:
        raise DesignError(
            f"press.pad_hardness = {press.pad_hardness:g} Shore A is harder than any silicone "
            f"sponge, {HARDEST_SPONGE:g} at most; lower it, or set press.pad_material = "
            '"silicone rubber"'
        )
    of_pad = f"{press.pad_material} of {press.pad_hardness:g} Shore A"
    aim = f"press with {press.pressure_kpa:g} kPa"
    if press.pad_thickness is not None:
        reasons = (_refusal(press, press.pad_thickness, under) for under in stacks)
        if why := next(filter(None, reasons), ""):
            raise DesignError(
                f"press.pad_thickness = {press.pad_thickness:g} of {of_pad} cannot {aim}: {why}"
            )
        return press.pad_thickness
    for thickness in (*PADS, *(PADS[-1] * number for number in range(2, 9))):
        if all(
            pressures(press, thickness, under).film <= EVEN * press.pressure_kpa
            and not _refusal(press, thickness, under)
            for under in stacks
        ):
            return thickness
    highest = max(stacks, key=lambda under: under.height)
    why = _refusal(press, 8 * PADS[-1], highest) or (
        f"over a stack {highest.height:.3f} mm high it is too uneven; {FEWER}, or take a softer one"
    )
    raise DesignError(f"no press pad of {of_pad} (press.pad_hardness) can {aim}: {why}")


FEWER = "stack fewer balloons (stack.balloons)"


def _refusal(press: Press, thickness: float, under: StackShape) -> str:
    """Return the reason why a pad cannot give the pressure, and a remedy; empty if it can."""
    estimate = pressures(press, thickness, under)
    force = press.pressure_kpa * press.platen_area
    pressed = estimate.plate / pad_modulus(press) + under.height / thickness
    over = f"over a stack {under.height:.3f} mm high"
    softer = f"{FEWER}, or make it thicker or softer"
    if estimate.plate <= 0:
        return (
            f"{over} it does not reach the base plate, and the films take the whole force, "
            f"{force / under.area:.0f} kPa; {softer}"
        )
    if estimate.film > MOST_UNEVEN * press.pressure_kpa:
        return f"{over} the films would get {estimate.film:.0f} kPa; {softer}"
    if press.pad_material == "silicone sponge" and pressed > LARGEST_COMPRESSION:
        return (
            f"it would be pressed together by {pressed:.0%}, and can be by "
            f"{LARGEST_COMPRESSION:.0%}; make it harder or thicker"
        )
    return ""


def pressure_basis(press: Press, thickness: float, under: StackShape, estimate: Pressures) -> str:
    """Return the sentence that explains the estimated pressures."""
    return (
        f"estimate: {press.pressure_kpa:g} kPa on the platen are about {estimate.film:.0f} on the "
        f"films, as the pad ({thickness:g} mm, {pad_modulus(press) / 1000:.2f} MPa) gives way "
        f"{under.height:.3f} mm more there; {estimate.edge:.0f} within {estimate.free:.1f} mm of "
        f"their edge, {estimate.bond:.0f} over the lowest bond, {estimate.plate:.0f} beside them"
    )


def unpressed(press: Press, stands_out: float) -> float:
    """Return the width in mm around a protruding pin where the pad does not press."""
    return stands_out * pad_modulus(press) / (2 * press.pressure_kpa)


def pad_sheets(thickness: float) -> int:
    """Return the number of sheets in a pad."""
    return max(1, math.ceil(thickness / PADS[-1] - 1e-9))
