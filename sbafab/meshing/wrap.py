"""A flat laminate bent round its tube: x becomes the circumference, z the radial direction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Surface, Vector

SAGITTA = 0.008
"""mm by which a facet of a bent film may deviate from its cylinder; a fifth of a film."""
SNAP = 1e-3
"""mm: a point this close to a cut counts as on it, to avoid slivers."""


RAMP = 1.5
"""mm round the tube within which an overlapping end of the sheet climbs onto the other end."""


class TubeWrap(NamedTuple):
    """Placement of a laminate round its tube, whose axis is z.

    ``radius`` is the tube's; lengths ``neutral`` mm above it, in the middle of the sheet, are
    kept. An overlapping sheet is raised by ``thickness`` at and past x = ``seam``; ``cuts`` are
    the x at which a solid is cut, so that its facets follow the tube. All mm.
    """

    radius: float
    neutral: float
    seam: float
    thickness: float
    cuts: tuple[float, ...]

    def placed(
        self, points: NDArray[np.float64], middle: float = 0.0, share: ArrayLike = 1.0
    ) -> NDArray[np.float64]:
        """Points (n, 3) of the flat laminate, z from the tube's surface, round the tube.

        A body fixed at x = ``middle`` may be bent by a ``share`` of the tube's curvature: 0 leaves
        it straight, on the tangent.
        """
        x, y, z = points.T
        angle, at = self.angle(x, middle, share), middle / (self.radius + self.neutral)
        bend = np.asarray(share, dtype=float) / self.radius
        safe = np.where(bend > 0, bend, 1.0)
        # 2 sin^2(a/2) / bend is (1 - cos a) / bend without its cancellation.
        sag = np.where(bend > 0, 2 * np.sin(angle / 2) ** 2 / safe, 0.0)
        sine = np.where(bend > 0, np.sin(angle) / safe, x - middle)
        out, aside = self.radius + z * np.cos(angle) - sag, sine + z * np.sin(angle)
        cos, sin = math.cos(at), math.sin(at)
        return np.column_stack([out * cos - aside * sin, out * sin + aside * cos, y])

    def angle(
        self, x: NDArray[np.float64], middle: float = 0.0, share: ArrayLike = 1.0
    ) -> NDArray[np.float64]:
        """Angle in radians by which a body leans at x, relative to its fixed point."""
        bend = np.asarray(share, dtype=float) / self.radius
        angle: NDArray[np.float64] = bend * (x - middle) / (1 + bend * self.neutral)
        return angle

    def raised(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height in mm by which the sheet is lifted by its overlapping end."""
        return self.thickness * np.clip((x - self.seam) / RAMP + 1, 0, 1)


def tube_wrap(laminate: Laminate) -> TubeWrap | None:
    """Return the placement of a laminate round its tube, or None for one without a tube."""
    if laminate.tube is None:
        return None
    sheet = laminate.tpe_layers[0]
    radius, neutral = laminate.tube / 2, sheet.film.thickness / 2
    low, _, high, _ = sheet.profile.bounds
    # A full turn of the sheet, less the maximum width of a solid's facets.
    seam = low + math.tau * (radius + neutral) - RAMP
    step = math.sqrt(8 * radius * SAGITTA)
    cuts = tuple(number * step for number in range(math.ceil(low / step), math.ceil(high / step)))
    return TubeWrap(
        radius, neutral, seam, 2 * (neutral + SAGITTA) if high > seam + RAMP else 0.0, cuts
    )


def wrapped(surface: Surface, wrap: TubeWrap) -> Surface:
    """The surface of a flat laminate, already cut at ``wrap.cuts``, wrapped round its tube."""
    x, y, z = surface.points.T
    return Surface(wrap.placed(np.column_stack([x, y, z + wrap.raised(x)])), surface.faces)


def bent_point(p: Vector, radius: float) -> Vector:
    """Return where a point of the flat laminate lies round a tube of this radius about z."""
    angle, r = p[0] / radius, radius + p[2]
    return r * math.cos(angle), r * math.sin(angle), p[1]


def bent(surface: Surface, radius: float, sagitta: float = SAGITTA) -> Surface:
    """The surface bent round a tube, first cut along the tube so that its facets follow it.

    Lengths at z = 0 are kept; points above are stretched round the tube, like films on it.
    """
    step = math.sqrt(8 * radius * sagitta)
    low, high = surface.points[:, 0].min(), surface.points[:, 0].max()
    first, last = math.floor(low / step) + 1, math.ceil(high / step)
    for number in range(first, last):
        surface = cut_along(surface, number * step)
    x, y, z = surface.points.T
    angle, r = x / radius, radius + z
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle), y])
    return Surface(points, surface.faces)


def cut_along(surface: Surface, x: float) -> Surface:
    """Return the surface with edges along its intersection with the plane at this x."""
    offset = surface.points[:, 0] - x
    side = np.sign(np.where(np.abs(offset) < SNAP, 0.0, offset)).astype(np.int8)
    sides = side[surface.faces]
    crossed = (sides.min(axis=1) < 0) & (sides.max(axis=1) > 0)
    if not crossed.any():
        return surface
    faces, sides = surface.faces[crossed], sides[crossed]
    # Rotate the corners: first the one alone on its side, or the one on the plane.
    on_plane = (sides == 0).any(axis=1)
    alone = np.where(sides.sum(axis=1) > 0, -1, 1)
    first_side = np.where(on_plane, 0, alone)
    start = (sides == first_side[:, None]).argmax(axis=1)
    faces = np.take_along_axis(faces, (start[:, None] + np.arange(3)) % 3, axis=1)
    points, middle = _crossings(surface.points, offset, faces, on_plane)
    a, b, c = faces.T
    ab, bc, ca = middle
    split = [
        _rows(a, b, bc)[on_plane],
        _rows(a, bc, c)[on_plane],
        _rows(a, ab, ca)[~on_plane],
        _rows(ab, b, c)[~on_plane],
        _rows(ab, c, ca)[~on_plane],
    ]
    return Surface(points, np.concatenate([surface.faces[~crossed], *split]))


def _rows(*columns: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.column_stack(columns)


def _crossings(
    points: NDArray[np.float64],
    offset: NDArray[np.float64],
    faces: NDArray[np.int64],
    on_plane: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], tuple[NDArray[np.int64], ...]]:
    """The points plus the crossings of edges, and the crossings' indices by edge of the faces."""
    a, b, c = faces.T
    sets = [(a, b, ~on_plane), (b, c, on_plane), (c, a, ~on_plane)]
    ends = np.concatenate([np.column_stack([p, q])[use] for p, q, use in sets])
    ends.sort(axis=1)
    edges, inverse = np.unique(ends, axis=0, return_inverse=True)
    low, high = edges.T
    share = offset[low] / (offset[low] - offset[high])
    added = points[low] + share[:, None] * (points[high] - points[low])
    indices = len(points) + inverse.ravel()
    middle, done = [], 0
    for _, _, use in sets:
        column = np.full(len(faces), -1, dtype=np.int64)
        count = int(use.sum())
        column[use] = indices[done : done + count]
        done += count
        middle.append(column)
    return np.concatenate([points, added]), tuple(middle)
