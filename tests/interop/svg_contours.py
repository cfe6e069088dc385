"""The contours of an SVG as svgelements reads them, in millimetres."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path as File
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from svgelements import SVG, Move, Path, PathSegment, Shape

STEPS = 128
"""Chords a curve of a quarter turn: 3e-5 of a disc's area."""
CLOSED = 1e-3
"""mm between the ends of a closed contour; ezdxf rounds every step to an eighth of that."""


class Drawing(NamedTuple):
    """Size of the page in mm, and the closed contours by the colour of their lines."""

    width: float
    height: float
    contours: dict[str, list[shapely.Polygon]]

    def areas(self, colour: str) -> list[float]:
        """In mm2, least first."""
        return sorted(polygon.area for polygon in self.contours.get(colour, []))


def svg_contours(file: File) -> Drawing:
    page = SVG.parse(file, ppi=25.4)
    found: dict[str, list[shapely.Polygon]] = {}
    for shape in page.elements():
        if isinstance(shape, Shape):
            colour = shape.stroke.hex if shape.stroke.value is not None else ""
            rings = [_points(subpath) for subpath in Path(shape).as_subpaths()]
            found.setdefault(colour, []).extend(
                shapely.Polygon(ring) for ring in rings if _closes(ring)
            )
    return Drawing(float(page.width), float(page.height), found)


def _points(edges: Iterable[PathSegment]) -> NDArray[np.float64]:
    places = np.linspace(0.0, 1.0, STEPS + 1)
    drawn = [edge for edge in edges if not isinstance(edge, Move) and edge.length() > 0]
    return np.concatenate([np.asarray(edge.npoint(places), dtype=float) for edge in drawn])


def _closes(ring: NDArray[np.float64]) -> bool:
    return len(ring) > 2 * (STEPS + 1) and bool(np.hypot(*(ring[0] - ring[-1])) < CLOSED)
