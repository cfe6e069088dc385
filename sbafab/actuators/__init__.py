"""Actuator families by name: each module holds a family's design record and builds its laminate.

Input: the tables of a design file. Output: a ``Design`` of its family (``load_design``), and its
``Laminate`` (``build``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import BaseModel

from sbafab import plugins
from sbafab.actuators.fitted_size import Fits, refuse_unfit
from sbafab.design.files import (
    FITS,
    Change,
    add_waivers,
    design_path,
    read_toml,
    with_changes,
)
from sbafab.design.outline import described_outline
from sbafab.design.records import Design, validated
from sbafab.laminate.laminate import Laminate
from sbafab.plugins import Plugins


class Family(NamedTuple):
    """A family's design record, and the function that builds the laminate of a design."""

    record: type[Design]
    build: Callable[[Any], Laminate]


FAMILIES = Plugins(
    plugins.FAMILIES,
    "family",
    Family,
    {
        "1dof": "sbafab.actuators.one_dof:FAMILY",
        "lobed": "sbafab.actuators.lobed:FAMILY",
        "radial": "sbafab.actuators.radial:FAMILY",
        "drawn": "sbafab.actuators.drawn:FAMILY",
    },
)
"""All families by name. Packages are searched only for a name that is not ours, or for all names:
that may raise DesignError.
"""


class _Records(Mapping[str, type[Design]]):
    """The design record of every family, loaded lazily."""

    def __getitem__(self, name: str) -> type[Design]:
        return FAMILIES[name].record

    def __iter__(self) -> Iterator[str]:
        return iter(FAMILIES)

    def __len__(self) -> int:
        return len(FAMILIES)


def records() -> Mapping[str, type[Design]]:
    """Return the design record of every family, loaded lazily."""
    return _Records()


def load_design(
    source: str | Path, changes: Iterable[Change] = (), waivers: Sequence[str] = ()
) -> Design:
    """Return a design from a template's name or a TOML file, with changes made to its keys.

    ``waivers`` are rule names added to those that the file waives. Raises DesignError with one
    sentence if it cannot be built.
    """
    path = design_path(source)
    data = add_waivers(with_changes(read_toml(path), changes), waivers)
    return validated({"name": path.stem, **data}, records(), path.parent)


def build(design: Design) -> Laminate:
    """Return the laminate of a design of any family. Raises DesignError if parts do not fit.

    Its notes state the size of a drawn outline, and compliance with ``fits``.
    """
    laminate = FAMILIES[design.family].build(design)
    fits = getattr(design, FITS, None)
    room = refuse_unfit(design, fits, laminate) if isinstance(fits, Fits) else None
    if room is not None:
        laminate = replace(laminate, notes=(room, *laminate.notes))
    if design.drawing is None:
        return laminate

    _, note = described_outline(design.drawing)
    return replace(laminate, notes=(note, *laminate.notes))


def schema(*more: type[BaseModel]) -> dict[str, Any]:
    """The JSON schema of a design file of any family, or of ``more`` records (draft 2020-12)."""
    from pydantic.json_schema import models_json_schema

    every = [*records().values(), *more]
    _, definitions = models_json_schema([(record, "validation") for record in every])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "sbafab design",
        "oneOf": [{"$ref": f"#/$defs/{record.__name__}"} for record in every],
        **definitions,
    }
