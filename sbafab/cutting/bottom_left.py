"""The nesting engine: bottom-left on a fine grid, from an empty sheet or around copies of one
shape.

Each part goes to the lowest free place. Several fixed orders are tried. If the parts take more
sheets than their area needs, they are also placed around copies of the shapes with the largest
total area: a lattice, or an arrangement found by a beam search if few copies fill a sheet. The best
result is returned. The engine is deterministic.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from sbafab.cutting.lattice import Lattice, lattice_of, lattices_of, most_copies
from sbafab.cutting.placements import TURNS, NestPart, Placement, Stock, Turn, placed
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

Cell = tuple[int, int]
"""Row and column of the lower left cell of a form."""
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
CELL = 0.1
"""mm; the finest grid. It is coarser where the maps would outgrow ``MEMORY`` bytes."""
MEMORY = 120e6
SNAP = 1e-6
"""Cells by which a shape may lie off the grid as if it lay on it."""
ROUNDING = 5e-7
"""mm by which a part may lie past the border: less than the check's tolerance."""


def bottom_left(
    parts: Sequence[NestPart], stock: Stock, lattices: bool = True
) -> tuple[Placement, ...]:
    """Return places for every part; each must fit the usable area.

    Without ``lattices`` all sheets start empty. Raises DesignError if the pins leave no room for a
    part.
    """
    _, low_y, _, high_y = stock.usable
    window = min(high_y - low_y, _length_needed(parts, stock))
    while True:
        filler = _Filler(parts, stock, low_y + window)
        best = min(map(filler.filled, _ways(parts)), key=_score)
        if window >= high_y - low_y or (best.stuck is None and best.sheets == 1):
            break
        window = min(high_y - low_y, 2 * window)
    if best.stuck is not None:
        part, where = parts[best.stuck], sheet_section(parts[best.stuck].material)
        raise DesignError(
            f"pattern {part.pattern} of {part.design} does not fit {stock.spacing:g} mm clear of "
            f"the {len(stock.pins)} {where}.pins; lower {where}.spacing, move the pins, or enlarge "
            "the sheet."
        )
    if lattices and takes_lattices(parts, stock, best.sheets):
        ways = (
            way._replace(lattices=copies, whole_only=whole_only)
            for copies in filler.lattices()
            if copies
            for way in _ways(parts)
            for whole_only in (True, False)
        )
        best = min([best, *map(filler.filled, ways)], key=_score)
    return best.placements


def sheet_section(material: Material) -> str:
    """Return the section of a design file for this material's sheets."""
    name = material.lower()
    return f"sheets.{name}" if material in FIRST else f"films.{name}.sheet"


class _Way(NamedTuple):
    """A filling method: the order of the parts, and the fraction of their height that ranks places.

    Sheets start with a lattice of the shape with the largest remaining area that has one; with
    ``whole_only``, only if it fills the sheet.
    """

    order: tuple[int, ...]
    share: float
    lattices: Mapping[int, Lattice] = MappingProxyType({})
    whole_only: bool = False


class _Filled(NamedTuple):
    """``reach`` is the last sheet's highest y; ``stuck`` the first part that fits nowhere."""

    placements: tuple[Placement, ...]
    sheets: int
    reach: float
    stuck: int | None = None


def _score(filled: _Filled) -> tuple[bool, int, float]:
    """A sort key: fewest sheets, then the shortest last sheet; the first of equal results wins."""
    return filled.stuck is not None, filled.sheets, round(filled.reach, 3)


def _size(region: Region) -> tuple[float, float]:
    low_x, low_y, high_x, high_y = region.bounds
    return high_x - low_x, high_y - low_y


def _ways(parts: Sequence[NestPart]) -> list[_Way]:
    """Return filling methods, large parts first by area or longest side: small ones fill gaps."""
    orders = []
    for measure in (math.prod, max):
        sizes = [-round(measure(_size(part.region)), 6) for part in parts]
        orders.append(tuple(sorted(range(len(parts)), key=sizes.__getitem__)))
    ways = [_Way(order, share) for order in dict.fromkeys(orders) for share in (0.5, 0.0, 1.0)]
    return ways if sum(part.count for part in parts) < MANY else ways[:2]


def takes_lattices(parts: Sequence[NestPart], stock: Stock, sheets: int) -> bool:
    """True if lattices may save film, given the ``sheets`` that bottom-left placement needs."""
    shapes, shape_of = _shapes(parts)
    counts = _counts(shape_of, [part.count for part in parts])
    if max(counts.values()) < LEAST_COPIES:
        return False
    # A lower bound: the room is filled by the shapes, each with half the spacing round it.
    grown = sum(counts[i] * _grown(shape, stock) for i, shape in enumerate(shapes))
    return stock.roll or (sheets > 1 and sheets > math.ceil(grown / _room(stock) - 1e-6))


def _counts(shape_of: Sequence[int], counts: Sequence[int]) -> Counter[int]:
    """Return the number of parts of each shape."""
    by_shape: Counter[int] = Counter()
    for shape, count in zip(shape_of, counts, strict=True):
        by_shape[shape] += count
    return by_shape


def _grown(shape: Region, stock: Stock) -> float:
    """Return the area of a shape with half the spacing around it."""
    return grow(shape, stock.spacing / 2).area


def _room(stock: Stock) -> float:
    """Return the usable area with half the spacing around it."""
    low_x, low_y, high_x, high_y = stock.usable
    return (high_x - low_x + stock.spacing) * (high_y - low_y + stock.spacing)


def _length_needed(parts: Sequence[NestPart], stock: Stock) -> float:
    """Return a length that very probably holds all parts, to limit the maps of long rolls."""
    sizes = [[side + stock.spacing for side in _size(part.region)] for part in parts]
    area = sum(part.count * math.prod(size) for part, size in zip(parts, sizes, strict=True))
    low_x, _, high_x, _ = stock.usable
    pins = sum((diameter + 2 * stock.spacing) ** 2 for _, _, diameter in stock.pins)
    return 1.3 * (area + pins) / (high_x - low_x) + 2 * max(map(max, sizes), default=0.0)


def _shapes(parts: Sequence[NestPart]) -> tuple[list[Region], list[int]]:
    """Return the distinct outlines, and the number of each part's outline.

    Holes count as solid: they are cut before all outlines, and a part in one would drop out.
    """
    numbers: dict[Region, int] = {}
    shape_of = [numbers.setdefault(Region(part.region.outers), len(numbers)) for part in parts]
    return list(numbers), shape_of


class _Form(NamedTuple):
    """A shape at one of its rotations; ``number`` counts the forms of all shapes.

    ``cells``, of the shape grown by half the spacing, fill ``frame``; ``bounds`` are those of the
    shape itself; both in mm, in the rotated frame of the shape.
    """

    number: int
    shape: int
    turn: Turn
    cells: Cells
    frame: Bounds
    bounds: Bounds


class _Filler:
    """Fills sheets of the usable area up to ``top`` by a given method, on one grid.

    Shapes are grown by half the spacing, so that disjoint cells guarantee it.
    """

    def __init__(self, parts: Sequence[NestPart], stock: Stock, top: float) -> None:
        self.parts, self.stock, self.margin = parts, stock, stock.spacing / 2
        self.shapes, self.shape_of = _shapes(parts)
        low_x, low_y, high_x, _ = stock.usable
        self.area: Bounds = (low_x, low_y, high_x, top)
        # Parts grown by the margin may reach past the border by it.
        self.origin: Point = (low_x - self.margin, low_y - self.margin)
        self.cell = _cell_size(self.shapes, self.area, stock)
        self.forms: list[_Form] = []
        self.form_of: dict[tuple[int, Turn], _Form] = {}
        for number, shape in enumerate(self.shapes):
            self._add_forms(number, shape)
        self._clear: dict[tuple[int, int], Cells] = {}
        self._started: dict[tuple[int, int], list[Cells]] = {}
        self.empty = [self._places(form) for form in self.forms]

    # The grid.

    def _add_forms(self, number: int, shape: Region) -> None:
        """Add the rotations of a shape that differ on the grid."""
        cells, frame = raster(grow(shape, self.margin), self.cell)
        by_cells: dict[tuple[tuple[int, ...], bytes], _Form] = {}
        for turn in self.stock.turns:
            turned = quarter_turned(cells, turn)
            key = (turned.shape, turned.tobytes())
            if key not in by_cells:
                boxes = _turned(frame, turn), _turned(shape.bounds, turn)
                by_cells[key] = _Form(len(self.forms), number, turn, turned, *boxes)
                self.forms.append(by_cells[key])
            self.form_of[number, turn] = by_cells[key]

    def clear(self, a: _Form, b: _Form) -> Cells:
        """Offsets of ``b`` from ``a`` without overlap, from one less than b's size below 0."""
        key = (a.number, b.number)
        if key not in self._clear:
            opposite = self._clear.get(key[::-1])
            if opposite is not None:
                self._clear[key] = np.ascontiguousarray(opposite[::-1, ::-1])
            elif a.turn == 0:
                self._clear[key] = ~meetings(a.cells, b.cells)
            else:
                # A common turn of both turns the offsets with them.
                back = self.form_of[b.shape, TURNS[(b.turn - a.turn) % len(TURNS)]]
                offsets = self.clear(self.form_of[a.shape, 0], back)
                self._clear[key] = quarter_turned(offsets, a.turn)
        return self._clear[key]

    def shift(self, form: _Form, row: int, column: int) -> Point:
        """Return the shift in mm of the rotated shape to a place."""
        x, y = self.origin
        return x + column * self.cell - form.frame[0], y + row * self.cell - form.frame[1]

    def _around(self, shape: int, turn: Turn, shift: Point) -> Iterator[Cell]:
        """Yield up to four places whose cells together cover a shape that lies off the grid."""
        corner = _turned(self.form_of[shape, 0].frame, turn)
        x, y = ((corner[k] + shift[k] - self.origin[k]) / self.cell for k in (0, 1))
        for row in sorted({math.floor(y + SNAP), math.ceil(y - SNAP)}):
            for column in sorted({math.floor(x + SNAP), math.ceil(x - SNAP)}):
                yield row, column

    def _places(self, form: _Form) -> Cells:
        """Return the places of a form that are inside the border and clear of the pins."""
        room = (
            self.area[side + 2] - form.bounds[side + 2] - self.shift(form, 0, 0)[side]
            for side in (1, 0)
        )
        counts = [max(0, math.floor((r + ROUNDING) / self.cell) + 1) for r in room]
        free = np.ones(counts, dtype=np.bool_)
        for x, y, diameter in self.stock.pins:
            pin = disc((x, y), diameter / 2 + self.margin)
            cells, place = aligned(pin, self.origin, self.cell)
            strike(free, ~meetings(cells, form.cells), form, place)
        return free

    # Copies of one shape on an empty sheet.

    def lattices(self) -> list[dict[int, Lattice]]:
        """Return copies on a sheet, for the shapes with the largest area and enough copies.

        These are the best lattices, or arrangements or pairs of lattices that hold more copies.
        """
        counts = _counts(self.shape_of, [part.count for part in self.parts])
        areas = dict.fromkeys(range(len(self.shapes)), 0.0)
        for part, shape in zip(self.parts, self.shape_of, strict=True):
            areas[shape] += part.count * part.region.area
        kinds: list[dict[int, Lattice]] = [{}, {}, {}]
        for shape in sorted(areas, key=lambda shape: -areas[shape])[:MOST_LATTICES]:
            if counts[shape] >= LEAST_COPIES:
                laid = sorted(self._clear_lattices(self.shapes[shape]), key=most_copies)
                alone = next(lattice for lattice in laid if not lattice.is_pair)
                # Of equal ones the first, which rows are.
                for kind, other in zip(
                    kinds, (alone, self._arrangement(shape), laid[0]), strict=True
                ):
                    kind[shape] = other if len(other.places) > len(alone.places) else alone
        return [kind for number, kind in enumerate(kinds) if kind not in kinds[:number]]

    def _clear_lattices(self, shape: Region) -> Iterator[Lattice]:
        """Yield the lattices of a shape without copies too close to pins."""
        stock = self.stock
        turned = {turn: placed(shape, turn, (0.0, 0.0)) for turn in TURNS}
        for lattice in lattices_of(shape, stock.spacing, self.area, stock.turns):
            places = (
                place for place in lattice.places if _is_clear(turned[place[0]], place[1], stock)
            )
            yield lattice._replace(places=tuple(places))

    def _arrangement(self, shape: int) -> Lattice:
        """Return copies of a shape, found by a beam search; none if many fit a sheet.

        Each step adds a copy at an extreme free place and keeps the sheets with the most free
        places.
        """
        if _room(self.stock) > FEW * _grown(self.shapes[shape], self.stock):
            return Lattice((), 0.0)
        forms = [form for form in self.forms if form.shape == shape]
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
                            steps[more] = [np.copy(free_map) for free_map in maps]
                            for there, free_map in zip(forms, steps[more], strict=True):
                                strike(free_map, self.clear(form, there), there, place)
            sheets = sorted(steps.items(), key=lambda step: -sum(map(np.count_nonzero, step[1])))
            sheets = sheets[:BEAM]
        chosen = [(self.forms[number], place) for number, *place in best]
        return lattice_of(
            self.shapes[shape], [(form.turn, self.shift(form, *place)) for form, place in chosen]
        )

    # Sheet after sheet.

    def filled(self, way: _Way) -> _Filled:
        """Fill successive sheets with the remaining parts, in the method's order."""
        remaining = [part.count for part in self.parts]
        placements: list[Placement] = []
        on_sheet: list[Placement] = []
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
        tops = {(form.shape, form.turn): form.bounds[3] for form in self.forms}
        reach = max(
            tops.get((self.shape_of[at.part], at.turn), math.inf) + at.shift[1] for at in on_sheet
        )
        return _Filled(tuple(placements), sheet, reach)

    def _sheet(self, sheet: int, counts: Sequence[int], way: _Way) -> list[Placement]:
        placements, maps = self._start(sheet, counts, way)
        free = _Free(self, [np.copy(places) for places in maps], way.share)
        remaining = list(counts)
        for placement in placements:
            remaining[placement.part] -= 1
        for step, part in enumerate(way.order):
            for number in range(remaining[part]):
                spot = free.lowest(self.shape_of[part])
                if spot is None:
                    break
                form, *place = spot
                placements.append(Placement(part, sheet, form.turn, self.shift(form, *place)))
                rest = way.order[step + (number + 1 == remaining[part]) :]
                open_shapes = {self.shape_of[later] for later in rest if remaining[later]}
                free.occupy(*spot, open_shapes)
        return placements

    def _start(
        self, sheet: int, remaining: Sequence[int], way: _Way
    ) -> tuple[list[Placement], list[Cells]]:
        """Return the initial lattice of a sheet, and the places that it leaves free."""
        counts = _counts(self.shape_of, remaining)
        shapes = [
            shape
            for shape, lattice in way.lattices.items()
            if counts[shape] >= (len(lattice.places) if way.whole_only else LEAST_COPIES)
        ]
        if not shapes:
            return [], self.empty
        shape = max(shapes, key=lambda shape: counts[shape] * self.shapes[shape].area)
        places = way.lattices[shape].places[: counts[shape]]
        mine = [part for part in way.order if self.shape_of[part] == shape]
        queue = (part for part in mine for _ in range(remaining[part]))
        placements = [
            Placement(part, sheet, *place) for place, part in zip(places, queue, strict=False)
        ]
        key = shape, len(placements)
        if key not in self._started:
            free = _Free(self, [np.copy(maps) for maps in self.empty], way.share)
            for turn, shift in places:
                for place in self._around(shape, turn, shift):
                    free.occupy(self.form_of[shape, turn], *place, set(self.shape_of))
            self._started[key] = free.maps
        return placements, self._started[key]

    def _alone(self, sheet: int, remaining: Sequence[int], order: Sequence[int]) -> list[Placement]:
        """Place the next part in the corner of an empty sheet, for a fit too tight for the grid."""
        part = next(part for part in order if remaining[part])
        low_x, low_y, high_x, high_y = self.stock.usable
        for turn in self.stock.turns if not self.stock.pins else ():
            bounds = placed(self.parts[part].region, turn, (0.0, 0.0)).bounds
            shift: Point = (low_x - bounds[0], low_y - bounds[1])
            if max(bounds[2] + shift[0] - high_x, bounds[3] + shift[1] - high_y) <= ROUNDING:
                return [Placement(part, sheet, turn, shift)]
        return []


def _is_clear(region: Region, shift: Point, stock: Stock) -> bool:
    """Return True if a shifted region keeps the spacing from all pins."""
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


def _extremes(places: Cells) -> list[Cell]:
    """Return the ends of the outermost rows and columns that have free places."""
    rows, columns = (np.flatnonzero(places.any(axis=axis)) for axis in (1, 0))
    if not rows.size:
        return []
    extremes = set()
    for row in rows[[0, -1]].tolist():
        extremes |= {(row, column) for column in np.flatnonzero(places[row])[[0, -1]].tolist()}
    for column in columns[[0, -1]].tolist():
        extremes |= {(row, column) for row in np.flatnonzero(places[:, column])[[0, -1]].tolist()}
    return sorted(extremes)


def strike(free: Cells, clear: Cells, form: _Form, place: Sequence[int]) -> None:
    """Remove a form's free places that are not ``clear`` of a form at ``place``."""
    row, column = (at - size + 1 for at, size in zip(place, form.cells.shape, strict=True))
    first_row, first_column = max(0, row), max(0, column)
    window = free[
        first_row : max(0, row + clear.shape[0]), first_column : max(0, column + clear.shape[1])
    ]
    there = clear[first_row - row :, first_column - column :]
    window &= there[: window.shape[0], : window.shape[1]]


class _Free:
    """The free places of every form on one sheet, and the start of the search for the lowest."""

    def __init__(self, filler: _Filler, maps: list[Cells], share: float) -> None:
        self.filler, self.maps, self.share = filler, maps, share
        self.searched = [0] * len(maps)

    def lowest(self, shape: int) -> tuple[_Form, int, int] | None:
        """The form with the lowest place, ranked by its height fraction; row and column."""
        spots = []
        for form in self.filler.forms:
            place = self._first(form.number) if form.shape == shape else None
            if place is not None:
                low = place[0] + self.share * form.cells.shape[0]
                spots.append((low, place[1], form.number, place[0]))
        if not spots:
            return None
        _, column, number, row = min(spots)
        return self.filler.forms[number], row, column

    def _first(self, number: int) -> Cell | None:
        """Return row and column of the lowest free place, the leftmost in its row."""
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

    def occupy(self, form: _Form, row: int, column: int, shapes: set[int]) -> None:
        """Remove places blocked by a placed form from the maps of these shapes."""
        for near in self.filler.forms:
            places = self.maps[near.number]
            if near.shape in shapes and self.searched[near.number] < places.size:
                strike(places, self.filler.clear(form, near), near, (row, column))


# Regions as sets of square cells, and the offsets at which two sets meet.
#
# Every cell that a region reaches into by more than ``TOUCH`` is set, so parts whose cells are
# disjoint are disjoint themselves. Rows count upward (y), columns to the right (x).


AT_ONCE = 1_000_000
"""Pairs of runs that are compared at once, which bounds the memory."""
TOUCH = 1e-7
"""mm by which a region may reach into a cell that is not set: regions side by side may touch."""


def raster(region: Region, cell: float) -> tuple[Cells, Bounds]:
    """Return the cells of a region, centred in their box so that rotations match, and the box."""
    low_x, low_y, high_x, high_y = region.bounds
    columns, x = _centred(low_x, high_x, cell)
    rows, y = _centred(low_y, high_y, cell)
    box = x, y, x + columns * cell, y + rows * cell
    return reached(region, (x, y), (rows, columns), cell), box


def _centred(low: float, high: float, cell: float) -> tuple[int, float]:
    count = max(1, math.ceil((high - low - 2 * TOUCH) / cell))
    return count, (low + high - count * cell) / 2


def aligned(region: Region, origin: Point, cell: float) -> tuple[Cells, Cell]:
    """Return the cells of a region on the grid through ``origin``, and the place of the first."""
    box = region.bounds
    (first_column, last_column), (first_row, last_row) = (
        _span(box[k] - origin[k], box[k + 2] - origin[k], cell) for k in (0, 1)
    )
    corner = (origin[0] + first_column * cell, origin[1] + first_row * cell)
    shape = (last_row - first_row + 1, last_column - first_column + 1)
    return reached(region, corner, shape, cell), (first_row, first_column)


def reached(region: Region, corner: Point, shape: tuple[int, int], cell: float) -> Cells:
    """Return the cells that a region touches in a grid whose lower left is ``corner``."""
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
    """Return the offsets at which cells of ``b`` overlap cells of ``a``.

    At entry (0, 0) b's upper right cell lies on a's lower left cell; the last entry is the reverse.
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
    """Return row, first column and end column of all runs of set cells in a row."""
    steps = np.diff(cells.astype(np.int8), axis=1, prepend=0, append=0)
    row, first = np.nonzero(steps > 0)
    return row, first, np.nonzero(steps < 0)[1]


def quarter_turned(cells: Cells, turns: int) -> Cells:
    """The cells rotated 90 degrees counterclockwise, with rows upward (opposite to NumPy)."""
    return np.ascontiguousarray(np.rot90(cells, -turns))


def _span(low: float, high: float, cell: float) -> tuple[int, int]:
    """Return the first and last cell that an interval overlaps; first > last on a cell boundary."""
    return math.floor((low + TOUCH) / cell), math.ceil((high - TOUCH) / cell) - 1


def _monotone(edge: Edge) -> list[Edge]:
    """Return the edge split where its direction in x or y reverses."""
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
    """Add the edge to every cell that it crosses, as increments to be summed along y."""
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
    """Add the winding of the edge to the cells above it, at their centres."""
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


def _turned(box: Bounds, turn: Turn) -> Bounds:
    for _ in range(turn):
        low_x, low_y, high_x, high_y = box
        box = (-high_y, low_x, -low_y, high_x)
    return box


def _cell_size(shapes: Sequence[Region], area: Bounds, stock: Stock) -> float:
    """Return the cell size at which the maps of free places and overlaps stay within ``MEMORY``."""
    turns, sides = len(stock.turns), [max(_size(shape)) + stock.spacing for shape in shapes]
    maps = 2 * turns * len(shapes) * (area[2] - area[0]) * (area[3] - area[1])
    pairs = sum((a + b) ** 2 for a in sides for b in sides) * turns**2
    return CELL * max(1.0, math.sqrt((maps + pairs) / CELL**2 / MEMORY))
