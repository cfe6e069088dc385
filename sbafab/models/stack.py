"""A whole actuator in real time: poses with their derivatives, inverse kinematics, and the motion
as chambers fill through their lines.

Lengths mm, pressures kPa, volumes ul; forces mN inside, N outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.actuators import build
from sbafab.design.records import Design, Form
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate, film_mass
from sbafab.models.balloon import Balloon
from sbafab.models.balloon_map import BalloonMap, balloon_map
from sbafab.models.balloons import balloons_of
from sbafab.models.derivatives import Derivatives, derivatives
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Array
from sbafab.models.pneumatics import Line
from sbafab.models.reach import reach
from sbafab.models.stack_loads import (
    vector_of,
)
from sbafab.models.stack_poses import NO_LOAD, Plate, Pose, PosedStack

__all__ = ["MOST_PRESSURE", "NO_LOAD", "Motion", "Plate", "Pose", "Stack", "stack"]

MOST_PRESSURE = 110.0
"""Highest pressure of maps in kPa, unless a request has a higher one."""
GRAVITY = 9.80665
GRIP = 0.15
"""Radius, as a share of its pocket's, of the disc by which plates hold a lone balloon."""
PRESSURE_SHARES = (1.0, 0.5, 0.2, 0.1)
"""Shares of the highest pressure, tried one after the other."""


@dataclass(frozen=True, eq=False)
class Stack(PosedStack):
    """An actuator as plates joined by balloons: poses, derivatives, inverse kinematics, motion."""

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
        """Return a pose whose tip is at a place (3) in mm, within 1e-3 mm; its ``pressures`` (kPa)
        are from 0 to ``most_pressure``, by default the maps' highest.

        ``near`` is a pose to start from, such as the last one of a motion; ``load`` are keyword
        arguments of ``pose`` beside pressures. If a stack with many chambers has several solutions,
        the result is one near the start. Raises UnreachableError, with the nearest tip found, and
        DesignError for bad input.
        """
        place = vector_of(tip, "the place of the tip in mm")
        most = self.reach_limit(most_pressure)
        acting = self.load(*(load.get(name, value) for name, value in NO_LOAD.items()))
        return reach(self, place, acting, load, most, near)

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
    design's, for drawn pockets that are nearly round (``drawn_pockets.model_form``). Raises
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
"""Limit of suction in kPa for a shut chamber, before its fluid boils or leaks."""
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
                        "for less"
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
            # Chambers at their least pressure stay; only the others move.
            which, slopes = which[may], slopes[np.ix_(may, may)]


def _symmetric_step(slopes: Array, wrong: Array, rates: Array) -> Array:
    """Return the step by x, its matrix made symmetric and positive definite by pressure."""
    matrix = slopes / rates
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    values = np.maximum(np.abs(values), 1e-9 * np.abs(values).max(initial=0.0) + 1e-12)
    return np.asarray(-(vectors @ ((vectors.T @ wrong) / values)) / rates)
