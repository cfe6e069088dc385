"""Designs read again from a lab's file of records, as this version understands them."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sbafab.actuators import build as laminate_of
from sbafab.actuators import records
from sbafab.design.reading import ASSEMBLY, validated
from sbafab.design.records import Design
from sbafab.design.writing import actuator_sha256
from sbafab.errors import DesignError
from sbafab.results.records import Build

if TYPE_CHECKING:
    from sbafab.rules.registration_yield import Share

BUILDS = 2000
"""Random builds at most: their interval of 2 % is within what a few measured errors leave open."""


def rebuilt(build: Build) -> Design | None:
    """Return the design of a record; None of an assembly and of what cannot be read any more.

    All that its kit gave stands in the record, so the kit's file is not asked for. A drawn outline
    is not in it: the file at its path may be another by now.
    """
    try:
        tables = tomllib.loads(build.toml)
    except (tomllib.TOMLDecodeError, RecursionError):
        return None
    tables.pop("kit", None)
    if not tables or tables.get("family") == ASSEMBLY:
        return None
    try:
        design = validated(tables, records(), Path())
    except DesignError:
        return None
    return None if design.drawing is not None else design


def actuator_of(build: Build) -> str:
    """Return the hash by which records of a design are grouped, as this version counts it.

    So an earlier version's record groups with today's, also where keys were added since. What
    cannot be read again has the hash of its day, or that of the design.
    """
    design = rebuilt(build)
    return build.actuator if design is None else actuator_sha256(design)


def yield_with(design: Design, errors: Mapping[str, float]) -> Share:
    """Return the share of random builds that keep every limit with other errors than stated.

    ``errors``: the most by which placement (mm), turn (degrees) or cutting (mm) are off, by the
    name in Tolerances. Raises DesignError where the design cannot be built.
    """
    from sbafab.output.settings import limits
    from sbafab.rules.registration_yield import simulate

    stated = limits(design)
    bench = replace(
        stated,
        tolerances=replace(stated.tolerances, **errors),
        yield_builds=min(stated.yield_builds or BUILDS, BUILDS),
    )
    return simulate(laminate_of(design), bench).whole
