"""The pin plate: a hole for every pin, one corner off, room for every layer."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sbafab.actuators import build, load_design
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.fixture import PATH, fixture, write_fixture
from sbafab.cutting.properties import CutSettings

SETTINGS = CutSettings("test", "0" * 64)


@pytest.mark.parametrize("method", ["channel-pin", "ears"])
@pytest.mark.parametrize("name", ["1dof-5mm", "3dof-15mm", "radial-15mm"])
def test_every_pin_has_its_hole(name: str, method: str, tmp_path: Path) -> None:
    laminate = build(load_design(name, [f'registration.method="{method}"', "stack.balloons=2"]))
    path = write_fixture(laminate, tmp_path, SETTINGS)
    assert path == PATH
    plate = read_profile(tmp_path / PATH).region
    circles = [hole.circle for hole in plate.holes]
    assert len(circles) == len(laminate.pins)
    for pin in laminate.pins:
        assert any(
            circle is not None
            and math.dist(circle[0], pin.centre) < 1e-6
            and circle[1] == pytest.approx(pin.diameter / 2)
            for circle in circles
        )


def test_the_plate_holds_every_layer_and_lacks_one_corner() -> None:
    laminate = build(load_design("3dof-15mm"))
    plate = fixture(laminate)
    assert plate is not None
    low_x, low_y, high_x, high_y = laminate.bounds
    (outline,) = plate.outers
    width, height = high_x - low_x + 12, high_y - low_y + 12
    holes = math.pi * (3 * 0.5**2 + 1.0**2)
    assert plate.area == pytest.approx(width * height - 5 * 5 / 2 - holes)
    assert outline.winding((high_x + 5.9, high_y + 5.9)) == 0
    assert outline.winding((low_x - 5.9, low_y - 5.9)) == 1


def test_no_pins_no_plate(tmp_path: Path) -> None:
    laminate = build(load_design("radial-15mm"))
    assert laminate.pins == ()
    assert write_fixture(laminate, tmp_path, SETTINGS) is None
    assert list(tmp_path.iterdir()) == []
