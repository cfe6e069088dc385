"""A line that runs into the arc of a round corner does not face it, whatever its radius."""

from __future__ import annotations

import pytest

from sbafab.geometry.offset import grow
from sbafab.geometry.region import rectangle
from sbafab.geometry.width import least_width


@pytest.mark.parametrize("radius", [0.5, 1.0, 2.0, 4.0])
def test_the_width_of_a_rounded_rectangle_is_its_shorter_side(radius: float) -> None:
    width = least_width(grow(rectangle((-8.0, -3.0), (8.0, 3.0)), radius))
    assert width is not None
    assert width.value == pytest.approx(6.0 + 2 * radius)
