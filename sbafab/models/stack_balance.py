"""Equilibrium of a stack by Newton's method: levels alone and all together under a load, of many
states at once, and against an outer plate, of one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.models.film_elements import Array
from sbafab.models.stack_loads import (
    Load,
    LoadedEnergy,
    OuterPlate,
    PlateContact,
    Springs,
    loaded_energy,
    with_diagonal_blocks,
)

LARGEST_MOVE = np.array([0.4, 0.15, 0.15])
LEAST_LIMIT = float(LARGEST_MOVE.min())
"""Largest rise (mm) and tilts (rad) in one step, and the least of these."""
SMALLEST_STEP = 1e-6
"""Step (mm, rad) below which an equilibrium counts as converged."""
SOFT_PLATES = ((1e3, 1e5), (1e3, 1e4, 1e5), (1e4, 1e5))
"""Stiffness in mN/mm of an outer plate in the first solutions, for paths tried in turn."""
MOST_STEPS, HALVINGS = 300, 14
RESIDUAL = 1e-7
"""Tolerance of the residual, mN or mN mm."""
SMALLEST_SUM_STEP = 5e-8
"""Smallest step where the errors of all levels add up: tilts under a load, volumes without."""
PLATE_LAST_STEP, PLATE_LAST_GAIN = 3e-5, 1e-7
"""Largest last step (mm, rad) against an outer plate, and its energy (uJ): the plate's force is to
converge as well.
"""
ROUGH_STEP = 0.01
"""Last step (mm, rad) against a soft plate."""
RIM_ROUNDS = 2
"""Times that a step is limited by rims that it would meet."""
CORRECTIONS, SMALL_CORRECTION = 16, 0.8
"""Corrections of a step by the springs at its end, and the share of it that is small: the next step
makes up for the rest.
"""
STRAIGHT = 6e-3
"""Step (mm, rad) along which springs are linear enough."""
REUSED_STEP, REUSED_PRODUCT, SPRING_CHANGE = 2e-3, 1e-9, 0.2
"""Step whose tangent stiffness the next may use again, the product of both steps at which that one
is the last, and the relative change of springs in between.
"""
FEW_STEPS = 12
"""Steps within which a far start must meet an outer plate."""
PLATE_STEPS = 12
"""Steps against an outer plate before another method is tried."""
PLATE_SMALLEST_STEP = 1e-7
"""Step (mm, rad) against an outer plate below which an equilibrium counts as converged."""
PLATE_RESIDUAL = 1e-4
"""Tolerance of the residual, mN or mN mm, and as a share of the plate's force."""
FIRST_STEP = 1e-3
"""Assumed step (mm, rad) before the first one."""
PLATE_CORRECTIONS, PLATE_SMALL_CORRECTION = 24, 0.2
"""Corrections of a step by springs and contacts at its end, and the share of it that is small."""
CONTACT_ROUNDS, CONTACT_RIM_ROUNDS = 8, 2
"""Rounds of the active set of contacts, and those with further rims in contact."""
STEP_SHARES = 0.5 ** np.arange(12)
"""Shares of a step to an active set other than its own."""
PUSH_RATIO = 2.0
"""Largest initial force on a plate over the largest push of a level."""


class Balance(NamedTuple):
    """Equilibria of n states: ``freedoms`` (n, rows, 3), ``pushes`` (n) in mN on an outer plate,
    and which are stable and which have been found (n).
    """

    freedoms: Array
    pushes: Array
    is_stable: NDArray[np.bool_]
    is_found: NDArray[np.bool_]

    @classmethod
    def none(cls, start: Array) -> Balance:
        """Return as many that are not found."""
        count = len(start)
        false = np.zeros(count, dtype=bool)
        return cls(start.copy(), np.zeros(count), false, false.copy())

    @classmethod
    def stable(cls, freedoms: Array, pushes: Array | None = None) -> Balance:
        """Return stable equilibria."""
        true = np.ones(len(freedoms), dtype=bool)
        return cls(
            freedoms, np.zeros(len(freedoms)) if pushes is None else pushes, true, true.copy()
        )

    def keep(self, which: Any, freedoms: Array, pushes: Any, is_stable: Any) -> None:
        """Note states that are found."""
        self.freedoms[which], self.pushes[which] = freedoms, pushes
        self.is_stable[which], self.is_found[which] = is_stable, True


def put(record: Any, which: Any, other: Any) -> None:
    """Replace some of the states of a record of arrays by another's."""
    for mine, its in zip(record, other, strict=True):
        if isinstance(mine, np.ndarray):
            mine[which] = its
        elif mine is not None:
            put(mine, which, its)


def free_equilibrium(springs: Springs, start: Array) -> Balance:
    """Return the equilibria without external load of n states, (n, rows, 3), whose rows do not act
    on each other: the energy of a level alone is convex.
    """
    found, live, at = Balance.none(start), np.arange(len(start)), start
    before = np.full(len(start), SMALLEST_STEP)
    now = springs.energy(at)
    for _ in range(MOST_STEPS):
        value, gradient, matrix = now
        move = newton_step(gradient, matrix)
        largest = np.abs(move).max((1, 2))
        is_over = is_last_step(largest, before, SMALLEST_SUM_STEP)
        is_over |= np.abs(gradient).max((1, 2)) < RESIDUAL
        if is_over.any():
            found.keep(live[is_over], (at + move)[is_over], 0.0, True)
            if is_over.all():
                break
            rest = ~is_over
            live, at, move, largest = live[rest], at[rest], move[rest], largest[rest]
            value, springs = value[rest], springs.at(rest)
        share = step_limit(move, largest)
        now = springs.energy(at + share[..., None] * move)
        for _ in range(HALVINGS):
            is_far = _rises(now[0], value)
            if not is_far.any():
                break
            share = np.where(is_far, share / 2, share)
            far = np.flatnonzero(is_far.any(1))
            put(now, far, springs.at(far).energy((at + share[..., None] * move)[far]))
        before = largest * (share == 1).all(1)
        at = at + share[..., None] * move
    return found


def _rises(after: Array, before: Array) -> NDArray[np.bool_]:
    """Return which energies rise by more than rounding."""
    return np.asarray(~(after <= before + 1e-11 * (1 + np.abs(before))))


def loaded_equilibrium(
    springs: Springs, pitch: float, load: Load, start: Array, is_near: bool
) -> Balance:
    """Return the equilibria under a load of n states, (n, levels, 3); of one state against an outer
    plate.

    An outer plate that is not met soon is stiffened gradually, since steps without contact would
    run far into it; ``is_near`` marks a start that may be in contact.
    """
    wall = load.wall
    if wall is not None:
        return _plate_equilibrium(springs.at(0), pitch, load, wall, start[0], is_near)
    fine = SMALLEST_STEP if is_near else SMALLEST_SUM_STEP
    found = _energy_descent(springs, pitch, load, start, FEW_STEPS, quick=fine)
    rest = np.flatnonzero(~found.is_found)
    if rest.size:
        put(found, rest, _energy_descent(springs.at(rest), pitch, load, start[rest], MOST_STEPS))
    return found


def _plate_equilibrium(
    springs: Springs, pitch: float, load: Load, wall: OuterPlate, start: Array, is_near: bool
) -> Balance:
    """Return the equilibrium of one state against an outer plate, from freedoms (levels, 3)."""
    at = start if is_near else start_below(springs, start, pitch, wall, load.stiffness)
    balance = _contact_descent(springs, pitch, load, wall, at)
    if balance is None:
        most = MOST_STEPS if is_near else FEW_STEPS
        balance = _one_descent(springs, pitch, load, at, most)
    return balance or _by_softer_plates(springs, pitch, load, wall, at) or Balance.none(at[None])


def _one_descent(
    springs: Springs, pitch: float, load: Load, start: Array, most: int, enough: float = 0.0
) -> Balance | None:
    """Return the ``_energy_descent`` of one state from freedoms (levels, 3), None if it fails."""
    found = _energy_descent(springs.at(None), pitch, load, start[None], most, enough)
    return found if found.is_found[0] else None


def _by_softer_plates(
    springs: Springs, pitch: float, load: Load, wall: OuterPlate, start: Array
) -> Balance | None:
    """Return the loaded equilibrium against a plate by continuation in plate stiffness; None if it
    fails.
    """
    for way in SOFT_PLATES:
        at = start
        for stiffness in way:
            softer = load._replace(stiffness=stiffness)
            soft = _one_descent(springs, pitch, softer, at, MOST_STEPS, ROUGH_STEP)
            if soft is None:
                break
            at = soft.freedoms[0]
        else:
            balance = _contact_descent(springs, pitch, load, wall, at)
            balance = balance or _one_descent(springs, pitch, load, at, MOST_STEPS)
            if balance is not None:
                return balance
    return None


def _energy_descent(
    springs: Springs,
    pitch: float,
    load: Load,
    start: Array,
    most: int,
    enough: float = 0.0,
    quick: float = 0.0,
) -> Balance:
    """Return the loaded equilibria of n states that at most ``most`` steps reach.

    A step no larger than ``enough`` ends it. ``quick`` makes fewer and larger steps, until the
    error is below it.
    """
    found, live, at = Balance.none(start), np.arange(len(start)), start
    before, now = np.full(len(at), quick or SMALLEST_STEP), loaded_energy(springs, pitch, load, at)
    last: tuple[Array, Array] | None = None
    for _ in range(most):
        if quick and last is not None and 0 < before.min() <= before.max() < REUSED_STEP:
            flat, is_last = _last_step(now, *last, before)
            if is_last:
                found.keep(live, at + flat.reshape(at.shape), 0.0, True)
                break
        rest = now.rest()
        matrix = with_diagonal_blocks(rest, now.blocks)
        flat = newton_step(now.gradient, matrix, None if quick else is_positive_definite(matrix))
        flat = _rim_limited(springs, at, flat, now.gradient, rest, now.blocks)
        largest = np.abs(flat).max(-1)
        if quick and largest.max() > STRAIGHT:
            flat = _refined(springs, at, flat, now, rest)
            largest = np.abs(flat).max(-1)
        move, value, last = flat.reshape(at.shape), now.value, (matrix, now.blocks)
        is_last = is_last_step(largest, before, quick or SMALLEST_STEP)
        if load.wall is not None:
            gain = -(flat * now.gradient).sum(-1)
            is_last &= (largest < PLATE_LAST_STEP) & (gain < PLATE_LAST_GAIN)
        is_still = np.zeros_like(is_last) if quick else _is_still(now, flat)
        is_over = is_last | is_still | (largest <= enough)
        if is_over.any():
            is_stable = is_over.copy()
            is_stable[is_over] = is_positive_definite(matrix[is_over])
            is_over &= is_still | is_stable
            end, pushes = at + np.where(is_stable[:, None, None], move, 0.0), now.push
            if load.wall is not None:
                pushes = loaded_energy(springs, pitch, load, end).push
            found.keep(live[is_over], end[is_over], pushes[is_over], is_stable[is_over])
            if is_over.all():
                break
            if is_over.any():
                goes = ~is_over
                live, at, move, largest, value = (
                    part[goes] for part in (live, at, move, largest, value)
                )
                springs, last = springs.at(goes), (last[0][goes], last[1][goes])
        now, share = _searched(springs, pitch, load, at, move, largest, value)
        before = largest * (share == 1)
        at = at + share[:, None, None] * move
    return found


def _is_still(now: LoadedEnergy, flat: Array) -> NDArray[np.bool_]:
    """Return which states (n) a step (n, freedoms) hardly changes."""
    is_still = np.abs(now.gradient).max(-1) < RESIDUAL * (1 + 1e-3 * now.push)
    slope = (flat * now.gradient).sum(-1)
    return np.asarray(is_still | (slope > -1e-12 * (1 + np.abs(now.value))))


def _last_step(
    now: LoadedEnergy, matrix: Array, blocks: Array, before: Array
) -> tuple[Array, bool]:
    """Return the steps (n, freedoms) by the tangent stiffness and springs' ``blocks`` of the last
    ones, of size ``before`` (n), and True if that is good enough: not where rims meet or part.
    """
    flat = np.asarray(-np.linalg.solve(matrix, now.gradient[..., None])[..., 0])
    is_small = (np.abs(flat).max(-1) * before).max() < REUSED_PRODUCT
    change = np.abs(now.blocks - blocks).max((1, 2, 3)) - SPRING_CHANGE * np.abs(blocks).max(
        (1, 2, 3)
    )
    return flat, bool(is_small and change.max() < 0 and is_positive_definite(matrix).all())


def _searched(
    springs: Springs, pitch: float, load: Load, at: Array, move: Array, largest: Array, value: Array
) -> tuple[LoadedEnergy, Array]:
    """Return the energy at the end of a share of each step (n, levels, 3) that does not raise it
    above ``value`` (n), and this share (n).
    """
    share = step_limit(move, largest).min(-1)
    now = loaded_energy(springs, pitch, load, at + share[:, None, None] * move)
    for _ in range(HALVINGS):
        is_far = _rises(now.value, value)
        if not is_far.any():
            break
        share, (far,) = np.where(is_far, share / 2, share), is_far.nonzero()
        ahead = (at + share[:, None, None] * move)[far]
        again = loaded_energy(springs.at(far), pitch, load, ahead)
        if len(far) == len(share):
            now = again
        else:
            put(now, far, again)
    return now, share


def _rim_limited(
    springs: Springs, at: Array, flat: Array, gradient: Array, rest: Array, blocks: Array
) -> Array:
    """Return the steps (n, freedoms) to where rims just touch that they would drive into each
    other.

    A step without their contact would run far past them (a primal-dual active set).
    """
    for _ in range(RIM_ROUNDS):
        met = springs.meeting(at, flat.reshape(at.shape))
        if met is None:
            break
        push, stiffer = met
        some = np.flatnonzero(stiffer.any((1, 2, 3)))
        matrix = with_diagonal_blocks(rest[some], (blocks + stiffer)[some])
        gradients = gradient[some]
        pushes = gradients + push[some].reshape(gradients.shape)
        tried = newton_step(pushes, matrix, is_positive_definite(matrix))
        goes = (tried * gradients).sum(-1) < 0  # others would lead uphill
        if not goes.any():
            break
        flat = flat.copy()
        flat[some[goes]] = tried[goes]
    return flat


def _refined(springs: Springs, at: Array, flat: Array, now: LoadedEnergy, rest: Array) -> Array:
    """Return the steps (n, freedoms), of the long ones those at whose end springs are in
    equilibrium, with all else linear.

    Films, and rims that meet on the way, are most of the nonlinearity.
    """
    live = np.flatnonzero(np.abs(flat).max(-1) > STRAIGHT)
    found, outside = flat.copy(), now.gradient - now.spring_gradient.reshape(flat.shape)
    if len(live) < len(flat):
        at, rest, outside, springs = at[live], rest[live], outside[live], springs.at(live)
        flat = flat[live]
    best, least = flat, np.full(len(live), math.inf)
    for _ in range(CORRECTIONS):
        value, spring_gradient, blocks = springs.energy(at + flat.reshape(at.shape))
        follows = outside + (rest @ flat[..., None])[..., 0]
        total = value.sum(-1) + ((outside + follows) * flat).sum(-1) / 2
        is_worse, halfway = total > least, (best + flat) / 2
        if is_worse.any():
            flat = np.where(is_worse[:, None], best, flat)
        best, least = flat, np.minimum(total, least)
        gradient = follows + spring_gradient.reshape(flat.shape)
        matrix = with_diagonal_blocks(rest, blocks)
        more = np.asarray(-np.linalg.solve(matrix, gradient[..., None])[..., 0])
        more = _rim_limited(springs, at + best.reshape(at.shape), more, gradient, rest, blocks)
        flat = best + more
        is_over = np.abs(more).max(-1) < SMALL_CORRECTION * np.abs(best).max(-1)
        if is_worse.any():
            flat, is_over = np.where(is_worse[:, None], halfway, flat), is_over & ~is_worse
        if is_over.any():
            found[live[is_over]] = flat[is_over]
            if is_over.all():
                return found
            goes = ~is_over
            live, at, flat, best, least = live[goes], at[goes], flat[goes], best[goes], least[goes]
            outside, rest, springs = outside[goes], rest[goes], springs.at(goes)
    found[live] = best
    return found


# Against an outer plate, with its contact forces as unknowns beside the freedoms.


def start_below(
    springs: Springs, start: Array, pitch: float, wall: OuterPlate, stiffness: float
) -> Array:
    """Return a start a little past a level plate, so that it is met all round."""
    at = start.copy()
    if wall.is_level:
        room = max(wall.point[2] / len(at) - pitch, 0.0)
        is_high = at[:, 0] > room
        straight = wall.sticks | (np.abs(at[:, 1:]) < 1e-9)
        at[:, 1:] = np.where(straight, 0.0, at[:, 1:])
        at[:, 0] = np.where(is_high, room, at[:, 0])
        past = 1e-4
        if wall.sticks and is_high.all():
            # As far as the plate gives way to them.
            push = float(-springs.energy(at)[1][:, 0].mean())
            past = max(push, 0.0) / stiffness / len(at) + 1e-9
        at[:, 0] += np.where(is_high, past, 0.0)
    return at


def _contact_descent(
    springs: Springs, pitch: float, load: Load, wall: OuterPlate, start: Array
) -> Balance | None:
    """Return the equilibrium of one state from freedoms (levels, 3); None if the steps pass an
    unstable place, or are too many.

    A mixed method: a plate is stiff, so the contact forces are unknowns beside the freedoms, found
    with each step and handed to the next. The set of points in contact is found within a step, with
    the springs at its end.
    """
    at, before = start, FIRST_STEP
    now = loaded_energy(springs, pitch, load, at)
    touch = now.touch
    if touch is not None and touch.push > PUSH_RATIO * np.abs(now.spring_gradient[:, 0]).max():
        # Too deep to estimate the force, or for the first step to show stability.
        before = 0.0
        now = loaded_energy(springs, pitch, load, at, np.zeros(len(touch.deep)))
    for _ in range(PLATE_STEPS):
        touch = now.touch
        assert touch is not None
        step = _contact_step(springs, at, now, touch)
        if step is None:
            return None
        flat, touch, is_found = step
        move = flat.reshape(-1, 3)
        largest = float(np.abs(move).max())
        if is_last_step(largest, before, PLATE_SMALLEST_STEP):
            if is_found:
                return Balance.stable((at + move)[None], touch.push[None])
            # A rim or a point that just touches is met in one round and parts in the next.
            end = loaded_energy(springs, pitch, load, at + move)
            if np.abs(end.gradient).max() < PLATE_RESIDUAL * (1 + end.push):
                return Balance.stable((at + move)[None], end.push[None])
        share = float(step_limit(move).min())
        if share < 1.0 and not wall.sticks:
            return None
        before = largest if share == 1.0 else 0.0
        at = at + share * move
        now = loaded_energy(springs, pitch, load, at, touch.forces)
    return None


def _contact_step(
    springs: Springs, at: Array, now: LoadedEnergy, touch: PlateContact
) -> tuple[Array, PlateContact, bool] | None:
    """Return the step (freedoms) to equilibrium, linear except for springs and contacts, the
    contact there, and True for converged; None if the tangent stiffness is indefinite.
    """
    lines, turned = now.deeper(touch), now.turned()
    outside = now.gradient - now.spring_gradient.ravel() - touch.forces @ lines
    spring_gradient, blocks = now.spring_gradient, now.blocks
    flat = best = np.zeros(now.gradient.size)
    has_converged = False
    deep, least = touch.deep, np.inf
    for number in range(PLATE_CORRECTIONS):
        follows = outside + turned @ flat
        if number:
            value, spring_gradient, blocks = springs.energy(at + flat.reshape(-1, 3))
            deep = touch.deep + lines @ flat
            total = float(value.sum() + (outside + follows) @ flat / 2)
            total += float(touch.resists(deep) @ deep) / 2
            if total > least:
                flat = (best + flat) / 2
                continue
            best, least = flat, total
        matrix, gradient = with_diagonal_blocks(turned, blocks), follows + spring_gradient.ravel()
        correction = _active_set_step(
            springs, at + flat.reshape(-1, 3), matrix, gradient, touch, lines, deep
        )
        if correction is None:
            return None
        more, is_settled = correction
        flat = best + more
        little = PLATE_SMALL_CORRECTION * np.abs(best).max() if number else STRAIGHT
        has_converged = is_settled and float(np.abs(more).max()) < little
        if has_converged:
            break
    deep = touch.deep + lines @ flat
    return flat, touch._replace(deep=deep, forces=touch.resists(deep)), has_converged


def _active_set_step(
    springs: Springs,
    at: Array,
    matrix: Array,
    gradient: Array,
    touch: PlateContact,
    lines: Array,
    deep: Array,
) -> tuple[Array, bool] | None:
    """Return the step at whose end the points and rims in contact are in equilibrium, and True if
    these are the contacts that it was made with.
    """

    def energy(trial: Array) -> float:
        after = deep + lines @ trial
        return float((gradient + matrix @ trial / 2) @ trial + touch.resists(after) @ after / 2)

    touches, met, held_off = deep > touch.least, None, 0
    tried = []
    for _ in range(CONTACT_ROUNDS):
        stiff = touch.stiff * touches
        against = (lines.T * stiff) @ lines
        pushes = gradient + (stiff * deep) @ lines
        if met is not None:
            against = with_diagonal_blocks(against, met[1])
            pushes = pushes + met[0].ravel()
        if not is_positive_definite(matrix + against):
            return None
        step = np.asarray(-np.linalg.solve(matrix + against, pushes))
        ahead = deep + lines @ step > touch.least
        if (ahead == touches).all():
            met = springs.meeting(at, step.reshape(-1, 3))
            if met is None or held_off == CONTACT_RIM_ROUNDS:
                return step, met is None
            held_off += 1
        touches = ahead
        tried.append(step)
    # Otherwise take the best place on the paths there; the first one leads downhill.
    return min((share * trial for trial in tried for share in STEP_SHARES), key=energy), False


# Safeguarded Newton steps.


def is_last_step(largest: Any, before: Any, fine: float = SMALLEST_STEP) -> Any:
    """Return True if the step after this one would be below ``fine``, by quadratic convergence from
    ``before``, the largest move of the full step before it.
    """
    return largest * largest < fine * before


def newton_step(gradient: Array, matrix: Array, is_firm: NDArray[np.bool_] | None = None) -> Array:
    """Return Newton's step of each row (..., size), a descent direction even where the tangent
    stiffness (..., size, size) is not positive definite, ``is_firm``; without it, where the plain
    step leads uphill.
    """
    step = np.asarray(-np.linalg.solve(matrix, gradient[..., None])[..., 0])
    uphill = (step * gradient).sum(-1) >= 0 if is_firm is None else ~is_firm
    if uphill.any():
        values, vectors = np.linalg.eigh(matrix[uphill])
        least = 1e-6 * np.abs(values).max(-1, keepdims=True) + 1e-9
        values = np.maximum(np.abs(values), least)
        within = (vectors.swapaxes(-1, -2) @ gradient[uphill][..., None])[..., 0]
        step[uphill] = -(vectors @ (within / values)[..., None])[..., 0]
    return step


def step_limit(move: Array, largest: Array | None = None) -> Array:
    """Return the share of each row's step (..., 3) that stays within ``LARGEST_MOVE``; ``largest``
    are the largest components of the steps, if they are known.
    """
    if largest is not None and largest.max() <= LEAST_LIMIT:
        return np.ones(move.shape[:-1])
    return np.asarray(np.minimum(1.0, (LARGEST_MOVE / np.maximum(np.abs(move), 1e-12)).min(-1)))


def is_positive_definite(matrix: Array) -> NDArray[np.bool_]:
    """Return which matrices (..., size, size) are positive definite: (...)."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        if matrix.ndim == 2:
            return np.zeros((), dtype=bool)
        return np.array([is_positive_definite(each) for each in matrix])
    return np.ones(matrix.shape[:-2], dtype=bool)
