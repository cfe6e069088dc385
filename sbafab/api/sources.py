"""What the functions are given: a design in one of three ways, and keywords of two kinds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab import actuators
from sbafab.design.reading import Change
from sbafab.design.records import Design

if TYPE_CHECKING:
    from sbafab.assemblies.records import Assembly

Source = Design | str | Path
"""A design: itself, a template's name, or a TOML file."""


def design_of(source: Source, changes: Sequence[Change], tables: Mapping[str, Any]) -> Design:
    """The design with its keys changed. Raises DesignError."""
    if isinstance(source, Design):
        return source.with_(*changes, **tables) if changes or tables else source
    return actuators.load_design(source, [*changes, tables])


def either_of(
    source: Source | Assembly, changes: Sequence[Change], tables: Mapping[str, Any]
) -> Design | Assembly:
    """The design or the assembly, likewise."""
    from sbafab.assemblies.loading import load
    from sbafab.assemblies.records import Assembly

    if isinstance(source, Assembly):
        return source
    if isinstance(source, Design):
        return design_of(source, changes, tables)
    return load(source, [*changes, tables])


def parted(asked: Mapping[str, Any], record: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """What of the keywords are fields of the record, and what are tables of a design."""
    names = {field.name for field in fields(record)}
    return (
        {name: value for name, value in asked.items() if name in names},
        {name: value for name, value in asked.items() if name not in names},
    )
