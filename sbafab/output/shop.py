"""What the cutting shop gets of one or several designs: layer files, pin plates, film sheets."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sbafab.cutting.files import CutFile, compensated_paths, write_layer_files
from sbafab.cutting.fixture import write_fixture
from sbafab.cutting.properties import CutSettings, curves_of
from sbafab.cutting.sheets import FOLDER, SheetFile, write_sheets
from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from sbafab.nesting.check import check_nest
from sbafab.nesting.nest import nest
from sbafab.nesting.parts import parts_of
from sbafab.nesting.records import Nest, Part
from sbafab.nesting.saved import as_dict, from_dict
from sbafab.output.coarse import refuse_coarse
from sbafab.output.settings import machine, stocks
from sbafab.pressing.together import runs_of
from sbafab.rules.limits import Limits

PLACES = f"{FOLDER}/nest.json"
MOST_BYTES = 50_000_000
"""Of saved places; more are not read but searched anew."""
Progress = Callable[[str, int, int], None]
"""Told what is being done, and how much of how much is done."""


@dataclass(frozen=True)
class CutPlan:
    """What is to be cut of a laminate: the beam's path for every pattern, and its parts."""

    paths: Mapping[str, Region]
    parts: tuple[Part, ...]
    places: tuple[Point, ...]
    """Where on the pin plate the copies of a press cycle lie."""


@dataclass(frozen=True)
class CutSet:
    """The cut files of one laminate; ``fixture`` is the pin plate's path, if it has pins.

    ``curves`` says within what chords stay; None for true arcs.
    """

    files: tuple[CutFile, ...]
    fixture: str | None
    curves: str | None = None


def plan_cuts(laminate: Laminate, copies: int, settings: CutSettings, limits: Limits) -> CutPlan:
    """Raises DesignError where the kerf leaves no path, or chords do not hold the limits."""
    paths = compensated_paths(laminate, settings)
    if settings.profile == "chords":
        refuse_coarse(laminate, paths, settings, limits)
    runs = runs_of(laminate, copies, (limits.heated_width, limits.heated_length))
    return CutPlan(paths, parts_of(laminate, paths, copies), runs.places)


def find_nests(
    parts: Sequence[Part], design: Design, old_folder: Path, tell: Progress
) -> tuple[Nest, ...]:
    """Places for the parts on the design's film sheets.

    Places that an earlier run found for the same parts and sheets are taken over, not searched
    for again. Raises DesignError where parts do not fit.
    """
    tell("nesting", 0, 1)
    saved = _saved(parts, design, old_folder / PLACES)
    return saved or nest(parts, stocks(design), design.sheets.engine, design.sheets.seconds)


def write_cut_set(
    laminate: Laminate, plan: CutPlan, folder: Path, settings: CutSettings, tell: Progress
) -> CutSet:
    """Writes the layer files and the pin plate of a laminate."""
    files = write_layer_files(
        laminate, plan.paths, folder, settings, lambda done, total: tell("cut files", done, total)
    )
    plate = write_fixture(laminate, folder, settings, plan.places)
    return CutSet(tuple(files), plate, curves_of(settings))


def write_nested_sheets(
    nests: Sequence[Nest], design: Design, folder: Path, settings: CutSettings, tell: Progress
) -> list[SheetFile]:
    """Writes the film sheets, and beside them the places for a later run."""
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


def _saved(parts: Sequence[Part], design: Design, path: Path) -> tuple[Nest, ...] | None:
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


def film_use(sheets: Sequence[SheetFile]) -> dict[str, dict[str, float]]:
    """Sheets, their area, the parts' share and the waste in mm2, by material."""
    used: dict[str, dict[str, float]] = {}
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
