"""Time of ``sbafab cut`` for many copies of one actuator on large film sheets."""

from __future__ import annotations

import math
import tempfile
import time
from pathlib import Path

DESIGN = "3dof-15mm"
SHEET = 900
"""mm along both sides of every film sheet."""


def nested_and_cut(copies: int) -> float:
    """Seconds from the design to its findings, layer files and film sheets, all read back."""
    from sbafab.actuators import load_design
    from sbafab.output.run import generate

    sheets = [
        f"sheets.{film}.{side}={SHEET}" for film in ("tpe", "ptfe") for side in ("width", "length")
    ]
    design = load_design(DESIGN, [f"order.copies={copies}", *sheets])
    with tempfile.TemporaryDirectory() as name:
        began = time.perf_counter()
        generate(design, Path(name), ("cut",))
        return time.perf_counter() - began


def exponent(times: dict[int, float]) -> float:
    """The power of the number of copies with which time grows, by least squares of logarithms."""
    points = [(math.log(copies), math.log(taken)) for copies, taken in times.items()]
    x, y = (sum(values) / len(points) for values in zip(*points, strict=True))
    return sum((a - x) * (b - y) for a, b in points) / sum((a - x) ** 2 for a, _ in points)
