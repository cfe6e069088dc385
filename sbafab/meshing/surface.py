"""Triangulated surfaces, and the check that they are closed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import manifold3d
    import trimesh

Vector = tuple[float, float, float]
"""A point or displacement in space, mm, or a direction."""
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangulated surface.

    ``points`` (n, 3) float64 in mm; ``faces`` (m, 3) int64 indices of points, counter-clockwise
    seen from outside.
    """

    points: Floats
    faces: Ints

    @cached_property
    def volume(self) -> float:
        """The enclosed volume in mm3."""
        a, b, c = self.points.take(self.faces.T, axis=0)
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)

    def trimesh(self) -> trimesh.Trimesh:
        """Return the surface for trimesh, with its points and faces in the same order."""
        import trimesh

        return trimesh.Trimesh(self.points, self.faces, process=False)

    def manifold(self) -> manifold3d.Manifold:
        """Return the solid inside a closed surface."""
        from manifold3d import Manifold, Mesh64

        faces = np.ascontiguousarray(self.faces.astype(np.uint64))
        return Manifold(Mesh64(np.ascontiguousarray(self.points), faces))


def open_edges(surface: Surface) -> Floats:
    """Return midpoints (k, 3) in mm of the edges that do not join exactly two consistently oriented
    faces.

    Points are merged as in a single-precision file. Empty for a watertight surface.
    """
    wrong = unpaired_edges(_merged(surface.points)[surface.faces])
    starts = surface.faces.ravel()[wrong]
    ends = np.roll(surface.faces, -1, axis=1).ravel()[wrong]
    middles: Floats = (surface.points[starts] + surface.points[ends]) / 2
    return middles


def unpaired_edges(faces: Ints) -> Ints:
    """Return the indices, in the flattened corners of faces (m, 3), at which an edge starts that
    does not join exactly two consistently oriented faces.
    """
    size = int(faces.max(initial=0)) + 1
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    # One key per edge; its last bit is the direction, so sorting puts opposite edges side by side.
    low, high = np.minimum(tails, heads), np.maximum(tails, heads)
    keys = np.sort((low * size + high) * 2 + (tails > heads))
    ways = keys[::2]
    is_paired = len(keys) == 2 * len(ways) and not np.any(ways & 1)
    if is_paired and np.array_equal(keys[1::2], ways + 1) and np.all(ways[1:] != ways[:-1]):
        return np.empty(0, dtype=np.int64)
    forth, back = tails * size + heads, heads * size + tails
    once, first, times = np.unique(forth, return_index=True, return_counts=True)
    wrong: Ints = first[(times != 1) | ~np.isin(once, back)]
    return wrong


def _merged(points: Floats) -> Ints:
    """Return a number for each point (n,), equal for points that coincide in single precision."""
    # Compare the bits of four-byte numbers; adding 0 turns -0 into 0.
    x, y, z = (points.astype(np.float32) + np.float32(0)).view(np.uint32).T.astype(np.uint64)
    half = np.uint64(32)
    in_plan = np.unique(x << half | y, return_inverse=True)[1].astype(np.uint64)
    return np.unique(in_plan << half | z, return_inverse=True)[1].astype(np.int64)
