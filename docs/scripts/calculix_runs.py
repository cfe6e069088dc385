"""Runs the examples of docs/simulation.md in CalculiX and draws what they find.

python -m docs.scripts.calculix_runs takes about ten minutes; it needs ccx and the extra "mesh".
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import sbafab
from sbafab.meshing.conforming.settings import MeshSettings
from sbafab.reports.chart import ChartCurve, Panel, chart_svg
from sbafab.simulators.calculix.axisymmetric import axisymmetric_strokes
from sbafab.simulators.calculix.history import State
from sbafab.simulators.calculix.job import simulate
from sbafab.simulators.calculix.settings import deck_settings

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


def main() -> None:
    one, stack = inflated(1), inflated(15)
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
    for state in stack:
        print(f"{state.pressures['chamber1']:6.3f} kPa {state.stroke:7.3f} mm")


if __name__ == "__main__":
    main()
