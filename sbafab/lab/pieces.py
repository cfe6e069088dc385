"""Identify the content of each place of a cut sheet: its piece, another, a flipped piece, or
none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.geometry.region import Region
from sbafab.lab.cut_sheet import DrawnSheet, SheetShape
from sbafab.lab.edges import TOLERANCE, EdgeFit
from sbafab.lab.picture import PictureOutline, ScanPicture, moments
from sbafab.lab.registration import SMALLEST, Location, PointArray, polyline

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

SOUND_SHARE = 0.9
"""Least share of samples on a contour that are within TOLERANCE."""
SAME_AREA = 0.08
"""Largest relative difference in area between a piece and its shape, in addition to the kerf."""
SAME_SHAPE = 0.2
"""Largest 95th percentile of the distance between an outline and its shape, mm."""
AS_GOOD = 0.02
"""Difference in fit below which the expected shape is chosen, mm."""
ANGLE_STEP = 5
TURNED = 5.0
"""Angle from which a piece counts as turned, not askew, degrees."""
COVERED_SHARE = 0.6
"""Least share of a piece's edges that must be visible if others cover the rest."""
REACH = 40.0
"""Search range for edges around a place, mm."""
STRAY = 0.5
"""Displacement that is reported, mm."""
NEAR = 1.0
"""Largest distance between an edge and a covered piece that is fitted to it, mm."""
HOLE_PLACE = 0.6
"""Largest distance between a hole and its place, mm."""


@dataclass(frozen=True)
class PieceFinding:
    """The finding for a place, x and y mm of the sheet: ``name`` is the piece drawn there.

    ``message`` is the finding as text; ``shift`` mm and ``turn`` degrees from the place, None if no
    piece was recognised; ``rms`` and ``largest`` mm: deviations of its edges from the drawn ones,
    apart from shift, turn and the common offset.
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


class Blob(NamedTuple):
    """A visible piece or window: outline and holes, points in mm of the sheet."""

    outline: PointArray
    holes: tuple[PointArray, ...]
    centroid: PointArray
    area: float


class Match(NamedTuple):
    """A shape fitted to edges: degrees counter-clockwise and mm from the place, after mirroring if
    it is mirrored.

    ``share`` of its edges lies on measured ones; ``misfit`` mm is the 95th percentile of distances.
    """

    name: str
    is_mirrored: bool
    turn: float
    shift: float
    share: float
    misfit: float


def piece_findings(
    picture: ScanPicture,
    sheet: DrawnSheet,
    location: Location,
    fit: EdgeFit,
    measured: Sequence[PictureOutline],
) -> list[PieceFinding]:
    """Return a finding for each place of the sheet."""
    blobs = _blobs(location, fit, measured)
    holders = _holders(sheet, blobs)
    is_skeleton = location.content == "skeleton"
    findings = []
    for number, place in enumerate(sheet.places):
        blob = holders.get(number)
        if _is_sound(fit, number) and (
            blob is None or is_skeleton or not _strange_holes(place.region, blob)
        ):
            findings.append(_sound(fit, number, place))
        elif blob is not None and _is_alone(sheet, number, blob):
            findings.append(_identified(sheet, place, blob, is_skeleton))
        else:
            findings.append(_crowded(picture, sheet, number, fit, blobs, is_skeleton))
    return findings


def _is_alone(sheet: DrawnSheet, number: int, blob: Blob) -> bool:
    """Return True if a blob covers no other place's middle."""
    middles = [_middle(place.region) for other, place in enumerate(sheet.places) if other != number]
    return not any(_is_in(blob.outline, middle) for middle in middles)


def _middle(piece: Region) -> PointArray:
    low_x, low_y, high_x, high_y = piece.bounds
    return np.array([(low_x + high_x) / 2, (low_y + high_y) / 2])


def _blobs(location: Location, fit: EdgeFit, measured: Sequence[PictureOutline]) -> list[Blob]:
    is_film = location.content == "pieces"
    in_mm = [
        (outline, points, *moments(points))
        for outline in measured
        for points in [fit.warp.inverse(outline.points)]
    ]
    least = SMALLEST
    holes = [
        (points, centroid)
        for outline, points, area, centroid in in_mm
        if (outline.is_light == location.is_light) != is_film and abs(area) > least
    ]
    return [
        Blob(points, tuple(h for h, middle in holes if _is_in(points, middle)), centroid, abs(area))
        for outline, points, area, centroid in in_mm
        if (outline.is_light == location.is_light) == is_film and abs(area) > least
    ]


def _is_in(polygon: PointArray, point: PointArray) -> bool:
    """Return True if a point lies in a polygon."""
    x, y = (polygon - point).T
    after_x, after_y = np.roll(x, -1), np.roll(y, -1)
    crosses = (y > 0) != (after_y > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x - y * (after_x - x) / (after_y - y)
    return bool((crosses & (at > 0)).sum() % 2)


def _holders(sheet: DrawnSheet, blobs: Sequence[Blob]) -> dict[int, Blob]:
    """Return the blob in each place, assigned by the nearest pairs first."""
    pairs = []
    for number, place in enumerate(sheet.places):
        low_x, low_y, high_x, high_y = place.region.bounds
        middle = np.array([(low_x + high_x) / 2, (low_y + high_y) / 2])
        half = np.array([high_x - low_x, high_y - low_y]) / 2 + 1.0
        outer = abs(sum(c.area for c in place.region.outers))
        for k, blob in enumerate(blobs):
            off = np.abs((blob.outline.min(axis=0) + blob.outline.max(axis=0)) / 2 - middle)
            # Dust is not a piece.
            if (off < half).all() and blob.area > 0.1 * outer:
                pairs.append((float(np.hypot(*off)), number, k))
    holders: dict[int, Blob] = {}
    used: set[int] = set()
    for _, number, k in sorted(pairs):
        if number not in holders and k not in used:
            holders[number] = blobs[k]
            used.add(k)
    return holders


def _is_sound(fit: EdgeFit, piece: int) -> bool:
    """Return True if every contour of a piece is visible at its drawn position."""
    mine = fit.samples.pieces == piece
    within = np.abs(fit.residuals[mine]) <= TOLERANCE
    contours = fit.samples.contours[mine]
    return all(within[contours == k].mean() >= SOUND_SHARE for k in np.unique(contours))


def _strange_holes(piece: Region, blob: Blob) -> list[PointArray]:
    """Return the middles of a blob's holes that its piece does not have."""
    drawn = [polyline(hole, 0.2).mean(axis=0) for hole in piece.holes]
    middles = [hole.mean(axis=0) for hole in blob.holes]
    return [m for m in middles if all(math.dist(m, d) > HOLE_PLACE for d in drawn)]


def _shut_holes(piece: Region, blob: Blob) -> list[PointArray]:
    """Return the middles of a piece's holes that are missing in a blob."""
    measured = [hole.mean(axis=0) for hole in blob.holes]
    drawn = [polyline(hole, 0.2).mean(axis=0) for hole in piece.holes if -hole.area > SMALLEST]
    return [d for d in drawn if all(math.dist(m, d) > HOLE_PLACE for m in measured)]


def _finding(
    place: SheetShape, verdict: PieceVerdict, message: str, **more: float | None
) -> PieceFinding:
    low_x, low_y, high_x, high_y = place.region.bounds
    x, y = round((low_x + high_x) / 2, 3), round((low_y + high_y) / 2, 3)
    return PieceFinding(place.name, x, y, verdict, message, **more)


def _sound(fit: EdgeFit, number: int, place: SheetShape) -> PieceFinding:
    mine = fit.samples.pieces == number
    residuals = np.abs(fit.residuals[mine & (fit.weights > 0)])
    shift = math.hypot(*fit.displacements[number, :2])
    turn = math.degrees(fit.displacements[number, 2])
    rms = math.sqrt(float((residuals**2).mean())) if len(residuals) else None
    largest = float(residuals.max()) if len(residuals) else None
    verdict: PieceVerdict = "sound"
    message = ""
    if abs(turn) > TURNED:
        verdict, message = "turned", f"is turned by {turn:.0f} degrees"
    elif shift > STRAY:
        verdict = "moved"
        message = f"lies {shift:.1f} mm off its place, turned by {turn:.1f} degrees"
    return _finding(place, verdict, message, shift=shift, turn=turn, rms=rms, largest=largest)


def _crowded(
    picture: ScanPicture,
    sheet: DrawnSheet,
    number: int,
    fit: EdgeFit,
    blobs: Sequence[Blob],
    is_skeleton: bool,
) -> PieceFinding:
    """Return the finding for a place without a blob: no piece, or others cover or touch it."""
    place = sheet.places[number]
    if _reaches_out(picture, fit, place.region):
        return _finding(place, "not in picture", "reaches out of the picture; scan all of it")
    middle = _middle(place.region)
    near = [
        points
        for blob in blobs
        for points in (blob.outline, *blob.holes)
        if (points.min(axis=0) < middle + REACH).all()
        and (points.max(axis=0) > middle - REACH).all()
    ]
    if not any(_is_in(blob.outline, middle) for blob in blobs):
        message = "is still in the sheet" if is_skeleton else "is missing"
        return _finding(place, "missing", message)
    shapes = (place, *_others(sheet, place))
    measured = np.vstack([_dense(points) for points in near])
    matches = [m for shape in shapes for m in _matches(shape, place, measured)]
    best = max(matches, key=lambda m: (round(m.share, 2), m.name == place.name), default=None)
    if best is None or best.share < COVERED_SHARE:
        return _finding(place, "unknown", "cannot be told from the pieces that it touches")
    if best.name != place.name:
        message = f"{best.name} lies in its place, and touches others"
        return _finding(place, "other piece", message)
    message = "is covered in part by another piece, or touches it"
    verdict: PieceVerdict = "covered"
    if best.is_mirrored:
        verdict, message = "turned over", "is turned over, and touches others"
    elif abs(best.turn) > TURNED:
        verdict = "turned"
        message = f"is turned by {best.turn:.0f} degrees, and touches others"
    return _finding(place, verdict, message, shift=best.shift, turn=best.turn)


def _reaches_out(picture: ScanPicture, fit: EdgeFit, piece: Region) -> bool:
    low_x, low_y, high_x, high_y = piece.bounds
    corners = [(x, y) for x in (low_x, high_x) for y in (low_y, high_y)]
    pixels = fit.warp(np.array(corners))
    rows, columns = picture.pixels.shape
    return bool((pixels < 1).any() or (pixels > (columns - 2, rows - 2)).any())


def _dense(points: PointArray) -> PointArray:
    """Return the points of a closed outline and the midpoints between them."""
    return np.vstack([points, (points + np.roll(points, -1, axis=0)) / 2])


def _identified(
    sheet: DrawnSheet, place: SheetShape, blob: Blob, is_skeleton: bool
) -> PieceFinding:
    """Return the finding for a blob that is not the piece in its place as drawn."""
    match = best_match(sheet, place, blob, is_skeleton)
    if match is None:
        return _finding(place, "unknown", _unknown(place, blob, is_skeleton))
    where = {"shift": match.shift, "turn": match.turn}
    if match.name != place.name:
        over = ", turned over," if match.is_mirrored else ""
        shut = "" if is_skeleton else _shut(place, blob)
        return _finding(place, "other piece", f"{match.name}{over} lies in its place{shut}")
    if match.is_mirrored:
        return _finding(place, "turned over", "is turned over", **where)
    if abs(match.turn) > TURNED:
        return _finding(place, "turned", f"is turned by {match.turn:.0f} degrees", **where)
    if match.shift > TOLERANCE:
        message = f"lies {match.shift:.1f} mm off its place, turned by {match.turn:.1f} degrees"
        return _finding(place, "moved", message, **where)
    return _finding(place, "unknown", _unknown(place, blob, is_skeleton), **where)


def _shut(place: SheetShape, blob: Blob) -> str:
    shut = _shut_holes(place.region, blob)
    at = " and ".join(f"x {x:.1f}, y {y:.1f}" for x, y in shut)
    return f", or the hole at {at} is not open" if shut and len(shut) <= 2 else ""


def _unknown(place: SheetShape, blob: Blob, is_skeleton: bool) -> str:
    places = []
    if not is_skeleton:
        places += [f"no hole at x {x:.1f}, y {y:.1f}" for x, y in _shut_holes(place.region, blob)]
        places += [
            f"an opening at x {x:.1f}, y {y:.1f} that is not drawn"
            for x, y in _strange_holes(place.region, blob)
        ]
    return f"has {', '.join(places[:3])}" if places else "differs from its outline and all others"


def best_match(sheet: DrawnSheet, place: SheetShape, blob: Blob, is_skeleton: bool) -> Match | None:
    """Return the shape of a blob, mirrored or not, or None; the expected one if in doubt."""
    measured = np.vstack([_sparse(points) for points in (blob.outline, *blob.holes)])
    matches = [
        match
        for shape in (place, *_others(sheet, place))
        if _has_size(shape, blob, is_skeleton)
        for match in _matches(shape, place, measured, blob, is_skeleton)
        if match.misfit < SAME_SHAPE
    ]
    least = min((match.misfit for match in matches), default=0.0)
    as_good = [match for match in matches if match.misfit <= least + AS_GOOD]
    return min(as_good, key=lambda m: (m.name != place.name, m.is_mirrored, m.misfit), default=None)


def _others(sheet: DrawnSheet, place: SheetShape) -> Iterator[SheetShape]:
    expected = place.name.split(", ")
    yield from (shape for shape in sheet.shapes if shape.name not in expected)


def _has_size(shape: SheetShape, blob: Blob, is_skeleton: bool) -> bool:
    """Return True if area and number of holes agree."""
    holes = 0 if is_skeleton else sum(-hole.area > SMALLEST for hole in shape.region.holes)
    outer = sum(contour.area for contour in shape.region.outers)
    room = SAME_AREA * outer + 0.15 * sum(c.length for c in shape.region.outers)
    return holes == len(blob.holes) and abs(blob.area - outer) <= room


def _matches(
    shape: SheetShape,
    place: SheetShape,
    measured: PointArray,
    blob: Blob | None = None,
    is_skeleton: bool = False,
) -> Iterator[Match]:
    """Yield the shape, unmirrored and mirrored, fitted to the points of a blob, or to the edges
    around its place that others partly cover.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(measured)
    holes = [] if is_skeleton else [h for h in shape.region.holes if -h.area > SMALLEST]
    outlines = [polyline(contour, 0.2) for contour in (*shape.region.outers, *holes)]
    drawn = np.vstack(outlines) - _middle(shape.region)
    centroid = moments(outlines[0])[1] - _middle(shape.region)
    start, reach = _middle(place.region), NEAR if blob is None else math.inf
    for is_mirrored in (False, True):
        flip = np.array([-1.0 if is_mirrored else 1.0, 1.0])
        arms = drawn * flip
        best: Match | None = None
        for angle, middle in _guesses(tree, _sparse(arms), reach, start, blob, centroid * flip):
            matrix, shift = _aligned(tree, measured, arms, (_spun(angle), middle), reach)
            laid = arms @ matrix.T + shift
            distances = [tree.query(laid)[0]]
            distances += [] if blob is None else [cKDTree(laid).query(measured)[0]]
            misfit = max(float(np.percentile(each, 95)) for each in distances)
            share = float((distances[0] < SAME_SHAPE).mean())
            turn = math.degrees(math.atan2(matrix[1, 0], matrix[0, 0]))
            # Of equally good turns, the smallest.
            if best is None or share > best.share + 0.01:
                off = math.dist(shift, start)
                best = Match(shape.name, is_mirrored, turn, off, share, misfit)
        if best is not None:
            yield best


def _guesses(
    tree: Any,
    arms: PointArray,
    reach: float,
    start: PointArray,
    blob: Blob | None,
    centroid: PointArray,
) -> list[tuple[float, PointArray]]:
    """Return the likeliest turns, rad, and where each puts the middle of a shape; of equally good
    ones the smallest first.

    Centroids of outlines agree at any turn, unless others cover a part.
    """
    guesses = []
    for angle in np.deg2rad(np.arange(-180, 180, ANGLE_STEP)):
        turned = _spun(angle)
        middle = start if blob is None else blob.centroid - turned @ centroid
        distances = tree.query(arms @ turned.T + middle)[0]
        guesses.append((float(np.minimum(distances, reach).mean()), float(angle), middle))
    least = min(cost for cost, *_ in guesses) + AS_GOOD
    guesses.sort(key=lambda guess: (max(guess[0], least), abs(guess[1])))
    return [(angle, middle) for _, angle, middle in guesses[:3]]


def _sparse(points: PointArray) -> PointArray:
    return points[:: max(1, len(points) // 150)]


def _spun(radians: float) -> NDArray[np.float64]:
    cosine, sine = math.cos(radians), math.sin(radians)
    return np.array([[cosine, -sine], [sine, cosine]])


def _aligned(
    tree: Any,
    measured: PointArray,
    arms: PointArray,
    guess: tuple[NDArray[np.float64], PointArray],
    reach: float,
) -> tuple[NDArray[np.float64], PointArray]:
    """Return turn and shift from points to their nearest measured ones within ``reach`` mm, by
    turns.
    """
    matrix, shift = guess
    for _ in range(12):
        distance, nearest = tree.query(arms @ matrix.T + shift)
        near = distance < reach
        if near.sum() < 8:
            break
        target, start = measured[nearest[near]], arms[near]
        a, b = start - start.mean(axis=0), target - target.mean(axis=0)
        dot, cross = float((a * b).sum()), float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
        matrix = _spun(math.atan2(cross, dot))
        shift = target.mean(axis=0) - matrix @ start.mean(axis=0)
    return matrix, shift
