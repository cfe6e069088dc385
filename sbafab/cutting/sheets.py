"""Film sheets: a nest's parts as one cut file per sheet, with label, cutting time and picture."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Literal, NamedTuple

from sbafab.cutting.beam_paths import LaserRun, beam_runs, contour_runs, drawn
from sbafab.cutting.dxf_read import ReadBack
from sbafab.cutting.dxf_write import Surroundings, dxf_text
from sbafab.cutting.index_marks import index_marks
from sbafab.cutting.lettering import Stroke, strokes, width
from sbafab.cutting.lightburn import (
    ENDING,
    NO_RECIPES,
    advice_of,
    runs_text,
    sheet_layers,
    verify_project,
)
from sbafab.cutting.machine_files import (
    PROGRAMS,
    machine_text,
    svg_text,
    verify_machine_file,
)
from sbafab.cutting.nest import Nest, Placement, Stock
from sbafab.cutting.properties import (
    PLAIN,
    CutSettings,
    Entries,
    LaserProgram,
    file_properties,
    kerf_suffix,
)
from sbafab.cutting.sequence import cutting_minutes, cutting_sequence, travel
from sbafab.cutting.verify import check_surroundings, verify_file
from sbafab.design.sections import Laser, Sheets
from sbafab.errors import OutputError
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region
from sbafab.laminate.films import Material
from sbafab.process import Counted

FOLDER = "sheets"


LabelState = Literal["engraved", "no room", "off"]


@dataclass(frozen=True)
class SheetFile:
    """One written sheet: paths relative to the output folder, lengths in mm, area in mm2.

    ``number`` counts from 1 within the material, and is the nest's sheet plus one. ``counts``
    says how many parts of each design and pattern lie on it: (design, pattern, count).
    ``unsorted_travel`` is the head's travel in the nest's own order. ``label`` states whether the
    sheet's label is engraved, did not fit the border, or was not requested. ``cut_length`` includes
    the cut that frees a roll's sheet; ``contours`` counts the parts' contours.
    ``index_marks`` is the number of parts with their number engraved beside them; None if not
    requested. ``machine_file`` is the file for a laser program other than LightBurn, if requested.
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
        """Share of the sheet's whole area that becomes parts."""
        return self.parts_area / (self.width * self.length)


def write_sheets(
    nests: Sequence[Nest],
    folder: Path,
    settings: CutSettings,
    laser: Laser,
    sheets: Sheets,
    progress: Counted | None = None,
) -> list[SheetFile]:
    """Writes ``sheets/<material>_<number>.dxf``, ``.lbrn2`` and ``.svg`` of every sheet.

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
    marks = index_marks(nest, sheet) if sheets.index_marks else ()
    placements = nest.on_sheet(sheet)
    region = Region(tuple(c for p in placements for c in nest.region(p).contours))
    contours = cutting_sequence(region, laser.heat_distance)
    width, length = nest.stock.width, nest.length(sheet)
    around = _surroundings(nest, sheet, (width, length), settings, sheets.label)
    unlabelled: LabelState = "no room" if sheets.label else "off"
    label_state: LabelState = "engraved" if around.engraved else unlabelled
    beside = tuple(stroke for mark in marks for stroke in mark.strokes)
    around = around._replace(engraved=(*around.engraved, *beside))
    number = f"sheet {sheet + 1} of {nest.sheets}"
    properties = file_properties(settings, nest.material, number, _parts_said(nest, placements))
    stem = f"{nest.material}_{sheet + 1}{kerf_suffix(settings.kerf_width(nest.material))}"
    path = folder / FOLDER / f"{stem}.dxf"
    text = dxf_text(contours, properties, settings.curves.profile, around)
    path.write_bytes(text.encode())
    # In the order of the file, so that each contour is compared with its own first.
    read = verify_file(path, Region(contours), properties)
    _verify_surroundings(path.name, read, around)
    project = path.with_suffix(ENDING)
    entries = settings.entries.get(nest.material, PLAIN)
    layout = _Layout(nest, sheet, contours, around, entries)
    runs = _write_project(project, layout, settings, properties)
    picture = path.with_suffix(".svg")
    title = f"{settings.design}: {nest.material} {number}"
    machine_file = _write_machine_file(path, layout, sheets.program, runs, title)
    picture.write_text(
        svg_text(drawn(contour_runs(contours), around), (width, length), title),
        encoding="utf-8",
        newline="\n",
    )
    partings = [math.dist(*ends) for ends in around.parting]
    cut_length = sum(contour.length for contour in contours) + sum(partings)
    moved = travel(contours)
    return SheetFile(
        path=f"{FOLDER}/{path.name}",
        picture=f"{FOLDER}/{picture.name}",
        project=f"{FOLDER}/{project.name}",
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        nest=nest,
        number=sheet + 1,
        width=width,
        length=length,
        counts=_counts(nest, placements),
        contours=len(contours),
        parts_area=region.area,
        cut_length=cut_length,
        travel=moved,
        unsorted_travel=travel((*region.holes, *region.outers)),
        minutes=cutting_minutes(len(contours) + len(partings), cut_length, moved, laser),
        label=label_state,
        index_marks=len(marks) if sheets.index_marks else None,
        machine_file=machine_file,
    )


class _Layout(NamedTuple):
    """A sheet of a nest: its contours in cutting order, its surroundings, and its entries."""

    nest: Nest
    sheet: int
    contours: Sequence[Contour]
    around: Surroundings
    entries: Entries


def _write_project(
    path: Path, layout: _Layout, settings: CutSettings, properties: Mapping[str, str]
) -> list[LaserRun]:
    """Write a sheet's LightBurn project, with lead-ins, overcuts and tabs if requested.

    Returns the beam's runs in it, in order.
    """
    material, around = layout.nest.material, layout.around
    entries = layout.entries
    name = f"{material} sheet {layout.sheet + 1}"
    cuts = beam_runs(layout.contours, entries, around, layout.nest.stock.pins, name)
    runs = list(drawn(cuts, around))
    layers = sheet_layers({run.layer for run in runs}, settings.recipes.get(material, NO_RECIPES))
    notes = {**properties, **entries.properties}
    path.write_bytes(runs_text(layers, runs, notes, advice_of(settings, material)).encode())
    verify_project(path, layers, runs)
    return runs


def _write_machine_file(
    sheet: Path, layout: _Layout, program: LaserProgram | None, runs: Sequence[LaserRun], title: str
) -> str | None:
    """Write and read back the file of a sheet for another laser program, if requested.

    Returns its path in the output folder.
    """
    if program is None or layout.around.frame is None:
        return None
    path = sheet.with_name(f"{sheet.stem}{PROGRAMS[program].ending}")
    text = machine_text(program, runs, layout.around.frame, title)
    path.write_bytes(text.encode())
    verify_machine_file(path, program, runs)
    return f"{FOLDER}/{path.name}"


def _surroundings(
    nest: Nest, sheet: int, size: tuple[float, float], settings: CutSettings, labelled: bool
) -> Surroundings:
    width, length = size
    parting = ((0.0, length), (width, length))
    engraved = _label(nest, sheet, settings) if labelled else ()
    return Surroundings(engraved, (parting,) if nest.stock.roll else (), size)


def _label(nest: Nest, sheet: int, settings: CutSettings) -> tuple[tuple[Point, ...], ...]:
    """Return the engraving of the border, if there is room for it between the pins."""
    kerf = kerf_suffix(settings.kerf_width(nest.material)).strip("_") or "kerf none"
    waived = f" waived: {', '.join(settings.waived)}" if settings.waived else ""
    lowered = f" limits: {', '.join(settings.lowered)}" if settings.lowered else ""
    text = (
        f"{settings.design} {nest.material} {sheet + 1}/{nest.sheets} "
        f"#{settings.design_sha256[:8]} {kerf}{waived}{lowered}"
    )
    return label(text, nest.stock, nest.length(sheet))


def _counts(nest: Nest, placements: Sequence[Placement]) -> tuple[tuple[str, str, int], ...]:
    counts = Counter(
        (nest.parts[placement.part].design, nest.parts[placement.part].pattern)
        for placement in placements
    )
    return tuple((design, pattern, count) for (design, pattern), count in sorted(counts.items()))


def _parts_said(nest: Nest, placements: Sequence[Placement]) -> str:
    return ", ".join(
        f"{count} x {design} {pattern}" for design, pattern, count in _counts(nest, placements)
    )


def _verify_surroundings(name: str, read: ReadBack, around: Surroundings) -> None:
    """Check the written sheet's frame, engraving and parting cut."""
    try:
        check_surroundings(read, around)
    except OutputError as error:
        raise OutputError(f"{name}: {error}") from error


# The label that is engraved into a sheet's border, where parts and pins leave room for it.


LETTERS = 4.0
"""Most height of engraved letters in mm."""
LEAST_LETTERS = 1.5
MOST_LINES = 3
PITCH = 1.4
"""From line to line, in heights of a letter."""
ONE_LINE, SEVERAL_LINES = 0.5, 0.7
"""Share of the border's width that a line, or several, may take."""


class _Margin(NamedTuple):
    """A strip of border: its reading direction runs from ``corner`` along x, or along y upward.

    Lines are ``room`` long at most and stand over each other away from ``corner``.
    """

    corner: Point
    upward: bool
    room: float

    def at(self, p: Point) -> Point:
        (x, y), (u, v) = self.corner, p
        return (x - v, y + u) if self.upward else (x + u, y + v)


def label(text: str, stock: Stock, length: float) -> tuple[Stroke, ...]:
    """The strokes of a sheet's label; empty if it does not fit the border.

    In one line along the lower edge if it fits, else along another, else in up to three lines.
    """
    for count in range(1, MOST_LINES + 1):
        lines = _wrapped(text, count)
        for margin in _margins(stock, length):
            written = _written(lines, margin, stock)
            if written:
                return written
    return ()


def _margins(stock: Stock, length: float) -> Iterator[_Margin]:
    """The border's four strips: below, left, above, right."""
    edge = stock.border
    along, up = stock.width - 2 * edge, length - 2 * edge
    yield _Margin((edge, 0.0), False, along)
    yield _Margin((edge, edge), True, up)
    yield _Margin((edge, length - edge), False, along)
    yield _Margin((stock.width, edge), True, up)


def _written(lines: Sequence[str], margin: _Margin, stock: Stock) -> tuple[Stroke, ...]:
    longest = max(width(line, 1.0) for line in lines)
    block = 1 + PITCH * (len(lines) - 1)
    share = ONE_LINE if len(lines) == 1 else SEVERAL_LINES
    height = min(LETTERS, share * stock.border / block, margin.room / max(longest, 1e-9))
    if height < LEAST_LETTERS:
        return ()
    low = (stock.border - height * block) / 2
    ends = margin.at((0.0, low)), margin.at((height * longest, low + height * block))
    if not all(_is_clear(ends, pin) for pin in stock.pins):
        return ()
    rows = [low + height * PITCH * row for row in reversed(range(len(lines)))]
    return tuple(
        tuple(map(margin.at, stroke))
        for line, row in zip(lines, rows, strict=True)
        for stroke in strokes(line, (0.0, row), height)
    )


def _is_clear(ends: tuple[Point, Point], pin: tuple[float, float, float]) -> bool:
    """Return True if the box between two corners keeps off a pin's."""
    low_x, low_y, high_x, high_y = _box(ends)
    x, y, r = pin[0], pin[1], pin[2] / 2
    return x + r < low_x or x - r > high_x or y + r < low_y or y - r > high_y


def _box(ends: tuple[Point, Point]) -> Bounds:
    (ax, ay), (bx, by) = ends
    return min(ax, bx), min(ay, by), max(ax, bx), max(ay, by)


def _wrapped(text: str, count: int) -> list[str]:
    """The text in at most this number of lines, the longest as short as words allow."""
    for most in range(1, len(text) + 1):
        lines = wrap(text, most, break_long_words=False, break_on_hyphens=False)
        if len(lines) <= count and max(map(len, lines)) <= most:
            return lines
    return [text]
