"""What KLayout and GDAL make of a laminate, beside what our own rules measure."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import klayout.db as kdb
import shapely
from pyogrio import raw

from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.region import Region
from sbafab.geometry.width import Width, least_gap, least_width
from sbafab.laminate.laminate import Laminate
from sbafab.rules import film_limits, margins, mask_overhang
from sbafab.rules.measures import Measures, distinct_interfaces
from tests.designs import PAPER

UNIT = 1e-5
"""mm of one step of KLayout's grid."""
SAGITTA = 0.001
"""mm that a chord of the polygons stays off its arc."""
TOLERANCE = 2 * SAGITTA + 20 * UNIT
"""A chord on either side, and the grid."""
WIDEST = 3.0
"""mm; of anything wider it is only asked that KLayout, too, finds nothing narrower than this."""
CORNERS = 0.1
"""mm past our measure that KLayout looks at corners: of ends that just reach it finds nothing."""
GRAZING = 100
"""Steps along which edges must face: less is a corner of one chord grazing another's normal."""


class Compared(NamedTuple):
    """One measure by us and by KLayout: mm, None where nothing is narrower than WIDEST.

    ``how`` tells where KLayout saw it: ``square`` between edges, only between ``corners``, or
    ``aslant``, in a taper that it measures square to one side and we from side to side.
    """

    what: str
    layer: int
    ours: float
    theirs: float | None
    how: str

    @property
    def agrees(self) -> bool:
        if self.theirs is None:
            return self.ours > WIDEST - TOLERANCE
        if self.how == "aslant":
            return self.theirs > self.ours * math.cos(math.radians(film_limits.SHARP)) - TOLERANCE
        return abs(self.ours - self.theirs) <= TOLERANCE


def as_klayout(region: Region) -> kdb.Region:
    """The region as polygons on KLayout's grid."""
    made = kdb.Region()
    for outer, *holes in region.polygons(SAGITTA):
        polygon = kdb.Polygon(_on_grid(outer))
        for hole in holes:
            polygon.insert_hole(_on_grid(hole))
        made.insert(polygon)
    return made


def _on_grid(ring: list[tuple[float, float]]) -> list[kdb.Point]:
    return [kdb.Point(round(x / UNIT), round(y / UNIT)) for x, y in ring]


def widths(laminate: Laminate) -> Iterator[Compared]:
    """The least width of every bond, web and slot."""
    for alike in distinct_interfaces(laminate):
        bond = alike.interface.bond
        layer = alike.interface.below.index
        found = compared("bond", bond, layer, least_width(bond, margins.SHARP))
        if found is not None:
            yield found
    for layers in laminate.patterns.values():
        profile, layer = layers[0].profile, layers[0].index
        for what, measured in (("web", least_width), ("slot", least_gap)):
            found = compared(what, profile, layer, measured(profile, film_limits.SHARP))
            if found is not None:
                yield found


def compared(what: str, region: Region, layer: int, ours: Width | None) -> Compared | None:
    """The least width of a region as we and as KLayout see it; None where there is none."""
    if ours is None:
        return None
    shape = as_klayout(region)
    check = shape.space_check if what == "slot" else shape.width_check
    sharp = margins.SHARP if what == "bond" else film_limits.SHARP
    limit = round(min(ours.value + 2 * TOLERANCE, WIDEST) / UNIT)
    square = min(
        _distances(check(limit, False, kdb.Region.Projection, sharp, GRAZING, None)), default=None
    )
    if ours.value > WIDEST or (square is not None and square <= ours.value + TOLERANCE):
        tapers = what == "slot" and square is not None and square < ours.value - TOLERANCE
        return Compared(what, layer, ours.value, square, "aslant" if tapers else "square")
    # At corners nothing need stand square; then any of KLayout's distances may be ours.
    further = limit + round(CORNERS / UNIT)
    corners = _distances(check(further, False, kdb.Region.Euclidian, 90.0, None, None))
    nearest = min(corners, key=lambda value: abs(value - ours.value), default=None)
    return Compared(what, layer, ours.value, nearest, "corners")


def _distances(pairs: kdb.EdgePairs) -> list[float]:
    """Distances in mm, but of pairs that hold a mere point: KLayout calls those 0."""
    return [
        pair.distance() * UNIT
        for pair in pairs.each()
        if not pair.first.is_degenerate() and not pair.second.is_degenerate()
    ]


def overhang(laminate: Laminate) -> Compared | None:
    """The least reach of a mask past a free film edge that it covers."""
    ours = mask_overhang.check(Measures(laminate, PAPER))[0].measured
    if ours is None:
        return None
    found: list[tuple[float, int]] = []
    limit = round((ours + 2 * TOLERANCE) / UNIT)
    for alike in distinct_interfaces(laminate):
        mask, contact = as_klayout(alike.interface.mask), as_klayout(alike.interface.contact)
        # Edges flush with the mask's, as at a pin, are not inside it.
        covered = contact.edges().inside_part(mask)
        pairs = covered.enclosed_check(
            mask.edges(), limit, False, kdb.Edges.Projection, None, GRAZING, None
        )
        found += [(value, alike.interface.below.index) for value in _distances(pairs)]
    theirs, layer = min(found, default=(None, 0))
    return Compared("overhang", layer, ours, theirs, "square")


def areas(laminate: Laminate, folder: Path) -> Iterator[tuple[float, float]]:
    """Area of every distinct profile in mm2, and what GDAL reads from its cut file.

    GDAL turns arcs into chords; set its option OGR_ARC_STEPSIZE (degrees) first.
    """
    path = folder / "layer.dxf"
    for layers in laminate.patterns.values():
        profile = layers[0].profile
        path.write_text(dxf_text(cutting_sequence(profile), {}), encoding="utf-8")
        yield profile.area, _gdal_area(path)


def _gdal_area(path: Path) -> float:
    _, _, shapes, (names,) = raw.read(path, columns=["Layer"])
    area = 0.0
    for name, shape in zip(names, shapes, strict=True):
        if name.startswith("CUT_"):
            ring = shapely.Polygon(shapely.from_wkb(shape))
            area += -ring.area if name == "CUT_INNER" else ring.area
    return area
