"""A lab's records in one SQLite file: rows are added, never changed, by any number of processes.

The file refuses changes itself (triggers). A record that corrects another names it, and no record
is corrected twice. Writers wait for each other; each write is one transaction. Whenever it is
opened, tables, triggers and pages are checked: a file without them may have been changed.
"""

from __future__ import annotations

import json
import sqlite3
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from sbafab.actuators import build as laminate_of
from sbafab.actuators import records
from sbafab.design.files import ASSEMBLY
from sbafab.design.identity import actuator_sha256
from sbafab.design.records import Design, validated
from sbafab.errors import DesignError, OutputError
from sbafab.output.checked import limits
from sbafab.results.history import (
    CHAINED,
    ENTRY_TEXTS,
    READING_NAMES,
    ChainCheck,
    HistoryEntry,
    Link,
    StoredEntry,
    add_links,
    chain_links,
    check_chain,
    checked_entry,
    is_stored_photograph,
    lost_photographs,
    photograph_folder,
    standing_entries,
    with_photograph,
)
from sbafab.results.records import ERRORS, NUMBERS, Build, LabResult, Record, checked
from sbafab.rules.registration_yield import Share, simulate

APPLICATION = 0x5BAFAB
VERSION = 3
PATIENCE = 10.0
"""Seconds that a writer waits for others."""

_SINGLE = ("serial", "leak", "operator", "kit", "note")
_NUMBERS = tuple(quantity.name for quantity in NUMBERS)
_ERRORS = tuple(quantity.name for quantity in ERRORS)
_RESULT = (
    *("id", "recorded", "design_sha256", "corrects", "withdrawn"),
    *(*_SINGLE, *_NUMBERS, *_ERRORS),
    "attempt",
)
_BUILD = (
    *("sha256", "generator", "name", "family", "method", "toml"),
    *("predicted", "tolerances", "good_builds"),
    "actuator_sha256",
)
_BEFORE = {"actuator_sha256": "''", "attempt": "1", "proof_kpa": "NULL"}
"""What these columns say in a file of version 1."""
_SCHEMA = f"""
CREATE TABLE design (
    {", ".join(f"{name} TEXT NOT NULL" for name in _BUILD[:-1])},
    PRIMARY KEY (sha256, generator)
);
CREATE TABLE result (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    recorded TEXT NOT NULL,
    design_sha256 TEXT NOT NULL,
    corrects INTEGER UNIQUE REFERENCES result (id),
    withdrawn INTEGER NOT NULL,
    {", ".join(f"{name} TEXT NOT NULL" for name in _SINGLE)},
    {", ".join(f"{name} REAL" for name in _NUMBERS if name not in _BEFORE)},
    {", ".join(f"{name} TEXT NOT NULL" for name in _ERRORS)}
);
CREATE INDEX item ON result (design_sha256, serial);
"""
_ENTRY = (
    *("id", "recorded", "design_sha256", "corrects", "withdrawn", "attempt"),
    *(*ENTRY_TEXTS, *READING_NAMES),
)
_ADDED = {
    2: (
        "ALTER TABLE design ADD COLUMN actuator_sha256 TEXT NOT NULL DEFAULT ''",
        "ALTER TABLE result ADD COLUMN attempt INTEGER NOT NULL DEFAULT 1",
        "ALTER TABLE result ADD COLUMN proof_kpa REAL",
    ),
    3: (
        f"""CREATE TABLE entry (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    recorded TEXT NOT NULL,
    design_sha256 TEXT NOT NULL,
    corrects INTEGER UNIQUE REFERENCES entry (id),
    withdrawn INTEGER NOT NULL,
    attempt INTEGER NOT NULL,
    {", ".join(f"{name} TEXT NOT NULL" for name in ENTRY_TEXTS)},
    {", ".join(f"{name} REAL" for name in READING_NAMES)}
)""",
        "CREATE INDEX device ON entry (design_sha256, serial)",
        """CREATE TABLE chain (
    id INTEGER PRIMARY KEY,
    source TEXT NOT NULL,
    row TEXT NOT NULL,
    adopted INTEGER NOT NULL,
    content_sha256 TEXT NOT NULL,
    previous TEXT NOT NULL UNIQUE,
    sha256 TEXT NOT NULL,
    UNIQUE (source, row)
)""",
    ),
}
"""What each version added to the one before."""
_KEPT = """
CREATE TRIGGER {name} BEFORE {what} BEGIN
    SELECT RAISE(ABORT, 'records are never changed; add one that corrects');
END
"""


def _unchanging(*tables: str) -> dict[str, str]:
    """Return triggers of changes to rows of these tables, by name."""
    return {
        f"{table}_{verb}": f"{verb} ON {table}" for table in tables for verb in ("UPDATE", "DELETE")
    }


# REPLACE deletes rows without asking the triggers of deletion.
_TRIGGERS = {
    **_unchanging("design", "result"),
    "design_twice": "INSERT ON design WHEN EXISTS "
    "(SELECT 1 FROM design WHERE sha256 = NEW.sha256 AND generator = NEW.generator)",
    "result_twice": "INSERT ON result WHEN EXISTS "
    "(SELECT 1 FROM result WHERE id = NEW.id OR corrects = NEW.corrects)",
}
_TRIGGERS_ADDED = {
    **_unchanging("entry", "chain"),
    "entry_twice": "INSERT ON entry WHEN EXISTS "
    "(SELECT 1 FROM entry WHERE id = NEW.id OR corrects = NEW.corrects)",
    "chain_twice": "INSERT ON chain WHEN EXISTS (SELECT 1 FROM chain WHERE id = NEW.id "
    "OR previous = NEW.previous OR (source = NEW.source AND row = NEW.row))",
}
"""Of version 3."""

Clock = Callable[[], datetime]


def now() -> datetime:
    return datetime.now(UTC)


class Lab:
    """The records of the file ``path``, which the first record makes.

    Methods raise DesignError for what contradicts the records and OutputError, with one sentence,
    where the file is locked, closed to us, damaged, another program's or of a newer version.
    """

    def __init__(self, path: Path, patience: float = PATIENCE, clock: Clock = now) -> None:
        self.path, self.patience, self.clock = path, patience, clock

    def knows(self, sha256: str, generator: str) -> bool:
        """True if this design is stored with the predictions of this version."""
        if not self.path.exists():
            return False
        with self._reading() as (rows, _):
            return _is_known(rows, sha256, generator)

    def add(
        self,
        sha256: str,
        build: Build | None,
        results: Sequence[LabResult],
        is_again: bool = False,
    ) -> list[Record]:
        """Stores results of a design, all or none; ``build`` where it is not known yet.

        ``is_again``: of actuators that were recorded, mended and tested again, as a new attempt.
        """
        if is_again and not self.path.exists():
            raise OutputError(f"{self.path} does not exist, so there is no attempt before this one")
        with self._writing() as rows:
            if build is not None and not _is_known(rows, build.sha256, build.generator):
                _put_build(rows, build)
            added = []
            for result in map(checked, results):
                live = _live(rows, sha256, result.serial)
                attempt = _attempt(rows, sha256, result.serial, is_again)
                added.append(self._put(rows, sha256, result, None, attempt, live))
            return added

    def add_entries(
        self,
        sha256: str,
        build: Build | None,
        entries: Sequence[HistoryEntry],
        is_again: bool = False,
    ) -> list[StoredEntry]:
        """Store lines of the history of devices of a design, all or none, as ``add`` does.

        Photographs are copied into the folder beside the lab's file first.
        """
        if is_again and not self.path.exists():
            raise OutputError(f"{self.path} does not exist, so there is no attempt before this one")
        entries = [with_photograph(self.path, checked_entry(entry)) for entry in entries]
        with self._writing() as rows:
            if build is not None and not _is_known(rows, build.sha256, build.generator):
                _put_build(rows, build)
            serials = dict.fromkeys(entry.serial for entry in entries)
            attempts = {serial: _attempt(rows, sha256, serial, is_again) for serial in serials}
            return [
                self._put_entry(rows, sha256, entry, None, attempts[entry.serial])
                for entry in entries
            ]

    def correct_entry(self, number: int, change: HistoryEntry) -> StoredEntry:
        """Store an entry that repeats ``number`` but for what ``change`` states."""
        if not self.path.exists():
            raise OutputError(f"{self.path} does not exist, so there is no entry to correct")
        with self._writing() as rows:
            stored = {entry.id: entry for entry in _entries(rows)}
            if number not in stored:
                raise DesignError(f"{self.path} holds no entry {number}; see: sbafab record --find")
            newer = [entry.id for entry in stored.values() if entry.corrects == number]
            if newer:
                raise DesignError(
                    f"entry e{number} is corrected by e{newer[0]} already; correct that one"
                )
            old = stored[number]
            entry = with_photograph(self.path, checked_entry(old.changed(change)))
            return self._put_entry(rows, old.design_sha256, entry, number, old.attempt)

    def entries(self) -> list[StoredEntry]:
        """All lines of history, those that were corrected too; none in a file of version 2."""
        with self._reading() as (rows, version):
            return _entries(rows) if version >= 3 else []

    def links(self) -> list[Link]:
        """The links of the chain in their order; none in a file of version 2."""
        with self._reading() as (rows, version):
            return chain_links(rows) if version >= 3 else []

    def check(self, head: str = "") -> ChainCheck:
        """Compute the hash chain again, and look for every photograph.

        ``head`` is a hash that was noted earlier, or its first digits. Raises OutputError for a
        file of version 2, which has no chain until something is recorded in it.
        """
        with self._reading() as (rows, version):
            if version < 3:
                raise OutputError(
                    f"{self.path} is older than the hash chain and has none; the next record adds "
                    "one, which covers the rows from then on"
                )
            # A text that is none any more is an edit, not an error.
            rows.text_factory = lambda raw: raw.decode("utf-8", "backslashreplace")
            checked_chain = check_chain(rows, head)
        if not checked_chain.broken:
            for name in lost_photographs(self.path, self.entries()):
                lost = photograph_folder(self.path) / name
                return replace(checked_chain, broken=f"photograph {lost} is missing or was changed")
        return checked_chain

    def correct(self, number: int, change: LabResult) -> Record:
        """Store a record that repeats ``number`` but for what ``change`` states."""
        if not self.path.exists():
            raise OutputError(f"{self.path} does not exist, so there is no record to correct")
        with self._writing() as rows:
            old = _record_numbered(rows, number)
            if old is None:
                raise DesignError(
                    f"{self.path} holds no record {number}; see: sbafab record --find"
                )
            newer = rows.execute("SELECT id FROM result WHERE corrects = ?", (number,)).fetchone()
            if newer is not None:
                raise DesignError(
                    f"record {number} is corrected by record {newer[0]} already; correct that one"
                )
            result = checked(old.changed(change))
            live = _live(rows, old.design_sha256, result.serial)
            return self._put(rows, old.design_sha256, result, number, old.attempt, live)

    def contents(self) -> tuple[list[Record], dict[str, Build]]:
        """All records, those that were corrected too, and their designs by sha256.

        A design stands as the newest version that recorded it predicts it.
        """
        with self._reading() as (rows, version):
            builds = {build.sha256: build for build in _builds(rows, version)}
            records = [_record(row) for row in rows.execute(f"{_select(version)} ORDER BY id")]
        if not {record.design_sha256 for record in records} <= set(builds):
            raise OutputError(f"{self.path} {_REASONS['CORRUPT']}")
        return records, builds

    def _put(
        self,
        rows: sqlite3.Connection,
        sha256: str,
        result: LabResult,
        corrects: int | None,
        attempt: int,
        live: Sequence[Record],
    ) -> Record:
        if not result.withdrawn:
            for live_record in live:
                if live_record.id != corrects and live_record.attempt == attempt:
                    _refuse_contradiction(result, live_record)
        values = (
            *(None, self.clock().strftime("%Y-%m-%dT%H:%M:%SZ"), sha256, corrects),
            int(result.withdrawn),
            *(getattr(result, name) for name in _SINGLE),
            *(result.numbers.get(name) for name in _NUMBERS),
            *(json.dumps(list(result.errors.get(name, ()))) for name in _ERRORS),
            attempt,
        )
        marks = ", ".join("?" * len(values))
        added = rows.execute(
            f"INSERT INTO result ({', '.join(_RESULT)}) VALUES ({marks})", values
        ).lastrowid
        assert added is not None
        add_links(rows, "result", str(added))
        stored = _record_numbered(rows, added)
        assert stored is not None
        return stored

    def _put_entry(
        self,
        rows: sqlite3.Connection,
        sha256: str,
        entry: HistoryEntry,
        corrects: int | None,
        attempt: int,
    ) -> StoredEntry:
        if corrects is None:
            _refuse_repeat(rows, entry, attempt)
        values = (
            *(self.clock().strftime("%Y-%m-%dT%H:%M:%SZ"), sha256, corrects),
            *(int(entry.withdrawn), attempt),
            *(getattr(entry, name) for name in ENTRY_TEXTS),
            *(entry.readings.get(name) for name in READING_NAMES),
        )
        marks = ", ".join("?" * len(values))
        added = rows.execute(
            f"INSERT INTO entry ({', '.join(_ENTRY[1:])}) VALUES ({marks})", values
        ).lastrowid
        add_links(rows, "entry", str(added))
        [stored] = _entries(rows, "WHERE id = ?", (added,))
        return stored

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """One transaction, in a file that is made where there is none."""
        with self._sqlite_errors(), closing(self._open()) as rows:
            rows.execute("BEGIN IMMEDIATE")
            try:
                _bring_up_to_date(rows, self._version(rows))
                yield rows
                rows.execute("COMMIT")
            finally:
                if rows.in_transaction:
                    rows.execute("ROLLBACK")

    @contextmanager
    def _reading(self) -> Iterator[tuple[sqlite3.Connection, int]]:
        """The file as it lies at one moment, and its version; one that may only be read will do."""
        if not self.path.is_file():
            raise OutputError(
                f"{self.path} is no file of records; record something first, or name the lab's "
                "file with --lab"
            )
        with self._sqlite_errors(), closing(self._open("?mode=ro")) as rows:
            rows.execute("BEGIN")
            version = self._version(rows)
            if version == 0:
                raise OutputError(f"{self.path} holds no records yet")
            yield rows, version

    def _open(self, mode: str = "") -> sqlite3.Connection:
        return sqlite3.connect(
            f"{self.path.absolute().as_uri()}{mode}",
            uri=True,
            timeout=self.patience,
            isolation_level=None,
        )

    def _version(self, rows: sqlite3.Connection) -> int:
        """The schema's version, 0 of an empty file. Raises OutputError for a file not ours."""
        (version,) = rows.execute("PRAGMA user_version").fetchone()
        (application,) = rows.execute("PRAGMA application_id").fetchone()
        (tables,) = rows.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if tables == 0 and version == 0 and application == 0:
            return 0
        if application != APPLICATION:
            raise OutputError(
                f"{self.path} is a database of another program; name the lab's file with --lab"
            )
        if not 1 <= version <= VERSION:
            raise OutputError(
                f"{self.path} was written by a newer sbafab (records of version {version}, this "
                f"one knows {VERSION}); update sbafab"
            )
        shape, expected = _shape(rows), _shape_of(version)
        if not shape >= expected or any(kind == "trigger" for kind, *_ in shape - expected):
            raise OutputError(
                f"{self.path} lacks tables or triggers of a file of records, or has other "
                "triggers, so that its records may have been changed; put a sound copy in its place"
            )
        if rows.execute("PRAGMA integrity_check(1)").fetchone() != ("ok",):
            raise OutputError(f"{self.path} {_REASONS['CORRUPT']}")
        return int(version)

    @contextmanager
    def _sqlite_errors(self) -> Iterator[None]:
        """Turn SQLite's errors into one sentence."""
        try:
            yield
        except sqlite3.Error as error:
            raise OutputError(f"{self.path} {_reason(error)}") from error
        except (_DamagedError, UnicodeDecodeError) as error:
            # SQLite's own message may quote what is no text any more.
            raise OutputError(f"{self.path} {_REASONS['CORRUPT']}") from error


class _DamagedError(Exception):
    """A row that no version has written."""


def _select(version: int = VERSION) -> str:
    return f"SELECT {', '.join(_columns(_RESULT, version))} FROM result"


def _columns(names: Sequence[str], version: int) -> Sequence[str]:
    """The columns to ask for, with what an older file lacks as a constant."""
    return names if version >= 2 else [_BEFORE.get(name, name) for name in names]


def _shape(rows: sqlite3.Connection) -> set[tuple[object, ...]]:
    """Tables, indices and triggers: kind, name, table, and the statement that made it."""
    return set(rows.execute("SELECT type, name, tbl_name, sql FROM sqlite_master"))


@cache
def _shape_of(version: int) -> set[tuple[object, ...]]:
    """Return the tables, indices and triggers of a new file of a version."""
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as rows:
        _make(rows)
        _bring_up_to_date(rows, 1, version)
        return _shape(rows)


_REASONS = {
    "BUSY": "is in use by another program; nothing was recorded, try again in a moment",
    "LOCKED": "is in use by another program; nothing was recorded, try again in a moment",
    "READONLY": "may only be read; nothing was recorded, ask for the right to write there",
    "PERM": "may not be opened; ask for the right to it",
    "AUTH": "may not be opened; ask for the right to it",
    "CANTOPEN": "cannot be opened; see that its folder exists and may be written",
    "NOTADB": "is no file of records; name the lab's file with --lab",
    "FULL": "cannot grow, the disk is full; nothing was recorded, make room there",
    "CORRUPT": "is damaged; put a sound copy in its place",
    "IOERR": "cannot be read or written, the disk reports an error; nothing was recorded",
}


def _reason(error: sqlite3.Error) -> str:
    name = getattr(error, "sqlite_errorname", None) or ""
    code = name.removeprefix("SQLITE_").partition("_")[0]
    if not name and "decode" in str(error):
        return _REASONS["CORRUPT"]
    return _REASONS.get(code, f"cannot be used as a file of records: {error}")


def _bring_up_to_date(rows: sqlite3.Connection, version: int, wanted: int = VERSION) -> None:
    """Make tables in an empty file, of version 0, and add what later versions have.

    Rows that are older than the hash chain are linked as they stand, as adopted.
    """
    if version == 0:
        _make(rows)
    for later in range(max(version, 1) + 1, wanted + 1):
        for statement in _ADDED[later]:
            rows.execute(statement)
        if later == 3:
            for name, event in _TRIGGERS_ADDED.items():
                rows.execute(_KEPT.format(name=name, what=event))
            for source in CHAINED:
                add_links(rows, source, adopted=True)
        rows.execute(f"PRAGMA user_version = {later}")


def _make(rows: sqlite3.Connection) -> None:
    """Makes the tables of version 1."""
    for statement in _SCHEMA.split(";"):
        rows.execute(statement)
    for name, event in _TRIGGERS.items():
        rows.execute(_KEPT.format(name=name, what=event))
    rows.execute(f"PRAGMA application_id = {APPLICATION}")
    rows.execute("PRAGMA user_version = 1")


def _is_known(rows: sqlite3.Connection, sha256: str, generator: str) -> bool:
    query = "SELECT 1 FROM design WHERE sha256 = ? AND generator = ?"
    return rows.execute(query, (sha256, generator)).fetchone() is not None


def _put_build(rows: sqlite3.Connection, build: Build) -> None:
    plain = [getattr(build, name) for name in _BUILD[:6]]
    tables = [
        json.dumps(value, sort_keys=True)
        for value in (dict(build.predicted), dict(build.tolerances), list(build.good_builds))
    ]
    marks = ", ".join("?" * len(_BUILD))
    values = [*plain, *tables, build.actuator_sha256]
    rows.execute(f"INSERT INTO design ({', '.join(_BUILD)}) VALUES ({marks})", values)
    add_links(rows, "design", f"{build.sha256} {build.generator}")


def _builds(
    rows: sqlite3.Connection, version: int = VERSION, sha256: Sequence[str] = ()
) -> list[Build]:
    """The designs, or those of the hashes, in the order in which they were recorded."""
    query = f"SELECT {', '.join(_columns(_BUILD, version))} FROM design"
    if sha256:
        query += f" WHERE sha256 IN ({', '.join('?' * len(sha256))})"
    return [_build(row) for row in rows.execute(f"{query} ORDER BY rowid", sha256)]


def _live(rows: sqlite3.Connection, sha256: str, serial: str) -> list[Record]:
    """The records that stand of an actuator: of its design, and of others that build the same."""
    standing = (
        f"{_select()} WHERE serial = ? AND withdrawn = 0 "
        "AND id NOT IN (SELECT corrects FROM result WHERE corrects IS NOT NULL) ORDER BY id"
    )
    records = [_record(row) for row in rows.execute(standing, (serial,))]
    actuators = _actuators(rows, {sha256, *(record.design_sha256 for record in records)})
    return [r for r in records if actuators[r.design_sha256] == actuators[sha256]]


def _attempt(rows: sqlite3.Connection, sha256: str, serial: str, is_again: bool) -> int:
    """Return the attempt that a record or an entry of a device belongs to."""
    live = _live(rows, sha256, serial)
    entries = standing_entries(_entries(rows, "WHERE serial = ?", (serial,)))
    actuators = _actuators(rows, {sha256, *(entry.design_sha256 for entry in entries)})
    attempts = [record.attempt for record in live] + [
        entry.attempt for entry in entries if actuators[entry.design_sha256] == actuators[sha256]
    ]
    if is_again and not attempts:
        raise DesignError(
            f"serial {serial} has no record yet, so there is no attempt before this one; leave "
            "out --again, or see: sbafab record --find"
        )
    return max(attempts, default=1) + is_again


def _actuators(rows: sqlite3.Connection, hashes: Iterable[str]) -> dict[str, str]:
    """Return the hash that actuators are grouped by, of each design."""
    return {build.sha256: build.actuator for build in _builds(rows, VERSION, sorted(hashes))}


def _entries(
    rows: sqlite3.Connection, where: str = "", values: Sequence[object] = ()
) -> list[StoredEntry]:
    query = f"SELECT {', '.join(_ENTRY)} FROM entry {where} ORDER BY id"
    return [_entry(row) for row in rows.execute(query, values)]


def _entry(row: Sequence[object]) -> StoredEntry:
    """A row as an entry. Raises _DamagedError."""
    cells = dict(zip(_ENTRY, row, strict=True))
    corrects = cells["corrects"]
    try:
        entry = StoredEntry(
            **{name: str(cells[name]) for name in (*ENTRY_TEXTS, "recorded", "design_sha256")},
            id=int(str(cells["id"])),
            corrects=None if corrects is None else int(str(corrects)),
            withdrawn=bool(int(str(cells["withdrawn"]))),
            attempt=int(str(cells["attempt"])),
            readings={
                name: float(str(cells[name])) for name in READING_NAMES if cells[name] is not None
            },
        )
        checked_entry(entry)
        if entry.photograph and not is_stored_photograph(entry.photograph):
            raise ValueError(entry.photograph)
    except _UNLIKELY as error:
        raise _DamagedError from error
    return entry


def _refuse_repeat(rows: sqlite3.Connection, entry: HistoryEntry, attempt: int) -> None:
    """Raise DesignError for a line that stands already, as of a form that was sent twice."""
    for stored in standing_entries(_entries(rows, "WHERE serial = ?", (entry.serial,))):
        if stored.attempt == attempt and stored.states_the_same(entry):
            raise DesignError(
                f"serial {entry.serial} has this line already, entry e{stored.id}; leave it out, "
                "or add a date or a note that tells them apart"
            )


def _build(row: Sequence[str]) -> Build:
    """A row as a design. Raises _DamagedError."""
    try:
        texts = dict(zip(_BUILD, map(str, row), strict=True))
        predicted, tolerances, (good, drawn) = (json.loads(texts.pop(name)) for name in _BUILD[6:9])
        build = Build(
            **texts,
            predicted={name: (float(value), str(m)) for name, (value, m) in predicted.items()},
            tolerances={name: float(value) for name, value in tolerances.items()},
            good_builds=(int(good), int(drawn)),
        )
    except _UNLIKELY as error:
        raise _DamagedError from error
    return replace(build, actuator_sha256=actuator_of(build))


def _record_numbered(rows: sqlite3.Connection, number: int) -> Record | None:
    row = rows.execute(f"{_select()} WHERE id = ?", (number,)).fetchone()
    return None if row is None else _record(row)


_UNLIKELY = (ValueError, TypeError, AttributeError, ArithmeticError, LookupError, RecursionError)
"""What comes of a row whose cells hold something else than what was written."""


def _record(row: Sequence[object]) -> Record:
    """A row as a record. Raises _DamagedError."""
    cells = dict(zip(_RESULT, row, strict=True))
    corrects = cells["corrects"]
    try:
        errors = {name: tuple(map(float, json.loads(str(cells[name])))) for name in _ERRORS}
        record = Record(
            **{name: str(cells[name]) for name in (*_SINGLE, "recorded", "design_sha256")},
            id=int(str(cells["id"])),
            corrects=None if corrects is None else int(str(corrects)),
            withdrawn=bool(int(str(cells["withdrawn"]))),
            numbers={name: float(str(cells[name])) for name in _NUMBERS if cells[name] is not None},
            errors={name: values for name, values in errors.items() if values},
            attempt=int(str(cells["attempt"])),
        )
        checked(record)
    except _UNLIKELY as error:
        raise _DamagedError from error
    return record


def _refuse_contradiction(result: LabResult, stored: Record) -> None:
    for name, value in result.once.items():
        if name in stored.once and stored.once[name] != value:
            raise DesignError(
                f"serial {result.serial} has {name} = {stored.once[name]} in record {stored.id}; "
                f"where that is wrong, add: sbafab record --correct {stored.id}; where it was "
                "mended and tested again, record that with --again"
            )
        if name in stored.once and name not in ("operator", "kit"):
            raise DesignError(
                f"serial {result.serial} has {name} = {value} in record {stored.id} already; leave "
                "it out, or choose another serial"
            )


# Designs read again from a lab's file of records, as this version understands them.


BUILDS = 2000
"""Random builds at most: their interval of 2 % is within what a few measured errors leave open."""


def rebuilt(build: Build) -> Design | None:
    """Return the design of a record; None of an assembly and of what cannot be read any more.

    All that its kit gave stands in the record, so the kit's file is not asked for. A drawn outline
    is not in it: the file at its path may be another by now.
    """
    try:
        tables = tomllib.loads(build.toml)
    except (tomllib.TOMLDecodeError, RecursionError):
        return None
    tables.pop("kit", None)
    if not tables or tables.get("family") == ASSEMBLY:
        return None
    try:
        design = validated(tables, records(), Path())
    except DesignError:
        return None
    return None if design.drawing is not None else design


def actuator_of(build: Build) -> str:
    """Return the hash by which records of a design are grouped, as this version counts it.

    So an earlier version's record groups with today's, also where keys were added since. What
    cannot be read again has the hash of its day, or that of the design.
    """
    design = rebuilt(build)
    return build.actuator if design is None else actuator_sha256(design)


def yield_with(design: Design, errors: Mapping[str, float]) -> Share:
    """Return the share of random builds that keep every limit with other errors than stated.

    ``errors``: the most by which placement (mm), turn (degrees) or cutting (mm) are off, by the
    name in Tolerances. Raises DesignError where the design cannot be built.
    """
    stated = limits(design)
    bench = replace(
        stated,
        tolerances=replace(stated.tolerances, **errors),
        yield_builds=min(stated.yield_builds or BUILDS, BUILDS),
    )
    return simulate(laminate_of(design), bench).whole
