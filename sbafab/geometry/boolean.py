"""Boolean operations on regions of lines and arcs, exact but for points that are made one (SAME).

Contours that meet are laid over each other; a piece stays if what is asked for lies on one side of
it only; the pieces that stay are chained into contours. Those that meet no other stay or fall whole
(``apart.py``). Nothing is flattened on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache, partial
from operator import lt
from typing import TypeVar

from sbafab.geometry.apart import (
    ChainGroup,
    ClosedChain,
    Wound,
    chains_of,
    grouped,
    settled,
    turned_round,
)
from sbafab.geometry.arrangement import Arrangement
from sbafab.geometry.edges import EPSILON, Edge, Point
from sbafab.geometry.inconsistent import GeometryError, InconsistentError
from sbafab.geometry.nanometres import in_reading_order
from sbafab.geometry.pieces import DIGIT, by_owner, overlaid, overlay
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.remembered import MOST, remembered
from sbafab.geometry.tidy import tidy

Found = TypeVar("Found")
WantedTurns = Callable[[int], bool]
"""Whether a place belongs to a region, from how often chains wind round it."""

WAYS = (1, 4, 16, 64)
"""With how many EPSILON edges are cut where they meet, tried in turn; by the last, points within a
quarter of a micrometre are one.
"""


def union(regions: Iterable[Region]) -> Region:
    solid = [region for region in regions if not region.is_empty]
    if len(solid) < 2:
        return solid[0] if solid else Region()
    return _union(*solid)


@remembered
def _union(*regions: Region) -> Region:
    return enclosed([contour for region in regions for contour in region.contours])


def intersection(a: Region, b: Region) -> Region:
    if a.is_empty or b.is_empty:
        return Region()
    return _intersection(a, b)


@remembered
def _intersection(a: Region, b: Region) -> Region:
    return enclosed([*a.contours, *b.contours], 1)


def difference(a: Region, b: Region) -> Region:
    if a.is_empty or b.is_empty:
        return a
    return _difference(a, b)


@remembered
def _difference(a: Region, b: Region) -> Region:
    own, other = ((contour, 1) for contour in a.contours), ((c, -1) for c in b.contours)
    (found,) = _enclosed([*own, *other], [_more_than(0)])
    return found


def divided(region: Region, by: Region) -> tuple[Region, Region]:
    """What of a region lies outside another, and what inside: ``region - by`` and ``region & by``.

    Both come of one arrangement.
    """
    if region.is_empty or by.is_empty:
        return region, Region()
    return _divided(region, by)


@remembered
def _divided(region: Region, by: Region) -> tuple[Region, Region]:
    own, other = ((c, 1) for c in region.contours), ((c, 1 << DIGIT) for c in by.contours)
    outside, inside = _enclosed([*own, *other], [_is_outside, _is_inside])
    return outside, inside


@lru_cache(maxsize=MOST)
def _is_outside(turns: int) -> bool:
    """Whether the first of two regions is there alone."""
    own, other = by_owner(turns, 2)
    return own > 0 >= other


@lru_cache(maxsize=MOST)
def _is_inside(turns: int) -> bool:
    """Whether both of two regions are there."""
    own, other = by_owner(turns, 2)
    return own > 0 and other > 0


def _more_than(turns: int) -> WantedTurns:
    """Wanted is what chains wind round more often than so."""
    return partial(lt, turns)


def wound(edges: Sequence[Edge], above: int) -> Region:
    """The points that closed chains of edges wind round more than ``above`` times.

    Raises GeometryError where no way to cut the edges where they meet gives one answer.
    """
    return arranged([edges], partial(_wound, above))


def _wound(above: int, found: Arrangement) -> Region:
    return _region(_loops(found, _more_than(above)))


def enclosed(contours: Iterable[Contour], above: int = 0) -> Region:
    """The same for contours, each a closed chain by itself."""
    (found,) = _enclosed([(contour, 1) for contour in contours], [_more_than(above)])
    return found


def _enclosed(chains: Iterable[Wound], wanted: Sequence[WantedTurns]) -> list[Region]:
    """The regions of the places that are wanted, from how often chains wind round them."""
    found: list[list[Contour]] = [[] for _ in wanted]
    for group in grouped(chains_of(chains)):
        if group.is_alone:
            own = [_whole(group.chains[0], group.outside, is_in) for is_in in wanted]
        else:
            own = _cut(group, wanted)
        for contours, more in zip(found, own, strict=True):
            contours.extend(more)
    return [Region(in_reading_order(contours)) for contours in found]


def _whole(chain: ClosedChain, outside: int, wanted: WantedTurns) -> list[Contour]:
    """A chain that nothing meets, with the material on its left; nothing if it bounds none."""
    contour = chain.contour
    inside = outside + (-chain.turns if contour.is_hole else chain.turns)
    if wanted(inside) == wanted(outside):
        return []
    return [contour if wanted(outside) == contour.is_hole else turned_round(contour)]


def _cut(group: ChainGroup, wanted: Sequence[WantedTurns]) -> list[list[Contour]]:
    """The contours of each region, where chains meet each other."""
    return _in_some_way(partial(_cut_with, group, wanted))


def _cut_with(
    group: ChainGroup, wanted: Sequence[WantedTurns], tolerance: float
) -> list[list[Contour]]:
    found = Arrangement(overlay(group.edges, tolerance, group.clear))
    return [_contours(_loops(found, is_in, group.outside)) for is_in in wanted]


def _loops(found: Arrangement, wanted: WantedTurns, outside: int = 0) -> Iterable[Sequence[Edge]]:
    """Loops round what is wanted, where other chains wind so often round all of it."""
    return found.loops(
        found.edging({turns for turns in set(found.left) if wanted(turns + outside)})
    )


def _contours(loops: Iterable[Sequence[Edge]]) -> list[Contour]:
    return [settled(contour) for contour in map(tidy, loops) if contour is not None]


def _region(loops: Iterable[Sequence[Edge]]) -> Region:
    """The region inside closed chains that meet nowhere."""
    return Region(in_reading_order(_contours(loops)))


def arranged(owners: Sequence[Iterable[Edge]], read: Callable[[Arrangement], Found]) -> Found:
    """What is read from the closed chains of edges of all owners, laid over each other.

    Raises GeometryError where no way to cut the edges where they meet gives one answer.
    """
    return _in_some_way(partial(_arranged_with, owners, read))


def _arranged_with(
    owners: Sequence[Iterable[Edge]], read: Callable[[Arrangement], Found], tolerance: float
) -> Found:
    return read(Arrangement(overlaid(owners, tolerance)))


def _in_some_way(read: Callable[[float], Found]) -> Found:
    """What is read where edges are cut with a tolerance, the finest that gives one answer."""
    place: Point | None = None
    for coarser in WAYS:
        try:
            return read(coarser * EPSILON)
        except InconsistentError as fault:
            place = place or fault.args[0]
    x, y = place or (0.0, 0.0)
    raise GeometryError(
        f"edges that nearly meet at x {x:.6f}, y {y:.6f} cannot be told apart; change a size "
        "there by 0.001 mm"
    )
