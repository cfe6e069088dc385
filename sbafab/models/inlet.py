"""Which tube goes into an inlet strip."""

from __future__ import annotations

import math


def largest_tube(width: float, strip: float = 0.0) -> float:
    """Outer diameter (mm) of the tube that fills a flat channel ``width`` mm wide, opened round.

    Half the perimeter of what lies in it is the channel's width: the tube, and along one side of it
    a PTFE strip ``strip`` mm thick.
    """
    return 2 * width / math.pi - strip
