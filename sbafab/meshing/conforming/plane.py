"""One triangulation of the plane for all layers, arcs as arcs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.errors import DesignError, OutputError
from sbafab.geometry.edges import Arc, Point
from sbafab.geometry.region import Region
from sbafab.meshing.conforming.arrangement import Border, Label, arrangement
from sbafab.meshing.conforming.elements import scaled_jacobians, volumes
from sbafab.meshing.conforming.extras import MISSING
from sbafab.meshing.conforming.narrows import narrows

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LEAST_JACOBIAN = 0.05
"""A curved side that leaves its triangle less than this becomes a chord."""
SHARP = math.radians(40.0)
GRADING = 0.3
"""How fast triangles grow away from a narrow place, as Netgen counts."""


class Plane(NamedTuple):
    """Triangles of second order that conform to every edge of some regions.

    ``points`` (n, 2) mm, the ``corners`` first corner nodes, then the mid-edge ones, which lie
    on the arcs. ``triangles`` (m, 6): three corners counter-clockwise, then the nodes between
    first and second, second and third, third and first. ``inside`` (regions, m) tells which
    triangles make up a region.
    """

    points: NDArray[np.float64]
    corners: int
    triangles: NDArray[np.int64]
    inside: NDArray[np.bool_]

    def areas(self) -> NDArray[np.float64]:
        """Exact area of each curved triangle, mm2."""
        return volumes("triangle6", self.points, self.triangles)


def triangulation(regions: Sequence[Region], h: float) -> Plane:
    """The plane covered by any of the regions, in triangles of about ``h`` mm.

    Triangles are smaller where edges run nearer to each other. Deterministic. Raises DesignError
    where Netgen is not installed, OutputError where it cannot mesh a cell.
    """
    import numpy as np

    borders = arrangement(regions, h)
    labels, points, triangles, cells, sides = _netgen(borders, h)
    points, triangles, cells = _crossings_halved(points, triangles, cells, sides)
    inside = np.array(labels, dtype=bool).T[:, cells]
    corners = len(points)
    triangles, middles = _second_order(points, triangles, sides, borders)
    plane = Plane(np.vstack([points, middles]), corners, triangles, inside)
    return _straightened(plane)


def _netgen(
    borders: Sequence[Border], h: float
) -> tuple[
    list[Label],
    NDArray[np.float64],
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.int64],
]:
    """Labels of cells, points, triangles, each one's cell, and (start, end, border) of sides."""
    import numpy as np

    try:
        from netgen.geom2d import SplineGeometry
        from netgen.meshing import MeshingParameters, SetMessageImportance
    except ImportError:
        raise DesignError(MISSING.format("Netgen")) from None
    SetMessageImportance(0)
    geometry = SplineGeometry()
    vertices: dict[Point, int] = {}

    def vertex(p: Point) -> int:
        if p not in vertices:
            vertices[p] = geometry.AppendPoint(*p)
        return vertices[p]

    domains: dict[Label, int] = {}

    def domain(label: Label) -> int:
        return domains.setdefault(label, len(domains) + 1) if any(label) else 0

    for number, (border, size) in enumerate(zip(borders, narrows(borders, h), strict=True), 1):
        edge = border.edge
        nodes = [vertex(edge.start), vertex(edge.end)]
        if isinstance(edge, Arc):
            nodes.insert(1, geometry.AppendPoint(*_tangents_meet(edge)))
        geometry.Append(
            ["spline3" if isinstance(edge, Arc) else "line", *nodes],
            leftdomain=domain(border.left),
            rightdomain=domain(border.right),
            bc=number,
            maxh=size,
        )
    try:
        mesh = geometry.GenerateMesh(MeshingParameters(maxh=h, grading=GRADING))
    except Exception as error:  # Netgen raises its own type, which it does not export.
        raise OutputError(
            f"The plane could not be meshed at h = {h:g} mm ({error}); ask for another h."
        ) from None
    # A copy: Netgen frees its own with the mesh.
    points = np.array(mesh.Coordinates(), dtype=np.float64)
    found = mesh.Elements2D().NumPy()
    sides = mesh.Elements1D().NumPy()
    triangles = found["nodes"][:, :3].astype(np.int64) - 1
    return (
        list(domains),
        points,
        triangles,
        found["index"].astype(np.int64) - 1,
        np.column_stack([sides["nodes"][:, :2].astype(np.int64) - 1, sides["index"] - 1]),
    )


def _crossings_halved(
    points: NDArray[np.float64],
    triangles: NDArray[np.int64],
    cells: NDArray[np.int64],
    sides: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Triangles with a node on each edge that crosses a cell from border to border.

    Two films bonded at both ends of such an edge, but not along it, would share it otherwise.
    """
    import numpy as np

    on_border = np.zeros(len(points), dtype=bool)
    on_border[sides[:, :2]] = True
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2))
    crossing = {tuple(edge) for edge in edges[on_border[edges].all(axis=1)].tolist()}
    crossing -= {tuple(side) for side in np.sort(sides[:, :2]).tolist()}
    crossing -= _sharp_corners(points, triangles, sides)
    corners: list[list[int] | None] = list(triangles.tolist())
    owners = cells.tolist()
    added: list[NDArray[np.float64]] = []
    touched = np.flatnonzero(on_border[triangles].sum(axis=1) >= 2).tolist()
    for a, b in sorted(crossing):
        middle = len(points) + len(added)
        added.append((points[a] + points[b]) / 2)
        for number in list(touched):
            triangle = corners[number]
            if triangle is None or a not in triangle or b not in triangle:
                continue
            for old in (a, b):
                touched.append(len(corners))
                corners.append([middle if node == old else node for node in triangle])
                owners.append(owners[number])
            corners[number] = None
    kept = [number for number, triangle in enumerate(corners) if triangle is not None]
    return (
        np.vstack([points, *added]),
        np.array([corners[number] for number in kept], dtype=np.int64),
        np.array(owners, dtype=np.int64)[kept],
    )


def _sharp_corners(
    points: NDArray[np.float64], triangles: NDArray[np.int64], sides: NDArray[np.int64]
) -> set[tuple[int, int]]:
    """Edges across from a corner between two borders that is too sharp to halve."""
    import numpy as np

    size = len(points)
    known = np.sort(sides[:, :2])
    keys = known[:, 0] * size + known[:, 1]
    found: set[tuple[int, int]] = set()
    for turn in range(3):
        c, a, b = np.roll(triangles, turn, axis=1).T
        u, v = points[a] - points[c], points[b] - points[c]
        cosine = np.sum(u * v, axis=1) / (np.hypot(*u.T) * np.hypot(*v.T))
        sharp = cosine > math.cos(SHARP)
        for other in (a, b):
            sharp &= np.isin(np.minimum(c, other) * size + np.maximum(c, other), keys)
        across = np.sort(np.column_stack([a, b])[sharp])
        found |= {(i, j) for i, j in across.tolist()}
    return found


def _tangents_meet(arc: Arc) -> Point:
    """The middle control point of the rational parabola that is the arc."""
    half = arc.sweep / 2
    (mx, my), (cx, cy) = arc.at(0.5), arc.centre
    return cx + (mx - cx) / math.cos(half), cy + (my - cy) / math.cos(half)


def _second_order(
    points: NDArray[np.float64],
    corners: NDArray[np.int64],
    sides: NDArray[np.int64],
    borders: Sequence[Border],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Triangles with mid-edge nodes, and the mid-edge points: on the arc where an edge is one."""
    import numpy as np

    count = len(points)
    heads = np.roll(corners, -1, axis=1)
    keys = np.minimum(corners, heads) * count + np.maximum(corners, heads)
    edges, number = np.unique(keys, return_inverse=True)
    middles = (points[edges // count] + points[edges % count]) / 2
    sides = sides[np.array([isinstance(borders[i].edge, Arc) for i in sides[:, 2]], dtype=bool)]
    arcs = [borders[i].edge for i in sides[:, 2]]
    centres = np.array([arc.centre for arc in arcs if isinstance(arc, Arc)]).reshape(-1, 2)
    radii = np.array([arc.radius for arc in arcs if isinstance(arc, Arc)])
    tails, heads = sides[:, 0], sides[:, 1]
    curved = np.searchsorted(edges, np.minimum(tails, heads) * count + np.maximum(tails, heads))
    outward = middles[curved] - centres
    lengths = np.hypot(outward[:, 0], outward[:, 1])
    middles[curved] = centres + outward * (radii / lengths)[:, None]
    return np.hstack([corners, number.reshape(corners.shape) + count]), middles


def _straightened(plane: Plane) -> Plane:
    """The plane with chords for arcs round every triangle that a curved side would fold."""
    import numpy as np

    points = plane.points.copy()
    nodes = plane.triangles
    for _ in range(4):
        folded = nodes[scaled_jacobians("triangle6", points, nodes) < LEAST_JACOBIAN]
        if not len(folded):
            break
        for start, end, middle in ((0, 1, 3), (1, 2, 4), (2, 0, 5)):
            points[folded[:, middle]] = (points[folded[:, start]] + points[folded[:, end]]) / 2
    return plane._replace(points=np.ascontiguousarray(points))
