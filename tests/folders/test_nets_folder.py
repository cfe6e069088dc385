"""Nets of the cut files as they lie on disk, and netlists in a file of their own."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from random import Random
from typing import Any

import pytest

from sbafab.actuators import load_design
from sbafab.cli import main
from sbafab.errors import DesignError
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.geometry.region import Region, disc, strip
from sbafab.laminate.netlist import compare, parchmint_nets, read_netlist
from sbafab.rules.finding import Finding
from sbafab.rules.nets import netlist_findings
from tests.designs import DRAWN, PAPER
from tests.folders.doctoring import Doctor
from tests.importing.test_parchmint import circuit as circuit_of_two_channels
from tests.importing.test_parchmint import written
from tests.site.formats import hold


@pytest.fixture(scope="session")
def clean_routed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Cut files of two pockets fed through holes: layers 1, 3 and 5 are films."""
    out = tmp_path_factory.mktemp("routed")
    path = out / "routed.toml"
    path.write_text(
        (DRAWN / "routed.toml").read_text() + "\n[rules]\nyield_builds = 100\n", encoding="utf-8"
    )
    return generate(RunRequest(load_design(path), out / "folder", ("cut",))).folder


@pytest.fixture
def circuit(clean_routed: Path, tmp_path: Path) -> Doctor:
    return Doctor(Path(shutil.copytree(clean_routed, tmp_path / "routed")))


def failed(findings: tuple[Finding, ...], rule: str) -> list[Finding]:
    return [f for f in findings if f.rule == rule and f.verdict == "fail"]


def test_a_folder_as_written_passes(circuit: Doctor) -> None:
    findings = check_folder(circuit.folder)
    assert [f for f in findings if f.verdict == "fail"] == []
    assert [f.verdict for f in findings if f.rule == "nets"] == ["pass", "pass"]


BRIDGE = strip((-8.0, 0.0), (8.0, 0.0), 1.0)
EDITS: list[tuple[int, Callable[[Region], Region], str, tuple[float, float]]] = [
    (4, lambda mask: mask | BRIDGE, "nets a and b are joined at interface 2", (0.0, 0.0)),
    (3, lambda film: film | disc((-8.0, -5.0), 0.6), "net a is open", (-8.0, -5.5)),
    (5, lambda film: film - disc((8.0, -3.0), 0.5), "net b reaches the outside", (8.0, -3.0)),
]


@pytest.mark.parametrize(("layer", "change", "words", "place"), EDITS)
def test_an_edited_cut_file_is_named_at_its_place(
    circuit: Doctor,
    layer: int,
    change: Callable[[Region], Region],
    words: str,
    place: tuple[float, float],
) -> None:
    circuit.redraw(layer, change)
    (finding, *_) = failed(check_folder(circuit.folder), "nets")
    assert words in finding.message
    assert finding.where.x is not None
    assert finding.where.y is not None
    assert math.dist((finding.where.x, finding.where.y), place) <= 1


def test_a_folder_with_an_unreadable_layer_says_that_nets_were_not_run(circuit: Doctor) -> None:
    circuit.path(3).write_text("no drawing", encoding="utf-8")
    messages = [f.message for f in check_folder(circuit.folder) if f.rule == "nets"]
    assert messages == ["not run: it needs every layer, and not all could be read"]


def test_a_folder_without_nets_does_not_speak_of_them(doctor: Doctor) -> None:
    doctor.path(3).write_text("no drawing", encoding="utf-8")
    assert "nets" not in {f.rule for f in check_folder(doctor.folder)}


# Netlists.


def netlist(folder: Path, nets: object, schema: str = "sbafab/nets@1") -> Path:
    path = folder / "circuit.json"
    path.write_text(json.dumps({"schema": schema, "nets": nets}), encoding="utf-8")
    return path


def check_against(source: Path, path: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    with pytest.raises(SystemExit) as ended:
        main(["check", str(source), "--nets", str(path), "--json"])
    printed: dict[str, Any] = json.loads(capsys.readouterr().out)
    hold("checks", printed)
    rows = [row for row in printed["findings"] if row["rule"] == "netlist"]
    assert (ended.value.code == 1) == any(row["verdict"] == "fail" for row in rows)
    return {"verdicts": [row["verdict"] for row in rows], "rows": rows}


def test_a_netlist_is_compared_with_folder_and_design(
    clean_routed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = netlist(tmp_path, {"x": ["supply", "left"], "y": ["tube", "right"]})
    hold("nets", json.loads(path.read_text(encoding="utf-8")))
    for source in (clean_routed, clean_routed / "design.toml"):
        (row,) = check_against(source, path, capsys)["rows"]
        assert row["verdict"] == "pass"
        assert row["message"] == "circuit.json: 2 nets joined as listed, and to nothing else"


def test_a_netlist_that_differs_names_each_place(
    clean_routed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = netlist(tmp_path, {"x": ["supply", "right"], "y": ["tube", "left"]})
    rows = check_against(clean_routed, path, capsys)["rows"]
    words = [row["message"] for row in rows]
    assert any("net x is open" in text for text in words)
    assert any("net y is open" in text for text in words)
    assert any("nets x and y are joined" in text for text in words)
    assert all(row["where"]["x"] is not None for row in rows)
    path = netlist(tmp_path, {"x": ["supply", "lft"], "y": ["tube", "right"]})
    (missing, *_) = check_against(clean_routed, path, capsys)["rows"]
    assert missing["message"] == (
        "circuit.json names lft, which is not a port or chamber of the design; did you mean left?"
    )


def test_a_netlist_may_give_places_of_its_own(
    clean_routed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pad = {"name": "pad", "layers": [1, 3], "at": [8, 9]}
    hold("nets", {"schema": "sbafab/nets@1", "nets": {"y": [pad]}})
    path = netlist(tmp_path, {"x": ["supply", "left"], "y": ["tube", "right", pad]})
    assert check_against(clean_routed, path, capsys)["verdicts"] == ["pass"]
    path = netlist(tmp_path, {"x": ["supply", "left", pad], "y": ["tube", "right"]})
    assert set(check_against(clean_routed, path, capsys)["verdicts"]) == {"fail"}


PARCHMINT = {
    "name": "circuit",
    "layers": [{"id": "f", "name": "flow", "type": "FLOW"}],
    "components": [
        {"id": name, "entity": "PORT", "layers": ["f"]}
        for name in ("supply", "left", "tube", "right")
    ],
    "connections": [
        {"id": first, "layer": "f", "source": {"component": first}, "sinks": [{"component": last}]}
        for first, last in (("supply", "left"), ("tube", "right"))
    ],
}


def test_parchmints_connections_are_a_netlist(
    clean_routed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "circuit.json"
    path.write_text(json.dumps(PARCHMINT), encoding="utf-8")
    assert check_against(clean_routed, path, capsys)["verdicts"] == ["pass"]


def test_connections_join_components_layer_by_layer_and_a_via_joins_layers() -> None:
    def component(name: str, entity: str, *layers: str) -> dict[str, object]:
        return {"id": name, "entity": entity, "layers": layers, "x-span": 9, "y-span": 9}

    def joins(layer: str, first: str, *others: str) -> dict[str, object]:
        sinks = [{"component": other, "port": "1"} for other in others]
        return {"id": f"c{first}", "layer": layer, "source": {"component": first}, "sinks": sinks}

    document = {
        "layers": [{"id": "l1", "name": "flow"}, {"id": "l2", "name": "control"}],
        "components": [
            component("p 1", "PORT", "l1"),
            component("mix", "MIXER", "l1"),
            component("q", "PORT", "l1"),
            component("valve", "VALVE", "l1", "l2"),
            component("gas", "PORT", "l2"),
            component("up", "VIA", "l1", "l2"),
            component("far", "PORT", "l2"),
            component("alone", "PORT", "l1"),
        ],
        "connections": [
            joins("l1", "p 1", "mix"),
            joins("l1", "mix", "q", "valve"),
            joins("l2", "gas", "valve"),
            joins("l1", "q", "up"),
            joins("l2", "up", "far"),
        ],
    }
    assert {frozenset(ports) for ports in parchmint_nets(document).values()} == {
        frozenset({"p-1", "mix", "q", "valve-flow", "up-flow", "up-control", "far"}),
        frozenset({"valve-control", "gas"}),
        frozenset({"alone"}),
    }


def test_an_imported_circuit_matches_its_own_file(tmp_path: Path) -> None:
    laminate = written(circuit_of_two_channels(), tmp_path).laminate
    path = tmp_path / "circuit.json"
    (finding,) = netlist_findings(laminate, PAPER, read_netlist(path), path.name)
    assert finding.message == "circuit.json: 2 nets joined as listed, and to nothing else"
    # Another channel in the netlist is an open of the layers.
    document = circuit_of_two_channels()
    document["connections"].append(
        {"id": "d", "layer": "f", "source": {"component": "in1"}, "sinks": [{"component": "in2"}]}
    )
    path.write_text(json.dumps(document), encoding="utf-8")
    (finding,) = netlist_findings(laminate, PAPER, read_netlist(path), path.name)
    assert (finding.verdict, finding.message[:34]) == ("fail", "circuit.json: net net1 is open: in")


BAD: list[tuple[object, str]] = [
    ([], "is not a netlist; it is JSON with"),
    ({"schema": "sbafab/nets@1"}, "nets must be an object with at least one named list"),
    ({"schema": "sbafab/nets@1", "nets": {"a": "b"}}, "nets.a must be a list of at least one port"),
    ({"schema": "sbafab/nets@1", "nets": {"a": [1]}}, "nets.a[0] must be a name, or an object"),
    (
        {"schema": "sbafab/nets@1", "nets": {"a": ["p"], "b": ["p"]}},
        "nets.b[0] names 'p', as does nets.a",
    ),
    (
        {"schema": "sbafab/nets@1", "nets": {"a": [{"name": "p", "at": [0, 0]}]}},
        'nets.a[0] must have "at": [x, y], "layers": [below, above]',
    ),
    ({"connections": [{"id": "a", "source": {"port": "1"}}]}, "connections unknown to"),
    ({"connections": [3]}, "connections unknown to ParchMint"),
]


@pytest.mark.parametrize(("document", "words"), BAD)
def test_a_netlist_that_is_none_is_refused_in_a_sentence(
    document: object, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(DesignError) as refused:
        read_netlist(path)
    assert words in str(refused.value)
    assert str(refused.value).startswith(str(path))


@pytest.mark.parametrize("seed", range(20))
def test_comparing_names_just_the_pairs_that_differ(seed: int) -> None:
    """Against the definition: two ports of one net are joined, two of different nets are not."""
    random = Random(seed)
    ports = [f"p{number}" for number in range(12)]
    nets: dict[str, list[str]] = {f"n{number}": [] for number in range(4)}
    parts: list[set[str]] = [set() for _ in range(5)]
    for number, port in enumerate(ports):
        nets[f"n{number % 4}"].append(port)
        # Most ports lie where their net does.
        parts[number % 4 if random.random() < 0.8 else random.randrange(5)].add(port)
    found = compare(map(frozenset, filter(None, parts)), nets)
    net_of = {port: name for name, members in nets.items() for port in members}
    opens, shorts = set(), set()
    for a, b in combinations(ports, 2):
        is_joined = any({a, b} <= part for part in parts)
        if net_of[a] == net_of[b] and not is_joined:
            opens.add(net_of[a])
        if net_of[a] != net_of[b] and is_joined:
            shorts.add(frozenset({net_of[a], net_of[b]}))
    assert set(found.open) == opens
    # Of several nets in one part each is named with the first.
    assert {frozenset(pair) for pair in found.shorted} <= shorts
    assert {n for pair in found.shorted for n in pair} == {n for pair in shorts for n in pair}
    assert set(found.matched) == set(nets) - opens - {n for pair in shorts for n in pair}
    assert found.missing == ()
