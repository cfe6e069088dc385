"""Check of a nest from the exact regions, independent of the engines: spacing, border, counts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.cutting.nest import Nest, Stock
from sbafab.errors import OutputError
from sbafab.geometry.edges import Arc, Edge, Line, Point, distance_to, line_circle, meeting_points
from sbafab.geometry.region import Region, disc
from sbafab.geometry.spatial_index import close_pairs, widened

SLACK = 1e-6
"""mm by which a distance may fall short of the spacing: rounding."""

NEAR = 1e-4
"""Two pairs share a bound of their gaps if their relative places differ by less than this, mm."""


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
    for name, region in regions:
        _check_border(name, region, stock, slack)
    # A part in another's hole would drop out with the waste: holes are cut first.
    regions = [(name, Region(region.outers)) for name, region in regions]
    pins = [
        (f"the pin at x {x:g}, y {y:g}", disc((x, y), diameter / 2))
        for x, y, diameter in stock.pins
    ]
    entries = [*regions, *pins]
    rounds = [_round(region) for _, region in entries]
    for i, j in close_pairs([region.bounds for _, region in entries], stock.spacing):
        if min(i, j) >= len(regions) or _circle_gap(rounds[i], rounds[j]) >= stock.spacing:
            continue
        pair = entries[i][1], entries[j][1]
        gap = least_distance(*pair, stock.spacing)
        if gap.value < stock.spacing - slack:
            (x, y), (first, second) = gap.place, (entries[min(i, j)][0], entries[max(i, j)][0])
            how = f"are {gap.value:.4f} mm apart" if gap.value > 0 else "overlap"
            raise OutputError(
                f"{first} and {second} {how} at x {x:.3f}, y {y:.3f}; the spacing is "
                f"{stock.spacing:g} mm; nest again."
            )


def _round(region: Region) -> tuple[Point, float]:
    """Return centre and radius of a circle that encloses the region; exact for a disc."""
    low_x, low_y, high_x, high_y = region.bounds
    centre = (low_x + high_x) / 2, (low_y + high_y) / 2
    return centre, max(edge.farthest_from(centre) for edge in region.edges)


def _circle_gap(a: tuple[Point, float], b: tuple[Point, float]) -> float:
    """Return the gap between two circles, mm: a lower bound for regions inside them."""
    return math.dist(a[0], b[0]) - a[1] - b[1]


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


def _check_border(name: str, region: Region, stock: Stock, slack: float) -> None:
    min_x, min_y, max_x, max_y = stock.usable
    low_x, low_y, high_x, high_y = region.bounds
    over = max(min_x - low_x, min_y - low_y, high_x - max_x, high_y - max_y)
    if over > slack:
        x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
        raise OutputError(
            f"{name} at x {x:.3f}, y {y:.3f} reaches {over:.4f} mm into the border of "
            f"{stock.border:g} mm; nest again."
        )
