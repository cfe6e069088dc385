"""What the cutting shop gets of one or several designs: layer files, base plates, film sheets."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.cutting.files import write_layer_files
from sbafab.cutting.fixture import write_fixture
from sbafab.cutting.lightburn import write_projects
from sbafab.cutting.properties import CutSettings
from sbafab.cutting.second_cut import write_second_cut
from sbafab.cutting.sheets import FOLDER, SheetFile, write_sheets
from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.geometry.region import Region
from sbafab.laminate.films import Material
from sbafab.laminate.laminate import Laminate
from sbafab.nesting.check import check_nest
from sbafab.nesting.nest import as_dict, from_dict, nest
from sbafab.nesting.records import Nest, NestPart
from sbafab.output.checked import (
    Planned,
    hole_notes,
    machine,
    stocks,
)
from sbafab.pressing.cycles import design_runs
from sbafab.process import Progress

if TYPE_CHECKING:
    pass


PLACES = f"{FOLDER}/nest.json"


MOST_BYTES = 50_000_000
"""Of saved places; more are not read but searched for again."""


def find_nests(
    parts: Sequence[NestPart], design: Design, old_folder: Path, tell: Progress
) -> tuple[Nest, ...]:
    """Places for the parts on the design's film sheets.

    Places that an earlier run found for the same parts and sheets are taken over, not searched
    for again. Raises DesignError where parts do not fit.
    """
    if not parts:
        return ()
    tell("nesting", 0, 1)
    saved = _saved(parts, design, old_folder / PLACES)
    return saved or nest(parts, stocks(design), design.sheets.engine, design.sheets.seconds)


def write_cut_files(planned: Planned, folder: Path, tell: Progress) -> None:
    """Writes the layer files and the base plate of a design."""
    laminate, settings = planned.checked.laminate, planned.settings
    told = partial(tell, "cut files")
    write_layer_files(laminate, planned.paths, folder, settings, told)
    design = planned.checked.design
    places = design_runs(design, laminate).places
    write_fixture(laminate, folder, settings, places, hole_notes(design, laminate))
    write_panel(laminate, planned.paths, folder, settings)


def write_panel(
    laminate: Laminate, paths: Mapping[str, Region], folder: Path, settings: CutSettings
) -> None:
    """Writes the second cut of registered sheets and their LightBurn projects, if there are any."""
    if laminate.panel is not None:
        write_second_cut(laminate, folder, settings)
        write_projects(laminate, paths, folder, settings)


def write_nested_sheets(
    nests: Sequence[Nest], design: Design, folder: Path, settings: CutSettings, tell: Progress
) -> list[SheetFile]:
    """Writes the film sheets, and beside them the places for a later run; nothing for no nest."""
    if not nests:
        return []
    sheets = write_sheets(
        nests,
        folder,
        settings,
        machine(design),
        design.sheets.label,
        lambda done, total: tell("sheets", done, total),
    )
    places = json.dumps(as_dict(nests), indent=1)
    (folder / PLACES).write_text(places + "\n", encoding="utf-8", newline="\n")
    return sheets


def _saved(parts: Sequence[NestPart], design: Design, path: Path) -> tuple[Nest, ...] | None:
    """The places of an earlier run; None where there are none for these parts, or bad ones."""
    try:
        if not path.is_file() or path.stat().st_size > MOST_BYTES:
            return None
        data: Any = json.loads(path.read_text(encoding="utf-8"))
        nests = from_dict(data, parts, stocks(design), design.sheets.engine)
        if nests is None or not all(_is_possible(nest) for nest in nests):
            return None
        for nested in nests:
            check_nest(nested)
    except (OSError, ValueError, ArithmeticError, RecursionError, OutputError):
        return None
    return nests


def _is_possible(nest: Nest) -> bool:
    """Whether sheets and turns are ones that the stock allows."""
    turns = nest.stock.turns
    return nest.sheets <= nest.stock.most and all(p.turn in turns for p in nest.placements)


def film_use(sheets: Sequence[SheetFile]) -> dict[Material, dict[str, Any]]:
    """Sheets, their area, the parts' share and the waste in mm2, by material."""
    used: dict[Material, dict[str, float]] = {}
    for sheet in sheets:
        entry = used.setdefault(sheet.material, {"sheets": 0, "sheet_area": 0.0, "parts_area": 0.0})
        entry["sheets"] += 1
        entry["sheet_area"] += sheet.width * sheet.length
        entry["parts_area"] += sheet.parts_area
    return {material: _shares(entry) for material, entry in used.items()}


def _shares(entry: Mapping[str, float]) -> dict[str, float]:
    area, parts = entry["sheet_area"], entry["parts_area"]
    return {
        "sheets": entry["sheets"],
        "sheet_area": round(area, 3),
        "waste": round(area - parts, 3),
        "density": round(parts / area, 4),
    }
