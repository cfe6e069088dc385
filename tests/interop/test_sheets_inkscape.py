"""Inkscape imports film sheets and shows their pictures, at their size."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from PIL import Image

from tests.interop.made import EXACT, LENGTH, WIDTH, Sheet, outline_bounds
from tests.interop.page import film_is_as_on_the_page
from tests.interop.painting import Painted, painted

INKSCAPE = shutil.which("inkscape")
PYTHON = "/usr/bin/python3"
"""The one that Inkscape runs its extensions with."""
COARSE, FINE = 300, 600
"""Dots an inch; imported lines are 0.26 mm wide, the picture's own 0.1 mm."""
A4_HEIGHT = 297.0
PIXELS_PER_MM = 96 / 25.4
"""Inkscape's own, whatever it exports."""

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(INKSCAPE is None, reason="no Inkscape here"),
]


def inkscape(*arguments: str) -> str:
    done = subprocess.run(
        [str(INKSCAPE), *arguments], capture_output=True, text=True, timeout=60, check=True
    )
    return done.stdout


def exported(drawing: Path, dots: int, folder: Path, *options: str) -> Image.Image:
    picture = folder / "picture.png"
    look = ("--export-type=png", f"--export-dpi={dots}", "--export-background=white")
    inkscape(*look, *options, f"--export-filename={picture}", str(drawing))
    with Image.open(picture) as opened:
        return opened.convert("RGB")


def imported(sheet: Sheet, folder: Path) -> Path:
    """What Inkscape's own importer makes of a DXF file: its dialogue needs a screen."""
    extensions = Path(inkscape("--system-data-directory").strip()) / "extensions"
    command = [PYTHON, str(extensions / "dxf_input.py"), "--scalemethod=file"]
    command.append(str(sheet.files["bulges"]))
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if "ModuleNotFoundError" in done.stderr:
        pytest.skip("Inkscape's importer wants python3-lxml, python3-numpy and python3-cssselect")
    assert done.returncode == 0, done.stderr
    drawing = folder / "imported.svg"
    drawing.write_text(done.stdout, encoding="utf-8")
    return drawing


def agrees(found: Painted, sheet: Sheet, reads: str) -> None:
    assert found.film == pytest.approx(sheet.film, rel=EXACT)
    film_is_as_on_the_page(f"Inkscape 1.2.2, {reads}", sheet, found.film)
    assert (found.pieces, found.holes) == (len(sheet.outers), len(sheet.holes))
    bounds = outline_bounds(sheet.files["bulges"])
    assert found.bounds == pytest.approx(bounds, abs=0.2)


def test_the_imported_cut_file_has_the_area(sheet: Sheet, tmp_path: Path) -> None:
    # The importer puts the origin at the lower left corner of an A4 page.
    corner = (0.0, A4_HEIGHT - LENGTH, WIDTH, A4_HEIGHT)
    area = ":".join(str(place * PIXELS_PER_MM) for place in corner)
    picture = exported(imported(sheet, tmp_path), COARSE, tmp_path, f"--export-area={area}")
    agrees(painted(picture, COARSE / 25.4), sheet, "DXF")


def test_layers_are_imported_under_their_names(sheet: Sheet, tmp_path: Path) -> None:
    drawing = imported(sheet, tmp_path).read_text(encoding="utf-8")
    named = re.findall(r'inkscape:label="(\w+)"', drawing)
    assert {"ENGRAVE", "CUT_INNER", "CUT_OUTER", "REFERENCE"} <= set(named)


def test_the_picture_has_the_area(sheet: Sheet, tmp_path: Path) -> None:
    picture = exported(sheet.picture, FINE, tmp_path)
    assert picture.size == pytest.approx((WIDTH / 25.4 * FINE, LENGTH / 25.4 * FINE), abs=1.0)
    agrees(painted(picture, FINE / 25.4), sheet, "SVG")


@pytest.mark.usefixtures("fine_arcs")
def test_objects_have_their_sizes(sheet: Sheet) -> None:
    """Inkscape says what objects measure with their lines, in pixels of 1/96 inch."""
    rows = [row.split(",") for row in inkscape("--query-all", str(sheet.picture)).splitlines()]
    found = {name: [float(value) / PIXELS_PER_MM for value in values] for name, *values in rows}
    x, y, width, height = found["CUT_OUTER"]
    low_x, low_y, high_x, high_y = outline_bounds(sheet.files["bulges"])
    # A line is 0.1 mm wide, and wider where it turns a corner.
    assert (x, y) == pytest.approx((low_x - 0.05, LENGTH - high_y - 0.05), abs=0.025)
    assert (width, height) == pytest.approx((high_x - low_x + 0.1, high_y - low_y + 0.1), abs=0.05)
