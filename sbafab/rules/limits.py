"""When a value passes a limit."""

from __future__ import annotations

TOLERANCE = 0.001
"""mm by which a value may miss its limit and still pass: the resolution of the cut files."""


def holds(measured: float, limit: float) -> bool:
    """True if a value reaches a least limit, to within TOLERANCE (with room for rounding)."""
    return measured >= least_passing(limit)


def least_passing(limit: float) -> float:
    """Return the least value that passes a least limit."""
    return limit - TOLERANCE - 1e-9
