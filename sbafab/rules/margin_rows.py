"""What is left at the margins of an interface beyond their limits: a row each, with its factors.

A row is its room and a sum over the errors drawn (``random_builds.py``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sbafab.rules.draws import CutContour, Error
from sbafab.rules.forms import LinearForms
from sbafab.rules.freedoms import Freedom
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.margins import Quantity

if TYPE_CHECKING:
    from sbafab.geometry.arrays import Floats, Indices

UNITS = 1000
"""Factors that are equal to so many parts are one: rows that feel all errors alike."""


@dataclass(frozen=True)
class MarginRows:
    """What is left at margins of one form beyond their limit: ``room`` and a sum of errors.

    Contours count by their sign, shifts by the normal times theirs, turns by the levers times
    theirs.
    """

    quantity: Quantity
    room: Floats
    normal: Floats
    contours: tuple[tuple[CutContour, float], ...]
    moves: tuple[tuple[Freedom, float, Floats | None], ...]

    @property
    def errors(self) -> tuple[Error, ...]:
        return *(one for one, _ in self.contours), *(freedom for freedom, _, _ in self.moves)


def rows_of(
    forms: LinearForms, layers: Sequence[int], limit: float, cutting: float
) -> Iterator[tuple[int, MarginRows]]:
    """The margins that can come short at all, by the two contours whose edges they join; of those
    that feel all errors alike, the least.

    With the number of the first of them.
    """
    import numpy as np

    room = forms.nominal - limit
    (short,) = np.nonzero(room - 2 * cutting - forms.loss < -TOLERANCE)
    if not len(short):
        return
    for between, alike in _least_alike(forms, room, short).items():
        first, chosen = short[alike[0]], short[alike[1]]
        owners = forms.owners[between]
        # More film widens a bond, more mask an overhang.
        signs = (1.0 if one.is_film == (forms.quantity == "bond") else -1.0 for one in owners)
        contours = (CutContour(layers[one.seat], one.contour) for one in owners)
        levers = forms.levers[:, chosen]
        yield (
            forms.first + int(first),
            MarginRows(
                forms.quantity,
                room[chosen],
                forms.normal[:, chosen],
                tuple(zip(contours, signs, strict=True)),
                tuple(
                    [
                        (freedom, 1.0 if at_end else -1.0, own if freedom.centre else None)
                        for (freedom, at_end), own in zip(
                            forms.felt[forms.parts[first]], levers, strict=False
                        )
                    ]
                ),
            ),
        )


def _least_alike(
    forms: LinearForms, room: Floats, short: Indices
) -> dict[int, tuple[int, list[int]]]:
    """Of the short margins between each two owners the first, and which have the least room of all
    with the same factors, rounded.
    """
    import numpy as np

    parts = forms.parts[short]
    shifts = np.array([any(one.centre is None for one, _ in own) for own in forms.felt])
    turns = np.zeros((len(forms.levers), len(forms.felt)))
    for part, own in enumerate(forms.felt):
        for line, (freedom, _) in enumerate(own):
            turns[line, part] = freedom.centre is not None
    # Where nothing but cutting is felt all factors are 0, and all are alike.
    factors = np.concatenate(
        [forms.normal[:, short] * shifts[parts], forms.levers[:, short] * turns[:, parts]]
    )
    keys = np.ascontiguousarray(_parts(factors).astype(np.int64).T)
    found: dict[int, tuple[int, dict[bytes, int]]] = {}
    left = room[short].tolist()
    names = keys.view(f"V{keys.itemsize * keys.shape[1]}").ravel().tolist()
    for place, (between, name) in enumerate(zip(forms.between[short].tolist(), names, strict=True)):
        _, alike = found.setdefault(between, (place, {}))
        known = alike.get(name)
        if known is None or left[place] < left[known]:
            alike[name] = place
    return {between: (first, list(alike.values())) for between, (first, alike) in found.items()}


def _parts(factors: Floats) -> Floats:
    """Factors as whole parts, rounded as the decimal number is."""
    import numpy as np

    scaled = factors * UNITS
    parts = np.rint(scaled)
    doubtful = np.abs(scaled - np.floor(scaled) - 0.5) < 1e-6
    if doubtful.any():
        parts[doubtful] = [round(round(one, 3) * UNITS) for one in factors[doubtful].tolist()]
    return parts
