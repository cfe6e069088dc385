"""Pages say what the records of measured figures say, and what the program says today."""

from __future__ import annotations

import csv
import math
import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks.sections import rate
from benchmarks.timing import Row, Section
from benchmarks.versions import Compared
from docs.scripts import measured
from docs.scripts.benchmark_runs import growth, other_program, told, versions_table
from docs.scripts.measured import BLOCK, FOLDER, HOW, filled, record
from docs.scripts.nesting import most_rectangles
from docs.scripts.rates import WORDS, statistic
from docs.scripts.tables import SUMMARIES, Table
from sbafab.cli import COMMANDS
from sbafab.design.files import rule_names
from sbafab.rules.deck import EXPLAINED
from tests.judge.campaign import JUDGES

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
TEXTS = {
    path: path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md")))
}
BLOCKS = [found.group(2, 3) for text in TEXTS.values() for found in BLOCK.finditer(text)]
RATE = re.compile(r"[\d,]+ (?:poses|designs|equilibria) a second")
COMMAND = "generate 3dof-15mm"
CI = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
TABLES = record("benchmarks").tables
TURNS = [1.0, 9.0, 2.0]
"""Its median is 2, its mean 4, its least 1."""
NAMES = sorted(path.stem for path in FOLDER.glob("*.json"))


def text(page: str) -> str:
    return " ".join(TEXTS[DOCS / f"{page}.md"].split())


def numbers(table: Table, column: str) -> list[int]:
    return [int(row[list(table.columns).index(column)]) for row in table.rows]


def recorded(table: str, row: str) -> float:
    """The time of a row, in the table's second column."""
    (cells,) = (cells for cells in TABLES[table].rows if cells[0] == row)
    return float(cells[1])


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
    named = {*JUDGES, *re.findall(r"(?:Disagreement|_heard)\(\s*\"([a-z]+)\"", source)}
    # A crash, an exit, what cannot be read and what takes too long are told in a sentence.
    assert lines == named - {"crash", "exit", "reading", "time"}


def test_every_program_of_the_table_is_run_by_the_tests() -> None:
    table = record("programs").tables["areas"]
    programs = {re.split(r"[ ,(]", row[0])[0] for row in table.rows}
    source = "".join(path.read_text() for path in (ROOT / "tests/interop").glob("*.py"))
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


def test_a_statistic_is_called_by_its_name() -> None:
    for name in ("plates", "decks", "processes", "poses", "commands", "versions"):
        assert statistic(TABLES[name]) in {"median", "least"}, name
    readme = " ".join(TEXTS[ROOT / "README.md"].split())
    of = statistic(TABLES["versions"])
    assert re.search(rf"{of} (?:processor )?time of several rounds", readme)


def test_factors_on_the_page_are_the_record_s() -> None:
    """Medians of one run: the other programs' seconds by ours, one process's by that of two."""
    page = " ".join((ROOT / "docs" / "testing.md").read_text(encoding="utf-8").split())
    plates = {name: recorded("plates", name) for name in ("sbafab", "foldable", "build123d")}
    others = re.search(r"took ([\d.]+) \(foldable, chords\) and ([\d.]+) times", page)
    assert others is not None
    for name, factor in zip(("foldable", "build123d"), others.groups(), strict=True):
        # Seconds are recorded to two digits.
        assert float(factor) == pytest.approx(plates[name] / plates["sbafab"], rel=0.02)
    several = re.search(r"check ([\d.]+) to ([\d.]+) times as many as one", page)
    assert several is not None
    gains = [
        recorded("processes", f"{design}, 1 process")
        / recorded("processes", f"{design}, 2 processes")
        for design in ("1dof-5mm", "3dof-15mm")
    ]
    assert [*map(float, several.groups())] == [pytest.approx(gain, abs=0.05) for gain in gains]
    sizes = re.search(r"takes (\d+) MB after 1,250 and (\d+) MB at the end", page)
    assert sizes is not None
    first, *_, last = (row[2] for row in TABLES["memory"].rows)
    assert [f"{size} MB" for size in sizes.groups()] == [first, last]


def test_no_rate_stands_in_a_text_by_hand() -> None:
    pages = [page for page in DOCS.rglob("*.md") if "_made" not in page.parts]
    for path in (ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(pages)):
        by_hand = BLOCK.sub("", path.read_text(encoding="utf-8"))
        assert RATE.findall(" ".join(by_hand.split())) == [], path


def test_what_is_measured_is_recorded_as_its_median() -> None:
    section = Section("decks", "", [Row("design", TURNS, rate(TURNS, "designs"))])
    plates = Section("plates", "", [Row("sbafab", [1.0]), Row("slow", [8.0]), Row("quick", TURNS)])
    table = told(section, other_program([section, plates]))
    assert statistic(table) == "median"
    assert list(table.rows) == [
        ["design", "2", "1", "3", "0.5 designs a second"],
        ["quick in the same run", "2", "1", "3", "40 lobed plates, a DXF each"],
    ]
    assert rate([0.001, 0.009, 0.002], "designs") == "500 designs a second"
    compared = versions_table([Compared("work", TURNS, [0.5, 0.5, 4.0])])
    assert statistic(compared) == "median"
    assert compared.rows == [["work", "2.000", "0.500", ""]]
    grown = growth([Section("sizes", "work", [Row("1 a", TURNS), Row("9 a", TURNS)], power=0.0)])
    assert grown.rows == [["work", "1 to 9 sizes", "2.00 to 2.00", "0.00"]]
