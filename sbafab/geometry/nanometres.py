"""Coordinates in whole nanometres: shapes that differ by a hair come in one order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sbafab.geometry.region import Contour


def nanometres(value: float) -> int:
    """The whole nanometres nearest to so many mm."""
    return math.floor(value * 1e6 + 0.5)


def in_reading_order(contours: Sequence[Contour]) -> tuple[Contour, ...]:
    """Outer contours, then holes, each from left to right."""
    # Most regions have one or two.
    return tuple(sorted(contours, key=_reading_order) if len(contours) > 1 else contours)


def _reading_order(contour: Contour) -> tuple[bool, int, int, int]:
    low_x, low_y, high_x, _ = contour.bounds
    return contour.is_hole, nanometres(low_x), nanometres(low_y), nanometres(high_x)
