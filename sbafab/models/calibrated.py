"""A calibration: the posterior of the models' unknowns with the discrepancy that remains, as a file
that designs and kits name, and the 90 % intervals of predictions that follow from it.

Unknowns have a normal posterior in their coordinates. A prediction is linear in them: its
logarithm, or the prediction itself where it may be 0 or below, changes by its slope times the
change of each unknown. What the models miss beyond that is a relative discrepancy, one standard
deviation for each group of quantities; farther from the evidence of a group, in size, film or
number of balloons, more is assumed to be missed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from sbafab.design.files import listed, read_toml, shown
from sbafab.errors import DesignError
from sbafab.models.figures import Factors
from sbafab.models.unknowns import UNKNOWNS, factors_at

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array

SCHEMA = "sbafab/calibration@2"
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
class ModelCalibration:
    """A posterior: ``mean`` and ``covariance`` (n, n) of the coordinates of ``UNKNOWNS``, and
    ``discrepancy``, the relative standard deviation that the models miss, by group.

    ``film`` is the product of the evidence, ``evidence`` the sources that it was fitted to,
    ``sizes`` the sizes of its actuators by group of quantities; ``inside`` of ``points`` left-out
    points lay in their intervals. ``sentences`` state what the evidence cannot distinguish.
    """

    name: str
    about: str
    film: str
    evidence: tuple[str, ...]
    mean: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    discrepancy: Mapping[str, float]
    sizes: Mapping[str, SizeRange]
    points: int
    inside: int
    sentences: tuple[str, ...]

    @cached_property
    def values(self) -> dict[str, float]:
        """Median of each unknown, by field of ``Factors``."""
        return {u.field: u.value(z) for u, z in zip(UNKNOWNS, self.mean, strict=True)}

    @cached_property
    def factors(self) -> Factors:
        """The factors at the median."""
        return self._factors_at(self.values)

    def _factors_at(self, values: Mapping[str, float]) -> Factors:
        return replace(factors_at(values), press_film=self.film)

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
        return {
            "schema": SCHEMA,
            "name": self.name,
            "about": self.about,
            "film": self.film,
            "evidence": list(self.evidence),
            "unknowns": [unknown.field for unknown in UNKNOWNS],
            "mean": list(self.mean),
            "covariance": [list(row) for row in self.covariance],
            "sentences": list(self.sentences),
            "discrepancy": dict(self.discrepancy),
            "sizes": {group: _listed(sizes) for group, sizes in self.sizes.items()},
            "held_out": {"points": self.points, "inside": self.inside},
        }


def _listed(sizes: SizeRange) -> dict[str, list[float]]:
    return {name: list(ends) for name, ends in sizes._asdict().items() if ends is not None}


@cache
def deviations(share: float) -> float:
    """Return the half width of the middle ``share`` of a normal distribution, in deviations."""
    low, high = 0.0, 40.0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if math.erf(middle / math.sqrt(2)) < share else (low, middle)
    return (low + high) / 2


def shipped_names() -> list[str]:
    """Return the names of the calibrations that ship."""
    folder = resources.files("sbafab.models").joinpath("calibrations")
    return sorted(path.name[:-5] for path in folder.iterdir() if path.name.endswith(".toml"))


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
    file = resources.files("sbafab.models").joinpath("calibrations", f"{name}.toml")
    with resources.as_file(file) as path:
        return read_calibration(path)


def read_calibration(path: Path) -> ModelCalibration:
    """Return the calibration of a file. Raises DesignError with one sentence for a fault in it."""
    tables = read_toml(path)
    try:
        return _checked(tables)
    except DesignError as error:
        raise DesignError(f"{path}: {error}; write it again with sbafab calibrate") from None


KEYS = {
    "schema": str,
    "name": str,
    "about": str,
    "film": str,
    "evidence": list,
    "unknowns": list,
    "mean": list,
    "covariance": list,
    "sentences": list,
    "discrepancy": dict,
    "sizes": dict,
    "held_out": dict,
}


def _check_keys(tables: Mapping[str, Any]) -> None:
    if tables.get("schema") != SCHEMA:
        raise DesignError(f"schema = {shown(tables.get('schema'))} must be {SCHEMA!r}")
    for key in tables:
        if key not in KEYS:
            raise DesignError(f"{shown(key)} is no key of a calibration; it has {listed(KEYS)}")
    for key, kind in KEYS.items():
        if not isinstance(tables.get(key), kind):
            raise DesignError(f"{key} is missing or not a {kind.__name__}")


def _checked(tables: Mapping[str, Any]) -> ModelCalibration:
    _check_keys(tables)
    fields = [unknown.field for unknown in UNKNOWNS]
    if tables["unknowns"] != fields:
        raise DesignError(f"unknowns must be {listed(fields)}, in this order")
    count = len(tables["unknowns"])
    mean = _numbers(tables["mean"], "mean", (count,))
    covariance = _numbers(tables["covariance"], "covariance", (count, count))
    if not np.allclose(covariance, covariance.T) or np.linalg.eigvalsh(covariance).min() <= 0:
        raise DesignError("covariance must be symmetric and positive definite")
    for unknown, coordinate in zip(UNKNOWNS, mean, strict=True):
        low, high = unknown.coordinate(unknown.least or 1e-9), unknown.coordinate(unknown.most)
        if not low - 1e-9 <= coordinate <= high + 1e-9:
            raise DesignError(
                f"mean of {unknown.field} must be from {low:.3g} to {high:.3g}"
                + (" (a logarithm)" if unknown.is_log else "")
            )
    spreads: dict[str, Any] = {group: tables["discrepancy"].get(group) for group in GROUPS}
    for group, value in spreads.items():
        if not isinstance(value, int | float) or not 0 <= value <= 10:
            raise DesignError(f'discrepancy."{group}" must be a number from 0 to 10')
    held = tables["held_out"]
    points, inside = held.get("points"), held.get("inside")
    if not (isinstance(points, int) and isinstance(inside, int) and 0 <= inside <= points):
        raise DesignError("held_out must have points, and inside, at most as many")
    return ModelCalibration(
        tables["name"],
        tables["about"],
        tables["film"],
        tuple(map(str, tables["evidence"])),
        tuple(mean.tolist()),
        tuple(tuple(row) for row in covariance.tolist()),
        spreads,
        {group: _sizes(group, table) for group, table in tables["sizes"].items()},
        points,
        inside,
        tuple(map(str, tables["sentences"])),
    )


def _sizes(group: str, table: object) -> SizeRange:
    """Return the sizes of a group's evidence. Raises DesignError."""
    names = SizeRange._fields
    if group not in GROUPS or not isinstance(table, dict) or not set(table) <= set(names):
        raise DesignError(f"sizes.{shown(group)} must be a table of {listed(names)}, by group")
    ends: list[Ends | None] = []
    for name in names:
        given = table.get(name)
        if given is None and name == "diameters":
            ends.append(None)
            continue
        low, high = _numbers(given, f"sizes.{shown(group)}.{name}", (2,)).tolist()
        if not 0 < low <= high:
            raise DesignError(f"sizes.{shown(group)}.{name} must be two numbers above 0, in order")
        ends.append((low, high))
    return SizeRange(*ends)  # type: ignore[arg-type]


def _numbers(values: object, key: str, shape: tuple[int, ...]) -> Array:
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        array = np.full(0, np.nan)
    if array.shape != shape or not np.isfinite(array).all():
        size = " by ".join(map(str, shape))
        raise DesignError(f"{key} must be {size} finite numbers")
    return array
