"""A whole actuator in real time: plates joined by balloons, in equilibrium with external loads, and
its motion as chambers fill through their lines.

Plates are the planes between balloons. Two neighbours are joined by one balloon a chamber: it
lengthens and tilts, and carries no shear ("a 2-DoF spring joint", paper, Sec. 4.4). A tilted
balloon is taken to push at six points of a ring, each as hard as the axisymmetric balloon does at
the gap there; between rigid plates that touch the film in a disc the ring's radius would be the
disc's, and it is taken midway between neck and pocket. Flat balloons do not sink into each other,
nor do rims where levels lean: contact by a stiff penalty, without friction.
The equilibrium is the minimum of one energy, found by Newton's method. Levels of equal balloons
without a load are equal and solved once. Lengths mm, pressures kPa, volumes ul; forces mN inside,
N outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sbafab.actuators import build
from sbafab.errors import DesignError
from sbafab.laminate.laminate import film_mass
from sbafab.models.balloon import Balloon
from sbafab.models.balloon_map import BalloonMap, balloon_map
from sbafab.models.balloons import balloons_of
from sbafab.models.derivatives import Derivatives, derivatives
from sbafab.models.figures import Factors
from sbafab.models.paper import counterparts_of_pose
from sbafab.models.pneumatics import Line
from sbafab.models.reach import reach
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

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.design.records import Design, Form
    from sbafab.laminate.laminate import Laminate
    from sbafab.models.film_elements import Array

RIM_POINTS = 24
"""Least number of points round a level's outline where its rims may meet the next level's."""
MOST_PRESSURE = 110.0
"""Highest pressure of maps in kPa, unless a request has a higher one."""
GRAVITY = 9.80665
GRIP = 0.15
"""Radius, as a share of its pocket's, of the disc by which plates hold a lone balloon."""
PRESSURE_SHARES = (1.0, 0.5, 0.2, 0.1)
"""Shares of the highest pressure, tried one after the other."""


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
        """Return a level plate so many mm above the base."""
        return cls((0.0, 0.0, height))


@dataclass(frozen=True, eq=False)
class Pose:
    """A stack in equilibrium at ``pressures`` (kPa, one a chamber).

    ``pitch`` is the height of a flat level in mm, ``freedoms`` (levels, 3) are rise in mm and tilt
    in rad of each level; ``gaps`` (levels, chambers) by how many mm each balloon has risen at its
    own centre; ``volumes`` ul a chamber; ``force`` N on the outer plate; ``energy`` uJ stored in
    the films. Where it is not ``stable`` it is an unstable equilibrium, as of a straight column
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
class Stack:
    """Levels of balloons, bottom to top.

    ``maps`` are those of the different balloons, ``levels`` the number of each level's map;
    ``axes`` (chambers, 2) the centres of the chambers, ``pitch`` the height of a flat level and
    ``outline`` the radius of the plates, in mm; ``weight`` mN of each level, None where a film's
    density is not known.
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

    def derivatives(self, pressures: Sequence[float], **load: Any) -> Derivatives:
        """Return the equilibrium pose at pressures (kPa, one a chamber) with its derivatives;
        ``load`` are keyword arguments of ``pose`` beside pressures.

        Raises DesignError as ``pose`` does, and for a pose that is about to buckle.
        """
        pose = self.pose(pressures, **load)
        acting = self.load(*(load.get(name, value) for name, value in NO_LOAD.items()))
        return derivatives(self, pose, acting, load.get("sucked", False))

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
        """Return a pose whose tip stands at a place (3) in mm, within 1e-3 mm; its ``pressures``
        (kPa) are from 0 to ``most_pressure``, by default that of the maps.

        ``near`` is a pose to start from, such as the last one of a motion; ``load`` are keyword
        arguments of ``pose`` beside pressures. Of several solutions of a stack with many chambers
        it is one near the start. Below a plate without friction, where the top slides freely, the
        search takes long and may miss. Raises UnreachableError, with the nearest tip found, and
        DesignError for bad input.
        """
        place = vector_of(tip, "the place of the tip in mm")
        most = self.most_pressure if most_pressure is None else float(most_pressure)
        if not 0 < most <= self.most_pressure:
            raise DesignError(
                f"most_pressure = {most:g} kPa must be above 0 and at most "
                f"{self.most_pressure:g} kPa, to which the stack was made"
            )
        acting = self.load(*(load.get(name, value) for name, value in NO_LOAD.items()))
        return reach(self, place, acting, load, most, near)

    def start_freedoms(self, pressures: Sequence[float]) -> Array:
        """Return rise and tilt to start from, a row a kind of balloon: the plane nearest to the
        free heights of the balloons.
        """
        return np.stack([kind.rises(pressures) for kind in self.maps]) @ self.planes

    def motion(
        self, pressures: Sequence[float] | None = None, line: Line | None = None, **load: Any
    ) -> Motion:
        """Return a motion that starts at pressures (kPa, by default 0); ``line`` feeds each
        chamber, and ``load`` are keyword arguments of ``pose`` beside pressures.
        """
        start = self.pose((0.0,) * self.chambers if pressures is None else pressures, **load)
        return Motion(self, line or Line(), load, start)

    @cached_property
    def most_pressure(self) -> float:
        """Highest pressure of all maps, kPa."""
        return min(kind.most_pressure for kind in self.maps)

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
        """Weight of a level in mN. Raises DesignError where it is not known."""
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


def stack(
    design: Design,
    laminate: Laminate | None = None,
    most_pressure: float = MOST_PRESSURE,
    factors: Factors | None = None,
    form: Form | None = None,
) -> Stack:
    """Return the stack of a design with round pockets on one axis or side by side.

    ``most_pressure`` in kPa is the range of its maps; those of wide pockets end before. A lone
    balloon is held by a small disc. ``factors`` are calibrated ones; ``form`` replaces the
    design's own, for drawn pockets that are nearly round (``drawn_pockets.model_form``). Raises
    DesignError for pockets of another shape, for actuators round a tube and for films of unknown
    modulus.
    """
    flat = laminate or build(design)
    factors = factors or Factors()
    ratio = factors.modulus_ratio
    # Maps scale with the modulus: that of the film as bought serves every ratio.
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
        flat.thickness * factors.press_factor / len(row),
        reach,
        film_mass(flat) * GRAVITY / len(row) if has_densities else None,
        factors.calibration,
    )


def _clamped(balloon: Balloon) -> Balloon:
    """Return a balloon with a disc by which plates hold it, where it has no neck."""
    if balloon.neck:
        return balloon
    mate = None if balloon.mate is None else replace(balloon.mate, neck=GRIP * balloon.pocket)
    return replace(balloon, neck=GRIP * balloon.pocket, mate=mate)


def _mapped(kind: Balloon, most_pressure: float) -> BalloonMap:
    """Return a balloon's map, to a lower pressure where a wide pocket has no equilibrium."""
    for share in PRESSURE_SHARES:
        try:
            return balloon_map(kind, share * most_pressure)
        except DesignError:
            if share == PRESSURE_SHARES[-1]:
                raise
    raise AssertionError


# A stack in time: chambers that fill through their lines, in equilibrium at every instant.


MOST_STEPS = 40
HALVINGS = 20
OVERSHOT = 0.5
"""Share of a step's first slope that its last one may rise to, in the line search."""
DIFFERENCE = 1e-3
"""Step of the finite differences."""
SCALE_PRESSURE = 0.01
"""Pressure in kPa below which volumes are nearly linear in pressure, above in its logarithm."""
LONGEST_STEP = 2.0
SUCTION = 90.0
"""kPa below the atmosphere to which a shut chamber may come before its fluid boils or leaks."""
TOLERANCE = 1e-5
LEAST_CONTENT = 20.0
"""Tolerance as a share of a chamber's content; in ul, the least content it is taken of."""


class _Trial(NamedTuple):
    """A trial pose: ``x``, asinh(p / SCALE_PRESSURE) of the chambers; the excess of their volumes
    in ul (``wrong``); and kPa by x (``rates``).
    """

    x: Array
    pose: Pose
    wrong: Array
    rates: Array


@dataclass
class Motion:
    """A moving stack: ``step`` it, then read ``pose``, ``time`` and ``sources``.

    ``time`` is in s, ``sources`` the pressure in kPa at each chamber's valve or pump; ``line``
    feeds each chamber. Quasi-static: film and fluid have no inertia. ``load`` are keyword arguments
    of ``Stack.pose`` beside pressures. A gas that is pumped fills the line's dead volume and tube
    as well.
    """

    stack: Stack
    line: Line
    load: dict[str, Any]
    pose: Pose
    time: float = 0.0
    sources: tuple[float, ...] = ()

    @property
    def pressures(self) -> tuple[float, ...]:
        """Pressures in the chambers, kPa."""
        return self.pose.pressures

    def step(
        self,
        dt: float,
        pressures: Sequence[float] | None = None,
        flows: Sequence[float] | None = None,
    ) -> Pose:
        """Return the pose ``dt`` s later, with pressures (kPa) at the valves or flows (ul/s, of a
        gas at the atmosphere) of the pumps, one a chamber. Raises DesignError.
        """
        if not (np.isfinite(dt) and dt > 0):
            raise DesignError(f"dt = {dt:g} s must be above 0 s")
        if (pressures is None) == (flows is None):
            raise DesignError("a step takes either pressures or flows, one a chamber")
        values = np.asarray(pressures if flows is None else flows, dtype=float)
        if values.shape != (self.stack.chambers,) or not np.isfinite(values).all():
            raise DesignError(f"a step takes {self.stack.chambers} finite numbers, one a chamber")
        before = self._contents(self.pose)
        acts = max(0.0, min(dt, self.time + dt - self.line.delay))
        if flows is None:
            self.pose = self._fed_pose(before, acts, values)
            self.sources = tuple(values.tolist())
        else:
            self.pose = self._filled_pose(before + acts * values)
            self.sources = tuple(
                self.line.source_pressure(float(q), p) if q > 0 else p
                for q, p in zip(values, self.pose.pressures, strict=True)
            )
        self.time += dt
        return self.pose

    def _contents(self, pose: Pose) -> Array:
        more = self.line.dead_volume + self.line.tube_volume if self.line.fluid.is_gas else 0.0
        pairs = zip(pose.volumes, pose.pressures, strict=True)
        return np.array([self.line.content(volume + more, p) for volume, p in pairs])

    def _fed_pose(self, before: Array, dt: float, sources: Array) -> Pose:
        def missed(pose: Pose) -> Array:
            pairs = zip(sources, pose.pressures, strict=True)
            flow = np.array([self.line.flow(float(source), p) for source, p in pairs])
            return np.asarray(self._contents(pose) - before - dt * flow)

        return self._solved(missed, before)

    def _filled_pose(self, contents: Array) -> Pose:
        """Return the pose with these contents. A pump that stands still is shut: its chamber may
        come to suction where a load bends it open.
        """
        return self._solved(
            lambda pose: np.asarray(self._contents(pose) - contents), contents, SUCTION
        )

    def _solved(self, missed: Callable[[Pose], Array], scale: Array, suction: float = 0.0) -> Pose:
        """Return the pose without residual content, at ``suction`` kPa below the atmosphere at
        most. A chamber that would need less draws in the rest.

        The residual, as a volume, is the gradient of one function of the pressures, whose minimum
        is sought: volumes are slopes of a concave potential, and more pressure lets less in.
        Newton's method with a line search in asinh(p / SCALE_PRESSURE), in which volumes are nearly
        linear.
        """
        most = math.asinh(self.stack.most_pressure / SCALE_PRESSURE)
        least = -math.asinh(suction / SCALE_PRESSURE)
        close = TOLERANCE * np.maximum(np.abs(scale), LEAST_CONTENT)
        start = np.maximum(np.arcsinh(np.asarray(self.pose.pressures) / SCALE_PRESSURE), least)
        now = self._tried(start, missed, self.pose)
        for _ in range(MOST_STEPS):
            lacks = (now.x >= most) & (now.wrong < 0)
            counts = ~((now.x <= least) & (now.wrong >= 0)) & ~lacks
            if (np.abs(now.wrong) <= close)[counts].all():
                if lacks.any():
                    raise DesignError(
                        f"the chambers would need more than {self.stack.most_pressure:g} kPa; ask "
                        "for less, or make the stack with a larger most_pressure"
                    )
                return now.pose
            ahead = self._newton_step(missed, now, counts, least)
            ahead *= min(1.0, LONGEST_STEP / max(float(np.abs(ahead).max()), 1e-12))
            now = self._downhill(missed, now, ahead, (least, most))
        raise DesignError(
            "no equilibrium of the stack found at the end of this step; try a shorter one"
        )

    def _downhill(
        self,
        missed: Callable[[Pose], Array],
        now: _Trial,
        ahead: Array,
        ends: tuple[float, float],
    ) -> _Trial:
        """Return the trial at the end of a step's descent, by a line search."""
        steep = float(now.wrong @ (now.rates * ahead))
        share = 1.0
        for _ in range(HALVINGS):
            x = np.clip(now.x + share * ahead, *ends)
            try:
                tried = self._tried(x, missed, now.pose)
            except DesignError:
                share /= 2
                continue
            still = (x > ends[0]) & (x < ends[1])
            slope = float((tried.wrong * tried.rates * ahead)[still].sum())
            if slope <= -OVERSHOT * steep:
                return tried
            share *= min(max(steep / (steep - slope), 0.1), 0.7)
        return tried

    def _tried(self, x: Array, missed: Callable[[Pose], Array], near: Pose) -> _Trial:
        pressures = np.minimum(SCALE_PRESSURE * np.sinh(x), self.stack.most_pressure)
        pose = self.stack.pose(tuple(pressures.tolist()), near=near, sucked=True, **self.load)
        return _Trial(x, pose, missed(pose) / self._content_rate(pose), SCALE_PRESSURE * np.cosh(x))

    def _content_rate(self, pose: Pose) -> Array:
        """Return the content of each chamber by its volume."""
        return np.array([self.line.content(1.0, p) for p in pose.pressures])

    def _newton_step(
        self,
        missed: Callable[[Pose], Array],
        now: _Trial,
        counts: NDArray[np.bool_],
        least: float,
    ) -> Array:
        """Return Newton's step by x of the active chambers; 0 of the others."""
        columns = []
        for chamber in np.flatnonzero(counts):
            moved = now.x.copy()
            moved[chamber] += DIFFERENCE if moved[chamber] < 1 else -DIFFERENCE
            tried = self._tried(moved, missed, now.pose)
            columns.append((tried.wrong - now.wrong)[counts] / (tried.x - now.x)[chamber])
        which, slopes = np.flatnonzero(counts), np.array(columns).T
        while True:
            ahead = np.zeros_like(now.x)
            ahead[which] = _symmetric_step(slopes, now.wrong[which], now.rates[which])
            may = (now.x[which] > least) | (ahead[which] >= 0)
            if may.all():
                return ahead
            # What has no less pressure to give stays: the others move alone.
            which, slopes = which[may], slopes[np.ix_(may, may)]


def _symmetric_step(slopes: Array, wrong: Array, rates: Array) -> Array:
    """Return the step by x, its matrix made symmetric and positive definite by pressure."""
    matrix = slopes / rates
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    values = np.maximum(np.abs(values), 1e-9 * np.abs(values).max(initial=0.0) + 1e-12)
    return np.asarray(-(vectors @ ((vectors.T @ wrong) / values)) / rates)
