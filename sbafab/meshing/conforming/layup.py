"""The layup: every TPE film over one triangulation of the plane, and the voids between them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sbafab.errors import DesignError, OutputError
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc
from sbafab.laminate.laminate import Chamber, Interface, Laminate, Layer
from sbafab.meshing.cavity import cavity_slabs
from sbafab.meshing.conforming.plane import Plane, triangulation
from sbafab.meshing.conforming.settings import MeshSettings
from sbafab.meshing.conforming.symmetry import Sector, sector

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

EDGE = 1e-3
"""mm"""
MOST_ELEMENTS = 3_000_000


@dataclass(frozen=True)
class Ply:
    """One TPE film. ``cells`` are the triangles it covers, ``bonded`` those of them that are
    bonded to the ply below, ``gap`` mm above it; ``area`` is its exact area in mm2.
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


@dataclass(frozen=True)
class MeshedVoid:
    """What the air of a chamber fills: triangles by ply that are open in that film, and by ply
    that are open under it. ``volume`` is the exact volume in mm3 when flat.
    """

    in_films: Mapping[int, NDArray[np.bool_]]
    under: Mapping[int, NDArray[np.bool_]]
    volume: float

    @property
    def is_open(self) -> bool:
        """Whether any of it lies in what is meshed."""
        return any(bool(cells.any()) for cells in self.under.values())


@dataclass(frozen=True)
class Layup:
    """All that meshes of one laminate share. ``seats`` are the triangles on the channels' axes by
    which base and tip are held: the neck ring with the bore inside it. ``shares`` tell how much of
    each chamber is meshed. Without ``is_thick`` films are their mid-surfaces.
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

    @property
    def centres(self) -> tuple[Point, ...]:
        """The axes of all stacks that are meshed, chamber by chamber."""
        return tuple(
            centre
            for chamber in self.laminate.chambers
            if chamber.name in self.voids
            for centre in chamber.centres
        )

    @property
    def centre_chambers(self) -> tuple[str, ...]:
        """The chamber of each of the centres."""
        return tuple(
            chamber.name
            for chamber in self.laminate.chambers
            if chamber.name in self.voids
            for _ in chamber.centres
        )


def layup(laminate: Laminate, settings: MeshSettings) -> Layup:
    """The films and voids of a laminate over one triangulation.

    Raises DesignError where h does not suit the laminate or the symmetry is not the design's,
    OutputError where bonds touch in one point.
    """
    _check_size(laminate, settings)
    part = sector(laminate, settings.symmetry)
    clipped: dict[Region, Region] = {}

    def clip(region: Region) -> Region:
        if region not in clipped:
            clipped[region] = region if part is None else region & part.region
        return clipped[region]

    films = [clip(layer.profile) for layer in laminate.tpe_layers]
    bonds = [Region(), *(clip(_bond(laminate, interface)) for interface in laminate.interfaces)]
    slabs = {chamber.name: list(_void_slabs(laminate, chamber)) for chamber in laminate.chambers}
    whole_seats = [
        (chamber.name, s) for chamber in laminate.chambers for s in _seats(laminate, chamber)
    ]
    seat_regions = [clip(seat) for _, seat in whole_seats]
    used = [*films, *bonds, *seat_regions]
    used += [clip(region) for found in slabs.values() for _, _, region in found]
    regions = [region for region in dict.fromkeys(used) if not region.is_empty]
    plane = triangulation(regions, settings.h)
    row = {region: index for index, region in enumerate(regions)}
    nothing = plane.inside[0] & False

    def cells(region: Region) -> NDArray[np.bool_]:
        covered: NDArray[np.bool_] = nothing
        if not region.is_empty:
            covered = plane.inside[row[region]]
        return covered

    heights = list(_heights(laminate, settings.gaps))
    plies = tuple(
        Ply(layer, z, gap, cells(film), cells(bond), film.area, bond.area)
        for layer, film, bond, (z, gap) in zip(
            laminate.tpe_layers, films, bonds, heights, strict=True
        )
    )
    for ply in plies:
        _check_apart(plane, ply)
    voids = {
        name: _void([(place, under, clip(region)) for place, under, region in found], plies, cells)
        for name, found in slabs.items()
    }
    seats = nothing.copy()
    for seat in seat_regions:
        seats |= cells(seat)
    present = {name: void for name, void in voids.items() if void.is_open}
    shares = {
        name: sum(clip(seat).area for owner, seat in whole_seats if owner == name)
        / sum(seat.area for owner, seat in whole_seats if owner == name)
        for name in present
    }
    return Layup(laminate, settings, plane, plies, present, seats, shares, part)


def _check_size(laminate: Laminate, settings: MeshSettings) -> None:
    """Raises DesignError if h is larger than the narrowest ring, or far too small."""
    h = settings.h
    width, place = narrowest_ring(laminate) or (h, "")
    if not 0 < h <= width * (1 + 1e-6):
        raise DesignError(
            f"h = {h:g} mm is larger than {place}, which is {width:.3f} mm wide; "
            f"ask for {width:.3f} mm at most"
            if h > 0
            else f"h = {h:g} mm is no size for a mesh; ask for 0.35 mm"
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
    """Width in mm of the narrowest bonded ring, the largest h there can be, and what it is."""
    return min([*_rings(laminate)] or _open_rings(laminate), default=None)


def _rings(laminate: Laminate) -> Iterator[tuple[float, str]]:
    """Width of each bonded ring along x and y, and what it is called."""
    for interface in laminate.interfaces:
        ring = "the neck ring" if interface.kind == "separator" else "the bond round the pocket"
        layers = f"between layers {interface.below.index} and {interface.above.index}"
        for piece in interface.bond.pieces:
            (low_x, low_y, high_x, high_y) = piece.outers[0].bounds
            for hole in piece.holes:
                left, low, right, high = hole.bounds
                width = min(left - low_x, low - low_y, high_x - right, high_y - high)
                yield width, f"{ring} {layers}"


def _open_rings(laminate: Laminate) -> Iterator[tuple[float, str]]:
    """What is left of the films beside each pocket, on the side where that is least.

    No ring is closed where a lone balloon's inlet leaves it.
    """
    for interface in laminate.interfaces:
        low_x, low_y, high_x, high_y = interface.contact.bounds
        for outer in interface.unbonded.outers:
            left, low, right, high = outer.bounds
            sides = (left - low_x, low - low_y, high_x - right, high_y - high)
            layers = f"between layers {interface.below.index} and {interface.above.index}"
            # The inlet's strip runs to the edge of the films.
            yield from ((s, f"the bond beside the pocket {layers}") for s in sides if s > EDGE)


def _bond(laminate: Laminate, interface: Interface) -> Region:
    """What is bonded when ears are snipped off: between balloons, the neck rings alone."""
    if interface.kind != "separator":
        return interface.bond
    centres = [centre for chamber in laminate.chambers for centre in chamber.centres]
    necks = [
        piece
        for piece in interface.bond.pieces
        if any(piece.outers[0].winding(centre) for centre in centres)
    ]
    return Region(tuple(contour for piece in necks for contour in piece.contours))


def _seats(laminate: Laminate, chamber: Chamber) -> Iterator[Region]:
    """The discs, one a stack, on which base and tip stand."""
    necks = [i.bond for i in laminate.interfaces if i.kind == "separator"]
    for centre in chamber.centres:
        outers = [outer for neck in necks for outer in neck.outers if outer.winding(centre)]
        if outers and laminate.bores:
            yield Region((min(outers, key=lambda outer: outer.area),))
        else:
            yield disc(centre, _room(laminate, centre) / 2)


def _room(laminate: Laminate, centre: Point) -> float:
    pockets = [i for i in laminate.interfaces if i.kind == "chamber"]
    return min(
        distance
        for interface in pockets
        for distance in [interface.bond.distance_to_edge(centre)]
        if distance > 0
    )


def _heights(laminate: Laminate, gaps: bool) -> Iterator[tuple[float, float]]:
    """Height of each film's lower face, and of the gap under it."""
    z = 0.0
    under = [0.0, *(interface.gap for interface in laminate.interfaces)]
    for layer, gap in zip(laminate.tpe_layers, under, strict=True):
        yield (layer.z, gap) if gaps else (z, 0.0)
        z += layer.film.thickness


def _void_slabs(laminate: Laminate, chamber: Chamber) -> Iterator[tuple[int, bool, Region]]:
    """The chamber's slabs as (ply, whether it lies under the ply instead of in it, region)."""
    films = {layer.z: ply for ply, layer in enumerate(laminate.tpe_layers)}
    gaps = {interface.z: ply for ply, interface in enumerate(laminate.interfaces, start=1)}
    for slab in cavity_slabs(laminate, chamber):
        if slab.bottom in films:
            yield films[slab.bottom], False, slab.region
        else:
            yield gaps[slab.bottom], True, slab.region


def _void(
    slabs: list[tuple[int, bool, Region]],
    plies: tuple[Ply, ...],
    cells: Callable[[Region], NDArray[np.bool_]],
) -> MeshedVoid:
    in_films: dict[int, NDArray[np.bool_]] = {}
    under: dict[int, NDArray[np.bool_]] = {}
    volume = 0.0
    for place, is_under, region in slabs:
        held = under if is_under else in_films
        covered = cells(region)
        held[place] = held[place] | covered if place in held else covered
        ply = plies[place]
        volume += region.area * (ply.gap if is_under else ply.thickness)
    return MeshedVoid(in_films, under, volume)


def _check_apart(plane: Plane, ply: Ply) -> None:
    """Raises OutputError where two parts of a bond meet in a single point."""
    import numpy as np

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
