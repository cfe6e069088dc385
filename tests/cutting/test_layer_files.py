"""One cut file a layer: verified, copied where patterns are equal, the same in every run."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from sbafab.cutting import layer_files
from sbafab.cutting.cut_settings import CutSettings
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.kerf import compensated_paths
from sbafab.cutting.layer_files import write_layer_files
from sbafab.errors import DesignError, OutputError
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
