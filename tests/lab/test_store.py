"""The lab's file: rows are only added, by many processes at once, and no other file is touched."""

from __future__ import annotations

import os
import random
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from sbafab.errors import DesignError, OutputError
from sbafab.lab.records import HistoryEntry, Record, standing
from sbafab.lab.store import Lab
from tests.hardship.starting import WITHOUT_PRIVILEGES
from tests.lab.conftest import SHA, build, result, step


def test_what_is_stored_comes_back(lab: Lab) -> None:
    told = result(
        "A1",
        "pass",
        operator="Ada",
        kit="paper",
        note="50 % rest, 'quoted' n\u00f6te",
        burst_kpa=350.0,
        stroke_mm=16.8,
        offset_mm=(0.1, 0.25),
    )
    [stored] = lab.add(SHA, build(), [told])
    assert (stored.id, stored.recorded, stored.corrects) == (1, "2026-01-02T03:04:05Z", None)
    assert stored.stated == told.stated
    [entry] = lab.add(SHA, None, [step()])
    assert entry.readings == {"temperature_c": 134.5, "minutes": 20.0}
    assert lab.contents() == ([stored], [entry], {SHA: build()})


def test_a_correction_is_a_row_of_its_own_that_names_the_other(lab: Lab) -> None:
    lab.add(SHA, build(), [result("A1", "pass", burst_kpa=35.0)])
    new = lab.correct(Record, 1, {"burst_kpa": 350.0})
    records = lab.contents().records
    assert [(r.id, r.corrects, r.leak, r.burst_kpa) for r in records] == [
        (1, None, "pass", 35.0),
        (2, 1, "pass", 350.0),
    ]
    assert standing(records) == [new]
    with pytest.raises(DesignError, match="record 1 is already corrected by record 2"):
        lab.correct(Record, 1, {"leak": "fail"})
    with pytest.raises(DesignError, match="no record 7"):
        lab.correct(Record, 7, {"leak": "fail"})
    lab.correct(Record, 2, {"withdrawn": True})
    assert standing(lab.contents().records) == []
    lab.add(SHA, None, [result("A1", "fail")])


def test_a_serial_is_told_in_parts_but_not_in_two_ways(lab: Lab) -> None:
    lab.add(SHA, build(), [result("A1", "pass", operator="Ada")])
    lab.add(SHA, None, [result("A1", operator="Ada", burst_kpa=350.0)])
    with pytest.raises(DesignError, match=r"A1 has leak = pass in record 1; .* --correct 1"):
        lab.add(SHA, None, [result("A2", "pass"), result("A1", "fail")])
    with pytest.raises(DesignError, match=r"A1 has burst_kpa = 350\.0 in record 2"):
        lab.add(SHA, None, [result("A1", burst_kpa=350.0)])
    assert len(lab.contents().records) == 2, "a batch is stored whole or not at all"


def test_attempts_are_counted_over_history_and_results(lab: Lab) -> None:
    lab.add(SHA, build(), [step()])
    lab.add(SHA, None, [result("A1", "fail")])
    [again] = lab.add(SHA, None, [step()], is_again=True)
    [passed] = lab.add(SHA, None, [result("A1", "pass")])
    assert (again.attempt, passed.attempt) == (2, 2)
    # A correction stays in its attempt.
    assert lab.correct(Record, 1, {"note": "torn"}).attempt == 1
    with pytest.raises(DesignError, match="serial A9 has no record yet"):
        lab.add(SHA, None, [result("A1", "pass"), result("A9", "pass")], is_again=True)
    assert len(lab.contents().records) == 3


WRITER = """
import sys
from pathlib import Path
from sbafab.errors import DesignError
from sbafab.lab.store import Lab
from tests.lab.conftest import SHA, build, result
file, who = sys.argv[1:]
lab = Lab(Path(file), 60)
for n in range(15):
    lab.add(SHA, build(), [result(f"{who}-{n}", "pass")])
try:
    lab.add(SHA, build(), [result("shared", "pass")])
    print("first")
except DesignError:
    print("late")
"""


def test_processes_that_write_at_once_lose_nothing(lab: Lab) -> None:
    """They also race for who makes the file, and for a serial that only one may have."""
    running = [
        subprocess.Popen(
            [sys.executable, "-c", WRITER, str(lab.path), f"w{n}"],
            stdout=subprocess.PIPE,
            text=True,
        )
        for n in range(4)
    ]
    said = sorted(process.communicate(timeout=120)[0].strip() for process in running)
    assert said == ["first", "late", "late", "late"]
    records = lab.contents().records
    assert [record.id for record in records] == list(range(1, 62))
    expected = {f"w{who}-{n}" for who in range(4) for n in range(15)} | {"shared"}
    assert {record.serial for record in records} == expected


def changed(*statements: str) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        with closing(sqlite3.connect(path)) as file:
            for statement in statements:
                file.execute(statement)
            file.commit()

    return change


def torn(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[4096:] = b"\xff" * (len(content) - 4096)
    path.write_bytes(content)


DAMAGE = {
    "another version": (changed("PRAGMA user_version = 3"), r"format 3; this version reads 4"),
    "pages": (torn, "is damaged"),
    "no table": (changed("DROP TABLE entry"), "cannot be used as a file of records: no such table"),
    "no JSON": (changed("UPDATE record SET content = '{'"), "is damaged"),
    "no text": (changed("UPDATE record SET content = CAST(x'ff41' AS TEXT)"), "is damaged"),
    "no leak": (
        changed("UPDATE record SET content = replace(content, 'pass', 'maybe')"),
        "is damaged",
    ),
    "no design": (changed("DELETE FROM design"), "is damaged"),
}
FOREIGN = {
    "a database": (changed("CREATE TABLE photos (id)"), "is another program's database"),
    "a table": (lambda path: path.write_text("serial\nA1\n" * 99), "is not a file of records"),
    "a folder": (lambda path: path.mkdir(), "cannot be opened"),
}


@pytest.mark.parametrize("name", [*DAMAGE, *FOREIGN])
def test_a_file_that_is_not_whole_or_not_ours_is_left_alone(name: str, lab: Lab) -> None:
    if name in DAMAGE:
        lab.add(SHA, build(), [result("A1", "pass")])
    spoil, says = {**DAMAGE, **FOREIGN}[name]
    spoil(lab.path)
    before = lab.path.read_bytes() if lab.path.is_file() else None
    with pytest.raises(OutputError, match=says):
        lab.add(SHA, None, [result("A2", "pass")])
    with pytest.raises(OutputError):
        lab.contents()
    assert before == (lab.path.read_bytes() if lab.path.is_file() else None)


def test_a_locked_file_is_one_sentence_and_readers_need_not_wait(lab: Lab) -> None:
    lab.add(SHA, build(), [result("A1", "pass")])
    with closing(sqlite3.connect(lab.path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(OutputError, match="is in use by another program"):
            lab.add(SHA, None, [result("A2", "pass")])
        assert len(lab.contents().records) == 1


READ_ONLY = f"""{WITHOUT_PRIVILEGES}
import sys
from pathlib import Path
from sbafab.errors import OutputError
from sbafab.lab.store import Lab
from tests.lab.conftest import SHA, result
lab = Lab(Path(sys.argv[1]))
print(len(lab.contents().records))
for path in (lab.path, lab.path.parent / "new.sqlite"):
    try:
        Lab(path).add(SHA, None, [result("A2", "pass")])
    except OutputError as error:
        print(error)
"""


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders have no modes on this system")
def test_a_file_that_may_only_be_read_still_reports(tmp_path: Path) -> None:
    lab = Lab(tmp_path / "lab.sqlite")
    lab.add(SHA, build(), [result("A1", "pass")])
    lab.path.chmod(0o444)
    tmp_path.chmod(0o555)
    arguments = [sys.executable, "-c", READ_ONLY, str(lab.path)]
    ran = subprocess.run(arguments, capture_output=True, text=True, check=True)
    tmp_path.chmod(0o700)
    count, old, new = ran.stdout.splitlines()
    assert count == "1"
    assert "may only be read; nothing was recorded" in old
    assert "cannot be opened; see that its folder exists" in new


def test_a_file_damaged_anywhere_is_one_sentence_or_whole(lab: Lab) -> None:
    """A page that is lost, bytes that flip, an end that is missing."""
    for n in range(12):
        lab.add(SHA, build(), [result(f"A{n}", "pass", note="n\u00f6te")])
    whole = lab.path.read_bytes()
    dice = random.Random(35)
    refused = 0
    for number in range(150):
        content = bytearray(whole)
        place = dice.randrange(len(content))
        if number % 3 == 0:
            content[place : place + 4] = b"\xff\xfe\x80\xc0"
        elif number % 3 == 1:
            content = content[:place]
        else:
            for _ in range(16):
                content[dice.randrange(len(content))] = dice.randrange(256)
        lab.path.write_bytes(content)
        try:
            records = lab.contents().records
        except OutputError:
            refused += 1
        else:
            assert len(records) in ((0, 12) if not content else (12,))
    assert refused > 50


def test_lines_of_history_are_corrected_and_not_repeated(lab: Lab) -> None:
    lab.add(SHA, build(), [step("A1"), step("A2")])
    new = lab.correct(HistoryEntry, 1, {"temperature_c": "135,0"})
    assert (new.id, new.corrects, new.serial, new.step) == (3, 1, "A1", "1")
    assert new.readings == {"temperature_c": 135.0, "minutes": 20.0}
    assert [entry.id for entry in standing(lab.contents().entries)] == [2, 3]
    with pytest.raises(DesignError, match="entry e1 is already corrected by entry e3"):
        lab.correct(HistoryEntry, 1, {"note": "again"})
    with pytest.raises(DesignError, match="A2 has this line already, entry e2"):
        lab.add(SHA, None, [step("A2")])


def test_tables_of_the_lab_s_own_are_no_harm(lab: Lab) -> None:
    lab.add(SHA, build(), [result("A1", "fail")])
    changed(
        "CREATE VIEW failed AS SELECT content ->> 'serial' FROM record "
        "WHERE content ->> 'leak' = 'fail'",
        "CREATE TABLE shelf (serial TEXT, place TEXT)",
    )(lab.path)
    lab.add(SHA, None, [result("A2", "pass")])
    assert len(lab.contents().records) == 2
