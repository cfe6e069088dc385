"""OpenSCAD imports film sheets of the profile that is meant for it, layer by layer."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from sbafab.cutting.properties import DxfProfile
from tests.interop.made import EXACT, Sheet
from tests.interop.page import contours_are_as_on_the_page
from tests.interop.svg_contours import svg_contours

OPENSCAD = shutil.which("openscad")
SIDES = 360
"""Chords of a full circle: 5e-5 of its area."""

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(OPENSCAD is None, reason="no OpenSCAD here"),
]


def imported(sheet: Sheet, profile: DxfProfile, layer: str, folder: Path) -> list[float]:
    """Areas of what OpenSCAD makes of one layer, least first."""
    script, exported = folder / "sheet.scad", folder / f"{layer}.svg"
    script.write_text(f'$fn={SIDES}; import("{sheet.files[profile]}", layer="{layer}");')
    command = [str(OPENSCAD), "-o", str(exported), str(script)]
    subprocess.run(command, capture_output=True, timeout=60, check=True)
    drawing = svg_contours(exported)
    return sorted(polygon.area for found in drawing.contours.values() for polygon in found)


def test_lines_and_arcs_close_to_every_contour(sheet: Sheet, tmp_path: Path) -> None:
    outers = imported(sheet, "arcs", "CUT_OUTER", tmp_path)
    assert outers == pytest.approx(sheet.outers, rel=EXACT)
    holes = imported(sheet, "arcs", "CUT_INNER", tmp_path)
    assert holes == pytest.approx(sheet.holes, rel=EXACT)
    contours_are_as_on_the_page("OpenSCAD 2021.01", sheet, outers, holes)


def test_bulges_are_lost_without_a_word(sheets: dict[str, Sheet], tmp_path: Path) -> None:
    """That is what the profile of lines and arcs is for."""
    sheet = sheets["3dof-15mm TPE"]
    outers = imported(sheet, "bulges", "CUT_OUTER", tmp_path)
    assert sum(outers) < 0.9 * sum(sheet.outers)
