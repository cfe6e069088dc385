"""The assembly of a folder: its parts as design.toml puts them together, and what is claimed."""

from __future__ import annotations

from pathlib import Path

from sbafab.as_built.claims import claim
from sbafab.as_built.records import Problem, read_joined
from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.checks import lowered_checks, run_checks
from sbafab.assemblies.reading import load_assembly
from sbafab.assemblies.writing import DESIGN_FILE, assembly_sha256, part_entry
from sbafab.design.writing import design_sha256
from sbafab.errors import DesignError
from sbafab.output.manifest_records import AssemblyManifest
from sbafab.rules.finding import Finding


def joined_findings(folder: Path) -> tuple[tuple[Finding, ...], list[Problem]]:
    """What is found between the parts, and where the manifest says otherwise than design.toml.

    Parts are as their designs make them: how films were cut is checked design by design.
    """
    claims = read_joined(folder)
    try:
        assembled = assemble(load_assembly(folder / DESIGN_FILE))
    except (DesignError, OSError) as error:
        return (), [claim(f"the parts were not put together, for {error or type(error).__name__}")]
    between = run_checks(assembled)
    return between, [
        *_assembly_problems(claims, assembled),
        *_unsaid_waivers(claims, between),
    ]


def lowered_between(folder: Path) -> tuple[str, ...]:
    """The limits between parts that the assembly in a folder weakens; none if it is unreadable."""
    try:
        return lowered_checks(load_assembly(folder / DESIGN_FILE).rules)
    except (DesignError, OSError):
        return ()


def _assembly_problems(claims: AssemblyManifest, assembled: Assembled) -> list[Problem]:
    problems = []
    if claims.name != assembled.assembly.name:
        problems.append(claim(f"design.toml names the assembly {assembled.assembly.name}"))
    if claims.design_sha256 != assembly_sha256(assembled):
        problems.append(claim("design_sha256 is not that of design.toml and its parts' designs"))
    told = [(one.name, one.copies, one.design_sha256) for one in claims.designs]
    own = [
        (one.design.name, one.design.order.quantity, design_sha256(one.design))
        for one in assembled.designs
    ]
    if told != own:
        problems.append(claim("designs or their copies are not those that the parts ask for"))
    if list(claims.parts) != [part_entry(placed) for placed in assembled.parts]:
        problems.append(claim("parts or their places are not those of design.toml"))
    return problems


def _unsaid_waivers(claims: AssemblyManifest, between: tuple[Finding, ...]) -> list[Problem]:
    waived = dict.fromkeys(finding.rule for finding in between if finding.by_user)
    return [
        claim(f"{rule} fails and is waived by design.toml, which the manifest does not say")
        for rule in waived
        if rule not in claims.waived
    ]
