"""Recipes: power, speed and passes for cutting or marking a film on a machine, with their
source.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from sbafab.design.toml_table import Section
from sbafab.design.units import SHORTEST, LengthOrZero, Millimetres
from sbafab.laminate.films import Film

Operation = Literal["cut", "engrave"]
DATE_PATTERN = r"^\d{4}-\d{2}-\d{2}$"
MachineName = Annotated[str, Field(min_length=1, max_length=80)]
SAME_THICKNESS = 1e-6
"""Thicknesses that differ by less are equal, mm."""


class Recipe(Section):
    """Settings of a machine for a film, and their source."""

    film: str = Field(min_length=1, max_length=80)
    """The film's product, as in films.tpe.product."""
    thickness_mm: Annotated[float, Millimetres(SHORTEST, 1)]
    """Its thickness."""
    machine: MachineName
    """The machine, as in laser.machine."""
    operation: Operation = "cut"
    """"cut" is for holes, outlines and the cut that frees a roll's sheet, "engrave" for labels."""
    power_percent: float = Field(gt=0, le=100)
    """%, both least and most power."""
    speed_mm_s: float = Field(gt=0, le=5000)
    """mm/s."""
    passes: int = Field(default=1, ge=1, le=50)
    """Number of times the beam follows a line."""
    kerf_mm: LengthOrZero | None = Field(default=None, le=1)
    """Full kerf width that was measured with these settings; for notes, it compensates nothing."""
    source: str = Field(min_length=1, max_length=200)
    """Source of the settings, for instance a material test of the laser program."""
    date: str | None = Field(default=None, pattern=DATE_PATTERN)
    """Date of their trial, as year-month-day."""

    @model_validator(mode="after")
    def _has_a_source(self) -> Self:
        if not self.source.strip():
            raise ValueError("has no source; say where power and speed are from")
        return self

    @property
    def settings(self) -> str:
        """Power, speed and passes as text."""
        passes = f"{self.passes} pass" + ("es" if self.passes > 1 else "")
        return f"{self.power_percent:g} % at {self.speed_mm_s:g} mm/s, {passes}"

    def is_for(self, film: Film, machine: str) -> bool:
        """Return True if it applies to a film on a machine."""
        same = abs(self.thickness_mm - film.thickness) < SAME_THICKNESS
        return same and (self.film, self.machine) == (film.product, machine)

    def is_rival(self, other: Recipe) -> bool:
        """Return True if both are for one film, thickness, machine and operation."""
        ours, theirs = (
            (recipe.film, round(recipe.thickness_mm, 6), recipe.machine, recipe.operation)
            for recipe in (self, other)
        )
        return ours == theirs


def recipes_for(
    recipes: Iterable[Recipe], film: Film, machine: str | None
) -> Mapping[Operation, Recipe]:
    """Return the recipes of a film by operation; empty if no machine is named."""
    if machine is None:
        return {}
    return {recipe.operation: recipe for recipe in recipes if recipe.is_for(film, machine)}
