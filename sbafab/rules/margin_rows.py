"""What is left at the margins of all interfaces beyond their limits: a row each, with its factors.

A row is its room and a sum over the errors drawn (``random_builds.py``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.rules.draws import CutContour, Error
from sbafab.rules.forms import LinearForms
from sbafab.rules.limits import TOLERANCE, Limits
from sbafab.rules.margins import Owner, Quantity

if TYPE_CHECKING:
    from sbafab.geometry.arrays import Floats, Indices

UNITS = 1000
"""Factors that are equal to so many parts are one: rows that feel all errors alike."""


class RowKind(NamedTuple):
    """The rows between the edges of two contours, of the interfaces of a group.

    They feel the ``errors``: two contours, which count by their ``signs``, then moves.
    """

    group: int
    quantity: Quantity
    errors: Sequence[Error]
    signs: tuple[float, float]


class MarginRows(NamedTuple):
    """What is left at margins beyond their limit: ``room`` and a sum of errors.

    All rows of all kinds, kind after kind: ``begins`` says where. Shifts count by the normal and
    their sign, turns by the ``levers``, a line for each move, 0 of what shifts. ``shift`` (mm),
    ``turn`` (radians) and ``sign`` are how far it goes and how it counts, by kind.
    """

    kinds: Sequence[RowKind]
    begins: Indices
    room: Floats
    normal: Floats
    levers: Floats
    shift: Floats
    turn: Floats
    sign: Floats


def rows_of(forms: LinearForms, layers: Sequence[Sequence[int]], limits: Limits) -> MarginRows:
    """The margins that can come short at all, by the two contours whose edges they join; of those
    that feel all errors alike, the least.

    Kinds are in the order of the first of them. ``layers`` are those of each group, by seat.
    """
    import numpy as np

    room = forms.nominal - forms.by_quantity(
        {"bond": limits.worst_bond_width, "overhang": limits.worst_mask_overhang}
    )
    (short,) = np.nonzero(room - 2 * limits.tolerances.cutting - forms.loss < -TOLERANCE)
    between = forms.between.take(short)
    # Owners in the order of their first short margin.
    owners = list(dict.fromkeys(between.tolist()))
    rank = np.zeros(len(forms.owners), dtype=np.intp)
    rank[owners] = np.arange(len(owners))
    chosen = _least_alike(forms, room, short)
    ranks = rank.take(forms.between.take(chosen))
    chosen = chosen.take(ranks.argsort(kind="stable"))
    begins = np.cumsum([0, *np.bincount(ranks, minlength=len(owners)).tolist()])
    kinds = []
    for both, run in zip(owners, forms.run[chosen[begins[:-1]]].tolist(), strict=True):
        group, quantity, _ = forms.runs[run]
        one, other = forms.owners[both]
        cuts = [CutContour(layers[group][own.seat], own.contour) for own in (one, other)]
        signs = _sign(quantity, one), _sign(quantity, other)
        kinds.append(RowKind(group, quantity, [*cuts, *forms.moves.freedoms[both]], signs))
    return MarginRows(
        kinds,
        begins,
        room[chosen],
        forms.normal.take(chosen, axis=1),
        forms.levers.take(chosen, axis=1),
        forms.moves.shift[:, owners],
        forms.moves.turn[:, owners],
        forms.moves.sign[:, owners],
    )


def _sign(quantity: Quantity, owner: Owner) -> float:
    """More film widens a bond, more mask an overhang."""
    return 1.0 if owner.is_film == (quantity == "bond") else -1.0


def _least_alike(forms: LinearForms, room: Floats, short: Indices) -> Indices:
    """Of the short margins between each two owners those with the least room of all with the same
    factors, rounded.
    """
    import numpy as np

    between = forms.between.take(short)
    # Where nothing but cutting is felt all factors are 0, and all are alike.
    shifts = (forms.moves.shift.max(axis=0, initial=0.0) > 0).take(between)
    factors = forms.normal.take(short, axis=1) * shifts, forms.levers.take(short, axis=1)
    parts = _parts(np.concatenate(factors)).astype(np.int64)
    keys = np.concatenate([between[None], parts]).T.copy()
    names = keys.view(f"V{keys.itemsize * keys.shape[1]}").ravel()
    # Of each name the last stays: that with the least room, of equal ones the first.
    order = room.take(short).argsort(kind="stable")[::-1]
    least = dict(zip(names.take(order).tolist(), order.tolist(), strict=True))
    return short.take(sorted(least.values()))


def _parts(factors: Floats) -> Floats:
    """Factors as whole parts, rounded as the decimal number is."""
    import numpy as np

    scaled = factors * UNITS
    parts = np.rint(scaled)
    doubtful = np.abs(scaled - np.floor(scaled) - 0.5) < 1e-6
    if doubtful.any():
        parts[doubtful] = [round(round(one, 3) * UNITS) for one in factors[doubtful].tolist()]
    return parts
