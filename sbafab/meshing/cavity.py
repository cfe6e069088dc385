"""The cavity of a chamber: what its air fills, closed at the inlet's mouth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from sbafab.errors import OutputError
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Contour, Region
from sbafab.laminate.interfaces import Interface
from sbafab.laminate.laminate import Chamber, Laminate
from sbafab.meshing.prisms import SAGITTA, Slab, closed_surface
from sbafab.meshing.surface import Surface


def cavity_slabs(laminate: Laminate, chamber: Chamber) -> list[Slab]:
    """The chamber's pockets and its channels through walls and neck rings, bottom to top.

    Raises OutputError where the chamber has no pocket, or a film between two of its pockets
    closes a channel.
    """
    axes = [bore.centre for bore in laminate.bores if bore.chamber == chamber.name]
    pockets = [
        Slab(Region(tuple(contours)), interface.z, interface.z + interface.gap)
        for interface in laminate.interfaces
        if interface.kind == "chamber"
        and (contours := list(_pocket(interface, chamber.centres, axes)))
    ]
    if not pockets:
        x, y = chamber.centres[0]
        raise OutputError(
            f"Chamber {chamber.name} has no pocket at x {x:.3f}, y {y:.3f}; "
            "a chamber mask must cover that place."
        )
    channels = _channels(laminate, chamber, axes, pockets[0].top, pockets[-1].bottom)
    return sorted([*pockets, *channels], key=lambda slab: slab.bottom)


def cavity(
    laminate: Laminate,
    chamber: Chamber,
    sagitta: float = SAGITTA,
    cuts: Sequence[float] = (),
) -> Surface:
    """The closed surface of a chamber's cavity, normals out of the air.

    Its volume is that of :func:`cavity_slabs`. No face runs across the ``cuts``, x in mm. Raises
    OutputError if it does not close.
    """
    return closed_surface(
        f"the cavity of chamber {chamber.name}", cavity_slabs(laminate, chamber), sagitta, cuts
    )


def _pocket(
    interface: Interface, centres: Sequence[Point], axes: Sequence[Point]
) -> Iterator[Contour]:
    """The unbonded pieces round the centres, open where a channel runs through them."""
    for piece in interface.unbonded.pieces:
        (outer,) = piece.outers
        if any(outer.winding(centre) != 0 for centre in centres):
            yield outer
            for hole in piece.holes:
                on_axis = [axis for axis in axes if hole.winding(axis) != 0]
                if not on_axis or interface.bond.contains(on_axis[0]):
                    yield hole


def _channels(
    laminate: Laminate, chamber: Chamber, axes: Sequence[Point], low: float, high: float
) -> Iterator[Slab]:
    """The openings on the chamber's axes in all that is bonded between two heights in mm."""
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


def _opening(holes: Iterable[Contour], axis: Point) -> Region | None:
    """What the smallest hole round the axis leaves open."""
    round_axis = [hole for hole in holes if hole.winding(axis) != 0]
    if not round_axis:
        return None
    return Region((max(round_axis, key=lambda hole: hole.area).reversed(),))
