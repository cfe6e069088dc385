"""``sbafab inspect``: what it prints and writes, what reads that, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from sbafab.cli import main
from tests.cli.conftest import Run
from tests.lab.scans import Camera, render, save

CAMERA = Camera(dpi=400, kerf=0.14, tilt=1)


@pytest.fixture(scope="module")
def coupon(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calibration piece and its scan."""
    out = tmp_path_factory.mktemp("coupon")
    with pytest.raises(SystemExit) as stop:
        main(["new", "coupon", str(out / "coupon")])
    assert stop.value.code == 0
    drawing = out / "coupon/coupon.dxf"
    save(render(drawing, CAMERA), out / "scan.png", CAMERA.dpi)
    save(render(drawing, CAMERA), out / "bare.png", None)
    save(render(drawing, CAMERA, lambda pieces: pieces[1:]), out / "less.png", CAMERA.dpi)
    return out


def test_a_scan_of_the_coupon_gives_the_kerf_twice(coupon: Path, tmp_path: Path, run: Run) -> None:
    """By all edges, and by the sizes through ``sbafab kerf``; both go to the record."""
    arguments = ["inspect", str(coupon / "coupon/coupon.dxf"), str(coupon / "scan.png")]
    code, out, err = run(*arguments, "-o", str(tmp_path), "--json")
    assert (code, err) == (0, "")
    result = json.loads(out)
    assert result["kerf"]["value"] == pytest.approx(0.14, abs=0.004)
    stem = tmp_path / "coupon-scan"
    assert (
        json.loads(Path(f"{stem}.json").read_text(encoding="utf-8"))["pieces"] == result["pieces"]
    )
    assert "<svg" in Path(f"{stem}.svg").read_text(encoding="utf-8")
    code, out, _ = run("kerf", f"{stem}_sizes.csv", "--json")
    assert code == 0
    assert json.loads(out)["all"]["kerf"]["value"] == pytest.approx(0.14, abs=0.006)
    record = ["record", "1dof-5mm", "--serial", "A1", "--lab", str(tmp_path / "lab.sqlite")]
    code, out, err = run(*record, "--history", f"{stem}_history.json")
    assert (code, err) == (0, "")
    assert result["picture_sha256"] in out


def test_a_missing_piece_ends_in_code_1(coupon: Path, tmp_path: Path, run: Run) -> None:
    arguments = ["inspect", str(coupon / "coupon/coupon.dxf"), str(coupon / "less.png")]
    code, out, _ = run(*arguments, "-o", str(tmp_path))
    assert code == 1
    assert "is missing" in out
    assert out.rstrip().endswith("coupon: 3 of 4 pieces as drawn")


def test_a_bar_tells_the_scale(coupon: Path, tmp_path: Path, run: Run) -> None:
    """The scan is 400 dpi, and the bar beside the frames is 30 mm, drawn as 400.8 dpi would."""
    pixels = render(coupon / "coupon/coupon.dxf", Camera(dpi=400, margin=12))
    image = Image.fromarray(pixels)
    length = 30 * 400.8 / 25.4
    ImageDraw.Draw(image).rectangle((100, 40, 100 + round(length) - 1, 80), fill=190)
    image.save(tmp_path / "bar.png")
    arguments = ["inspect", str(coupon / "coupon/coupon.dxf"), str(tmp_path / "bar.png")]
    code, out, _ = run(*arguments, "--bar", "30", "-o", str(tmp_path), "--json")
    assert code == 0
    expected = 30 / (round(length) * 25.4 / 400)
    assert json.loads(out)["scale"]["x"] == pytest.approx(expected, abs=4e-4)


@pytest.mark.parametrize(
    ("picture", "more", "says"),
    [
        ("coupon/coupon.csv", [], "not a picture that can be read"),
        ("none.png", [], "is not a file"),
        ("bare.png", [], "states no resolution; give the --dpi"),
        ("scan.png", ["--dpi", "300"], "does not show coupon"),
        # Read as a sheet without its pieces, the film seems larger than drawn.
        ("scan.png", ["--paper", "light"], ""),
        ("scan.png", ["--pins"], "--pins needs 2 pins"),
        ("scan.png", ["--bar", "55"], "no bar of about that length"),
        ("scan.png", ["--bar", "-1"], "must be a length above 0 mm"),
        ("dark.png", [], "film and paper differ by"),
        ("tiny.png", [], "too small to measure"),
    ],
)
def test_bad_input_is_one_sentence(
    picture: str, more: list[str], says: str, coupon: Path, tmp_path: Path, run: Run
) -> None:
    save(np.full((200, 200), 9, dtype=np.uint8), coupon / "dark.png", 400)
    save(np.full((20, 20), 9, dtype=np.uint8), coupon / "tiny.png", 400)
    out = tmp_path / "out"
    arguments = ["inspect", str(coupon / "coupon/coupon.dxf"), str(coupon / picture), *more]
    code, printed, err = run(*arguments, "-o", str(out))
    assert (code, printed, err.count("\n")) == (2, "", 1)
    assert says in err
    assert not out.exists()
