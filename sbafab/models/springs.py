"""What the levels of a stack do on their own: energy of balloons and of rims that meet.

Arrays have a row a level, or a row a kind of balloon; lengths mm, energies uJ, volumes ul.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.models.balloon_map import DEGREE, PIECES_IN_ALL, along, derivatives, horner

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
    rise and tilt, ``squares`` (rows, chambers x points, 9) their products. ``meet`` (rows, points,
    3) are the gaps at all that may be shut: the same, then the rims in mm; ``stiff`` (rows, points)
    how hard each resists.
    """

    begins: NDArray[np.int_]
    ring: Array
    squares: Array
    meet: Array
    stiff: Array

    @classmethod
    def of(cls, maps: Sequence[BalloonMap], gaps: Array, rims: Array) -> GapPlaces:
        """A row a kind of balloon, with gaps at its ring and round its rim, in mm."""
        count = gaps.shape[1]
        begins = np.arange(len(maps) * count // RING).reshape(len(maps), -1) * PIECES_IN_ALL
        spans = np.array([[one.spans] for one in maps])
        ring = gaps * spans[..., None]
        stiff = np.full((len(maps), count + rims.shape[1]), SHUT / RING)
        stiff[:, :count] /= spans * spans
        return cls(
            np.repeat(begins, RING, axis=1),
            ring,
            (ring[..., :, None] * ring[..., None, :]).reshape(*gaps.shape[:2], 9),
            np.concatenate([ring, rims], axis=1),
            stiff,
        )

    def at(self, levels: NDArray[np.int_]) -> GapPlaces:
        """A row for each of these; one row for all where they are alike."""
        if len(self.begins) == 1:
            return self
        begins, ring, squares, meet, stiff = self
        return GapPlaces(begins[levels], ring[levels], squares[levels], meet[levels], stiff[levels])


@dataclass(frozen=True, eq=False)
class Springs:
    """What levels do at given pressures, looked at in ``places``.

    ``table`` holds the ``derivatives`` of the potentials of all splines, then of their volumes.
    """

    table: Array
    places: GapPlaces

    @classmethod
    def pressed(cls, maps: Sequence[BalloonMap], pressures: Array, places: GapPlaces) -> Springs:
        """Those of kinds of balloons at pressures, one a chamber."""
        found = np.stack([one.pressed(pressures) for one in maps])
        # Each point has its share of its balloon.
        rows = found.transpose(2, 0, 1, 3, 4).reshape(-1, DEGREE + 1) / RING
        return cls(derivatives(rows), places)

    def meeting(self, freedoms: Array, move: Array) -> tuple[Array, Array] | None:
        """What rims would do, by gradient (rows, 3) and second derivatives (rows, 3, 3), if those
        which a move closes were shut from where they are; None where it closes none.
        """
        first = self.places.begins.shape[1]
        rims, stiff = self.places.meet[:, first:], self.places.stiff[:, first:]
        gaps = (rims @ freedoms[..., None])[..., 0]
        met = (gaps >= 0) & (gaps + (rims @ move[..., None])[..., 0] < 0)
        if not met.any():
            return None
        each = rims * (met * stiff)[..., None]
        return (gaps[:, None] @ each)[:, 0], each.transpose(0, 2, 1) @ rims

    def energy(self, freedoms: Array) -> tuple[Array, Array, Array]:
        """Energy (rows) in uJ with its gradient (rows, 3) and second derivatives (rows, 3, 3)."""
        begins, ring, squares, meet, stiff = self.places
        gaps = (meet @ freedoms[..., None])[..., 0]
        found = along(self.table, begins, gaps[:, : begins.shape[1]])
        value = found.value.sum(-1)
        gradient = (found.first[:, None] @ ring)[:, 0]
        matrix = (found.second[:, None] @ squares).reshape(-1, 3, 3)
        if gaps.min() < 0:
            push = stiff * np.minimum(gaps, 0.0)
            value += (push * gaps).sum(-1) / 2
            gradient += (push[:, None] @ meet)[:, 0]
            touch = np.where(gaps < 0, stiff, 0.0)[..., None] * meet
            matrix += touch.transpose(0, 2, 1) @ meet
        return value, gradient, matrix

    def contents(self, freedoms: Array) -> tuple[Array, Array]:
        """Volume in ul of each balloon (rows, chambers), and the potential of each row."""
        begins, ring = self.places.begins, self.places.ring
        gaps = (ring @ freedoms[..., None])[..., 0]
        both = begins + np.array([[[0]], [[self.table.shape[2] // 2]]])
        stored, held = horner(self.table[:, 0], both, gaps)
        return held.reshape(len(held), -1, RING).sum(-1), stored.sum(-1)
