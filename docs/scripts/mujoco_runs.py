"""Inflates the models of docs/mujoco.md in MuJoCo and writes its tables.

``python -m docs.scripts.mujoco_runs`` takes some ten minutes of processor time. What stands beside
MuJoCo's figures comes from the records of the other pages.
"""

from __future__ import annotations

import tempfile
from datetime import date
from functools import cache
from pathlib import Path

import sbafab
from docs.scripts.measured import Record, keep, record, texts, versions
from docs.scripts.tables import Table
from sbafab.runtime import ignore_progress
from sbafab.simulators.mujoco import run
from sbafab.simulators.simulator import Result, SimulationRequest

COMMAND = "python -m docs.scripts.mujoco_runs"
RINGS = (8, 16, 24, 32)
ONE = ("1dof-5mm", "stack.balloons=1")
ARM = ("3dof-15mm",)
STACKS = ((3, 6.0, RINGS[:2]), (6, 6.0, RINGS[:2]), (15, 0.84, RINGS[:2]), (15, 2.0, RINGS[:2]))
"""Balloons, kPa and rings; the last one at 6 kPa follows."""
POSES = (
    ((5.0, 5.0, 5.0), RINGS[:2]),
    ((10.0, 10.0, 10.0), RINGS[:1]),
    ((5.0, 5.0, 0.0), RINGS[:2]),
    ((5.0, 0.0, 0.0), RINGS[:2]),
    ((2.0, 0.0, 0.0), RINGS[:2]),
    ((10.0, 0.0, 0.0), RINGS[:1]),
)


@cache
def inflated(design: tuple[str, ...], pressures: tuple[float, ...], ring: int) -> Result:
    """A run of the usual length; pressures in kPa by chamber."""
    laminate = sbafab.build(*design)
    names = [chamber.name for chamber in laminate.chambers]
    told = dict(zip(names, pressures, strict=True))
    with tempfile.TemporaryDirectory() as folder:
        request = SimulationRequest(chambers=told)
        return run(laminate, request, Path(folder), ignore_progress, ring)


def stroke(balloons: int, kpa: float, ring: int) -> str:
    """The stroke of a 1-DoF stack in mm, as its table shows it."""
    design = (ONE[0], f"stack.balloons={balloons}")
    return f"{inflated(design, (kpa,), ring).last.stroke:.{3 if balloons == 1 else 2}f}"


def pose(pressures: tuple[float, ...], ring: int) -> str:
    """Height of the tip's mid-surface in mm, and where chambers are unlike the tilt in degrees."""
    last = inflated(ARM, pressures, ring).last
    high = f"{last.stroke:.2f}"
    return high if len(set(pressures)) == 1 else f"{high}, {last.tilt:.0f}"


def one_balloon() -> Table:
    """One balloon in rings of every size, beside both models of CalculiX."""
    beside = record("calculix").tables["one"]
    heads = ("section through the axis, CAX8R", "full, without inlet")
    rows = []
    for kpa in (0.95, 6.0):
        own = [stroke(1, kpa, ring) for ring in RINGS]
        rows.append([f"{kpa:g}", *own, *(beside.cell(f"{kpa:g}", head) for head in heads)])
    airs = [f"{inflated(ONE, (6.0,), ring).last.volumes['chamber1']:.1f}" for ring in RINGS]
    rows.append(["6: air in ul", *airs, "", "15.6"])
    columns = ["kPa", "8", "16 (default)", "24", "32", "CalculiX axisymmetric", "CalculiX whole"]
    return Table(columns, rows)


def stacks() -> Table:
    """Stacks on one axis, beside CalculiX's wedges."""
    beside = record("calculix").tables["stack"]
    known = {
        (3, 6.0): beside.cell("6", "stroke, 3 balloons"),
        **{
            (15, kpa): beside.cell(row, "stroke, 15 balloons")
            for kpa, row in ((0.84, "0.84"), (2.0, "2.0"), (6.0, "6"))
        },
    }
    rows = []
    for balloons, kpa, rings in (*STACKS, (15, 6.0, RINGS[:2])):
        own = [stroke(balloons, kpa, ring) for ring in rings]
        calculix = known.get((balloons, kpa), "").removesuffix(" mm")
        rows.append([f"{balloons}, {kpa:g}", *own, calculix])
    return Table(["balloons, kPa", "8", "16", "CalculiX"], rows)


def actuator() -> Table:
    """The 3-DoF actuator, beside SOFA's shell and the paper."""
    shell = record("sofa").tables["pressures"]
    paper = {(5.0, 5.0, 5.0): "17.5", (5.0, 5.0, 0.0): "81 +- 6"}
    rows = []
    for pressures, rings in POSES:
        named = ", ".join(f"{kpa:g}" for kpa in pressures)
        high, tilt = shell.cell(named, "A shell").split(", ")
        even = len(set(pressures)) == 1
        own = [pose(pressures, ring) for ring in rings] + [""] * (2 - len(rings))
        sofa = high if even else f"{high}, {float(tilt):.0f}"
        rows.append([named, *own, sofa, paper.get(pressures, "")])
    return Table(["kPa in chambers 1, 2, 3", "8", "16", "SOFA, 12", "paper"], rows)


def main() -> None:
    tables = {"one": one_balloon(), "stacks": stacks(), "actuator": actuator()}
    day = date.today().isoformat()
    told = {name: Table(t.columns, texts(t.rows)) for name, t in tables.items()}
    keep("mujoco", Record(COMMAND, day, versions(MuJoCo="mujoco"), told))


if __name__ == "__main__":
    main()
