"""Edges of film in a picture, measured along the normals of the cut file's edges.

Along each normal the grey level falls from film to paper; the film's edge is at the midpoint of
their local values. Symmetric blur does not move that point on a straight edge; on a circle of
radius r a blur of deviation s moves it by s^2 / 2r toward the centre, which is corrected.

All edges together determine, by robust least squares, the map from the cut file to the picture, the
offset of the film's edge outside the drawn edge (half the kerf, negative) and the displacement of
each piece. The true scale comes from the scanner's resolution, a bar, or the sheet's pins.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from sbafab.errors import DesignError
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Edge, left_turn
from sbafab.geometry.region import Region, disc, polygon
from sbafab.lab.registration import SMALLEST, Location, PointArray, Warp, xy
from sbafab.lab.scan import MILLIMETRES, Scan, ScanPicture

FloatArray = NDArray[np.float64]

STEP = 0.2  # spacing of samples, mm
MOST_SAMPLES = 60_000
CORNER = 0.35  # distance of samples from corners, which the beam and blur round off, mm
TURN = 0.1  # smaller angles are not corners, rad
SHARPEST = 0.3  # arcs of a smaller radius are corners, not edges, mm
REACHES = (0.9, 0.45, 0.45, 0.45)
"""Search range on both sides of the drawn edge, round by round, mm."""
SMOOTH = 1.4  # smoothing length of a profile, in steps of half a pixel
LEAST_CONTRAST = 0.4  # least contrast, as a share of the usual difference between film and paper
TOLERANCE = 0.1  # largest distance of an edge that belongs to its piece, after displacement, mm
NEIGHBOURS = 10  # samples along an edge with correlated errors: they count as one
ROUNDS = 8  # rounds of reweighting
FEW = 4  # fewer pieces give no uncertainty from their scatter
LOOSE, TIGHT = 0.3, 0.004  # displacement of pieces, at the first guess and at least, mm


@dataclass(frozen=True)
class Samples:
    """Points on the drawn edges: ``points`` and outward ``normals`` of the film (n, 2), mm.

    ``curvatures``, 1/mm, are positive where the film's edge is convex. ``contours`` and ``pieces``
    are the numbers of each sample's contour and piece.
    """

    points: PointArray
    normals: PointArray
    curvatures: FloatArray
    contours: NDArray[np.int64]
    pieces: NDArray[np.int64]

    def middles(self, count: int) -> PointArray:
        """Return the mean position of the samples of each of ``count`` pieces, (count, 2) mm."""
        sums = [np.bincount(self.pieces, each, count) for each in self.points.T]
        return np.column_stack(sums) / self.numbers(count)[:, None]

    def numbers(self, count: int) -> FloatArray:
        """Return the number of samples of each of ``count`` pieces, at least 1."""
        return np.maximum(np.bincount(self.pieces, minlength=count), 1.0)

    def moved(self, displacements: FloatArray) -> Samples:
        """Return the samples on displaced pieces: mm along x and y, radians about the middle."""
        dx, dy, turns = displacements[self.pieces].T
        middles = self.middles(len(displacements))[self.pieces] @ (1, 1j)
        spin = np.exp(1j * turns)
        points = middles + dx + 1j * dy + spin * (self.points @ (1, 1j) - middles)
        normals = spin * (self.normals @ (1, 1j))
        return replace(self, points=xy(points), normals=xy(normals))


def samples_of(regions: Sequence[Region], is_skeleton: bool) -> Samples:
    """Return samples on the edges of pieces; in a skeleton, the film is outside the outlines."""
    step = max(STEP, sum(c.length for r in regions for c in r.contours) / MOST_SAMPLES)
    shown = [
        (piece, contour)
        for piece, region in enumerate(regions)
        for contour in region.contours
        if not contour.is_hole or not (is_skeleton or -contour.area < SMALLEST)
    ]
    rows = [
        (*row, number, piece)
        for number, (piece, contour) in enumerate(shown)
        for row in _along(contour, step)
    ]
    table = np.array(rows, dtype=float).reshape(-1, 7)
    sign = -1.0 if is_skeleton else 1.0
    contours, pieces = table[:, 5:].astype(int).T
    return Samples(table[:, :2], sign * table[:, 2:4], sign * table[:, 4], contours, pieces)


def _along(contour: Contour, step: float) -> Iterator[tuple[float, ...]]:
    """Yield x, y, outward normal and curvature of samples along a contour, clear of corners."""
    edges = contour.edges
    for before, edge, after in zip(
        (edges[-1], *edges[:-1]), edges, (*edges[1:], edges[0]), strict=True
    ):
        if _is_sharp(edge):
            continue
        start = CORNER if _is_corner(before, edge) else 0.0
        end = edge.length - (CORNER if _is_corner(edge, after) else 0.0)
        count = max(1, math.floor((end - start) / step)) if end > start else 0
        bend = (1.0 if edge.ccw else -1.0) / edge.radius if isinstance(edge, Arc) else 0.0
        for k in range(count):
            point = edge.at((start + (k + 0.5) * (end - start) / count) / edge.length)
            ux, uy = edge.direction(point)
            yield *point, uy, -ux, bend


def _is_sharp(edge: Edge) -> bool:
    return isinstance(edge, Arc) and edge.radius < SHARPEST


def _is_corner(before: Edge, after: Edge) -> bool:
    return _is_sharp(before) or _is_sharp(after) or abs(left_turn(before, after)) > TURN


def crossings(
    picture: ScanPicture, warp: Warp, samples: Samples, reach: float, expected: float = 0.0
) -> tuple[FloatArray, float]:
    """Return the distance of the film's edge outside each drawn edge, mm (NaN if none is visible),
    and the deviation of the picture's blur, mm.

    Of several edges along a normal, the one nearest to ``expected`` mm outside is used.
    """
    from scipy.ndimage import gaussian_filter1d, map_coordinates, median_filter

    step = 0.5 / float(np.hypot(*warp.axes.T).max())
    half = max(6, round(reach / step))
    offsets: FloatArray = np.arange(-half, half + 1, dtype=np.float64) * step
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
    widths = width[is_seen & np.isfinite(width)]
    # Smoothing is only across the edge, which does not move a curved edge.
    blur = float(np.median(widths)) / 2 if len(widths) else 0.0
    blur = math.sqrt(max(blur**2 - (SMOOTH * step) ** 2, 0.0))
    return outside + blur**2 / 2 * samples.curvatures, blur


def _passing(
    share: FloatArray, level: float, offsets: FloatArray, expected: FloatArray | float
) -> FloatArray:
    """The offset at which each row falls through a level, nearest to ``expected``, or NaN."""
    falls = (share[:, :-1] >= level) & (share[:, 1:] < level)
    with np.errstate(divide="ignore", invalid="ignore"):
        part = (share[:, :-1] - level) / (share[:, :-1] - share[:, 1:])
    at = np.where(falls, offsets[:-1] + part * (offsets[1] - offsets[0]), np.nan)
    centre = np.broadcast_to(np.nan_to_num(np.asarray(expected, dtype=float)), len(share))
    distance = np.where(falls, np.abs(at - centre[:, None]), np.inf)
    return np.take_along_axis(at, distance.argmin(axis=1)[:, None], axis=1)[:, 0]


@dataclass(frozen=True)
class EdgeFit:
    """Edges of a picture fitted to the cut file.

    ``outside`` by sample, mm, NaN if no edge is visible: distance of the film's edge beyond the
    drawn edge, at the displaced piece. Its common part is ``offset``; ``displacements`` (pieces, 3)
    are the displacements of pieces, mm along x and y and radians about their middle. A weight of 0
    in ``weights`` marks an outlier, not an edge of the piece. ``uncertainty``: the standard
    uncertainty of ``offset`` from the scatter between pieces, with ``degrees`` of freedom. ``blur``
    is the deviation of the picture's blur, mm.
    """

    samples: Samples
    warp: Warp
    outside: FloatArray
    weights: FloatArray
    offset: float
    uncertainty: float
    degrees: int
    displacements: FloatArray
    blur: float

    @property
    def residuals(self) -> FloatArray:
        """The residuals of the edges after the common offset, mm."""
        return self.outside - self.offset


def fitted(scan: Scan, location: Location) -> EdgeFit:
    """Return the fit of the edges in a picture with an approximately known location."""
    sheet = scan.sheet
    samples = samples_of([place.region for place in sheet.places], location.is_skeleton)
    degree = 3 if scan.is_camera and len(sheet.places) >= 6 else 1
    empty = np.zeros(((degree + 1) * (degree + 2) // 2, 2))
    warp = replace(location.warp, degree=degree, coefficients=empty)
    displacements = np.zeros((len(sheet.places), 3))
    looseness, offset = LOOSE, 0.0
    for reach in REACHES:
        laid = samples.moved(displacements)
        within = min(reach, 0.9 * sheet.spacing)
        outside, blur = crossings(scan.picture, warp, laid, within, offset)
        fit = _solved(laid, warp, outside, displacements, looseness)
        warp, offset, displacements = fit.warp, fit.offset, fit.displacements
        looseness = max(TIGHT, 1.5 * float(np.median(np.abs(displacements[:, :2]))))
    return replace(fit, samples=samples, blur=blur)


def _solved(
    laid: Samples, warp: Warp, outside: FloatArray, displacements: FloatArray, looseness: float
) -> EdgeFit:
    """Solve for the map, the offset and all displacements at once, with Tukey's weights."""
    matrix, arms = _matrix(laid, warp, len(displacements))
    first = matrix.shape[1] - displacements.size
    # All displacements are expected to be about equally small; a turn counts by the edge's motion.
    strength = np.zeros(matrix.shape[1])
    strength[first:] = np.column_stack([np.ones((len(arms), 2)), arms]).ravel()
    before = np.concatenate([np.zeros(first), displacements.ravel()])
    is_seen = np.isfinite(outside)
    outside = np.where(is_seen, outside, 0.0)
    weights = is_seen.astype(float)
    scale = float(np.median(np.abs(outside[is_seen]))) if is_seen.any() else 1.0
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
    towards = np.linalg.solve(normal, np.eye(len(normal))[0])
    pull = (towards * stiffness * (before + solution))[first:].reshape(-1, 3).sum(axis=1)
    uncertainty, degrees = _of_offset((matrix @ towards) * weights * residuals, pull, laid)
    change = solution[1:first].reshape(2, -1).T
    return EdgeFit(
        samples=laid,
        warp=replace(warp, coefficients=warp.coefficients + change),
        outside=np.where(is_seen, residuals + solution[0], np.nan),
        weights=weights,
        offset=float(solution[0]),
        uncertainty=uncertainty,
        degrees=degrees,
        displacements=displacements + solution[first:].reshape(-1, 3),
        blur=0.0,
    )


def _matrix(laid: Samples, warp: Warp, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the outward motion of each sample per unknown (offset, map, displacements), and the
    mean square of the motion by a rotation of each of ``count`` pieces, mm2.
    """
    arm = laid.points - laid.middles(count)[laid.pieces]
    turn = arm[:, 0] * laid.normals[:, 1] - arm[:, 1] * laid.normals[:, 0]
    monomials = warp.monomials(laid.points)
    moves = np.zeros((len(laid.points), count, 3))
    moves[np.arange(len(moves)), laid.pieces] = np.column_stack([laid.normals, turn])
    by_map = [monomials * laid.normals[:, axis : axis + 1] for axis in (0, 1)]
    arms = np.bincount(laid.pieces, turn**2, count) / laid.numbers(count)
    offset = np.ones((len(moves), 1))
    return np.hstack([offset, *by_map, moves.reshape(len(moves), -1)]), arms


def _of_offset(influence: FloatArray, pull: FloatArray, laid: Samples) -> tuple[float, int]:
    """Return the offset's standard uncertainty from the scatter between pieces, and its degrees of
    freedom.

    Errors within a piece are correlated and its displacement is one draw, so pieces are the
    clusters, or contours if there are few pieces (cluster-robust sandwich estimate).
    """
    if len(pull) < FEW:
        by_cluster: NDArray[Any] = np.bincount(laid.contours, influence)
    else:
        by_cluster = np.bincount(laid.pieces, influence, len(pull)) - pull
    degrees = max(len(by_cluster) - 1, 1)
    spread = math.sqrt(float((by_cluster**2).sum()) * len(by_cluster) / degrees)
    return spread, degrees


# The scale: the fit maps the cut file to the film, so a millimetre of the file is one of the film.
# An independent length gives the true length of that millimetre.


NEAR_LENGTH = 0.05  # largest relative error of a bar's length before it is measured
BAR_FILL = 0.9  # least share of its box that a bar fills
LEAST_PINS = 2
SEARCH = 0.45  # search range around a drawn edge, mm


@dataclass(frozen=True)
class Scale:
    """The ratio of true to drawn lengths along x and y, and its reference."""

    x: float
    y: float
    reference: str


def scale_of(scan: Scan, fit: EdgeFit) -> Scale:
    """Return the film's scale from the reference. Raises DesignError if that is not visible."""
    reference = scan.reference
    if reference.bar is not None:
        scale = _by_bar(scan, fit, reference.bar)
        return Scale(scale, scale, f"the bar of {reference.bar:g} mm")
    if reference.pins:
        scale = _by_pins(scan, fit)
        return Scale(scale, scale, f"{len(scan.sheet.pins)} pins")
    if reference.dpi is None:
        return Scale(1.0, 1.0, "none: taken from the cut file")
    x, y = np.hypot(*(fit.warp.axes / np.array(reference.dpi) * MILLIMETRES).T)
    dpi = " x ".join(dict.fromkeys(f"{each:.0f}" for each in reference.dpi))
    return Scale(float(x), float(y), f"{dpi} dpi")


def _by_bar(scan: Scan, fit: EdgeFit, length: float) -> float:
    parts = shapely.box(*scan.sheet.bounds)
    for outline in scan.outlines:
        bar = shapely.transform(outline.polygon, fit.warp.inverse)
        box = shapely.minimum_rotated_rectangle(bar)
        a, b, c, d = shapely.get_coordinates(box)[:4]
        if math.dist(a, b) < math.dist(b, c):
            a, b, c, d = b, c, d, a
        is_bar = abs(math.dist(a, b) / length - 1) < NEAR_LENGTH and bar.area > BAR_FILL * box.area
        if is_bar and not parts.contains(bar.centroid):
            samples = samples_of([polygon([(float(x), float(y)) for x, y in (a, b, c, d)])], False)
            outside, _ = crossings(scan.picture, fit.warp, samples, SEARCH)
            axis = (b - a) / math.dist(a, b)
            towards = samples.normals @ axis
            along = samples.points @ axis + towards * outside
            ends = [along[(s * towards > 0.9) & np.isfinite(outside)] for s in (1, -1)]
            if min(map(len, ends)) == 0:
                raise DesignError(
                    "--bar: its ends are not visible; lay it on the paper with square ends"
                )
            return length / float(np.median(ends[0]) - np.median(ends[1]))
    raise DesignError(
        f"--bar is {length:g} mm, and no bar of about that length lies beside the parts; lay a "
        "straight bar with square ends on the paper, clear of the film and the picture's border"
    )


def _by_pins(scan: Scan, fit: EdgeFit) -> float:
    pins = scan.sheet.pins
    if len(pins) < LEAST_PINS:
        raise DesignError(
            f"--pins needs {LEAST_PINS} pins of {scan.sheet.name} or more, but it has "
            f"{len(pins)}; give --dpi or --bar"
        )
    drawn = np.array([(x, y) for x, y, _ in pins])
    measured = np.array([_pin(scan.picture, fit, pin) for pin in pins])
    return math.sqrt(float(drawn.var(axis=0).sum() / measured.var(axis=0).sum()))


def _pin(picture: ScanPicture, fit: EdgeFit, pin: tuple[float, float, float]) -> PointArray:
    """Return the centre of a pin, in mm of the cut file."""
    x, y, diameter = pin
    samples = samples_of([disc((x, y), diameter / 2)], False)
    for _ in range(3):
        outside, _ = crossings(picture, fit.warp, samples, SEARCH)
        is_measured = np.isfinite(outside)
        if is_measured.mean() < 0.8:
            raise DesignError(
                f"the pin at x {x:g}, y {y:g} mm is not visible; give --dpi or --bar, or a picture "
                "with all pins"
            )
        columns = np.column_stack([samples.normals[is_measured], np.ones(is_measured.sum())])
        shift = np.linalg.lstsq(columns, outside[is_measured], rcond=None)[0][:2]
        samples = replace(samples, points=samples.points + shift)
    return np.asarray(samples.points.mean(axis=0))
