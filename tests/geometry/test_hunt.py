"""A part of the hunt for counterexamples; ``python -m tests.hunt`` goes on from here."""

from __future__ import annotations

import os
from collections.abc import Callable
from random import Random

import pytest

from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Line
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region, disc
from tests.hunt import oracle
from tests.hunt.__main__ import CHUNK, hunted

SCALE = int(os.environ.get("SBAFAB_HUNT", "1"))
"""Times as many cases as in the suite."""


@pytest.mark.parametrize("chunk", range(3 * SCALE))
def test_booleans(chunk: int) -> None:
    assert hunted("booleans", seed=0, first=CHUNK * chunk, count=CHUNK) == []


@pytest.mark.parametrize("chunk", range(SCALE))
def test_offsets(chunk: int) -> None:
    assert hunted("offsets", seed=0, first=CHUNK * chunk, count=CHUNK) == []


@pytest.mark.parametrize(
    ("operation", "seed", "number"),
    [
        # An edge 7 nm long; the arc beside it ends 3.7 nm off its circle.
        ("offsets", 11, 16945),
        # Bent to a common corner, a long side came to lie on another that was cut elsewhere.
        ("booleans", 31, 14210),
        # A corner on an arc's circle, beside the arc that was bent off it.
        ("booleans", 31, 12555),
        # A sliver's tip on a circle: tiny edges beside it were joined round its corner.
        ("booleans", 2026, 475111),
        ("booleans", 2026, 667622),
        # An arc's end below the lowest point of its circle by a rounding: out of its box.
        ("booleans", 2027, 7688),
        # A sliver of a few nm, and at its end 0.6 um by 20 um that went as dust with it.
        ("booleans", 2027, 294305),
        # A step along a side that shapely drops before it shrinks.
        ("offsets", 2026, 189961),
    ],
)
def test_found_before(operation: str, seed: int, number: int) -> None:
    assert hunted(operation, seed, number, count=1) == []


def ring() -> tuple[Region, Region]:
    return disc((0.0, 0.0), 3.25), disc((0.5, 0.0), 1.0)


def with_a_chord(region: Region) -> Region:
    first, *rest = region.contours
    arc, *edges = first.edges
    return Region((Contour((Line(arc.start, arc.end), *edges)), *rest))


@pytest.mark.parametrize(
    "fault",
    [
        lambda good: Region(good.contours[:1]),
        lambda good: Region(),
        with_a_chord,
        lambda good: good.moved(0.01, 0.0),
        lambda good: good.scaled(1.0001),
    ],
    ids=["a hole is missing", "nothing", "a chord for an arc", "moved", "scaled"],
)
def test_the_oracle_tells_a_fault(fault: Callable[[Region], Region]) -> None:
    a, b = ring()
    good = a - b
    assert oracle.fault("minus", a, b, good, Random(1)) is None
    assert oracle.fault("minus", a, b, fault(good), Random(1)) is not None
    grown = grow(good, 0.1)
    assert oracle.offset_fault(good, 0.1, grown, Random(1)) is None
    assert oracle.offset_fault(good, 0.1, fault(grown), Random(1)) is not None
