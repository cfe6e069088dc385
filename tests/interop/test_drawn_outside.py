"""Layers drawn in Inkscape, from import to traveller, and their cut files printed by LibreCAD."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pypdfium2
import pytest
from click.testing import CliRunner

from sbafab.cli import app
from tests.interop.painting import painted
from tests.interop.test_sheets import inkscape, program

pytestmark = pytest.mark.long

DOTS = 600
PAGE = 60.0
"""Of the drawings, mm: Inkscape's DXF counts y from the lower edge of the page."""
BOXES = {
    "film": ((9, 14, 42, 32), (28, 6, 4, 10)),
    "mask": ((10, 15, 40, 30), (29, 5.5, 2, 11)),
}
"""What is drawn of each layer: a pocket and a strip, by corner and size, y down."""
AREAS = {"film": 42 * 32 + 4 * 8.0, "mask": 40 * 30 + 2 * 9.5}
LAYERS = ("film", "mask", "film")


def draw(name: str, folder: Path, work: Path) -> None:
    """A layer's DXF: Inkscape joins the boxes to one path and writes it by its extension."""
    boxes = "".join(
        f'<rect x="{x}" y="{y}" width="{w}" height="{h}"/>' for x, y, w, h in BOXES[name]
    )
    head = f'width="{PAGE}mm" height="{PAGE}mm" viewBox="0 0 {PAGE} {PAGE}"'
    source, joined = work / f"{name}-boxes.svg", work / f"{name}.svg"
    source.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{boxes}</svg>')
    steps = f"select-all;path-union;export-plain-svg;export-filename:{joined};export-do"
    inkscape(f"--actions={steps}", str(source))
    extension = Path(inkscape("--system-data-directory").strip()) / "extensions/dxf_outlines.py"
    output = f"--output={folder / name}.dxf"
    command = ["/usr/bin/python3", str(extension), "--units=25.4/96", output, str(joined)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if "ModuleNotFoundError" in done.stderr:
        pytest.skip("Inkscape's exporter wants python3-lxml, python3-numpy and python3-cssselect")
    assert done.returncode == 0, done.stderr


def printed_area(drawing: Path, folder: Path) -> float:
    """What LibreCAD's print of a drawing encloses, mm2."""
    shutil.copy(drawing, folder / "layer.dxf")
    subprocess.run(
        [program("librecad"), "dxf2pdf", "-s", "1", "layer.dxf"],
        cwd=folder,
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", "HOME": str(folder)},
        capture_output=True,
        timeout=60,
        check=True,
    )
    with pypdfium2.PdfDocument(folder / "layer.pdf") as document:
        (page,) = document
        return painted(page.render(scale=DOTS / 72).to_pil(), DOTS / 25.4).film


def run(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result.output


def test_layers_drawn_in_inkscape_become_cut_files_and_a_traveller(tmp_path: Path) -> None:
    source, work, design = tmp_path / "outside", tmp_path / "work", tmp_path / "outside.toml"
    source.mkdir()
    work.mkdir()
    for name in BOXES:
        draw(name, source, work)
    (source / "layers.csv").write_text(
        "file,role\nfilm.dxf,base\nmask.dxf,chamber-mask\nfilm.dxf,cap"
    )
    chamber = f"pouch,30,{PAGE - 30},30,{PAGE - 6},90,2"
    (source / "chambers.csv").write_text(f"name,x,y,mouth_x,mouth_y,angle,width\n{chamber}\n")
    assert "3 layers in 2 patterns" in run("import", source, "--to", design)
    run("generate", design, "-o", tmp_path / "out", "--set", "rules.yield_builds=100")
    folder = tmp_path / "out" / "outside"
    layers = json.loads((folder / "manifest.json").read_text())["layers"]
    # Inkscape writes coordinates of a path to about 0.2 um of the page.
    expected = [AREAS[name] for name in LAYERS]
    assert [layer["area"] for layer in layers] == pytest.approx(expected, rel=1e-4)
    findings = json.loads((folder / "checks.json").read_text())["findings"]
    assert {finding["verdict"] for finding in findings} <= {"pass", "warn"}
    (bond,) = (finding for finding in findings if finding["rule"] == "bond-width")
    assert bond["measured"] == pytest.approx(1.0, abs=1e-3)
    assert "outside" in (folder / "traveller.html").read_text(encoding="utf-8")
    run("check", folder)
    for layer, area in zip(layers, expected, strict=True):
        assert printed_area(folder / layer["file"], work) == pytest.approx(area, rel=0.002)
