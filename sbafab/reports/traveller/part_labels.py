"""Where the label of a part stands: on the part, off its holes and off other labels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from heapq import heappop, heappush, merge
from typing import NamedTuple

from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region
from sbafab.reports import drawing as draw

LEGIBLE = 1.5
"""mm on the page: smaller labels help nobody."""
STEPS = 6
"""Places tried from the middle of a part to each of its ends."""
SIZES = (1.0, 0.8, 0.6)
OVER = 1.1
"""Share of its part's width that a label may take."""
HIGH = 0.8
"""Height of a label in sizes of its letters."""
OUTSIDE, HOLE = 3.0, 1.0
"""What a corner off the part costs, and a hole that is covered; distance from the middle, 1."""


class PlacedLabel(NamedTuple):
    """``at`` is the middle of the words' base line; ``size`` and ``box`` are mm on the page."""

    at: Point
    size: float
    box: Bounds

    def moved(self, dx: float, dy: float) -> PlacedLabel:
        (x, y), (low_x, low_y, high_x, high_y) = self.at, self.box
        box = low_x + dx, low_y + dy, high_x + dx, high_y + dy
        return PlacedLabel((x + dx, y + dy), self.size, box)


def labels(words: str, part: Region) -> Iterator[PlacedLabel]:
    """Where the words may stand on a part as it is drawn, the best place first.

    Off its holes if they can, near its middle, as large as may be; none where nobody could read
    them. A place is measured when its turn has come: the first one is nearly always taken.
    """
    low_x, _, high_x, _ = part.bounds
    width = OVER * (high_x - low_x)
    most = min(draw.SMALL * width / draw.text_width(words, draw.SMALL), draw.SMALL)
    holes = [hole.bounds for hole in part.holes]
    em = draw.text_width(words, 1.0)
    middles = list(_middles(part.bounds))
    sizes = [(1 - share, share * most) for share in SIZES if share * most >= LEGIBLE]
    # Nearest first for each size, so labels are made only as far as their turn comes.
    fresh = merge(*([(far + less, at, size) for far, at in middles] for less, size in sizes))
    ahead = next(fresh, None)
    waiting: list[_Candidate] = []
    while waiting or ahead is not None:
        while ahead is not None and (not waiting or ahead[0] <= waiting[0].cost):
            far, middle, size = ahead
            heappush(waiting, _Candidate(far, _label(em, middle, size), far))
            ahead = next(fresh, None)
        best = heappop(waiting)
        if best.sides is None:
            covered = [hole for hole in holes if _meet(best.label.box, hole)]
            heappush(waiting, best.covering(len(covered), _sides(best.label.box, covered)))
        elif best.sides:
            heappush(waiting, best.beside(part))
        else:
            yield best.label


class _Candidate(NamedTuple):
    """A label with the least that it costs, as far as is known: ``far`` off the middle and small,
    holes ``covered``, points ``off`` the part; what is quickly told is asked first.

    ``sides``: points of its box that have not been looked for on the part yet; None where the holes
    have not been counted either.
    """

    cost: float
    label: PlacedLabel
    far: float
    covered: int = 0
    off: int = 0
    sides: tuple[Point, ...] | None = None

    def covering(self, covered: int, sides: tuple[Point, ...]) -> _Candidate:
        return self._measured(covered, 0, sides)

    def beside(self, part: Region) -> _Candidate:
        """With the points up to the first one that is off the part, which costs much."""
        assert self.sides is not None
        for number, point in enumerate(self.sides):
            if not part.contains(point):
                return self._measured(self.covered, self.off + 1, self.sides[number + 1 :])
        return self._measured(self.covered, self.off, ())

    def _measured(self, covered: int, off: int, sides: tuple[Point, ...]) -> _Candidate:
        cost = self.far + (HOLE * covered + OUTSIDE * off)
        return _Candidate(cost, self.label, self.far, covered, off, sides)


def first_free(
    found: Iterable[PlacedLabel], page: Bounds, taken: Sequence[Bounds]
) -> PlacedLabel | None:
    """The first of the labels that stands on the page and off the boxes of other labels."""
    return next(
        (
            label
            for label in found
            if _within(label.box, page) and not any(_meet(label.box, box) for box in taken)
        ),
        None,
    )


def _label(em: float, middle: Point, size: float) -> PlacedLabel:
    """The label of words that are ``em`` sizes of their letters wide."""
    x, y = middle
    wide, high = size * em / 2, HIGH * size / 2
    box = x - wide, y - high, x + wide, y + high
    return PlacedLabel((x, y + 0.35 * size), size, box)


def _middles(bounds: Bounds) -> Iterator[tuple[float, Point]]:
    """Points of a part's box and how far off its middle they are, from 0 to 1; nearest first."""
    low_x, low_y, high_x, high_y = bounds
    x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
    for off, u, v in _grid():
        yield off, (x + u * (high_x - low_x) / 2, y + v * (high_y - low_y) / 2)


@cache
def _grid() -> list[tuple[float, float, float]]:
    """The same of a box from -1 to 1: how far off, and both shares."""
    steps = range(-STEPS, STEPS + 1)
    grid = [(i / (STEPS + 1), j / (STEPS + 1)) for i in steps for j in steps]
    nearest = sorted(grid, key=lambda p: (p[0] ** 2 + p[1] ** 2, p))
    return [(((u**2 + v**2) / 2) ** 0.5, u, v) for u, v in nearest]


def _sides(box: Bounds, holes: Sequence[Bounds]) -> tuple[Point, ...]:
    """Corners and middles of the words' box, but for what stands on a hole of the part."""
    points = [(x, y) for y in (box[1], box[3]) for x in (box[0], (box[0] + box[2]) / 2, box[2])]
    return tuple([p for p in points if not any(_meet((*p, *p), hole) for hole in holes)])


def _meet(a: Bounds, b: Bounds) -> bool:
    return a[0] < b[2] and a[2] > b[0] and a[1] < b[3] and a[3] > b[1]


def _within(box: Bounds, page: Bounds) -> bool:
    return box[0] >= page[0] and box[1] >= page[1] and box[2] <= page[2] and box[3] <= page[3]
