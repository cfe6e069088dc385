"""Rates of a design's pose by its keys: diameter, film, modulus, number of balloons.

They are central differences of poses: for the modulus of all films by a small step, for maps scale
with it exactly, for other keys by newly mapped balloons. The number of balloons is an integer: its
rate is half the change by two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from sbafab.actuators import build
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.models.calibration import factors_of
from sbafab.models.derivatives import Rates
from sbafab.models.figures import Factors
from sbafab.models.stack import MOST_PRESSURE, Pose, Stack, stack

KEYS = (
    "chamber.diameter",
    "bond.width",
    "films.tpe.thickness",
    "films.tpe.modulus",
    "stack.balloons",
)
"""Default keys for rates."""
STRAIGHT = 1e-4
"""Bend in degrees below which a stack stands straight."""
SHARE, EXACT_SHARE = 0.1, 3e-4
"""Relative step of a key, either way, for newly mapped balloons: maps are fitted, and smaller steps
show more of their errors. And that of the modulus."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Rates of a ``pose`` by a unit of a ``key`` of the design, which has a ``value``: ``rates`` of
    tip, turn, volumes and force.

    ``stroke`` is the relative change of the rise above the flat stack, and ``bend`` that of the
    bend, as ratios to the key's change; ``bend`` is None for a stack that stands straight.
    """

    key: str
    value: float
    pose: Pose
    rates: Rates
    stroke: float
    bend: float | None


@dataclass(frozen=True)
class SensitivityRow:
    """Change in percent of the free ``stroke`` for 1 % more of a ``key``, and of the ``bend`` of
    one chamber, None if it does not bend; the ratio of the changes.
    """

    key: str
    value: float
    stroke: float
    bend: float | None


def sensitivities(
    design: Design,
    pressures: Sequence[float],
    keys: Sequence[str] = KEYS,
    factors: Factors | None = None,
    most_pressure: float = MOST_PRESSURE,
    **load: Any,
) -> list[Sensitivity]:
    """Return the rates of a design's pose at pressures (kPa, one a chamber) by each of ``keys``.

    Default ``factors`` come from the design's calibration; ``load`` are keyword arguments of
    ``Stack.pose`` beside pressures. Contacts of rims that open or close are smoothed over the step
    of a key. Raises DesignError for keys that are not a single number, and
    as ``Stack.pose`` does.
    """
    factors = factors or factors_of(design)

    def stack_with(key: str, value: float) -> Stack:
        other = design.with_({key: value})
        return stack(other, most_pressure=most_pressure, factors=factors)

    whole = stack(design, most_pressure=most_pressure, factors=factors)
    pose = whole.pose(pressures, **load)
    rows = []
    for key in keys:
        value = _value(design, key)
        if isinstance(value, int):
            step: float = 1
            ends = [stack_with(key, value + side) for side in (-1, 1)]
        elif key.endswith(".modulus") and _is_film_of_all(design, key, factors):
            step = EXACT_SHARE * value
            # Maps of softer films end at less pressure.
            sides = (-1, 1) if max(pressures) * (1 + step / value) < whole.most_pressure else (0, 2)
            ratios = [1 + side * EXACT_SHARE for side in sides]
            ends = [
                replace(whole, maps=tuple(kind.stiffened(ratio) for kind in whole.maps))
                for ratio in ratios
            ]
        else:
            step = SHARE * value
            ends = [stack_with(key, value + side * step) for side in (-1, 1)]
        poses = [
            each.pose(pressures, near=pose if len(each.levels) == len(pose.gaps) else None, **load)
            for each in ends
        ]
        rows.append(_sensitivity(key, value, pose, poses, 2 * step))
    return rows


def _sensitivity(
    key: str, value: float, pose: Pose, ends: Sequence[Pose], by: float
) -> Sensitivity:
    """Return the rates by a key, which changes ``by`` so much from the first of the ends to the
    other.
    """
    low, high = ends
    turned = high.frames[1][-1] @ low.frames[1][-1].T
    turn = (turned - turned.T)[[2, 0, 1], [1, 2, 0]] / 2
    parts = high.tip - low.tip, turn, high.volumes - low.volumes, high.force - low.force
    rates = Rates(*(np.asarray(part)[..., None] / by for part in parts))
    rises = [each.height - each.pitch * len(each.gaps) for each in (pose, low, high)]
    stroke = (rises[2] - rises[1]) / by * value / rises[0]
    bend = (high.bend - low.bend) / by * value / pose.bend if pose.bend > STRAIGHT else None
    return Sensitivity(key, value, pose, rates, stroke, bend)


def sensitivity_table(design: Design, pressure: float) -> list[SensitivityRow]:
    """Return a row per key of KEYS for a pressure in kPa in all chambers, and in one for the bend.

    Raises DesignError for pockets that are not round.
    """
    chambers = len(build(design).chambers)
    free = sensitivities(design, (pressure,) * chambers)
    bends: list[float | None] = [None] * len(free)
    if chambers > 1:
        bent = sensitivities(design, (pressure, *(0.0,) * (chambers - 1)))
        bends = [row.bend for row in bent]
    return [
        SensitivityRow(row.key, row.value, row.stroke, bend)
        for row, bend in zip(free, bends, strict=True)
    ]


def _value(design: Design, key: str) -> int | float:
    """Return the value of a key of a design. Raises DesignError."""
    try:
        value: Any = reduce(getattr, key.split("."), design)
    except AttributeError:
        value = None
    if isinstance(value, bool) or not isinstance(value, int | float) or not value:
        raise DesignError(
            f"{key} is not a number above 0 in this design; give keys such as {', '.join(KEYS[:3])}"
        )
    return value


def _is_film_of_all(design: Design, key: str, factors: Factors) -> bool:
    """Return True if a key is the modulus of all films that are bonded."""
    films = {layer.film for layer in build(design).layers if not layer.is_mask}
    name = key.split(".")[1]
    return films == {design.films.stock[name]} and factors.modulus_mpa is None
