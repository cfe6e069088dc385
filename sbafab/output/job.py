"""Several designs cut together: a folder with each design's own, and film sheets for all."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sbafab.cutting.dxf_write import DxfProfile
from sbafab.cutting.properties import CutSettings
from sbafab.cutting.sheets import SheetFile
from sbafab.design.records import NAME_PATTERN, Design
from sbafab.design.writing import design_sha256
from sbafab.errors import DesignError
from sbafab.output.contents import Checked, Made, Part, close_folder, schedule_of, write_contents
from sbafab.output.manifest import sheet_entry
from sbafab.output.run import check
from sbafab.output.settings import GENERATOR, cut_settings, kerf_widths
from sbafab.output.shop import (
    Progress,
    film_use,
    find_nests,
    plan_cuts,
    write_cut_set,
    write_nested_sheets,
)
from sbafab.output.swap import JOB_SCHEMA, replaced_folder

PARTS: tuple[Part, ...] = ("press", "mesh", "preview")
SHARED = ("sheets", "laser")
"""Sections that all designs of a job must have alike: they are cut from the same film."""


@dataclass(frozen=True)
class Job:
    """What was made of several designs; nothing was written if one of them ``failed``."""

    checked: tuple[Checked, ...]
    folder: Path
    manifest: dict[str, Any]

    @property
    def failed(self) -> bool:
        return any(checked.failed for checked in self.checked)


def generate_job(
    designs: Sequence[Design],
    name: str,
    out: Path = Path("out"),
    progress: Progress | None = None,
    dxf_profile: DxfProfile = "bulges",
    chord_error: float = 0.005,
) -> Job:
    """Writes ``out/<name>/``: a folder for each design, and ``sheets/`` with the parts of all.

    Film sheets, kerf and machine are those of the first design, and must be alike in all.
    Raises DesignError where they are not, or where two designs have one name. If a rule fails in
    any design, nothing is written.
    """
    tell = progress or (lambda what, done, total: None)
    _refuse_unlike(designs, name)
    checked = tuple(Checked(design, *check(design, tell)) for design in designs)
    target = out / name
    if any(one.failed for one in checked):
        return Job(checked, target, {})
    schedules = [schedule_of(one) for one in checked]
    own_settings = [
        cut_settings(one.design, one.waived, dxf_profile, chord_error) for one in checked
    ]
    plans = [
        plan_cuts(one.laminate, one.design.order.copies, settings)
        for one, settings in zip(checked, own_settings, strict=True)
    ]
    nests = find_nests([part for plan in plans for part in plan.parts], designs[0], target, tell)
    shared = _settings(checked, name, dxf_profile, chord_error)
    with replaced_folder(target) as folder:
        sheets = write_nested_sheets(nests, designs[0], folder, shared, tell)
        seen = _seen_from_below(sheets)
        for one, plan, settings, pressing in zip(
            checked, plans, own_settings, schedules, strict=True
        ):
            own = folder / one.design.name
            own.mkdir()
            cut = write_cut_set(one.laminate, plan, own, settings, tell)
            index = write_contents(one, PARTS, Made(cut, seen, pressing), own, tell)
            # The job's manifest has the sheets; a design's own folder is one without.
            close_folder(own, {**index, "sheets": []})
        index = _manifest(checked, name, shared, sheets)
        close_folder(folder, index)
    return Job(checked, target, index)


def _refuse_unlike(designs: Sequence[Design], name: str) -> None:
    first, *others = designs
    if re.fullmatch(NAME_PATTERN.strip("^$"), name) is None:
        raise DesignError(
            f"--name {name!r} must be a folder's name of letters, digits, dots, dashes and "
            "underscores; for another place use -o"
        )
    names = [design.name for design in designs]
    twice = next((own for own in names if names.count(own) > 1), None)
    if twice is not None:
        raise DesignError(
            f"two designs are named {twice}; give each a name of its own, or say --copies"
        )
    if name in (*names, "sheets"):
        raise DesignError(f"the job is named {name} as one of its folders; choose another --name")
    for other in others:
        for section in SHARED:
            if getattr(other, section) != getattr(first, section):
                raise DesignError(
                    f"{section} differs between {first.name} and {other.name}, which are to be cut "
                    f"from the same film; make the section {section} equal in both"
                )


def _settings(
    checked: Sequence[Checked], name: str, profile: DxfProfile, chord_error: float
) -> CutSettings:
    """Those of the shared sheets: one hash over all designs, every waiver of any."""
    hashes = "".join(design_sha256(one.design) for one in checked)
    return CutSettings(
        design=name,
        design_sha256=hashlib.sha256(hashes.encode()).hexdigest(),
        kerf_widths=kerf_widths(checked[0].design),
        waived=tuple(dict.fromkeys(rule for one in checked for rule in one.waived)),
        profile=profile,
        chord_error=chord_error,
        generator=GENERATOR,
    )


def _seen_from_below(sheets: Sequence[SheetFile]) -> list[SheetFile]:
    """The job's sheets as a design's own folder names them."""
    return [
        replace(sheet, path=f"../{sheet.path}", picture=f"../{sheet.picture}") for sheet in sheets
    ]


def _manifest(
    checked: Sequence[Checked], name: str, settings: CutSettings, sheets: Sequence[SheetFile]
) -> dict[str, Any]:
    return {
        "schema": JOB_SCHEMA,
        "name": name,
        "units": "mm",
        "designs_sha256": settings.design_sha256,
        "generator": GENERATOR,
        "waived": list(settings.waived),
        "designs": [
            {
                "name": one.design.name,
                "folder": one.design.name,
                "copies": one.design.order.copies,
                "design_sha256": design_sha256(one.design),
            }
            for one in checked
        ],
        "films": [{"material": material, **use} for material, use in film_use(sheets).items()],
        "sheets": [sheet_entry(sheet) for sheet in sheets],
    }
