"""Film sheets: the parts of a nest as one cut file a sheet, with a picture beside it."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from sbafab.cutting.dxf_read import ReadBack
from sbafab.cutting.dxf_write import Surroundings, dxf_text
from sbafab.cutting.label import label
from sbafab.cutting.lightburn import ENDING, project_text
from sbafab.cutting.lightburn_verify import verify_project
from sbafab.cutting.order import cutting_order, travel
from sbafab.cutting.properties import CutSettings, kerf_suffix, sheet_properties
from sbafab.cutting.svg_write import sheet_svg
from sbafab.cutting.verify import check_surroundings, verify_file
from sbafab.errors import OutputError
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.films import Material
from sbafab.nesting.records import Nest, Placement
from sbafab.progress import Counted

FOLDER = "sheets"


LabelState = Literal["engraved", "no room", "off"]


@dataclass(frozen=True)
class Machine:
    """What the estimate of cutting time assumes; mm/s, seconds and mm."""

    cut_speed: float = 20.0
    travel_speed: float = 200.0
    pierce_seconds: float = 0.1
    heat_distance: float = 3.0


@dataclass(frozen=True)
class SheetFile:
    """One written sheet: paths relative to the output folder, lengths in mm, area in mm2.

    ``number`` counts from 1 within the material, and is the nest's sheet plus one. ``counts``
    says how many parts of each design and pattern lie on it: (design, pattern, count).
    ``unsorted_travel`` is what the head would travel in the nest's own order. ``label`` says
    whether the sheet's label is engraved, or found no room in the border, or was not asked for.
    ``cut_length`` has the cut that frees a roll's sheet in it; ``contours`` are those of the parts.
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
    machine: Machine,
    labelled: bool = True,
    progress: Counted | None = None,
) -> list[SheetFile]:
    """Writes ``sheets/<material>_<number>.dxf``, ``.lbrn2`` and ``.svg`` of every sheet.

    Each file is read back: its contours are those of the nest. Whether they lie inside the border,
    apart from each other and clear of pins is told when the whole folder is read back. Raises
    OutputError where a file is another, OSError where it cannot be written.
    """
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    total = sum(nest.sheets for nest in nests)
    written: list[SheetFile] = []
    for nest in nests:
        for sheet in range(nest.sheets):
            written.append(_write_sheet(nest, sheet, folder, settings, machine, labelled))
            if progress is not None:
                progress(len(written), total)
    return written


def _write_sheet(
    nest: Nest, sheet: int, folder: Path, settings: CutSettings, machine: Machine, labelled: bool
) -> SheetFile:
    placements = nest.on_sheet(sheet)
    region = Region(tuple(c for p in placements for c in nest.region(p).contours))
    contours = cutting_order(region, machine.heat_distance)
    width, length = nest.stock.width, nest.length(sheet)
    around = _surroundings(nest, sheet, (width, length), settings, labelled)
    properties = sheet_properties(
        settings, nest.material, f"{sheet + 1} of {nest.sheets}", _parts_said(nest, placements)
    )
    stem = f"{nest.material}_{sheet + 1}{kerf_suffix(settings.kerf_width(nest.material))}"
    path = folder / FOLDER / f"{stem}.dxf"
    text = dxf_text(contours, properties, settings.curves.profile, around)
    path.write_bytes(text.encode())
    # In the order of the file, so that each contour is compared with its own first.
    found = verify_file(path, Region(contours), properties)
    _verify_surroundings(path.name, found, around)
    project = path.with_suffix(ENDING)
    project.write_bytes(project_text(contours, around, properties).encode())
    verify_project(project, contours, around)
    picture = path.with_suffix(".svg")
    title = f"{settings.design}: {nest.material} sheet {sheet + 1} of {nest.sheets}"
    picture.write_text(
        sheet_svg(contours, around, width, length, title), encoding="utf-8", newline="\n"
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
        minutes=_minutes(len(contours) + len(partings), cut_length, moved, machine),
        label="engraved" if around.engraved else "no room" if labelled else "off",
    )


def _minutes(cuts: int, cut_length: float, moved: float, machine: Machine) -> float:
    """Of all cuts; engraving and the way to the cut that frees a roll's sheet are left out."""
    seconds = (
        cut_length / machine.cut_speed
        + moved / machine.travel_speed
        + cuts * machine.pierce_seconds
    )
    return seconds / 60


def _surroundings(
    nest: Nest, sheet: int, size: tuple[float, float], settings: CutSettings, labelled: bool
) -> Surroundings:
    width, length = size
    parting = ((0.0, length), (width, length))
    engraved = _label(nest, sheet, settings) if labelled else ()
    return Surroundings(engraved, (parting,) if nest.stock.roll else (), size)


def _label(nest: Nest, sheet: int, settings: CutSettings) -> tuple[tuple[Point, ...], ...]:
    """What is engraved into the border, if there is room for it between the pins."""
    kerf = kerf_suffix(settings.kerf_width(nest.material)).strip("_") or "kerf none"
    waived = f" waived: {', '.join(settings.waived)}" if settings.waived else ""
    lowered = f" limits: {', '.join(settings.lowered)}" if settings.lowered else ""
    text = (
        f"{settings.design} {nest.material} {sheet + 1}/{nest.sheets} "
        f"#{settings.design_sha256[:8]} {kerf}{waived}{lowered}"
    )
    return label(text, nest.stock, nest.length(sheet))


def _counts(nest: Nest, placements: Sequence[Placement]) -> tuple[tuple[str, str, int], ...]:
    found = Counter(
        (nest.parts[placement.part].design, nest.parts[placement.part].pattern)
        for placement in placements
    )
    return tuple((design, pattern, count) for (design, pattern), count in sorted(found.items()))


def _parts_said(nest: Nest, placements: Sequence[Placement]) -> str:
    return ", ".join(
        f"{count} x {design} {pattern}" for design, pattern, count in _counts(nest, placements)
    )


def _verify_surroundings(name: str, found: ReadBack, around: Surroundings) -> None:
    """What the written sheet has beside its parts: frame, engraving, parting cut."""
    try:
        check_surroundings(found, around)
    except OutputError as error:
        raise OutputError(f"{name}: {error}") from error
