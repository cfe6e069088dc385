"""The kinematic chain of a stack, read by yourdfpy: plates stand as in the stack's pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sbafab
from sbafab.models.joint_chain import JOINTS, UPPER, joint_values
from sbafab.models.map_files import map_text

yourdfpy = pytest.importorskip("yourdfpy", reason="yourdfpy is not installed")


@pytest.mark.parametrize("pressures", [(0.0, 0.0, 0.0), (5.0, 5.0, 5.0), (0.3, 0.1, 0.0)])
def test_its_forward_kinematics_are_the_pose(
    pressures: tuple[float, float, float], tmp_path: Path
) -> None:
    """A level's joints follow the plates up to the third order of its tilt."""
    stack = sbafab.stack("3dof-15mm", "stack.balloons=5")
    path = tmp_path / "stack.urdf"
    path.write_text(map_text("stack", stack, "urdf"), encoding="utf-8")
    robot = yourdfpy.URDF.load(str(path), load_meshes=False)
    pose = stack.pose(pressures)
    values = joint_values(pose.freedoms)
    values[:, JOINTS.index("rise")] /= 1000
    robot.update_cfg(
        {
            f"level{level}_{joint}": value
            for level, row in enumerate(values.tolist(), start=1)
            for joint, value in zip(JOINTS, row, strict=True)
            if not joint.endswith(UPPER)
        }
    )
    origins, axes = pose.frames
    tilt = float(np.abs(pose.freedoms[:, 1:]).max())
    assert (tilt > 0.02) == (pressures[0] != pressures[2])
    for level in range(1, 6):
        frame = robot.get_transform(f"plate_{level}", "plate_0")
        assert 1000 * frame[:3, 3] == pytest.approx(origins[level], abs=1e-6 + 2 * level * tilt**3)
        assert frame[:3, :3] == pytest.approx(axes[level], abs=1e-6 + level * tilt**3)
