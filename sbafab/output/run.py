"""One run: a design becomes a folder with all that was asked for, written whole or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sbafab.actuators import build
from sbafab.cutting.dxf_write import DxfProfile
from sbafab.cutting.sheets import SheetFile
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.boolean import GeometryError
from sbafab.laminate.laminate import Laminate
from sbafab.output.contents import (
    Checked,
    Part,
    carry_over,
    close_folder,
    schedule_of,
    write_contents,
)
from sbafab.output.settings import cut_settings, limits
from sbafab.output.shop import (
    CutSet,
    Progress,
    find_nests,
    plan_cuts,
    write_cut_set,
    write_nested_sheets,
)
from sbafab.output.swap import replaced_folder
from sbafab.pressing.schedule import Schedule
from sbafab.rules.deck import has_failed, run_deck
from sbafab.rules.finding import Finding

EVERYTHING: tuple[Part, ...] = ("cut", "press", "mesh", "preview")


@dataclass(frozen=True)
class Run:
    """What a run made. ``findings`` tell whether the design holds; without cut files if not."""

    design: Design
    laminate: Laminate
    findings: tuple[Finding, ...]
    folder: Path
    manifest: dict[str, Any]
    schedule: Schedule | None

    @property
    def failed(self) -> bool:
        """Whether a rule failed that the design does not waive; no cut file was written then."""
        return has_failed(self.findings)


def check(design: Design, progress: Progress | None = None) -> tuple[Laminate, tuple[Finding, ...]]:
    """The laminate of a design and what the rule deck finds in it."""
    try:
        laminate = build(design)
        return laminate, run_deck(laminate, limits(design), progress)
    except GeometryError as error:
        raise DesignError(f"design {design.name} cannot be resolved: {error}") from None


def generate(
    design: Design,
    out: Path = Path("out"),
    parts: Sequence[Part] = EVERYTHING,
    progress: Progress | None = None,
    dxf_profile: DxfProfile = "bulges",
    chord_error: float = 0.005,
) -> Run:
    """Writes ``out/<design name>/`` and returns what was made.

    A design that breaks a rule gets its findings and pictures, but no cut files, schedule or
    meshes. With some of the ``parts`` only, the others stay if they are of the same design.
    Raises DesignError or OutputError; the old folder is then whole.
    """
    tell = progress or (lambda what, done, total: None)
    checked = Checked(design, *check(design, tell))
    wanted = set(parts)
    if checked.failed:
        wanted &= {"preview"}
    # Schedule and nest are made before anything is written: they may refuse the design.
    pressing = schedule_of(checked) if "press" in wanted else None
    target = out / design.name
    settings = cut_settings(design, checked.waived, dxf_profile, chord_error)
    plan = plan_cuts(checked.laminate, design.order.copies, settings) if "cut" in wanted else None
    nests = find_nests(plan.parts, design, target, tell) if plan is not None else ()
    with replaced_folder(target) as folder:
        cut: CutSet | None = None
        sheets: list[SheetFile] = []
        if plan is not None:
            cut = write_cut_set(checked.laminate, plan, folder, settings, tell)
            sheets = write_nested_sheets(nests, design, folder, settings, tell)
        index = write_contents(checked, wanted, cut, sheets, pressing, folder, tell)
        if not checked.failed:
            carry_over(target, folder, index)
        close_folder(folder, index)
    return Run(design, checked.laminate, checked.findings, target, index, pressing)
