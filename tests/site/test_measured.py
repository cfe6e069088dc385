"""Pages say what the records of measured figures say, and what the program says today."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

from docs.scripts import measured
from docs.scripts.measured import BLOCK, FOLDER, HOW, filled, record
from docs.scripts.rates import WORDS
from docs.scripts.tables import SUMMARIES
from sbafab.cli import COMMANDS
from sbafab.design.sections import rule_names
from sbafab.rules.deck import EXPLAINED

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
TEXTS = {
    path: path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md")))
}
BLOCKS = [found.group(2, 3) for text in TEXTS.values() for found in BLOCK.finditer(text)]
RATE = re.compile(r"[\d,]+ (?:poses|designs|equilibria) a second")
COMMAND = "generate 3dof-15mm"
NAMES = sorted(path.stem for path in FOLDER.glob("*.json"))


def text(page: str) -> str:
    return " ".join(TEXTS[DOCS / f"{page}.md"].split())


@pytest.mark.parametrize("page", list(measured.pages()), ids=lambda page: page.stem)
def test_a_page_shows_what_was_recorded(page: Path) -> None:
    written = page.read_text(encoding="utf-8")
    assert filled(written) == written, "python -m docs.scripts.measured writes the tables anew"


def test_blocks_name_what_is_recorded_and_each_record_says_its_day() -> None:
    assert len(NAMES) >= 6
    every = {(name, table) for name in NAMES for table in (*record(name).tables, HOW)}
    every |= {("benchmarks", words) for words in WORDS} | {*SUMMARIES}
    assert len(BLOCKS) == len(set(BLOCKS))
    assert {*BLOCKS} <= every
    assert {name for name, table in BLOCKS if table == HOW} == {*NAMES}
    for name in NAMES:
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", record(name).day)


def test_every_command_on_the_pages_exists() -> None:
    own = {*COMMANDS}
    asked = set()
    for path, said in TEXTS.items():
        asked |= {(path.stem, name) for name in re.findall(r"python -m ([\w.]+)", said)}
        commands = set(re.findall(r"(?:^ {4}|`|\$ )sbafab ([a-z]+)\b", said, re.MULTILINE))
        assert commands <= own, path
    assert len(asked) > 20
    outside = {"build", "twine", "uv"}  # for a release alone
    lost = {(page, name) for page, name in asked if name not in outside and not find_spec(name)}
    assert lost == set()


def test_every_judge_has_its_line() -> None:
    lines = set(re.findall(r"^\| `([a-z]+)` \| ", TEXTS[DOCS / "testing.md"], re.MULTILINE))
    source = "".join(path.read_text() for path in (ROOT / "tests" / "judge").glob("*.py"))
    named = set(re.findall(r"Disagreement\(\s*\"([a-z]+)\"", source))
    # A crash, an exit, what cannot be read and what takes too long are told in a sentence.
    assert lines == named - {"crash", "exit", "reading", "time"}


def test_the_rules_of_the_page_are_rules_of_the_deck() -> None:
    listed = re.findall(r"^\| `([a-z-]+)` \| ", TEXTS[DOCS / "rules.md"], re.MULTILINE)
    assert set(listed) <= {*EXPLAINED} >= {*rule_names()}


def test_the_readme_s_seconds_are_the_record_s() -> None:
    readme, tables = " ".join(TEXTS[ROOT / "README.md"].split()), record("benchmarks").tables
    (usage,) = (row[1] for row in tables["commands"].rows if row[0] == "sbafab --help")
    for pattern, measured_s in (
        (r"`sbafab generate 3dof-15mm` takes ([\d.]+) s", tables["versions"].cell(COMMAND, "now")),
        (r"`sbafab --help` ([\d.]+) s", usage),
    ):
        stated = re.search(pattern, readme)
        assert stated is not None, pattern
        assert float(stated[1]) == pytest.approx(float(measured_s), rel=0.05)


def test_no_rate_stands_in_a_text_by_hand() -> None:
    pages = [page for page in DOCS.rglob("*.md") if "_made" not in page.parts]
    for path in (ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(pages)):
        by_hand = BLOCK.sub("", path.read_text(encoding="utf-8"))
        assert RATE.findall(" ".join(by_hand.split())) == [], path
