"""Chords on the side of their arcs that takes from bonds, overhangs and pins."""

from __future__ import annotations

import math
from collections.abc import Callable

from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.contour import Contour
from sbafab.geometry.region import Region, polygon
from tests.faults.record import Fault, Kind, Pick, Specimen, mask, separator, wall

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


KIND = Kind(
    "Chords",
    f"One layer is drawn in chords within {ERROR:g} mm, and its file says so; the others in arcs.",
    (
        chorded("film in chords inside its outline", "bond-width", wall, inside),
        chorded("chamber mask in chords outside its outline", "bond-width", mask, outside),
        chorded("separator in chords inside its outline", "mask-overhang", separator, inside),
        chorded("bore in chords inside its circle", "channel-clear", wall, tight_holes),
    ),
)
