"""Locate a cut sheet in a picture: the map from millimetres of the cut file to pixels.

Outlines are matched by position and area: each pair gives a similarity; the one with the most
matching outlines is refined to an affine map (scanner) or a homography (camera).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import DesignError
from sbafab.geometry.contour import Contour
from sbafab.lab.cut_sheet import DrawnSheet
from sbafab.lab.picture import PictureOutline, moments

PointArray = NDArray[np.float64]
"""x and y, (n, 2)."""
SheetSide = Literal["film", "void"]
"""The inside of a contour."""
Content = Literal["pieces", "skeleton"]
"""The content of the picture: pieces without the waste, or the sheet that they fell out of."""

ANCHORS = 8
"""Most pairs of contours to search."""
FEW = 6
"""Up to this many contours all pairs are searched."""
MOST_POSES = 6000
SAME_AREA = 0.25
"""Largest relative difference of matching areas, kerf included; twice as much for a camera."""
LEAST_SHARE = 0.5
"""Least share of outlines that a picture of the sheet must show."""
ENOUGH = 0.97
"""Share of matched outlines at which the search for a better pose ends."""
SCALE_STEP = 0.01
"""Scale steps in which poses are ranked."""
CORNER_STEPS = np.array([(0.0, 0.0), (1e-3, 0.0), (0.0, 1e-3)])
"""Step along x and along y for derivatives, mm."""
SMALLEST = 0.2
"""Least area of a hole to search, mm2."""


@dataclass(frozen=True)
class Warp:
    """A map from mm of the cut file to pixels: a homography after a small polynomial one.

    ``base`` (3, 3); ``coefficients`` (k, 2) in mm are of the monomials up to ``degree`` of the
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

    def pixels_per_mm(self, point: PointArray) -> tuple[float, float]:
        """Return the size in pixels of a millimetre along x, and along y, at a point."""
        steps = point + CORNER_STEPS
        at, beside, above = self(steps)
        return float(np.hypot(*(beside - at)) * 1e3), float(np.hypot(*(above - at)) * 1e3)

    def inverse(self, pixels: PointArray) -> PointArray:
        """Return the points in mm of pixels."""
        back: NDArray[np.float64] = np.asarray(np.linalg.inv(self.base), dtype=np.float64)
        aim = projected(back, pixels)
        points = aim
        for _ in range(8):
            points = aim - self.monomials(points) @ self.coefficients
        return points


def projected(matrix: NDArray[np.float64], points: PointArray) -> PointArray:
    """Return the images of points under a homography."""
    after = points @ matrix[:, :2].T + matrix[:, 2]
    return after[:, :2] / after[:, 2:]


class Target(NamedTuple):
    """A contour to search: its centroid in mm, area in mm2 and its inside."""

    centroid: tuple[float, float]
    area: float
    side: SheetSide


@dataclass(frozen=True)
class Location:
    """``warp`` from the sheet to the picture, the picture's content, and the matched outlines.

    ``from_below``: True if the sheet appears mirrored. ``is_light``: True if film is lighter than
    paper.
    """

    warp: Warp
    content: Content
    from_below: bool
    is_light: bool
    matched: int
    targets: int


def targets_of(sheet: DrawnSheet, content: Content) -> list[Target]:
    """Return the contours visible in a picture of a sheet: a skeleton shows no holes of pieces."""
    contours = [contour for place in sheet.places for contour in place.region.contours]
    side: SheetSide = "film" if content == "pieces" else "void"
    shown = [c for c in contours if not c.is_hole or (content == "pieces" and -c.area > SMALLEST)]
    return [
        Target(centroid_of(contour), abs(contour.area), "void" if contour.is_hole else side)
        for contour in shown
    ]


def centroid_of(contour: Contour) -> tuple[float, float]:
    if contour.circle is not None:
        return contour.circle[0]
    _, (x, y) = moments(polyline(contour, 0.05))
    return float(x), float(y)


def polyline(contour: Contour, step: float) -> PointArray:
    """Return points along a contour, at most ``step`` mm apart."""
    return np.array(
        [
            edge.at(k / count)
            for edge in contour.edges
            for count in [max(1, math.ceil(edge.length / step))]
            for k in range(count)
        ]
    )


@dataclass(frozen=True)
class _Pose:
    """A similarity as complex numbers: pixel = scale_turn * (z or its conjugate) + shift.

    Pixels count downward, so a sheet seen from above uses the conjugate.
    """

    scale_turn: complex
    shift: complex
    from_below: bool

    def __call__(self, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return self.scale_turn * (z if self.from_below else z.conj()) + self.shift

    @property
    def matrix(self) -> NDArray[np.float64]:
        a, b = self.scale_turn.real, self.scale_turn.imag
        turned = [[a, -b], [b, a]] if self.from_below else [[a, b], [b, -a]]
        return np.array(
            [[*turned[0], self.shift.real], [*turned[1], self.shift.imag], [0.0, 0.0, 1.0]]
        )


def locate(
    sheet: DrawnSheet,
    measured: Sequence[PictureOutline],
    size: tuple[int, int],
    pixels_per_mm: float | None,
    is_light: bool,
    is_camera: bool,
) -> Location:
    """Return the sheet's location in a picture of ``size``, rows and columns.

    ``is_light``: film is lighter than paper. ``is_camera``: with perspective. Raises DesignError if
    the picture does not show the sheet.
    """
    best: tuple[float, Location] | None = None
    contents: tuple[Content, ...] = ("pieces", "skeleton")
    for content in contents:
        targets = targets_of(sheet, content)
        finder = _Finder(targets, measured, size, pixels_per_mm, is_light, is_camera)
        pose = finder.best_pose()
        if pose is None:
            continue
        location = finder.refined(pose, sheet, content)
        share = location.matched / location.targets
        if best is None or share > best[0] + 1e-9:
            best = share, location
    if best is None or best[0] < LEAST_SHARE:
        shown = "none" if best is None else f"{best[1].matched} of {best[1].targets}"
        raise DesignError(
            f"the picture does not show {sheet.name}: {shown} of its outlines match; check --sheet"
            f"{', --dpi' if pixels_per_mm else ''} and --paper, and that the waste is lifted off, "
            "or the pieces are"
        )
    return best[1]


class _Finder:
    """Matches of the outlines of a picture with targets."""

    def __init__(
        self,
        targets: Sequence[Target],
        measured: Sequence[PictureOutline],
        size: tuple[int, int],
        pixels_per_mm: float | None,
        is_light: bool,
        is_camera: bool,
    ) -> None:
        self.targets = targets
        self.rows, self.columns = size
        self.scale = pixels_per_mm
        self.is_light = is_light
        self.is_camera = is_camera
        self.places = np.array([complex(*target.centroid) for target in targets])
        self.areas = np.array([target.area for target in targets])
        self.is_film = np.array([target.side == "film" for target in targets])
        self.measured = measured
        self.measured_places = np.array([complex(*outline.centroid) for outline in measured])
        self.measured_areas = np.array([outline.area for outline in measured])
        self.measured_film = np.array([outline.is_light == is_light for outline in measured])
        spread = np.abs(self.places - self.places.mean()).max()
        # Residual of a similarity due to perspective, or tilt and unequal scales.
        self.reach = max(0.5, (0.035 if is_camera else 0.006) * float(spread))
        self.same_area = SAME_AREA * (2 if is_camera else 1)

    def best_pose(self) -> _Pose | None:
        if not self.measured:
            return None
        best: tuple[tuple[int, int, bool, int, float], _Pose] | None = None
        for pose in self._poses():
            pixels = pose(self.places)
            matched = int((self._matches(self.reach, pixels, pose.scale_turn) >= 0).sum())
            upright = pose.scale_turn if not pose.from_below else -pose.scale_turn
            # A row of equal pieces also fits one place further, except for the picture's border.
            angle = abs(float(np.angle(upright)))
            off = 0.0 if self.scale is None else abs(abs(pose.scale_turn) / self.scale - 1)
            unlike = -self._outside(pixels), not pose.from_below, -round(off / SCALE_STEP)
            rank = matched, *unlike, -angle
            if best is None or rank > best[0]:
                best = rank, pose
                if matched >= ENOUGH * len(self.targets) and not pose.from_below:
                    break
        return None if best is None else best[1]

    def _outside(self, pixels: NDArray[np.complex128]) -> int:
        """Return the number of places outside the picture."""
        x, y = pixels.real, pixels.imag
        return int(((x < 0) | (y < 0) | (x > self.columns) | (y > self.rows)).sum())

    def _poses(self) -> Iterator[_Pose]:
        poses = [pose for pair in self._pairs() for pose in self._poses_of(*pair)]
        # A scan is hardly tilted: most likely poses first.
        poses.sort(key=lambda pose: (pose.from_below, abs(float(np.angle(pose.scale_turn)))))
        if len(self.targets) == 1 or not poses:
            yield from self._single_poses()
        yield from poses[:MOST_POSES]

    def _pairs(self) -> list[tuple[int, int]]:
        """Return pairs of large targets far apart, each target at most twice."""
        large = np.argsort(-self.areas)[: 3 * ANCHORS]
        if len(large) <= FEW:
            return [(int(i), int(j)) for i, j in combinations(large, 2)]
        pairs: list[tuple[int, int]] = []
        for first in large:
            distances = np.abs(self.places[large] - self.places[first])
            other = int(large[int(distances.argmax())])
            if distances.max() > 1e-6 and (other, int(first)) not in pairs:
                pairs.append((int(first), other))
        step = max(1, len(pairs) // ANCHORS)
        return pairs[::step][:ANCHORS]

    def _poses_of(self, first: int, other: int) -> Iterator[_Pose]:
        """Yield the similarities that map two targets to two outlines of matching areas."""
        across = self.places[other] - self.places[first]
        apart = self.measured_places[None, :] - self.measured_places[:, None]
        stretch = np.abs(apart) / abs(across)
        with np.errstate(divide="ignore", invalid="ignore"):
            fits = stretch > 0
            for ratio in (
                self.measured_areas[:, None] / self.areas[first] / stretch**2,
                self.measured_areas[None, :] / self.areas[other] / stretch**2,
            ):
                fits &= np.abs(ratio - 1) < self.same_area
        fits &= (self.measured_film == self.is_film[first])[:, None]
        fits &= (self.measured_film == self.is_film[other])[None, :]
        if self.scale is not None:
            fits &= np.abs(stretch / self.scale - 1) < 0.5 * SAME_AREA
        for i, j in zip(*np.nonzero(fits), strict=True):
            for from_below in (False, True):
                along = across if from_below else across.conjugate()
                start = self.places[first] if from_below else self.places[first].conjugate()
                scale_turn = complex(apart[i, j] / along)
                shift = complex(self.measured_places[i] - scale_turn * start)
                yield _Pose(scale_turn, shift, from_below)

    def _single_poses(self) -> Iterator[_Pose]:
        """Yield upright poses of a sheet with a single outline, on outlines of that tone."""
        largest = int(self.areas.argmax())
        for k in np.nonzero(self.measured_film == self.is_film[largest])[0][:20]:
            scale = math.sqrt(self.measured_areas[k] / self.areas[largest])
            if self.scale is not None and abs(scale / self.scale - 1) > 0.5 * SAME_AREA:
                continue
            for quarter in (1, 1j, -1, -1j):
                turned = scale * quarter
                shift = self.measured_places[k] - turned * self.places[largest].conjugate()
                yield _Pose(complex(turned), complex(shift), False)

    def _matches(
        self, reach: float, pixels: NDArray[np.complex128], scale: complex
    ) -> NDArray[np.int64]:
        """Return the index of the nearest fitting outline of each target, or -1."""
        per_mm = abs(scale)
        distance = np.abs(pixels[:, None] - self.measured_places[None, :])
        ratio = self.measured_areas[None, :] / (self.areas[:, None] * per_mm**2)
        # The kerf enlarges a small hole by a larger share.
        room = self.same_area + 1.2 / np.sqrt(self.areas[:, None])
        misfit = (np.abs(ratio - 1) > room) | (self.measured_film[None, :] != self.is_film[:, None])
        distance[misfit] = np.inf
        nearest = distance.argmin(axis=1)
        is_near = distance[np.arange(len(nearest)), nearest] < reach * per_mm
        return np.where(is_near, nearest, -1)

    def refined(self, pose: _Pose, sheet: DrawnSheet, content: Content) -> Location:
        """Return the location by an affine map or a homography of matched centroids."""
        low_x, low_y, high_x, high_y = sheet.bounds
        centre = (low_x + high_x) / 2, (low_y + high_y) / 2
        warp = Warp(
            pose.matrix, centre, max(high_x - low_x, high_y - low_y) / 2, 0, np.zeros((1, 2))
        )
        points = np.column_stack([self.places.real, self.places.imag])
        matches = self._matches(self.reach, pose(self.places), pose.scale_turn)
        for reach in (self.reach, self.reach, 0.5 * self.reach, max(0.4, 0.25 * self.reach)):
            known = matches >= 0
            if known.sum() >= 3:
                measured = self.measured_places[matches[known]]
                pixels = np.column_stack([measured.real, measured.imag])
                base = _fitted(points[known], pixels, self.is_camera)
                warp = warp if base is None else replace(warp, base=base)
            at = warp(points)
            matches = self._matches(reach, at[:, 0] + 1j * at[:, 1], complex(self._scale_at(warp)))
        return Location(
            warp=warp,
            content=content,
            from_below=pose.from_below,
            is_light=self.is_light,
            matched=int((matches >= 0).sum()),
            targets=len(self.targets),
        )

    def _scale_at(self, warp: Warp) -> float:
        return math.sqrt(math.prod(warp.pixels_per_mm(np.array(warp.centre))))


def _fitted(points: PointArray, pixels: PointArray, is_camera: bool) -> NDArray[np.float64] | None:
    """Return the affine map, or the homography, of points to pixels by least squares."""
    centre, size = points.mean(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-9)
    x, y = ((points - centre) / size).T
    one, none = np.ones_like(x), np.zeros_like(x)
    if np.linalg.matrix_rank(np.column_stack([x, y, one]), tol=0.02) < 3:
        return None
    middle = pixels.mean(axis=0)
    spread = max(float(np.ptp(pixels, axis=0).max()), 1e-9)
    u, v = ((pixels - middle) / spread).T
    if is_camera and len(points) >= 6:
        rows = np.vstack(
            [
                np.column_stack([x, y, one, none, none, none, -u * x, -u * y]),
                np.column_stack([none, none, none, x, y, one, -v * x, -v * y]),
            ]
        )
        solved: Any = np.linalg.lstsq(rows, np.concatenate([u, v]), rcond=None)[0]
        matrix = np.append(solved, 1.0).reshape(3, 3)
    else:
        solved = np.linalg.lstsq(np.column_stack([x, y, one]), np.column_stack([u, v]), rcond=None)
        matrix = np.vstack([solved[0].T, [0.0, 0.0, 1.0]])
    to_unit = np.array([[1, 0, -centre[0]], [0, 1, -centre[1]], [0, 0, size]]) / size
    to_pixels = np.array([[spread, 0, middle[0]], [0, spread, middle[1]], [0, 0, 1]])
    return np.asarray(to_pixels @ matrix @ to_unit)
