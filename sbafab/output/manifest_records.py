"""What ``manifest.json`` holds: the records that a run writes it from, and that it is read with.

A key with a default may be missing in a folder that is read. What the manifest claims is held
against the files by ``as_built``, which measures it there and asks nothing that wrote it.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from sbafab.laminate.films import Material
from sbafab.laminate.laminate import InterfaceKind, Role

MOST_SIZE = 10_000.0
"""mm, of a film sheet."""


Count = Annotated[int, Field(ge=1, le=10_000_000)]


Size = Annotated[float, Field(gt=0, le=MOST_SIZE)]


Thickness = Annotated[float, Field(gt=0, le=10)]


BatchSchema = Literal["sbafab/job@1", "sbafab/assembly@1"]


Schema = Literal["sbafab/manifest@1"] | BatchSchema


class _Claim(BaseModel):
    model_config = ConfigDict(
        extra="ignore", frozen=True, strict=True, allow_inf_nan=False, defer_build=True
    )

    def as_dict(self) -> dict[str, Any]:
        """What stands in the file: keys in the order of the fields, but for unset ones."""
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
    """Sheets of a film and their area in mm2; nothing where there are none."""

    sheets: int = 0
    sheet_area: float = 0.0
    waste: float = 0.0
    density: float = 0.0


class FilmClaim(FilmUseClaim, _FilmNeed):
    """What a design needs of a film and the sheets it is cut from, in this order of the keys."""


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
    material: Material
    number: Count
    width: Size
    length: Size
    border: Annotated[float, Field(ge=0, le=MOST_SIZE)]
    spacing: Annotated[float, Field(gt=0, le=MOST_SIZE)]
    pins: Annotated[tuple[SheetPinClaim, ...], Field(max_length=100)]
    engine: str
    parts: tuple[SheetPartClaim, ...]
    parts_area: float
    density: float
    label: str = ""
    contours: Count
    cut_length: float
    travel: float = 0.0
    unsorted_travel: float = 0.0
    estimated_minutes: float = 0.0


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
    """How several copies are pressed: where each of a cycle lies, and how many cycles take."""

    at_once: Count
    cycles: Annotated[tuple[Count, ...], Field(max_length=1000)]
    places: Annotated[tuple[PlaceClaim, ...], Field(min_length=1, max_length=1000)]


class KitClaim(_Claim):
    name: str
    version: str
    sha256: str
    departures: tuple[str, ...]


class FiducialClaim(PlaceClaim):
    diameter: float


class PanelClaim(_Claim):
    """Registered sheets, in the frame of the first copy; lengths in mm.

    ``turned_over`` are the materials whose sheets are drawn as seen from below; ``projects`` the
    first and second cut for LightBurn.
    """

    size: tuple[float, float]
    places: tuple[PlaceClaim, ...]
    batches: int
    second_cut: str
    fiducials: tuple[FiducialClaim, ...]
    turned_over: str
    projects: tuple[str, ...] = ()


class Manifest(_Claim):
    """``manifest.json`` of one design's folder."""

    schema_name: Literal["sbafab/manifest@1"] = Field(alias="schema")
    name: str
    family: str
    units: Literal["mm"]
    design_sha256: str
    generator: str
    kit: KitClaim | None = None
    registration: RegistrationClaim
    kerf: dict[Material, KerfClaim]
    curves: str | None = None
    waived: tuple[str, ...]
    lowered_limits: tuple[str, ...] = ()
    sizes: dict[str, float]
    notes: tuple[str, ...] = ()
    copies: Annotated[int, Field(ge=1, le=1000)] = 1
    batch: BatchClaim | None = None
    films: tuple[FilmClaim, ...]
    warnings: tuple[str, ...] = ()
    layers: Annotated[tuple[LayerClaim, ...], Field(min_length=1, max_length=10_000)]
    interfaces: tuple[InterfaceClaim, ...]
    bores: tuple[BoreClaim, ...]
    inlets: tuple[InletClaim, ...]
    lumen: float | None
    fixture: str | None = None
    panel: PanelClaim | None = None
    sheets: Annotated[tuple[SheetClaim, ...], Field(max_length=2000)] = ()
    meshes: tuple[MeshClaim, ...] = ()
    mesh_statistics: dict[str, Any] = Field(default_factory=dict)
    files: dict[str, str]


class DesignClaim(_Claim):
    name: str
    folder: str
    copies: Annotated[int, Field(ge=1, le=1000)]
    design_sha256: str
    kit: KitClaim | None = None


class JobManifest(_Claim):
    """``manifest.json`` of several designs cut together."""

    schema_name: BatchSchema = Field(alias="schema")
    name: str
    units: Literal["mm"]
    designs_sha256: str
    generator: str
    waived: tuple[str, ...]
    lowered_limits: tuple[str, ...] = ()
    designs: Annotated[tuple[DesignClaim, ...], Field(min_length=1, max_length=100)]
    films: tuple[FilmUseClaim, ...]
    sheets: Annotated[tuple[SheetClaim, ...], Field(max_length=2000)]
    files: dict[str, str]


class AssemblyManifest(JobManifest):
    """That of an assembly, which says more than that of a job."""

    family: str = ""
    design_sha256: str
    copies: int = 1
    parts: Annotated[tuple[dict[str, Any], ...], Field(max_length=1000)]
    meshes: tuple[dict[str, Any], ...] = ()
