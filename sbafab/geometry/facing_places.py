"""Points spread over edges, from which it is looked for what lies across."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.geometry.cache import cached_batch
from sbafab.geometry.edge_table import (
    SideTable,
    boxes_round,
    columns_of,
    crossings,
    dot,
    touching_in_parts,
)
from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.region import Region
from sbafab.geometry.width import ASIDE, TOUCH, Gathered, Width, boundary_of, least_of, search

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices

STEP = math.radians(15)
"""Widest step of samples along an arc: 7.5 degrees aside a shift counts 0.99 of its length."""


def sampled(edges: Sequence[Edge], room: float = 0.0) -> tuple[list[Point], list[int]]:
    """Samples of all edges, one edge after the other, and how many each has.

    On a line both ends and the middle, on an arc one every 15 degrees at least; those at the ends
    lie ``room`` mm within.
    """
    found: list[Point] = []
    counts: list[int] = []
    for edge in edges:
        count = 2
        if isinstance(edge, Arc):
            count = max(2, math.ceil(abs(edge.sweep) / STEP))
        share = room / edge.length if room > 0 else 0.0
        shares = [min(1 - share, max(share, i / count)) for i in range(count + 1)]
        found += _places_along(edge, shares)
        counts.append(count + 1)
    return found, counts


def _places_along(edge: Edge, shares: list[float]) -> list[Point]:
    """The points at these shares of an edge's length; its very ends at 0 and 1."""
    if not isinstance(edge, Arc):
        return [edge.start if t == 0 else edge.end if t == 1 else edge.at(t) for t in shares]
    first, sweep = edge.start_angle, edge.sweep
    x, y = edge.centre
    r = edge.radius
    angles = [first + t * sweep for t in shares]
    found = [(x + r * math.cos(a), y + r * math.sin(a)) for a in angles]
    if shares[0] == 0:
        found[0] = edge.start
    if shares[-1] == 1:
        found[-1] = edge.end
    return found


# All narrow places of a region, in arrays: every sample against every edge at once.


NEAR = 10 * TOUCH
"""mm from its ends within which what meets a segment does not cross it."""


class FacingPlaces(NamedTuple):
    """Segments square on edges at both ends, each once: x and y of both ends, and their lengths."""

    start: Floats
    end: Floats
    value: Floats

    def at(self, some: Bools) -> FacingPlaces:
        """Some of them."""
        return FacingPlaces(self.start[:, some], self.end[:, some], self.value[some])


NOWHERE = FacingPlaces(np.zeros((2, 0)), np.zeros((2, 0)), np.zeros(0))


FacingAsked = tuple[Region, float, float, Width | None]
"""What is asked of a region: the slack (mm), what is sharp (degrees), the least width if known."""


def facing_places(
    region: Region, slack: float, sharp: float = 90.0, least: Width | None = None
) -> FacingPlaces:
    """Facing places that are at most ``slack`` mm wider than the narrowest, each once.

    Besides the places where edges are square on each other they hold samples along edges that run
    nearly alongside: where a layer turns, those may become the narrowest. ``least`` is the least
    width, where it is known.
    """
    (found,) = facing_places_of([(region, slack, sharp, least)])
    return found


@cached_batch
def facing_places_of(asked: Sequence[FacingAsked]) -> Sequence[FacingPlaces]:
    """The same of several regions."""
    found = [NOWHERE] * len(asked)
    searched: dict[int, Gathered] = {}
    for number, (region, slack, sharp, known) in enumerate(asked):
        boundary = boundary_of(region, sharp)
        least = known or least_of(boundary, math.inf)
        if least is None:
            continue
        if least.value == 0.0:
            place = np.array([least.start]).T, np.array([least.end]).T
            found[number] = FacingPlaces(*place, np.zeros(1))
            continue
        searched[number] = Gathered(boundary, least.value + slack)
        search(searched[number])
    if searched:
        for number, places in zip(searched, _together(list(searched.values())), strict=True):
            found[number] = places
    return found


def _together(searched: Sequence[Gathered]) -> list[FacingPlaces]:
    """What was gathered of each boundary, and samples of its sides, without what is crossed."""
    boundaries = [one.boundary for one in searched]
    parts = [len(one.sides) for one in boundaries]
    sides = SideTable([side for one in boundaries for side in one.sides], parts)
    of_side = np.arange(len(parts)).repeat(parts)
    within = np.array([one.value for one in searched])
    offered = columns_of([(*p, *q) for one in searched for p, q in one.offered], 4)
    p, q, side = _from_samples(sides, within[of_side])
    counts = [len(one.offered) for one in searched]
    home = np.concatenate([np.arange(len(parts)).repeat(counts), of_side.take(side)])
    p, q = np.concatenate([offered[:2], p], axis=1), np.concatenate([offered[2:], q], axis=1)
    first = _first_of_each(p, q, home)
    # Of each boundary by itself, in the order in which they were found.
    first = first.take(home.take(first).argsort(kind="stable"))
    p, q, home = p.take(first, axis=1), q.take(first, axis=1), home.take(first)
    clear = _clear(p, q, home, sides, searched)
    if not clear.all():
        p, q, home = p[:, clear], q[:, clear], home[clear]
    value, ends = _length(q - p), home.searchsorted(np.arange(len(parts) + 1)).tolist()
    return [FacingPlaces(p[:, a:b], q[:, a:b], value[a:b]) for a, b in pairwise(ends)]


def _from_samples(sides: SideTable, within: Floats) -> tuple[Floats, Floats, Indices]:
    """Samples of each side and the feet of their normals on the sides they face, and the side.

    ``within`` is how far off these may be, mm, for each side.
    """
    a, b = sides.pairs(ASIDE, within)
    points, numbers = sampled(sides.edges)
    counts, samples = np.array(numbers), columns_of(points, 2)
    owner = np.arange(len(counts)).repeat(counts)
    normals = sides.table.at(owner).normal(samples)
    # Each pair has a row a sample of its first side.
    own = counts.take(a)
    starts = (counts.cumsum() - counts).take(a)
    row = np.arange(own.sum()) + (starts - own.cumsum() + own).repeat(own)
    p, n = samples.take(row, axis=1), normals.take(row, axis=1)
    feet, inward, there = _feet(p, sides, b.repeat(own))
    side = a.repeat(own)
    # Rows of samples, a column a foot.
    p, n = p[:, :, None], n[:, :, None]
    off = feet - p
    square = dot(n, inward) < -math.cos(ASIDE)
    faces = (dot(off, n) > TOUCH) & (dot(off, inward) < -TOUCH)
    kept = there & square & faces & (_length(off) <= within.take(side)[:, None])
    place, _ = kept.nonzero()
    return p[:, :, 0].take(place, axis=1), feet[:, kept], side.take(place)


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


def _first_of_each(p: Floats, q: Floats, home: Indices) -> Indices:
    """Which segments of each home are the first with their ends, in either order, to 10 nm."""
    ends = np.rint(np.concatenate([p, q]) * 1e5)
    turned = (ends[0] > ends[2]) | ((ends[0] == ends[2]) & (ends[1] > ends[3]))
    ends = np.concatenate([np.where(turned, ends[[2, 3, 0, 1]], ends), home[None]])
    # A stable order, so that the first of those that are alike comes first.
    order = np.lexsort(ends)
    ends = ends.take(order, axis=1)
    is_new = np.ones(len(order), dtype=bool)
    is_new[1:] = (ends[:, 1:] != ends[:, :-1]).any(axis=0)
    return np.sort(order[is_new])


def _clear(
    p: Floats, q: Floats, home: Indices, sides: SideTable, searched: Sequence[Gathered]
) -> Bools:
    """Which segments no edge crosses; those that an edge may cross are looked at one by one."""
    counts = np.bincount(home, minlength=len(searched)).tolist()
    boxes = boxes_round(p, q, NEAR)
    segment, number = touching_in_parts(boxes, counts, sides.table.box, sides.parts)
    edges = sides.table.at(number)
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
    for asked in sorted(set(segment[doubtful].tolist())):
        (px, py), (qx, qy) = p[:, asked].tolist(), q[:, asked].tolist()
        clear[asked] = searched[home[asked]].is_clear((px, py), (qx, qy))
    return clear


def _length(vector: Floats) -> Floats:
    found: Floats = np.sqrt(dot(vector, vector))
    return found
