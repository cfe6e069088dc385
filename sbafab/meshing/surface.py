"""Triangulated surfaces, and the check that they are closed."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from sbafab.errors import DesignError

if TYPE_CHECKING:
    import numpy as np
    import trimesh
    from numpy.typing import NDArray

Vector = tuple[float, float, float]
"""A point or a way in space, mm, or a direction."""


class Surface(NamedTuple):
    """A triangulated surface.

    ``points`` (n, 3) float64 in mm; ``faces`` (m, 3) int64 indices of points, counter-clockwise
    seen from outside.
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int64]

    @property
    def volume(self) -> float:
        """Enclosed volume in mm3."""
        import numpy as np

        a, b, c = (self.points[self.faces[:, corner]] for corner in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)

    def trimesh(self) -> trimesh.Trimesh:
        """The surface for trimesh (extra "python"). Raises DesignError where it is missing."""
        try:
            import trimesh
        except ImportError as error:
            hint = 'add it with pip install "sbafab[python]"'
            raise DesignError(f"trimesh is not installed; {hint}") from error
        return trimesh.Trimesh(self.points, self.faces, process=False)


def open_edges(surface: Surface) -> NDArray[np.float64]:
    """Middles (k, 3) in mm of the edges that do not join exactly two faces of like turn.

    Points are merged as a single-precision file merges them. Empty for a watertight surface.
    """
    import numpy as np

    size = len(surface.points)
    merged = np.zeros(size, dtype=np.int64)
    for axis in surface.points.astype(np.float32).T:
        ranks = np.unique(axis, return_inverse=True)[1]
        merged = np.unique(merged * size + ranks, return_inverse=True)[1]
    faces = merged[surface.faces]
    tails = faces.ravel()
    heads = np.roll(faces, -1, axis=1).ravel()
    forth, back = tails * size + heads, heads * size + tails
    ordered = np.sort(forth)
    if np.array_equal(ordered, np.sort(back)) and np.all(ordered[1:] != ordered[:-1]):
        return np.empty((0, 3))
    once, first, times = np.unique(forth, return_index=True, return_counts=True)
    wrong = first[(times != 1) | ~np.isin(once, back)]
    starts = surface.faces.ravel()[wrong]
    ends = np.roll(surface.faces, -1, axis=1).ravel()[wrong]
    middles: NDArray[np.float64] = (surface.points[starts] + surface.points[ends]) / 2
    return middles
