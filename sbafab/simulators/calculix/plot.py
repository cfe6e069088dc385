"""Stroke, air and wall stress against pressure as one SVG, for screen and print."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple
from xml.sax.saxutils import escape

from sbafab.simulators.calculix.history import State

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Told apart by the colour blind (Okabe and Ito); dashes tell lines apart in grey."""
DASHES = ("", "7 3", "2 3", "9 3 2 3", "4 2", "12 4")
WIDTH, HEIGHT = 330, 300
LEFT, RIGHT, TOP, FOOT = 56, 316, 34, 254
"""Edges of the field in a panel."""
STEPS = (1, 2, 2.5, 5, 10)


class Line(NamedTuple):
    """A curve; its label is drawn at its end if there are several in a panel."""

    label: str
    values: Sequence[float]


def history_svg(title: str, states: Sequence[State]) -> str:
    """Three panels beside each other; x is the highest of the chambers' pressures."""
    last = states[-1]
    fullest = max(last.pressures, key=lambda name: last.pressures[name])
    x = [state.pressures[fullest] for state in states]
    alike = len(set(last.pressures.values())) == 1
    x_label = "pressure, kPa" if alike else f"pressure in {fullest}, kPa"
    volumes = [Line(name, [s.volumes[name] for s in states]) for name in last.volumes]
    panels = (
        ("stroke of the tip, mm", [Line("", [s.stroke for s in states])]),
        ("volume of air, ul", volumes),
        ("largest von Mises stress, MPa", [Line("", [s.stress for s in states])]),
    )
    width, height = len(panels) * WIDTH, HEIGHT + 24
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" font-family="Helvetica, Arial, sans-serif" '
        'font-size="12" fill="#222">',
        f"<title>{escape(title)}</title>",
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
        f'<text x="{LEFT}" y="18" font-size="14" font-weight="bold">{escape(title)}</text>',
    ]
    for number, (label, lines) in enumerate(panels):
        parts.append(f'<g transform="translate({number * WIDTH} 24)">')
        parts += _panel(label, x_label, x, lines)
        parts.append("</g>")
    return "\n".join([*parts, "</svg>", ""])


def _panel(label: str, x_label: str, x: Sequence[float], lines: Sequence[Line]) -> list[str]:
    ys = [value for line in lines for value in line.values]
    x_ticks, y_ticks = _ticks(0.0, max(x)), _ticks(min(0.0, *ys), max(ys))

    def across(value: float) -> float:
        return LEFT + (RIGHT - LEFT) * value / x_ticks[-1]

    def up(value: float) -> float:
        return FOOT - (FOOT - TOP) * (value - y_ticks[0]) / (y_ticks[-1] - y_ticks[0])

    parts = [f'<text x="{LEFT}" y="{TOP - 12}" font-weight="bold">{escape(label)}</text>']
    for tick in y_ticks:
        y = f"{up(tick):.1f}"
        parts.append(f'<path d="M{LEFT} {y}H{RIGHT}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 7}" y="{y}" dy="4" text-anchor="end">{tick:g}</text>')
    for tick in x_ticks:
        at = f"{across(tick):.1f}"
        parts.append(f'<path d="M{at} {FOOT}v5" stroke="#222"/>')
        parts.append(f'<text x="{at}" y="{FOOT + 19}" text-anchor="middle">{tick:g}</text>')
    parts.append(f'<path d="M{LEFT} {TOP}V{FOOT}H{RIGHT}" fill="none" stroke="#222"/>')
    parts.append(
        f'<text x="{(LEFT + RIGHT) / 2:g}" y="{FOOT + 37}" text-anchor="middle">'
        f"{escape(x_label)}</text>"
    )
    for number, line in enumerate(lines):
        places = [(across(a), up(b)) for a, b in zip(x, line.values, strict=True)]
        parts += _curve(number, places, line.label if len(lines) > 1 else "")
    return parts


def _curve(number: int, places: Sequence[tuple[float, float]], label: str) -> list[str]:
    """A curve with a dot at each result, and a line in the key if it has a label."""
    colour = COLOURS[number % len(COLOURS)]
    pen = f'stroke="{colour}" stroke-width="2"'
    if dash := DASHES[number % len(DASHES)]:
        pen += f' stroke-dasharray="{dash}"'
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    parts = [f'<polyline points="{path}" fill="none" {pen}/>']
    parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.2" fill="{colour}"/>' for x, y in places]
    if label:
        y = TOP + 14 + 16 * number
        parts.append(f'<path d="M{LEFT + 10} {y}h30" {pen}/>')
        parts.append(f'<text x="{LEFT + 46}" y="{y}" dy="4">{escape(label)}</text>')
    return parts


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers from at most ``low`` to at least ``high``, four to seven of them."""
    span = max(high - low, 1e-9)
    power = 10.0 ** math.floor(math.log10(span / 5))
    step = next(s * power for s in STEPS if s * power >= span / 5 * (1 - 1e-9))
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(step * n, 12) for n in range(first, max(last, first + 1) + 1)]
