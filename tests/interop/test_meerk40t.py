"""MeerK40t writes G-code of LightBurn projects: what it cuts, in which order, with which power."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import shapely

from sbafab.cutting.beam_paths import beam_runs
from sbafab.cutting.cut_settings import CUT_INNER, CUT_OUTER, ENGRAVE, PTFE_WARNING, LeadIns
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import LaserRun, Surroundings, drawn
from sbafab.cutting.laser_programs import LaserSheet, laser_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.design.films import Recipe
from tests.interop.made import EXACT, LENGTH, WIDTH, Sheet, outline_bounds

pytestmark = pytest.mark.skipif(find_spec("meerk40t") is None, reason="MeerK40t is not installed")

AROUND = Surroundings(engraved=(((2.0, 2.0), (30.0, 2.0), (30.0, 5.0)),), frame=(WIDTH, LENGTH))
HELD = LeadIns(lead_in=0.3, overcut=0.3, tab_width=0.4, tabs=2, clearance=0.1)
CUT, MARK = (
    Recipe(
        film="TPE",
        thickness_mm=0.038,
        machine="any",
        operation=operation,
        power_percent=power,
        speed_mm_s=speed,
        source="this test",
    )
    for operation, power, speed in (("cut", 20.0, 10.0), ("engrave", 5.0, 80.0))
)
STEP = 0.0254
"""mm: MeerK40t's grid, a thousandth of an inch."""


def runs_of(sheet: Sheet, lead_ins: LeadIns) -> list[LaserRun]:
    contours = cutting_sequence(read_profile(sheet.files["bulges"]).region)
    return list(drawn(beam_runs(contours, lead_ins, AROUND), AROUND))


class Move(NamedTuple):
    """A straight move of a G-code file with the beam on: its S word, mm/min, and ends in mm."""

    power: float
    feed: float
    start: tuple[float, float]
    end: tuple[float, float]


def moves(path: Path) -> list[Move]:
    """What a file has the beam cut: G1 with S above 0, words staying as they were set."""
    words: dict[str, float] = {"X": 0.0, "Y": 0.0, "S": 0.0, "F": 0.0, "G": 0.0}
    found = []
    for line in re.split(r"[\r\n]+", path.read_text()):
        start = words["X"], words["Y"]
        told = {key: float(value) for key, value in re.findall(r"([GXYSF])([-\d.]+)", line)}
        words |= told
        if words["G"] == 1 and words["S"] > 0 and told.keys() & {"X", "Y"}:
            found.append(Move(words["S"], words["F"], start, (words["X"], words["Y"])))
    return found


def meerk40t(folder: Path, *lines: str) -> None:
    batch = folder / "batch.txt"
    batch.write_text("".join(f"{line}\n" for line in (*lines, "quit")))
    home = {"HOME": str(folder), "XDG_CONFIG_HOME": str(folder)}
    start = "from meerk40t.main import run; run()"
    subprocess.run(
        [sys.executable, "-c", start, *("-z", "-p", "-A", "-q", "-b"), str(batch)],
        cwd=folder,
        env={**os.environ, **home},
        capture_output=True,
        timeout=120,
        check=True,
    )


@pytest.mark.long
def test_meerk40t_writes_gcode_of_what_the_project_cuts(
    sheets: dict[str, Sheet], tmp_path: Path
) -> None:
    """Lengths within 0.2 %, every place within a step of its grid, order, power and speed."""
    runs = runs_of(sheets["3dof-15mm TPE"], HELD)
    drawing = LaserSheet(runs, (WIDTH, LENGTH), "sheet", {"cut": CUT, "engrave": MARK})
    (tmp_path / "TPE_1.lbrn2").write_text(laser_text("lightburn", drawing))
    # Its y runs down: without this the sheet comes out mirrored.
    meerk40t(tmp_path, "service device start -i grbl", "set -p grbl flip_y False")
    job = "plan copy preprocess validate blob save_job"
    meerk40t(
        tmp_path,
        "service device activate 1",
        f"load {tmp_path / 'TPE_1.lbrn2'}",
        f"{job} {tmp_path / 'TPE_1.gcode'}",
    )
    found = moves(tmp_path / "TPE_1.gcode")
    # 5 % and 20 % of S 1000, 80 and 10 mm/s in mm/min, engraving first.
    powers = [move.power for move in found]
    assert powers == sorted(powers)
    assert {(move.power, move.feed) for move in found} == {(50.0, 4800.0), (200.0, 600.0)}
    for power, names in ((50.0, (ENGRAVE,)), (200.0, (CUT_INNER, CUT_OUTER))):
        ours = [run for run in runs if run.layer in names]
        theirs = [move for move in found if move.power == power]
        length = sum(edge.length for run in ours for edge in run.edges)
        cut = sum(math.dist(move.start, move.end) for move in theirs)
        assert cut == pytest.approx(length, rel=2e-3)
        lines = shapely.union_all([line(run) for run in ours])
        places = shapely.points([p for move in theirs for p in (move.start, move.end)])
        assert float(shapely.distance(lines, places).max()) < STEP
        extent = shapely.union_all(places).bounds
        assert extent == pytest.approx(lines.bounds, abs=STEP)
        # Nothing is left out either: tabs are, and nothing else.
        cuts = shapely.MultiLineString([(m.start, m.end) for m in theirs]).buffer(1.5 * STEP)
        assert lines.difference(cuts).length < 1e-3 * length


def line(run: LaserRun) -> shapely.LineString:
    points = [run.edges[0].start, *(e.at(k / 48) for e in run.edges for k in range(1, 49))]
    return shapely.LineString(points)


class Node:
    """A node of the tree that MeerK40t's reader fills."""

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


def shape_of(node: Node) -> shapely.Polygon:
    """What the node's line encloses, in mm, curves as MeerK40t itself breaks them up."""
    from meerk40t.core.geomstr import Geomstr
    from meerk40t.core.units import UNITS_PER_MM

    told = node.told
    if told["type"] == "elem ellipse":
        geometry = Geomstr.ellipse(told["rx"], told["ry"], told["cx"], told["cy"])
        geometry.transform(told["matrix"])
    else:
        geometry = told["geometry"]
    points = geometry.as_interpolated_points(interpolate=100)
    return shapely.Polygon(
        [(p.real / UNITS_PER_MM, p.imag / UNITS_PER_MM) for p in points if p is not None]
    )


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

    shapes = {name: [shape_of(node) for node in layers[name].children] for name in list(layers)[1:]}
    areas = {name: sorted(shape.area for shape in own) for name, own in shapes.items()}
    assert areas["CUT_OUTER"] == pytest.approx(sheet.outers, rel=EXACT)
    assert areas["CUT_INNER"] == pytest.approx(sheet.holes, rel=EXACT)
    assert areas["REFERENCE"] == pytest.approx([WIDTH * LENGTH])
    # Numbers, not looks: MeerK40t counts y downwards, as a project does that says MirrorY.
    bounds = shapely.total_bounds(shapes["CUT_OUTER"])
    assert bounds == pytest.approx(outline_bounds(cut_file), abs=0.001)

    # The tree holds the shapes as the file does: all holes before any outline, the frame last.
    [file] = read.elem_branch.children
    layer_of = {id(node): name for name, op in layers.items() for node in op.children}
    seen = [layer_of[id(node)] for node in file.children]
    assert seen == sorted(seen, key=list(layers).index)

    assert read.note.startswith("Powers are 0: set power and speed of each layer")
    assert "KERF_STATE: uncalibrated" in read.note
    assert (PTFE_WARNING in read.note) == (cut_file.name == "PTFE_1.dxf")
