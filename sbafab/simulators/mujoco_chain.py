"""A stack as rigid plates on springs (MJCF), linearised about its pose at given pressures.

A level tilts by half, rises, and tilts by the other half: hinges about x and y, a slide along z,
hinges about y and x. The order is mirrored, so that the twists of both halves cancel, and plates
are positioned as in ``stack_loads.plate_chain`` up to third order in a level's tilt.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.derivatives import Linearised, linearised_poses
from sbafab.models.film_elements import Array
from sbafab.models.stack import GRAVITY, Pose, Stack
from sbafab.models.stack_loads import plate_chain
from sbafab.simulators.simulator import model_file

ACCURACY = 0.02
"""Largest error of the tip's position, as a share of the stack's length."""
LINEAR_SHARE = 0.9
"""Share of that error allowed for the linear tip: joints are exact to third order only."""
RANGES = (20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01)
"""Ranges in kPa about the given pressures, tried in this order."""
DT, SETTLING = 0.002, 0.05
"""s: time step, and time constant of each level, set by artificial dampers."""
MASS = 1e-5
"""Default mass of a plate in kg, if a density is not known."""
MIRROR = 100.0
"""Stiffness that keeps both halves of a tilt equal, as a multiple of the tilt's."""
JOINTS = ("tilt_x", "tilt_y", "rise", "tilt_y_upper", "tilt_x_upper")
"""Joints of a level from its lower plate up; the name of each begins with its level's."""
AXES = dict(zip(JOINTS, ("1 0 0", "0 1 0", "0 0 1", "0 1 0", "1 0 0"), strict=True))
"""Axis of each joint in the frame below it."""
FREEDOMS: tuple[tuple[str, ...], ...] = (
    ("rise",),
    ("tilt_x", "tilt_x_upper"),
    ("tilt_y", "tilt_y_upper"),
)
"""Joints that add up to each freedom of a level."""
SPRINGS = ("rise", "tilt_x", "tilt_y")
POSE = "pressed"


def chain_text(name: str, stack: Stack, pressures: Sequence[float]) -> str:
    """Return a stack as MJCF, in mm, kg and s, which settles in its pose at pressures (kPa, one per
    chamber) from any start.

    A chamber's control is the difference in kPa from its pressure. Raises DesignError if the stack
    has no stable pose there.
    """
    pose = stack.pose(pressures)
    at = linearised_poses(stack.states_of(pose, None))
    listed = ", ".join(f"{pressure:g}" for pressure in pose.pressures)
    if np.linalg.eigvalsh(at.energy.matrix).min() <= 0:
        raise DesignError(
            f"the pose at {listed} kPa is about to buckle, so springs cannot hold it; give other "
            "--pressures"
        )
    span = valid_range(stack, pose, at)
    mass = MASS if stack.weight is None else stack.weight / GRAVITY / 1000
    # Moments of inertia of half a plate, a disc, about a diameter and about its axis.
    across = mass * (3 * stack.outline**2 + stack.pitch**2) / 24
    along = mass * stack.outline**2 / 4
    center = np.array(pose.pressures)[:, None]
    ends = np.clip(center + np.array([-span, span]), 0.0, stack.most_pressure) - center
    return model_file(
        "chain.xml.j2",
        name,
        pressures=listed,
        pose=pose,
        stack=stack,
        count=len(stack.levels),
        span=span,
        share=f"{100 * ACCURACY:g} %",
        length=length_of(pose),
        mass=mass,
        weighs=stack.weight is not None,
        inertia=(across, across, along),
        axes=AXES,
        tendons=[*_springs(at), *_chambers(at)],
        ranges=ends,
        places=joint_values(at.at[0]).round(12),
        key=POSE,
        settling=SETTLING,
        dt=DT,
    )


def valid_range(stack: Stack, pose: Pose, at: Linearised) -> float:
    """Return the range in kPa about a pose's pressures, changed singly or all together, in which
    the linear tip is within ACCURACY of the stack's; 0 if it is less than the last of RANGES.
    """
    p = np.asarray(pose.pressures)
    each = np.concatenate([np.eye(stack.chambers), np.ones((1, stack.chambers))])
    ways = np.concatenate([each, -each])
    moves = at.energy.solved(at.filling)[0]
    for span in RANGES:
        ends = np.clip(p + span * ways, 0.0, stack.most_pressure)
        exact = stack.equilibria(ends, None, pose.freedoms[None].repeat(len(ends), 0))
        linear = at.at + ((ends - p) @ moves.T).reshape(exact.freedoms.shape)
        away = np.linalg.norm(plate_chain(linear, stack.pitch).tip - exact.tips, axis=-1)
        if (exact.is_met & (away <= LINEAR_SHARE * ACCURACY * length_of(pose))).all():
            return span
    return 0.0


def joint_values(freedoms: Array) -> Array:
    """Return the values (levels, 5) of JOINTS, mm and rad, from rise and tilt (levels, 3)."""
    rise, x, y = np.asarray(freedoms, dtype=float).T
    return np.stack([x / 2, y / 2, rise, y / 2, x / 2], axis=-1)


def length_of(pose: Pose) -> float:
    """Return the length of a pose's middle line in mm."""
    return float((pose.freedoms[:, 0] + pose.pitch).sum())


Tendon = tuple[str, tuple[float, float] | None, list[tuple[str, float]]]
"""Name, stiffness and length of its spring, if it has one, and its joints with their factors."""


def _springs(at: Linearised) -> Iterator[Tendon]:
    """Return three springs per level with the energy q H q / 2.

    H = L D L^T are the second derivatives with respect to its freedoms: D holds stiffnesses, and L
    each spring's length by freedom. Stiffer springs keep both halves of a tilt equal: MuJoCo's
    equality constraints ignore dampers, and diverge with masses this small.
    """
    lower = np.linalg.cholesky(at.energy.matrix[0])
    roots = np.diagonal(lower, axis1=1, axis2=2)
    levels = zip(lower / roots[:, None], roots**2, at.at[0], strict=True)
    for level, (columns, stiffnesses, freedoms) in enumerate(levels, start=1):
        lengths = (freedoms @ columns).round(12)
        for spring, ways, stiffness, length in zip(
            SPRINGS, columns.T, stiffnesses.tolist(), lengths.tolist(), strict=True
        ):
            yield f"level{level}_{spring}", (stiffness, length), _joints(level, ways)
        for joint, other in FREEDOMS[1:]:
            halves = [(f"level{level}_{joint}", 1.0), (f"level{level}_{other}", -1.0)]
            stiffness = MIRROR * float(stiffnesses[1:].max())
            yield f"level{level}_{joint}_halves", (stiffness, 0.0), halves


def _chambers(at: Linearised) -> Iterator[Tendon]:
    """Return a tendon per chamber, whose length increases like the chamber's volume, in ul."""
    filling = at.filling[0].T.reshape(-1, *at.at.shape[1:])
    for chamber, rates in enumerate(filling, start=1):
        parts = [part for level, ways in enumerate(rates, 1) for part in _joints(level, ways)]
        yield f"chamber{chamber}", None, parts


def _joints(level: int, ways: Array) -> list[tuple[str, float]]:
    """The joints of one level with their contributions to a tendon's length, by its freedoms."""
    # Ignore coefficients that are only rounding.
    least = 1e-9 * float(np.abs(ways).max())
    return [
        (f"level{level}_{joint}", way)
        for joints, way in zip(FREEDOMS, ways.tolist(), strict=True)
        for joint in (joints if abs(way) > least else ())
    ]
