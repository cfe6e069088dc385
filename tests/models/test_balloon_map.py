"""Maps of balloons of several sizes beside balloons that they were not made from."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sbafab.models.balloon import Balloon, inflate
from sbafab.models.balloon_map import BalloonMap, balloon_map
from sbafab.models.rippled import pressed, risen, taller

SIZES = {
    "d = 3": Balloon(1.5, neck=0.75, bore=0.3),
    "d = 5": Balloon(2.5, neck=1.27, bore=0.52),
    "d = 8": Balloon(4.0, neck=1.0, bore=0.3),
    "d = 12": Balloon(6.0, neck=1.0, bore=0.4),
}
SIZES["unlike films"] = replace(
    SIZES["d = 5"], mate=replace(SIZES["d = 5"], thickness=0.05, modulus=40_000.0)
)
FREE = {"d = 3": 0.006, "d = 5": 0.006, "d = 8": 0.013, "d = 12": 0.023, "unlike films": 0.01}
"""How near free heights are, as shares."""
VOLUME = {"d = 12": 0.024}
"""How near volumes are, as shares, where not within 0.02."""
PULLED = 1.3
"""The height to which balloons are pulled here, as a share of where they stand freely."""


@pytest.fixture(scope="module", params=SIZES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def made(name: str) -> BalloonMap:
    return balloon_map(SIZES[name], 110.0)


@pytest.mark.parametrize(("least", "most"), [(0.05, 1.0), (1.0, PULLED)], ids=["pressed", "pulled"])
def test_forces_are_within_two_percent(
    name: str, made: BalloonMap, least: float, most: float
) -> None:
    """Of force and of pressure times pocket, at places drawn from 0.06 to 100 kPa; so volumes."""
    draw = np.random.default_rng(7)
    p = 0.06 * (100 / 0.06) ** draw.random(200)
    free = inflate(made.balloon, p).height * taller(made.balloon, p).share
    h = free * draw.uniform(least, most, len(p))
    inside = (h < 0.98 * made.most_height) & (h > 0.02)
    p, h = p[inside], h[inside]
    found = pressed(made.balloon, p, h, tied=True)
    full = p * math.pi * made.balloon.pocket**2 + np.abs(found.force)
    assert (np.abs(made.force(p, h) - found.force) < 0.02 * full).all()
    assert made.volume(p, h) == pytest.approx(found.volume, rel=VOLUME.get(name, 0.02))


def test_free_heights_are_near(name: str, made: BalloonMap) -> None:
    p = np.geomspace(0.06, 100.0, 40)
    free = risen(made.balloon, p).height
    inside = free < 0.95 * made.most_height
    assert made.free_height(p[inside]) == pytest.approx(free[inside], rel=FREE[name])


def test_without_pressure_it_holds_and_widens_as_its_films_do(made: BalloonMap) -> None:
    h = np.linspace(0.1, 0.97, 9) * made.most_height
    none, step = np.zeros(len(h)), 1e-3
    assert made.volume(none, h) == pytest.approx(
        inflate(made.balloon, none, h, tied=True).volume, rel=0.01
    )
    more, less = (inflate(made.balloon, none, h + s, tied=True).volume for s in (step, -step))
    own = (made.volume(none, h + step) - made.volume(none, h - step)) / (2 * step)
    widest = math.pi * made.balloon.pocket**2
    assert own == pytest.approx((more - less) / (2 * step), abs=0.03 * widest)
