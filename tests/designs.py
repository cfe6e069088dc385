"""The design that the laminates of tests are held against."""

from __future__ import annotations

from sbafab.actuators import load_design

PAPER = load_design("1dof-5mm", ["registration.pin_error=0.004"])
"""The paper's limits. The pins' error is stated, so that no rule speaks of the plate's machine."""


def errors(
    cutting: float = 0, pin: float = 0, placement: float = 0, turn: float = 0
) -> dict[str, float]:
    """Return keys of ``registration``: errors of cutting, pins and hand, mm and degrees."""
    return {
        "cutting_error": cutting,
        "pin_error": pin,
        "hand_placement": placement,
        "hand_turn": turn,
    }
