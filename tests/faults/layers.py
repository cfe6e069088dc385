"""Whole layers that lie, or were drawn, wrongly."""

from __future__ import annotations

from sbafab.geometry.offset import grow, shrink
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from tests.faults.record import Fault, Kind, redrawn
from tests.faults.specimen import (
    Specimen,
    base,
    cap,
    inlet_mask,
    mask,
    separator,
    tabbed_wall,
    wall,
)

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


def scaled_by(factor: float) -> Fault:
    """Every layer drawn at a wrong scale, with only the hashes put right."""

    def put(specimen: Specimen) -> None:
        specimen.redraw(specimen.clean.layers, lambda region, _: region.scaled(factor))
        specimen.doctor.rehash()

    return Fault(f"every layer scaled by {factor:g}", "as-designed", put)


def kerf(name: str, rule: str, times: int) -> Fault:
    """The film's cut paths as if the kerf were applied so many times (-1: the wrong way)."""

    def put(specimen: Specimen) -> None:
        off = (times - 1) * KERF / 2
        films = [layer for layer in specimen.clean.layers if not layer.is_mask]
        specimen.redraw(
            films, lambda region, _: grow(region, off) if off > 0 else shrink(region, -off)
        )
        specimen.doctor.rehash()

    return Fault(name, rule, put, settings=(f"laser.kerf_tpe={KERF}",))


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
        redrawn("wall scaled by 25.4", "press-fit", tabbed_wall, lambda r, _: r.scaled(25.4)),
        redrawn("wall scaled by 1.002", NOMINAL, tabbed_wall, lambda r, _: r.scaled(1.002)),
        redrawn("chamber mask scaled by 25.4", "sealing", mask, lambda r, _: r.scaled(25.4)),
        redrawn("chamber mask scaled by 1.002", "bond-width", mask, lambda r, _: r.scaled(1.002)),
        scaled_by(25.4),
        scaled_by(1.002),
        kerf("kerf applied twice", "mask-overhang", 2),
        kerf("kerf with the wrong sign", "bond-width", -1),
    ),
)
