"""Where the films stand: flat, or lifted off each other by air."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from sbafab.meshing.conforming.layup import Layup

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class FormedFilm(NamedTuple):
    """Lower face of a film over the plane's nodes, ``base`` (n, 3) mm, and the unit vectors ``up``
    (n, 3) along which its thickness is measured. ``growth`` is the part by which its volume is
    larger than flat, where it is bent round a tube.
    """

    base: NDArray[np.float64]
    up: NDArray[np.float64]
    growth: float = 0.0

    def at(self, height: float) -> NDArray[np.float64]:
        """Points (n, 3) of the film ``height`` mm above its lower face."""
        points: NDArray[np.float64] = self.base + height * self.up
        return points


def flat(layup: Layup) -> list[FormedFilm]:
    """Every film flat, at its height in the stack."""
    return [level(layup, ply.z) for ply in layup.plies]


def level(layup: Layup, z: float) -> FormedFilm:
    """A film flat at one height in mm."""
    import numpy as np

    plane = layup.plane.points
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(plane), 3))
    return FormedFilm(np.column_stack([plane, np.full(len(plane), z)]), up)
