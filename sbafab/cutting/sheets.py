"""Film sheets: a nest's parts as one cut file per sheet, with label, cutting time and picture."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Literal, NamedTuple

from sbafab.cutting.beam_paths import beam_runs
from sbafab.cutting.cut_settings import PLAIN, CutSettings, file_properties, kerf_suffix
from sbafab.cutting.dxf_write import Surroundings, contour_runs, drawn, dxf_text
from sbafab.cutting.laser_programs import (
    PROGRAMS,
    LaserSheet,
    laser_notes,
    laser_text,
    svg_text,
    verify_laser_file,
)
from sbafab.cutting.lettering import Stroke, strokes, width
from sbafab.cutting.placements import Nest, Stock
from sbafab.cutting.sequence import cutting_minutes, cutting_sequence, travel
from sbafab.cutting.verify import verify_file
from sbafab.design.sections import Laser, Sheets
from sbafab.geometry.edges import Point, box_round
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.region import Region
from sbafab.geometry.spatial_index import boxes_meet, widened
from sbafab.laminate.films import Material
from sbafab.runtime import Counted

if TYPE_CHECKING:
    import shapely

FOLDER = "sheets"


LabelState = Literal["engraved", "no room", "off"]


@dataclass(frozen=True)
class SheetFile:
    """One written sheet: paths relative to the output folder, lengths in mm, area in mm2.

    ``number`` counts from 1 within the material, and is the nest's sheet plus one. ``counts`` holds
    the number of parts of each design and pattern: (design, pattern, count). ``unsorted_travel`` is
    the head's travel in the nest's own order. ``label`` states whether the sheet's label is
    engraved, did not fit the border, or was not requested. ``cut_length`` includes the cut that
    frees a roll's sheet; ``contours`` counts the parts' contours. ``index_marks`` is the number of
    parts with their number engraved beside them; None if not requested. ``machine_file`` is the
    file for a laser program other than LightBurn, if requested.
    """

    path: str
    picture: str
    project: str
    sha256: str
    nest: Nest
    number: int
    width: float
    length: float
    counts: tuple[tuple[str, str, int], ...]
    contours: int
    parts_area: float
    cut_length: float
    travel: float
    unsorted_travel: float
    minutes: float
    label: LabelState = "engraved"
    index_marks: int | None = None
    machine_file: str | None = None

    @property
    def material(self) -> Material:
        return self.nest.material

    @property
    def density(self) -> float:
        """The fraction of the sheet's area that becomes parts."""
        return self.parts_area / (self.width * self.length)


def write_sheets(
    nests: Sequence[Nest],
    folder: Path,
    settings: CutSettings,
    laser: Laser,
    sheets: Sheets,
    progress: Counted | None = None,
) -> list[SheetFile]:
    """Write ``sheets/<material>_<number>.dxf``, ``.lbrn2`` and ``.svg`` of every sheet.

    Each file is read back and its contours are compared with the nest. The check of the whole
    folder tests that they lie inside the border, apart from each other and clear of pins. Raises
    OutputError if a file differs, OSError if it cannot be written.
    """
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    total = sum(nest.sheets for nest in nests)
    written: list[SheetFile] = []
    for nest in nests:
        for sheet in range(nest.sheets):
            written.append(_write_sheet(nest, sheet, folder, settings, laser, sheets))
            if progress is not None:
                progress(len(written), total)
    return written


def _write_sheet(
    nest: Nest,
    sheet: int,
    folder: Path,
    settings: CutSettings,
    laser: Laser,
    sheets: Sheets,
) -> SheetFile:
    material, placements = nest.material, nest.on_sheet(sheet)
    region = Region(tuple(c for p in placements for c in nest.region(p).contours))
    contours = cutting_sequence(region, laser.heat_distance)
    size = nest.stock.width, nest.length(sheet)
    label_strokes = _sheet_label(nest, sheet, settings) if sheets.label else ()
    marks = index_marks(nest, sheet) if sheets.index_marks else ()
    engraved = (*label_strokes, *(stroke for mark in marks for stroke in mark.strokes))
    partings = (((0.0, size[1]), size),) if nest.stock.roll else ()
    around = Surroundings(engraved, partings, size)
    parts = (nest.parts[placement.part] for placement in placements)
    counts = sorted(Counter((part.design, part.pattern) for part in parts).items())
    counted = ", ".join(f"{count} x {design} {pattern}" for (design, pattern), count in counts)
    number = f"sheet {sheet + 1} of {nest.sheets}"
    properties = file_properties(settings, material, number, counted)
    stem = f"{material}_{sheet + 1}{kerf_suffix(settings.kerf_width(material))}"
    path = folder / FOLDER / f"{stem}.dxf"
    data = dxf_text(contours, properties, settings.curves.profile, around).encode()
    path.write_bytes(data)
    # In the order of the file, so that each contour is compared with its own first.
    verify_file(path, Region(contours), properties, around)
    title = f"{settings.design}: {material} {number}"
    lead_ins = settings.lead_ins.get(material, PLAIN)
    cuts = beam_runs(contours, lead_ins, around, nest.stock.pins, f"{material} sheet {sheet + 1}")
    notes = laser_notes(settings, material, {**properties, **lead_ins.properties})
    recipes = settings.recipes.get(material, {})
    drawing = LaserSheet(list(drawn(cuts, around)), size, title, recipes, notes)
    files = {
        program: _write_laser_file(path, program, drawing)
        for program in ("lightburn", sheets.program)
        if program is not None
    }
    picture = path.with_suffix(".svg")
    plain = svg_text(drawn(contour_runs(contours), around), size, title)
    picture.write_text(plain, encoding="utf-8", newline="\n")
    cut_length = sum(contour.length for contour in contours)
    cut_length += sum(math.dist(*ends) for ends in partings)
    moved = travel(contours)
    return SheetFile(
        path=f"{FOLDER}/{path.name}",
        picture=f"{FOLDER}/{picture.name}",
        project=files["lightburn"],
        sha256=hashlib.sha256(data).hexdigest(),
        nest=nest,
        number=sheet + 1,
        width=size[0],
        length=size[1],
        counts=tuple((design, pattern, count) for (design, pattern), count in counts),
        contours=len(contours),
        parts_area=region.area,
        cut_length=cut_length,
        travel=moved,
        unsorted_travel=travel((*region.holes, *region.outers)),
        minutes=cutting_minutes(len(contours) + len(partings), cut_length, moved, laser),
        label="engraved" if label_strokes else "no room" if sheets.label else "off",
        index_marks=len(marks) if sheets.index_marks else None,
        machine_file=files.get(sheets.program or ""),
    )


def _write_laser_file(sheet: Path, program: str, drawing: LaserSheet) -> str:
    """Write and read back a sheet's file for a laser program; return its path in the folder."""
    path = sheet.with_name(f"{sheet.stem}{PROGRAMS[program].ending}")
    path.write_bytes(laser_text(program, drawing).encode())
    verify_laser_file(path, program, drawing)
    return f"{FOLDER}/{path.name}"


# The label that is engraved into a sheet's border, where parts and pins leave room for it.


LETTERS = 4.0
"""Most height of engraved letters in mm."""
LEAST_LETTERS = 1.5
MOST_LINES = 3
PITCH = 1.4
"""From line to line, in heights of a letter."""
ONE_LINE, SEVERAL_LINES = 0.5, 0.7
"""Share of the border's width that a line, or several, may take."""


def _sheet_label(nest: Nest, sheet: int, settings: CutSettings) -> tuple[Stroke, ...]:
    """Return the engraving of the border, if it fits between the pins."""
    kerf = kerf_suffix(settings.kerf_width(nest.material)).strip("_") or "kerf none"
    waived = f" waived: {', '.join(settings.waived)}" if settings.waived else ""
    lowered = f" limits: {', '.join(settings.lowered)}" if settings.lowered else ""
    text = (
        f"{settings.design} {nest.material} {sheet + 1}/{nest.sheets} "
        f"#{settings.design_sha256[:8]} {kerf}{waived}{lowered}"
    )
    return label(text, nest.stock, nest.length(sheet))


class _Margin(NamedTuple):
    """A strip of border, read from ``corner`` along x, or along y upward.

    Lines are at most ``room`` long and are stacked away from ``corner``.
    """

    corner: Point
    upward: bool
    room: float

    def at(self, p: Point) -> Point:
        (x, y), (u, v) = self.corner, p
        return (x - v, y + u) if self.upward else (x + u, y + v)


def label(text: str, stock: Stock, length: float) -> tuple[Stroke, ...]:
    """Return the strokes of a sheet's label; empty if it does not fit the border.

    It is one line along the lower edge if it fits, else along another edge, else up to three lines.
    """
    edge = stock.border
    along, up = stock.width - 2 * edge, length - 2 * edge
    below, left = _Margin((edge, 0.0), False, along), _Margin((edge, edge), True, up)
    above, right = (
        _Margin((edge, length - edge), False, along),
        _Margin((stock.width, edge), True, up),
    )
    tries = (
        _written(_wrapped(text, count), margin, stock)
        for count in range(1, MOST_LINES + 1)
        for margin in (below, left, above, right)
    )
    return next(filter(None, tries), ())


def _written(lines: Sequence[str], margin: _Margin, stock: Stock) -> tuple[Stroke, ...]:
    longest = max(width(line, 1.0) for line in lines)
    block = 1 + PITCH * (len(lines) - 1)
    share = ONE_LINE if len(lines) == 1 else SEVERAL_LINES
    height = min(LETTERS, share * stock.border / block, margin.room / max(longest, 1e-9))
    low = (stock.border - height * block) / 2
    ends = margin.at((0.0, low)), margin.at((height * longest, low + height * block))
    box = box_round([(*end, *end) for end in ends])
    pins = (widened((x, y, x, y), diameter / 2) for x, y, diameter in stock.pins)
    if height < LEAST_LETTERS or any(boxes_meet(box, pin) for pin in pins):
        return ()
    rows = [low + height * PITCH * row for row in reversed(range(len(lines)))]
    return tuple(
        tuple(map(margin.at, stroke))
        for line, row in zip(lines, rows, strict=True)
        for stroke in strokes(line, (0.0, row), height)
    )


def _wrapped(text: str, count: int) -> list[str]:
    """Return the text in at most this number of lines, the longest as short as possible."""
    for most in range(1, len(text) + 1):
        lines = wrap(text, most, break_long_words=False, break_on_hyphens=False)
        if len(lines) <= count and max(map(len, lines)) <= most:
            return lines
    return [text]


# Index marks: the number of a part's pattern, engraved into the skeleton beside it.
#
# A mark keeps 0.5 mm from every part (half the spacing, if that is less than 1 mm), so that the
# film on its two sides adds up to the default spacing of parts. It stands nearer to its part than
# to any other, and never in a hole. If the skeleton has no such room, the part gets no mark.


HEIGHT = 1.2
"""mm of the digits."""
FARTHEST = 2.5
"""mm from a part to its mark."""
CLEARANCE = 0.5
"""mm from a mark to every part, at most."""
AROUND = 32
"""Places that are tried on each line round a part."""
GRID = 2
"""Decimals of a mark's place in mm: it hangs on no rounding of a library."""
CHORD = 0.005
"""mm by which the outlines that are searched round may lie inside their arcs."""


class IndexMark(NamedTuple):
    """The number of a pattern, its lower left corner, and its strokes."""

    text: str
    at: Point
    strokes: tuple[Stroke, ...]


def index_marks(nest: Nest, sheet: int) -> tuple[IndexMark, ...]:
    """Return the marks of a sheet's parts, at most one for each."""
    import shapely

    placed, stock = nest.on_sheet(sheet), nest.stock
    if not placed:
        return ()
    outlines = [Region(nest.region(placement).outers).shapely(CHORD) for placement in placed]
    tree = shapely.STRtree(outlines)
    clear, edge = clearance(stock.spacing) + CHORD, stock.border
    inside = shapely.box(edge, edge, stock.width - edge, nest.length(sheet) - edge)
    taken = [shapely.Point(x, y).buffer(d / 2) for x, y, d in stock.pins]
    marks = []
    for number, placement in enumerate(placed):
        pattern = nest.parts[placement.part].pattern
        # The number of a pattern, "5" of "P05".
        text = pattern.lstrip("P").lstrip("0") or pattern
        size = width(text, HEIGHT), HEIGHT
        corners = np.array([*_corners(outlines[number], size, clear)])
        boxes = shapely.box(*corners.T, *(corners + size).T)
        is_free = shapely.contains_properly(inside, boxes)
        is_free[tree.query(boxes, predicate="dwithin", distance=clear)[0]] = False
        away = np.round(shapely.distance(boxes, outlines[number]), GRID)
        near = np.flatnonzero(is_free & (away <= FARTHEST))
        for place in near[np.argsort(away[near], kind="stable")]:
            box = boxes[place]
            around = tree.query(box, predicate="dwithin", distance=away[place] + 0.1)
            if {*around} == {number} and not any(box.dwithin(mark, clear) for mark in taken):
                x, y = map(float, corners[place])
                taken.append(box)
                marks.append(IndexMark(text, (x, y), strokes(text, (x, y), HEIGHT)))
                break
    return tuple(marks)


def clearance(spacing: float) -> float:
    """Return the least distance of a mark from every part, mm."""
    return min(CLEARANCE, spacing / 2)


def _corners(outline: shapely.MultiPolygon, size: Point, clear: float) -> Iterator[Point]:
    """Yield lower left corners of boxes around a part, on lines clear of it."""
    import shapely

    for off in (size[1] / 2, size[0] / 2, (size[0] ** 2 + size[1] ** 2) ** 0.5 / 2):
        ring = shapely.buffer(outline, clear + off + 0.02)
        exterior = ring.exterior if ring.geom_type == "Polygon" else ring.convex_hull.exterior
        for n in range(AROUND):
            p = exterior.interpolate(n / AROUND, normalized=True)
            yield round(p.x - size[0] / 2, GRID), round(p.y - size[1] / 2, GRID)
