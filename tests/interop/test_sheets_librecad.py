"""LibreCAD prints film sheets at their size, in their colours, without the sheet's frame."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pypdfium2
import pytest
from PIL import Image

from tests.interop.made import EXACT, LENGTH, WIDTH, Sheet, outline_bounds
from tests.interop.page import film_is_as_on_the_page
from tests.interop.painting import painted

LIBRECAD = shutil.which("librecad")
DOTS = 600
"""Dots an inch."""

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(LIBRECAD is None, reason="no LibreCAD here"),
]


def printed(sheet: Sheet, folder: Path) -> Image.Image:
    """The sheet as LibreCAD prints it, at the lower left corner of a page of its own choice."""
    shutil.copy(sheet.files["bulges"], folder / "sheet.dxf")
    # Without its scale given, LibreCAD prints next to nothing; the PDF is in the current folder.
    subprocess.run(
        [str(LIBRECAD), "dxf2pdf", "-s", "1", "sheet.dxf"],
        cwd=folder,
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", "HOME": str(folder)},
        capture_output=True,
        timeout=60,
        check=True,
    )
    with pypdfium2.PdfDocument(folder / "sheet.pdf") as document:
        (page,) = document
        width, height = page.get_size()
        crop = (0.0, 0.0, width - WIDTH * 72 / 25.4, height - LENGTH * 72 / 25.4)
        picture: Image.Image = page.render(scale=DOTS / 72, crop=crop).to_pil()
        return picture.copy()


def test_its_print_has_the_area_and_the_contours(sheet: Sheet, tmp_path: Path) -> None:
    found = painted(printed(sheet, tmp_path), DOTS / 25.4)
    assert found.film == pytest.approx(sheet.film, rel=EXACT)
    film_is_as_on_the_page("LibreCAD 2.2.0", sheet, found.film)
    assert (found.pieces, found.holes) == (len(sheet.outers), len(sheet.holes))
    bounds = outline_bounds(sheet.files["bulges"])
    assert found.bounds == pytest.approx(bounds, abs=0.1)


def test_the_frame_does_not_print(sheets: dict[str, Sheet], tmp_path: Path) -> None:
    picture = printed(sheets["3dof-15mm TPE"], tmp_path)
    assert picture.size == pytest.approx((WIDTH / 25.4 * DOTS, LENGTH / 25.4 * DOTS), abs=1.0)
    margin = round(1.0 / 25.4 * DOTS)
    width, height = picture.size
    strips = [
        (0, 0, width, margin),
        (0, 0, margin, height),
        (width - margin, 0, width, height),
        (0, height - margin, width, height),
    ]
    for strip in strips:
        assert picture.crop(strip).convert("L").getextrema() == (255, 255)
