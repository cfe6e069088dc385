"""Inverse kinematics of a stack: the pressures that bring the middle of its top to a place, under a
load and in contact.

First freedoms and pressures are found together by Newton's method: each step solves the linearised
equilibrium, and the pressures' change is the least, within their limits, that brings the linearised
tip to the place (Nocedal and Wright, Numerical Optimization, Sec. 18.1). Against an outer plate the
points in contact are those at the step's end, so that it passes where one closes or opens and the
tip's rates jump. Where these steps do not converge, Levenberg and Marquardt's method goes from
equilibrium to equilibrium by the tip's derivatives. Pressures are counted in asinh(p / P0), in
which heights are nearly linear.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import permutations, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError, UnreachableError
from sbafab.models.derivatives import derivatives, hessian, tip_motion
from sbafab.models.least_energy import is_positive_definite, step_limit
from sbafab.models.stack_loads import (
    WALL_STIFFNESS,
    level_motions,
    loaded_energy,
    plate_chain,
    with_diagonal_blocks,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from typing import Any

    from numpy.typing import NDArray

    from sbafab.models.film_elements import Array
    from sbafab.models.stack_loads import GapPlaces, Load, LoadedEnergy, OuterPlate, Springs
    from sbafab.models.stack_poses import Pose, PosedStack

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


class TipTarget(NamedTuple):
    """A ``place`` (3,) in mm that the tip of a stack is to reach under a load, and the highest
    asinh(p / P0).
    """

    stack: PosedStack
    place: Array
    load: Load | None
    most: float


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
    """Linearised equilibrium: the tip (3,) in mm, the freedoms' own step to equilibrium (rows, 3)
    and their step by each pressure (rows, 3, chambers), the tip's motion by freedoms (3, rows x 3),
    the tangent stiffness (groups of rows, size, size), and which contacts of balloons and rims are
    closed.
    """

    tip: Array
    own: Array
    by_pressure: Array
    motion: Array
    matrix: Array
    closed: NDArray[np.bool_]


def reach(
    stack: PosedStack,
    place: Array,
    load: Load | None,
    arguments: dict[str, Any],
    most_pressure: float,
    near: Pose | None,
) -> Pose:
    """Return the pose whose tip stands at ``place`` (3,) in mm, with no more than ``most_pressure``
    kPa; ``near`` is a pose to start from, ``arguments`` are passed to ``Stack.pose`` for the load.

    Raises UnreachableError with the nearest tip found.
    """
    target = TipTarget(stack, place, load, math.asinh(most_pressure / P0))
    if near is None:
        (guess,) = starts(stack, place[None], target.most)
    else:
        guess = np.arcsinh(np.array(near.pressures) / P0)
    guess = np.clip(guess, 0.0, target.most)
    if load is not None and load.wall is not None:
        best = _against_plate(target, guess, arguments, near)
    else:
        best = _without_plate(target, guess, arguments, near)
    if best is not None and _distance(target, best) < MET:
        return best
    if best is None:
        raise DesignError("no equilibrium of the stack found near this place; try another load")
    raise UnreachableError(
        f"the tip cannot reach {_written(place)} mm with 0 to {most_pressure:g} kPa; the nearest "
        f"place found is {_written(best.tip)} mm, {_distance(target, best):.3g} mm away"
    )


def _without_plate(
    target: TipTarget, guess: Array, arguments: dict[str, Any], near: Pose | None
) -> Pose | None:
    """Return the pose whose tip is nearest to the place; None without an equilibrium."""
    pose = _by_freedoms(target, guess, near)
    if pose is not None:
        return pose
    if target.load is not None:
        # From an equilibrium, where the load has bent the stack far.
        posed = _equilibrium(target, guess, arguments, near)
        pose = None if posed is None else _by_freedoms(target, guess, posed)
        if pose is not None:
            return pose
    best = None
    for x in (guess, *further_starts(guess, target.most)):
        pose = _by_poses(target, x, arguments, near if best is None else None)
        best = _nearer(target, best, pose)
        if best is not None and _distance(target, best) < NEAR:
            break
    return best


def _against_plate(
    target: TipTarget, guess: Array, arguments: dict[str, Any], near: Pose | None
) -> Pose | None:
    """Return the pose against an outer plate whose tip is nearest to the place; None without an
    equilibrium.
    """
    assert target.load is not None
    assert target.load.wall is not None
    begins, ways = plate_starts(guess, target.most), ways_to(target.load.wall)
    first, second, *others = begins

    def by_contacts(tries: Iterable[tuple[Array, Way]]) -> Iterator[Pose | None]:
        for x, way in tries:
            yield _by_contacts(target, x, near if x is guess else None, arguments, way)

    def about(best: Pose | None) -> Iterator[Pose | None]:
        """Descents end at a contact change, so try poses from places near it."""
        if best is not None and _distance(target, best) < STRANDED:
            for x in _around(target, np.arcsinh(np.array(best.pressures) / P0)):
                for from_near, way in ((best, POSED), (None, ways[0])):
                    yield _by_contacts(target, x, from_near, arguments, way)

    def descents(starts: Sequence[Array]) -> Iterator[Pose | None]:
        for x in starts:
            yield _by_poses(target, x, arguments, near if x is guess else None)

    stages: tuple[Callable[[Pose | None], Iterable[Pose | None]], ...] = (
        lambda _: by_contacts(product([first], ways if near is None else (POSED, *ways))),
        lambda _: by_contacts(product([second], ways)),
        lambda _: by_contacts(product([first, second], AIMED)),
        lambda _: descents([first]),
        about,
        lambda _: by_contacts(product(others, ways)),
        lambda _: descents(others[: DESCENT_STARTS - 1]),
        about,
    )
    best = None
    for stage in stages:
        best = _nearest(target, best, stage(best))
        if best is not None and _distance(target, best) < MET:
            break
    return best


def _around(target: TipTarget, x: Array) -> Iterator[Array]:
    """Yield places about one: itself, with a chamber's pressure changed, and with one raised as
    another is lowered, as it is along the edge of a contact.
    """
    yield x
    each = np.eye(len(x))
    singles = [size * sign * one for size in (0.05, 0.2, 0.6) for sign in (1, -1) for one in each]
    pairs = [0.15 * (first - second) for first, second in permutations(each, 2)]
    for change in (*singles, *pairs):
        yield np.clip(x + change, 0.0, target.most)


def _nearest(target: TipTarget, best: Pose | None, poses: Iterable[Pose | None]) -> Pose | None:
    """Return the pose nearest to the place of ``best`` and ``poses``, whose search ends where one
    is met.
    """
    for pose in poses:
        best = _nearer(target, best, pose)
        if best is not None and _is_met(target, best):
            break
    return best


def _nearer(target: TipTarget, first: Pose | None, second: Pose | None) -> Pose | None:
    if first is None or second is None:
        return first or second
    return min(first, second, key=lambda pose: _distance(target, pose))


def _written(place: Array) -> str:
    # Adding 0 makes -0 a plain 0.
    return "(" + ", ".join(f"{round(value, 3) + 0.0:g}" for value in place.tolist()) + ")"


def starts(stack: PosedStack, places: Array, most: float) -> Array:
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


def _arc_freedoms(target: TipTarget) -> Array:
    """Return rise and tilt of each level (levels, 3) on the arc to the place, all alike."""
    (bend,), (length,), (way,) = _arcs(target.place[None])
    levels = len(target.stack.levels)
    level = (length / levels - target.stack.pitch, -bend * way[1] / levels, bend * way[0] / levels)
    return np.tile(level, (levels, 1))


@lru_cache(maxsize=16)
def _column_rises(stack: PosedStack, most: float) -> tuple[Array, Array]:
    """Return by how many mm all balloons of a chamber rise freely, and at which asinh(p / P0)."""
    grid = np.linspace(0.0, most, 33)
    kinds = np.stack([kind.rises(P0 * np.sinh(grid)) for kind in stack.maps])
    return kinds[stack.levels].sum(0), grid


def further_starts(guess: Array, most: float) -> Iterator[Array]:
    """Yield starts all over the range, the nearer to the middle the earlier: (chambers, ...)."""
    for share in (0.6, 0.85, 0.3):
        yield np.full(guess.shape, share * most)
    for chamber in range(len(guess)):
        for low, high in ((0.3, 0.9), (0.9, 0.3)):
            x = np.full(guess.shape, low * most)
            x[chamber] = high * most
            yield x


def plate_starts(guess: Array, most: float) -> tuple[Array, ...]:
    """Return starts against an outer plate: (chambers, ...) each."""
    return guess, np.where(guess > guess.min(0), guess, 0.0), *further_starts(guess, most)


def ways_to(wall: OuterPlate) -> tuple[Way, ...]:
    """Return the paths to solutions against an outer plate, in the order of trial."""
    return STICKING if wall.sticks else SLIDING


def _distance(target: TipTarget, pose: Pose) -> float:
    return float(np.linalg.norm(pose.tip - target.place))


def _is_met(target: TipTarget, pose: Pose) -> bool:
    """Return True where a search against an outer plate ends."""
    assert target.load is not None
    assert target.load.wall is not None
    missing = movable(target.load.wall, target.place - pose.tip)
    return float(np.linalg.norm(missing)) < MET / 2 and _distance(target, pose) < MET


def movable(wall: OuterPlate, missing: Array) -> Array:
    """Return the part of distances (3, ...) in mm that pressures can remove.

    A plate that the tip sticks to yields across its line by less than ``MET``: pressures would
    stray if they tried to move the tip that way.
    """
    if not wall.sticks:
        return missing
    along = np.multiply.outer(wall.normal, wall.normal @ missing)
    is_held = np.linalg.norm(missing - along, axis=0) < MET / 2
    return np.where(is_held, along, missing)


def bounded_step(rates: Array, missing: Array, damping: float, room: tuple[Array, Array]) -> Array:
    """Return the step (n,) with least |rates @ step - missing|^2 + damping |step|^2 that stays
    within ``room``, its least and largest values (n,).

    Components outside the room are clamped until the rest stays within: an active set that only
    grows, sufficient for one of many steps.
    """
    least, most = room
    matrix = rates.T @ rates
    matrix.ravel()[:: len(matrix) + 1] += damping
    gradient = rates.T @ missing
    step = np.linalg.solve(matrix, gradient)
    inside = np.minimum(np.maximum(step, least), most)
    is_free = inside == step
    while not is_free.all():
        step = inside
        if not is_free.any():
            break
        right = gradient - matrix[:, ~is_free] @ step[~is_free]
        step[is_free] = np.linalg.solve(matrix[np.ix_(is_free, is_free)], right[is_free])
        inside = np.minimum(np.maximum(step, least), most)
        still = is_free & (inside == step)
        if (still == is_free).all():
            break
        is_free = still
    return np.asarray(step)


# Freedoms and pressures together.


def _by_freedoms(target: TipTarget, x: Array, near: Pose | None) -> Pose | None:
    """Return the pose by Newton's method, None if it does not converge to a stable pose within the
    limits.
    """
    stack = target.stack
    if near is not None:
        at = near.freedoms if target.load is not None else near.freedoms[stack.first_levels]
    else:
        at = stack.start_freedoms((P0 * np.sinh(x)).tolist())
        at = at if target.load is None else at[stack.levels]
    rows = stack.places if target.load is None else stack.level_places
    largest = math.inf
    for number in range(STEPS):
        now = _linearised(target, x, at, largest < CLOSE)
        if now is None:
            return None
        rates = now.motion @ now.by_pressure.reshape(-1, len(x))
        missing = target.place - now.tip - now.motion @ now.own.ravel()
        damping = LEAST_DAMPING * float((rates * rates).sum()) + 1e-12
        room = (np.maximum(-x, -LONGEST_STEP), np.minimum(target.most - x, LONGEST_STEP))
        ahead = bounded_step(rates, missing, damping, room)
        move = now.own + now.by_pressure @ ahead
        share = float(step_limit(move).min())
        if number >= WHOLE_STEPS and (_closed(rows, at + share * move) != now.closed).any():
            share /= 2
        x, at = np.clip(x + share * ahead, 0.0, target.most), at + share * move
        largest = max(float(np.abs(move).max()), float(np.abs(ahead).max()))
        is_small = largest < LAST_STEP and share == 1.0
        if largest < STILL or (is_small and (_closed(rows, at) == now.closed).all()):
            if np.linalg.norm(missing - rates @ ahead) < NEAR and is_positive_definite(now.matrix):
                return _pose(target, x, at)
            return None
    return None


def _linearised(target: TipTarget, x: Array, at: Array, is_close: bool) -> Linearisation | None:
    """Return the linearised equilibrium, None if it is singular; exact only if ``is_close``."""
    stack, load = target.stack, target.load
    springs = stack.springs((P0 * np.sinh(x)).tolist())
    if load is None:
        _, gradient, matrix = springs.energy(at)
        freedoms, rows = at[stack.levels], springs
        plates = plate_chain(freedoms, stack.pitch)
        motions = level_motions(plates)
    else:
        rows = stack.each(springs)
        now = loaded_energy(rows, stack.pitch, load, at)
        gradient, plates, motions = now.gradient[None], now.plates, now.motions
        if is_close:
            matrix = hessian(now, at, stack.pitch)[None]
        else:
            matrix = with_diagonal_blocks(now.rest(), now.blocks)[None]
    motion = tip_motion(plates, motions)[:3]
    if load is None:
        motion = motion.transpose(0, 2, 1) @ (stack.levels[:, None] == np.arange(len(at)))
        motion = motion.transpose(0, 2, 1)
    filling = rows.slopes(at)[1].transpose(0, 2, 1) * (P0 * np.cosh(x))
    right = np.concatenate([-gradient.reshape(*at.shape, 1), filling], axis=-1)
    groups, size, _ = matrix.shape
    try:
        moves = np.linalg.solve(matrix, right.reshape(groups, size, -1)).reshape(right.shape)
    except np.linalg.LinAlgError:
        return None
    return Linearisation(
        plates.places[-1],
        moves[..., 0],
        moves[..., 1:],
        motion.reshape(3, -1),
        matrix,
        _closed(rows.places, at),
    )


def _closed(places: GapPlaces, at: Array) -> NDArray[np.bool_]:
    return (at[:, None] @ places.meet)[:, 0] < 0


def _pose(target: TipTarget, x: Array, at: Array) -> Pose | None:
    stack, pressures = target.stack, (P0 * np.sinh(x)).tolist()
    springs = stack.springs(pressures)
    try:
        if target.load is None:
            return stack.pose_at(pressures, springs, at[stack.levels], at)
        return stack.pose_at(pressures, springs, at)
    except DesignError:
        return None


# Freedoms and pressures together, against an outer plate.


def _by_contacts(
    target: TipTarget,
    x: Array,
    near: Pose | None,
    arguments: dict[str, Any],
    way: Way,
) -> Pose | None:
    """Return the pose by Newton's method, with the plate's contact forces as additional unknowns;
    None if it does not converge to a stable pose within the limits.
    """
    load, forces = target.load, None
    assert load is not None
    if way.is_posed:
        pose = _equilibrium(target, x, arguments, near)
        if pose is None:
            return None
        at = pose.freedoms
    elif way.is_aimed:
        at = _arc_freedoms(target)
    else:
        at = target.stack.start_freedoms((P0 * np.sinh(x)).tolist())[target.stack.levels]
    for stiffness in way.soft:
        softer = target._replace(load=load._replace(stiffness=stiffness))
        tried = _contact_newton(softer, x, at, forces, SOFT_STEPS, ROUGH_CONTACT)
        if tried is None:
            return None
        x, at, forces, _ = tried
    found = _contact_newton(target, x, at, forces, PLATE_STEPS, CLOSE_CONTACT)
    if found is None:
        return None
    x, at, _, now = found
    if now is None:
        return None
    if not is_positive_definite(hessian(now, at, target.stack.pitch)):
        # A straight column that would buckle, unless a stable equilibrium is near.
        return _equilibrium(target, x, arguments, target.stack.pose_like(at))
    pressures = (P0 * np.sinh(x)).tolist()
    try:
        springs = target.stack.springs(pressures)
        return target.stack.pose_at(pressures, springs, at, None, now.push / 1000)
    except DesignError:
        return None


def _contact_newton(
    target: TipTarget, x: Array, at: Array, forces: Array | None, most: int, enough: float
) -> tuple[Array, Array, Array | None, LoadedEnergy | None] | None:
    """Return asinh(p / P0), freedoms and contact forces after a step below ``enough``, or after
    ``most`` steps; None if one is singular.

    Against the plate itself such a step ends in equilibrium, whose energy comes with it.
    """
    stack, load, before = target.stack, target.load, np.zeros_like(x)
    assert load is not None
    is_soft, is_close = load.stiffness < WALL_STIFFNESS, False
    for number in range(most + 1):
        if is_soft and (is_close or number == most):
            return x, at, forces, None
        springs = stack.each(stack.springs((P0 * np.sinh(x)).tolist()))
        now = loaded_energy(springs, stack.pitch, load, at, forces)
        if is_close and np.abs(now.gradient).max() < CONTACT_RESIDUAL:
            return x, at, forces, now
        if number == most:
            break
        touch = now.touch
        assert touch is not None
        step = _contact_step(target, x, at, now, springs)
        if step is None:
            return None
        move, ahead = step
        share = float(step_limit(move).min())
        if ahead @ before < -TURNED_BACK * (before @ before):
            # Oscillation at the limits of pressures and at contact changes.
            share /= 2
        before = ahead
        forces = touch.resists(touch.deep + share * (now.deeper(touch) @ move.ravel()))
        x, at = np.clip(x + share * ahead, 0.0, target.most), at + share * move
        is_close = max(float(np.abs(move).max()), float(np.abs(ahead).max())) < enough
    return x, at, forces, None


def _contact_step(
    target: TipTarget, x: Array, at: Array, now: LoadedEnergy, springs: Springs
) -> tuple[Array, Array] | None:
    """Return the steps of freedoms (levels, 3) and of asinh(p / P0) (chambers,) to the linearised
    equilibrium with the contacts at their end; None if it is singular.
    """
    touch, size = now.touch, now.gradient.size
    assert touch is not None
    assert target.load is not None
    wall = target.load.wall
    assert wall is not None
    lines = now.deeper(touch)
    motion = tip_motion(now.plates, now.motions)[:3].reshape(3, size)
    away = target.place - now.plates.places[-1]
    share = plate_damping(away)
    filling = springs.slopes(at)[1].transpose(0, 2, 1) * (P0 * np.cosh(x))
    # Without what the plate resists.
    free = hessian(now, at, target.stack.pitch)
    free -= (lines.T * (touch.stiff * (touch.deep > touch.least))) @ lines
    gradient = now.gradient - touch.forces @ lines
    room = (np.maximum(-x, -LONGEST_STEP), np.minimum(target.most - x, LONGEST_STEP))
    before = touches = touch.deep > touch.least
    for number in range(CONTACT_ROUNDS):
        stiff = touch.stiff * touches
        pushes = gradient + (stiff * touch.deep) @ lines
        right = np.concatenate([-pushes[:, None], filling.reshape(size, -1)], axis=1)
        try:
            moves = np.linalg.solve(free + (lines.T * stiff) @ lines, right)
        except np.linalg.LinAlgError:
            return None
        own, by_pressure = moves[:, 0], moves[:, 1:]
        rates = motion @ by_pressure
        missing = movable(wall, away - motion @ own)
        if np.linalg.norm(missing) < NEAR / 2:
            # Friction may prevent pressures from moving it further, and they would stray.
            missing = np.zeros(3)
        damping = float(share * (rates * rates).sum()) + 1e-12
        ahead = bounded_step(rates, missing, damping, room)
        move = own + by_pressure @ ahead
        after = touch.deep + lines @ move > touch.least
        if (after == touches).all() or (is_turn(number) and (after == before).all()):
            break
        before, touches = touches, after
    return move.reshape(-1, 3), ahead


def is_turn(number: int) -> bool:
    """Return True for a round that ends an oscillation between two sets of contacts: later rounds
    would repeat it.
    """
    return number > 0 and (CONTACT_ROUNDS - 1 - number) % 2 == 0


def plate_damping(away: Array) -> Array:
    """Return the damping (...) against an outer plate at a distance in mm (3, ...), as a share of
    the sum of the squares of all rates.

    A top flat on the plate cannot move along its normal, so distant steps must not try to.
    """
    return np.asarray(LEAST_DAMPING + PLATE_DAMPING * np.minimum((away * away).sum(0), 1.0))


# From equilibrium to equilibrium.


def _by_poses(
    target: TipTarget, x: Array, arguments: dict[str, Any], near: Pose | None
) -> Pose | None:
    """Return the pose whose tip is nearest to the place, as reached from a start; None without an
    equilibrium.
    """
    stack = target.stack
    pose = _equilibrium(target, x, arguments, near)
    if pose is None:
        return None
    damping = DAMPING
    for _ in range(POSES):
        missing = target.place - pose.tip
        if np.linalg.norm(missing) < NEAR:
            return pose
        try:
            by_pressure = derivatives(stack, pose, target.load).by_pressure.tip
        except DesignError:
            return pose
        rates = by_pressure * (P0 * np.cosh(x))
        scale = float((rates * rates).sum(0).max()) + 1e-12
        room = (np.maximum(-x, -LONGEST_STEP), np.minimum(target.most - x, LONGEST_STEP))
        while True:
            ahead = bounded_step(rates, missing, damping * scale, room)
            if np.abs(ahead).max() < STILL or damping > MOST_DAMPING:
                return pose
            tried = _equilibrium(target, x + ahead, arguments, pose)
            if tried is not None and _distance(target, tried) < _distance(target, pose):
                break
            damping *= 8
        x, pose = np.clip(x + ahead, 0.0, target.most), tried
        damping = max(damping / 8, LEAST_DAMPING)
    return pose


def _equilibrium(
    target: TipTarget, x: Array, arguments: dict[str, Any], near: Pose | None
) -> Pose | None:
    pressures: Sequence[float] = (P0 * np.sinh(np.clip(x, 0.0, target.most))).tolist()
    try:
        return target.stack.pose(pressures, near=near, **arguments)
    except DesignError:
        return None
