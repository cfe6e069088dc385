"""Registered sheets that do not hold, do not free, or lock in what they should let go."""

from __future__ import annotations

import math
from collections.abc import Callable

from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.order import cutting_order
from sbafab.cutting.second_cut import PATH, marks
from sbafab.geometry.edges import Edge, Point
from sbafab.geometry.region import Region, disc, strip
from sbafab.laminate.laminate import Laminate
from tests.faults.record import Fault, Kind
from tests.faults.specimen import Change, Pick, Specimen, base, separator, wall

SHEETS = ('registration.method="sheet"', "registration.experimental=true", "order.copies=2")
HELD, LOCKED, PINNED = "bridges", "scrap", "pin-holes"


def sides(laminate: Laminate) -> list[Edge]:
    """The edges along the first bridge of the first copy, where the second cut takes it out."""
    panel = laminate.panel
    assert panel is not None
    pieces = (panel.sheets[0] & panel.second).pieces
    nearest = min(pieces, key=lambda piece: math.dist(piece.edges[0].start, (0.0, 0.0)))
    return sorted(nearest.edges, key=lambda edge: edge.length)[:2]


def outward(edge: Edge) -> tuple[Point, Point]:
    """Where an edge starts that leads away from the axis, and its direction."""
    inner, outer = sorted((edge.start, edge.end), key=lambda p: math.hypot(*p))
    length = edge.length
    return inner, ((outer[0] - inner[0]) / length, (outer[1] - inner[1]) / length)


def along(edge: Edge, reach: float, width: float) -> Region:
    (x, y), (dx, dy) = outward(edge)
    return strip((x, y), (x + reach * dx, y + reach * dy), width)


def narrowed(sheet: Region, laminate: Laminate) -> Region:
    """A bridge 1.0 wide is left 0.4 wide."""
    return sheet - along(sides(laminate)[0], 1.5, 1.2)


def torn(sheet: Region, laminate: Laminate) -> Region:
    """Two of three bridges of one copy are gone."""
    panel = laminate.panel
    assert panel is not None
    cut = sorted((sheet & panel.second).pieces, key=lambda p: math.hypot(*p.edges[0].start))
    for piece in cut[:2]:
        edge = min(piece.edges, key=lambda one: one.length)
        sheet = sheet - along(edge, 1.5, 4.0)
    return sheet


def over_the_tab(sheet: Region, laminate: Laminate) -> Region:
    """The sheet reaches from its window over the first copy's tab, 1 mm inward of the mouth."""
    inlet = laminate.inlets[0]
    (x, y), (dx, dy) = inlet.mouth, inlet.direction
    return sheet | strip((x - dx, y - dy), (x + 4 * dx, y + 4 * dy), 1.0)


def aside(sheet: Region, laminate: Laminate) -> Region:
    """The holes of the first two pins closed and drilled 0.1 mm beside them."""
    moved = sheet
    for pin in laminate.pins[:2]:
        x, y = -pin.centre[0], pin.centre[1]
        moved = (moved | disc((x, y), 2.0)) - disc((x + 0.1, y), pin.diameter / 2)
    return moved


def second(name: str, change: Callable[[Region], Region]) -> Fault:
    """Another second cut, its hash put right."""

    def put(specimen: Specimen) -> None:
        panel = specimen.clean.panel
        assert panel is not None
        path = specimen.doctor.folder / PATH
        found = read_profile(path)
        contours = cutting_order(change(found.region))
        path.write_text(dxf_text(contours, found.properties, sheet=marks(panel)), newline="\n")
        specimen.doctor.rehash()

    return Fault(name, HELD, put, settings=SHEETS)


def redrawn(name: str, rule: str, pick: Pick, change: Change) -> Fault:
    """Another sheet for one layer; the part that comes out of it stays as it was."""

    def put(specimen: Specimen) -> None:
        layer = pick(specimen.clean)
        specimen.doctor.redraw(layer.index, lambda sheet: change(sheet, specimen.clean))
        specimen.doctor.rehash()

    return Fault(name, rule, put, settings=SHEETS)


KIND = Kind(
    "Registered sheets",
    'Of `registration.method = "sheet"`, two copies. The sheets are cut otherwise; the parts that '
    "come out of them are as they should be.",
    (
        redrawn("bridge left 0.4 wide", HELD, base, narrowed),
        redrawn("film sheet over the inlet tab", LOCKED, wall, over_the_tab),
        redrawn("mask sheet beside its pins", PINNED, separator, aside),
        second("second cut without a slot", lambda slots: Region(slots.contours[1:])),
        second("second cut moved", lambda slots: slots.moved(0.3, 0.1)),
    ),
)
