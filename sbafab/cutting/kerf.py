"""Kerf: moving the cut half its width into the waste, so that the part keeps its size."""

from __future__ import annotations

from collections.abc import Sequence

from sbafab.errors import DesignError
from sbafab.geometry.boolean import GeometryError
from sbafab.geometry.edges import Point, distance_to
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Contour, Region


def compensate(region: Region, kerf_width: float) -> Region:
    """The path of the beam's middle: outlines grown and holes shrunk by half of ``kerf_width``.

    Raises DesignError with the place where a contour vanishes, splits or merges.
    """
    if kerf_width == 0.0:
        return region
    try:
        path = grow(region, kerf_width / 2)
    except GeometryError as error:
        raise DesignError(
            f"no path for a kerf of {kerf_width:g} mm: {error}; measure the kerf again."
        ) from error
    sources = [_sources(contour, region.contours) for contour in path.contours]
    for index, contour in enumerate(region.contours):
        followers = [source for source in sources if index in source]
        if not followers:
            raise _lost(contour, kerf_width, "vanishes")
        if len(followers) > 1:
            raise _lost(contour, kerf_width, "splits in parts")
        if len(followers[0]) > 1:
            raise _lost(contour, kerf_width, "runs into another")
    return path


def _sources(contour: Contour, originals: Sequence[Contour]) -> set[int]:
    """Which of the originals the edges of an offset contour come from."""
    return {
        min(range(len(originals)), key=lambda index: _distance(originals[index], edge.at(0.5)))
        for edge in contour.edges
    }


def _distance(contour: Contour, p: Point) -> float:
    return min(distance_to(edge, p) for edge in contour.edges)


def _lost(contour: Contour, kerf_width: float, fate: str) -> DesignError:
    low_x, low_y, high_x, high_y = contour.bounds
    kind = "hole" if contour.is_hole else "outline"
    return DesignError(
        f"with a kerf of {kerf_width:g} mm the {kind} at x {(low_x + high_x) / 2:.3f}, "
        f"y {(low_y + high_y) / 2:.3f} {fate}; a narrower kerf or a wider {kind} would keep it."
    )
