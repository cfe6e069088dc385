"""What ``manifest.json`` claims, taken in with its types checked, and problems as data."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sbafab.errors import OutputError
from sbafab.laminate.films import Material
from sbafab.laminate.interfaces import InterfaceKind
from sbafab.laminate.laminate import Role
from sbafab.output.swap import ASSEMBLY_SCHEMA, JOB_SCHEMA, SCHEMA, read_manifest
from sbafab.rules.finding import Finding, Place, Verdict

INTEGRITY = "file-integrity"
CLAIMS = "manifest-claims"
DESIGNED = "as-designed"
MOST_BYTES = 50_000_000
MOST_SHOWN = 12
"""Problems of one rule that are reported one by one."""

MOST_SIZE = 10_000.0
"""mm, of a film sheet."""

Count = Annotated[int, Field(ge=1, le=10_000_000)]
Size = Annotated[float, Field(gt=0, le=MOST_SIZE)]
Thickness = Annotated[float, Field(gt=0, le=10)]


class _Claim(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, strict=True, allow_inf_nan=False)


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


class FilmUseClaim(_Claim):
    """Sheets of a film and their area in mm2; nothing where there are none."""

    material: Material
    sheets: int = 0
    sheet_area: float = 0.0
    waste: float = 0.0
    density: float = 0.0


class FilmClaim(FilmUseClaim):
    product: str
    thickness: Thickness
    layers: int
    area: float


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
    contours: Count
    cut_length: float


class PlaceClaim(_Claim):
    x: float
    y: float


class BatchClaim(_Claim):
    at_once: Count
    cycles: Annotated[tuple[Count, ...], Field(max_length=1000)]
    places: Annotated[tuple[PlaceClaim, ...], Field(min_length=1, max_length=1000)]


class Manifest(_Claim):
    """The part of ``manifest.json`` that a check compares with what lies on disk."""

    schema_name: Literal["sbafab/manifest@1"] = Field(alias="schema")
    name: str
    family: str
    units: Literal["mm"]
    design_sha256: str
    generator: str
    registration: RegistrationClaim
    kerf: dict[Material, KerfClaim]
    curves: str | None = None
    waived: tuple[str, ...]
    lowered_limits: tuple[str, ...] = ()
    copies: Annotated[int, Field(ge=1, le=1000)] = 1
    batch: BatchClaim | None = None
    sizes: dict[str, float]
    films: tuple[FilmClaim, ...]
    layers: Annotated[tuple[LayerClaim, ...], Field(min_length=1, max_length=10_000)]
    interfaces: tuple[InterfaceClaim, ...]
    bores: tuple[BoreClaim, ...]
    inlets: tuple[InletClaim, ...]
    lumen: float | None
    fixture: str | None = None
    sheets: Annotated[tuple[SheetClaim, ...], Field(max_length=2000)] = ()
    files: dict[str, str]


class DesignClaim(_Claim):
    name: str
    folder: str
    copies: Annotated[int, Field(ge=1, le=1000)]
    design_sha256: str


class Job(_Claim):
    """The part of a job's ``manifest.json`` that a check compares with what lies on disk."""

    schema_name: Literal["sbafab/job@1", "sbafab/assembly@1"] = Field(alias="schema")
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


class Joined(Job):
    """What the manifest of an assembly says beyond that of a job."""

    design_sha256: str
    parts: Annotated[tuple[dict[str, Any], ...], Field(max_length=1000)]


def read_claims(folder: Path) -> Manifest:
    """The manifest of an output folder.

    Raises OutputError with one sentence where there is none, or a key is missing or of a wrong
    type.
    """
    return _read(folder, Manifest, SCHEMA)


def is_job(folder: Path) -> bool:
    """Whether a folder is one of several designs, of a job or an assembly."""
    path = folder / "manifest.json"
    try:
        is_small = path.is_file() and path.stat().st_size <= MOST_BYTES
    except OSError:
        return False
    return is_small and (read_manifest(folder) or {}).get("schema") in (JOB_SCHEMA, ASSEMBLY_SCHEMA)


def read_job(folder: Path) -> Job:
    """The manifest of a job's folder. Raises OutputError as ``read_claims`` does."""
    return _read(folder, Job, JOB_SCHEMA)


def is_joined(job: Job) -> bool:
    """Whether a job's designs are the parts of an assembly."""
    return job.schema_name == ASSEMBLY_SCHEMA


def read_joined(folder: Path) -> Joined:
    """The manifest of an assembly's folder. Raises OutputError as ``read_claims`` does."""
    return _read(folder, Joined, ASSEMBLY_SCHEMA)


Read = TypeVar("Read", Manifest, Job, Joined)


def _read(folder: Path, kind: type[Read], schema: str) -> Read:
    path = folder / "manifest.json"
    try:
        # A pipe or a device would be read for ever.
        if path.exists() and not path.is_file():
            raise OutputError(f"{path} is no plain file; write the folder anew")
        if path.stat().st_size > MOST_BYTES:
            raise OutputError(f"{path} is larger than {MOST_BYTES:,} bytes; write the folder anew")
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
        said = f"{where}: {reason}" if where else reason
        raise OutputError(
            f"{path} is not a sound {schema}: {said}; write the folder anew with sbafab generate"
        ) from None


@dataclass(frozen=True)
class Problem:
    """One thing that is not as it should be, found outside the rule deck."""

    rule: str
    message: str
    layers: tuple[int, ...] = ()
    interface: int | None = None
    x: float | None = None
    y: float | None = None
    verdict: Verdict = "fail"


def findings_of(rule: str, problems: list[Problem], passed: str) -> list[Finding]:
    """Findings of one rule: each problem, the many in one at the end, or one that passes."""
    own = [problem for problem in problems if problem.rule == rule]
    if not any(problem.verdict == "fail" for problem in own):
        own.append(Problem(rule, passed, verdict="pass"))
    shown, rest = own[:MOST_SHOWN], own[MOST_SHOWN:]
    if rest:
        layers = tuple(dict.fromkeys(index for problem in rest for index in problem.layers))
        message = f"and {len(rest)} more like these"
        failed = any(problem.verdict == "fail" for problem in rest)
        shown.append(
            Problem(rule=rule, message=message, layers=layers, verdict="fail" if failed else "warn")
        )
    return [_finding(problem) for problem in shown]


def _finding(problem: Problem) -> Finding:
    place = Place(problem.interface, problem.layers, problem.x, problem.y)
    return Finding(problem.rule, problem.verdict, None, None, "", place, problem.message)
