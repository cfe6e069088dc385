"""Sensitivities of free stroke and bend to a design's keys: diameter, film, modulus, number of
balloons.

They are central differences of poses: for the modulus of all films by a small step, since maps
scale with it exactly, for other keys by newly mapped balloons. The number of balloons is an
integer: its derivative is half the change over two steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

from sbafab.actuators import build
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.models.calibration import factors_of
from sbafab.models.figures import Factors
from sbafab.models.stack import Pose, Stack, stack

KEYS = (
    "chamber.diameter",
    "bond.width",
    "films.tpe.thickness",
    "films.tpe.modulus",
    "stack.balloons",
)
STRAIGHT = 1e-4
"""Bend in degrees below which a stack stands straight."""
SHARE, EXACT_SHARE = 0.1, 3e-4
"""Relative step of a key, either way, for newly mapped balloons: maps are fitted, and smaller steps
show more of their errors. And that of the modulus."""


@dataclass(frozen=True)
class SensitivityRow:
    """The change in percent of the free ``stroke`` for 1 % more of a ``key``, and of the ``bend``
    of one chamber (None if it does not bend); the ratio of the changes.
    """

    key: str
    value: float
    stroke: float
    bend: float | None


def sensitivity_table(design: Design, pressure: float) -> list[SensitivityRow]:
    """Return a row per key of KEYS for a pressure in kPa in all chambers, and in one for the bend.

    Rim contacts that open or close are smoothed over the step of a key. Raises DesignError for
    pockets that are not round, and for a key that is not a single number.
    """
    factors = factors_of(design)
    whole = stack(design, factors=factors)
    count = whole.chambers
    free = whole.pose((pressure,) * count)
    bent = whole.pose((pressure, *(0.0,) * (count - 1)))
    rows = []
    for key in KEYS:
        value = _value(design, key)
        step, ends = _ends(design, key, value, whole, pressure, factors)
        scale = value / (2 * step)
        stroke = scale * _change(ends, free, _rise) / _rise(free)
        is_bent = count > 1 and bent.bend > STRAIGHT
        bend = scale * _change(ends, bent, attrgetter("bend")) / bent.bend if is_bent else None
        rows.append(SensitivityRow(key, value, stroke, bend))
    return rows


def _ends(
    design: Design, key: str, value: float, whole: Stack, pressure: float, factors: Factors
) -> tuple[float, list[Stack]]:
    """Return the step of a key, and the stacks one step below and above."""
    if key.endswith(".modulus") and _is_film_of_all(design, key):
        # Maps of softer films end at less pressure.
        sides = (-1, 1) if pressure * (1 + EXACT_SHARE) < whole.most_pressure else (0, 2)
        ratios = [1 + side * EXACT_SHARE for side in sides]
        maps = [tuple(kind.stiffened(ratio) for kind in whole.maps) for ratio in ratios]
        return EXACT_SHARE * value, [replace(whole, maps=each) for each in maps]
    step = 1 if isinstance(value, int) else SHARE * value
    designs = [design.with_({key: value + side * step}) for side in (-1, 1)]
    return step, [stack(each, factors=factors) for each in designs]


def _change(ends: list[Stack], pose: Pose, measure: Callable[[Pose], float]) -> float:
    """Return the difference of a measure of poses at equal pressures between two stacks."""
    low, high = (
        each.pose(pose.pressures, near=pose if len(each.levels) == len(pose.gaps) else None)
        for each in ends
    )
    return measure(high) - measure(low)


def _rise(pose: Pose) -> float:
    return pose.height - pose.pitch * len(pose.gaps)


def _value(design: Design, key: str) -> int | float:
    """Return the value of a key of a design. Raises DesignError."""
    value: Any = design
    for name in key.split("."):
        value = getattr(value, name, None)
    if isinstance(value, bool) or not isinstance(value, int | float) or not value:
        raise DesignError(
            f"{key} is not a number above 0 in this design; give keys such as {', '.join(KEYS[:3])}"
        )
    return value


def _is_film_of_all(design: Design, key: str) -> bool:
    """Return True if a key is the modulus of all bonded films."""
    films = {layer.film for layer in build(design).layers if not layer.is_mask}
    return films == {design.films.stock[key.split(".")[1]]}
