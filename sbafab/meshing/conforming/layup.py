"""Layup shared by volume and shell mesh: settings, symmetry, films, voids, film positions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple

import numpy as np

from sbafab.errors import DesignError, OutputError
from sbafab.geometry.edges import Bounds, Point, unit
from sbafab.geometry.region import Region, disc, polygon, rectangle
from sbafab.laminate.laminate import Chamber, Interface, Laminate, Layer
from sbafab.meshing.conforming.plane import Plane, triangulation
from sbafab.meshing.solid import TubeWrap, body_bond, cavity_slabs, parted, tube_wrap
from sbafab.meshing.surface import Flags, Floats, Ints

Element = Literal["wedge", "tet"]
Symmetry = Literal["full", "half", "quarter", "sector"]


@dataclass(frozen=True)
class MeshSettings:
    """Settings of the conforming meshes.

    ``h`` is the side of the triangles in mm. ``symmetry``: half of the actuator, the quarter of a
    1-DoF one away from its inlet, or one lobe's sector. ``fill_ul`` is the air in every balloon in
    ul; None is the flat shape. ``gaps`` keeps the films a mask's thickness apart, with bonds of
    that thickness; without it films touch, and the height is the sum of the TPE films. ``wrapped``:
    a laminate made for a tube is wrapped around it, with the tube's axis along z; otherwise it is
    flat.
    """

    h: float = 0.35
    element: Element = "wedge"
    symmetry: Symmetry = "full"
    fill_ul: float | None = None
    gaps: bool = False
    wrapped: bool = True


# The part of an actuator that represents the whole.


SLACK = 1e-5
"""mm2 by which a profile may differ from its image."""
ON_PLANE = 1e-6
NEAR = 0.1
"""Radius in mm of the disc about a chamber's centre that stands for the chamber."""


class Sector(NamedTuple):
    """The meshed part of the plane, and its symmetry planes by name: directions from the axis."""

    region: Region
    planes: tuple[tuple[str, Point], ...]

    def on_planes(self, points: Floats) -> Iterator[tuple[str, Flags]]:
        """Yield each plane's name and a mask of the points (n, 2) on it."""
        for name, (x, y) in self.planes:
            across = np.abs(points[:, 1] * x - points[:, 0] * y) < ON_PLANE
            if name.startswith("symmetry_sector"):
                across &= points[:, 0] * x + points[:, 1] * y > -ON_PLANE
            yield name, across


def sector(laminate: Laminate, symmetry: Symmetry) -> Sector | None:
    """Return the part of the laminate to mesh, None for all of it.

    Half: one side of the plane y = 0, else of x = 0. Quarter: for a stack on the axis, the quarter
    at x < 0, y > 0, which excludes the inlet. Sector: one of several stacks around the axis, with
    its inlet. Raises DesignError if the laminate is not symmetric.
    """
    if symmetry == "full":
        return None
    far = 10 * max(map(abs, laminate.bounds)) + 10
    films = [layer.profile for layer in laminate.tpe_layers]
    bonds = [interface.bond for interface in laminate.interfaces]
    regions = list(dict.fromkeys([*films, *bonds]))
    count = len(laminate.chambers)
    if symmetry == "half":
        if all(_covers(_flipped_y(region), region) for region in regions):
            return Sector(rectangle((-far, 0.0), (far, far)), (("symmetry_y", (1.0, 0.0)),))
        if all(_covers(region.mirrored(), region) for region in regions):
            return Sector(rectangle((-far, -far), (0.0, far)), (("symmetry_x", (0.0, 1.0)),))
    elif symmetry == "quarter":
        # A quarter of a single stack on the axis holds a quarter of its chamber.
        is_on_axis = [chamber.centres for chamber in laminate.chambers] == [((0.0, 0.0),)]
        if is_on_axis and all(_is_quarter(laminate, region, far) for region in regions):
            planes = ("symmetry_x", (0.0, 1.0)), ("symmetry_y", (-1.0, 0.0))
            return Sector(rectangle((-far, 0.0), (0.0, far)), planes)
    elif count > 1 and all(_covers(region.turned(360 / count), region) for region in regions):
        rays = [unit(180 / count * share) for share in (-1.0, -0.5, 0.0, 0.5, 1.0)]
        lobe = polygon([(0.0, 0.0), *((far * x, far * y) for x, y in rays)])
        ends = ("symmetry_sector_1", rays[0]), ("symmetry_sector_2", rays[-1])
        return Sector(lobe, ends)
    raise DesignError(
        f"this laminate lacks the mesh symmetry {symmetry}: a profile differs from its image; "
        "use full, or omit parts on one side only, such as ears and inlet tabs"
    )


def _flipped_y(region: Region) -> Region:
    return region.mirrored().turned(180.0)


def _covers(region: Region, image: Region) -> bool:
    return region == image or (image - region).area < SLACK


def _is_quarter(laminate: Laminate, region: Region, far: float) -> bool:
    """Return True if all four quarters are images of each other, apart from the inlet."""
    away = region & rectangle((-far, -far), (0.0, far))
    image = away.mirrored()
    for inlet in laminate.inlets[:1]:
        if inlet.direction[0] > 0:
            image -= rectangle((0.0, -inlet.width / 2), (far, inlet.width / 2))
    return _covers(_flipped_y(away), away) and _covers(region, image)


def meshed_shares(laminate: Laminate, part: Sector | None) -> dict[str, float]:
    """Return the fraction of each chamber in the meshed part."""
    shares = {}
    for chamber in laminate.chambers:
        discs = [disc(centre, NEAR) for centre in chamber.centres]
        meshed = discs if part is None else [place & part.region for place in discs]
        shares[chamber.name] = sum(place.area for place in meshed) / sum(d.area for d in discs)
    return shares


def images(laminate: Laminate, symmetry: Symmetry) -> dict[str, str]:
    """For each chamber, the chamber meshed in its place: itself, or one that it is an image of."""
    part = sector(laminate, symmetry)
    places = {chamber.name: chamber.centres[0] for chamber in laminate.chambers}
    meshed = [name for name, share in meshed_shares(laminate, part).items() if share]

    def meshed_for(name: str) -> str:
        if name in meshed or symmetry != "half" or part is None:
            return name if name in meshed else meshed[0]
        (a, b), (x, y) = places[name], part.planes[0][1]
        along = 2 * (a * x + b * y)
        image = along * x - a, along * y - b
        return min(meshed, key=lambda twin: math.dist(image, places[twin]))

    return {name: meshed_for(name) for name in places}


# The layup: every TPE film over one triangulation of the plane, and the voids between them.


EDGE = 1e-3
"""mm"""
MOST_ELEMENTS = 3_000_000
KINDS = ("separator", "chamber")


class Ply(NamedTuple):
    """One TPE film. ``cells`` are its triangles, ``bonded`` those bonded to the ply below, ``gap``
    mm above it; ``area`` is its exact area in mm2.
    """

    layer: Layer
    z: float
    gap: float
    cells: Flags
    bonded: Flags
    area: float
    bond_area: float

    @property
    def thickness(self) -> float:
        return self.layer.film.thickness

    @property
    def is_sheet(self) -> bool:
        return self.layer.role == "sheet"

    @property
    def name(self) -> str:
        return f"film_{self.layer.name}"


class MeshedVoid(NamedTuple):
    """Air of a chamber as triangles by ply: open in that film (``in_films``), or ``under`` it."""

    in_films: dict[int, Flags]
    under: dict[int, Flags]


@dataclass(frozen=True)
class Layup:
    """Data shared by the meshes of one laminate.

    ``seats`` are the triangles on the channels' axes that hold base and tip: the neck ring with the
    bore inside it. ``shares`` are the meshed fractions of the chambers. Without ``is_thick`` films
    are represented by their mid-surfaces.
    """

    laminate: Laminate
    settings: MeshSettings
    plane: Plane
    plies: tuple[Ply, ...]
    voids: Mapping[str, MeshedVoid]
    seats: Flags
    shares: Mapping[str, float]
    sector: Sector | None
    is_thick: bool = True

    def nodes(self, cells: Flags) -> Ints:
        """Return the plane's nodes of some triangles."""
        return np.unique(self.plane.triangles[cells])

    @property
    def stacks(self) -> list[tuple[str, Point]]:
        """The chamber and axis of each meshed stack, chamber by chamber."""
        chambers = [chamber for chamber in self.laminate.chambers if chamber.name in self.voids]
        return [(chamber.name, centre) for chamber in chambers for centre in chamber.centres]

    @property
    def centres(self) -> tuple[Point, ...]:
        """The axes of all meshed stacks."""
        return tuple(centre for _, centre in self.stacks)


def layup(laminate: Laminate, settings: MeshSettings) -> Layup:
    """Return the films and voids of a laminate over one triangulation.

    Raises DesignError if h does not suit the laminate or the design lacks the symmetry, OutputError
    if bonds touch in one point.
    """
    laminate = parted(laminate)
    _check_size(laminate, settings)
    part = sector(laminate, settings.symmetry)

    @cache
    def clip(region: Region) -> Region:
        return region if part is None else region & part.region

    films = [clip(layer.profile) for layer in laminate.tpe_layers]
    bonds = [Region(), *(clip(_bond(laminate, interface)) for interface in laminate.interfaces)]
    seats = [clip(seat) for chamber in laminate.chambers for seat in _seats(laminate, chamber)]
    slabs = {chamber.name: cavity_slabs(laminate, chamber) for chamber in laminate.chambers}
    used = [*films, *bonds, *seats]
    used += [clip(slab.region) for of_chamber in slabs.values() for slab in of_chamber]
    regions = [region for region in dict.fromkeys(used) if not region.is_empty]
    plane = triangulation(regions, settings.h)
    row = {region: index for index, region in enumerate(regions)}

    def cells(*clipped: Region) -> Flags:
        rows = [row[region] for region in clipped if not region.is_empty]
        covered: Flags = np.any(plane.inside[rows], axis=0)
        return covered

    plies: list[Ply] = []
    gaps = [0.0, *(interface.gap for interface in laminate.interfaces)]
    for layer, film, bond, gap in zip(laminate.tpe_layers, films, bonds, gaps, strict=True):
        z = sum(ply.thickness for ply in plies)
        places = (layer.z, gap) if settings.gaps else (z, 0.0)
        plies.append(Ply(layer, *places, cells(film), cells(bond), film.area, bond.area))
        _check_apart(plane, plies[-1])
    films_at = {layer.z: k for k, layer in enumerate(laminate.tpe_layers)}
    gaps_at = {interface.z: k for k, interface in enumerate(laminate.interfaces, start=1)}
    voids = {}
    for name, of_chamber in slabs.items():
        void = MeshedVoid({}, {})
        for slab in of_chamber:
            at, z = slab.bottom in films_at, slab.bottom
            place, k = (void.in_films, films_at[z]) if at else (void.under, gaps_at[z])
            here = cells(clip(slab.region))
            place[k] = place[k] | here if k in place else here
        if any(covered.any() for covered in void.under.values()):
            voids[name] = void
    shares = meshed_shares(laminate, part)
    return Layup(laminate, settings, plane, tuple(plies), voids, cells(*seats), shares, part)


def _check_size(laminate: Laminate, settings: MeshSettings) -> None:
    """Raise DesignError if h is larger than the narrowest ring, or far too small."""
    h = settings.h
    width, place = narrowest_ring(laminate) or (h, "")
    if not h > 0:
        raise DesignError(f"h = {h:g} mm is not a valid mesh size; use 0.35 mm")
    if h > width * (1 + 1e-6):
        raise DesignError(
            f"h = {h:g} mm is larger than {place}, which is {width:.3f} mm wide; use at most "
            f"{width:.3f} mm"
        )
    covered = sum(layer.profile.area for layer in laminate.tpe_layers)
    elements = 2.31 * covered / h**2 * (3 if settings.element == "tet" else 1)
    if elements > MOST_ELEMENTS:
        least = h * (elements / MOST_ELEMENTS) ** 0.5
        raise DesignError(
            f"h = {h:g} mm gives about {elements:.2g} elements for this laminate, more than "
            f"{MOST_ELEMENTS:,}; use at least {least:.2f} mm"
        )


def narrowest_ring(laminate: Laminate) -> tuple[float, str] | None:
    """Return the width in mm of the narrowest bonded ring, which is the largest possible h, and its
    name.

    A lone balloon's ring is open at its inlet, whose strip runs to the edge of the films: there it
    is the bond beside the pocket.
    """
    rings: list[tuple[float, str]] = []
    beside: list[tuple[float, str]] = []
    for interface in laminate.interfaces:
        between = f"between layers {interface.below.index} and {interface.above.index}"
        ring = "the neck ring" if interface.kind == "separator" else "the bond round the pocket"
        for piece in interface.bond.pieces:
            for hole in piece.holes:
                widths = _margins(piece.outers[0].bounds, hole.bounds)
                rings += [(width, f"{ring} {between}") for width in widths]
        for outer in interface.unbonded.outers:
            widths = _margins(interface.contact.bounds, outer.bounds)
            beside += [(width, f"the bond beside the pocket {between}") for width in widths]
    return min(rings or [row for row in beside if row[0] > EDGE], default=None)


def _margins(outer: Bounds, inner: Bounds) -> Bounds:
    (a, b, c, d), (e, f, g, h) = outer, inner
    return e - a, f - b, c - g, d - h


def _bond(laminate: Laminate, interface: Interface) -> Region:
    """Return the bond without ears that are cut off: only the neck rings between balloons."""
    if interface.kind != "separator":
        return body_bond(interface)
    centres = [centre for chamber in laminate.chambers for centre in chamber.centres]
    return Region(
        tuple(
            contour
            for piece in interface.bond.pieces
            if any(piece.outers[0].winding(centre) for centre in centres)
            for contour in piece.contours
        )
    )


def _seats(laminate: Laminate, chamber: Chamber) -> Iterator[Region]:
    """Return the discs on which base and tip stand, one per stack."""
    bonds = {kind: [i.bond for i in laminate.interfaces if i.kind == kind] for kind in KINDS}
    for centre in chamber.centres:
        necks = [n for bond in bonds["separator"] for n in bond.outers if n.winding(centre)]
        if necks and laminate.bores:
            yield Region((min(necks, key=lambda outer: outer.area),))
        else:
            rooms = [bond.distance_to_edge(centre) for bond in bonds["chamber"]]
            yield disc(centre, min(room for room in rooms if room > 0) / 2)


def _check_apart(plane: Plane, ply: Ply) -> None:
    """Raise OutputError if two parts of a bond meet in a single point."""
    triangles = plane.triangles[ply.bonded]
    middles, times = np.unique(triangles[:, 3:], return_counts=True)
    edge = np.isin(triangles[:, 3:], middles[times == 1])
    starts = triangles[:, :3][edge]
    points, times = np.unique(starts, return_counts=True)
    touching = points[times > 1]
    if len(touching):
        x, y = plane.points[touching[0]]
        raise OutputError(
            f"Bonds under layer {ply.layer.index} touch in one point at x {x:.3f}, y {y:.3f}; "
            "change a dimension there by at least 0.01 mm."
        )


# The positions of the films: heights over the plane, then round a tube.


class FormedFilm(NamedTuple):
    """Lower face of a film over the plane's nodes, ``base`` (n, 3) mm, and the unit vectors ``up``
    (n, 3) of its thickness.

    ``growth`` is the relative increase of its volume over the flat film's, if it is bent around a
    tube.
    """

    base: Floats
    up: Floats
    growth: float = 0.0

    def at(self, height: float) -> Floats:
        """Return points (n, 3) of the film ``height`` mm above its lower face."""
        points: Floats = self.base + height * self.up
        return points


def flat(stack: Layup) -> Floats:
    """Return the heights (plies, plane nodes) in mm of the lower faces of all films, flat."""
    levels = np.array([ply.z for ply in stack.plies])
    return np.repeat(levels[:, None], len(stack.plane.points), axis=1)


TOUCHING = 0.002
"""mm of apparent overlap allowed between films: the error of chords on curved films."""


def check_apart(stack: Layup, heights: Floats) -> None:
    """Raise OutputError if films at these heights intersect."""
    top = np.full(heights.shape[1], -math.inf)
    for ply, height in zip(stack.plies, heights, strict=True):
        nodes = stack.nodes(ply.cells)
        depth = top[nodes] - height[nodes]
        if depth.max() > TOUCHING:
            x, y = stack.plane.points[nodes[depth.argmax()]]
            raise OutputError(
                f"film {ply.layer.index} would pass through one below it by {depth.max():.2f} mm "
                f"at x {x:.3f}, y {y:.3f}; reduce the fill"
            )
        top[nodes] = height[nodes] + (ply.thickness if stack.is_thick else 0.0)


def bodies(stack: Layup) -> tuple[Ints, Ints]:
    """Return the body of each node of the plane, and of each stack's centre.

    A body is a connected part above the sheet, such as each oblong balloon stack on it.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    films = [ply.cells for ply in stack.plies if not ply.is_sheet]
    triangles = stack.plane.triangles[np.any(films, axis=0)]
    count = len(stack.plane.points)
    rows, columns = np.repeat(triangles[:, 0], 5), triangles[:, 1:].ravel()
    links = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    labels = connected_components(links, directed=False)[1].astype(np.int64)
    offsets = stack.plane.points[:, None] - np.array(stack.centres)
    return labels, labels[np.linalg.norm(offsets, axis=2).argmin(axis=0)]


# A laminate on a tube: the sheet wrapped round it, with the balloons on the sheet.
#
# Flat balloons are wrapped with their sheet. Filled ones straighten: they are bent only as far as
# no film is stretched round the tube by more than in the flat laminate, but follow the tube where
# they are bonded to the sheet.


OVERLAP = 1e-3
"""mm of apparent overlap allowed past the middle between two balloons."""

LAID = 12
"""A film leaves the tube beside its bond to the sheet with this power of its depth."""


def formed(stack: Layup, heights: Floats | None = None) -> list[FormedFilm]:
    """Return the films at these heights, by default flat, wrapped if the laminate is on a tube.

    Raises OutputError if films cross, DesignError if filled balloons meet around the tube.
    """
    heights = flat(stack) if heights is None else heights
    check_apart(stack, heights)
    wrap = tube_wrap(stack.laminate) if stack.settings.wrapped else None
    if wrap is not None:
        return list(_round_tube(stack, wrap, heights))
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (heights.shape[1], 3))
    return [FormedFilm(np.column_stack([stack.plane.points, z]), up) for z in heights]


def _round_tube(stack: Layup, wrap: TubeWrap, heights: Floats) -> Iterator[FormedFilm]:
    """Yield the films in their wrapped positions. Raises DesignError if balloons meet.

    A film with a smaller curvature than the tube stays outside its sheet.
    """
    x = stack.plane.points[:, 0]
    of_node, of_centre = bodies(stack)
    masks = [of_node == body for body in np.unique(of_centre)]
    top = heights[-1] + stack.plies[-1].thickness
    # For each node the x at which its body is fixed, and the body's share of the tube's curvature.
    middle, share = np.zeros_like(x), np.ones_like(x)
    for nodes, body in zip(masks, np.unique(of_centre), strict=True):
        fixed_at = np.array(stack.centres)[of_centre == body, 0]
        middle[nodes] = fixed_at.mean()
        # One body of several stacks, joined by a manifold, goes all round.
        if len(fixed_at) == 1:
            height = max(float(top[nodes].max()), 1e-9)
            share[nodes] = min(1.0, stack.laminate.thickness / height)
    for k, (ply, z) in enumerate(zip(stack.plies, heights, strict=True)):
        laid = np.zeros_like(x)
        if ply.is_sheet:
            yield _wrapped(stack, wrap, ply, z + wrap.raised(x), laid, laid + 1.0, laid)
            continue
        for nodes in masks if stack.plies[k - 1].is_sheet else ():
            low, high = z[nodes].min(), z[nodes].max()
            if high - low > OVERLAP:
                laid[nodes] = ((high - z[nodes]) / (high - low)) ** LAID
        film = _wrapped(stack, wrap, ply, z, middle, share, laid)
        there = stack.nodes(ply.cells)
        around = middle[there] / (wrap.radius + wrap.neutral)
        _check_room(wrap, ply, film.base[there], around, len(masks))
        yield film


def _wrapped(
    stack: Layup,
    wrap: TubeWrap,
    ply: Ply,
    z: Floats,
    middle: Floats,
    share: Floats,
    laid: Floats,
) -> FormedFilm:
    """Return a film at heights z, wrapped and drawn down to the tube by the fraction ``laid``."""
    flat_base = np.column_stack([stack.plane.points, z])
    x = flat_base[:, 0]
    base, lean = wrap.placed(flat_base, middle, share), wrap.lean(x, middle, share)
    up = np.column_stack([np.cos(lean), np.sin(lean), np.zeros(len(lean))])
    down = laid * ((wrap.placed(flat_base, middle) - base) * up).sum(axis=1)
    # Points farther out than the sheet's middle are stretched round the tube.
    bend = share / wrap.radius
    height = z + (ply.thickness / 2 if stack.is_thick else 0.0)
    longer = (1 + bend * height) / (1 + bend * wrap.neutral) - 1 + bend * down
    # Only the mid-side nodes carry weight in a second-order triangle.
    growth = longer[stack.plane.triangles[ply.cells, 3:]].mean(axis=1)
    mean = float(np.average(growth, weights=stack.plane.areas()[ply.cells]))
    return FormedFilm(base + down[:, None] * up, up, mean)


def _check_room(wrap: TubeWrap, ply: Ply, points: Floats, around: Floats, bodies: int) -> None:
    """Raise DesignError if a film extends past the middle between two bodies, which are fixed at
    angles ``around`` the tube.
    """
    x, y, _ = points.T
    room = math.pi / bodies
    aside = float(np.abs(np.angle(np.exp(1j * (np.arctan2(y, x) - around)))).max())
    if (aside - room) * wrap.radius > OVERLAP:
        raise DesignError(
            f"filled balloons meet around the tube of {2 * wrap.radius:g} mm: film "
            f"{ply.layer.index} extends {math.degrees(aside):.1f} degrees, but has "
            f"{math.degrees(room):.1f}; reduce the fill"
        )
