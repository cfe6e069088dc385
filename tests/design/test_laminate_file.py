"""``laminate.json``: read back exactly, and what is wrong with one named at its place."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given

from sbafab.actuators import build, load_design
from sbafab.design.laminate_file import laminate_json, read_laminate
from sbafab.errors import DesignError
from sbafab.geometry.contour import circle
from sbafab.geometry.edges import Line
from sbafab.geometry.region import Region
from sbafab.laminate.joints import FaceBond, Fold, Net, Port, Seam
from sbafab.laminate.laminate import Laminate
from tests.judge.welded_drafts import welded_draft
from tests.properties.designs import Draft, valid
from tests.properties.test_designs import share
from tests.quick import few
from tests.site.formats import hold

TEMPLATES = ("1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm", "pouch")


def regions(laminate: Laminate) -> list[Region]:
    return [laminate.outline, *(layer.profile for layer in laminate.layers)]


def assert_read_back(laminate: Laminate, folder: Path) -> None:
    path = folder / "laminate.json"
    path.write_text(laminate_json(laminate), encoding="utf-8")
    again = read_laminate(path)
    assert again == laminate
    pairs = zip(regions(laminate), regions(again), strict=True)
    assert all(region.is_exactly(other) for region, other in pairs)
    assert laminate_json(again) == path.read_text(encoding="utf-8")


def assert_draft_read_back(draft: Draft) -> None:
    with TemporaryDirectory() as name:
        assert_read_back(build(load_design(draft.write(Path(name)))), Path(name))


@pytest.mark.parametrize("name", TEMPLATES)
def test_a_template_is_read_back_exactly(name: str, tmp_path: Path) -> None:
    laminate = build(load_design(name))
    assert_read_back(laminate, tmp_path)
    hold("laminate", json.loads(laminate_json(laminate)))


@share(2, 2)
@given(valid())
def test_a_random_laminate_is_read_back_exactly(draft: Draft) -> None:
    assert_draft_read_back(draft)


def test_further_keys_are_passed_over(tmp_path: Path) -> None:
    laminate = build(load_design("3dof-15mm"))
    document = json.loads(laminate_json(laminate))
    for rows in ([document], document["films"], document["layers"], document["inlets"]):
        for row in rows:
            row["further"] = 1
    path = tmp_path / "laminate.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    assert read_laminate(path) == laminate


def first_arc(document: dict[str, Any]) -> list[Any]:
    arcs: list[list[Any]] = [
        edge
        for shape in document["shapes"]
        for contour in shape
        for edge in contour
        if len(edge) == 8
    ]
    return arcs[0]


FAULTS: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "id": (lambda d: d.update(schema="x"), "schema = 'x' must be 'sbafab/laminate@1'"),
    "outline": (lambda d: d.update(outline=999), "outline: there is no shape 999"),
    "order": (lambda d: d["layers"].reverse(), "layers[0].index: "),
    "role": (lambda d: d["layers"][0].update(role="lid"), "layers.0.role = 'lid' must be 'base'"),
    "film": (lambda d: d["layers"][1].update(film=9), "layers[1].film: there is no film 9"),
    "thickness": (lambda d: d["films"][0].update(thickness=0), "films[0].thickness: "),
    "height": (lambda d: d["layers"][2].update(z=1.0), "layers[2].z: "),
    "edge": (lambda d: d["shapes"][0][0].append([0, 0]), "shapes.0.0."),
    "open": (lambda d: d["shapes"][0][0].pop(), "shapes[0][0][0]: does not begin"),
    "radius": (lambda d: first_arc(d).__setitem__(6, 77.0), "the arc's ends do not lie"),
}


def assert_refused(document: dict[str, Any], words: str, folder: Path) -> None:
    path = folder / "laminate.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(DesignError) as refused:
        read_laminate(path)
    assert str(refused.value).startswith(f"{path} is not a valid laminate; ")
    assert words in str(refused.value)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_at_its_place(name: str, tmp_path: Path) -> None:
    spoil, words = FAULTS[name]
    document = json.loads(laminate_json(build(load_design("1dof-5mm"))))
    spoil(document)
    assert_refused(document, words, tmp_path)


@pytest.mark.parametrize("text", ["", "[]", "null", "{", '{"schema": "sbafab/laminate@1"}'])
def test_what_is_no_laminate_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "laminate.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DesignError, match=r"laminate\.json"):
        read_laminate(path)


JOINED: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "tool": (lambda d: d["seams"][0].update(tool="glue"), "seams.0.tool = 'glue' must be 'laser'"),
    "layers": (lambda d: d["seams"][0].update(above=9), "seams[0]: lies between layers 1 and 9"),
    "path": (lambda d: d["seams"][0]["path"][0].append([9.0, 9, 9, 8]), "seams[0].path[0][1]: "),
    "fold": (lambda d: d["folds"][0].update(lower=3), "folds[0]: lies between layers 3 and 3"),
    "line": (lambda d: d["folds"][0].update(line=[[0, 0], [0, 0]]), "folds[0].line: "),
    "net": (lambda d: d["nets"][0].update(ports=["x"]), "nets[0].ports: there is no port"),
    "crossing": (
        lambda d: d["shapes"].append([[[0, 0, 2, 2], [2, 2, 2, 0], [2, 0, 0, 2], [0, 2, 0, 0]]]),
        "its edges cross at x 1.0000, y 1.0000",
    ),
}
"""Faults of seams, folds, ports, nets and bonds, and edges that cross."""


def with_joints(laminate: Laminate) -> Laminate:
    """The laminate of two films and a mask with one of each joint."""
    path = ((Line((0.0, 0.0), (0.1, 0.7)),), circle((0.3, 0.1), 1.7).edges)
    lower, mask, upper = laminate.layers
    coated = replace(lower, film=replace(lower.film, faces=("tpu", "textile")))
    return replace(
        laminate,
        layers=(coated, mask, replace(upper, turned=True)),
        chambers=tuple(replace(chamber, balloons=(1,)) for chamber in laminate.chambers),
        seams=(Seam("rim", 1, 3, path, 0.9, "roller", "fin", 1),),
        folds=(Fold(1, 3, ((-1.0, 0.3), (1.0, 0.1))),),
        ports=(Port("a", 1, 3, (0.1, 0.2)),),
        nets=(Net("n", ("a", "pouch")),),
        bonds=(FaceBond("coated", ("tpu", "tpu"), "hot-tip", 150.0, "press"),),
    )


def test_seams_folds_faces_and_nets_are_read_back_exactly(tmp_path: Path) -> None:
    laminate = with_joints(build(load_design("pouch")))
    assert_read_back(laminate, tmp_path)
    hold("laminate", json.loads(laminate_json(laminate)))


@pytest.mark.parametrize("name", JOINED)
def test_a_fault_of_a_joint_is_named_at_its_place(name: str, tmp_path: Path) -> None:
    spoil, words = JOINED[name]
    document = json.loads(laminate_json(with_joints(build(load_design("pouch")))))
    spoil(document)
    assert_refused(document, words, tmp_path)


# Of a stack whose seams have no order, or whose films nothing joins, there is no laminate.
UNMADE = ("wide top", "no neck")
ORDERED = [n for n in range(160) if welded_draft(5, n).fault not in UNMADE][:100]


@pytest.mark.parametrize("number", few(ORDERED, 6, long=24))
def test_random_seams_and_folds_are_read_back_exactly(number: int, tmp_path: Path) -> None:
    draft = welded_draft(5, number)
    laminate = build(load_design(draft.write(tmp_path)))
    assert laminate.seams or laminate.folds or draft.fault == "not folded"
    assert_read_back(laminate, tmp_path)
