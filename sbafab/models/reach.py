"""Inverse kinematics of a stack: the pressures that bring the middle of its top to a place, or to
many places at once, under a load and in contact.

First freedoms and pressures are found together by Newton's method: each step solves the linearised
equilibrium, and the pressures' change is the least, within their limits, that brings the linearised
tip to the place (Nocedal and Wright, Numerical Optimization, Sec. 18.1). Against an outer plate the
points in contact are those at the step's end, so that it passes where one closes or opens and the
tip's rates jump. Where these steps do not converge, Levenberg and Marquardt's method goes from
equilibrium to equilibrium by the tip's derivatives, one place after the other. Pressures are
counted in asinh(p / P0), in which heights are nearly linear. Arrays have one row per place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations, product, takewhile
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import DesignError, UnreachableError
from sbafab.models.derivatives import derivatives, hessian
from sbafab.models.film_elements import Array
from sbafab.models.stack_balance import (
    Balance,
    Equilibria,
    Pose,
    is_positive_definite,
    put,
    step_limit,
)
from sbafab.models.stack_loads import (
    WALL_STIFFNESS,
    Load,
    LoadedEnergy,
    OuterPlate,
    PlateContact,
    Springs,
    crossing,
    level_motions,
    loaded_energy,
    plate_chain,
    with_diagonal_blocks,
)

if TYPE_CHECKING:
    from sbafab.models.stack import Stack

P0 = 0.1
"""Pressure in kPa below which pressures are counted evenly, above in their logarithm."""
NEAR, MET = 1e-4, 1e-3
"""Distances in mm from the place at which a search ends, and at which the tip has reached it."""
STRANDED = 0.5
"""Distance in mm from the place within which a failed search is repeated from nearby places."""
STEPS, LAST_STEP = 25, 2e-3
"""Maximum Newton steps of freedoms and pressures; step size (mm, rad, asinh) of the last one."""
WHOLE_STEPS = 5
"""Halve steps that change contacts after this many, to stop cycling."""
CLOSE = 0.05
"""Step (mm, rad, asinh) below which tangents are exact."""
ROUGH_CONTACT, CLOSE_CONTACT = 0.3, 1e-4
"""Last step (mm, rad, asinh) against a soft plate, and against the plate itself."""
SOFT_STEPS, PLATE_STEPS = 4, 16
"""Newton steps against a soft plate, converged or not, and maximum against the plate itself."""
TURNED_BACK = 0.5
"""Share of a pressure step reversed by the next step, above which that one is halved."""
CONTACT_RESIDUAL = 1e-3
"""Tolerance of the residual against an outer plate, mN or mN mm."""
LONGEST_STEP = 1.5
"""Largest change of asinh(p / P0) in one step."""
POSES = 40
"""Maximum number of equilibria from one start."""
DESCENT_STARTS = 3
"""Starts of descents against an outer plate, after Newton's method from all starts."""
CONTACT_ROUNDS = 8
"""Rounds in which a step's contacts with an outer plate are found."""
DAMPING = 1e-3
"""First damping, as a share of the largest square of a derivative (mm by asinh)."""
LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e3
PLATE_DAMPING = 1e-4
"""Damping against an outer plate, a mm away from the place."""
STILL = 1e-6
"""Step (mm, rad, asinh) that counts as no change."""


TOGETHER = 128
"""Places solved together: more bring no speed, and cost memory."""


class Way(NamedTuple):
    """A continuation path to solutions against an outer plate: it starts at an equilibrium
    (``is_posed``), on the arc from the pressures of ``starts``, or on the arc that ends at the
    place (``is_aimed``); ``soft`` is the plate's stiffness in mN/mm in the first solutions.

    On soft plates the top's load shifts gradually from point to point as it rolls, so rates hardly
    jump.
    """

    is_posed: bool
    soft: tuple[float, ...] = ()
    is_aimed: bool = False


POSED, ON_ARC = Way(True), Way(False)
STICKING = (ON_ARC, Way(False, (3e2, 3e3, 3e4)), POSED)
"""Paths against a plate that the tip sticks to, tried in turn."""
SLIDING = (Way(False, (3e2, 3e3, 3e4)), Way(False, (1e3, 3e3, 1e4, 3e4, 1e5)), ON_ARC)
"""Paths against a plate without friction."""
AIMED = tuple(Way(False, soft, is_aimed=True) for soft in ((3e2, 3e3, 3e4), (1e5,), ()))
"""Paths tried after the ones from two starts: a stack that folds below a plate has several stable
equilibria at the same pressures, and only a start near one converges to it.
"""


class Linearisation(NamedTuple):
    """Linearised equilibria: tips (n, 3) in mm, what they move by as the freedoms come to
    equilibrium and by each pressure (n, 3, 1 + chambers), the freedoms' steps for these (n, rows,
    3, 1 + chambers), and the tangent stiffness (n, groups of rows, size, size).
    """

    tips: Array
    motion: Array
    moves: Array
    matrix: Array


@dataclass(frozen=True, eq=False)
class Search:
    """Inverse kinematics of a ``stack`` under a ``load``, with asinh(p / P0) up to ``most``."""

    stack: Stack
    load: Load | None
    most: float

    @property
    def _plate(self) -> tuple[Load, OuterPlate]:
        assert self.load is not None
        assert self.load.wall is not None
        return self.load, self.load.wall

    def reached(self, places: Array, near: Pose | None) -> Equilibria:
        """Return the states whose tips stand at places (n, 3) in mm; ``near`` is a pose to start
        from. Raises UnreachableError with the nearest tip found.
        """
        if not len(places):
            return self.stack.no_states(self.load, 0)
        if len(places) > TOGETHER:
            parts = np.array_split(places, -(-len(places) // TOGETHER))
            each = [self.reached(part, near) for part in parts]
            return Equilibria(*(np.concatenate(part) for part in zip(*each, strict=True)))
        if near is None:
            guess = starts(self.stack, places, self.most)
        else:
            guess = np.arcsinh(np.array([near.pressures]) / P0)
        guess = np.clip(guess, 0.0, self.most)
        wall = None if self.load is None else self.load.wall
        if wall is None:
            found = self._by_freedoms(places, guess, None if near is None else near.freedoms[None])
        elif near is None:
            found = self._by_attempts(places, guess)
        else:
            found = self.stack.no_states(self.load, len(places))
        for number in np.flatnonzero(~self._is_met(places, found)).tolist():
            best = self.stack.pose_of(found, number) if found.is_met[number] else None
            best = _Alone(self, places[number], guess[number]).reached(best, near)
            put(found, np.array([number]), self.stack.states_of(best, self.load))
        return found

    def _is_met(self, places: Array, states: Equilibria) -> NDArray[np.bool_]:
        """Return True (n) for states at their places."""
        missing = places - self.stack.tips(states.freedoms)
        is_met = states.is_met & (np.linalg.norm(missing, axis=-1) < MET)
        if self.load is not None and self.load.wall is not None:
            rest = movable(self.load.wall, missing)
            is_met &= np.linalg.norm(rest, axis=-1) < MET / 2
        return np.asarray(is_met)

    def equilibria(self, x: Array, start: Array | None = None) -> Equilibria:
        """Return the equilibria at asinh(p / P0) (n, chambers), from freedoms (n, levels, 3)."""
        pressures = P0 * np.sinh(np.clip(x, 0.0, self.most))
        return self.stack.equilibria(pressures, self.load, start)

    def _room(self, x: Array) -> tuple[Array, Array]:
        """Return the least and largest step of asinh(p / P0)."""
        return np.maximum(-x, -LONGEST_STEP), np.minimum(self.most - x, LONGEST_STEP)

    def begin(self, x: Array) -> Array:
        """Return freedoms (n, rows, 3) on the arcs to the places."""
        kinds = self.stack.start_freedoms(P0 * np.sinh(x))
        return kinds if self.load is None else kinds[:, self.stack.levels]

    # Freedoms and pressures together.

    def _by_freedoms(self, places: Array, x: Array, near: Array | None) -> Equilibria:
        """Return the states by Newton's method, from freedoms ``near`` (n, levels, 3)."""
        stack, live, found = (
            self.stack,
            np.arange(len(places)),
            self.stack.no_states(self.load, len(places)),
        )
        if near is None:
            at = self.begin(x)
        else:
            at = near if self.load is not None else near[:, stack.first_levels]
        rows = stack.places if self.load is None else stack.level_places
        largest = np.full(len(live), math.inf)
        for number in range(STEPS):
            now = self._linearised(x, at, largest < CLOSE)
            if now is None:
                break
            rates = now.motion[..., 1:]
            missing = places - now.tips - now.motion[..., 0]
            damping = LEAST_DAMPING * (rates * rates).sum((1, 2)) + 1e-12
            ahead = bounded_steps(rates, missing, damping, self._room(x))
            move = now.moves[..., 0] + (now.moves[..., 1:] @ ahead[:, None, :, None])[..., 0]
            share, closed = step_limit(move).min(-1), rows.closed(at)
            if number >= WHOLE_STEPS:
                changes = rows.closed(at + share[:, None, None] * move) != closed
                share = np.where(changes.any((1, 2)), share / 2, share)
            x = np.clip(x + share[:, None] * ahead, 0.0, self.most)
            at = at + share[:, None, None] * move
            largest = np.maximum(np.abs(move).max((1, 2)), np.abs(ahead).max(1))
            is_last = (largest < LAST_STEP) & (share == 1)
            if is_last.any():
                is_last &= (rows.closed(at) == closed).all((1, 2))
            is_last |= largest < STILL
            if is_last.any():
                left = missing - (rates @ ahead[..., None])[..., 0]
                is_met = is_last & (np.linalg.norm(left, axis=-1) < NEAR)
                is_met[is_met] = is_positive_definite(now.matrix[is_met]).all(1)
                if is_met.any():
                    put(found, live[is_met], self._settled(x[is_met], at[is_met]))
            rest = ~is_last & np.isfinite(largest)
            if not rest.any():
                break
            if not rest.all():
                live, places, x, at, largest = (
                    part[rest] for part in (live, places, x, at, largest)
                )
        return found

    def _settled(self, x: Array, at: Array, pushes: Array | None = None) -> Equilibria:
        """Return states in stable equilibrium."""
        true = np.ones(len(x), dtype=bool)
        none = np.zeros(len(x)) if pushes is None else pushes
        balance = Balance(at, none, true, true.copy())
        return self.stack.settled(P0 * np.sinh(x), balance, self.load)

    def _linearised(self, x: Array, at: Array, is_close: NDArray[np.bool_]) -> Linearisation | None:
        """Return the linearised equilibria, None if one is singular; exact only if ``is_close``."""
        stack, load = self.stack, self.load
        springs = stack.springs(P0 * np.sinh(x), by_level=load is not None)
        if load is None:
            _, gradient, matrix = springs.energy(at)
            plates = plate_chain(at[:, stack.levels], stack.pitch)
            motion = plates.tip_motion(level_motions(plates))[..., :3]
            kinds = (stack.levels == np.arange(len(stack.maps))[:, None]).astype(float)
            motion = kinds @ motion.reshape(*motion.shape[:2], 9)
        else:
            now = loaded_energy(springs, stack.pitch, load, at)
            gradient, plates, rest = now.gradient[:, None], now.plates, now.rest()
            if is_close.any():
                matrix = hessian(now, rest, at, stack.pitch, is_close)
            else:
                matrix = with_diagonal_blocks(rest, now.blocks)
            matrix, motion = matrix[:, None], plates.tip_motion(now.motions)[..., :3]
        right = np.concatenate([-gradient.reshape(*at.shape, 1), self._filling(springs, x, at)], -1)
        groups, size = matrix.shape[1:3]
        try:
            moves = np.linalg.solve(matrix, right.reshape(len(x), groups, size, -1))
        except np.linalg.LinAlgError:
            return None
        flat = moves.reshape(len(x), -1, right.shape[-1])
        tips = motion.reshape(len(x), -1, 3).swapaxes(1, 2) @ flat
        return Linearisation(plates.tip, tips, flat.reshape(right.shape), matrix)

    def _filling(self, springs: Springs, x: Array, at: Array) -> Array:
        """Return the pull on the freedoms by asinh(p / P0): (n, rows, 3, chambers)."""
        by_pressure = springs.slopes(at)[1].swapaxes(-1, -2)
        return np.asarray(by_pressure * (P0 * np.cosh(x))[:, None, None])

    # Freedoms and pressures together, against an outer plate.

    def _by_attempts(self, places: Array, guess: Array) -> Equilibria:
        """Return the states nearest to their places that the first paths lead to."""
        found = self.stack.no_states(self.load, len(places))
        best = np.full(len(places), math.inf)
        _, wall = self._plate
        rest = np.arange(len(places))
        for x, way in first_attempts(wall, guess, self.most):
            states = self.by_contacts(places[rest], x[rest], self.begin(x[rest]), way.soft)
            away = np.linalg.norm(places[rest] - self.stack.tips(states.freedoms), axis=-1)
            is_nearer = states.is_met & (away < best[rest])
            best[rest[is_nearer]] = away[is_nearer]
            put(found, rest[is_nearer], states.part(is_nearer))
            rest = np.flatnonzero(~self._is_met(places, found))
            if not rest.size:
                break
        return found

    def by_contacts(
        self, places: Array, x: Array, at: Array, soft: tuple[float, ...]
    ) -> Equilibria:
        """Return the states by Newton's method from freedoms (n, levels, 3), with the plate's
        contact forces as additional unknowns, first against ``soft`` plates.
        """
        load, wall = self._plate
        run = _ContactRun(places, x, at, np.full((len(x), len(wall.local)), np.nan))
        for stiffness in soft:
            run, _ = self._contact_newton(run, load._replace(stiffness=stiffness))
        run, is_settled = self._contact_newton(run, load)
        found, which = self.stack.no_states(self.load, len(x)), np.flatnonzero(is_settled)
        if not which.size:
            return found
        x, at = run.x[which], run.at[which]
        springs = self.stack.springs(P0 * np.sinh(x), by_level=True)
        now = loaded_energy(springs, self.stack.pitch, load, at, run.forces[which])
        put(found, which, self._settled(x, at, now.push))
        unstable = ~is_positive_definite(hessian(now, now.rest(), at, self.stack.pitch))
        if unstable.any():
            # A straight column that would buckle, unless a stable equilibrium is near.
            put(found, which[unstable], self.equilibria(x[unstable], at[unstable]))
        return found

    def _contact_newton(
        self, run: _ContactRun, load: Load
    ) -> tuple[_ContactRun, NDArray[np.bool_]]:
        """Return the states after a small step, or the last one, and which (n) are in equilibrium
        against the plate.
        """
        is_soft, end = load.stiffness < WALL_STIFFNESS, _ContactRun(*(part.copy() for part in run))
        enough, most = (ROUGH_CONTACT, SOFT_STEPS) if is_soft else (CLOSE_CONTACT, PLATE_STEPS)
        live, is_settled = np.arange(len(run.x)), np.zeros(len(run.x), dtype=bool)
        before, is_close = np.zeros_like(run.x), is_settled
        for number in range(most + 1):
            springs = self.stack.springs(P0 * np.sinh(run.x), by_level=True)
            forces = None if np.isnan(run.forces).any() else run.forces
            now = loaded_energy(springs, self.stack.pitch, load, run.at, forces)
            is_over = is_close & (is_soft | (np.abs(now.gradient).max(-1) < CONTACT_RESIDUAL))
            put(end, live, run)
            is_settled[live[is_over]] = True
            step = (
                None if is_over.all() or number == most else self._contact_step(run, now, springs)
            )
            if step is None:
                break
            move, ahead, deeper = step
            share = step_limit(move).min(-1)
            # Oscillation at the limits of pressures and at contact changes.
            turns = (ahead * before).sum(-1) < -TURNED_BACK * (before * before).sum(-1)
            share, before, touch = np.where(turns, share / 2, share), ahead, now.touch
            assert touch is not None
            x = np.clip(run.x + share[:, None] * ahead, 0.0, self.most)
            at = run.at + share[:, None, None] * move
            run = _ContactRun(
                run.places, x, at, touch.resists(touch.deep + share[:, None] * deeper)
            )
            largest = np.maximum(np.abs(move).max((1, 2)), np.abs(ahead).max(1))
            is_close, goes = largest < enough, ~is_over & np.isfinite(largest)
            if not goes.any():
                break
            if not goes.all():
                run = _ContactRun(*(part[goes] for part in run))
                live, before, is_close = live[goes], before[goes], is_close[goes]
        return end, is_settled

    def _contact_step(
        self, run: _ContactRun, now: LoadedEnergy, springs: Springs
    ) -> tuple[Array, Array, Array] | None:
        """Return the steps of freedoms (n, levels, 3) and of asinh(p / P0) (n, chambers) to the
        linearised equilibria with the contacts at their end, and how much deeper the points then
        are (n, points) in mm; None if one is singular.

        Contacts act on the freedoms through the six turns and moves of the top alone, so that
        other contacts than the first need no further solution of all levels (Woodbury).
        """
        touch, (count, size), at = now.touch, now.gradient.shape, run.at
        assert touch is not None
        motions, is_in = now.flat_motions, touch.touches
        forces = (touch.forces[:, None] @ touch.lines)[:, 0]
        first, pull = _contact_top(touch, is_in)
        tangent = hessian(now, now.rest(), at, self.stack.pitch)
        free = -now.gradient + (motions @ forces[..., None])[..., 0]
        filling = self._filling(springs, run.x, at).reshape(count, size, -1)
        right = np.concatenate([free[..., None], filling, motions], axis=-1)
        try:
            moves = np.linalg.solve(tangent, right)
        except np.linalg.LinAlgError:
            return None
        by_top = motions.swapaxes(1, 2) @ moves
        begin, by_pull = by_top[..., :-6], by_top[..., -6:]
        before, live = is_in, np.ones(count, dtype=bool)
        for number in range(CONTACT_ROUNDS):
            stiffness, pull = _contact_top(touch, is_in)
            more = stiffness - first
            pulled = begin.copy()
            pulled[..., 0] -= (by_pull @ pull[..., None])[..., 0]
            tops = np.asarray(np.linalg.solve(np.eye(6) + by_pull @ more, pulled))
            ahead = self._contact_ahead(run, now, tops)
            columns = np.concatenate([np.ones((count, 1)), ahead], axis=1)
            top = (tops @ columns[..., None])[..., 0]
            deeper = (touch.lines @ top[..., None])[..., 0]
            after = touch.deep + deeper > touch.least
            live &= (after != is_in).any(1)
            if is_turn(number):
                live &= (after != before).any(1)
            if not live.any():
                break
            before, is_in = is_in, np.where(live[:, None], after, is_in)
        back = pull + (more @ top[..., None])[..., 0]
        columns = np.concatenate([columns, -back], axis=1)
        return (moves @ columns[..., None]).reshape(at.shape), ahead, deeper

    def _contact_ahead(self, run: _ContactRun, now: LoadedEnergy, tops: Array) -> Array:
        """Return the steps of asinh(p / P0) (n, chambers) from the turns and moves of the top (n,
        6, 1 + chambers) to equilibrium and by each pressure.
        """
        _, wall = self._plate
        tip = now.plates.tip
        motion = tops[:, 3:] - crossing(tip).swapaxes(1, 2) @ tops[:, :3]
        rates, away = motion[..., 1:], run.places - tip
        missing = movable(wall, away - motion[..., 0])
        # Friction may prevent pressures from moving it further, and they would stray.
        is_near = np.linalg.norm(missing, axis=-1) < NEAR / 4
        missing = np.where(is_near[:, None], 0.0, missing)
        # A top flat on the plate cannot move along its normal, so distant steps must not try to.
        share = LEAST_DAMPING + PLATE_DAMPING * np.minimum((away * away).sum(-1), 1.0)
        damping = share * (rates * rates).sum((1, 2)) + 1e-12
        return bounded_steps(rates, missing, damping, self._room(run.x))


def _contact_top(touch: PlateContact, is_in: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the stiffness (n, 6, 6) and the pull (n, 6) of points in contact (n, points) on the
    turns and moves of the top.
    """
    stiff = touch.stiff * is_in
    lines = touch.lines.swapaxes(1, 2)
    return (lines * stiff[:, None]) @ touch.lines, (lines @ (stiff * touch.deep)[..., None])[..., 0]


class _ContactRun(NamedTuple):
    """Places (n, 3), asinh(p / P0) (n, chambers), freedoms (n, levels, 3) and contact forces (n,
    points) in mN, NaN where a plate's stiffness makes them.
    """

    places: Array
    x: Array
    at: Array
    forces: Array


def is_turn(number: int) -> bool:
    """Return True for a round that ends an oscillation between two sets of contacts: later rounds
    would repeat it.
    """
    return number > 0 and (CONTACT_ROUNDS - 1 - number) % 2 == 0


def bounded_steps(rates: Array, missing: Array, damping: Array, room: tuple[Array, Array]) -> Array:
    """Return the steps (n, chambers) with least |rates @ step - missing|^2 + damping |step|^2, of
    rates (n, 3, chambers), that stay within ``room``, its least and largest values (n, chambers).

    Components outside the room are clamped until the rest stays within: an active set that only
    grows, sufficient for one of many steps.
    """
    chambers = rates.shape[-1]
    turned = rates.swapaxes(1, 2)
    matrix = turned @ rates + damping[:, None, None] * np.eye(chambers)
    gradient = (turned @ missing[..., None])[..., 0]
    tried = np.linalg.solve(matrix, gradient[..., None])[..., 0]
    step = np.clip(tried, *room)
    is_free = step == tried
    live = ~is_free.all(1)
    for _ in range(chambers):
        if not live.any():
            break
        held = np.where(is_free, 0.0, step)
        right = np.where(is_free, gradient - (matrix @ held[..., None])[..., 0], step)
        reduced = np.where(is_free[:, None] & is_free[..., None], matrix, np.eye(chambers))
        tried = np.linalg.solve(reduced, right[..., None])[..., 0]
        within = np.clip(tried, *room)
        still = is_free & (within == tried)
        step = np.where(live[:, None], within, step)
        live &= (still != is_free).any(1) & still.any(1)
        is_free = still
    return np.asarray(step)


# Starts.


def starts(stack: Stack, places: Array, most: float) -> Array:
    """Return asinh(p / P0), up to ``most``, of chambers as long as on arcs from the base to places
    (n, 3) in mm: (n, chambers).

    An arc leaves the base at a right angle: constant curvature (Webster and Jones 2010).
    """
    bend, length, ways = _arcs(places)
    rises = (length - stack.flat_height)[:, None] - bend[:, None] * (ways @ stack.axes.T)
    return np.asarray(np.interp(rises, *_column_rises(stack, most)))


def _arcs(places: Array) -> tuple[Array, Array, Array]:
    """Return bend in rad (n,), length in mm (n,) and direction (n, 2) of the arcs to places (n, 3)
    that leave the base at a right angle.
    """
    aside, up = np.hypot(*places[:, :2].T), places[:, 2]
    bend, length = 2 * np.arctan2(aside, up), np.hypot(aside, up)
    turns = bend > 1e-9
    length[turns] *= (bend[turns] / 2) / np.sin(bend[turns] / 2)
    return bend, length, places[:, :2] / np.maximum(aside, 1e-12)[:, None]


@lru_cache(maxsize=16)
def _column_rises(stack: Stack, most: float) -> tuple[Array, Array]:
    """Return by how many mm all balloons of a chamber rise freely, and at which asinh(p / P0)."""
    grid = np.linspace(0.0, most, 33)
    kinds = np.stack([kind.rises(P0 * np.sinh(grid)) for kind in stack.maps])
    return kinds[stack.levels].sum(0), grid


def further_starts(guess: Array, most: float) -> Iterator[Array]:
    """Yield starts all over the range, the nearer to the middle the earlier: (..., chambers)."""
    for share in (0.6, 0.85, 0.3):
        yield np.full(guess.shape, share * most)
    for chamber in range(guess.shape[-1]):
        for low, high in ((0.3, 0.9), (0.9, 0.3)):
            x = np.full(guess.shape, low * most)
            x[..., chamber] = high * most
            yield x


def plate_starts(guess: Array, most: float) -> tuple[Array, ...]:
    """Return starts against an outer plate: (..., chambers) each."""
    raised = np.where(guess > guess.min(-1, keepdims=True), guess, 0.0)
    return guess, raised, *further_starts(guess, most)


def first_attempts(wall: OuterPlate, guess: Array, most: float) -> Iterator[tuple[Array, Way]]:
    """Return the starts and paths that are tried first, for many places together."""
    tries = product(plate_starts(guess, most)[:2], ways_to(wall))
    return takewhile(lambda each: not each[1].is_posed, tries)


def ways_to(wall: OuterPlate) -> tuple[Way, ...]:
    """Return the paths to solutions against an outer plate, in the order of trial."""
    return STICKING if wall.sticks else SLIDING


def movable(wall: OuterPlate, missing: Array) -> Array:
    """Return the part of distances (..., 3) in mm that pressures can remove.

    A plate that the tip sticks to yields across its line by less than ``MET``: pressures would
    stray if they tried to move the tip that way.
    """
    if not wall.sticks:
        return missing
    along = (missing @ wall.normal)[..., None] * wall.normal
    is_held = np.linalg.norm(missing - along, axis=-1) < MET / 2
    return np.where(is_held[..., None], along, missing)


# One place, from many starts.


class _Alone(NamedTuple):
    """A ``place`` (3,) in mm for which the first steps from a ``guess`` (chambers,) failed."""

    search: Search
    place: Array
    guess: Array

    def reached(self, best: Pose | None, near: Pose | None) -> Pose:
        """Return the pose at the place, ``best`` being the nearest so far. Raises
        UnreachableError.
        """
        load, most = self.search.load, self.search.most
        for stage in self._stages(near, load.wall if load is not None else None):
            best = self._nearest(best, stage(best))
            if best is not None and self._distance(best) < MET:
                return best
        if best is None:
            raise DesignError("no equilibrium of the stack found near this place; try another load")
        most_pressure, away = P0 * math.sinh(most), self._distance(best)
        raise UnreachableError(
            f"the tip cannot reach {_written(self.place)} mm with 0 to {most_pressure:g} kPa; the "
            f"nearest place found is {_written(best.tip)} mm, {away:.3g} mm away"
        )

    def _stages(self, near: Pose | None, wall: OuterPlate | None) -> Iterator[_Stage]:
        """Yield searches, each of which is given the best pose so far."""
        if wall is None:
            yield lambda _: self._by_freedoms(near)
            yield lambda best: self._descents(
                (self.guess, *further_starts(self.guess, self.search.most)), near, best
            )
            return
        first, second, *others = plate_starts(self.guess, self.search.most)
        ways = ways_to(wall)
        tries = [
            *product([first], ways if near is None else (POSED, *ways)),
            *product([second], ways),
        ]
        if near is None:
            tries = tries[len([*first_attempts(wall, self.guess, self.search.most)]) :]
        yield lambda _: self._by_contacts(tries, near)
        yield lambda _: self._by_contacts(product([first, second], AIMED), near)
        yield lambda _: self._descents([first], near, None)
        yield lambda best: self._about(best, ways)
        yield lambda _: self._by_contacts(product(others, ways), near)
        yield lambda _: self._descents(others[: DESCENT_STARTS - 1], near, None)
        yield lambda best: self._about(best, ways)

    def _by_freedoms(self, near: Pose | None) -> Iterator[Pose | None]:
        """Yield a pose from an equilibrium, where the load has bent the stack far."""
        posed = None if self.search.load is None else self._equilibrium(self.guess, near)
        if posed is not None:
            start = posed.freedoms[None]
            yield self._posed(self.search._by_freedoms(self.place[None], self.guess[None], start))

    def _by_contacts(
        self, tries: Iterable[tuple[Array, Way]], near: Pose | None
    ) -> Iterator[Pose | None]:
        search = self.search
        for x, way in tries:
            if way.is_posed:
                pose = self._equilibrium(x, near if x is self.guess else None)
                if pose is None:
                    continue
                at = pose.freedoms[None]
            else:
                at = self._arc_freedoms() if way.is_aimed else search.begin(x[None])
            yield self._posed(search.by_contacts(self.place[None], x[None], at, way.soft))

    def _about(self, best: Pose | None, ways: tuple[Way, ...]) -> Iterator[Pose | None]:
        """Yield poses from places near the best: descents end at a contact change.

        These are itself, with a chamber's pressure changed, and with one raised as another is
        lowered, as it is along the edge of a contact.
        """
        if best is None or self._distance(best) >= STRANDED:
            return
        x = np.arcsinh(np.array(best.pressures) / P0)
        each = np.eye(len(x))
        sizes = product((0.05, 0.2, 0.6), (1, -1), each)
        pairs = [0.15 * (first - second) for first, second in permutations(each, 2)]
        for change in (0.0 * x, *(size * sign * one for size, sign, one in sizes), *pairs):
            moved = np.clip(x + change, 0.0, self.search.most)
            alone = self._replace(guess=moved)
            yield from alone._by_contacts([(moved, POSED), (moved, ways[0])], best)

    def _descents(
        self, starts: Iterable[Array], near: Pose | None, best: Pose | None
    ) -> Iterator[Pose | None]:
        for number, x in enumerate(starts):
            yield self._by_poses(
                x, near if x is self.guess or (number == 0 and best is None) else None
            )

    def _by_poses(self, x: Array, near: Pose | None) -> Pose | None:
        """Return the pose whose tip is nearest to the place, as reached from a start; None without
        an equilibrium.
        """
        pose = self._equilibrium(x, near)
        if pose is None:
            return None
        damping = DAMPING
        for _ in range(POSES):
            missing = self.place - pose.tip
            if np.linalg.norm(missing) < NEAR:
                return pose
            try:
                by_pressure = derivatives(self.search.stack, pose, self.search.load).by_pressure.tip
            except DesignError:
                return pose
            rates = by_pressure * (P0 * np.cosh(x))
            scale = float((rates * rates).sum(0).max()) + 1e-12
            room = self.search._room(x[None])
            while True:
                size = np.array([damping * scale])
                (ahead,) = bounded_steps(rates[None], missing[None], size, room)
                if np.abs(ahead).max() < STILL or damping > MOST_DAMPING:
                    return pose
                tried = self._equilibrium(x + ahead, pose)
                if tried is not None and self._distance(tried) < self._distance(pose):
                    break
                damping *= 8
            x, pose = np.clip(x + ahead, 0.0, self.search.most), tried
            damping = max(damping / 8, LEAST_DAMPING)
        return pose

    def _equilibrium(self, x: Array, near: Pose | None) -> Pose | None:
        return self._posed(
            self.search.equilibria(x[None], None if near is None else near.freedoms[None])
        )

    def _posed(self, states: Equilibria) -> Pose | None:
        return self.search.stack.pose_of(states) if states.is_met[0] else None

    def _arc_freedoms(self) -> Array:
        """Return rise and tilt of each level (1, levels, 3) on the arc to the place, all alike."""
        (bend,), (length,), (way,) = _arcs(self.place[None])
        stack = self.search.stack
        levels = len(stack.levels)
        level = (length / levels - stack.pitch, -bend * way[1] / levels, bend * way[0] / levels)
        return np.tile(level, (1, levels, 1))

    def _nearest(self, best: Pose | None, poses: Iterable[Pose | None]) -> Pose | None:
        """Return the pose nearest to the place of ``best`` and ``poses``, whose search ends where
        one is met.
        """
        for pose in poses:
            if pose is None:
                continue
            if best is None or self._distance(pose) < self._distance(best):
                best = pose
            if self._is_end(best):
                break
        return best

    def _is_end(self, pose: Pose) -> bool:
        """Return True where a search ends."""
        load, missing = self.search.load, self.place - pose.tip
        if load is None or load.wall is None:
            return self._distance(pose) < NEAR
        rest = float(np.linalg.norm(movable(load.wall, missing)))
        return rest < MET / 2 and self._distance(pose) < MET

    def _distance(self, pose: Pose) -> float:
        return float(np.linalg.norm(pose.tip - self.place))


_Stage = Callable[[Pose | None], Iterable[Pose | None]]


def _written(place: Array) -> str:
    # Adding 0 makes -0 a plain 0.
    return "(" + ", ".join(f"{round(value, 3) + 0.0:g}" for value in place.tolist()) + ")"
