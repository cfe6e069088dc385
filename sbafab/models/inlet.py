"""Which tube goes into an inlet strip."""

from __future__ import annotations

import math


def largest_tube(width: float) -> float:
    """Outer diameter (mm) of the tube that fills a flat strip ``width`` mm wide, opened round.

    Half the tube's perimeter is the strip's width.
    """
    return 2 * width / math.pi
