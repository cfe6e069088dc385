"""Drawings of whole layers: all closed contours of a file, or a profile of a ``laminate.json``."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from sbafab.design.files import listed, shown
from sbafab.design.laminate_file import read_laminate
from sbafab.design.outline import closed_loops, content, crossing, refuse_crossings, traced
from sbafab.design.strands import MOST_OF_ENTITY, Strand, counted, is_closed, sealed
from sbafab.errors import DesignError
from sbafab.geometry.arcs import FitError
from sbafab.geometry.contour import Contour, in_reading_order, tidy
from sbafab.geometry.region import Region

LARGEST = 2000.0
"""Bound of a drawing's extent, mm."""
OUTLINE = "outline"
"""Name of the outline of a ``laminate.json``, beside its patterns."""


def read_drawing(path: Path, layer: str | None = None) -> Region:
    """Return the region enclosed by the closed contours of a drawing, at their place in it, mm.

    Contours are nested by the even-odd rule: one inside another is a hole. Layers of a DXF file
    that are not plotted are ignored unless named. ``layer`` names a layer of a DXF file, a group of
    an SVG file by its label or id, or a pattern, ``outline`` or ``seam NAME`` of a
    ``laminate.json``. Units are read as for an outline. Raises DesignError with the file and the
    place.
    """
    try:
        if path.suffix.lower() == ".json":
            return _profile(path, content(path), layer)
        return _drawn(path, content(path), layer)
    except FitError as error:
        raise DesignError(f"drawing {path} has a {error}; round it off") from None
    except DesignError as error:
        raise DesignError(f"drawing {path} {error}") from None


@lru_cache(maxsize=64)
def _drawn(path: Path, content: bytes, layer: str | None) -> Region:
    """The region of a file with this content; cached, as a run needs it more than once."""
    strands = list(counted(traced(path, layer, is_plot=True).strands, MOST_OF_ENTITY))
    loops = [sealed(loop) for loop in closed_loops(strands)]
    for loop in loops:
        refuse_crossings(loop)
    if len(loops) > 1:
        _refuse_meetings(loops)
    contours = []
    for loop in loops:
        contour = tidy(loop)
        if contour is None:
            x, y = loop[0].start if loop else (0.0, 0.0)
            raise DesignError(
                f"has a contour without area at x {x:.4f}, y {y:.4f}; delete it, or check the units"
            )
        contours.append(contour)
    _refuse_extent(contours)
    return nested(contours)


def _refuse_meetings(loops: list[Strand]) -> None:
    p = crossing(tuple(edge for loop in loops for edge in loop))
    if p is not None:
        raise DesignError(
            f"has contours that cross or touch each other at x {p[0]:.4f}, y {p[1]:.4f}; draw them "
            "apart, or join them"
        )


def _refuse_extent(contours: list[Contour]) -> None:
    low_x, low_y, high_x, high_y = Region(tuple(contours)).bounds
    if max(high_x - low_x, high_y - low_y) > LARGEST:
        raise DesignError(
            f"measures {high_x - low_x:.4g} x {high_y - low_y:.4g} mm, where at most {LARGEST:g} "
            "is allowed; check its units"
        )


def nested(contours: list[Contour]) -> Region:
    """Return the region enclosed by disjoint contours: each inside an odd number is a hole."""
    oriented = []
    for contour in contours:
        place = contour.edges[0].at(0.5)
        around = sum(other is not contour and other.winding(place) != 0 for other in contours)
        is_hole = around % 2 == 1
        oriented.append(contour if contour.is_hole == is_hole else contour.reversed())
    return Region(in_reading_order(oriented))


@lru_cache(maxsize=4)
def _profiles(path: Path, content: bytes) -> dict[str, Region]:
    try:
        laminate = read_laminate(path)
    except DesignError as error:
        raise DesignError(str(error).removeprefix(f"{path} ")) from None
    profiles = {layer.pattern: layer.profile for layer in laminate.layers}
    for seam in laminate.seams:
        if all(is_closed(chain) for chain in seam.path):
            profiles[seam_layer(seam.name)] = Region(tuple(map(Contour, seam.path)))
    return profiles | ({} if laminate.outline.is_empty else {OUTLINE: laminate.outline})


def seam_layer(name: str) -> str:
    """Return the name of a seam's closed path among a laminate's patterns."""
    return f"seam {name}"


def _profile(path: Path, content: bytes, layer: str | None) -> Region:
    profiles = _profiles(path, content)
    if layer is None:
        raise DesignError(f"is a laminate; name one of its patterns as layer: {listed(profiles)}")
    if layer not in profiles:
        raise DesignError(f"has no pattern {shown(layer)}; there are {listed(profiles)}")
    return profiles[layer]
