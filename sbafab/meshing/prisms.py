"""Prisms over planar regions, and the closed surface of their union."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from sbafab.errors import OutputError
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import rectangle
from sbafab.meshing.partition import Partition, partition
from sbafab.meshing.surface import Surface, open_edges

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SAGITTA = 0.0015
"""Default height in mm of an arc over its chord: no point is farther than 1 um from the arc."""

VOLUME_TOLERANCE = 0.002
"""Largest relative difference between a surface's volume and its sum of area x thickness."""


class Slab(NamedTuple):
    """A region between two heights in mm."""

    region: Region
    bottom: float
    top: float

    @property
    def volume(self) -> float:
        """Exact volume in mm3: area x thickness."""
        return self.region.area * (self.top - self.bottom)


def fuse(slabs: Sequence[Slab], sagitta: float, cuts: Sequence[float] = ()) -> Surface:
    """The surface of the union of the slabs, built film by film from one partition of the plane.

    Arcs become chords within ``sagitta`` mm of them, of equal area. No boolean of solids is
    needed: walls stand on the outline of a level, and what differs from the level above it or
    below it is a face. ``cuts`` (x in mm, ascending) are lines that no face runs across.
    """
    import numpy as np

    regions = list(dict.fromkeys(slab.region for slab in slabs))
    strips = list(_strips(regions, cuts))
    plane = partition([*regions, *strips], sagitta)
    heights, levels = _levels(slabs, regions, plane)
    faces = _faces(plane, levels, plane.inside[len(regions) :])
    count = len(plane.points)
    used = np.zeros(count * len(heights), dtype=bool)
    used[faces] = True
    (corners,) = np.nonzero(used)
    points = np.column_stack([plane.points[corners % count], heights[corners // count]])
    return Surface(points, np.cumsum(used)[faces] - 1)


def _strips(regions: Sequence[Region], cuts: Sequence[float]) -> Iterator[Region]:
    """What lies between two cuts each, and before the first and past the last of them."""
    if not cuts:
        return
    boxes = [region.bounds for region in regions]
    low = min(box[0] for box in boxes) - 1, min(box[1] for box in boxes) - 1
    high = max(box[2] for box in boxes) + 1, max(box[3] for box in boxes) + 1
    for left, right in pairwise([low[0], *cuts, high[0]]):
        yield rectangle((left, low[1]), (right, high[1]))


def closed_surface(
    what: str, slabs: Sequence[Slab], sagitta: float, cuts: Sequence[float] = ()
) -> Surface:
    """The verified surface of the slabs; ``what`` names it in errors.

    Raises OutputError if an edge does not join two triangles, or the volume is off.
    """
    surface = sealed(what, fuse(slabs, sagitta, cuts))
    expected = sum(slab.volume for slab in slabs)
    if not abs(surface.volume - expected) <= VOLUME_TOLERANCE * expected:
        raise OutputError(
            f"The mesh of {what} holds {surface.volume:.4f} mm3 where its films add up to "
            f"{expected:.4f} mm3; ask for a smaller sagitta than {sagitta:g} mm."
        )
    return surface


def sealed(what: str, surface: Surface) -> Surface:
    """The surface itself. Raises OutputError if an edge does not join two triangles."""
    gaps = open_edges(surface)
    if len(gaps):
        x, y, z = gaps[0]
        raise OutputError(
            f"The mesh of {what} is not closed at {len(gaps)} edges, the first at x {x:.3f}, "
            f"y {y:.3f}, z {z:.3f}; move profiles apart that touch in one point there."
        )
    return surface


def _levels(
    slabs: Sequence[Slab], regions: Sequence[Region], plane: Partition
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The heights where something starts or ends, and the filled cells between each two."""
    import numpy as np

    # To 1e-9 mm, so that faces that touch lie at one number.
    spans = [(round(slab.bottom, 9), round(slab.top, 9)) for slab in slabs]
    heights = sorted({height for span in spans for height in span})
    number = {height: index for index, height in enumerate(heights)}
    row = {region: index for index, region in enumerate(regions)}
    filled = np.zeros((len(heights) - 1, plane.inside.shape[1]), dtype=bool)
    for slab, (bottom, top) in zip(slabs, spans, strict=True):
        filled[number[bottom] : number[top]] |= plane.inside[row[slab.region]]
    return np.array(heights), filled


def _faces(
    plane: Partition, levels: NDArray[np.bool_], strips: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Triangles (k, 3) of point + height x number of points, heights counted from the lowest."""
    import numpy as np

    walls: dict[bytes, NDArray[np.int64]] = {}
    lids: dict[bytes, NDArray[np.int64]] = {}
    count = len(plane.points)
    empty = np.zeros((1, levels.shape[1]), dtype=bool)
    faces = []
    for index, (below, here) in enumerate(
        zip(np.vstack([empty, levels]), np.vstack([levels, empty]), strict=True)
    ):
        for chosen, order in ((below & ~here, (0, 1, 2)), (here & ~below, (0, 2, 1))):
            if (key := chosen.tobytes()) not in lids:
                parts = [chosen & strip for strip in strips] if len(strips) else [chosen]
                lids[key] = np.concatenate([plane.triangles(part) for part in parts])
            faces.append(lids[key][:, order] + index * count)
        if (key := here.tobytes()) not in walls:
            walls[key] = _walls(plane.boundary(here), count)
        faces.append(walls[key] + index * count)
    return np.concatenate(faces)


def _walls(edges: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Two triangles an edge, from one height to the next."""
    import numpy as np

    tails, heads = edges.T
    lower = np.column_stack([tails, heads, heads + count])
    upper = np.column_stack([tails, heads + count, tails + count])
    return np.concatenate([lower, upper])
