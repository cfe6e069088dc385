"""Time of ``sbafab cut`` for many copies of one actuator on large film sheets."""

from __future__ import annotations

import tempfile
from pathlib import Path

from benchmarks.timing import own_seconds

DESIGN = "3dof-15mm"
SHEET = 900
"""mm along both sides of every film sheet."""


def nested_and_cut(copies: int, turn: int) -> float:
    """Seconds from the design to its findings, layer files and film sheets, all read back."""
    from sbafab.actuators import load_design
    from sbafab.folders.run import RunRequest, generate

    sheets = [
        f"sheets.{film}.{side}={SHEET}" for film in ("tpe", "ptfe") for side in ("width", "length")
    ]
    another = f"chamber.diameter={5 + turn / 1000}"
    design = load_design(DESIGN, [f"order.copies={copies}", another, *sheets])
    with tempfile.TemporaryDirectory() as name:
        return own_seconds(lambda: generate(RunRequest(design, Path(name), ("cut",))))
