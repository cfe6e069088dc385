"""The kinematic chain as URDF, read as XML and moved by hand."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

import sbafab
from sbafab.laminate.laminate import film_mass
from sbafab.models.map_files import map_text
from sbafab.models.stack import Stack
from sbafab.models.stack_loads import plate_chain

LOBED = ("3dof-15mm", "stack.balloons=5", "models.calibration=none")


@pytest.fixture(scope="module")
def lobed() -> Stack:
    return sbafab.stack(*LOBED)


@pytest.fixture(scope="module")
def robot(lobed: Stack) -> ET.Element:
    return ET.fromstring(map_text("lobed", lobed, "urdf"))


def placed(robot: ET.Element, values: dict[str, float]) -> np.ndarray:
    """Return the frame (4, 4) of the last link, in m, at values of the joints that mimic none."""
    joints = {joint.find("parent").get("link"): joint for joint in robot.iter("joint")}
    frame, link = np.eye(4), "plate_0"
    while link in joints:
        joint = joints[link]
        mimic = joint.find("mimic")
        value = values[joint.get("name") if mimic is None else mimic.get("joint")]
        move = np.eye(4)
        origin = joint.find("origin")
        if origin is not None:
            assert origin.get("rpy") == "0 0 0"
            move[:3, 3] = [float(x) for x in origin.get("xyz").split()]
        axis = np.array([float(x) for x in joint.find("axis").get("xyz").split()])
        turn = np.eye(4)
        if joint.get("type") == "prismatic":
            turn[:3, 3] = value * axis
        else:
            # Rodrigues' formula, with the vector product as a matrix.
            cross = np.cross(np.eye(3), axis)
            turn[:3, :3] += math.sin(value) * cross + (1 - math.cos(value)) * cross @ cross
        frame = frame @ move @ turn
        link = joint.find("child").get("link")
    assert link == "plate_5"
    return frame


def values_of(freedoms: np.ndarray) -> dict[str, float]:
    names = (("rise", 0.001), ("tilt_x", 0.5), ("tilt_y", 0.5))
    return {
        f"level{level}_{name}": share * value
        for level, row in enumerate(freedoms.tolist(), start=1)
        for (name, share), value in zip(names, row, strict=True)
    }


@pytest.mark.parametrize("column", [1, 2])
def test_tip_of_a_plane_bend_is_that_of_the_stack(
    lobed: Stack, robot: ET.Element, column: int
) -> None:
    freedoms = np.zeros((5, 3))
    freedoms[:, 0] = 0.5, 0.2, 0.9, 0.1, 1.1
    freedoms[:, column] = 0.12, -0.03, 0.08, 0.15, 0.02
    frame = placed(robot, values_of(freedoms))
    # By hand: each level is a straight step at the middle of its turn.
    before = np.cumsum(freedoms[:, column]) - freedoms[:, column] / 2
    steps = freedoms[:, 0] + lobed.pitch
    aside, up = float(steps @ np.sin(before)), float(steps @ np.cos(before))
    tip = (0, -aside, up) if column == 1 else (aside, 0, up)
    assert 1000 * frame[:3, 3] == pytest.approx(tip, abs=1e-6)
    plates = plate_chain(freedoms, lobed.pitch)
    assert 1000 * frame[:3, 3] == pytest.approx(plates.places[-1], abs=1e-6)


def test_plates_of_any_bend_stand_as_in_the_stack(lobed: Stack, robot: ET.Element) -> None:
    """Up to the third order of a tilt: 0.1 rad in a level."""
    freedoms = np.array(
        [[0.5, 0.1, 0.05], [0.2, -0.08, 0.1], [0.9, 0.1, -0.1], [0.1, 0.0, 0.1], [1.1, 0.1, 0.1]]
    )
    frame = placed(robot, values_of(freedoms))
    plates = plate_chain(freedoms, lobed.pitch)
    assert 1000 * frame[:3, 3] == pytest.approx(plates.places[-1], abs=2e-3)
    assert frame[:3, :3] == pytest.approx(plates.axes[-1], abs=1e-3)


def test_limits_are_those_of_the_map(lobed: Stack, robot: ET.Element) -> None:
    highest = lobed.maps[0].most_height
    limits = {joint.get("name"): joint.find("limit") for joint in robot.iter("joint")}
    assert len(limits) == 25
    assert float(limits["level3_rise"].get("upper")) == pytest.approx(highest / 1000)
    # Paper, Sec. 2: axes 4.25 from the middle; films reach 0.75 beyond pockets of 2.5. Bent
    # towards a chamber, two others' rims meet, at half their axes' distance; rims are points 15
    # degrees apart.
    tilt = highest / (4.25 + 4.25 / 2 + 3.25)
    for name in ("level3_tilt_x", "level3_tilt_x_upper", "level5_tilt_y"):
        ends = [float(limits[name].get(end)) for end in ("lower", "upper")]
        assert ends == pytest.approx([-tilt / 2, tilt / 2], rel=5e-3)


def test_masses_are_the_films(robot: ET.Element) -> None:
    masses = [float(mass.get("value")) for mass in robot.iter("mass")]
    assert len(masses) == 25
    assert sum(masses) == pytest.approx(film_mass(sbafab.build(*LOBED)) / 1000)


def test_a_film_without_density_has_no_masses(lobed: Stack) -> None:
    text = map_text("light", replace(lobed, weight=None), "urdf")
    assert "Masses: not known" in text
    assert not list(ET.fromstring(text).iter("inertial"))
