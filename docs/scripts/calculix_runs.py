"""Runs the examples of docs/simulation.md in CalculiX, writes its tables and draws what they find.

python -m docs.scripts.calculix_runs takes about ten minutes; it needs ccx and the extra "mesh". The
whole balloon, the one without wrinkles and the stack of 3 take hours more: theirs are kept.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from datetime import date
from pathlib import Path

import numpy as np

import sbafab
from docs.scripts.axisymmetric import axisymmetric_strokes
from docs.scripts.measured import Record, keep, record
from docs.scripts.tables import Table
from sbafab.meshing.conforming.layup import MeshSettings
from sbafab.reports.charts import ChartCurve, Panel, chart_svg
from sbafab.simulators.calculix import State, deck_settings, simulate

COMMAND = "python -m docs.scripts.calculix_runs"
PICTURE = Path(__file__).parents[1] / "images" / "calculix.svg"
SECTION = [0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 0.95, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0]
"""kPa."""
STROKE, HEIGHT, REGIME = 1.2, 17.5, 0.95
"""The paper's stroke a balloon and height of 15, in mm; kPa where its geometric regime ends."""
HOUR = 3600.0


def inflated(balloons: int) -> Sequence[State]:
    """A quarter of a 1-DoF stack with pockets of 5, up to the paper's 6 kPa."""
    laminate = sbafab.build("1dof-5mm", f"stack.balloons={balloons}")
    mesh = MeshSettings(symmetry="quarter")
    with tempfile.TemporaryDirectory() as place:
        found = simulate(
            laminate, mesh, deck_settings(laminate), Path(place), HOUR, lambda *_: None
        )
    return found.states


def pressures(states: Sequence[State]) -> list[float]:
    return [state.pressures["chamber1"] for state in states]


def stroke_at(states: Sequence[State], kpa: float) -> float:
    """The stroke in mm, between the states of a run."""
    return float(np.interp(kpa, pressures(states), [state.stroke for state in states]))


def section_at(kpa: float) -> float:
    """The stroke in mm of a section through the axis of one balloon, which cannot ripple."""
    return axisymmetric_strokes([kpa])[0]


def tables(one: Sequence[State], stack: Sequence[State]) -> dict[str, Table]:
    """The tables of the page; what is not run here stays as it was measured before."""
    before = record("calculix").tables
    single = [list(row) for row in before["one"].rows]
    for row in single:
        kpa = float(row[0])
        row[1], row[3] = f"{section_at(kpa):.3f}", f"{stroke_at(one, kpa):.3f}"
    fifteen = [list(row) for row in before["stack"].rows]
    for row in fifteen:
        stroke = stroke_at(stack, float(row[0]))
        row[1], row[2] = f"{stroke:.2f} mm", f"{stroke / 15:.2f} mm"
    return {
        "one": Table(before["one"].columns, single),
        "stack": Table(before["stack"].columns, fifteen),
    }


def main() -> None:
    one, stack = inflated(1), inflated(15)
    known = record("calculix")
    day = date.today().isoformat()
    keep("calculix", Record(COMMAND, day, known.versions, tables(one, stack)))
    films = sum(layer.film.thickness for layer in sbafab.build("1dof-5mm").tpe_layers) * 15 / 6
    heights = [films + state.stroke for state in stack]
    panels = [
        Panel(
            "One balloon of 5 mm (paper, Fig. 7c)",
            "pressure, kPa",
            "stroke, mm",
            [
                ChartCurve(
                    "section, CAX8R", [0.0, *SECTION], [0.0, *axisymmetric_strokes(SECTION)]
                ),
                ChartCurve("quarter, with ripples", pressures(one), [s.stroke for s in one]),
                ChartCurve("paper: 1.2 mm a balloon", [0.0, 6.0], [STROKE] * 2, is_reference=True),
                ChartCurve("", [REGIME] * 2, [0.0, STROKE], is_reference=True),
            ],
        ),
        Panel(
            "15 balloons of 5 mm",
            "pressure, kPa",
            "height, mm",
            [
                ChartCurve("quarter, with ripples", pressures(stack), heights),
                ChartCurve("paper: 17.5 mm, 3-DoF", [0.0, 6.0], [HEIGHT] * 2, is_reference=True),
            ],
        ),
    ]
    PICTURE.write_text(chart_svg("CalculiX", panels), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
