"""A batch's table: read where it can be read in one way, refused with its line where not."""

from __future__ import annotations

from pathlib import Path

import pytest

from sbafab.errors import DesignError
from sbafab.results.recording import read_batch
from sbafab.results.records import LabResult

POINTS = """\
# Lot of Tuesday, pressed cold
serial,leak,burst_kpa,offset_mm,note
A1,pass,350.5,0.1 0.25,
A2,FAIL,,,"burnt, step 2"
"""
READABLE = {
    "points": POINTS,
    "semicolons and decimal commas": (
        'Serial;Leak;Burst_kPa;Offset_mm;Note\nA1;pass;350,5;0,1 0,25;\nA2;FAIL;;;"burnt, step 2"\n'
    ),
    "tabs, another order, an empty column": (
        "leak\tserial\tnote\tburst_kpa\toffset_mm\t\npass\tA1\t\t350.5\t0.1 0.25\t\n"
        "FAIL\tA2\tburnt, step 2\t\t\t\n"
    ),
}


def table(folder: Path, text: str) -> Path:
    path = folder / "batch.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", READABLE)
def test_a_row_is_an_actuator(name: str, tmp_path: Path) -> None:
    assert read_batch(table(tmp_path, READABLE[name])) == [
        LabResult("A1", "pass", numbers={"burst_kpa": 350.5}, errors={"offset_mm": (0.1, 0.25)}),
        LabResult("A2", "fail", note="burnt, step 2"),
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty; its first line names columns: serial, operator"),
        ("serial,leak\n", "has no row below its columns"),
        ("leak,burst_kpa\npass,3\n", "has no column serial"),
        ("serial,burst\nA1,3\n", "has a column 'burst'; known are serial"),
        ("serial,leak,leak\nA1,pass,pass\n", "two columns leak"),
        ("serial,leak\nA1,maybe\n", "line 2: leak is 'maybe'; write pass or fail"),
        ("serial,leak\n,pass\n", "line 2 has no serial"),
        ("serial,leak\nA1,\n", "line 2: nothing is said of A1"),
        ("serial,burst_kpa\nA1,350,5\n", "line 2 has 3 cells where the header has 2"),
        ("serial,burst_kpa\nA1,high\n", "line 2: burst_kpa is 'high', not a number"),
        ("serial,turn_deg\nA1,0.5 90\n", "line 2: turn_deg is 90; it must be 0 or more"),
        ("serial;burst_kpa\nA1;-3\n", "line 2: burst_kpa is '-3', not a number"),
    ],
)
def test_a_table_that_cannot_be_meant_is_refused(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(DesignError, match=says):
        read_batch(table(tmp_path, text))
