"""The history of devices: lines of it, the hash chain over all rows, photographs, export."""

from __future__ import annotations

import csv
import hashlib
import json
import re
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pypdfium2
import pytest
from PIL import Image

from sbafab.errors import DesignError, OutputError
from sbafab.results import store as store_module
from sbafab.results.export import lab_history, write_history
from sbafab.results.history import HistoryEntry, entries_of, read_history, standing_entries
from sbafab.results.records import Build, LabResult
from sbafab.results.store import Lab
from tests.site.formats import hold

Make = Callable[..., Build]
SHA = "c0ffee" + 58 * "0"
STEP = HistoryEntry(
    serial="A1", step="1", initials="AL", readings={"temperature_c": 134.5, "minutes": 20}
)


def picture(path: Path, colour: str = "red") -> Path:
    Image.new("RGB", (40, 30), colour).save(path)
    return path


@pytest.fixture
def filled(lab: Lab, make_build: Make, tmp_path: Path) -> Lab:
    """Two devices, a correction, a photograph and two results."""
    lab.add_entries(SHA, make_build(), [STEP, replace(STEP, serial="A2")])
    lab.add(SHA, None, [LabResult("A1", "pass"), LabResult("A2", "fail")])
    lab.correct_entry(1, HistoryEntry(readings={"temperature_c": 135.0}))
    photograph = str(picture(tmp_path / "rim.jpg"))
    lab.add_entries(
        SHA,
        None,
        [HistoryEntry(serial="A2", decision="rework", reason="rim", photograph=photograph)],
    )
    return lab


def test_lines_come_back_and_a_correction_is_a_line_of_its_own(filled: Lab) -> None:
    entries = filled.entries()
    assert [(entry.id, entry.corrects, entry.serial) for entry in entries] == [
        *((1, None, "A1"), (2, None, "A2"), (3, 1, "A1"), (4, None, "A2"))
    ]
    assert entries[0].readings == {"temperature_c": 134.5, "minutes": 20.0}
    assert entries[2].readings == {"temperature_c": 135.0, "minutes": 20.0}
    assert [entry.id for entry in standing_entries(entries)] == [2, 3, 4]
    with pytest.raises(DesignError, match="entry e1 is corrected by e3 already"):
        filled.correct_entry(1, HistoryEntry(note="again"))
    with pytest.raises(DesignError, match="A2 has this line already, entry e2"):
        filled.add_entries(SHA, None, [replace(STEP, serial="A2")])


def test_attempts_are_counted_over_history_and_results(lab: Lab, make_build: Make) -> None:
    lab.add_entries(SHA, make_build(), [STEP])
    lab.add(SHA, None, [LabResult("A1", "fail")])
    [again] = lab.add_entries(SHA, None, [STEP], is_again=True)
    [result] = lab.add(SHA, None, [LabResult("A1", "pass")])
    assert (again.attempt, result.attempt) == (2, 2)


# The chain, computed by the page's words: this code shares nothing with the program's.


def judged(path: Path) -> list[str]:
    """The hashes of the chain, each row hashed from the table it stands in."""
    hashes = []
    with closing(sqlite3.connect(path)) as rows:
        rows.row_factory = sqlite3.Row
        tables = {
            name: rows.execute(f"SELECT * FROM {name}") for name in ("design", "result", "entry")
        }
        contents = {}
        for name, cursor in tables.items():
            for row in cursor:
                key = f"{row['sha256']} {row['generator']}" if name == "design" else str(row["id"])
                stated = {k: row[k] for k in row.keys() if row[k] is not None}  # noqa: SIM118
                contents[name, key] = digest(stated)
        previous = 64 * "0"
        for link in rows.execute("SELECT * FROM chain ORDER BY id"):
            body = {
                "adopted": link["adopted"],
                "content_sha256": contents.pop((link["source"], link["row"])),
                "id": len(hashes) + 1,
                "previous": previous,
                "row": link["row"],
                "source": link["source"],
            }
            previous = digest(body)
            hashes.append(previous)
    assert not contents, "every row is a link"
    return hashes


def digest(content: dict[str, object]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def test_the_chain_is_what_the_page_says(filled: Lab) -> None:
    hashes = judged(filled.path)
    assert [link.sha256 for link in filled.links()] == hashes
    check = filled.check()
    assert (check.links, check.adopted, check.head, check.broken) == (7, 0, hashes[-1], "")
    noted = filled.check(hashes[4][:12])
    assert (noted.broken, noted.later) == ("", 2)


def doctored(lab: Lab, *statements: str) -> None:
    """Change the file behind its triggers, and put the triggers back."""
    with closing(sqlite3.connect(lab.path)) as rows:
        triggers = rows.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'")
        every = list(triggers)
        for name, _ in every:
            rows.execute(f"DROP TRIGGER {name}")
        for statement in statements:
            rows.execute(statement)
        for _, sql in every:
            rows.execute(sql)
        rows.commit()


INSERT = (
    "INSERT INTO result SELECT 9, recorded, design_sha256, NULL, withdrawn, 'A9', 'pass', "
    "operator, kit, note, burst_kpa, stroke_mm, force_n, height_mm, mass_g, offset_mm, turn_deg, "
    "cut_mm, attempt, proof_kpa FROM result WHERE id = 1"
)


@pytest.mark.parametrize(
    ("statements", "says"),
    [
        (["UPDATE result SET leak = 'pass' WHERE id = 2"], "record 2 was edited"),
        (["UPDATE entry SET temperature_c = 136 WHERE id = 3"], "entry 3 was edited"),
        (["UPDATE design SET name = 'leg'"], "design c0ffee.* was edited"),
        (["DELETE FROM entry WHERE id = 2"], "entry 2 was deleted"),
        (
            ["DELETE FROM entry WHERE id = 2", "DELETE FROM chain WHERE source || row = 'entry2'"],
            "link 3 is missing before record 1: a row was deleted with its link",
        ),
        (
            [
                "DELETE FROM entry WHERE id = 2",
                "DELETE FROM chain WHERE source || row = 'entry2'",
                "UPDATE chain SET id = id - 1 WHERE id > 3",
            ],
            "record 1 does not follow link 2",
        ),
        ([INSERT], "record 9 was inserted without a link"),
        (
            [
                "UPDATE chain SET row = 'x' WHERE source || row = 'result1'",
                "UPDATE chain SET row = '1' WHERE source || row = 'result2'",
                "UPDATE chain SET row = '2' WHERE row = 'x'",
            ],
            "the link of record 2 was edited",
        ),
        (
            [
                "UPDATE chain SET id = 99 WHERE id = 4",
                "UPDATE chain SET id = 4 WHERE id = 5",
                "UPDATE chain SET id = 5 WHERE id = 99",
            ],
            "record 2 does not follow link 3",
        ),
        (["UPDATE chain SET content_sha256 = 'ab' WHERE id = 1"], "the link of design .* edited"),
    ],
)
def test_the_first_row_that_was_changed_is_named(
    statements: list[str], says: str, filled: Lab
) -> None:
    doctored(filled, *statements)
    assert re.match(says, filled.check().broken)


def test_an_end_that_was_cut_off_shows_against_a_noted_head(filled: Lab) -> None:
    noted = filled.check().head
    doctored(filled, "DELETE FROM entry WHERE id = 4", "DELETE FROM chain WHERE id = 7")
    assert filled.check().broken == ""
    assert "no link has the hash" in filled.check(noted).broken


@pytest.mark.parametrize("version", [1, 2])
def test_an_older_file_is_linked_as_it_stands(
    version: int, tmp_path: Path, make_build: Make
) -> None:
    """No row of it is written again; the chain counts them as older than itself."""
    path = tmp_path / "old.sqlite"
    with closing(sqlite3.connect(path)) as rows:
        store_module._make(rows)
        store_module._bring_up_to_date(rows, 1, version)
        rows.execute(
            "INSERT INTO design (sha256, generator, name, family, method, toml, predicted, "
            f"tolerances, good_builds) VALUES ('{SHA}', 'sbafab 1.0.0', 'arm', 'lobed', 'ears', "
            "'', '{}', '{}', '[1, 1]')"
        )
        rows.execute(
            "INSERT INTO result (recorded, design_sha256, withdrawn, serial, leak, operator, kit, "
            f"note, offset_mm, turn_deg, cut_mm) VALUES ('2025-01-01T00:00:00Z', '{SHA}', 0, 'A1', "
            "'pass', '', '', '', '[]', '[]', '[]')"
        )
        rows.commit()
        before = rows.execute("SELECT id, recorded, serial, leak FROM result").fetchall()
    lab = Lab(path, 1.0, lambda: datetime(2026, 1, 2, tzinfo=UTC))
    assert [record.serial for record in lab.contents()[0]] == ["A1"]
    assert lab.entries() == []
    with pytest.raises(OutputError, match="older than the hash chain"):
        lab.check()
    lab.add_entries(SHA, make_build(), [STEP])
    check = lab.check()
    # The old design and record; the design as this version predicts it has the same key.
    assert (check.links, check.adopted, check.broken) == (3, 2, "")
    assert judged(path)[-1] == check.head
    with closing(sqlite3.connect(path)) as rows:
        assert rows.execute("SELECT id, recorded, serial, leak FROM result").fetchall() == before
    doctored(lab, "UPDATE result SET leak = 'fail'")
    assert lab.check().broken.startswith("record 1 was edited")


def test_photographs_lie_beside_the_file_by_their_hash(filled: Lab, tmp_path: Path) -> None:
    [name] = [entry.photograph for entry in filled.entries() if entry.photograph]
    stored = tmp_path / "lab-photographs" / name
    original = (tmp_path / "rim.jpg").read_bytes()
    assert stored.read_bytes() == original
    assert name == f"{hashlib.sha256(original).hexdigest()}.jpg"
    picture(stored, "blue")
    assert name in filled.check().broken
    with pytest.raises(DesignError, match=r"no JPEG, PNG or WebP"):
        filled.add_entries(SHA, None, [HistoryEntry(serial="A1", photograph=__file__)])
    with pytest.raises(DesignError, match="cannot be read"):
        filled.add_entries(SHA, None, [HistoryEntry(serial="A1", photograph="none.jpg")])


# Lines from files and forms.


TOML = """
serial = ["A1", "A2"]
initials = "AL"
[[entry]]
item = "TPE"
lot = "L7"
expires = "2026-01-31"
[[entry]]
step = 1
temperature_c = 134.5
"""


def test_files_of_three_kinds_state_the_same(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(TOML)
    (tmp_path / "a.json").write_text(
        json.dumps(
            {
                "serial": "A1, A2",
                "initials": "AL",
                "entry": [
                    {"item": "TPE", "lot": "L7", "expires": "2026-01-31"},
                    {"step": "1", "temperature_c": 134.5},
                ],
            }
        )
    )
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


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"lot": "L7", "item": "TPE"}, "needs its serial"),
        ({"serial": "A1", "initials": "AL"}, "states a lot, a reading"),
        ({"serial": "A1", "lot": "L7"}, "a lot needs its item"),
        ({"serial": "A1", "item": "TPE", "expires": "2026-01-31", "note": "x"}, "needs its lot"),
        ({"serial": "A1", "minutes": 20}, "need their step"),
        ({"serial": "A1", "step": 1, "minutes": "20 min"}, "minutes is '20 min', not a number"),
        ({"serial": "A1", "step": 1, "temperature_c": 1350}, "at most 400 C"),
        ({"serial": "A1", "decision": "good"}, "write accept, reject or rework"),
        ({"serial": "A1", "decision": "reject"}, "a reject needs its reason"),
        ({"serial": "A1", "decision": "accept", "reason": "leaks"}, "a reason goes with"),
        ({"serial": "A1", "note": "x", "date": "4.5.2026"}, "write a day such as 2026-05-04"),
        ({"serial": "A1", "note": "x", "date": "20260504"}, "write a day such as"),
        ({"serial": "A1", "colour": "red"}, "an entry has no 'colour'; it has date, serial"),
        ({"serial": "A1", "note": "a\nb"}, "plain text in one line"),
    ],
)
def test_what_cannot_be_meant_is_one_sentence(values: dict[str, object], says: str) -> None:
    with pytest.raises(DesignError, match=says) as refused:
        entries_of(values, "row 3")
    assert str(refused.value).startswith("row 3: ")


# Export.


def test_exports_hold_every_row_and_have_no_date_of_print(filled: Lab, tmp_path: Path) -> None:
    history = lab_history(filled)
    for ending in ("csv", "json", "pdf"):
        paths = [tmp_path / f"{n}.{ending}" for n in "ab"]
        for path in paths:
            write_history(history, path)
        assert paths[0].read_bytes() == paths[1].read_bytes()
    document = json.loads((tmp_path / "a.json").read_text())
    hold("history", document)
    assert [device["serial"] for device in document["devices"]] == ["A1", "A2"]
    rows = list(csv.DictReader((tmp_path / "a.csv").read_text().splitlines()))
    assert sorted(row["row"] for row in rows) == ["1", "2", "e1", "e2", "e3", "e4"]
    hashes = {link.sha256 for link in filled.links() if link.source != "design"}
    assert {row["sha256"] for row in rows} == hashes
    with pypdfium2.PdfDocument(tmp_path / "a.pdf") as pdf:
        texts = [page.get_textpage().get_text_bounded() for page in pdf]
        pictures = [sum(o.type == 3 for o in page.get_objects()) for page in pdf]
    assert len(texts) == 3, "a page a device, and one of photographs"
    assert "serial A1" in texts[0]
    assert "temperature_c 135" in texts[0]
    assert filled.check().head in texts[0]
    assert "rework: rim" in texts[1]
    assert pictures == [0, 0, 1]
    assert b"CreationDate" not in (tmp_path / "a.pdf").read_bytes()
    one = lab_history(filled, "A2")
    assert [device.serial for device in one.devices] == ["A2"]
    with pytest.raises(DesignError, match="ends in none of"):
        write_history(history, tmp_path / "a.doc")
    with pytest.raises(DesignError, match="no device goes with 'Z9'"):
        lab_history(filled, "Z9")


def test_a_lot_that_had_expired_is_marked(lab: Lab, make_build: Make) -> None:
    lot = HistoryEntry(serial="A1", item="TPE", lot="L7", expires="2026-01-31")
    days = ("2026-01-31", "2026-02-01")
    lab.add_entries(SHA, make_build(), [replace(lot, date=day) for day in days])
    assert [entry.is_expired for entry in lab.entries()] == [False, True]
