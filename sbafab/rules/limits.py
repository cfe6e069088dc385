"""Comparison of values with limits."""

from __future__ import annotations

TOLERANCE = 0.001
"""mm by which a value may miss its limit and still pass: the resolution of the cut files."""


def holds(measured: float, limit: float) -> bool:
    """Return True if a value is at least ``limit``, within TOLERANCE and rounding."""
    return measured >= least_passing(limit)


def least_passing(limit: float) -> float:
    """Return the least value that passes a lower limit."""
    return limit - TOLERANCE - 1e-9
