"""One triangulation of the plane for all layers: edges of regions, exact arcs, and sizes."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from sbafab.errors import DesignError, OutputError
from sbafab.geometry.arrangement import Arrangement, by_owner
from sbafab.geometry.boolean import arranged
from sbafab.geometry.edges import Arc, Edge, Point, edge_from_bulge
from sbafab.geometry.region import Region
from sbafab.meshing.conforming.mesh import scaled_jacobians, volumes
from sbafab.meshing.surface import Flags, Floats, Ints

# The plane cut up by the edges of several regions, arcs as arcs.


MISSING = 'conforming meshes need {}; install it with: pip install "sbafab[mesh]"'

Label = tuple[bool, ...]
"""For each region, True if it covers a cell of the plane."""

CUSP = math.radians(8.0)
"""Edges that leave a point at less than this angle are joined for as long as they are near."""
NEAR = 0.03
"""Fraction of h within which they are near."""
COARSE = 0.35
"""h in mm above which a coarser mesh does not move edges any farther."""


class Border(NamedTuple):
    """An edge between two cells, and the regions that cover each side of it."""

    edge: Edge
    left: Label
    right: Label

    def ends_at(self, corner: Point) -> bool:
        return corner in (self.edge.start, self.edge.end)

    def leaving(self, corner: Point) -> Border:
        """Return the border from the corner that it ends at."""
        if self.edge.start == corner:
            return self
        return Border(self.edge.reversed(), self.right, self.left)


def arrangement(regions: Sequence[Region], h: float) -> list[Border]:
    """Return all edges of the regions without duplicates, cut at their intersections.

    Two edges that leave a point in one direction (a fillet and the outline that it joins) are
    merged until they are a small fraction of ``h`` mm apart, so that no cell ends in a cusp.
    """

    def labelled(plan: Arrangement) -> list[Border]:
        count = len(regions)
        sides = [tuple(n > 0 for n in by_owner(turns, count)) for turns in plan.left]
        rows = zip(plan.pieces, sides[::2], sides[1::2], strict=True)
        return [Border(piece.edge, left, right) for piece, left, right in rows if left != right]

    borders = arranged([region.edges for region in regions], labelled)
    return _without_cusps(borders, min(h, COARSE))


def _without_cusps(borders: list[Border], h: float) -> list[Border]:
    """Return the borders with every cusp shortened to the point where its sides separate."""
    leaving: defaultdict[Point, list[int]] = defaultdict(list)
    for number, border in enumerate(borders):
        leaving[border.edge.start].append(number)
        leaving[border.edge.end].append(number)
    shortened: list[Border | None] = list(borders)
    added: list[Border] = []
    for corner, numbers in leaving.items():
        for first, second in combinations(numbers, 2):
            a, b = shortened[first], shortened[second]
            # One may have been cut short by another cusp at this corner.
            if first != second and a and b and a.ends_at(corner) and b.ends_at(corner):
                joined = _joined(a.leaving(corner), b.leaving(corner), h)
                if joined is not None:
                    common, shortened[first], bent, shortened[second] = joined
                    added += [common, bent] if common.left != common.right else [bent]
    return [border for border in shortened if border is not None] + added


def _joined(a: Border, b: Border, h: float) -> tuple[Border, Border, Border, Border | None] | None:
    """Return the part shared by two borders from one corner, and the remainders of both.

    The second one is bent over about ``h`` to start where the first one does.
    """
    (ax, ay), (bx, by) = a.edge.direction(a.edge.start), b.edge.direction(b.edge.start)
    if ax * bx + ay * by <= math.cos(CUSP):
        return None
    apart = _parting(a.edge, b.edge, NEAR * h)
    if apart is None:
        return None
    end, b_end = apart
    # The cusp lies between the two: the common part keeps the outer side of both.
    b_is_left = (b_end[0] - end[0]) * -ay + (b_end[1] - end[1]) * ax > 0
    left, right = (b.left, a.right) if b_is_left else (a.left, b.right)
    rest = b.edge.part(b_end, b.edge.end)
    whole = rest.length < 1.5 * h
    bent = rest if whole else rest.part(b_end, rest.at(h / rest.length))
    return (
        Border(a.edge.part(a.edge.start, end), left, right),
        a._replace(edge=a.edge.part(end, a.edge.end)),
        b._replace(edge=edge_from_bulge(end, bent.end, bent.bulge)),
        None if whole else b._replace(edge=rest.part(bent.end, rest.end)),
    )


def _parting(a: Edge, b: Edge, near: float) -> tuple[Point, Point] | None:
    """Return the points, one on each, where two edges with a common start become ``near`` mm apart.

    None if that happens at the first step, or never.
    """
    steps = 256
    length = min(a.length, b.length)
    for step in range(1, steps):
        along = length * step / steps
        on_b = b.at(along / b.length)
        on_a = a.nearest(on_b)
        if math.dist(on_a, on_b) >= near:
            return (on_a, on_b) if step > 1 else None
    return None


# The size of triangles along each edge, smaller beside narrow places.


ACROSS = 2.0
"""Triangles across a narrow place."""
TURN = 0.5
"""Angle in radians that one side of a triangle may follow an arc: a parabola through three points
of it then encloses the arc's area to 0.05 %."""
LEAST = 0.4
"""Least size of triangles, as a fraction of h."""


def narrows(borders: Sequence[Border], h: float) -> list[float]:
    """Return for each edge the side in mm of the triangles along it: ``h``, or less if needed.

    Along each edge's normals, the next edge that shares no end with it must be at least two
    triangles away; tight arcs have sides of half a radian.
    """
    import shapely

    edges = [border.edge for border in borders]
    counts = [max(2, math.ceil(2 * edge.length / h)) for edge in edges]
    lines = np.array(
        [
            (edge.at(i / count), edge.at((i + 1) / count))
            for edge, count in zip(edges, counts, strict=True)
            for i in range(count)
        ]
    )
    owner = np.repeat(np.arange(len(edges)), counts)
    tails, heads = lines.transpose(1, 0, 2)
    numbers: dict[Point, int] = {}
    ends = np.array(
        [[numbers.setdefault(p, len(numbers)) for p in (e.start, e.end)] for e in edges]
    )
    middles = (tails + heads) / 2
    along = heads - tails
    normals = np.column_stack([-along[:, 1], along[:, 0]])
    normals /= np.hypot(normals[:, 0], normals[:, 1])[:, None]
    far = normals * ACROSS * h
    rays = shapely.linestrings(np.stack([middles - far, middles + far], axis=1))
    ray, chord = shapely.STRtree(shapely.linestrings(lines)).query(rays, predicate="intersects")
    mine, theirs = ends[owner[ray]], ends[owner[chord]]
    apart = ~(mine[:, :, None] == theirs[:, None, :]).any(axis=(1, 2))
    ray, chord = ray[apart], chord[apart]
    # Distance to the chord along the ray; shapely's points differ in the last digits, and with them
    # the mesh.
    a, b = tails[chord] - middles[ray], heads[chord] - middles[ray]
    (x, y), across = normals[ray].T, normals[ray]
    side_a, side_b = (p[:, 0] * y - p[:, 1] * x for p in (a, b))
    run = side_a - side_b
    share = np.divide(side_a, run, out=np.full_like(run, 0.5), where=np.abs(run) > 1e-12)
    reach = np.abs(np.einsum("ij,ij->i", a + share[:, None] * (b - a), across))
    widths = np.full(len(middles), math.inf)
    np.minimum.at(widths, ray, reach)
    sizes = np.array([min(h, TURN * e.radius) if isinstance(e, Arc) else h for e in edges])
    np.minimum.at(sizes, owner, np.maximum(widths / ACROSS, LEAST * h))
    return [float(size) for size in sizes]


# One triangulation of the plane for all layers, arcs as arcs.


LEAST_JACOBIAN = 0.05
"""A curved side that leaves its triangle less than this becomes a chord."""
SHARP = math.radians(40.0)
GRADING = 0.3
"""Growth rate of triangles away from a narrow place, in Netgen's definition."""


class Plane(NamedTuple):
    """Triangles of second order that conform to every edge of some regions.

    ``points`` (n, 2) mm, the ``corners`` first corner nodes, then the mid-edge ones, which lie
    on the arcs. ``triangles`` (m, 6): three corners counter-clockwise, then the nodes between
    first and second, second and third, third and first. ``inside`` (regions, m) is a mask of the
    triangles of each region.
    """

    points: Floats
    corners: int
    triangles: Ints
    inside: Flags

    def areas(self) -> Floats:
        """The exact area of each curved triangle, mm2."""
        return volumes("triangle6", self.points, self.triangles)


def triangulation(regions: Sequence[Region], h: float) -> Plane:
    """Return the plane covered by any of the regions, in triangles of about ``h`` mm.

    Triangles are smaller where edges run closer together. Deterministic. Raises DesignError if
    Netgen is not installed, OutputError if it cannot mesh a cell.
    """
    borders = arrangement(regions, h)
    labels, points, triangles, cells, sides = _netgen(borders, h)
    points, triangles, cells = _crossings_halved(points, triangles, cells, sides)
    inside = np.array(labels, dtype=bool).T[:, cells]
    triangles, middles = _second_order(points, triangles, sides, borders)
    return _straightened(Plane(np.vstack([points, middles]), len(points), triangles, inside))


def _netgen(borders: Sequence[Border], h: float) -> tuple[list[Label], Floats, Ints, Ints, Ints]:
    """Labels of cells, points, triangles, each one's cell, and (start, end, border) of sides."""
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
            f"The plane could not be meshed at h = {h:g} mm ({error}); use another h."
        ) from None
    # Copy: Netgen frees its array with the mesh.
    points = np.array(mesh.Coordinates(), dtype=np.float64)
    elements = mesh.Elements2D().NumPy()
    sides = mesh.Elements1D().NumPy()
    triangles = elements["nodes"][:, :3].astype(np.int64) - 1
    return (
        list(domains),
        points,
        triangles,
        elements["index"].astype(np.int64) - 1,
        np.column_stack([sides["nodes"][:, :2].astype(np.int64) - 1, sides["index"] - 1]),
    )


def _crossings_halved(
    points: Floats, triangles: Ints, cells: Ints, sides: Ints
) -> tuple[Floats, Ints, Ints]:
    """Return triangles with a node on each edge that crosses a cell from border to border.

    Otherwise two films bonded at both ends of such an edge, but not along it, would share it.
    """
    on_border = np.zeros(len(points), dtype=bool)
    on_border[sides[:, :2]] = True
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2))
    crossing = {tuple(edge) for edge in edges[on_border[edges].all(axis=1)].tolist()}
    crossing -= {tuple(side) for side in np.sort(sides[:, :2]).tolist()}
    halved = sorted(crossing - _sharp_corners(points, triangles, sides))
    corners, owners = triangles.tolist(), cells.tolist()
    touched = np.flatnonzero(on_border[triangles].sum(axis=1) >= 2).tolist()
    for middle, (a, b) in enumerate(halved, start=len(points)):
        for number in [n for n in touched if a in corners[n] and b in corners[n]]:
            touched += [len(corners), len(corners) + 1]
            for old in (a, b):
                corners.append([middle if node == old else node for node in corners[number]])
                owners.append(owners[number])
            corners[number] = []
    whole = [number for number, nodes in enumerate(corners) if nodes]
    middles = points[np.array(halved, dtype=np.int64).reshape(-1, 2)].mean(axis=1)
    return (
        np.vstack([points, middles]),
        np.array([corners[number] for number in whole], dtype=np.int64),
        np.array(owners, dtype=np.int64)[whole],
    )


def _sharp_corners(points: Floats, triangles: Ints, sides: Ints) -> set[tuple[int, int]]:
    """Return edges opposite a corner between two borders that is too sharp to halve."""
    size = len(points)
    border_edges = np.sort(sides[:, :2])
    keys = border_edges[:, 0] * size + border_edges[:, 1]
    opposite: set[tuple[int, int]] = set()
    for turn in range(3):
        c, a, b = np.roll(triangles, turn, axis=1).T
        u, v = points[a] - points[c], points[b] - points[c]
        cosine = np.sum(u * v, axis=1) / (np.hypot(*u.T) * np.hypot(*v.T))
        sharp = cosine > math.cos(SHARP)
        for end in (a, b):
            sharp &= np.isin(np.minimum(c, end) * size + np.maximum(c, end), keys)
        across = np.sort(np.column_stack([a, b])[sharp])
        opposite |= {(i, j) for i, j in across.tolist()}
    return opposite


def _tangents_meet(arc: Arc) -> Point:
    """Return the middle control point of the arc as a rational parabola."""
    half = arc.sweep / 2
    (mx, my), (cx, cy) = arc.at(0.5), arc.centre
    return cx + (mx - cx) / math.cos(half), cy + (my - cy) / math.cos(half)


def _second_order(
    points: Floats, corners: Ints, sides: Ints, borders: Sequence[Border]
) -> tuple[Ints, Floats]:
    """Triangles with mid-edge nodes, and the mid-edge points: on the arc for curved edges."""
    count = len(points)
    heads = np.roll(corners, -1, axis=1)
    keys = np.minimum(corners, heads) * count + np.maximum(corners, heads)
    edges, number = np.unique(keys, return_inverse=True)
    middles = (points[edges // count] + points[edges % count]) / 2
    rows = [
        (tail, head, *arc.centre, arc.radius)
        for tail, head, border in sides.tolist()
        if isinstance(arc := borders[border].edge, Arc)
    ]
    tails, heads, x, y, radii = np.array(rows, dtype=float).reshape(-1, 5).T
    curved = np.searchsorted(edges, np.minimum(tails, heads) * count + np.maximum(tails, heads))
    centres = np.column_stack([x, y])
    outward = middles[curved] - centres
    lengths = np.hypot(outward[:, 0], outward[:, 1])
    middles[curved] = centres + outward * (radii / lengths)[:, None]
    return np.hstack([corners, number.reshape(corners.shape) + count]), middles


def _straightened(plane: Plane) -> Plane:
    """The plane with arcs replaced by chords in every triangle that a curved side would fold."""
    points = plane.points.copy()
    nodes = plane.triangles
    for _ in range(4):
        folded = nodes[scaled_jacobians("triangle6", points, nodes) < LEAST_JACOBIAN]
        if not len(folded):
            break
        for start, end, middle in ((0, 1, 3), (1, 2, 4), (2, 0, 5)):
            points[folded[:, middle]] = (points[folded[:, start]] + points[folded[:, end]]) / 2
    return plane._replace(points=np.ascontiguousarray(points))
