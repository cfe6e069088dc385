"""Drawings by the user: the outline of a pocket, or the contours of whole layers.

A DXF or SVG file holds polylines, chains of edges, whose ends form loops. All coordinates are mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from sbafab.design.files import is_file, listed, read_bytes, shown
from sbafab.design.laminate_file import read_laminate
from sbafab.design.outline_dxf import dxf_polylines
from sbafab.design.outline_svg import svg_polylines
from sbafab.design.polylines import (
    JOIN,
    MOST_BYTES,
    MOST_EDGES,
    Polyline,
    counted,
    is_closed,
)
from sbafab.errors import DesignError
from sbafab.geometry.arcs import FitError
from sbafab.geometry.arrangement import split_edges
from sbafab.geometry.chaining import LooseEndError, chained, depths
from sbafab.geometry.contour import Contour, in_reading_order, tidy
from sbafab.geometry.edges import EPSILON, Bounds, Point, box_round, meeting_points
from sbafab.geometry.region import Region, centroid
from sbafab.geometry.spatial_index import close_pairs

MOST_OUTLINE_EDGES = 500
LARGEST = 150.0
SMALLEST = 1.0
"""Bounds of the outline's extent, in mm."""
LARGEST_DRAWING = 2000.0
"""Bound of a drawing's extent, mm."""
OUTLINE = "outline"
"""Name of the outline of a ``laminate.json``, beside its patterns."""


@contextmanager
def _faults_of(what: str, path: Path) -> Iterator[None]:
    """Raise the faults of a drawing with its name."""
    try:
        yield
    except FitError as error:
        raise DesignError(f"{what} {path} has a {error}; round it off") from None
    except DesignError as error:
        raise DesignError(f"{what} {path} {str(error).removeprefix(f'{path} ')}") from None


def _content(path: Path) -> bytes:
    if not is_file(path):
        raise DesignError("does not exist as a file; check its path")
    return read_bytes(path, MOST_BYTES)


def read_outline(path: Path) -> Region:
    """Return the one closed path of a DXF or SVG file as lines and arcs, in mm, counter-clockwise.

    The chamber's axis is the file's origin if that lies inside, else the outline's centroid. DXF
    units follow $INSUNITS, with mm as default; an SVG without width and height in physical units is
    read as 1 unit = 1 mm, and its y axis is turned upward, so that the outline looks as drawn.
    Ellipses, Béziers and splines become arcs within 0.5 um. Raises DesignError.
    """
    return described_outline(path)[0]


def described_outline(path: Path) -> tuple[Region, str]:
    """Return a drawn outline, and its size as text. Raises DesignError."""
    with _faults_of("outline", path):
        return _outline(path, _content(path))


@lru_cache(maxsize=4)
def _outline(path: Path, content: bytes) -> tuple[Region, str]:
    """The outline of a file with this content; cached, as a run needs it more than once."""
    polylines, scale = _traced(path)
    region = _nested(_contours(polylines, MOST_OUTLINE_EDGES))
    if len(region.contours) > 1:
        raise DesignError(
            f"holds {len(region.contours)} closed paths; keep only the pocket's outline"
        )
    width, height = _extent(region.bounds, SMALLEST, LARGEST)
    shift = ""
    if not _surrounds(region, (0.0, 0.0)):
        x, y = centroid(region)
        if not _surrounds(region, (x, y)):
            raise DesignError(
                "has its centroid outside itself, so the position of the chamber's axis is "
                "undefined; draw it around (0, 0)"
            )
        # The printed shift is the one applied.
        region, shift = region.moved(-round(x, 6), -round(y, 6)), ", centred on its centroid"
    # Without the file's name: the design is the same wherever its drawing is stored.
    return region, f"drawn outline: {width:.3f} x {height:.3f} mm, {scale}{shift}"


def _extent(bounds: Bounds, least: float, most: float) -> tuple[float, float]:
    """Return width and height, mm. Raises DesignError if they are not within the limits."""
    width, height = bounds[2] - bounds[0], bounds[3] - bounds[1]
    if max(width, height) > most or min(width, height) < least:
        allowed = f"{least:g} to {most:g}" if least else f"at most {most:g}"
        raise DesignError(
            f"measures {width:.4g} x {height:.4g} mm, where {allowed} is allowed; check its units"
        )
    return width, height


def _surrounds(region: Region, p: Point) -> bool:
    return region.contains(p) and region.distance_to_edge(p) >= EPSILON


def read_drawing(path: Path, layer: str | None = None) -> Region:
    """Return the region enclosed by the closed contours of a drawing, in its own coordinates, mm.

    Contours are nested by the even-odd rule: one inside another is a hole. Unplotted layers of a
    DXF file are ignored unless named. ``layer`` names a layer of a DXF file, a group of an SVG file
    by its label or id, or a pattern, ``outline`` or ``seam NAME`` of a ``laminate.json``. Units are
    read as for an outline. Raises DesignError with the file and the place.
    """
    with _faults_of("drawing", path):
        if path.suffix.lower() == ".json":
            return _profile(_profiles(path, _content(path)), layer)
        return _drawn(path, _content(path), layer)


@lru_cache(maxsize=64)
def _drawn(path: Path, content: bytes, layer: str | None) -> Region:
    """The region of a file with this content; cached, since a run needs it more than once."""
    polylines, _ = _traced(path, layer, is_plot=True)
    contours = _contours(polylines, MOST_EDGES)
    p = crossing(tuple(edge for contour in contours for edge in contour.edges))
    if p is not None:
        raise _contact(p, of_several=True)
    _extent(box_round([contour.bounds for contour in contours]), 0.0, LARGEST_DRAWING)
    return _nested(contours)


@lru_cache(maxsize=4)
def _profiles(path: Path, content: bytes) -> dict[str, Region]:
    laminate = read_laminate(path)
    profiles = {layer.pattern: layer.profile for layer in laminate.layers}
    for seam in laminate.seams:
        if all(is_closed(chain) for chain in seam.path):
            profiles[seam_layer(seam.name)] = Region(tuple(map(Contour, seam.path)))
    return profiles | ({} if laminate.outline.is_empty else {OUTLINE: laminate.outline})


def seam_layer(name: str) -> str:
    """Return the name of a seam's closed path among a laminate's patterns."""
    return f"seam {name}"


def _profile(profiles: Mapping[str, Region], layer: str | None) -> Region:
    if layer is None:
        raise DesignError(f"is a laminate; name one of its patterns as layer: {listed(profiles)}")
    if layer not in profiles:
        raise DesignError(f"has no pattern {shown(layer)}; use {listed(profiles)}")
    return profiles[layer]


# From a file's polylines to contours, and to the region that they enclose.


def _traced(
    path: Path, layer: str | None = None, is_plot: bool = False
) -> tuple[Iterator[Polyline], str]:
    """Return the polylines of a DXF or SVG file, or of one of its layers, and its unit as text.

    ``is_plot``: unplotted layers of a DXF file count only if named.
    """
    if path.suffix.lower() == ".dxf":
        return dxf_polylines(path, layer, is_plot)
    if path.suffix.lower() == ".svg":
        return svg_polylines(path, layer)
    raise DesignError("is neither .dxf nor .svg; export it as one of them")


def _contours(polylines: Iterable[Polyline], most: int) -> list[Contour]:
    """Return the contours formed by polylines of at most ``most`` edges. Raises DesignError."""
    chains = [c for c in counted(polylines, most) if sum(edge.length for edge in c) > JOIN]
    contours = []
    for loop in _closed_loops(chains):
        refuse_crossings(loop)
        contour = tidy(loop)
        if contour is None:
            x, y = loop[0].start
            raise DesignError(
                f"has a contour without area at x {x:.4f}, y {y:.4f}; delete it, or check the units"
            )
        contours.append(contour)
    return contours


def _closed_loops(chains: Sequence[Polyline]) -> list[Polyline]:
    """Return the loops that polylines close to. Raises DesignError if one is open or doubled."""
    drawn, edges = set(), [edge for chain in chains for edge in chain]
    for edge in edges:
        x, y = edge.at(0.5)
        ends = sorted((round(px, 4), round(py, 4)) for px, py in (edge.start, edge.end))
        key = (*ends, round(x, 4), round(y, 4))
        if key in drawn:
            raise DesignError(
                f"draws an edge twice, at x {x:.4f}, y {y:.4f}; delete one of the two"
            )
        drawn.add(key)
    try:
        loops = chained(edges, JOIN)
    except LooseEndError as error:
        x, y = error.place
        if error.ends > 2:
            meet = [c for c in chains if any(math.dist(e.start, (x, y)) <= JOIN for e in c)]
            raise _contact(error.place, of_several=len(meet) > 1) from None
        raise DesignError(
            f"is open: a gap of {error.gap:.4f} mm at x {x:.4f}, y {y:.4f}, the limit is {JOIN}; "
            "join the ends, or delete everything but the outline"
        ) from None
    if not loops:
        raise DesignError(
            "has no closed path; draw one of lines, arcs or curves, and explode blocks"
        )
    return list(map(tuple, loops))


def _nested(contours: list[Contour]) -> Region:
    """Return the region enclosed by disjoint contours: each inside an odd number is a hole."""
    oriented = (
        contour if contour.is_hole == (depth % 2 == 1) else contour.reversed()
        for contour, depth in zip(contours, depths(contours), strict=True)
    )
    return Region(in_reading_order([*oriented]))


def refuse_crossings(loop: Polyline) -> None:
    """Raise DesignError if a closed loop crosses or touches itself."""
    p = crossing(loop)
    if p is not None:
        raise _contact(p, of_several=False)


def _contact(p: Point, of_several: bool) -> DesignError:
    place = f"x {p[0]:.4f}, y {p[1]:.4f}"
    if of_several:
        return DesignError(
            f"has contours that cross or touch each other at {place}; separate or join them"
        )
    return DesignError(f"crosses or touches itself at {place}; draw it without the loop")


def crossing(loop: Polyline) -> Point | None:
    """Return a point where edges of closed loops cross or touch, except at shared ends."""
    # A tangle is reported at its first crossing: there may be one for every two edges.
    for i, j in close_pairs([edge.bounds for edge in loop], EPSILON):
        ends = loop[i].start, loop[i].end, loop[j].start, loop[j].end
        for p in meeting_points(loop[i], loop[j]):
            if min(math.dist(p, end) for end in ends) > JOIN:
                return p
    corners: set[Point] = set()
    for edge, pieces in zip(loop, split_edges(loop)[0], strict=True):
        start = pieces[0].start if pieces else edge.start
        if len(pieces) != 1 or start in corners:
            return pieces[0].end if len(pieces) > 1 else edge.start
        corners.add(start)
    return None
