"""Medial axes of voids seen from above: dead ends, and the path from one place to another.

A void's boundary is sampled; every sample touches the largest circle inside the void that is
tangent there, and the circle touches a second sample, its partner (shrinking balls: Ma, Bae and
Choi, The Visual Computer 28 (2012) 7). The chord between the two is a straight cut across the void.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from sbafab.geometry.cache import cached
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Point, left_normal
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.offset import shrink
from sbafab.geometry.region import Region

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Complex = NDArray[np.complex128]
    Floats = NDArray[np.float64]
    Counts = NDArray[np.int64]

STEPS_ACROSS = 4
"""Samples along the boundary within the narrowest width."""
MOST_SAMPLES = 3000
ROWS = 256
"""Samples whose circles are searched for together; limits the memory."""
INWARD = 1e-6
"""mm by which a sample must lie inside of another's tangent to bound its circle."""
POCKET = 3.0
"""A pocket is this many times as wide as the channels that lead to it."""
POCKET_OF_VIAS = 6.0
"""Like POCKET, for holes that lead to a pocket: many are narrower than the channels they join."""
NUDGE = 1e-3
"""mm by which places are moved off the boundary, inward."""


@dataclass(frozen=True)
class VoidAxis:
    """Samples of a void's boundary in order, contour by contour, with the void on their left.

    ``points`` and the ``centres`` of the tangent circles are x + iy in mm, ``radii`` in mm;
    ``partners`` are the other samples that the circles touch; ``contours`` numbers the contour of
    each; ``starts`` are the first samples of the contours, then the number of samples.
    """

    region: Region
    points: Complex
    centres: Complex
    radii: Floats
    partners: Counts
    contours: Counts
    starts: tuple[int, ...]

    def nearest(self, p: Point) -> int:
        """Return the sample whose circle has its centre nearest to ``p``."""
        return int(np.abs(self.centres - complex(*p)).argmin())

    def neighbours(self, sample: int) -> tuple[int, int, int]:
        """Return the previous and next sample on the contour, and the partner."""
        contour = int(self.contours[sample])
        first, end = self.starts[contour], self.starts[contour + 1]
        before = sample - 1 if sample > first else end - 1
        after = sample + 1 if sample + 1 < end else first
        return before, after, int(self.partners[sample])

    def centre(self, sample: int) -> Point:
        return _point(self.centres[sample])

    @cached_property
    def following(self) -> Complex:
        """Return the next sample of each on its contour."""
        following = np.roll(self.points, -1)
        for first, end in pairwise(self.starts):
            following[end - 1] = self.points[first]
        return following

    def summed(self, steps: Floats, first: Counts, last: Counts) -> Floats:
        """Return the sums of steps from ``first`` to ``last``, along their contour."""
        before = np.concatenate([[0.0], np.cumsum(steps)])
        starts, contour = np.array(self.starts), self.contours[first]
        whole = before[starts[contour + 1]] - before[starts[contour]]
        part: Floats = before[last] - before[first]
        return np.where(last < first, part + whole, part)


def _point(z: complex) -> Point:
    return float(z.real), float(z.imag)


def _cross(p: Complex, q: Complex) -> Floats:
    crossed: Floats = (p.conj() * q).imag
    return crossed


@cached
def axis_of(region: Region, width: float) -> VoidAxis:
    """Return the axis of a connected region whose narrowest place is ``width`` mm wide."""
    length = sum(contour.length for contour in region.contours)
    step = max(width / STEPS_ACROSS, length / MOST_SAMPLES)
    samples = [[*_samples(contour, step)] for contour in region.contours]
    counts = [len(row) for row in samples]
    starts = np.cumsum([0, *counts]).tolist()
    points, inward = np.array([pair for row in samples for pair in row]).T
    radii, partners = _circles(points, inward)
    contours = np.repeat(np.arange(len(counts)), counts)
    centres = points + radii * inward
    return VoidAxis(region, points, centres, radii, partners, contours, tuple(starts))


def _samples(contour: Contour, step: float) -> Iterator[tuple[complex, complex]]:
    """Return points inside the edges, at most one step apart, and their normals into the region."""
    for edge in contour.edges:
        count = max(1, math.ceil(edge.length / step))
        for i in range(count):
            p = edge.at((i + 0.5) / count)
            yield complex(*p), complex(*left_normal(edge, p))


def _circles(points: Complex, normals: Complex) -> tuple[Floats, Counts]:
    """Return radii of the largest inner circles tangent at the samples, and their partners."""
    radii = np.empty(len(points))
    partners = np.empty(len(points), dtype=np.int64)
    for first in range(0, len(points), ROWS):
        rows = slice(first, first + ROWS)
        away = points - points[rows, None]
        inward = (away * normals[rows, None].conj()).real
        with np.errstate(divide="ignore", invalid="ignore"):
            squares = away.real**2 + away.imag**2
            candidates = np.where(inward > INWARD, squares / (2 * inward), np.inf)
        best = candidates.argmin(axis=1)
        partners[rows] = best
        radii[rows] = candidates[np.arange(len(best)), best]
    # A sample that no other faces, as in the cusp of a sliver, has a circle of no size.
    radii[~np.isfinite(radii)] = 0.0
    return radii, partners


# Blind ends: parts behind a cut straight across a void, without a way on.


class Terminal(NamedTuple):
    """A place where a void continues: a port, or an exit of ``width`` mm."""

    at: Point
    width: float
    is_port: bool


class BlindEnd(NamedTuple):
    """A part of a void behind a cut of ``width`` mm: ``depth`` mm long, its far end at ``at``."""

    at: Point
    width: float
    depth: float


def blind_ends(axis: VoidAxis, terminals: Sequence[Terminal], ratio: float) -> list[BlindEnd]:
    """Return the dead ends of a void that are more than ``ratio`` times as long as wide.

    A dead end lies behind a straight cut across the void and holds no terminal. It is excused if a
    port lies at its foot, within the width of the cut, or if it belongs to a pocket with a port.
    Its length is half the boundary around it, less the cut.
    """
    cuts = _cuts(axis)
    closed = ~_holds_any(axis, cuts, [terminal.at for terminal in terminals])
    deep = closed & (cuts.depth >= ratio * cuts.width)
    ends: list[BlindEnd] = []
    taken: list[tuple[int, int, int]] = []
    for row in np.argsort(-np.where(deep, cuts.depth, -1.0), kind="stable")[: int(deep.sum())]:
        first, last = int(cuts.first[row]), int(cuts.last[row])
        contour = int(axis.contours[first])
        begin, end = axis.starts[contour], axis.starts[contour + 1]
        size = end - begin
        count = (last - first) % size
        covered = [(contour, (first - begin + i) % size) for i in (0, count // 2, count)]
        if any(_within(taken_arc, place, axis) for taken_arc in taken for place in covered):
            continue
        taken.append((contour, first - begin, count))
        foot = _point((axis.points[first] + axis.points[last]) / 2)
        width = float(cuts.width[row])
        if _is_excused(axis, foot, width, terminals):
            continue
        tip = begin + (first - begin + count // 2) % size
        ends.append(BlindEnd(axis.centre(tip), width, float(cuts.depth[row])))
    return ends


class _Cuts(NamedTuple):
    """Cuts across a void: the samples from ``first`` to ``last`` lie behind each."""

    first: Counts
    last: Counts
    width: Floats
    depth: Floats


def _cuts(axis: VoidAxis) -> _Cuts:
    """Return both sides of every chord that divides the void."""
    samples = np.arange(len(axis.points))
    is_whole = (axis.contours[axis.partners] == axis.contours) & (axis.radii > 0)
    there, back = samples[is_whole], axis.partners[is_whole]
    first, last = np.concatenate([there, back]), np.concatenate([back, there])
    width = np.abs(axis.points[first] - axis.points[last])
    steps = _cross(axis.points, axis.following) / 2
    way = axis.summed(np.abs(axis.following - axis.points), first, last)
    closing = _cross(axis.points[last], axis.points[first]) / 2
    enclosed = axis.summed(steps, first, last) + closing
    depth = np.where(enclosed > 0, (way - width) / 2, -1.0)
    return _Cuts(first, last, width, depth)


def _holds_any(axis: VoidAxis, cuts: _Cuts, places: Sequence[Point]) -> NDArray[np.bool_]:
    """Return True for cuts with one of the places behind them or on their edge."""
    holds = np.zeros(len(cuts.first), dtype=np.bool_)
    for p in (complex(*place) for place in places):
        # A place may lie on the boundary: a little inward.
        away = complex(axis.centres[np.abs(axis.points - p).argmin()]) - p
        place = p + away * min(1.0, NUDGE / abs(away)) if away else p
        here, there = axis.points - place, axis.following - place
        turned = axis.summed(np.angle(here.conj() * there), cuts.first, cuts.last)
        closing = np.angle(here[cuts.last].conj() * here[cuts.first])
        holds |= np.abs(turned + closing) / math.tau > 0.25
    return holds


def _within(arc: tuple[int, int, int], place: tuple[int, int], axis: VoidAxis) -> bool:
    contour, first, count = arc
    size = axis.starts[contour + 1] - axis.starts[contour]
    return place[0] == contour and (place[1] - first) % size <= count


def _is_excused(axis: VoidAxis, foot: Point, width: float, terminals: Sequence[Terminal]) -> bool:
    """Return True if a port lies at the foot of a dead end, or in the same pocket."""
    ports = [terminal for terminal in terminals if terminal.is_port]
    if any(math.dist(port.at, foot) <= width for port in ports):
        return True
    # The part that remains a third of the way in has no channel that leads to the pocket.
    inset = width / POCKET / 2
    inner = shrink(axis.region, inset)
    pocket = next((piece for piece in inner.pieces if piece.contains(foot)), None)
    if pocket is None:
        return False

    def is_inside(terminal: Terminal) -> bool:
        if pocket.contains(terminal.at):
            return True
        return pocket.distance_to_edge(terminal.at) <= inset + terminal.width / 2

    inside = [terminal for terminal in terminals if is_inside(terminal)]
    narrow = width / POCKET_OF_VIAS
    wide = [terminal for terminal in inside if terminal.is_port or terminal.width > narrow]
    return len(wide) == 1 and wide[0].is_port


# Ways along the axes of several voids, which vias join.

AxisNode = tuple[int, int]
"""Number of an axis, and a sample of it."""
Links = Mapping[AxisNode, Sequence[AxisNode]]
"""Vias: from a sample of one axis to samples of others."""


def shortest_way(
    axes: Sequence[VoidAxis], links: Links, starts: Iterable[AxisNode], goals: Iterable[AxisNode]
) -> list[AxisNode]:
    """Return the nodes of the shortest path from any start to any goal; empty if there is none."""
    aims = set(goals)
    lengths = dict.fromkeys(starts, 0.0)
    came: dict[AxisNode, AxisNode] = {}
    queue = [(0.0, node) for node in sorted(lengths)]
    done: set[AxisNode] = set()
    while queue:
        length, node = heapq.heappop(queue)
        if node in done:
            continue
        done.add(node)
        if node in aims:
            way = [node]
            while way[-1] in came:
                way.append(came[way[-1]])
            return way[::-1]
        for there, step in _steps(axes, links, node):
            if there not in done and length + step < lengths.get(there, math.inf):
                lengths[there] = length + step
                came[there] = node
                heapq.heappush(queue, (length + step, there))
    return []


def _steps(
    axes: Sequence[VoidAxis], links: Links, node: AxisNode
) -> Iterable[tuple[AxisNode, float]]:
    number, sample = node
    axis = axes[number]
    here = axis.centre(sample)
    for neighbour in axis.neighbours(sample):
        yield (number, neighbour), math.dist(here, axis.centre(neighbour))
    for linked in links.get(node, ()):
        yield linked, math.dist(here, axes[linked[0]].centre(linked[1]))
