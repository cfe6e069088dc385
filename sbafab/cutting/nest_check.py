"""Check of a nest from the exact regions, independent of the engines: spacing, border, counts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.cutting.placements import Nest, Stock
from sbafab.errors import OutputError
from sbafab.geometry.edges import Arc, Edge, Line, Point, distance_to, line_circle, meeting_points
from sbafab.geometry.region import Region, disc
from sbafab.geometry.spatial_index import close_pairs, widened

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
    """Check named regions on a sheet for its border and spacing. Raises OutputError.

    ``slack`` mm may be missing: the rounding of the numbers in a file.
    """
    min_x, min_y, max_x, max_y = stock.usable
    for name, region in regions:
        low_x, low_y, high_x, high_y = region.bounds
        over = max(min_x - low_x, min_y - low_y, high_x - max_x, high_y - max_y)
        if over > slack:
            x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
            raise OutputError(
                f"{name} at x {x:.3f}, y {y:.3f} reaches {over:.4f} mm into the border of "
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
    """The least distance between two edges and the place on ``a``, or their meeting point."""
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
