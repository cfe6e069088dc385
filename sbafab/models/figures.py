"""What a prediction is made of: figures and curves that know their model and its trust."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sbafab.errors import DesignError
from sbafab.notebook import table_html


@dataclass(frozen=True)
class Model:
    """Where a number comes from: ``source`` is equation or section, ``trust`` how far it holds."""

    name: str
    source: str
    trust: str

    @property
    def title(self) -> str:
        """Name and source in one."""
        return f"{self.name} ({self.source})" if self.source else self.name

    def times(self, what: str, factor: float) -> Model:
        """The same with a calibration factor, named unless it is 1."""
        return self if factor == 1 else replace(self, name=f"{self.name} x {what} {factor:g}")


@dataclass(frozen=True)
class Figure:
    """One predicted number: ``value`` in ``unit``; ``group`` gathers what belongs together.

    ``other``: another model gives the same quantity, and that one is to design with.
    """

    group: str
    name: str
    value: float
    unit: str
    model: Model
    other: bool = False

    def as_dict(self) -> dict[str, Any]:
        return {
            "group": self.group,
            "name": self.name,
            "value": _rounded(self.value),
            "unit": self.unit,
            "model": self.model.title,
            "trust": self.model.trust,
            "design_with": not self.other,
        }


@dataclass(frozen=True)
class Trace:
    """A predicted curve; without a model, what the paper measured along it.

    The unit of ``x`` and that of ``y`` stand in the labels of the relation.
    """

    label: str
    x: Sequence[float]
    y: Sequence[float]
    model: Model | None = None


@dataclass(frozen=True)
class Points:
    """What the paper measured, each +- its error (0 where it gives none).

    The unit of ``x`` and that of ``y`` and its ``error`` stand in the labels of the relation.
    """

    label: str
    x: Sequence[float]
    y: Sequence[float]
    error: Sequence[float]


@dataclass(frozen=True)
class Relation:
    """One quantity against another: ``name`` is a file's stem, labels carry their units."""

    name: str
    title: str
    x_label: str
    y_label: str
    lines: tuple[Trace, ...]
    points: tuple[Points, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "title": self.title,
            "x": self.x_label,
            "y": self.y_label,
            "lines": [
                {
                    "label": line.label,
                    "model": line.model.title if line.model else "measured (paper)",
                    "trust": line.model.trust if line.model else "",
                    "x": [_rounded(value) for value in line.x],
                    "y": [_rounded(value) for value in line.y],
                }
                for line in self.lines
            ],
            "measured": [
                {
                    "label": points.label,
                    "x": [_rounded(value) for value in points.x],
                    "y": [_rounded(value) for value in points.y],
                    "error": list(points.error),
                }
                for points in self.points
            ],
        }


@dataclass(frozen=True)
class LeftOut:
    """A figure that is not given, and why."""

    name: str
    reason: str


@dataclass(frozen=True)
class Factors:
    """What a measurement of one's own says; the defaults leave models as they are.

    ``press_factor`` is what is left of the films' thickness after pressing, ``contact_factor`` the
    measured force over that of the paper's own models. The elastic balloon takes ``pocket_loss``,
    by how many mm the press leaves pockets smaller in radius than drawn, and ``modulus_mpa``, the
    film's modulus where it is not the one of the design.
    """

    press_factor: float = 1.0
    contact_factor: float = 1.0
    pocket_loss: float = 0.0
    modulus_mpa: float | None = None

    def __post_init__(self) -> None:
        for name, value, most in (
            ("press factor", self.press_factor, 1.0),
            ("contact factor", self.contact_factor, 10.0),
        ):
            if not 0 < value <= most:
                raise DesignError(f"{name} = {value:g} must be above 0 and at most {most:g}")
        if not 0 <= self.pocket_loss <= 100:
            raise DesignError(f"pocket loss = {self.pocket_loss:g} mm must be from 0 to 100 mm")
        if self.modulus_mpa is not None and not 0.1 <= self.modulus_mpa <= 1e4:
            raise DesignError(f"modulus = {self.modulus_mpa:g} MPa must be from 0.1 to 10000 MPa")


@dataclass(frozen=True)
class Asked:
    """What a prediction is asked for: kPa, ml/min into each chamber or all, ul a balloon."""

    pressures_kpa: tuple[float, ...] = (10.0, 100.0)
    flow_ml_min: float = 35.0
    volumes_ul: tuple[float, ...] = ()
    calibration: Factors = field(default_factory=Factors)


@dataclass(frozen=True, repr=False)
class Prediction:
    """All that is predicted of one design."""

    asked: Asked
    figures: tuple[Figure, ...]
    relations: tuple[Relation, ...]
    left_out: tuple[LeftOut, ...]

    def value(self, name: str, model: str = "") -> float:
        """The value, in its figure's unit, of this name by the model whose title begins so.

        Raises KeyError where there is none, or where several models give one and none is named.
        """
        named = [figure for figure in self.figures if figure.name == name]
        found = [figure for figure in named if figure.model.title.startswith(model)]
        if not named:
            near = difflib.get_close_matches(name, [figure.name for figure in self.figures], 3)
            hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
            raise KeyError(f"no figure is named {name!r}{hint}")
        if len(found) != 1:
            titles = ", ".join(repr(figure.model.title) for figure in found or named)
            raise KeyError(f"{name!r} is given by {titles}; name one of these models")
        return found[0].value

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row a figure, for example for ``pandas.DataFrame(prediction.rows)``."""
        return [figure.as_dict() for figure in self.figures]

    def __repr__(self) -> str:
        left = f", {len(self.left_out)} left out" if self.left_out else ""
        return f"Prediction({len(self.figures)} figures, {len(self.relations)} curves{left})"

    def _repr_html_(self) -> str:
        head = ("", "", "unit", "model", "validity")
        first = sorted(self.figures, key=lambda figure: figure.other)
        rows = [
            (
                f"{f.name} (other model)" if f.other else f.name,
                f.value,
                f.unit,
                f.model.title,
                f.model.trust,
            )
            for f in first
        ]
        left = [(left.name, None, "", "not predicted", left.reason) for left in self.left_out]
        return table_html(head, [*rows, *left])

    def as_dict(self) -> dict[str, Any]:
        """What ``predict.json`` holds of it."""
        return {
            "asked": {
                "pressures_kpa": list(self.asked.pressures_kpa),
                "flow_ml_min": self.asked.flow_ml_min,
                "volumes_ul": list(self.asked.volumes_ul),
                "press_factor": self.asked.calibration.press_factor,
                "contact_factor": self.asked.calibration.contact_factor,
                "pocket_loss": self.asked.calibration.pocket_loss,
                "modulus_mpa": self.asked.calibration.modulus_mpa,
            },
            "figures": [figure.as_dict() for figure in self.figures],
            "left_out": [{"name": left.name, "reason": left.reason} for left in self.left_out],
            "relations": [relation.as_dict() for relation in self.relations],
        }


def _rounded(value: float) -> float:
    """Seven digits: what a model says, without the noise of arithmetic."""
    if value == 0 or not math.isfinite(value):
        return 0.0
    digits = 6 - math.floor(math.log10(abs(value)))
    return 0.0 if abs(value) < 1e-9 else round(float(value), digits)
