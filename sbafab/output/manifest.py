"""``manifest.json`` and ``checks.json``: what a program reads of an output folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sbafab.cutting.sheets import SheetFile
from sbafab.design.kits import citation
from sbafab.design.records import Design
from sbafab.design.writing import design_sha256
from sbafab.laminate.interfaces import Interface
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.meshing.files import MeshFile
from sbafab.models.sizes import sizes
from sbafab.output.settings import GENERATOR, kerf_widths, limits, warnings
from sbafab.output.shop import CutSet, film_use
from sbafab.output.swap import SCHEMA
from sbafab.pressing.together import design_runs
from sbafab.rules.finding import Finding
from sbafab.rules.lowered import lowered


def as_json(value: object) -> str:
    """Text of a JSON file: readable, and the same for the same value."""
    return json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def checks(
    findings: Sequence[Finding], source: str, designs: Sequence[Design] = ()
) -> dict[str, Any]:
    """``checks.json``; ``source`` is "design" or "as-built", ``designs`` are what was checked."""
    return {
        "source": source,
        "kits": [{"design": design.name, **citation(design)} for design in designs],
        "findings": [finding.as_dict() for finding in findings],
    }


def manifest(
    design: Design,
    laminate: Laminate,
    waived: Sequence[str],
    cut: CutSet | None,
    sheets: Sequence[SheetFile],
    meshes: Sequence[MeshFile],
) -> dict[str, Any]:
    """The index of an output folder, but for the hashes of its files."""
    paths = {file.layer: file.path for file in cut.files} if cut else {}
    return {
        "schema": SCHEMA,
        "name": laminate.name,
        "family": laminate.family,
        "units": "mm",
        "design_sha256": design_sha256(design),
        "generator": GENERATOR,
        "kit": citation(design),
        "registration": {
            "method": laminate.registration,
            "pins": [
                {"name": pin.name, **_place(pin.centre), "diameter": pin.diameter}
                for pin in laminate.pins
            ],
        },
        "kerf": {
            material: {"state": "uncalibrated" if width is None else "compensated", "width": width}
            for material, width in kerf_widths(design).items()
        },
        **({"curves": cut.curves} if cut and cut.curves else {}),
        "waived": list(waived),
        "lowered_limits": list(lowered(limits(design))),
        "sizes": {name: round(value, 6) for name, value in sizes(design, laminate).items()},
        "notes": list(laminate.notes),
        "copies": design.order.copies,
        **_batch(design, laminate),
        "films": _films(laminate, sheets),
        "warnings": list(dict.fromkeys(warnings(design).values())),
        "layers": [_layer(laminate, layer, paths.get(layer.index)) for layer in laminate.layers],
        "interfaces": [_interface(interface) for interface in laminate.interfaces],
        "bores": [
            {"chamber": bore.chamber, **_place(bore.centre), "diameter": bore.diameter}
            for bore in laminate.bores
        ],
        "inlets": [
            {
                "chamber": inlet.chamber,
                **_place(inlet.mouth),
                "width": inlet.width,
                "tube_outer_diameter": inlet.tube_diameter,
            }
            for inlet in laminate.inlets
        ],
        "lumen": laminate.lumen,
        "fixture": cut.fixture if cut else None,
        "sheets": [sheet_entry(sheet) for sheet in sheets],
        "meshes": [
            {
                "file": mesh.file,
                "kind": mesh.kind,
                "chamber": mesh.chamber,
                "fill_ul": mesh.fill_ul,
                "volume_mm3": round(mesh.volume_mm3, 6),
                "elements": mesh.elements,
            }
            for mesh in meshes
        ],
    }


def _batch(design: Design, laminate: Laminate) -> dict[str, Any]:
    """How several copies are pressed, and where each lies on the pin plate."""
    runs = design_runs(design, laminate)
    if runs.copies == 1:
        return {}
    places = [_place(place) for place in runs.places]
    return {"batch": {"at_once": runs.together, "cycles": list(runs.cycles), "places": places}}


def _place(point: tuple[float, float]) -> dict[str, float]:
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    return {"x": round(point[0], 6) + 0.0, "y": round(point[1], 6) + 0.0}


def sheet_entry(sheet: SheetFile) -> dict[str, Any]:
    """A film sheet as the manifest lists it; lengths mm, areas mm2."""
    stock = sheet.nest.stock
    return {
        "file": sheet.path,
        "picture": sheet.picture,
        "material": sheet.material,
        "number": sheet.number,
        "width": sheet.width,
        "length": round(sheet.length, 6),
        "border": stock.border,
        "spacing": stock.spacing,
        "pins": [{"x": x, "y": y, "diameter": d} for x, y, d in stock.pins],
        "engine": sheet.nest.engine,
        "parts": [
            {"design": design, "pattern": pattern, "count": count}
            for design, pattern, count in sheet.counts
        ],
        "parts_area": round(sheet.parts_area, 6),
        "density": round(sheet.density, 4),
        "label": sheet.label,
        "contours": sheet.contours,
        "cut_length": round(sheet.cut_length, 3),
        "travel": round(sheet.travel, 3),
        "unsorted_travel": round(sheet.unsorted_travel, 3),
        "estimated_minutes": round(sheet.minutes, 2),
    }


def _films(laminate: Laminate, sheets: Sequence[SheetFile]) -> list[dict[str, Any]]:
    use = film_use(sheets)
    used: dict[str, dict[str, Any]] = {}
    for layer in laminate.layers:
        film = layer.film
        entry = used.setdefault(
            film.material,
            {
                "material": film.material,
                "product": film.product,
                "thickness": film.thickness,
                "layers": 0,
                "area": 0.0,
            },
        )
        entry["layers"] += 1
        entry["area"] += layer.profile.area
    return [
        {**entry, "area": round(entry["area"], 6), **use.get(material, {})}
        for material, entry in used.items()
    ]


def _layer(laminate: Laminate, layer: Layer, path: str | None) -> dict[str, Any]:
    return {
        "index": layer.index,
        "name": layer.name,
        "material": layer.film.material,
        "role": layer.role,
        "balloon": layer.balloon,
        "thickness": layer.film.thickness,
        "z": layer.z,
        "file": path,
        "pattern": layer.pattern,
        "area": round(layer.profile.area, 6),
        "pieces": len(layer.profile.pieces),
        "bores": [bore.chamber for bore in laminate.bores if _is_open(layer, bore.centre)],
    }


def _is_open(layer: Layer, place: tuple[float, float]) -> bool:
    return any(hole.winding(place) != 0 for hole in layer.profile.holes)


def _interface(interface: Interface) -> dict[str, Any]:
    return {
        "below": interface.below.index,
        "above": interface.above.index,
        "masks": [mask.index for mask in interface.masks],
        "kind": interface.kind,
        "contact_area": round(interface.contact.area, 6),
        "bond_area": round(interface.bond.area, 6),
    }


def file_hashes(folder: Path) -> dict[str, str]:
    """sha256 of every file of a folder, by relative path."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def identity(design: Design, waived: Sequence[str]) -> dict[str, Any]:
    """What a manifest says of the design and version that its files are of."""
    sha256 = design_sha256(design)
    return {"design_sha256": sha256, "generator": GENERATOR, "waived": list(waived)}


def carried_over(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """Whether files of the old run still belong to the new one's design and version."""
    return all(old.get(key) == new.get(key) for key in ("design_sha256", "generator", "waived"))
