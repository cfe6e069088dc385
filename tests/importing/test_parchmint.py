"""ParchMint circuits imported: masks by closed formulas, nets against a union of shapely's."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from sbafab.cli import app
from sbafab.importing.parchmint import import_parchmint
from sbafab.importing.records import Written, write_imported
from sbafab.rules.nets import connectivity
from tests.designs import PAPER, put
from tests.importing.conftest import Importing


def component(name: str, entity: str, corner: list[int], span: int, layer: str) -> dict[str, Any]:
    radius = {"PORT": {"portRadius": span / 2}, "VIA": {"radius": span / 2}}.get(entity, {})
    return {
        "id": name,
        "name": name,
        "entity": entity,
        "layers": layer.split(),
        "params": {"position": corner, **radius},
        "ports": [{"label": "1", "layer": layer[:1], "x": span // 2, "y": span // 2}],
        "x-span": span,
        "y-span": span,
    }


def channel(name: str, layer: str, ends: list[str], points: list[list[int]]) -> dict[str, Any]:
    source, *sinks = ({"component": end, "port": "1"} for end in ends)
    return {
        "id": name,
        "name": name,
        "layer": layer,
        "source": source,
        "sinks": sinks,
        "params": {"channelWidth": 1000},
        "paths": [{"source": source, "sink": sinks[0], "wayPoints": points}],
    }


def circuit() -> dict[str, Any]:
    """Two channels of 20 mm on the flow layer; the first goes up through a via to a valve."""
    return {
        "name": "two channels",
        "layers": [
            {"id": "f", "name": "flow", "type": "FLOW", "group": "0"},
            {"id": "c", "name": "control", "type": "CONTROL", "group": "0"},
            {"id": "i", "name": "electrodes", "type": "INTEGRATION", "group": "0"},
        ],
        "components": [
            component("in1", "PORT", [0, 0], 3000, "f"),
            component("via1", "VIA", [20000, 0], 3000, "f c"),
            component("in2", "PORT", [0, 10000], 3000, "f"),
            component("tank", "REACTION CHAMBER", [20000, 10000], 3000, "f"),
            component("valve", "VALVE", [20000, 20000], 3000, "c"),
            component("pad", "PAD", [0, 0], 10, "i"),
        ],
        "connections": [
            channel("a", "f", ["in1", "via1"], [[1500, 1500], [21500, 1500]]),
            channel("b", "f", ["in2", "tank"], [[1500, 11500], [21500, 11500]]),
            channel("c", "c", ["via1", "valve"], [[21500, 1500], [21500, 21500]]),
        ],
        "features": [],
        "version": "1.2",
    }


def saved(document: dict[str, Any], folder: Path) -> Path:
    path = folder / "circuit.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def written(document: dict[str, Any], folder: Path) -> Written:
    path = saved(document, folder)
    return write_imported(import_parchmint(path), folder / "again.toml", path.name)


def test_layers_are_masks_between_films_with_the_channels_as_drawn(tmp_path: Path) -> None:
    laminate = written(circuit(), tmp_path).laminate
    roles = ["base", "chamber-mask", "wall", "chamber-mask", "cap"]
    assert [layer.role for layer in laminate.layers] == roles
    # A disc of 3 mm, from which a channel of 1 mm leaves: what it adds begins on the circle.
    disc, half = math.pi * 1.5**2, math.asin(0.5 / 1.5)
    within = 2 * 0.5 * 1.5 * math.cos(half) / 2 + 1.5**2 * half
    free = 20 * 1.0 - 2 * within
    # The chamber is a square of 3 mm, which holds 1.5 mm of its channel.
    flow = 3 * disc + 9 + free + (20 - 1.5 - within)
    control = disc + 9 + (20 - 1.5 - within)
    assert laminate.layers[1].profile.area == pytest.approx(flow, rel=1e-9)
    assert laminate.layers[3].profile.area == pytest.approx(control, rel=1e-9)
    # y runs up here, and the middle of all lies at (0, 0).
    assert laminate.layers[1].profile.bounds == pytest.approx((-11.5, -1.5, 11.5, 11.5))
    holes = {layer.index: len(layer.profile.holes) for layer in laminate.layers}
    assert holes == {1: 2, 2: 0, 3: 1, 4: 0, 5: 0}
    assert laminate.layers[2].profile.holes[0].circle == ((10.0, 10.0), 1.0)
    kinds = {port.name: port.kind for port in laminate.ports}
    assert kinds["in1"] == kinds["in2"] == "hole"
    assert kinds["tank"] == kinds["valve"] == kinds["via1-flow"] == "place"


def test_the_nets_of_a_circuit_match_its_channels(tmp_path: Path) -> None:
    laminate = written(circuit(), tmp_path).laminate
    nets = {frozenset(net.ports) for net in laminate.nets}
    assert nets == {
        frozenset(("in1", "via1-flow", "via1-control", "valve")),
        frozenset(("in2", "tank")),
    }
    assert connectivity(laminate, PAPER).faults == ()


def test_an_end_on_a_layer_without_the_component_joins_nothing(tmp_path: Path) -> None:
    document = circuit()
    document["connections"].append(
        channel("d", "c", ["valve", "tank"], [[21500, 21500], [21500, 26000]])
    )
    remarks = import_parchmint(saved(document, tmp_path)).remarks
    assert any("ends at tank, which is not on layer control" in remark for remark in remarks)
    (net,) = (net for net in written(document, tmp_path).laminate.nets if "valve" in net.ports)
    assert "tank" not in net.ports


def test_the_netlist_of_the_file_matches_the_design(importing: Importing, tmp_path: Path) -> None:
    path = saved(circuit(), tmp_path)
    assert importing(path).exit_code == 0
    command = ["check", "two-channels.toml", "--nets", str(path), "--set", "rules.yield_builds=100"]
    said = CliRunner().invoke(app, command).output
    assert re.search("netlist +pass +0 differences", said), said
    # The same circuit with its first channel moved to the other tank is another netlist.
    document = circuit()
    document["connections"][0]["sinks"][0]["component"] = "tank"
    saved(document, tmp_path)
    said = CliRunner().invoke(app, command).output
    assert re.search("netlist +fail +1 differences +<= 0 differences", said), said


def rewired(document: dict[str, Any], points: list[list[int]]) -> dict[str, Any]:
    document["connections"][1]["paths"][0]["wayPoints"] = points
    return document


def test_a_channel_that_crosses_another_is_a_short(tmp_path: Path) -> None:
    crossing = [
        [1500, 11500],
        [10000, 11500],
        [10000, 0],
        [15000, 0],
        [15000, 11500],
        [21500, 11500],
    ]
    laminate = written(rewired(circuit(), crossing), tmp_path).laminate
    assert {fault.kind for fault in connectivity(laminate, PAPER).faults} >= {"short"}


def test_a_channel_that_ends_before_its_component_is_an_open(tmp_path: Path) -> None:
    laminate = written(rewired(circuit(), [[1500, 11500], [18000, 11500]]), tmp_path).laminate
    assert {fault.kind for fault in connectivity(laminate, PAPER).faults} >= {"open"}


@pytest.mark.parametrize("scale", [0.5, 1, 2])
@pytest.mark.parametrize("gap", [0, 4000])
def test_a_node_without_a_size_joins_its_channels(gap: int, scale: float, tmp_path: Path) -> None:
    """Three channels meet in two nodes; the last may begin a gap away from its node."""
    ends = {"in": (0, 0), "up": (10000, -9000), "out": (30000, 0)}
    corners = {name: [round((v - 1500) * scale) for v in p] for name, p in ends.items()}
    ports = [component(n, "PORT", corners[n], round(3000 * scale), "f") for n in ends]
    nodes = [
        component(name, "NODE", [round(x * scale), 0], 0, "f")
        for name, x in (("j", 10000), ("k", 18000))
    ]
    routes: dict[str, tuple[list[str], list[list[float]]]] = {
        "a": (["in", "j"], [[0, 0], [10000, 0]]),
        "b": (["up", "j"], [[10000, -9000], [10000, 0]]),
        "c": (["j", "k"], [[10000, 0], [18000, 0]]),
        "d": (["k", "out"], [[18000 + gap, 0], [30000, 0]]),
    }
    document = circuit() | {
        "layers": [{"id": "f", "name": "flow", "type": "FLOW", "group": "0"}],
        "components": [*ports, *nodes],
        "connections": [
            channel(name, "f", joined, [[round(v * scale) for v in p] for p in points])
            for name, (joined, points) in routes.items()
        ],
    }
    laminate = written(document, tmp_path).laminate
    assert [set(net.ports) for net in laminate.nets] == [{"in", "up", "out"}]
    kinds = [fault.kind for fault in connectivity(laminate, PAPER).faults]
    assert [kind for kind in kinds if kind != "dead-end"] == (["open"] if gap else [])


def test_a_single_point_that_two_channels_share_is_named_in_the_file(
    importing: Importing, tmp_path: Path
) -> None:
    """Round ends of 0.5 mm whose middles lie 1 mm apart, on two channels of one connection."""
    document = rewired(circuit(), [[1500, 11500], [10000, 11500]])
    source, sinks = document["connections"][1]["source"], document["connections"][1]["sinks"]
    path = {"source": source, "sink": sinks[0], "wayPoints": [[11000, 11500], [21500, 11500]]}
    document["connections"][1]["paths"].append(path)
    said = importing(saved(document, tmp_path)).output
    assert "layer flow: channels or components touch in a single point at x 10500, y 1" in said


def test_places_and_channels_may_be_features(tmp_path: Path) -> None:
    plain = written(circuit(), tmp_path).laminate
    document = circuit()
    for row in document["components"][:5]:
        x, y = row["params"].pop("position")
        feature = {"id": row["id"], "name": row["name"], "layer": "f", "location": {"x": x, "y": y}}
        document["features"].append({**feature, "x-span": 3000, "y-span": 3000, "depth": 10})
    for row in document["connections"]:
        ((start, end),) = (path["wayPoints"] for path in row.pop("paths"))
        (x0, y0), (x1, y1) = start, end
        ends = {"source": {"x": x0, "y": y0}, "sink": {"x": x1, "y": y1}}
        feature = {"id": f"of {row['id']}", "connection": row["id"], "layer": row["layer"]}
        document["features"].append({**feature, **ends, "width": 1000, "type": "channel"})
    (tmp_path / "features").mkdir()
    again = written(document, tmp_path / "features").laminate
    assert [layer.profile for layer in again.layers] == [layer.profile for layer in plain.layers]
    assert again.nets == plain.nets


REFUSED: list[tuple[str, object, str]] = [
    ("components.0.x-span", "wide", "components.0.x-span = 'wide' must be a number"),
    ("connections.2.paths", [], "connection c (connections[2]) has no path (paths[].wayPoints, or"),
    ("connections.0.params", {}, "connection a (connections[0]) has no width"),
    (
        "connections.0.paths.0.wayPoints.1",
        [3],
        "connections.0.paths.0.wayPoints.1 is a list without value 2",
    ),
]


@pytest.mark.parametrize(("key", "value", "sentence"), REFUSED)
def test_what_cannot_be_drawn_is_named_at_its_place(
    key: str, value: object, sentence: str, importing: Importing, tmp_path: Path
) -> None:
    document = circuit()
    put(document, key, value)
    assert sentence in importing(saved(document, tmp_path)).output


def test_a_netlist_alone_is_refused(importing: Importing, tmp_path: Path) -> None:
    document = circuit()
    for row in document["components"]:
        row["params"]["position"] = [0, 0]
    said = importing(saved(document, tmp_path)).output
    assert "none of the 6 components has a distinct position" in said
    assert "place and route the circuit first" in said


def test_what_is_inside_of_a_component_is_named(importing: Importing, tmp_path: Path) -> None:
    document = circuit()
    document["components"][3]["entity"] = "MIXER"
    result = importing(saved(document, tmp_path), "--json")
    remarks = json.loads(result.stdout)["remarks"]
    assert any(
        remark.startswith("component tank (MIXER, components[3]): drawn as its box of 3000 x 3000")
        for remark in remarks
    )
    assert any(remark.startswith("layer electrodes: holds no channels") for remark in remarks)


def circuit_of_ports() -> dict[str, Any]:
    document = circuit()
    document["components"][3] = component("out2", "PORT", [20000, 10000], 3000, "f")
    document["connections"][1]["sinks"][0]["component"] = "out2"
    document["connections"][1]["paths"][0]["sink"]["component"] = "out2"
    return document


NO_CHAMBER = {
    "predict": ("predict", 0, "no inlet strip"),
    "mesh": ("mesh", 2, "two-channels has no chamber, which these meshes"),
    "decks": ("generate --decks", 0, "has no chamber"),
    "calculix": ("simulate --with calculix --export", 2, "the design has no chamber"),
    "find": ("find --max outline_diameter=50", 2, "has no free key"),
}


@pytest.mark.parametrize("name", NO_CHAMBER)
def test_what_needs_a_chamber_refuses_a_circuit_of_ports(name: str, tmp_path: Path) -> None:
    file = written(circuit_of_ports(), tmp_path).file
    command, code, words = NO_CHAMBER[name]
    verb, *options = command.split()
    target = tmp_path / "out"
    ended = CliRunner().invoke(app, [verb, str(file), *options, "-o", str(target)])
    assert ended.exit_code == code, ended.output
    assert words in " ".join(ended.output.split())
    if code:
        assert ended.exception is None or isinstance(ended.exception, SystemExit)


def test_a_circuit_without_chambers_goes_through_to_its_traveller(tmp_path: Path) -> None:
    file = written(circuit_of_ports(), tmp_path).file
    result = CliRunner().invoke(app, ["generate", str(file), "-o", str(tmp_path)])
    assert result.exit_code == 0, result.output
    folder = tmp_path / "two-channels"
    findings = json.loads((folder / "checks.json").read_text())["findings"]
    assert {row["rule"] for row in findings if row["verdict"] == "fail"} == set()
    (fit,) = (row for row in findings if row["rule"] == "tube-fit")
    # The tube is as wide as the port, 3 mm; the hole is 0.5 less all round, and cut 0.3 wider.
    assert (fit["measured"], fit["limit"]) == (3.0, pytest.approx(2.3))
    page = (folder / "traveller.html").read_text()
    assert "the tab" not in page.split("Fit the tubes")[1]
