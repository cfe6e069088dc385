"""Inverse kinematics of stacks: the pressures that bring the middle of the top to a place, for many
places at once, under a load and in contact.

First freedoms and pressures are solved together by Newton's method: each step solves the linearised
equilibrium, and the pressures' change is the smallest, within their limits, that brings the
linearised tip to the place (Nocedal and Wright, Numerical Optimization, Sec. 18.1). Outer plates
are stiffened gradually: on compliant ones the top's load shifts from point to point as it rolls, so
derivatives hardly jump. If these steps do not converge, the Levenberg-Marquardt method goes from
equilibrium to equilibrium with the tip's derivatives. Pressures are expressed in coordinates in
which heights are nearly linear (``place_of``). Arrays have one row per place.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import DesignError, UnreachableError
from sbafab.models.column import BatchPoses, Column, Pose
from sbafab.models.derivatives import (
    Linearised,
    linearised_poses,
    place_of,
    pressure_at,
    pressure_rate,
    together,
)
from sbafab.models.film_elements import Array
from sbafab.models.stack_balance import bounded_solutions
from sbafab.models.stack_loads import Load, OuterPlate

NEAR, MET = 1e-4, 1e-3
"""Distances in mm from the place at which a search ends, and at which the tip has reached it."""
STEPS = 25
"""Maximum Newton steps of freedoms and pressures."""
SOFT, ROUGH, SOFT_STEPS = (3e2, 3e3, 3e4), 0.3, 4
"""Stiffness in mN/mm of an outer plate in the first solutions, their last step (mm, rad, asinh) and
their most steps, converged or not."""
LONGEST_STEP = 1.5
"""Largest change of a coordinate in one step."""
POSES = 40
"""Maximum number of equilibria from one start."""
DAMPING = 1e-3
"""First damping, as a share of the largest square of a derivative (mm by asinh)."""
LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e3
PLATE_DAMPING = 1e-4
"""Damping against an outer plate, a mm away from the place."""
UNSTABLE = 1e6
"""mm by which an unstable pose counts as farther away, so that any stable one is preferred."""
STILL = 1e-6
"""Step (mm, rad, asinh) that counts as no change."""
TOGETHER = 128
"""Places solved together: more bring no speed, and cost memory."""


def reached(
    column: Column, load: Load | None, places: Array, most_pressure: float, near: Pose | None
) -> BatchPoses:
    """Return the poses with tips at places (n, 3) in mm, at 0 to ``most_pressure`` in kPa; ``near``
    is an initial pose. Raises UnreachableError with the nearest tip found.
    """
    states = []
    for begin in range(0, max(len(places), 1), TOGETHER):
        part = places[begin : begin + TOGETHER]
        search = Search(column, load, part, float(place_of(most_pressure)))
        search.run(near)
        states.append(search.best)
    return BatchPoses.joined(states)


class Search:
    """The ``best`` poses of a column under a load for places (n, 3), with coordinates of pressures
    up to ``most``; how far ``away`` (n) their tips count in mm, and where the search is over.
    """

    def __init__(self, column: Column, load: Load | None, places: Array, most: float) -> None:
        self.column, self.load, self.places = column, load, places
        self.most, self.ends = most, (0.0, most)
        self.wall = None if load is None else load.wall
        count = len(places)
        self.best = column.states(load, np.zeros((count, column.chambers)), None)
        self.away, self.is_over = np.full(count, math.inf), np.zeros(count, dtype=bool)

    @property
    def rest(self) -> NDArray[np.int_]:
        """The numbers of the places still searched."""
        return np.flatnonzero(~self.is_over)

    def run(self, near: Pose | None) -> None:
        """Search from a pose, or from starts over the whole range. Raises UnreachableError."""
        if near is not None:
            x = place_of(np.tile(near.pressures, (len(self.places), 1)))
            at = near.freedoms[None].repeat(len(x), 0)
            self._newton(self.rest, x, at)
            self._descend(x, at)
        guess = np.clip(self._guess(), 0.0, self.most)
        self._newton_from(guess)
        self._descend(guess, None)
        further = further_starts(guess, self.most)
        for x in further:
            self._newton_from(x)
        for x in further:
            self._descend(x, None)
        self._refuse_missed()

    def _newton_from(self, x: Array) -> None:
        """Search by Newton's method from pressure coordinates (n, chambers)."""
        at = self.column.start_freedoms(pressure_at(x))[:, self.column.levels]
        if self.wall is not None:
            self._newton(self.rest, x, at, SOFT)
        self._newton(self.rest, x, at)
        self._settle_for_met()

    # Freedoms and pressures together.

    def _newton(
        self, rest: NDArray[np.int_], x: Array, at: Array, soft: tuple[float, ...] = ()
    ) -> None:
        """Search from pressure coordinates (n, chambers) and freedoms (n, levels, 3), first against
        ``soft`` plates.
        """
        if not rest.size:
            return
        states, forces = self.column.states(self.load, pressure_at(x[rest]), at[rest]), None

        def ahead(which: NDArray[np.int_], now: Linearised, x: Array, moves: Array) -> Array:
            return self._ahead(self.places[rest[which]], now, x, moves)

        for stiffness in soft:
            assert self.load is not None
            states = replace(states, load=self.load._replace(stiffness=stiffness))
            forces, states = together(states, ahead, self.ends, SOFT_STEPS, ROUGH, forces)
        states = replace(states, load=self.load)
        _, states = together(states, ahead, self.ends, STEPS, forces=forces)
        # A straight column would buckle, unless a stable equilibrium is near; and against a plate,
        # which is hard, the push is that of an equilibrium alone.
        loose = np.flatnonzero(states.is_found & (~states.is_stable | (self.wall is not None)))
        if loose.size:
            some = states.part(loose)
            again = self.column.equilibria(some.pressures, self.load, some.freedoms)
            states = states.replaced(loose, again)
        self._take(rest, states)

    def _ahead(self, places: Array, now: Linearised, x: Array, moves: Array) -> Array:
        """Return the steps of coordinates (n, chambers), as for ``together``."""
        (tip, motion), wall = now.tip_motion(), self.wall
        moved = motion[:, :3] @ moves
        rates, away = moved[..., 1:], places - tip
        missing, share = away - moved[..., 0], np.full(len(tip), LEAST_DAMPING)
        if wall is not None:
            missing = movable(wall, missing)
            # Friction may prevent pressures from moving it further, and they would stray.
            is_near = np.linalg.norm(missing, axis=-1) < NEAR / 4
            missing = np.where(is_near[:, None], 0.0, missing)
            # A top flat on the plate cannot move along its normal, so distant steps must not try.
            share = share + PLATE_DAMPING * np.minimum((away * away).sum(-1), 1.0)
        damping = share * (rates * rates).sum((1, 2)) + 1e-12
        return self._bounded(rates, missing, damping, x)

    def _bounded(self, rates: Array, missing: Array, damping: Array, x: Array) -> Array:
        """Return the steps (n, chambers) that stay within the range and minimise |rates @ step -
        missing|^2 + damping |step|^2, for rates (n, 3, chambers).
        """
        turned = rates.swapaxes(1, 2)
        matrix = turned @ rates + damping[:, None, None] * np.eye(rates.shape[-1])
        room = np.maximum(-x, -LONGEST_STEP), np.minimum(self.most - x, LONGEST_STEP)
        return bounded_solutions(matrix, (turned @ missing[..., None])[..., 0], *room)

    # From equilibrium to equilibrium.

    def _descend(self, x: Array, near: Array | None) -> None:
        """Descend by the Levenberg-Marquardt method from the equilibria at coordinates (n,
        chambers), solved from freedoms (n, levels, 3) if given.
        """
        rest = self.rest
        x = x[rest]
        now = self._equilibria(x, None if near is None else near[rest])
        damping = np.full(len(rest), DAMPING)
        for _ in range(POSES):
            self._take(rest, now)
            goes = now.is_met & ~self.is_over[rest] & (damping <= MOST_DAMPING)
            if not goes.any():
                break
            rest, x, now, damping = rest[goes], x[goes], now.part(goes), damping[goes]
            try:
                at = linearised_poses(now)
                moves = at.energy.solved(at.filling)
            except (DesignError, np.linalg.LinAlgError):
                break
            rates = at.tip_motion()[1][:, :3] @ moves * pressure_rate(x)[:, None]
            missing = self.places[rest] - now.tips
            scale = (rates * rates).sum(1).max(1) + 1e-12
            ahead = self._bounded(rates, missing, damping * scale, x)
            tried = self._equilibria(x + ahead, now.freedoms)
            left = np.linalg.norm(self.places[rest] - tried.tips, axis=-1)
            good = tried.is_met & (left < np.linalg.norm(missing, axis=-1))
            still = np.abs(ahead).max(1) < STILL
            damping = np.where(good, np.maximum(damping / 8, LEAST_DAMPING), damping * 8)
            damping[still] = math.inf
            x = np.where(good[:, None], np.clip(x + ahead, 0.0, self.most), x)
            now = now.replaced(good, tried.part(good))
        self._settle_for_met()

    def _equilibria(self, x: Array, start: Array | None) -> BatchPoses:
        pressures = pressure_at(np.clip(x, 0.0, self.most))
        return self.column.equilibria(pressures, self.load, start)

    # The nearest states.

    def _take(self, which: NDArray[np.int_], states: BatchPoses) -> None:
        """Keep states for some of the places if their tips are nearer."""
        missing = self.places[which] - states.tips
        away = np.where(states.is_met, np.linalg.norm(missing, axis=-1), math.inf)
        away += np.where(states.is_stable, 0.0, UNSTABLE)
        is_end = away < NEAR
        if self.wall is not None:
            along = np.linalg.norm(movable(self.wall, missing), axis=-1)
            is_end = (away < MET) & (along < MET / 2)
        good = away < self.away[which]
        self.best = self.best.replaced(which[good], states.part(good))
        self.away[which[good]], self.is_over[which[good]] = away[good], is_end[good]

    def _settle_for_met(self) -> None:
        """End the search for places that tips have reached, even if only just."""
        self.is_over |= self.away < MET

    def _refuse_missed(self) -> None:
        """Raise UnreachableError for the first place that no pose meets, stable or not."""
        is_unstable = np.isfinite(self.away) & ~self.best.is_stable
        self.away[is_unstable] -= UNSTABLE
        self._settle_for_met()
        for number in self.rest[:1].tolist():
            away, place = float(self.away[number]), self.places[number]
            if not math.isfinite(away):
                raise DesignError(
                    "no equilibrium of the stack found near this place; try another load"
                )
            tip = self.best.part([number]).tips[0]
            raise UnreachableError(
                f"the tip cannot reach {_written(place)} mm with 0 to "
                f"{float(pressure_at(self.most)):g} kPa; the nearest place found is "
                f"{_written(tip)} mm, {away:.3g} mm away"
            )

    # Starts.

    def _guess(self) -> Array:
        """Return coordinates (n, chambers) of chambers with the lengths of arcs from the base to
        the places: constant curvature (Webster and Jones 2010), perpendicular to the base.
        """
        column, grid = self.column, np.linspace(0.0, self.most, 33)
        aside, up = np.hypot(*self.places[:, :2].T), self.places[:, 2]
        bend = 2 * np.arctan2(aside, up)
        length = np.hypot(aside, up) / np.sinc(bend / math.tau)
        ways = self.places[:, :2] / np.maximum(aside, 1e-12)[:, None]
        kinds = np.stack([kind.rises(pressure_at(grid)) for kind in column.maps])
        rises = (length - column.flat_height)[:, None] - bend[:, None] * (ways @ column.axes.T)
        return np.asarray(np.interp(rises, kinds[column.levels].sum(0), grid))


def further_starts(guess: Array, most: float) -> list[Array]:
    """Return starts over the whole range, those nearer to the middle first: (n, chambers)."""
    shares = [np.full(guess.shape[-1], share) for share in (0.6, 0.85, 0.3, 0.1)]
    for one in np.eye(guess.shape[-1]):
        shares += [0.3 + 0.6 * one, 0.9 - 0.6 * one]
    return [np.zeros(guess.shape) + share * most for share in shares]


def movable(wall: OuterPlate, missing: Array) -> Array:
    """Return the part of distances (n, 3) in mm that pressures can remove.

    A plate to which the tip sticks yields across its line by less than ``MET``: pressures would
    diverge if they tried to move the tip that way.
    """
    if not wall.sticks:
        return missing
    along = (missing @ wall.normal)[..., None] * wall.normal
    is_held = np.linalg.norm(missing - along, axis=-1) < MET / 2
    return np.where(is_held[..., None], along, missing)


def _written(place: Array) -> str:
    # Adding 0 makes -0 a plain 0.
    return "(" + ", ".join(f"{round(value, 3) + 0.0:g}" for value in place.tolist()) + ")"
