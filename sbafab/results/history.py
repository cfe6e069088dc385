"""Entries of a device's history, and the hash chain over all rows of a lab's file.

Each link of the chain has the number of a row, the SHA-256 of its content as canonical JSON (keys
sorted, no blanks, columns without a value left out), the hash of the link before it and, over all
of these, its own. So a row that was edited, deleted, inserted or moved breaks the chain there. An
end that was cut off shows only against a hash that was noted elsewhere.
"""

from __future__ import annotations

import csv
import datetime
import hashlib
import json
import re
import sqlite3
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

from sbafab.cutting.calibration import table_text
from sbafab.errors import DesignError, OutputError
from sbafab.reports.traveller.record_sheet import DECISIONS, HISTORY_FIELDS
from sbafab.results.records import UNWRITABLE, Measurand, check_number

ACCEPT, REJECT, REWORK = DECISIONS
READINGS = (
    Measurand("kerf_mm", "mm", 1, "kerf", "Kerf measured on a film."),
    Measurand("temperature_c", "C", 400, "temperature", "Temperature of a press step."),
    Measurand("press_force_n", "N", 1_000_000, "force", "Force of a press step."),
    Measurand("minutes", "min", 10_000, "minutes", "Minutes of a press step."),
)
"""Numbers of an entry."""
READING_NAMES = tuple(reading.name for reading in READINGS)
ENTRY_TEXTS = tuple(f.name for f in HISTORY_FIELDS if f.name not in READING_NAMES)
ENTRY_FIELDS = tuple(f.name for f in HISTORY_FIELDS)
MOST_TEXT = {"serial": 64, "step": 40, "item": 60, "lot": 60, "initials": 16, "reason": 200}
"""Characters of a text; of all others 400."""


@dataclass(frozen=True)
class HistoryEntry:
    """A line of the history of the device ``serial``; what it does not state is empty.

    ``date`` (ISO) is the day of the work, ``step`` a press step's number or a test's name, ``item``
    a film or the adhesive with its ``lot`` and last day ``expires``. ``photograph`` is the name of
    a file in the folder beside the lab's file. Units stand in the names of READINGS.
    """

    date: str = ""
    serial: str = ""
    step: str = ""
    item: str = ""
    lot: str = ""
    expires: str = ""
    decision: str = ""
    reason: str = ""
    photograph: str = ""
    note: str = ""
    initials: str = ""
    readings: Mapping[str, float] = field(default_factory=dict)
    withdrawn: bool = False

    @property
    def is_empty(self) -> bool:
        """True if nothing is stated of a device but when, where and by whom."""
        return not (self.lot or self.decision or self.photograph or self.note or self.readings)

    def states_the_same(self, other: HistoryEntry) -> bool:
        """Return True if both state the same, whoever stored them."""
        texts = all(getattr(self, name) == getattr(other, name) for name in ENTRY_TEXTS)
        return texts and self.readings == other.readings

    def changed(self, change: HistoryEntry) -> HistoryEntry:
        """Return the entry with all that ``change`` states in its place."""
        texts = {name: getattr(change, name) for name in ENTRY_TEXTS if getattr(change, name)}
        readings = {**self.readings, **change.readings}
        return replace(self, **texts, readings=readings, withdrawn=change.withdrawn)


@dataclass(frozen=True)
class StoredEntry(HistoryEntry):
    """An entry as it is stored: its number, when (UTC), of which design and attempt.

    ``corrects`` is the number of the entry in whose place it stands.
    """

    id: int = 0
    recorded: str = ""
    design_sha256: str = ""
    corrects: int | None = None
    attempt: int = 1

    @property
    def day(self) -> str:
        """The day of the work; where none is stated that of the record."""
        return self.date or self.recorded[:10]

    @property
    def is_expired(self) -> bool:
        """True if the lot had expired on the day of the work."""
        return bool(self.expires) and self.expires < self.day

    def as_dict(self) -> dict[str, Any]:
        """The entry for JSON; units stand in the keys."""
        plain = {f.name: getattr(self, f.name) for f in fields(self)}
        return {**plain, "readings": dict(self.readings), "expired": self.is_expired}


def standing_entries(entries: Sequence[StoredEntry]) -> list[StoredEntry]:
    """Return the entries that no other corrects and that are not withdrawn."""
    corrected = {entry.corrects for entry in entries}
    return [entry for entry in entries if entry.id not in corrected and not entry.withdrawn]


def checked_entry(entry: HistoryEntry, where: str = "") -> HistoryEntry:
    """The entry, with texts stripped. Raises DesignError for what cannot be meant."""
    place = f"{where}: " if where else ""
    texts = {name: getattr(entry, name).strip() for name in ENTRY_TEXTS}
    for name, text in texts.items():
        most = MOST_TEXT.get(name, 400)
        if len(text) > most:
            raise DesignError(f"{place}{name} has {len(text)} characters; at most {most} fit")
        if UNWRITABLE.search(text):
            raise DesignError(f"{place}{name} must be plain text in one line")
    entry = replace(entry, **texts)
    for name in ("date", "expires"):
        _check_day(texts[name], name, place)
    for reading in READINGS:
        if reading.name in entry.readings:
            check_number(reading, entry.readings[reading.name], place, "above 0")
    for problem in _problems(entry):
        raise DesignError(f"{place}{problem}")
    return entry


def _problems(entry: HistoryEntry) -> Iterator[str]:
    """Sentences on fields that need another one."""
    if not entry.serial:
        yield "an entry needs its serial, as on the traveller"
    if entry.is_empty and not entry.withdrawn:
        yield (
            "an entry states a lot, a reading (kerf_mm, temperature_c, press_force_n, minutes), a "
            "decision, a photograph or a note; fill in one of them"
        )
    if entry.decision not in ("", *DECISIONS):
        yield f"decision is {entry.decision[:40]!r}; write {', '.join(DECISIONS[:2])} or {REWORK}"
    if entry.decision in (REJECT, REWORK) and not entry.reason:
        yield f"a {entry.decision} needs its reason; fill in reason"
    if entry.reason and entry.decision not in (REJECT, REWORK):
        yield f"a reason goes with the decision {REJECT} or {REWORK}; fill in decision"
    if entry.lot and not entry.item:
        yield "a lot needs its item, the film or the adhesive, such as TPE"
    if entry.expires and not entry.lot:
        yield "a day of expiry needs its lot; fill in lot"
    if set(entry.readings) - {"kerf_mm"} and not entry.step:
        yield "temperature_c, press_force_n and minutes need their step, such as 1"


def _check_day(text: str, name: str, place: str) -> None:
    try:
        is_day = not text or (
            len(text) == 10 and datetime.date.fromisoformat(text).isoformat() == text
        )
    except ValueError:
        is_day = False
    if not is_day:
        raise DesignError(f"{place}{name} is {text[:40]!r}; write a day such as 2026-05-04")


# Entries from options, from a filled form, and from files: TOML, JSON, CSV.


_COMMA = re.compile(r"\s*,\s*")
_DECIMAL = re.compile(r"\d+(?:[.,]\d*)?|[.,]\d+", re.ASCII)


def entries_of(values: Mapping[str, Any], where: str = "") -> list[HistoryEntry]:
    """Return an entry for each serial of ``values``, by the names of HISTORY_FIELDS.

    Serials are a list, or a text with commas between them. Raises DesignError.
    """
    serials = values.get("serial") or ""
    if not isinstance(serials, list | tuple):
        serials = _COMMA.split(str(serials).strip(" ,"))
    entry = unchecked_entry({**values, "serial": ""}, where)
    return [
        checked_entry(replace(entry, serial=serial), where)
        for serial in dict.fromkeys(map(str, serials))
    ]


def unchecked_entry(values: Mapping[str, Any], where: str = "") -> HistoryEntry:
    """Return an entry of ``values``, which may lack what a whole one needs. Raises DesignError."""
    place = f"{where}: " if where else ""
    stated = {name: value for name, value in values.items() if value not in ("", None)}
    withdrawn = stated.pop("withdrawn", False) is True
    for name in stated:
        if name not in ENTRY_FIELDS:
            raise DesignError(
                f"{place}an entry has no {name[:40]!r}; it has {', '.join(ENTRY_FIELDS)}"
            )
    readings = {n: _number(stated[n], n, place) for n in READING_NAMES if n in stated}
    texts: dict[str, Any] = {n: str(v) for n, v in stated.items() if n not in READING_NAMES}
    return HistoryEntry(**texts, readings=readings, withdrawn=withdrawn)


def _number(value: Any, name: str, place: str) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, str) or _DECIMAL.fullmatch(value.strip()) is None:
        raise DesignError(f"{place}{name} is {str(value)[:40]!r}, not a number such as 134.5")
    return float(value.strip().replace(",", "."))


def read_history(path: Path, defaults: Mapping[str, Any]) -> list[HistoryEntry]:
    """Return the entries of a file, with ``defaults`` where it states nothing else.

    CSV has a row an entry, with the names of HISTORY_FIELDS as columns. TOML and JSON have a list
    ``entry``, and beside it values that go for all of them. Photographs are found beside the file.
    Raises DesignError with the line or the entry.
    """
    readers = {".csv": _csv_rows, ".toml": _toml_rows, ".json": _json_rows}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise DesignError(f"{path} ends in none of {', '.join(readers)}; save it as one of these")
    entries: list[HistoryEntry] = []
    for where, row in reader(path):
        values = {**defaults, **{name: v for name, v in row.items() if v not in ("", None)}}
        if values.get("photograph"):
            values["photograph"] = str(path.parent / str(values["photograph"]))
        entries += entries_of(values, where)
    if not entries:
        raise DesignError(f"{path} holds no entry; fill in a row")
    return entries


def _csv_rows(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    lines = table_text(path).splitlines()
    separator = max(",;\t", key=lines[0].count) if lines else ","
    try:
        rows = list(csv.reader(lines, delimiter=separator, strict=True))
    except csv.Error as error:
        raise DesignError(f"{path} cannot be read ({error}); save the table as CSV") from None
    names = [name.strip().lower() for name in rows[0]] if rows else []
    if len(set(names)) != len(names):
        raise DesignError(f"{path} names a column twice; keep one of each")
    for number, cells in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) != len(names):
            raise DesignError(
                f"{path}, line {number} has {len(cells)} cells where the header has {len(names)}; "
                "write decimal points, or part columns by semicolons"
            )
        yield f"{path}, line {number}", dict(zip(names, map(str.strip, cells), strict=True))


def _toml_rows(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    try:
        table = tomllib.loads(table_text(path))
    except tomllib.TOMLDecodeError as error:
        raise DesignError(f"{path} is no TOML: {error}") from None
    return _table_rows(path, table)


def _json_rows(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    try:
        table = json.loads(table_text(path))
    except (json.JSONDecodeError, RecursionError) as error:
        raise DesignError(f"{path} is no JSON: {error}") from None
    return _table_rows(path, table)


def _table_rows(path: Path, table: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    rows = table.get("entry") if isinstance(table, dict) else None
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise DesignError(f"{path} needs a list of tables called entry, a table an entry")
    common = {name: value for name, value in table.items() if name != "entry"}
    for number, row in enumerate(rows, start=1):
        yield f"{path}, entry {number}", {**common, **row}


# Photographs: files named by their content, in a folder beside the lab's file.


MOST_PHOTOGRAPH = 20_000_000
"""Bytes."""


def photograph_folder(lab: Path) -> Path:
    """Return the folder of a lab's photographs."""
    return lab.with_name(f"{lab.stem}-photographs")


def photograph_ending(content: bytes) -> str:
    """Return the ending of a picture's format by its first bytes; empty for none that is known."""
    if content[:3] == b"\xff\xd8\xff":
        return ".jpg"
    if content[:8] == b"\x89PNG\r\n\x1a\n":
        return ".png"
    return ".webp" if content[:4] == b"RIFF" and content[8:12] == b"WEBP" else ""


def store_photograph(lab: Path, content: bytes, where: str) -> str:
    """Store a photograph under its hash and return the file's name. Raises DesignError."""
    ending = photograph_ending(content)
    if not ending or len(content) > MOST_PHOTOGRAPH:
        raise DesignError(
            f"{where} is no JPEG, PNG or WebP of at most {MOST_PHOTOGRAPH // 1_000_000} MB; save "
            "it as one"
        )
    folder = photograph_folder(lab)
    path = folder / f"{hashlib.sha256(content).hexdigest()}{ending}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.is_file() or path.read_bytes() != content:
            fresh = path.with_suffix(".new")
            fresh.write_bytes(content)
            fresh.replace(path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}") from None
    return path.name


def with_photograph(lab: Path, entry: HistoryEntry) -> HistoryEntry:
    """Return the entry with its photograph's file stored. Raises DesignError."""
    if not entry.photograph or is_stored_photograph(entry.photograph):
        return entry
    path = Path(entry.photograph)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise DesignError(f"{path} cannot be read: {error.strerror or error}") from None
    return replace(entry, photograph=store_photograph(lab, content, str(path)))


def is_stored_photograph(name: str) -> bool:
    """Return True for the name of a stored photograph: its hash and its ending."""
    return re.fullmatch(r"[0-9a-f]{64}\.(jpg|png|webp)", name) is not None


def lost_photographs(lab: Path, entries: Sequence[StoredEntry]) -> list[str]:
    """Return the names of photographs that are missing or have other bytes than were recorded."""
    names = dict.fromkeys(entry.photograph for entry in entries if entry.photograph)
    folder = photograph_folder(lab)
    return [name for name in names if not _has_hash(folder / name)]


def _has_hash(path: Path) -> bool:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest() == path.stem
    except OSError:
        return False


# The chain.


CHAINED = ("design", "result", "entry")
"""Tables whose rows are links."""
WORDS = {"design": "design", "result": "record", "entry": "entry"}
FIRST = "0" * 64
"""The hash before the first link."""
LINK = ("id", "source", "row", "adopted", "content_sha256", "previous", "sha256")


class Link(NamedTuple):
    """A link of the chain; ``adopted``: its row is older than the chain."""

    id: int
    source: str
    row: str
    adopted: int
    content_sha256: str
    previous: str
    sha256: str

    def __str__(self) -> str:
        return f"{WORDS.get(self.source, self.source)} {self.row}"


@dataclass(frozen=True)
class ChainCheck:
    """A chain that was computed again.

    ``head`` is the hash of its last link, ``broken`` a sentence on the first row that does not
    hold, empty where all do. ``adopted`` rows are older than the chain, which vouches for them from
    the day on which they were linked.
    """

    links: int
    adopted: int
    head: str
    broken: str = ""
    later: int = 0
    """Links after the head that was compared with."""

    def as_dict(self) -> dict[str, Any]:
        """The check for JSON."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


def canonical(content: Mapping[str, Any]) -> str:
    """Return a table as canonical JSON: keys sorted, no blanks, ASCII."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), default=repr)


def sha256_of(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


_ROW_NAMES = {"design": "sha256 || ' ' || generator", "result": "CAST(id AS TEXT)"}
"""A row's name in SQL; a design's row has no number that outlives VACUUM."""


def row_contents(
    rows: sqlite3.Connection, source: str, row: str | None = None
) -> Iterator[tuple[str, str]]:
    """Yield name and content hash of the rows of a table, or of the one that is named."""
    name = _ROW_NAMES.get(source, _ROW_NAMES["result"])
    where, values = ("", ()) if row is None else (f"WHERE {name} = ?", (row,))
    cursor = rows.execute(f"SELECT {name}, * FROM {source} {where} ORDER BY rowid", values)
    columns = [column[0] for column in cursor.description][1:]
    for row_name, *cells in cursor:
        content = dict(zip(columns, cells, strict=True))
        stated = {column: value for column, value in content.items() if value is not None}
        yield str(row_name), sha256_of(canonical(stated))


def add_links(
    rows: sqlite3.Connection, source: str, row: str | None = None, adopted: bool = False
) -> None:
    """Link one row that was added, or all rows of a table."""
    last = rows.execute("SELECT id, sha256 FROM chain ORDER BY id DESC LIMIT 1").fetchone()
    number, previous = last or (0, FIRST)
    for name, content in list(row_contents(rows, source, row)):
        number += 1
        link = Link(number, source, name, int(adopted), content, previous, "")
        link = link._replace(sha256=_link_hash(link))
        marks = ", ".join("?" * len(LINK))
        rows.execute(f"INSERT INTO chain ({', '.join(LINK)}) VALUES ({marks})", link)
        previous = link.sha256


def _link_hash(link: Link) -> str:
    return sha256_of(canonical({name: getattr(link, name) for name in LINK[:-1]}))


def chain_links(rows: sqlite3.Connection) -> list[Link]:
    """Return the links of an open file in their order."""
    cursor = rows.execute(f"SELECT {', '.join(LINK)} FROM chain ORDER BY id")
    return [Link(*cells) for cells in cursor]


def check_chain(rows: sqlite3.Connection, head: str = "") -> ChainCheck:
    """Compute the chain of an open file again; ``head`` is a hash that was noted earlier."""
    links = chain_links(rows)
    contents = {
        (source, row): content for source in CHAINED for row, content in row_contents(rows, source)
    }
    broken = next(_breaks(links, contents), "")
    hashes = [link.sha256 for link in links]
    later = 0
    if head and not broken:
        matches = [n for n, sha256 in enumerate(hashes) if sha256.startswith(head.lower())]
        if not matches:
            broken = (
                f"no link has the hash {head[:64]}: rows that it covers were removed or written "
                "again, or it is of another file"
            )
        else:
            later = len(links) - 1 - matches[0]
    adopted = sum(link.adopted for link in links)
    return ChainCheck(len(links), adopted, hashes[-1] if hashes else FIRST, broken, later)


def _breaks(links: Sequence[Link], contents: Mapping[tuple[str, str], str]) -> Iterator[str]:
    """Sentences on what breaks the chain, in its order."""
    previous = FIRST
    linked: set[tuple[str, str]] = set()
    for number, link in enumerate(links, start=1):
        key = (link.source, link.row)
        if link.id != number:
            yield f"link {number} is missing before {link}: a row was deleted with its link"
        if link.previous != previous:
            yield f"{link} does not follow link {number - 1}: a row was deleted, inserted or moved"
        if link.sha256 != _link_hash(link):
            yield f"the link of {link} was edited"
        if key not in contents:
            yield f"{link} was deleted"
        elif contents[key] != link.content_sha256:
            yield f"{link} was edited after it was recorded"
        if key in linked:
            yield f"{link} is linked twice"
        linked.add(key)
        previous = link.sha256
    for source, row in contents:
        if (source, row) not in linked:
            yield f"{WORDS[source]} {row} was inserted without a link"
