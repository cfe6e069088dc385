"""An assembly: its designs cut together, one traveller, and the whole put together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sbafab.assemblies.build import Assembled, PlacedPart, assemble
from sbafab.assemblies.checks import lowered_checks, run_checks
from sbafab.assemblies.files import load_assembly
from sbafab.assemblies.records import Assembly
from sbafab.assemblies.shapes import colours, linear, placed_surface
from sbafab.assemblies.writing import DESIGN_FILE, assembly_sha256, assembly_toml, part_entry
from sbafab.cutting.properties import TRUE_ARCS, Curves
from sbafab.cutting.sheets import SheetFile
from sbafab.errors import DesignError, GeometryError
from sbafab.meshing.formats.glb import Node, write_scene
from sbafab.output.batch import (
    TRAVELLER,
    Batch,
    order_of,
    plan_batch,
    refuse_other_film,
    write_batch,
    write_findings,
    write_text,
)
from sbafab.output.checked import EVERYTHING, GENERATOR, PICTURES, Checked, checks, limits, plan
from sbafab.output.earlier import would_replace
from sbafab.output.manifest import as_json
from sbafab.output.manifest_records import AssemblyManifest
from sbafab.output.run import Run, found_in, swapped_in
from sbafab.output.swap import ASSEMBLY_SCHEMA
from sbafab.process import Progress, unheard
from sbafab.rules.deck import has_failed, run_deck
from sbafab.rules.finding import Finding

SOLID = "mesh/assembled.glb"
PICTURE = "preview/assembled.png"


@dataclass(frozen=True)
class CheckedAssembly:
    """An assembly, what the rules find in each design, and the checks between the parts."""

    assembled: Assembled
    designs: tuple[Checked, ...]
    between: tuple[Finding, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Those of the designs, each with its design's name, then those between parts."""
        return found_in(self.designs, self.between)

    @property
    def failed(self) -> bool:
        return has_failed(self.findings)

    @property
    def waived(self) -> tuple[str, ...]:
        """Checks between parts that fail and that the assembly waives by name."""
        return tuple(dict.fromkeys(finding.rule for finding in self.between if finding.by_user))

    @property
    def lowered(self) -> tuple[str, ...]:
        """The limits of the checks between parts that the assembly weakens."""
        return lowered_checks(self.assembled.assembly.rules)


def check_assembly(assembly: Assembly, progress: Progress | None = None) -> CheckedAssembly:
    """The assembly put together, the rule deck on each design, the checks between parts."""
    tell = progress or unheard
    assembled = assemble(assembly)
    designs = [made.design for made in assembled.designs]
    refuse_other_film(designs)
    try:
        checked = tuple(
            Checked(one.design, one.laminate, run_deck(one.laminate, limits(one.design), tell))
            for one in assembled.designs
        )
    except GeometryError as error:
        raise DesignError(f"assembly {assembly.name} cannot be resolved: {error}") from None
    tell("checks between parts", 0, 1)
    return CheckedAssembly(assembled, checked, run_checks(assembled))


def checked_again(folder: Path, designs: Sequence[Checked]) -> CheckedAssembly:
    """The assembly of a folder, with what was found in its designs as they lie in there."""
    assembled = assemble(load_assembly(folder / DESIGN_FILE))
    return CheckedAssembly(assembled, tuple(designs), run_checks(assembled))


def generate_assembly(
    assembly: Assembly,
    out: Path = Path("out"),
    progress: Progress | None = None,
    curves: Curves = TRUE_ARCS,
) -> Run:
    """Writes ``out/<name>/``: a folder for each design, shared film sheets, one traveller.

    Where a rule or a check between parts fails, findings and pictures are written, and nothing
    to cut; an earlier run with more than that stays as it is (``Run.kept``). Raises DesignError
    or OutputError; the old folder is then whole.
    """
    tell = progress or unheard
    checked = check_assembly(assembly, tell)
    target = out / assembly.name
    if checked.failed and would_replace(target, None):
        return Run(checked.designs, target, between=checked.between, kept=True)
    batch = plan_assembly(checked, target, tell, curves)
    return swapped_in(
        batch,
        target,
        lambda folder: write_assembly(checked, batch, folder, tell),
        tell,
        checked.between,
    )


def plan_assembly(
    checked: CheckedAssembly, old_folder: Path, tell: Progress, curves: Curves
) -> Batch:
    """The designs of an assembly, to be cut together where nothing failed."""
    wanted = PICTURES if checked.failed else EVERYTHING
    planned = [plan(one, wanted, curves) for one in checked.designs]
    name = checked.assembled.assembly.name
    said = (checked.waived, checked.lowered)
    return plan_batch(ASSEMBLY_SCHEMA, name, planned, old_folder, tell, *said)


def write_assembly(
    checked: CheckedAssembly, batch: Batch, folder: Path, tell: Progress
) -> dict[str, Any]:
    """Writes designs and film sheets, and the whole; its manifest, without the files' hashes."""
    from sbafab.reports.assembly_png import assembly_pngs

    index, sheets = write_batch(batch, folder, tell)
    assembled = checked.assembled
    tell("assembled", 0, 1)
    (folder / "preview").mkdir()
    picture, bare = assembly_pngs(assembled, _note(checked))
    (folder / PICTURE).write_bytes(picture)
    meshes = []
    if batch.is_cut:
        (folder / "mesh").mkdir()
        meshes.append(_write_solid(assembled, folder))
        write_text(folder / TRAVELLER, _traveller(checked, batch, sheets, bare))
    sha256 = assembly_sha256(assembled)
    write_findings(assembled.assembly.name, sha256, checked.designs, checked.between, folder)
    designs = [one.design for one in checked.designs]
    found = checks(checked.findings, "design", assembled.assembly.name, designs)
    write_text(folder / "checks.json", as_json(found))
    write_text(folder / DESIGN_FILE, assembly_toml(assembled))
    index |= {**_claims(assembled), "meshes": meshes, "files": {}}
    return AssemblyManifest.model_validate_json(as_json(index)).as_dict()


def _note(checked: CheckedAssembly) -> str:
    failed = dict.fromkeys(f.rule for f in checked.findings if f.verdict == "fail")
    waived = dict.fromkeys(f.rule for f in checked.findings if f.by_user)
    note = f"; must not be built; failed: {', '.join(failed)}" if failed else ""
    return note + (f"; waived: {', '.join(waived)}" if waived else "")


def _write_solid(assembled: Assembled, folder: Path) -> dict[str, Any]:
    """``mesh/assembled.glb``, a node a part, as the manifest lists it."""
    paints = colours(assembled)
    nodes = [
        Node(placed.name, placed_surface(placed), _material(placed), linear(paints[placed.name]))
        for placed in assembled.parts
    ]
    write_scene(nodes, folder / SOLID)
    return {
        "file": SOLID,
        "kind": "assembly",
        "nodes": [
            {
                "name": node.name,
                "volume_mm3": round(node.surface.volume, 6),
                "elements": len(node.surface.faces),
            }
            for node in nodes
        ],
    }


def _material(placed: PlacedPart) -> str:
    if placed.made is not None:
        return placed.made.laminate.bonded_materials
    return str(getattr(placed.part, "material", placed.part.kind))


def _claims(assembled: Assembled) -> dict[str, Any]:
    """What an assembly's manifest says beyond that of a job."""
    return {
        "family": assembled.assembly.family,
        "design_sha256": assembly_sha256(assembled),
        "copies": assembled.assembly.order.copies,
        "parts": [part_entry(placed) for placed in assembled.parts],
    }


def _traveller(
    checked: CheckedAssembly, batch: Batch, sheets: Sequence[SheetFile], picture: bytes
) -> str:
    from sbafab.reports.traveller.assembly_page import AssemblyJob, DesignWork, assembly_html
    from sbafab.reports.traveller.job import Work

    works = []
    for one in batch.designs:
        design, laminate = one.checked.design, one.checked.laminate
        assert one.pressing is not None
        folder = f"{design.name}/"
        work = Work(design, laminate, one.pressing, sheets, order_of(one.checked, folder))
        works.append(DesignWork(work, folder))
    order = checked.assembled.assembly.order
    return assembly_html(
        AssemblyJob(
            assembled=checked.assembled,
            sha256=assembly_sha256(checked.assembled),
            generator=GENERATOR,
            works=works,
            sheets=sheets,
            findings=checked.between,
            waived=checked.waived,
            lowered=batch.settings.lowered,
            picture=picture,
            copies=order.copies,
            made_for=order.made_for,
            note=order.note,
        )
    )
