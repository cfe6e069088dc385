"""Lattices of one shape on a film sheet: rows of copies, straight, offset, or rotated 180 degrees.

Copies are apart if outlines grown by half the spacing do not meet. The least distance of two copies
along an axis follows from envelopes: it is the maximum, over the other coordinate, of the front of
one minus the back of the other. Lattices are ranked by a table of these distances and placed by the
exact distances.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property, reduce
from itertools import cycle, product
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab.cutting.placements import TURNS, Turn, placed
from sbafab.geometry.contour import run_chords
from sbafab.geometry.edges import Bounds, Point, unit
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers = NDArray[np.float64]

SAGITTA = 5e-4
"""mm by which the polygons of grown outlines may reach past arcs."""
LEVEL = 1e-10
"""mm beside a corner at which an envelope is read, since it may jump there."""
STEPS = 96
"""Offsets that are tried between two rows, and between the two copies of a pair."""
TABLE = 192
"""Entries of a table of distances."""
MOST_ROWS = 60
"""Rows that are counted to rank a lattice."""
PROMISING = 16
"""Number of best-ranked lattices that are laid."""
NEVER = -1e9
"""mm: what need not lie above at all."""
FEW = 40
"""Copies on a sheet up to which two lattices are tried beside each other."""
ROOM = 0.02
"""mm more than there is, in which copies are counted to rank a lattice."""
ROUNDING = 5e-7
"""mm by which a copy may lie past the border: less than the check's tolerance."""


_Value = Any
"""A number, or an array of a number of many rows."""


class Lattice(NamedTuple):
    """Places of copies of one shape on an empty sheet, lowest first: rotation and shift in mm.

    ``top`` is their highest y; ``is_pair`` is true for two lattices side by side.
    """

    places: tuple[tuple[Turn, Point], ...]
    top: float
    is_pair: bool = False


def lattices_of(
    shape: Region, spacing: float, area: Bounds, turns: Sequence[Turn]
) -> list[Lattice]:
    """Return the lattices with the most copies of a shape in ``area``, best first.

    Copies are ``spacing`` mm apart, and rotated only by ``turns``. If few fit, a lattice may
    combine two, side by side.
    """
    rows = tuple(_Rows(shape, base, spacing) for base in TURNS[:2])
    laid = list(_laid_in(rows, area, turns))
    if 0 < max(len(lattice.places) for lattice in laid) <= FEW:
        laid += _pairs(rows, area, turns)
    return sorted(laid, key=most_copies)


def most_copies(lattice: Lattice) -> tuple[int, float]:
    """Return a sort key: most copies, then least length."""
    return -len(lattice.places), round(lattice.top, 3)


def _laid_in(rows: Sequence[_Rows], area: Bounds, turns: Sequence[Turn]) -> Iterator[Lattice]:
    """Yield lattices of a shape, as drawn and rotated, in ``area``."""
    low_x, low_y, high_x, high_y = area
    width, length = high_x - low_x, high_y - low_y
    for base, in_turn in zip(TURNS, rows, strict=False):
        if base in turns:
            for copies in in_turn.layouts((width, length)):
                places = [(turn, (low_x + u, low_y + v)) for turn, (u, v) in copies]
                yield lattice_of(in_turn.shape, places)
        if TURNS[base + 1] in turns and abs(width - length) > LEVEL:
            # Columns: the sheet's y is the rows' x.
            for copies in in_turn.layouts((length, width)):
                places = [
                    (TURNS[(turn + 1) % 4], (high_x - v, low_y + u)) for turn, (u, v) in copies
                ]
                yield lattice_of(in_turn.shape, places)


def _pairs(rows: Sequence[_Rows], area: Bounds, turns: Sequence[Turn]) -> Iterator[Lattice]:
    """Yield pairs of lattices: one leaves a strip as wide as one copy, one fills the strip."""
    shape, spacing = rows[0].shape, rows[0].spacing
    low_x, low_y, high_x, high_y = area
    # On a square, a strip on top is one at the side, turned.
    is_square = abs(high_x - low_x - (high_y - low_y)) < LEVEL and len(turns) == len(TURNS)
    for strip in sorted({2 * rows[0].half_width, 2 * rows[0].half_height}):
        for is_above in (False,) if is_square else (False, True):
            across, up = (0.0, strip + spacing) if is_above else (strip + spacing, 0.0)
            inside = low_x, low_y, high_x - across, high_y - up
            first = min(_laid_in(rows, inside, turns), key=most_copies)
            if not first.places:
                continue
            turned = {turn: placed(shape, turn, (0.0, 0.0)) for turn in TURNS}
            right = max(turned[turn].bounds[2] + shift[0] for turn, shift in first.places)
            beyond = first.top if is_above else right
            corner = (low_x, beyond + spacing) if is_above else (beyond + spacing, low_y)
            rest = min(_laid_in(rows, (*corner, high_x, high_y), turns), key=most_copies)
            pair = lattice_of(shape, [*first.places, *rest.places])
            yield pair._replace(is_pair=True)


def lattice_of(shape: Region, places: Sequence[tuple[Turn, Point]]) -> Lattice:
    """Return the copies of a shape, lowest first."""
    tops = {
        turn: placed(shape, turn, (0.0, 0.0)).bounds[3] for turn in {turn for turn, _ in places}
    }
    highest = [tops[turn] + shift[1] for turn, shift in places]
    order = sorted(range(len(places)), key=lambda i: (round(highest[i], 6), places[i][1][0]))
    return Lattice(tuple(places[i] for i in order), max(highest, default=0.0))


class _Copy(NamedTuple):
    """A copy in a row: 1 if rotated 180 degrees, else 0, and its shift in mm."""

    half: int
    x: _Value
    y: _Value


class _Row(NamedTuple):
    """Copies that repeat every ``pitch`` mm."""

    copies: tuple[_Copy, ...]
    pitch: _Value


class _Pattern(NamedTuple):
    """Rows that repeat upward; each starts one of ``steps`` mm to the right of the row below."""

    rows: tuple[_Row, ...]
    steps: tuple[_Value, ...]


class _Rows:
    """Rows along x of a shape in two orientations, 180 degrees apart."""

    def __init__(self, shape: Region, turn: Turn, spacing: float) -> None:
        self.shape, self.spacing = shape, spacing
        self.turns: tuple[Turn, Turn] = turn, TURNS[(turn + 2) % 4]
        (outline,) = grow(Region(shape.outers), spacing / 2).outers
        polygon = np.array([p for run in outline.runs for p in run_chords(run, True, SAGITTA)])
        boxes = [placed(shape, each, (0.0, 0.0)).bounds for each in self.turns]
        self.centres = [((box[0] + box[2]) / 2, (box[1] + box[3]) / 2) for box in boxes]
        self.half_width, self.half_height = (
            (boxes[0][axis + 2] - boxes[0][axis]) / 2 for axis in (0, 1)
        )
        outlines = [
            _turned(polygon, each) - centre
            for each, centre in zip(self.turns, self.centres, strict=True)
        ]
        self.upright = [_sides(outline) for outline in outlines]
        self.lying = [_sides(outline[:, ::-1]) for outline in outlines]
        self.reach: Point = tuple((2 * np.abs(outlines[0]).max(axis=0)).tolist())
        self._known: dict[tuple[_Row, _Row, float], float] = {}

    @cached_property
    def is_symmetric(self) -> bool:
        """True if the rotated shape equals the shape itself, shifted."""
        first, second = (
            np.concatenate([side.levels, side.front, side.back]) for side in self.upright
        )
        return len(first) == len(second) and bool(np.abs(first - second).max() < SAGITTA)

    # How near copies and rows come.

    def beside(self, first: int, second: int, rise: Numbers) -> Numbers:
        """The least distance of the second copy, ``rise`` mm higher, to the right of the first."""
        return _slides(self.upright[first], self.upright[second], rise)

    def above(self, first: int, second: int, right: Numbers) -> Numbers:
        """The least height of the second copy, ``right`` mm to the right, above the first."""
        return _slides(self.lying[first], self.lying[second], right)

    def climb(self, low: _Row, high: _Row, right: float) -> float:
        """Return the least height of a row, ``right`` mm to the right, above another."""
        key = low, high, round(right % low.pitch, 9)
        if key not in self._known:
            heights = []
            for a, b in product(low.copies, high.copies):
                offset = b.x - a.x + right
                first = math.ceil((-self.reach[0] - offset) / low.pitch)
                last = math.floor((self.reach[0] - offset) / low.pitch)
                offsets = np.array([offset + k * low.pitch for k in range(first, last + 1)])
                heights += (self.above(a.half, b.half, offsets) + (a.y - b.y)).tolist()
            self._known[key] = max(heights, default=-math.inf)
        return self._known[key]

    def _ranked_climb(self, low: _Row, high: _Row, right: Numbers) -> Numbers:
        """Return approximate values of ``climb`` for arrays of rows."""
        best = np.full(np.shape(right), -math.inf)
        reach = math.ceil(self.reach[0] / np.min(low.pitch))
        places, table = self._table
        for a, b in product(low.copies, high.copies):
            offset, heights = (b.x - a.x + right) % low.pitch, table[a.half, b.half]
            for times in range(-reach, reach + 1):
                height = np.interp(offset + times * low.pitch, places, heights, NEVER, NEVER)
                best = np.maximum(best, height + a.y - b.y)
        return best

    @cached_property
    def _table(self) -> tuple[Numbers, dict[tuple[int, int], Numbers]]:
        """Return offsets to the right, and the least heights of one copy above another at each."""
        width = self.reach[0] - 1e-6
        places = np.linspace(-width, width, TABLE)
        same_shape = self.above(0, 0, places)
        unlike = () if self.is_symmetric else ((0, 1), (1, 0))
        heights = {both: self.above(*both, places) for both in unlike}
        return places, {(0, 0): same_shape, (1, 1): same_shape, **heights}

    # The patterns that are tried.

    def layouts(self, box: tuple[float, float]) -> list[list[tuple[Turn, Point]]]:
        """Return the copies of the most promising patterns, in a box from the origin.

        Returns one layout without copies if the box is too small for any.
        """
        if box[0] < 2 * self.half_width - ROUNDING or box[1] < 2 * self.half_height - ROUNDING:
            return [[]]
        ranked: list[tuple[float, _Pattern]] = []
        for family in self._families():
            counts = self._promise(family, box)
            best = np.argsort(-counts, kind="stable")[:PROMISING].tolist()
            ranked += [(float(counts[i]), _member(family, i)) for i in best]
        ranked.sort(key=lambda entry: -entry[0])
        return [self._laid(pattern, box) for _, pattern in ranked[:PROMISING]]

    def _families(self) -> Iterator[_Pattern]:
        """Yield patterns with arrays of numbers: equal rows, alternating rows, and pairs."""
        origin, pitch = np.array(0.0), np.array(self.beside(0, 0, np.zeros(1))[0])
        upright = _Row((_Copy(0, origin, origin),), pitch)
        steps = np.linspace(0.0, float(pitch), STEPS, endpoint=False)
        yield _Pattern((upright,), (steps,))
        yield _Pattern((upright,), (steps, -steps))
        if self.is_symmetric:
            return
        turned = _Row((_Copy(1, origin, origin),), pitch)
        yield _Pattern((upright, turned), (steps, -steps))
        yield _Pattern((upright, turned), (steps, steps))
        rises = np.linspace(-self.reach[1], self.reach[1], STEPS + 1)[1:-1]
        there = self.beside(0, 1, rises)
        pitches = np.maximum(there + self.beside(1, 0, -rises), pitch)
        shares = np.linspace(0.0, 1.0, STEPS, endpoint=False)
        rise, share = (each.ravel() for each in np.meshgrid(rises, shares, indexing="ij"))
        there, pitches = np.repeat(there, STEPS), np.repeat(pitches, STEPS)
        pair = _Row((_Copy(0, origin, origin), _Copy(1, there, rise)), pitches)
        yield _Pattern((pair,), (share * pitches,))
        yield _Pattern((pair,), (share * pitches, -share * pitches))

    def _promise(self, family: _Pattern, box: tuple[float, float]) -> Numbers:
        rows, steps = family.rows, family.steps
        width, height = (
            side - 2 * half + ROOM
            for side, half in zip(box, (self.half_width, self.half_height), strict=True)
        )
        right = np.zeros(np.shape(steps[0]))
        up = right - reduce(np.minimum, [copy.y for copy in rows[0].copies])
        counts = np.zeros(np.shape(right))
        before: Numbers | None = None
        for number in range(MOST_ROWS):
            row = rows[number % len(rows)]
            added = np.zeros(np.shape(right))
            for copy in row.copies:
                room = width - (right + copy.x) % row.pitch
                across = np.where(room >= 0, np.floor(room / row.pitch) + 1, 0)
                added += np.where(up + copy.y <= height, across, 0)
            counts += added
            if not added.any():
                break
            step, after = steps[number % len(steps)], rows[(number + 1) % len(rows)]
            higher = up + self._ranked_climb(row, after, step)
            if before is not None:
                across_two = step + steps[(number - 1) % len(steps)]
                below = rows[(number - 1) % len(rows)]
                higher = np.maximum(higher, before + self._ranked_climb(below, after, across_two))
            before, up, right = up, higher, right + step
        return counts

    def _laid(self, pattern: _Pattern, box: tuple[float, float]) -> list[tuple[Turn, Point]]:
        """Return the copies of a pattern inside a box from the origin."""
        copies: list[tuple[Turn, Point]] = []
        right, up = 0.0, -min(copy.y for copy in pattern.rows[0].copies)
        below: list[tuple[_Row, float, float]] = []
        for row, step in zip(cycle(pattern.rows), cycle(pattern.steps), strict=False):
            for row_below, other_right, other_up in below[-3:]:
                up = max(up, other_up + self.climb(row_below, row, right - other_right))
            in_row = list(self._in_row(row, (right, up), box))
            if not in_row:
                break
            copies += in_row
            below.append((row, right, up))
            right += step
        return copies

    def _in_row(
        self, row: _Row, start: Point, box: tuple[float, float]
    ) -> Iterator[tuple[Turn, Point]]:
        half_width, half_height = self.half_width, self.half_height
        width, height = box[0] - 2 * half_width + ROUNDING, box[1] - 2 * half_height + ROUNDING
        for copy in row.copies:
            y, (centre_x, centre_y) = start[1] + copy.y, self.centres[copy.half]
            first = (start[0] + copy.x + LEVEL) % row.pitch
            count = math.floor((width - first) / row.pitch) + 1 if -ROUNDING <= y <= height else 0
            for times in range(count):
                x = half_width + first + times * row.pitch - centre_x
                yield self.turns[copy.half], (x, half_height + y - centre_y)


def _member(family: _Pattern, number: int) -> _Pattern:
    """Return one pattern of a family with arrays of numbers."""

    def chosen(values: Numbers) -> float:
        return float(values if values.ndim == 0 else values[number])

    rows = tuple(
        _Row(tuple(_Copy(c.half, chosen(c.x), chosen(c.y)) for c in row.copies), chosen(row.pitch))
        for row in family.rows
    )
    return _Pattern(rows, tuple(chosen(step) for step in family.steps))


# Envelopes of polygons.


class _Sides(NamedTuple):
    """Front and back of a polygon along an axis, as straight pieces between levels across it."""

    levels: Numbers
    front: Numbers
    back: Numbers


def _sides(polygon: Numbers) -> _Sides:
    """Return the sides of a polygon along its first coordinate, as functions of its second."""
    starts, ends = polygon, np.roll(polygon, -1, axis=0)
    corners = np.unique(polygon[:, 1])
    corners = corners[np.concatenate([[True], np.diff(corners) > 8 * LEVEL])]
    low, high = corners[:-1], corners[1:]
    middle = (low + high) / 2
    # No edge ends between two levels, and none crosses another.
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = (ends[:, 0] - starts[:, 0]) / (ends[:, 1] - starts[:, 1])
        along = starts[:, 0] + (middle[:, None] - starts[:, 1]) * slopes
    spans = (np.minimum(starts, ends)[:, 1] < middle[:, None]) & (
        np.maximum(starts, ends)[:, 1] > middle[:, None]
    )
    levels = np.stack([low + LEVEL, high - LEVEL], axis=1)
    front = np.where(spans, along, -math.inf).argmax(axis=1)[:, None]
    back = np.where(spans, along, math.inf).argmin(axis=1)[:, None]
    sides = (starts[e, 0] + (levels - starts[e, 1]) * slopes[e] for e in (front, back))
    return _Sides(levels.ravel(), *(side.ravel() for side in sides))


def _slides(first: _Sides, second: _Sides, offsets: Numbers) -> Numbers:
    """Return the distance along the axis at which the second polygon clears the first.

    It is shifted across the axis by each offset; -inf if the polygons then miss each other.
    """
    shifts = offsets[:, None]
    beside = 2 * LEVEL * np.resize([1.0, -1.0], len(first.levels))
    beside_second = 2 * LEVEL * np.resize([1.0, -1.0], len(second.levels))
    low = np.maximum(first.levels[0], second.levels[0] + shifts)
    high = np.minimum(first.levels[-1], second.levels[-1] + shifts)
    levels = np.concatenate(
        [
            np.broadcast_to(first.levels + beside, (len(offsets), len(first.levels))),
            second.levels + beside_second + shifts,
        ],
        axis=1,
    )
    levels = np.clip(levels, low, np.maximum(low, high))
    gaps = np.interp(levels, first.levels, first.front) - np.interp(
        levels - shifts, second.levels, second.back
    )
    return np.where((high - low)[:, 0] > 8 * LEVEL, gaps.max(axis=1), -math.inf)


def _turned(polygon: Numbers, turn: Turn) -> Numbers:
    c, s = unit(90.0 * turn)
    return np.asarray(polygon @ np.array([[c, s], [-s, c]]))
