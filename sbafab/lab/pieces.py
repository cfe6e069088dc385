"""Identify the content of each place of a cut sheet: its piece, another, a flipped one, or none."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
import shapely

from sbafab.geometry.edges import Bounds
from sbafab.geometry.region import Region
from sbafab.lab.edges import TOLERANCE, EdgeFit
from sbafab.lab.registration import SMALLEST, Complexes, Location, polyline, xy
from sbafab.lab.scan import Scan, SheetShape

PieceVerdict = Literal[
    "sound",
    "moved",
    "turned",
    "turned over",
    "other piece",
    "missing",
    "covered",
    "unknown",
    "not in picture",
]
"""States of a place; "covered": another piece lies on it or touches it."""

SOUND_SHARE = 0.9  # least share of samples on a contour that are within TOLERANCE
SAME_AREA = 0.08
"""Largest relative difference in area between a piece and its shape, in addition to the kerf."""
SAME_SHAPE = 0.2  # largest 95th percentile of the distance between an outline and its shape, mm
AS_GOOD = 0.02  # difference in fit below which the expected shape is chosen, mm
ANGLE_STEP = 5
TURNED = 5.0  # angle from which a piece counts as turned, not askew, degrees
COVERED_SHARE = 0.6  # least share of a piece's edges that must be visible if others cover the rest
REACH = 40.0  # search range for edges around a place, mm
STRAY = 0.5  # displacement that is reported, mm
NEAR = 1.0  # largest distance between an edge and a covered piece that is fitted to it, mm
HOLE_PLACE = 0.6  # largest distance between a hole and its place, mm


@dataclass(frozen=True)
class PieceFinding:
    """The finding for a place, x and y mm of the sheet: ``name`` is the piece drawn there.

    ``message`` is the finding as text; ``shift`` mm and ``turn`` degrees are measured from the
    place, None if no piece was recognised; ``rms`` and ``largest`` mm are deviations of its edges
    from the drawn ones, apart from shift, rotation and the common offset.
    """

    name: str
    x: float
    y: float
    verdict: PieceVerdict
    message: str
    shift: float | None = None
    turn: float | None = None
    rms: float | None = None
    largest: float | None = None


class Match(NamedTuple):
    """A shape fitted to edges: degrees counter-clockwise and mm from the place, after mirroring if
    mirrored.

    ``share`` of its edges lies on measured ones; ``misfit`` mm is the 95th percentile of distances.
    """

    name: str
    is_mirrored: bool
    turn: float
    shift: float
    share: float
    misfit: float


def piece_findings(scan: Scan, location: Location, fit: EdgeFit) -> list[PieceFinding]:
    """Return a finding for each place of the sheet."""
    judge = _Judge(scan, location, fit)
    return [judge.finding(number, place) for number, place in enumerate(scan.sheet.places)]


class _Judge:
    """The visible pieces, or windows of a skeleton, as polygons with holes, mm of the sheet."""

    def __init__(self, scan: Scan, location: Location, fit: EdgeFit) -> None:
        self.picture, self.sheet, self.fit = scan.picture, scan.sheet, fit
        self.is_skeleton = location.is_skeleton
        in_mm = [
            ((outline.is_light == scan.is_light) != self.is_skeleton, polygon)
            for outline in scan.outlines
            for polygon in [shapely.transform(outline.polygon, fit.warp.inverse)]
            if polygon.area > SMALLEST
        ]
        holes = [polygon for is_piece, polygon in in_mm if not is_piece]
        self.blobs = [
            shapely.Polygon(
                piece.exterior, [h.exterior for h in holes if piece.contains(h.centroid)]
            )
            for is_piece, piece in in_mm
            if is_piece
        ]
        self.holders = self._holders()

    def _holders(self) -> dict[int, shapely.Polygon]:
        """Return the blob in each place, assigned by the nearest pairs first."""
        pairs = []
        for number, place in enumerate(self.sheet.places):
            low_x, low_y, high_x, high_y = box = place.region.bounds
            outer = sum(contour.area for contour in place.region.outers)
            for k, blob in enumerate(self.blobs):
                off = _middle(blob.bounds) - _middle(box)
                is_near = abs(off.real) < (high_x - low_x) / 2 + 1
                is_near = is_near and abs(off.imag) < (high_y - low_y) / 2 + 1
                # Dust is not a piece.
                if is_near and shapely.Polygon(blob.exterior).area > 0.1 * outer:
                    pairs.append((abs(off), number, k))
        holders: dict[int, int] = {}
        for _, number, k in sorted(pairs):
            if number not in holders and k not in holders.values():
                holders[number] = k
        return {number: self.blobs[k] for number, k in holders.items()}

    def finding(self, number: int, place: SheetShape) -> PieceFinding:
        """Return the finding for a place of the sheet."""
        blob = self.holders.get(number)
        if self._is_sound(number) and not (blob and self._strange_holes(place, blob)):
            return self._sound(number, place)
        # A blob that covers another place's middle is more than one piece.
        middles = [_middle(p.region.bounds) for p in self.sheet.places if p is not place]
        if blob is None or any(_holds(blob, middle) for middle in middles):
            return self._crowded(place)
        match = self._best_match(place, blob)
        if match is None:
            return _finding(place, "unknown", self._unknown(place, blob))
        shut = self._shut_holes(place, blob)
        at = " and ".join(f"x {hole.real:.1f}, y {hole.imag:.1f}" for hole in shut)
        more = f", or the hole at {at} is not open" if 0 < len(shut) <= 2 else ""
        doubt: tuple[PieceVerdict, str] = "unknown", self._unknown(place, blob)
        return _recognised(place, match, TOLERANCE, more, "", doubt)

    def _is_sound(self, piece: int) -> bool:
        """Return True if every contour of a piece is visible at its drawn position."""
        mine = self.fit.samples.pieces == piece
        within = np.abs(self.fit.residuals[mine]) <= TOLERANCE
        contours = self.fit.samples.contours[mine]
        return all(within[contours == k].mean() >= SOUND_SHARE for k in np.unique(contours))

    def _sound(self, number: int, place: SheetShape) -> PieceFinding:
        fit = self.fit
        residuals = np.abs(fit.residuals[(fit.samples.pieces == number) & (fit.weights > 0)])
        shift = math.hypot(*fit.displacements[number, :2])
        turn = math.degrees(fit.displacements[number, 2])
        verdict, message = _displaced(shift, turn, STRAY) or ("sound", "")
        rms, largest = None, None
        if len(residuals):
            rms, largest = math.sqrt(float((residuals**2).mean())), float(residuals.max())
        return _finding(place, verdict, message, shift, turn, rms, largest)

    def _crowded(self, place: SheetShape) -> PieceFinding:
        """Return the finding for a place without a blob: no piece, or others cover or touch it."""
        low_x, low_y, high_x, high_y = place.region.bounds
        pixels = self.fit.warp(np.array([(x, y) for x in (low_x, high_x) for y in (low_y, high_y)]))
        rows, columns = self.picture.pixels.shape
        if (pixels < 1).any() or (pixels > (columns - 2, rows - 2)).any():
            return _finding(place, "not in picture", "reaches out of the picture; scan all of it")
        middle = _middle(place.region.bounds)
        if not any(_holds(blob, middle) for blob in self.blobs):
            message = "is still in the sheet" if self.is_skeleton else "is missing"
            return _finding(place, "missing", message)
        x, y = middle.real, middle.imag
        around = shapely.box(x - REACH, y - REACH, x + REACH, y + REACH)
        near = [blob.segmentize(NEAR / 2) for blob in self.blobs if around.intersects(blob)]
        edges = np.concatenate([shapely.get_coordinates(blob) for blob in near]) @ (1, 1j)
        matches = [m for shape in self._shapes(place) for m in self._matches(shape, place, edges)]
        best = max(matches, key=lambda m: (round(m.share, 2), m.name == place.name), default=None)
        if best is None or best.share < COVERED_SHARE:
            return _finding(place, "unknown", "cannot be told from the pieces that it touches")
        touches = ", and touches others"
        covered = "is covered in part by another piece, or touches it"
        return _recognised(place, best, math.inf, touches, touches, ("covered", covered))

    def _unknown(self, place: SheetShape, blob: shapely.Polygon) -> str:
        shut, strange = self._shut_holes(place, blob), self._strange_holes(place, blob)
        places = [f"no hole at x {hole.real:.1f}, y {hole.imag:.1f}" for hole in shut]
        places += [
            f"an opening at x {hole.real:.1f}, y {hole.imag:.1f} that is not drawn"
            for hole in strange
        ]
        text = f"has {', '.join(places[:3])}"
        return text if places else "differs from its outline and all others"

    def _strange_holes(self, place: SheetShape, blob: shapely.Polygon) -> list[complex]:
        """Return the middles of a blob's holes that its piece does not have."""
        drawn = [points.mean() for points in _holes(place.region, 0.0)]
        return [] if self.is_skeleton else _apart(_inner(blob), drawn)

    def _shut_holes(self, place: SheetShape, blob: shapely.Polygon) -> list[complex]:
        """Return the middles of a piece's holes that are missing in a blob."""
        drawn = [points.mean() for points in _holes(place.region)]
        return [] if self.is_skeleton else _apart(drawn, _inner(blob))

    def _shapes(self, place: SheetShape) -> Iterator[SheetShape]:
        """Yield the shape that is expected in a place, then all others."""
        expected = place.name.split(", ")
        yield place
        yield from (shape for shape in self.sheet.shapes if shape.name not in expected)

    def _best_match(self, place: SheetShape, blob: shapely.Polygon) -> Match | None:
        """Return the shape of a blob, mirrored or not, or None; the expected one if in doubt."""
        rings = (blob.exterior, *blob.interiors)
        edges = np.concatenate([_sparse(_points(ring)) for ring in rings])
        matches = [
            match
            for shape in self._shapes(place)
            if self._has_size(shape.region, blob)
            for match in self._matches(shape, place, edges, blob)
            if match.misfit < SAME_SHAPE
        ]
        least = min((match.misfit for match in matches), default=0.0)
        as_good = [match for match in matches if match.misfit <= least + AS_GOOD]
        return min(
            as_good, key=lambda m: (m.name != place.name, m.is_mirrored, m.misfit), default=None
        )

    def _has_size(self, shape: Region, blob: shapely.Polygon) -> bool:
        """Return True if area and number of holes agree."""
        holes = 0 if self.is_skeleton else len(_holes(shape))
        outer = sum(contour.area for contour in shape.outers)
        room = SAME_AREA * outer + 0.15 * sum(contour.length for contour in shape.outers)
        area = shapely.Polygon(blob.exterior).area
        return holes == len(blob.interiors) and abs(area - outer) <= room

    def _matches(
        self,
        shape: SheetShape,
        place: SheetShape,
        edges: Complexes,
        blob: shapely.Polygon | None = None,
    ) -> Iterator[Match]:
        """Yield the shape, unmirrored and mirrored, fitted to the edges of a blob, or to the edges
        around its place if others partly cover it.

        Centroids of a blob and its shape agree at any rotation; a partly covered piece is tried in
        its place.
        """
        from scipy.spatial import cKDTree

        tree, start = cKDTree(xy(edges)), _middle(place.region.bounds)
        reach, aim, anchor = NEAR, start, 0j
        outer = [polyline(contour, 0.2) for contour in shape.region.outers]
        holes = [] if self.is_skeleton else _holes(shape.region)
        drawn = np.concatenate([*outer, *holes]) - _middle(shape.region.bounds)
        if blob is not None:
            reach, aim = math.inf, _centroid(shapely.Polygon(blob.exterior))
            anchor = _centroid(shapely.Polygon(xy(outer[0]))) - _middle(shape.region.bounds)
        for is_mirrored in (False, True):
            arms = -drawn.conj() if is_mirrored else drawn
            anchor = -anchor.conjugate() if is_mirrored else anchor
            best: Match | None = None
            for guess in _turns(tree, _sparse(arms), reach, anchor, aim):
                spin, shift = _aligned(tree, edges, arms, (guess, aim - guess * anchor), reach)
                laid = arms * spin + shift
                distances = [tree.query(xy(laid))[0]]
                distances += [] if blob is None else [cKDTree(xy(laid)).query(xy(edges))[0]]
                misfit = max(float(np.percentile(each, 95)) for each in distances)
                share = float((distances[0] < SAME_SHAPE).mean())
                # Of equally good turns, the smallest.
                if best is None or share > best.share + 0.01:
                    turn, off = math.degrees(cmath.phase(spin)), abs(shift - start)
                    best = Match(shape.name, is_mirrored, turn, off, share, misfit)
            if best is not None:
                yield best


def _finding(
    place: SheetShape, verdict: PieceVerdict, message: str, *measured: float | None
) -> PieceFinding:
    middle = _middle(place.region.bounds)
    x, y = round(middle.real, 3), round(middle.imag, 3)
    return PieceFinding(place.name, x, y, verdict, message, *measured)


def _recognised(
    place: SheetShape,
    match: Match,
    least: float,
    after_other: str,
    after: str,
    otherwise: tuple[PieceVerdict, str],
) -> PieceFinding:
    """Return the finding for a recognised piece; ``otherwise`` if it is the expected piece and less
    than ``least`` mm off. ``after_other`` and ``after`` end messages on another piece and on the
    expected one.
    """
    if match.name != place.name:
        over = ", turned over," if match.is_mirrored else ""
        message = f"{match.name}{over} lies in its place{after_other}"
        return _finding(place, "other piece", message)
    verdict, message = _displaced(match.shift, match.turn, least, after) or otherwise
    if match.is_mirrored:
        verdict, message = "turned over", f"is turned over{after}"
    return _finding(place, verdict, message, match.shift, match.turn)


def _displaced(
    shift: float, turn: float, least: float, after: str = ""
) -> tuple[PieceVerdict, str] | None:
    """Return verdict and message for a piece that is rotated, or at least ``least`` mm off."""
    if abs(turn) > TURNED:
        return "turned", f"is turned by {turn:.0f} degrees{after}"
    if shift > least:
        return "moved", f"lies {shift:.1f} mm off its place, turned by {turn:.1f} degrees"
    return None


def _turns(
    tree: Any, arms: Complexes, reach: float, anchor: complex, aim: complex
) -> list[complex]:
    """Return the three likeliest rotations about an anchor that maps to ``aim``; the smallest first
    if equal.
    """
    angles = np.deg2rad(np.arange(-180, 180, ANGLE_STEP))
    spins = np.exp(1j * angles)
    laid = (arms - anchor) * spins[:, None] + aim
    distances = tree.query(xy(laid.ravel()))[0].reshape(laid.shape)
    costs = np.minimum(distances, reach).mean(axis=1)
    order = np.lexsort([np.abs(angles), np.maximum(costs, costs.min() + AS_GOOD)])
    return [complex(spins[k]) for k in order[:3]]


def _aligned(
    tree: Any, edges: Complexes, arms: Complexes, guess: tuple[complex, complex], reach: float
) -> tuple[complex, complex]:
    """Rotation and shift from points to their nearest edges within ``reach`` mm, by rotation."""
    spin, shift = guess
    for _ in range(12):
        distance, nearest = tree.query(xy(arms * spin + shift))
        near = distance < reach
        if near.sum() < 8:
            break
        target, start = edges[nearest[near]], arms[near]
        dot = complex(((start - start.mean()).conj() * (target - target.mean())).sum())
        spin = cmath.exp(1j * cmath.phase(dot))
        shift = complex(target.mean() - spin * start.mean())
    return spin, shift


# Points as complex numbers, mm.


def _middle(box: Bounds) -> complex:
    low_x, low_y, high_x, high_y = box
    return complex((low_x + high_x) / 2, (low_y + high_y) / 2)


def _holds(blob: shapely.Polygon, point: complex) -> bool:
    """Return True if a point lies within the outline of a blob."""
    return bool(shapely.Polygon(blob.exterior).contains(shapely.Point(point.real, point.imag)))


def _points(ring: shapely.LinearRing) -> Complexes:
    return np.asarray(shapely.get_coordinates(ring)[:-1] @ (1, 1j))


def _inner(blob: shapely.Polygon) -> list[complex]:
    """Return the centres of a blob's holes."""
    return [complex(_points(hole).mean()) for hole in blob.interiors]


def _holes(piece: Region, least: float = SMALLEST) -> list[Complexes]:
    """Return points along the holes of a piece that are larger than ``least`` mm2."""
    return [polyline(hole, 0.2) for hole in piece.holes if -hole.area > least]


def _apart(middles: Sequence[complex], there: Sequence[complex]) -> list[complex]:
    """Return the centres of holes that are far from all others."""
    return [m for m in middles if all(abs(m - middle) > HOLE_PLACE for middle in there)]


def _centroid(polygon: shapely.Polygon) -> complex:
    return complex(polygon.centroid.x, polygon.centroid.y)


def _sparse(points: Complexes) -> Complexes:
    return points[:: max(1, len(points) // 150)]
