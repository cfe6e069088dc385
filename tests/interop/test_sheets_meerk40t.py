"""MeerK40t reads the LightBurn projects: what it would cut, in which order, with which power."""

from __future__ import annotations

from contextlib import nullcontext
from itertools import pairwise
from typing import Any

import pytest

from sbafab.cutting.properties import PTFE_WARNING
from tests.interop.made import EXACT, LENGTH, WIDTH, Sheet, outline_bounds
from tests.interop.page import contours_are_as_on_the_page

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
    points = geometry.as_interpolated_points(interpolate=100)
    return [(p.real / UNITS_PER_MM, p.imag / UNITS_PER_MM) for p in points if p is not None]


def area(points: list[Point]) -> float:
    return sum(x * v - u * y for (x, y), (u, v) in pairwise([*points, points[0]])) / 2


@pytest.mark.usefixtures("fine_arcs")
def test_meerk40t_cuts_what_the_sheet_says_in_its_order_with_no_power(sheet: Sheet) -> None:
    from meerk40t.extra.lbrn import LbrnLoader

    cut_file = sheet.files["bulges"]
    read = Elements()
    assert LbrnLoader.load(None, read, str(cut_file.with_suffix(".lbrn2")))
    layers = {op.told["label"].partition(":")[0]: op for op in read.op_branch.children}
    assert list(layers) == ["ENGRAVE", "CUT_INNER", "CUT_OUTER", "REFERENCE"]
    for name, op in layers.items():
        says = "not cut" if name == "REFERENCE" else "set power and speed"
        assert op.told == {**op.told, "type": "op cut", "power": 0, "label": f"{name}: {says}"}

    runs = {name: [points_of(node) for node in op.children] for name, op in layers.items()}
    areas = {name: sorted(abs(area(run)) for run in own) for name, own in runs.items()}
    assert areas["CUT_OUTER"] == pytest.approx(sheet.outers, rel=EXACT)
    assert areas["CUT_INNER"] == pytest.approx(sheet.holes, rel=EXACT)
    assert areas["REFERENCE"] == pytest.approx([WIDTH * LENGTH])
    contours_are_as_on_the_page("MeerK40t 0.9.91", sheet, areas["CUT_OUTER"], areas["CUT_INNER"])
    # Numbers, not looks: MeerK40t counts y downwards, as a project does that says MirrorY.
    xs, ys = zip(*(p for run in runs["CUT_OUTER"] for p in run), strict=True)
    bounds = (min(xs), min(ys), max(xs), max(ys))
    assert bounds == pytest.approx(outline_bounds(cut_file), abs=0.001)

    # The tree holds the shapes as the file does: all holes before any outline, the frame last.
    [file] = read.elem_branch.children
    layer_of = {id(node): name for name, op in layers.items() for node in op.children}
    seen = [layer_of[id(node)] for node in file.children]
    assert seen == sorted(seen, key=list(layers).index)

    assert read.note.startswith("Powers are 0: set power and speed of each layer")
    assert "KERF_STATE: uncalibrated" in read.note
    assert (PTFE_WARNING in read.note) == (cut_file.name == "PTFE_1.dxf")
