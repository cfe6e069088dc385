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
from sbafab.results.records import Build, LabResult, checked
from sbafab.results.report import standing
from sbafab.results.store import Lab
from tests.hardship.starting import WITHOUT_PRIVILEGES

Make = Callable[..., Build]
SHA = "c0ffee" + 58 * "0"


def test_what_is_stored_comes_back(lab: Lab, make_build: Make) -> None:
    told = LabResult(
        serial="A1",
        leak="pass",
        operator="Ada",
        kit="paper",
        note="50 % rest, 'quoted'",
        numbers={"burst_kpa": 350.0, "stroke_mm": 16.8},
        errors={"offset_mm": (0.1, 0.25)},
    )
    [stored] = lab.add(SHA, make_build(), [told])
    records, builds = lab.contents()
    assert records == [stored]
    assert builds == {SHA: make_build()}
    assert (stored.id, stored.recorded, stored.corrects) == (1, "2026-01-02T03:04:05Z", None)
    for name in ("serial", "leak", "operator", "kit", "note", "numbers", "errors"):
        assert getattr(stored, name) == getattr(told, name)


def test_a_correction_is_a_row_of_its_own_that_names_the_other(lab: Lab, make_build: Make) -> None:
    lab.add(SHA, make_build(), [LabResult("A1", "pass", numbers={"burst_kpa": 35.0})])
    new = lab.correct(1, LabResult(numbers={"burst_kpa": 350.0}))
    records, _ = lab.contents()
    assert [(r.id, r.corrects, r.leak, r.numbers["burst_kpa"]) for r in records] == [
        (1, None, "pass", 35.0),
        (2, 1, "pass", 350.0),
    ]
    assert standing(records) == [new]
    with pytest.raises(DesignError, match="record 1 is corrected by record 2 already"):
        lab.correct(1, LabResult(leak="fail"))
    with pytest.raises(DesignError, match="no record 7"):
        lab.correct(7, LabResult(leak="fail"))
    lab.correct(2, LabResult(withdrawn=True))
    assert standing(lab.contents()[0]) == []
    lab.add(SHA, None, [LabResult("A1", "fail")])


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE result SET leak = 'fail'",
        "DELETE FROM result",
        "UPDATE design SET name = 'leg'",
        "DELETE FROM design",
        "REPLACE INTO design SELECT * FROM design",
        "REPLACE INTO result SELECT * FROM result WHERE id = 1",
        "REPLACE INTO result SELECT 9, recorded, design_sha256, 1, withdrawn, serial, leak, "
        "operator, kit, note, burst_kpa, stroke_mm, force_n, height_mm, mass_g, offset_mm, "
        "turn_deg, cut_mm, attempt, proof_kpa FROM result WHERE id = 2",
        "INSERT INTO result SELECT 9, recorded, design_sha256, 1, withdrawn, serial, leak, "
        "operator, kit, note, burst_kpa, stroke_mm, force_n, height_mm, mass_g, offset_mm, "
        "turn_deg, cut_mm, attempt, proof_kpa FROM result WHERE id = 1",
    ],
)
def test_the_file_itself_refuses_changes(statement: str, lab: Lab, make_build: Make) -> None:
    """Also to another program; the last two would correct a record twice."""
    lab.add(SHA, make_build(), [LabResult("A1", "pass")])
    lab.correct(1, LabResult(note="same"))
    before = lab.contents()
    with closing(sqlite3.connect(lab.path)) as rows:
        with pytest.raises(sqlite3.IntegrityError):
            rows.execute(statement)
        rows.commit()
    assert lab.contents() == before


def test_a_serial_is_told_in_parts_but_not_in_two_ways(lab: Lab, make_build: Make) -> None:
    lab.add(SHA, make_build(), [LabResult("A1", "pass", "Ada")])
    lab.add(SHA, None, [LabResult("A1", operator="Ada", numbers={"burst_kpa": 350.0})])
    with pytest.raises(DesignError, match=r"A1 has leak = pass in record 1; .* --correct 1"):
        lab.add(SHA, None, [LabResult("A2", "pass"), LabResult("A1", "fail")])
    with pytest.raises(DesignError, match=r"A1 has burst_kpa = 350\.0 in record 2 already"):
        lab.add(SHA, None, [LabResult("A1", numbers={"burst_kpa": 350.0})])
    assert len(lab.contents()[0]) == 2, "a batch is stored whole or not at all"


WRITER = """
import sys
from pathlib import Path
from sbafab.errors import DesignError
from sbafab.results.records import Build, LabResult
from sbafab.results.store import Lab
file, who, sha = sys.argv[1:]
lab = Lab(Path(file), 60)
build = Build(sha, "sbafab 1.0.0", "arm", "lobed", "ears", "", {}, {}, (1, 1))
for n in range(15):
    lab.add(sha, build, [LabResult(f"{who}-{n}", "pass")])
try:
    lab.add(sha, build, [LabResult("shared", "pass")])
    print("first")
except DesignError:
    print("late")
"""


def test_processes_that_write_at_once_lose_nothing(lab: Lab) -> None:
    """They also race for who makes the file, and for a serial that only one may have."""
    running = [
        subprocess.Popen(
            [sys.executable, "-c", WRITER, str(lab.path), f"w{n}", SHA],
            stdout=subprocess.PIPE,
            text=True,
        )
        for n in range(4)
    ]
    said = sorted(process.communicate(timeout=120)[0].strip() for process in running)
    assert said == ["first", "late", "late", "late"]
    records, _ = lab.contents()
    assert [record.id for record in records] == list(range(1, 62))
    expected = {f"w{who}-{n}" for who in range(4) for n in range(15)} | {"shared"}
    assert {record.serial for record in records} == expected


def other_program(path: Path) -> None:
    with closing(sqlite3.connect(path)) as rows:
        rows.execute("CREATE TABLE photos (id)")
        rows.commit()


def newer(path: Path) -> None:
    with closing(sqlite3.connect(path)) as rows:
        rows.execute("PRAGMA user_version = 4")


def damaged(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[4096:] = b"\xff" * (len(content) - 4096)
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (other_program, "is a database of another program"),
        (lambda path: path.write_text("serial,leak\nA1,pass\n" * 50), "is no file of records"),
        (lambda path: path.mkdir(), "cannot be opened"),
        (newer, r"was written by a newer sbafab \(records of version 4, this one knows 3\)"),
        (damaged, "is damaged"),
    ],
)
def test_a_file_that_is_not_ours_is_left_alone(
    spoil: Callable[[Path], object], says: str, lab: Lab, make_build: Make
) -> None:
    if spoil in (newer, damaged):
        lab.add(SHA, make_build(), [LabResult("A1", "pass")])
    spoil(lab.path)
    before = lab.path.read_bytes() if lab.path.is_file() else None
    with pytest.raises(OutputError, match=says):
        lab.add(SHA, make_build(), [LabResult("A2", "pass")])
    with pytest.raises(OutputError):
        lab.contents()
    assert before == (lab.path.read_bytes() if lab.path.is_file() else None)


def without_trigger(rows: sqlite3.Connection) -> None:
    rows.execute("DROP TRIGGER result_UPDATE")
    rows.execute("UPDATE result SET leak = 'pass'")


def with_another_answer(rows: sqlite3.Connection) -> None:
    rows.execute("DROP TRIGGER result_UPDATE")
    rows.execute("CREATE TRIGGER result_UPDATE BEFORE UPDATE ON result BEGIN SELECT 1; END")


def with_a_trigger_more(rows: sqlite3.Connection) -> None:
    rows.execute(
        "CREATE TRIGGER more AFTER INSERT ON design BEGIN INSERT INTO result SELECT 9, '', "
        "NEW.sha256, NULL, 0, 'A9', 'pass', '', '', '', 1, 1, 1, 1, 1, '[]', '[]', '[]', 1; END"
    )


def without_order(rows: sqlite3.Connection) -> None:
    rows.execute("DROP INDEX item")


def of_other_columns(rows: sqlite3.Connection) -> None:
    rows.execute("ALTER TABLE result ADD COLUMN colour TEXT")


@pytest.mark.parametrize(
    "change",
    [without_trigger, with_another_answer, with_a_trigger_more, without_order, of_other_columns],
)
def test_a_file_whose_triggers_or_tables_were_changed_is_refused(
    change: Callable[[sqlite3.Connection], None], lab: Lab, make_build: Make
) -> None:
    lab.add(SHA, make_build(), [LabResult("A1", "fail")])
    with closing(sqlite3.connect(lab.path)) as rows:
        change(rows)
        rows.commit()
    before = lab.path.read_bytes()
    for use in (lab.contents, lambda: lab.add(SHA, None, [LabResult("A2", "pass")])):
        with pytest.raises(OutputError, match="records may have been changed"):
            use()
    assert lab.path.read_bytes() == before


def test_a_view_and_a_table_of_the_lab_s_own_are_no_harm(lab: Lab, make_build: Make) -> None:
    lab.add(SHA, make_build(), [LabResult("A1", "fail")])
    with closing(sqlite3.connect(lab.path)) as rows:
        rows.execute("CREATE VIEW failed AS SELECT serial FROM result WHERE leak = 'fail'")
        rows.execute("CREATE TABLE shelf (serial TEXT, place TEXT)")
        rows.execute("ANALYZE")
        rows.commit()
    lab.add(SHA, None, [LabResult("A2", "pass")])
    assert len(lab.contents()[0]) == 2


@pytest.mark.parametrize(
    "cells",
    [
        "leak = 'maybe'",
        "stroke_mm = 'long'",
        "stroke_mm = -1",
        "offset_mm = '{}x'",
        "offset_mm = '[null]'",
        "offset_mm = '3'",
        "serial = CAST(x'ff41' AS TEXT)",
        "withdrawn = 'no'",
        "design_sha256 = 'abc'",
    ],
)
def test_cells_that_no_version_writes_are_damage(cells: str, lab: Lab, make_build: Make) -> None:
    """Rewritten with the triggers put back, or by a disk that fails."""
    lab.add(SHA, make_build(), [LabResult("A1", "fail")])
    with closing(sqlite3.connect(lab.path)) as rows:
        [(trigger,)] = rows.execute("SELECT sql FROM sqlite_master WHERE name = 'result_UPDATE'")
        rows.execute("DROP TRIGGER result_UPDATE")
        rows.execute(f"UPDATE result SET {cells}")
        rows.execute(trigger)
        rows.commit()
    with pytest.raises(OutputError, match="is damaged"):
        lab.contents()


def test_a_file_damaged_anywhere_is_one_sentence_or_whole(lab: Lab, make_build: Make) -> None:
    """A page that is lost, bytes that flip, an end that is missing."""
    for n in range(12):
        lab.add(SHA, make_build(), [LabResult(f"A{n}", "pass", note="n\u00f6te")])
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
            records, _ = lab.contents()
        except OutputError:
            refused += 1
        else:
            assert len(records) == 12
    assert refused > 50


def test_a_locked_file_is_one_sentence_and_readers_need_not_wait(
    lab: Lab, make_build: Make
) -> None:
    lab.add(SHA, make_build(), [LabResult("A1", "pass")])
    with closing(sqlite3.connect(lab.path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(OutputError, match="is in use by another program"):
            lab.add(SHA, None, [LabResult("A2", "pass")])
        assert len(lab.contents()[0]) == 1


READ_ONLY = f"""{WITHOUT_PRIVILEGES}
import sys
from pathlib import Path
from sbafab.errors import OutputError
from sbafab.results.records import LabResult
from sbafab.results.store import Lab
lab = Lab(Path(sys.argv[1]))
print(len(lab.contents()[0]))
for path in (lab.path, lab.path.parent / "new.sqlite"):
    try:
        Lab(path).add(sys.argv[2], None, [LabResult("A2", "pass")])
    except OutputError as error:
        print(error)
"""


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders have no modes on this system")
def test_a_file_that_may_only_be_read_still_reports(make_build: Make, tmp_path: Path) -> None:
    lab = Lab(tmp_path / "lab.sqlite")
    lab.add(SHA, make_build(), [LabResult("A1", "pass")])
    lab.path.chmod(0o444)
    tmp_path.chmod(0o555)
    arguments = [sys.executable, "-c", READ_ONLY, str(lab.path), SHA]
    ran = subprocess.run(arguments, capture_output=True, text=True, check=True)
    tmp_path.chmod(0o700)
    count, old, new = ran.stdout.splitlines()
    assert count == "1"
    assert "may only be read; nothing was recorded" in old
    assert "cannot be opened; see that its folder exists" in new


@pytest.mark.parametrize(
    ("result", "says"),
    [
        (LabResult("A1", "leaks"), "leak is 'leaks'; write pass or fail"),
        (LabResult("x" * 65), "serial has 65 characters; at most 64"),
        (LabResult("A\n1"), "serial must be plain text in one line"),
        (LabResult("A1", numbers={"burst_kpa": 0.0}), r"burst_kpa is 0; it must be above 0"),
        (LabResult("A1", numbers={"mass_g": float("nan")}), "mass_g is nan"),
        (LabResult("A1", numbers={"stroke_mm": 1e9}), "at most 10,000 mm"),
        (LabResult("A1", errors={"offset_mm": (0.1, -0.2)}), "offset_mm is -0.2; it must be 0 or"),
    ],
)
def test_what_cannot_be_meant_is_refused(result: LabResult, says: str) -> None:
    with pytest.raises(DesignError, match=says):
        checked(result)
