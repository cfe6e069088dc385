"""Derivatives of a stack in equilibrium by pressures, forces and moments on the tip, and an outer
plate.

In equilibrium the gradient g(q, x) of the energy is 0, so the freedoms q follow a change of x by
dq/dx = -H^-1 dg/dx, with H the second derivatives of the energy with the closed contacts (implicit
function theorem). If a contact is just closing or opening, derivatives apply to the pose's side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.stack_loads import (
    CROSS,
    SMALL,
    WALL_POINTS,
    crossing,
    level_motions,
    loaded_energy,
    plate_chain,
    with_diagonal_blocks,
)

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array
    from sbafab.models.stack import Stack
    from sbafab.models.stack_balance import Pose
    from sbafab.models.stack_loads import Load, LoadedEnergy, PlateContact, Springs

RIGID = 1e-9
"""Share of the largest compliance below which a motion of the tip counts as impossible."""

RESIDUAL = 1e-7
"""Tolerance of the residual, mN or mN mm: poses are in equilibrium to about 1e-6 mm."""
CORRECTIONS = 6
"""Maximum Newton steps to reach it; one suffices unless contacts open or close."""
UNIT, QUARTER_TURN = np.eye(2), np.array([[0.0, 1.0], [-1.0, 0.0]])


class Tangent(NamedTuple):
    """n states linearised: the ``gradient`` of the energy (n, freedoms), its second derivatives (n,
    groups, size, size) of groups of levels that do not act on each other, and the force on an outer
    plate (n) in mN; ``energy`` is that of loaded states.
    """

    springs: Springs
    gradient: Array
    matrix: Array
    push: Array
    energy: LoadedEnergy | None

    @property
    def touch(self) -> PlateContact | None:
        """Contact with an outer plate."""
        return None if self.energy is None else self.energy.touch

    def solved(self, right: Array) -> Array:
        """Return the solutions (n, freedoms, k) of the second derivatives by right sides."""
        groups = self.matrix.shape[:3]
        moves = np.linalg.solve(self.matrix, right.reshape(*groups, -1))
        return np.asarray(moves.reshape(right.shape))

    def top(self, stack: Stack, at: Array) -> tuple[Array, Array]:
        """Return tips (n, 3) in mm, and the turn and move of the top by the freedoms (n, freedoms,
        6).
        """
        if self.energy is not None:
            return self.energy.plates.tip, self.energy.flat_motions
        plates = plate_chain(at[:, stack.levels], stack.pitch)
        motions = level_motions(plates)
        kinds = (stack.levels == np.arange(len(stack.maps))[:, None]).astype(float)
        by_kind = kinds @ motions.reshape(*motions.shape[:2], 18)
        return plates.tip, by_kind.reshape(len(at), -1, 6)


def tangent(
    stack: Stack, springs: Springs, load: Load | None, at: Array, forces: Array | None = None
) -> Tangent:
    """Return n states linearised at freedoms (n, rows, 3), each kind of balloon without a load and
    each level under one; ``forces`` of an outer plate as of ``loaded_energy``.
    """
    if load is None:
        _, gradient, matrix = springs.energy(at)
        return Tangent(springs, gradient.reshape(len(at), -1), matrix, np.zeros(len(at)), None)
    now = loaded_energy(springs, stack.pitch, load, at, forces)
    matrix = hessian(now, now.rest(), at, stack.pitch)[:, None]
    return Tangent(springs, now.gradient, matrix, now.push, now)


class Rates(NamedTuple):
    """Rates of a pose by n quantities: of the middle of the ``tip`` (3, n) in mm, the ``turn`` of
    the top (3, n) in rad about x, y and z, ``volumes`` (chambers, n) in ul, the ``force`` (n) in N
    on an outer plate, and ``freedoms`` (levels, 3, n) in mm and rad.
    """

    tip: Array
    turn: Array
    volumes: Array
    force: Array
    freedoms: Array


@dataclass(frozen=True, eq=False)
class Derivatives:
    """A ``pose`` with its rates ``by_pressure`` (each chamber's, a kPa), ``by_wrench`` (forces on
    the middle of the top along x, y and z, a N, then moments, a N mm), and ``by_plate`` (an outer
    plate, a mm along its normal), None without.
    """

    pose: Pose
    by_pressure: Rates
    by_wrench: Rates
    by_plate: Rates | None

    @property
    def compliance(self) -> Array:
        """Motion of the tip by forces and moments on it: (6, 6), mm and rad by N and N mm."""
        return np.concatenate([self.by_wrench.tip, self.by_wrench.turn])

    @property
    def stiffness(self) -> Array:
        """Forces and moments on the tip by its motion: (6, 6), N and N mm by mm and rad.

        Inverse of the compliance over the motions that the levels allow, 0 along others, such as
        the twist of a straight stack: balloons carry no shear.
        """
        compliance = self.compliance
        length = max(self.pose.height, 1.0)
        # As if all were lengths, so that motions are compared with each other.
        scale = np.repeat([1.0, length], 3)
        values, vectors = np.linalg.eigh((compliance + compliance.T) / 2 * np.outer(scale, scale))
        free = np.abs(values) > RIGID * np.abs(values).max()
        inverse = np.zeros_like(values)
        inverse[free] = 1 / values[free]
        return np.asarray((vectors * inverse) @ vectors.T * np.outer(scale, scale))


class Linearised(NamedTuple):
    """A stack linearised about an equilibrium.

    ``freedoms`` (levels, 3) are those in equilibrium to rounding; ``matrices`` (groups, size, size)
    second derivatives of the energy, group by group of levels that do not act on each other. By
    freedoms: ``motion`` (6, levels, 3) of the tip, ``filling`` (chambers, levels, 3) of the volumes
    in ul, ``films`` (levels, chambers, 3) of the balloons' potentials in uJ, ``push`` (levels, 3)
    of the force on an outer plate in mN. With all plates held: ``swelling`` ul of each chamber by
    its pressure, ``hardness`` mN on an outer plate by its own shift.
    """

    freedoms: Array
    matrices: Array
    motion: Array
    filling: Array
    swelling: Array
    films: Array
    push: Array
    hardness: float

    def rates(
        self, pulls: Array, volumes: Array | None = None, tip: Array | None = None, force: float = 0
    ) -> Rates:
        """Return the rates by n quantities that pull on the freedoms (levels, 3, n) in mN or mN mm.

        ``volumes`` (chambers, n), ``tip`` (6, n) and ``force`` (mN) are rates at rest. Raises
        DesignError for a pose that is about to buckle.
        """
        groups, size, _ = self.matrices.shape
        count = pulls.shape[-1]
        moves = _solved(self.matrices, pulls.reshape(groups, size, count))
        flat = moves.reshape(-1, count)
        motion = self.motion.reshape(6, -1) @ flat
        filled = self.filling.reshape(len(self.filling), -1) @ flat
        if volumes is not None:
            filled += volumes
        if tip is not None:
            motion += tip
        pushes = (self.push.ravel() @ flat + force) / 1000
        return Rates(motion[:3], motion[3:], filled, pushes, np.asarray(flat.reshape(-1, 3, count)))


def derivatives(
    stack: Stack, pose: Pose, load: Load | None = None, sucked: bool = False
) -> Derivatives:
    """Return the derivatives of a pose of a stack under the load that it was found with. Raises
    DesignError for a pose that is about to buckle.
    """
    at = linearised(stack, pose, load, sucked)
    chambers = stack.chambers
    has_plate = load is not None and load.wall is not None
    pulls = np.empty((*at.freedoms.shape, chambers + 6 + has_plate))
    pulls[..., :chambers] = at.filling.transpose(1, 2, 0)
    pulls[..., chambers : chambers + 6] = 1000 * at.motion.transpose(1, 2, 0)
    volumes = np.zeros((chambers, pulls.shape[-1]))
    volumes[:, :chambers] = np.diag(at.swelling)
    if has_plate:
        pulls[..., -1] = at.push
    each = at.rates(pulls, volumes)
    parts = [
        Rates(*(part[..., columns] for part in each))
        for columns in (slice(chambers), slice(chambers, chambers + 6), slice(chambers + 6, None))
    ]
    by_plate = None
    if has_plate:
        by_plate = parts[2]._replace(force=parts[2].force - at.hardness / 1000)
    return Derivatives(pose, parts[0], parts[1], by_plate)


def linearised(
    stack: Stack, pose: Pose, load: Load | None = None, sucked: bool = False
) -> Linearised:
    """Return a stack linearised about a pose under the load that it was found with."""
    each = stack.springs(pose.pressures, sucked, by_level=True, orders=3)
    push, hardness = np.zeros_like(pose.freedoms), 0.0
    if load is None:
        springs = stack.springs(pose.pressures, sucked)
        kinds = pose.freedoms[stack.first_levels]
        for _ in range(CORRECTIONS):
            _, gradient, blocks = springs.energy(kinds)
            if np.abs(gradient).max() < RESIDUAL:
                break
            kinds = kinds - _solved(blocks, gradient[..., None])[..., 0]
        matrices = blocks[stack.levels]
        freedoms = kinds[stack.levels]
        plates = plate_chain(freedoms, stack.pitch)
        motions = level_motions(plates)
    else:
        freedoms = pose.freedoms
        for _ in range(CORRECTIONS):
            now = loaded_energy(each, stack.pitch, load, freedoms)
            matrix = hessian(now, now.rest(), freedoms, stack.pitch)
            if np.abs(now.gradient).max() < RESIDUAL * (1 + 1e-3 * now.push):
                break
            freedoms = freedoms - _solved(matrix, now.gradient).reshape(-1, 3)
        matrices = matrix[None]
        plates, motions = now.plates, now.motions
        if now.touch is not None:
            stiff = (now.touch.stiff * now.touch.touches)[:WALL_POINTS]
            push = (stiff @ now.deeper(now.touch)[:WALL_POINTS]).reshape(-1, 3)
            hardness = float(stiff.sum())
    films, filling = each.order(freedoms, [0, 1])[1]
    swelling, _ = each.order(freedoms, 2, with_rates=False)
    return Linearised(
        freedoms,
        matrices,
        plates.tip_motion(motions).transpose(2, 0, 1),
        filling.transpose(1, 0, 2),
        swelling.sum(0),
        films,
        push,
        hardness,
    )


def _solved(matrices: Array, right: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrices, right))
    except np.linalg.LinAlgError:
        raise DesignError(
            "the stack is about to buckle and has no derivatives; change a pressure or load"
        ) from None


# Second derivatives of the energy under a load.


def hessian(now: LoadedEnergy, rest: Array, freedoms: Array, pitch: float) -> Array:
    """Return the second derivatives (..., freedoms, freedoms) of the energy of a stack under a
    load; ``rest`` are those of all but the springs, as of ``LoadedEnergy.rest``.
    """
    blocks = now.blocks.copy()
    blocks[..., 1:, 1:] -= _tilt_works(now, freedoms, pitch)
    return with_diagonal_blocks(rest, blocks)


def _tilt_works(now: LoadedEnergy, freedoms: Array, pitch: float) -> Array:
    """Return the work of the forces by the two tilts of one level that ``LoadedEnergy.turned``
    omits: (..., levels, 2, 2).

    A point y from the level's middle moves by a x y with the turn a of a tilt. The second tilt,
    with the turn b, changes that to second order by da/db x y + a x (b x y - c x s / 2);
    ``turned`` includes the mean of a x (b x y) and b x (a x y). s goes from plate to plate, c is
    the turn of the level's first half, so that the middle shifts by c x s / 2.
    """
    plates, acting = now.plates, now.acting
    half = freedoms[..., 1:] / 2
    safe = np.maximum((half * half).sum(-1), SMALL)
    angle = np.sqrt(safe)
    # A tilt's turn, in the frame of the level's middle, is (sine I + mean v v) times its rate, and
    # the first half's has the skew part of the Jacobian besides (``rotations``).
    sine = np.sin(angle) / angle
    mean = (1 - sine) / safe
    sine_rate = (np.cos(angle) - sine) / safe
    mean_rate = -(sine_rate + 2 * mean) / safe
    skew = half @ QUARTER_TURN * ((1 - np.cos(angle)) / safe)[..., None]
    # Moments about the level's middle, along the turns, v, the plane's axes, and across the rise.
    arms = acting.arms - plates.middles[..., None] * acting.forces[..., None, :]
    moment = (arms.reshape(*arms.shape[:-2], 9) @ CROSS.T)[..., None, :]
    works = now.works[..., 1:, 3]
    along = (half * works).sum(-1)
    axes = (works - (mean * along)[..., None] * half) / sine[..., None]
    across = ((moment @ crossing(plates.rises)) @ -plates.turns.swapaxes(-1, -2))[..., 0, :]
    mixed = (sine_rate + mean)[..., None] * half
    pairs = mixed[..., :, None] * axes[..., None, :] - skew[..., :, None] * across[..., None, :]
    lift = now.works[..., 0, 3] * (freedoms[..., 0] + pitch)
    second = pairs + pairs.swapaxes(-1, -2)
    second += (2 * mean_rate * along)[..., None, None] * (half[..., :, None] * half[..., None, :])
    second += (2 * mean * along)[..., None, None] * UNIT
    second += lift[..., None, None] * (plates.turns @ plates.turns.swapaxes(-1, -2))
    return np.asarray(second / 4)
