from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sbafab.actuators import build, load_design
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.formats import write_meshes
from sbafab.meshing.solid import MASKLESS_GAP, cavity_slabs, solid, solid_slabs


@pytest.fixture(scope="module")
def lobed() -> Laminate:
    return build(load_design("3dof-15mm", ["stack.balloons=3"]))


def digests(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_a_lobed_design_gives_a_solid_in_three_formats_and_a_cavity_a_chamber(
    lobed: Laminate, tmp_path: Path
) -> None:
    told: list[tuple[int, int]] = []
    meshes, left_out = write_meshes(lobed, tmp_path, progress=lambda *counts: told.append(counts))
    assert left_out == []
    names = ["solid.stl", "solid.3mf", "solid.glb"]
    names += [f"cavity_{chamber.name}.stl" for chamber in lobed.chambers]
    assert [mesh.file for mesh in meshes] == [f"mesh/{name}" for name in names]
    assert sorted(digests(tmp_path)) == sorted(names)
    assert told == [(done, 6) for done in range(1, 7)]
    assert [mesh.kind for mesh in meshes] == ["solid"] * 3 + ["cavity"] * 3
    assert [mesh.chamber for mesh in meshes[3:]] == [c.name for c in lobed.chambers]


def test_the_lumen_and_three_necks_a_joint_are_the_only_handles(lobed: Laminate) -> None:
    surface = solid(lobed)
    # Lumen: one. Each of the two joints between balloons adds three neck rings round a lumen
    # that opens between them.
    handles = 1 + 3 * (lobed.balloons - 1)
    assert len(surface.points) - len(surface.faces) // 2 == 2 - 2 * handles


def test_the_outline_stays_within_a_micrometre(lobed: Laminate) -> None:
    points = solid(lobed).points
    # Above the tabs of the bottom balloon the plates fit a circle of 15 mm.
    reach = np.hypot(*points[points[:, 2] > 0.2, :2].T).max()
    assert reach == pytest.approx(7.5, abs=0.00101)


TWO_WELDED = """
name = "two"
family = "drawn"
layers = [
  {role = "base", shape = "film", film = "f1"},
  {role = "cap", shape = "holed", film = "f2"},
  {role = "base", shape = "holed", film = "f3"},
  {role = "cap", shape = "film", film = "f4"},
]
chambers = [{name = "c", centres = [[0, 0]], mouth = [0, 30], angle = 90, width = 2.1}]
face_bonds.aa = {faces = ["a", "a"], by = "hot-tip", temperature_c = 180}
face_bonds.bb = {faces = ["b", "b"], by = "laser", temperature_c = 150}
[shapes]
film = {polygon = [[-20, -15], [20, -15], [20, 30], [-20, 30]]}
hole = {disc = 2}
holed = {difference = ["film", "hole"]}
[[seams]]
name = "low"
layers = [1, 2]
width = 1.5
tool = "hot-tip"
path = [[-1.8, 31], [-1.8, 10], [-12, 10], [-12, -10], [12, -10], [12, 10], [1.8, 10], [1.8, 31]]
[[seams]]
name = "neck"
layers = [2, 3]
width = 1.5
tool = "laser"
closed = true
path = [[-3, -3], [3, -3], [3, 3], [-3, 3]]
[[seams]]
name = "up"
layers = [3, 4]
width = 1.5
tool = "hot-tip"
closed = true
path = [[-9, -8], [9, -8], [9, 8], [-9, 8]]
"""
FACES = {"f1": "an", "f2": "ba", "f3": "ab", "f4": "na"}


def test_the_cavity_of_welded_balloons_lies_within_their_seams(tmp_path: Path) -> None:
    films = "".join(
        f'[films.{name}]\nkind = "structural"\nproduct = "coated"\nthickness = 0.1\n'
        f'melting_point = 110\nfaces = {{upper = "{upper}", lower = "{lower}"}}\n'
        for name, (upper, lower) in FACES.items()
    )
    (tmp_path / "two.toml").write_text(TWO_WELDED + films)
    laminate = build(load_design(tmp_path / "two.toml"))
    meshes, left_out = write_meshes(laminate, tmp_path)
    assert left_out == []
    # Between the inner edges of the seams: below 22.5 x 18.5 and a channel of 2.1 from y = 9.25 to
    # the mouth, at the neck 4.5 x 4.5, above 16.5 x 14.5; and two holes of 2 through 0.1 of film.
    gaps = 22.5 * 18.5 + 2.1 * (30 - 9.25) + 4.5**2 + 16.5 * 14.5
    expected = gaps * MASKLESS_GAP + 2 * math.pi * 0.1
    assert meshes[-1].volume_mm3 == pytest.approx(expected, rel=5e-4)


TEMPLATES = ["1dof-5mm", "radial-15mm"]


@pytest.mark.parametrize("template", TEMPLATES)
def test_volumes_are_the_sums_of_area_times_thickness(template: str, tmp_path: Path) -> None:
    laminate = build(load_design(template))
    meshes, _ = write_meshes(laminate, tmp_path)
    expected = [sum(slab.volume for slab in solid_slabs(laminate))] * 3
    for chamber in laminate.chambers:
        expected.append(sum(slab.volume for slab in cavity_slabs(laminate, chamber)))
    flat = [mesh.volume_mm3 for mesh in meshes if "wrapped" not in mesh.file]
    assert flat == pytest.approx(expected, rel=5e-4)


def test_same_bytes_again_under_another_hash_seed_and_time_zone(
    lobed: Laminate, tmp_path: Path
) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    write_meshes(lobed, here)
    script = (
        "import sys; from pathlib import Path\n"
        "from sbafab.actuators import build, load_design\n"
        "from sbafab.meshing.formats import write_meshes\n"
        "laminate = build(load_design('3dof-15mm', ['stack.balloons=3']))\n"
        "write_meshes(laminate, Path(sys.argv[1]))\n"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "4711", "TZ": "Asia/Tokyo"}
    root = Path(__file__).parents[2]
    subprocess.run([sys.executable, "-c", script, there], check=True, env=environment, cwd=root)
    assert digests(here) == digests(there)
