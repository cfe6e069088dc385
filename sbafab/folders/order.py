"""The designs of one output folder, checked and planned: one, several, or an assembly's."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.checks import lowered_checks, run_checks
from sbafab.assemblies.records import Assembly
from sbafab.cutting.cut_settings import TRUE_ARCS, Curves, CutSettings
from sbafab.cutting.nesting import PLACES, from_dict, nest
from sbafab.cutting.placements import Nest, NestPart, check_nest
from sbafab.design.records import Design
from sbafab.design.toml_table import NAME_PATTERN
from sbafab.errors import DefectError, DesignError, GeometryError, OutputError
from sbafab.folders.build import Build, make_build, stocks
from sbafab.folders.swap import ASSEMBLY_SCHEMA, JOB_SCHEMA, SCHEMA, Schema
from sbafab.rules.deck import has_failed, run_deck
from sbafab.rules.finding import Finding
from sbafab.runtime import Progress, ignore_progress

RESERVED = {
    "sheets": "the job's folder of film sheets",
    "manifest.json": "the job's index",
}
"""Names in a job's folder that no design may have."""
SHARED = ("films", "sheets", "laser")
"""Sections that must be alike in all designs that are cut from the same film."""
MOST_BYTES = 50_000_000
"""Limit of saved places; a larger file is not read, and places are searched for again."""


@dataclass(frozen=True, eq=False)
class Order:
    """Builds made together into one folder: those of a design, of several, or of an assembly's
    parts.

    ``schema`` identifies the folder's manifest. ``between`` holds the findings between the parts of
    an assembly, None for designs.
    """

    schema: Schema
    name: str
    builds: tuple[Build, ...]
    assembled: Assembled | None = None
    between: tuple[Finding, ...] | None = None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings of the designs, with names if there are several, and between parts."""
        if len(self.builds) == 1 and self.between is None:
            return self.builds[0].findings
        named = (
            replace(finding, design=each.design.name)
            for each in self.builds
            for finding in each.findings
        )
        return (*named, *(self.between or ()))

    @property
    def groups(self) -> dict[str, Sequence[Finding]]:
        """The findings of each design by its name, and those between the parts."""
        each: dict[str, Sequence[Finding]] = {b.design.name: b.findings for b in self.builds}
        return each if self.between is None else {**each, "between the parts": self.between}

    @property
    def notes(self) -> list[str]:
        """The notes of all designs, each once, with design names unless common to all."""
        designs: dict[str, list[str]] = {}
        for build in self.builds:
            for note in dict.fromkeys(build.laminate.notes):
                designs.setdefault(note, []).append(build.design.name)
        return [
            note if len(names) == len(self.builds) else f"{', '.join(names)}: {note}"
            for note, names in designs.items()
        ]

    @property
    def is_job(self) -> bool:
        """True for several designs that are cut together."""
        return self.schema == JOB_SCHEMA

    @property
    def failed(self) -> bool:
        """True if a rule or a check between parts failed without a waiver."""
        return has_failed(self.findings)

    @property
    def waived(self) -> tuple[str, ...]:
        """Checks between parts that fail and that the assembly waives by name."""
        failed = (finding.rule for finding in self.between or () if finding.by_user)
        return tuple(dict.fromkeys(failed))

    @property
    def lowered(self) -> tuple[str, ...]:
        """The limits of the checks between parts that the assembly relaxes."""
        return () if self.assembled is None else lowered_checks(self.assembled.assembly.rules)

    @cached_property
    def settings(self) -> CutSettings:
        """The settings of the film sheets; for several designs, one hash and the waivers and
        lowered limits of all.
        """
        each = [build.settings for build in self.builds]
        if self.schema == SCHEMA:
            return each[0]
        hashes = "".join(settings.design_sha256 for settings in each)
        waived = [rule for settings in each for rule in settings.waived]
        weakened = [limit for settings in each for limit in settings.lowered]
        return replace(
            each[0],
            design=self.name,
            design_sha256=hashlib.sha256(hashes.encode()).hexdigest(),
            waived=tuple(dict.fromkeys([*waived, *self.waived])),
            lowered=tuple(dict.fromkeys([*weakened, *self.lowered])),
            warnings={name: text for settings in each for name, text in settings.warnings.items()},
        )

    def nests(self, old_folder: Path, progress: Progress) -> tuple[Nest, ...]:
        """Return places for all pieces on the film sheets of the first design.

        Places of an earlier run in ``old_folder`` for the same pieces and sheets are reused. Raises
        DesignError if pieces do not fit.
        """
        progress("nesting", 0, 1)
        pieces = [piece for build in self.builds for piece in build.pieces]
        design = self.builds[0].design
        return _saved(pieces, design, old_folder / PLACES) or _nested(pieces, design)


def make_order(
    source: Design | Assembly | Sequence[Design],
    name: str = "",
    progress: Progress | None = None,
    curves: Curves = TRUE_ARCS,
) -> Order:
    """Check a design, an assembly with the space between its parts, or the designs of job ``name``.

    Raises DesignError if one cannot be built, or if designs have different film sheets, kerf or
    machine.
    """
    if isinstance(source, Design):
        return Order(SCHEMA, source.name, (make_build(source, progress, curves),))
    if isinstance(source, Assembly):
        return _check_assembly(source, progress or ignore_progress, curves)
    _refuse_names([design.name for design in source], name)
    refuse_other_film(source)
    return Order(JOB_SCHEMA, name, tuple(make_build(design, progress, curves) for design in source))


def _check_assembly(assembly: Assembly, progress: Progress, curves: Curves) -> Order:
    assembled = assemble(assembly)
    refuse_other_film([part.design for part in assembled.designs])
    try:
        builds = [
            Build(
                part.design, part.laminate, run_deck(part.laminate, part.design, progress), curves
            )
            for part in assembled.designs
        ]
    except GeometryError as error:
        raise DesignError(f"assembly {assembly.name} cannot be resolved: {error}") from None
    progress("checks between parts", 0, 1)
    return of_assembly(assembled, builds)


def of_assembly(assembled: Assembled, builds: Sequence[Build]) -> Order:
    """Return the builds of an assembly with the findings between its parts."""
    between = run_checks(assembled)
    return Order(ASSEMBLY_SCHEMA, assembled.assembly.name, tuple(builds), assembled, between)


def refuse_other_film(designs: Sequence[Design]) -> None:
    """Raise DesignError if two designs are not cut from the same film by one machine."""
    first, *rest = designs
    for design in rest:
        for section in SHARED:
            if getattr(design, section) != getattr(first, section):
                raise DesignError(
                    f"{section} differs between {first.name} and {design.name}, which share a "
                    f"film; make the section {section} equal in both"
                )


def _refuse_names(names: Sequence[str], name: str) -> None:
    if re.fullmatch(NAME_PATTERN.strip("^$"), name) is None:
        raise DesignError(
            f"--name {name!r} must be a folder's name of letters, digits, dots, dashes and "
            "underscores; for another place use -o"
        )
    # Some systems hold names that differ in small and capital letters for one.
    lower = [design.lower() for design in names]
    folders = dict(zip(reversed(lower), reversed(names), strict=True))
    repeated = next((k for k, name in enumerate(lower) if name in lower[:k]), None)
    if repeated is not None:
        both = " and ".join(dict.fromkeys((folders[lower[repeated]], names[repeated])))
        raise DesignError(
            f"two designs are named {both}, which is one folder on some machines; give each a name "
            "of its own, or say --copies"
        )
    reserved = next((design for design in names if design.lower() in RESERVED), None)
    if reserved is not None:
        raise DesignError(
            f"a design is named {reserved}, like {RESERVED[reserved.lower()]}; rename it in its "
            "design file"
        )
    if name.lower() in (*folders, *RESERVED):
        raise DesignError(
            f"the job and one of its folders are both named {name}; choose another --name"
        )


# Places of pieces on film sheets.


def _nested(parts: Sequence[NestPart], design: Design) -> tuple[Nest, ...]:
    """Return new places. Raises DefectError if they break spacing, border or counts."""
    nests = nest(parts, stocks(design))
    try:
        for nested in nests:
            check_nest(nested)
    except OutputError as error:
        raise DefectError(
            f"{error} This is a defect of sbafab and nothing was written: please report this "
            "sentence with the design file"
        ) from error
    return nests


def _saved(parts: Sequence[NestPart], design: Design, path: Path) -> tuple[Nest, ...] | None:
    """Return the places of an earlier run; None if none are valid for these parts."""
    try:
        if not path.is_file() or path.stat().st_size > MOST_BYTES:
            return None
        data: Any = json.loads(path.read_text(encoding="utf-8"))
        nests = from_dict(data, parts, stocks(design))
        if nests is None:
            return None
        for nested in nests:
            turns, placed = nested.stock.turns, nested.placements
            if nested.sheets > nested.stock.most or any(p.turn not in turns for p in placed):
                return None
            check_nest(nested)
    except (OSError, ValueError, ArithmeticError, RecursionError, OutputError):
        return None
    return nests
