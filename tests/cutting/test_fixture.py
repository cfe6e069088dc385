"""The pin plate: a hole for every pin, one corner off, room for every layer."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import ezdxf
import pytest

from sbafab.actuators import build, load_design
from sbafab.cutting.cut_settings import Curves, CutSettings
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.fixture import PATH, fixture, plate_corner, write_fixture
from sbafab.folders.build import hole_notes

SETTINGS = CutSettings("test", "0" * 64)
PLATEN = (152.4, 152.4)


@pytest.mark.parametrize("method", ["channel-pin", "ears"])
@pytest.mark.parametrize("name", ["1dof-5mm", "3dof-15mm", "radial-15mm"])
def test_every_pin_has_its_hole(name: str, method: str, tmp_path: Path) -> None:
    laminate = build(load_design(name, [f'registration.method="{method}"', "stack.balloons=2"]))
    path = write_fixture(laminate, tmp_path, SETTINGS, PLATEN)
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


def test_the_plate_is_as_large_as_the_platen_and_lacks_one_corner() -> None:
    laminate = build(load_design("3dof-15mm"))
    plate = fixture(laminate, (152.4, 120.0))
    assert plate is not None
    low_x, low_y, high_x, high_y = laminate.bounds
    x0, y0, x1, y1 = plate.bounds
    assert (x1 - x0, y1 - y0) == pytest.approx((152.4, 120.0))
    # The laminate lies in the middle, to the tenth that the holes are measured from.
    assert (x0 + x1) / 2 == pytest.approx((low_x + high_x) / 2, abs=0.051)
    assert (y0 + y1) / 2 == pytest.approx((low_y + high_y) / 2, abs=0.051)
    assert (x0, y0) == plate_corner(laminate, (152.4, 120.0))
    (outline,) = plate.outers
    holes = math.pi * sum((pin.diameter / 2) ** 2 for pin in laminate.pins)
    assert plate.area == pytest.approx(152.4 * 120 - 5 * 5 / 2 - holes)
    assert outline.winding((x1 - 0.1, y1 - 0.1)) == 0
    assert outline.winding((x0 + 0.1, y0 + 0.1)) == 1


@pytest.mark.parametrize("curves", [Curves("bulges"), Curves("arcs"), Curves("chords")])
def test_the_plate_carries_what_the_shop_must_know(curves: Curves, tmp_path: Path) -> None:
    """Letters in single strokes on REFERENCE, on the plate, and the same words as a property."""
    laminate = build(load_design("3dof-15mm"))
    notes = ("D1 H7, from above 2.35 +-0.05 deep", "each hole within 0.025 of its place")
    settings = replace(SETTINGS, curves=curves)
    path = write_fixture(laminate, tmp_path, settings, PLATEN, notes=notes)
    assert path is not None
    document = ezdxf.readfile(tmp_path / path)
    kinds = {(e.dxftype(), e.dxf.layer) for e in document.modelspace()}
    assert {kind for kind, layer in kinds if layer == "REFERENCE"} == {"LINE", "LWPOLYLINE"}
    assert not any(kind in ("TEXT", "MTEXT") for kind, _ in kinds)
    assert dict(document.header.custom_vars)["HOLES"] == " / ".join(notes)
    plate = fixture(laminate, PLATEN)
    assert plate is not None
    letters = [
        list(e.get_points("xy"))
        for e in document.modelspace()
        if e.dxftype() == "LWPOLYLINE" and e.dxf.layer == "REFERENCE"
    ]
    # The title and two lines: a stroke or more for each letter, all on the plate.
    words = f"test: base plate, seen from above #{'0' * 8}", *notes
    assert len(letters) >= sum(len(line.replace(" ", "")) for line in words)
    low_x, low_y, high_x, high_y = plate.bounds
    for x, y in (p for run in letters for p in run):
        assert low_x + 1 < x < high_x - 1
        assert low_y + 1 < y < high_y - 1
    read = read_profile(tmp_path / path)
    assert len(read.region.holes) == len(laminate.pins)


def test_a_machine_that_bores_less_true_is_told_on_the_drawing() -> None:
    """What the plate's drawing asks for is what the rules count, for each machine."""
    for machine, position, play in (("jig-borer", 0.003, 0.002), ("cnc-mill", 0.025, 0.008)):
        design = load_design("3dof-15mm", [f'registration.plate_made_by="{machine}"'])
        notes = hole_notes(design, build(design))
        assert f"each hole within {position:g} of its place" in notes[-1]
        assert design.pin_error == pytest.approx(position + play / 2)
    assert load_design("3dof-15mm", ["registration.pin_error=0.01"]).pin_error == 0.01
