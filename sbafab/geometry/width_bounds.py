"""What is known of widths before they are measured: from circles, and from where contours lie.

Contours have the material on their left here, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

from sbafab.geometry.nearby import widened
from sbafab.geometry.region import Contour

MANY_CIRCLES = 24
"""From which on looking at all pairs costs more than it saves."""


def widest_least(contours: Sequence[Contour]) -> float:
    """No less than the least width, mm: what circles leave between them, or across.

    What lies between two of them may only make it less. Endless where no circle tells.
    """
    circles = [(*one.circle, one.is_hole) for one in contours if one.circle is not None]
    least = min((2 * radius for _, radius, is_hole in circles if not is_hole), default=math.inf)
    if len(circles) > MANY_CIRCLES:
        return least
    for (one, r, one_is_hole), (other, s, other_is_hole) in combinations(circles, 2):
        gap = math.dist(one, other)
        if one_is_hole and other_is_hole:
            width = gap - r - s
        elif one_is_hole != other_is_hole:
            width = (s - r if one_is_hole else r - s) - gap
        else:
            continue
        if 0 < width < least:
            least = width
    return least


def may_be_narrower(contours: Sequence[Contour], than: float) -> Sequence[Contour]:
    """The contours without circles that are as wide, and stay as far from all others.

    No width below ``than`` mm begins, ends or is crossed there.
    """
    if math.isinf(than):
        return contours
    return [
        one
        for one in contours
        if one.circle is None
        or (not one.is_hole and 2 * one.circle[1] < than)
        or _has_near(one, contours, than)
    ]


def _has_near(contour: Contour, others: Sequence[Contour], reach: float) -> bool:
    """Whether another contour may come within ``reach`` of this circle."""
    assert contour.circle is not None
    centre, r = contour.circle
    left, low, right, high = widened(contour.bounds, reach)
    for other in others:
        if other is contour:
            continue
        if other.circle is not None:
            there, s = other.circle
            gap = math.dist(centre, there)
            if max(gap - r - s, abs(r - s) - gap) < reach:
                return True
        elif any(
            box[0] <= right and box[2] >= left and box[1] <= high and box[3] >= low
            for box in other.boxes
        ):
            return True
    return False
