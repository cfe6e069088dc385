"""Holds the elastic balloon against CalculiX and writes the table into docs/prediction.md.

``python -m docs.scripts.balloon_runs`` needs ccx and the extra "mesh": seconds for the sections through
the axis, some minutes of processor time for each solid mesh. Parts of rows' names as arguments run only
these ("smooth", "d = 5, alone"); the other rows stay.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import sbafab
from sbafab.actuators import load_design
from sbafab.meshing.conforming.settings import MeshSettings
from sbafab.models.balloon import Balloon, inflate
from sbafab.models.balloons import balloons_of
from sbafab.simulators.calculix.axisymmetric import MeridianSection, axisymmetric_states
from sbafab.simulators.calculix.job import simulate
from sbafab.simulators.calculix.settings import deck_settings

PAGE = Path(__file__).parents[1] / "prediction.md"
BEGIN, END = "<!-- written by docs.scripts.balloon_runs -->", "<!-- to here -->"
PRESSURES = (0.5, 2.0, 6.0, 10.0)
HOUR = 3600.0
SMOOTH, FREE = "held smooth", "free to wrinkle"
Found = tuple["np.ndarray", "np.ndarray"]
"""Strokes in mm and air in ul at the pressures."""


class Case(NamedTuple):
    """A row: the balloon of a template, alone or an inner one of a stack, and how it is run.

    ``h`` mm is the solid mesh's, ``ramp`` s its time to 10 kPa: inertia counts the more the wider
    the pocket. 0 for a section through the axis.
    """

    template: str
    alone: bool
    h: float = 0.0
    ramp: float = 0.0

    @property
    def name(self) -> str:
        size = self.template.removeprefix("1dof-").removesuffix("mm")
        where = "alone" if self.alone else "in a stack"
        return f"d = {size}, {where}, {FREE if self.h else SMOOTH}"

    @property
    def balloon(self) -> Balloon:
        design = load_design(self.template, (f"stack.balloons={1 if self.alone else 3}",))
        return replace(balloons_of(design, sbafab.build(design))[0], wrinkles=bool(self.h))


CASES = (
    Case("1dof-5mm", alone=True),
    Case("1dof-5mm", alone=False),
    Case("1dof-10mm", alone=True),
    Case("1dof-10mm", alone=False),
    Case("1dof-5mm", alone=True, h=0.35, ramp=0.05),
    Case("1dof-5mm", alone=False, h=0.35, ramp=0.05),
    Case("1dof-10mm", alone=True, h=0.7, ramp=0.2),
)
"""An inner balloon of d = 10 that may wrinkle would be hours of a processor."""


def elastic(case: Case) -> Found:
    """What the elastic balloon says."""
    found = inflate(case.balloon, PRESSURES)
    return found.height, found.volume


def measured(case: Case) -> Found:
    """What CalculiX says."""
    if not case.h:
        one = case.balloon
        section = MeridianSection(
            2 * one.pocket, one.ring, one.thickness, 2 * one.neck, 2 * one.bore
        )
        states = axisymmetric_states(PRESSURES, section)
        return np.array([s.stroke for s in states]), np.array([s.volume for s in states])
    if case.alone:
        return solid(case, 1)
    # The bottom and the top balloon are in both; what is left is an inner one.
    three, two = solid(case, 3), solid(case, 2)
    return three[0] - two[0], three[1] - two[1]


def solid(case: Case, balloons: int) -> Found:
    """Quarter of a stack of wedges, in time; what its air holds beyond the flat one."""
    laminate = sbafab.build(case.template, f"stack.balloons={balloons}")
    settings = replace(
        deck_settings(laminate), pressures={"chamber1": max(PRESSURES)}, ramp=case.ramp
    )
    mesh = MeshSettings(h=case.h, symmetry="quarter")
    with tempfile.TemporaryDirectory() as place:
        found = simulate(laminate, mesh, settings, Path(place), HOUR, lambda *_: None)
    if found.stopped:
        raise SystemExit(found.stopped)
    states = found.states
    # Strokes grow about as the cube root of the pressure: nearly straight between outputs.
    at = np.cbrt([state.pressures["chamber1"] for state in states])
    strokes = np.interp(np.cbrt(PRESSURES), at, [state.stroke for state in states])
    air = [state.volumes["chamber1"] - states[0].volumes["chamber1"] for state in states]
    return strokes, np.interp(np.cbrt(PRESSURES), at, air)


def apart(own: np.ndarray, other: np.ndarray) -> str:
    return ", ".join(f"{share:+.1f}" for share in 100 * (own / other - 1))


def row(case: Case) -> str:
    """The row of a case."""
    (stroke, air), (mesh_stroke, mesh_air) = elastic(case), measured(case)
    cells = [case.name, listed(stroke, 3), listed(mesh_stroke, 3), apart(stroke, mesh_stroke)]
    cells += [listed(air, 2), listed(mesh_air, 2), apart(air, mesh_air)]
    return "| " + " | ".join(cells) + " |"


def listed(values: np.ndarray, digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def known(text: str) -> dict[str, str]:
    """The rows of the page by name."""
    rows = (line for line in text.splitlines() if line.startswith("| d = "))
    return {line.split("|")[1].strip(): line for line in rows}


def lines(before: dict[str, str], asked: Sequence[str]) -> Iterator[str]:
    """The table: rows that are asked for are run, others are as before."""
    yield (
        "| balloon | stroke, mm: elastic | CalculiX | apart, % | air, ul: elastic | CalculiX "
        "| apart, % |\n|---|---|---|---|---|---|---|"
    )
    for case in CASES:
        is_asked = any(part in case.name for part in asked) or not asked
        found = row(case) if is_asked else before.get(case.name)
        if found is not None:
            print(found, flush=True)
            yield found


def main() -> None:
    text = PAGE.read_text(encoding="utf-8")
    head, _, rest = text.partition(BEGIN)
    body, _, tail = rest.partition(END)
    found = "\n".join(lines(known(body), sys.argv[1:]))
    PAGE.write_text(f"{head}{BEGIN}\n\n{found}\n\n{END}{tail}", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
