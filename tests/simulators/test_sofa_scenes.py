"""The scenes, held against what SOFA 25.06 knows and against the numbers that ran."""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ET
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import sbafab
from sbafab.errors import DesignError
from sbafab.simulators.coarse.shell import actuator
from sbafab.simulators.sofa.scenes import (
    beam_of,
    document,
    pair_of_frames,
    prism,
    root_node,
    scaled_mass,
    write_scenes,
)
from sbafab.simulators.sofa.shell import conforming_shell, round_actuator, round_shell

FACTS = json.loads(Path(__file__).with_name("sofa_components.json").read_text(encoding="utf-8"))
SCENES = ("actuator.scn", "actuator_frames.scn", "actuator_volume.scn", "actuator_beam.scn")
NODE_FIELDS = {"name", "dt", "gravity"}
CORE = "Sofa.Simulation.Core"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("sofa")
    write_scenes(sbafab.build("3dof-15mm"), made)
    return made


@cache
def parsed(path: Path) -> ET.Element:
    return ET.parse(path).getroot()


@pytest.fixture(params=SCENES)
def scene(request: pytest.FixtureRequest, folder: Path) -> ET.Element:
    return parsed(folder / request.param)


def known_fields(component: str) -> set[str]:
    return set(FACTS["components"][component]["attributes"])


def numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def every(scene: ET.Element, component: str, field: str) -> list[float]:
    return [float(element.attrib[field]) for element in scene.iter(component)]


def node_count(path: list[ET.Element]) -> int:
    """Nodes of the nearest MechanicalObject, from a node upward."""
    for node in reversed(path):
        state = node.find("MechanicalObject")
        if state is not None:
            size = 7 if state.attrib["template"] == "Rigid3d" else 3
            return len(state.attrib["position"].split()) // size
    raise AssertionError("no MechanicalObject")


def walk(node: ET.Element, path: list[ET.Element]) -> Any:
    path = [*path, node]
    for element in node:
        if element.tag == "Node":
            yield from walk(element, path)
        else:
            yield path, element


def test_components_and_fields_are_sofa_s(scene: ET.Element) -> None:
    for element in scene.iter():
        if element.tag == "Node":
            assert set(element.attrib) <= NODE_FIELDS
        else:
            assert set(element.attrib) <= known_fields(element.tag), element.tag


def test_every_module_is_required_and_no_other(scene: ET.Element) -> None:
    used = {FACTS["components"][e.tag]["module"] for e in scene.iter() if e.tag != "Node"}
    required = [e.attrib["name"] for e in scene.iter("RequiredPlugin")]
    assert required == sorted(used - {CORE})


def test_only_the_volume_scene_needs_a_plugin_of_others(folder: Path) -> None:
    needing = [
        name
        for name in SCENES
        if "SoftRobots" in {e.attrib["name"] for e in parsed(folder / name).iter("RequiredPlugin")}
    ]
    assert needing == ["actuator_volume.scn"]


def test_indices_point_at_nodes(scene: ET.Element) -> None:
    seen = 0
    for path, element in walk(scene, []):
        fields = {
            "TriangleSetTopologyContainer": "triangles",
            "FixedProjectiveConstraint": "indices",
            "MeshTopology": "edges",
        }
        if element.tag in fields:
            count, indices = node_count(path), numbers(element.attrib[fields[element.tag]])
        elif element.tag == "SubsetMapping":
            count, indices = node_count(path[:-1]), numbers(element.attrib["indices"])
        elif element.tag == "SkinningMapping":
            count = node_count(path[:-1])
            indices = [float(i) for i in re.findall(r"\d+", element.attrib["indices"])]
            assert len(indices) == 2 * node_count(path)
        elif element.tag == "RigidMapping":
            count, indices = node_count(path[:-1]), numbers(element.attrib["rigidIndexPerPoint"])
            assert len(indices) == node_count(path)
        else:
            continue
        seen += 1
        assert 0 <= min(indices) <= max(indices) < count, element.tag
    assert seen > 4


def test_links_resolve(scene: ET.Element) -> None:
    links = [
        (path, value)
        for path, element in walk(scene, [])
        for value in element.attrib.values()
        if value.startswith("@")
    ]
    assert len(links) >= 4
    for path, link in links:
        *ups, name = link[1:].split("/")
        assert set(ups) <= {".."}
        name, _, field = name.partition(".")
        node = path[len(path) - 1 - len(ups)]
        found = [e for e in node if e.attrib.get("name") == name and e.tag != "Node"]
        assert len(found) == 1, link
        assert not field or field in found[0].attrib


def test_the_shell_has_the_numbers_that_ran(folder: Path) -> None:
    scene = parsed(folder / "actuator.scn")
    assert scene.attrib["dt"] == "0.02"
    assert every(scene, "TriangularFEMForceFieldOptim", "youngModulus") == [380, 760]
    assert every(scene, "FastTriangularBendingSprings", "bendingStiffness") == [
        0.0476,
        0.0476,
        0.381,
        0.381,
    ]
    assert every(scene, "SurfacePressureForceField", "pressureLowerBound") == [4.999995] * 3
    assert every(scene, "SurfacePressureForceField", "useTangentStiffness") == [0, 0, 0]
    volume = parsed(folder / "actuator_volume.scn")
    assert every(volume, "SurfacePressureConstraint", "value") == [80, 80, 80]
    frames = parsed(folder / "actuator_frames.scn")
    assert frames.attrib["dt"] == "0.05"
    assert every(frames, "TriangularFEMForceFieldOptim", "youngModulus") == [45.6, 91.2]


@pytest.mark.parametrize("design", ["3dof-15mm", "1dof-10mm"])
def test_nodal_mass_follows_the_rule_that_held(design: str) -> None:
    """3 mN/mm a kPa for pockets of 5 mm, 8 at least."""
    for pressure, expected in ((10.0, 30.0), (1.0, 8.0)):
        made = round_actuator(sbafab.build(design), {"chamber1": pressure})
        size = made.stack.pockets[0] / 2.5
        nodal = scaled_mass(round_shell(made), 0.02) / len(made.mesh.rest)
        assert nodal / 0.02**2 == pytest.approx(max(8, 3 * pressure * size))
        assert size > 1 or nodal / 0.02**2 == pytest.approx(expected)


def test_elasticity_follows_the_film() -> None:
    made = actuator(sbafab.build("1dof-5mm", "films.tpe.thickness=0.05"))
    assert made.membrane == pytest.approx(500)
    assert made.bending(1) == pytest.approx(10_000 * 0.05**3 / 12 / 0.96)
    assert made.bending(2) == pytest.approx(8 * made.bending(1))


def test_chambers_are_pressurised_apart(tmp_path: Path) -> None:
    laminate = sbafab.build("3dof-15mm", "stack.balloons=2")
    write_scenes(laminate, tmp_path, {"chamber1": 4, "chamber3": 2.5})
    scene = ET.parse(tmp_path / "actuator.scn").getroot()
    told = {
        node.attrib["name"]: element.attrib
        for node in scene.iter("Node")
        for element in node.findall("SurfacePressureForceField")
    }
    assert {name: fields["pressure"] for name, fields in told.items()} == {
        "chamber1": "4",
        "chamber2": "0",
        "chamber3": "2.5",
    }
    assert told["chamber1"]["pressureSpeed"] == "4"
    assert float(told["chamber3"]["pressureLowerBound"]) == pytest.approx(2.5, rel=1e-5)
    assert "pulseMode" not in told["chamber2"]


@pytest.mark.parametrize(
    ("pressures", "message"),
    [
        ({"chamber4": 5.0}, "the chambers are chamber1, chamber2, chamber3"),
        ({"chamber1": -1.0}, "must be 0 or more"),
        ({"chamber1": math.nan}, "must be 0 or more"),
    ],
)
def test_pressures_that_cannot_be(pressures: dict[str, float], message: str) -> None:
    with pytest.raises(DesignError, match=message):
        actuator(sbafab.build("3dof-15mm", "stack.balloons=2"), pressures)


@pytest.mark.parametrize("name", ["actuator_frames.scn", "actuator_beam.scn"])
def test_skin_weights_are_linear_along_the_backbone(folder: Path, name: str) -> None:
    scene = parsed(folder / name)
    film = next(node for node in scene.iter("Node") if node.attrib["name"] == "film")
    states = [next(scene.iter("MechanicalObject")), film.find("MechanicalObject")]
    frames, points = (
        np.array(numbers(state.attrib["position"])).reshape(-1, size)
        for state, size in zip(states, (7, 3), strict=True)
        if state is not None
    )
    skin = next(scene.iter("SkinningMapping")).attrib
    index = np.array([int(i) for i in re.findall(r"\d+", skin["indices"])]).reshape(-1, 2)
    weight = np.array([float(w) for w in re.findall(r"[\d.e-]+", skin["weight"])]).reshape(-1, 2)
    assert len(frames) == 9
    assert weight.min() >= 0
    # SkinningMapping reads the weights of a node up to the first that is 0.
    assert (weight[:, 0] >= weight[:, 1]).all()
    assert weight.sum(axis=1) == pytest.approx(1)
    assert (weight * frames[index, 2]).sum(axis=1) == pytest.approx(points[:, 2], abs=1e-4)


def test_the_beam_stretches_and_bends_as_fitted(folder: Path) -> None:
    """EA = 3 k H0, EI = 1.5 k 4.25^2 H0 with k = 7 mN/mm, H0 = 7.2 mm; 17.5 mm at 5 kPa."""
    field = next(parsed(folder / "actuator_beam.scn").iter("BeamFEMForceField")).attrib
    radius, young = float(field["radius"]), float(field["youngModulus"])
    assert young * math.pi * radius**2 == pytest.approx(3 * 7 * 7.2)
    assert young * math.pi * radius**4 / 4 == pytest.approx(1.5 * 7 * 4.25**2 * 7.2)
    beam = beam_of(actuator(sbafab.build("3dof-15mm")))
    assert beam.height + 5 * beam.area / beam.spring == pytest.approx(17.49, abs=0.1)
    frames = numbers(
        next(parsed(folder / "actuator_beam.scn").iter("MechanicalObject")).attrib["position"]
    )
    assert frames[-5] == pytest.approx(7.2, abs=1e-4)


def test_prisms_are_closed_and_look_outward() -> None:
    points, triangles = prism((4.25, 0.0), 10.9, 7.2)
    surface = trimesh.Trimesh(points, triangles, process=False)
    assert surface.is_watertight
    assert surface.volume == pytest.approx(10.9 * 7.2)
    assert surface.center_mass == pytest.approx([4.25, 0, 3.6])


def test_air_does_not_twist_a_prism() -> None:
    """The moment of equal pressure round the prism's own axis, by turning its upper levels."""
    points, triangles = prism((0.0, 0.0), 10.9, 7.2)

    def volume(degrees: float) -> float:
        turned = []
        for x, y, z in points:
            turn = math.radians(degrees * z / 7.2)
            c, s = math.cos(turn), math.sin(turn)
            turned.append((c * x - s * y, s * x + c * y, z))
        return float(trimesh.Trimesh(turned, triangles, process=False).volume)

    assert volume(20) == pytest.approx(volume(-20), rel=1e-9)
    assert volume(20) < volume(0)


def test_files_say_what_is_not_true_of_them(folder: Path) -> None:
    said = {name: (folder / name).read_text(encoding="utf-8").split("-->")[0] for name in SCENES}
    assert all("kPa" in text and "docs/sofa.md" in text for text in said.values())
    for name in SCENES[1::2]:
        assert "Needs calibration" in said[name]
    assert "FITTED" in said["actuator_frames.scn"]
    assert "SURROGATE" in said["actuator_beam.scn"]
    assert "ARTIFICIAL: mass" in said["actuator.scn"]


def test_one_dof_has_no_beam_and_same_bytes_twice(tmp_path: Path) -> None:
    laminate = sbafab.build("1dof-5mm", "stack.balloons=3")
    first = write_scenes(laminate, tmp_path / "a")
    second = write_scenes(sbafab.build("1dof-5mm", "stack.balloons=3"), tmp_path / "b")
    names = ["actuator.scn", "actuator_frames.scn", "actuator_volume.scn"]
    assert [path.name for path in first] == [*names, "actuator.json", "scene.py"]
    assert sorted(first) == sorted((tmp_path / "a").iterdir())
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_a_name_cannot_end_the_comment(tmp_path: Path) -> None:
    laminate = sbafab.build("1dof-5mm", "stack.balloons=1", "name=odd--name")
    path = write_scenes(laminate, tmp_path)[0]
    assert ET.parse(path).getroot().attrib["name"] == "root"
    with pytest.raises(ValueError, match="hyphens"):
        document(root_node(0.1), "a -- b")


class Recorded:
    """Stands in for a node of SofaPython3: keeps what is added to it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.objects: list[tuple[str, dict[str, Any]]] = []
        self.children: list[Recorded] = []

    def addObject(self, component: str, **fields: Any) -> None:  # noqa: N802
        self.objects.append((component, fields))

    def addChild(self, name: str) -> Recorded:  # noqa: N802
        self.children.append(Recorded(name))
        return self.children[-1]


def test_the_python_scene_builds_the_default_one(folder: Path) -> None:
    """The same nodes, components and values as actuator.scn, from the JSON beside it."""
    path = folder / "scene.py"
    module: dict[str, Any] = {"__file__": str(path)}
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), module)
    root = Recorded("root")
    module["createScene"](root)
    assert_same(root, parsed(folder / "actuator.scn"))
    assert root.dt == 0.02  # type: ignore[attr-defined]


def assert_same(made: Recorded, written: ET.Element) -> None:
    assert made.name == written.attrib["name"]
    components = [element for element in written if element.tag != "Node"]
    assert [name for name, _ in made.objects] == [element.tag for element in components]
    for (_, fields), element in zip(made.objects, components, strict=True):
        assert set(fields) == set(element.attrib)
        for name, value in fields.items():
            text = element.attrib[name]
            if isinstance(value, str):
                assert value == text
            else:
                assert np.ravel(value).astype(float) == pytest.approx(numbers(text), rel=2e-3)
    nodes = written.findall("Node")
    assert len(made.children) == len(nodes)
    for child, node in zip(made.children, nodes, strict=True):
        assert_same(child, node)


def test_the_nearer_frame_comes_first() -> None:
    assert pair_of_frames(0.0, 8.0) == ((0, 1), (1.0, 0.0))
    assert pair_of_frames(8.0, 8.0) == ((8, 7), (1.0, 0.0))
    assert pair_of_frames(2.75, 8.0) == ((3, 2), (0.75, 0.25))


def test_another_film_has_its_own_stiffness() -> None:
    """E t, bending and Poisson's ratio of one film all through; 20 MPa, 0.05 mm, 0.3."""
    film = (
        "films.soft.kind=structural",
        "films.soft.product=S",
        "films.soft.thickness=0.05",
        "films.soft.density=1200",
    )
    film += ("films.soft.melting_point=120", "films.soft.modulus=20", "films.soft.poisson=0.3")
    layers = tuple(f"layup.{part}=soft" for part in ("base", "wall", "cap"))
    shell = round_shell(round_actuator(sbafab.build("1dof-5mm", *film, *layers)))
    assert [group.stiffness for group in shell.membranes] == pytest.approx([1000, 2000])
    assert shell.bending[0].stiffness == pytest.approx(20_000 * 0.05**3 / 12 / 0.91)
    assert {group.poisson for group in shell.membranes} == {0.3}


@pytest.mark.parametrize(
    ("design", "nodes"), [(("radial-15mm",), 3), (("1dof-5mm", "stack.balloons=2"), 4)]
)
def test_shells_of_conforming_meshes(design: tuple[str, ...], nodes: int) -> None:
    """Area times thickness, walls that look out of the air, bending groups without forks."""
    laminate = sbafab.build(*design)
    shell = conforming_shell(laminate, {"chamber1": 2.0})
    weight = sum(layer.profile.area * 0.038 * 1122e-9 for layer in laminate.tpe_layers)
    assert shell.mass == pytest.approx(weight, rel=0.01)
    assert len(shell.tip) == nodes
    assert sum(shell.pressures.values()) == 2.0
    for group in shell.bending:
        sides = Counter(frozenset(side) for t in group.triangles for side in pairs(t))
        assert max(sides.values()) == 2
    rest, start = np.array(shell.rest), np.array(shell.position)
    assert (rest[:, 2] == 0).all()
    if laminate.tube is not None:
        # On the tube's surface, give or take the end of the sheet that lies on the other.
        assert np.hypot(start[:, 0], start[:, 1]) == pytest.approx(7.5, abs=0.05)
    for _, walls in shell.cavities:
        corners = rest[np.array(walls)]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
        # As much film above the air as below it.
        assert normal[normal > 0].sum() == pytest.approx(-normal[normal < 0].sum(), rel=1e-6)
        assert normal.sum() == pytest.approx(0, abs=1e-6)


def pairs(t: tuple[int, int, int]) -> list[tuple[int, int]]:
    return [(t[i], t[i - 1]) for i in range(3)]


def test_other_pockets_have_the_shell_scene_alone(tmp_path: Path) -> None:
    drawn = tmp_path / "square.svg"
    drawn.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="6mm" height="6mm" viewBox="-3 -3 6 6">'
        '<path d="M -2.5 -2.5 L 2.5 -2.5 L 2.5 2.5 L -2.5 2.5 Z"/></svg>'
    )
    laminate = sbafab.build("1dof-5mm", "stack.balloons=1", f"chamber.outline={drawn}")
    written = write_scenes(laminate, tmp_path, {"chamber1": 2.0})
    assert [path.name for path in written] == ["actuator.scn", "actuator.json", "scene.py"]
    scene = ET.parse(tmp_path / "actuator.scn").getroot()
    for element in scene.iter():
        if element.tag != "Node":
            assert set(element.attrib) <= known_fields(element.tag), element.tag


def test_each_film_of_a_stack_stretches_as_itself() -> None:
    """E t of TPE, of a cap of PET, and of the two bonded; 3,000 MPa, 0.012 mm."""
    film = ("films.pet.kind=structural", "films.pet.product=P", "films.pet.thickness=0.012")
    film += ("films.pet.density=1390", "films.pet.modulus=3000", "films.pet.poisson=0.3")
    laminate = sbafab.build("1dof-5mm", "stack.balloons=1", *film, "layup.cap=pet")
    shell = conforming_shell(laminate)
    stiffness = {round(group.stiffness): group.poisson for group in shell.membranes}
    assert set(stiffness) == {380, 36_000, 36_380}
    assert (stiffness[380], stiffness[36_000]) == (0.2, 0.3)
