"""Writes docs/measured/nesting.csv: sheets of every template's batch, beside other nesters.

    python -m docs.scripts.nesting        (for it alone: pip install spyrrow python-libnest2d)

sparrow packs a strip as wide as a sheet, whose length over a sheet's is rounded up; a cut at a
sheet's end may cross parts, so it is a lower bound of what it needs. For films of one shape ``most``
is what we can put on a sheet, and ``one_more`` is "no" if sparrow cannot put one copy more on it.
libnest2d puts parts by no-fit polygons, first fit. ``area`` and ``rectangle`` are lower bounds for any
nester with quarter turns: by the area of the parts, and by a rectangle that lies in every part.
"""

from __future__ import annotations

import csv
import math
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path
from typing import Any

import shapely

from sbafab.actuators import load_design
from sbafab.cutting.bottom_left import bottom_left
from sbafab.cutting.nesting import materials_of, nest, of_material
from sbafab.cutting.placements import NestPart, Stock, check_nest
from sbafab.design.files import template_names
from sbafab.errors import DesignError
from sbafab.folders.build import make_build, stocks
from sbafab.geometry.contour import run_chords
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region

COPIES = (1, 4, 8, 20)
SECONDS = 25
"""By the clock, of sparrow for each strip; the processor's time is written."""
MOST_PARTS = 130
"""libnest2d, whose time grows with the square of the parts, gets no more."""
MOST_RECTANGLES = 30
"""Rectangles on a sheet, by area, up to which their most is found."""
TINY = 1e-7
SLACK = 0.01
"""mm by which libnest2d's parts may be nearer: its outlines are polygons."""
TABLE = Path(__file__).parents[1] / "measured" / "nesting.csv"
COLUMNS = (
    "design", "copies", "film", "parts", "area", "rectangle", "bottom_left", "sbafab", "seconds",
    "sparrow", "sparrow_seconds", "most", "one_more", "libnest2d", "libnest2d_seconds",
)  # fmt: skip


def rows() -> Iterator[dict[str, Any]]:
    """Yield a row for each film of each batch."""
    for name in template_names():
        for copies in COPIES:
            try:
                design = load_design(name, (f"order.copies={copies}",), ())
            except DesignError:
                # An assembly, whose designs are templates themselves.
                break
            parts = make_build(design).pieces
            for film in materials_of(parts):
                stock = stocks(design)[film].model_copy(update={"most": 1000})
                entry = {"design": name, "copies": copies, "film": film}
                yield entry | measured(of_material(parts, film), stock)


def measured(parts: Sequence[NestPart], stock: Stock) -> dict[str, Any]:
    """Return sheets and processor time of each nester."""
    began = time.process_time()
    (result,) = nest(parts, {parts[0].material: stock})
    seconds = time.process_time() - began
    check_nest(result)
    area, rectangle = area_bound(parts, stock), rectangle_bound(parts, stock)
    plain = 1 + max(place.sheet for place in bottom_left(parts, stock, lattices=False))
    row = {"parts": sum(part.count for part in parts), "area": area, "rectangle": rectangle}
    row |= {"bottom_left": plain, "sbafab": result.sheets, "seconds": round(seconds, 2)}
    # One sheet, or as few as a bound allows, cannot be beaten.
    if result.sheets == max(1, area, rectangle):
        return row
    row |= sparrow(parts, stock) | libnest2d(parts, stock)
    if len({Region(part.region.outers) for part in parts}) == 1:
        most = max(len(result.on_sheet(sheet)) for sheet in range(result.sheets))
        while fits(parts[0], most + 1, stock):
            most += 1
        length, _ = strip([replace(parts[0], count=most + 1)], stock)
        more = "yes" if length <= stock.usable[3] - stock.usable[1] else "no"
        row |= {"most": most, "one_more": more}
    return row


def fits(part: NestPart, count: int, stock: Stock) -> bool:
    """Return True if we put so many copies on one sheet."""
    (result,) = nest([replace(part, count=count)], {part.material: stock})
    return result.sheets == 1


def area_bound(parts: Sequence[NestPart], stock: Stock) -> int:
    """Return the sheets that the parts fill, each with half the spacing round it."""
    low_x, low_y, high_x, high_y = stock.usable
    grown = [
        part.count * grow(Region(part.region.outers), stock.spacing / 2).area for part in parts
    ]
    room = (high_x - low_x + stock.spacing) * (high_y - low_y + stock.spacing)
    return math.ceil(sum(grown) / room - 1e-6)


def rectangle_bound(parts: Sequence[NestPart], stock: Stock) -> int:
    """Return the sheets that the parts need by a rectangle that lies in each of them."""
    each = [rectangles(shape) for shape in {Region(part.region.outers) for part in parts}]
    shared = {
        (a, b)
        for sides in each
        for a, b in sides
        if all(any(a <= c and b <= d for c, d in others) for others in each)
    }
    # Parts that are ``spacing`` apart are that over the root of two apart along x or along y.
    room = stock.spacing / math.sqrt(2)
    low_x, low_y, high_x, high_y = stock.usable
    sheet = high_x - low_x + room, high_y - low_y + room
    most = min(
        (
            most_rectangles((a + room, b + room), sheet)
            for a, b in shared
            if (a + room) * (b + room) * MOST_RECTANGLES > math.prod(sheet)
        ),
        default=math.inf,
    )
    return math.ceil(sum(part.count for part in parts) / most)


def most_rectangles(sides: tuple[float, float], sheet: tuple[float, float]) -> int:
    """Return the most rectangles, lying or standing, that a sheet holds, by an integer program.

    Moved left and down as far as they go, their corners lie at sums of sides (Herz 1972).
    """
    import numpy as np
    from scipy.optimize import Bounds, LinearConstraint, milp

    a, b = sides
    sums = {
        i * a + j * b
        for i in range(int(max(sheet) / a) + 1)
        for j in range(int(max(sheet) / b) + 1)
    }
    columns, rows = (np.array(sorted(at for at in sums if at <= end)) for end in sheet)
    covered = [
        np.outer(
            (x - TINY < columns) & (columns < x + w - TINY),
            (y - TINY < rows) & (rows < y + h - TINY),
        )
        for w, h in ((a, b), (b, a))
        for x in columns[columns + w <= sheet[0] + TINY]
        for y in rows[rows + h <= sheet[1] + TINY]
    ]
    if not covered:
        return 0
    table = np.array([cells.ravel() for cells in covered], dtype=float).T
    solved = milp(
        -np.ones(len(covered)),
        constraints=LinearConstraint(table, ub=1.0),
        integrality=np.ones(len(covered)),
        bounds=Bounds(0, 1),
        options={"time_limit": SECONDS},
    )
    # The bound that is proven, where the time was not enough.
    return math.floor(-solved.mip_dual_bound + 1e-6)


def rectangles(shape: Region) -> list[tuple[float, float]]:
    """Return sides of rectangles in a shape, the longer first, from corner to corner of it."""
    polygon = shapely.Polygon(shape.polygons(1e-3)[0][0]).buffer(1e-6)
    corners = [edge.start for edge in shape.edges]
    spans = [combinations(sorted({round(at[axis], 6) for at in corners}), 2) for axis in (0, 1)]
    return [
        (max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0))
        for (x0, x1), (y0, y1) in product(*spans)
        if polygon.contains(shapely.box(x0, y0, x1, y1))
    ]


def sparrow(parts: Sequence[NestPart], stock: Stock) -> dict[str, Any]:
    """Return the sheets of the strip that sparrow packs, and its processor time."""
    length, seconds = strip(parts, stock)
    low, high = stock.usable[1::2]
    # Two sheets' worth of strip lacks the gap between them.
    sheets = math.ceil((length + stock.spacing) / (high - low + stock.spacing) - 1e-6)
    return {"sparrow": sheets, "sparrow_seconds": round(seconds, 1)}


def strip(parts: Sequence[NestPart], stock: Stock) -> tuple[float, float]:
    """Return the length of the strip that sparrow packs, in mm, and its processor time in s."""
    import spyrrow

    low_x, _, high_x, _ = stock.usable
    items = [
        spyrrow.Item(
            str(number),
            [p for run in part.region.outers[0].runs for p in run_chords(run, True, 0.01)],
            part.count,
            [0.0, 90.0, 180.0, 270.0],
        )
        for number, part in enumerate(parts)
    ]
    # It keeps the spacing from the strip's sides and ends, too, where a border needs none.
    instance = spyrrow.StripPackingInstance("strip", high_x - low_x + 2 * stock.spacing, items)
    settings = spyrrow.StripPackingConfig(
        min_items_separation=stock.spacing,
        total_computation_time=SECONDS,
        num_workers=1,
        seed=1,
    )
    began = time.process_time()
    length = instance.solve(settings).width - 2 * stock.spacing
    return length, time.process_time() - began


def libnest2d(parts: Sequence[NestPart], stock: Stock) -> dict[str, Any]:
    """Return the sheets that libnest2d takes, and its processor time; nothing for many parts.

    The sheets are "overlap" if two of its parts are nearer than the spacing, or leave the sheet.
    """
    import pynest2d

    if sum(part.count for part in parts) > MOST_PARTS:
        return {}
    low_x, low_y, high_x, high_y = stock.usable
    unit = pynest2d.mm()
    items = []
    for part in parts:
        runs = part.region.outers[0].runs
        corners = [p for run in runs for p in run_chords(run, True, 0.01)]
        outline = [pynest2d.Point(round(x * unit), round(y * unit)) for x, y in corners]
        items += [pynest2d.Item(outline) for _ in range(part.count)]
    sheet = pynest2d.Box(round((high_x - low_x) * unit), round((high_y - low_y) * unit))
    began = time.process_time()
    sheets = pynest2d.nest(items, sheet, round(stock.spacing * unit), pynest2d.NfpConfig())
    seconds = round(time.process_time() - began, 1)
    laid: dict[int, list[shapely.Polygon]] = defaultdict(list)
    for item in items:
        corners = [(point.x() / unit, point.y() / unit) for point in item.transformedContour()]
        laid[item.binId()].append(shapely.Polygon(corners))
    is_valid = all(_are_apart(polygons, stock) for polygons in laid.values())
    return {"libnest2d": sheets if is_valid else "overlap", "libnest2d_seconds": seconds}


def _are_apart(polygons: Sequence[shapely.Polygon], stock: Stock) -> bool:
    """Return True if the polygons of a sheet keep the spacing and fit the usable area."""
    low_x, low_y, high_x, high_y = shapely.total_bounds(polygons)
    min_x, min_y, max_x, max_y = stock.usable
    tree = shapely.STRtree(polygons)
    near, _ = tree.query(polygons, "dwithin", stock.spacing - SLACK)
    fits = high_x - low_x < max_x - min_x + SLACK and high_y - low_y < max_y - min_y + SLACK
    return bool(fits) and len(near) == len(polygons)


def main() -> None:
    """Write the table."""
    with TABLE.open("w", encoding="utf-8", newline="") as opened:
        table = csv.DictWriter(opened, COLUMNS, lineterminator="\n")
        table.writeheader()
        for row in rows():
            table.writerow(row)
            opened.flush()


if __name__ == "__main__":
    main()
