"""What lies in the output folder of one design beside its cut files."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from sbafab.cutting.sheets import SheetFile
from sbafab.design.kits import FILE as KIT_FILE
from sbafab.design.kits import kit_of
from sbafab.design.reading import kit_names
from sbafab.design.records import Design
from sbafab.design.writing import design_sha256, design_toml
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.files import MeshFile, write_meshes
from sbafab.output.manifest import as_json, checks, file_hashes, manifest
from sbafab.output.settings import GENERATOR, kerf_widths, limits, press_settings
from sbafab.output.shop import CutSet, Progress
from sbafab.pressing.schedule import Schedule, press_csv, press_json, schedule
from sbafab.pressing.together import batch_json, design_runs
from sbafab.rules.deck import has_failed
from sbafab.rules.finding import Finding
from sbafab.rules.lowered import CHECKED_AGAINST, lowered

if TYPE_CHECKING:
    from sbafab.meshing.conforming.meshes import ConformingMeshes
    from sbafab.meshing.conforming.settings import MeshSettings

Part = Literal["cut", "press", "mesh", "preview"]
TRAVELLER = "traveller.html"


@dataclass(frozen=True)
class Conforming:
    """Volume and shell meshes that are asked for, in the formats of these file endings."""

    settings: MeshSettings
    formats: tuple[str, ...]


@dataclass(frozen=True)
class Made:
    """What was made before the rest is written; None or empty for what was not asked for.

    Without ``traveller`` the folder gets none of its own: an assembly has one for all designs.
    """

    cut: CutSet | None = None
    sheets: Sequence[SheetFile] = ()
    pressing: Schedule | None = None
    conforming: ConformingMeshes | None = None
    formats: tuple[str, ...] = ()
    traveller: bool = True


@dataclass(frozen=True)
class Checked:
    """A design, its laminate, and what the rules found in it."""

    design: Design
    laminate: Laminate
    findings: tuple[Finding, ...]

    @property
    def failed(self) -> bool:
        """Whether a rule failed that the design does not waive."""
        return has_failed(self.findings)

    @property
    def waived(self) -> tuple[str, ...]:
        """The rules that fail and that the design waives by name."""
        return tuple(dict.fromkeys(finding.rule for finding in self.findings if finding.by_user))

    @property
    def lowered(self) -> tuple[str, ...]:
        """The limits that the design sets below the usual ones."""
        return lowered(limits(self.design))


def schedule_of(checked: Checked) -> Schedule:
    """The press schedule; its first step and its warnings name waived rules and lowered limits."""
    made = schedule(checked.laminate, press_settings(checked.design))
    said = []
    if checked.waived:
        rules = ", ".join(checked.waived)
        said.append(f"made although it breaks rules that the design waives: {rules}")
    if checked.lowered:
        said.append(f"{CHECKED_AGAINST}{', '.join(checked.lowered)}")
    if not said:
        return made
    first, *others = made.steps
    words = " ".join(f"{one[:1].upper()}{one[1:]}." for one in said)
    marked = replace(first, instructions=f"{words} {first.instructions}")
    return replace(made, steps=(marked, *others), warnings=(*said, *made.warnings))


def write_contents(
    checked: Checked, wanted: Collection[Part], made: Made, folder: Path, tell: Progress
) -> dict[str, Any]:
    """Writes what is wanted beside the cut files; the manifest, without the files' hashes.

    The traveller needs cut files, schedule and pictures.
    """
    meshes: list[MeshFile] = []
    if made.pressing is not None:
        write_text(folder / "press.json", as_json(_press(checked, made.pressing)))
        write_text(folder / "press.csv", press_csv(made.pressing))
    if "mesh" in wanted:
        meshes = write_meshes(
            checked.laminate, folder, progress=lambda done, total: tell("meshes", done, total)
        )
    if made.conforming is not None:
        from sbafab.meshing.conforming.meshes import write_conforming

        told = partial(tell, "conforming meshes")
        meshes += write_conforming(made.conforming, folder, told, made.formats)
    if "preview" in wanted:
        _write_pictures(checked, folder, tell)
    paged = made.traveller and "preview" in wanted
    if paged and made.cut is not None and made.pressing is not None:
        page = _traveller(checked, made.cut, made.sheets, made.pressing, folder)
        write_text(folder / TRAVELLER, page)
    write_text(
        folder / "checks.json", as_json(checks(checked.findings, "design", [checked.design]))
    )
    _write_design(checked.design, folder)
    index = manifest(
        checked.design, checked.laminate, checked.waived, made.cut, made.sheets, meshes
    )
    if made.conforming is not None:
        index["mesh_statistics"] = made.conforming.statistics
    return index


def _press(checked: Checked, plan: Schedule) -> dict[str, Any]:
    runs = design_runs(checked.design, checked.laminate)
    batch = {"batch": batch_json(checked.laminate, runs, plan)} if runs.copies > 1 else {}
    return {**press_json(plan), **batch}


def close_folder(folder: Path, index: dict[str, Any]) -> None:
    """Writes the manifest, with the hashes of all that lies in the folder."""
    index["files"] = file_hashes(folder)
    write_text(folder / "manifest.json", as_json(index))


def write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def _traveller(
    checked: Checked,
    cut: CutSet,
    sheets: Sequence[SheetFile],
    pressing: Schedule,
    folder: Path,
) -> str:
    from sbafab.reports.traveller.job import Job
    from sbafab.reports.traveller.page import traveller_html

    design = checked.design
    job = Job(
        design_sha256=design_sha256(design),
        generator=GENERATOR,
        waived=checked.waived,
        lowered=checked.lowered,
        findings=checked.findings,
        fixture=cut.fixture,
        kerf=kerf_widths(design),
        copies=design.order.copies,
        made_for=design.order.made_for,
        note=design.order.note,
        solid_png=(folder / "preview" / "solid.png").read_bytes(),
    )
    return traveller_html(design, checked.laminate, pressing, sheets, job)


def _marked(checked: Checked) -> Laminate:
    """The laminate with notes for its pictures: failed and waived rules, lowered limits."""
    failed = dict.fromkeys(f.rule for f in checked.findings if f.verdict == "fail")
    notes = [f"not to be built, failed: {', '.join(failed)}"] if failed else []
    notes += [f"waived: {', '.join(checked.waived)}"] if checked.waived else []
    notes += [f"limits lowered: {', '.join(checked.lowered)}"] if checked.lowered else []
    laminate = checked.laminate
    return replace(laminate, notes=(*laminate.notes, *notes)) if notes else laminate


def _write_pictures(checked: Checked, folder: Path, tell: Progress) -> None:
    from sbafab.reports.layers_svg import layers_svg
    from sbafab.reports.solid_png import solid_png
    from sbafab.reports.stack_svg import stack_svg

    laminate = _marked(checked)
    preview = folder / "preview"
    preview.mkdir()
    write_text(preview / "layers.svg", layers_svg(laminate))
    tell("pictures", 1, 3)
    write_text(preview / "stack.svg", stack_svg(laminate))
    tell("pictures", 2, 3)
    (preview / "solid.png").write_bytes(solid_png(laminate))
    tell("pictures", 3, 3)


def _write_design(design: Design, folder: Path) -> None:
    if design.drawing is not None:
        name = f"outline{design.drawing.suffix.lower()}"
        shutil.copyfile(design.drawing, folder / name)
        chamber = design.chamber.model_copy(update={"outline": name})
        design = design.model_copy(update={"chamber": chamber})
    if design.kit not in kit_names():
        (folder / KIT_FILE).write_bytes(kit_of(design).text)
        design = design.model_copy(update={"kit": KIT_FILE})
    write_text(folder / "design.toml", design_toml(design))
