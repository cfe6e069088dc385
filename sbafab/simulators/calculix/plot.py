"""Stroke, air and wall stress against pressure as one SVG, for screen and print."""

from __future__ import annotations

from collections.abc import Sequence

from sbafab.reports.chart import ChartCurve, Panel, chart_svg
from sbafab.simulators.calculix.history import State


def history_svg(title: str, states: Sequence[State]) -> str:
    """Three panels beside each other; x is the highest of the chambers' pressures."""
    last = states[-1]
    fullest = max(last.pressures, key=lambda name: last.pressures[name])
    x = [state.pressures[fullest] for state in states]
    alike = len(set(last.pressures.values())) == 1
    x_label = "pressure, kPa" if alike else f"pressure in {fullest}, kPa"
    several = len(last.volumes) > 1

    def curve(label: str, values: Sequence[float]) -> ChartCurve:
        return ChartCurve(label, x, values, dotted=True)

    volumes = [
        curve(name if several else "", [state.volumes[name] for state in states])
        for name in last.volumes
    ]
    stroke = [curve("", [state.stroke for state in states])]
    stress = [curve("", [state.stress for state in states])]
    return chart_svg(
        title,
        [
            Panel("stroke of the tip", x_label, "stroke, mm", stroke),
            Panel("air in the chambers", x_label, "volume, ul", volumes),
            Panel("largest von Mises stress", x_label, "stress, MPa", stress),
        ],
    )
