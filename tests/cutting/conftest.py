"""Profiles and a small laminate, built by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.offset import fillet
from sbafab.geometry.region import Region, disc, strip, union
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Laminate, Layer, Role

TPE = Film("TPE", "film", 0.038, 1122.0, 120.0, 200.0)
PTFE = Film("PTFE", "film", 0.025, 2200.0, 327.0, 260.0, kind="mask")


@pytest.fixture(scope="session")
def plate() -> Region:
    """The 3-DoF plate of 2.5 mm chambers with bores, lumen and one inlet tab."""
    axes = [
        (4.25 * math.cos(math.radians(turn)), 4.25 * math.sin(math.radians(turn)))
        for turn in (90, 210, 330)
    ]
    outline = union([disc((0.0, 0.0), 1.75), *(disc(axis, 3.25) for axis in axes)])
    outline = fillet(outline, 1.0) | strip((0.0, 4.25), (0.0, 12.5), 3.1)
    return outline - union([disc((0.0, 0.0), 1.0), *(disc(axis, 0.5) for axis in axes)])


@pytest.fixture(scope="session")
def plate_text(plate: Region) -> str:
    return dxf_text(cutting_sequence(plate), {"DESIGN": "plate"})


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    def written(text: str) -> Path:
        path = tmp_path / "001_TPE_base.dxf"
        path.write_text(text, encoding="utf-8", newline="\n")
        return path

    return written


@pytest.fixture(scope="session")
def laminate(plate: Region) -> Laminate:
    """Base, mask and cap of a plate, where the cap is equal to the base."""
    bore = disc((0.0, 4.25), 0.5)
    mask = disc((0.0, 4.25), 2.5) - bore
    rows: list[tuple[Role, Film, Region, str]] = [
        ("base", TPE, plate, "P01"),
        ("chamber-mask", PTFE, mask, "P02"),
        ("cap", TPE, plate, "P01"),
    ]
    layers = tuple(
        Layer(index, role, film, profile, 1, 0.0, 1, pattern)
        for index, (role, film, profile, pattern) in enumerate(rows, 1)
    )
    return Laminate("two-plates", "lobed", layers, (), (), (), (), 2.0, 1, "channel-pin")
