"""Random numbers for builds: a stream that begins alike for every laminate, read where needed.

Each error has a row of numbers a batch (a shift has two); what they mean is worked out only for the
builds that nothing simpler decides. The beginning of the stream is kept, for the next laminate asks
for it again.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from sbafab.rules.freedoms import Freedom

if TYPE_CHECKING:
    from sbafab.geometry.arrays import Floats

KEPT = 4_000_000
"""Numbers at the stream's beginning that are kept: 32 MB at most, of which a page is taken up when
it is first written.
"""


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
        if rows.setdefault(error, count) == count:
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


class DrawnBuilds(NamedTuple):
    """Builds drawn at a time: which numbers of the seed's stream, a row of ``builds`` an error."""

    seed: int
    first: int
    rows: int
    builds: int

    @property
    def numbers(self) -> Floats:
        """Numbers from 0 to 1, a row each, from the ``first`` of the seed's stream on."""
        return numbers(*self)


def numbers(seed: int, first: int, rows: int, builds: int) -> Floats:
    """Numbers from 0 to 1, a row of ``builds`` each, from the ``first`` of the seed's stream on."""
    import numpy as np

    last = first + rows * builds
    if last <= KEPT:
        return _stream(seed).until(last)[first:last].reshape(rows, builds)
    ahead = np.random.PCG64(seed)
    ahead.advance(first)
    return np.random.Generator(ahead).random((rows, builds))
