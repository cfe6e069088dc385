"""The fixture: the base plate of the press, with a hole for every dowel pin of one laminate."""

from __future__ import annotations

from pathlib import Path

from sbafab.cutting.chords import in_chords
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import CutSettings, fixture_properties
from sbafab.cutting.verify import verify_file
from sbafab.geometry.boolean import union
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc, polygon, rectangle
from sbafab.laminate.laminate import Laminate

PATH = "sheets/fixture.dxf"
MARGIN = 6.0
"""mm of plate that pictures show round everything that lies on it."""
CHAMFER = 5.0


def fixture(laminate: Laminate, platen: tuple[float, float]) -> Region | None:
    """The base plate in the layers' own frame; None for a laminate without pins.

    As large as the platen (mm), so that the pad rests on it all round; the laminate lies in its
    middle. One corner is cut off, at the largest x and y: it tells which way round layers and plate
    go.
    """
    if not laminate.pins:
        return None
    x0, y0 = plate_corner(laminate, platen)
    x1, y1 = x0 + platen[0], y0 + platen[1]
    plate = polygon([(x0, y0), (x1, y0), (x1, y1 - CHAMFER), (x1 - CHAMFER, y1), (x0, y1)])
    return _drilled(plate, laminate)


def plate_corner(laminate: Laminate, platen: tuple[float, float]) -> Point:
    """The plate's corner of least x and y, to 0.1 mm: where its holes are measured from."""
    low_x, low_y, high_x, high_y = _lying(laminate)
    middle = (low_x + high_x) / 2, (low_y + high_y) / 2
    return round(middle[0] - platen[0] / 2, 1), round(middle[1] - platen[1] / 2, 1)


def shown(laminate: Laminate) -> Region | None:
    """The part of the base plate round the laminate, as pictures show it; None without pins."""
    if not laminate.pins:
        return None
    low_x, low_y, high_x, high_y = _lying(laminate)
    low, high = (low_x - MARGIN, low_y - MARGIN), (high_x + MARGIN, high_y + MARGIN)
    return _drilled(rectangle(low, high), laminate)


def _lying(laminate: Laminate) -> Bounds:
    """The box round what lies on the plate: the laminate, or its registered sheets."""
    return laminate.bounds if laminate.panel is None else laminate.panel.outline.bounds


def _drilled(plate: Region, laminate: Laminate) -> Region:
    return plate - union(disc(pin.centre, pin.diameter / 2) for pin in laminate.pins)


def write_fixture(laminate: Laminate, folder: Path, settings: CutSettings) -> str | None:
    """Writes and reads back the plate's cut file; its path in ``folder``, None without pins.

    Nominal edges: the holes are to be reamed to the pins.
    """
    plate = fixture(laminate, settings.platen)
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
