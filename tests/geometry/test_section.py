"""Sections of regions by lines, against closed formulas."""

from __future__ import annotations

import math

import pytest

from sbafab.geometry.region import Region, disc, rectangle, section, strip


@pytest.mark.parametrize("height", [0.0, 0.3, 1.0, 2.49])
def test_a_chord_of_a_disc(height: float) -> None:
    half = math.sqrt(2.5**2 - height**2)
    [(start, end)] = section(disc((1.0, 0.0), 2.5), (0.0, height), (1.0, 0.0))
    assert (start, end) == pytest.approx((1.0 - half, 1.0 + half), abs=1e-9)


def test_a_ring_gives_two_stretches() -> None:
    ring = disc((0.0, 0.0), 3.25) - disc((0.0, 0.0), 0.5)
    c = math.sqrt(0.5)
    left, right = section(ring, (0.0, 0.0), (c, c))
    assert left == pytest.approx((-3.25, -0.5), abs=1e-9)
    assert right == pytest.approx((0.5, 3.25), abs=1e-9)


def test_distances_count_from_the_origin_along_the_direction() -> None:
    box = rectangle((2.0, -1.0), (5.0, 1.0))
    assert section(box, (10.0, 0.0), (-1.0, 0.0)) == [pytest.approx((5.0, 8.0), abs=1e-9)]


def test_a_slanted_line_through_a_strip_is_longer_by_the_cosine() -> None:
    slanted = section(strip((-9.0, 0.0), (9.0, 0.0), 1.6), (0.0, 0.0), (0.6, 0.8))
    assert slanted == [pytest.approx((-1.0, 1.0), abs=1e-9)]


def test_a_miss_and_an_empty_region_give_nothing() -> None:
    assert section(disc((0.0, 0.0), 1.0), (0.0, 1.5), (1.0, 0.0)) == []
    assert section(Region(), (0.0, 0.0), (1.0, 0.0)) == []


def test_a_line_that_only_touches_has_no_length() -> None:
    assert section(disc((0.0, 0.0), 1.0), (0.0, 1.0), (1.0, 0.0)) == []
