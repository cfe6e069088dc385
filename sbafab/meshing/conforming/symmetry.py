"""The part of an actuator that stands for the whole."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.errors import DesignError
from sbafab.geometry.edges import Point, unit
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc, polygon
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.settings import Symmetry

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SLACK = 1e-5
"""mm2 by which a profile may differ from its image."""
ON_PLANE = 1e-6
NEAR = 0.01
"""mm round a chamber's centre, any part of which makes it meshed."""


class Sector(NamedTuple):
    """What is kept, and its symmetry planes by name, each along a direction from the axis.

    ``copies`` of it make up the whole.
    """

    region: Region
    planes: tuple[tuple[str, Point], ...]
    copies: int

    def on_planes(self, points: NDArray[np.float64]) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        """Which of the points (n, 2) lie on each plane."""
        import numpy as np

        for name, (x, y) in self.planes:
            across = np.abs(points[:, 1] * x - points[:, 0] * y) < ON_PLANE
            if name.startswith("symmetry_sector"):
                across &= points[:, 0] * x + points[:, 1] * y > -ON_PLANE
            yield name, across


def sector(laminate: Laminate, symmetry: Symmetry) -> Sector | None:
    """The part of the laminate to mesh, None for all of it.

    Half: one side of the plane y = 0, or else of x = 0. Quarter: of a stack on the axis, the one at
    x < 0, y > 0, away from the inlet, which is left out so. Sector: one of several stacks round
    the axis, with its inlet.
    Raises DesignError where the laminate is not symmetric.
    """
    if symmetry == "full":
        return None
    far = 10 * max(map(abs, laminate.bounds)) + 10
    regions = _regions(laminate)
    if symmetry == "half":
        if all(_covers(_flipped_y(region), region) for region in regions):
            box = polygon([(-far, 0.0), (far, 0.0), (far, far), (-far, far)])
            return Sector(box, (("symmetry_y", (1.0, 0.0)),), 2)
        if all(_covers(region.mirrored(), region) for region in regions):
            box = polygon([(-far, -far), (0.0, -far), (0.0, far), (-far, far)])
            return Sector(box, (("symmetry_x", (0.0, 1.0)),), 2)
    elif symmetry == "quarter":
        box = polygon([(-far, 0.0), (0.0, 0.0), (0.0, far), (-far, far)])
        if _is_on_axis(laminate) and all(_is_quarter(laminate, layer) for layer in regions):
            return Sector(box, (("symmetry_x", (0.0, 1.0)), ("symmetry_y", (-1.0, 0.0))), 4)
    else:
        count = len(laminate.chambers)
        if count > 1 and all(_covers(region.turned(360 / count), region) for region in regions):
            return _lobe(count, far)
    raise DesignError(
        f"mesh symmetry {symmetry} is not this laminate's: a profile differs from its image; "
        "use full, or leave out what is on one side only, such as ears and inlet tabs"
    )


def _is_on_axis(laminate: Laminate) -> bool:
    """Whether there is one stack, on the axis: a quarter of it then is a quarter of its chamber."""
    return [chamber.centres for chamber in laminate.chambers] == [((0.0, 0.0),)]


def _regions(laminate: Laminate) -> Sequence[Region]:
    """Each distinct film and bond."""
    films = [layer.profile for layer in laminate.tpe_layers]
    return list(dict.fromkeys([*films, *(interface.bond for interface in laminate.interfaces)]))


def _lobe(count: int, far: float) -> Sector:
    half = 180 / count
    rays = [unit(half * share) for share in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    rim = [(far * x, far * y) for x, y in rays]
    planes = (("symmetry_sector_1", rays[0]), ("symmetry_sector_2", rays[-1]))
    return Sector(polygon([(0.0, 0.0), *rim]), planes, count)


def _flipped_y(region: Region) -> Region:
    return region.mirrored().turned(180.0)


def _covers(region: Region, other: Region) -> bool:
    return region == other or (other - region).area < SLACK


def _is_quarter(laminate: Laminate, region: Region) -> bool:
    """Whether the side away from the inlet is symmetric, and its image too but for the inlet."""
    far = 10 * max(map(abs, laminate.bounds)) + 10
    away = region & polygon([(-far, -far), (0.0, -far), (0.0, far), (-far, far)])
    if not _covers(_flipped_y(away), away):
        return False
    inlet = laminate.inlets[0] if laminate.inlets else None
    image = away.mirrored()
    if inlet is not None and inlet.direction[0] > 0:
        width = inlet.width / 2
        image = image - polygon([(0.0, -width), (far, -width), (far, width), (0.0, width)])
    return _covers(region, image)


def images(laminate: Laminate, symmetry: Symmetry) -> dict[str, str]:
    """For each chamber the one that is meshed in its place: itself, or one it is an image of."""
    part = sector(laminate, symmetry)
    chambers = {chamber.name: chamber.centres for chamber in laminate.chambers}
    if part is None:
        return {name: name for name in chambers}
    meshed = [
        name
        for name, centres in chambers.items()
        if any(not (disc(centre, NEAR) & part.region).is_empty for centre in centres)
    ]
    if symmetry != "half":
        return {name: name if name in meshed else meshed[0] for name in chambers}
    _, (x, y) = part.planes[0]
    found = {}
    for name, centres in chambers.items():
        a, b = centres[0]
        along = a * x + b * y
        image = 2 * along * x - a, 2 * along * y - b
        others = {other: math.dist(image, chambers[other][0]) for other in meshed}
        found[name] = name if name in meshed else min(others, key=lambda other: others[other])
    return found
