"""The cantilever formula E = F l^3 / (3 delta I) (paper, Sec. 4.4), and the I it takes."""

from __future__ import annotations

from sbafab.geometry.centroid import centroid
from sbafab.geometry.region import Region

SAGITTA = 1e-4


def tip_stiffness(modulus_kpa: float, second_moment: float, length: float) -> float:
    """F / delta in N/mm of a cantilever, from E (kPa), I (mm4) and length (mm)."""
    return 3 * modulus_kpa * 1e-3 * second_moment / length**3


def modulus(force: float, deflection: float, length: float, second_moment: float) -> float:
    """E in kPa, from tip force (N), deflection and length (mm), I (mm4)."""
    return force * length**3 / (3 * deflection * second_moment) * 1e3


def second_moments(region: Region) -> tuple[float, float]:
    """Least and largest second moment of area (mm4) of a section about its centre."""
    x0, y0 = centroid(region)
    xx = yy = xy = 0.0
    for piece in region.polygons(SAGITTA):
        for ring in piece:
            for (xa, ya), (xb, yb) in zip(ring, [*ring[1:], ring[0]], strict=True):
                ax, ay, bx, by = xa - x0, ya - y0, xb - x0, yb - y0
                cross = ax * by - bx * ay
                xx += cross * (ay * ay + ay * by + by * by) / 12
                yy += cross * (ax * ax + ax * bx + bx * bx) / 12
                xy += cross * (ax * by + 2 * ax * ay + 2 * bx * by + bx * ay) / 24
    middle, half = (xx + yy) / 2, ((xx - yy) ** 2 / 4 + xy * xy) ** 0.5
    return middle - half, middle + half
