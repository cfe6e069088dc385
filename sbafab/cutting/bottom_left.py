"""The nesting engine: bottom-left on a fine grid, from an empty sheet or round copies of one shape.

Each part goes to the lowest free place. Several fixed orders are tried. Where the parts take more
sheets than their area needs, they are tried round copies of the shapes of most area, too: a
lattice, or an arrangement found by a beam search if few copies fill a sheet. The best result is
returned. Nothing is random.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

from sbafab.cutting.lattice import Lattice, lattice_of, lattices_of, most_copies
from sbafab.cutting.placements import (
    TURNS,
    NestPart,
    Placement,
    Stock,
    Turn,
    placed,
)
from sbafab.errors import DesignError
from sbafab.geometry.contour import ticks
from sbafab.geometry.edges import Arc, Bounds, Edge, Point, distance_to
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region, disc
from sbafab.laminate.films import FIRST, Material

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Cells = NDArray[np.bool_]
    Counts = NDArray[np.intp]
    Numbers = NDArray[np.float64]

_Copies = tuple[tuple[int, int, int], ...]

MANY = 600
"""Number of parts from which only the first few ways to fill a sheet are tried."""
MOST_LATTICES = 3
"""Number of shapes for which lattices are tried."""
LEAST_COPIES = 3
"""Copies that are worth a lattice or an arrangement."""
FEW = 16
"""Copies on a sheet, by their area, up to which an arrangement is searched."""
BEAM = 6
"""Arrangements that are continued at each step of the search."""


def bottom_left(
    parts: Sequence[NestPart], stock: Stock, lattices: bool = True
) -> tuple[Placement, ...]:
    """Return places for every part; each must fit the usable area.

    Without ``lattices`` all sheets start empty. Raises DesignError if the pins leave no place
    for one.
    """
    shapes, shape_of = _shapes(parts)
    low_x, low_y, high_x, high_y = stock.usable
    window = min(high_y - low_y, _length_needed(parts, stock))
    while True:
        grid = grid_of(shapes, (low_x, low_y, high_x, low_y + window), stock.spacing, stock.turns)
        filler = _Filler(tuple(parts), tuple(shape_of), stock, grid)
        best = min((filler.filled(way) for way in _ways(parts)), key=_score)
        if window >= high_y - low_y or (best.stuck is None and best.sheets == 1):
            break
        window = min(high_y - low_y, 2 * window)
    if best.stuck is not None:
        part, where = parts[best.stuck], sheet_section(parts[best.stuck].material)
        raise DesignError(
            f"pattern {part.pattern} of {part.design} finds no place {stock.spacing:g} mm clear of "
            f"the {len(stock.pins)} {where}.pins; lower {where}.spacing, move the pins, or enlarge "
            "the sheet."
        )
    if lattices and takes_lattices(parts, stock, best.sheets):
        ways = [way for lattices in filler.lattices() for way in _lattice_ways(parts, lattices)]
        best = min([best, *map(filler.filled, ways)], key=_score)
    return best.placements


def sheet_section(material: Material) -> str:
    """Return the section of a design file that describes this material's sheets."""
    name = material.lower()
    return f"sheets.{name}" if material in FIRST else f"films.{name}.sheet"


@dataclass(frozen=True)
class _Way:
    """A way to fill: the order of the parts, and the share of their height that counts as low.

    Sheets start with a lattice of the shape with the largest remaining area that has a lattice;
    with ``whole_only`` only if it fills the sheet.
    """

    order: tuple[int, ...]
    share: float
    lattices: Mapping[int, Lattice] = field(default_factory=dict)
    whole_only: bool = False


@dataclass(frozen=True)
class _Filled:
    """``reach`` is the last sheet's highest y; ``stuck`` the part that found no place at all."""

    placements: tuple[Placement, ...]
    sheets: int
    reach: float
    stuck: int | None = None


def _score(filled: _Filled) -> tuple[bool, int, float]:
    """Sort key: fewest sheets, then least length of the last; of equal results the first wins."""
    return filled.stuck is not None, filled.sheets, round(filled.reach, 3)


def _size(part: NestPart) -> tuple[float, float]:
    low_x, low_y, high_x, high_y = part.region.bounds
    return high_x - low_x, high_y - low_y


def _ways(parts: Sequence[NestPart]) -> list[_Way]:
    """Ways to fill, large parts first by area or by longest side: small ones fit between them."""
    orders = []
    for measure in (math.prod, max):
        sizes = [-round(measure(_size(part)), 6) for part in parts]
        orders.append(tuple(sorted(range(len(parts)), key=sizes.__getitem__)))
    ways = [_Way(order, share) for order in dict.fromkeys(orders) for share in (0.5, 0.0, 1.0)]
    return ways if sum(part.count for part in parts) < MANY else ways[:2]


def _lattice_ways(parts: Sequence[NestPart], lattices: Mapping[int, Lattice]) -> list[_Way]:
    """Return ways to fill that start with lattices."""
    if not lattices:
        return []
    return [
        replace(way, lattices=lattices, whole_only=whole_only)
        for way in _ways(parts)
        for whole_only in (True, False)
    ]


def takes_lattices(parts: Sequence[NestPart], stock: Stock, sheets: int) -> bool:
    """Return True if lattices may save film; bottom-left alone needs this number of ``sheets``."""
    shapes, shape_of = _shapes(parts)
    counts: Counter[int] = Counter()
    for part, shape in zip(parts, shape_of, strict=True):
        counts[shape] += part.count
    if max(counts.values()) < LEAST_COPIES:
        return False
    return stock.roll or (sheets > 1 and sheets > _area_bound(shapes, counts, stock))


def _area_bound(shapes: Sequence[Region], counts: Mapping[int, int], stock: Stock) -> int:
    """Return the sheets that are filled by the shapes, each with half the spacing round it.

    The usable area with half the spacing round it holds as much at most.
    """
    grown = sum(counts[i] * _grown(shape, stock) for i, shape in enumerate(shapes))
    return math.ceil(grown / _room(stock) - 1e-6)


def _grown(shape: Region, stock: Stock) -> float:
    """Return the area of a shape with half the spacing round it."""
    return grow(shape, stock.spacing / 2).area


def _room(stock: Stock) -> float:
    """Return the usable area with half the spacing round it."""
    low_x, low_y, high_x, high_y = stock.usable
    return (high_x - low_x + stock.spacing) * (high_y - low_y + stock.spacing)


def _length_needed(parts: Sequence[NestPart], stock: Stock) -> float:
    """Return a length that most likely holds all parts, to limit the maps of long rolls."""
    area, longest = 0.0, 0.0
    for part in parts:
        width, height = (size + stock.spacing for size in _size(part))
        area += part.count * width * height
        longest = max(longest, width, height)
    low_x, _, high_x, _ = stock.usable
    pins = sum((diameter + 2 * stock.spacing) ** 2 for _, _, diameter in stock.pins)
    return 1.3 * (area + pins) / (high_x - low_x) + 2 * longest


def _shapes(parts: Sequence[NestPart]) -> tuple[list[Region], list[int]]:
    """Return the distinct outlines, and the number of each part's.

    Holes count as full: they are cut before all outlines, and a part in one would drop out.
    """
    numbers: dict[Region, int] = {}
    shape_of = []
    for part in parts:
        shape_of.append(numbers.setdefault(Region(part.region.outers), len(numbers)))
    return list(numbers), shape_of


class _Filler:
    """Fills sheets of one grid by a given way."""

    def __init__(
        self, parts: tuple[NestPart, ...], shape_of: tuple[int, ...], stock: Stock, grid: Grid
    ) -> None:
        self.parts, self.shape_of, self.stock, self.grid = parts, shape_of, stock, grid
        self.empty = [grid.places(form, stock) for form in grid.forms]
        self.forms = [[form for form in grid.forms if form.shape == shape] for shape in shape_of]
        self._started: dict[tuple[int, int], list[Cells]] = {}

    def lattices(self) -> list[dict[int, Lattice]]:
        """Return copies on a sheet, for the shapes of most area that come often enough.

        They are the best lattices, and arrangements or pairs of lattices if these hold more.
        """
        areas = dict.fromkeys(range(len(self.grid.shapes)), 0.0)
        counts: Counter[int] = Counter()
        for part, shape in zip(self.parts, self.shape_of, strict=True):
            areas[shape] += part.count * part.region.area
            counts[shape] += part.count
        kinds: list[dict[int, Lattice]] = [{}, {}, {}]
        for shape in sorted(areas, key=lambda shape: -areas[shape])[:MOST_LATTICES]:
            if counts[shape] >= LEAST_COPIES:
                laid = sorted(self._clear_lattices(self.grid.shapes[shape]), key=most_copies)
                alone = next(lattice for lattice in laid if not lattice.is_pair)
                # Of equal ones the first, which rows are.
                for kind, paired in zip(
                    kinds, (alone, self._arrangement(shape), laid[0]), strict=True
                ):
                    has_more = len(paired.places) > len(alone.places)
                    kind[shape] = paired if has_more else alone
        return [kind for number, kind in enumerate(kinds) if kind not in kinds[:number]]

    def _clear_lattices(self, shape: Region) -> Iterator[Lattice]:
        """Yield the lattices of a shape without the copies that are too near to pins."""
        stock = self.stock
        turned = {turn: placed(shape, turn, (0.0, 0.0)) for turn in TURNS}
        for lattice in lattices_of(shape, stock.spacing, self.grid.area, stock.turns):
            places = (
                place for place in lattice.places if _is_clear(turned[place[0]], place[1], stock)
            )
            yield lattice._replace(places=tuple(places))

    def _arrangement(self, shape: int) -> Lattice:
        """Return copies of a shape, found by a beam search; none if many fit a sheet.

        Each step puts a copy at an extreme free place and keeps the sheets with most free places.
        """
        if _room(self.stock) > FEW * _grown(self.grid.shapes[shape], self.stock):
            return Lattice((), 0.0)
        forms = [form for form in self.grid.forms if form.shape == shape]
        # Copies, each a form's number, row and column in order, and the free places of each form.
        sheets: list[tuple[_Copies, list[Cells]]] = [((), [self.empty[f.number] for f in forms])]
        best: _Copies = ()
        while sheets:
            best = sheets[0][0]
            steps: dict[_Copies, list[Cells]] = {}
            for copies, maps in sheets:
                for form, places in zip(forms, maps, strict=True):
                    for place in _extremes(places):
                        more = tuple(sorted((*copies, (form.number, *place))))
                        if more not in steps:
                            steps[more] = self._left(forms, maps, form, place)
            sheets = sorted(steps.items(), key=lambda step: -sum(map(np.count_nonzero, step[1])))
            sheets = sheets[:BEAM]
        chosen = [(self.grid.forms[number], row, column) for number, row, column in best]
        return lattice_of(
            self.grid.shapes[shape],
            [(form.turn, self.grid.shift(form, row, column)) for form, row, column in chosen],
        )

    def _left(
        self,
        forms: Sequence[TurnedShape],
        maps: Sequence[Cells],
        form: TurnedShape,
        place: tuple[int, int],
    ) -> list[Cells]:
        """Return the free places of forms after one of them is put at a place."""
        left = [np.copy(places) for places in maps]
        for form_there, places in zip(forms, left, strict=True):
            strike(places, self.grid.clear(form, form_there), form_there, place)
        return left

    def filled(self, way: _Way) -> _Filled:
        """Fill sheet after sheet with the remaining parts, in the way's order."""
        remaining = [part.count for part in self.parts]
        placements: list[Placement] = []
        sheet = 0
        while any(remaining):
            on_sheet = self._sheet(sheet, remaining, way) or self._alone(
                sheet, remaining, way.order
            )
            if not on_sheet:
                stuck = next(part for part in way.order if remaining[part])
                return _Filled((), sheet, math.inf, stuck)
            for placement in on_sheet:
                remaining[placement.part] -= 1
            placements += on_sheet
            sheet += 1
        return _Filled(tuple(placements), sheet, self._reach(on_sheet))

    def _sheet(self, sheet: int, remaining: Sequence[int], way: _Way) -> list[Placement]:
        placements, maps = self._start(sheet, remaining, way)
        free = _Free(self.grid, [np.copy(places) for places in maps], way.share)
        remaining = list(remaining)
        for placement in placements:
            remaining[placement.part] -= 1
        for step, part in enumerate(way.order):
            for number in range(remaining[part]):
                spot = free.lowest(self.forms[part])
                if spot is None:
                    break
                form, row, column = spot
                shift = self.grid.shift(form, row, column)
                placements.append(Placement(part, sheet, form.turn, shift))
                rest = way.order[step + (number + 1 == remaining[part]) :]
                open_shapes = {self.shape_of[later] for later in rest if remaining[later]}
                free.occupy(form, (row, column), open_shapes)
        return placements

    def _start(
        self, sheet: int, remaining: Sequence[int], way: _Way
    ) -> tuple[list[Placement], list[Cells]]:
        """Return the lattice that a sheet starts with, and the places that it leaves free."""
        left: Counter[int] = Counter()
        for part, count in enumerate(remaining):
            left[self.shape_of[part]] += count
        shapes = [
            shape
            for shape, lattice in way.lattices.items()
            if left[shape] >= (len(lattice.places) if way.whole_only else LEAST_COPIES)
        ]
        if not shapes:
            return [], self.empty
        shape = max(shapes, key=lambda shape: left[shape] * self.grid.shapes[shape].area)
        places = way.lattices[shape].places[: left[shape]]
        queue = [
            part
            for part in way.order
            if self.shape_of[part] == shape
            for _ in range(remaining[part])
        ]
        placements = [
            Placement(part, sheet, turn, shift)
            for part, (turn, shift) in zip(queue, places, strict=False)
        ]
        key = shape, len(placements)
        if key not in self._started:
            free = _Free(self.grid, [np.copy(places) for places in self.empty], way.share)
            everything = set(self.shape_of)
            for turn, shift in places:
                form = self.grid.form_of[shape, turn]
                for place in self.grid.around(shape, turn, shift):
                    free.occupy(form, place, everything)
            self._started[key] = free.maps
        return placements, self._started[key]

    def _alone(self, sheet: int, remaining: Sequence[int], order: Sequence[int]) -> list[Placement]:
        """Place the next part in the corner of an empty sheet, for a fit too tight for the grid."""
        if self.stock.pins:
            return []
        part = next(part for part in order if remaining[part])
        low_x, low_y, high_x, high_y = self.stock.usable
        for turn in self.stock.turns:
            bounds = placed(self.parts[part].region, turn, (0.0, 0.0)).bounds
            shift: Point = (low_x - bounds[0], low_y - bounds[1])
            if max(bounds[2] + shift[0] - high_x, bounds[3] + shift[1] - high_y) <= ROUNDING:
                return [Placement(part, sheet, turn, shift)]
        return []

    def _reach(self, placements: Sequence[Placement]) -> float:
        tops = {
            (part, form.turn): form.bounds[3]
            for part, forms in enumerate(self.forms)
            for form in forms
        }
        return max(
            tops.get((placement.part, placement.turn), math.inf) + placement.shift[1]
            for placement in placements
        )


def _extremes(places: Cells) -> list[tuple[int, int]]:
    """Return the ends of the outermost rows and columns that have free places."""
    rows, columns = (np.flatnonzero(places.any(axis=axis)) for axis in (1, 0))
    if not rows.size:
        return []
    extremes = set()
    for row in (int(rows[0]), int(rows[-1])):
        across = np.flatnonzero(places[row])
        extremes |= {(row, int(across[0])), (row, int(across[-1]))}
    for column in (int(columns[0]), int(columns[-1])):
        up = np.flatnonzero(places[:, column])
        extremes |= {(int(up[0]), column), (int(up[-1]), column)}
    return sorted(extremes)


class _Free:
    """The free places of every form on one sheet, and the start of the search for the lowest."""

    def __init__(self, grid: Grid, maps: list[Cells], share: float) -> None:
        self.grid, self.maps, self.share = grid, maps, share
        self.searched = [0] * len(maps)

    def lowest(self, forms: Sequence[TurnedShape]) -> tuple[TurnedShape, int, int] | None:
        """The form that lies lowest, by the share of its height that counts; row and column."""
        spots = []
        for form in forms:
            place = self._first(form.number)
            if place is not None:
                low = place[0] + self.share * form.cells.shape[0]
                spots.append((low, place[1], form.number, place[0]))
        if not spots:
            return None
        _, column, number, row = min(spots)
        return self.grid.forms[number], row, column

    def _first(self, number: int) -> tuple[int, int] | None:
        """Return row and column of the lowest free place, the leftmost of its row."""
        places = self.maps[number].reshape(-1)
        # Places are only ever taken, so the search continues where it stopped.
        start = self.searched[number]
        if start < places.size:
            start += int(np.argmax(places[start:]))
            self.searched[number] = start if places[start] else places.size
        if self.searched[number] == places.size:
            return None
        columns: int = self.maps[number].shape[1]
        return divmod(start, columns)

    def occupy(self, form: TurnedShape, place: tuple[int, int], shapes: set[int]) -> None:
        """Remove the places that a form at ``place`` blocks from the maps of these shapes."""
        for neighbour in self.grid.forms:
            if (
                neighbour.shape in shapes
                and self.searched[neighbour.number] < self.maps[neighbour.number].size
            ):
                strike(
                    self.maps[neighbour.number], self.grid.clear(form, neighbour), neighbour, place
                )


# Regions as sets of square cells, and the offsets at which two sets meet.
#
# Every cell that a region reaches into by more than ``TOUCH`` is set, so parts whose cells are
# disjoint are disjoint themselves. Rows count upward (y), columns to the right (x).


AT_ONCE = 1_000_000
"""Pairs of runs that are compared at once, which bounds the memory."""
TOUCH = 1e-7
"""mm by which a region may reach into a cell that is not set: regions side by side may touch."""


class Raster(NamedTuple):
    """``cells`` of a region and the box in mm, in the region's frame, that they fill."""

    cells: Cells
    frame: Bounds


def raster(region: Region, cell: float) -> Raster:
    """Return the cells of a region, centred in their box, so that turns of it agree."""
    low_x, low_y, high_x, high_y = region.bounds
    columns, x = _centred(low_x, high_x, cell)
    rows, y = _centred(low_y, high_y, cell)
    cells = reached(region, (x, y), (rows, columns), cell)
    return Raster(cells, (x, y, x + columns * cell, y + rows * cell))


def aligned(region: Region, origin: Point, cell: float) -> tuple[Cells, int, int]:
    """Return the cells of a region on the grid through ``origin``; row and column of the first."""
    low_x, low_y, high_x, high_y = region.bounds
    first_column, last_column = _span(low_x - origin[0], high_x - origin[0], cell)
    first_row, last_row = _span(low_y - origin[1], high_y - origin[1], cell)
    corner = (origin[0] + first_column * cell, origin[1] + first_row * cell)
    shape = (last_row - first_row + 1, last_column - first_column + 1)
    return reached(region, corner, shape, cell), first_row, first_column


def reached(region: Region, corner: Point, shape: tuple[int, int], cell: float) -> Cells:
    """Return the cells that a region reaches into, of a grid whose lower left is ``corner``."""
    rows, columns = shape
    edge_counts = np.zeros((rows + 1, columns), dtype=np.int32)
    turns = np.zeros((rows + 1, columns), dtype=np.int32)
    for edge in region.edges:
        for piece in _monotone(edge):
            _add_boundary(edge_counts, piece, corner, cell)
            _add_winding(turns, piece, corner, cell)
    return np.asarray(
        (np.cumsum(edge_counts[:-1], axis=0) > 0) | (np.cumsum(turns[:-1], axis=0) > 0)
    )


def meetings(a: Cells, b: Cells) -> Cells:
    """Return the offsets at which cells of ``b`` meet cells of ``a``.

    Entry (0, 0) is where b's upper right cell lies on a's lower left one; the last, the reverse.
    """
    rows, columns = (m + n - 1 for m, n in zip(a.shape, b.shape, strict=True))
    a_row, a_first, a_end = _runs(a)
    b_row, b_first, b_end = _runs(b)
    width = columns + 1
    counts = np.zeros(rows * width, dtype=np.int64)
    # Two runs of cells meet from one offset to another: +1 at the first, -1 past the last.
    for some in np.array_split(np.arange(len(a_row)), 1 + len(a_row) * len(b_row) // AT_ONCE):
        line = (a_row[some, None] - b_row + b.shape[0] - 1) * width + b.shape[1]
        counts += np.bincount((line + a_first[some, None] - b_end).ravel(), minlength=counts.size)
        ends = line + a_end[some, None] - b_first - 1
        counts -= np.bincount(ends.ravel(), minlength=counts.size)
    return np.asarray(counts.reshape(rows, width).cumsum(axis=1)[:, :-1] > 0)


def _runs(cells: Cells) -> tuple[Counts, Counts, Counts]:
    """Return row, first column and the column past the last of all runs of set cells in a row."""
    steps = np.diff(cells.astype(np.int8), axis=1, prepend=0, append=0)
    row, first = np.nonzero(steps > 0)
    return row, first, np.nonzero(steps < 0)[1]


def quarter_turned(cells: Cells, turns: int) -> Cells:
    """Return the cells turned counterclockwise; rows count upward, so against NumPy's own sense."""
    return np.ascontiguousarray(np.rot90(cells, -turns))


def _centred(low: float, high: float, cell: float) -> tuple[int, float]:
    count = max(1, math.ceil((high - low - 2 * TOUCH) / cell))
    return count, (low + high - count * cell) / 2


def _span(low: float, high: float, cell: float) -> tuple[int, int]:
    """Return the first and last cell that an interval reaches into; first > last on a limit."""
    return math.floor((low + TOUCH) / cell), math.ceil((high - TOUCH) / cell) - 1


def _monotone(edge: Edge) -> list[Edge]:
    """Return the edge cut where it turns back in x or in y."""
    if not isinstance(edge, Arc):
        return [edge]
    corners = [edge.start, *map(edge.on_circle, ticks([edge], math.pi / 2, 1e-9)), edge.end]
    return [edge.part(a, b) for a, b in zip(corners, corners[1:], strict=False)]


def _heights(edge: Edge, x: Numbers) -> Numbers:
    """Return y of a monotone edge at each x, clipped to its ends."""
    (x0, y0), (x1, y1) = edge.start, edge.end
    if isinstance(edge, Arc):
        (cx, cy), middle = edge.centre, edge.at(0.5)
        rise = np.sqrt(np.maximum(0.0, edge.radius**2 - (x - cx) ** 2))
        y = cy + rise if middle[1] > cy else cy - rise
    elif abs(x1 - x0) < TOUCH:
        y = np.full_like(x, y0)
    else:
        y = y0 + (x - x0) * ((y1 - y0) / (x1 - x0))
    return np.clip(y, min(y0, y1), max(y0, y1))


def _add_boundary(counts: NDArray[np.int32], edge: Edge, corner: Point, cell: float) -> None:
    """Add the edge to every cell it runs through, as steps to be summed along y."""
    (x0, y0), (x1, y1) = edge.start, edge.end
    rows, columns = counts.shape[0] - 1, counts.shape[1]
    low_x, high_x = sorted((x0, x1))
    first, last = _span(low_x - corner[0], high_x - corner[0], cell)
    first, last = max(0, first), min(columns - 1, last)
    if last < first:
        return
    limits = corner[0] + cell * np.arange(first, last + 2)
    y = _heights(edge, np.clip(limits, low_x, high_x))
    low, high = np.minimum(y[:-1], y[1:]), np.maximum(y[:-1], y[1:])
    if high_x - low_x < TOUCH:
        low, high = np.minimum(low, min(y0, y1)), np.maximum(high, max(y0, y1))
    bottom = np.floor((low - corner[1] + TOUCH) / cell).astype(np.int64)
    top = np.ceil((high - corner[1] - TOUCH) / cell).astype(np.int64)
    bottom, top = np.clip(bottom, 0, rows), np.clip(top, 0, rows)
    there = np.flatnonzero(top > bottom)
    counts[bottom[there], first + there] += 1
    counts[top[there], first + there] -= 1


def _add_winding(turns: NDArray[np.int32], edge: Edge, corner: Point, cell: float) -> None:
    """Add, from the edge upward, its turn round the centres of the cells."""
    x0, x1 = edge.start[0], edge.end[0]
    rows, columns = turns.shape[0] - 1, turns.shape[1]
    # Half open, so that a corner on a column's middle counts once.
    first = math.ceil((min(x0, x1) - corner[0]) / cell - 0.5)
    last = math.ceil((max(x0, x1) - corner[0]) / cell - 0.5) - 1
    first, last = max(0, first), min(columns - 1, last)
    if last < first:
        return
    column = np.arange(first, last + 1)
    y = _heights(edge, corner[0] + cell * (column + 0.5))
    row = np.clip(np.ceil((y - corner[1]) / cell - 0.5).astype(np.int64), 0, rows)
    turns[row, column] += 1 if x1 > x0 else -1


# The usable area as a grid, with shapes as cells.
#
# Shapes are grown by half the spacing, so cells that are disjoint keep it. A place is the row and
# column of the lower left cell of a form.


CELL = 0.1
"""mm; the finest grid. It is coarser where the maps would outgrow ``MEMORY`` bytes."""
MEMORY = 120e6
SNAP = 1e-6
"""Cells by which a shape may lie off the grid as if it lay on it."""
ROUNDING = 5e-7
"""mm by which a part may lie past the border: less than the check's tolerance."""


@dataclass(frozen=True)
class TurnedShape:
    """A shape in one of its turns.

    ``cells`` fill ``frame``; ``bounds`` are the bounds of the shape itself; both mm, in the
    shape's own frame turned. ``number`` counts the forms of all shapes.
    """

    number: int
    shape: int
    turn: Turn
    cells: Cells = field(repr=False)
    frame: Bounds
    bounds: Bounds


def _is_clear(region: Region, shift: Point, stock: Stock) -> bool:
    """Return True if a region that is moved keeps the spacing from all pins."""
    low_x, low_y, high_x, high_y = region.bounds
    for x, y, diameter in stock.pins:
        room, p = diameter / 2 + stock.spacing, (x - shift[0], y - shift[1])
        is_near = low_x - room < p[0] < high_x + room and low_y - room < p[1] < high_y + room
        if is_near and (
            Region(region.outers).contains(p)
            or min(distance_to(edge, p) for edge in region.edges) < room
        ):
            return False
    return True


@dataclass(frozen=True)
class Grid:
    """The forms of all shapes on the grid of one usable ``area``."""

    shapes: tuple[Region, ...]
    area: Bounds
    margin: float
    cell: float
    forms: tuple[TurnedShape, ...]
    form_of: dict[tuple[int, Turn], TurnedShape] = field(repr=False)
    _clear: dict[tuple[int, int], Cells] = field(default_factory=dict, repr=False)

    @property
    def origin(self) -> Point:
        """The grid's corner; parts grown by the margin may reach past the border by it."""
        return self.area[0] - self.margin, self.area[1] - self.margin

    def clear(self, a: TurnedShape, b: TurnedShape) -> Cells:
        """Offsets of ``b`` from ``a`` without overlap, from one less than b's size below 0."""
        key = (a.number, b.number)
        if key not in self._clear:
            self._clear[key] = self._offsets(a, b)
        return self._clear[key]

    def _offsets(self, a: TurnedShape, b: TurnedShape) -> Cells:
        opposite = self._clear.get((b.number, a.number))
        if opposite is not None:
            return np.ascontiguousarray(opposite[::-1, ::-1])
        if a.turn == 0:
            # The reverse pair, turned until a lies as it is drawn.
            turned = self.form_of[a.shape, TURNS[-b.turn % len(TURNS)]]
            twin = self._clear.get((self.form_of[b.shape, 0].number, turned.number))
            if twin is not None:
                return np.ascontiguousarray(quarter_turned(twin, b.turn)[::-1, ::-1])
            return ~meetings(a.cells, b.cells)
        # A common turn of both turns the offsets with them.
        back = self.form_of[b.shape, TURNS[(b.turn - a.turn) % len(TURNS)]]
        return quarter_turned(self.clear(self.form_of[a.shape, 0], back), a.turn)

    def shift(self, form: TurnedShape, row: int, column: int) -> Point:
        """Return the shift in mm of the turned shape to a place."""
        x, y = self.origin
        return x + column * self.cell - form.frame[0], y + row * self.cell - form.frame[1]

    def around(self, shape: int, turn: Turn, shift: Point) -> Iterator[tuple[int, int]]:
        """Yield up to four places whose cells together hold a shape that lies off the grid."""
        left, low, _, _ = _turned(self.form_of[shape, 0].frame, turn)
        x = (left + shift[0] - self.origin[0]) / self.cell
        y = (low + shift[1] - self.origin[1]) / self.cell
        for row in sorted({math.floor(y + SNAP), math.ceil(y - SNAP)}):
            for column in sorted({math.floor(x + SNAP), math.ceil(x - SNAP)}):
                yield row, column

    def places(self, form: TurnedShape, stock: Stock) -> Cells:
        """Return the places of the form inside the border and clear of the pins."""
        x, y = self.shift(form, 0, 0)
        rows = self._count(self.area[3] - form.bounds[3] - y)
        columns = self._count(self.area[2] - form.bounds[2] - x)
        free = np.ones((rows, columns), dtype=np.bool_)
        for pin_x, pin_y, diameter in stock.pins:
            pin = disc((pin_x, pin_y), diameter / 2 + self.margin)
            cells, row, column = aligned(pin, self.origin, self.cell)
            strike(free, ~meetings(cells, form.cells), form, (row, column))
        return free

    def _count(self, room: float) -> int:
        return max(0, math.floor((room + ROUNDING) / self.cell) + 1)


def strike(free: Cells, clear: Cells, form: TurnedShape, place: tuple[int, int]) -> None:
    """Remove a form's free places that are not ``clear`` of a form at ``place``."""
    row, column = (at - size + 1 for at, size in zip(place, form.cells.shape, strict=True))
    rows = slice(max(0, row), max(0, row + clear.shape[0]))
    columns = slice(max(0, column), max(0, column + clear.shape[1]))
    window = free[rows, columns]
    first_row, first_column = rows.start - row, columns.start - column
    window &= clear[
        first_row : first_row + window.shape[0], first_column : first_column + window.shape[1]
    ]


def grid_of(shapes: Sequence[Region], area: Bounds, spacing: float, turns: Sequence[Turn]) -> Grid:
    """Return the grid for shapes, turned by ``turns``, ``spacing`` mm apart in ``area``."""
    margin = spacing / 2
    cell = _cell_size(shapes, area, spacing, len(turns))
    grown = [grow(shape, margin) for shape in shapes]
    forms: list[TurnedShape] = []
    form_of: dict[tuple[int, Turn], TurnedShape] = {}
    for number, shape in enumerate(shapes):
        cells, frame = raster(grown[number], cell)
        by_cells: dict[tuple[tuple[int, ...], bytes], TurnedShape] = {}
        for turn in turns:
            turned = quarter_turned(cells, turn)
            key = (turned.shape, turned.tobytes())
            # Only turns that differ on the grid.
            if key not in by_cells:
                boxes = _turned(frame, turn), _turned(shape.bounds, turn)
                by_cells[key] = TurnedShape(len(forms), number, turn, turned, *boxes)
                forms.append(by_cells[key])
            form_of[number, turn] = by_cells[key]
    return Grid(tuple(shapes), area, margin, cell, tuple(forms), form_of)


def _turned(box: Bounds, turn: Turn) -> Bounds:
    for _ in range(turn):
        low_x, low_y, high_x, high_y = box
        box = (-high_y, low_x, -low_y, high_x)
    return box


def _cell_size(shapes: Sequence[Region], area: Bounds, spacing: float, turns: int) -> float:
    """Return the cell at which the maps of free places and of meetings stay within ``MEMORY``."""
    sizes = [
        (high_x - low_x + spacing, high_y - low_y + spacing)
        for low_x, low_y, high_x, high_y in (shape.bounds for shape in shapes)
    ]
    maps = 2 * turns * len(shapes) * (area[2] - area[0]) * (area[3] - area[1])
    pairs = sum((max(a) + max(b)) ** 2 for a in sizes for b in sizes) * turns**2
    return CELL * max(1.0, math.sqrt((maps + pairs) / CELL**2 / MEMORY))
