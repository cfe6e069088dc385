"""Runs the scenes in SOFA and writes the tables of docs/sofa.md.

``python -m docs.scripts.sofa_runs`` takes four minutes of processor time; it needs runSofa and ccx on
PATH.
A further model beside them is a further entry of ``OTHERS``.
"""

from __future__ import annotations

import math
import resource
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any
from unittest import mock

import sbafab
from docs.scripts.axisymmetric import MeridianSection, axisymmetric_strokes
from docs.scripts.measured import Record, keep
from docs.scripts.tables import Table
from sbafab.runtime import ignore_progress
from sbafab.simulators import sofa as scene_files
from sbafab.simulators.shell_model import Shell, round_stack
from sbafab.simulators.simulator import Result, SimulationRequest
from sbafab.simulators.sofa import run

COMMAND = "python -m docs.scripts.sofa_runs"
PROGRAMS = {"SOFA": "25.06", "CalculiX": "2.20"}
NAME = "3dof-15mm"
PRESSURES = (1.0, 2.0, 5.0, 10.0)
CHAMBERS = ("chamber1", "chamber2", "chamber3")
INNER = MeridianSection(neck=2.5, bore=1.0)
STEP = {"frames": scene_files.FRAMES_DT}
SECONDS = {"shell": 10.0, "frames": 4.0, "volume": 5.0}
CALCULIX = {1.0: 2.17, 2.0: 2.77, 5.0: 3.73, 10.0: 4.59}
"""Stroke in mm of three balloons on one axis: sbafab simulate 1dof-5mm --set stack.balloons=3
--symmetry quarter --pressure 10 --with calculix, some ten minutes on a core."""
Posed = Callable[[Sequence[float]], tuple[float, float]]
"""Pressure in kPa of each chamber to height of mid-surfaces in mm and bend in degrees."""


def section(pressures: Sequence[float]) -> tuple[float, float]:
    """Fifteen inner balloons, each a section through its axis that cannot ripple."""
    return 15 * axisymmetric_strokes([pressures[0]], INNER)[0], 0.0


def fast_stack() -> Posed | None:
    """The stack of sbafab itself, where it is there."""
    make = getattr(sbafab, "stack", None)
    if make is None:
        return None
    stack = make(NAME, "models.calibration=none")

    def pose(pressures: Sequence[float]) -> tuple[float, float]:
        found = stack.pose(tuple(pressures))
        turn = math.radians(found.bend)
        # Its height has films and masks in it, that of mid-surfaces neither. Bent into an arc, they
        # stand on each other the less upright the higher they are.
        upright = math.sin(turn) / turn if turn > 1e-6 else 1.0
        return float(found.tip[2]) - stack.flat_height * upright, float(found.bend)

    return pose


OTHERS: dict[str, Posed | None] = {"CalculiX, 15 sections": section, "fast stack": fast_stack()}


def ran(
    pressures: Sequence[float],
    scene: str = "shell",
    design: Sequence[str] = (NAME,),
    volumes: Mapping[str, float] | None = None,
) -> tuple[Result, float]:
    """A run, and its steps in a second of processor time, loading left in."""
    laminate = sbafab.build(*design)
    names = [chamber.name for chamber in laminate.chambers]
    told = dict(zip(names, pressures, strict=True))
    seconds = SECONDS[scene]
    request = SimulationRequest(chambers=told, scene=scene, seconds=seconds, volumes=volumes or {})
    with tempfile.TemporaryDirectory() as place:
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = run(laminate, request, Path(place), ignore_progress)
        used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    steps = seconds / STEP.get(scene, scene_files.DT)
    print(scene, list(pressures), done.tip, done.tilt, round(steps / used))
    return done, steps / used


def told(done: Result) -> str:
    return f"{done.last.tip[2]:.2f}, {done.last.tilt:.1f}"


def scenes() -> Iterator[list[str]]:
    """Every scene at every pressure, in all chambers, in two and in one."""
    known = {name: pose for name, pose in OTHERS.items() if pose is not None}
    yield row("kPa in chambers", "A shell", "B frames", *known)
    rates: dict[str, list[float]] = {"shell": [], "frames": []}
    for on in (3, 2, 1):
        for kpa in PRESSURES:
            pressures = [kpa] * on + [0.0] * (3 - on)
            cells = []
            for scene, found in rates.items():
                done, rate = ran(pressures, scene)
                cells.append(told(done))
                found.append(rate)
            for pose in known.values():
                is_even = pose is not section or on == 3
                cells.append("{:.2f}, {:.1f}".format(*pose(pressures)) if is_even else "")
            yield row(", ".join(f"{p:g}" for p in pressures), *cells)
    means = [f"{sum(found) / len(found):.0f}" for found in rates.values()]
    yield row("steps/s", *means, *[""] * len(known))


def volumes() -> Iterator[list[str]]:
    """Scene C."""
    yield row("ul above the start", "C volume", "steps/s")
    for on in (3, 2, 1):
        asked = dict(zip(CHAMBERS, [80.0] * on + [0.0] * (3 - on), strict=True))
        done, rate = ran([0.0] * 2 + [5.0], "volume", volumes=asked)
        yield row(", ".join(f"{ul:g}" for ul in asked.values()), told(done), f"{rate:.0f}")


def finer() -> Iterator[list[str]]:
    """Scene A with rings of more and fewer corners at 5 kPa."""
    yield row("corners of a ring", "nodes", "height, mm", "steps/s")
    for sectors in (8, 12, 16):
        with _made(lambda stack, *_, n=sectors: ROUND(stack, n)):
            done, rate = ran([5.0] * 3)
        nodes = len(ROUND(round_stack(sbafab.build(NAME)), sectors).rest)
        yield row(sectors, nodes, f"{done.last.tip[2]:.2f}", f"{rate:.0f}")


def three() -> Iterator[list[str]]:
    """Three balloons on one axis against the ripples of CalculiX's wedges."""
    yield row("kPa", "A shell, mm", "CalculiX, quarter, mm", "", "steps/s")
    for kpa in PRESSURES:
        done, rate = ran([kpa], design=("1dof-5mm", "stack.balloons=3"))
        high = done.last.tip[2]
        off = f"{100 * (high / CALCULIX[kpa] - 1):+.0f} %"
        yield row(f"{kpa:g}", f"{high:.2f}", f"{CALCULIX[kpa]:.2f}", off, f"{rate:.0f}")


def bending() -> Iterator[list[str]]:
    """What the bend depends on, at 5 kPa in one chamber and in two."""
    yield row("", "5 kPa in one chamber", "in two")
    cases: dict[str, Callable[..., Shell]] = {
        "as drawn": ROUND,
        "pockets 0.3 mm smaller in radius": _of(pockets=(2.2,) * 15),
        "neck discs of radius 1.6 for 1.25": _of(neck=1.6),
        "films that bend ten times as hard": _stiff(10.0),
        "a tenth as hard": _stiff(0.1),
    }
    for name, make in cases.items():
        cells = []
        for pressures in ([5.0, 0.0, 0.0], [5.0, 5.0, 0.0]):
            with _made(make):
                done, _ = ran(pressures)
            cells.append(f"{done.last.tilt:.1f}")
        yield row(name, *cells)


ROUND = scene_files.round_shell


def _stiff(factor: float) -> Callable[..., Shell]:
    """Films that bend harder, and stretch as before."""

    def make(*given: Any) -> Shell:
        shell = ROUND(*given)
        groups = (g._replace(stiffness=factor * g.stiffness) for g in shell.bending)
        return replace(shell, bending=tuple(groups))

    return make


def _of(**other: Any) -> Callable[..., Shell]:
    """The shell of another stack."""
    return lambda stack, *given: ROUND(replace(stack, **other), *given)


def _made(make: Callable[..., Shell]) -> mock._patch[object]:
    return mock.patch.object(scene_files, "round_shell", make)


def row(*cells: object) -> list[str]:
    return [str(cell) for cell in cells]


PARTS: dict[str, Callable[[], Iterator[list[str]]]] = {
    "pressures": scenes,
    "volumes": volumes,
    "rings": finer,
    "three": three,
    "tilt": bending,
}


def main() -> None:
    tables = {}
    for name, rows in PARTS.items():
        head, *others = rows()
        tables[name] = Table(head, others)
    keep("sofa", Record(COMMAND, date.today().isoformat(), PROGRAMS, tables))


if __name__ == "__main__":
    main()
