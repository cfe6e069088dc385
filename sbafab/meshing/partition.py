"""The partition of the plane by the edges of several regions.

Every edge of every region is an edge of the partition, so surfaces put together from its cells
meet edge to edge.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.geometry.facets import facets
from sbafab.geometry.region import Contour, Region

if TYPE_CHECKING:
    import numpy as np
    import shapely
    from numpy.typing import NDArray

GRID = 1e-5
"""Spacing in mm of the grid that vertices are rounded to; single precision tells them apart."""


class Partition(NamedTuple):
    """Cells of the plane between the edges of some regions.

    ``points`` (n, 2) float64 in mm. ``edges`` (m, 2) int64 indices of points, each edge of each
    cell with the cell on its left; ``cells`` (m,) the cell of an edge. ``inside`` (regions,
    cells) bool: which cells make up a region.
    """

    points: NDArray[np.float64]
    edges: NDArray[np.int64]
    cells: NDArray[np.int64]
    inside: NDArray[np.bool_]

    def boundary(self, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Edges (k, 2) round the union of the chosen cells, the cells on their left."""
        import numpy as np

        edges = self.edges[chosen[self.cells]]
        size = len(self.points)
        forth = edges[:, 0] * size + edges[:, 1]
        back = np.sort(edges[:, 1] * size + edges[:, 0])
        # Not np.isin, which loads masked arrays.
        place = np.searchsorted(back[:-1], forth)
        outline: NDArray[np.int64] = edges[back[place] != forth]
        return outline

    def triangles(self, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Triangles (k, 3), counter-clockwise, that fill the union of the chosen cells."""
        import numpy as np
        from manifold3d import triangulate

        loops = _loops(self.boundary(chosen))
        if not loops:
            return np.empty((0, 3), dtype=np.int64)
        order = np.concatenate(loops)
        corners = triangulate([self.points[loop] for loop in loops])
        return order[np.asarray(corners, dtype=np.int64)]


def partition(regions: Sequence[Region], sagitta: float) -> Partition:
    """The cells between all edges of the regions, arcs as chords within ``sagitta`` mm."""
    import numpy as np
    import shapely

    areas = [_polygons(region, sagitta) for region in regions]
    lines = shapely.unary_union([shapely.boundary(area) for area in areas], grid_size=GRID)
    cells = shapely.orient_polygons(shapely.get_parts(shapely.polygonize(shapely.get_parts(lines))))
    within = shapely.get_coordinates(shapely.point_on_surface(cells))
    inside = np.array([shapely.contains_xy(area, within) for area in areas])
    rings, owner = shapely.get_rings(cells, return_index=True)
    coordinates, ring = shapely.get_coordinates(rings, return_index=True)
    steps = np.round(coordinates / GRID).astype(np.int64)
    distinct, index = np.unique(steps, axis=0, return_inverse=True)
    index = index.ravel()
    # A ring ends where it starts; the step to the next ring is no edge.
    joined = ring[:-1] == ring[1:]
    edges = np.column_stack([index[:-1], index[1:]])[joined]
    return Partition(distinct * GRID, edges, owner[ring[:-1][joined]], inside)


def _polygons(region: Region, sagitta: float) -> shapely.MultiPolygon:
    import numpy as np
    import shapely

    def ring(contour: Contour) -> shapely.LinearRing:
        # As an array, which shapely takes without a look at every number of it.
        return shapely.linearrings(np.array(facets(contour, sagitta)))

    pieces = []
    for piece in region.pieces:
        (outer,) = piece.outers
        pieces.append(shapely.polygons(ring(outer), [ring(hole) for hole in piece.holes] or None))
    return shapely.multipolygons(pieces)


def _loops(edges: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Closed chains of points that the directed edges make up, none through a point twice."""
    import numpy as np

    following: defaultdict[int, list[int]] = defaultdict(list)
    for tail, head in edges.tolist():
        following[tail].append(head)
    loops = []
    for start in edges[:, 0].tolist():
        point = start
        path: list[int] = []
        place: dict[int, int] = {}
        while following[point]:
            place[point] = len(path)
            path.append(point)
            point = following[point].pop()
            if point in place:
                loop = path[place[point] :]
                loops.append(np.array(loop, dtype=np.int64))
                del path[place[point] :]
                for passed in loop:
                    del place[passed]
    return loops
