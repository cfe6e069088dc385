"""A whole actuator in real time: plates joined by balloons, in equilibrium with external loads.

Plates are the planes between balloons. Two neighbours are joined by one balloon a chamber: it
lengthens and tilts, and carries no shear ("a 2-DoF spring joint", paper, Sec. 4.4). A tilted
balloon is taken to push at six points of a ring, each as hard as the axisymmetric balloon does at
the gap there; between rigid plates that touch the film in a disc the ring's radius would be the
disc's, and it is taken midway between neck and pocket. Flat balloons, and rims of leaning levels,
do not sink into each other: contact by a stiff penalty, without friction.
The equilibrium is the minimum of one energy, found by Newton's method, for many states at once; one
pose is a batch of one. Levels of equal balloons without a load are equal and solved once.
Lengths mm, pressures kPa, volumes ul; forces mN inside, N outside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.actuators import build
from sbafab.design.records import Design, Form
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate, film_mass
from sbafab.models.balloon import Balloon
from sbafab.models.balloon_map import BalloonMap, balloon_map, holds_at
from sbafab.models.balloons import balloons_of
from sbafab.models.derivatives import Derivatives, derivatives
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Array
from sbafab.models.inverse_kinematics import P0, Search
from sbafab.models.motion import BatchMotion, Motion
from sbafab.models.paper import counterparts_of_pose
from sbafab.models.pneumatics import Line
from sbafab.models.stack_balance import (
    CHUNK,
    LOADED_CHUNK,
    Balance,
    BatchPoses,
    Equilibria,
    Plate,
    Pose,
    free_equilibrium,
    loaded_equilibrium,
)
from sbafab.models.stack_loads import (
    RING_POINTS,
    GapPlaces,
    Load,
    Springs,
    direction_of,
    outer_plate,
    plate_chain,
    vector_of,
)
from sbafab.runtime import one_blas_thread

__all__ = ["MOST_PRESSURE", "Motion", "Plate", "Pose", "Stack", "StackBatch", "stack"]

MOST_PRESSURE = 110.0
"""Highest pressure of maps in kPa, unless a request has a higher one."""
GRAVITY = 9.80665
GRIP = 0.15
"""Radius, as a share of its pocket's, of the disc by which plates hold a lone balloon."""
PRESSURE_SHARES = (1.0, 0.5, 0.2, 0.1)
"""Shares of the highest pressure, tried one after the other."""
RIM_POINTS = 24
"""Least number of points round a level's outline where its rims may meet the next level's."""
NO_LOAD: dict[str, Any] = {"tip_load": (0.0, 0.0, 0.0), "gravity": False, "plate": None}
"""Defaults of the arguments of ``Stack.load``."""
NOT_FOUND = (
    "no equilibrium of the stack found at these pressures, under this load; try a smaller one"
)


@dataclass(frozen=True, eq=False)
class Stack:
    """An actuator as plates joined by balloons: poses, derivatives, inverse kinematics, motion.

    ``maps`` are the maps of the different balloons, ``levels`` the index of each level's map from
    the base; ``axes`` (chambers, 2) the centres of the chambers, ``pitch`` the height of a flat
    level and ``outline`` the radius of the plates, in mm; ``weight`` mN of each level, None if a
    film's density is unknown.
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

    def springs(
        self, pressures: ArrayLike, sucked: bool = False, by_level: bool = False, orders: int = 2
    ) -> Springs:
        """Return the springs of each kind of balloon, or of each level, at pressures (...,
        chambers). Raises DesignError.

        With ``sucked`` a chamber that is shut may stand below 0 kPa; three ``orders`` as of
        ``Springs.pressed``.
        """
        places = self.level_places if by_level else self.places
        return Springs.pressed(self.maps, np.asarray(pressures, float), places, sucked, orders)

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
        try:
            values = np.array(pressures, dtype=float)
        except (TypeError, ValueError):
            raise DesignError("pressures must be numbers in kPa, one a chamber") from None
        if values.shape != (self.chambers,):
            raise DesignError(
                f"{values.size} pressures are given for {self.chambers} chambers; give one a "
                "chamber"
            )
        load = self.load(tip_load, gravity, plate)
        start = None if near is None else near.freedoms[None]
        return self.pose_of(self.equilibria(values[None], load, start, sucked))

    def equilibria(
        self,
        pressures: Array,
        load: Load | None,
        start: Array | None = None,
        sucked: bool = False,
    ) -> Equilibria:
        """Return the equilibria of n states at pressures (n, chambers) in kPa, from freedoms (n,
        levels, 3) if given. Raises DesignError for pressures outside the maps.
        """
        if not len(pressures):
            return self.no_states(load, 0)
        size = CHUNK if load is None else LOADED_CHUNK
        if len(pressures) <= size:
            return self._solved(pressures, load, start, sucked)
        parts = [slice(begin, begin + size) for begin in range(0, len(pressures), size)]
        each = [
            self._solved(pressures[part], load, None if start is None else start[part], sucked)
            for part in parts
        ]
        return Equilibria(*(np.concatenate(part) for part in zip(*each, strict=True)))

    def _solved(
        self, pressures: Array, load: Load | None, start: Array | None, sucked: bool
    ) -> Equilibria:
        springs = self.springs(pressures, sucked, by_level=load is not None)
        begin = self.start_freedoms(pressures) if start is None else start
        if load is None:
            begin = begin if start is None else begin[:, self.first_levels]
            return self.settled(pressures, free_equilibrium(springs, begin), load, sucked, springs)
        if start is None:
            if load.wall is not None and not (load.wall.is_level and load.wall.sticks):
                begin = free_equilibrium(self.springs(pressures, sucked), begin).freedoms
            begin = begin[:, self.levels]
        found = loaded_equilibrium(springs, self.pitch, load, begin, start is not None)
        return self.settled(pressures, found, load, sucked, springs)

    def settled(
        self,
        pressures: Array,
        found: Balance,
        load: Load | None,
        sucked: bool = False,
        springs: Springs | None = None,
    ) -> Equilibria:
        """Return the states of a balance at pressures (n, chambers) in kPa."""
        if springs is None:
            springs = self.springs(pressures, sucked, by_level=load is not None)
        counts = self.row_counts[load is None]
        stored, each = springs.order(found.freedoms, [0, 1], with_rates=False)[0]
        volumes = counts @ each
        energies = stored.sum(-1) @ counts + (pressures * volumes).sum(-1)
        excess = self.excess(found.freedoms, load)
        return Equilibria(pressures, found.freedoms, volumes, energies, *found[1:], excess)

    def excess(self, freedoms: Array, load: Load | None) -> Array:
        """Return by how many mm a balloon rises above its map: (n,)."""
        gaps = freedoms @ self.centres
        return np.asarray((gaps - self.row_tops[load is None]).max((1, 2)))

    def pose_of(self, states: Equilibria, number: int = 0) -> Pose:
        """Return one of the states as a pose. Raises DesignError if it has none."""
        if not states.is_found[number]:
            raise DesignError(NOT_FOUND)
        excess, top = states.excess[number], self.row_tops[1].min()
        if excess > 0:
            raise DesignError(
                "a balloon would rise higher than its films can be stretched "
                f"({excess:.2g} mm above {top:.3g} mm); give less pressure or load"
            )
        freedoms = self.by_level(states.freedoms[number])
        return Pose(
            tuple(states.pressures[number].tolist()),
            freedoms,
            freedoms @ self.centres,
            states.volumes[number],
            float(states.pushes[number]) / 1000,
            float(states.energies[number]),
            bool(states.is_stable[number]),
            self.pitch,
        )

    def poses_of(self, states: Equilibria) -> BatchPoses:
        """Return the states as poses. Raises DesignError as for the first that has none."""
        for number in np.flatnonzero(~states.is_met)[:1]:
            self.pose_of(states, int(number))
        return BatchPoses(
            states.pressures,
            self.by_level(states.freedoms),
            states.volumes,
            self.tips(states.freedoms),
            states.pushes / 1000,
        )

    def no_states(self, load: Load | None, count: int) -> Equilibria:
        """Return ``count`` states under a load that are not found."""
        none, each = np.zeros(count), np.zeros((count, self.chambers))
        freedoms = np.zeros((count, len(self.row_counts[load is None]), 3))
        balance = Balance.of(freedoms, is_found=False)
        return Equilibria(each, freedoms, each.copy(), none, *balance[1:], none.copy())

    def states_of(self, pose: Pose, load: Load | None) -> Equilibria:
        """Return a pose under a load as one state."""
        rows = pose.freedoms if load is not None else pose.freedoms[self.first_levels]
        true, stable = np.ones(1, dtype=bool), np.array([pose.stable])
        return Equilibria(
            np.array([pose.pressures]),
            rows[None],
            pose.volumes[None],
            np.array([pose.energy]),
            np.array([1000 * pose.force]),
            stable,
            true,
            -np.ones(1),
        )

    def by_level(self, freedoms: Array) -> Array:
        """Return freedoms (..., kinds, 3), or (..., levels, 3) themselves, of each level."""
        is_level = freedoms.shape[-2] == len(self.levels)
        return freedoms if is_level else freedoms[..., self.levels, :]

    def tips(self, freedoms: Array) -> Array:
        """Return the middles of the top plates in mm, by freedoms (n, rows, 3) as of
        ``Equilibria``: (n, 3).
        """
        if freedoms.shape[-2] == len(self.levels):
            return plate_chain(freedoms, self.pitch).tip
        # Equal levels move all beyond them alike.
        alone = plate_chain(freedoms[..., None, :], self.pitch)
        moves = np.zeros((*freedoms.shape[:-1], 4, 4))
        moves[..., :3, :3], moves[..., :3, 3] = alone.axes[..., 1, :, :], alone.tip
        moves[..., 3, 3] = 1.0
        whole: Array = np.eye(4)
        for kind, levels in groupby(self.levels.tolist()):
            whole = whole @ np.linalg.matrix_power(moves[..., kind, :, :], sum(1 for _ in levels))
        return np.asarray(whole[..., :3, 3])

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

    def start_freedoms(self, pressures: ArrayLike) -> Array:
        """Return rise and tilt to start from at pressures (..., chambers), one row per kind of
        balloon (..., kinds, 3): the plane nearest to the free heights of the balloons.
        """
        rises = [kind.rises(pressures)[..., None, :] for kind in self.maps]
        return np.concatenate(rises, axis=-2) @ self.planes

    @cached_property
    def most_pressure(self) -> float:
        """Highest pressure of all maps in kPa, without the noise of scaling by the modulus."""
        return round(min(kind.most_pressure for kind in self.maps), 9)

    @cached_property
    def row_tops(self) -> tuple[Array, Array]:
        """Largest height in mm of the map of each level, and of each kind: (rows, 1)."""
        kinds = np.array([[kind.most_height] for kind in self.maps])
        return kinds[self.levels], kinds

    @cached_property
    def row_counts(self) -> tuple[Array, Array]:
        """How many levels each level, and each kind of balloon, stands for: (rows,)."""
        kinds = np.bincount(self.levels, minlength=len(self.maps))
        return np.ones(len(self.levels)), kinds.astype(float)

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

    def acting(self, arguments: dict[str, Any]) -> Load | None:
        """Return the load that arguments of ``pose`` beside pressures are. Raises DesignError."""
        unknown = sorted(set(arguments) - {*NO_LOAD, "sucked"})
        if unknown:
            raise DesignError(
                f"a load has no {unknown[0]}; give tip_load, gravity or plate, as of Stack.pose"
            )
        return self.load(*(arguments.get(name, value) for name, value in NO_LOAD.items()))

    def table(self, pressures: ArrayLike, rows: int | None = None) -> Array:
        """Return pressures (rows, chambers) in kPa. Raises DesignError if they are invalid."""
        try:
            table = np.asarray(pressures, dtype=float)
        except (TypeError, ValueError):
            table = np.zeros(0)
        shape = (len(table) if rows is None and table.ndim else rows, self.chambers)
        if table.shape != shape or not np.isfinite(table).all():
            states = "a row a state" if rows is None else f"{rows} rows"
            raise DesignError(
                f"pressures in kPa must be finite numbers, {states} of {self.chambers}"
            )
        return table

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

    def derivatives(self, pressures: Sequence[float], **load: Any) -> Derivatives:
        """Return the equilibrium pose at pressures (kPa, one a chamber) with its derivatives;
        ``load`` are keyword arguments of ``pose`` beside pressures.

        Raises DesignError as ``pose`` does, and for a pose that is about to buckle.
        """
        pose = self.pose(pressures, **load)
        return derivatives(self, pose, self.acting(load), load.get("sucked", False))

    def stiffness(self, pressures: Sequence[float], **load: Any) -> Array:
        """Return the stiffness (6, 6) of the tip in N/mm, N and N mm, as of ``derivatives``."""
        return self.derivatives(pressures, **load).stiffness

    def reach(
        self,
        tip: Sequence[float],
        most_pressure: float | None = None,
        near: Pose | None = None,
        **load: Any,
    ) -> Pose:
        """Return a pose whose tip is at a place (3) in mm, within 1e-3 mm; its ``pressures`` (kPa)
        are from 0 to ``most_pressure``, by default the maps' highest.

        ``near`` is a pose to start from, such as the last one of a motion; ``load`` are keyword
        arguments of ``pose`` beside pressures. If a stack with many chambers has several solutions,
        the result is one near the start. Raises UnreachableError, with the nearest tip found, and
        DesignError for bad input.
        """
        place = vector_of(tip, "the place of the tip in mm")
        most = self.reach_limit(most_pressure)
        search = Search(self, self.acting(load), math.asinh(most / P0))
        return self.pose_of(search.reached(place[None], near))

    def reach_limit(self, most_pressure: float | None) -> float:
        """Return the highest pressure in kPa of ``reach``. Raises DesignError."""
        most = self.most_pressure if most_pressure is None else float(most_pressure)
        if not 0 < most <= self.most_pressure:
            raise DesignError(
                f"most_pressure = {most:g} kPa must be above 0 and at most "
                f"{self.most_pressure:g} kPa, to which the stack was made"
            )
        return most

    def motion(
        self, pressures: Sequence[float] | None = None, line: Line | None = None, **load: Any
    ) -> Motion:
        """Return a motion that starts at pressures (kPa, by default 0); ``line`` feeds each
        chamber, and ``load`` are keyword arguments of ``pose`` beside pressures.
        """
        start = self.pose((0.0,) * self.chambers if pressures is None else pressures, **load)
        return Motion(self, line or Line(), load, start)


@dataclass(frozen=True, eq=False)
class StackBatch:
    """Many states of one ``stack``, solved together."""

    stack: Stack

    @one_blas_thread
    def poses(
        self, pressures: ArrayLike, near: BatchPoses | None = None, **load: Any
    ) -> BatchPoses:
        """Return the equilibrium poses at pressures (N, chambers) in kPa.

        ``near`` are N poses to start from; ``load`` are keyword arguments of ``Stack.pose`` beside
        pressures. Raises DesignError as ``Stack.pose`` does, for the first state that has no pose.
        """
        asked = self.stack.table(pressures)
        if near is not None and len(near.freedoms) != len(asked):
            raise DesignError(
                f"near has {len(near.freedoms)} poses for {len(asked)} states; give one a state"
            )
        start = None if near is None else near.freedoms
        return self.stack.poses_of(self.stack.equilibria(asked, self.stack.acting(load), start))

    @one_blas_thread
    def reach(self, tips: ArrayLike, most_pressure: float | None = None, **load: Any) -> BatchPoses:
        """Return poses whose tips stand at places (N, 3) in mm, those that ``Stack.reach`` finds
        one by one, with pressures from 0 to ``most_pressure`` in kPa.

        ``load`` are keyword arguments of ``Stack.pose`` beside pressures. Raises UnreachableError
        and DesignError as ``Stack.reach`` does, for the first place that is not met.
        """
        places, most = _places(tips), self.stack.reach_limit(most_pressure)
        search = Search(self.stack, self.stack.acting(load), math.asinh(most / P0))
        return self.stack.poses_of(search.reached(places, None))

    def motion(
        self,
        count: int,
        line: Line | None = None,
        pressures: Sequence[float] | None = None,
        **load: Any,
    ) -> BatchMotion:
        """Return ``count`` motions that start at pressures (kPa, by default 0); ``line`` feeds each
        chamber, and ``load`` are keyword arguments of ``Stack.pose`` beside pressures.
        """
        if count < 1:
            raise DesignError(f"count = {count} must be at least 1")
        acting = self.stack.acting(load)
        begin = (0.0,) * self.stack.chambers if pressures is None else pressures
        start = self.stack.states_of(self.stack.pose(begin, **load), acting)
        parts: list[Any] = [part.repeat(count, axis=0) for part in start]
        states = Equilibria(*parts)
        return BatchMotion(
            self.stack,
            line or Line(),
            acting,
            start,
            states.balance,
            states.pressures,
            np.zeros(count),
        )


def _places(tips: ArrayLike) -> Array:
    """Return places (N, 3) in mm. Raises DesignError if they are invalid."""
    try:
        places = np.asarray(tips, dtype=float)
    except (TypeError, ValueError):
        places = np.zeros(0)
    if places.ndim != 2 or places.shape[1] != 3 or not np.isfinite(places).all():
        raise DesignError(
            "positions of the tip in mm must be finite numbers, one row of three for each"
        )
    return places


def stack(
    design: Design,
    laminate: Laminate | None = None,
    most_pressure: float = MOST_PRESSURE,
    factors: Factors | None = None,
    form: Form | None = None,
) -> Stack:
    """Return the stack of a design with round pockets on one axis or side by side.

    ``most_pressure`` in kPa is the range of its maps; maps of wide pockets end earlier. A lone
    balloon is held by a small disc. ``factors`` are calibrated ones; ``form`` replaces the
    design's, for drawn pockets that are nearly round (``actuator.model_form``). Raises
    DesignError for pockets of another shape, for actuators round a tube and for films of unknown
    modulus.
    """
    flat = laminate or build(design)
    factors = factors or Factors()
    ratio = factors.modulus_ratio
    # Maps scale with the modulus, so a map for the film as bought serves every ratio.
    drawn = balloons_of(design, flat, replace(factors, modulus_ratio=1.0), form)
    row = [_clamped(balloon) for balloon in drawn]
    kinds = list(dict.fromkeys(row))
    axes = np.array([chamber.centres[0] for chamber in flat.chambers])
    if len(axes) == 1:
        axes = np.zeros((1, 2))
    reach = float(np.hypot(*axes.T).max()) + max(balloon.pocket + balloon.ring for balloon in row)
    has_densities = all(layer.film.density is not None for layer in flat.layers)
    return Stack(
        tuple(_mapped(kind, most_pressure / ratio).stiffened(ratio) for kind in kinds),
        np.array([kinds.index(balloon) for balloon in row]),
        axes,
        factors.folded(flat).height / len(row),
        reach,
        film_mass(flat) * GRAVITY / len(row) if has_densities else None,
        factors.calibration,
    )


def _clamped(balloon: Balloon) -> Balloon:
    """Return a balloon with a disc by which plates hold it, if it lacks a neck."""
    if balloon.neck:
        return balloon
    mate = None if balloon.mate is None else replace(balloon.mate, neck=GRIP * balloon.pocket)
    return replace(balloon, neck=GRIP * balloon.pocket, mate=mate)


def _mapped(kind: Balloon, most_pressure: float) -> BalloonMap:
    """Return a balloon's map, to a lower pressure if a wide pocket has no equilibrium."""
    for share in PRESSURE_SHARES:
        try:
            return balloon_map(kind, share * most_pressure)
        except DesignError:
            if share == PRESSURE_SHARES[-1]:
                raise
    raise AssertionError
