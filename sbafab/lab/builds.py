"""Recorded designs with their predictions: quantities and the share of good builds."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from sbafab.actuators import build as laminate_of
from sbafab.actuators import records
from sbafab.assemblies.build import Assembled
from sbafab.assemblies.files import assembled_sha256, assembly_sha256, assembly_toml
from sbafab.design.files import ASSEMBLY
from sbafab.design.identity import actuator_sha256, design_sha256
from sbafab.design.records import Design, design_toml, validated
from sbafab.errors import DesignError
from sbafab.models.figures import PredictionRequest
from sbafab.models.paper import FORCE_KPA
from sbafab.models.pneumatics import usual_pressures
from sbafab.models.prediction import predict
from sbafab.models.quantity import ANYWHERE, Conditions, Quantity
from sbafab.rules.registration_yield import simulate
from sbafab.version import GENERATOR

MEASURED: Mapping[str, tuple[Quantity, Conditions]] = {
    "burst_kpa": (Quantity.BURST, ANYWHERE),
    "stroke_mm": (Quantity.REFERENCE_STROKE, ANYWHERE),
    "force_n": (Quantity.BLOCKED_FORCE, Conditions(kpa=FORCE_KPA, share=0.0)),
    "height_mm": (Quantity.FOLDED_HEIGHT, ANYWHERE),
    "mass_g": (Quantity.MASS, ANYWHERE),
}
"""For each measured quantity, the predicted figure, from the model to design with."""


@dataclass(frozen=True)
class RecordedDesign:
    """A recorded design with its predictions.

    ``predicted`` maps quantities to value and model. ``good_builds`` is the number of random builds
    that meet every limit, and their total. ``actuator_sha256`` is the hash of the actuator, equal
    for designs that differ only in counts or sheets.
    """

    sha256: str
    generator: str
    name: str
    family: str
    method: str
    toml: str
    predicted: Mapping[str, tuple[float, str]]
    good_builds: tuple[int, int]
    actuator_sha256: str

    @property
    def promise(self) -> float:
        """The share of random builds that meet every limit."""
        return self.good_builds[0] / self.good_builds[1]

    @cached_property
    def design(self) -> Design | None:
        """The design as read by this version; None for an assembly or if it cannot be read.

        The record holds the kit's values, so the kit's file is not needed. It does not hold drawn
        outlines: the file at that path may have changed.
        """
        try:
            tables = tomllib.loads(self.toml)
            tables.pop("kit", None)
            if not tables or tables.get("family") == ASSEMBLY:
                return None
            design = validated(tables, records(), Path())
        except (tomllib.TOMLDecodeError, RecursionError, DesignError):
            return None
        return None if design.drawing is not None else design

    @cached_property
    def actuator(self) -> str:
        """The hash that groups actuators, as computed by this version.

        An earlier version's record therefore matches current ones, even if keys were added since.
        """
        return self.actuator_sha256 if self.design is None else actuator_sha256(self.design)


def recorded_sha256(built: Design | Assembled) -> str:
    """Return the hash of the actuator."""
    return design_sha256(built) if isinstance(built, Design) else assembly_sha256(built)


def promised(built: Design | Assembled) -> RecordedDesign:
    """Return the built design with its predictions and yield. Raises DesignError.

    An assembly is good if every part is; it has no predictions.
    """
    if isinstance(built, Design):
        name, family, toml = built.name, built.family, design_toml(built)
        actuator, predicted = actuator_sha256(built), _predicted(built)
        parts = [(built, laminate_of(built), 1)]
    else:
        name, family, toml = built.assembly.name, ASSEMBLY, assembly_toml(built)
        actuator, predicted = assembled_sha256(built), {}
        parts = [(part.design, part.laminate, len(part.parts)) for part in built.designs]
    designs = [design for design, _, _ in parts]
    shares = [simulate(laminate, design).whole for design, laminate, _ in parts]
    builds = max(share.builds for share in shares)
    good = math.prod(share.value**count for share, (*_, count) in zip(shares, parts, strict=True))
    return RecordedDesign(
        sha256=recorded_sha256(built),
        generator=GENERATOR,
        name=name,
        family=family,
        method=", ".join(dict.fromkeys(design.registration.method for design in designs)),
        toml=toml,
        predicted=predicted,
        good_builds=(round(good * builds), builds),
        actuator_sha256=actuator,
    )


def _predicted(design: Design) -> dict[str, tuple[float, str]]:
    """Return value and model of each predicted quantity that the lab measures."""
    request = PredictionRequest(usual_pressures(design.form)[-1:])
    figures = [figure for figure in predict(design, request).figures if not figure.other]
    return {
        measured: (figure.value, figure.model.title)
        for measured, sought in MEASURED.items()
        for figure in figures
        if figure.is_of(*sought)
    }
