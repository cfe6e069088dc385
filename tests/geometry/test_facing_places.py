"""All narrow places of a region, not only the narrowest."""

from __future__ import annotations

import math

import pytest

from sbafab.geometry.facing_places import facing_places_of
from sbafab.geometry.region import Region, disc, rectangle
from sbafab.geometry.width import Width, least_width

RING = disc((0.0, 0.0), 3.0) - disc((0.0, 0.0), 2.0)
FRAME = rectangle((0.0, 0.0), (10.0, 6.0)) - rectangle((1.0, 1.5), (9.0, 4.0))


def facing_pairs(region: Region, slack: float) -> list[Width]:
    (places,) = facing_places_of([(region, slack, 90.0, None)])
    ends = zip(places.start.T.tolist(), places.end.T.tolist(), places.value.tolist(), strict=True)
    return [Width(value, tuple(start), tuple(end)) for start, end, value in ends]


def test_a_ring_is_narrow_in_every_direction() -> None:
    pairs = facing_pairs(RING, 0.1)
    assert [pair.value for pair in pairs] == pytest.approx([1.0] * len(pairs))
    angles = sorted(math.degrees(math.atan2(*reversed(pair.middle))) % 360 for pair in pairs)
    steps = [after - before for before, after in zip(angles, angles[1:], strict=False)]
    assert len(pairs) >= 24
    assert max(*steps, 360 - angles[-1] + angles[0]) <= 15 + 1e-6


def test_slack_says_how_much_wider_a_place_may_be() -> None:
    # Webs of 1 left and right, 1.5 below and 2 above the window.
    for slack, widths in ((0.4, {1.0}), (0.6, {1.0, 1.5}), (1.1, {1.0, 1.5, 2.0})):
        assert {round(pair.value, 6) for pair in facing_pairs(FRAME, slack)} == widths


def test_both_ends_of_a_web_are_there() -> None:
    ends = {round(pair.middle[1], 6) for pair in facing_pairs(FRAME, 0.1)}
    assert {1.5, 4.0} <= ends


def test_the_narrowest_is_the_least_width() -> None:
    region = FRAME - disc((5.0, 5.0), 0.7)
    least = least_width(region)
    assert least is not None
    assert min(pair.value for pair in facing_pairs(region, 0.5)) == pytest.approx(least.value)


def test_no_place_twice() -> None:
    pairs = facing_pairs(FRAME, 1.1)
    ends = {
        frozenset(tuple(round(v, 4) for v in p) for p in (pair.start, pair.end)) for pair in pairs
    }
    assert len(ends) == len(pairs)
