"""``sbafab new coupon`` and ``sbafab kerf``, from the empty table to the lines to paste."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.conftest import Run


@pytest.fixture
def table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run) -> Path:
    """A coupon's table filled in for a kerf of 0.12 along x and 0.1 along y."""
    monkeypatch.chdir(tmp_path)
    assert run("new", "coupon")[0] == 0
    assert sorted(path.name for path in Path("coupon").iterdir()) == [
        "coupon.csv",
        "coupon.dxf",
        "coupon.svg",
    ]
    lines = []
    for line in Path("coupon/coupon.csv").read_text().splitlines():
        name, _, rest = line.partition(",")
        if name.endswith(("outer", "window", "piece")):
            axis, nominal, _ = rest.split(",")
            kerf = {"x": 0.12, "y": 0.1}[axis] * (1 if name.endswith("window") else -1)
            line += f"{float(nominal) + kerf:.3f}"  # noqa: PLW2901
        lines.append(line)
    path = Path("coupon/coupon.csv")
    path.write_text("\n".join(lines))
    return path


def test_kerfs_that_differ_are_pasted_as_a_pair(table: Path, run: Run) -> None:
    code, out, _ = run("kerf", str(table), "--resolution", "0.001")
    assert code == 0
    assert tomllib.loads(out[out.index("[laser]") :]) == {"laser": {"kerf_tpe": [0.12, 0.1]}}
    assert "x and y differ by 0.0200 mm" in out
    assert "warning" not in out


def test_one_kerf_for_both_where_it_is_asked_for(table: Path, run: Run) -> None:
    _, out, _ = run("kerf", str(table), "--resolution", "0.001", "--no-split-xy")
    assert tomllib.loads(out[out.index("[laser]") :]) == {"laser": {"kerf_tpe": 0.11}}
    assert "a common kerf does not correct this" in out


def test_kerfs_that_do_not_differ_are_one(table: Path, run: Run) -> None:
    _, out, _ = run("kerf", str(table), "--resolution", "0.1")
    assert tomllib.loads(out[out.index("[laser]") :])["laser"]["kerf_tpe"] == 0.11


def test_a_kerf_that_may_be_none_is_not_pasted_bare(tmp_path: Path, run: Run) -> None:
    """Kerfs 0.05 and 0.07: t = 12.7062, so that 0.06 +- 0.13; from -0.067 to 0.187."""
    path = tmp_path / "two.csv"
    path.write_text("feature;axis;nominal_mm;measured_mm\nA outer;x;24;23,95\nA window;y;8;8,07\n")
    code, out, _ = run("kerf", str(path), "--resolution", "0")
    assert code == 0
    says = "the kerf may be zero: its 95 % interval is -0.067 to 0.187 mm from 2 sizes"
    assert f"\nwarning: {says}" in out
    assert "Paste into the design file" not in out
    pasted = out[out.index("[laser]") :]
    assert f"# warning: {says}" in pasted
    assert tomllib.loads(pasted) == {"laser": {"kerf_tpe": 0.06}}


def test_a_typo_names_its_line(table: Path, run: Run) -> None:
    lines = table.read_text().splitlines()
    (row,) = (n for n, line in enumerate(lines) if line.startswith("D window,y"))
    assert lines[row].endswith(",6.100")
    lines[row] = lines[row].replace("6.100", "61.100")
    table.write_text("\n".join(lines))
    code, out, err = run("kerf", str(table))
    assert (code, out) == (2, "")
    assert f"coupon.csv, line {row + 1}: the window along y, nominal 6 and measured 61.1 mm" in err


def test_x_and_y_apart_for_programs(table: Path, run: Run) -> None:
    arguments = ["kerf", str(table), "--material", "ptfe", "--split-xy", "--json"]
    code, out, _ = run(*arguments, "--resolution", "0.001")
    assert code == 0
    said = json.loads(out)
    assert said["x"]["kerf"]["value"] == pytest.approx(0.12)
    assert said["y"]["kerf"]["value"] == pytest.approx(0.1)
    assert said["differs"] is True
    assert tomllib.loads(said["toml"]) == {"laser": {"kerf_ptfe": [0.12, 0.1]}}


def changed_sizes(table: Path, change: Callable[[float, float], float]) -> None:
    """Write the table with other sizes, from the nominal one and that read."""
    lines = table.read_text().splitlines()
    (head,) = (n for n, line in enumerate(lines) if line.startswith("feature"))
    changed = [
        f"{','.join(cells[:3])},{change(float(cells[2]), float(cells[3])):.3f}"
        for cells in (line.split(",") for line in lines[head + 1 :])
    ]
    table.write_text("\n".join([*lines[: head + 1], *changed]))


def test_a_constant_reading_error_is_told_and_corrected_for(table: Path, run: Run) -> None:
    """A calliper that reads 0.03 mm too much: the old advice was to change the laser."""
    changed_sizes(table, lambda nominal, measured: measured + 0.03)
    arguments = ["kerf", str(table), "--resolution", "0.001", "--instrument", "calliper"]
    code, out, _ = run(*arguments)
    assert code == 0
    assert "the calliper reads 0.0300 mm too much" in out
    assert "warning" not in out
    assert "laser" not in out[: out.index("[laser]")]
    assert "the jaws of a calliper compress thin film" in out
    assert tomllib.loads(out[out.index("[laser]") :]) == {"laser": {"kerf_tpe": [0.12, 0.1]}}
    arguments[-1] = "scanner"
    assert "jaws" not in run(*arguments)[1]


def test_outsides_alone_are_pasted_with_a_warning(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "outers.csv"
    rows = "".join(f"A outer,{axis},{n},{n - 0.12:.2f}\n" for axis in "xy" for n in (24, 20, 16))
    path.write_text(f"feature,axis,nominal_mm,measured_mm\n{rows}")
    _, out, _ = run("kerf", str(path), "--instrument", "microscope")
    says = "a constant reading error cannot be separated from the kerf"
    assert f"warning: {says}" in out
    assert f"# warning: {says}" in out[out.index("[laser]") :]


def test_shrunk_film_draws_a_warning(table: Path, run: Run) -> None:
    changed_sizes(table, lambda nominal, measured: measured - 0.003 * nominal)
    code, out, _ = run("kerf", str(table), "--resolution", "0.001")
    assert code == 0
    assert "warning: sizes along x are 0.9970 times the drawn ones" in out
    assert "Check the instrument with a gauge of known length" in out
    assert "steps per mm" not in out
    assert tomllib.loads(out[out.index("[laser]") :]) == {"laser": {"kerf_tpe": [0.12, 0.1]}}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: text.replace("measured_mm", "size"), "no column measured_mm"),
        (lambda text: text.replace("24.120", "wide").replace("23.880", "wide"), "not a number"),
        (lambda text: "\n".join(text.splitlines()[:5]), "needs 2"),
        (lambda text: text.replace("outer", "cave").replace("window", "outer"), "must end in"),
        (
            lambda text: (
                text.replace("outer", "?").replace("window", "outer").replace("?", "window")
            ),
            "negative",
        ),
    ],
)
def test_a_bad_table_is_one_sentence_and_exit_2(
    change: object, says: str, table: Path, run: Run
) -> None:
    table.write_text(change(table.read_text()))  # type: ignore[operator]
    code, out, err = run("kerf", str(table))
    assert (code, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1


def test_no_table_and_no_second_coupon(table: Path, run: Run) -> None:
    for arguments in (["kerf", "nosuch.csv"], ["new", "coupon"]):
        code, out, err = run(*arguments)
        assert (code, out) == (2, "")
        assert err.count("\n") == 1


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
    arguments = ["cut", "1dof-5mm", *narrow, *kerf, "-o", str(tmp_path)]
    code, out, _ = run(*arguments)
    assert code == 1
    said = " ".join(out.split())
    assert "has a hole that vanishes at x 0.000, y 0.000" in said
    assert "kerf of 0.5 x 1 mm" in said


def test_chords_do_not_go_with_two_widths(tmp_path: Path, run: Run) -> None:
    arguments = ["cut", "1dof-5mm", "--set", "laser.kerf_tpe=[0.1,0.08]", "-o", str(tmp_path)]
    code, _, err = run(*arguments, "--dxf-profile", "chords")
    assert code == 2
    assert "write bulges or arcs" in err
