"""The manifest as typed records, and problems as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from sbafab.errors import OutputError
from sbafab.orders.order import ASSEMBLY_SCHEMA, JOB_SCHEMA, SCHEMA
from sbafab.output.manifest import AssemblyManifest, JobManifest, Manifest
from sbafab.output.swap import read_manifest
from sbafab.rules.finding import Finding, Place, Verdict

INTEGRITY = "file-integrity"
CLAIMS = "manifest-claims"
DESIGNED = "as-designed"
MAX_MANIFEST_BYTES = 50_000_000
MAX_SHOWN = 12
"""Problems of a rule that are reported one by one."""


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
            raise OutputError(f"{path} is no plain file; regenerate the folder")
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


@dataclass(frozen=True)
class Problem:
    """A fault outside the rule deck."""

    rule: str
    message: str
    layers: tuple[int, ...] = ()
    interface: int | None = None
    x: float | None = None
    y: float | None = None
    verdict: Verdict = "fail"


def findings_of(rule: str, problems: Sequence[Problem], passed: str) -> list[Finding]:
    """Return the findings of a rule: at most MAX_SHOWN problems in full, or one that passes."""
    rule_problems = [problem for problem in problems if problem.rule == rule]
    if not any(problem.verdict == "fail" for problem in rule_problems):
        rule_problems.append(Problem(rule, passed, verdict="pass"))
    shown, rest = rule_problems[:MAX_SHOWN], rule_problems[MAX_SHOWN:]
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
