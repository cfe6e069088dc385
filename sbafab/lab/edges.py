"""Edges of film in a picture, measured along the normals of the cut file's edges.

Along each normal the grey level falls from film to paper; the film's edge is where it passes midway
between their local values. Symmetric blur does not move that point on a straight edge; on a circle
of radius r a blur of deviation s moves it by s^2 / 2r towards the centre, which is corrected.

All edges together give, by robust least squares, the map from the cut file to the picture, the
offset of the film's edge outside the drawn one (half the kerf, negative) and the displacement of
each piece.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Edge, left_turn
from sbafab.geometry.region import Region
from sbafab.lab.cut_sheet import DrawnSheet
from sbafab.lab.picture import ScanPicture
from sbafab.lab.registration import SMALLEST, Location, PointArray, Warp

STEP = 0.2
"""Spacing of samples, mm."""
MOST_SAMPLES = 60_000
CORNER = 0.35
"""Distance of samples from corners, which the beam and blur round off, mm."""
TURN = 0.1
"""Smaller angles are not corners, rad."""
SHARPEST = 0.3
"""Arcs of a smaller radius are corners, not edges, mm."""
REACHES = (0.9, 0.45, 0.45, 0.45)
"""Search range on both sides of the drawn edge, round by round, mm."""
SMOOTH = 1.4
"""Smoothing length of a profile, in steps of half a pixel."""
LEAST_CONTRAST = 0.4
"""Least contrast, as a share of the usual difference between film and paper."""
TOLERANCE = 0.1
"""Largest distance of an edge that belongs to its piece, after displacement, mm."""
NEIGHBOURS = 10
"""Samples along an edge with correlated errors: they count as one."""
ROUNDS = 8
"""Rounds of reweighting."""
FEW = 4
"""Fewer pieces give no uncertainty from their scatter."""
LOOSE, TIGHT = 0.3, 0.004
"""Displacement of pieces, at the first guess and at least, mm."""


@dataclass(frozen=True)
class Samples:
    """Places on the drawn edges: ``points`` and outward ``normals`` of the film (n, 2), mm.

    ``curvatures``, 1/mm: positive where the film's edge bulges outward. ``contours`` and ``pieces``
    are the numbers of each sample's contour and piece.
    """

    points: PointArray
    normals: PointArray
    curvatures: NDArray[np.float64]
    contours: NDArray[np.int64]
    pieces: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.points)


def samples_of(regions: Sequence[Region], is_skeleton: bool) -> Samples:
    """Return samples on the edges of pieces; in a skeleton, the film is outside the outlines."""
    step = max(STEP, sum(c.length for r in regions for c in r.contours) / MOST_SAMPLES)
    rows: list[tuple[float, ...]] = []
    number = 0
    for piece, region in enumerate(regions):
        for contour in region.contours:
            if contour.is_hole and (is_skeleton or -contour.area < SMALLEST):
                continue
            rows += [(*row, number, piece) for row in _along(contour, step)]
            number += 1
    table = np.array(rows, dtype=float).reshape(-1, 7)
    sign = -1.0 if is_skeleton else 1.0
    return Samples(
        points=table[:, :2],
        normals=sign * table[:, 2:4],
        curvatures=sign * table[:, 4],
        contours=table[:, 5].astype(int),
        pieces=table[:, 6].astype(int),
    )


def _along(contour: Contour, step: float) -> list[tuple[float, ...]]:
    """Return x, y, outward normal and curvature of samples along a contour, away from its
    corners.
    """
    rows: list[tuple[float, ...]] = []
    edges = contour.edges
    for before, edge, after in zip(
        (edges[-1], *edges[:-1]), edges, (*edges[1:], edges[0]), strict=True
    ):
        if isinstance(edge, Arc) and edge.radius < SHARPEST:
            continue
        start = CORNER if _is_corner(before, edge) else 0.0
        end = edge.length - (CORNER if _is_corner(edge, after) else 0.0)
        count = max(1, math.floor((end - start) / step))
        for k in range(count if end > start else 0):
            point = edge.at((start + (k + 0.5) * (end - start) / count) / edge.length)
            ux, uy = edge.direction(point)
            bend = 0.0
            if isinstance(edge, Arc):
                bend = (1.0 if edge.ccw else -1.0) / edge.radius
            rows.append((*point, uy, -ux, bend))
    return rows


def _is_corner(before: Edge, after: Edge) -> bool:
    sharp = any(isinstance(e, Arc) and e.radius < SHARPEST for e in (before, after))
    return sharp or abs(left_turn(before, after)) > TURN


class Crossings(NamedTuple):
    """Distance per sample of the film's edge outside the drawn edge, mm; NaN if no edge is visible.

    ``blur``: the deviation of the picture's blur, mm. ``contrast``: film less paper, grey levels.
    """

    outside: NDArray[np.float64]
    blur: float
    contrast: float


def crossings(
    picture: ScanPicture,
    warp: Warp,
    samples: Samples,
    reach: float,
    expected: NDArray[np.float64] | float = 0.0,
) -> Crossings:
    """Return the film's edge along each normal, nearest to ``expected`` mm outside."""
    from scipy.ndimage import gaussian_filter1d, map_coordinates, median_filter

    step = 0.5 / max(warp.pixels_per_mm(np.array(warp.centre)))
    half = max(6, round(reach / step))
    offsets: NDArray[np.float64] = np.arange(-half, half + 1, dtype=np.float64) * step
    places = samples.points[:, None, :] + offsets[None, :, None] * samples.normals[:, None, :]
    pixels = warp(places.reshape(-1, 2)).reshape(places.shape)
    levels = map_coordinates(
        picture.pixels, [pixels[..., 1], pixels[..., 0]], order=1, mode="constant", cval=np.nan
    )
    levels = gaussian_filter1d(levels, SMOOTH, axis=1, mode="nearest")
    # Neighbours along the edge agree on film and paper; dust affects only a few.
    plateau = max(3, half // 2)
    film = median_filter(np.median(levels[:, :plateau], axis=1), 9, mode="nearest")
    paper = median_filter(np.median(levels[:, -plateau:], axis=1), 9, mode="nearest")
    difference = film - paper
    # Edges outside the picture have no contrast.
    usual = float(np.nanmedian(difference)) if np.isfinite(difference).any() else np.nan
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (levels - paper[:, None]) / difference[:, None]
    is_seen = difference * np.sign(usual) > LEAST_CONTRAST * abs(usual)
    outside = _passing(share, 0.5, offsets, expected)
    width = _passing(share, 0.1587, offsets, outside) - _passing(share, 0.8413, offsets, outside)
    outside[~is_seen] = np.nan
    known = width[is_seen & np.isfinite(width)]
    # Smoothing is only across the edge, which does not move a curved edge.
    blur = float(np.median(known)) / 2 if len(known) else 0.0
    blur = math.sqrt(max(blur**2 - (SMOOTH * step) ** 2, 0.0))
    outside += blur**2 / 2 * samples.curvatures
    return Crossings(outside, blur, usual)


def _passing(
    share: NDArray[np.float64],
    level: float,
    offsets: NDArray[np.float64],
    expected: NDArray[np.float64] | float,
) -> NDArray[np.float64]:
    """Return the offset at which each row falls through a level, nearest to ``expected``, or
    NaN.
    """
    above = share >= level
    falls = above[:, :-1] & (share[:, 1:] < level)
    with np.errstate(divide="ignore", invalid="ignore"):
        part = (share[:, :-1] - level) / (share[:, :-1] - share[:, 1:])
    at = offsets[:-1] + part * (offsets[1] - offsets[0])
    centre = np.broadcast_to(np.asarray(expected, dtype=float), len(share))[:, None]
    distance = np.where(falls, np.abs(at - np.nan_to_num(centre)), np.inf)
    nearest = distance.argmin(axis=1)
    rows = np.arange(len(share))
    return np.where(np.isfinite(distance[rows, nearest]), at[rows, nearest], np.nan)


@dataclass(frozen=True)
class EdgeFit:
    """Edges of a picture fitted to the cut file.

    ``outside`` by sample, mm, NaN if no edge is visible: distance of the film's edge beyond the
    drawn edge, at the displaced piece. Its common part is ``offset``; ``displacements`` (pieces, 3)
    are the displacements of pieces, mm along x and y and radians about their middle. A weight of 0
    in ``weights`` marks an outlier, not an edge of the piece. ``uncertainty``: the standard
    uncertainty of ``offset`` from the scatter between pieces, with ``degrees`` of freedom.
    """

    samples: Samples
    warp: Warp
    outside: NDArray[np.float64]
    weights: NDArray[np.float64]
    offset: float
    uncertainty: float
    degrees: int
    displacements: NDArray[np.float64]
    blur: float
    contrast: float

    @property
    def residuals(self) -> NDArray[np.float64]:
        """Residuals of the edges after the common offset, mm."""
        return self.outside - self.offset


def fitted(picture: ScanPicture, sheet: DrawnSheet, location: Location, is_camera: bool) -> EdgeFit:
    """Return the fit of the edges in a picture with a roughly known location."""
    is_skeleton = location.content == "skeleton"
    samples = samples_of([place.region for place in sheet.places], is_skeleton)
    degree = 3 if is_camera and len(sheet.places) >= 6 else 1
    empty = np.zeros(((degree + 1) * (degree + 2) // 2, 2))
    warp = replace(location.warp, degree=degree, coefficients=empty)
    displacements = np.zeros((len(sheet.places), 3))
    looseness, offset = LOOSE, 0.0
    fit: EdgeFit | None = None
    for reach in REACHES:
        laid = moved(samples, displacements)
        measured = crossings(picture, warp, laid, min(reach, 0.9 * sheet.spacing), offset)
        fit = _solved(laid, warp, measured, displacements, looseness)
        warp, offset, displacements = fit.warp, fit.offset, fit.displacements
        looseness = max(TIGHT, 1.5 * float(np.median(np.abs(displacements[:, :2]))))
    assert fit is not None
    return replace(fit, samples=samples)


def moved(samples: Samples, displacements: NDArray[np.float64]) -> Samples:
    """Return the samples at the displaced pieces."""
    shifts, turns = displacements[samples.pieces, :2], displacements[samples.pieces, 2]
    middles = _middles(samples, len(displacements))[samples.pieces]
    cosine, sine = np.cos(turns), np.sin(turns)
    spin = np.stack([np.stack([cosine, -sine], 1), np.stack([sine, cosine], 1)], 1)
    return replace(
        samples,
        points=middles + shifts + np.einsum("nij,nj->ni", spin, samples.points - middles),
        normals=np.einsum("nij,nj->ni", spin, samples.normals),
    )


def _middles(samples: Samples, count: int) -> PointArray:
    number = np.maximum(np.bincount(samples.pieces, minlength=count), 1)
    return np.column_stack(
        [np.bincount(samples.pieces, samples.points[:, k], count) / number for k in range(2)]
    )


def _rigid(samples: Samples, count: int) -> NDArray[np.float64]:
    """Return the outward motion (n, 3) of each sample by x, y and turn of its piece."""
    arm = samples.points - _middles(samples, count)[samples.pieces]
    turn = arm[:, 0] * samples.normals[:, 1] - arm[:, 1] * samples.normals[:, 0]
    return np.column_stack([samples.normals, turn])


def _solved(
    laid: Samples,
    warp: Warp,
    measured: Crossings,
    displacements: NDArray[np.float64],
    looseness: float,
) -> EdgeFit:
    """Solve for the map, the offset and all displacements at once, by Tukey's weights."""
    matrix, terms = _matrix(laid, warp, len(displacements))
    strength = _strength(matrix, laid, displacements, terms)
    before = np.concatenate([np.zeros(1 + 2 * terms), displacements.ravel()])
    is_seen = np.isfinite(measured.outside)
    outside = np.where(is_seen, measured.outside, 0.0)
    weights = is_seen.astype(float)
    scale = float(np.median(np.abs(measured.outside[is_seen]))) if is_seen.any() else 1.0
    for _ in range(ROUNDS):
        weighted = matrix * weights[:, None]
        stiffness = strength * max(scale, 0.004) ** 2 * NEIGHBOURS / looseness**2
        normal = matrix.T @ weighted + np.diag(stiffness + 1e-9)
        solution = np.linalg.solve(normal, weighted.T @ outside - stiffness * before)
        residuals = outside - matrix @ solution
        scale = 1.4826 * float(np.median(np.abs(residuals[is_seen]))) if is_seen.any() else 1.0
        bound = max(4.7 * scale, 0.02)
        inside = is_seen & (np.abs(residuals) < bound)
        weights = np.where(inside, (1 - (residuals / bound) ** 2) ** 2, 0.0)
    pull = stiffness * (before + solution)
    uncertainty, degrees = _of_offset(matrix, normal, weights * residuals, pull, laid)
    change = solution[1 : 1 + 2 * terms].reshape(2, terms).T
    return EdgeFit(
        samples=laid,
        warp=replace(warp, coefficients=warp.coefficients + change),
        outside=np.where(is_seen, residuals + solution[0], np.nan),
        weights=weights,
        offset=float(solution[0]),
        uncertainty=uncertainty,
        degrees=degrees,
        displacements=displacements + solution[1 + 2 * terms :].reshape(-1, 3),
        blur=measured.blur,
        contrast=measured.contrast,
    )


def _matrix(laid: Samples, warp: Warp, count: int) -> tuple[NDArray[np.float64], int]:
    """Return the outward motion of each sample by offset, map and displacements, and the map's
    number of terms per axis.
    """
    monomials = warp.monomials(laid.points)
    terms = monomials.shape[1]
    matrix = np.zeros((len(laid), 1 + 2 * terms + 3 * count))
    matrix[:, 0] = 1.0
    matrix[:, 1 : 1 + terms] = monomials * laid.normals[:, :1]
    matrix[:, 1 + terms : 1 + 2 * terms] = monomials * laid.normals[:, 1:]
    rows = np.arange(len(laid))
    for k, column in enumerate(_rigid(laid, count).T):
        matrix[rows, 1 + 2 * terms + 3 * laid.pieces + k] = column
    return matrix, terms


def _strength(
    matrix: NDArray[np.float64], laid: Samples, displacements: NDArray[np.float64], terms: int
) -> NDArray[np.float64]:
    """Return the prior weight of each unknown: all displacements are expected to be about equally
    small.

    A turn counts by the motion of the edge.
    """
    count = len(displacements)
    number = np.maximum(np.bincount(laid.pieces, minlength=count), 1)
    arms = np.bincount(laid.pieces, _rigid(laid, count)[:, 2] ** 2, count) / number
    strength = np.zeros(matrix.shape[1])
    strength[1 + 2 * terms :] = np.column_stack([np.ones((count, 2)), arms]).ravel()
    return strength


def _of_offset(
    matrix: NDArray[np.float64],
    normal: NDArray[np.float64],
    errors: NDArray[np.float64],
    pull: NDArray[np.float64],
    laid: Samples,
) -> tuple[float, int]:
    """Return the offset's standard uncertainty from the scatter between pieces, and its degrees.

    Errors within a piece are correlated and its displacement is one draw, so pieces are the
    clusters, or contours if pieces are few (cluster-robust sandwich estimate).
    """
    towards = np.linalg.solve(normal, np.eye(len(normal))[0])
    count = int(laid.pieces.max()) + 1
    influence = (matrix @ towards) * errors
    if count < FEW:
        by_cluster = np.bincount(laid.contours, influence)
    else:
        shifts = (towards * pull)[-3 * count :].reshape(count, 3).sum(axis=1)
        by_cluster = np.bincount(laid.pieces, influence, count) - shifts
    degrees = max(len(by_cluster) - 1, 1)
    spread = math.sqrt(float((by_cluster**2).sum()) * len(by_cluster) / degrees)
    return spread, degrees
