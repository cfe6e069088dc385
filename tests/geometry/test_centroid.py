"""Centres of area against closed formulas and shapely."""

from __future__ import annotations

import math

import pytest
import shapely

from sbafab.geometry.region import Region, centroid, disc, rectangle, strip

HALF = disc((3.0, -1.0), 2.0) & rectangle((3.0, -5.0), (9.0, 5.0))
SHAPES = {
    "disc": disc((3.0, -1.0), 2.0),
    "half disc": HALF,
    "ring with a tab": (disc((1.0, 2.0), 3.0) | strip((1.0, 2.0), (9.0, 4.0), 1.5))
    - disc((1.5, 2.0), 1.0),
    "two pieces": disc((0.0, 0.0), 1.0) | disc((7.0, 3.0), 2.0),
}


def test_a_half_disc_has_its_centre_at_four_thirds_of_r_over_pi() -> None:
    assert centroid(HALF) == pytest.approx((3.0 + 4 * 2.0 / (3 * math.pi), -1.0), abs=1e-9)


@pytest.mark.parametrize("name", SHAPES)
def test_shapely_finds_the_same_centre(name: str) -> None:
    region: Region = SHAPES[name]
    pieces = [shapely.Polygon(rings[0], rings[1:]) for rings in region.polygons(1e-6)]
    centre = shapely.union_all(pieces).centroid
    assert centroid(region) == pytest.approx((centre.x, centre.y), abs=1e-5)
