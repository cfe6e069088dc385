"""Random numbers for builds: a stream that begins alike for every laminate, read where needed.

Each error has a row of numbers a batch (a shift has two); what they mean is worked out only for the
builds that nothing simpler decides. The beginning of the stream is kept, for the next laminate asks
for it again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from sbafab.rules.freedoms import Freedom

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Indices = NDArray[np.intp]

KEPT = 4_000_000
"""Numbers at the stream's beginning that are kept: 32 MB at most, of which a page is taken up when
it is first written.
"""
ROOM = 1e-12
"""mm: far more than the rounding of a sum of a few errors."""


class CutContour(NamedTuple):
    """A cut contour: by how far its film reaches beyond the nominal edge."""

    layer: int
    contour: int


Error = CutContour | Freedom


def is_shift(error: Error) -> bool:
    """Whether an error has an x and a y, and two rows of numbers."""
    return isinstance(error, Freedom) and error.centre is None


def rows_by_error(errors: Iterable[Error]) -> tuple[dict[Error, int], int]:
    """The first row of each error, in the order in which they are drawn, and how many rows."""
    rows: dict[Error, int] = {}
    count = 0
    for error in errors:
        if error not in rows:
            rows[error] = count
            count += 2 if is_shift(error) else 1
    return rows, count


class _Stream:
    """The beginning of the numbers of one seed."""

    def __init__(self, seed: int) -> None:
        import numpy as np

        self.generator = np.random.default_rng(seed)
        self.numbers = np.empty(KEPT)
        self.known = 0

    def until(self, last: int) -> Floats:
        if last > self.known:
            self.generator.random(out=self.numbers[self.known : last])
            self.known = last
        return self.numbers


_stream = lru_cache(maxsize=1)(_Stream)


def numbers(seed: int, first: int, rows: int, builds: int) -> Floats:
    """Numbers from 0 to 1, a row of ``builds`` each, from the ``first`` of the seed's stream on."""
    import numpy as np

    last = first + rows * builds
    if last <= KEPT:
        return _stream(seed).until(last)[first:last].reshape(rows, builds)
    ahead = np.random.PCG64(seed)
    ahead.advance(first)
    return np.random.Generator(ahead).random((rows, builds))


class Draws:
    """The errors of a batch of builds of interfaces that are alike.

    ``numbers`` has a row of builds for each error of the laminate, ``first`` the rows of each error
    of the first interface and of those that stand in its place in the others.
    """

    def __init__(self, numbers: Floats, first: Mapping[Error, Indices], cutting: float) -> None:
        self.numbers = numbers
        self.first = first
        self.cutting = cutting

    def of(self, error: Error, interfaces: Indices, builds: Indices) -> Floats:
        """X and y of a shift, or the one value of a cutting error or turn, in builds of these."""
        import numpy as np

        if is_shift(error):
            radius = self.reach(error, interfaces, builds)
            rows = self.first[error][interfaces] + 1
            angle = math.tau * self.numbers[rows, builds]
            return np.array([radius * np.cos(angle), radius * np.sin(angle)])
        return self.value(error, interfaces, builds)[None, :]

    def reach(self, shift: Error, interfaces: Indices, builds: Indices) -> Floats:
        """How far a shift goes: uniform over a disc, so that the radius goes with the root."""
        import numpy as np

        assert isinstance(shift, Freedom)
        drawn = self.numbers[self.first[shift][interfaces], builds]
        far: Floats = shift.most * np.sqrt(drawn)
        return far

    def value(self, error: Error, interfaces: Indices, builds: Indices) -> Floats:
        """The one value of a cutting error or a turn."""
        most = error.most if isinstance(error, Freedom) else self.cutting
        drawn = self.numbers[self.first[error][interfaces], builds]
        values: Floats = -most + (most + most) * drawn
        return values

    def cut_below(
        self, contours: Sequence[tuple[Error, float]], least: float
    ) -> tuple[Indices, Indices]:
        """Interfaces and builds in which the cutting errors, by their signs, may add up to less."""
        import numpy as np

        count, builds = len(self.first[contours[0][0]]), self.numbers.shape[1]
        if self.cutting <= 0:
            interfaces, every = np.nonzero(np.full((count, builds), least > -ROOM))
            return interfaces, every
        share = (least + ROOM) / (2 * self.cutting) + sum(sign for _, sign in contours) / 2
        found: list[Indices] = []
        # One interface after the other: rows of all at once would be copied first.
        for number in range(count):
            total = np.zeros(1)
            for error, sign in contours:
                row = self.numbers[self.first[error][number]]
                total = total + row if sign > 0 else total - row
            found.append((total < share).nonzero()[0])
        interfaces = np.repeat(np.arange(count), [len(one) for one in found])
        return interfaces, np.concatenate(found)
