"""Cut files as polygons: ezdxf takes the entities off the disk, arcs become chords of our own.

Every chord's ends lie on the arc, and its middle at most ``SAGITTA`` off it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from ezdxf.addons import iterdxf
from scipy.spatial import KDTree
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

SAGITTA = 3e-4
"""mm, at most, between an arc and the chords that stand for it here."""
WIDEST = math.radians(6.0)
JOIN = 1e-5
"""mm between the ends of two entities of one contour."""
MOST_KEPT = 400
Points = list[tuple[float, float]]


class UnreadableError(Exception):
    """A cut file that no cutter could follow."""


@dataclass(frozen=True)
class Contour:
    """Something drawn on a layer of a DXF file; ``closed`` if it is a contour that can be cut."""

    layer: str
    points: tuple[tuple[float, float], ...]
    closed: bool

    @property
    def line(self) -> LineString:
        return LineString([*self.points, self.points[0]] if self.closed else self.points)


@dataclass(frozen=True)
class Drawing:
    """All that a DXF file draws, and the parts it cuts: outlines less the holes in them."""

    contours: tuple[Contour, ...]
    region: BaseGeometry
    circles: tuple[tuple[float, float, float], ...]
    """x, y, radius of the full circles that are cut as holes."""

    def on(self, *layers: str) -> list[Contour]:
        return [contour for contour in self.contours if contour.layer in layers]


_READ: dict[str, Drawing] = {}


def read(path: Path) -> Drawing:
    """A DXF file in millimetres; files that draw the same are taken apart once.

    Raises UnreadableError.
    """
    text = path.read_text(encoding="utf-8")
    units = re.search(r"\$INSUNITS\s+70\s+(\d+)", text)
    if units is None or units.group(1) != "4":
        raise UnreadableError(f"{path.name} is not in millimetres")
    drawn = text[text.index("ENTITIES") :]
    if drawn not in _READ:
        if len(_READ) >= MOST_KEPT:
            _READ.clear()
        _READ[drawn] = _parsed(path)
    return _READ[drawn]


def _parsed(path: Path) -> Drawing:
    contours: list[Contour] = []
    loose: dict[str, list[Points]] = {}
    circles = []
    for entity in iterdxf.modelspace(path):
        kind, layer = entity.dxftype(), entity.dxf.layer
        if kind == "CIRCLE":
            x, y, _ = entity.dxf.center
            contours.append(Contour(layer, tuple(_circle(x, y, entity.dxf.radius)), True))
            if layer == "CUT_INNER":
                circles.append((x, y, float(entity.dxf.radius)))
        elif kind == "LWPOLYLINE":
            points = tuple(_polyline(entity))
            contours.append(Contour(layer, points, bool(entity.closed)))
        elif kind in ("LINE", "ARC"):
            loose.setdefault(layer, []).append(_piece(entity))
        else:
            raise UnreadableError(f"{path.name} holds a {kind}")
    for layer, pieces in loose.items():
        contours += [Contour(layer, *_joined(chain)) for chain in _chains(pieces)]
    open_cuts = [c for c in contours if c.layer in ("CUT_INNER", "CUT_OUTER") and not c.closed]
    if open_cuts:
        raise UnreadableError(
            f"{path.name} has a cut that is not closed at {open_cuts[0].points[0]}"
        )
    region = _region(
        [c.points for c in contours if c.layer == "CUT_OUTER"],
        [c.points for c in contours if c.layer == "CUT_INNER"],
        path.name,
    )
    return Drawing(tuple(contours), region, tuple(circles))


def _region(outers: Sequence[Any], holes: Sequence[Any], name: str) -> BaseGeometry:
    """Every hole goes into the smallest outline that holds it."""
    plates = sorted((Polygon(points) for points in outers), key=lambda p: p.area)
    inner: list[list[Any]] = [[] for _ in plates]
    for plate in plates:
        shapely.prepare(plate)
    for points in holes:
        hole = Polygon(points)
        home = next((i for i, plate in enumerate(plates) if plate.contains(hole)), None)
        if home is None:
            raise UnreadableError(f"{name} cuts a hole outside every part, near {points[0]}")
        inner[home].append(points)
    parts = [
        Polygon(plate.exterior.coords, cut) if cut else plate
        for plate, cut in zip(plates, inner, strict=True)
    ]
    for part in parts:
        if not part.is_valid:
            raise UnreadableError(f"{name}: {shapely.is_valid_reason(part)}")
    whole = shapely.MultiPolygon(parts)
    if not whole.is_valid:
        raise UnreadableError(f"{name}: {shapely.is_valid_reason(whole)}")
    return whole


def arc(centre: tuple[float, float], radius: float, start: float, sweep: float) -> Points:
    """Points from the arc's start up to its end, without the end."""
    step = WIDEST
    if radius > SAGITTA:
        step = min(step, 2 * math.acos(1 - SAGITTA / radius))
    count = max(1, math.ceil(abs(sweep) / step - 1e-9))
    return [
        (
            centre[0] + radius * math.cos(start + sweep * i / count),
            centre[1] + radius * math.sin(start + sweep * i / count),
        )
        for i in range(count)
    ]


def _circle(x: float, y: float, radius: float) -> Points:
    return arc((x, y), radius, 0.0, 2 * math.pi)


def bulged(start: Sequence[float], end: Sequence[float], bulge: float) -> Points:
    """Points of a polyline's segment without its end; ``bulge`` is tan of a quarter sweep."""
    (x1, y1), (x2, y2) = start[:2], end[:2]
    if abs(bulge) < 1e-12 or (x1, y1) == (x2, y2):
        return [(x1, y1)]
    sweep = 4 * math.atan(bulge)
    half = math.hypot(x2 - x1, y2 - y1) / 2
    off = half * (1 - bulge * bulge) / (2 * bulge)
    ux, uy = (x2 - x1) / (2 * half), (y2 - y1) / (2 * half)
    cx, cy = (x1 + x2) / 2 - uy * off, (y1 + y2) / 2 + ux * off
    radius = math.hypot(x1 - cx, y1 - cy)
    return [(x1, y1), *arc((cx, cy), radius, math.atan2(y1 - cy, x1 - cx), sweep)[1:]]


def _polyline(entity: Any) -> Points:
    corners = list(entity.get_points("xyb"))
    following = corners[1:] + (corners[:1] if entity.closed else [])
    points = [
        point
        for a, b in zip(corners, following, strict=False)
        for point in bulged((a[0], a[1]), (b[0], b[1]), a[2])
    ]
    return points if entity.closed else [*points, (corners[-1][0], corners[-1][1])]


def _piece(entity: Any) -> Points:
    if entity.dxftype() == "LINE":
        return [tuple(entity.dxf.start)[:2], tuple(entity.dxf.end)[:2]]
    start, end = math.radians(entity.dxf.start_angle), math.radians(entity.dxf.end_angle)
    sweep = (end - start) % (2 * math.pi) or 2 * math.pi
    x, y, _ = entity.dxf.center
    radius = float(entity.dxf.radius)
    last = (x + radius * math.cos(end), y + radius * math.sin(end))
    return [*arc((x, y), radius, start, sweep), last]


def _chains(pieces: Iterable[Points]) -> Iterator[Points]:
    """Lines and arcs put end to end, in any order and direction.

    Pieces may be shorter than JOIN, so each chain starts with the longest and takes what is
    nearest to its end.
    """
    longest = sorted(pieces, key=lambda piece: math.dist(piece[0], piece[-1]), reverse=True)
    ends = np.array([end for piece in longest for end in (piece[0], piece[-1])])
    tree = KDTree(ends)
    free = dict.fromkeys(range(len(longest)))
    while free:
        first = next(iter(free))
        del free[first]
        chain = list(longest[first])
        while True:
            near = [k for k in tree.query_ball_point(chain[-1], JOIN) if k // 2 in free]
            best = min(near, key=lambda k: math.dist(ends[k], chain[-1]), default=None)
            back = math.dist(chain[0], chain[-1])
            if best is None or math.dist(ends[best], chain[-1]) > back:
                break
            del free[best // 2]
            chain += longest[best // 2][:: -1 if best % 2 else 1][1:]
        yield chain


def _joined(chain: Points) -> tuple[tuple[tuple[float, float], ...], bool]:
    closed = len(chain) > 2 and math.dist(chain[0], chain[-1]) <= JOIN
    return tuple(chain[:-1] if closed else chain), closed
