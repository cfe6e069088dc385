"""Plates joined by balloons in equilibrium at given pressures, many states at once; one pose is a
batch of one.

Without a load, levels of equal balloons are equal and solved once. An outer plate is stiffened
gradually: a stiff one would meet one point of the top after another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.errors import DesignError
from sbafab.models.balloon_map import DEGREE, BalloonMap, holds_at
from sbafab.models.film_elements import Array
from sbafab.models.stack_balance import descent
from sbafab.models.stack_loads import (
    RING_POINTS,
    Chain,
    GapPlaces,
    Load,
    OuterPlate,
    Springs,
    energy,
    plate_chain,
)

CHUNK, LOADED_CHUNK = 512, 256
"""States solved together, without and with a load: more bring no speed, and cost memory."""
SOFT_PLATES = (1e3, 1e4, 1e5)
"""Stiffness in mN/mm of an outer plate in the first solutions."""
ROUGH_STEP = 1e-3
"""Last step (mm, rad) against a soft plate."""
RIM_POINTS = 24
"""Least number of points round a level's outline where its rims may meet the next level's."""
LOADS: dict[str, Any] = {"tip_load": (0.0, 0.0, 0.0), "gravity": False, "plate": None}
"""Loads of a pose, with their defaults."""
NOT_FOUND = (
    "no equilibrium of the stack found at these pressures, under this load; try a smaller one"
)


@dataclass(frozen=True)
class Plate:
    """An outer plate that the tip may push on: through ``point`` (mm), with an outward ``normal``.

    ``Plate.at(height)`` lies level. With ``sticks`` friction holds the middle of the tip on the
    line through the point along the normal, also above or below the plate; without, it slides along
    the plate.
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    sticks: bool = True

    @classmethod
    def at(cls, height: float) -> Plate:
        """Return a level plate at a height in mm above the base."""
        return cls((0.0, 0.0, height))


@dataclass(frozen=True, eq=False)
class Pose:
    """A stack in equilibrium at ``pressures`` (kPa, one per chamber).

    ``pitch`` is the height of a flat level in mm, ``freedoms`` (levels, 3) are rise in mm and tilt
    in rad of each level; ``gaps`` (levels, chambers) is the rise in mm of each balloon at its
    centre; ``volumes`` in ul per chamber; ``force`` N on the outer plate; ``energy`` uJ stored in
    the films. A pose that is not ``stable`` is an unstable equilibrium, such as a straight column
    that would buckle.
    """

    pressures: tuple[float, ...]
    freedoms: Array
    gaps: Array
    volumes: Array
    force: float
    energy: float
    stable: bool
    pitch: float

    @cached_property
    def _chain(self) -> Chain:
        return plate_chain(self.freedoms, self.pitch)

    @property
    def frames(self) -> tuple[Array, Array]:
        """The origins (n, 3) in mm and axes (n, 3, 3) of the plates, the base first; the columns of
        ``axes[i]`` are the x, y and z of plate i.
        """
        return self._chain.places, self._chain.axes

    @property
    def tip(self) -> Array:
        """The middle of the top plate (3,) in mm."""
        return self._chain.tip

    @property
    def height(self) -> float:
        """The height of the middle of the top plate above the base, mm."""
        return float(self.tip[2])

    @property
    def bend(self) -> float:
        """Degrees from base to top, summed along the stack, so it may exceed half a turn."""
        return math.degrees(math.hypot(*self.freedoms[:, 1:].sum(0)))

    @property
    def direction(self) -> float:
        """The bending direction in degrees around the base from x; 0 for a straight stack."""
        x, y = self.freedoms[:, 1:].sum(0)
        return math.degrees(math.atan2(-x, y)) if math.hypot(x, y) > 1e-9 else 0.0


@dataclass(frozen=True, eq=False)
class BatchPoses:
    """N poses of a ``column`` under a ``load`` at ``pressures`` (N, chambers) in kPa.

    ``freedoms`` (N, levels, 3) are rise in mm and tilt in rad of each level; ``pushes`` (N,) mN on
    an outer plate; with masks (N,) of stable states and of those found.
    """

    column: Column
    load: Load | None
    pressures: Array
    freedoms: Array
    pushes: Array
    is_stable: NDArray[np.bool_]
    is_found: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.pressures)

    @property
    def _arrays(self) -> tuple[Any, ...]:
        return self.pressures, self.freedoms, self.pushes, self.is_stable, self.is_found

    def part(self, which: Any) -> BatchPoses:
        """Return some of the states."""
        return BatchPoses(self.column, self.load, *(part[which] for part in self._arrays))

    def replaced(self, which: Any, other: BatchPoses) -> BatchPoses:
        """Return the states with some of them replaced by another batch's."""
        arrays = [part.copy() for part in self._arrays]
        for mine, its in zip(arrays, other._arrays, strict=True):
            mine[which] = its
        return BatchPoses(self.column, self.load, *arrays)

    @classmethod
    def joined(cls, parts: Sequence[BatchPoses]) -> BatchPoses:
        """Return the states of several batches under one load."""
        arrays = zip(*(part._arrays for part in parts), strict=True)
        return cls(parts[0].column, parts[0].load, *(np.concatenate(each) for each in arrays))

    @cached_property
    def _stored(self) -> tuple[Array, Array]:
        """The volumes (N, chambers) in ul, and energies of the films (N,) in uJ."""
        column, is_alike = self.column, self.load is None
        if not len(self):
            return np.zeros(self.pressures.shape), np.zeros(0)
        # With three orders volumes are those of ``linearised`` to the last digit: a shut valve
        # leaves pressures as they are.
        springs = column.springs(self.pressures, sucked=True, by_level=not is_alike, orders=3)
        at = column.rows_of(self.freedoms, self.load)
        stored, each = springs.order(at, [0, 1], with_rates=False)[0]
        counts = column.counts(self.load)
        volumes = counts @ each
        return volumes, stored.sum(-1) @ counts + (self.pressures * volumes).sum(-1)

    @property
    def volumes(self) -> Array:
        """The volumes of the chambers in ul: (N, chambers)."""
        return self._stored[0]

    @property
    def energies(self) -> Array:
        """The energies stored in the films in uJ: (N,)."""
        return self._stored[1]

    @cached_property
    def tips(self) -> Array:
        """The middles of the top plates in mm: (N, 3)."""
        return plate_chain(self.freedoms, self.column.pitch).tip

    @property
    def heights(self) -> Array:
        """The heights of the middles of the top plates above the base in mm: (N,)."""
        return np.asarray(self.tips[:, 2])

    @property
    def bends(self) -> Array:
        """Degrees from base to top, along the stack: (N,)."""
        return np.asarray(np.degrees(np.hypot(*self.freedoms[:, :, 1:].sum(1).T)))

    @property
    def forces(self) -> Array:
        """The forces in N on an outer plate: (N,)."""
        return self.pushes / 1000

    @cached_property
    def excess(self) -> Array:
        """The height in mm of a balloon above its map: (N,)."""
        above = self.freedoms @ self.column.centres - self.column.tops[self.column.levels]
        return np.asarray(above.max((1, 2), initial=-math.inf))

    @property
    def is_met(self) -> NDArray[np.bool_]:
        """True for states that were found with all balloons on their maps: (N,)."""
        return np.asarray(self.is_found & (self.excess <= 0))

    def pose(self, number: int = 0) -> Pose:
        """Return one of the states. Raises DesignError if it has no pose."""
        self.part(slice(number, number + 1)).met()
        freedoms = self.freedoms[number]
        return Pose(
            tuple(self.pressures[number].tolist()),
            freedoms,
            freedoms @ self.column.centres,
            self.volumes[number],
            float(self.pushes[number]) / 1000,
            float(self.energies[number]),
            bool(self.is_stable[number]),
            self.column.pitch,
        )

    def met(self) -> BatchPoses:
        """Return the states. Raises DesignError for the first without a pose."""
        for number in np.flatnonzero(~self.is_met)[:1]:
            if not self.is_found[number]:
                raise DesignError(NOT_FOUND)
            raise DesignError(
                "a balloon would rise beyond the stretch limit of its films "
                f"({self.excess[number]:.2g} mm above {self.column.tops.min():.3g} mm); reduce "
                "the pressure or load"
            )
        return self


@dataclass(frozen=True, eq=False)
class Column:
    """Plates joined by balloons, in equilibrium at given pressures. Fields as in ``Stack``."""

    maps: tuple[BalloonMap, ...]
    levels: NDArray[np.int_]
    axes: Array
    pitch: float
    outline: float
    weight: float | None = 0.0
    calibration: str = ""

    @property
    def chambers(self) -> int:
        """Number of chambers."""
        return len(self.axes)

    @property
    def flat_height(self) -> float:
        """Height in mm of all levels when flat."""
        return self.pitch * len(self.levels)

    @cached_property
    def most_pressure(self) -> float:
        """The highest pressure of all maps in kPa, without rounding errors from scaling."""
        return round(min(kind.most_pressure for kind in self.maps), 9)

    @cached_property
    def tops(self) -> Array:
        """The largest height in mm of the map of each kind: (kinds, 1)."""
        return np.array([[kind.most_height] for kind in self.maps])

    @cached_property
    def centres(self) -> Array:
        """The gap at each chamber's middle, as a function of rise and tilt: (3, chambers)."""
        return _gaps(self.axes).T

    @cached_property
    def rims(self) -> Array:
        """The gap at points around each kind's outline, by rise and tilt: (kinds, points, 3).

        The outline is the convex hull of the films' rims: whichever way plates lean, the first
        contact lies on it.
        """
        # An even number a chamber, from the first one's axis on, and half a step off it: no way
        # points between two chambers, where one would stand for both.
        around = 2 * self.chambers * math.ceil(RIM_POINTS / 2 / self.chambers)
        first = math.atan2(*self.axes[0, ::-1])
        turn = first + (np.arange(around) + 0.5) * math.tau / around
        ways = np.stack([np.cos(turn), np.sin(turn)], -1)
        farthest = self.axes[np.argmax(ways @ self.axes.T, axis=1)]
        reaches = [kind.balloon.pocket + kind.balloon.ring for kind in self.maps]
        return np.stack([_gaps(farthest + reach * ways) for reach in reaches])

    @cached_property
    def _places(self) -> tuple[GapPlaces, GapPlaces]:
        """Gaps of each kind of balloon, and of each level."""
        turn = np.arange(RING_POINTS) * math.tau / RING_POINTS
        ring = np.stack([np.cos(turn), np.sin(turn)], -1)
        across = [(kind.balloon.neck + kind.balloon.pocket) / 2 for kind in self.maps]
        each = [_gaps((self.axes[:, None] + radius * ring).reshape(-1, 2)) for radius in across]
        kinds = GapPlaces.of(self.maps, np.stack(each), self.rims)
        return kinds, kinds.at(self.levels)

    @cached_property
    def _first_levels(self) -> NDArray[np.int_]:
        return np.array([int(np.argmax(self.levels == kind)) for kind in range(len(self.maps))])

    def rows_of(self, freedoms: Array, load: Load | None) -> Array:
        """Return the freedoms (n, rows, 3) of levels' (n, levels, 3): one row per kind of balloon
        without a load, per level with one.
        """
        return freedoms[:, self._first_levels] if load is None else freedoms

    def counts(self, load: Load | None) -> Array:
        """Return the number of levels that each row represents."""
        if load is not None:
            return np.ones(len(self.levels))
        return np.bincount(self.levels, minlength=len(self.maps)).astype(float)

    def springs(
        self, pressures: Array, sucked: bool = False, by_level: bool = False, orders: int = 2
    ) -> Springs:
        """Return the springs of each kind of balloon, or of each level, at pressures (n, chambers)
        in kPa. Raises DesignError for those outside the maps.

        With ``sucked`` a closed chamber may be below 0 kPa; derivatives of volumes with respect to
        pressure need three ``orders``.
        """
        tables = [kind.splines(pressures, orders, sucked)[:, :, None] for kind in self.maps]
        table = tables[0] if len(tables) == 1 else np.concatenate(tables, axis=2)
        places, size = self._places[by_level], pressures.size
        states = np.arange(0, size, self.chambers)[:, None, None]
        begins = states + (orders * size * places.kinds + places.chambers)
        stride = len(tables) * orders * size
        return Springs(table.reshape(DEGREE + 1, -1), begins, stride, size, places)

    def start_freedoms(self, pressures: Array) -> Array:
        """Return initial rise and tilt at pressures (n, chambers), one row per kind of balloon (n,
        kinds, 3): the plane nearest to the free heights of the balloons.
        """
        rises = [kind.rises(pressures)[..., None, :] for kind in self.maps]
        return np.concatenate(rises, axis=-2) @ np.linalg.pinv(self.centres)

    def states(self, load: Load | None, pressures: Array, freedoms: Array | None) -> BatchPoses:
        """Return states at pressures (n, chambers) and freedoms (n, levels, 3), not necessarily in
        equilibrium.
        """
        count = len(pressures)
        if freedoms is None:
            freedoms = np.zeros((count, len(self.levels), 3))
        none = np.zeros((2, count), dtype=bool)
        return BatchPoses(self, load, pressures.copy(), freedoms, np.zeros(count), *none)

    def states_of(self, pose: Pose, load: Load | None) -> BatchPoses:
        """Return a pose under a load as one state."""
        found, p = np.array([[pose.stable], [True]]), np.array([pose.pressures])
        pushes = np.array([1000 * pose.force])
        return BatchPoses(self, load, p, pose.freedoms[None], pushes, *found)

    def equilibria(
        self,
        pressures: Array,
        load: Load | None,
        start: Array | None = None,
        sucked: bool = False,
    ) -> BatchPoses:
        """Return the equilibria of n states at pressures (n, chambers) in kPa, from freedoms (n,
        levels, 3) if given. Raises DesignError for pressures outside the maps.
        """
        if not len(pressures):
            return self.states(load, pressures, None)
        size = CHUNK if load is None else LOADED_CHUNK
        parts = [slice(begin, begin + size) for begin in range(0, len(pressures), size)]
        return BatchPoses.joined(
            [
                self._solved(pressures[part], load, None if start is None else start[part], sucked)
                for part in parts
            ]
        )

    def _solved(
        self, pressures: Array, load: Load | None, start: Array | None, sucked: bool
    ) -> BatchPoses:
        springs = self.springs(pressures, sucked, by_level=load is not None)
        if load is None:
            at = self.start_freedoms(pressures) if start is None else self.rows_of(start, load)
            return self._balanced(springs, pressures, None, at)
        if load.wall is None:
            at = self.start_freedoms(pressures)[:, self.levels] if start is None else start
            return self._balanced(springs, pressures, load, at)
        if start is None:
            at = self._solved(pressures, None, None, sucked).freedoms
            if load.wall.sticks:
                # Straight, and no higher than the plate: most of the way of one that meets it.
                room = float(np.linalg.norm(load.wall.point)) / len(self.levels) - self.pitch
                at = np.minimum(at, max(room, 0.0)) * (1.0, 0.0, 0.0)
            rest = np.arange(len(pressures))
        else:
            states = self._balanced(springs, pressures, load, start)
            rest = np.flatnonzero(~states.is_found)
            at = start[rest]
            if not rest.size:
                return states
        some, p = springs.at(rest), pressures[rest]
        for stiffness in SOFT_PLATES:
            softer = load._replace(stiffness=stiffness)
            at = self._balanced(some, p, softer, at, ROUGH_STEP).freedoms
        last = self._balanced(some, p, load, at)
        return last if start is None else states.replaced(rest, last)

    def _balanced(
        self,
        springs: Springs,
        pressures: Array,
        load: Load | None,
        start: Array,
        enough: float = 0.0,
    ) -> BatchPoses:
        """Return the ``descent`` of freedoms (n, rows, 3)."""

        def energies(which: Any, at: Array) -> tuple[Array, ...]:
            some = springs if len(at) == len(start) else springs.at(which)
            now = energy(some, self.pitch, load, at)
            return now.value, now.gradient, now.matrix, now.push

        is_at_plate = load is not None and load.wall is not None
        at, pushes, *which = descent(energies, start, enough, is_at_plate)
        freedoms = at[:, self.levels] if load is None else at
        return BatchPoses(self, load, pressures, freedoms, pushes, *which)

    @property
    def level_weight(self) -> float:
        """The weight of a level in mN. Raises DesignError if it is unknown."""
        if self.weight is None:
            raise DesignError(
                "gravity needs the density of every film; add films.<name>.density, in kg/m3"
            )
        return self.weight

    def table(self, pressures: ArrayLike, rows: int | None = None) -> Array:
        """Return pressures (rows, chambers) in kPa. Raises DesignError if they are invalid."""
        states = "a row a state" if rows is None else f"{rows} rows"
        sentence = f"pressures in kPa must be finite numbers, {states} of {self.chambers}"
        return numbers_of(pressures, (rows, self.chambers), sentence)

    def acting(self, arguments: dict[str, Any]) -> Load | None:
        """Return the load from the arguments of ``pose`` other than pressures; None if there are
        none. Raises DesignError.
        """
        unknown = sorted(set(arguments) - {*LOADS, "sucked"})
        if unknown:
            raise DesignError(
                f"a load has no {unknown[0]}; use tip_load, gravity or plate, as in Stack.pose"
            )
        tip_load, gravity, plate = ({**LOADS, **arguments}[name] for name in LOADS)
        force, weight, wall = 1000 * vector_of(tip_load, "tip_load in N"), None, None
        if not isinstance(gravity, (bool, np.bool_)):
            weight = self.level_weight * direction_of(gravity, "the direction of gravity")
        elif gravity:
            weight = np.array([0.0, 0.0, -self.level_weight])
        if plate is not None:
            wall = self._outer_plate(plate if isinstance(plate, Plate) else Plate.at(plate))
        is_loaded = force.any() or weight is not None or wall is not None
        return Load(force, weight, wall) if is_loaded else None

    def _outer_plate(self, plate: Plate) -> OuterPlate:
        point = vector_of(plate.point, "the plate's point in mm")
        normal = direction_of(plate.normal, "the plate's normal")
        if normal[2] > 1 - 1e-9 and point[2] < self.flat_height - 1e-9:
            raise DesignError(
                f"a plate {point[2]:g} mm high is lower than the flat stack; give at least "
                f"{self.flat_height:.4g} mm"
            )
        return OuterPlate.of(point, normal, plate.sticks, self.outline)

    def within(self, pose: Pose) -> bool:
        """Return True if the maps are valid for all balloons of a pose: within 3 % of balloons
        between plates computed there. False if one lies outside, or cannot be computed.
        """
        (holds,) = self.hold([pose])
        return holds

    def hold(self, poses: Sequence[Pose]) -> list[bool]:
        """Return ``within`` of each pose; balloons of all poses are computed at once."""
        if not poses:
            return []
        gaps = np.stack([pose.gaps for pose in poses])
        pressures = np.array([pose.pressures for pose in poses])[:, None, :]
        pressures = np.broadcast_to(pressures, gaps.shape)
        holds = np.ones(len(poses), bool)
        try:
            for kind, balloon in enumerate(self.maps):
                row = self.levels == kind
                places = pressures[:, row].ravel(), gaps[:, row].ravel()
                holds &= holds_at(balloon, *places).reshape(len(poses), -1).all(-1)
        except DesignError:
            return [self.within(pose) for pose in poses] if len(poses) > 1 else [False]
        return holds.tolist()


def _gaps(points: Array) -> Array:
    """The gaps at points (n, 2) of a level's plane as functions of its rise and tilt: (n, 3)."""
    x, y = points.T
    return np.stack([np.ones_like(x), y, -x], -1)


def numbers_of(values: ArrayLike, shape: tuple[int | None, ...], sentence: str) -> Array:
    """Return finite numbers of a shape, in which None is any length. Raises DesignError with a
    sentence for others.
    """
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise DesignError(sentence) from None
    fits = len(shape) == array.ndim
    fits = fits and all(n in (None, m) for n, m in zip(shape, array.shape, strict=True))
    if not fits or not np.isfinite(array).all():
        raise DesignError(sentence)
    return array


def vector_of(values: Sequence[float], quantity: str) -> Array:
    """Return three numbers (3,). Raises DesignError unless there are three finite numbers."""
    sentence = f"{quantity} must be three finite numbers, such as (0, 0, -0.1)"
    return numbers_of(values, (3,), sentence)


def direction_of(values: Sequence[float], quantity: str) -> Array:
    """Return the direction (3,) of three numbers. Raises DesignError if all are 0."""
    vector = vector_of(values, quantity)
    length = float(np.linalg.norm(vector))
    if not length:
        raise DesignError(f"{quantity} has no direction; give three numbers that are not all 0")
    return vector / length
