"""Films that face each other past films that end between them: every pair, found in one sweep.

Seen from above, a stack of films is a patchwork: at each place the highest film so far. A film
laid on top faces the film just below it over most of its area, which is their interface, and lower
ones where those in between have ended or are open.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from sbafab.geometry.boolean import divided, union
from sbafab.geometry.nearby import widened
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.shapes import disc
from sbafab.laminate.interfaces import Interface
from sbafab.laminate.laminate import LOOSE, Laminate, Layer
from sbafab.rules.limits import TOLERANCE


class Facing(NamedTuple):
    """Two films with no film between them over some area outside pins' openings.

    ``gap`` holds both, the masks it takes to cover that area from above, and as its unbonded
    region what they cover; its index is that of the interface just below the upper film. ``bare``
    is what no mask covers.
    """

    gap: Interface
    bare: Region


class _Seen(NamedTuple):
    """The part of a film that no film covers yet, and outlines that it lies outside of."""

    film: Layer
    region: Region
    outlines: tuple[Contour, ...] = ()


def facing_films(laminate: Laminate) -> tuple[Facing, ...]:
    """Every pair of films, not next to each other, that face each other but in pins' openings.

    Lowest upper film first. Equal shapes are laid on each other once.
    """
    found: list[Facing] = []
    seen: list[_Seen] = []
    shapes = _Shapes(laminate)
    films = laminate.tpe_layers
    for index, film in enumerate(films):
        left: list[_Seen] = []
        for one in seen:
            below, region, outlines = one
            if below is films[index - 1]:
                rest = shapes.left_by_next(index, below, film)
                if rest.contours:
                    left.append(_Seen(below, rest, _outlines_of(film.profile, rest)))
                continue
            if _fits_in(film.profile, outlines):
                left.append(one)
                continue
            shared, rest = shapes.laid(region, film.profile)
            if rest.contours:
                left.append(_Seen(below, rest, _outlines_of(film.profile, rest)))
            if shared.contours:
                faced = shapes.kept_apart(shared, index, below, film)
                if faced is not None:
                    found.append(faced)
        seen = [*left, _Seen(film, film.profile)]
    return tuple(found)


def _outlines_of(film: Region, rest: Region) -> tuple[Contour, ...]:
    """The outlines of a film, if what it leaves of another lies outside them, and not in holes."""
    for hole in film.holes:
        left, low, right, high = widened(hole.bounds, TOLERANCE)
        for outer in rest.outers:
            box = outer.bounds
            if box[0] >= left and box[1] >= low and box[2] <= right and box[3] <= high:
                return ()
    return film.outers


def _fits_in(film: Region, outlines: tuple[Contour, ...]) -> bool:
    """Whether a film's outlines are among these."""
    return bool(outlines) and all(
        any(own is other or own.edges == other.edges for other in outlines) for own in film.outers
    )


class _Shapes:
    """Regions laid on each other, each pair of shapes once."""

    def __init__(self, laminate: Laminate) -> None:
        self.laminate = laminate
        self.openings = pin_openings(laminate)
        # Not methods of its own, or it would hold itself until rings are searched for.
        self.laid = cache(_laid)
        self.minus = cache(_minus)
        self.both = cache(Region.__and__)
        self.union = cache(_union)

    def left_by_next(self, index: int, below: Layer, above: Layer) -> Region:
        """What the film next to it leaves of a film; their contact is known."""
        if below.pattern == above.pattern:
            return Region()
        contact = without_slivers(self.laminate.interfaces[index - 1].contact)
        if not contact.contours:
            return below.profile
        # Interfaces have asked for it as well.
        return without_slivers(divided(below.profile, above.profile)[0])

    def kept_apart(self, region: Region, index: int, below: Layer, above: Layer) -> Facing | None:
        """Two films that face each other over a region; None where it is all pins' openings."""
        facing = bare = self.minus(region, self.openings)
        masks: dict[Region, Layer] = {}
        for layer in reversed(self.laminate.layers[below.index : above.index - 1]):
            if bare.is_empty:
                break
            if layer.is_mask and layer.profile not in masks:
                left = self.minus(bare, layer.profile)
                if left != bare:
                    masks[layer.profile] = layer
                bare = left
        if not masks and bare.is_empty:
            return None
        mask = self.union(tuple(masks))
        unbonded = self.minus(facing, bare) if bare.contours else facing
        contact = self.both(below.profile, above.profile)
        used = tuple(reversed(masks.values()))
        gap = Interface(index, "separator", below, above, used, mask, contact, Region(), unbonded)
        return Facing(gap, bare)


def _laid(seen: Region, film: Region) -> tuple[Region, Region]:
    """What a film covers of a region, and what it leaves."""
    rest, shared = map(without_slivers, divided(seen, film))
    return shared, rest if shared.contours else seen


def _minus(region: Region, other: Region) -> Region:
    return without_slivers(region - other)


def _union(regions: tuple[Region, ...]) -> Region:
    return union(regions)


def pin_openings(laminate: Laminate) -> Region:
    """Where bores, lumen and tooling holes are open, as wide as holes that are still a pin's."""
    places = [(bore.centre, bore.diameter) for bore in laminate.bores]
    places += [(pin.centre, pin.hole) for pin in laminate.pins]
    if laminate.lumen is not None:
        places.append(((0.0, 0.0), laminate.lumen))
    return union(disc(centre, (width + LOOSE) / 2) for centre, width in dict.fromkeys(places))


def without_slivers(region: Region) -> Region:
    """The region without pieces that are on average no wider than TOLERANCE."""
    if region.is_empty:
        return region
    pieces = [piece for piece in region.pieces if _is_wide(piece)]
    if len(pieces) == len(region.outers):
        return region
    return Region(tuple(contour for piece in pieces for contour in piece.contours))


def _is_wide(piece: Region) -> bool:
    return 2 * piece.area > TOLERANCE * sum([contour.length for contour in piece.contours], 0.0)
