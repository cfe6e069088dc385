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
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import DesignError, UnreachableError
from sbafab.models.derivatives import Tangent, derivatives, tangent
from sbafab.models.film_elements import Array
from sbafab.models.stack_balance import (
    Balance,
    Equilibria,
    Pose,
    bounded_solutions,
    is_positive_definite,
    put,
    step_limit,
)
from sbafab.models.stack_loads import WALL_STIFFNESS, Load, OuterPlate, PlateContact, crossing

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
ROUGH_CONTACT, CLOSE_CONTACT = 0.3, 1e-4
"""Last step (mm, rad, asinh) against a soft plate, and against the plate itself."""
SOFT_STEPS, PLATE_STEPS = 4, 16
"""Newton steps against a soft plate, converged or not, and maximum against the plate itself."""
TURNED_BACK = 0.5
"""Share of a pressure step reversed by the next step, above which that one is halved."""
RESIDUAL = 1e-3
"""Tolerance of the residual, mN or mN mm."""
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


Path = tuple[str, tuple[float, ...]]
"""A continuation path to solutions against an outer plate: the freedoms that it starts from, those
"posed" in equilibrium, on the "arc" from the starting pressures or "aimed" along the arc that ends
at the place; and the plate's stiffness in mN/mm in the first solutions.

On soft plates the top's load shifts gradually from point to point as it rolls, so rates hardly
jump.
"""
STICKING: tuple[Path, ...] = (("arc", ()), ("arc", (3e2, 3e3, 3e4)), ("posed", ()))
"""Paths against a plate that the tip sticks to, tried in turn."""
SLIDING: tuple[Path, ...] = (
    ("arc", (3e2, 3e3, 3e4)),
    ("arc", (1e3, 3e3, 1e4, 3e4, 1e5)),
    ("arc", ()),
)
"""Paths against a plate without friction."""
POSED: Path = ("posed", ())
AIMED: tuple[Path, ...] = (("aimed", (3e2, 3e3, 3e4)), ("aimed", (1e5,)), ("aimed", ()))
"""Paths tried after the ones from two starts: a stack that folds below a plate has several stable
equilibria at the same pressures, and only a start near one converges to it.
"""


@dataclass(frozen=True, eq=False)
class Search:
    """Inverse kinematics of a ``stack`` under a ``load``, with asinh(p / P0) up to ``most``."""

    stack: Stack
    load: Load | None
    most: float

    @property
    def _wall(self) -> OuterPlate | None:
        return None if self.load is None else self.load.wall

    def reached(self, places: Array, near: Pose | None) -> Equilibria:
        """Return the states whose tips stand at places (n, 3) in mm; ``near`` is a pose to start
        from. Raises UnreachableError with the nearest tip found.
        """
        if len(places) > TOGETHER:
            parts = np.array_split(places, -(-len(places) // TOGETHER))
            each = [self.reached(part, near) for part in parts]
            return Equilibria(*(np.concatenate(part) for part in zip(*each, strict=True)))
        if near is None:
            guess = starts(self.stack, places, self.most)
        else:
            guess = np.arcsinh(np.tile(near.pressures, (len(places), 1)) / P0)
        guess, nearest = np.clip(guess, 0.0, self.most), Nearest(self, places)
        if not len(places):
            return nearest.states
        if self._wall is None:
            self._reach_freely(nearest, guess, near)
        else:
            self._reach_at_plate(nearest, guess, near, self._wall)
        nearest.refuse_missed()
        return nearest.states

    def _reach_freely(self, nearest: Nearest, guess: Array, near: Pose | None) -> None:
        if near is None:
            at = self.begin(guess)
        else:
            rows = (
                near.freedoms if self.load is not None else near.freedoms[self.stack.first_levels]
            )
            at = rows[None].repeat(len(guess), 0)
        nearest.take(nearest.rest, self._solved(nearest.places, guess, at))
        if self.load is not None:
            # From equilibria, where the load has bent the stack far.
            self._follow(nearest, guess, [POSED], near)
        self._descend(nearest, (guess, *further_starts(guess, self.most)), near)

    def _reach_at_plate(
        self, nearest: Nearest, guess: Array, near: Pose | None, wall: OuterPlate
    ) -> None:
        raised = np.where(guess > guess.min(-1, keepdims=True), guess, 0.0)
        further = further_starts(guess, self.most)
        paths = STICKING if wall.sticks else SLIDING
        if near is not None:
            self._follow(nearest, guess, [POSED], near)
        self._follow(nearest, guess, paths, near)
        self._follow(nearest, raised, paths)
        nearest.settle_for_met()
        self._follow(nearest, guess, AIMED)
        self._follow(nearest, raised, AIMED)
        nearest.settle_for_met()
        self._descend(nearest, [guess], near)
        self._look_about(nearest, paths[0])
        for x in further:
            self._follow(nearest, x, paths)
        nearest.settle_for_met()
        self._descend(nearest, further[: DESCENT_STARTS - 1], None)
        self._look_about(nearest, paths[0])

    def _follow(
        self, nearest: Nearest, x: Array, paths: Iterable[Path], near: Pose | None = None
    ) -> None:
        """Follow paths from asinh(p / P0) (n, chambers)."""
        for begin, soft in paths:
            rest = nearest.rest
            if begin == "posed":
                at, rest = self._posed(x, rest, near)
            elif begin == "aimed":
                at = self._arc_freedoms(nearest.places[rest])
            else:
                at = self.begin(x[rest])
            if rest.size:
                nearest.take(rest, self._solved(nearest.places[rest], x[rest], at, soft))

    def _posed(
        self, x: Array, rest: NDArray[np.int_], near: Pose | None
    ) -> tuple[Array, NDArray[np.int_]]:
        """Return the freedoms in equilibrium at asinh(p / P0) (n, chambers) for the ``rest`` of the
        places, from a pose; and for which they are found.
        """
        start = None if near is None else near.freedoms[None].repeat(len(rest), 0)
        if not rest.size:
            return np.zeros((0, len(self.stack.levels), 3)), rest
        begin = self.equilibria(x[rest], start)
        return begin.freedoms[begin.is_met], rest[begin.is_met]

    def _look_about(self, nearest: Nearest, path: Path) -> None:
        """Search from near the best states: descents end at a contact change.

        These are itself, with a chamber's pressure changed, and with one raised as another is
        lowered, as it is along the edge of a contact.
        """
        each = np.eye(self.stack.chambers)
        sizes = product((0.05, 0.2, 0.6), (1, -1), each)
        pairs = [0.15 * (first - second) for first, second in permutations(each, 2)]
        for change in (0.0 * each[0], *(size * sign * one for size, sign, one in sizes), *pairs):
            rest = nearest.rest
            for number in rest[nearest.away[rest] < STRANDED].tolist():
                pose = self.stack.pose_of(nearest.states, number)
                x = np.zeros((len(nearest.places), len(change)))
                x[number] = np.arcsinh(np.array(pose.pressures) / P0) + change
                alone = Nearest(self, nearest.places[[number]])
                one = np.clip(x[[number]], 0.0, self.most)
                self._follow(alone, one, [POSED], pose)
                self._follow(alone, one, [path])
                nearest.take(np.array([number]), alone.states)
        nearest.settle_for_met()

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

    def _solved(
        self, places: Array, x: Array, at: Array, soft: tuple[float, ...] = ()
    ) -> Equilibria:
        """Return the states by Newton's method from freedoms (n, rows, 3), first against ``soft``
        plates; a plate's contact forces are additional unknowns.
        """
        points = 0 if self._wall is None else len(self._wall.local)
        run = SearchRun(places, x, at, np.full((len(x), points), np.nan))
        for stiffness in soft:
            assert self.load is not None
            run, _ = self._newton(run, self.load._replace(stiffness=stiffness))
        run, balance = self._newton(run, self.load)
        found, which = self.stack.no_states(self.load, len(x)), np.flatnonzero(balance.is_found)
        if which.size:
            end = balance.part(which)
            pressures = P0 * np.sinh(run.x[which])
            put(found, which, self.stack.settled(pressures, end, self.load))
            unstable = which[~end.is_stable]
            if unstable.size:
                # A straight column that would buckle, unless a stable equilibrium is near.
                put(found, unstable, self.equilibria(run.x[unstable], run.at[unstable]))
        return found

    def _newton(self, run: SearchRun, load: Load | None) -> tuple[SearchRun, Balance]:
        """Return the states after a small step, or the last one, and their balance."""
        is_soft = load is not None and load.stiffness < WALL_STIFFNESS
        most, enough = (STEPS, LAST_STEP) if self._wall is None else (PLATE_STEPS, CLOSE_CONTACT)
        if is_soft:
            most, enough = SOFT_STEPS, ROUGH_CONTACT
        end, live = SearchRun(*(part.copy() for part in run)), np.arange(len(run.x))
        balance = Balance.of(run.at, is_found=False)
        before, is_close = np.zeros_like(run.x), np.zeros(len(live), dtype=bool)
        for number in range(most + 1):
            forces = None if np.isnan(run.forces).any() else run.forces
            springs = self.stack.springs(P0 * np.sinh(run.x), by_level=load is not None)
            now = tangent(self.stack, springs, load, run.at, forces)
            is_over = is_close & (is_soft | (np.abs(now.gradient).max(-1) < RESIDUAL))
            put(end, live, run)
            if is_over.any():
                ends = Balance.of(run.at[is_over], now.push[is_over])
                ends.is_stable[:] = is_positive_definite(now.matrix[is_over]).all(1)
                put(balance, live[is_over], ends)
            if is_over.all() or number == most:
                break
            try:
                move, ahead, deeper = self._step(run, now)
            except np.linalg.LinAlgError:
                break
            # Oscillation at the limits of pressures and at contact changes.
            turns = (ahead * before).sum(-1) < -TURNED_BACK * (before * before).sum(-1)
            share = np.where(turns, 0.5, 1.0) * step_limit(move).min(-1)
            at, x = run.at + share[:, None, None] * move, run.x + share[:, None] * ahead
            pushes = run.forces
            if now.touch is not None:
                pushes = now.touch.resists(now.touch.deep + share[:, None] * deeper)
            run, before = SearchRun(run.places, np.clip(x, 0.0, self.most), at, pushes), ahead
            largest = np.maximum(np.abs(move).max((1, 2)), np.abs(ahead).max(1))
            is_close, goes = largest < enough, ~is_over & np.isfinite(largest)
            if not goes.any():
                break
            if not goes.all():
                run = SearchRun(*(part[goes] for part in run))
                live, before, is_close = live[goes], before[goes], is_close[goes]
        return end, balance

    def _step(self, run: SearchRun, now: Tangent) -> tuple[Array, Array, Array]:
        """Return the steps of freedoms (n, rows, 3) and of asinh(p / P0) (n, chambers) to the
        linearised equilibria, and by how many mm a plate's points are then deeper (n, points).

        A plate's contacts are those at the step's end. They act on the freedoms through the six
        turns and moves of the top alone, so that other contacts than the first need no further
        solution of all levels (Woodbury).
        """
        (count, size), touch = now.gradient.shape, now.touch
        tip, motions = now.top(self.stack, run.at)
        by_pressure = now.springs.order(run.at, 1)[1].swapaxes(-1, -2)
        filling = (by_pressure * (P0 * np.cosh(run.x))[:, None, None]).reshape(count, size, -1)
        if touch is None:
            moves = now.solved(np.concatenate([-now.gradient[..., None], filling], -1))
            ahead = self._ahead(run, tip, motions.swapaxes(1, 2) @ moves)
            columns = np.concatenate([np.ones((count, 1)), ahead], axis=1)
            return (moves @ columns[..., None]).reshape(run.at.shape), ahead, run.forces
        forces = (touch.forces[:, None] @ touch.lines)[:, 0]
        free = -now.gradient + (motions @ forces[..., None])[..., 0]
        moves = now.solved(np.concatenate([free[..., None], filling, motions], -1))
        by_top = motions.swapaxes(1, 2) @ moves
        begin, by_pull = by_top[..., :-6], by_top[..., -6:]
        before = is_in = touch.touches
        first, live = _contact_top(touch, is_in)[0], np.ones(count, dtype=bool)
        for number in range(CONTACT_ROUNDS):
            stiffness, pull = _contact_top(touch, is_in)
            more = stiffness - first
            pulled = begin.copy()
            pulled[..., 0] -= (by_pull @ pull[..., None])[..., 0]
            tops = np.asarray(np.linalg.solve(np.eye(6) + by_pull @ more, pulled))
            ahead = self._ahead(run, tip, tops)
            columns = np.concatenate([np.ones((count, 1)), ahead], axis=1)
            top = (tops @ columns[..., None])[..., 0]
            deeper = (touch.lines @ top[..., None])[..., 0]
            after = touch.deep + deeper > touch.least
            live &= (after != is_in).any(1)
            if number and (CONTACT_ROUNDS - 1 - number) % 2 == 0:
                # Later rounds would repeat an oscillation between two sets of contacts.
                live &= (after != before).any(1)
            if not live.any():
                break
            before, is_in = is_in, np.where(live[:, None], after, is_in)
        back = pull + (more @ top[..., None])[..., 0]
        columns = np.concatenate([columns, -back], axis=1)
        return (moves @ columns[..., None]).reshape(run.at.shape), ahead, deeper

    def _ahead(self, run: SearchRun, tip: Array, tops: Array) -> Array:
        """Return the steps of asinh(p / P0) (n, chambers) from the turns and moves of the top (n,
        6, 1 + chambers) to equilibrium and by each pressure.
        """
        wall, motion = self._wall, tops[:, 3:] - crossing(tip).swapaxes(1, 2) @ tops[:, :3]
        rates, away = motion[..., 1:], run.places - tip
        missing, share = away - motion[..., 0], np.full(len(tip), LEAST_DAMPING)
        if wall is not None:
            missing = movable(wall, missing)
            # Friction may prevent pressures from moving it further, and they would stray.
            is_near = np.linalg.norm(missing, axis=-1) < NEAR / 4
            missing = np.where(is_near[:, None], 0.0, missing)
            # A top flat on the plate cannot move along its normal, so distant steps must not try.
            share = share + PLATE_DAMPING * np.minimum((away * away).sum(-1), 1.0)
        damping = share * (rates * rates).sum((1, 2)) + 1e-12
        return bounded_steps(rates, missing, damping, self._room(run.x))

    # From equilibrium to equilibrium, one place after the other.

    def _descend(self, nearest: Nearest, starts: Iterable[Array], near: Pose | None) -> None:
        """Descend by Levenberg and Marquardt's method; the first start is at a pose ``near``."""
        for number, x in enumerate(starts):
            for row in nearest.rest.tolist():
                start = None if near is None or number else near.freedoms[None]
                states = self._by_poses(
                    nearest.places[row], x[row], self.equilibria(x[[row]], start)
                )
                nearest.take(np.array([row]), states)
        nearest.settle_for_met()

    def _by_poses(self, place: Array, x: Array, states: Equilibria) -> Equilibria:
        """Return the state whose tip is nearest to the place, as reached from one."""
        damping = DAMPING
        for _ in range(POSES if states.is_met[0] else 0):
            pose = self.stack.pose_of(states)
            missing = place - pose.tip
            if np.linalg.norm(missing) < NEAR:
                break
            try:
                by_pressure = derivatives(self.stack, pose, self.load).by_pressure.tip
            except DesignError:
                break
            rates = by_pressure * (P0 * np.cosh(x))
            scale = float((rates * rates).sum(0).max()) + 1e-12
            while True:
                size = np.array([damping * scale])
                (ahead,) = bounded_steps(rates[None], missing[None], size, self._room(x[None]))
                if np.abs(ahead).max() < STILL or damping > MOST_DAMPING:
                    return states
                tried = self.equilibria((x + ahead)[None], pose.freedoms[None])
                left = np.linalg.norm(place - self.stack.tips(tried.freedoms)[0])
                if tried.is_met[0] and left < np.linalg.norm(missing):
                    break
                damping *= 8
            x, states = np.clip(x + ahead, 0.0, self.most), tried
            damping = max(damping / 8, LEAST_DAMPING)
        return states

    def _arc_freedoms(self, places: Array) -> Array:
        """Return rise and tilt of each level (n, levels, 3) on arcs to places, all alike."""
        bend, length, ways = _arcs(places)
        levels = len(self.stack.levels)
        rise = length / levels - self.stack.pitch
        level = np.stack([rise, -bend * ways[:, 1] / levels, bend * ways[:, 0] / levels], -1)
        return level[:, None].repeat(levels, 1)


@dataclass
class Nearest:
    """The ``states`` (n) whose tips are nearest to ``places`` (n, 3), ``away`` (n) in mm, and the
    places for which the search is over.
    """

    search: Search
    places: Array

    def __post_init__(self) -> None:
        count = len(self.places)
        self.states = self.search.stack.no_states(self.search.load, count)
        self.away, self.is_over = np.full(count, math.inf), np.zeros(count, dtype=bool)

    @property
    def rest(self) -> NDArray[np.int_]:
        """Numbers of the places that are searched."""
        return np.flatnonzero(~self.is_over)

    def take(self, which: NDArray[np.int_], states: Equilibria) -> None:
        """Keep states for some of the places if they are nearer."""
        missing = self.places[which] - self.search.stack.tips(states.freedoms)
        away = np.where(states.is_met, np.linalg.norm(missing, axis=-1), math.inf)
        wall, is_end = self.search._wall, away < NEAR
        if wall is not None:
            is_end = (away < MET) & (np.linalg.norm(movable(wall, missing), axis=-1) < MET / 2)
        good = away < self.away[which]
        put(self.states, which[good], states.part(good))
        self.away[which[good]], self.is_over[which[good]] = away[good], is_end[good]

    def settle_for_met(self) -> None:
        """End the search for places that tips have reached, if only just."""
        self.is_over |= self.away < MET

    def refuse_missed(self) -> None:
        """Raise UnreachableError for the first place that is not met."""
        self.settle_for_met()
        for number in self.rest[:1].tolist():
            away, place = float(self.away[number]), self.places[number]
            if not math.isfinite(away):
                raise DesignError(
                    "no equilibrium of the stack found near this place; try another load"
                )
            tip = self.search.stack.tips(self.states.freedoms)[number]
            most = P0 * math.sinh(self.search.most)
            raise UnreachableError(
                f"the tip cannot reach {_written(place)} mm with 0 to {most:g} kPa; the nearest "
                f"place found is {_written(tip)} mm, {away:.3g} mm away"
            )


def _contact_top(touch: PlateContact, is_in: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the stiffness (n, 6, 6) and the pull (n, 6) of points in contact (n, points) on the
    turns and moves of the top.
    """
    stiff = touch.stiff * is_in
    lines = touch.lines.swapaxes(1, 2)
    return (lines * stiff[:, None]) @ touch.lines, (lines @ (stiff * touch.deep)[..., None])[..., 0]


class SearchRun(NamedTuple):
    """Places (n, 3), asinh(p / P0) (n, chambers), freedoms (n, rows, 3) and contact forces (n,
    points) in mN, NaN where a plate's stiffness makes them.
    """

    places: Array
    x: Array
    at: Array
    forces: Array


def bounded_steps(rates: Array, missing: Array, damping: Array, room: tuple[Array, Array]) -> Array:
    """Return the steps (n, chambers) with least |rates @ step - missing|^2 + damping |step|^2, of
    rates (n, 3, chambers), that stay within ``room``, its least and largest values (n, chambers).
    """
    turned = rates.swapaxes(1, 2)
    matrix = turned @ rates + damping[:, None, None] * np.eye(rates.shape[-1])
    return bounded_solutions(matrix, (turned @ missing[..., None])[..., 0], *room)


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


def further_starts(guess: Array, most: float) -> list[Array]:
    """Return starts all over the range, the nearer to the middle the earlier: (..., chambers)."""
    shares = [np.full(guess.shape[-1], share) for share in (0.6, 0.85, 0.3)]
    for one in np.eye(guess.shape[-1]):
        shares += [0.3 + 0.6 * one, 0.9 - 0.6 * one]
    return [np.zeros(guess.shape) + share * most for share in shares]


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


def _written(place: Array) -> str:
    # Adding 0 makes -0 a plain 0.
    return "(" + ", ".join(f"{round(value, 3) + 0.0:g}" for value in place.tolist()) + ")"
