"""Overlap pairs: segments square on edges that are barely longer than the shortest one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.geometry.cache import cached
from sbafab.geometry.edge_table import (
    SideTable,
    boxes_round,
    columns_of,
    crossings,
    dot,
    touching,
)
from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.region import Region
from sbafab.geometry.width import ASIDE, TOUCH, Gathered, Width, boundary_of, least_of, search

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices

STEP = math.radians(15)
"""Largest sample step along an arc: a shift 7.5 degrees off counts 0.99 of its length."""


def sampled(edges: Sequence[Edge], room: float = 0.0) -> tuple[list[Point], list[int]]:
    """Return samples of all edges, one edge after the other, and the count of each.

    A line has both ends and the middle, an arc at least one sample every 15 degrees; the outermost
    samples lie ``room`` mm inside the ends.
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
    """Segments square on edges at both ends, each once: x and y of both ends, and their lengths."""

    start: Floats
    end: Floats
    value: Floats

    def at(self, some: Bools) -> OverlapPairs:
        """Return the places of a mask."""
        return OverlapPairs(self.start[:, some], self.end[:, some], self.value[some])


@cached
def overlap_pairs(
    region: Region, slack: float, sharp: float, least: Width | None = None
) -> OverlapPairs:
    """Return the places of a region that are at most ``slack`` mm wider than the narrowest.

    They include places where edges are square on each other, and samples along nearly parallel
    edges: these may become the narrowest if a layer turns. A corner below ``sharp`` degrees has
    width 0; ``least`` is the least width, if measured already.
    """
    boundary = boundary_of(region, sharp)
    least = least or least_of(boundary, math.inf)
    if least is None or least.value == 0.0:
        ends = [] if least is None else [(*least.start, *least.end)]
        columns = columns_of(ends, 4)
        return OverlapPairs(columns[:2], columns[2:], np.zeros(len(ends)))
    gathered = Gathered(boundary, least.value + slack)
    search(gathered)
    offered = columns_of([(*p, *q) for p, q in gathered.offered], 4)
    start, end = _from_samples(boundary.table, gathered.value)
    p, q = np.concatenate([offered[:2], start], axis=1), np.concatenate([offered[2:], end], axis=1)
    first = _first_of_each(p, q)
    p, q = p.take(first, axis=1), q.take(first, axis=1)
    clear = _clear(p, q, gathered)
    return OverlapPairs(p, q, _length(q - p)).at(clear)


def _from_samples(sides: SideTable, within: float) -> tuple[Floats, Floats]:
    """Samples of sides, and the feet of their normals on facing sides ``within`` a distance, mm."""
    a, b = sides.pairs(ASIDE, within)
    points, numbers = sampled(sides.edges)
    counts, samples = np.array(numbers), columns_of(points, 2)
    owner = np.arange(len(counts)).repeat(counts)
    normals = sides.table.at(owner).normal(samples)
    # One row per pair and sample of its first side.
    rows_of_pair = counts.take(a)
    starts = (counts.cumsum() - counts).take(a)
    row = np.arange(rows_of_pair.sum()) + (starts - rows_of_pair.cumsum() + rows_of_pair).repeat(
        rows_of_pair
    )
    p, n = samples.take(row, axis=1), normals.take(row, axis=1)
    feet, inward, there = _feet(p, sides, b.repeat(rows_of_pair))
    # One row per sample, one column per foot.
    p, n = p[:, :, None], n[:, :, None]
    off = feet - p
    square = dot(n, inward) < -math.cos(ASIDE)
    faces = (dot(off, n) > TOUCH) & (dot(off, inward) < -TOUCH)
    valid = there & square & faces & (_length(off) <= within)
    place, _ = valid.nonzero()
    return p[:, :, 0].take(place, axis=1), feet[:, valid]


def _feet(p: Floats, sides: SideTable, numbers: Indices) -> tuple[Floats, Floats, Bools]:
    """The points of sides whose normals pass through given points, up to two each; the normals."""
    edges = sides.table.at(numbers)
    chord, off = edges.end - edges.start, p - edges.start
    square = dot(chord, chord)
    t = dot(chord, off) / square
    length = np.sqrt(square)
    on_line = edges.start + t * chord
    aside = np.array([-chord[1] / length, chord[0] / length])
    out = p - edges.centre
    distance = _length(out)
    central = distance < 1e-12
    unit = out / np.where(central, 1.0, distance)
    middle = sides.middle.take(numbers, axis=1)
    least = edges.radius * (np.cos(sides.half_turn.take(numbers)) - 1e-9)
    ahead = dot(unit, middle - edges.centre)
    normal = sides.normal.take(numbers, axis=1)
    line = edges.turn == 0
    points = []
    normals = []
    there = []
    for sign in (1.0, -1.0):
        at_middle = central & (sign > 0)
        on_arc = np.where(at_middle, middle, edges.centre + edges.radius * (sign * unit))
        inward = np.where(at_middle, normal, -edges.turn * sign * unit)
        points.append(np.where(line, on_line, on_arc))
        normals.append(np.where(line, aside, inward))
        is_on_arc = at_middle | (~central & (sign * ahead >= least))
        is_on_line = (t >= -1e-9) & (t <= 1 + 1e-9) & (sign > 0)
        there.append(np.where(line, is_on_line, is_on_arc))
    return np.stack(points, axis=2), np.stack(normals, axis=2), np.stack(there, axis=1)


def _first_of_each(p: Floats, q: Floats) -> Indices:
    """The numbers of the first segment with given ends, in either order, to 10 nm."""
    ends = np.rint(np.concatenate([p, q]) * 1e5)
    turned = (ends[0] > ends[2]) | ((ends[0] == ends[2]) & (ends[1] > ends[3]))
    ends = np.where(turned, ends[[2, 3, 0, 1]], ends)
    # A stable order, so that the first of equal segments comes first.
    order = np.lexsort(ends)
    ends = ends.take(order, axis=1)
    is_new = np.ones(len(order), dtype=bool)
    is_new[1:] = (ends[:, 1:] != ends[:, :-1]).any(axis=0)
    return np.sort(order[is_new])


def _clear(p: Floats, q: Floats, gathered: Gathered) -> Bools:
    """Return True for segments that no edge crosses; doubtful ones are tested one by one."""
    table = gathered.boundary.table.table
    segment, number = touching(boxes_round(p, q, NEAR), table.box)
    edges = table.at(number)
    start, off = p.take(segment, axis=1), (q - p).take(segment, axis=1)
    length = _length(off)
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
        clear[place] = gathered.is_clear((px, py), (qx, qy))
    return clear


def _length(vector: Floats) -> Floats:
    length: Floats = np.sqrt(dot(vector, vector))
    return length
