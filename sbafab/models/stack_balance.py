"""Balance of a stack against an outer plate, with the plate's forces as unknowns of their own.

A plate is stiff: how it makes a stack turn is known by the force with which it is pressed on, not
by how deep a step happens to end in it. So forces are found with each step, and the next one goes
on with them (a mixed method). Which points touch is found within a step, with springs as they are
at its end.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.least_energy import (
    LARGEST_MOVE,
    SMALLEST_STEP,
    is_last_step,
    is_positive_definite,
    newton_step,
    step_limit,
)
from sbafab.models.stack_loads import Load, Loaded, loaded, with_blocks

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array
    from sbafab.models.stack_loads import OuterPlate, PlateContact, Springs

STEPS = 12
"""Steps that suffice, or another way is tried."""
PLATE_FINE = 1e-7
"""A step (mm, rad) that need not be made: a plate lets little of it be."""
SLIGHT = 1e-4
"""Out of balance in mN (or mN mm), and as a share of the plate's force, that is none."""
FIRST = 1e-3
"""A step (mm, rad) as large as the one before the first may have been."""
PLATE_ROUNDS, PLATE_NEARLY = 24, 0.2
"""How often a step is bettered by springs and touching points at its end, and the share of it that
is little."""
CONTACT_TRIES, RIM_TRIES = 8, 2
"""How often the points that touch are found anew, and how often by rims that meet."""
SHARES = 0.5 ** np.arange(12)
"""Of a step to other touching points than it was made with."""
PLATE_STRAIGHT = 6e-3
"""A step (mm, rad) along which springs are straight enough."""
PUSHES = 2.0
"""By how many times the largest push of a level a plate may be pressed on to begin with."""


def below(
    springs: Springs, start: Array, pitch: float, wall: OuterPlate, stiffness: float
) -> Array:
    """The same start below a level plate, a little past it, so that it is met all round: what is
    alike on all sides stays so.
    """
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


def pressed(
    springs: Springs, pitch: float, load: Load, wall: OuterPlate, start: Array
) -> tuple[Array, float, bool] | None:
    """Rise and tilt of each level (levels, 3), the force in mN on the plate, and that the balance
    is stable; None where the way there leads over a place where it is not, or is too long.
    """
    at, before = start, FIRST
    now = loaded(springs, pitch, load, at)
    touch = now.touch
    if touch is not None and touch.push > PUSHES * np.abs(now.own[:, 0]).max():
        # So deep that it says nothing of the force, nor the first step of what is stable.
        before = 0.0
        now = loaded(springs, pitch, load, at, np.zeros(len(touch.deep)))
    for _ in range(STEPS):
        touch = now.touch
        assert touch is not None
        step = _step(springs, at, now, touch)
        if step is None:
            return None
        flat, touch, is_found = step
        move = flat.reshape(-1, 3)
        largest = float(np.abs(move).max())
        if is_last_step(largest, before, PLATE_FINE):
            if is_found:
                return at + move, touch.push, True
            # A rim or a point that just touches is met in one round and parts in the next.
            end = loaded(springs, pitch, load, at + move)
            if np.abs(end.gradient).max() < SLIGHT * (1 + end.push):
                return at + move, end.push, True
        share = float(step_limit(move).min())
        if share < 1.0 and not wall.sticks:
            return None
        before = largest if share == 1.0 else 0.0
        at = at + share * move
        now = loaded(springs, pitch, load, at, touch.forces)
    return None


def _step(
    springs: Springs, at: Array, now: Loaded, touch: PlateContact
) -> tuple[Array, PlateContact, bool] | None:
    """The step (freedoms) to balance with all straight but springs and touching, the touch there,
    and whether it is that balance; None where the energy curves the wrong way.
    """
    lines, turned = now.deeper(touch), now.turned()
    outside = now.gradient - now.own.ravel() - touch.forces @ lines
    own, blocks = now.own, now.blocks
    flat = best = np.zeros(now.gradient.size)
    is_found = False
    deep, least = touch.deep, np.inf
    for number in range(PLATE_ROUNDS):
        follows = outside + turned @ flat
        if number:
            value, own, blocks = springs.energy(at + flat.reshape(-1, 3))
            deep = touch.deep + lines @ flat
            total = float(value.sum() + (outside + follows) @ flat / 2)
            total += float(touch.resists(deep) @ deep) / 2
            if total > least:
                flat = (best + flat) / 2
                continue
            best, least = flat, total
        matrix, gradient = with_blocks(turned, blocks), follows + own.ravel()
        found = _more(springs, at + flat.reshape(-1, 3), matrix, gradient, touch, lines, deep)
        if found is None:
            return None
        more, is_settled = found
        flat = best + more
        little = PLATE_NEARLY * np.abs(best).max() if number else PLATE_STRAIGHT
        is_found = is_settled and float(np.abs(more).max()) < little
        if is_found:
            break
    deep = touch.deep + lines @ flat
    return flat, touch._replace(deep=deep, forces=touch.resists(deep)), is_found


def _more(
    springs: Springs,
    at: Array,
    matrix: Array,
    gradient: Array,
    touch: PlateContact,
    lines: Array,
    deep: Array,
) -> tuple[Array, bool] | None:
    """The step to where the points that touch at its end, and rims that meet, are in balance, and
    whether they are those that the step was made with.
    """

    def energy(step: Array) -> float:
        after = deep + lines @ step
        return float((gradient + matrix @ step / 2) @ step + touch.resists(after) @ after / 2)

    touches, met, held_off = deep > touch.least, None, 0
    tried = []
    for _ in range(CONTACT_TRIES):
        stiff = touch.stiff * touches
        against = (lines.T * stiff) @ lines
        pushes = gradient + (stiff * deep) @ lines
        if met is not None:
            against = with_blocks(against, met[1])
            pushes = pushes + met[0].ravel()
        found, is_firm = newton_step(pushes[None], (matrix + against)[None])
        if not is_firm:
            return None
        ahead = deep + lines @ found[0] > touch.least
        if (ahead == touches).all():
            met = springs.meeting(at, found[0].reshape(-1, 3))
            if met is None or held_off == RIM_TRIES:
                return found[0], met is None
            held_off += 1
        touches = ahead
        tried.append(found[0])
    # None is the least: the best place on the ways there, of which the first leads downhill.
    return min((share * step for step in tried for share in SHARES), key=energy), False


# Balance of a stack by Newton's method: levels on their own, or all together under a load.


SOFTER = (1e3, 1e5)
"""mN/mm of an outer plate on the way to it."""
MOST_STEPS = 300
CLOSE = 1e-7
"""Out of balance in mN (or mN mm) that is none."""
FINEST = 5e-8
"""The same where what all levels do adds up: tilts under a load, volumes without."""
CLOSELY, LITTLE = 3e-5, 1e-7
"""Largest last step (mm, rad) against an outer plate, and the energy (uJ) that it may gain: the
plate's force is to be right as well."""
ROUGH = 0.01
"""The same on the way to an outer plate."""
TRIES = 2
"""How often a step is held off by rims that it would meet."""
ROUNDS, NEARLY = 16, 0.8
"""How often a step is bettered by the springs at its end, and the share of it that is little: the
next step sees to the rest.
"""
STRAIGHT = 6e-3
"""A step (mm, rad) along which springs are straight enough."""
SMALL, TINY, ALIKE = 2e-3, 1e-9, 0.2
"""A step with whose matrix another one may be made, what the product of both must be below for that
one to be the last, and the share by which springs may change between.
"""
FEW_STEPS = 12
"""Steps in which a start far away meets an outer plate, or never does."""


def free(springs: Springs, start: Array) -> Array:
    """Rise and tilt of each row with nothing outside acting: (rows, 3). Raises DesignError."""
    at, before = start, SMALLEST_STEP
    value, gradient, matrix = springs.energy(at)
    for _ in range(MOST_STEPS):
        if np.abs(gradient).max() < CLOSE:
            return at
        move, is_firm = newton_step(gradient, matrix)
        largest = float(np.abs(move).max())
        if is_firm and is_last_step(largest, before, FINEST):
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
    raise DesignError("the stack finds no balance at these pressures; try others")


def held(
    springs: Springs, pitch: float, load: Load, start: Array, is_near: bool
) -> tuple[Array, float, bool]:
    """Rise and tilt of each level (levels, 3) under a load, the force in mN on the plate, and
    whether the balance is stable.

    An outer plate that is not met soon stiffens by and by, for steps that do not see it yet would
    run far into it; ``is_near`` tells a start that may be met as it is. Raises DesignError where no
    balance is found.
    """
    wall = load.wall
    if wall is None:
        fine = SMALLEST_STEP if is_near else FINEST
        found = _settled(springs, pitch, load, start, FEW_STEPS, quick=fine)
        if found is None:
            found = _settled(springs, pitch, load, start, MOST_STEPS)
    else:
        at = start if is_near else below(springs, start, pitch, wall, load.stiffness)
        found = pressed(springs, pitch, load, wall, at)
        if found is None:
            found = _settled(springs, pitch, load, at, MOST_STEPS if is_near else FEW_STEPS)
        if found is None:
            found = _met(springs, pitch, load, wall, at)
    if found is None:
        raise DesignError("the stack finds no balance under this load; try a smaller one")
    return found


def _met(
    springs: Springs, pitch: float, load: Load, wall: OuterPlate, start: Array
) -> tuple[Array, float, bool] | None:
    """What ``held`` gives against a plate that is soft at first."""
    at = start
    for stiffness in SOFTER:
        soft = _settled(springs, pitch, load._replace(stiffness=stiffness), at, MOST_STEPS, ROUGH)
        if soft is None:
            return None
        at, _, _ = soft
    found = pressed(springs, pitch, load, wall, at)
    return found or _settled(springs, pitch, load, at, MOST_STEPS)


def _settled(
    springs: Springs,
    pitch: float,
    load: Load,
    start: Array,
    most: int,
    enough: float = 0.0,
    quick: float = 0.0,
) -> tuple[Array, float, bool] | None:
    """What ``held`` gives, or None where so many steps do not get there. A step that is no larger
    than ``enough`` ends it. ``quick`` makes fewer and larger ones, until less than it is left.
    """
    fine = quick or SMALLEST_STEP
    at, before, last = start, fine, None
    now = loaded(springs, pitch, load, at)
    for _ in range(most):
        if np.abs(now.gradient).max() < CLOSE * (1 + 1e-3 * now.push):
            return at, now.push, is_positive_definite(with_blocks(now.rest(), now.blocks))
        if last is not None:
            # The matrix of a step so small is still good enough for the last one.
            matrix, blocks = last
            flat = -np.linalg.solve(matrix, now.gradient)
            if np.abs(flat).max() * before < TINY and _are_alike(blocks, now.blocks):
                return at + flat.reshape(-1, 3), now.push, True
        rest = now.rest()
        matrix = with_blocks(rest, now.blocks)
        flat, is_firm = (_downhill if quick else _careful)(now.gradient, matrix)
        flat = _held_off(springs, at, flat, now.gradient, rest, now.blocks)
        if quick and np.abs(flat).max() > STRAIGHT:
            flat = _bettered(springs, at, flat, now, rest)
        move = flat.reshape(-1, 3)
        largest = float(np.abs(move).max())
        slope = float(flat @ now.gradient)
        fits = load.wall is None or (largest < CLOSELY and slope > -LITTLE)
        is_last = largest <= enough or (fits and is_last_step(largest, before, fine))
        if is_last and (is_positive_definite(matrix) if is_firm is None else is_firm):
            at = at + move
            if load.wall is None:
                return at, 0.0, True
            return at, loaded(springs, pitch, load, at).push, True
        share = float(step_limit(move).min()) if largest > LARGEST_MOVE.min() else 1.0
        for _ in range(14):
            tried = loaded(springs, pitch, load, at + share * move)
            if tried.value <= now.value + 1e-4 * share * slope + 1e-11 * (1 + abs(now.value)):
                break
            share /= 2
        before = largest if share == 1.0 else 0.0
        may_last = load.wall is None and 0 < before < SMALL and is_positive_definite(matrix)
        last = (matrix, now.blocks) if may_last else None
        at = at + share * move
        now = tried
        if abs(slope) < 1e-11 * (1 + abs(now.value)):
            return at, now.push, is_positive_definite(with_blocks(now.rest(), now.blocks))
    return None


def _careful(gradient: Array, matrix: Array) -> tuple[Array, bool]:
    """Newton's step of all levels, and whether the energy curves the right way."""
    found, is_firm = newton_step(gradient[None], matrix[None])
    return found[0], is_firm


def _downhill(gradient: Array, matrix: Array) -> tuple[Array, bool | None]:
    """The same; where the step leads downhill, it is left open how the energy curves."""
    flat = -np.linalg.solve(matrix, gradient)
    return (np.asarray(flat), None) if flat @ gradient < 0 else _careful(gradient, matrix)


def _are_alike(one: Array, other: Array) -> bool:
    """Whether the springs of two places are: where rims meet or part they are not."""
    return float(np.abs(one - other).max()) < ALIKE * float(np.abs(one).max())


def _held_off(
    springs: Springs, at: Array, flat: Array, gradient: Array, rest: Array, blocks: Array
) -> Array:
    """The step to where rims just touch which it would drive into each other.

    A step that does not see them yet would run far past them (a primal-dual active set).
    """
    for _ in range(TRIES):
        met = springs.meeting(at, flat.reshape(-1, 3))
        if met is None:
            break
        push, stiffer = met
        matrix = with_blocks(rest, blocks + stiffer)
        tried, _ = newton_step((gradient + push.ravel())[None], matrix[None])
        if float((tried @ gradient)[0]) >= 0:
            break  # it would lead uphill
        flat = tried[0]
    return flat


def _bettered(springs: Springs, at: Array, flat: Array, now: Loaded, rest: Array) -> Array:
    """The step by which springs come into balance, with all else as it is at the step's start.

    Films, and rims that meet on the way, are most of what a step does not see.
    """
    outside = now.gradient - now.own.ravel()
    best, least = flat, math.inf
    for _ in range(ROUNDS):
        value, own, blocks = springs.energy(at + flat.reshape(-1, 3))
        follows = outside + rest @ flat
        total = float(value.sum() + (outside + follows) @ flat / 2)
        if total > least:
            flat = (best + flat) / 2
            continue
        best, least = flat, total
        gradient = follows + own.ravel()
        more = np.asarray(-np.linalg.solve(with_blocks(rest, blocks), gradient))
        more = _held_off(springs, at + best.reshape(-1, 3), more, gradient, rest, blocks)
        flat = best + more
        if np.abs(more).max() < NEARLY * np.abs(best).max():
            return flat
    return best
