"""Pages say what the records of measured figures say, and what the program says today."""

from __future__ import annotations

import csv
import math
import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest

from docs.scripts import measured
from docs.scripts.measured import BLOCK, FOLDER, HOW, filled, record
from docs.scripts.nesting import most_rectangles
from docs.scripts.rates import WORDS
from docs.scripts.tables import SUMMARIES, Table
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
NAMES = sorted(path.stem for path in FOLDER.glob("*.json"))
CI = (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def text(page: str) -> str:
    return " ".join(TEXTS[DOCS / f"{page}.md"].split())


def numbers(table: Table, column: str) -> list[int]:
    return [int(row[list(table.columns).index(column)]) for row in table.rows]


@pytest.mark.parametrize("page", list(measured.pages()), ids=lambda page: page.stem)
def test_a_page_shows_what_was_recorded(page: Path) -> None:
    written = page.read_text(encoding="utf-8")
    assert filled(written) == written, "python -m docs.scripts.measured writes the tables anew"


def test_a_page_that_was_edited_by_hand_is_told() -> None:
    page = "<!-- measured: mutation how -->\n\n*Measured yesterday.*\n\n<!-- end -->"
    assert "2026" in filled(page)
    assert filled(page) != page


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


def test_the_pages_of_judges_say_what_is_run_for_them() -> None:
    """Designs and seeds of the runs that repeat a part of them, as .ci/run has them."""
    for command, said in (
        ("tests.judge", "`.ci/run` judges {designs} designs of seed {seed}."),
        ("tests.hunt", "`.ci/run` draws {booleans} booleans and {offsets} offsets of seed {seed}."),
    ):
        (line,) = (line for line in CI.splitlines() if f"python -m {command}" in line)
        words = shlex.split(line)
        told = {
            word.removeprefix("--"): f"{int(value):,}"
            for word, value in zip(words, words[1:], strict=False)
            if word.startswith("--")
        }
        assert said.format(**told) in text("testing")


def test_what_the_judges_saw_adds_up() -> None:
    found = record("klayout").tables
    (row,) = found["designs"].rows
    designs, *families, areas, off = row
    assert int(designs) == sum(map(int, families)) == 200
    assert float(off.removesuffix(" %")) < 0.01  # what docs/testing.md allows
    widths = found["widths"]
    for cells in widths.rows:
        name, compared, *ways, apart, disagree = cells
        assert int(compared) == sum(map(int, ways)), name
        assert float(apart) <= 0.0022, name
        assert int(disagree) == 0, name
    assert widths.cell("overhang", "compared") == designs
    assert widths.cell("web", "compared") == areas
    judged = re.search(
        r"(\d+) designs judged \((\d+) 1-DoF, (\d+) lobed, (\d+) radial, (\d+) pairs",
        text("testing"),
    )
    assert judged is not None
    whole, *parts = map(int, judged.groups())
    assert whole == sum(parts)
    refused = re.search(r"\. (\d+) were refused", text("testing"))
    assert refused is not None
    assert whole + int(refused[1]) == 1000


def test_every_judge_has_its_line() -> None:
    lines = set(re.findall(r"^\| `([a-z]+)` \| ", TEXTS[DOCS / "testing.md"], re.MULTILINE))
    source = "".join(path.read_text() for path in (ROOT / "tests" / "judge").glob("*.py"))
    named = set(re.findall(r"Disagreement\(\s*\"([a-z]+)\"", source))
    # A crash, an exit, what cannot be read and what takes too long are told in a sentence.
    assert lines == named - {"crash", "exit", "reading", "time"}


def test_every_program_of_the_table_is_run_by_the_tests() -> None:
    table = record("programs").tables["areas"]
    programs = {re.split(r"[ ,(]", row[0])[0] for row in table.rows}
    source = "".join(path.read_text() for path in (ROOT / "tests/interop").glob("test_*.py"))
    assert all(program.lower() in source.lower() for program in programs)
    assert all(float(row[3].removesuffix(" %")) <= 0.1 for row in table.rows)


def test_mutation_testing_adds_up() -> None:
    table = record("mutation").tables["files"]
    run, killed, survived = (numbers(table, name) for name in ("run", "killed", "survived"))
    assert [k + s for k, s in zip(killed, survived, strict=True)] == run
    share = f"{sum(killed)} of {sum(run)} ({100 * sum(killed) / sum(run):.0f} %)"
    assert f"it is {share}" in text("testing")
    assert abs(sum(numbers(table, "mutants")) - 4100) < 50


def test_the_rules_of_the_page_are_rules_of_the_deck() -> None:
    listed = re.findall(r"^\| `([a-z-]+)` \| ", TEXTS[DOCS / "rules.md"], re.MULTILINE)
    assert set(listed) <= {*EXPLAINED} >= {*rule_names()}


def test_the_page_on_cutting_counts_the_sheets_of_the_record() -> None:
    with (FOLDER / "nesting.csv").open(encoding="utf-8", newline="") as opened:
        rows = list(csv.DictReader(opened))
    totals = {name: sum(int(row[name]) for row in rows) for name in ("sbafab", "bottom_left")}
    least = [max(1, int(row["area"]), int(row["rectangle"])) for row in rows]
    page = text("cutting")
    assert "take {sbafab} sheets, by bottom-left alone {bottom_left}".format(**totals) in page
    assert f"no fewer than {sum(least)}" in page
    assert "sparrow saves none" in page
    open_rows = [row for row, bound in zip(rows, least, strict=True) if int(row["sbafab"]) > bound]
    assert open_rows
    for row in open_rows:
        if row["most"]:
            assert row["one_more"] == "no"
            assert int(row["sbafab"]) == math.ceil(int(row["parts"]) / int(row["most"]))
        else:
            assert int(row["sparrow"]) >= int(row["sbafab"])


@pytest.mark.parametrize(
    ("sides", "sheet", "most"),
    [
        # 4 k + 2 unit squares a side do not fill with bars of four (de Bruijn 1969).
        ((4.0, 1.0), (6.0, 6.0), 8),
        ((4.0, 1.0), (6.6, 6.6), 8),
        # Four round a square hole of one.
        ((3.0, 2.0), (5.0, 5.0), 4),
        ((10.0, 3.0), (26.0, 30.0), 26),
        ((3.0, 3.0), (2.9, 9.0), 0),
    ],
)
def test_the_most_rectangles_of_a_sheet(
    sides: tuple[float, float], sheet: tuple[float, float], most: int
) -> None:
    assert most_rectangles(sides, sheet) == most
