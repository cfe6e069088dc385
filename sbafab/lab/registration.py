"""Locate a cut sheet in a picture: the map from millimetres of the cut file to pixels.

Outlines are matched by position and area: each pair defines a similarity; the one with the most
matching outlines is refined to an affine map (scanner) or a homography (camera).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Any, Literal, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from sbafab.errors import DesignError
from sbafab.geometry.contour import Contour
from sbafab.lab.scan import Scan

PointArray = NDArray[np.float64]
"""x and y, (n, 2)."""
Complexes = NDArray[np.complexfloating[Any, Any]]
"""Points as x + iy, (n,)."""
Content = Literal["pieces", "skeleton"]
"""The content of the picture: pieces without the waste, or the sheet that they fell out of."""

ANCHORS = 8  # most pairs of contours to search
FEW = 6  # up to this many contours all pairs are searched
MOST_POSES = 6000
SAME_AREA = 0.25
"""Largest relative difference of matching areas, kerf included; twice as much for a camera."""
SAME_SCALE = 0.125  # largest relative difference from the scale by the resolution
LEAST_SHARE = 0.5  # least share of outlines that a picture of the sheet must show
ENOUGH = 0.97  # share of matched outlines at which the search for a better pose ends
SCALE_STEP = 0.01  # scale steps in which poses are ranked
SMALLEST = 0.2  # least area of a hole to search, mm2


@dataclass(frozen=True)
class Warp:
    """A map from mm of the cut file to pixels: a homography after a small polynomial one.

    ``base`` is (3, 3); ``coefficients`` (k, 2) in mm multiply the monomials up to ``degree`` of the
    position relative to ``centre``, in units of ``size``, mm.
    """

    base: NDArray[np.float64]
    centre: tuple[float, float]
    size: float
    degree: int
    coefficients: NDArray[np.float64]

    def __call__(self, points: PointArray) -> PointArray:
        """Return pixels, x and y, of points in mm."""
        return projected(self.base, points + self.monomials(points) @ self.coefficients)

    def monomials(self, points: PointArray) -> NDArray[np.float64]:
        """Return the values (n, k) of the monomials at points."""
        x, y = ((points - self.centre) / self.size).T
        powers = [(i, total - i) for total in range(self.degree + 1) for i in range(total + 1)]
        return np.column_stack([x**i * y**j for i, j in powers])

    @property
    def axes(self) -> NDArray[np.float64]:
        """The pixels per millimetre at the centre along x, and along y, (2, 2)."""
        at = self(np.array([(0.0, 0.0), (1e-3, 0.0), (0.0, 1e-3)]) + self.centre)
        return np.asarray((at[1:] - at[0]) * 1e3)

    @property
    def pixels_per_mm(self) -> float:
        """The pixels per millimetre at the centre."""
        return math.sqrt(abs(float(np.linalg.det(self.axes))))

    def inverse(self, pixels: PointArray) -> PointArray:
        """Return the points in mm at pixels."""
        aim = projected(np.linalg.inv(self.base), pixels)
        points = aim
        for _ in range(8):
            points = aim - self.monomials(points) @ self.coefficients
        return points


def projected(matrix: NDArray[Any], points: PointArray) -> PointArray:
    """Return the images of points under a homography."""
    after = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(after[:, :2] / after[:, 2:])


@dataclass(frozen=True)
class Location:
    """The map ``warp`` from the sheet to the picture, the picture's content, and ``matched`` of
    ``targets``, the number of drawn outlines with a match.

    ``from_below``: True if the sheet appears mirrored.
    """

    warp: Warp
    content: Content
    from_below: bool
    matched: int
    targets: int

    @property
    def is_skeleton(self) -> bool:
        return self.content == "skeleton"


def polyline(contour: Contour, step: float) -> Complexes:
    """Return points along a contour, at most ``step`` mm apart."""
    counts = [max(1, math.ceil(edge.length / step)) for edge in contour.edges]
    edges = zip(contour.edges, counts, strict=True)
    return np.array([edge.at(k / count) for edge, count in edges for k in range(count)]) @ (1, 1j)


def xy(points: Complexes) -> PointArray:
    return np.column_stack([points.real, points.imag])


def locate(scan: Scan) -> Location:
    """Return the sheet's location in a picture. Raises DesignError if it is not visible."""
    contents: tuple[Content, ...] = ("pieces", "skeleton")
    locations = [_Finder(scan, content).location() for content in contents]
    best = max(
        filter(None, locations), key=lambda at: round(at.matched / at.targets, 9), default=None
    )
    if best is None or best.matched < LEAST_SHARE * best.targets:
        shown = "none" if best is None else f"{best.matched} of {best.targets}"
        raise DesignError(
            f"the picture does not show {scan.sheet.name}: {shown} of its outlines match; check "
            f"--sheet{(', --dpi' if scan.reference.dpi else '')} and --paper, and that either "
            "the waste or the pieces are removed"
        )
    return best


class _Pose(NamedTuple):
    """A similarity as complex numbers: pixel = scale_turn * (z or its conjugate) + shift.

    Pixels count downward, so a sheet seen from above uses the conjugate.
    """

    scale_turn: complex
    shift: complex
    from_below: bool

    def __call__(self, z: Complexes) -> Complexes:
        return self.scale_turn * (z if self.from_below else z.conj()) + self.shift

    @property
    def tilt(self) -> float:
        """The angle from upright, rad."""
        return abs(float(np.angle(self.scale_turn * (-1 if self.from_below else 1))))

    @property
    def matrix(self) -> NDArray[np.float64]:
        origin, x, y = self(np.array([0, 1, 1j]))
        rows = np.array([x - origin, y - origin, origin])
        return np.array([rows.real, rows.imag, (0.0, 0.0, 1.0)])


class _Finder:
    """Matches between the outlines of a picture and the visible contours of a sheet."""

    def __init__(self, scan: Scan, content: Content) -> None:
        self.scan, self.content, self.scale = scan, content, scan.reference.pixels_per_mm
        is_pieces = content == "pieces"
        # A skeleton shows no holes of pieces.
        contours = [
            contour
            for place in scan.sheet.places
            for contour in place.region.contours
            if not contour.is_hole or (is_pieces and -contour.area > SMALLEST)
        ]
        drawn = shapely.centroid([shapely.Polygon(xy(polyline(c, 0.05))) for c in contours])
        self.places = shapely.get_coordinates(drawn) @ (1, 1j)
        self.areas = np.array([abs(contour.area) for contour in contours])
        self.is_film = np.array([contour.is_hole != is_pieces for contour in contours])
        polygons = [outline.polygon for outline in scan.outlines]
        self.seen = shapely.get_coordinates(shapely.centroid(polygons)) @ (1, 1j)
        self.seen_areas = shapely.area(polygons)
        self.seen_film = np.array([each.is_light == scan.is_light for each in scan.outlines])
        spread = float(np.abs(self.places - self.places.mean()).max())
        # Residual of a similarity due to perspective, or tilt and unequal scales.
        self.reach = max(0.5, (0.035 if scan.is_camera else 0.006) * spread)
        self.same_area = SAME_AREA * (2 if scan.is_camera else 1)

    def location(self) -> Location | None:
        """Return the sheet's location with this content; None if no outline fits."""
        best: tuple[tuple[float, ...], _Pose] | None = None
        for pose in self._poses() if len(self.seen) else ():
            pixels = pose(self.places)
            matched = int((self._matches(self.reach, pixels, abs(pose.scale_turn)) >= 0).sum())
            off = 0.0 if self.scale is None else abs(abs(pose.scale_turn) / self.scale - 1)
            # A row of equal pieces also fits one place further, except for the picture's border.
            unlike = self._outside(pixels), pose.from_below, round(off / SCALE_STEP), pose.tilt
            rank = -matched, *unlike
            if best is None or rank < best[0]:
                best = rank, pose
                if matched >= ENOUGH * len(self.places) and not pose.from_below:
                    break
        return None if best is None else self._refined(best[1])

    def _outside(self, pixels: Complexes) -> int:
        """Return the number of places outside the picture."""
        (rows, columns), x, y = self.scan.picture.pixels.shape, pixels.real, pixels.imag
        return int(((x < 0) | (y < 0) | (x > columns) | (y > rows)).sum())

    def _poses(self) -> Iterator[_Pose]:
        poses = [pose for pair in self._pairs() for pose in self._poses_of(*pair)]
        # A scan is hardly tilted: most likely poses first.
        poses.sort(key=lambda pose: (pose.from_below, abs(float(np.angle(pose.scale_turn)))))
        if len(self.places) == 1 or not poses:
            yield from self._single_poses()
        yield from poses[:MOST_POSES]

    def _pairs(self) -> list[tuple[int, int]]:
        """Return pairs of large contours that are far apart."""
        large = np.argsort(-self.areas)[: 3 * ANCHORS].tolist()
        if len(large) <= FEW:
            return list(combinations(large, 2))
        places = self.places[large]
        farthest = [large[int(np.abs(places - self.places[i]).argmax())] for i in large]
        pairs = list(dict.fromkeys(map(frozenset, zip(large, farthest, strict=True))))
        step = max(1, len(pairs) // ANCHORS)
        return [(min(pair), max(pair)) for pair in pairs[::step][:ANCHORS] if len(pair) == 2]

    def _poses_of(self, first: int, second: int) -> Iterator[_Pose]:
        """Yield the similarities that map two contours to two outlines of matching areas."""
        across = self.places[second] - self.places[first]
        apart = self.seen[None, :] - self.seen[:, None]
        stretch = np.abs(apart) / abs(across)
        fits = (self.seen_film == self.is_film[first])[:, None] & (stretch > 0)
        fits &= (self.seen_film == self.is_film[second])[None, :]
        with np.errstate(divide="ignore", invalid="ignore"):
            for areas, contour in ((self.seen_areas[:, None], first), (self.seen_areas, second)):
                fits &= np.abs(areas / self.areas[contour] / stretch**2 - 1) < self.same_area
        if self.scale is not None:
            fits &= np.abs(stretch / self.scale - 1) < SAME_SCALE
        for (i, j), from_below in product(zip(*np.nonzero(fits), strict=True), (False, True)):
            turn = _Pose(1 + 0j, 0j, from_below)
            scale_turn = complex(apart[i, j] / turn(across))
            shift = complex(self.seen[i] - scale_turn * turn(self.places[first]))
            yield _Pose(scale_turn, shift, from_below)

    def _single_poses(self) -> Iterator[_Pose]:
        """Yield upright poses of a sheet with a single outline, on outlines of that tone."""
        largest = int(self.areas.argmax())
        for k in np.nonzero(self.seen_film == self.is_film[largest])[0][:20]:
            scale = math.sqrt(self.seen_areas[k] / self.areas[largest])
            if self.scale is not None and abs(scale / self.scale - 1) > SAME_SCALE:
                continue
            for turned in (scale, 1j * scale, -scale, -1j * scale):
                shift = self.seen[k] - turned * self.places[largest].conjugate()
                yield _Pose(complex(turned), complex(shift), False)

    def _matches(self, reach: float, pixels: Complexes, per_mm: float) -> NDArray[np.int64]:
        """Return the index of the nearest fitting outline of each contour, or -1."""
        distance = np.abs(pixels[:, None] - self.seen)
        ratio = self.seen_areas / (self.areas[:, None] * per_mm**2)
        # The kerf enlarges a small hole by a larger share.
        room = self.same_area + 1.2 / np.sqrt(self.areas[:, None])
        distance[(np.abs(ratio - 1) > room) | (self.seen_film != self.is_film[:, None])] = np.inf
        return np.where(distance.min(axis=1) < reach * per_mm, distance.argmin(axis=1), -1)

    def _refined(self, pose: _Pose) -> Location:
        """Return the location from an affine map or a homography of matched centroids."""
        low_x, low_y, high_x, high_y = self.scan.sheet.bounds
        centre = (low_x + high_x) / 2, (low_y + high_y) / 2
        size = max(high_x - low_x, high_y - low_y) / 2
        warp = Warp(pose.matrix, centre, size, 0, np.zeros((1, 2)))
        points = xy(self.places)
        matches = self._matches(self.reach, pose(self.places), abs(pose.scale_turn))
        for reach in (self.reach, self.reach, 0.5 * self.reach, max(0.4, 0.25 * self.reach)):
            is_matched = matches >= 0
            base = self._fitted(points[is_matched], xy(self.seen[matches[is_matched]]))
            warp = warp if base is None else replace(warp, base=base)
            matches = self._matches(reach, warp(points) @ (1, 1j), warp.pixels_per_mm)
        matched = int((matches >= 0).sum())
        return Location(warp, self.content, pose.from_below, matched, len(self.places))

    def _fitted(self, points: PointArray, pixels: PointArray) -> NDArray[np.float64] | None:
        """Return the map of points to pixels by least squares; None for collinear points."""
        from skimage import transform

        if len(points) < 3:
            return None
        arms = points - points.mean(axis=0)
        if np.linalg.matrix_rank(arms, tol=0.02 * np.ptp(points, axis=0).max()) < 2:
            return None
        kind = "projective" if self.scan.is_camera and len(points) >= 6 else "affine"
        estimate_transform: Any = transform.estimate_transform
        return np.asarray(estimate_transform(kind, points, pixels).params)
