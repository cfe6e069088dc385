"""MeerK40t reads the LightBurn projects: what it would cut, in which order, with which power."""

from __future__ import annotations

from contextlib import nullcontext
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from sbafab.cutting.properties import PTFE_WARNING
from tests.interop.made import EXACT, LENGTH, WIDTH, Sheet, outline_bounds

pytest.importorskip("meerk40t", reason="MeerK40t is not installed")

Point = tuple[float, float]


class Node:
    """A node of the tree that the reader fills."""

    def __init__(self, **told: Any) -> None:
        self.told = told
        self.children: list[Node] = []

    def add(self, **told: Any) -> Node:
        self.children.append(Node(**told))
        return self.children[-1]

    def add_reference(self, node: Node) -> None:
        self.children.append(node)

    def remove_all_children(self) -> None:
        self.children.clear()

    def focus(self) -> None:
        pass


class Elements:
    """As much of MeerK40t's elements as its reader asks for."""

    def __init__(self) -> None:
        self.node_lock = nullcontext()
        self.op_branch, self.elem_branch = Node(), Node()
        self.note = ""


def points_of(node: Node) -> list[Point]:
    """The node's line in mm, curves as MeerK40t itself breaks them up."""
    from meerk40t.core.geomstr import Geomstr
    from meerk40t.core.units import UNITS_PER_MM

    if node.told["type"] == "elem ellipse":
        told = node.told
        geometry = Geomstr.ellipse(told["rx"], told["ry"], told["cx"], told["cy"])
        geometry.transform(told["matrix"])
    else:
        geometry = node.told["geometry"]
    points = geometry.as_interpolated_points(interpolate=200)
    return [(p.real / UNITS_PER_MM, p.imag / UNITS_PER_MM) for p in points if p is not None]


def area(points: list[Point]) -> float:
    return sum(x * v - u * y for (x, y), (u, v) in pairwise([*points, points[0]])) / 2


@pytest.fixture
def read(sheet: Sheet) -> Elements:
    from meerk40t.extra.lbrn import LbrnLoader

    path = sheet.files["bulges"].with_suffix(".lbrn2")
    found = Elements()
    assert LbrnLoader.load(None, found, str(path))
    return found


def test_it_cuts_every_contour_on_its_layer_in_order(read: Elements, sheet: Sheet) -> None:
    layers = {op.told["label"].partition(":")[0]: op for op in read.op_branch.children}
    assert list(layers) == ["ENGRAVE", "CUT_INNER", "CUT_OUTER", "REFERENCE"]
    assert {op.told["type"] for op in layers.values()} == {"op cut"}
    found = {name: [area(points_of(node)) for node in op.children] for name, op in layers.items()}
    assert sorted(map(abs, found["CUT_OUTER"])) == pytest.approx(sheet.outers, rel=EXACT / 10)
    assert sorted(map(abs, found["CUT_INNER"])) == pytest.approx(sheet.holes, rel=EXACT / 10)
    assert found["REFERENCE"] == pytest.approx([WIDTH * LENGTH])
    # The tree holds the shapes as the file does: all holes before any outline, the frame last.
    [file] = read.elem_branch.children
    layer_of = {id(node): name for name, op in layers.items() for node in op.children}
    seen = [layer_of[id(node)] for node in file.children]
    assert seen == sorted(seen, key=list(layers).index)


@pytest.mark.usefixtures("fine_arcs")
def test_it_lies_as_the_cut_file_does(read: Elements, sheet: Sheet) -> None:
    """Numbers, not looks: MeerK40t counts y downwards, as a project does that says MirrorY."""
    outlines = next(op for op in read.op_branch.children if op.told["label"].startswith("CUT_OUT"))
    points = [p for node in outlines.children for p in points_of(node)]
    xs, ys = zip(*points, strict=True)
    bounds = (min(xs), min(ys), max(xs), max(ys))
    assert bounds == pytest.approx(outline_bounds(sheet.files["bulges"]), abs=0.001)


def test_no_power_is_guessed_and_the_notes_say_what_to_set(read: Elements, sheet: Sheet) -> None:
    for op in read.op_branch.children:
        assert op.told["power"] == 0
        wanted = "not cut" if op.told["label"].startswith("REF") else "set power and speed"
        assert op.told["label"].endswith(f": {wanted}")
    assert read.note.startswith("Powers are 0: set power and speed of each layer")
    assert "KERF_STATE: uncalibrated" in read.note
    assert (PTFE_WARNING in read.note) == ("PTFE" in Path(sheet.picture).name)
