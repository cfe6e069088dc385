"""``manifest.json``: its records, each built from its subject, and the hashes of files.

A folder that is read may lack a key with a default.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Field, ValidationError

from sbafab.cutting.cut_settings import CutSettings, curves_text, layer_path
from sbafab.cutting.fixture import PATH as FIXTURE
from sbafab.cutting.layer_files import seam_path
from sbafab.cutting.sheets import SheetFile
from sbafab.design.identity import citation, design_sha256
from sbafab.design.records import Design
from sbafab.documents import Document, attribute
from sbafab.errors import OutputError
from sbafab.folders.build import Build, warnings
from sbafab.folders.swap import (
    ASSEMBLY_SCHEMA,
    JOB_SCHEMA,
    MANIFEST,
    MAX_MANIFEST_BYTES,
    SCHEMA,
    read_manifest,
    sound_bytes,
)
from sbafab.laminate.films import Film, Material
from sbafab.laminate.joints import SeamKind, SeamTool
from sbafab.laminate.laminate import InterfaceKind, Laminate, Layer, Role
from sbafab.laminate.lay_up import lay_up_steps
from sbafab.meshing.formats import MeshFile
from sbafab.models.sizes import sizes
from sbafab.pressing.cycles import Runs
from sbafab.version import GENERATOR

MOST_SIZE = 10_000.0
"""mm, of a film sheet."""


def _rounded(digits: int) -> AfterValidator:
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    return AfterValidator(lambda value: round(value, digits) + 0.0)


Six = Annotated[float, _rounded(6)]
Three = Annotated[float, _rounded(3)]
Count = Annotated[int, Field(ge=1, le=10_000_000)]
Copies = Annotated[int, Field(ge=1, le=1000)]
Size = Annotated[float, Field(gt=0, le=MOST_SIZE), _rounded(6)]
Thickness = Annotated[float, Field(gt=0, le=10)]


# The records.


class _Claim(Document):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False, populate_by_name=True)


class LayerClaim(_Claim):
    index: int
    name: str
    material: Material = attribute("film.material")
    role: Role
    balloon: int | None
    thickness: Thickness = attribute("film.thickness")
    z: float
    file: str | None
    pattern: str
    area: Six = attribute("profile.area")
    pieces: int
    bores: tuple[str, ...]


class InterfaceClaim(_Claim):
    below: int = attribute("below.index")
    above: int = attribute("above.index")
    masks: tuple[int, ...]
    kind: InterfaceKind
    contact_area: Six = attribute("contact.area")
    bond_area: Six = attribute("bond.area")


class SeamClaim(_Claim):
    """A seam and the file of its path. ``order`` is its number in the list of seams, ``step`` the
    number of its step in ``press.json``.
    """

    name: str
    file: str | None
    below: int
    above: int
    tool: SeamTool
    kind: SeamKind
    width: float
    length: Six
    order: int
    step: int


class BoreClaim(_Claim):
    chamber: str
    x: Six = attribute("centre.0")
    y: Six = attribute("centre.1")
    diameter: float


class InletClaim(_Claim):
    chamber: str
    x: Six = attribute("mouth.0")
    y: Six = attribute("mouth.1")
    width: float
    tube_outer_diameter: float = attribute("tube_diameter")


class PinClaim(_Claim):
    name: str
    x: Six = attribute("centre.0")
    y: Six = attribute("centre.1")
    diameter: float


class RegistrationClaim(_Claim):
    method: str
    pins: tuple[PinClaim, ...]


class KerfClaim(_Claim):
    state: Literal["uncalibrated", "compensated"]
    width: float | tuple[float, float] | None
    """Full width in mm, or that along x and along y."""


class FilmUseClaim(_Claim):
    """Sheets of a film and their area in mm2; zeros without sheets."""

    material: Material
    sheets: int = 0
    sheet_area: Three = 0.0
    waste: Three = 0.0
    density: Annotated[float, _rounded(4)] = 0.0


class FilmClaim(FilmUseClaim):
    """A design's need of a film, and the sheets it is cut from."""

    product: str
    thickness: Thickness
    layers: int
    area: Six


class SheetPinClaim(_Claim):
    x: float
    y: float
    diameter: float


class SheetPartClaim(_Claim):
    design: str
    pattern: str
    count: Count


class SheetClaim(_Claim):
    """A film sheet; lengths in mm, areas in mm2."""

    file: str = attribute("path")
    picture: str
    project: str
    machine_file: str | None = None
    material: Material
    number: Count
    width: Annotated[float, Field(gt=0, le=MOST_SIZE)]
    length: Size
    border: Annotated[float, Field(ge=0, le=MOST_SIZE)] = attribute("nest.stock.border")
    spacing: Annotated[float, Field(gt=0, le=MOST_SIZE)] = attribute("nest.stock.spacing")
    pins: Annotated[tuple[SheetPinClaim, ...], Field(max_length=100)]
    parts: tuple[SheetPartClaim, ...]
    parts_area: Six
    density: Annotated[float, _rounded(4)]
    label: str
    contours: Count
    cut_length: Three
    travel: Three
    unsorted_travel: Three
    estimated_minutes: Annotated[float, _rounded(2)] = attribute("minutes")


class PlaceClaim(_Claim):
    x: Six
    y: Six


class BatchClaim(_Claim):
    """Press cycles of several copies, and the place of each copy of a cycle on the base plate."""

    at_once: Count
    cycles: Annotated[tuple[Count, ...], Field(max_length=1000)]
    places: Annotated[tuple[PlaceClaim, ...], Field(min_length=1, max_length=1000)]


class KitClaim(_Claim):
    name: str
    version: str
    sha256: str
    departures: tuple[str, ...]


class Manifest(_Claim, schema=SCHEMA):
    """``manifest.json`` of one design's folder."""

    name: str
    family: str
    units: Literal["mm"]
    design_sha256: str
    generator: str
    kit: KitClaim
    registration: RegistrationClaim
    kerf: dict[Material, KerfClaim]
    curves: str | None = None
    waived: tuple[str, ...]
    lowered_limits: tuple[str, ...]
    sizes: dict[str, Six]
    notes: tuple[str, ...]
    copies: Copies
    batch: BatchClaim | None = None
    films: tuple[FilmClaim, ...]
    warnings: tuple[str, ...]
    layers: Annotated[tuple[LayerClaim, ...], Field(min_length=1, max_length=10_000)]
    interfaces: tuple[InterfaceClaim, ...]
    bores: tuple[BoreClaim, ...]
    inlets: tuple[InletClaim, ...]
    lumen: float | None
    fixture: str | None
    sheets: Annotated[tuple[SheetClaim, ...], Field(max_length=2000)] = ()
    meshes: tuple[MeshFile, ...] = ()
    mesh_statistics: dict[str, Any] = Field(default_factory=dict)
    seams: Annotated[tuple[SeamClaim, ...], Field(max_length=200)] = ()
    files: dict[str, str]


class DesignClaim(_Claim):
    name: str
    folder: str
    copies: Copies
    design_sha256: str
    kit: KitClaim


class JobManifest(_Claim, schema=JOB_SCHEMA):
    """``manifest.json`` of several designs that are cut together."""

    name: str
    units: Literal["mm"]
    designs_sha256: str
    generator: str
    waived: tuple[str, ...]
    lowered_limits: tuple[str, ...]
    designs: Annotated[tuple[DesignClaim, ...], Field(min_length=1, max_length=100)]
    films: tuple[FilmUseClaim, ...]
    sheets: Annotated[tuple[SheetClaim, ...], Field(max_length=2000)]
    files: dict[str, str]


class AssemblyManifest(JobManifest, schema=ASSEMBLY_SCHEMA):
    """``manifest.json`` of an assembly: a job's, with the parts and their places."""

    family: str
    design_sha256: str
    copies: int
    parts: Annotated[tuple[dict[str, Any], ...], Field(max_length=1000)]
    meshes: tuple[dict[str, Any], ...]


# Manifests of builds.


def as_json(value: object) -> str:
    """Return the text of a JSON file: readable, and equal for equal values."""
    return json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def manifest(
    build: Build,
    is_cut: bool,
    sheets: Sequence[SheetFile],
    meshes: Sequence[MeshFile],
    statistics: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the manifest of a design's folder, without the hashes of its files.

    ``is_cut``: it has cut files; ``statistics`` describe conforming meshes.
    """
    design, laminate, cycles = build.design, build.laminate, build.cycles
    optional = {
        "curves": curves_text(build.curves) if is_cut else None,
        "batch": None if cycles.copies == 1 else _batch(cycles),
        "seams": _seams(laminate, is_cut) or None,
        "mesh_statistics": statistics,
    }
    return Manifest.of(
        None,
        name=laminate.name,
        family=laminate.family,
        units="mm",
        design_sha256=build.sha256,
        generator=GENERATOR,
        kit=citation(design),
        registration={"method": laminate.registration, "pins": laminate.pins},
        kerf={
            name: {"state": "uncalibrated" if width is None else "compensated", "width": width}
            for name, width in design.kerf_widths.items()
        },
        waived=build.waived,
        lowered_limits=build.lowered,
        sizes=sizes(design, laminate),
        notes=laminate.notes,
        copies=design.order.quantity,
        films=_films(laminate, sheets),
        warnings=tuple(dict.fromkeys(warnings(design).values())),
        layers=[_layer(build, layer, is_cut) for layer in laminate.layers],
        interfaces=[
            InterfaceClaim.read(interface, masks=[mask.index for mask in interface.masks])
            for interface in laminate.interfaces
        ],
        bores=laminate.bores,
        inlets=laminate.inlets,
        lumen=laminate.lumen,
        fixture=FIXTURE if is_cut and laminate.pins else None,
        sheets=[*map(_sheet, sheets)],
        meshes=meshes,
        **{name: value for name, value in optional.items() if value is not None},
        files={},
    )


def job_manifest(
    name: str,
    settings: CutSettings,
    designs: Sequence[Design],
    sheets: Sequence[SheetFile],
    assembly: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the manifest of the folder of several designs, without the hashes of its files.

    ``settings`` belong to the shared ``sheets``; ``assembly`` has the keys that an assembly adds.
    """
    record = JobManifest if assembly is None else AssemblyManifest
    return record.of(
        None,
        name=name,
        units="mm",
        designs_sha256=settings.design_sha256,
        generator=GENERATOR,
        waived=settings.waived,
        lowered_limits=settings.lowered,
        designs=[
            {
                "name": design.name,
                "folder": design.name,
                "copies": design.order.quantity,
                "design_sha256": design_sha256(design),
                "kit": citation(design),
            }
            for design in designs
        ],
        films=[{"material": material, **use} for material, use in _film_use(sheets).items()],
        sheets=[*map(_sheet, sheets)],
        files={},
        **(assembly or {}),
    )


def _batch(runs: Runs) -> dict[str, Any]:
    """Return press cycles and places of several copies."""
    places = [{"x": x, "y": y} for x, y in runs.places]
    return {"at_once": runs.together, "cycles": runs.cycles, "places": places}


def _sheet(sheet: SheetFile) -> dict[str, Any]:
    """Return a film sheet as the manifest lists it."""
    keys = SheetClaim.of(
        sheet,
        pins=[{"x": x, "y": y, "diameter": d} for x, y, d in sheet.nest.stock.pins],
        parts=[
            {"design": design, "pattern": pattern, "count": count}
            for design, pattern, count in sheet.counts
        ],
    )
    return {key: value for key, value in keys.items() if value is not None}


def _film_use(sheets: Sequence[SheetFile]) -> dict[Material, dict[str, float]]:
    """Return number and area of sheets, share of the parts and waste in mm2, by material."""
    use: dict[Material, dict[str, float]] = {}
    for material in dict.fromkeys(sheet.material for sheet in sheets):
        of_material = [sheet for sheet in sheets if sheet.material == material]
        area = sum(sheet.width * sheet.length for sheet in of_material)
        parts = sum(sheet.parts_area for sheet in of_material)
        use[material] = {"sheets": len(of_material), "sheet_area": area}
        use[material] |= {"waste": area - parts, "density": parts / area}
    return use


def _films(laminate: Laminate, sheets: Sequence[SheetFile]) -> list[dict[str, Any]]:
    use = _film_use(sheets)
    layers: dict[Film, list[Layer]] = {}
    for layer in laminate.layers:
        layers.setdefault(layer.film, []).append(layer)
    return [
        {
            "material": film.material,
            "product": film.product,
            "thickness": film.thickness,
            "layers": len(stack),
            "area": sum(layer.profile.area for layer in stack),
            **use.get(film.material, {}),
        }
        for film, stack in layers.items()
    ]


def _layer(build: Build, layer: Layer, is_cut: bool) -> LayerClaim:
    kerf, laminate = build.settings.kerf_width(layer.film.material), build.laminate
    cut, holes = laminate.layer(laminate.cut_with(layer)), layer.profile.holes
    open_bores = (b for b in laminate.bores if any(hole.winding(b.centre) for hole in holes))
    return LayerClaim.read(
        layer,
        file=layer_path(cut.name, kerf) if is_cut else None,
        pieces=len(layer.profile.pieces),
        bores=[bore.chamber for bore in open_bores],
    )


def _seams(laminate: Laminate, is_cut: bool) -> list[SeamClaim]:
    steps = [(step.joining.seam, step.number) for step in lay_up_steps(laminate) if step.joining]
    return [
        SeamClaim.read(seam, file=seam_path(seam) if is_cut else None, step=number)
        for seam, number in steps
        if seam is not None
    ]


def file_hashes(folder: Path) -> dict[str, str]:
    """Return the sha256 of every file of a folder, by relative path."""
    return {name: file_hash(folder / name) for name in file_names(folder)}


def file_names(folder: Path) -> list[str]:
    """Return the relative paths of all files of a folder."""
    paths = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return [path.relative_to(folder).as_posix() for path in paths]


def file_hash(path: Path) -> str:
    """Return the sha256 of a file's contents."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def identity(build: Build) -> dict[str, Any]:
    """Return the manifest's keys that identify the design and version of its files."""
    return {"design_sha256": build.sha256, "generator": GENERATOR, "waived": list(build.waived)}


def carried_over(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """Return True if files of the old run belong to the new run's design and version."""
    return all(old.get(key) == new.get(key) for key in ("design_sha256", "generator", "waived"))


# Manifests of folders read.


RECORDS = {record.SCHEMA: record for record in (Manifest, JobManifest, AssemblyManifest)}


def is_job(folder: Path) -> bool:
    """Return True if a folder holds several designs, of a job or an assembly."""
    return (read_manifest(folder) or {}).get("schema") in (JOB_SCHEMA, ASSEMBLY_SCHEMA)


def read_design_index(folder: Path) -> Manifest:
    """Return the manifest of a design's folder. Raises OutputError like ``read_index``."""
    index = read_index(folder)
    if isinstance(index, Manifest):
        return index
    raise OutputError(f"{folder} is not the folder of one design; regenerate its parent folder")


def read_index(folder: Path) -> Manifest | JobManifest:
    """Return the manifest of an output folder. Raises OutputError if it is missing or invalid."""
    path = folder / MANIFEST
    if not os.path.lexists(path):
        raise OutputError(
            f"{folder} has no manifest.json; give a folder written by sbafab generate"
        )
    try:
        data = sound_bytes(path, MAX_MANIFEST_BYTES)
    except OutputError as error:
        raise OutputError(f"{path}: {error}") from None
    schema = (read_manifest(folder) or {}).get("schema")
    try:
        if schema is not None:
            return RECORDS[str(schema)].model_validate_json(data)
        fault = "it is not JSON of this schema"
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = "".join(f"{part}." for part in first["loc"])
        fault = f"{where[:-1]}: {first['msg'][:1].lower()}{first['msg'][1:]}"
    raise OutputError(
        f"{path} is not a valid {schema or SCHEMA}: {fault}; regenerate the folder with sbafab "
        "generate"
    )
