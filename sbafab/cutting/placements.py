"""Records of nesting: parts, film sheets, the placements in a nest, and their check.

Lengths are mm, areas mm2. A sheet's lower left corner is its origin.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

from sbafab.design.films import Sheet
from sbafab.errors import OutputError
from sbafab.geometry.edges import (
    Arc,
    Bounds,
    Edge,
    Line,
    Point,
    distance_to,
    line_circle,
    meeting_points,
    unit,
)
from sbafab.geometry.region import Region, disc
from sbafab.geometry.spatial_index import close_pairs, widened
from sbafab.laminate.films import Material
from sbafab.laminate.laminate import Laminate

Turn = Literal[0, 1, 2, 3]
"""Quarter turns, counterclockwise. Never mirrored: a film's faces differ by their cut."""
TURNS: tuple[Turn, ...] = (0, 1, 2, 3)


@dataclass(frozen=True)
class NestPart:
    """One piece to be cut ``count`` times.

    ``region`` is the kerf-compensated path of the beam, in the frame of its layer; ``design`` and
    ``pattern`` name its source, ``piece`` its number (from 1) if the pattern has several pieces.
    """

    design: str
    pattern: str
    piece: int
    material: Material
    region: Region
    count: int

    @property
    def name(self) -> str:
        return f"{self.pattern}.{self.piece}"


class Stock(Sheet):
    """Film to cut from, and the rotations ``turns`` that parts may have on it.

    A path compensated for different kerfs along x and y keeps its axes.
    """

    turns: tuple[Turn, ...] = TURNS

    @property
    def usable(self) -> Bounds:
        """The sheet without its border: least x, least y, largest x, largest y."""
        return self.border, self.border, self.width - self.border, self.length - self.border


@dataclass(frozen=True)
class Placement:
    """A part on a sheet: its region turned by ``turn`` about the origin, then moved by ``shift``.

    ``part`` is an index into the nested parts; sheets count from 0.
    """

    part: int
    sheet: int
    turn: Turn
    shift: Point


@dataclass(frozen=True)
class Nest:
    """The places of all parts of one material; ``placements`` are unordered."""

    material: Material
    stock: Stock
    parts: tuple[NestPart, ...]
    placements: tuple[Placement, ...]

    @property
    def sheets(self) -> int:
        return 1 + max((placement.sheet for placement in self.placements), default=-1)

    def on_sheet(self, sheet: int) -> Sequence[Placement]:
        return [placement for placement in self.placements if placement.sheet == sheet]

    def length(self, sheet: int) -> float:
        """Return the sheet's length: a roll is cut off one border width beyond the last part."""
        if not self.stock.roll:
            return self.stock.length
        tops = (self.region(placement).bounds[3] for placement in self.on_sheet(sheet))
        return max(tops) + self.stock.border

    def region(self, placement: Placement) -> Region:
        """Return the part's path at its place."""
        return self._regions[placement]

    @cached_property
    def _regions(self) -> dict[Placement, Region]:
        return {
            placement: placed(self.parts[placement.part].region, placement.turn, placement.shift)
            for placement in self.placements
        }


def placed(region: Region, turn: Turn, shift: Point) -> Region:
    """Return a region rotated by exact quarter turns about the origin and then shifted."""
    (c, s), (dx, dy) = unit(90.0 * turn), shift
    for contour in region.contours:
        # Computed here once instead of for every place.
        _ = contour.area, contour.length
    return region.mapped(lambda p: (p[0] * c - p[1] * s + dx, p[0] * s + p[1] * c + dy), 1.0, False)


def parts_of(
    laminate: Laminate,
    paths: Mapping[str, Region],
    copies: int,
    spares: Callable[[int], int] = lambda needed: 0,
) -> tuple[NestPart, ...]:
    """Return every piece of every pattern, by pattern in stacking order.

    ``paths`` holds each pattern's kerf-compensated beam path; ``spares`` returns the number of a
    pattern's spare pieces beyond the ``copies``. Pieces of one pattern that differ only in position
    are one part, named after the first.
    """
    parts: list[NestPart] = []
    for pattern, layers in laminate.patterns.items():
        if laminate.cut_with(layers[0]) != layers[0].index:
            continue
        needed = len(layers) * copies
        layers_cut = needed + spares(needed)
        by_form: dict[Region, list[tuple[int, Region]]] = {}
        for number, piece in enumerate(paths[pattern].pieces, start=1):
            low_x, low_y, _, _ = piece.bounds
            by_form.setdefault(piece.moved(-low_x, -low_y), []).append((number, piece))
        for equal in by_form.values():
            (number, piece), count = equal[0], len(equal) * layers_cut
            material = layers[0].film.material
            parts.append(NestPart(laminate.name, pattern, number, material, piece, count))
    return tuple(parts)


# The check of a nest, from the exact regions and independent of the engine.


SLACK = 1e-6
"""mm by which a distance may fall short of the spacing: rounding."""


class Gap(NamedTuple):
    """A least distance in mm (0 for an overlap) and a place at which it occurs."""

    value: float
    place: Point


def check_nest(nest: Nest) -> None:
    """Check a nest against its stock. Raises OutputError with the place of a violation."""
    counts = Counter(placement.part for placement in nest.placements)
    for number, part in enumerate(nest.parts):
        if counts.pop(number, 0) != part.count:
            raise OutputError(
                f"part {part.name} of {part.design} is not nested {part.count} times; nest again."
            )
    sheets = {placement.sheet for placement in nest.placements}
    if counts or sheets != set(range(nest.sheets)) or nest.sheets > nest.stock.most:
        raise OutputError(f"the {nest.material} nest has too many parts or sheets; nest again.")
    for sheet in range(nest.sheets):
        named = [
            (f"{nest.parts[placement.part].name} (no. {number})", nest.region(placement))
            for number, placement in enumerate(nest.on_sheet(sheet), start=1)
        ]
        try:
            check_placed(named, nest.stock)
        except OutputError as error:
            raise OutputError(f"{nest.material} sheet {sheet + 1}: {error}") from error


def check_placed(regions: Sequence[tuple[str, Region]], stock: Stock, slack: float = SLACK) -> None:
    """Check border and spacing of named regions on a sheet. Raises OutputError.

    The tolerance ``slack`` in mm allows for rounding of the numbers in a file.
    """
    min_x, min_y, max_x, max_y = stock.usable
    for name, region in regions:
        low_x, low_y, high_x, high_y = region.bounds
        over = max(min_x - low_x, min_y - low_y, high_x - max_x, high_y - max_y)
        if over > slack:
            x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
            raise OutputError(
                f"{name} at x {x:.3f}, y {y:.3f} extends {over:.4f} mm into the border of "
                f"{stock.border:g} mm; nest again."
            )
    # A part in another's hole would drop out with the waste: holes are cut first.
    entries = [(name, Region(region.outers)) for name, region in regions]
    entries += [
        (f"the pin at x {x:g}, y {y:g}", disc((x, y), diameter / 2))
        for x, y, diameter in stock.pins
    ]
    for pair in close_pairs([region.bounds for _, region in entries], stock.spacing):
        (first, part), (second, part_there) = (entries[number] for number in sorted(pair))
        gap = least_distance(part, part_there, stock.spacing)
        if min(pair) < len(regions) and gap.value < stock.spacing - slack:
            (x, y), value = gap.place, gap.value
            how = f"are {value:.4f} mm apart" if value > 0 else "overlap"
            raise OutputError(
                f"{first} and {second} {how} at x {x:.3f}, y {y:.3f}; the spacing is "
                f"{stock.spacing:g} mm; nest again."
            )


def least_distance(a: Region, b: Region, beyond: float) -> Gap:
    """Return the least distance between two regions, exact for lines and arcs; 0 if they overlap.

    Infinite if it is more than ``beyond`` mm.
    """
    best = Gap(math.inf, a.edges[0].start)
    reach = beyond
    for edge in a.index.touching(widened(b.bounds, beyond)):
        for opposite in b.index.touching(widened(edge.bounds, reach)):
            gap = edge_distance(edge, opposite)
            if gap.value < best.value and gap.value <= beyond:
                best, reach = gap, gap.value
    if best.value > 0:
        for inner, holder in ((a, b), (b, a)):
            for contour in inner.outers:
                if holder.contains(contour.edges[0].start):
                    return Gap(0.0, contour.edges[0].start)
    return best


def edge_distance(a: Edge, b: Edge) -> Gap:
    """Return the least distance between two edges and the point on ``a``, or their intersection."""
    touching = meeting_points(a, b)
    if touching:
        return Gap(0.0, touching[0])
    gaps = [Gap(distance_to(b, p), p) for p in (a.start, a.end, *_feet(a, b))]
    gaps += [Gap(distance_to(a, p), a.nearest(p)) for p in (b.start, b.end)]
    return min(gaps)


def _feet(a: Edge, b: Edge) -> Iterator[Point]:
    """Yield points of ``a`` whose normal may also be a normal of ``b``: on the line of centres."""
    if isinstance(a, Line) and isinstance(b, Line):
        return
    if isinstance(b, Arc):
        yield a.nearest(b.centre)
    if isinstance(a, Arc):
        towards = b.centre if isinstance(b, Arc) else b.nearest(a.centre)
        if math.dist(towards, a.centre) > 1e-9:
            ux, uy = towards[0] - a.centre[0], towards[1] - a.centre[1]
            length = math.hypot(ux, uy)
            axis = (ux / length, uy / length)
            # Both sides of the circle: from inside it, the far one may be the near one.
            for p in line_circle(a.centre, axis, a.centre, a.radius):
                yield a.nearest(p)
