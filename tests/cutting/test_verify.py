"""Verification tells a file that differs from its profile, and names the place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from sbafab.cutting.cut_settings import DxfProfile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.layer_files import path_difference
from sbafab.cutting.sequence import cutting_sequence
from sbafab.cutting.verify import verify_file
from sbafab.errors import OutputError
from sbafab.geometry.edges import Line
from sbafab.geometry.region import Region, disc, rectangle

Write = Callable[[str], Path]


def ring(hole_x: float = 1.0, hole_radius: float = 0.5, radius: float = 5.0) -> Region:
    return disc((0.0, 0.0), radius) - disc((hole_x, 0.0), hole_radius)


def check(found: Region, expected: Region, write: Write) -> None:
    verify_file(write(dxf_text(cutting_sequence(found), {"A": "b"})), expected, {"A": "b"})


@pytest.mark.parametrize("name", ["disc", "discs", "stadium", "tab", "plate", "island"])
@pytest.mark.parametrize("profile", ["bulges", "arcs", "chords"])
def test_what_was_written_passes(
    name: str, profile: DxfProfile, profiles: dict[str, Region], write: Write
) -> None:
    region = profiles[name]
    if profile == "chords":
        region = in_chords(region, "wall", 0.005)
    path = write(dxf_text(cutting_sequence(region), {}, profile))
    verify_file(path, region, {})


def test_half_a_micrometre_passes_and_two_do_not(write: Write) -> None:
    check(ring(hole_x=1.0005), ring(), write)
    with pytest.raises(
        OutputError, match=r"001_TPE_base\.dxf: .* 0\.002000 mm off at x (0\.5|1\.5)"
    ):
        check(ring(hole_x=1.002), ring(), write)


def test_area_is_held_to_a_ten_thousandth(write: Write) -> None:
    """0.9 um on the radius of 5 mm is inside a micrometre and 3.6e-4 of the area."""
    with pytest.raises(OutputError, match="its area is"):
        check(disc((0.0, 0.0), 5.0009), disc((0.0, 0.0), 5.0), write)


def test_missing_and_added_holes_are_found(write: Write) -> None:
    with pytest.raises(OutputError, match="has 0 holes, not 1"):
        check(disc((0.0, 0.0), 5.0), ring(), write)
    with pytest.raises(OutputError, match="has 2 holes, not 1"):
        check(ring() - disc((-2.0, 0.0), 0.5), ring(), write)


def test_outline_before_its_hole_is_found(write: Write) -> None:
    backwards = cutting_sequence(ring())[::-1]
    with pytest.raises(OutputError, match="CUT_OUTER is cut before CUT_INNER"):
        verify_file(write(dxf_text(backwards, {})), ring(), {})


def test_a_notch_that_misses_every_sample_is_found_either_way(write: Write) -> None:
    """A slit of 0.05 mm2 in a sheet of 10000 mm2 is too small for the area to tell."""
    sheet = rectangle((0.0, 0.0), (100.0, 100.0))
    slit = sheet - rectangle((20.0, -1.0), (20.05, 1.0))
    for found, expected in ((slit, sheet), (sheet, slit)):
        with pytest.raises(OutputError, match=r"1\.000000 mm off at x 20\.[05]"):
            check(found, expected, write)


def test_a_shorter_turned_or_second_path_of_a_seam_is_another() -> None:
    line, short = Line((0.0, 0.0), (10.0, 0.0)), Line((0.0, 0.0), (9.0, 0.0))
    turned = Line((10.0, 0.0), (0.0, 0.0))
    assert path_difference(((line,),), ((line,),)) is None
    assert "1.000 mm off at x 10.000, y 0.000" in str(path_difference(((short,),), ((line,),)))
    assert "10.000 mm off" in str(path_difference(((turned,),), ((line,),)))
    assert path_difference(((line,), (short,)), ((line,),)) == "it has 2 paths, not 1"
