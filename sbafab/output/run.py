"""One run: a design becomes a folder with all that was asked for, written whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab.actuators import build
from sbafab.cutting.dxf_write import DxfProfile
from sbafab.cutting.sheets import SheetFile
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.boolean import GeometryError
from sbafab.laminate.laminate import Laminate
from sbafab.notebook import table_html
from sbafab.output.contents import (
    Checked,
    Conforming,
    Made,
    Part,
    close_folder,
    schedule_of,
    write_contents,
)
from sbafab.output.earlier import (
    CUT,
    MESH,
    PRESS,
    carry_over,
    refuse_to_replace,
    removed_files,
    would_replace,
)
from sbafab.output.manifest import identity
from sbafab.output.self_check import refuse_unlike, work_of
from sbafab.output.settings import cut_settings, limits
from sbafab.output.shop import (
    CutPlan,
    CutSet,
    Progress,
    find_nests,
    plan_cuts,
    write_cut_set,
    write_nested_sheets,
)
from sbafab.output.swap import listed_files, replaced_folder
from sbafab.pressing.schedule import Schedule
from sbafab.rules.deck import has_failed, run_deck
from sbafab.rules.finding import Finding, Findings

if TYPE_CHECKING:
    from sbafab.meshing.conforming.meshes import ConformingMeshes

ExtraFiles = Callable[[Laminate, Path], None]
"""Writes something of its own for a laminate into the folder of a run."""
EVERYTHING: tuple[Part, ...] = ("cut", "press", "mesh", "preview")
OWN: dict[Part, tuple[str, ...]] = {"cut": CUT, "press": PRESS, "mesh": MESH, "preview": ()}
"""What of an earlier run is made anew with a part."""


class Extras(NamedTuple):
    """What a run may be asked for beside its parts.

    ``conforming``: volume and shell meshes, which take the extra "mesh"; ``also`` writes files and
    folders with the names ``own`` into the folder of a design that holds.
    """

    conforming: Conforming | None = None
    also: ExtraFiles | None = None
    own: tuple[str, ...] = ()


NO_EXTRAS = Extras()


@dataclass(frozen=True, repr=False)
class Run:
    """What a run made. ``findings`` tell whether the design holds; without cut files if not."""

    design: Design
    laminate: Laminate
    findings: tuple[Finding, ...]
    folder: Path
    manifest: dict[str, Any]
    schedule: Schedule | None
    conforming: ConformingMeshes | None = None
    dropped: tuple[str, ...] = ()
    """Files of an older run of another design or version that this one removed."""
    kept: bool = False
    """Whether the design fails and ``folder`` was left to an older run of another one."""

    @property
    def failed(self) -> bool:
        """Whether a rule failed that the design does not waive; no cut file was written then."""
        return has_failed(self.findings)

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r}, {'failed' if self.failed else 'holds'})"

    def _repr_html_(self) -> str:
        files = [(str(self.folder / name),) for name in self.manifest.get("files", ())]
        table = table_html(("files written",), files)
        return self.laminate._repr_html_() + Findings(self.findings)._repr_html_() + table


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
    extras: Extras = NO_EXTRAS,
) -> Run:
    """Writes ``out/<design name>/`` and returns what was made.

    A design that breaks a rule gets its findings and pictures, but no cut files, schedule or
    meshes; where another design's lie, it gets nothing and they stay (``Run.kept``). With some of
    the ``parts`` only, the others stay if they are of the same design.
    Raises DesignError or OutputError, also where other parts are another design's, and DefectError
    where the cut files read back are not what was checked; the old folder is then whole.
    """
    tell = progress or (lambda what, done, total: None)
    checked = Checked(design, *check(design, tell))
    wanted = set(parts)
    target = out / design.name
    if checked.failed:
        kept = would_replace(target, identity(design, checked.waived))
        if kept:
            return Run(design, checked.laminate, checked.findings, target, {}, None, kept=True)
        wanted &= {"preview"}
    elif wanted < set(EVERYTHING):
        own = [name for part in wanted for name in OWN[part]]
        refuse_to_replace(target, identity(design, checked.waived), (*own, *extras.own))
    # Schedule, nest and meshes are made before anything is written: they may refuse the design.
    pressing = schedule_of(checked) if "press" in wanted else None
    settings = cut_settings(design, checked.waived, dxf_profile, chord_error)
    plan: CutPlan | None = None
    if "cut" in wanted:
        plan = plan_cuts(checked.laminate, design.order, settings, limits(design))
    nests = find_nests(plan.parts, design, target, tell) if plan is not None else ()
    meshes = _meshed(checked, extras.conforming, tell) if "mesh" in wanted else None
    listed = listed_files(target)
    with replaced_folder(target) as folder:
        cut: CutSet | None = None
        sheets: list[SheetFile] = []
        if plan is not None:
            cut = write_cut_set(checked.laminate, plan, folder, settings, tell)
            sheets = write_nested_sheets(nests, design, folder, settings, tell)
        formats = extras.conforming.formats if extras.conforming else ()
        made = Made(cut, sheets, pressing, meshes, formats)
        index = write_contents(checked, wanted, made, folder, tell)
        if not checked.failed:
            if extras.also is not None:
                extras.also(checked.laminate, folder)
            carry_over(target, folder, index)
        close_folder(folder, index)
        if plan is not None:
            tell("reading back", 0, 1)
            refuse_unlike(folder, {design.name: work_of(checked, plan.paths)}, settings)
    dropped = removed_files(listed, index)
    return Run(design, checked.laminate, checked.findings, target, index, pressing, meshes, dropped)


def _meshed(checked: Checked, asked: Conforming | None, tell: Progress) -> ConformingMeshes | None:
    if asked is None:
        return None
    from sbafab.meshing.conforming.meshes import conforming_meshes

    tell("meshing", 0, 1)
    return conforming_meshes(checked.laminate, asked.settings)


def with_folder(made: Path) -> ExtraFiles:
    """Puts a folder that was made elsewhere into that of a run, under its own name."""

    def put(_: Laminate, folder: Path) -> None:
        shutil.copytree(made, folder / made.name)

    return put
