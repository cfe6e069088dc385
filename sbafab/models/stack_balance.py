"""Balance of a stack by Newton's method: levels on their own, or all together under a load."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.least_energy import FARTHEST_STEP, FINE, curves_up, ends, limited, towards
from sbafab.models.outer_plate import below, pressed
from sbafab.models.stack_loads import Load, Loaded, loaded, with_blocks

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array
    from sbafab.models.stack_loads import OuterPlate, Springs

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
    at, before = start, FINE
    value, gradient, matrix = springs.energy(at)
    for _ in range(MOST_STEPS):
        if np.abs(gradient).max() < CLOSE:
            return at
        move, is_firm = towards(gradient, matrix)
        largest = float(np.abs(move).max())
        if is_firm and ends(largest, before, FINEST):
            return at + move
        share = limited(move)
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
        fine = FINE if is_near else FINEST
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
    fine = quick or FINE
    at, before, last = start, fine, None
    now = loaded(springs, pitch, load, at)
    for _ in range(most):
        if np.abs(now.gradient).max() < CLOSE * (1 + 1e-3 * now.push):
            return at, now.push, curves_up(with_blocks(now.rest(), now.blocks))
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
        is_last = largest <= enough or (fits and ends(largest, before, fine))
        if is_last and (curves_up(matrix) if is_firm is None else is_firm):
            at = at + move
            if load.wall is None:
                return at, 0.0, True
            return at, loaded(springs, pitch, load, at).push, True
        share = float(limited(move).min()) if largest > FARTHEST_STEP.min() else 1.0
        for _ in range(14):
            tried = loaded(springs, pitch, load, at + share * move)
            if tried.value <= now.value + 1e-4 * share * slope + 1e-11 * (1 + abs(now.value)):
                break
            share /= 2
        before = largest if share == 1.0 else 0.0
        may_last = load.wall is None and 0 < before < SMALL and curves_up(matrix)
        last = (matrix, now.blocks) if may_last else None
        at = at + share * move
        now = tried
        if abs(slope) < 1e-11 * (1 + abs(now.value)):
            return at, now.push, curves_up(with_blocks(now.rest(), now.blocks))
    return None


def _careful(gradient: Array, matrix: Array) -> tuple[Array, bool]:
    """Newton's step of all levels, and whether the energy curves the right way."""
    found, is_firm = towards(gradient[None], matrix[None])
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
        tried, _ = towards((gradient + push.ravel())[None], matrix[None])
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
