"""What is said of widths before they are measured, against the widths themselves."""

from __future__ import annotations

import math
import random

import pytest

from sbafab.geometry import width
from sbafab.geometry.region import Region, disc, polygon, rectangle, union
from sbafab.geometry.width import least_gap, least_width, may_be_narrower, widest_least
from tests.quick import few

AXIS = (0.0, 0.0)
CLOSED = {
    "disc": (disc(AXIS, 2.5), 5.0),
    "ring": (disc(AXIS, 3) - disc((0.3, 0.4), 2), 0.5),
    "web": (disc(AXIS, 9) - disc((-2.0, 0.0), 1.5) - disc((2, 1), 1.5), 17**0.5 - 3),
    "hole and wall": (disc(AXIS, 9) - disc((6.0, 0.0), 2.0) - disc((-3, 1), 1.5), 1.0),
}


@pytest.mark.parametrize("name", CLOSED)
def test_circles_tell_the_width_between_them(name: str) -> None:
    region, expected = CLOSED[name]
    assert widest_least(region.contours) == pytest.approx(expected, abs=1e-9)


def test_no_circle_tells_nothing_and_void_between_two_is_no_width() -> None:
    assert widest_least(rectangle(AXIS, (2.0, 1.0)).contours) == math.inf
    apart = union([disc(AXIS, 2.0), disc((5.0, 0.0), 2.0)])
    assert widest_least(apart.contours) == 4.0


def plate(seed: int) -> Region:
    """A plate with round and square holes, some of which meet, and islands beside it."""
    draw = random.Random(seed)
    holes = [
        disc((draw.uniform(-8, 8), draw.uniform(-5, 5)), draw.uniform(0.2, 1.5)) for _ in range(7)
    ]
    x, y = draw.uniform(-6, 6), draw.uniform(-3, 3)
    holes.append(rectangle((x, y), (x + 1.3, y + 0.7)).turned(draw.uniform(0, 90)))
    hexagon = [(11 * math.cos(k * math.pi / 3), 7 * math.sin(k * math.pi / 3)) for k in range(6)]
    islands = [disc((draw.uniform(-14, 14), 9.0), 0.6), disc((14.0, draw.uniform(-5, 5)), 1.1)]
    return union([polygon(hexagon), *islands]) - union(holes)


@pytest.mark.parametrize("least", [least_width, least_gap])
@pytest.mark.parametrize("seed", few(range(25), 8))
def test_widths_are_those_found_without_bounds(
    seed: int, least: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert callable(least)
    region = plate(seed)
    limits = [math.inf, 5.0, 1.0, 0.3, 0.1]
    bounded = [least(region.moved(1.0, 0.0), 30.0, below) for below in limits]
    monkeypatch.setattr(width, "may_be_narrower", lambda contours, _: contours)
    monkeypatch.setattr(width, "widest_least", lambda _: math.inf)
    # Elsewhere, so that nothing is remembered.
    plain = [least(region.moved(1.0, 1e-3), 30.0, below) for below in limits]
    result = [a and round(a.value, 9) for a in bounded]
    assert result == [a and round(a.value, 9) for a in plain]
    assert result[0] is not None
    assert result[1:] == [result[0] if result[0] < below else None for below in limits[1:]]


def test_far_and_wide_circles_are_left_out() -> None:
    region = (
        rectangle((-9, -9), (9, 9)) - disc((-5, 0), 1.0) - disc((5, 0), 0.3) - disc((5, 1), 0.3)
    )
    left = [a.circle for a in may_be_narrower(region.contours, 0.5)]
    assert sum(circle is not None for circle in left) == 2
    assert len(may_be_narrower(region.contours, math.inf)) == len(region.contours)
