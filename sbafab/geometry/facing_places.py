"""All narrow places of a region, in arrays: every sample against every edge at once."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.geometry.edge_table import (
    CellOrder,
    EdgeTable,
    boxes_round,
    crossings,
    dot,
    touching,
)
from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.region import Region
from sbafab.geometry.remembered import remembered
from sbafab.geometry.sides import BESIDE
from sbafab.geometry.width import (
    ASIDE,
    STEP,
    TOUCH,
    Boundary,
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
    sides = _sides_in_arrays(boundary)
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


class _Samples(NamedTuple):
    """Points spread over sides, side by side, and the normals there; how many a side has, and which
    is its first.
    """

    p: Floats
    normal: Floats
    counts: Indices
    first: Indices


def _sides_in_arrays(boundary: Boundary) -> _Sides:
    """They are asked for with several slacks."""
    known = boundary.__dict__
    if "in_arrays" not in known:
        known["in_arrays"] = _Sides(boundary)
    found: _Sides = known["in_arrays"]
    return found


class _Sides:
    """What the search knows of a boundary's sides, in arrays."""

    def __init__(self, boundary: Boundary) -> None:
        sides = boundary.sides
        self.edges = [side.edge for side in sides]
        self.table = EdgeTable.of(self.edges)
        rows = [
            (*side.middle, *side.normal, side.half_turn, side.half, side.lean) for side in sides
        ]
        columns = np.array(rows).T
        self.middle, self.normal = columns[0:2], columns[2:4]
        self.half_turn, self.half, self.lean = columns[4:7]

    @cached_property
    def samples(self) -> _Samples:
        """Points spread over all of them."""
        shares = [spread_along(edge) for edge in self.edges]
        count = np.array([len(own) for own in shares])
        points = [places_along(edge, own) for edge, own in zip(self.edges, shares, strict=True)]
        p = np.array([p for own in points for p in own]).T
        owner = np.repeat(np.arange(len(count)), count)
        return _Samples(p, self.table.at(owner).normal(p), count, np.cumsum(count) - count)

    def pairs(self, aside: float, within: float) -> tuple[Indices, Indices]:
        """Sides and those that their normals may meet no farther off, as ``near`` tells them."""
        asked, box = self.table.box.copy(), self.table.box
        asked[:2] -= within
        asked[2:] += within
        a, b = touching(asked, box)
        room = self.half_turn[a] + aside + self.half_turn[b]
        opposed = dot(self.normal[:, a], self.normal[:, b]) < -np.cos(room)
        off, normal = self.middle[:, a] - self.middle[:, b], self.normal[:, b]
        missed = np.abs(off[0] * normal[1] - off[1] * normal[0])
        holds = missed <= self.half[b] + self.half[a] + within * self.lean[b] + BESIDE
        chosen = (opposed | (room > math.pi)) & holds & (a != b)
        a, b = a[chosen], b[chosen]
        order = CellOrder(box).sorted(asked, a, b)
        return a[order], b[order]


def _from_samples(sides: _Sides, within: float) -> tuple[Floats, Floats]:
    """Samples of each side and the feet of their normals on the sides they face."""
    a, b = sides.pairs(ASIDE, within)
    samples, normals, counts, firsts = sides.samples
    # Each pair has a row a sample of its first side.
    own, starts = counts[a], firsts[a]
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


def _feet(p: Floats, sides: _Sides, numbers: Indices) -> tuple[Floats, Floats, Bools]:
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
    _, first = np.unique(ends, axis=1, return_index=True)
    return np.sort(first)


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
