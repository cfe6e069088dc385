"""What the levels of a stack do on their own: energy of balloons and of rims that meet.

Arrays have a row a level, or a row a kind of balloon; lengths mm, energies uJ, volumes ul.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.models.balloon_map import DEGREE, PIECES_IN_ALL, derivatives, horner

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from sbafab.models.balloon_map import BalloonMap
    from sbafab.models.film_elements import Array

RING = 6
"""Points of each balloon at which its gap is looked at."""
SHUT = 2e4
"""mN/mm with which a flat balloon resists being flattened further: no film gives way visibly."""


class GapPlaces(NamedTuple):
    """Where levels are looked at, whatever the pressures.

    ``begins`` (rows, chambers x points) is where the potential of each point begins in the table of
    springs. ``ring`` (rows, chambers x points, 3) are the gaps there, in pieces of the spline, by
    rise and tilt, ``squares`` (rows, chambers x points, 9) their products. ``meet`` (rows, 3,
    points) are the gaps at all that may be shut: the same, then the rims in mm; ``shut`` (rows,
    points, 9) their products by how hard each resists.
    """

    begins: NDArray[np.int_]
    ring: Array
    squares: Array
    meet: Array
    shut: Array

    @classmethod
    def of(cls, maps: Sequence[BalloonMap], gaps: Array, rims: Array) -> GapPlaces:
        """A row a kind of balloon, with gaps at its ring and round its rim, in mm."""
        count = gaps.shape[1]
        begins = np.arange(len(maps) * count // RING).reshape(len(maps), -1) * PIECES_IN_ALL
        spans = np.array([[one.spans] for one in maps])
        ring = gaps * spans[..., None]
        stiff = np.full((len(maps), count + rims.shape[1]), SHUT / RING)
        stiff[:, :count] /= spans * spans
        meet = np.concatenate([ring, rims], axis=1)
        squares = (meet[..., :, None] * meet[..., None, :]).reshape(*meet.shape[:2], 9)
        return cls(
            np.repeat(begins, RING, axis=1),
            ring,
            squares[:, :count],
            np.ascontiguousarray(meet.transpose(0, 2, 1)),
            squares * stiff[..., None],
        )

    def at(self, levels: NDArray[np.int_]) -> GapPlaces:
        """A row for each of these; one row for all where they are alike."""
        if len(self.begins) == 1:
            return self
        begins, ring, squares, meet, shut = self
        return GapPlaces(begins[levels], ring[levels], squares[levels], meet[levels], shut[levels])


@dataclass(frozen=True, eq=False)
class Springs:
    """What levels do at given pressures, looked at in ``places``.

    ``table`` holds the ``derivatives`` of the potentials of all splines, then of their volumes.
    """

    table: Array
    places: GapPlaces

    @classmethod
    def pressed(
        cls,
        maps: Sequence[BalloonMap],
        pressures: Array,
        places: GapPlaces,
        sucked: bool = False,
    ) -> Springs:
        """Those of kinds of balloons at pressures, one a chamber, below 0 only where ``sucked``."""
        found = np.stack([one.pressed(pressures, sucked) for one in maps])
        # Each point has its share of its balloon.
        rows = found.transpose(2, 0, 1, 3, 4).reshape(-1, DEGREE + 1) / RING
        return cls(derivatives(rows), places)

    def meeting(self, freedoms: Array, move: Array) -> tuple[Array, Array] | None:
        """What rims would do, by gradient (rows, 3) and second derivatives (rows, 3, 3), if those
        which a move closes were shut from where they are; None where it closes none.
        """
        first = self.places.begins.shape[1]
        rims = self.places.meet[:, :, first:]
        ends = ((freedoms + move)[:, None] @ rims)[:, 0]
        if ends.min() >= 0:
            return None
        met = (ends < 0) & ((freedoms[:, None] @ rims)[:, 0] >= 0)
        if not met.any():
            return None
        stiffer = self._shut(met, first)
        return (stiffer @ freedoms[..., None])[..., 0], stiffer

    def _shut(self, met: NDArray[np.bool_], first: int = 0) -> Array:
        """Second derivatives (rows, 3, 3) of what resists where ``met`` (rows, points)."""
        each = met.astype(float)[:, None] @ self.places.shut[:, first:]
        return np.asarray(each.reshape(-1, 3, 3))

    def energy(self, freedoms: Array) -> tuple[Array, Array, Array]:
        """Energy (rows) in uJ with its gradient (rows, 3) and second derivatives (rows, 3, 3)."""
        begins, ring, squares, meet, _ = self.places
        gaps = (freedoms[:, None] @ meet)[:, 0]
        value, first, second = horner(self.table, begins, gaps[:, : begins.shape[1]])
        value = value @ np.ones(value.shape[-1])
        gradient = (first[:, None] @ ring)[:, 0]
        matrix = (second[:, None] @ squares).reshape(-1, 3, 3)
        if gaps.min() < 0:
            stiffer = self._shut(gaps < 0)
            push = (stiffer @ freedoms[..., None])[..., 0]
            value += (push * freedoms).sum(-1) / 2
            gradient += push
            matrix += stiffer
        return value, gradient, matrix

    def contents(self, freedoms: Array) -> tuple[Array, Array]:
        """Volume in ul of each balloon (rows, chambers), and the potential of each row."""
        begins, ring = self.places.begins, self.places.ring
        gaps = (ring @ freedoms[..., None])[..., 0]
        both = begins + np.array([[[0]], [[self.table.shape[2] // 2]]])
        stored, held = horner(self.table[:, 0], both, gaps)
        return held.reshape(len(held), -1, RING).sum(-1), stored.sum(-1)
