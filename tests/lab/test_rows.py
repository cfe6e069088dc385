"""Rows as users write them: options, tables and files, read or refused with the place."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from sbafab.errors import DesignError
from sbafab.lab.recording import entries_of, read_batch, read_history, write_history
from sbafab.lab.records import HistoryEntry, columns, row_of
from sbafab.lab.records import Record as Result
from sbafab.lab.store import Lab
from sbafab.reports.traveller.record_sheet import HISTORY_FIELDS
from tests.lab.conftest import SHA, build, result, step
from tests.site.formats import hold

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
        result("A1", "pass", burst_kpa=350.5, offset_mm=(0.1, 0.25)),
        result("A2", "fail", note="burnt, step 2"),
    ]


TABLES = {
    "": "has no result; its first line names columns \\(serial, operator",
    "serial,leak\n": "has no result",
    "leak,burst_kpa\npass,3\n": "line 2: a result needs its serial",
    "serial,burst\nA1,3\n": "line 2: 'burst' is not a column; use serial",
    "serial,leak,leak\nA1,pass,pass\n": "has two columns leak; keep one",
    "serial,leak\nA1,maybe\n": "line 2: leak = 'maybe' must be '', 'pass' or 'fail'",
    "serial,leak\nA1,\n": "line 2: A1 has no result; give leak",
    "serial,burst_kpa\nA1,350,5\n": "line 2 has 3 cells, but the header has 2",
    "serial,burst_kpa\nA1,high\n": "line 2: burst_kpa = 'high' must be a number",
    "serial,turn_deg\nA1,0.5 90\n": r"line 2: turn_deg.1 = '90' must be at most 45",
}


@pytest.mark.parametrize("text", TABLES)
def test_a_table_that_cannot_be_meant_is_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(DesignError, match=TABLES[text]):
        read_batch(table(tmp_path, text))


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"serial": "x" * 65}, "must have at most 64 letters"),
        ({"serial": "A\n1"}, "must be plain text in one line"),
        ({"burst_kpa": 0.0}, "burst_kpa = 0.0 must be greater than 0"),
        ({"mass_g": float("nan")}, "mass_g = nan must be a finite number"),
        ({"stroke_mm": 1e9}, "stroke_mm = 1000000000.0 must be at most 10000"),
        ({"offset_mm": (0.1, -0.2)}, "offset_mm.1 = -0.2 must be at least 0"),
    ],
)
def test_a_result_that_cannot_be_meant_is_refused(values: dict[str, Any], says: str) -> None:
    with pytest.raises(DesignError, match=says):
        row_of(Result, {"serial": "A1", "leak": "pass", **values})


def test_a_line_has_the_fields_of_the_page() -> None:
    assert set(columns(HistoryEntry)) == {field.name for field in HISTORY_FIELDS}


def test_files_of_every_kind_say_the_same(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        'serial = ["A1", "A2"]\ninitials = "AL"\n\n[[entry]]\nitem = "TPE"\nlot = "L7"\n'
        'expires = "2026-01-31"\n\n[[entry]]\nstep = 1\ntemperature_c = 134.5\n'
    )
    lot = {"item": "TPE", "lot": "L7", "expires": "2026-01-31"}
    document = {"initials": "AL", "entry": [lot, {"step": "1", "temperature_c": 134.5}]}
    (tmp_path / "a.json").write_text(json.dumps({"serial": "A1, A2", **document}))
    (tmp_path / "a.csv").write_text(
        "Serial;item;lot;expires;step;temperature_c;initials\n"
        "A1, A2;TPE;L7;2026-01-31;;;AL\n;;;;;;\nA1, A2;;;;1;134,5;AL\n"
    )
    lines = [read_history(tmp_path / f"a.{ending}", {}) for ending in ("toml", "json", "csv")]
    assert lines[0] == lines[1] == lines[2]
    assert [(line.serial, line.lot, line.readings) for line in lines[0]] == [
        *(("A1", "L7", {}), ("A2", "L7", {})),
        *(("A1", "", {"temperature_c": 134.5}), ("A2", "", {"temperature_c": 134.5})),
    ]
    for name, text, says in (
        ("b.json", "[", "b.json cannot be read"),
        ("b.toml", "entry = 1", "needs a list of tables named entry"),
        ("b.csv", "serial,note\n", "has no entry"),
        ("b.doc", "", "must end in .csv, .toml, .json"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(DesignError, match=says):
            read_history(tmp_path / name, {})


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("lot=L7 item=TPE", "needs its serial"),
        ("serial=A1 initials=AL", "states a lot, a reading"),
        ("serial=A1 lot=L7", "a lot needs its item"),
        ("serial=A1 item=TPE expires=2026-01-31 note=x", "needs its lot"),
        ("serial=A1 minutes=20", "need their step"),
        ("serial=A1 step=1 minutes=20min", "minutes = '20min' must be a number"),
        ("serial=A1 step=1 temperature_c=1350", "must be at most 400"),
        ("serial=A1 decision=good", "must be '', 'accept', 'reject' or 'rework'"),
        ("serial=A1 decision=reject", "a reject needs its reason"),
        ("serial=A1 decision=accept reason=leaks", "a reason goes with"),
        ("serial=A1 note=x date=4.5.2026", "must be a day such as 2026-05-04"),
        ("serial=A1 note=x date=20260504", "must be a day such as"),
        ("serial=A1 colour=red", "'colour' is not a column; use serial, date"),
    ],
)
def test_a_line_that_cannot_be_meant_is_one_sentence(text: str, says: str) -> None:
    with pytest.raises(DesignError, match=says) as refused:
        entries_of(dict(word.split("=") for word in text.split()), "row 3")
    assert str(refused.value).startswith("row 3: ")


def test_photographs_lie_beside_the_file_by_their_hash(lab: Lab, tmp_path: Path) -> None:
    path = tmp_path / "rim.jpg"
    Image.new("RGB", (40, 30), "red").save(path)
    [entry] = lab.add(SHA, build(), [HistoryEntry(serial="A1", photograph=str(path))])
    stored = tmp_path / "lab-photographs" / entry.photograph
    assert stored.read_bytes() == path.read_bytes()
    assert [stored] == list(stored.parent.iterdir())
    again = lab.add(SHA, None, [HistoryEntry(serial="A2", photograph=str(path))])
    assert again[0].photograph == entry.photograph
    path.write_text("no picture")
    for name, says in ((path, "is not a JPEG, PNG or WebP"), ("x.jpg", "x.jpg cannot be read")):
        with pytest.raises(DesignError, match=says):
            lab.add(SHA, None, [HistoryEntry(serial="A3", photograph=str(name))])


def test_exports_hold_every_row(lab: Lab, tmp_path: Path) -> None:
    lot = {"item": "TPE", "lot": "L7", "expires": "2026-01-31"}
    days = [HistoryEntry(serial="A2", date=f"2026-0{day}", **lot) for day in ("1-31", "2-01")]
    lab.add(SHA, build(), [step(), *days])
    lab.add(SHA, None, [result("A1", "pass", note="=1+1"), result("A2", offset_mm=(0.1, 0.25))])
    lab.correct(HistoryEntry, 1, {"temperature_c": 135})
    for ending in ("csv", "json"):
        assert write_history(lab.contents(), tmp_path / f"a.{ending}") == 2
    document = json.loads((tmp_path / "a.json").read_text())
    hold("history", document)
    assert [device["serial"] for device in document["devices"]] == ["A1", "A2"]
    rows = list(csv.DictReader((tmp_path / "a.csv").read_text().splitlines()))
    assert sorted(row["row"] for row in rows) == ["1", "2", "e1", "e2", "e3", "e4"]
    by_row = {row["row"]: row for row in rows}
    assert (by_row["e4"]["corrects"], by_row["e4"]["temperature_c"]) == ("e1", "135.0")
    assert [by_row[row]["expired"] for row in ("e2", "e3", "1")] == ["0", "1", ""]
    assert (by_row["1"]["leak"], by_row["1"]["note"]) == ("pass", "'=1+1")
    assert by_row["2"]["offset_mm"] == "0.1 0.25"
    with pytest.raises(DesignError, match="must end in"):
        write_history(lab.contents(), tmp_path / "a.doc")
