"""``manifest.json``: the records that it is written from and read with, and the hashes of files.

A key with a default may be missing in a folder that is read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sbafab.cutting.fixture import PATH as FIXTURE
from sbafab.cutting.properties import CutSettings, layer_path, said_of
from sbafab.cutting.seam_files import seam_path
from sbafab.cutting.sheets import SheetFile
from sbafab.design.identity import citation, design_sha256
from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.folders.build import Build, warnings
from sbafab.folders.order import ASSEMBLY_SCHEMA, JOB_SCHEMA, SCHEMA, BatchSchema
from sbafab.folders.swap import read_manifest
from sbafab.geometry.offset import Kerf
from sbafab.laminate.films import Film, Material
from sbafab.laminate.joints import SeamKind, SeamTool
from sbafab.laminate.laminate import Interface, InterfaceKind, Laminate, Layer, Role
from sbafab.laminate.lay_up import lay_up_steps
from sbafab.meshing.mesh_files import MeshFile
from sbafab.models.formulas import sizes
from sbafab.pressing.cycles import Runs
from sbafab.version import GENERATOR

MOST_SIZE = 10_000.0
"""mm, of a film sheet."""
Count = Annotated[int, Field(ge=1, le=10_000_000)]
Size = Annotated[float, Field(gt=0, le=MOST_SIZE)]
Thickness = Annotated[float, Field(gt=0, le=10)]


# The records.


class _Claim(BaseModel):
    model_config = ConfigDict(
        extra="ignore", frozen=True, strict=True, allow_inf_nan=False, defer_build=True
    )

    def as_dict(self) -> dict[str, Any]:
        """Return the keys of the file in the order of the fields, without unset ones."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)


class LayerClaim(_Claim):
    index: int
    name: str
    material: Material
    role: Role
    balloon: int | None
    thickness: Thickness
    z: float
    file: str | None
    pattern: str
    area: float
    pieces: int
    bores: tuple[str, ...]


class InterfaceClaim(_Claim):
    below: int
    above: int
    masks: tuple[int, ...]
    kind: InterfaceKind
    contact_area: float
    bond_area: float


class SeamClaim(_Claim):
    """A seam and the file of its path; ``order`` is that in which the seams are listed, ``step``
    the number of its step in ``press.json``.
    """

    name: str
    file: str | None
    below: int
    above: int
    tool: SeamTool
    kind: SeamKind
    width: float
    length: float
    order: int
    step: int


class BoreClaim(_Claim):
    chamber: str
    x: float
    y: float
    diameter: float


class InletClaim(_Claim):
    chamber: str
    x: float
    y: float
    width: float
    tube_outer_diameter: float


class PinClaim(_Claim):
    name: str
    x: float
    y: float
    diameter: float


class RegistrationClaim(_Claim):
    method: str
    pins: tuple[PinClaim, ...]


class KerfClaim(_Claim):
    state: Literal["uncalibrated", "compensated"]
    width: float | tuple[float, float] | None
    """Full width in mm, or that along x and along y."""


class _OfFilm(_Claim):
    material: Material


class _FilmNeed(_OfFilm):
    product: str
    thickness: Thickness
    layers: int
    area: float


class FilmUseClaim(_OfFilm):
    """Sheets of a film and their area in mm2; zeros without sheets."""

    sheets: int = 0
    sheet_area: float = 0.0
    waste: float = 0.0
    density: float = 0.0


class FilmClaim(FilmUseClaim, _FilmNeed):
    """A design's need of a film and the sheets it is cut from; keys in this order."""


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

    file: str
    picture: str
    project: str
    machine_file: str | None = None
    material: Material
    number: Count
    width: Size
    length: Size
    border: Annotated[float, Field(ge=0, le=MOST_SIZE)]
    spacing: Annotated[float, Field(gt=0, le=MOST_SIZE)]
    pins: Annotated[tuple[SheetPinClaim, ...], Field(max_length=100)]
    parts: tuple[SheetPartClaim, ...]
    parts_area: float
    density: float
    label: str
    contours: Count
    cut_length: float
    travel: float
    unsorted_travel: float
    estimated_minutes: float


class MeshClaim(_Claim):
    file: str
    kind: str
    chamber: str | None
    fill_ul: float
    volume_mm3: float
    elements: int


class PlaceClaim(_Claim):
    x: float
    y: float


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


class Manifest(_Claim):
    """``manifest.json`` of one design's folder."""

    schema_name: Literal["sbafab/manifest@1"] = Field(alias="schema")
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
    sizes: dict[str, float]
    notes: tuple[str, ...]
    copies: Annotated[int, Field(ge=1, le=1000)]
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
    meshes: tuple[MeshClaim, ...] = ()
    mesh_statistics: dict[str, Any] = Field(default_factory=dict)
    seams: Annotated[tuple[SeamClaim, ...], Field(max_length=200)] = ()
    files: dict[str, str]


class DesignClaim(_Claim):
    name: str
    folder: str
    copies: Annotated[int, Field(ge=1, le=1000)]
    design_sha256: str
    kit: KitClaim


class JobManifest(_Claim):
    """``manifest.json`` of several designs cut together."""

    schema_name: BatchSchema = Field(alias="schema")
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


class AssemblyManifest(JobManifest):
    """``manifest.json`` of an assembly: a job's, with the parts and their places."""

    family: str
    design_sha256: str
    copies: int
    parts: Annotated[tuple[dict[str, Any], ...], Field(max_length=1000)]
    meshes: tuple[dict[str, Any], ...]


# Manifests of plans.


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
    design, laminate = build.design, build.laminate
    curves = said_of(build.curves) if is_cut else None
    optional: dict[str, Any] = {}
    if curves is not None:
        optional["curves"] = curves
    if build.cycles.copies > 1:
        optional["batch"] = _batch(build.cycles)
    if laminate.seams:
        optional["seams"] = _seams(laminate, is_cut)
    if statistics is not None:
        optional["mesh_statistics"] = statistics
    return Manifest(
        schema=SCHEMA,
        name=laminate.name,
        family=laminate.family,
        units="mm",
        design_sha256=build.sha256,
        generator=GENERATOR,
        kit=KitClaim.model_validate_json(as_json(citation(design))),
        registration=RegistrationClaim(
            method=laminate.registration,
            pins=tuple(
                PinClaim(name=pin.name, **_place(pin.centre), diameter=pin.diameter)
                for pin in laminate.pins
            ),
        ),
        kerf={name: kerf_claim(width) for name, width in design.kerf_widths.items()},
        waived=build.waived,
        lowered_limits=build.lowered,
        sizes={name: round(value, 6) for name, value in sizes(design, laminate).items()},
        notes=laminate.notes,
        copies=design.order.quantity,
        films=_films(laminate, sheets),
        warnings=tuple(dict.fromkeys(warnings(design).values())),
        layers=tuple(_layer(build, layer, is_cut) for layer in laminate.layers),
        interfaces=tuple(_interface(interface) for interface in laminate.interfaces),
        bores=tuple(
            BoreClaim(chamber=bore.chamber, **_place(bore.centre), diameter=bore.diameter)
            for bore in laminate.bores
        ),
        inlets=tuple(
            InletClaim(
                chamber=inlet.chamber,
                **_place(inlet.mouth),
                width=inlet.width,
                tube_outer_diameter=inlet.tube_diameter,
            )
            for inlet in laminate.inlets
        ),
        lumen=laminate.lumen,
        fixture=FIXTURE if is_cut and laminate.pins else None,
        sheets=tuple(_sheet(sheet) for sheet in sheets),
        meshes=tuple(
            MeshClaim(**{**asdict(mesh), "volume_mm3": round(mesh.volume_mm3, 6)})
            for mesh in meshes
        ),
        **optional,
        files={},
    ).as_dict()


def job_manifest(
    schema: BatchSchema,
    name: str,
    settings: CutSettings,
    designs: Sequence[Design],
    sheets: Sequence[SheetFile],
) -> dict[str, Any]:
    """Return the manifest of the folder of several designs, without the hashes of its files.

    ``settings`` belong to the shared ``sheets``.
    """
    return JobManifest(
        schema=schema,
        name=name,
        units="mm",
        designs_sha256=settings.design_sha256,
        generator=GENERATOR,
        waived=settings.waived,
        lowered_limits=settings.lowered,
        designs=tuple(
            DesignClaim(
                name=design.name,
                folder=design.name,
                copies=design.order.quantity,
                design_sha256=design_sha256(design),
                kit=KitClaim.model_validate_json(as_json(citation(design))),
            )
            for design in designs
        ),
        films=tuple(
            FilmUseClaim(material=material, **use) for material, use in _film_use(sheets).items()
        ),
        sheets=tuple(_sheet(sheet) for sheet in sheets),
        files={},
    ).as_dict()


def kerf_claim(width: Kerf | None) -> KerfClaim:
    return KerfClaim(state="uncalibrated" if width is None else "compensated", width=width)


def _batch(runs: Runs) -> BatchClaim:
    """Return press cycles and places of several copies."""
    places = tuple(PlaceClaim(**_place(place)) for place in runs.places)
    return BatchClaim(at_once=runs.together, cycles=runs.cycles, places=places)


def _place(point: tuple[float, float]) -> dict[str, float]:
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    return {"x": round(point[0], 6) + 0.0, "y": round(point[1], 6) + 0.0}


def _sheet(sheet: SheetFile) -> SheetClaim:
    """Return a film sheet as the manifest lists it; lengths mm, areas mm2."""
    stock = sheet.nest.stock
    other = {} if sheet.machine_file is None else {"machine_file": sheet.machine_file}
    return SheetClaim(
        **other,
        file=sheet.path,
        picture=sheet.picture,
        project=sheet.project,
        material=sheet.material,
        number=sheet.number,
        width=sheet.width,
        length=round(sheet.length, 6),
        border=stock.border,
        spacing=stock.spacing,
        pins=tuple(SheetPinClaim(x=x, y=y, diameter=d) for x, y, d in stock.pins),
        parts=tuple(
            SheetPartClaim(design=design, pattern=pattern, count=count)
            for design, pattern, count in sheet.counts
        ),
        parts_area=round(sheet.parts_area, 6),
        density=round(sheet.density, 4),
        label=sheet.label,
        contours=sheet.contours,
        cut_length=round(sheet.cut_length, 3),
        travel=round(sheet.travel, 3),
        unsorted_travel=round(sheet.unsorted_travel, 3),
        estimated_minutes=round(sheet.minutes, 2),
    )


def _film_use(sheets: Sequence[SheetFile]) -> dict[Material, dict[str, Any]]:
    """Return number and area of sheets, share of the parts and waste in mm2, by material."""
    used: dict[Material, dict[str, float]] = {}
    for sheet in sheets:
        entry = used.setdefault(sheet.material, {"sheets": 0, "sheet_area": 0.0, "parts_area": 0.0})
        entry["sheets"] += 1
        entry["sheet_area"] += sheet.width * sheet.length
        entry["parts_area"] += sheet.parts_area
    return {material: _shares(entry) for material, entry in used.items()}


def _shares(entry: Mapping[str, float]) -> dict[str, float]:
    area, parts = entry["sheet_area"], entry["parts_area"]
    return {
        "sheets": entry["sheets"],
        "sheet_area": round(area, 3),
        "waste": round(area - parts, 3),
        "density": round(parts / area, 4),
    }


def _films(laminate: Laminate, sheets: Sequence[SheetFile]) -> tuple[FilmClaim, ...]:
    use = _film_use(sheets)
    layers: dict[Film, list[Layer]] = {}
    for layer in laminate.layers:
        layers.setdefault(layer.film, []).append(layer)
    return tuple(
        FilmClaim(
            material=film.material,
            product=film.product,
            thickness=film.thickness,
            layers=len(stack),
            area=round(sum(layer.profile.area for layer in stack), 6),
            **use.get(film.material, {}),
        )
        for film, stack in layers.items()
    )


def _layer(build: Build, layer: Layer, is_cut: bool) -> LayerClaim:
    kerf, laminate = build.settings.kerf_width(layer.film.material), build.laminate
    bores, cut = laminate.bores, laminate.layer(laminate.cut_with(layer))
    return LayerClaim(
        index=layer.index,
        name=layer.name,
        material=layer.film.material,
        role=layer.role,
        balloon=layer.balloon,
        thickness=layer.film.thickness,
        z=layer.z,
        file=layer_path(cut.name, kerf) if is_cut else None,
        pattern=layer.pattern,
        area=round(layer.profile.area, 6),
        pieces=len(layer.profile.pieces),
        bores=tuple(bore.chamber for bore in bores if _is_open(layer, bore.centre)),
    )


def _is_open(layer: Layer, place: tuple[float, float]) -> bool:
    return any(hole.winding(place) != 0 for hole in layer.profile.holes)


def _interface(interface: Interface) -> InterfaceClaim:
    return InterfaceClaim(
        below=interface.below.index,
        above=interface.above.index,
        masks=tuple(mask.index for mask in interface.masks),
        kind=interface.kind,
        contact_area=round(interface.contact.area, 6),
        bond_area=round(interface.bond.area, 6),
    )


def _seams(laminate: Laminate, is_cut: bool) -> tuple[SeamClaim, ...]:
    steps = [(step.joining.seam, step.number) for step in lay_up_steps(laminate) if step.joining]
    return tuple(
        SeamClaim(
            name=seam.name,
            file=seam_path(seam) if is_cut else None,
            below=seam.below,
            above=seam.above,
            tool=seam.tool,
            kind=seam.kind,
            width=seam.width,
            length=round(seam.length, 6),
            order=seam.order,
            step=number,
        )
        for seam, number in steps
        if seam is not None
    )


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
    """True if files of the old run belong to the new one's design and version."""
    return all(old.get(key) == new.get(key) for key in ("design_sha256", "generator", "waived"))


# Manifests of folders read.


MAX_MANIFEST_BYTES = 50_000_000


def read_claims(folder: Path) -> Manifest:
    """Return the manifest of an output folder. Raises OutputError if it is missing or unsound."""
    return _read(folder, Manifest, SCHEMA)


def is_job(folder: Path) -> bool:
    """Return True if a folder holds several designs, of a job or an assembly."""
    path = folder / "manifest.json"
    try:
        is_small = path.is_file() and path.stat().st_size <= MAX_MANIFEST_BYTES
    except OSError:
        return False
    return is_small and (read_manifest(folder) or {}).get("schema") in (JOB_SCHEMA, ASSEMBLY_SCHEMA)


def read_job(folder: Path) -> JobManifest:
    """Return the manifest of a job's folder. Raises OutputError as ``read_claims`` does."""
    return _read(folder, JobManifest, JOB_SCHEMA)


def is_assembly(job: JobManifest) -> bool:
    """Return True if a job's designs are the parts of an assembly."""
    return job.schema_name == ASSEMBLY_SCHEMA


def read_assembly(folder: Path) -> AssemblyManifest:
    """Return the manifest of an assembly's folder. Raises OutputError as ``read_claims`` does."""
    return _read(folder, AssemblyManifest, ASSEMBLY_SCHEMA)


Read = TypeVar("Read", Manifest, JobManifest, AssemblyManifest)


def _read(folder: Path, kind: type[Read], schema: str) -> Read:
    path = folder / "manifest.json"
    try:
        # Reading a pipe or a device would never end.
        if path.exists() and not path.is_file():
            raise OutputError(f"{path} is not a plain file; regenerate the folder")
        if path.stat().st_size > MAX_MANIFEST_BYTES:
            raise OutputError(
                f"{path} is larger than {MAX_MANIFEST_BYTES:,} bytes; regenerate the folder"
            )
        data = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        raise OutputError(
            f"{folder} holds no manifest.json; give a folder that sbafab generate has written"
        ) from None
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"{path} cannot be read: {error.strerror or error}") from None
    try:
        return kind.model_validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        reason = first["msg"][:1].lower() + first["msg"][1:]
        fault = f"{where}: {reason}" if where else reason
        raise OutputError(
            f"{path} is not a sound {schema}: {fault}; regenerate the folder with sbafab generate"
        ) from None
