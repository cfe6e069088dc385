"""Inverse kinematics of many places of a stack's tip at once.

The same steps as in ``reach`` from the same starts, for all places together, so the pressures are
the same as one by one. Places that these steps do not meet are left to ``reach``. One column per
state. Lengths mm, pressures kPa, forces mN.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.models import reach
from sbafab.models.batch_balance import Levels, LevelsAt, TouchingAt, step_share
from sbafab.models.batch_loads import chain_of, crossed
from sbafab.models.reach import P0
from sbafab.models.stack_loads import WALL_POINTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.film_elements import Array
    from sbafab.models.stack_loads import Load, OuterPlate
    from sbafab.models.stack_poses import PosedStack

FEW = 6
"""Number of places below which solving each alone is faster."""
CHUNK, TOGETHER = 1024, 384
"""Places solved together, and simultaneous runs against a plate: larger batches bring no speed."""
GROUP_ENDS = (1, 3, 6, 18)
"""Ends of the groups of attempts at a place; each group starts after the previous one failed."""


class States(NamedTuple):
    """States of n places (3, n): asinh(p / P0) of the chambers, ``x`` (chambers, n), freedoms
    (rows, 3, n) and contact ``forces`` (points, n) in mN, NaN where a plate's stiffness makes them.
    """

    places: Array
    x: Array
    freedoms: Array
    forces: Array

    def at(self, where: NDArray[np.int_] | NDArray[np.bool_]) -> States:
        """Return some of the states."""
        return States(*(part[..., where] for part in self))


class ReachStep(NamedTuple):
    """Steps of freedoms (rows, 3, n) and of asinh(p / P0) (chambers, n), and of contact depths
    (points, n) in mm.
    """

    move: Array
    ahead: Array
    deeper: Array

    @property
    def largest(self) -> Array:
        """The largest component of each: (n,)."""
        return np.asarray(np.maximum(np.abs(self.move).max((0, 1)), np.abs(self.ahead).max(0)))


class Reached(NamedTuple):
    """Freedoms (levels, 3, n), pressures (chambers, n), volumes (chambers, n) and forces (n) in mN
    on an outer plate; NaN volumes where a place is not met.
    """

    freedoms: Array
    pressures: Array
    volumes: Array
    pushes: Array


class AttemptTable(NamedTuple):
    """Attempts to meet a place against an outer plate, in the order of ``reach``: the number of the
    start of each, ``starts`` (attempts,); by stage the ``stiffness`` (stages, attempts) of the
    plate in mN/mm, and the ``last`` stage (attempts,), against the plate itself; the ``groups`` are
    tried one after the other.
    """

    starts: NDArray[np.int_]
    stiffness: Array
    last: NDArray[np.int_]
    groups: tuple[range, ...]

    @classmethod
    def of(cls, wall: OuterPlate, stiffness: float, starts: int) -> AttemptTable:
        """Return the attempts from ``starts`` starts, until one begins at an equilibrium."""
        each = [(start, way) for start in range(starts) for way in reach.ways_to(wall)]
        each = list(takewhile(lambda one: not one[1].is_posed, each))
        last = np.array([len(way.soft) for _, way in each])
        table = np.full((last.max() + 1, len(each)), stiffness)
        for number, (_, way) in enumerate(each):
            table[: len(way.soft), number] = way.soft
        ends = [0, *(end for end in GROUP_ENDS if end < len(each)), len(each), len(each)]
        groups = tuple(range(*pair) for pair in pairwise(ends))
        return cls(np.array([start for start, _ in each]), table, last, groups)


class PlateRuns(NamedTuple):
    """Runs of n attempts (``attempt``) at places (``place``): the current ``stage`` of each, the
    ``steps`` made in it, the last step of pressures, ``before`` (chambers, n), and ``is_close``,
    True if that was small enough for an equilibrium.
    """

    place: NDArray[np.int_]
    attempt: NDArray[np.int_]
    stage: NDArray[np.int_]
    steps: NDArray[np.int_]
    before: Array
    is_close: NDArray[np.bool_]
    states: States

    @classmethod
    def of(cls, place: NDArray[np.int_], attempt: NDArray[np.int_], states: States) -> PlateRuns:
        """Return runs that begin."""
        none = np.zeros_like(place)
        return cls(place, attempt, none, none, np.zeros_like(states.x), none > 0, states)

    def at(self, where: NDArray[np.int_]) -> PlateRuns:
        """Return some of the runs."""
        return PlateRuns(
            self.place[where],
            self.attempt[where],
            self.stage[where],
            self.steps[where],
            self.before[:, where],
            self.is_close[where],
            self.states.at(where),
        )

    def joined(self, other: PlateRuns) -> PlateRuns:
        """Return both."""
        states = zip(self.states, other.states, strict=True)
        return PlateRuns(
            np.concatenate([self.place, other.place]),
            np.concatenate([self.attempt, other.attempt]),
            np.concatenate([self.stage, other.stage]),
            np.concatenate([self.steps, other.steps]),
            np.concatenate([self.before, other.before], axis=1),
            np.concatenate([self.is_close, other.is_close]),
            States(*(np.concatenate(pair, axis=-1) for pair in states)),
        )


@dataclass(frozen=True, eq=False)
class BatchReach:
    """Inverse kinematics of a ``stack`` under a ``load``, with asinh(p / P0) up to ``most``."""

    stack: PosedStack
    load: Load | None
    most: float

    @cached_property
    def levels(self) -> Levels:
        """The rows of a state."""
        return Levels.of(self.stack, self.load)

    @property
    def _wall(self) -> OuterPlate:
        assert self.load is not None
        assert self.load.wall is not None
        return self.load.wall

    @property
    def _stiffness(self) -> float:
        assert self.load is not None
        return self.load.stiffness

    @property
    def _points(self) -> int:
        return len(self._wall.local)

    def reached(self, places: Array) -> Reached:
        """Return the states whose tips stand at ``places`` (n, 3) in mm."""
        count, has_plate = len(places), self.load is not None and self.load.wall is not None
        found = Reached(
            np.zeros((len(self.stack.levels), 3, count)),
            np.zeros((self.stack.chambers, count)),
            np.full((self.stack.chambers, count), np.nan),
            np.zeros(count),
        )
        guess = np.clip(reach.starts(self.stack, places, self.most), 0.0, self.most).T
        if has_plate:
            self._against_plate(places.T, guess, found)
            return found
        for begin in range(0, count, CHUNK):
            part = slice(begin, begin + CHUNK)
            some = Reached(*(each[..., part] for each in found))
            self._by_freedoms(places[part].T, guess[:, part], some)
        return found

    def _begun(self, places: Array, x: Array, points: int = 0) -> States:
        """Return states on the arcs to the places."""
        p = P0 * np.sinh(x)
        rises = np.stack([kind.rises(p.T) for kind in self.stack.maps])
        kinds = (rises @ self.stack.planes).transpose(0, 2, 1)
        freedoms = kinds if self.load is None else kinds[self.stack.levels]
        return States(places, x, freedoms, np.full((points, places.shape[1]), np.nan))

    def _weights(self, x: Array) -> Array:
        return self.levels.weights(P0 * np.sinh(x), 2)

    def _moved(self, states: States, step: ReachStep, share: Array) -> States:
        """Return the states after shares (n) of a step."""
        x = np.clip(states.x + share * step.ahead, 0.0, self.most)
        return states._replace(x=x, freedoms=states.freedoms + share * step.move)

    def _room(self, x: Array) -> tuple[Array, Array]:
        """Return the least and largest step of asinh(p / P0)."""
        longest = reach.LONGEST_STEP
        return np.maximum(-x, -longest), np.minimum(self.most - x, longest)

    # Freedoms and pressures together.

    def _by_freedoms(self, places: Array, guess: Array, found: Reached) -> None:
        live, states = np.arange(places.shape[1]), self._begun(places, guess)
        largest = np.full(len(live), math.inf)
        for number in range(reach.STEPS):
            now = self._now(states, largest < reach.CLOSE)
            step, missing, is_firm = self._free_step(states, now)
            share, largest = step_share(step.move), step.largest
            closed = self._closed(states.freedoms)
            if number >= reach.WHOLE_STEPS:
                tried = self._closed(states.freedoms + share * step.move)
                share = np.where((tried != closed).any(0), share / 2, share)
            states = self._moved(states, step, share)
            is_last = largest < reach.STILL
            small = (largest < reach.LAST_STEP) & (share == 1.0)
            if small.any():
                same = (self._closed(states.freedoms) == closed).all(0)
                is_last |= small & same
            met = is_last & is_firm & (np.linalg.norm(missing, axis=0) < reach.NEAR)
            if met.any():
                self._keep(states.at(met), live[met], found)
            rest = ~is_last & np.isfinite(largest)
            if rest.sum() <= FEW:
                break
            if not rest.all():
                live, states, largest = live[rest], states.at(rest), largest[rest]

    def _now(self, states: States, is_close: NDArray[np.bool_]) -> LevelsAt:
        """Return the rows of states, second derivatives exact only where ``is_close``."""
        return self.levels.at(self._weights(states.x), states.freedoms, is_close)

    def _free_step(
        self, states: States, now: LevelsAt
    ) -> tuple[ReachStep, Array, NDArray[np.bool_]]:
        """Return the steps to linearised equilibria, by how many mm their tips miss the places (3,
        n), and True (n) where the tangent stiffness is positive definite.
        """
        filling = now.filling.transpose(0, 2, 1, 3) * (P0 * np.cosh(states.x))
        right = np.concatenate([-now.gradient[:, :, None], filling], axis=2)
        moves, is_firm = now.solved(right)
        tips, motion = self._tip_motion(states.freedoms)
        by_each = (motion[:, :, :, None] * moves[:, :, None]).sum((0, 1))
        own, rates = by_each[:, 0], by_each[:, 1:]
        missing = states.places - tips - own
        damping = reach.LEAST_DAMPING * (rates * rates).sum((0, 1)) + 1e-12
        ahead = bounded_steps(rates, missing, damping, self._room(states.x))
        move = moves[:, :, 0] + (moves[:, :, 1:] * ahead).sum(2)
        return ReachStep(move, ahead, move[0, :0]), missing - (rates * ahead).sum(1), is_firm

    def _tip_motion(self, freedoms: Array) -> tuple[Array, Array]:
        """Return the tips (3, n) in mm, and their motion by the rows' freedoms (rows, 3, 3, n)."""
        each = freedoms if self.load is not None else freedoms[self.stack.levels]
        plates = chain_of(each, self.stack.pitch)
        turned = crossed(plates.turns, (plates.tip - plates.middles)[:, None])
        motion = np.concatenate([plates.rises[:, None], turned], axis=1)
        if self.load is None:
            kinds = range(len(self.stack.maps))
            motion = np.stack([motion[self.stack.levels == kind].sum(0) for kind in kinds])
        return plates.tip, motion

    def _closed(self, freedoms: Array) -> NDArray[np.bool_]:
        """Return which contacts of balloons and rims are closed: (rows x points, n)."""
        rows = [
            self.levels.springs[kind].meet @ one < 0
            for kind, one in zip(self.levels.kinds, freedoms, strict=True)
        ]
        return np.concatenate(rows)

    def _keep(self, states: States, which: NDArray[np.int_], found: Reached) -> None:
        """Note the states that are in equilibrium."""
        volumes = self.levels.at(self._weights(states.x), states.freedoms).volumes
        is_free = self.load is None
        freedoms = states.freedoms[self.stack.levels] if is_free else states.freedoms
        self._note(states, freedoms, volumes, np.zeros(len(which)), which, found)

    def _note(
        self,
        states: States,
        freedoms: Array,
        volumes: Array,
        pushes: Array,
        which: NDArray[np.int_],
        found: Reached,
    ) -> None:
        fits = self.levels.fits(self.stack.centres, states.freedoms)
        found.freedoms[..., which] = freedoms
        found.pressures[:, which] = P0 * np.sinh(states.x)
        found.volumes[:, which] = np.where(fits, volumes, np.nan)
        found.pushes[which] = pushes

    # Freedoms and pressures together, against an outer plate.

    def _against_plate(self, places: Array, guess: Array, found: Reached) -> None:
        """Note the states that are met.

        Runs of many places and attempts proceed together, each against its current plate; the first
        attempt that meets a place counts.
        """
        if places.shape[1] <= FEW:
            return
        begins = np.stack(reach.plate_starts(guess, self.most))
        table = AttemptTable.of(self._wall, self._stiffness, len(begins))
        count, none = places.shape[1], len(table.starts)
        best, group = np.full(count, none), np.zeros(count, dtype=int)
        is_open = np.zeros((count, none), dtype=bool)
        is_open[:, 0] = True
        queue, runs = [(place, 0) for place in range(count)], None
        while queue or (runs is not None and runs.place.size):
            room = TOGETHER - (0 if runs is None else runs.place.size)
            if queue and room > 0:
                place, attempt = np.array(queue[:room]).T
                del queue[:room]
                x = begins[table.starts[attempt], :, place].T
                more = PlateRuns.of(place, attempt, self._begun(places[:, place], x, self._points))
                runs = more if runs is None else runs.joined(more)
            assert runs is not None
            place, attempt = runs.place, runs.attempt
            ahead, met, over = self._advanced(runs, table, found, best)
            is_open[place[met | over], attempt[met | over]] = False
            stays = ~met & ~over & (attempt < best[place])
            for number in np.unique(place[over]).tolist():
                if best[number] == none and not is_open[number].any():
                    group[number] += 1
                    attempts = table.groups[group[number]]
                    is_open[number, list(attempts)] = True
                    queue = [(number, each) for each in attempts] + queue
            runs = ahead.at(np.flatnonzero(stays))

    def _advanced(
        self, runs: PlateRuns, table: AttemptTable, found: Reached, best: NDArray[np.int_]
    ) -> tuple[PlateRuns, NDArray[np.bool_], NDArray[np.bool_]]:
        """Return the runs a step ahead, and True (n) for those that have met their place, and for
        those that have failed; note the former where they are the ``best`` attempt (places).
        """
        states, is_hard = runs.states, runs.stage == table.last[runs.attempt]
        stiffness = table.stiffness[runs.stage, runs.attempt]
        now = self.levels.touching(
            self._weights(states.x), states.freedoms, stiffness, states.forces
        )
        step, is_firm = self._contact_step(states, now)
        settled = runs.is_close & (np.abs(now.residual).max((0, 1)) < reach.CONTACT_RESIDUAL)
        met = settled & self._is_met(states, now)
        self._note_touching(runs, now, is_firm, np.flatnonzero(met), found, best)
        share, before = step_share(step.move), runs.before
        is_back = (step.ahead * before).sum(0) < -reach.TURNED_BACK * (before * before).sum(0)
        share = np.where(is_back, share / 2, share)
        states = self._moved(states, step, share)
        states = states._replace(forces=now.contact.resists(now.contact.deep + share * step.deeper))
        steps, largest = runs.steps + 1, step.largest
        is_last = largest < np.where(is_hard, reach.CLOSE_CONTACT, reach.ROUGH_CONTACT)
        passes = ~is_hard & (is_last | (steps >= reach.SOFT_STEPS))
        over = settled | ~np.isfinite(largest) | (is_hard & (runs.steps >= reach.PLATE_STEPS))
        ahead = runs._replace(
            stage=runs.stage + passes,
            steps=np.where(passes, 0, steps),
            before=np.where(passes, 0.0, step.ahead),
            is_close=is_hard & is_last,
            states=states,
        )
        return ahead, met, over & ~met

    def _is_met(self, states: States, now: TouchingAt) -> NDArray[np.bool_]:
        """Return True (n) for states at their places, with no balloon higher than its map."""
        missing = states.places - now.tips
        met = np.linalg.norm(reach.movable(self._wall, missing), axis=0) < reach.MET / 2
        met &= np.linalg.norm(missing, axis=0) < reach.MET
        return np.asarray(met & self.levels.fits(self.stack.centres, states.freedoms))

    def _note_touching(
        self,
        runs: PlateRuns,
        now: TouchingAt,
        is_firm: NDArray[np.bool_],
        which: NDArray[np.int_],
        found: Reached,
        best: NDArray[np.int_],
    ) -> None:
        # The last entry of each place remains: the earliest attempt.
        which = which[np.argsort(-runs.attempt[which])]
        which = which[runs.attempt[which] < best[runs.place[which]]]
        place = runs.place[which]
        best[place] = runs.attempt[which]
        found.freedoms[..., place] = runs.states.freedoms[..., which]
        found.pressures[:, place] = P0 * np.sinh(runs.states.x[:, which])
        # Unstable equilibria are left to ``reach``.
        found.volumes[:, place] = np.where(is_firm[which], now.volumes[:, which], np.nan)
        found.pushes[place] = now.forces[:WALL_POINTS, which].sum(0)

    def _contact_step(self, states: States, now: TouchingAt) -> tuple[ReachStep, NDArray[np.bool_]]:
        """Return the steps to the linearised equilibria with the contacts at their ends, and True
        (n) where the tangent stiffness is positive definite.
        """
        filling = now.filling.transpose(0, 2, 1, 3) * (P0 * np.cosh(states.x))
        right = np.concatenate([-now.residual[:, :, None], filling], axis=2)
        solutions, k = now.condensed(right), right.shape[2]
        count = right.shape[3]
        pulls, touches = np.zeros((6, k, count)), now.contact.touches
        ahead, whole = self._ahead(states, now.tips, solutions.sums[:, :k])
        deeper = (now.contact.lines * whole).sum(1)
        after = now.contact.deep + deeper > now.contact.least
        live = np.flatnonzero((after != touches).any(0))
        for number in range(1, reach.CONTACT_ROUNDS):
            if not live.size:
                break
            before = touches[:, live]
            touches[:, live] = after[:, live]
            contact = now.contact.at(live)
            held = contact.held(touches[:, live], now.forces[:, live])
            sums, pulls[..., live] = solutions.at(live).with_contacts(*held)
            ahead[:, live], whole = self._ahead(states.at(live), now.tips[:, live], sums)
            deeper[:, live] = (contact.lines * whole).sum(1)
            after[:, live] = contact.deep + deeper[:, live] > contact.least
            goes_on = (after[:, live] != touches[:, live]).any(0)
            if reach.is_turn(number):
                goes_on &= (after[:, live] != before).any(0)
            live = live[goes_on]
        pull = pulls[:, 0] + (pulls[:, 1:] * ahead).sum(1)
        columns = np.concatenate([np.ones((1, count)), ahead, pull])
        move = np.einsum("lfkn,kn->lfn", solutions.moves, columns)
        return ReachStep(move, ahead, deeper), solutions.is_firm

    def _ahead(self, states: States, tips: Array, sums: Array) -> tuple[Array, Array]:
        """Return the steps of asinh(p / P0) (chambers, n) from the top's turns and moves (6, k, n)
        to equilibrium and by each pressure, and the resulting steps of the top (6, n).
        """
        motion = sums[3:] + crossed(sums[:3].transpose(1, 0, 2), tips).transpose(1, 0, 2)
        rates, away = motion[:, 1:], states.places - tips
        missing = reach.movable(self._wall, away - motion[:, 0])
        missing = np.where(np.linalg.norm(missing, axis=0) < reach.NEAR / 2, 0.0, missing)
        damping = reach.plate_damping(away) * (rates * rates).sum((0, 1)) + 1e-12
        ahead = bounded_steps(rates, missing, damping, self._room(states.x))
        return ahead, sums[:, 0] + (sums[:, 1:] * ahead).sum(1)


def bounded_steps(rates: Array, missing: Array, damping: Array, room: tuple[Array, Array]) -> Array:
    """Return the steps (chambers, n) for rates (3, chambers, n) and missing distances (3, n), as in
    ``reach.bounded_step``.
    """
    chambers = rates.shape[1]
    matrix = (rates[:, :, None] * rates[:, None]).sum(0)
    each = np.arange(chambers)
    matrix[each, each] += damping
    gradient = (rates * missing[:, None]).sum(0)
    step = _each_solved(matrix, gradient)
    inside = np.minimum(np.maximum(step, room[0]), room[1])
    is_free = inside == step
    live = np.flatnonzero(~is_free.all(0))
    step = inside
    for _ in range(chambers):
        if not live.size:
            break
        free, held = is_free[:, live], np.where(is_free[:, live], 0.0, step[:, live])
        some = matrix[..., live]
        right = np.where(free, gradient[:, live] - (some * held).sum(1), held)
        reduced = some * (free[:, None] & free[None])
        reduced[each, each] = np.where(free, reduced[each, each], 1.0)
        tried = _each_solved(reduced, right)
        within = np.minimum(np.maximum(tried, room[0][:, live]), room[1][:, live])
        still = free & (within == tried)
        step[:, live] = within
        is_free[:, live] = still
        live = live[((still != free) & free).any(0) & still.any(0)]
    return step


def _each_solved(matrices: Array, right: Array) -> Array:
    """Return the solutions (size, n) of matrices (size, size, n) by right sides (size, n)."""
    found = np.linalg.solve(matrices.transpose(2, 0, 1), right.T[..., None])
    return np.asarray(found[..., 0].T)
