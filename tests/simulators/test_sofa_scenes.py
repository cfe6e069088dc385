"""The scenes, held against what SOFA 25.06 knows and against the numbers that ran."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sbafab
from sbafab.errors import DesignError
from sbafab.simulators.simulator import SimulationRequest
from sbafab.simulators.sofa import (
    conforming_shell,
    export,
    scenes_of,
)

FACTS = json.loads(Path(__file__).with_name("sofa_components.json").read_text(encoding="utf-8"))
SCENES = ("actuator.scn", "actuator_frames.scn", "actuator_volume.scn")
NODE_FIELDS = {"name", "dt", "gravity"}
CORE = "Sofa.Simulation.Core"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("sofa")
    export(sbafab.build("3dof-15mm"), SimulationRequest(), made)
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


def test_components_fields_and_plugins_are_sofa_s(scene: ET.Element) -> None:
    for element in scene.iter():
        if element.tag == "Node":
            assert set(element.attrib) <= NODE_FIELDS
        else:
            assert set(element.attrib) <= known_fields(element.tag), element.tag
    used = {FACTS["components"][e.tag]["module"] for e in scene.iter() if e.tag != "Node"}
    required = [e.attrib["name"] for e in scene.iter("RequiredPlugin")]
    assert required == sorted(used - {CORE})


def test_indices_point_at_nodes(scene: ET.Element) -> None:
    seen = 0
    for path, element in walk(scene, []):
        fields = {
            "TriangleSetTopologyContainer": "triangles",
            "FixedProjectiveConstraint": "indices",
        }
        if element.tag in fields:
            count, indices = node_count(path), numbers(element.attrib[fields[element.tag]])
        elif element.tag == "SubsetMapping":
            count, indices = node_count(path[:-1]), numbers(element.attrib["indices"])
        elif element.tag == "SkinningMapping":
            count = node_count(path[:-1])
            indices = [float(i) for i in re.findall(r"\d+", element.attrib["indices"])]
            assert len(indices) == 2 * node_count(path)
        else:
            continue
        seen += 1
        assert 0 <= min(indices) <= max(indices) < count, element.tag
    assert seen > 4


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
    laminate = sbafab.build(design)
    size = 2.0 if design == "1dof-10mm" else 1.0
    for pressure in (10.0, 1.0):
        pressures = {chamber.name: pressure for chamber in laminate.chambers}
        scene = ET.fromstring(scenes_of(laminate, pressures)["shell"].text().encode())
        (mass,) = every(scene, "UniformMass", "totalMass")
        nodal = mass / len(every_node(scene)) / 0.02**2
        assert nodal == pytest.approx(max(8, 3 * pressure * size), rel=5e-3)


def every_node(scene: ET.Element) -> np.ndarray:
    places = next(scene.iter("MechanicalObject")).attrib["position"]
    return np.array(numbers(places)).reshape(-1, 3)


def test_skin_weights_are_linear_along_the_backbone(folder: Path) -> None:
    scene = parsed(folder / "actuator_frames.scn")
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


def test_files_of_one_chamber_are_the_same_twice(tmp_path: Path) -> None:
    for name in ("a", "b"):
        laminate = sbafab.build("1dof-5mm", "stack.balloons=2", "name=odd--name")
        export(laminate, SimulationRequest(3.0), tmp_path / name)
    first, second = (sorted((tmp_path / name).iterdir()) for name in ("a", "b"))
    names = ["actuator.json", "actuator.scn", "actuator_frames.scn", "actuator_volume.scn"]
    assert [path.name for path in first] == [*names, "scene.py"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    # Two hyphens in a row would end the comment that holds the name.
    assert parsed(first[1]).attrib["name"] == "root"


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


@pytest.mark.parametrize(
    ("design", "nodes"), [(("radial-15mm",), 3), (("1dof-5mm", "stack.balloons=2"), 4)]
)
def test_shells_of_conforming_meshes(design: tuple[str, ...], nodes: int) -> None:
    """Area times thickness, walls that look out of the air, bending groups without forks."""
    laminate = sbafab.build(*design)
    shell = conforming_shell(laminate)
    weight = sum(layer.profile.area * 0.038 * 1122e-9 for layer in laminate.tpe_layers)
    assert shell.mass == pytest.approx(weight, rel=0.01)
    assert len(shell.tip) == nodes
    for group in shell.bending:
        sides = (frozenset((t[i], t[i - 1])) for t in group.triangles.tolist() for i in range(3))
        assert max(Counter(sides).values()) == 2
    assert not shell.rest[:, 2].any()
    if laminate.tube is not None:
        # On the tube's surface, give or take the end of the sheet that lies on the other.
        assert np.hypot(*shell.position[:, :2].T) == pytest.approx(7.5, abs=0.05)
    for walls in shell.cavities.values():
        a, b, c = shell.rest[walls].transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)[:, 2] / 2
        # As much film above the air as below it.
        assert normal[normal > 0].sum() == pytest.approx(-normal[normal < 0].sum(), rel=1e-6)


def test_other_pockets_have_the_shell_scene_alone(tmp_path: Path, square: Path) -> None:
    laminate = sbafab.build("1dof-5mm", "stack.balloons=1", f"chamber.outline={square}")
    export(laminate, SimulationRequest(2.0), tmp_path / "sofa")
    written = sorted(path.name for path in (tmp_path / "sofa").iterdir())
    assert written == ["actuator.json", "actuator.scn", "scene.py"]
    for element in parsed(tmp_path / "sofa" / "actuator.scn").iter():
        if element.tag != "Node":
            assert set(element.attrib) <= known_fields(element.tag), element.tag


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


def test_chambers_are_pressurised_apart() -> None:
    laminate = sbafab.build("3dof-15mm", "stack.balloons=2")
    pressures = {"chamber1": 4.0, "chamber2": 0.0, "chamber3": 2.5}
    scene = ET.fromstring(scenes_of(laminate, pressures)["shell"].text().encode())
    told = {
        node.attrib["name"]: element.attrib
        for node in scene.iter("Node")
        for element in node.findall("SurfacePressureForceField")
    }
    assert {name: float(fields["pressure"]) for name, fields in told.items()} == pressures
    assert told["chamber1"]["pressureSpeed"] == "4"
    assert float(told["chamber3"]["pressureLowerBound"]) == pytest.approx(2.5, rel=1e-5)
    assert "pulseMode" not in told["chamber2"]


def test_scenes_that_are_fitted_say_so(folder: Path) -> None:
    said = {name: (folder / name).read_text(encoding="utf-8").split("-->")[0] for name in SCENES}
    assert "Needs calibration" in said["actuator_frames.scn"]
    assert "ARTIFICIAL: mass" in said["actuator.scn"]


def test_volumes_that_cannot_be_are_refused(tmp_path: Path) -> None:
    laminate = sbafab.build("1dof-5mm", "stack.balloons=1")
    for volumes, words in (({"left": 3.0}, "left"), ({"chamber1": -1.0}, "must be at least 0")):
        with pytest.raises(DesignError, match=words):
            export(laminate, SimulationRequest(volumes=volumes), tmp_path)


def test_each_film_of_a_stack_stretches_as_itself() -> None:
    """E t of TPE, of a cap of PET, and of the two bonded; 3,000 MPa, 0.012 mm."""
    film = ("films.pet.kind=structural", "films.pet.product=P", "films.pet.thickness=0.012")
    film += ("films.pet.density=1390", "films.pet.modulus=3000", "films.pet.poisson=0.3")
    laminate = sbafab.build("1dof-5mm", "stack.balloons=1", *film, "layup.cap=pet")
    groups = conforming_shell(laminate).membranes
    stiffness = {round(group.stiffness): group.poisson for group in groups}
    assert set(stiffness) == {380, 36_000, 36_380}
    assert (stiffness[380], stiffness[36_000]) == (0.2, 0.3)
