"""Pocket outlines drawn by the user: one closed path of a DXF or SVG file."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from sbafab.design.strands import JOIN, Strand, Traced, counted, joined, sealed, widest_gap
from sbafab.errors import DesignError
from sbafab.geometry.biarc import FitError
from sbafab.geometry.centroid import centroid
from sbafab.geometry.edges import EPSILON, Point
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.nearby import close_pairs
from sbafab.geometry.pieces import split_edges
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.tidy import tidy

MOST_BYTES = 2_000_000
LARGEST = 150.0
SMALLEST = 1.0
"""Bounds of the outline's extent, in mm."""


class Outline(NamedTuple):
    """A drawn outline, and one sentence on the size that was understood."""

    region: Region
    said: str


def read_outline(path: Path) -> Region:
    """The one closed path of a DXF or SVG file as lines and arcs, in mm, counter-clockwise.

    The chamber's axis is the file's origin where that lies inside, else the outline's centroid.
    DXF units follow $INSUNITS, none meaning mm; an SVG without width and height in physical units
    is read as 1 unit = 1 mm, and its y axis is turned upward, so that the outline looks as it is
    drawn. Ellipses, Béziers and splines become arcs within 0.5 um. Raises DesignError.
    """
    return understood(path).region


def understood(path: Path) -> Outline:
    """The same with the size that was understood, in words. Raises DesignError."""
    try:
        return _understood(path, _content(path))
    except FitError as error:
        raise DesignError(f"outline {path} has a {error}; round it off") from None
    except DesignError as error:
        raise DesignError(f"outline {path} {error}") from None


@lru_cache(maxsize=4)
def _understood(path: Path, content: bytes) -> Outline:
    """The outline of a file that holds this; a run asks for it more than once."""
    strands, scale = _traced(path)
    region, moved = _on_its_axis(_checked(sealed(_one_loop(list(counted(strands))))))
    low_x, low_y, high_x, high_y = region.bounds
    size = f"{high_x - low_x:.3f} x {high_y - low_y:.3f} mm"
    # Without the file's name: a design is the same wherever its drawing lies.
    return Outline(region, f"drawn outline: {size}, {scale}{moved}")


def _content(path: Path) -> bytes:
    """What the file holds, if it is no larger than an outline may be."""
    try:
        is_file = path.is_file()
        size = path.stat().st_size if is_file else 0
        content = path.read_bytes() if is_file and size <= MOST_BYTES else b""
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DesignError(f"cannot be read ({reason}); check its path") from None
    if not is_file:
        raise DesignError("does not exist as a file; check its path")
    if size > MOST_BYTES:
        raise DesignError(f"has {size:,} bytes, where at most {MOST_BYTES:,} are allowed")
    return content


def _traced(path: Path) -> Traced:
    # Each reader brings its own library, loaded for the format at hand only.
    if path.suffix.lower() == ".dxf":
        from sbafab.design.outline_dxf import dxf_strands

        return dxf_strands(path)
    if path.suffix.lower() == ".svg":
        from sbafab.design.outline_svg import svg_strands

        return svg_strands(path)
    raise DesignError("is neither .dxf nor .svg; export it as one of them")


def _one_loop(strands: list[Strand]) -> Strand:
    _refuse_doubles(strands)
    loops, opens = joined(strands)
    if opens:
        gap, (x, y) = widest_gap(opens)
        raise DesignError(
            f"is open: a gap of {gap:.4f} mm at x {x:.4f}, y {y:.4f}, where {JOIN} is allowed; "
            "join the ends, or delete what is not the outline"
        )
    if not loops:
        raise DesignError(
            "holds no closed path; draw one of lines, arcs or curves, and explode blocks"
        )
    if len(loops) > 1:
        raise DesignError(f"holds {len(loops)} closed paths; keep only the pocket's outline")
    return loops[0]


def _refuse_doubles(strands: list[Strand]) -> None:
    seen = set()
    for strand in strands:
        for edge in strand:
            x, y = edge.at(0.5)
            ends = sorted((round(px, 4), round(py, 4)) for px, py in (edge.start, edge.end))
            key = (*ends, round(x, 4), round(y, 4))
            if key in seen:
                raise DesignError(
                    f"draws an edge twice, at x {x:.4f}, y {y:.4f}; delete one of the two"
                )
            seen.add(key)


def _checked(loop: Strand) -> Region:
    """The region inside a loop, if it is a simple one of sensible size."""
    if not loop:
        raise DesignError("encloses no area; draw the outline of a pocket")
    low_x, low_y, high_x, high_y = Contour(loop).bounds
    width, height = high_x - low_x, high_y - low_y
    if max(width, height) > LARGEST or min(width, height) < SMALLEST:
        raise DesignError(
            f"measures {width:.4g} x {height:.4g} mm, where {SMALLEST:g} to {LARGEST:g} is "
            "allowed; check its units"
        )
    _refuse_crossings(loop)
    contour = tidy(loop)
    if contour is None:
        raise DesignError("encloses no area; draw the outline of a pocket")
    return Region((contour.reversed() if contour.is_hole else contour,))


def _on_its_axis(region: Region) -> tuple[Region, str]:
    """The region round the chamber's axis at (0, 0), and how it got there, in words."""
    if _surrounds(region, (0.0, 0.0)):
        return region, ""
    x, y = centroid(region)
    if not _surrounds(region, (x, y)):
        raise DesignError(
            "has its centroid outside itself, so the chamber's axis has no place; draw it round "
            "(0, 0)"
        )
    # What is printed is what is done.
    x, y = round(x, 6), round(y, 6)
    return region.moved(-x, -y), ", centred on its centroid"


def _surrounds(region: Region, p: Point) -> bool:
    return region.contains(p) and region.distance_to_edge(p) >= EPSILON


def _refuse_crossings(loop: Strand) -> None:
    # A tangle is told at its first knot: there may be one for every two edges.
    for i, j in close_pairs([edge.bounds for edge in loop], EPSILON):
        ends = loop[i].start, loop[i].end, loop[j].start, loop[j].end
        for p in meeting_points(loop[i], loop[j]):
            if min(math.dist(p, end) for end in ends) > JOIN:
                raise _crossing(p)
    corners: set[Point] = set()
    for edge, pieces in zip(loop, split_edges(loop).parts, strict=True):
        start = pieces[0].start if pieces else edge.start
        if len(pieces) != 1 or start in corners:
            raise _crossing(pieces[0].end if len(pieces) > 1 else edge.start)
        corners.add(start)


def _crossing(p: Point) -> DesignError:
    return DesignError(
        f"crosses or touches itself at x {p[0]:.4f}, y {p[1]:.4f}; draw it without the loop"
    )
