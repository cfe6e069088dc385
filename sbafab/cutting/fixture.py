"""The fixture: a pin plate that holds the layers in register, with a hole for every dowel pin."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sbafab.cutting.chords import in_chords
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import CutSettings, fixture_properties
from sbafab.cutting.verify import verify_file
from sbafab.geometry.boolean import union
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc, polygon
from sbafab.laminate.assembly import PLATE_MARGIN
from sbafab.laminate.laminate import Laminate

PATH = "sheets/fixture.dxf"
CHAMFER = 5.0
ONE: tuple[Point, ...] = ((0.0, 0.0),)
"""The place of a laminate that is pressed by itself."""


def fixture(laminate: Laminate, places: Sequence[Point] = ONE) -> Region | None:
    """The pin plate in the layers' own frame; None for a laminate without pins.

    At each of the ``places`` it has all holes of a laminate that is moved there. One corner is cut
    off, at the largest x and y: it tells which way round layers and plate go.
    """
    if not laminate.pins:
        return None
    low_x, low_y, high_x, high_y = laminate.bounds
    xs, ys = [x for x, _ in places], [y for _, y in places]
    x0, y0 = min(xs) + low_x - PLATE_MARGIN, min(ys) + low_y - PLATE_MARGIN
    x1, y1 = max(xs) + high_x + PLATE_MARGIN, max(ys) + high_y + PLATE_MARGIN
    plate = polygon([(x0, y0), (x1, y0), (x1, y1 - CHAMFER), (x1 - CHAMFER, y1), (x0, y1)])
    return plate - union(
        disc((pin.centre[0] + x, pin.centre[1] + y), pin.diameter / 2)
        for x, y in places
        for pin in laminate.pins
    )


def write_fixture(
    laminate: Laminate, folder: Path, settings: CutSettings, places: Sequence[Point] = ONE
) -> str | None:
    """Writes and reads back the plate's cut file; its path in ``folder``, None without pins.

    Nominal edges: the holes are to be reamed to the pins.
    """
    plate = fixture(laminate, places)
    if plate is None:
        return None
    properties = fixture_properties(settings)
    if settings.curves.in_chords:
        plate = in_chords(plate, None, settings.curves.chord_error)
    text = dxf_text(cutting_order(plate), properties, settings.curves.profile)
    path = folder / PATH
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode())
    verify_file(path, plate, properties)
    return PATH
