"""Masks of a wrong size or shape: what must bond does not, what must not does."""

from __future__ import annotations

import math
from collections.abc import Callable

from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Point
from sbafab.geometry.offset import grow, shrink
from sbafab.geometry.region import Region, disc, polygon, strip, union
from sbafab.laminate.laminate import Inlet, Laminate
from tests.faults.holes import aside, bore, cut_in_two
from tests.faults.record import Fault, Kind, no_lumen, no_sheet, one_chamber, redrawn
from tests.faults.specimen import (
    Pick,
    Specimen,
    base,
    cap,
    inlet_mask,
    mask,
    separator,
    sheet_mask,
    wall,
)


def smaller(region: Region, laminate: Laminate) -> Region:
    return shrink(region, 0.1)


def inside_the_rim(region: Region, laminate: Laminate) -> Region:
    """Its outer edge moved in from 0.5 outside the films' edge to 0.8 inside."""
    return region & shrink(Region(region.outers), 1.3)


def larger(region: Region, laminate: Laminate) -> Region:
    """By 0.01, which leaves a bond of 0.74."""
    return grow(region, 0.01)


def with_strip(region: Region, laminate: Laminate, start: Point, end: Point) -> Region:
    """Joined by a strip of 0.5, the bores left open."""
    joined = region | strip(start, end, 0.5)
    for own in laminate.bores:
        joined = joined - disc(own.centre, own.diameter / 2)
    return joined


def to_neighbour(region: Region, laminate: Laminate) -> Region:
    first, second = (laminate.bores[n].centre for n in (0, 1))
    return with_strip(region, laminate, first, second)


def to_lumen(region: Region, laminate: Laminate) -> Region:
    x, y = bore(laminate)
    return with_strip(region, laminate, (0.1 * x, 0.1 * y), (x, y))


def to_outside(region: Region, laminate: Laminate) -> Region:
    return with_strip(region, laminate, bore(laminate), aside(bore(laminate), 9.0))


def ring_cut(region: Region, laminate: Laminate) -> Region:
    centre = bore(laminate)
    return region | strip(aside(centre, 0.45), aside(centre, 2.5), 0.3)


def ring_missing(region: Region, laminate: Laminate) -> Region:
    return region | (disc(bore(laminate), 1.5) - disc(bore(laminate), 0.5))


def without_chamber(region: Region, laminate: Laminate) -> Region:
    """Without the piece round the first bore."""
    pieces = [piece for piece in region.pieces if not _is_round(piece, bore(laminate))]
    return Region(tuple(contour for piece in pieces for contour in piece.contours))


def _is_round(piece: Region, p: Point) -> bool:
    return any(outer.winding(p) != 0 for outer in piece.outers)


def island(region: Region, laminate: Laminate) -> Region:
    high_x, high_y = region.bounds[2:]
    return region | disc((high_x + 3.0, high_y + 3.0), 1.0)


def window_closed(region: Region, laminate: Laminate) -> Region:
    """The mask under the first film without its window."""
    pieces = region.pieces
    window = next(hole for hole in pieces[0].holes if hole.circle is None)
    return region | Region((window.reversed(),))


def _inside(inlet: Inlet, depth: float, offset: float = 0.0) -> Point:
    (x, y), (dx, dy) = inlet.mouth, inlet.direction
    return x - depth * dx + offset * dy, y - depth * dy - offset * dx


def strip_blocked(region: Region, laminate: Laminate) -> Region:
    """A gap of 1 mm in the first inlet's strip, half way along its straight run."""
    inlet = laminate.inlets[0]
    half = inlet.length / 2
    return region - strip(_inside(inlet, half - 0.5), _inside(inlet, half + 0.5), 4.0)


def strip_cut_short(region: Region, laminate: Laminate) -> Region:
    inlet = laminate.inlets[0]
    return region - strip(_inside(inlet, 1.0), _inside(inlet, -2.0), 4.0)


def strip_narrow(region: Region, laminate: Laminate) -> Region:
    """0.3 off either side: 1.0 wide, and a tube of 1.016 needs 1.596."""
    inlet = laminate.inlets[0]
    for side in (1.0, -1.0):
        off = side * (inlet.width / 2 - 0.3 + 1.0)
        start, end = _inside(inlet, inlet.length - 0.3, off), _inside(inlet, -2.0, off)
        region = region - strip(start, end, 2.0)
    return region


def strip_aside(region: Region, laminate: Laminate) -> Region:
    """Widened by 0.05 to one side of its run, the bond beside it narrowed as much."""
    inlet = laminate.inlets[0]
    off = inlet.width / 2
    return region | strip(_inside(inlet, inlet.length, off), _inside(inlet, -0.5, off), 0.1)


def tabs_left(region: Region, laminate: Laminate) -> Region:
    """As wide as the strips and with their run: over the tabs of the bottom balloon."""
    tabs = (strip(_inside(i, i.length + 1.0), i.mouth, i.width) for i in laminate.inlets)
    return union([region, *tabs])


def tab_cut_off(region: Region, laminate: Laminate) -> Region:
    inlet = laminate.inlets[0]
    return region - strip(_inside(inlet, 4.0), _inside(inlet, -2.0), 6.0)


KIND = Kind(
    "Masks, chambers, inlets",
    "Chambers are joined by a strip of mask 0.5 mm wide. The inlet is that of the first chamber.",
    (
        redrawn("separator too small by 0.1 all round", "mask-overhang", separator, smaller),
        redrawn(
            "separator that ends 0.8 inside the films' edge",
            "facing-films",
            separator,
            inside_the_rim,
        ),
        redrawn("inlet tab left on the cap", "facing-films", cap, tabs_left),
        redrawn("separator too large: bond 0.74", "bond-width", separator, larger),
        redrawn("chamber mask too large: bond 0.74", "bond-width", mask, larger),
        redrawn("chamber mask with strip too large: bond 0.74", "bond-width", inlet_mask, larger),
        redrawn("chamber mask with strip too small by 0.1", "tube-fit", inlet_mask, smaller),
        redrawn("chamber mask split", "piece-count", mask, cut_in_two),
        redrawn("separator split", "piece-count", separator, cut_in_two),
        redrawn("chamber missing from a mask", "sealing", mask, without_chamber, one_chamber),
        redrawn(
            "chamber missing from the mask with strips",
            "sealing",
            inlet_mask,
            without_chamber,
            one_chamber,
        ),
        redrawn("stray island in a mask", "piece-count", mask, island),
        redrawn("stray island of film", "piece-count", wall, island),
        redrawn("neck ring cut through", "sealing", separator, ring_cut),
        redrawn("neck ring missing", "sealing", separator, ring_missing),
        redrawn("chamber joined to its neighbour", "sealing", mask, to_neighbour, one_chamber),
        redrawn(
            "chamber joined to its neighbour at the inlets",
            "sealing",
            inlet_mask,
            to_neighbour,
            one_chamber,
        ),
        redrawn("chamber joined to the lumen", "sealing", mask, to_lumen, no_lumen),
        redrawn("chamber joined to the outside", "sealing", mask, to_outside),
        redrawn("balloon cut off from its inlet", "sealing", inlet_mask, strip_blocked),
        redrawn("strip too narrow for the tube", "tube-fit", inlet_mask, strip_narrow),
        redrawn("strip not reaching the tab's end", "tube-fit", inlet_mask, strip_cut_short),
        redrawn("strip 0.05 too near the tab's edge", "bond-width", inlet_mask, strip_aside),
        redrawn(
            "mask on the sheet too small by 0.1", "mask-overhang", sheet_mask, smaller, no_sheet
        ),
        redrawn(
            "window closed in the mask on the sheet", "sealing", sheet_mask, window_closed, no_sheet
        ),
        redrawn("tab missing in one film", "registration-nominal", base, tab_cut_off),
    ),
)


# Chords on the side of their arcs that takes from bonds, overhangs and pins.


ERROR = 0.05


def chorded(name: str, rule: str, pick: Pick, draw: Callable[[Region], Region]) -> Fault:
    """A fault in one layer's chords, with a file and a manifest that agree with them."""

    def put(specimen: Specimen) -> None:
        layer = pick(specimen.clean)
        specimen.redraw([layer], lambda region, _: draw(region))
        path = specimen.doctor.path(layer.index)
        found = read_profile(path)
        told = {**found.properties, "CURVES": f"chords within {ERROR:g} mm"}
        path.write_text(dxf_text(cutting_sequence(found.region), told), newline="\n")

    return Fault(name, rule, put)


def inside(region: Region) -> Region:
    """Chords that shrink the outlines, as those of a chamber mask may."""
    return in_chords(region, "chamber-mask", ERROR)


def outside(region: Region) -> Region:
    """Chords that grow the outlines, as those of a separator may."""
    return in_chords(region, "separator-mask", ERROR)


def tight_holes(region: Region) -> Region:
    """Round holes with their corners on the circle, so that no pin passes."""
    return Region(tuple(_inscribed(c) if c.is_hole else c for c in region.contours))


def _inscribed(hole: Contour) -> Contour:
    assert hole.circle is not None
    (x, y), _ = hole.circle
    corners = [edge.at(share) for edge in hole.edges for share in (0.0, 1 / 3, 2 / 3)]
    shape = polygon(sorted(corners, key=lambda p: _turn(p[0] - x, p[1] - y)))
    return shape.contours[0].reversed()


def _turn(x: float, y: float) -> float:
    return math.atan2(y, x)


CHORDS_KIND = Kind(
    "Chords",
    f"One layer is drawn in chords within {ERROR:g} mm, and its file says so; the others in arcs.",
    (
        chorded("film in chords inside its outline", "bond-width", wall, inside),
        chorded("chamber mask in chords outside its outline", "bond-width", mask, outside),
        chorded("separator in chords inside its outline", "mask-overhang", separator, inside),
        chorded("bore in chords inside its circle", "channel-clear", wall, tight_holes),
    ),
)
