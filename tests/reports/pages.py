"""Pages of templates without nesting, as trees, as text and as files to approve."""

from __future__ import annotations

import html
import re
from functools import cache
from pathlib import Path
from typing import Any

from lxml import html as lxml_html

from sbafab.actuators import build, load_design
from sbafab.design.identity import design_sha256
from sbafab.design.records import Design
from sbafab.laminate.laminate import Laminate
from sbafab.reports.traveller.bench import bench_html
from sbafab.reports.traveller.page import traveller_html
from sbafab.reports.traveller.work import Work
from sbafab.version import GENERATOR

APPROVED = Path(__file__).parent / "approved"
DOUBLE = Path(__file__).parent / "double.toml"
"""Two pouches on each other, whose rims are welded one over the other."""
EARS = 'registration.method="ears"'
TPU = ("films.tpe.product=TPU", "films.tpe.thickness=0.1")
BLOCKS = "p|li|tr|div|section|article|h1|h2|h3|ul|ol|table|figure|dt|svg|header|label|title"


@cache
def built(template: str, *assignments: str) -> tuple[Design, Laminate]:
    design = load_design(template, assignments)
    return design, build(design)


def work_of(template: str, *assignments: str, sheets: Any = None, **more: Any) -> Work:
    """Return the work of a template; ``sheets`` makes its sheets of a laminate and copies."""
    design, laminate = built(template, *assignments)
    files = () if sheets is None else sheets(laminate, design.order.quantity)
    return Work(design, laminate, more.pop("findings", ()), sheets=files, **more)


def page(work: Work) -> Any:
    return lxml_html.fromstring(traveller_html(work))


def bench(work: Work) -> Any:
    return lxml_html.fromstring(bench_html(work.design.name, design_sha256(work.design), [work]))


def words_of(node: Any) -> str:
    return " ".join(node.text_content().split())


def lines_of(text: str) -> str:
    """Return the words of a page, a block a line; blanks, boxes and pictures are marked."""
    text = re.sub(r"<style>.*?</style>|<script>.*?</script>", "", text, flags=re.DOTALL)
    text = re.sub(r"<svg.*?</svg>", _picture, text, flags=re.DOTALL)
    text = re.sub(r'<input type="checkbox"[^>]*>', "[ ]", text)
    text = re.sub(r'<input [^>]*?(?:aria-label="([^"]*)")?>', r"[___ \1]", text)
    text = re.sub(rf"\s*<(?:{BLOCKS})\b[^>]*>\s*", "\n", " ".join(text.split()))
    text = html.unescape(re.sub(r"<[^>]*>", " ", text)).replace(GENERATOR, "GENERATOR")
    text = re.sub(r"\b[0-9a-f]{12,64}\b", "SHA", text)
    return "\n".join(filter(None, (" ".join(line.split()) for line in text.split("\n")))) + "\n"


def _picture(found: re.Match[str]) -> str:
    label = re.search(r'aria-label="([^"]*)"', found[0])
    words = " | ".join(re.findall(r">([^<>]+)</text>", found[0]))
    return f"<p>PICTURE {label[1]}: {words}</p>" if label else ""
