"""Layers drawn in Inkscape, and printed by LibreCAD, from import to traveller."""

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
from tests.interop.test_sheets_inkscape import INKSCAPE, PYTHON, inkscape
from tests.interop.test_sheets_librecad import LIBRECAD

DOTS = 600
PAGE = 60.0
"""Of the drawings, mm: Inkscape's DXF counts y from the lower edge of the page."""
BOXES = {
    "film": ((9, 14, 42, 32), (28, 6, 4, 10)),
    "mask": ((10, 15, 40, 30), (29, 5.5, 2, 11)),
}
"""What is drawn of each layer: a pocket and a strip, by corner and size, y down."""
AREAS = {"film": 42 * 32 + 4 * 8.0, "mask": 40 * 30 + 2 * 9.5}

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(INKSCAPE is None, reason="no Inkscape here"),
]


def drawn(name: str, folder: Path) -> Path:
    """A layer's DXF: Inkscape joins the boxes to one path and writes it by its extension."""
    boxes = "".join(
        f'<rect x="{x}" y="{y}" width="{w}" height="{h}"/>' for x, y, w, h in BOXES[name]
    )
    head = f'width="{PAGE}mm" height="{PAGE}mm" viewBox="0 0 {PAGE} {PAGE}"'
    source, joined = folder / f"{name}-boxes.svg", folder / f"{name}.svg"
    source.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{boxes}</svg>')
    steps = f"select-all;path-union;export-plain-svg;export-filename:{joined};export-do"
    inkscape(f"--actions={steps}", str(source))
    extension = Path(inkscape("--system-data-directory").strip()) / "extensions/dxf_outlines.py"
    drawing = folder / f"{name}.dxf"
    command = [PYTHON, str(extension), "--units=25.4/96", f"--output={drawing}", str(joined)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if "ModuleNotFoundError" in done.stderr:
        pytest.skip("Inkscape's exporter wants python3-lxml, python3-numpy and python3-cssselect")
    assert done.returncode == 0, done.stderr
    return drawing


@pytest.fixture
def source(tmp_path: Path) -> Path:
    folder, work = tmp_path / "outside", tmp_path / "work"
    folder.mkdir()
    work.mkdir()
    for name in BOXES:
        shutil.copy(drawn(name, work), folder)
    rows = ("film.dxf,base", "mask.dxf,chamber-mask", "film.dxf,cap")
    (folder / "layers.csv").write_text("\n".join(("file,role", *rows)))
    chamber = f"pouch,30,{PAGE - 30},30,{PAGE - 6},90,2"
    (folder / "chambers.csv").write_text(f"name,x,y,mouth_x,mouth_y,angle,width\n{chamber}\n")
    return folder


def run(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result.output


def test_layers_drawn_in_inkscape_become_cut_files_and_a_traveller(
    source: Path, tmp_path: Path
) -> None:
    design = tmp_path / "outside.toml"
    assert "3 layers in 2 patterns" in run("import", source, "--to", design)
    run("generate", design, "-o", tmp_path / "out", "--set", "rules.yield_builds=100")
    folder = tmp_path / "out" / "outside"
    layers = json.loads((folder / "manifest.json").read_text())["layers"]
    # Inkscape writes coordinates of a path to about 0.2 um of the page.
    expected = [AREAS["film"], AREAS["mask"], AREAS["film"]]
    assert [layer["area"] for layer in layers] == pytest.approx(expected, rel=1e-4)
    findings = json.loads((folder / "checks.json").read_text())["findings"]
    assert {finding["verdict"] for finding in findings} <= {"pass", "warn"}
    (bond,) = (finding for finding in findings if finding["rule"] == "bond-width")
    assert bond["measured"] == pytest.approx(1.0, abs=1e-3)
    traveller = (folder / "traveller.html").read_text(encoding="utf-8")
    assert "outside" in traveller
    run("check", folder)


@pytest.mark.skipif(LIBRECAD is None, reason="no LibreCAD here")
@pytest.mark.parametrize("name", BOXES)
def test_librecad_prints_the_cut_files_as_inkscape_drew_them(
    name: str, source: Path, tmp_path: Path
) -> None:
    design = tmp_path / "outside.toml"
    run("import", source, "--to", design)
    run("cut", design, "-o", tmp_path / "out", "--set", "rules.yield_builds=100")
    (cut,) = (tmp_path / "out" / "outside" / "layers").glob(
        "001_*.dxf" if name == "film" else "002_*.dxf"
    )
    assert printed_area(cut, tmp_path / "print") == pytest.approx(AREAS[name], rel=0.002)


def printed_area(drawing: Path, folder: Path) -> float:
    """What LibreCAD's print of a drawing encloses, mm2."""
    folder.mkdir()
    shutil.copy(drawing, folder / "layer.dxf")
    subprocess.run(
        [str(LIBRECAD), "dxf2pdf", "-s", "1", "layer.dxf"],
        cwd=folder,
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", "HOME": str(folder)},
        capture_output=True,
        timeout=60,
        check=True,
    )
    with pypdfium2.PdfDocument(folder / "layer.pdf") as document:
        (page,) = document
        return painted(page.render(scale=DOTS / 72).to_pil(), DOTS / 25.4).film
