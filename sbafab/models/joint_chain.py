"""A stack as rigid links and joints, for programs of robots: joint values, limits, and URDF.

A level tilts by half, rises, and tilts by the other half: hinges about x and y, a slide along z,
hinges about y and x. The orders mirror each other, so that the twists of both halves cancel, and
plates stand as in ``stack_loads.plate_chain`` up to the third order of a level's tilt.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import numpy as np

from sbafab.models.film_elements import Array
from sbafab.models.stack import GRAVITY, Stack

JOINTS = ("tilt_x", "tilt_y", "rise", "tilt_y_upper", "tilt_x_upper")
"""Joints of a level from its lower plate up; the name of each begins with its level's."""
AXES = {"x": "1 0 0", "y": "0 1 0", "e": "0 0 1"}
UPPER = "_upper"
"""Suffix of the hinges above the rise; each follows its counterpart below."""
VELOCITY = 1.0
"""Placeholder velocity limits, m/s and rad/s: URDF requires them, lines and valves set them."""


def joint_values(freedoms: Array) -> Array:
    """Return the values (levels, 5) of JOINTS, mm and rad, by rise and tilt (levels, 3)."""
    rise, x, y = np.asarray(freedoms, dtype=float).T
    return np.stack([x / 2, y / 2, rise, y / 2, x / 2], axis=-1)


def axis_of(joint: str) -> str:
    """Return the axis of one of JOINTS in the frame below it."""
    return AXES[joint.removesuffix(UPPER)[-1]]


def plate_mass(stack: Stack) -> float | None:
    """Return the mass in kg of films that move with each plate, None if a density is unknown."""
    return None if stack.weight is None else stack.weight / GRAVITY / 1000


def disc_inertia(mass: float, radius: float, height: float) -> tuple[float, float]:
    """Return the moments of inertia of a disc about a diameter and about its axis."""
    return mass * (3 * radius**2 + height**2) / 12, mass * radius**2 / 2


def _limits(stack: Stack, kind: int) -> tuple[float, float, float]:
    """Return the largest rise of a level in mm and tilt in rad, and the largest force in N.

    At the largest tilt for any rise and direction, rims just meet on one side, and a balloon on the
    other side is as high as its map.
    """
    balloon = stack.maps[kind]
    turns = np.radians(np.arange(360))
    ways = np.stack([np.cos(turns), np.sin(turns)])
    # Gaps by tilt are y and -x.
    rims = stack.rims[kind][:, [2, 1]] * (-1, 1)
    across = (-(rims @ ways)).max(0) + (stack.axes @ ways).max(0)
    force = stack.chambers * float(balloon.force(balloon.most_pressure, 0.0)) / 1000
    return balloon.most_height, balloon.most_height / float(across.min()), force


def urdf_text(name: str, stack: Stack) -> str:
    """Return a stack as URDF, in m, kg and rad: ``plate_<i>`` ends level i, the last is the tip."""
    root = ET.Element("robot", {"name": name})
    _add(root, "link", name="plate_0")
    for level, kind in enumerate(stack.levels.tolist(), start=1):
        limits, parent = _limits(stack, kind), f"plate_{level - 1}"
        for joint in JOINTS:
            title, is_plate = f"level{level}_{joint}", joint == JOINTS[-1]
            child = f"plate_{level}" if is_plate else f"{title}_link"
            _add_link(root, child, stack, is_plate)
            _add_joint(root, title, joint, (parent, child), limits, stack)
            parent = child
    ET.indent(root, " ")
    # Two hyphens in a row would end the comment.
    note = _note(name, stack).replace("--", "- -")
    return f'<?xml version="1.0"?>\n<!--\n{note}\n-->\n{ET.tostring(root, encoding="unicode")}\n'


def _add(parent: ET.Element, tag: str, **attributes: str | float) -> ET.Element:
    """Add an element; numbers get nine digits, without a minus before a zero."""
    texts = {
        key: value if isinstance(value, str) else f"{float(value) + 0.0:.9g}"
        for key, value in attributes.items()
    }
    return ET.SubElement(parent, tag, texts)


def _add_joint(
    root: ET.Element,
    title: str,
    joint: str,
    links: tuple[str, str],
    limits: tuple[float, float, float],
    stack: Stack,
) -> None:
    slides, (rise, tilt, force) = joint == "rise", limits
    element = _add(root, "joint", name=title, type="prismatic" if slides else "revolute")
    _add(element, "parent", link=links[0])
    _add(element, "child", link=links[1])
    if slides:
        _add(element, "origin", xyz=f"0 0 {stack.pitch / 1000:.9g}", rpy="0 0 0")
    _add(element, "axis", xyz=axis_of(joint))
    # Both hinges of a tilt have half of it.
    lower, upper = (0.0, rise / 1000) if slides else (-tilt / 2, tilt / 2)
    effort = force if slides else force * stack.outline / 1000
    _add(element, "limit", lower=lower, upper=upper, effort=effort, velocity=VELOCITY)
    if joint.endswith(UPPER):
        _add(element, "mimic", joint=title.removesuffix(UPPER))


def _add_link(root: ET.Element, name: str, stack: Stack, is_plate: bool) -> None:
    """Add a link with its share of the level's mass; a plate is seen."""
    link, mass = _add(root, "link", name=name), plate_mass(stack)
    radius, height = stack.outline / 1000, stack.pitch / 1000
    if mass is not None:
        inertial, share = _add(link, "inertial"), mass / len(JOINTS)
        _add(inertial, "mass", value=share)
        across, along = disc_inertia(share, radius, height)
        _add(inertial, "inertia", ixx=across, ixy=0, ixz=0, iyy=across, iyz=0, izz=along)
    if is_plate:
        visual = _add(link, "visual")
        _add(visual, "origin", xyz=f"0 0 {-height / 2:.9g}", rpy="0 0 0")
        _add(_add(visual, "geometry"), "cylinder", radius=radius, length=height)


def _note(name: str, stack: Stack) -> str:
    tilts = [math.degrees(_limits(stack, kind)[1]) for kind in set(stack.levels.tolist())]
    masses = (
        "not known, a film has no density"
        if stack.weight is None
        else "the films', a fifth of a level's on each of its links"
    )
    return f"""\
{name}: the kinematic chain of {len(stack.levels)} levels of balloons, in m, kg, rad, N.
plate_0 is the base, plate_{len(stack.levels)} the tip. A level tilts about x and y by half, rises,
and tilts by the other half, which mimics the first: 3 freedoms a level.
Limits are those of the balloons' map to {stack.most_pressure:g} kPa. At the largest tilt of a level
({max(tilts):.3g} degrees) rims just meet at one side while a balloon is as high as its map at the
other; at other rises or in other directions less is allowed, which URDF cannot say.
Efforts are the balloons' at that pressure; velocities of {VELOCITY:g} stand in, for lines and
valves set them. Masses: {masses}.
Which values hold at which pressures is not in this file: sbafab.stack(...).pose(pressures)."""
