"""The fixture: the base plate of the press, with a hole for every dowel pin of a press cycle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sbafab.cutting.cut_settings import CutSettings, fixture_properties
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.lettering import Stroke, strokes, width
from sbafab.cutting.sequence import cutting_sequence
from sbafab.cutting.verify import verify_file
from sbafab.errors import OutputError
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region, disc, polygon, rectangle, union
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.lay_up import PLATE_MARGIN

PATH = "sheets/fixture.dxf"
CHAMFER = 5.0
LETTERS, BORDER, PITCH = 2.5, 3.0, 1.6
"""Height of the notes' letters, mm at most, their distance from the edge, and from line to line."""
ONE: tuple[Point, ...] = ((0.0, 0.0),)
"""The place of a laminate that is pressed by itself."""


def fixture(
    laminate: Laminate, platen: tuple[float, float], places: Sequence[Point] = ONE
) -> Region | None:
    """The base plate in the layers' frame; None for a laminate without pins.

    It is as large as the platen (mm), so that the pad rests on it all around. The ``places`` lie in
    its middle, each with all holes of a laminate shifted there. One corner, at the largest x and y,
    is cut off to show the orientation of layers and plate.
    """
    return whole_plate(laminate, platen, places) if laminate.pins else None


def whole_plate(
    laminate: Laminate, platen: tuple[float, float], places: Sequence[Point] = ONE
) -> Region:
    """Return the base plate in the layers' frame, without holes if the laminate has no pins."""
    x0, y0 = plate_corner(laminate, platen, places)
    width, length = _as_it_lies(platen, _lying(laminate, places))
    x1, y1 = x0 + width, y0 + length
    plate = polygon([(x0, y0), (x1, y0), (x1, y1 - CHAMFER), (x1 - CHAMFER, y1), (x0, y1)])
    return _drilled(plate, laminate, places)


def plate_corner(
    laminate: Laminate, platen: tuple[float, float], places: Sequence[Point] = ONE
) -> Point:
    """Return the plate's corner of least x and y, to 0.1 mm: the origin of its hole coordinates."""
    box = low_x, low_y, high_x, high_y = _lying(laminate, places)
    width, length = _as_it_lies(platen, box)
    return round((low_x + high_x - width) / 2, 1), round((low_y + high_y - length) / 2, 1)


def shown(laminate: Laminate) -> Region | None:
    """Return the part of the base plate around one laminate, for pictures; None without pins."""
    if not laminate.pins:
        return None
    low_x, low_y, high_x, high_y = _lying(laminate)
    low, high = (
        (low_x - PLATE_MARGIN, low_y - PLATE_MARGIN),
        (high_x + PLATE_MARGIN, high_y + PLATE_MARGIN),
    )
    return _drilled(rectangle(low, high), laminate)


def _as_it_lies(platen: tuple[float, float], box: Bounds) -> tuple[float, float]:
    """Return width and length of the plate, rotated if the laminates fit only that way."""
    wide, high = box[2] - box[0], box[3] - box[1]
    width, length = platen
    turn = (wide > width or high > length) and wide <= length and high <= width
    return (length, width) if turn else platen


def _lying(laminate: Laminate, places: Sequence[Point] = ONE) -> Bounds:
    """Return the bounding box of the laminates on the plate."""
    box = laminate.bounds
    xs, ys = [x for x, _ in places], [y for _, y in places]
    return min(xs) + box[0], min(ys) + box[1], max(xs) + box[2], max(ys) + box[3]


def _drilled(plate: Region, laminate: Laminate, places: Sequence[Point] = ONE) -> Region:
    return plate - union(
        disc((pin.centre[0] + x, pin.centre[1] + y), pin.diameter / 2)
        for x, y in places
        for pin in laminate.pins
    )


def write_fixture(
    laminate: Laminate,
    folder: Path,
    settings: CutSettings,
    platen: tuple[float, float],
    places: Sequence[Point] = ONE,
    notes: Sequence[str] = (),
) -> str | None:
    """Write and read back the plate's cut file; return its path in ``folder``, None without pins.

    Nominal edges: the holes are finished to the pins. ``notes`` state how, as uncut strokes on the
    plate and in the file's properties.
    """
    plate = fixture(laminate, platen, places)
    if plate is None:
        return None
    properties = fixture_properties(settings, notes)
    title = f"{settings.design}: base plate, seen from above #{settings.design_sha256[:8]}"
    written = _lettered((title, *notes), plate) if notes else ()
    if settings.curves.in_chords:
        plate = in_chords(plate, None, settings.curves.chord_error)
    text = dxf_text(cutting_sequence(plate), properties, settings.curves.profile, notes=written)
    path = folder / PATH
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode())
    read = verify_file(path, plate, properties)
    if len(read.strokes) != 2 + len(written):
        raise OutputError(f"{path.name}: its notes are incomplete. Regenerate it.")
    return PATH


def _lettered(lines: Sequence[str], plate: Region) -> tuple[Stroke, ...]:
    """Return the strokes of lines along the plate's front edge, as large as its width allows."""
    low_x, low_y, high_x, _ = plate.bounds
    longest = max(width(line, 1.0) for line in lines)
    height = min(LETTERS, (high_x - low_x - 2 * BORDER) / longest)
    return tuple(
        stroke
        for row, line in enumerate(reversed(lines))
        for stroke in strokes(line, (low_x + BORDER, low_y + BORDER + row * PITCH * height), height)
    )
