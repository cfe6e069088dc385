"""Kerf: moving the cut half its width into the waste, so that the part keeps its size."""

from __future__ import annotations

from sbafab.cutting.properties import kerf_text
from sbafab.errors import DesignError
from sbafab.geometry.beam import Kerf, Lost, beam_path, place_of, widths
from sbafab.geometry.inconsistent import GeometryError
from sbafab.geometry.region import Region


def compensate(region: Region, kerf: Kerf) -> Region:
    """The path of the beam's middle: outlines grown and holes shrunk by half of the kerf.

    ``kerf``: full width in mm, or that along x and along y. Of one width arcs stay arcs; of two
    they are followed within 0.1 um, and straight edges stay straight. Raises DesignError with the
    place where a contour vanishes, splits or merges.
    """
    if widths(kerf) == (0.0, 0.0):
        return region
    try:
        path = beam_path(region, kerf)
    except GeometryError as error:
        raise DesignError(
            f"no path for a kerf of {kerf_text(kerf)} mm: {error}; measure the kerf again."
        ) from error
    if path.lost is not None:
        raise _refused(region, path.lost, kerf)
    return path.region


def _refused(region: Region, lost: Lost, kerf: Kerf) -> DesignError:
    x, y = place_of(region, lost, kerf)
    kind = "hole" if lost.contour.is_hole else "outline"
    return DesignError(
        f"with a kerf of {kerf_text(kerf)} mm the {kind} at x {x + 0.0:.3f}, y {y + 0.0:.3f} "
        f"{lost.fate}; a narrower kerf, or more room there, would keep it."
    )
