"""Designs that are cut from the same film: planned and nested together, a folder for each."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from sbafab.cutting.dxf_write import DxfProfile
from sbafab.cutting.properties import CutSettings
from sbafab.cutting.sheets import SheetFile
from sbafab.design.kits import citation
from sbafab.design.records import Design
from sbafab.design.writing import design_sha256
from sbafab.errors import DesignError
from sbafab.nesting.nest import refuse_unfit
from sbafab.nesting.records import Nest
from sbafab.output.contents import Checked, Made, Part, close_folder, schedule_of, write_contents
from sbafab.output.manifest import sheet_entry
from sbafab.output.settings import GENERATOR, cut_settings, kerf_widths, limits, stocks, warnings
from sbafab.output.shop import (
    CutPlan,
    CutSet,
    Progress,
    film_use,
    find_nests,
    plan_cuts,
    write_cut_set,
    write_nested_sheets,
)
from sbafab.pressing.schedule import Schedule

SHARED = ("films", "sheets", "laser")
"""Sections that must be alike in all designs that are cut from the same film."""


class Drawing(NamedTuple):
    """How cut files draw arcs."""

    profile: DxfProfile = "bulges"
    chord_error: float = 0.005


class Planned(NamedTuple):
    """One design before it is written."""

    checked: Checked
    settings: CutSettings
    plan: CutPlan
    pressing: Schedule


@dataclass(frozen=True)
class Batch:
    """All designs before they are written; ``settings`` are those of the shared sheets."""

    designs: tuple[Planned, ...]
    settings: CutSettings
    nests: tuple[Nest, ...]


class Written(NamedTuple):
    """The shared film sheets, and what the shop gets of each design."""

    sheets: list[SheetFile]
    cut: list[CutSet]


def refuse_unlike(designs: Sequence[Design]) -> None:
    """Raises DesignError where two designs are not cut from the same film by one machine."""
    first, *others = designs
    for other in others:
        for section in SHARED:
            if getattr(other, section) != getattr(first, section):
                raise DesignError(
                    f"{section} differs between {first.name} and {other.name}, which are to be cut "
                    f"from the same film; make the section {section} equal in both"
                )


def plan_batch(
    checked: Sequence[Checked],
    name: str,
    old_folder: Path,
    drawing: Drawing,
    tell: Progress,
    waived: Sequence[str] = (),
    lowered: Sequence[str] = (),
) -> Batch:
    """Cut paths, schedules and places on film sheets.

    ``waived`` checks and ``lowered`` limits are said on the sheets as well.

    Film, kerf and machine are those of the first design. Raises DesignError where a design or a
    sheet refuses.
    """
    designs = []
    for one in checked:
        settings = cut_settings(one.design, one.waived, drawing.profile, drawing.chord_error)
        plan = plan_cuts(one.laminate, one.design.order.copies, settings, limits(one.design))
        designs.append(Planned(one, settings, plan, schedule_of(one)))
    parts = [part for one in designs for part in one.plan.parts]
    nests = find_nests(parts, checked[0].design, old_folder, tell)
    return Batch(tuple(designs), _settings(checked, name, drawing, waived, lowered), nests)


def refuse_undoable(checked: Sequence[Checked]) -> None:
    """Raises DesignError where press, kerf or film sheets cannot do designs that hold."""
    for one in checked:
        design = one.design
        schedule_of(one)
        settings = cut_settings(design, one.waived)
        plan = plan_cuts(one.laminate, design.order.copies, settings, limits(design))
        refuse_unfit(plan.parts, stocks(design))


def _settings(
    checked: Sequence[Checked],
    name: str,
    drawing: Drawing,
    waived: Sequence[str],
    lowered: Sequence[str],
) -> CutSettings:
    """Those of the shared sheets: one hash over all designs, every waiver and limit of any."""
    hashes = "".join(design_sha256(one.design) for one in checked)
    own = (rule for one in checked for rule in one.waived)
    return CutSettings(
        design=name,
        design_sha256=hashlib.sha256(hashes.encode()).hexdigest(),
        kerf_widths=kerf_widths(checked[0].design),
        waived=tuple(dict.fromkeys([*own, *waived])),
        lowered=tuple(
            dict.fromkeys([*(said for one in checked for said in one.lowered), *lowered])
        ),
        profile=drawing.profile,
        chord_error=drawing.chord_error,
        generator=GENERATOR,
        warnings={name: said for one in checked for name, said in warnings(one.design).items()},
    )


def write_batch(
    batch: Batch, folder: Path, parts: Collection[Part], traveller: bool, tell: Progress
) -> Written:
    """Writes ``sheets/`` and a folder for each design, named after it."""
    first = batch.designs[0].checked.design
    sheets = write_nested_sheets(batch.nests, first, folder, batch.settings, tell)
    seen = _seen_from_below(sheets)
    cut = []
    for one in batch.designs:
        own = folder / one.checked.design.name
        own.mkdir()
        cut.append(write_cut_set(one.checked.laminate, one.plan, own, one.settings, tell))
        made = Made(cut[-1], seen, one.pressing, traveller=traveller)
        index = write_contents(one.checked, parts, made, own, tell)
        # The folder above has the sheets; a design's own is one without.
        close_folder(own, {**index, "sheets": []})
    return Written(sheets, cut)


def _seen_from_below(sheets: Sequence[SheetFile]) -> list[SheetFile]:
    """The shared sheets as a design's own folder names them."""
    return [
        replace(sheet, path=f"../{sheet.path}", picture=f"../{sheet.picture}") for sheet in sheets
    ]


def batch_manifest(
    schema: str, name: str, checked: Sequence[Checked], batch: Batch, sheets: Sequence[SheetFile]
) -> dict[str, Any]:
    """The index of the folder of several designs, without the files' hashes."""
    return {
        "schema": schema,
        "name": name,
        "units": "mm",
        "designs_sha256": batch.settings.design_sha256,
        "generator": GENERATOR,
        "waived": list(batch.settings.waived),
        "lowered_limits": list(batch.settings.lowered),
        "designs": [
            {
                "name": one.design.name,
                "folder": one.design.name,
                "copies": one.design.order.copies,
                "design_sha256": design_sha256(one.design),
                "kit": citation(one.design),
            }
            for one in checked
        ],
        "films": [{"material": material, **use} for material, use in film_use(sheets).items()],
        "sheets": [sheet_entry(sheet) for sheet in sheets],
    }
