"""The model for MuJoCo, and what stands beside it."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import sbafab
from sbafab.errors import DesignError
from sbafab.simulators.coarse.shell import actuator
from sbafab.simulators.mujoco.model import model_text, why_no_model, write_model

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")

BALLOON = ("1dof-5mm", "stack.balloons=1")
LOBED = ("3dof-15mm", "stack.balloons=2")


def written(folder: Path, *design: str) -> Path:
    """The model with rings of eight nodes."""
    return write_model(sbafab.build(*design), folder, sectors=8)[0]


def test_the_files_are_those_named(tmp_path: Path) -> None:
    files = write_model(sbafab.build(*LOBED), tmp_path / "mujoco", {"chamber2": 3})
    assert [file.name for file in files] == ["actuator.xml", "actuator.json", "inflate.py"]
    assert sorted(files) == sorted((tmp_path / "mujoco").iterdir())
    data = json.loads(files[1].read_text())
    assert data["pressures"] == {"chamber1": 0, "chamber2": 3, "chamber3": 0}
    assert data["units"]["pressure"] == "kPa"
    compile(files[2].read_text(), "inflate.py", "exec")


@pytest.mark.parametrize("design", [BALLOON, LOBED, ("1dof-10mm",), ("1dof-5mm",)], ids=" ".join)
def test_mujoco_reads_the_mesh_as_it_was_meant(tmp_path: Path, design: tuple[str, ...]) -> None:
    """Node i is body i + 1: flat at qpos0, where MuJoCo takes its lengths, inflated in the key.

    The model's lengths are cm.
    """
    mesh = actuator(sbafab.build(*design)).mesh
    model = mujoco.MjModel.from_xml_path(str(written(tmp_path, *design)))
    state = mujoco.MjData(model)
    mujoco.mj_kinematics(model, state)
    assert 10 * state.xpos[1:] == pytest.approx(np.array(mesh.rest), abs=1e-7)
    mujoco.mj_resetDataKeyframe(model, state, model.key("inflated").id)
    mujoco.mj_kinematics(model, state)
    still = model.body_dofnum[1:, None] == 0
    expected = np.where(still, mesh.rest, mesh.position)
    assert 10 * state.xpos[1:] == pytest.approx(expected, abs=1e-7)
    assert model.nflexelem == len(mesh.single) + len(mesh.double)
    bodies = model.flex_vertbodyid - 1
    corners = model.flex_elem.reshape(-1, 3)
    first = np.repeat(model.flex_vertadr, model.flex_elemnum)
    read = {tuple(map(int, bodies[t + start])) for t, start in zip(corners, first, strict=True)}
    assert read == set(mesh.single + mesh.double)


def test_the_film_is_the_design_s(tmp_path: Path) -> None:
    """E t of a film (paper, Sec. 3.2.1), twice that where two are bonded, and their mass."""
    path = written(tmp_path, "1dof-5mm", "stack.balloons=2", "films.tpe.thickness=0.05")
    told = {
        flex.attrib["name"]: next(flex.iter("elasticity")).attrib
        for flex in ET.parse(path).getroot().iter("flex")
    }
    stretch = {name: float(e["young"]) * float(e["thickness"]) for name, e in told.items()}
    expected = {"lower": 500, "upper": 500, "web": 1000, "necks": 1000}
    assert stretch == pytest.approx(expected)
    assert {(e["poisson"], e["elastic2d"]) for e in told.values()} == {("0.2", "both")}


def test_the_mass_is_that_of_the_films(tmp_path: Path) -> None:
    """Of a balloon: two octagons round the plate, less what is held at its centre."""
    model = mujoco.MjModel.from_xml_path(str(written(tmp_path, *BALLOON)))
    octagon = 4 * math.sin(math.tau / 8)
    plate = octagon * 3.25**2 * 0.038 * 1122e-9
    centre = octagon * 0.5**2 / 3 * 0.038 * 1122e-9
    assert model.body_mass.sum() == pytest.approx(2 * plate - centre, rel=1e-6)


def test_the_base_stands_still_and_a_lone_balloon_is_held_at_its_centre(tmp_path: Path) -> None:
    stack = mujoco.MjModel.from_xml_path(str(written(tmp_path / "stack", *LOBED)))
    assert (stack.body_dofnum[1:] == 0).sum() == 3 * 17
    balloon = mujoco.MjModel.from_xml_path(str(written(tmp_path / "balloon", *BALLOON)))
    assert np.flatnonzero(balloon.body_dofnum[1:] == 0).tolist() == [0]
    assert balloon.opt.gravity.tolist() == [0, 0, 0]


def test_finer_rings_have_more_nodes(tmp_path: Path) -> None:
    laminate = sbafab.build(*BALLOON)
    nodes = [
        mujoco.MjModel.from_xml_path(str(write_model(laminate, tmp_path, None, n)[0])).nbody
        for n in (8, 16)
    ]
    # The world and the two centres are not in a ring.
    assert nodes[1] - 3 == 2 * (nodes[0] - 3)


def test_same_bytes_twice(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_model(sbafab.build(*LOBED), tmp_path / name)
    for file in sorted((tmp_path / "a").iterdir()):
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


def test_a_name_with_two_hyphens_is_no_end_of_a_comment() -> None:
    made = actuator(sbafab.build(*BALLOON, "name=a--b"))
    assert mujoco.MjModel.from_xml_string(model_text(made)).nflex == 3


def test_unsuited_designs_are_refused_with_the_reason(tmp_path: Path) -> None:
    radial = sbafab.build("radial-15mm")
    assert "lie on a sheet" in (why_no_model(radial) or "")
    with pytest.raises(DesignError, match="lie on a sheet"):
        write_model(radial, tmp_path)
    with pytest.raises(DesignError, match="names chamber left, which is not there"):
        write_model(sbafab.build(*BALLOON), tmp_path, {"left": 3})
    assert list(tmp_path.iterdir()) == []
