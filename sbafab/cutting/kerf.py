"""Kerf and chords: cuts offset into the waste by half the kerf, arcs in conservative chords."""

from __future__ import annotations

from sbafab.cutting.cut_settings import CutSettings, kerf_text
from sbafab.errors import DesignError, GeometryError
from sbafab.geometry.contour import Contour, run_chords, tidy
from sbafab.geometry.edges import EPSILON, Arc, Line
from sbafab.geometry.offset import Kerf, Lost, beam_path, widths
from sbafab.geometry.region import Region
from sbafab.geometry.width import place_of
from sbafab.laminate.laminate import Laminate, Layer, Role


def compensated_paths(laminate: Laminate, settings: CutSettings) -> dict[str, Region]:
    """Return the beam path for every pattern, in chords if the cut files use chords.

    Raises DesignError if the kerf leaves no path.
    """
    return {
        pattern: _compensated(layers[0], laminate.as_cut(layers[0]), settings)
        for pattern, layers in laminate.patterns.items()
    }


def _compensated(layer: Layer, shape: Region, settings: CutSettings) -> Region:
    kerf, curves = settings.kerf_width(layer.film.material), settings.curves
    try:
        if isinstance(kerf, tuple) and curves.in_chords:
            raise DesignError(
                "chords cannot represent different kerfs along x and y; write bulges or arcs."
            )
        path = compensate(shape, kerf or 0.0)
        if not curves.in_chords:
            return path
        return in_chords(path, layer.role, curves.chord_error, max(widths(kerf or 0.0)) / 2)
    except DesignError as error:
        raise DesignError(f"layer {layer.name}: {error}") from error


def compensate(region: Region, kerf: Kerf) -> Region:
    """Return the path of the beam's centre: outlines grown and holes shrunk by half the kerf.

    ``kerf`` is the full width in mm, or the widths along x and y. For one width, arcs stay arcs;
    for two they are approximated within 0.1 um, and straight edges stay straight. Raises
    DesignError with the place if a contour vanishes, splits or merges.
    """
    if widths(kerf) == (0.0, 0.0):
        return region
    try:
        path, lost = beam_path(region, kerf)
    except GeometryError as error:
        raise DesignError(
            f"no path for a kerf of {kerf_text(kerf)} mm: {error}; measure the kerf again."
        ) from error
    if lost is not None:
        raise _refused(region, lost, kerf)
    return path


def _refused(region: Region, lost: Lost, kerf: Kerf) -> DesignError:
    x, y = place_of(region, lost, kerf)
    kind = "hole" if lost.contour.is_hole else "outline"
    return DesignError(
        f"with a kerf of {kerf_text(kerf)} mm the {kind} at x {x + 0.0:.3f}, y {y + 0.0:.3f} "
        f"{lost.fate}; a narrower kerf, or more room there, would keep it."
    )


# Arcs drawn as chords, on the side of them that keeps bonds, overhangs and pins.
#
# What bounds a bond or overhang on one side gives way, and what bounds it on the other side stays
# nearer to its arcs than anything measures: films and round holes stay, masks give way.


FINE = 0.0004
"""mm: chords of films and of round holes stay nearer, so that pins fit as in arcs, and a mask's
edge that gives way has nothing to make up for."""


def in_chords(path: Region, role: Role | None, error: float, beam: float = 0.0) -> Region:
    """Return the path of a layer (None: the base plate) with chords for arcs, within ``error`` mm.

    Outlines of chamber masks shrink, outlines of separator masks grow, and holes widen; films grow
    and round holes widen by less than FINE. Straight edges are unchanged. Arcs of the radius
    ``beam``, half the kerf in mm, lead around the part's corners, which are unchanged.
    """
    is_film = role is None or not role.endswith("-mask")
    fine = min(error, FINE)
    return Region(
        (
            *(
                _contour(outer, role != "chamber-mask", fine if is_film else error, beam)
                for outer in path.outers
            ),
            *(
                _contour(hole, False, fine if is_film or hole.circle else error, beam)
                for hole in path.holes
            ),
        )
    )


def _contour(contour: Contour, grows: bool, error: float, beam: float) -> Contour:
    """The contour as lines that enclose at least (``grows``) or at most its material everywhere."""
    points = []
    for run in contour.runs:
        edge = run[0]
        is_corner = isinstance(edge, Arc) and edge.ccw and abs(edge.radius - beam) < EPSILON
        points += run_chords(run, grows or (is_corner and beam > 0), error)
    loop = [Line(p, q) for p, q in zip(points, (*points[1:], points[0]), strict=True) if p != q]
    return tidy(loop) or Contour(tuple(loop))
