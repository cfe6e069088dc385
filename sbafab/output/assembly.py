"""An assembly: its designs cut together, one traveller, and the whole put together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sbafab.assemblies.build import Assembled, PlacedPart, assemble
from sbafab.assemblies.checks import lowered_checks, run_checks
from sbafab.assemblies.colours import colours, linear
from sbafab.assemblies.reading import load_assembly
from sbafab.assemblies.records import Assembly
from sbafab.assemblies.shapes import placed_surface
from sbafab.assemblies.writing import DESIGN_FILE, assembly_sha256, assembly_toml, part_entry
from sbafab.cutting.dxf_write import DxfProfile
from sbafab.design.kits import citation
from sbafab.design.writing import design_sha256
from sbafab.errors import DesignError
from sbafab.geometry.boolean import GeometryError
from sbafab.meshing.write_glb import Node, write_scene
from sbafab.output.batch import (
    Batch,
    Drawing,
    Written,
    batch_manifest,
    plan_batch,
    refuse_unlike,
    write_batch,
)
from sbafab.output.contents import (
    TRAVELLER,
    Checked,
    Made,
    Part,
    close_folder,
    write_contents,
    write_text,
)
from sbafab.output.earlier import removed_files, would_replace
from sbafab.output.manifest import as_json, checks
from sbafab.output.self_check import refuse_batch
from sbafab.output.settings import GENERATOR, kerf_widths, limits
from sbafab.output.shop import Progress
from sbafab.output.swap import ASSEMBLY_SCHEMA, listed_files, replaced_folder
from sbafab.rules.deck import has_failed, run_deck
from sbafab.rules.finding import Finding

PARTS: tuple[Part, ...] = ("press", "mesh", "preview")
UNCUT: tuple[Part, ...] = ("preview",)
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
        named = (finding for one in self.designs for finding in _named(one))
        return (*named, *self.between)

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


def _named(one: Checked) -> list[Finding]:
    return [replace(f, message=f"{one.design.name}: {f.message}") for f in one.findings]


@dataclass(frozen=True)
class AssemblyRun:
    """What was made of an assembly; without cut files if something ``failed``."""

    checked: CheckedAssembly
    folder: Path
    manifest: dict[str, Any]
    dropped: tuple[str, ...] = ()
    """Files of an earlier run in the folder that this one removed."""
    kept: bool = False
    """Whether something failed and ``folder`` was left to an earlier run that is worth more."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        return self.checked.findings

    @property
    def failed(self) -> bool:
        return self.checked.failed


def check_assembly(assembly: Assembly, progress: Progress | None = None) -> CheckedAssembly:
    """The assembly put together, the rule deck on each design, the checks between parts."""
    tell = progress or (lambda what, done, total: None)
    assembled = assemble(assembly)
    designs = [made.design for made in assembled.designs]
    refuse_unlike(designs)
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
    dxf_profile: DxfProfile = "bulges",
    chord_error: float = 0.005,
) -> AssemblyRun:
    """Writes ``out/<name>/``: a folder for each design, shared film sheets, one traveller.

    Where a rule or a check between parts fails, findings and pictures are written, and nothing
    to cut; an earlier run with more than that stays as it is (``AssemblyRun.kept``). Raises
    DesignError or OutputError; the old folder is then whole.
    """
    tell = progress or (lambda what, done, total: None)
    checked = check_assembly(assembly, tell)
    target = out / assembly.name
    batch = None
    if checked.failed and would_replace(target, None):
        return AssemblyRun(checked, target, {}, kept=True)
    if not checked.failed:
        drawing = Drawing(dxf_profile, chord_error)
        batch = plan_batch(
            checked.designs,
            assembly.name,
            target,
            drawing,
            tell,
            waived=checked.waived,
            lowered=checked.lowered,
        )
    listed = listed_files(target)
    with replaced_folder(target) as folder:
        written = None
        if batch is not None:
            written = write_batch(batch, folder, PARTS, False, tell)
        else:
            _write_uncut(checked, folder, tell)
        index = write_whole(checked, batch, written, folder, tell)
        close_folder(folder, index)
        if batch is not None:
            refuse_batch(batch, folder, tell)
    return AssemblyRun(checked, target, index, removed_files(listed, index))


def _write_uncut(checked: CheckedAssembly, folder: Path, tell: Progress) -> None:
    """What is left of designs that are not to be cut: findings, pictures, the design."""
    for one in checked.designs:
        own = folder / one.design.name
        own.mkdir()
        close_folder(own, write_contents(one, UNCUT, Made(), own, tell))


def write_whole(
    checked: CheckedAssembly,
    batch: Batch | None,
    written: Written | None,
    folder: Path,
    tell: Progress,
) -> dict[str, Any]:
    """Writes what is the assembly's own; its manifest, without the files' hashes."""
    from sbafab.reports.assembly_png import assembly_pngs

    assembled = checked.assembled
    tell("assembled", 0, 1)
    (folder / "preview").mkdir()
    picture, bare = assembly_pngs(assembled, _note(checked))
    (folder / PICTURE).write_bytes(picture)
    index = _manifest(checked, batch, written)
    if batch is not None and written is not None:
        (folder / "mesh").mkdir()
        index["meshes"] = [_write_solid(assembled, folder)]
        write_text(folder / TRAVELLER, _traveller(checked, batch, written, bare))
    designs = [one.design for one in checked.designs]
    write_text(folder / "checks.json", as_json(checks(checked.findings, "design", designs)))
    write_text(folder / DESIGN_FILE, assembly_toml(assembled))
    return index


def _note(checked: CheckedAssembly) -> str:
    failed = dict.fromkeys(f.rule for f in checked.findings if f.verdict == "fail")
    waived = dict.fromkeys(f.rule for f in checked.findings if f.by_user)
    note = f"; not to be built, failed: {', '.join(failed)}" if failed else ""
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


def _manifest(
    checked: CheckedAssembly, batch: Batch | None, written: Written | None
) -> dict[str, Any]:
    assembled = checked.assembled
    assembly = assembled.assembly
    if batch is not None and written is not None:
        index = batch_manifest(
            ASSEMBLY_SCHEMA, assembly.name, checked.designs, batch, written.sheets
        )
    else:
        index = _uncut_manifest(assembly.name, checked.designs)
    return {
        **index,
        "family": assembly.family,
        "design_sha256": assembly_sha256(assembled),
        "copies": assembly.order.copies,
        "parts": [part_entry(placed) for placed in assembled.parts],
        "meshes": [],
    }


def _uncut_manifest(name: str, designs: Sequence[Checked]) -> dict[str, Any]:
    return {
        "schema": ASSEMBLY_SCHEMA,
        "name": name,
        "units": "mm",
        "generator": GENERATOR,
        "waived": [],
        "lowered_limits": [],
        "designs": [
            {
                "name": one.design.name,
                "folder": one.design.name,
                "copies": one.design.order.copies,
                "design_sha256": design_sha256(one.design),
                "kit": citation(one.design),
            }
            for one in designs
        ],
        "films": [],
        "sheets": [],
    }


def _traveller(checked: CheckedAssembly, batch: Batch, written: Written, picture: bytes) -> str:
    from sbafab.reports.traveller.assembly_page import AssemblyJob, DesignWork, assembly_html
    from sbafab.reports.traveller.job import Job, Work

    works = []
    for one, planned, cut in zip(checked.designs, batch.designs, written.cut, strict=True):
        name = one.design.name
        job = Job(
            design_sha256=design_sha256(one.design),
            generator=GENERATOR,
            waived=one.waived,
            lowered=one.lowered,
            findings=one.findings,
            fixture=cut.fixture and f"{name}/{cut.fixture}",
            kerf=kerf_widths(one.design),
            copies=one.design.order.copies,
        )
        work = Work(one.design, one.laminate, planned.pressing, written.sheets, job)
        works.append(DesignWork(work, f"{name}/"))
    order = checked.assembled.assembly.order
    return assembly_html(
        AssemblyJob(
            assembled=checked.assembled,
            sha256=assembly_sha256(checked.assembled),
            generator=GENERATOR,
            works=works,
            sheets=written.sheets,
            findings=checked.between,
            waived=checked.waived,
            lowered=batch.settings.lowered,
            picture=picture,
            copies=order.copies,
            made_for=order.made_for,
            note=order.note,
        )
    )
