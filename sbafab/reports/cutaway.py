"""The piece a picture cuts out of the laminate, so that pockets, bores and neck rings show."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sbafab.geometry.edges import Edge, Line, Point
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import polygon
from sbafab.laminate.laminate import Laminate

LEAST_SECTOR = math.radians(44.0)


@dataclass(frozen=True)
class RemovedSector:
    """A sector with its tip at ``apex``, counter-clockwise from angle ``first`` to ``last``."""

    chamber: str
    apex: Point
    first: float
    last: float
    removed: Region

    def on_face(self, edge: Edge) -> bool:
        """Whether an edge lies on one of the two faces of the cut."""
        if not isinstance(edge, Line):
            return False
        return any(
            all(_off_ray(self.apex, angle, p) < 1e-5 for p in (edge.start, edge.end))
            for angle in (self.first, self.last)
        )


def cutaway(laminate: Laminate) -> RemovedSector:
    """The sector beside one chamber: a face runs through its middle and along its inlet.

    Round a lumen the tip is on the actuator's axis and the other face runs between two lobes;
    else the tip is the chamber's middle and the sector a quarter.
    """
    inlet = next(iter(laminate.inlets), None)
    u, v = inlet.direction if inlet else (1.0, 0.0)
    last = math.atan2(v, u)
    count = len(laminate.chambers)
    if laminate.lumen and count > 1:
        sector = math.pi / count
        while sector < LEAST_SECTOR:
            sector += math.tau / count
        return _sector(laminate, laminate.chambers[0].name, (0.0, 0.0), last - sector, last)
    # The chamber at the sector's open side: the quarter then cuts no other.
    places = [(p, chamber.name) for chamber in laminate.chambers for p in chamber.centres]
    apex, name = max(places, key=lambda place: place[0][0] * v - place[0][1] * u)
    return _sector(laminate, name, apex, last - math.pi / 2, last)


def _sector(
    laminate: Laminate, chamber: str, apex: Point, first: float, last: float
) -> RemovedSector:
    low_x, low_y, high_x, high_y = laminate.bounds
    reach = 4.0 * math.hypot(high_x - low_x, high_y - low_y)
    x, y = apex
    rays = [first, (first + last) / 2, last]
    tips = [(x + reach * math.cos(a), y + reach * math.sin(a)) for a in rays]
    return RemovedSector(chamber, apex, first, last, polygon([apex, *tips]))


def _off_ray(apex: Point, angle: float, p: Point) -> float:
    return abs((p[0] - apex[0]) * math.sin(angle) - (p[1] - apex[1]) * math.cos(angle))
