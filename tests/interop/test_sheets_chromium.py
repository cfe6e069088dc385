"""Chromium shows the pictures of film sheets at their size, in CSS pixels of 1/96 inch."""

from __future__ import annotations

import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.interop.made import EXACT, LENGTH, WIDTH, Sheet, outline_bounds
from tests.interop.page import film_is_as_on_the_page
from tests.interop.painting import painted

NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next(filter(None, map(shutil.which, NAMES)), None)
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-background-networking",
    "--no-first-run",
    "--hide-scrollbars",
)
COARSE, FINE = 4, 8
"""Pixels of the screenshot along a CSS pixel; the fewer, the coarser are the chords of arcs."""
PIXELS_PER_MM = 96 / 25.4
# Holes over outlines: red where there is film, black in the holes, white beside.
FILLED = """<style>
body { margin: 0 } svg { display: block } g { display: none }
#CUT_OUTER, #CUT_INNER { display: inline; stroke: none; mix-blend-mode: multiply }
#CUT_OUTER { fill: #f00 } #CUT_INNER { fill: #00f }
</style>"""

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here"),
]


def shown(page: Path, finer: int, folder: Path) -> Image.Image:
    """What the browser shows of a page, cut to the size of the sheet."""
    shot = folder / "shot.png"
    window = f"{math.ceil(WIDTH * PIXELS_PER_MM)},{math.ceil(LENGTH * PIXELS_PER_MM)}"
    command = [str(CHROMIUM), *FLAGS, f"--user-data-dir={folder / 'profile'}"]
    look = [f"--window-size={window}", f"--force-device-scale-factor={finer}"]
    subprocess.run(
        [*command, *look, f"--screenshot={shot}", page.as_uri()],
        capture_output=True,
        timeout=60,
        check=True,
    )
    size = round(WIDTH * finer * PIXELS_PER_MM), round(LENGTH * finer * PIXELS_PER_MM)
    with Image.open(shot) as opened:
        return opened.convert("RGB").crop((0, 0, *size))


def test_lines_lie_where_they_are_cut(sheet: Sheet, tmp_path: Path) -> None:
    found = painted(shown(sheet.picture, COARSE, tmp_path), COARSE * PIXELS_PER_MM)
    assert (found.pieces, found.holes) == (len(sheet.outers), len(sheet.holes))
    bounds = outline_bounds(sheet.files["bulges"])
    assert found.bounds == pytest.approx(bounds, abs=0.1)


def test_what_the_lines_enclose_has_the_area(sheet: Sheet, tmp_path: Path) -> None:
    page = tmp_path / "filled.html"
    page.write_text(FILLED + sheet.picture.read_text(encoding="utf-8"), encoding="utf-8")
    channels = shown(page, FINE, tmp_path).split()
    red, green, _ = (int(np.asarray(channel).sum(dtype=np.int64)) for channel in channels)
    film = (red - green) / 255 / (FINE * PIXELS_PER_MM) ** 2
    assert film == pytest.approx(sheet.film, rel=EXACT)
    film_is_as_on_the_page("Chromium 156", sheet, film)
