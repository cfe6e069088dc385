"""The flat solid and cavities, made of prisms over a partition of the plane; also bent around a
tube.

Every edge of every region is an edge of the partition, so surfaces assembled from its cells match
edge to edge.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import OutputError
from sbafab.geometry.contour import Contour, facets
from sbafab.geometry.edges import SAME, Point, box_round
from sbafab.geometry.region import Region, rectangle, strip, union
from sbafab.laminate.laminate import Chamber, Interface, Laminate, Layer
from sbafab.meshing.surface import Flags, Floats, Ints, Surface, Vector, open_edges

if TYPE_CHECKING:
    import shapely

GRID = 1e-5
"""Grid spacing in mm to which vertices are rounded; single precision resolves it."""


class Partition(NamedTuple):
    """Cells into which the edges of regions divide the plane.

    ``points`` (n, 2) float64 in mm. ``edges`` (m, 2) int64 are point indices, directed with their
    cell on the left; an edge between two cells is listed once for each. ``cells`` (m,) is the cell
    of an edge. ``inside`` (regions, cells) bool masks the cells of each region.
    """

    points: Floats
    edges: Ints
    cells: Ints
    inside: Flags

    def boundary(self, chosen: Flags) -> Ints:
        """Edges (k, 2) around the union of the chosen cells, with the cells on their left."""
        edges = self.edges[chosen[self.cells]]
        size = len(self.points)
        forth = edges[:, 0] * size + edges[:, 1]
        back = np.sort(edges[:, 1] * size + edges[:, 0])
        # Not np.isin, which loads masked arrays.
        place = np.searchsorted(back[:-1], forth)
        outline: Ints = edges[back[place] != forth]
        return outline

    def triangles(self, chosen: Flags) -> Ints:
        """Return triangles (k, 3), counter-clockwise, that fill the union of the chosen cells."""
        from manifold3d import triangulate

        loops = loops_of(self.boundary(chosen))
        if not loops:
            return np.empty((0, 3), dtype=np.int64)
        order = np.concatenate(loops)
        corners = triangulate([self.points[loop] for loop in loops])
        return order[np.asarray(corners, dtype=np.int64)]


def partition(regions: Sequence[Region], sagitta: float) -> Partition:
    """The cells between all edges of the regions, with arcs as chords within ``sagitta`` mm."""
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
    """Return the region with arcs as chords that enclose its area."""
    import shapely

    pieces = []
    for piece in region.pieces:
        # As arrays, which shapely takes without checking every number.
        outer, *holes = (
            shapely.linearrings(np.array(facets(contour, sagitta)))
            for contour in (*piece.outers, *piece.holes)
        )
        pieces.append(shapely.polygons(outer, holes or None))
    return shapely.multipolygons(pieces)


def loops_of(edges: Ints) -> list[Ints]:
    """Return the closed chains formed by the directed edges, none through a point twice."""
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
        """The exact volume in mm3: area x thickness."""
        return self.region.area * (self.top - self.bottom)


def fuse(slabs: Sequence[Slab], sagitta: float, step: float = 0.0) -> Surface:
    """Return the surface of the union of the slabs, built film by film from one partition of the
    plane.

    Arcs become chords of equal area within ``sagitta`` mm. Solid booleans are not needed: walls
    stand on the outline of a level, and its difference from the level above or below is a face.
    Faces are split every ``step`` mm of x, not at all if it is 0. (manifold3d's booleans take ten
    times as long, and leave edges that coincide in single precision.)
    """
    regions = list(dict.fromkeys(slab.region for slab in slabs))
    strips = list(_strips(regions, step)) if step else []
    plane = partition([*regions, *strips], sagitta)
    # Rounded to 1e-9 mm, so that touching faces have equal heights.
    spans = [(round(slab.bottom, 9), round(slab.top, 9)) for slab in slabs]
    heights = sorted({height for span in spans for height in span})
    filled = np.zeros((len(heights) - 1, plane.inside.shape[1]), dtype=bool)
    for slab, (bottom, top) in zip(slabs, spans, strict=True):
        levels = slice(heights.index(bottom), heights.index(top))
        filled[levels] |= plane.inside[regions.index(slab.region)]
    faces = _faces(plane, filled, plane.inside[len(regions) :])
    corners, faces = np.unique(faces, return_inverse=True)
    level, corner = np.divmod(corners, len(plane.points))
    points = np.column_stack([plane.points[corner], np.array(heights)[level]])
    return Surface(points, faces.reshape(-1, 3))


def _strips(regions: Sequence[Region], step: float) -> Iterator[Region]:
    """Yield the strips of the plane between the lines at multiples of ``step``."""
    low_x, bottom, high_x, top = box_round([region.bounds for region in regions])
    for number in range(math.floor(low_x / step), math.ceil(high_x / step)):
        yield rectangle((number * step, bottom - 1), ((number + 1) * step, top + 1))


def closed_surface(name: str, slabs: Sequence[Slab], sagitta: float, step: float = 0.0) -> Surface:
    """Return the verified surface of the slabs; ``name`` names it in errors.

    Raises OutputError if an edge does not join two triangles, or the volume deviates.
    """
    surface = sealed(name, fuse(slabs, sagitta, step))
    expected = sum(slab.volume for slab in slabs)
    if not abs(surface.volume - expected) <= VOLUME_TOLERANCE * expected:
        raise OutputError(
            f"The mesh of {name} holds {surface.volume:.4f} mm3, but its films add up to "
            f"{expected:.4f} mm3."
        )
    return surface


def sealed(name: str, surface: Surface) -> Surface:
    """Return the surface itself. Raises OutputError if an edge does not join two triangles."""
    gaps = open_edges(surface)
    if len(gaps):
        x, y, z = gaps[0]
        raise OutputError(
            f"The mesh of {name} is not closed at {len(gaps)} edges, the first at x {x:.3f}, "
            f"y {y:.3f}, z {z:.3f}; separate profiles that touch in one point there."
        )
    return surface


def _faces(plane: Partition, levels: Flags, strips: Flags) -> Ints:
    """Triangles (k, 3) of indices point + level x number of points, levels from the lowest."""
    walls: dict[bytes, Ints] = {}
    lids: dict[bytes, Ints] = {}
    count = len(plane.points)
    nothing = np.zeros((1, levels.shape[1]), dtype=bool)
    faces = []
    for index, (below, here) in enumerate(pairwise(np.vstack([nothing, levels, nothing]))):
        for chosen, order in ((below & ~here, (0, 1, 2)), (here & ~below, (0, 2, 1))):
            if (key := chosen.tobytes()) not in lids:
                parts = [chosen & strip for strip in strips] if len(strips) else [chosen]
                lids[key] = np.concatenate([plane.triangles(part) for part in parts])
            faces.append(lids[key][:, order] + index * count)
        if (key := here.tobytes()) not in walls:
            # Two triangles per edge, from one height to the next.
            (a, b), up = plane.boundary(here).T, count
            halves = [a, b, b + up], [a, b + up, a + up]
            walls[key] = np.concatenate([np.column_stack(half) for half in halves])
        faces.append(walls[key] + index * count)
    return np.concatenate(faces)


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


def folded_strips(interface: Interface) -> Region:
    """Return the strips along the folds of an interface, where film continues to the other half."""
    strips = [strip(*line, 2 * FOLD_WIDTH) for line in interface.fold_lines]
    return interface.contact & union(strips) if strips else Region()


def body_bond(interface: Interface) -> Region:
    """Return the region in which the films of an interface are one body: bonds and fold strips."""
    return union([interface.bond, folded_strips(interface)])


def film_slab(layer: Layer) -> Slab:
    return Slab(layer.profile, layer.z, layer.z + layer.film.thickness)


def gap_slab(interface: Interface, region: Region) -> Slab:
    return Slab(region, interface.z, interface.z + interface.gap)


def solid_slabs(laminate: Laminate) -> list[Slab]:
    """Every TPE layer, and every bond as the mask's thickness filled with TPE, bottom to top."""
    laminate = parted(laminate)
    slabs = [film_slab(layer) for layer in laminate.tpe_layers]
    slabs += [
        gap_slab(interface, body_bond(interface))
        for interface in laminate.interfaces
        if interface.gap and not interface.bond.is_empty
    ]
    return sorted(slabs, key=lambda slab: slab.bottom)


def solid(laminate: Laminate, sagitta: float = SAGITTA, step: float = 0.0) -> Surface:
    """Return the surface of the flat actuator, with open pockets, bores, inlet channels and lumen.

    Its volume equals the sum over :func:`solid_slabs`. Faces are split every ``step`` mm of x.
    Raises OutputError if it is not closed.
    """
    return closed_surface("the solid", solid_slabs(laminate), sagitta, step)


# The cavity of a chamber: the volume of its air, closed at the inlet's mouth.


def cavity_slabs(laminate: Laminate, chamber: Chamber) -> list[Slab]:
    """Return the chamber's pockets and its channels through walls and neck rings, bottom to top.

    Raises OutputError if the chamber has no pocket, or a film between two of its pockets closes a
    channel.
    """
    laminate = parted(laminate)
    axes = [bore.centre for bore in laminate.bores if bore.chamber == chamber.name]
    if laminate.nets:
        # Chambers of nets pass through all drawn holes, not only bores.
        inner = laminate.tpe_layers[1:-1]
        boxes = [hole.bounds for layer in inner for hole in layer.profile.holes]
        axes = [((a + c) / 2, (b + d) / 2) for a, b, c, d in boxes]
    levels = [interface for interface in laminate.interfaces if interface.kind == "chamber"]
    pockets = [
        gap_slab(interface, Region(tuple(contours)))
        for balloon, interface in enumerate(levels, start=1)
        if chamber.is_in(balloon) and (contours := [*_pocket(interface, chamber.centres, axes)])
    ]
    if not pockets:
        x, y = chamber.centres[0]
        raise OutputError(
            f"Chamber {chamber.name} has no pocket at x {x:.3f}, y {y:.3f}; "
            "a chamber mask must cover that place."
        )
    channels = _holes_between if laminate.nets else _channels
    slabs = [*pockets, *channels(laminate, chamber, axes, pockets)]
    return sorted(slabs, key=lambda slab: slab.bottom)


def cavity(laminate: Laminate, chamber: Chamber, step: float = 0.0) -> Surface:
    """Return the closed surface of a chamber's cavity, with outward normals.

    Its volume equals the sum over :func:`cavity_slabs`. Faces are split every ``step`` mm of x.
    Raises OutputError if it is not closed.
    """
    name = f"the cavity of chamber {chamber.name}"
    return closed_surface(name, cavity_slabs(laminate, chamber), SAGITTA, step)


def _pocket(
    interface: Interface, centres: Sequence[Point], axes: Sequence[Point]
) -> Iterator[Contour]:
    """Return the unbonded pieces around the centres, open where a channel passes through them."""
    void = interface.unbonded
    if interface.folds:
        void -= folded_strips(interface)
    # If a seam surrounds a pocket, the area outside the seam surrounds the pocket too.
    innermost = {
        min(round_it, key=lambda piece: piece.outers[0].area)
        for centre in centres
        if (round_it := [p for p in void.pieces if p.outers[0].winding(centre) != 0])
    }
    for piece in (piece for piece in void.pieces if piece in innermost):
        yield piece.outers[0]
        for hole in piece.holes:
            on_axis = [axis for axis in axes if hole.winding(axis) != 0]
            if not on_axis or interface.bond.contains(on_axis[0]):
                yield hole


def _channels(
    laminate: Laminate, chamber: Chamber, axes: Sequence[Point], pockets: Sequence[Slab]
) -> Iterator[Slab]:
    """Return the openings on the chamber's axes through the bonded films between its pockets."""
    low, high = pockets[0].top, pockets[-1].bottom
    slabs = [(f"layer {layer.index}", film_slab(layer)) for layer in laminate.tpe_layers]
    slabs += [
        (f"interface {gap.index}", gap_slab(gap, gap.bond))
        for gap in laminate.interfaces
        if gap.kind == "separator"
    ]
    between = [(name, slab) for name, slab in slabs if low <= (slab.bottom + slab.top) / 2 <= high]
    for name, slab in between:
        for x, y in axes:
            holes = [hole for hole in slab.region.holes if hole.winding((x, y)) != 0]
            if not holes:
                raise OutputError(
                    f"The channel of chamber {chamber.name} is closed at {name}, "
                    f"x {x:.3f}, y {y:.3f}; cut a bore there with a neck ring around it."
                )
            # The area of a hole is negative: this is the smallest.
            smallest = max(holes, key=lambda hole: hole.area)
            yield slab._replace(region=Region((smallest.reversed(),)))


def _holes_between(
    laminate: Laminate, _chamber: Chamber, _axes: Sequence[Point], pockets: Sequence[Slab]
) -> Iterator[Slab]:
    """Return the holes of films that open to a pocket below and to one above."""
    for film in map(film_slab, laminate.tpe_layers):
        below = [pocket.region for pocket in pockets if math.isclose(pocket.top, film.bottom)]
        above = [pocket.region for pocket in pockets if math.isclose(pocket.bottom, film.top)]
        for hole in film.region.holes:
            opening = Region((hole.reversed(),))
            if all(any(not (opening & r).is_empty for r in side) for side in (below, above)):
                yield film._replace(region=opening)


# A flat laminate bent round its tube: x becomes the circumference, z the radial direction.


BENT_SAGITTA = 0.008
"""mm by which a facet of a bent film may deviate from its cylinder; a fifth of a film."""
RAMP = 1.5
"""mm round the tube within which an overlapping end of the sheet climbs onto the other end."""
Numbers = Floats | float


class TubeWrap(NamedTuple):
    """Placement of a flat body around a tube with axis z.

    ``radius`` is the tube's; lengths ``neutral`` mm above it are preserved. An overlapping sheet is
    raised by ``thickness`` at and beyond x = ``seam``. All in mm.
    """

    radius: float
    neutral: float = 0.0
    seam: float = math.inf
    thickness: float = 0.0

    @property
    def step(self) -> float:
        """The distance in mm between the lines along the tube at which facets of a body are cut."""
        return math.sqrt(8 * self.radius * BENT_SAGITTA)

    def placed(self, points: Floats, middle: Numbers = 0.0, share: Numbers = 1.0) -> Floats:
        """Return points (n, 3) of the flat laminate, with z from the tube's surface, around the
        tube.

        A body fixed at x = ``middle`` may be bent by a fraction ``share`` of the tube's curvature:
        0 leaves it straight, on the tangent. Both may be given for each point.
        """
        x, y, z = points.T
        at, bend = middle / (self.radius + self.neutral), share / self.radius
        angle = self.lean(x, middle, share) - at
        safe = np.where(bend > 0, bend, 1.0)
        # 2 sin^2(a/2) / bend is (1 - cos a) / bend without its cancellation.
        sag = np.where(bend > 0, 2 * np.sin(angle / 2) ** 2 / safe, 0.0)
        sine = np.where(bend > 0, np.sin(angle) / safe, x - middle)
        out, aside = self.radius + z * np.cos(angle) - sag, sine + z * np.sin(angle)
        cos, sin = np.cos(at), np.sin(at)
        return np.column_stack([out * cos - aside * sin, out * sin + aside * cos, y])

    def lean(self, x: Floats, middle: Numbers = 0.0, share: Numbers = 1.0) -> Floats:
        """Return the angle in radians around the tube of the normal of a body at x."""
        at, bend = middle / (self.radius + self.neutral), share / self.radius
        return bend * (x - middle) / (1 + bend * self.neutral) + at

    def raised(self, x: Floats) -> Floats:
        """Return the height in mm by which the sheet is lifted by its overlapping end."""
        return self.thickness * np.clip((x - self.seam) / RAMP + 1, 0, 1)


def tube_wrap(laminate: Laminate) -> TubeWrap | None:
    """Return the placement of a laminate around its tube, or None for one without a tube."""
    if laminate.tube is None:
        return None
    sheet = laminate.tpe_layers[0]
    radius, neutral = laminate.tube / 2, sheet.film.thickness / 2
    low, _, high, _ = sheet.profile.bounds
    # A full turn of the sheet, less the maximum width of a solid's facets.
    seam = low + math.tau * (radius + neutral) - RAMP
    thickness = 2 * (neutral + BENT_SAGITTA) if high > seam + RAMP else 0.0
    return TubeWrap(radius, neutral, seam, thickness)


def wrapped(surface: Surface, wrap: TubeWrap) -> Surface:
    """The surface of a flat body, already cut every ``wrap.step``, wrapped around its tube."""
    x, y, z = surface.points.T
    return Surface(wrap.placed(np.column_stack([x, y, z + wrap.raised(x)])), surface.faces)


def bent_point(p: Vector, radius: float) -> Vector:
    """Return the position of a point of a flat body around a tube of this radius about z."""
    x, y, z = TubeWrap(radius).placed(np.array([p]))[0].tolist()
    return x, y, z
