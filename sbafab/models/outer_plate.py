"""Balance of a stack against an outer plate, with the plate's forces as unknowns of their own.

A plate is stiff: how it makes a stack turn is known by the force with which it is pressed on, not
by how deep a step happens to end in it. So forces are found with each step, and the next one goes
on with them (a mixed method). Which points touch is found within a step, with springs as they are
at its end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sbafab.models.least_energy import ends, limited, towards
from sbafab.models.stack_loads import loaded, with_blocks

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array
    from sbafab.models.stack_loads import Load, Loaded, OuterPlate, PlateContact, Springs

STEPS = 12
"""Steps that suffice, or another way is tried."""
FINE = 1e-7
"""A step (mm, rad) that need not be made: a plate lets little of it be."""
SLIGHT = 1e-4
"""Out of balance in mN (or mN mm), and as a share of the plate's force, that is none."""
FIRST = 1e-3
"""A step (mm, rad) as large as the one before the first may have been."""
ROUNDS, NEARLY = 24, 0.2
"""How often a step is bettered by springs and touching points at its end, and the share of it that
is little."""
TRIES, HELD = 8, 2
"""How often the points that touch are found anew, and how often by rims that meet."""
SHARES = 0.5 ** np.arange(12)
"""Of a step to other touching points than it was made with."""
STRAIGHT = 6e-3
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
        if ends(largest, before, FINE):
            if is_found:
                return at + move, touch.push, True
            # A rim or a point that just touches is met in one round and parts in the next.
            end = loaded(springs, pitch, load, at + move)
            if np.abs(end.gradient).max() < SLIGHT * (1 + end.push):
                return at + move, end.push, True
        share = float(limited(move).min())
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
    for number in range(ROUNDS):
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
        little = NEARLY * np.abs(best).max() if number else STRAIGHT
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
    for _ in range(TRIES):
        stiff = touch.stiff * touches
        against = (lines.T * stiff) @ lines
        pushes = gradient + (stiff * deep) @ lines
        if met is not None:
            against = with_blocks(against, met[1])
            pushes = pushes + met[0].ravel()
        found, is_firm = towards(pushes[None], (matrix + against)[None])
        if not is_firm:
            return None
        ahead = deep + lines @ found[0] > touch.least
        if (ahead == touches).all():
            met = springs.meeting(at, found[0].reshape(-1, 3))
            if met is None or held_off == HELD:
                return found[0], met is None
            held_off += 1
        touches = ahead
        tried.append(found[0])
    # None is the least: the best place on the ways there, of which the first leads downhill.
    return min((share * step for step in tried for share in SHARES), key=energy), False
