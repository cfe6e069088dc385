"""Partition of the plane by the edges of regions, prisms over it, and the flat solid and cavities.

Every edge of every region is an edge of the partition, so surfaces assembled from its cells meet
edge to edge.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import OutputError
from sbafab.geometry.contour import Contour, facets
from sbafab.geometry.edges import SAME, Point
from sbafab.geometry.region import Region, rectangle, strip, union
from sbafab.laminate.laminate import Chamber, Interface, Laminate
from sbafab.meshing.surface import Surface, open_edges

if TYPE_CHECKING:
    import shapely

GRID = 1e-5
"""Grid spacing in mm to which vertices are rounded; single precision resolves it."""


class Partition(NamedTuple):
    """Cells of the plane between the edges of some regions.

    ``points`` (n, 2) float64 in mm. ``edges`` (m, 2) int64 indices of points, each edge of each
    cell with the cell on its left; ``cells`` (m,) the cell of an edge. ``inside`` (regions,
    cells) bool: a mask of the cells of each region.
    """

    points: NDArray[np.float64]
    edges: NDArray[np.int64]
    cells: NDArray[np.int64]
    inside: NDArray[np.bool_]

    def boundary(self, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Edges (k, 2) round the union of the chosen cells, the cells on their left."""
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
        from manifold3d import triangulate

        loops = loops_of(self.boundary(chosen))
        if not loops:
            return np.empty((0, 3), dtype=np.int64)
        order = np.concatenate(loops)
        corners = triangulate([self.points[loop] for loop in loops])
        return order[np.asarray(corners, dtype=np.int64)]


def partition(regions: Sequence[Region], sagitta: float) -> Partition:
    """The cells between all edges of the regions, arcs as chords within ``sagitta`` mm."""
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
    # A ring ends where it starts; skip the step to the next ring.
    joined = ring[:-1] == ring[1:]
    edges = np.column_stack([index[:-1], index[1:]])[joined]
    return Partition(distinct * GRID, edges, owner[ring[:-1][joined]], inside)


def _polygons(region: Region, sagitta: float) -> shapely.MultiPolygon:
    import shapely

    def ring(contour: Contour) -> shapely.LinearRing:
        # As an array, which shapely takes without checking every number.
        return shapely.linearrings(np.array(facets(contour, sagitta)))

    pieces = []
    for piece in region.pieces:
        (outer,) = piece.outers
        pieces.append(shapely.polygons(ring(outer), [ring(hole) for hole in piece.holes] or None))
    return shapely.multipolygons(pieces)


def loops_of(edges: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Closed chains formed by the directed edges, none passing a point twice."""
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


# Prisms over planar regions, and the closed surface of their union.


SAGITTA = 0.0015
"""Default height in mm of an arc over its chord: every point is within 1 um of the arc."""

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


def fuse(slabs: Sequence[Slab], sagitta: float, step: float = 0.0) -> Surface:
    """The surface of the union of the slabs, built film by film from one partition of the plane.

    Arcs become chords within ``sagitta`` mm of them, of equal area. Solid booleans are not needed:
    walls stand on the outline of a level, and its difference from the level above or below is a
    face. Faces are split every ``step`` mm of x, not at all if it is 0.
    (manifold3d's booleans take ten times as long, and leave edges that single precision does not
    tell apart.)
    """
    regions = list(dict.fromkeys(slab.region for slab in slabs))
    strips = list(_strips(regions, step))
    plane = partition([*regions, *strips], sagitta)
    heights, levels = _levels(slabs, regions, plane)
    faces = _faces(plane, levels, plane.inside[len(regions) :])
    count = len(plane.points)
    used = np.zeros(count * len(heights), dtype=bool)
    used[faces] = True
    (corners,) = np.nonzero(used)
    points = np.column_stack([plane.points[corners % count], heights[corners // count]])
    return Surface(points, np.cumsum(used)[faces] - 1)


def _strips(regions: Sequence[Region], step: float) -> Iterator[Region]:
    """Yield the strips of the plane between the lines at multiples of ``step``."""
    low_x, low_y, high_x, high_y = np.array([region.bounds for region in regions]).T
    bottom, top = low_y.min() - 1, high_y.max() + 1
    if not step:
        return
    for number in range(math.floor(low_x.min() / step), math.ceil(high_x.max() / step)):
        yield rectangle((number * step, bottom), ((number + 1) * step, top))


def closed_surface(name: str, slabs: Sequence[Slab], sagitta: float, step: float = 0.0) -> Surface:
    """Return the verified surface of the slabs; ``name`` names it in errors.

    Raises OutputError if an edge does not join two triangles, or the volume is off.
    """
    surface = sealed(name, fuse(slabs, sagitta, step))
    expected = sum(slab.volume for slab in slabs)
    if not abs(surface.volume - expected) <= VOLUME_TOLERANCE * expected:
        raise OutputError(
            f"The mesh of {name} holds {surface.volume:.4f} mm3 where its films add up to "
            f"{expected:.4f} mm3."
        )
    return surface


def sealed(name: str, surface: Surface) -> Surface:
    """The surface itself. Raises OutputError if an edge does not join two triangles."""
    gaps = open_edges(surface)
    if len(gaps):
        x, y, z = gaps[0]
        raise OutputError(
            f"The mesh of {name} is not closed at {len(gaps)} edges, the first at x {x:.3f}, "
            f"y {y:.3f}, z {z:.3f}; move profiles apart that touch in one point there."
        )
    return surface


def _levels(
    slabs: Sequence[Slab], regions: Sequence[Region], plane: Partition
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The heights at which slabs start or end, and the filled cells between successive heights."""
    # Rounded to 1e-9 mm, so that touching faces have equal heights.
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
    """Triangles (k, 3) of indices point + level x number of points, levels from the lowest."""
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
    """Two triangles per edge, from one height to the next."""
    tails, heads = edges.T
    lower = np.column_stack([tails, heads, heads + count])
    upper = np.column_stack([tails, heads + count, tails + count])
    return np.concatenate([lower, upper])


# The flat solid: TPE films and the bonds that join them.


MASKLESS_GAP = 0.02
"""mm by which a gap with seams but no mask opens in solids and meshes, to keep the films apart.
"""
FOLD_WIDTH = 0.5
"""Width in mm along a fold in which the two halves are one body in solids and meshes."""


def parted(laminate: Laminate) -> Laminate:
    """Return the laminate with ``MASKLESS_GAP`` in each gap whose films stay apart without a mask.

    Seams bond such films; the rest of the gap is open, both between balloons and in a chamber.
    """
    opened = {
        interface.above.index
        for interface in laminate.interfaces
        if not interface.masks and abs(interface.gap) < SAME and not interface.unbonded.is_empty
    }
    layers, lift = [], 0.0
    for layer in laminate.layers:
        lift += MASKLESS_GAP if layer.index in opened else 0.0
        layers.append(replace(layer, z=round(layer.z + lift, 9)) if lift else layer)
    return replace(laminate, layers=tuple(layers)) if opened else laminate


def folded_strips(laminate: Laminate, interface: Interface) -> Region:
    """Return the strips along the folds of an interface, where film continues to the other half."""
    layers = interface.below.index, interface.above.index
    folds = [fold for fold in laminate.folds if (fold.lower, fold.upper) == layers]
    strips = [strip(*fold.line, 2 * FOLD_WIDTH) for fold in folds]
    return interface.contact & union(strips) if strips else Region()


def body_bond(laminate: Laminate, interface: Interface) -> Region:
    """Return the region in which the films of an interface are one body: bonds and fold strips."""
    strips = folded_strips(laminate, interface)
    return interface.bond if strips.is_empty else interface.bond | strips


def solid_slabs(laminate: Laminate) -> list[Slab]:
    """Every TPE layer, and every bond as the mask's thickness filled with TPE, bottom to top."""
    laminate = parted(laminate)
    slabs = [
        Slab(layer.profile, layer.z, layer.z + layer.film.thickness)
        for layer in laminate.tpe_layers
    ]
    slabs += [
        Slab(body_bond(laminate, interface), interface.z, interface.z + interface.gap)
        for interface in laminate.interfaces
        if interface.gap and not interface.bond.is_empty
    ]
    return sorted(slabs, key=lambda slab: slab.bottom)


def solid(laminate: Laminate, sagitta: float = SAGITTA, step: float = 0.0) -> Surface:
    """The surface of the flat actuator, pockets, bores, inlet channels and lumen open.

    Its volume equals the sum over :func:`solid_slabs`. Faces are split every ``step`` mm of x.
    Raises OutputError if it does not close.
    """
    return closed_surface("the solid", solid_slabs(laminate), sagitta, step)


# The cavity of a chamber: the volume of its air, closed at the inlet's mouth.


def cavity_slabs(laminate: Laminate, chamber: Chamber) -> list[Slab]:
    """The chamber's pockets and its channels through walls and neck rings, bottom to top.

    Raises OutputError if the chamber has no pocket, or a film between two of its pockets closes a
    channel.
    """
    laminate = parted(laminate)
    axes = [bore.centre for bore in laminate.bores if bore.chamber == chamber.name]
    if laminate.nets:
        # Chambers of nets pass through all drawn holes, not only bores.
        inner = laminate.tpe_layers[1:-1]
        axes = [_middle(hole) for layer in inner for hole in layer.profile.holes]
    levels = [interface for interface in laminate.interfaces if interface.kind == "chamber"]
    pockets = [
        Slab(Region(tuple(contours)), interface.z, interface.z + interface.gap)
        for balloon, interface in enumerate(levels, start=1)
        if chamber.is_in(balloon)
        and (contours := list(_pocket(laminate, interface, chamber.centres, axes)))
    ]
    if not pockets:
        x, y = chamber.centres[0]
        raise OutputError(
            f"Chamber {chamber.name} has no pocket at x {x:.3f}, y {y:.3f}; "
            "a chamber mask must cover that place."
        )
    channels = (
        _holes_between(laminate, pockets)
        if laminate.nets
        else _channels(laminate, chamber, axes, pockets[0].top, pockets[-1].bottom)
    )
    return sorted([*pockets, *channels], key=lambda slab: slab.bottom)


def cavity(
    laminate: Laminate,
    chamber: Chamber,
    sagitta: float = SAGITTA,
    step: float = 0.0,
) -> Surface:
    """The closed surface of a chamber's cavity, with normals that point out of it.

    Its volume equals the sum over :func:`cavity_slabs`. Faces are split every ``step`` mm of x.
    Raises OutputError if it does not close.
    """
    name = f"the cavity of chamber {chamber.name}"
    return closed_surface(name, cavity_slabs(laminate, chamber), sagitta, step)


def _pocket(
    laminate: Laminate, interface: Interface, centres: Sequence[Point], axes: Sequence[Point]
) -> Iterator[Contour]:
    """The unbonded pieces round the centres, open where a channel passes through them."""
    strips = folded_strips(laminate, interface)
    void = interface.unbonded if strips.is_empty else interface.unbonded - strips
    # If a seam surrounds a pocket, the area outside the seam surrounds the pocket too.
    innermost = {
        min(round_it, key=lambda piece: piece.outers[0].area)
        for centre in centres
        if (round_it := [p for p in void.pieces if p.outers[0].winding(centre) != 0])
    }
    for piece in void.pieces:
        if piece in innermost:
            yield piece.outers[0]
            for hole in piece.holes:
                on_axis = [axis for axis in axes if hole.winding(axis) != 0]
                if not on_axis or interface.bond.contains(on_axis[0]):
                    yield hole


def _channels(
    laminate: Laminate, chamber: Chamber, axes: Sequence[Point], low: float, high: float
) -> Iterator[Slab]:
    """The openings on the chamber's axes through bonded films between two heights in mm."""
    films = [
        (f"layer {layer.index}", layer.profile, layer.z, layer.z + layer.film.thickness)
        for layer in laminate.tpe_layers
    ]
    bonds = [
        (f"interface {gap.index}", gap.bond, gap.z, gap.z + gap.gap)
        for gap in laminate.interfaces
        if gap.kind == "separator"
    ]
    for place, region, bottom, top in films + bonds:
        if not low <= (bottom + top) / 2 <= high:
            continue
        for x, y in axes:
            opening = _opening(region.holes, (x, y))
            if opening is None:
                raise OutputError(
                    f"The channel of chamber {chamber.name} is closed at {place}, "
                    f"x {x:.3f}, y {y:.3f}; cut a bore there with a neck ring round it."
                )
            yield Slab(opening, bottom, top)


def _middle(contour: Contour) -> Point:
    low_x, low_y, high_x, high_y = contour.bounds
    return (low_x + high_x) / 2, (low_y + high_y) / 2


def _holes_between(laminate: Laminate, pockets: Sequence[Slab]) -> Iterator[Slab]:
    """The holes of films that open to a pocket below and to one above."""
    for layer in laminate.tpe_layers:
        top = layer.z + layer.film.thickness
        below = [pocket.region for pocket in pockets if math.isclose(pocket.top, layer.z)]
        above = [pocket.region for pocket in pockets if math.isclose(pocket.bottom, top)]
        for hole in layer.profile.holes if below and above else ():
            opening = Region((hole.reversed(),))
            if all(any(not (opening & r).is_empty for r in side) for side in (below, above)):
                yield Slab(opening, layer.z, top)


def _opening(holes: Iterable[Contour], axis: Point) -> Region | None:
    """Return the region that the smallest hole round the axis leaves open, or None."""
    round_axis = [hole for hole in holes if hole.winding(axis) != 0]
    if not round_axis:
        return None
    return Region((max(round_axis, key=lambda hole: hole.area).reversed(),))
