"""The fixture: a pin plate that holds the layers in register, with a hole for every dowel pin."""

from __future__ import annotations

from pathlib import Path

from sbafab.cutting.chords import in_chords
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import CutSettings, fixture_properties
from sbafab.cutting.verify import verify_file
from sbafab.geometry.boolean import union
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc, polygon
from sbafab.laminate.laminate import Laminate

PATH = "sheets/fixture.dxf"
MARGIN = 6.0
"""mm of plate round everything that lies on it."""
CHAMFER = 5.0


def fixture(laminate: Laminate) -> Region | None:
    """The pin plate in the layers' own frame; None for a laminate without pins.

    One corner is cut off, at the largest x and y: it tells which way round layers and plate go.
    """
    if not laminate.pins:
        return None
    whole = laminate.bounds if laminate.panel is None else laminate.panel.outline.bounds
    low_x, low_y, high_x, high_y = whole
    x0, y0, x1, y1 = low_x - MARGIN, low_y - MARGIN, high_x + MARGIN, high_y + MARGIN
    plate = polygon([(x0, y0), (x1, y0), (x1, y1 - CHAMFER), (x1 - CHAMFER, y1), (x0, y1)])
    return plate - union(disc(pin.centre, pin.diameter / 2) for pin in laminate.pins)


def write_fixture(laminate: Laminate, folder: Path, settings: CutSettings) -> str | None:
    """Writes and reads back the plate's cut file; its path in ``folder``, None without pins.

    Nominal edges: the holes are to be reamed to the pins.
    """
    plate = fixture(laminate)
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
