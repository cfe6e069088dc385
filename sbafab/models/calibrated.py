"""A calibration: the posterior of the models' unknowns with the discrepancy that remains, as a file
that designs and kits name, and the 90 % intervals of predictions that follow from it.

Unknowns have a normal posterior in their coordinates. A prediction is linear in them: its
logarithm, or the prediction itself where it may be 0 or below, changes by its slope times the
change of each unknown. What the models miss beyond that is a relative discrepancy, one standard
deviation for each group of quantities; farther from the evidence of a group, in size, film or
number of balloons, more is assumed to be missed.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from sbafab.design.files import checked, listed, read_toml, shown
from sbafab.design.toml_table import Section
from sbafab.errors import DesignError
from sbafab.models.figures import Factors

FOLDER = Path(__file__).parent / "calibrations"
NONE: Literal["none"] = "none"
"""The name for using no calibration: films as drawn and bought, without intervals."""
FILE = "calibration.toml"
"""A calibration's copy in the output folder of a design."""
GROUPS = ("force", "motion", "flat height", "time", "work", "stiffness", "loss")
"""Groups of quantities, each with its discrepancy."""
SHARE = 0.9
"""Probability that an interval holds the measured value."""
DESIGN_UNKNOWNS = 3
"""The first of UNKNOWNS, which change an actuator; the others change its supply."""


Ends = tuple[float, float]
"""Least and largest value."""


class SizeRange(NamedTuple):
    """Least and largest diameter of round pockets and thickness of films that bond, mm, and number
    of balloons in a stack: of an actuator, or of several.
    """

    diameters: Ends | None
    thicknesses: Ends
    balloons: Ends

    def joined(self, other: SizeRange) -> SizeRange:
        """Return the sizes of both."""
        return SizeRange(*(_hull(a, b) for a, b in zip(self, other, strict=True)))  # type: ignore[arg-type]


def _hull(first: Ends | None, second: Ends | None) -> Ends | None:
    if first is None or second is None:
        return first or second
    return min(first[0], second[0]), max(first[1], second[1])


@dataclass(frozen=True)
class Unknown:
    """One unknown of the models; ``field`` names the field of ``Factors``.

    The prior is normal in the coordinate, which is the logarithm of the value (``is_log``) or the
    value itself: ``middle`` is the value at its mean, ``spread`` its standard deviation in the
    coordinate, and ``source`` its reason. Values lie from ``least`` to ``most``.
    """

    field: str
    title: str
    unit: str
    is_log: bool
    middle: float
    spread: float
    least: float
    most: float
    source: str

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value."""
        return math.log(value) if self.is_log else value

    def value(self, coordinate: float) -> float:
        """Return the value at a coordinate, within its bounds."""
        value = math.exp(coordinate) if self.is_log else coordinate
        return min(max(value, self.least), self.most)

    def shown(self, value: float) -> str:
        """Return a value to three digits, with its unit."""
        return f"{value:.3g} {self.unit}".rstrip()


def _priors() -> Iterator[Unknown]:
    with Path(__file__).with_name("priors.csv").open(encoding="utf-8", newline="") as opened:
        for cells in csv.DictReader(opened):
            middle, spread, least, most = (
                float(cells[name]) for name in ("middle", "spread", "least", "most")
            )
            names = cells["field"], cells["title"], cells["unit"]
            is_log, source = cells["is_log"] == "yes", cells["source"]
            yield Unknown(*names, is_log, middle, spread, least, most, source)


UNKNOWNS = tuple(_priors())
"""What calibration estimates, in the order of a calibration's mean and covariance."""


_Size = Annotated[int | float, Field(gt=0)]
_Range = Annotated[tuple[_Size, _Size], Field(strict=False)]
_Row = Annotated[tuple[float, ...], Field(strict=False)]
_Texts = Annotated[tuple[str, ...], Field(strict=False)]


class _Sizes(Section):
    """The table of a SizeRange."""

    diameters: _Range | None = None
    thicknesses: _Range
    balloons: _Range

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for name, ends in self:
            if ends is not None and ends[0] > ends[1]:
                raise ValueError(f"has {name} that are not in order; give the least one first")
        return self


class _HeldOut(Section):
    points: int = Field(ge=0)
    inside: int = Field(ge=0)


class ModelCalibration(Section):
    """A posterior: ``mean`` and ``covariance`` (n, n) of the coordinates of ``unknowns``, and
    ``discrepancy``, the relative standard deviation that the models miss, by group.

    ``film`` is the product of the evidence, ``evidence`` the sources that it was fitted to,
    ``ranges`` the sizes of its actuators by group of quantities; ``held_out`` says how many
    left-out points lay in their intervals. ``sentences`` state what the evidence cannot
    distinguish.
    """

    schema_name: Literal["sbafab/calibration@2"] = Field(alias="schema")
    name: str
    about: str
    film: str
    evidence: _Texts
    unknowns: _Texts
    mean: _Row
    covariance: Annotated[tuple[_Row, ...], Field(strict=False)]
    sentences: _Texts
    discrepancy: dict[str, Annotated[float, Field(ge=0, le=10)]]
    sizes: dict[str, _Sizes]
    held_out: _HeldOut

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Self:
        fields = [unknown.field for unknown in UNKNOWNS]
        if list(self.unknowns) != fields:
            raise ValueError(f"has other unknowns than {listed(fields)}, in this order")
        if len(self.mean) != len(fields):
            raise ValueError(f"has a mean of {len(self.mean)} numbers; it must be {len(fields)}")
        if {len(self.covariance), *map(len, self.covariance)} != {len(fields)}:
            raise ValueError(f"has a covariance that is not {len(fields)} by {len(fields)}")
        covariance = np.array(self.covariance)
        if not np.allclose(covariance, covariance.T) or np.linalg.eigvalsh(covariance).min() <= 0:
            raise ValueError("has a covariance that is not symmetric and positive definite")
        for unknown, coordinate in zip(UNKNOWNS, self.mean, strict=True):
            low, high = unknown.coordinate(unknown.least or 1e-9), unknown.coordinate(unknown.most)
            if not low - 1e-9 <= coordinate <= high + 1e-9:
                of = " (a logarithm)" if unknown.is_log else ""
                raise ValueError(
                    f"has a mean of {unknown.field}{of} of {coordinate:.3g}; it must be from "
                    f"{low:.3g} to {high:.3g}"
                )
        if set(self.discrepancy) != set(GROUPS) or not set(self.sizes) <= set(GROUPS):
            raise ValueError(f"must have a discrepancy, and may have sizes, of {listed(GROUPS)}")
        if self.held_out.inside > self.held_out.points:
            raise ValueError("has more held-out points inside than there are")
        return self

    @cached_property
    def ranges(self) -> dict[str, SizeRange]:
        """The sizes by group."""
        return {
            group: SizeRange(sizes.diameters, sizes.thicknesses, sizes.balloons)
            for group, sizes in self.sizes.items()
        }

    @cached_property
    def values(self) -> dict[str, Any]:
        """Median of each unknown, by field of ``Factors``."""
        return {u.field: u.value(z) for u, z in zip(UNKNOWNS, self.mean, strict=True)}

    @cached_property
    def factors(self) -> Factors:
        """The factors at the median."""
        return self._factors_at(self.values)

    def _factors_at(self, values: dict[str, Any]) -> Factors:
        return replace(Factors(**values), press_film=self.film)

    def bounds(self, field: str) -> tuple[float, float]:
        """Return the 90 % interval of an unknown."""
        row = [unknown.field for unknown in UNKNOWNS].index(field)
        unknown, half = UNKNOWNS[row], deviations(SHARE) * math.sqrt(self.covariance[row][row])
        return unknown.value(self.mean[row] - half), unknown.value(self.mean[row] + half)

    def shifted(self) -> list[tuple[float, Factors]]:
        """Return the factors with one design unknown after the other moved by about a standard
        deviation, and by how much its coordinate has moved.
        """
        moved = []
        for row in range(DESIGN_UNKNOWNS):
            unknown, start = UNKNOWNS[row], self.values[UNKNOWNS[row].field]
            step = math.sqrt(self.covariance[row][row])
            # Downwards where the upper end is near: a press factor is at most 1.
            value = unknown.value(self.mean[row] + step)
            if abs(unknown.coordinate(value) - self.mean[row]) < step / 2:
                value = unknown.value(self.mean[row] - step)
            change = unknown.coordinate(value) - unknown.coordinate(start)
            moved.append((change, self._factors_at({**self.values, unknown.field: value})))
        return moved

    def variance(self, slopes: Sequence[float]) -> float:
        """Return the variance by the unknowns of a quantity with these slopes (n,) by their
        coordinates; left-out ones at the end are 0.
        """
        rates = np.zeros(len(UNKNOWNS))
        rates[: len(slopes)] = slopes
        return float(rates @ np.array(self.covariance) @ rates)

    def interval(
        self,
        group: str,
        value: float,
        slopes: Sequence[float],
        is_log: bool,
        share: float = SHARE,
        farther: float = 0.0,
    ) -> tuple[float, float]:
        """Return the interval that holds the measured value with a probability of ``share``.

        ``slopes`` are the slopes of the logarithm of the value (``is_log``) or of the value, by
        coordinate; ``farther`` is the relative standard deviation assumed off the evidence.
        """
        missed = math.hypot(self.discrepancy[group], farther) * (1.0 if is_log else abs(value))
        half = deviations(share) * math.sqrt(self.variance(slopes) + missed**2)
        if is_log:
            return value * math.exp(-half), value * math.exp(half)
        return value - half, value + half

    def as_dict(self) -> dict[str, Any]:
        """Return the tables of the file."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)


@cache
def deviations(share: float) -> float:
    """Return the half width of the middle ``share`` of a normal distribution, in deviations."""
    low, high = 0.0, 40.0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if math.erf(middle / math.sqrt(2)) < share else (low, middle)
    return (low + high) / 2


@cache
def shipped_names() -> list[str]:
    """Return the names of the calibrations that ship."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_calibration(
    name: object, folder: Path | None = None, key: str = "models.calibration"
) -> ModelCalibration | None:
    """Return the calibration of a name, or of a file in ``folder``; None for "none". ``key`` is
    the key that gives the name.

    Raises DesignError with one sentence for an unknown name or a faulty file.
    """
    if not isinstance(name, str):
        raise DesignError(
            f"{key} = {shown(name)} must be a text in quotes: a calibration's name or its file"
        )
    if name == NONE:
        return None
    if name in shipped_names():
        return _shipped(name)
    path = (folder or Path()) / name
    try:
        is_there = path.is_file()
    except (OSError, ValueError):
        is_there = False
    if not is_there:
        raise DesignError(
            f'{key} = {shown(name)} is neither "none", nor one that ships '
            f"({', '.join(shipped_names())}), nor a file"
            + (" beside the design" if folder else "")
            + "; sbafab calibrate writes one"
        )
    return read_calibration(path)


@cache
def _shipped(name: str) -> ModelCalibration:
    return read_calibration(FOLDER / f"{name}.toml")


def read_calibration(path: Path) -> ModelCalibration:
    """Return the calibration of a file. Raises DesignError with one sentence for a fault in it."""
    try:
        return checked(ModelCalibration, read_toml(path), {}, file="calibration")
    except DesignError as error:
        message = str(error).strip().removeprefix(f"{path} ")
        raise DesignError(f"{path}: {message}; write it again with sbafab calibrate") from None
