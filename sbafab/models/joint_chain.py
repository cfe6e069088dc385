"""A stack as rigid links and joints, for programs of robots: joint values, limits, and URDF.

A level tilts by half, rises, and tilts by the other half: hinges about x and y, a slide along z,
hinges about y and x. The orders mirror each other, so that the twists of both halves cancel, and
plates stand as in ``stack_loads.plate_chain`` up to the third order of a level's tilt.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from typing import NamedTuple

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


def number(value: float) -> str:
    """Return nine digits, without a minus before a zero."""
    return f"{float(value) + 0.0:.9g}"


def numbers(values: Iterable[float]) -> str:
    """Return numbers with spaces between them."""
    return " ".join(map(number, values))


def document(root: ET.Element, note: str) -> str:
    """Return a file of XML that begins with a comment."""
    ET.indent(root, " ")
    # Two hyphens in a row would end the comment.
    text = note.replace("--", "- -")
    return f'<?xml version="1.0"?>\n<!--\n{text}\n-->\n{ET.tostring(root, encoding="unicode")}\n'


def plate_mass(stack: Stack) -> float | None:
    """Return the mass in kg of films that move with each plate, None if a density is unknown."""
    return None if stack.weight is None else stack.weight / GRAVITY / 1000


def disc_inertia(mass: float, radius: float, height: float) -> tuple[float, float]:
    """Return the moments of inertia of a disc about a diameter and about its axis."""
    return mass * (3 * radius**2 + height**2) / 12, mass * radius**2 / 2


class _Limits(NamedTuple):
    """Largest rise of a level in mm and tilt in rad, and the largest force in N and moment in N mm
    that its balloons have there.
    """

    rise: float
    tilt: float
    force: float
    moment: float


def _limits(stack: Stack, kind: int) -> _Limits:
    """Return the limits of a level. At the largest tilt for any rise and direction, rims just meet
    on one side, and a balloon on the other side is as high as its map.
    """
    balloon = stack.maps[kind]
    turns = np.radians(np.arange(360))
    ways = np.stack([np.cos(turns), np.sin(turns)])
    # Gaps by tilt are y and -x.
    rims = stack.rims[kind][:, [2, 1]] * (-1, 1)
    across = (-(rims @ ways)).max(0) + (stack.axes @ ways).max(0)
    force = stack.chambers * float(balloon.force(balloon.most_pressure, 0.0)) / 1000
    tilt = balloon.most_height / float(across.min())
    return _Limits(balloon.most_height, tilt, force, force * stack.outline)


def urdf_text(name: str, stack: Stack) -> str:
    """Return a stack as URDF, in m, kg and rad: ``plate_<i>`` ends level i, the last is the tip."""
    root = ET.Element("robot", {"name": name})
    ET.SubElement(root, "link", {"name": "plate_0"})
    mass = plate_mass(stack)
    for level, kind in enumerate(stack.levels.tolist(), start=1):
        limits, parent = _limits(stack, kind), f"plate_{level - 1}"
        for joint in JOINTS:
            title = f"level{level}_{joint}"
            child = f"plate_{level}" if joint == JOINTS[-1] else f"{title}_link"
            link = ET.SubElement(root, "link", {"name": child})
            if mass is not None:
                _add_mass(link, stack, mass / len(JOINTS))
            if joint == JOINTS[-1]:
                _add_plate(link, stack)
            _add_joint(root, title, joint, (parent, child), limits, stack.pitch)
            parent = child
    return document(root, _note(name, stack, mass))


def _add_joint(
    root: ET.Element,
    title: str,
    joint: str,
    links: tuple[str, str],
    limits: _Limits,
    pitch: float,
) -> None:
    slides = joint == "rise"
    element = ET.SubElement(
        root, "joint", {"name": title, "type": "prismatic" if slides else "revolute"}
    )
    ET.SubElement(element, "parent", {"link": links[0]})
    ET.SubElement(element, "child", {"link": links[1]})
    if slides:
        ET.SubElement(element, "origin", {"xyz": numbers((0, 0, pitch / 1000)), "rpy": "0 0 0"})
    ET.SubElement(element, "axis", {"xyz": axis_of(joint)})
    # Both hinges of a tilt have half of it.
    ends = (0.0, limits.rise / 1000) if slides else (-limits.tilt / 2, limits.tilt / 2)
    effort = limits.force if slides else limits.moment / 1000
    limit = {"lower": ends[0], "upper": ends[1], "effort": effort, "velocity": VELOCITY}
    ET.SubElement(element, "limit", {key: number(value) for key, value in limit.items()})
    if joint.endswith(UPPER):
        ET.SubElement(element, "mimic", {"joint": title.removesuffix(UPPER)})


def _add_mass(link: ET.Element, stack: Stack, mass: float) -> None:
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "mass", {"value": number(mass)})
    across, along = disc_inertia(mass, stack.outline / 1000, stack.pitch / 1000)
    moments = {"ixx": across, "ixy": 0, "ixz": 0, "iyy": across, "iyz": 0, "izz": along}
    each = {key: number(value) for key, value in moments.items()}
    ET.SubElement(inertial, "inertia", each)


def _add_plate(link: ET.Element, stack: Stack) -> None:
    height = stack.pitch / 1000
    visual = ET.SubElement(link, "visual")
    ET.SubElement(visual, "origin", {"xyz": numbers((0, 0, -height / 2)), "rpy": "0 0 0"})
    size = {"radius": number(stack.outline / 1000), "length": number(height)}
    ET.SubElement(ET.SubElement(visual, "geometry"), "cylinder", size)


def _note(name: str, stack: Stack, mass: float | None) -> str:
    tilts = [math.degrees(_limits(stack, kind).tilt) for kind in set(stack.levels.tolist())]
    masses = (
        "not known, a film has no density"
        if mass is None
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
