"""What lies in the output folder of one design."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.cutting.fixture import PATH as FIXTURE
from sbafab.cutting.properties import CutSettings
from sbafab.cutting.sheets import SheetFile
from sbafab.design.files import design_sha256, design_toml, kit_names
from sbafab.design.kits import FILE as KIT_FILE
from sbafab.design.kits import kit_of
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.files import MeshFile, write_meshes
from sbafab.nesting.records import Nest
from sbafab.output.checked import (
    GENERATOR,
    Checked,
    Planned,
    checks,
    kerf_widths,
    limits,
)
from sbafab.output.manifest import as_json, file_hashes, job_manifest, manifest
from sbafab.output.manifest_records import Schema
from sbafab.output.shop import find_nests, write_cut_files, write_nested_sheets
from sbafab.output.swap import ASSEMBLY_SCHEMA, SCHEMA
from sbafab.pressing.cycles import batch_json, design_runs
from sbafab.pressing.schedule import Schedule
from sbafab.pressing.tables import press_csv, press_json
from sbafab.process import Progress
from sbafab.rules.finding import Finding

if TYPE_CHECKING:
    from sbafab.reports.traveller.job import Job

TRAVELLER = "traveller.html"
FINDINGS = "findings.html"


def write_contents(
    planned: Planned,
    sheets: Sequence[SheetFile],
    folder: Path,
    tell: Progress,
    has_page: bool = True,
) -> dict[str, Any]:
    """Writes what is wanted of a design; the manifest, without the files' hashes.

    A folder without pages of its own gets neither findings nor a traveller, which needs cut files,
    schedule and pictures.
    """
    from sbafab.reports.underlay import NAME as UNDERLAY
    from sbafab.reports.underlay import underlay_pdf

    checked, wanted = planned.checked, planned.wanted
    meshes: list[MeshFile] = []
    solid: bytes | None = None
    if planned.paths:
        write_cut_files(planned, folder, tell)
    if planned.pressing is not None:
        write_text(folder / "press.json", as_json(_press(checked, planned.pressing)))
        write_text(folder / "press.csv", press_csv(planned.pressing))
        places = design_runs(checked.design, checked.laminate).places
        press = checked.design.press
        platen = press.platen_width, press.platen_length
        underlay = underlay_pdf(checked.laminate, design_sha256(checked.design), places, platen)
        if underlay is not None:
            (folder / UNDERLAY).write_bytes(underlay)
    if "mesh" in wanted:
        meshes = write_meshes(checked.laminate, folder, progress=partial(tell, "meshes"))
    if planned.conforming is not None:
        from sbafab.meshing.conforming.meshes import write_conforming

        told = partial(tell, "conforming meshes")
        meshes += write_conforming(planned.conforming, folder, told, planned.formats)
    if "preview" in wanted:
        solid = _write_pictures(checked, folder, tell)
    if has_page and wanted >= {"cut", "press", "preview"}:
        write_text(folder / TRAVELLER, _traveller(planned, sheets, solid))
    if has_page and "preview" in wanted:
        write_findings(checked.design.name, design_sha256(checked.design), [checked], (), folder)
    found = checks(checked.findings, "design", checked.design.name, [checked.design])
    write_text(folder / "checks.json", as_json(found))
    _write_design(checked.design, folder)
    return manifest(planned, sheets, meshes)


def _press(checked: Checked, plan: Schedule) -> dict[str, Any]:
    runs = design_runs(checked.design, checked.laminate)
    batch = {"batch": batch_json(checked.design, checked.laminate, plan)} if runs.copies > 1 else {}
    return {**press_json(plan), **batch}


def write_findings(
    name: str,
    sha256: str,
    designs: Sequence[Checked],
    between: Sequence[Finding],
    folder: Path,
) -> None:
    """The designer's page: of every design, and of the checks ``between`` an assembly's parts."""
    from sbafab.reports.traveller.findings import Inspected, findings_html

    inspected = [
        Inspected(one.design.name, one.findings, one.laminate, limits(one.design))
        for one in designs
    ]
    if between:
        inspected.append(Inspected("Between the parts", between))
    write_text(folder / FINDINGS, findings_html(name, sha256, GENERATOR, inspected))


def close_folder(folder: Path, index: dict[str, Any]) -> None:
    """Writes the manifest, with the hashes of all that lies in the folder."""
    index.pop("files", None)
    index["files"] = file_hashes(folder)
    write_text(folder / "manifest.json", as_json(index))


def write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def _traveller(planned: Planned, sheets: Sequence[SheetFile], solid: bytes | None) -> str:
    from sbafab.reports.traveller.page import traveller_html

    checked, order = planned.checked, planned.checked.design.order
    job = replace(order_of(checked), made_for=order.made_for, note=order.note, solid_png=solid)
    assert planned.pressing is not None
    return traveller_html(checked.design, checked.laminate, planned.pressing, sheets, job)


def order_of(checked: Checked, folder: str = "") -> Job:
    """What a traveller says of the order of a design whose files lie in ``folder``."""
    from sbafab.reports.traveller.job import Job
    from sbafab.reports.underlay import NAME as UNDERLAY
    from sbafab.reports.underlay import guides

    design = checked.design
    return Job(
        design_sha256=design_sha256(design),
        generator=GENERATOR,
        waived=checked.waived,
        lowered=checked.lowered,
        findings=checked.findings,
        fixture=f"{folder}{FIXTURE}" if checked.laminate.pins else None,
        underlay=f"{folder}{UNDERLAY}" if guides(checked.laminate) else None,
        kerf={str(name): kerf for name, kerf in kerf_widths(design).items()},
        copies=design.order.quantity,
    )


def _marked(checked: Checked) -> Laminate:
    """The laminate with notes for its pictures: failed and waived rules, lowered limits."""
    failed = dict.fromkeys(f.rule for f in checked.findings if f.verdict == "fail")
    notes = [f"must not be built; failed: {', '.join(failed)}"] if failed else []
    notes += [f"waived: {', '.join(checked.waived)}"] if checked.waived else []
    notes += [f"limits lowered: {', '.join(checked.lowered)}"] if checked.lowered else []
    laminate = checked.laminate
    return replace(laminate, notes=(*laminate.notes, *notes)) if notes else laminate


def _write_pictures(checked: Checked, folder: Path, tell: Progress) -> bytes:
    """Writes the pictures; that of the solid is returned as well."""
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
    solid = solid_png(laminate)
    (preview / "solid.png").write_bytes(solid)
    tell("pictures", 3, 3)
    return solid


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


# What the cutting shop gets of one or several designs: layer files, base plates, film sheets.


# Designs that are cut from the same film, one or several: placed together, then written.


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


# Several designs cut together: a folder with each design's own, and film sheets for all.
