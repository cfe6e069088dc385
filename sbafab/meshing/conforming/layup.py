"""Layup that volume and shell mesh share: settings, symmetry, films, voids, film positions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import DesignError, OutputError
from sbafab.geometry.edges import Bounds, Point, unit
from sbafab.geometry.region import Region, disc, polygon, rectangle
from sbafab.laminate.laminate import Chamber, Interface, Laminate, Layer
from sbafab.meshing.conforming.plane import Plane, triangulation
from sbafab.meshing.solid import body_bond, cavity_slabs, parted
from sbafab.meshing.wrap import TubeWrap, tube_wrap

Element = Literal["wedge", "tet"]
Symmetry = Literal["full", "half", "quarter", "sector"]


@dataclass(frozen=True)
class MeshSettings:
    """Settings of the conforming meshes.

    ``h`` is the side of the triangles in mm. ``symmetry``: half of the actuator, the quarter of a
    1-DoF one away from its inlet, or one lobe's sector. ``fill_ul`` is the air per pocket in ul,
    for all balloons or by chamber name; None is the flat shape. ``gaps`` keeps the films a mask's
    thickness apart, with bonds of that thickness; without it films lie on each other, and the
    height is the sum of the TPE films. ``wrapped``: a laminate made for a tube is wrapped round it,
    with the tube's axis along z; otherwise it lies flat.
    """

    h: float = 0.35
    element: Element = "wedge"
    symmetry: Symmetry = "full"
    fill_ul: float | Mapping[str, float] | None = None
    gaps: bool = False
    wrapped: bool = True


# The part of an actuator that represents the whole.


SLACK = 1e-5
"""mm2 by which a profile may differ from its image."""
ON_PLANE = 1e-6
NEAR = 0.01
"""Radius in mm about a chamber's centre: the chamber is meshed if any part of it is."""


class Sector(NamedTuple):
    """Meshed part of the plane, and its symmetry planes by name: directions from the axis."""

    region: Region
    planes: tuple[tuple[str, Point], ...]

    def on_planes(self, points: NDArray[np.float64]) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        """Yield each plane's name and a mask of the points (n, 2) on it."""
        for name, (x, y) in self.planes:
            across = np.abs(points[:, 1] * x - points[:, 0] * y) < ON_PLANE
            if name.startswith("symmetry_sector"):
                across &= points[:, 0] * x + points[:, 1] * y > -ON_PLANE
            yield name, across


def sector(laminate: Laminate, symmetry: Symmetry) -> Sector | None:
    """The part of the laminate to mesh, None for all of it.

    Half: one side of the plane y = 0, or else of x = 0. Quarter: for a stack on the axis, the
    quarter at x < 0, y > 0, which excludes the inlet. Sector: one of several stacks round the axis,
    with its inlet.
    Raises DesignError if the laminate is not symmetric.
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
        f"mesh symmetry {symmetry} is not this laminate's: a profile differs from its image; "
        "use full, or leave out parts on one side only, such as ears and inlet tabs"
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


def images(laminate: Laminate, symmetry: Symmetry) -> dict[str, str]:
    """For each chamber, the one meshed in its place: itself, or one that it is an image of."""
    part = sector(laminate, symmetry)
    chambers = {chamber.name: chamber.centres for chamber in laminate.chambers}
    if part is None:
        return {name: name for name in chambers}
    meshed = [
        name
        for name, centres in chambers.items()
        if any(not (disc(centre, NEAR) & part.region).is_empty for centre in centres)
    ]
    _, (x, y) = part.planes[0]

    def meshed_for(name: str) -> str:
        if name in meshed or symmetry != "half":
            return name if name in meshed else meshed[0]
        a, b = chambers[name][0]
        along = a * x + b * y
        image = 2 * along * x - a, 2 * along * y - b
        return min(meshed, key=lambda twin: math.dist(image, chambers[twin][0]))

    return {name: meshed_for(name) for name in chambers}


# The layup: every TPE film over one triangulation of the plane, and the voids between them.


EDGE = 1e-3
"""mm"""
MOST_ELEMENTS = 3_000_000
KINDS = ("separator", "chamber")


@dataclass(frozen=True)
class Ply:
    """One TPE film. ``cells`` are the triangles it covers, ``bonded`` the triangles bonded to the
    ply below, ``gap`` mm above it; ``area`` is its exact area in mm2.
    """

    layer: Layer
    z: float
    gap: float
    cells: NDArray[np.bool_]
    bonded: NDArray[np.bool_]
    area: float
    bond_area: float

    @property
    def thickness(self) -> float:
        return self.layer.film.thickness

    @property
    def name(self) -> str:
        return f"film_{self.layer.name}"


class MeshedVoid(NamedTuple):
    """Air of a chamber as triangles by ply: open in that film (``in_films``), or ``under`` it."""

    in_films: Mapping[int, NDArray[np.bool_]]
    under: Mapping[int, NDArray[np.bool_]]


@dataclass(frozen=True)
class Layup:
    """Data shared by the meshes of one laminate. ``seats`` are the triangles on the channels' axes
    that hold base and tip: the neck ring with the bore inside it. ``shares`` are the meshed
    fractions of the chambers. Without ``is_thick`` films are their mid-surfaces.
    """

    laminate: Laminate
    settings: MeshSettings
    plane: Plane
    plies: tuple[Ply, ...]
    voids: Mapping[str, MeshedVoid]
    seats: NDArray[np.bool_]
    shares: Mapping[str, float]
    sector: Sector | None
    is_thick: bool = True

    def nodes(self, cells: NDArray[np.bool_]) -> NDArray[np.int64]:
        """The plane's nodes of some triangles."""
        return np.unique(self.plane.triangles[cells])

    @property
    def stacks(self) -> list[tuple[str, Point]]:
        """Chamber and axis of each stack that is meshed, chamber by chamber."""
        chambers = [chamber for chamber in self.laminate.chambers if chamber.name in self.voids]
        return [(chamber.name, centre) for chamber in chambers for centre in chamber.centres]

    @property
    def centres(self) -> tuple[Point, ...]:
        """The axes of all stacks that are meshed."""
        return tuple(centre for _, centre in self.stacks)


def layup(laminate: Laminate, settings: MeshSettings) -> Layup:
    """The films and voids of a laminate over one triangulation.

    Raises DesignError if h does not suit the laminate or the design lacks the symmetry,
    OutputError if bonds touch in one point.
    """
    laminate = parted(laminate)
    _check_size(laminate, settings)
    part = sector(laminate, settings.symmetry)

    @cache
    def clip(region: Region) -> Region:
        return region if part is None else region & part.region

    films = [clip(layer.profile) for layer in laminate.tpe_layers]
    bonds = [Region(), *(clip(_bond(laminate, interface)) for interface in laminate.interfaces)]
    slabs = {chamber.name: list(_void_slabs(laminate, chamber)) for chamber in laminate.chambers}
    seats = {chamber.name: list(_seats(laminate, chamber)) for chamber in laminate.chambers}
    used = [*films, *bonds, *(clip(seat) for of_chamber in seats.values() for seat in of_chamber)]
    used += [clip(region) for of_chamber in slabs.values() for _, _, region in of_chamber]
    regions = [region for region in dict.fromkeys(used) if not region.is_empty]
    plane = triangulation(regions, settings.h)
    row = {region: index for index, region in enumerate(regions)}

    def cells(*whole: Region) -> NDArray[np.bool_]:
        rows = [row[clip(region)] for region in whole if not clip(region).is_empty]
        covered: NDArray[np.bool_] = np.any(plane.inside[rows], axis=0)
        return covered

    plies: list[Ply] = []
    gaps = [0.0, *(interface.gap for interface in laminate.interfaces)]
    for layer, film, bond, gap in zip(laminate.tpe_layers, films, bonds, gaps, strict=True):
        z = sum(ply.thickness for ply in plies)
        places = (layer.z, gap) if settings.gaps else (z, 0.0)
        plies.append(Ply(layer, *places, cells(film), cells(bond), film.area, bond.area))
        _check_apart(plane, plies[-1])
    voids, shares = {}, {}
    for name, of_chamber in slabs.items():
        parts: tuple[dict[int, list[Region]], ...] = ({}, {})
        for place, is_under, region in of_chamber:
            parts[is_under].setdefault(place, []).append(region)
        void = MeshedVoid(*({k: cells(*of) for k, of in each.items()} for each in parts))
        if any(covered.any() for covered in void.under.values()):
            voids[name] = void
            whole = sum(seat.area for seat in seats[name])
            shares[name] = sum(clip(seat).area for seat in seats[name]) / whole
    standing = cells(*(seat for of_chamber in seats.values() for seat in of_chamber))
    return Layup(laminate, settings, plane, tuple(plies), voids, standing, shares, part)


def _check_size(laminate: Laminate, settings: MeshSettings) -> None:
    """Raises DesignError if h is larger than the narrowest ring, or far too small."""
    h = settings.h
    width, place = narrowest_ring(laminate) or (h, "")
    if not 0 < h <= width * (1 + 1e-6):
        raise DesignError(
            f"h = {h:g} mm is larger than {place}, which is {width:.3f} mm wide; "
            f"ask for {width:.3f} mm at most"
            if h > 0
            else f"h = {h:g} mm is not a size for a mesh; ask for 0.35 mm"
        )
    covered = sum(layer.profile.area for layer in laminate.tpe_layers)
    elements = 2.31 * covered / h**2 * (3 if settings.element == "tet" else 1)
    if elements > MOST_ELEMENTS:
        least = h * (elements / MOST_ELEMENTS) ** 0.5
        raise DesignError(
            f"h = {h:g} mm makes about {elements:.2g} elements of this laminate, more than "
            f"{MOST_ELEMENTS:,}; ask for {least:.2f} mm or more"
        )


def narrowest_ring(laminate: Laminate) -> tuple[float, str] | None:
    """Width in mm of the narrowest bonded ring, which is the largest possible h, and its name."""
    return min([*_rings(laminate)] or _open_rings(laminate), default=None)


def _rings(laminate: Laminate) -> Iterator[tuple[float, str]]:
    """Yield the width of each bonded ring along x and y, and its name."""
    for interface in laminate.interfaces:
        ring = "the neck ring" if interface.kind == "separator" else "the bond round the pocket"
        for piece in interface.bond.pieces:
            for hole in piece.holes:
                width = min(_margins(piece.outers[0].bounds, hole.bounds))
                yield width, f"{ring} {_between(interface)}"


def _open_rings(laminate: Laminate) -> Iterator[tuple[float, str]]:
    """Yield the widths of the bond beside each pocket, and its name.

    A lone balloon's ring is open at its inlet, whose strip runs to the edge of the films.
    """
    for interface in laminate.interfaces:
        for outer in interface.unbonded.outers:
            for side in _margins(interface.contact.bounds, outer.bounds):
                if side > EDGE:
                    yield side, f"the bond beside the pocket {_between(interface)}"


def _margins(outer: Bounds, inner: Bounds) -> Bounds:
    (a, b, c, d), (e, f, g, h) = outer, inner
    return e - a, f - b, c - g, d - h


def _between(interface: Interface) -> str:
    return f"between layers {interface.below.index} and {interface.above.index}"


def _bond(laminate: Laminate, interface: Interface) -> Region:
    """Return the bond without snipped-off ears: only the neck rings between balloons."""
    if interface.kind != "separator":
        return body_bond(laminate, interface)
    centres = [centre for chamber in laminate.chambers for centre in chamber.centres]
    necks = [
        piece
        for piece in interface.bond.pieces
        if any(piece.outers[0].winding(centre) for centre in centres)
    ]
    return Region(tuple(contour for piece in necks for contour in piece.contours))


def _seats(laminate: Laminate, chamber: Chamber) -> Iterator[Region]:
    """The discs on which base and tip stand, one per stack."""
    bonds = {kind: [i.bond for i in laminate.interfaces if i.kind == kind] for kind in KINDS}
    for centre in chamber.centres:
        necks = [n for bond in bonds["separator"] for n in bond.outers if n.winding(centre)]
        if necks and laminate.bores:
            yield Region((min(necks, key=lambda outer: outer.area),))
        else:
            rooms = [bond.distance_to_edge(centre) for bond in bonds["chamber"]]
            yield disc(centre, min(room for room in rooms if room > 0) / 2)


def _void_slabs(laminate: Laminate, chamber: Chamber) -> Iterator[tuple[int, bool, Region]]:
    """The chamber's slabs as (ply, True if under the ply instead of in it, region)."""
    films = {layer.z: ply for ply, layer in enumerate(laminate.tpe_layers)}
    gaps = {interface.z: ply for ply, interface in enumerate(laminate.interfaces, start=1)}
    for slab in cavity_slabs(laminate, chamber):
        if slab.bottom in films:
            yield films[slab.bottom], False, slab.region
        else:
            yield gaps[slab.bottom], True, slab.region


def _check_apart(plane: Plane, ply: Ply) -> None:
    """Raises OutputError if two parts of a bond meet in a single point."""
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
            "change a size there by 0.01 mm or more."
        )


# The positions of the films: flat, or lifted off each other by air.


class FormedFilm(NamedTuple):
    """Lower face of a film over the plane's nodes, ``base`` (n, 3) mm, and the unit vectors ``up``
    (n, 3) along which its thickness is measured. ``growth`` is the relative increase of its volume
    over the flat film's, if it is bent round a tube.
    """

    base: NDArray[np.float64]
    up: NDArray[np.float64]
    growth: float = 0.0

    def at(self, height: float) -> NDArray[np.float64]:
        """Points (n, 3) of the film ``height`` mm above its lower face."""
        points: NDArray[np.float64] = self.base + height * self.up
        return points


def flat(layup: Layup) -> list[FormedFilm]:
    """Every film flat, at its height in the stack."""
    return [level(layup, ply.z) for ply in layup.plies]


def level(layup: Layup, z: float) -> FormedFilm:
    """A film flat at one height in mm."""
    plane = layup.plane.points
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(plane), 3))
    return FormedFilm(np.column_stack([plane, np.full(len(plane), z)]), up)


def bodies(stack: Layup) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the body of each node of the plane, and of each stack's centre.

    A body is a connected part above the sheet, such as each oblong balloon stack on it.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    films = [ply.cells for ply in stack.plies if ply.layer.role != "sheet"]
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
"""mm of apparent overlap allowed into the sheet, or past the middle between two balloons."""

LAID = 12
"""A film leaves the tube beside its bond to the sheet with this power of its depth."""


def round_tube(stack: Layup, forms: Sequence[FormedFilm]) -> list[FormedFilm]:
    """The films in their wrapped position if the laminate is on a tube; otherwise unchanged.

    Raises DesignError if filled balloons meet round the tube.
    """
    wrap = tube_wrap(stack.laminate) if stack.settings.wrapped else None
    if wrap is None:
        return list(forms)
    x = stack.plane.points[:, 0]
    on_tube = list(_bodies(stack, wrap, forms))
    placed: list[FormedFilm] = []
    for k, (ply, form) in enumerate(zip(stack.plies, forms, strict=True)):
        if ply.layer.role == "sheet":
            lifted = form.base + np.outer(wrap.raised(x), (0.0, 0.0, 1.0))
            whole = BodyOnTube(wrap, np.arange(len(x)), 0.0, 1.0)
            moved = _moved(stack, ply, form._replace(base=lifted), whole)
        else:
            moved = form
            for body in on_tube:
                is_laid = stack.plies[k - 1].layer.role == "sheet"
                moved = _moved(stack, ply, moved, body, is_laid)
        placed.append(moved)
    _check_room(stack, on_tube, placed)
    return placed


class BodyOnTube(NamedTuple):
    """Nodes of the plane of a body on the sheet, the x it is fixed at, its share of the bend."""

    wrap: TubeWrap
    nodes: NDArray[np.int64]
    middle: float
    share: float

    @property
    def at(self) -> float:
        """The angle in radians round the tube at which it is fixed."""
        return self.middle / (self.wrap.radius + self.wrap.neutral)

    @property
    def bend(self) -> float:
        """Its curvature, 1/mm."""
        return self.share / self.wrap.radius


def _bodies(stack: Layup, wrap: TubeWrap, forms: Sequence[FormedFilm]) -> Iterator[BodyOnTube]:
    of_node, of_centre = bodies(stack)
    top = forms[-1].base[:, 2] + stack.plies[-1].thickness
    x = np.array(stack.centres)[:, 0]
    for body in np.unique(of_centre).tolist():
        nodes, fixed_at = np.flatnonzero(of_node == body), x[of_centre == body]
        # One body of several stacks, joined by a manifold, goes all round.
        share = 1.0
        if len(fixed_at) == 1:
            share = min(1.0, stack.laminate.thickness / max(float(top[nodes].max()), 1e-9))
        yield BodyOnTube(wrap, nodes, float(fixed_at.mean()), share)


def _moved(
    stack: Layup, ply: Ply, form: FormedFilm, body: BodyOnTube, is_laid: bool = False
) -> FormedFilm:
    """The film with the nodes of one body in place.

    If it ``is_laid`` on the sheet, it is drawn down to the tube at its bond and near it.
    """
    wrap, nodes, middle, share = body
    flat = form.base[nodes]
    base, up = form.base.copy(), np.array(form.up)
    base[nodes] = wrap.placed(flat, middle, share)
    lean = wrap.angle(flat[:, 0], middle, share) + body.at
    up[nodes] = np.column_stack([np.cos(lean), np.sin(lean), np.zeros(len(lean))])
    # Points farther out than the sheet's middle are stretched round the tube.
    height = flat[:, 2] + (ply.thickness / 2 if stack.is_thick else 0.0)
    longer = np.zeros(len(base))
    longer[nodes] = (1 + body.bend * height) / (1 + body.bend * wrap.neutral) - 1
    low, high = flat[:, 2].min(), flat[:, 2].max()
    if is_laid and high - low > OVERLAP:
        part = ((high - flat[:, 2]) / (high - low)) ** LAID
        down = part * ((wrap.placed(flat, middle) - base[nodes]) * up[nodes]).sum(axis=1)
        base[nodes] += down[:, None] * up[nodes]
        longer[nodes] += body.bend * down
    cells = stack.plane.triangles[ply.cells]
    sizes = stack.plane.areas()[ply.cells]
    # Only the mid-side nodes carry weight in a second-order triangle.
    growth = float((longer[cells[:, 3:]].mean(axis=1) * sizes).sum() / sizes.sum())
    return FormedFilm(base, up, form.growth + growth)


def _check_room(stack: Layup, on_tube: list[BodyOnTube], placed: Sequence[FormedFilm]) -> None:
    """Raises DesignError if balloons reach past the middle between them, or into the sheet."""
    room, radius = math.pi / len(on_tube), on_tube[0].wrap.radius
    least = radius
    for ply, form in zip(stack.plies, placed, strict=True):
        if ply.layer.role == "sheet":
            least = radius + ply.z + (ply.thickness if stack.is_thick else 0.0)
            continue
        for body in on_tube:
            nodes = np.intersect1d(stack.nodes(ply.cells), body.nodes)
            x, y, _ = form.base[nodes].T
            aside = np.abs(np.angle(np.exp(1j * (np.arctan2(y, x) - body.at))))
            if len(on_tube) > 1 and float((aside - room).max() * radius) > OVERLAP:
                raise DesignError(
                    f"filled balloons meet round the tube of {2 * radius:g} mm: film "
                    f"{ply.layer.index} reaches {math.degrees(aside.max()):.1f} degrees round it "
                    f"where each has {math.degrees(room):.1f}; ask for less fill"
                )
            depth = least - float(np.hypot(x, y).min())
            if depth > OVERLAP:
                raise DesignError(
                    f"film {ply.layer.index} would pass through its sheet by {depth:.3f} mm; "
                    "ask for another fill"
                )
