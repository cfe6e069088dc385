"""Poses of an actuator: plates joined by balloons, in equilibrium with external loads.

Plates are the planes between balloons. Two neighbours are joined by one balloon a chamber: it
lengthens and tilts, and carries no shear ("a 2-DoF spring joint", paper, Sec. 4.4). A tilted
balloon is taken to push at six points of a ring, each as hard as the axisymmetric balloon does at
the gap there; between rigid plates that touch the film in a disc the ring's radius would be the
disc's, and it is taken midway between neck and pocket. Flat balloons, and rims of leaning levels,
do not sink into each other: contact by a stiff penalty, without friction.
The equilibrium is the minimum of one energy, found by Newton's method. Levels of equal balloons
without a load are equal and solved once. Lengths mm, pressures kPa, volumes ul; forces mN inside,
N outside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import DesignError
from sbafab.models.balloon_map import BalloonMap
from sbafab.models.film_elements import Array
from sbafab.models.map_range import holds_at
from sbafab.models.paper import counterparts_of_pose
from sbafab.models.stack_balance import free_equilibrium, loaded_equilibrium
from sbafab.models.stack_loads import (
    RING_POINTS,
    Chain,
    GapPlaces,
    Load,
    Springs,
    direction_of,
    outer_plate,
    plate_chain,
    vector_of,
)

RIM_POINTS = 24
"""Least number of points round a level's outline where its rims may meet the next level's."""
NO_LOAD: dict[str, Any] = {"tip_load": (0.0, 0.0, 0.0), "gravity": False, "plate": None}
"""Defaults of the arguments of ``Stack.load``."""


@dataclass(frozen=True)
class Plate:
    """An outer plate that the tip may push on: through ``point`` (mm), ``normal`` pointing away.

    ``Plate.at(height)`` lies level. With ``sticks`` friction holds the middle of the tip on the
    line through the point along the normal; without, it slides along the plate.
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
    """A stack in equilibrium at ``pressures`` (kPa, one a chamber).

    ``pitch`` is the height of a flat level in mm, ``freedoms`` (levels, 3) are rise in mm and tilt
    in rad of each level; ``gaps`` (levels, chambers) by how many mm each balloon has risen at its
    own centre; ``volumes`` ul a chamber; ``force`` N on the outer plate; ``energy`` uJ stored in
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
        """Origins (n, 3) in mm and axes (n, 3, 3) of the plates, the base first; the columns of
        ``axes[i]`` are the x, y and z of plate i.
        """
        return self._chain.places, self._chain.axes

    @property
    def tip(self) -> Array:
        """Middle of the top plate (3,) in mm."""
        return np.asarray(self._chain.places[-1])

    @property
    def height(self) -> float:
        """Height of the middle of the top plate above the base, mm."""
        return float(self.tip[2])

    @property
    def bend(self) -> float:
        """Degrees from base to top; along the stack, so that it may be more than half a turn."""
        return math.degrees(math.hypot(*self.freedoms[:, 1:].sum(0)))

    @property
    def direction(self) -> float:
        """Degrees round the base, from x, towards which it bends; 0 where it stands straight."""
        x, y = self.freedoms[:, 1:].sum(0)
        return math.degrees(math.atan2(-x, y)) if math.hypot(x, y) > 1e-9 else 0.0


@dataclass(frozen=True, eq=False)
class PosedStack:
    """Levels of balloons, bottom to top.

    ``maps`` are the maps of the different balloons, ``levels`` the index of each level's map;
    ``axes`` (chambers, 2) the centres of the chambers, ``pitch`` the height of a flat level and
    ``outline`` the radius of the plates, in mm; ``weight`` mN of each level, None if a film's
    density is unknown.
    """

    maps: tuple[BalloonMap, ...]
    levels: NDArray[np.int_]
    axes: Array
    pitch: float
    outline: float
    weight: float | None = 0.0
    calibration: str = ""
    """Name of the calibration that its balloons have, if any."""

    @property
    def chambers(self) -> int:
        """Number of chambers."""
        return len(self.axes)

    @property
    def counterparts(self) -> dict[str, str]:
        """Measured counterparts of the "height" and the "bend" of a pose, a clause each."""
        rows = counterparts_of_pose(self.chambers, self.calibration)
        return {quantity: row.sentence() for quantity, row in rows.items()}

    @property
    def flat_height(self) -> float:
        """Height in mm of all levels when flat."""
        return self.pitch * len(self.levels)

    @cached_property
    def centres(self) -> Array:
        """Gap at each chamber's middle, by rise and tilt: (3, chambers)."""
        x, y = self.axes.T
        return np.stack([np.ones_like(x), y, -x])

    @cached_property
    def planes(self) -> Array:
        """Rise and tilt of the plane nearest to gaps at the chambers' middles: (chambers, 3)."""
        return np.asarray(np.linalg.pinv(self.centres))

    @cached_property
    def ring_gaps(self) -> Array:
        """Gap at each point of each balloon's ring, by rise and tilt: (chambers x points, 3)."""
        turn = np.arange(RING_POINTS) * math.tau / RING_POINTS
        ring = np.stack([np.cos(turn), np.sin(turn)], -1)
        rows = []
        for kind in self.maps:
            across = (kind.balloon.neck + kind.balloon.pocket) / 2
            x, y = (self.axes[:, None] + across * ring).reshape(-1, 2).T
            rows.append(np.stack([np.ones_like(x), y, -x], -1))
        return np.stack(rows)

    @cached_property
    def rims(self) -> Array:
        """Gap at points round each kind's outline, by rise and tilt: (kinds, points, 3).

        The outline is the convex hull of the films' rims: whatever way plates lean, what meets
        first lies on it.
        """
        # An even number a chamber, from the first one's axis on, and half a step off it: no way
        # points between two chambers, where one would stand for both.
        around = 2 * self.chambers * math.ceil(RIM_POINTS / 2 / self.chambers)
        first = math.atan2(*self.axes[0, ::-1])
        turn = first + (np.arange(around) + 0.5) * math.tau / around
        ways = np.stack([np.cos(turn), np.sin(turn)], -1)
        farthest = self.axes[np.argmax(ways @ self.axes.T, axis=1)]
        rows = []
        for kind in self.maps:
            x, y = (farthest + (kind.balloon.pocket + kind.balloon.ring) * ways).T
            rows.append(np.stack([np.ones_like(x), y, -x], -1))
        return np.stack(rows)

    @cached_property
    def places(self) -> GapPlaces:
        """Gaps of each kind of balloon."""
        return GapPlaces.of(self.maps, self.ring_gaps, self.rims)

    @cached_property
    def level_places(self) -> GapPlaces:
        """Gaps of each level."""
        return self.places.at(self.levels)

    def springs(self, pressures: Sequence[float], sucked: bool = False) -> Springs:
        """Return the springs of each kind of balloon at pressures, one a chamber. Raises
        DesignError.

        With ``sucked`` a chamber that is shut may stand below 0 kPa.
        """
        try:
            values = np.array(pressures, dtype=float)
        except (TypeError, ValueError):
            raise DesignError("pressures must be numbers in kPa, one a chamber") from None
        if values.shape != (self.chambers,):
            raise DesignError(
                f"{values.size} pressures are given for {self.chambers} chambers; give one a "
                "chamber"
            )
        return Springs.pressed(self.maps, values, self.places, sucked)

    def each(self, springs: Springs) -> Springs:
        """Return the springs of each level."""
        return Springs(springs.table, self.level_places)

    def pose(
        self,
        pressures: Sequence[float],
        tip_load: Sequence[float] = (0.0, 0.0, 0.0),
        gravity: bool | Sequence[float] = False,
        plate: float | Plate | None = None,
        near: Pose | None = None,
        sucked: bool = False,
    ) -> Pose:
        """Return the equilibrium pose at pressures (kPa, one a chamber).

        ``tip_load`` is a force in N on the middle of the top; ``gravity`` is True where the base
        lies level, or the direction (3) of down; ``plate`` an outer plate, or its height in mm.
        ``near`` is a pose to start from, such as the last one of a motion. Pressures may be below 0
        only where chambers may be ``sucked``: shut, with a fluid that keeps its volume. Raises
        DesignError for pressures outside the maps, and where Newton's method finds no equilibrium.
        """
        springs = self.springs(pressures, sucked)
        load = self.load(tip_load, gravity, plate)
        if load is None:
            if near is None:
                start = self.start_freedoms(pressures)
            else:
                start = near.freedoms[self.first_levels]
            kinds = free_equilibrium(springs, start)
            return self.pose_at(pressures, springs, kinds[self.levels], kinds)
        if near is not None:
            start = near.freedoms
        else:
            start = self.start_freedoms(pressures)
            if load.wall is not None and not (load.wall.is_level and load.wall.sticks):
                start = free_equilibrium(springs, start)
            start = start[self.levels]
        freedoms, push, stable = loaded_equilibrium(
            self.each(springs), self.pitch, load, start, near is not None
        )
        return self.pose_at(pressures, springs, freedoms, None, push / 1000, stable)

    def pose_like(self, freedoms: Array, pressures: Sequence[float] = ()) -> Pose:
        """Return a pose with freedoms (levels, 3) to start from: not in equilibrium."""
        none = np.zeros(0)
        return Pose(tuple(pressures), freedoms, none, none, 0.0, 0.0, True, self.pitch)

    def within(self, pose: Pose) -> bool:
        """Return True if the maps hold for all balloons of a pose: within 3 % of balloons between
        plates that are computed there. False where one lies outside, or cannot be computed.
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

    def start_freedoms(self, pressures: Sequence[float]) -> Array:
        """Return rise and tilt to start from, one row per kind of balloon: the plane nearest to the
        free heights of the balloons.
        """
        return np.stack([kind.rises(pressures) for kind in self.maps]) @ self.planes

    @cached_property
    def most_pressure(self) -> float:
        """Highest pressure of all maps in kPa, without the noise of scaling by the modulus."""
        return round(min(kind.most_pressure for kind in self.maps), 9)

    @cached_property
    def _top(self) -> Array:
        """Largest height of each level's map in mm: (levels, 1)."""
        return np.array([self.maps[kind].most_height for kind in self.levels])[:, None]

    @cached_property
    def first_levels(self) -> NDArray[np.int_]:
        """First level of each kind of balloon."""
        return np.array([int(np.argmax(self.levels == kind)) for kind in range(len(self.maps))])

    @property
    def level_weight(self) -> float:
        """Weight of a level in mN. Raises DesignError if it is not known."""
        if self.weight is None:
            raise DesignError(
                "gravity needs the density of every film; add films.<name>.density, in kg/m3"
            )
        return self.weight

    def load(
        self,
        tip_load: Sequence[float],
        gravity: bool | Sequence[float],
        plate: float | Plate | None,
    ) -> Load | None:
        """Return the external loads of ``pose``'s arguments, or None without any. Raises
        DesignError.
        """
        force, weight = 1000 * vector_of(tip_load, "tip_load in N"), None
        if not isinstance(gravity, (bool, np.bool_)):
            weight = self.level_weight * direction_of(gravity, "the direction of gravity")
        elif gravity:
            weight = np.array([0.0, 0.0, -self.level_weight])
        if not force.any() and weight is None and plate is None:
            return None
        if plate is None:
            return Load(force, weight, None)
        outer = plate if isinstance(plate, Plate) else Plate.at(plate)
        point = vector_of(outer.point, "the plate's point in mm")
        normal = direction_of(outer.normal, "the plate's normal")
        wall = outer_plate((*point.tolist(), *normal.tolist()), outer.sticks, self.outline)
        if wall.normal[2] > 1 - 1e-9 and wall.point[2] < self.flat_height - 1e-9:
            raise DesignError(
                f"a plate {wall.point[2]:g} mm high is lower than the flat stack; give at least "
                f"{self.flat_height:.4g} mm"
            )
        return Load(force, weight, wall)

    def pose_at(
        self,
        pressures: Sequence[float],
        springs: Springs,
        freedoms: Array,
        kinds: Array | None = None,
        force: float = 0.0,
        stable: bool = True,
    ) -> Pose:
        """Return a pose; ``kinds`` are its freedoms by kind of balloon where levels are equal."""
        gaps = freedoms @ self.centres
        highest = float((gaps - self._top).max())
        if highest > 0:
            raise DesignError(
                "a balloon would rise higher than its films can be stretched "
                f"({highest:.2g} mm above {self._top.min():.3g} mm); give less pressure or load"
            )
        if kinds is None:
            volumes, energies = self.each(springs).contents(freedoms)
        else:
            each, stored = springs.contents(kinds)
            volumes, energies = each[self.levels], stored[self.levels]
        volumes, energy = volumes.sum(0), float(energies.sum())
        p = np.asarray(pressures, dtype=float)
        return Pose(
            tuple(p.tolist()),
            freedoms,
            gaps,
            volumes,
            force,
            energy + float(p @ volumes),
            stable,
            self.pitch,
        )
