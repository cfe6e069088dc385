"""A whole actuator in real time: plates joined by balloons, in equilibrium with external loads.

Plates are the planes between balloons. Two neighbours are joined by one balloon per chamber: it
lengthens and tilts, and carries no shear ("a 2-DoF spring joint", paper, Sec. 4.4). A tilted
balloon is assumed to push at six points of a ring, each with the force of the axisymmetric balloon
at the gap there; between rigid plates that touch the film in a disc the ring's radius would be the
disc's, and it is assumed midway between neck and pocket. Flat balloons, and rims of tilted levels,
do not interpenetrate: contact by a stiff penalty, without friction. The equilibrium is the minimum
of one energy, found by Newton's method, for many states at once; one pose is a batch of one. Levels
of equal balloons without a load are equal and solved once. Lengths mm, pressures kPa, volumes ul;
forces mN inside, N outside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sbafab.actuators import build
from sbafab.design.records import Design, Form
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate, film_mass
from sbafab.models.balloon_map import BalloonMap, balloon_map
from sbafab.models.balloons import balloons_of
from sbafab.models.column import BatchPoses, Column, Plate, Pose, numbers_of, vector_of
from sbafab.models.derivatives import Derivatives, derivatives
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Array, Balloon
from sbafab.models.inverse_kinematics import reached
from sbafab.models.motion import BatchMotion, Motion
from sbafab.models.paper import counterparts_of_pose
from sbafab.models.pneumatics import Line
from sbafab.runtime import one_blas_thread

__all__ = ["MOST_PRESSURE", "BatchPoses", "Motion", "Plate", "Pose", "Stack", "StackBatch", "stack"]

MOST_PRESSURE = 110.0
"""Highest pressure of maps in kPa, unless a request has a higher one."""
GRAVITY = 9.80665
GRIP = 0.15
"""Radius, as a share of its pocket's, of the disc by which plates hold a lone balloon."""
PRESSURE_SHARES = (1.0, 0.5, 0.2, 0.1)
"""Shares of the highest pressure, tried one after the other."""


@dataclass(frozen=True, eq=False)
class Stack(Column):
    """An actuator as plates joined by balloons: poses, derivatives, inverse kinematics, motion.

    ``maps`` are the maps of the different balloons, ``levels`` the index of each level's map from
    the base; ``axes`` (chambers, 2) the centres of the chambers, ``pitch`` the height of a flat
    level and ``outline`` the radius of the plates, in mm; ``weight`` mN of each level, None if a
    film's density is unknown; ``calibration`` the name of the balloons' calibration, if any.
    """

    @property
    def counterparts(self) -> dict[str, str]:
        """The measured counterparts of the "height" and the "bend" of a pose, one clause each."""
        rows = counterparts_of_pose(self.chambers, self.calibration)
        return {quantity: row.sentence for quantity, row in rows.items()}

    def pose(
        self,
        pressures: Sequence[float],
        tip_load: Sequence[float] = (0.0, 0.0, 0.0),
        gravity: bool | Sequence[float] = False,
        plate: float | Plate | None = None,
        near: Pose | None = None,
        sucked: bool = False,
    ) -> Pose:
        """Return the equilibrium pose at pressures (kPa, one per chamber).

        ``tip_load`` is a force in N on the middle of the top; ``gravity`` is True for a level base,
        or the downward direction (3); ``plate`` is an outer plate, or its height in mm. ``near`` is
        an initial pose, such as the previous pose of a motion. Pressures may be below 0 only if
        chambers may be ``sucked``: closed, with a fluid of constant volume. Raises DesignError for
        pressures outside the maps, and if Newton's method finds no equilibrium.
        """
        try:
            values = np.array(pressures, dtype=float)
        except (TypeError, ValueError):
            raise DesignError("pressures must be numbers in kPa, one per chamber") from None
        if values.shape != (self.chambers,):
            raise DesignError(
                f"{values.size} pressures are given for {self.chambers} chambers; give one per "
                "chamber"
            )
        load = self.acting({"tip_load": tip_load, "gravity": gravity, "plate": plate})
        start = None if near is None else near.freedoms[None]
        return self.equilibria(values[None], load, start, sucked).pose()

    def derivatives(self, pressures: Sequence[float], **load: Any) -> Derivatives:
        """Return the equilibrium pose at pressures (kPa, one per chamber) with its derivatives;
        ``load`` holds keyword arguments of ``pose`` other than pressures.

        Raises DesignError like ``pose``, and for a pose that is about to buckle.
        """
        return derivatives(self.states_of(self.pose(pressures, **load), self.acting(load)))

    def stiffness(self, pressures: Sequence[float], **load: Any) -> Array:
        """Return the stiffness (6, 6) of the tip in N/mm, N and N mm, as in ``derivatives``."""
        return self.derivatives(pressures, **load).stiffness

    def reach(
        self,
        tip: Sequence[float],
        most_pressure: float | None = None,
        near: Pose | None = None,
        **load: Any,
    ) -> Pose:
        """Return a pose with its tip at a place (3) in mm, within 1e-3 mm; its ``pressures`` (kPa)
        are from 0 to ``most_pressure``, by default the maps' highest.

        ``near`` is an initial pose, such as the previous pose of a motion; ``load`` holds keyword
        arguments of ``pose`` other than pressures. If a stack with many chambers has several
        solutions, the result is one near the start. Raises UnreachableError, with the nearest tip
        found, and DesignError for bad input.
        """
        place = vector_of(tip, "the place of the tip in mm")
        most = self.reach_limit(most_pressure)
        return reached(self, self.acting(load), place[None], most, near).pose()

    def reach_limit(self, most_pressure: float | None) -> float:
        """Return the highest pressure in kPa for ``reach``. Raises DesignError."""
        most = self.most_pressure if most_pressure is None else float(most_pressure)
        if not 0 < most <= self.most_pressure:
            raise DesignError(
                f"most_pressure = {most:g} kPa must be above 0 and at most "
                f"{self.most_pressure:g} kPa, the range of the stack"
            )
        return most

    def motion(
        self, pressures: Sequence[float] | None = None, line: Line | None = None, **load: Any
    ) -> Motion:
        """Return a motion that starts at pressures (kPa, by default 0); ``line`` feeds each
        chamber, and ``load`` holds keyword arguments of ``pose`` other than pressures.
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

        ``near`` holds N initial poses; ``load`` holds keyword arguments of ``Stack.pose`` other
        than pressures. Raises DesignError like ``Stack.pose``, for the first state without a pose.
        """
        table = self.stack.table(pressures)
        if near is not None and len(near.freedoms) != len(table):
            raise DesignError(
                f"near has {len(near.freedoms)} poses for {len(table)} states; give one per state"
            )
        start = None if near is None else near.freedoms
        return self.stack.equilibria(table, self.stack.acting(load), start).met()

    @one_blas_thread
    def reach(self, tips: ArrayLike, most_pressure: float | None = None, **load: Any) -> BatchPoses:
        """Return poses with tips at places (N, 3) in mm, equal to those of ``Stack.reach`` one by
        one, with pressures from 0 to ``most_pressure`` in kPa.

        ``load`` holds keyword arguments of ``Stack.pose`` other than pressures. Raises
        UnreachableError and DesignError like ``Stack.reach``, for the first place that is not
        reached.
        """
        sentence = "positions of the tip in mm must be finite numbers, one row of three for each"
        places, most = numbers_of(tips, (None, 3), sentence), self.stack.reach_limit(most_pressure)
        return reached(self.stack, self.stack.acting(load), places, most, None).met()

    def motion(
        self,
        count: int,
        line: Line | None = None,
        pressures: Sequence[float] | None = None,
        **load: Any,
    ) -> BatchMotion:
        """Return ``count`` motions that start at pressures (kPa, by default 0); ``line`` feeds each
        chamber, and ``load`` holds keyword arguments of ``Stack.pose`` other than pressures.
        """
        if count < 1:
            raise DesignError(f"count = {count} must be at least 1")
        begin = (0.0,) * self.stack.chambers if pressures is None else pressures
        start = self.stack.states_of(self.stack.pose(begin, **load), self.stack.acting(load))
        poses = BatchPoses.joined([start] * count)
        return BatchMotion(line or Line(), start, poses, np.zeros(count))


def stack(
    design: Design,
    laminate: Laminate | None = None,
    most_pressure: float = MOST_PRESSURE,
    factors: Factors | None = None,
    form: Form | None = None,
) -> Stack:
    """Return the stack of a design with round pockets on one axis or side by side.

    ``most_pressure`` in kPa is the range of its maps; maps of wide pockets end earlier. A lone
    balloon is held by a small disc. ``factors`` are calibration factors; ``form`` replaces the
    design's, for drawn pockets that are nearly round (``actuator.model_form``). Raises DesignError
    for pockets of another shape, actuators around a tube and films of unknown modulus.
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
    """Return a balloon with a disc by which plates hold it, if it has no neck."""
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
