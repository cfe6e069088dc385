"""Processor times in the README are those of the record, and no page states a rate by hand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.scripts.measured import BLOCK, record

ROOT = Path(__file__).parents[2]
README = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
TABLES = record("benchmarks").tables
RATE = re.compile(r"[\d,]+ (?:poses|designs|equilibria) a second")


def recorded(table: str, row: str) -> float:
    """The time of a row, in the table's second column."""
    (cells,) = (cells for cells in TABLES[table].rows if cells[0] == row)
    return float(cells[1])


def stated(pattern: str) -> list[float]:
    """The numbers that the README states there."""
    found = re.search(pattern, README)
    assert found is not None, pattern
    return [float(number.replace(",", "")) for number in found.groups()]


def test_the_readme_s_seconds_are_the_record_s() -> None:
    (generate,) = stated(r"`sbafab generate 3dof-15mm` takes ([\d.]+) s")
    now = float(TABLES["versions"].cell("generate 3dof-15mm", "now"))
    assert generate == pytest.approx(now, rel=0.05)
    (usage,) = stated(r"`sbafab --help` ([\d.]+) s")
    assert usage == pytest.approx(recorded("commands", "sbafab --help"), rel=0.05)


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
    pages = [page for page in (ROOT / "docs").rglob("*.md") if "_made" not in page.parts]
    for path in (ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(pages)):
        by_hand = BLOCK.sub("", path.read_text(encoding="utf-8"))
        assert RATE.findall(" ".join(by_hand.split())) == [], path
