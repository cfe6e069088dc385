"""Overlap pairs: segments perpendicular to edges that are barely longer than the shortest one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.geometry.cache import cached
from sbafab.geometry.edge_table import (
    boxes_round,
    columns_of,
    crossings,
    dot,
    length_of,
    touching,
)
from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.region import Region
from sbafab.geometry.width import ASIDE, TOUCH, Boundary, Width, boundary_of, joined, least_of

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices
    from sbafab.geometry.width import Segments

STEP = math.radians(15)
"""Largest sample step along an arc: a shift 7.5 degrees off counts 0.99 of its length."""


def sampled(edges: Sequence[Edge], room: float = 0.0) -> tuple[list[Point], list[int]]:
    """Return samples of all edges, one edge after the other, and the count of each.

    A line has both ends and the midpoint, an arc at least one sample every 15 degrees; the
    outermost samples lie ``room`` mm inside the ends.
    """
    points: list[Point] = []
    counts: list[int] = []
    for edge in edges:
        count = 2
        if isinstance(edge, Arc):
            count = max(2, math.ceil(abs(edge.sweep) / STEP))
        share = room / edge.length if room > 0 else 0.0
        shares = [min(1 - share, max(share, i / count)) for i in range(count + 1)]
        # The ends exactly.
        ends = {0.0: edge.start, 1.0: edge.end}
        points += [ends[t] if t in ends else edge.at(t) for t in shares]
        counts.append(count + 1)
    return points, counts


NEAR = 10 * TOUCH
"""mm from the ends of a segment within which an edge does not cross it."""


class OverlapPairs(NamedTuple):
    """Unique segments perpendicular to edges at both ends: coordinates and lengths."""

    start: Floats
    end: Floats
    value: Floats

    def at(self, some: Bools) -> OverlapPairs:
        """Return the places selected by a mask."""
        return OverlapPairs(self.start[:, some], self.end[:, some], self.value[some])


@cached
def overlap_pairs(
    region: Region, slack: float, sharp: float, least: Width | None = None
) -> OverlapPairs:
    """Return the places of a region that are at most ``slack`` mm wider than the narrowest.

    They include segments perpendicular to both edges, and samples along nearly parallel edges,
    which may become the narrowest if a layer rotates. A corner below ``sharp`` degrees has width 0;
    ``least`` is the least width, if already measured.
    """
    boundary = boundary_of(region, sharp)
    least = least or least_of(boundary, math.inf)
    if least is None or least.value == 0.0:
        ends = [] if least is None else [(*least.start, *least.end)]
        columns = columns_of(ends, 4)
        return OverlapPairs(columns[:2], columns[2:], np.zeros(len(ends)))
    within = least.value + slack
    p, q = joined(boundary.square(within), _from_samples(boundary, within))
    first = _first_of_each(p, q)
    p, q = p.take(first, axis=1), q.take(first, axis=1)
    return OverlapPairs(p, q, length_of(q - p)).at(_clear(p, q, boundary))


def _from_samples(boundary: Boundary, within: float) -> Segments:
    """Samples of edges, and the feet of their normals on facing edges ``within`` a distance, mm."""
    a, b = boundary.pairs(ASIDE, within)
    points, numbers = sampled(boundary.edges)
    counts, samples = np.array(numbers), columns_of(points, 2)
    owner = np.arange(len(counts)).repeat(counts)
    normals = boundary.table.at(owner).normal(samples)
    # One row per pair and sample of its first side.
    rows_of_pair = counts.take(a)
    starts = (counts.cumsum() - counts).take(a)
    row = np.arange(rows_of_pair.sum()) + (starts - rows_of_pair.cumsum() + rows_of_pair).repeat(
        rows_of_pair
    )
    p, n = samples.take(row, axis=1), normals.take(row, axis=1)
    feet, inward, there = boundary.feet(p, b.repeat(rows_of_pair))
    # One row per sample, one column per foot.
    p, n = p[:, :, None], n[:, :, None]
    off = feet - p
    square = dot(n, inward) < -math.cos(ASIDE)
    faces = (dot(off, n) > TOUCH) & (dot(off, inward) < -TOUCH)
    valid = there & square & faces & (length_of(off) <= within)
    place, _ = valid.nonzero()
    return p[:, :, 0].take(place, axis=1), feet[:, valid]


def _first_of_each(p: Floats, q: Floats) -> Indices:
    """Return the numbers of the first segment with given ends, in either order, to 10 nm."""
    ends = np.rint(np.concatenate([p, q]) * 1e5)
    turned = (ends[0] > ends[2]) | ((ends[0] == ends[2]) & (ends[1] > ends[3]))
    ends = np.where(turned, ends[[2, 3, 0, 1]], ends)
    # A stable order, so that the first of equal segments comes first.
    order = np.lexsort(ends)
    ends = ends.take(order, axis=1)
    is_new = np.ones(len(order), dtype=bool)
    is_new[1:] = (ends[:, 1:] != ends[:, :-1]).any(axis=0)
    return np.sort(order[is_new])


def _clear(p: Floats, q: Floats, boundary: Boundary) -> Bools:
    """Return True for segments that no edge crosses; doubtful ones are tested one by one."""
    table = boundary.table
    segment, number = touching(boxes_round(p, q, NEAR), table.box)
    edges = table.at(number)
    start, off = p.take(segment, axis=1), (q - p).take(segment, axis=1)
    length = length_of(off)
    unit = off / length
    along, there = crossings(start, unit, edges, NEAR)
    inner = there & (along > NEAR / 2) & (along < length - NEAR / 2)
    doubtful = np.zeros(len(segment), dtype=bool)
    for at, within in zip(along, inner, strict=True):
        some = within.nonzero()[0]
        here = edges.at(some)
        doubtful[some] |= here.distance(start[:, some] + at[some] * unit[:, some]) < NEAR
    for end in (edges.start, edges.end):
        to_end = end - start
        ahead = dot(to_end, unit)
        aside = np.abs(to_end[0] * unit[1] - to_end[1] * unit[0])
        doubtful |= (aside < NEAR) & (ahead > NEAR / 2) & (ahead < length - NEAR / 2)
    clear = np.ones(p.shape[1], dtype=bool)
    # Not np.unique, which loads masked arrays.
    for place in sorted(set(segment[doubtful].tolist())):
        (px, py), (qx, qy) = p[:, place].tolist(), q[:, place].tolist()
        clear[place] = boundary.is_clear((px, py), (qx, qy))
    return clear
