"""All narrow places of a region, in arrays: every sample against every edge at once."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.geometry.edge_table import EdgeTable, boxes_round, crossings, dot, touching
from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.region import Region
from sbafab.geometry.remembered import remembered
from sbafab.geometry.side_table import SideTable
from sbafab.geometry.width import (
    ASIDE,
    STEP,
    TOUCH,
    Gathered,
    Width,
    boundary_of,
    least_of,
    search,
)

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices

NEAR = 10 * TOUCH
"""mm from its ends within which what meets a segment does not cross it."""


class FacingPlaces(NamedTuple):
    """Segments square on edges at both ends, each once: x and y of both ends, and their lengths."""

    start: Floats
    end: Floats
    value: Floats


NOWHERE = FacingPlaces(np.zeros((2, 0)), np.zeros((2, 0)), np.zeros(0))


@remembered
def facing_places(
    region: Region, slack: float, sharp: float = 90.0, least: Width | None = None
) -> FacingPlaces:
    """Facing places that are at most ``slack`` mm wider than the narrowest, each once.

    Besides the places where edges are square on each other they hold samples along edges that run
    nearly alongside: where a layer turns, those may become the narrowest. ``least`` is the least
    width, where it is known.
    """
    boundary = boundary_of(region, sharp)
    least = least or least_of(boundary, math.inf)
    if least is None:
        return NOWHERE
    if least.value == 0.0:
        return FacingPlaces(np.array([least.start]).T, np.array([least.end]).T, np.zeros(1))
    gathered = Gathered(boundary, least.value + slack)
    search(gathered)
    found = np.array([(*p, *q) for p, q in gathered.offered]).reshape(-1, 4).T
    sides = boundary.table
    p, q = (
        np.concatenate(both, axis=1)
        for both in zip((found[:2], found[2:]), _from_samples(sides, gathered.value), strict=True)
    )
    first = _first_of_each(p, q)
    p, q = p[:, first], q[:, first]
    clear = _clear(p, q, sides.table, gathered)
    p, q = p[:, clear], q[:, clear]
    return FacingPlaces(p, q, _length(q - p))


def spread_along(edge: Edge) -> list[float]:
    """Shares of an edge's length: both ends, the middle of a line, an arc every 15 degrees."""
    count = max(2, math.ceil(abs(edge.sweep) / STEP)) if isinstance(edge, Arc) else 2
    return [i / count for i in range(count + 1)]


def places_along(edge: Edge, shares: list[float]) -> list[Point]:
    """The points at these shares of an edge's length; its very ends at 0 and 1."""
    if not isinstance(edge, Arc):
        return [edge.start if t == 0 else edge.end if t == 1 else edge.at(t) for t in shares]
    first, sweep = edge.start_angle, edge.sweep
    (x, y), r = edge.centre, edge.radius
    angles = [first + t * sweep for t in shares]
    found = [(x + r * math.cos(a), y + r * math.sin(a)) for a in angles]
    if shares[0] == 0:
        found[0] = edge.start
    if shares[-1] == 1:
        found[-1] = edge.end
    return found


def _from_samples(sides: SideTable, within: float) -> tuple[Floats, Floats]:
    """Samples of each side and the feet of their normals on the sides they face."""
    a, b = sides.pairs(ASIDE, within)
    shares = [spread_along(edge) for edge in sides.edges]
    counts = np.array([len(own) for own in shares])
    samples = np.array(
        [p for edge, own in zip(sides.edges, shares, strict=True) for p in places_along(edge, own)]
    ).T
    owner = np.repeat(np.arange(len(counts)), counts)
    normals = sides.table.at(owner).normal(samples)
    # Each pair has a row a sample of its first side.
    own = counts[a]
    starts = (np.cumsum(counts) - counts)[a]
    row = np.arange(own.sum()) - np.repeat(np.cumsum(own) - own, own) + np.repeat(starts, own)
    p, n = samples[:, row], normals[:, row]
    other = np.repeat(b, own)
    feet, inward, there = _feet(p, sides, other)
    # Rows of samples, a column a foot.
    p, n = p[:, :, None], n[:, :, None]
    off = feet - p
    square = dot(n, inward) < -math.cos(ASIDE)
    faces = (dot(off, n) > TOUCH) & (dot(off, inward) < -TOUCH)
    kept = there & square & faces & (_length(off) <= within)
    return np.broadcast_to(p, feet.shape)[:, kept], feet[:, kept]


def _feet(p: Floats, sides: SideTable, numbers: Indices) -> tuple[Floats, Floats, Bools]:
    """Points of sides where their normal passes through points, up to two each; and the normals."""
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
    middle = sides.middle[:, numbers]
    least = edges.radius * (np.cos(sides.half_turn[numbers]) - 1e-9)
    ahead = dot(unit, middle - edges.centre)
    line = edges.turn == 0
    points = []
    normals = []
    there = []
    for sign in (1.0, -1.0):
        at_middle = central & (sign > 0)
        on_arc = np.where(at_middle, middle, edges.centre + edges.radius * (sign * unit))
        inward = np.where(at_middle, sides.normal[:, numbers], -edges.turn * sign * unit)
        points.append(np.where(line, on_line, on_arc))
        normals.append(np.where(line, aside, inward))
        is_on_arc = at_middle | (~central & (sign * ahead >= least))
        is_on_line = (t >= -1e-9) & (t <= 1 + 1e-9) & (sign > 0)
        there.append(np.where(line, is_on_line, is_on_arc))
    return np.stack(points, axis=2), np.stack(normals, axis=2), np.stack(there, axis=1)


def _first_of_each(p: Floats, q: Floats) -> Indices:
    """Which segments are the first with their ends, in either order, to 10 nm."""
    ends = np.rint(np.concatenate([p, q]) * 1e5)
    turned = (ends[0] > ends[2]) | ((ends[0] == ends[2]) & (ends[1] > ends[3]))
    ends[:, turned] = ends[:, turned][[2, 3, 0, 1]]
    # A stable order, so that the first of those that are alike comes first.
    order = np.lexsort(ends)
    ends = ends[:, order]
    is_new = np.ones(len(order), dtype=bool)
    is_new[1:] = (ends[:, 1:] != ends[:, :-1]).any(axis=0)
    return np.sort(order[is_new])


def _clear(p: Floats, q: Floats, table: EdgeTable, gathered: Gathered) -> Bools:
    """Which segments no edge crosses; those that an edge may cross are looked at one by one."""
    segment, number = touching(boxes_round(p, q, NEAR), table.box)
    edges = table.at(number)
    start, off = p[:, segment], (q - p)[:, segment]
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
    for asked in sorted(set(segment[doubtful].tolist())):
        (px, py), (qx, qy) = p[:, asked].tolist(), q[:, asked].tolist()
        clear[asked] = gathered.is_clear((px, py), (qx, qy))
    return clear


def _length(vector: Floats) -> Floats:
    found: Floats = np.sqrt(dot(vector, vector))
    return found
