"""What lies in the output folder of one design."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.cutting.fixture import PATH as FIXTURE
from sbafab.cutting.sheets import SheetFile
from sbafab.design.kits import FILE as KIT_FILE
from sbafab.design.kits import kit_of
from sbafab.design.records import Design
from sbafab.design.templates import kit_names
from sbafab.design.writing import design_sha256, design_toml
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.files import MeshFile, write_meshes
from sbafab.output.checking import checks
from sbafab.output.manifest import as_json, file_hashes, manifest
from sbafab.output.planned import Checked, Planned
from sbafab.output.settings import GENERATOR, kerf_widths, limits
from sbafab.output.shop import write_cut_files
from sbafab.pressing.schedule import Schedule
from sbafab.pressing.tables import press_csv, press_json
from sbafab.pressing.together import batch_json, design_runs
from sbafab.progress import Progress
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
