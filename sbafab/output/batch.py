"""Designs that are cut from the same film, one or several: placed together, then written."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sbafab.cutting.properties import CutSettings
from sbafab.cutting.sheets import SheetFile
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.nesting.records import Nest
from sbafab.output.contents import close_folder, write_contents
from sbafab.output.manifest import job_manifest
from sbafab.output.manifest_records import Schema
from sbafab.output.planned import Planned
from sbafab.output.shop import (
    find_nests,
    write_nested_sheets,
)
from sbafab.output.swap import ASSEMBLY_SCHEMA, SCHEMA
from sbafab.progress import Progress

SHARED = ("films", "sheets", "laser")
"""Sections that must be alike in all designs that are cut from the same film."""


@dataclass(frozen=True)
class Batch:
    """All designs before they are written; ``settings`` are those of the film sheets.

    ``schema`` is that of the folder's manifest: of one design, of a job or of an assembly.
    """

    schema: Schema
    name: str
    designs: tuple[Planned, ...]
    settings: CutSettings
    nests: tuple[Nest, ...]

    @property
    def is_cut(self) -> bool:
        return bool(self.nests)


def refuse_other_film(designs: Sequence[Design]) -> None:
    """Raises DesignError where two designs are not cut from the same film by one machine."""
    for one in designs:
        if one.registration.method == "sheet":
            raise DesignError(
                f"{one.name} is made in registered sheets, which hold no parts of other designs; "
                'make it by itself with sbafab generate, or use registration.method = "ears"'
            )
    first, *others = designs
    for other in others:
        for section in SHARED:
            if getattr(other, section) != getattr(first, section):
                raise DesignError(
                    f"{section} differs between {first.name} and {other.name}, which are to be cut "
                    f"from the same film; make the section {section} equal in both"
                )


def plan_batch(
    schema: Schema,
    name: str,
    designs: Sequence[Planned],
    old_folder: Path,
    tell: Progress,
    waived: Sequence[str] = (),
    lowered: Sequence[str] = (),
) -> Batch:
    """Planned designs with places for their parts on the film sheets of the first.

    ``waived`` checks and ``lowered`` limits beside those of the designs are said on the sheets as
    well. Raises DesignError where a sheet refuses.
    """
    parts = [part for one in designs for part in one.parts]
    nests = find_nests(parts, designs[0].checked.design, old_folder, tell) if parts else ()
    settings = designs[0].settings
    if schema != SCHEMA:
        settings = _settings(name, designs, waived, lowered)
    return Batch(schema, name, tuple(designs), settings, nests)


def _settings(
    name: str, designs: Sequence[Planned], waived: Sequence[str], lowered: Sequence[str]
) -> CutSettings:
    """Those of the shared sheets: one hash over all designs, every waiver and limit of any."""
    own = [one.settings for one in designs]
    hashes = "".join(one.design_sha256 for one in own)
    return replace(
        own[0],
        design=name,
        design_sha256=hashlib.sha256(hashes.encode()).hexdigest(),
        waived=tuple(dict.fromkeys([*(said for one in own for said in one.waived), *waived])),
        lowered=tuple(dict.fromkeys([*(said for one in own for said in one.lowered), *lowered])),
        warnings={name: said for one in own for name, said in one.warnings.items()},
    )


def write_batch(
    batch: Batch, folder: Path, tell: Progress
) -> tuple[dict[str, Any], list[SheetFile]]:
    """Writes film sheets and designs; the manifest without the files' hashes, and the sheets.

    Several designs get a folder each, named after it.
    """
    first, *_ = batch.designs
    sheets: list[SheetFile] = []
    if batch.is_cut:
        design = first.checked.design
        sheets = write_nested_sheets(batch.nests, design, folder, batch.settings, tell)
    if batch.schema == SCHEMA:
        return write_contents(first, sheets, folder, tell), sheets
    seen = _seen_from_below(sheets)
    for one in batch.designs:
        own = folder / one.checked.design.name
        own.mkdir()
        # An assembly has one page for all designs.
        index = write_contents(one, seen, own, tell, batch.schema != ASSEMBLY_SCHEMA)
        # The folder above has the sheets; a design's own is one without.
        close_folder(own, {**index, "sheets": []})
    own_designs = [one.checked.design for one in batch.designs]
    index = job_manifest(batch.schema, batch.name, batch.settings, own_designs, sheets)
    return index, sheets


def _seen_from_below(sheets: Sequence[SheetFile]) -> list[SheetFile]:
    """The shared sheets as a design's own folder names them."""
    return [
        replace(
            sheet,
            path=f"../{sheet.path}",
            picture=f"../{sheet.picture}",
            project=f"../{sheet.project}",
        )
        for sheet in sheets
    ]
