"""A folded film's folder: one cut file for its halves, and each half measured from that file."""

from __future__ import annotations

from pathlib import Path

import ezdxf
import pytest
import tomli_w

from sbafab.api import check_folder, generate
from sbafab.folders.check import read_folder, rules_as_cut
from tests.designs import tables


def made(folder: Path) -> Path:
    path = folder / "folded.toml"
    path.write_text(tomli_w.dumps(tables("folded")), encoding="utf-8")
    return generate(path, out=folder / "out").folder


def test_a_folded_folder_is_as_designed_and_a_moved_half_is_found(tmp_path: Path) -> None:
    folder = made(tmp_path)
    files = sorted(path.name for path in (folder / "layers").iterdir())
    assert files == ["001_TPE_base.dxf", "002_PTFE_chamber-mask.dxf"]
    assert not [finding for finding in check_folder(folder) if finding.verdict == "fail"]
    nest = folder / "sheets" / "TPE_1.dxf"
    outlines = [e for e in ezdxf.readfile(nest).modelspace() if e.dxf.layer == "CUT_OUTER"]
    # One part and its spare.
    assert len(outlines) == 2
    # The half that is folded over ends 0.3 mm short at its far edge, x = -61.
    document = ezdxf.readfile(folder / "layers" / files[0])
    (outline,) = [e for e in document.modelspace() if e.dxf.layer == "CUT_OUTER"]
    points = [
        (x + 0.3 if x < -60.9 else x, y, *rest) for x, y, *rest in outline.get_points("xyseb")
    ]
    outline.set_points(points, format="xyseb")
    document.saveas(folder / "layers" / files[0])
    built = read_folder(folder)
    assert built.laminate is not None
    lower, _, upper = (layer.profile for layer in built.laminate.layers)
    assert lower.bounds[2] == pytest.approx(21, abs=1e-6)
    assert upper.bounds[2] == pytest.approx(20.7, abs=1e-6)
    bond = next(finding for finding in rules_as_cut(built) if finding.rule == "bond-width")
    assert bond.measured == pytest.approx(0.7, abs=1e-6)
    assert bond.verdict == "fail"


def test_a_turned_layer_is_cut_turned_over_and_read_back_as_it_lies(tmp_path: Path) -> None:
    data = tables("folded") | {"name": "turned"}
    del data["folds"]
    data["layers"][2]["turned"] = True
    path = tmp_path / "turned.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    rules = ["sealing", "tube-fit", "mask-overhang"]
    folder = generate(path, out=tmp_path / "out", rules={"waive": rules}).folder
    cap = folder / "layers" / "003_TPE_cap.dxf"
    document = ezdxf.readfile(cap)
    (outline,) = [e for e in document.modelspace() if e.dxf.layer == "CUT_OUTER"]
    xs = [x for x, *_ in outline.get_points("xy")]
    # It lies from -20 to 21.
    assert (min(xs), max(xs)) == (-21, 20)
    assert not [finding for finding in check_folder(folder) if finding.verdict == "fail"]
    points = [
        (x + 0.25 if x < -20.9 else x, y, *rest) for x, y, *rest in outline.get_points("xyseb")
    ]
    outline.set_points(points, format="xyseb")
    document.saveas(cap)
    built = read_folder(folder)
    assert built.laminate is not None
    assert built.laminate.layers[2].profile.bounds[2] == pytest.approx(20.75, abs=1e-6)
