"""A part of the hunt for counterexamples; ``python -m tests.hunt`` goes on from here."""

from __future__ import annotations

import os

import pytest

from tests.hunt.__main__ import CHUNK, hunted

SCALE = int(os.environ.get("SBAFAB_HUNT", "1"))
"""Times as many cases as in the suite."""


@pytest.mark.parametrize("chunk", range(8 * SCALE))
def test_booleans(chunk: int) -> None:
    assert hunted("booleans", seed=0, first=CHUNK * chunk, count=CHUNK) == []


@pytest.mark.parametrize("chunk", range(3 * SCALE))
def test_offsets(chunk: int) -> None:
    assert hunted("offsets", seed=0, first=CHUNK * chunk, count=CHUNK) == []


@pytest.mark.parametrize(
    ("what", "seed", "number"),
    [
        # An edge 7 nm long; the arc beside it ends 3.7 nm off its circle.
        ("offsets", 11, 16945),
        # Bent to a common corner, a long side came to lie on another that was cut elsewhere.
        ("booleans", 31, 14210),
        # A corner on an arc's circle, beside the arc that was bent off it.
        ("booleans", 31, 12555),
    ],
)
def test_found_before(what: str, seed: int, number: int) -> None:
    assert hunted(what, seed, number, count=1) == []
