"""The paper whose actuators these are is cited where one looks for it, once in each place."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOI = "10.1002/aisy.202200085"
TITLE = "A Collapsible Soft Actuator Facilitates Performance in Constrained Environments"
JOURNAL = "Advanced Intelligent Systems"
AUTHORS = (
    "Rogatinsky",
    "Gomatam",
    "Lim",
    "Lee",
    "Kinnicutt",
    "Duriez",
    "Thomson",
    "McDonald",
    "Ranzani",
)
"""As published, doi.org/10.1002/aisy.202200085."""
DOCS = sorted((ROOT / "docs").glob("*.md")) + sorted((ROOT / "docs" / "learn").glob("*.md"))


@pytest.mark.parametrize("files", [[ROOT / "README.md"], DOCS], ids=["readme", "docs"])
def test_a_text_cites_the_paper_once(files: list[Path]) -> None:
    text = " ".join(" ".join(path.read_text(encoding="utf-8").split()) for path in files)
    text = text.replace("> ", "")
    assert text.count(TITLE) == text.count(JOURNAL) == 1
    assert text.count(f"https://doi.org/{DOI}") == 1
    before = text[: text.index(TITLE)][-150:]
    places = [before.index(f" {name}") for name in AUTHORS]
    assert places == sorted(places)


def test_the_citation_file_cites_the_paper_once() -> None:
    # Read as lines: YAML would take a package for this one file.
    program, paper = (ROOT / "CITATION.cff").read_text(encoding="utf-8").split("references:\n")
    assert "cite it, and the paper" in program
    assert paper.count("- type: article") == 1
    for key, value in (("title", TITLE), ("journal", JOURNAL), ("doi", DOI), ("year", "2022")):
        assert re.findall(rf"^    {key}: (.*)$", paper, re.MULTILINE) == [value]
    assert tuple(re.findall(r"^        family-names: (.*)$", paper, re.MULTILINE)) == AUTHORS
    assert len(re.findall(r"^      - given-names: \S", paper, re.MULTILINE)) == len(AUTHORS)
