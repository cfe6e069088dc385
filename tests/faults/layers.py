"""Whole layers that lie, or were drawn, wrongly."""

from __future__ import annotations

from collections.abc import Sequence

from sbafab.geometry.offset import grow, shrink
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate, Layer
from tests.faults.record import Fault, Kind, redrawn
from tests.faults.specimen import Change, base, cap, inlet_mask, mask, separator, tabbed_wall, wall

KERF = 0.2
NOMINAL = "registration-nominal"


def shifted(region: Region, laminate: Laminate) -> Region:
    return region.moved(0.15, 0.0)


def turned(region: Region, laminate: Laminate) -> Region:
    return region.turned(2.0)


def flipped(region: Region, laminate: Laminate) -> Region:
    """Turned over about the y axis, or about the x axis where that shows."""
    over = region.mirrored()
    apart = (region | over).area - (region & over).area
    return over if apart > 1e-6 else over.turned(180.0)


def every(laminate: Laminate) -> Sequence[Layer]:
    return laminate.layers


def scaled(factor: float) -> Change:
    return lambda region, _: region.scaled(factor)


def kerf(name: str, rule: str, times: int) -> Fault:
    """The film's cut paths as if the kerf were applied so many times (-1: the wrong way)."""
    off = (times - 1) * KERF / 2

    def films(laminate: Laminate) -> list[Layer]:
        return [layer for layer in laminate.layers if not layer.is_mask]

    def change(region: Region, _: Laminate) -> Region:
        return grow(region, off) if off > 0 else shrink(region, -off)

    return redrawn(name, rule, films, change, settings=(f"laser.kerf_tpe={KERF}",))


KIND = Kind(
    "Layers shifted, turned, flipped, scaled",
    "Shifts are 0.15 mm along x, turns 2 degrees about the axis; a flipped layer is turned over "
    "about the y axis, or about the x axis where the y axis shows nothing.",
    (
        redrawn("wall shifted", NOMINAL, wall, shifted),
        redrawn("wall with tab shifted", NOMINAL, tabbed_wall, shifted),
        redrawn("base shifted", NOMINAL, base, shifted),
        redrawn("cap shifted", NOMINAL, cap, shifted),
        redrawn("chamber mask shifted", "bond-width", mask, shifted),
        redrawn("chamber mask with strip shifted", "bond-width", inlet_mask, shifted),
        redrawn("separator shifted", "mask-overhang", separator, shifted),
        redrawn("wall with tab turned", NOMINAL, tabbed_wall, turned),
        redrawn("wall turned", NOMINAL, wall, turned),
        redrawn("chamber mask turned", "bond-width", mask, turned),
        redrawn("chamber mask with strip turned", "bond-width", inlet_mask, turned),
        redrawn("separator turned", "mask-overhang", separator, turned),
        redrawn("wall with tab flipped", NOMINAL, tabbed_wall, flipped),
        redrawn("wall flipped", NOMINAL, wall, flipped),
        redrawn("base flipped", NOMINAL, base, flipped),
        redrawn("chamber mask with strip flipped", "tube-fit", inlet_mask, flipped),
        redrawn("separator flipped", "mask-overhang", separator, flipped),
        redrawn("wall scaled by 25.4", "press-fit", tabbed_wall, scaled(25.4)),
        redrawn("wall scaled by 1.002", NOMINAL, tabbed_wall, scaled(1.002)),
        redrawn("chamber mask scaled by 25.4", "sealing", mask, scaled(25.4)),
        redrawn("chamber mask scaled by 1.002", "bond-width", mask, scaled(1.002)),
        *(
            redrawn(f"every layer scaled by {factor:g}", "as-designed", every, scaled(factor))
            for factor in (25.4, 1.002)
        ),
        kerf("kerf applied twice", "mask-overhang", 2),
        kerf("kerf with the wrong sign", "bond-width", -1),
    ),
)
