"""Time of the rule deck for one design after the other, each a little other than the one before."""

from __future__ import annotations

from benchmarks.timing import own_seconds

VARIED = {
    "1dof-5mm": ("chamber.diameter", 5.0),
    "radial-15mm": ("tube.outer_diameter", 15.0),
    "3dof-15mm": ("chamber.diameter", 5.0),
}
"""The key of each template that is varied, and where it starts."""
STEP = 0.001
"""mm from one design to the next."""


def other_height(template: str, turn: int) -> float:
    """Seconds for a design of an outline that was checked before, one balloon higher or lower."""
    return checked(template, -1, f"stack.balloons={2 + turn % 12}")


def checked(template: str, turn: int, *settings: str) -> float:
    """Seconds from a design to its findings: laminate, interfaces and all rules."""
    from sbafab.actuators import build, load_design
    from sbafab.rules.deck import run_deck

    key, first = VARIED[template]
    design = load_design(template, [f"{key}={first + STEP * (turn + 1):.3f}", *settings])
    return own_seconds(lambda: run_deck(build(design), design))
