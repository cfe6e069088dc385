"""How far masks reach past the edges of the films they keep apart."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from tests.judge.bonds import sampled
from tests.judge.folder import Folder, Hole, Interface, Layer, pieces

STEP = 0.1
INSIDE = 0.001
"""mm inward from an edge: whether the films are kept apart there."""
BESIDE = 0.01
"""mm from a mask's side, along the film's edge, from where on a ray stays within the mask: a side
whose kerf was taken back may lean by a thousandth, an arc that ends at it by its last chord."""
FITS = 0.004
"""mm by which a hole may differ from the pin in it."""
PLAY = 0.02
"""mm by which a bore's radius exceeds its pin's, the default."""
LOOKS = 8
"""Places along the overhang that are looked at."""
Array = NDArray[np.float64]


def judge_overhangs(folder: Folder) -> Iterator[str]:
    """Each mask reaches the design's overhang past film edges, but flush at pinned bores."""
    seen = set()
    for interface in folder.interfaces:
        if interface.shape in seen or not interface.masks:
            continue
        seen.add(interface.shape)
        mask = shapely.union_all([mask.profile for mask in interface.masks])
        shapely.prepare(mask)
        films = (interface.below, interface.above)
        for film, other in (films, films[::-1]):
            worst = _least(folder, film, other, mask)
            if worst is not None:
                reach, x, y = worst
                yield (
                    f"at {_named(interface)} the mask reaches only {reach:.4f} past the edge of "
                    f"film {film.index} at x {x:.3f}, y {y:.3f}, where "
                    f"{folder.overhang_limit:g} are asked for"
                )


def _named(interface: Interface) -> str:
    return f"interface {interface.number}"


def _least(
    folder: Folder, film: Layer, other: Layer, mask: BaseGeometry
) -> tuple[float, float, float] | None:
    """The least reach below the limit along a film's edges, and where."""
    limit = folder.overhang_limit - folder.slack
    exempt = folder.holes if folder.method == "channel-pin" else ()
    points, normals = _edges(film, exempt, FITS + folder.chord_error)
    if not len(points):
        return None
    inside = points - normals * INSIDE
    along = np.stack([-normals[:, 1], normals[:, 0]], axis=1) * BESIDE
    kept = np.ones(len(points), dtype=bool)
    for place in (inside - along, inside + along):
        kept &= shapely.contains_xy(mask, place[:, 0], place[:, 1])
    shapely.prepare(other.profile)
    kept &= shapely.contains_xy(other.profile, inside[:, 0], inside[:, 1])
    points, normals = points[kept], normals[kept]
    shapely.prepare(film.profile)
    bare = np.zeros(len(points), dtype=bool)
    open_yet = ~bare
    for look in range(1, LOOKS + 1):
        out = points + normals * (limit * look / LOOKS)
        # Past a gap of the film the far edge speaks for itself.
        open_yet &= ~shapely.contains_xy(film.profile, out[:, 0], out[:, 1])
        bare |= open_yet & ~shapely.contains_xy(mask, out[:, 0], out[:, 1])
    short = [
        (_reach(mask, points[number], normals[number], limit), *points[number])
        for number in np.flatnonzero(bare)
    ]
    return min(short, default=None)


def _reach(mask: BaseGeometry, start: Array, normal: Array, limit: float) -> float:
    """How far the mask reaches from a film's edge."""
    ray = LineString([start - normal * INSIDE, start + normal * limit])
    covered = shapely.get_parts(ray.intersection(mask))
    lengths = [
        part.length for part in covered if part.distance(shapely.Point(ray.coords[0])) < 1e-6
    ]
    return float(max(lengths, default=INSIDE)) - INSIDE


def _edges(film: Layer, exempt: tuple[Hole, ...], slack: float) -> tuple[Array, Array]:
    """Points along a film's edges with outward normals, but not round pinned holes."""
    found = []
    for part in map(shapely.geometry.polygon.orient, pieces(film.profile)):
        rings = [part.exterior]
        rings += [ring for ring in part.interiors if not _is_pinned(ring, exempt, slack)]
        found += [sampled(np.asarray(ring.coords), STEP, False) for ring in rings]
    points, left = (np.vstack(rows) for rows in zip((np.empty((0, 2)),) * 2, *found, strict=True))
    # The material lies to the left.
    return points, -left


def _is_pinned(ring: shapely.LinearRing, exempt: tuple[Hole, ...], slack: float) -> bool:
    """Whether a pin fills the hole."""
    hole = Polygon(ring)
    return any(
        -slack <= math.sqrt(hole.area / math.pi) - pin.radius <= slack + PLAY
        and math.dist(hole.centroid.coords[0], (pin.x, pin.y)) <= slack
        for pin in exempt
    )
