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


def test_an_offset_across_an_edge_of_7_nm() -> None:
    """The arc beside it ends 3.7 nm off its circle: a wedge was left outside the result."""
    assert hunted("offsets", seed=11, first=16945, count=1) == []
