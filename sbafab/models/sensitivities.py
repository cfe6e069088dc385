"""Rates of a design's pose by its keys: diameter, film, modulus, number of balloons.

The equilibrium follows a key by the implicit function theorem (``derivatives``), from the change of
the energy's slope with the plates held. For the modulus that change is exact: stresses, and so the
films' energy U = W + p V, are proportional to it. For other keys it is a central difference of
newly mapped balloons. The number of balloons is an integer: its rate is half the change by two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from sbafab.actuators import build
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.models.calibration import factors_of
from sbafab.models.derivatives import Linearised, Rates, linearised_poses
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Array
from sbafab.models.stack import MOST_PRESSURE, Pose, Stack, stack
from sbafab.models.stack_loads import NO_LOAD, WALL_POINTS, energy, plate_chain

KEYS = (
    "chamber.diameter",
    "bond.width",
    "films.tpe.thickness",
    "films.tpe.modulus",
    "stack.balloons",
)
"""Default keys for rates."""
STRAIGHT = 1e-6
"""Turn in rad below which a stack stands straight."""
SHARE = 0.1
"""Relative step of a key, either way, for newly mapped balloons: maps are fitted, and smaller steps
show more of their errors. Rates by the modulus come within 8 % of the exact ones."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Rates of a ``pose`` by a unit of a ``key`` of the design, which has a ``value``: ``rates`` of
    tip, volumes and force, and ``flat`` of the flat stack's height in mm.

    ``rates.freedoms`` are empty where the number of levels changes.
    """

    key: str
    value: float
    pose: Pose
    rates: Rates
    flat: float

    @property
    def stroke(self) -> float:
        """Relative change of the rise above the flat stack, as a ratio to the key's change."""
        rise = self.pose.height - self.pose.pitch * len(self.pose.freedoms)
        return (float(self.rates.tip[2, 0]) - self.flat) * self.value / rise

    @property
    def bend(self) -> float | None:
        """Relative change of the bend, as a ratio to the key's change; None if it stands straight
        or is bent by half a turn.
        """
        vector = rotation_vector(self.pose.frames[1][-1])
        angle = float(np.linalg.norm(vector))
        if not STRAIGHT < angle < math.pi - STRAIGHT:
            return None
        return float(self.rates.turn[:, 0] @ vector) / angle**2 * self.value


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
    ``Stack.pose`` beside pressures. For lengths of pockets and rims, contacts of rims that open or
    close are smoothed over that step. Raises DesignError for keys that are not a single number, and
    as ``Stack.pose`` does.
    """
    factors = factors or factors_of(design)

    def stack_with(key: str = "", value: float = 0.0) -> Stack:
        other = design.with_({key: value}) if key else design
        return stack(other, most_pressure=most_pressure, factors=factors)

    whole = stack_with()
    pose = whole.pose(pressures, **load)
    at = linearised_poses(whole.states_of(pose, whole.acting(load)))
    rows = []
    for key in keys:
        value = _value(design, key)
        if isinstance(value, int):
            ends = [stack_with(key, value + side) for side in (-1, 1)]
            low, high = (each.pose(pressures, **load) for each in ends)
            flat = (ends[1].flat_height - ends[0].flat_height) / 2
            rows.append(Sensitivity(key, value, pose, _difference(low, high), flat))
        elif key.endswith(".modulus") and _is_film_of_all(design, key, factors):
            rows.append(Sensitivity(key, value, pose, _by_modulus(at, pose, value), 0.0))
        else:
            step = SHARE * value
            around = whole, stack_with(key, value - step), stack_with(key, value + step)
            rows.append(_by_key(key, value, around, at, pose, load, step))
    return rows


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


def rotation_vector(turned: Array) -> Array:
    """Return the axis of a rotation (3, 3) times its angle in rad."""
    vector = np.array(
        [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    )
    sine = float(np.linalg.norm(vector)) / 2
    angle = math.atan2(sine, (np.trace(turned) - 1) / 2)
    return np.asarray(vector * (angle / sine / 2 if sine > 1e-12 else 0.5))


def _difference(low: Pose, high: Pose) -> Rates:
    """Return half the difference of two poses."""
    vector = rotation_vector(high.frames[1][-1] @ low.frames[1][-1].T)
    return Rates(
        ((high.tip - low.tip) / 2)[:, None],
        (vector / 2)[:, None],
        ((high.volumes - low.volumes) / 2)[:, None],
        np.array([(high.force - low.force) / 2]),
        np.zeros((0, 3, 1)),
    )


def _by_modulus(at: Linearised, pose: Pose, value: float) -> Rates:
    """Return the rates by the modulus of all films, exact but for contacts' stiffness."""
    p = np.array(pose.pressures)
    # U is W + p V; and V(p, E) = V(p / E).
    films = at.springs.order(at.at, 0)[1].sum(2)
    slopes = films.reshape(1, -1) + at.filling @ p
    return at.rates(-slopes[..., None] / value, (-p * at.swelling / value)[..., None]).part(0)


def _by_key(
    key: str,
    value: float,
    stacks: tuple[Stack, Stack, Stack],
    at: Linearised,
    pose: Pose,
    load: dict[str, Any],
    step: float,
) -> Sensitivity:
    """Return the rates by a key, from the stack and those with a step of it less and more."""
    whole, *ends = stacks
    if any((each.levels != whole.levels).any() for each in ends):
        raise DesignError(f"{key} changes which balloons are equal; ask for another key")
    touch = at.energy.touch
    forces = None if touch is None else touch.forces
    low, high = (_held(each, at.at, pose, load, forces) for each in ends)
    slope, volumes, tip, deep = ((b - a) / (2 * step) for a, b in zip(low, high, strict=True))
    pulls, force = -slope, 0.0
    if touch is not None:
        # A stiff plate keeps its contacts.
        harder = touch.stiff_touches * deep
        pulls = pulls - (harder[:, None] @ at.energy.deeper())[:, 0]
        force = float(harder[:, :WALL_POINTS].sum())
    motion = np.concatenate([tip, np.zeros((1, 3))], axis=1)
    by_key = at.rates(pulls[..., None], volumes[..., None], motion[..., None], force).part(0)
    return Sensitivity(
        key, value, pose, by_key, (ends[1].flat_height - ends[0].flat_height) / (2 * step)
    )


def _held(
    changed_stack: Stack, freedoms: Array, pose: Pose, load: dict[str, Any], forces: Array | None
) -> tuple[Array, Array, Array, Array]:
    """Return of a stack with its plates held the slope (1, freedoms) of its energy against given
    contact forces, volumes (1, chambers), tip (1, 3) in mm and depths in an outer plate (1, points)
    in mm.
    """
    springs = changed_stack.springs(np.array([pose.pressures]), sucked=True, by_level=True)
    now = energy(
        springs, changed_stack.pitch, changed_stack.acting(load) or NO_LOAD, freedoms, forces
    )
    deep = np.zeros((1, 0)) if now.touch is None else now.touch.deep
    volumes = springs.order(freedoms, 1, with_rates=False)[0].sum(1)
    return now.gradient, volumes, plate_chain(freedoms, changed_stack.pitch).tip, deep
