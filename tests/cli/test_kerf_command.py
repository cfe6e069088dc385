"""``sbafab new coupon`` and ``sbafab kerf``, from the empty table to the lines to paste."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import Run

FINE = ("--resolution", "0.001")


@pytest.fixture
def table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run) -> Path:
    """A coupon's table filled in for a kerf of 0.12 along x and 0.1 along y."""
    monkeypatch.chdir(tmp_path)
    assert run("new", "coupon")[0] == 0
    names = {path.name for path in Path("coupon").iterdir()}
    assert names == {"coupon.csv", "coupon.dxf", "coupon.svg"}
    path = Path("coupon/coupon.csv")
    kerf = {"x": 0.12, "y": 0.1}
    filled(path, lambda n, axis, is_window: n + kerf[axis] * (1 if is_window else -1))
    return path


def filled(table: Path, size: Callable[[float, str, bool], float]) -> None:
    """Fill in each size from its nominal one and axis; a window is measured inside."""
    lines = table.read_text().splitlines()
    (head,) = (n for n, line in enumerate(lines) if line.startswith("feature"))
    for number, line in enumerate(lines[head + 1 :], head + 1):
        name, axis, nominal, *_ = line.split(",")
        measured = size(float(nominal), axis, name.endswith("window"))
        lines[number] = f"{name},{axis},{nominal},{measured:.3f}"
    table.write_text("\n".join(lines))


def pasted(out: str) -> Any:
    return tomllib.loads(out[out.index("[laser]") :])["laser"]


def test_kerfs_that_differ_are_pasted_as_a_pair_if_asked_or_found(table: Path, run: Run) -> None:
    code, out, _ = run("kerf", str(table), *FINE)
    assert code == 0
    assert pasted(out) == {"kerf_tpe": [0.12, 0.1]}
    assert "x and y differ by 0.0200 mm" in out
    assert "warning" not in out
    # One for both if it is asked for, or if the reading cannot tell them apart.
    out = run("kerf", str(table), *FINE, "--no-split-xy")[1]
    assert pasted(out) == {"kerf_tpe": 0.11}
    assert "a common kerf does not correct this" in out
    assert pasted(run("kerf", str(table), "--resolution", "0.1")[1]) == {"kerf_tpe": 0.11}
    out = run("kerf", str(table), "--material", "ptfe", "--split-xy", "--json", *FINE)[1]
    said = json.loads(out)
    assert (said["x"]["kerf"]["value"], said["y"]["kerf"]["value"]) == pytest.approx((0.12, 0.1))
    assert said["differs"] is True
    assert tomllib.loads(said["toml"]) == {"laser": {"kerf_ptfe": [0.12, 0.1]}}
    assert run("new", "coupon")[0] == 2


def test_a_kerf_that_may_be_none_is_not_pasted_bare(tmp_path: Path, run: Run) -> None:
    """Kerfs 0.05 and 0.07: t = 12.7062, so that 0.06 +- 0.13; from -0.067 to 0.187."""
    path = tmp_path / "two.csv"
    path.write_text("feature;axis;nominal_mm;measured_mm\nA outer;x;24;23,95\nA window;y;8;8,07\n")
    code, out, _ = run("kerf", str(path), "--resolution", "0")
    assert code == 0
    says = "the kerf may be zero: its 95 % interval is -0.067 to 0.187 mm from 2 sizes"
    assert f"\nwarning: {says}" in out
    assert "Paste into the design file" not in out
    assert f"# warning: {says}" in out[out.index("[laser]") :]
    assert pasted(out) == {"kerf_tpe": 0.06}


def test_a_constant_reading_error_is_told_and_corrected_for(table: Path, run: Run) -> None:
    """A calliper that reads 0.03 mm too much, which is no reason to change the laser."""
    kerf = {"x": 0.12, "y": 0.1}
    filled(table, lambda n, axis, is_window: n + kerf[axis] * (1 if is_window else -1) + 0.03)
    code, out, _ = run("kerf", str(table), *FINE, "--instrument", "calliper")
    assert code == 0
    assert "the calliper reads 0.0300 mm too much" in out
    assert "warning" not in out
    assert "laser" not in out[: out.index("[laser]")]
    assert "the jaws of a calliper compress thin film" in out
    assert pasted(out) == {"kerf_tpe": [0.12, 0.1]}
    assert "jaws" not in run("kerf", str(table), *FINE, "--instrument", "scanner")[1]


def test_what_spoils_a_kerf_is_a_warning(table: Path, run: Run) -> None:
    kerf = {"x": 0.12, "y": 0.1}
    filled(table, lambda n, axis, is_window: 0.997 * n + kerf[axis] * (1 if is_window else -1))
    out = run("kerf", str(table), *FINE)[1]
    assert "warning: sizes along x are 0.9970 times the drawn ones" in out
    assert "Check the instrument with a gauge of known length" in out
    assert pasted(out) == {"kerf_tpe": [0.12, 0.1]}
    rows = "".join(f"A outer,{axis},{n},{n - 0.12:.2f}\n" for axis in "xy" for n in (24, 20, 16))
    table.write_text(f"feature,axis,nominal_mm,measured_mm\n{rows}")
    out = run("kerf", str(table), "--instrument", "microscope")[1]
    says = "a constant reading error cannot be separated from the kerf"
    assert f"warning: {says}" in out
    assert f"# warning: {says}" in out[out.index("[laser]") :]


def test_a_calibrated_folder_checks_as_built(tmp_path: Path, run: Run) -> None:
    settings = ["stack.balloons=2", "laser.kerf_tpe=0.12", "laser.kerf_ptfe=[0.1,0.08]"]
    arguments = [part for setting in settings for part in ("--set", setting)]
    code, _, _ = run("cut", "1dof-5mm", *arguments, "-o", str(tmp_path))
    assert code == 0
    folder = tmp_path / "1dof-5mm"
    names = sorted(path.name for path in (folder / "layers").iterdir())
    assert names[:2] == ["001_TPE_base_kerf0.12.dxf", "002_PTFE_chamber-mask_kerf0.1x0.08.dxf"]
    kerf = json.loads((folder / "manifest.json").read_text())["kerf"]
    assert kerf["TPE"] == {"state": "compensated", "width": 0.12}
    assert kerf["PTFE"] == {"state": "compensated", "width": [0.1, 0.08]}
    code, out, _ = run("check", "-v", str(folder))
    assert code == 0
    assert "hashes and manifest match the files" in " ".join(out.split())


def test_a_kerf_that_takes_a_bore_is_told_with_its_place(tmp_path: Path, run: Run) -> None:
    narrow = ["--set", "bore.diameter=1", "--set", "bore.pin_diameter=0.96"]
    kerf = ["--set", "laser.kerf_ptfe=[0.5,1.0]"]
    code, out, _ = run("cut", "1dof-5mm", *narrow, *kerf, "-o", str(tmp_path))
    assert code == 1
    said = " ".join(out.split())
    assert "has a hole that vanishes at x 0.000, y 0.000" in said
    assert "kerf of 0.5 x 1 mm" in said
