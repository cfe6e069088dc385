"""A planned folder written: film sheets, each design's artefacts, the whole of an assembly."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sbafab import plugins
from sbafab.assemblies.build import Assembled, PlacedPart
from sbafab.assemblies.files import DESIGN_FILE, assembly_sha256, assembly_toml, part_entry
from sbafab.assemblies.records import Cup
from sbafab.assemblies.shapes import colours, cup_mould, linear, placed_surface
from sbafab.cutting.placements import Nest
from sbafab.cutting.sheets import SheetFile
from sbafab.errors import DefectError
from sbafab.folders.artefacts import (
    BENCH,
    FINDINGS,
    TRAVELLER,
    Artefact,
    DesignFolder,
    RunPart,
    work_of,
    write_artefacts,
    write_nested_sheets,
    write_text,
)
from sbafab.folders.checks_json import checks
from sbafab.folders.manifest import as_json, file_hashes, job_manifest, manifest
from sbafab.folders.order import Order
from sbafab.folders.swap import SCHEMA
from sbafab.meshing.formats import Node, write_scene, write_stl
from sbafab.runtime import Progress

SOLID = "mesh/assembled.glb"
PICTURE = "preview/assembled.png"


def write_folder(
    order: Order,
    wanted: Collection[RunPart],
    nests: Sequence[Nest],
    path: Path,
    progress: Progress,
    **extras: Any,
) -> tuple[dict[str, Any], dict[str, str], tuple[tuple[str, str], ...]]:
    """Write film sheets and designs; several designs get a folder each, named after it.

    ``extras`` are fields of the ``DesignFolder`` of a single design. Return the manifest without
    its files' hashes; the sha256 of each cut file that was read back; and the meshes and inputs of
    simulators that could not be, with the reason.
    """
    parts, first = frozenset(wanted), order.builds[0]
    sheets = write_nested_sheets(nests, first.design, path, order.settings, progress)
    verified = {sheet.path: sheet.sha256 for sheet in sheets}
    if order.schema == SCHEMA:
        folder = DesignFolder(first, parts, sheets, path, progress, **extras)
        index = write_design(folder)
        return index, verified | folder.verified, tuple(folder.left_out)
    from_below = _from_below(sheets)
    left_out: list[tuple[str, str]] = []
    for build in order.builds:
        subfolder = path / build.design.name
        subfolder.mkdir()
        # An assembly has one page for all designs.
        has_pages = order.assembled is None
        folder = DesignFolder(build, parts, from_below, subfolder, progress, has_pages)
        # Sheets are stored in the parent folder only.
        close_folder(subfolder, {**write_design(folder), "sheets": []})
        verified |= {f"{subfolder.name}/{name}": file for name, file in folder.verified.items()}
        left_out += [(f"{subfolder.name}/{name}", reason) for name, reason in folder.left_out]
    designs = [build.design for build in order.builds]
    more = None
    if order.assembled is not None:
        more = _write_assembly(order, order.assembled, sheets, path, progress)
    index = job_manifest(order.name, order.settings, designs, sheets, more)
    return index, verified, tuple(left_out)


def write_design(
    folder: DesignFolder, artefacts: Iterable[Artefact] | None = None
) -> dict[str, Any]:
    """Write a design's artefacts; return its manifest, without the files' hashes."""
    write_artefacts(folder, artefacts)
    is_cut, conforming = "cut" in folder.wanted, folder.conforming
    statistics = None if conforming is None else conforming.statistics
    return manifest(folder.build, is_cut, folder.sheets, folder.meshes, statistics)


def close_folder(
    folder: Path, index: dict[str, Any], verified: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Write the manifest, with the hashes of all files in the folder.

    Raises DefectError if a ``verified`` file is not as it was when it was read back.
    """
    index.pop("files", None)
    index["files"] = file_hashes(folder)
    changed = [path for path, digest in verified.items() if index["files"].get(path) != digest]
    if changed:
        raise DefectError(
            f"{changed[0]} was changed after it had been verified; this is a defect of sbafab and "
            "nothing was written: please report this sentence with the design file"
        )
    write_text(folder / "manifest.json", as_json(index))


def _from_below(sheets: Sequence[SheetFile]) -> list[SheetFile]:
    """Return the shared sheets as a design's own folder names them."""
    return [
        replace(
            sheet,
            path=f"../{sheet.path}",
            picture=f"../{sheet.picture}",
            project=f"../{sheet.project}",
            machine_file=sheet.machine_file and f"../{sheet.machine_file}",
        )
        for sheet in sheets
    ]


# The whole of an assembly: picture, solid, pages, design.


def _write_assembly(
    order: Order,
    assembled: Assembled,
    sheets: Sequence[SheetFile],
    path: Path,
    progress: Progress,
) -> dict[str, Any]:
    """Write what an assembly's folder holds beside its designs; return the keys that its manifest
    has beside a job's.
    """
    progress("assembled", 0, 1)
    (path / "preview").mkdir()
    draw = plugins.load("sbafab.reports.solid_pictures:assembly_pngs")
    picture, bare = draw(assembled, _note(order))
    (path / PICTURE).write_bytes(picture)
    meshes = []
    if sheets:
        (path / "mesh").mkdir()
        meshes.append(_write_solid(assembled, path))
        _write_moulds(assembled, path)
        traveller, bench = _bench_pages(order, assembled, sheets, bare)
        write_text(path / TRAVELLER, traveller)
        write_text(path / BENCH, bench)
    sha256 = assembly_sha256(assembled)
    findings_html = plugins.load("sbafab.reports.traveller.findings:findings_html")
    page = findings_html(order.name, sha256, order.builds, order.between or ())
    write_text(path / FINDINGS, page)
    designs = [build.design for build in order.builds]
    document = checks(order.findings, "design", order.name, designs)
    write_text(path / "checks.json", as_json(document))
    write_text(path / DESIGN_FILE, assembly_toml(assembled))
    return {
        "family": assembled.assembly.family,
        "design_sha256": sha256,
        "copies": assembled.assembly.order.copies,
        "parts": [part_entry(placed) for placed in assembled.parts],
        "meshes": meshes,
    }


def _note(order: Order) -> str:
    failed = dict.fromkeys(f.rule for f in order.findings if f.verdict == "fail")
    waived = dict.fromkeys(f.rule for f in order.findings if f.by_user)
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


def _write_moulds(assembled: Assembled, folder: Path) -> None:
    """Write both halves of the mould of every cast part, to be printed."""
    for placed in assembled.parts:
        if isinstance(placed.part, Cup):
            for half, surface in zip(("lower", "upper"), cup_mould(placed.part), strict=True):
                write_stl(surface, folder / f"mesh/mould_{placed.name}_{half}.stl")


def _material(placed: PlacedPart) -> str:
    if placed.made is not None:
        return placed.made.laminate.bonded_materials
    return str(getattr(placed.part, "material", placed.part.kind))


def _bench_pages(
    order: Order, assembled: Assembled, sheets: Sequence[SheetFile], picture: bytes
) -> tuple[str, str]:
    """Return the traveller and the page of the bench."""
    bench_html = plugins.load("sbafab.reports.traveller.bench:bench_html")
    page = "sbafab.reports.traveller.assembly_page"
    works = [work_of(build, sheets, f"{build.design.name}/") for build in order.builds]
    sha256 = assembly_sha256(assembled)
    between, lowered = order.between or (), order.settings.lowered
    work = plugins.load(f"{page}:AssemblyWork")(
        assembled, sha256, works, sheets, between, order.waived, lowered, picture
    )
    traveller = plugins.load(f"{page}:assembly_html")(work)
    return traveller, bench_html(assembled.assembly.name, sha256, works, assembled)
