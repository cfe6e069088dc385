"""traveller.html in Chromium: it shows, it prints on both papers, and a phone reads its code."""

from __future__ import annotations

import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pypdfium2
import pytest
from lxml import html as lxml_html
from PIL import Image

from sbafab.actuators import load_design
from sbafab.assemblies.files import load_assembly
from sbafab.folders.run import RunRequest, generate
from sbafab.reports.traveller.page import record_text, traveller_html
from sbafab.version import GENERATOR
from tests.quick import few
from tests.reports.pages import work_of
from tests.shared import CHROMIUM, chromium

# Points, as the browser rounds them.
PAPERS = {"A4": (595, 842), "letter": (612, 792)}

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")


@pytest.fixture(scope="module")
def html(sheet_files: Any) -> str:
    return traveller_html(work_of("3dof-15mm", sheets=sheet_files))


def printed(folder: Path, text: str, paper: str = "A4") -> Path:
    """Prints a page, which names no paper itself: a printer does."""
    file, target = folder / "page.html", folder / "page.pdf"
    sized = f"<style>@page {{ size: {paper} }}</style></head>"
    file.write_text(text.replace("</head>", sized), encoding="utf-8")
    chromium(folder, file, "--no-pdf-header-footer", f"--print-to-pdf={target}")
    return target


@pytest.mark.parametrize("paper", few(PAPERS, 1))
def test_it_prints_on_both_papers(paper: str, html: str, tmp_path: Path) -> None:
    target = printed(tmp_path, html, paper)
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", target.read_bytes())
    [size] = {(round(float(width)), round(float(height))) for width, height in boxes}
    assert size == pytest.approx(PAPERS[paper], abs=1)
    assert 5 <= pages_of(target) <= 8
    if shutil.which("pdftotext"):
        check_pages(target, pages_of(target))


def pages_of(file: Path) -> int:
    return len(re.findall(rb"/Type /Page\b", file.read_bytes()))


MOST_PAGES = {"3dof-15mm": 8, "1dof-5mm": 8, "gripper": 7, "folded": 5, "brace": 14}
"""15, 14, 12, 9 and 21 when all that is done once for a bench stood on the traveller."""


@cache
def page_of(template: str) -> str:
    """The traveller of a template as it is generated, an assembly or a design."""
    design = load_assembly(template) if template == "brace" else load_design(template)
    with TemporaryDirectory() as out:
        folder = generate(RunRequest(design, Path(out), ("cut", "press", "preview"))).folder
        return (folder / "traveller.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("template", few(MOST_PAGES, 1))
def test_the_first_page_has_order_steps_picture_and_tests(template: str, tmp_path: Path) -> None:
    """Printed alone, what stands before the warnings takes one page of either paper."""
    text = page_of(template)
    tree = lxml_html.fromstring(text)
    [header] = tree.findall("./body/header")
    words = " ".join(header.text_content().split())
    for part in ("What is laid, lowest first", "Then you hold", "leak test", "warnings"):
        assert part in words
    assert template == "brace" or "Layer order, lowest first" in words
    assert header.xpath(".//img[starts-with(@src, 'data:image/png')]")
    alone = text.replace("</header>", "</header><!--", 1).replace("<script>", "--><script>", 1)
    for paper in PAPERS:
        assert pages_of(printed(tmp_path, alone, paper)) == 1
        assert pages_of(printed(tmp_path, text, paper)) <= MOST_PAGES[template]


@pytest.mark.parametrize(("template", "paper"), [("3dof-15mm", "letter"), ("brace", "A4")])
def test_no_page_but_the_last_is_less_than_half_full(
    template: str, paper: str, tmp_path: Path
) -> None:
    *shares, _ = filled(printed(tmp_path, page_of(template), paper))
    assert len(shares) >= 6
    assert min(shares) >= 0.5


def filled(file: Path) -> list[float]:
    """The share of every page, between its margins of 11 and 14 mm, down to its last ink."""
    shares = []
    for page in pypdfium2.PdfDocument(file):
        height = page.get_height() / 72 * 25.4
        with page.render(scale=0.5).to_pil().convert("L") as picture:
            mm = height / picture.height
            body = picture.crop((0, 0, picture.width, int((height - 14) / mm)))
        # The box round the dark pixels.
        _, _, _, low = body.point(lambda grey: 255 * (grey < 200)).getbbox()
        shares.append((low * mm - 11) / (height - 25))
    return shares


def check_pages(file: Path, pages: int) -> None:
    """Neither a step nor the warnings run over a page's end."""
    sheets = text_of(file).split("\f")[:pages]
    [first] = [" ".join(sheet.split()) for sheet in sheets if "Warnings" in sheet]
    assert "owner permits PTFE" in first[first.index("Warnings") :]
    assert "and generate again" in first
    for number in range(1, 5):
        [own] = [sheet for sheet in sheets if f"Press step {number} of 4" in sheet]
        after = own[own.index(f"Press step {number} of 4") :]
        assert "You now hold" in after
    assert re.search(r"Printed: \d", sheets[0])
    last = " ".join(sheets[-1].split())
    assert last.index("One page for each device") < last.index("Photograph")


BEYOND = """<script>addEventListener("load", () => {
  const frames = [...document.querySelectorAll("article.step")];
  const beyond = frame => [...frame.querySelectorAll("*")].filter(part =>
    part.getBoundingClientRect().right > frame.getBoundingClientRect().right + 0.5);
  document.title = `${frames.length} frames, ${frames.flatMap(beyond).length} beyond`;
});</script></body>"""


def test_nothing_runs_over_the_frame_of_a_press_step(html: str, tmp_path: Path) -> None:
    """Also in the wide letters of a machine without Helvetica."""
    page = tmp_path / "page.html"
    wide = html.replace("</head>", "<style>html { font-family: 'DejaVu Sans' }</style></head>")
    page.write_text(wide.replace("</body>", BEYOND))
    shown = chromium(tmp_path, page, "--window-size=1000,1400", "--dump-dom")
    assert "<title>4 frames, 0 beyond</title>" in shown


def text_of(file: Path) -> str:
    command = ["pdftotext", "-layout", str(file), "-"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_a_phone_reads_its_code_off_the_screen(html: str, tmp_path: Path) -> None:
    page, shot = tmp_path / "page.html", tmp_path / "shot.png"
    page.write_text(html)
    chromium(tmp_path, page, "--window-size=1000,1400", f"--screenshot={shot}")
    with Image.open(shot) as picture:
        grey = picture.convert("L")
    dark, light = grey.getextrema()
    assert dark < 60
    assert light == 255
    zxing = pytest.importorskip("zxingcpp")
    [code] = zxing.read_barcodes(grey)
    sha256 = work_of("3dof-15mm").sha256
    assert code.text == record_text("3dof-15mm", sha256)
    find = f"sbafab record --find {sha256[:12]}"
    assert code.text.splitlines() == ["3dof-15mm", f"sha256 {sha256}", GENERATOR, find]


def test_it_prints_without_scripts(html: str, tmp_path: Path) -> None:
    # Chromium prints nothing with scripts switched off as a whole; a policy stops the page's own.
    policy = """<meta http-equiv="Content-Security-Policy" content="script-src 'none'">"""
    target = printed(tmp_path, html.replace("<head>", f"<head>{policy}"))
    assert pages_of(target) >= 5
    if shutil.which("pdftotext"):
        assert "Printed: ____" in text_of(target)
