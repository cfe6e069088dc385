"""A stack as rigid plates on springs (MJCF), linearised about its pose at given pressures."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.derivatives import Linearised, linearised
from sbafab.models.film_elements import Array
from sbafab.models.joint_chain import (
    JOINTS,
    axis_of,
    disc_inertia,
    document,
    joint_values,
    number,
    numbers,
    plate_mass,
)
from sbafab.models.stack import Pose, Stack
from sbafab.models.stack_loads import plate_chain

ACCURACY = 0.02
"""Largest error of the tip's position, as a share of the stack's length."""
LINEAR_SHARE = 0.9
"""Share of that error allowed for the linear tip: joints are exact to third order only."""
RANGES = (20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01)
"""Ranges in kPa about the given pressures, tried in this order."""
DRIVEN_SETTLING = 0.01
"""s: time constant of the stiffest motion of a level driven by balloons."""
DT, SETTLING = 0.002, 0.05
"""s: time step, and time constant of each level, set by artificial dampers."""
MASS = 1e-5
"""Default mass of a plate in kg, if a density is not known."""
MIRROR = 100.0
"""Stiffness that keeps both halves of a tilt equal, as a multiple of the tilt's."""
FREEDOMS: tuple[tuple[str, ...], ...] = (
    ("rise",),
    ("tilt_x", "tilt_x_upper"),
    ("tilt_y", "tilt_y_upper"),
)
"""Joints that add up to each freedom of a level."""
SPRINGS = ("rise", "tilt_x", "tilt_y")
BY_JOINT, HALVES = np.array([1, 2, 0, 2, 1]), np.array([2.0, 2.0, 1.0, 2.0, 2.0])
"""The freedom to which each of JOINTS belongs, and the number of joints per freedom."""
POSE = "pressed"


def chain_text(name: str, stack: Stack, pressures: Sequence[float]) -> str:
    """Return a stack as MJCF, in mm, kg and s, which settles in its pose at pressures (kPa, one per
    chamber) from any start. A chamber's control is the difference in kPa from its pressure.

    Raises DesignError if the stack has no stable pose there.
    """
    pose = stack.pose(pressures)
    at = linearised(stack, pose)
    if np.linalg.eigvalsh(at.matrices).min() <= 0:
        raise DesignError(
            f"the pose at {_listed(pose.pressures)} kPa is about to buckle, so that no springs "
            "hold it; give other --pressures"
        )
    span = valid_range(stack, pose, at)
    root = ET.Element("mujoco", {"model": name})
    ET.SubElement(root, "compiler", {"angle": "radian"})
    option = {"timestep": number(DT), "gravity": "0 0 0", "integrator": "implicit"}
    ET.SubElement(ET.SubElement(root, "option", option), "flag", {"contact": "disable"})
    height = pose.height
    centre = {"center": numbers((0, 0, height / 2)), "extent": number(max(height, 5.0))}
    ET.SubElement(root, "statistic", centre)
    _add_plates(ET.SubElement(root, "worldbody"), stack)
    tendons = ET.SubElement(root, "tendon")
    _add_springs(tendons, at)
    _add_chambers(tendons, at)
    if span:
        _add_controls(ET.SubElement(root, "actuator"), stack, pose, span)
    key = {"name": POSE, "qpos": numbers(joint_values(at.freedoms).ravel().round(12))}
    ET.SubElement(ET.SubElement(root, "keyframe"), "key", key)
    return document(root, _note(name, stack, pose, span))


def valid_range(stack: Stack, pose: Pose, at: Linearised) -> float:
    """Return the range in kPa about a pose's pressures, changed singly or all together, in which
    the linear tip is within ACCURACY of the stack's; 0 if it is less than the last of RANGES.
    """
    p = np.asarray(pose.pressures)
    each = np.concatenate([np.eye(stack.chambers), np.ones((1, stack.chambers))])
    ways = np.concatenate([each, -each])
    for span in RANGES:
        ends = np.clip(p + span * ways, 0.0, stack.most_pressure)
        if all(_is_close(stack, pose, at, end) for end in ends):
            return span
    return 0.0


def _is_close(stack: Stack, pose: Pose, at: Linearised, pressures: Array) -> bool:
    pulls = np.einsum("clf,c->lf", at.filling, pressures - pose.pressures)
    moves = np.linalg.solve(at.matrices, pulls[..., None])[..., 0]
    tip = plate_chain(at.freedoms + moves, stack.pitch).places[-1]
    try:
        exact = stack.pose(tuple(pressures.tolist()), near=pose).tip
    except DesignError:
        return False
    return float(np.linalg.norm(tip - exact)) <= LINEAR_SHARE * ACCURACY * length_of(pose)


def length_of(pose: Pose) -> float:
    """Return the length of a pose's middle line in mm."""
    return float((pose.freedoms[:, 0] + pose.pitch).sum())


def _add_plates(world: ET.Element, stack: Stack) -> None:
    """Add two bodies per level: the part between its halves, then its upper plate."""
    mass = plate_mass(stack) or MASS
    size = numbers((stack.outline, stack.pitch / 4))
    shape = {"type": "cylinder", "size": size, "contype": "0", "conaffinity": "0", "mass": "0"}
    paint = {"rgba": "0.35 0.60 0.85 1"}
    ET.SubElement(world, "geom", {"name": "base", **shape, "rgba": "0.4 0.4 0.4 1"})
    across, along = disc_inertia(mass / 2, stack.outline, stack.pitch)
    inertial = {
        "pos": "0 0 0",
        "mass": number(mass / 2),
        "diaginertia": numbers((across, across, along)),
    }
    body = world
    for level in range(1, len(stack.levels) + 1):
        for title, joints, place in (
            (f"level{level}", JOINTS[:3], 0.0),
            (f"plate{level}", JOINTS[3:], stack.pitch),
        ):
            body = ET.SubElement(body, "body", {"name": title, "pos": numbers((0, 0, place))})
            ET.SubElement(body, "inertial", inertial)
            for joint in joints:
                kind = "slide" if joint == "rise" else "hinge"
                parts = {"name": f"level{level}_{joint}", "type": kind, "axis": axis_of(joint)}
                ET.SubElement(body, "joint", parts)
        ET.SubElement(body, "geom", {**shape, **paint})
    ET.SubElement(body, "site", {"name": "tip"})


def _add_springs(tendons: ET.Element, at: Linearised) -> None:
    """Add three springs per level with the energy q H q / 2, where H = L D L^T are the second
    derivatives by its freedoms: D holds stiffnesses, and L each spring's length by freedom.

    Stiffer springs keep both halves of a tilt equal: MuJoCo's equality constraints ignore dampers,
    and diverge with masses this small.
    """
    lower = np.linalg.cholesky(at.matrices)
    roots = np.diagonal(lower, axis1=1, axis2=2)
    for level, (columns, stiffnesses) in enumerate(
        zip(lower / roots[:, None], roots**2, strict=True), start=1
    ):
        lengths = at.freedoms[level - 1] @ columns
        for spring, ways, stiffness, length in zip(
            SPRINGS, columns.T, stiffnesses, lengths, strict=True
        ):
            tendon = _damped(tendons, f"level{level}_{spring}", stiffness, length)
            _add_joints(tendon, level, ways)
        for joints in FREEDOMS[1:]:
            name = f"level{level}_{joints[0]}_halves"
            tendon = _damped(tendons, name, MIRROR * float(stiffnesses[1:].max()), 0.0)
            for joint, sign in zip(joints, ("1", "-1"), strict=True):
                ET.SubElement(tendon, "joint", {"joint": f"level{level}_{joint}", "coef": sign})


def _damped(tendons: ET.Element, name: str, stiffness: float, length: float) -> ET.Element:
    """Add a spring with its damper, without joints yet."""
    parts = {
        "name": name,
        "stiffness": number(stiffness),
        "damping": number(stiffness * SETTLING),
        "springlength": number(round(length, 12)),
    }
    return ET.SubElement(tendons, "fixed", parts)


def _add_joints(tendon: ET.Element, level: int, ways: Array) -> None:
    """Add the joints of one level to a tendon's length, by its freedoms (3,)."""
    # Ignore coefficients that are only rounding.
    least = 1e-9 * float(np.abs(ways).max())
    for joints, way in zip(FREEDOMS, ways.tolist(), strict=True):
        for joint in joints if abs(way) > least else ():
            parts = {"joint": f"level{level}_{joint}", "coef": number(way)}
            ET.SubElement(tendon, "joint", parts)


def _add_chambers(tendons: ET.Element, at: Linearised) -> None:
    """Add a tendon per chamber: its length grows like the chamber's volume, in ul."""
    for chamber, rates in enumerate(at.filling, start=1):
        tendon = ET.SubElement(tendons, "fixed", {"name": f"chamber{chamber}"})
        for level, ways in enumerate(rates, start=1):
            _add_joints(tendon, level, ways)


def _add_controls(actuator: ET.Element, stack: Stack, pose: Pose, span: float) -> None:
    for chamber, pressure in enumerate(pose.pressures, start=1):
        ends = np.clip((pressure - span, pressure + span), 0.0, stack.most_pressure) - pressure
        parts = {"name": f"chamber{chamber}", "tendon": f"chamber{chamber}"}
        parts |= {"ctrllimited": "true", "ctrlrange": numbers(ends)}
        ET.SubElement(actuator, "motor", parts)


def _listed(pressures: Sequence[float]) -> str:
    return ", ".join(f"{pressure:g}" for pressure in pressures)


def _note(name: str, stack: Stack, pose: Pose, span: float) -> str:
    share = f"{100 * ACCURACY:g} %"
    valid = (
        f"ctrl of a chamber is by how many kPa it is above that. At {span:g} kPa more or less,\n"
        f"each chamber alone or all together, the tip settles within {share} of the stack's\n"
        f"length ({length_of(pose):.4g} mm) of the elastic stack's place."
        if span
        else "Balloons change so much with pressure there that no range of it keeps the tip\n"
        f"within {share} of the stack's length: there are no controls."
    )
    mass = "the films'" if stack.weight is not None else f"{MASS:g} kg, for a film has no density"
    return f"""\
{name}: rigid plates on springs for MuJoCo, for {_listed(pose.pressures)} kPa in its chambers.
Units: mm, kg, s; so force mN, pressure kPa, volume ul.
It settles there, with the tip at {numbers(np.round(pose.tip, 4))} mm and bent by
{pose.bend:.1f} degrees; so it starts in the key "{POSE}", else flat.
{valid}
Springs are the elastic stack's second derivatives at that pose, for small motions and loads about
it; rims that meet or part are not in it. The length of tendon chamber<i> grows with its volume.
A plate's mass is {mass}. Dampers settle each level in some {SETTLING:g} s,
as no actuator does: states at rest alone mean something. Not in it: gravity, contact."""


class PressedChain:
    """A loaded model of ``chain_text`` driven by a stack's balloons at any pressures.

    The springs of the file are valid about one pose. Here they are removed, and each step applies
    the forces of the stack's own springs, contacts included, at the joints' values: states at rest
    are poses of the stack up to its highest pressure. Dampers follow the stiffness: soft motions
    settle later than stiff ones, and a slack stack without pressure hardly settles.
    """

    def __init__(self, model: Any, stack: Stack) -> None:
        """Remove the springs and the actuators' gear from ``model``, a mujoco.MjModel."""
        self.model, self.stack = model, stack
        count = len(stack.levels)
        names = [[f"level{level + 1}_{joint}" for joint in JOINTS] for level in range(count)]
        joints = np.array([[model.joint(name).id for name in row] for row in names])
        self.places, self.dofs = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        for level in range(count):
            for spring in SPRINGS:
                tendon = model.tendon(f"level{level + 1}_{spring}").id
                model.tendon_stiffness[tendon] = model.tendon_damping[tendon] = 0.0
        model.actuator_gear[:] = 0.0

    def apply(self, data: Any, pressures: Sequence[float]) -> None:
        """Set the forces of the next step, ``qfrc_applied`` of a mujoco.MjData, at pressures in
        kPa, one per chamber. Raises DesignError for pressures outside the stack's maps.
        """
        tilt_x, tilt_y, rise, tilt_y_upper, tilt_x_upper = data.qpos[self.places].T
        at = np.stack([rise, tilt_x + tilt_x_upper, tilt_y + tilt_y_upper], axis=-1)
        _, gradient, matrices = self.stack.each(self.stack.springs(pressures)).energy(at)
        # Both halves of a tilt carry its full moment, and each moves by half.
        data.qfrc_applied[self.dofs] = -gradient[:, BY_JOINT]
        stiff = np.einsum("lii->li", matrices)[:, BY_JOINT] * HALVES
        self.model.dof_damping[self.dofs] = DRIVEN_SETTLING * np.maximum(stiff, 0.0)
