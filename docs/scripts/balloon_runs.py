"""Holds the elastic balloon against CalculiX and writes docs/measured/balloons.csv.

``python -m docs.scripts.balloon_runs`` needs ccx and the extra "mesh": seconds for the sections through
the axis, a minute or two for each ripple's sector, some minutes of processor time for each solid mesh.
Parts of rows' names as arguments run only these ("smooth", "d = 5, alone"); the other rows stay.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import sbafab
from docs.scripts import measured as tables_of_pages
from docs.scripts.axisymmetric import MeridianSection, axisymmetric_states
from docs.scripts.ripple_sector import Sector, sector_states
from docs.scripts.tables import FOLDER, Table, table
from sbafab.actuators import load_design
from sbafab.meshing.conforming.layup import MeshSettings
from sbafab.models.balloons import balloons_of
from sbafab.models.film_elements import Balloon
from sbafab.models.rim_correction import free_shapes
from sbafab.simulators.calculix import deck_settings, simulate

PATH = FOLDER / "balloons.csv"
PRESSURES = (0.5, 2.0, 6.0, 10.0)
"""kPa."""
HOUR = 3600.0
RAMP, SLOW = 0.2, 1.0
"""s to the last pressure of a ripple."""
RIPPLED = (0.25, 0.5, 1.0, 2.0, 4.0, 6.0, 10.0)
SMOOTH, FREE = "held smooth", "free to wrinkle"
RIPPLES, HALF = "even ripples", "ripples, half a wave"
Found = tuple["np.ndarray", "np.ndarray"]
"""Strokes in mm and air in ul at the pressures."""


class Run(NamedTuple):
    """A solid mesh in time: what pressures (kPa) it is for, and how many s it takes to the last.

    The slower, the less inertia counts and the more steps ripples take: below 1 kPa columns and wide
    pockets need it slow.
    """

    pressures: tuple[float, ...]
    ramp: float


class Case(NamedTuple):
    """A row: the balloon of a template, alone or an inner one of a stack, or one like it of another
    ``diameter`` in mm.

    ``h`` mm is the solid mesh's; with ``waves`` it is one even ripple of that many; without either
    it is a section through the axis.
    """

    template: str
    alone: bool
    h: float = 0.0
    runs: tuple[Run, ...] = ()
    waves: int = 0
    diameter: float | None = None
    half: bool = False
    """Half a wave, which may roll, inflated slowly; else a quarter."""

    @property
    def pressures(self) -> tuple[float, ...]:
        found = tuple(pressure for run in self.runs for pressure in run.pressures)
        return RIPPLED if self.waves else found or PRESSURES

    @property
    def name(self) -> str:
        size = self.template.removeprefix("1dof-").removesuffix("mm")
        size = f"{self.diameter:g}" if self.diameter else size
        where = "alone" if self.alone else "in a stack"
        ripples = HALF if self.half else RIPPLES
        how = f"{self.waves} {ripples}" if self.waves else FREE if self.runs else SMOOTH
        return f"d = {size}, {where}, {how}"

    @property
    def balloon(self) -> Balloon:
        design = load_design(self.template, (f"stack.balloons={1 if self.alone else 3}",))
        found = balloons_of(design, sbafab.build(design))[0]
        pocket = self.diameter / 2 if self.diameter else found.pocket
        return replace(found, pocket=pocket, wrinkles=bool(self.runs or self.waves))


CASES = (
    Case("1dof-5mm", alone=True),
    Case("1dof-5mm", alone=False),
    Case("1dof-10mm", alone=True),
    Case("1dof-10mm", alone=False),
    Case("1dof-5mm", True, 0.22, (Run((0.5, 2.0, 6.0), 0.05),)),
    Case("1dof-5mm", False, 0.35, (Run((0.5,), 1.0), Run((2.0, 6.0, 10.0), 0.05))),
    Case("1dof-10mm", True, 0.45, (Run((0.15, 0.25), 0.16),)),
    Case("1dof-5mm", alone=True, waves=7),
    Case("1dof-5mm", alone=False, waves=7),
    Case("1dof-10mm", alone=True, waves=12),
    Case("1dof-10mm", alone=False, waves=12),
    Case("1dof-10mm", alone=True, waves=9, diameter=7),
    Case("1dof-10mm", alone=True, waves=18, diameter=15),
    Case("1dof-10mm", alone=False, waves=18, diameter=15),
    Case("1dof-10mm", alone=True, waves=24, diameter=20),
    Case("1dof-10mm", alone=True, waves=12, half=True),
)
"""Quarters of d = 10 whose rims ripple would be hours."""


def elastic(case: Case) -> Found:
    """What the elastic balloon says."""
    found = free_shapes(case.balloon, case.pressures)
    return found.height, found.volume


def measured(case: Case) -> Found:
    """What CalculiX says."""
    one = case.balloon
    if case.waves:
        return _rippled(one, case)
    if not case.runs:
        section = MeridianSection(
            2 * one.pocket, one.ring, one.thickness, 2 * one.neck, 2 * one.bore
        )
        states = axisymmetric_states(case.pressures, section)
        return np.array([s.stroke for s in states]), np.array([s.volume for s in states])
    found = [_alone_or_inner(case, run) for run in case.runs]
    return np.concatenate([one[0] for one in found]), np.concatenate([one[1] for one in found])


def _rippled(one: Balloon, case: Case) -> Found:
    sector = Sector(
        2 * one.pocket,
        case.waves,
        one.ring,
        one.thickness,
        round=8 if case.half else 5,
        ramp=SLOW if case.half else RAMP,
        even=not case.half,
        neck=2 * one.neck,
        bore=2 * one.bore,
    )
    states = [state for state in sector_states(sector) if state.pressure in RIPPLED]
    if len(states) < len(RIPPLED):
        raise SystemExit("ccx did not finish")
    return np.array([state.stroke for state in states]), np.array([state.air for state in states])


def _alone_or_inner(case: Case, run: Run) -> Found:
    if case.alone:
        return solid(case, run, 1)
    # The bottom and the top balloon are in both; what is left is an inner one.
    three, two = solid(case, run, 3), solid(case, run, 2)
    return three[0] - two[0], three[1] - two[1]


def solid(case: Case, run: Run, balloons: int) -> Found:
    """Quarter of a stack of wedges, in time; what its air holds beyond the flat one."""
    laminate = sbafab.build(case.template, f"stack.balloons={balloons}")
    settings = replace(
        deck_settings(laminate), pressures={"chamber1": max(run.pressures)}, ramp=run.ramp
    )
    mesh = MeshSettings(h=case.h, symmetry="quarter")
    with tempfile.TemporaryDirectory() as place:
        found = simulate(laminate, mesh, settings, Path(place), HOUR, lambda *_: None)
    if found.stopped:
        raise SystemExit(found.stopped)
    states = found.states
    # Strokes grow about as the cube root of the pressure: nearly straight between outputs.
    at = np.cbrt([state.pressures["chamber1"] for state in states])
    wanted = np.cbrt(run.pressures)
    strokes = np.interp(wanted, at, [state.stroke for state in states])
    air = [state.volumes["chamber1"] - states[0].volumes["chamber1"] for state in states]
    return strokes, np.interp(wanted, at, air)


def apart(own: np.ndarray, other: np.ndarray) -> str:
    return ", ".join(f"{share:+.1f}" for share in 100 * (own / other - 1))


def row(case: Case) -> list[str]:
    """Return the cells of a case."""
    (stroke, air), (mesh_stroke, mesh_air) = elastic(case), measured(case)
    return [
        case.name,
        ", ".join(f"{pressure:g}" for pressure in case.pressures),
        listed(stroke, 3),
        listed(mesh_stroke, 3),
        apart(stroke, mesh_stroke),
        listed(air, 2),
        listed(mesh_air, 2),
        apart(air, mesh_air),
    ]


def listed(values: np.ndarray, digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def known() -> dict[str, list[str]]:
    """Return the recorded rows by name."""
    return {cells[0]: list(cells) for cells in table("balloons").rows}


def main() -> None:
    parts = sys.argv[1:]
    rows = known()
    for case in CASES:
        if not parts or any(part in case.name for part in parts):
            rows[case.name] = row(case)
            print(*rows[case.name], sep=" | ", flush=True)
    recorded = [rows[case.name] for case in CASES if case.name in rows]
    PATH.write_text(Table(COLUMNS, recorded).csv, encoding="utf-8", newline="\n")
    tables_of_pages.main()


COLUMNS = (
    "balloon",
    "kPa",
    "stroke of the model, mm",
    "of CalculiX",
    "difference, %",
    "air of the model, ul",
    "of CalculiX",
    "difference, %",
)

if __name__ == "__main__":
    main()
