"""The 40-plate task: lobed plates, each a little larger than the one before, a DXF file each.

A plate has three lobes round a lumen, with a bore in each; concave corners are filleted.
Lengths in mm. Nothing is imported here, so that every program's virtual environment can.
"""

from __future__ import annotations

import math
from typing import NamedTuple

COUNT = 40
LOBES = 3
FILLET = 1.0


class Plate(NamedTuple):
    """Dimensions of one plate."""

    pocket_radius: float
    bond: float = 0.75
    lumen_radius: float = 1.0
    bore_radius: float = 0.5

    @property
    def lobe_radius(self) -> float:
        return self.pocket_radius + self.bond

    @property
    def hub_radius(self) -> float:
        return self.lumen_radius + self.bond

    @property
    def axes(self) -> list[tuple[float, float]]:
        """Centres of the lobes."""
        radius = self.axis_radius
        turns = [math.tau * i / LOBES for i in range(LOBES)]
        return [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]

    @property
    def axis_radius(self) -> float:
        return self.lumen_radius + self.bond + self.pocket_radius

    @property
    def fillet_axis_radius(self) -> float:
        """Distance of the fillets' centres from the lumen's axis.

        A fillet touches two lobes, so its centre stands on their bisector.
        """
        a, reach, half = self.axis_radius, self.lobe_radius + FILLET, math.pi / LOBES
        return a * math.cos(half) + math.sqrt(reach**2 - (a * math.sin(half)) ** 2)

    @property
    def area(self) -> float:
        """Exact area: the hexagon of lobe and fillet centres, with sectors added and taken."""
        a, reach, half = self.axis_radius, self.lobe_radius + FILLET, math.pi / LOBES
        s = self.fillet_axis_radius
        at_lobe = 2 * math.acos((a**2 + reach**2 - s**2) / (2 * a * reach))
        at_fillet = 2 * math.acos((s**2 + reach**2 - a**2) / (2 * s * reach))
        hexagon = LOBES * a * s * math.sin(half)
        lobes = LOBES * self.lobe_radius**2 / 2 * (math.tau - at_lobe)
        fillets = LOBES * FILLET**2 / 2 * at_fillet
        openings = math.pi * (LOBES * self.bore_radius**2 + self.lumen_radius**2)
        return hexagon + lobes - fillets - openings


def plates() -> list[Plate]:
    return [Plate(pocket_radius=2.5 + i / 500) for i in range(COUNT)]


def file_name(index: int) -> str:
    return f"plate_{index:02d}.dxf"
