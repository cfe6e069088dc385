"""A lab's records in one SQLite file, shared by any number of processes, and its photographs.

A write is one transaction, and writers wait for each other. Rows are only added: a correction names
the row that it replaces, and no row is corrected twice.
"""

from __future__ import annotations

import hashlib
import os
import re
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import TypeAdapter, ValidationError

from sbafab.errors import DesignError, OutputError
from sbafab.lab.builds import RecordedDesign
from sbafab.lab.records import HistoryEntry, LabRow, Record, Row, row_of, standing

APPLICATION, VERSION = 0x5BAFAB, 4
PATIENCE = 10.0  # timeout for other writers, s
KINDS: tuple[type[LabRow], ...] = (Record, HistoryEntry)
_SCHEMA = (
    "CREATE TABLE design (sha256 TEXT NOT NULL, generator TEXT NOT NULL, content TEXT NOT NULL, "
    "PRIMARY KEY (sha256, generator))",
    *(
        f"CREATE TABLE {kind.NOUN} (id INTEGER PRIMARY KEY AUTOINCREMENT, "
        f"corrects INTEGER UNIQUE REFERENCES {kind.NOUN} (id), content TEXT NOT NULL)"
        for kind in KINDS
    ),
    f"PRAGMA application_id = {APPLICATION}",
    f"PRAGMA user_version = {VERSION}",
)
"""``content`` is JSON: the fields of a RecordedDesign, a Record or a HistoryEntry."""


class Contents(NamedTuple):
    """All rows of a lab, including corrected ones, and their designs by sha256.

    Each design has the predictions of the newest version that recorded it.
    """

    records: list[Record]
    entries: list[HistoryEntry]
    builds: dict[str, RecordedDesign]

    def rows(self, kind: type[Row]) -> list[Row]:
        """Return the records or the entries."""
        return [row for row in (*self.entries, *self.records) if isinstance(row, kind)]

    def of_device(self, sha256: str, serial: str) -> list[LabRow]:
        """Return the valid rows of a device: of this design, and of others of one actuator."""
        rows: list[LabRow] = [*standing(self.records), *standing(self.entries)]
        builds = self.builds
        return [
            row
            for row in rows
            if row.serial == serial
            and (
                row.design_sha256 == sha256
                or builds[row.design_sha256].actuator == builds[sha256].actuator
            )
        ]


class Lab:
    """The records in the file ``path``, which the first record creates.

    Methods raise DesignError for rows that contradict the records, and OutputError if the file is
    locked, unreadable, damaged, or written by another program or version.
    """

    def __init__(
        self,
        path: Path,
        patience: float = PATIENCE,
        clock: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self.path, self.patience, self.clock = path, patience, clock

    def contents(self) -> Contents:
        """Return all rows; a read-only file is sufficient."""
        if not self.path.is_file():
            raise OutputError(
                f"{self.path} is not a file of records; record something first, or name the lab's "
                "file with --lab"
            )
        with self._sqlite_errors(), closing(self._open("?mode=ro")) as file:
            file.execute("BEGIN")
            return self._contents(file) if self._is_filled(file) else Contents([], [], {})

    def add(
        self, sha256: str, build: RecordedDesign | None, rows: Sequence[Row], is_again: bool = False
    ) -> list[Row]:
        """Store rows of a design, all or none; ``build`` is added if it is not stored yet.

        ``is_again``: store as a new attempt of recorded devices that were repaired and retested.
        Photographs are copied into the folder beside the lab's file first.
        """
        if is_again and not self.path.exists():
            raise OutputError(f"{self.path} does not exist, so there is no earlier attempt")
        rows = [with_photograph(self.path, row) for row in rows]
        with self._writing() as file:
            if build is not None:
                values = (build.sha256, build.generator, _BUILD.dump_json(build).decode())
                file.execute("INSERT OR IGNORE INTO design VALUES (?, ?, ?)", values)
            contents = self._contents(file)
            devices = {row.serial: contents.of_device(sha256, row.serial) for row in rows}
            for serial, device in devices.items() if is_again else ():
                if not device:
                    raise DesignError(
                        f"serial {serial} has no record yet, so there is no earlier attempt; "
                        "omit --again, or see: sbafab record --find"
                    )
            attempts = {
                serial: max((row.attempt for row in device), default=1) + is_again
                for serial, device in devices.items()
            }
            added = []
            for row in rows:
                head = {"design_sha256": sha256, "attempt": attempts[row.serial]}
                added.append(self._put(file, devices[row.serial], row.model_copy(update=head)))
                devices[row.serial].append(added[-1])
            return added

    def correct(self, kind: type[Row], number: int, change: Mapping[str, Any]) -> Row:
        """Store a correction of row ``number``: a copy with the values of ``change``, by column,
        which may include ``withdrawn``.
        """
        if not self.path.exists():
            raise OutputError(f"{self.path} does not exist, so there is no {kind.NOUN} to correct")
        with self._writing() as file:
            contents = self._contents(file)
            stored = {row.id: row for row in contents.rows(kind)}
            if number not in stored:
                raise DesignError(
                    f"{self.path} holds no {kind.NOUN} {number}; see: sbafab record --find"
                )
            old = stored[number]
            for row in stored.values():
                if row.corrects == number:
                    raise DesignError(
                        f"{kind.NOUN} {old.number} is already corrected by {kind.NOUN} "
                        f"{row.number}; correct that one"
                    )
            row = with_photograph(self.path, row_of(kind, {**old.stated, **change}))
            more = {name: getattr(old, name) for name in ("design_sha256", "attempt")}
            row = row.model_copy(update={**more, "corrects": number})
            return self._put(file, contents.of_device(row.design_sha256, row.serial), row)

    def _put(self, file: sqlite3.Connection, device: Sequence[LabRow], row: Row) -> Row:
        """Add a row. Raises DesignError if it contradicts or repeats another row of its device."""
        for stored in () if row.withdrawn else device:
            is_other = stored.attempt == row.attempt and stored.id != row.corrects
            if type(stored) is type(row) and is_other and (problem := row.conflict(stored)):
                raise DesignError(problem)
        row = row.model_copy(update={"recorded": self.clock().strftime("%Y-%m-%dT%H:%M:%SZ")})
        content = row.model_dump_json(exclude={"id", "corrects"}, exclude_defaults=True)
        statement = f"INSERT INTO {row.NOUN} (corrects, content) VALUES (?, ?)"
        number = file.execute(statement, (row.corrects, content)).lastrowid
        return row.model_copy(update={"id": number})

    def _contents(self, file: sqlite3.Connection) -> Contents:
        def rows(kind: type[Row]) -> list[Row]:
            query = f"SELECT id, corrects, content FROM {kind.NOUN} ORDER BY id"
            return [
                kind.model_validate_json(content).model_copy(update={"id": i, "corrects": corrects})
                for i, corrects, content in file.execute(query)
            ]

        designs = file.execute("SELECT content FROM design ORDER BY rowid")
        builds = [_BUILD.validate_json(content) for (content,) in designs]
        contents = Contents(
            rows(Record), rows(HistoryEntry), {build.sha256: build for build in builds}
        )
        stored: list[LabRow] = [*contents.records, *contents.entries]
        if {row.design_sha256 for row in stored} - contents.builds.keys():
            raise OutputError(f"{self.path} {_REASONS['CORRUPT']}")
        return contents

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Run one transaction; create the file if it is missing."""
        with self._sqlite_errors(), closing(self._open()) as file:
            file.execute("BEGIN IMMEDIATE")
            try:
                if not self._is_filled(file):
                    for statement in _SCHEMA:
                        file.execute(statement)
                yield file
                file.execute("COMMIT")
            finally:
                if file.in_transaction:
                    file.execute("ROLLBACK")

    def _open(self, mode: str = "") -> sqlite3.Connection:
        return sqlite3.connect(
            f"{self.path.absolute().as_uri()}{mode}",
            uri=True,
            timeout=self.patience,
            isolation_level=None,
        )

    def _is_filled(self, file: sqlite3.Connection) -> bool:
        """Return False for an empty file. Raises OutputError for another program's file."""
        (version,) = file.execute("PRAGMA user_version").fetchone()
        (application,) = file.execute("PRAGMA application_id").fetchone()
        (tables,) = file.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if tables == 0 and version == 0 and application == 0:
            return False
        if application != APPLICATION:
            raise OutputError(
                f"{self.path} is another program's database; name the lab's file with --lab"
            )
        if version != VERSION:
            raise OutputError(
                f"{self.path} was written by another sbafab (record format {version}; this "
                f"version reads {VERSION}); read it with that version, or name another file with "
                "--lab"
            )
        if file.execute("PRAGMA integrity_check(1)").fetchone() != ("ok",):
            raise OutputError(f"{self.path} {_REASONS['CORRUPT']}")
        return True

    @contextmanager
    def _sqlite_errors(self) -> Iterator[None]:
        """Convert SQLite's errors to one sentence."""
        try:
            yield
        except sqlite3.Error as error:
            raise OutputError(f"{self.path} {_reason(error)}") from error
        except (ValidationError, UnicodeDecodeError) as error:
            # SQLite's own message may quote bytes that cannot be read as text.
            raise OutputError(f"{self.path} {_REASONS['CORRUPT']}") from error


_REASONS = {
    "BUSY": "is in use by another program; nothing was recorded, try again in a moment",
    "LOCKED": "is in use by another program; nothing was recorded, try again in a moment",
    "READONLY": "may only be read; nothing was recorded, ask for the right to write there",
    "PERM": "may not be opened; ask for the right to it",
    "AUTH": "may not be opened; ask for the right to it",
    "CANTOPEN": "cannot be opened; see that its folder exists and may be written",
    "NOTADB": "is not a file of records; name the lab's file with --lab",
    "FULL": "cannot grow, the disk is full; nothing was recorded, make room there",
    "CORRUPT": "is damaged; put a sound copy in its place",
    "IOERR": "cannot be read or written, the disk reports an error; nothing was recorded",
}


def _reason(error: sqlite3.Error) -> str:
    name = getattr(error, "sqlite_errorname", None) or ""
    # Python itself raises an error without a name for bytes that are not text.
    code = name.removeprefix("SQLITE_").partition("_")[0] or "CORRUPT"
    return _REASONS.get(code, f"cannot be used as a file of records: {error}")


_BUILD = TypeAdapter(RecordedDesign)


# Photographs: files named by their content, in a folder beside the lab's file.


MOST_PHOTOGRAPH = 20_000_000  # largest photograph, bytes
_PICTURE = re.compile(
    rb"(?P<jpg>\xff\xd8\xff)|(?P<png>\x89PNG\r\n\x1a\n)|(?P<webp>RIFF.{4}WEBP)", re.DOTALL
)
"""The first bytes of a picture, by file suffix."""
_STORED = re.compile(r"[0-9a-f]{64}\.(jpg|png|webp)")


def store_photograph(lab: Path, content: bytes, where: str) -> str:
    """Store a photograph under its hash and return the file's name. Raises DesignError."""
    kind = _PICTURE.match(content)
    if kind is None or len(content) > MOST_PHOTOGRAPH:
        raise DesignError(
            f"{where} is not a JPEG, PNG or WebP of at most {MOST_PHOTOGRAPH // 1_000_000} MB; "
            "save it as one"
        )
    folder = lab.with_name(f"{lab.stem}-photographs")
    path = folder / f"{hashlib.sha256(content).hexdigest()}.{kind.lastgroup}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        fresh = path.with_suffix(f".{os.getpid()}-{threading.get_ident()}")
        fresh.write_bytes(content)
        fresh.replace(path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}") from None
    return path.name


def with_photograph(lab: Path, row: Row) -> Row:
    """Return the row after storing the photograph that it names, if any. Raises DesignError."""
    if not isinstance(row, HistoryEntry) or not row.photograph or _STORED.fullmatch(row.photograph):
        return row
    path = Path(row.photograph)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise DesignError(f"{path} cannot be read: {error.strerror or error}") from None
    return row.model_copy(update={"photograph": store_photograph(lab, content, str(path))})
