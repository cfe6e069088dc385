"""Time of the rules for drawn outlines of many edges."""

from __future__ import annotations

import cmath
import math
import tempfile
from pathlib import Path

from benchmarks.timing import own_seconds

DESIGN = "1dof-5mm"
WAVES = ((0.05, 3), (0.03, 5), (0.012, 7))
"""A closed curve: how far it swings about its mean radius, and how often."""
RADIUS = 9.0


def curve(t: float) -> complex:
    swing = sum(share * math.cos(times * t) for share, times in WAVES)
    return cmath.rect(RADIUS * (1 + swing), t)


def heading(t: float) -> complex:
    """The unit direction of the curve."""
    swing = sum(share * math.cos(times * t) for share, times in WAVES)
    rate = -sum(share * times * math.sin(times * t) for share, times in WAVES)
    along = complex(rate, 1 + swing) * cmath.rect(1, t)
    return along / abs(along)


def drawing(edges: int, larger: float = 1.0) -> list[tuple[float, float, float]]:
    """Vertices with bulges: pairs of arcs that leave and arrive along the curve."""
    vertices = []
    for i in range(edges // 2):
        first, last = (math.tau * k / (edges // 2) for k in (i, i + 1))
        (p, u), (q, v) = (curve(first), heading(first)), (curve(last), heading(last))
        chord = q - p
        along = (chord.conjugate() * (u + v)).real
        less = 2 * (1 - (u.conjugate() * v).real)
        reach = abs(chord) ** 2 / (along + math.sqrt(along**2 + less * abs(chord) ** 2))
        middle = (p + q + reach * (u - v)) / 2
        vertices.append((p.real, p.imag, math.tan(cmath.phase((middle - p) / u) / 2)))
        vertices.append((middle.real, middle.imag, math.tan(cmath.phase(v / (q - middle)) / 2)))
    return [(larger * x, larger * y, bulge) for x, y, bulge in vertices]


def save(path: Path, edges: int, larger: float = 1.0) -> None:
    """Writes such an outline as DXF."""
    import ezdxf

    document = ezdxf.new(units=4)
    vertices = drawing(edges, larger)
    document.modelspace().add_lwpolyline(vertices, format="xyb", close=True)
    document.saveas(path)


def built_and_checked(edges: int, turn: int) -> float:
    """Seconds to build a design with such an outline, and for the rules, interfaces too.

    Each turn has an outline of its own: what is asked again of the same one is remembered.
    """
    from sbafab.actuators import build, load_design
    from sbafab.rules.deck import run_deck

    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "outline.dxf"
        save(path, edges, 1 + turn / 1000)
        design = load_design(DESIGN, [f"chamber.outline={path}"])
        return own_seconds(lambda: run_deck(build(design), design))
