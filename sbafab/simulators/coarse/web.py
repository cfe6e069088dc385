"""The web between the pockets of a lobed plate: half a sector is triangulated, then mirrored."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from sbafab.geometry.edges import Point

Triangle = tuple[int, int, int]
WebNode = tuple[str, int]
"""Which node of a half sector: pocket, outline or lumen with its step, or the junction."""


@dataclass(frozen=True)
class Web:
    """Angles in degrees of the nodes round the actuator's axis, and the triangles of half a sector.

    ``reach`` is how many steps the outline of a lobe has nodes to either side; a node lies
    between every two lobes, ``junction`` mm from the axis.
    """

    lobes: int
    reach: int
    junction: float
    half: tuple[tuple[WebNode, WebNode, WebNode], ...]

    @property
    def lumen_steps(self) -> int:
        """Steps on the lumen from a lobe's direction to the middle between two lobes."""
        return 2 if self.lobes == 2 else 1

    @property
    def lumen(self) -> tuple[float, ...]:
        count = 2 * self.lumen_steps * self.lobes
        return tuple(360 / count * i for i in range(count))

    @property
    def between(self) -> tuple[float, ...]:
        return tuple(360 / self.lobes * (k + 0.5) for k in range(self.lobes))

    def triangles(
        self,
        edges: Sequence[Sequence[int]],
        outlines: Sequence[Mapping[int, int]],
        junctions: Sequence[int],
        lumen: Sequence[int],
    ) -> list[Triangle]:
        """The web's triangles, counter-clockwise from above, from the nodes of all its edges."""
        found: list[Triangle] = []
        for k in range(self.lobes):
            for side in (1, -1):

                def node(place: WebNode, k: int = k, side: int = side) -> int:
                    kind, step = place
                    if kind == "pocket":
                        return edges[k][side * step % len(edges[k])]
                    if kind == "outline":
                        return outlines[k][side * step]
                    if kind == "lumen":
                        return lumen[(2 * k * self.lumen_steps + side * step) % len(lumen)]
                    return junctions[k if side > 0 else k - 1]

                for a, b, c in self.half:
                    corners = (node(a), node(b), node(c))
                    # A mirrored triangle begins with the mirrored edge.
                    found.append(corners if side > 0 else (corners[1], corners[0], corners[2]))
        return found


@cache
def web_of(lobes: int, radii: tuple[float, float, float, float, float], sectors: int) -> Web:
    """The web of a plate; radii in mm: of the chamber axes, pocket, rim, hub and lumen."""
    axis, pocket, rim, hub, lumen = radii
    half = math.pi / lobes
    step = math.tau / sectors

    def off_axis(radius: float, i: int) -> Point:
        return axis + radius * math.cos(step * i), radius * math.sin(step * i)

    junction = _junction(axis, rim, hub, half)
    x, y = junction * math.cos(half), junction * math.sin(half)
    # A node nearer to the junction than a quarter of a step is left to the junction.
    reach = math.floor(math.atan2(y, x - axis) / step - 0.25)
    bare = Web(lobes, reach, junction, ())
    lumen_turn = half / bare.lumen_steps
    places: dict[WebNode, Point] = {("outline", i): off_axis(rim, i) for i in range(reach + 1)}
    places["junction", 0] = x, y
    for i in range(bare.lumen_steps, -1, -1):
        places["lumen", i] = lumen * math.cos(lumen_turn * i), lumen * math.sin(lumen_turn * i)
    for i in range(sectors // 2, -1, -1):
        places["pocket", i] = off_axis(pocket, i)
    return Web(lobes, reach, junction, _triangulated(places))


def _junction(axis: float, rim: float, hub: float, half: float) -> float:
    """Where the outline crosses the middle between two lobes: on the hub, or where lobes meet."""
    apart = axis * math.sin(half)
    return hub if apart >= rim else max(hub, axis * math.cos(half) + math.sqrt(rim**2 - apart**2))


def _triangulated(places: dict[WebNode, Point]) -> tuple[tuple[WebNode, WebNode, WebNode], ...]:
    """Delaunay triangles of the polygon whose corners are given counter-clockwise."""
    import shapely

    # Corners meant to lie on the axis of symmetry must do so for the triangulation.
    names = {(round(x, 9), round(y, 9)): place for place, (x, y) in places.items()}
    polygon = shapely.Polygon(list(names))
    found = []
    for triangle in shapely.constrained_delaunay_triangles(polygon).geoms:
        a, b, c = (names[x, y] for x, y in list(triangle.exterior.coords)[:3])
        corners = (a, b, c) if triangle.exterior.is_ccw else (a, c, b)
        first = corners.index(min(corners))
        found.append((corners[first], corners[first - 2], corners[first - 1]))
    return tuple(sorted(found))
