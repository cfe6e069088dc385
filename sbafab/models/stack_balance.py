"""Equilibrium of a stack by Newton's method: levels alone, all together under a load, and against
an outer plate.
"""

from __future__ import annotations

import math

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.film_elements import Array
from sbafab.models.least_energy import (
    LARGEST_MOVE,
    SMALLEST_STEP,
    is_last_step,
    is_positive_definite,
    newton_step,
    step_limit,
)
from sbafab.models.stack_loads import (
    Load,
    LoadedEnergy,
    OuterPlate,
    PlateContact,
    Springs,
    loaded_energy,
    with_diagonal_blocks,
)

SOFT_PLATES = ((1e3, 1e5), (1e3, 1e4, 1e5), (1e4, 1e5))
"""Stiffness in mN/mm of an outer plate in the first solutions, for paths tried in turn."""
MOST_STEPS = 300
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


def free_equilibrium(springs: Springs, start: Array) -> Array:
    """Return rise and tilt of each row without external load: (rows, 3). Raises DesignError."""
    at, before = start, SMALLEST_STEP
    value, gradient, matrix = springs.energy(at)
    for _ in range(MOST_STEPS):
        if np.abs(gradient).max() < RESIDUAL:
            return at
        move, is_firm = newton_step(gradient, matrix)
        largest = float(np.abs(move).max())
        if is_firm and is_last_step(largest, before, SMALLEST_SUM_STEP):
            return at + move
        share = step_limit(move)
        slope = (move * gradient).sum(-1)
        for _ in range(12):
            step = share[:, None] * move
            tried = springs.energy(at + step)
            good = tried[0] <= value + 1e-4 * share * slope + 1e-11 * (1 + np.abs(value))
            if good.all():
                break
            share = np.where(good, share, share / 2)
        before = largest if (share == 1.0).all() else 0.0
        at = at + step
        value, gradient, matrix = tried
    raise DesignError("no equilibrium of the stack found at these pressures; try others")


def loaded_equilibrium(
    springs: Springs, pitch: float, load: Load, start: Array, is_near: bool
) -> tuple[Array, float, bool]:
    """Return rise and tilt of each level (levels, 3) under a load, the force in mN on the plate,
    and True for a stable equilibrium.

    An outer plate that is not met soon is stiffened gradually, since steps without contact would
    run far into it; ``is_near`` marks a start that may be in contact. Raises DesignError if no
    equilibrium is found.
    """
    wall = load.wall
    if wall is None:
        fine = SMALLEST_STEP if is_near else SMALLEST_SUM_STEP
        balance = _energy_descent(springs, pitch, load, start, FEW_STEPS, quick=fine)
        if balance is None:
            balance = _energy_descent(springs, pitch, load, start, MOST_STEPS)
    else:
        at = start if is_near else start_below(springs, start, pitch, wall, load.stiffness)
        balance = _contact_descent(springs, pitch, load, wall, at)
        if balance is None:
            balance = _energy_descent(
                springs, pitch, load, at, MOST_STEPS if is_near else FEW_STEPS
            )
        if balance is None:
            balance = _by_softer_plates(springs, pitch, load, wall, at)
    if balance is None:
        raise DesignError("no equilibrium of the stack found under this load; try a smaller one")
    return balance


def _by_softer_plates(
    springs: Springs, pitch: float, load: Load, wall: OuterPlate, start: Array
) -> tuple[Array, float, bool] | None:
    """Return the loaded equilibrium against a plate by continuation in plate stiffness; None if it
    fails.
    """
    for way in SOFT_PLATES:
        at = _below_soft_plates(springs, pitch, load, start, way)
        if at is not None:
            balance = _contact_descent(springs, pitch, load, wall, at)
            balance = balance or _energy_descent(springs, pitch, load, at, MOST_STEPS)
            if balance is not None:
                return balance
    return None


def _below_soft_plates(
    springs: Springs, pitch: float, load: Load, start: Array, way: tuple[float, ...]
) -> Array | None:
    """Return freedoms near equilibrium against the last of increasingly stiff plates; None if one
    has no equilibrium.
    """
    at = start
    for stiffness in way:
        softer = load._replace(stiffness=stiffness)
        soft = _energy_descent(springs, pitch, softer, at, MOST_STEPS, ROUGH_STEP)
        if soft is None:
            return None
        at, _, _ = soft
    return at


def _energy_descent(
    springs: Springs,
    pitch: float,
    load: Load,
    start: Array,
    most: int,
    enough: float = 0.0,
    quick: float = 0.0,
) -> tuple[Array, float, bool] | None:
    """Return the loaded equilibrium, or None if ``most`` steps do not reach it.

    A step no larger than ``enough`` ends it. ``quick`` makes fewer and larger steps, until the
    error is below it.
    """
    fine = quick or SMALLEST_STEP
    at, before, last = start, fine, None
    now = loaded_energy(springs, pitch, load, at)
    for _ in range(most):
        if np.abs(now.gradient).max() < RESIDUAL * (1 + 1e-3 * now.push):
            return at, now.push, is_positive_definite(with_diagonal_blocks(now.rest(), now.blocks))
        if last is not None:
            # The matrix of such a small step is good enough for the last one.
            matrix, blocks = last
            flat = -np.linalg.solve(matrix, now.gradient)
            if np.abs(flat).max() * before < REUSED_PRODUCT and _are_close(blocks, now.blocks):
                return at + flat.reshape(-1, 3), now.push, True
        rest = now.rest()
        matrix = with_diagonal_blocks(rest, now.blocks)
        flat, is_firm = (_plain_step if quick else _safeguarded_step)(now.gradient, matrix)
        flat = _rim_limited(springs, at, flat, now.gradient, rest, now.blocks)
        if quick and np.abs(flat).max() > STRAIGHT:
            flat = _refined(springs, at, flat, now, rest)
        move = flat.reshape(-1, 3)
        largest = float(np.abs(move).max())
        slope = float(flat @ now.gradient)
        fits = load.wall is None or (largest < PLATE_LAST_STEP and slope > -PLATE_LAST_GAIN)
        is_last = largest <= enough or (fits and is_last_step(largest, before, fine))
        if is_last and (is_positive_definite(matrix) if is_firm is None else is_firm):
            at = at + move
            if load.wall is None:
                return at, 0.0, True
            return at, loaded_energy(springs, pitch, load, at).push, True
        share = float(step_limit(move).min()) if largest > LARGEST_MOVE.min() else 1.0
        for _ in range(14):
            tried = loaded_energy(springs, pitch, load, at + share * move)
            if tried.value <= now.value + 1e-4 * share * slope + 1e-11 * (1 + abs(now.value)):
                break
            share /= 2
        before = largest if share == 1.0 else 0.0
        may_last = load.wall is None and 0 < before < REUSED_STEP and is_positive_definite(matrix)
        last = (matrix, now.blocks) if may_last else None
        at = at + share * move
        now = tried
        if abs(slope) < 1e-11 * (1 + abs(now.value)):
            return at, now.push, is_positive_definite(with_diagonal_blocks(now.rest(), now.blocks))
    return None


def _safeguarded_step(gradient: Array, matrix: Array) -> tuple[Array, bool]:
    """Return Newton's step of all levels, and True for a positive definite tangent stiffness."""
    step, is_firm = newton_step(gradient[None], matrix[None])
    return step[0], is_firm


def _plain_step(gradient: Array, matrix: Array) -> tuple[Array, bool | None]:
    """Return Newton's step, its tangent stiffness unchecked (None) where it leads downhill."""
    flat = -np.linalg.solve(matrix, gradient)
    return (np.asarray(flat), None) if flat @ gradient < 0 else _safeguarded_step(gradient, matrix)


def _are_close(first: Array, second: Array) -> bool:
    """Return True if the springs of two places are nearly equal: not where rims meet or part."""
    return float(np.abs(first - second).max()) < SPRING_CHANGE * float(np.abs(first).max())


def _rim_limited(
    springs: Springs, at: Array, flat: Array, gradient: Array, rest: Array, blocks: Array
) -> Array:
    """Return the step to where rims just touch that it would drive into each other.

    A step without their contact would run far past them (a primal-dual active set).
    """
    for _ in range(RIM_ROUNDS):
        met = springs.meeting(at, flat.reshape(-1, 3))
        if met is None:
            break
        push, stiffer = met
        matrix = with_diagonal_blocks(rest, blocks + stiffer)
        tried, _ = newton_step((gradient + push.ravel())[None], matrix[None])
        if float((tried @ gradient)[0]) >= 0:
            break  # it would lead uphill
        flat = tried[0]
    return flat


def _refined(springs: Springs, at: Array, flat: Array, now: LoadedEnergy, rest: Array) -> Array:
    """Return the step at whose end springs are in equilibrium, with all else linear.

    Films, and rims that meet on the way, are most of the nonlinearity.
    """
    outside = now.gradient - now.spring_gradient.ravel()
    best, least = flat, math.inf
    for _ in range(CORRECTIONS):
        value, spring_gradient, blocks = springs.energy(at + flat.reshape(-1, 3))
        follows = outside + rest @ flat
        total = float(value.sum() + (outside + follows) @ flat / 2)
        if total > least:
            flat = (best + flat) / 2
            continue
        best, least = flat, total
        gradient = follows + spring_gradient.ravel()
        more = np.asarray(-np.linalg.solve(with_diagonal_blocks(rest, blocks), gradient))
        more = _rim_limited(springs, at + best.reshape(-1, 3), more, gradient, rest, blocks)
        flat = best + more
        if np.abs(more).max() < SMALL_CORRECTION * np.abs(best).max():
            return flat
    return best


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
) -> tuple[Array, float, bool] | None:
    """Return rise and tilt of each level (levels, 3), the force in mN on the plate, and True for a
    stable equilibrium; None if the steps pass an unstable place, or are too many.

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
                return at + move, touch.push, True
            # A rim or a point that just touches is met in one round and parts in the next.
            end = loaded_energy(springs, pitch, load, at + move)
            if np.abs(end.gradient).max() < PLATE_RESIDUAL * (1 + end.push):
                return at + move, end.push, True
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
        step, is_firm = newton_step(pushes[None], (matrix + against)[None])
        if not is_firm:
            return None
        ahead = deep + lines @ step[0] > touch.least
        if (ahead == touches).all():
            met = springs.meeting(at, step[0].reshape(-1, 3))
            if met is None or held_off == CONTACT_RIM_ROUNDS:
                return step[0], met is None
            held_off += 1
        touches = ahead
        tried.append(step[0])
    # Otherwise take the best place on the paths there; the first one leads downhill.
    return min((share * trial for trial in tried for share in STEP_SHARES), key=energy), False
