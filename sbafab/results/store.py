"""A lab's records in one SQLite file: rows are added, never changed, by any number of processes.

The file refuses changes itself (triggers). A record that corrects another names it, and no record
is corrected twice. Writers wait for each other; each write is one transaction.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path

from sbafab.errors import DesignError, OutputError
from sbafab.results.records import ERRORS, NUMBERS, Build, LabResult, Record, checked

APPLICATION = 0x5BAFAB
VERSION = 1
PATIENCE = 10.0
"""Seconds that a writer waits for others."""

_SINGLE = ("serial", "leak", "operator", "kit", "note")
_NUMBERS = tuple(quantity.name for quantity in NUMBERS)
_ERRORS = tuple(quantity.name for quantity in ERRORS)
_RESULT = (
    *("id", "recorded", "design_sha256", "corrects", "withdrawn"),
    *(*_SINGLE, *_NUMBERS, *_ERRORS),
)
_BUILD = (
    *("sha256", "generator", "name", "family", "method", "toml"),
    *("predicted", "tolerances", "good_builds"),
)
_SCHEMA = f"""
CREATE TABLE design (
    {", ".join(f"{name} TEXT NOT NULL" for name in _BUILD)},
    PRIMARY KEY (sha256, generator)
);
CREATE TABLE result (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    recorded TEXT NOT NULL,
    design_sha256 TEXT NOT NULL,
    corrects INTEGER UNIQUE REFERENCES result (id),
    withdrawn INTEGER NOT NULL,
    {", ".join(f"{name} TEXT NOT NULL" for name in _SINGLE)},
    {", ".join(f"{name} REAL" for name in _NUMBERS)},
    {", ".join(f"{name} TEXT NOT NULL" for name in _ERRORS)}
);
CREATE INDEX item ON result (design_sha256, serial);
"""
_KEPT = """
CREATE TRIGGER {name} BEFORE {what} BEGIN
    SELECT RAISE(ABORT, 'records are never changed; add one that corrects');
END
"""
# REPLACE deletes rows without asking the triggers of deletion.
_TRIGGERS = {
    **{
        f"{table}_{verb}": f"{verb} ON {table}"
        for table in ("design", "result")
        for verb in ("UPDATE", "DELETE")
    },
    "design_twice": "INSERT ON design WHEN EXISTS "
    "(SELECT 1 FROM design WHERE sha256 = NEW.sha256 AND generator = NEW.generator)",
    "result_twice": "INSERT ON result WHEN EXISTS "
    "(SELECT 1 FROM result WHERE id = NEW.id OR corrects = NEW.corrects)",
}

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
        """Whether this design is stored as this version predicts it."""
        if not self.path.exists():
            return False
        with self._reading() as rows:
            return _is_known(rows, sha256, generator)

    def add(self, sha256: str, build: Build | None, results: Sequence[LabResult]) -> list[Record]:
        """Stores results of a design, all or none; ``build`` where it is not known yet."""
        with self._writing() as rows:
            if build is not None and not _is_known(rows, build.sha256, build.generator):
                _put_build(rows, build)
            return [self._put(rows, sha256, result, None) for result in results]

    def correct(self, number: int, change: LabResult) -> Record:
        """Stores a record that says what ``number`` says but for what ``change`` says."""
        if not self.path.exists():
            raise OutputError(f"{self.path} does not exist, so there is no record to correct")
        with self._writing() as rows:
            old = _one(rows, number)
            if old is None:
                raise DesignError(
                    f"{self.path} holds no record {number}; see: sbafab record --find"
                )
            newer = rows.execute("SELECT id FROM result WHERE corrects = ?", (number,)).fetchone()
            if newer is not None:
                raise DesignError(
                    f"record {number} is corrected by record {newer[0]} already; correct that one"
                )
            return self._put(rows, old.design_sha256, old.changed(change), number)

    def contents(self) -> tuple[list[Record], dict[str, Build]]:
        """All records, those that were corrected too, and their designs by sha256.

        A design stands as the newest version that recorded it predicts it.
        """
        with self._reading() as rows:
            rows.execute("BEGIN")
            designs = rows.execute(f"SELECT {', '.join(_BUILD)} FROM design ORDER BY rowid")
            builds = {row[0]: _build(row) for row in designs}
            records = [_record(row) for row in rows.execute(f"{_SELECT} ORDER BY id")]
            rows.execute("COMMIT")
        if not {record.design_sha256 for record in records} <= set(builds):
            raise OutputError(f"{self.path} {_REASONS['CORRUPT']}")
        return records, builds

    def _put(
        self, rows: sqlite3.Connection, sha256: str, result: LabResult, corrects: int | None
    ) -> Record:
        result = checked(result)
        live = [
            _record(row)
            for row in rows.execute(
                f"{_SELECT} WHERE design_sha256 = ? AND serial = ? AND withdrawn = 0 "
                "AND id NOT IN (SELECT corrects FROM result WHERE corrects IS NOT NULL)",
                (sha256, result.serial),
            )
        ]
        if not result.withdrawn:
            for other in live:
                if other.id != corrects:
                    _refuse_contradiction(result, other)
        values = (
            *(None, self.clock().strftime("%Y-%m-%dT%H:%M:%SZ"), sha256, corrects),
            int(result.withdrawn),
            *(getattr(result, name) for name in _SINGLE),
            *(result.numbers.get(name) for name in _NUMBERS),
            *(json.dumps(list(result.errors.get(name, ()))) for name in _ERRORS),
        )
        marks = ", ".join("?" * len(values))
        added = rows.execute(
            f"INSERT INTO result ({', '.join(_RESULT)}) VALUES ({marks})", values
        ).lastrowid
        assert added is not None
        stored = _one(rows, added)
        assert stored is not None
        return stored

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """One transaction, in a file that is made where there is none."""
        with self._told(), closing(self._open()) as rows:
            rows.execute("BEGIN IMMEDIATE")
            try:
                if self._version(rows) == 0:
                    _make(rows)
                yield rows
                rows.execute("COMMIT")
            finally:
                if rows.in_transaction:
                    rows.execute("ROLLBACK")

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        """The file as it lies there; a file that may only be read will do."""
        if not self.path.is_file():
            raise OutputError(
                f"{self.path} is no file of records; record something first, or name the lab's "
                "file with --lab"
            )
        with self._told(), closing(self._open("?mode=ro")) as rows:
            if self._version(rows) == 0:
                raise OutputError(f"{self.path} holds no records yet")
            yield rows

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
        if version != VERSION:
            raise OutputError(
                f"{self.path} was written by a newer sbafab (records of version {version}, this "
                f"one knows {VERSION}); update sbafab"
            )
        return VERSION

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Turns what SQLite says into one sentence."""
        try:
            yield
        except sqlite3.Error as error:
            raise OutputError(f"{self.path} {_reason(error)}") from error
        except json.JSONDecodeError as error:
            raise OutputError(f"{self.path} {_REASONS['CORRUPT']}") from error


_SELECT = f"SELECT {', '.join(_RESULT)} FROM result"
_REASONS = {
    "BUSY": "is in use by another program; nothing was recorded, try again in a moment",
    "LOCKED": "is in use by another program; nothing was recorded, try again in a moment",
    "READONLY": "may only be read; nothing was recorded, ask for the right to write there",
    "PERM": "may not be opened; ask for the right to it",
    "AUTH": "may not be opened; ask for the right to it",
    "CANTOPEN": "cannot be opened; see that its folder exists and may be written",
    "NOTADB": "is no file of records; name the lab's file with --lab",
    "FULL": "cannot grow, the disk is full; nothing was recorded, make room there",
    "CORRUPT": "is damaged; put a copy in its place that is sound",
    "IOERR": "cannot be read or written, the disk reports an error; nothing was recorded",
}


def _reason(error: sqlite3.Error) -> str:
    name = getattr(error, "sqlite_errorname", None) or ""
    code = name.removeprefix("SQLITE_").partition("_")[0]
    return _REASONS.get(code, f"cannot be used as a file of records: {error}")


def _make(rows: sqlite3.Connection) -> None:
    for statement in _SCHEMA.split(";"):
        rows.execute(statement)
    for name, what in _TRIGGERS.items():
        rows.execute(_KEPT.format(name=name, what=what))
    rows.execute(f"PRAGMA application_id = {APPLICATION}")
    rows.execute(f"PRAGMA user_version = {VERSION}")


def _is_known(rows: sqlite3.Connection, sha256: str, generator: str) -> bool:
    asked = "SELECT 1 FROM design WHERE sha256 = ? AND generator = ?"
    return rows.execute(asked, (sha256, generator)).fetchone() is not None


def _put_build(rows: sqlite3.Connection, build: Build) -> None:
    plain = [getattr(build, name) for name in _BUILD[:6]]
    told = [
        json.dumps(value, sort_keys=True)
        for value in (dict(build.predicted), dict(build.tolerances), list(build.good_builds))
    ]
    marks = ", ".join("?" * len(_BUILD))
    rows.execute(f"INSERT INTO design ({', '.join(_BUILD)}) VALUES ({marks})", [*plain, *told])


def _build(row: Sequence[str]) -> Build:
    texts = dict(zip(_BUILD, row, strict=True))
    predicted, tolerances, (good, drawn) = (json.loads(texts.pop(name)) for name in _BUILD[6:])
    return Build(
        sha256=texts["sha256"],
        generator=texts["generator"],
        name=texts["name"],
        family=texts["family"],
        method=texts["method"],
        toml=texts["toml"],
        predicted={name: (value, model) for name, (value, model) in predicted.items()},
        tolerances=tolerances,
        good_builds=(good, drawn),
    )


def _one(rows: sqlite3.Connection, number: int) -> Record | None:
    row = rows.execute(f"{_SELECT} WHERE id = ?", (number,)).fetchone()
    return None if row is None else _record(row)


def _record(row: Sequence[object]) -> Record:
    cells = dict(zip(_RESULT, row, strict=True))
    numbers = {name: float(str(cells[name])) for name in _NUMBERS if cells[name] is not None}
    errors = {name: tuple(json.loads(str(cells[name]))) for name in _ERRORS}
    corrects = cells["corrects"]
    return Record(
        **{name: str(cells[name]) for name in (*_SINGLE, "recorded", "design_sha256")},
        id=int(str(cells["id"])),
        corrects=None if corrects is None else int(str(corrects)),
        withdrawn=bool(cells["withdrawn"]),
        numbers=numbers,
        errors={name: found for name, found in errors.items() if found},
    )


def _refuse_contradiction(result: LabResult, other: Record) -> None:
    for name, value in result.once.items():
        if name in other.once and other.once[name] != value:
            raise DesignError(
                f"serial {result.serial} has {name} = {other.once[name]} in record {other.id}; "
                f"where that is wrong, add: sbafab record --correct {other.id}"
            )
        if name in other.once and name not in ("operator", "kit"):
            raise DesignError(
                f"serial {result.serial} has {name} = {value} in record {other.id} already; leave "
                "it out, or choose another serial"
            )
