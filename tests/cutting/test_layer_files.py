"""One cut file a layer: verified, copied where patterns are equal, the same in every run."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import pytest

from sbafab.cutting import layer_files
from sbafab.cutting.cut_settings import CutSettings
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import compensated_paths
from sbafab.cutting.layer_files import path_difference, write_layer_files
from sbafab.cutting.sequence import cutting_sequence
from sbafab.cutting.verify import verify_file
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.edges import Line
from sbafab.geometry.region import Region, disc, rectangle
from sbafab.laminate.laminate import Laminate
from sbafab.runtime import Counted

SETTINGS = CutSettings("two-plates", "ab" * 32)
CALIBRATED = CutSettings(
    "two-plates",
    "ab" * 32,
    {"TPE": 0.1, "PTFE": None},
    ("bond-width", "tube-fit"),
    generator="sbafab 1.2.3",
)


def written(
    laminate: Laminate, folder: Path, settings: CutSettings, progress: Counted | None = None
) -> dict[str, str]:
    paths = compensated_paths(laminate, settings)
    return write_layer_files(laminate, paths, folder, settings, progress)


def test_every_layer_has_its_file(laminate: Laminate, tmp_path: Path) -> None:
    made = written(laminate, tmp_path, SETTINGS)
    names = [
        "layers/001_TPE_base.dxf",
        "layers/002_PTFE_chamber-mask.dxf",
        "layers/003_TPE_cap.dxf",
    ]
    assert sorted(made) == names
    assert sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*.dxf")) == names
    for file, layer in zip(names, laminate.layers, strict=True):
        assert hashlib.sha256((tmp_path / file).read_bytes()).hexdigest() == made[file]
        assert read_profile(tmp_path / file).region.key == layer.profile.key


def test_kerf_is_stated_and_done_for_each_material(laminate: Laminate, tmp_path: Path) -> None:
    base, mask, _ = sorted(written(laminate, tmp_path, CALIBRATED))
    found = read_profile(tmp_path / base)
    assert found.properties == {
        "DESIGN": "two-plates",
        "DESIGN_SHA256": "ab" * 32,
        "PATTERN": "P01",
        "MATERIAL": "TPE",
        "UNITS": "mm",
        "KERF_STATE": "compensated",
        "KERF_WIDTH": "0.1",
        "WAIVED": "bond-width, tube-fit",
        "GENERATOR": "sbafab 1.2.3",
    }
    radii = [contour.circle[1] for contour in found.region.holes if contour.circle]
    assert sorted(radii) == pytest.approx([0.45, 0.45, 0.45, 0.95], abs=1e-6)
    nominal = read_profile(tmp_path / mask)
    assert nominal.properties["KERF_STATE"] == "uncalibrated: nominal edges"
    assert nominal.properties["KERF_WIDTH"] == "none"
    assert nominal.region.key == laminate.layer(2).profile.key


def test_kerf_too_wide_names_the_layer(laminate: Laminate, tmp_path: Path) -> None:
    settings = CutSettings("two-plates", "", {"TPE": 1.1})
    with pytest.raises(DesignError, match=r"layer 001_TPE_base: .* hole at x .* vanishes"):
        written(laminate, tmp_path, settings)


def test_a_wrong_write_is_found(
    laminate: Laminate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = layer_files.dxf_text
    monkeypatch.setattr(layer_files, "dxf_text", lambda contours, *rest: write(contours[1:], *rest))
    with pytest.raises(OutputError, match=r"001_TPE_base\.dxf: it has 3 holes, not 4"):
        written(laminate, tmp_path, SETTINGS)


# Verification tells a file that differs from its profile, and names the place.


Write = Callable[[str], Path]


def ring(hole_x: float = 1.0, hole_radius: float = 0.5, radius: float = 5.0) -> Region:
    return disc((0.0, 0.0), radius) - disc((hole_x, 0.0), hole_radius)


def check(found: Region, expected: Region, write: Write) -> None:
    verify_file(write(dxf_text(cutting_sequence(found), {"A": "b"})), expected, {"A": "b"})


SHEET = rectangle((0.0, 0.0), (100.0, 100.0))
SLIT = SHEET - rectangle((20.0, -1.0), (20.05, 1.0))


@pytest.mark.parametrize(
    ("found", "expected", "says"),
    [
        (ring(hole_x=1.002), ring(), r"001_TPE_base\.dxf: .* 0\.002000 mm off at x (0\.5|1\.5)"),
        # 0.9 um on the radius of 5 mm is inside a micrometre and 3.6e-4 of the area.
        (disc((0.0, 0.0), 5.0009), disc((0.0, 0.0), 5.0), "its area is"),
        (disc((0.0, 0.0), 5.0), ring(), "has 0 holes, not 1"),
        (ring() - disc((-2.0, 0.0), 0.5), ring(), "has 2 holes, not 1"),
        # 0.05 mm2 of 10000 mm2 are too little for the area to tell, and miss every sample.
        (SLIT, SHEET, r"1\.000000 mm off at x 20\.[05]"),
        (SHEET, SLIT, r"1\.000000 mm off at x 20\.[05]"),
    ],
)
def test_another_profile_is_found(found: Region, expected: Region, says: str, write: Write) -> None:
    with pytest.raises(OutputError, match=says):
        check(found, expected, write)


def test_half_a_micrometre_passes(write: Write) -> None:
    check(ring(hole_x=1.0005), ring(), write)


def test_outline_before_its_hole_is_found(write: Write) -> None:
    backwards = cutting_sequence(ring())[::-1]
    with pytest.raises(OutputError, match="CUT_OUTER is cut before CUT_INNER"):
        verify_file(write(dxf_text(backwards, {})), ring(), {})


def test_a_shorter_turned_or_second_path_of_a_seam_is_another() -> None:
    line, short = Line((0.0, 0.0), (10.0, 0.0)), Line((0.0, 0.0), (9.0, 0.0))
    turned = Line((10.0, 0.0), (0.0, 0.0))
    assert path_difference(((line,),), ((line,),)) is None
    assert "1.000 mm off at x 10.000, y 0.000" in str(path_difference(((short,),), ((line,),)))
    assert "10.000 mm off" in str(path_difference(((turned,),), ((line,),)))
    assert path_difference(((line,), (short,)), ((line,),)) == "it has 2 paths, not 1"
