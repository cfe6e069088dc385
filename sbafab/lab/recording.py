"""Record built actuators from values and files, find their rows, write them as CSV and JSON."""

from __future__ import annotations

import json
import re
import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from sbafab.actuators import build as laminate_of
from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.files import load
from sbafab.design.files import Change
from sbafab.design.identity import kit_of
from sbafab.design.records import Design
from sbafab.errors import DesignError, OutputError
from sbafab.folders.swap import replace_text
from sbafab.lab.builds import RecordedDesign, promised, recorded_sha256
from sbafab.lab.records import (
    DeviceEntry,
    HistoryDocument,
    HistoryEntry,
    LabRow,
    Record,
    Row,
    columns,
    row_of,
)
from sbafab.lab.store import Contents, Lab
from sbafab.pressing.schedule import schedule
from sbafab.reports.traveller.record_sheet import TESTS_TABLE, RecordTable, record_tables
from sbafab.spreadsheet import csv_text, table_rows, table_text
from sbafab.version import GENERATOR


def built_from(source: str | Path | Design, changes: Sequence[Change] = ()) -> Design | Assembled:
    """Return the design or assembly of a template, a file or a run's folder."""
    if isinstance(source, Design):
        return source.with_(*changes) if changes else source
    resolved = Path(source) / "design.toml"
    loaded = load(resolved if resolved.is_file() else source, changes)
    return loaded if isinstance(loaded, Design) else assemble(loaded)


def record(
    lab: Lab, built: Design | Assembled, rows: Sequence[Row], is_again: bool = False
) -> list[Row]:
    """Store rows about built devices, with the design's predictions; all or none.

    Results get the design's kit. ``is_again``: store as new attempts of repaired and retested
    devices. Raises DesignError, OutputError.
    """
    designs = [built] if isinstance(built, Design) else [part.design for part in built.designs]
    kit = ", ".join(dict.fromkeys(kit_of(design).record.name for design in designs))
    rows = [
        row.model_copy(update={"kit": kit}) if isinstance(row, Record) and not row.kit else row
        for row in rows
    ]
    sha256 = recorded_sha256(built)
    recorded = lab.contents().builds.get(sha256) if lab.path.exists() else None
    build = promised(built) if recorded is None or recorded.generator != GENERATOR else None
    return lab.add(sha256, build, rows, is_again)


def record_sheet(built: Design | Assembled) -> list[RecordTable]:
    """Return the tables of the record page of a design; for an assembly, its tests."""
    if not isinstance(built, Design):
        return [TESTS_TABLE]
    laminate = laminate_of(built)
    return record_tables(built, laminate, schedule(laminate, built))


# Rows from values, and from files: all or none.


def entries_of(values: Mapping[str, Any], where: str = "") -> list[HistoryEntry]:
    """Return one history entry per serial of ``values``, by column.

    Serials are a list, or comma-separated text. Raises DesignError.
    """
    serials = values.get("serial") or ""
    if not isinstance(serials, list | tuple):
        serials = re.split(r"\s*,\s*", str(serials).strip(" ,"))
    return [
        row_of(HistoryEntry, {**values, "serial": serial}, where)
        for serial in dict.fromkeys(map(str, serials))
    ]


def read_batch(path: Path) -> list[Record]:
    """Return a result for each row of a batch's filled-in table.

    Its columns are a subset of a Record's. Several errors share one cell, separated by spaces.
    Raises DesignError with the line.
    """
    records = [row_of(Record, row, where) for where, row in table_rows(path)]
    if not records:
        raise DesignError(
            f"{path} has no result; its first line names columns ({', '.join(columns(Record))}), "
            "and each row below is an actuator"
        )
    return records


def read_history(path: Path, defaults: Mapping[str, Any]) -> list[HistoryEntry]:
    """Return the history entries of a file, with ``defaults`` for values that it omits.

    A CSV file has one row per entry; its columns are a subset of a HistoryEntry's. TOML and JSON
    have a list ``entry`` and values shared by all entries. Paths of photographs are relative to the
    file. Raises DesignError with the line or the entry.
    """
    rows = table_rows(path) if path.suffix.lower() == ".csv" else _entry_tables(path)
    entries: list[HistoryEntry] = []
    for where, row in rows:
        values = {**defaults, **{name: v for name, v in row.items() if v not in ("", None)}}
        if values.get("photograph"):
            values["photograph"] = str(path.parent / str(values["photograph"]))
        entries += entries_of(values, where)
    if not entries:
        raise DesignError(f"{path} has no entry; fill in a row")
    return entries


_PARSERS: Mapping[str, Callable[[str], Any]] = {".toml": tomllib.loads, ".json": json.loads}


def _entry_tables(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the tables of the list ``entry``, merged with the shared values, with their places."""
    parser = _PARSERS.get(path.suffix.lower())
    if parser is None:
        raise DesignError(f"{path} must end in .csv, {', '.join(_PARSERS)}; save it as one")
    text = table_text(path)
    try:
        table = parser(text)
    except (ValueError, RecursionError) as error:
        raise DesignError(f"{path} cannot be read: {error}") from None
    rows = table.get("entry") if isinstance(table, dict) else None
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise DesignError(f"{path} needs a list of tables named entry, one for each entry")
    common = {name: value for name, value in table.items() if name != "entry"}
    for number, row in enumerate(rows, start=1):
        yield f"{path}, entry {number}", {**common, **row}


def matching(
    text: str, serial: str, stored: Sequence[Row], builds: Mapping[str, RecordedDesign]
) -> list[Row]:
    """Return the rows of the design with the hash (at least eight digits) in the text.

    Rows of other designs of the same actuator are included. Otherwise the text is a serial, a
    design's name or a row's number; ``serial``, if given, filters these rows.
    """
    text = text.strip()
    hashes = re.findall(r"\b[0-9a-f]{8,64}\b", text.lower())
    actuators = {
        build.actuator
        for build in builds.values()
        if any(h.startswith(part) for part in hashes for h in (build.sha256, build.actuator))
    }
    matches = [row for row in stored if builds[row.design_sha256].actuator in actuators]
    if not matches:
        matches = [
            row
            for row in stored
            if text in (row.serial, builds[row.design_sha256].name, row.number)
        ]
    return [row for row in matches if serial in ("", row.serial)]


# Writing rows. The same rows give the same bytes.


HEAD = ("row", "recorded", "design", "design_sha256", "attempt", "corrects", "withdrawn")
CSV_COLUMNS = tuple(dict.fromkeys((*HEAD, *columns(HistoryEntry), "expired", *columns(Record))))


def write_history(contents: Contents, path: Path) -> int:
    """Write rows as CSV or JSON, by the file's suffix, atomically; return the number of devices.

    Raises DesignError for another suffix, and OutputError.
    """
    writers = {".csv": _csv_history, ".json": _json_history}
    writer = writers.get(path.suffix.lower())
    if writer is None:
        raise DesignError(f"{path} must end in one of {', '.join(writers)}")
    rows: dict[tuple[str, str], list[LabRow]] = defaultdict(list)
    for row in (*contents.entries, *contents.records):
        rows[contents.builds[row.design_sha256].actuator, row.serial].append(row)
    # Each device, its entries first, by design and serial.
    devices = [(contents.builds[rows[0].design_sha256], rows) for rows in rows.values()]
    devices.sort(key=lambda device: (device[0].name, device[1][0].serial))
    save_text(path, writer(devices))
    return len(devices)


def save_text(path: Path, text: str) -> None:
    """Write a temporary file and swap it in. Raises OutputError."""
    try:
        replace_text(path, text)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}") from None


_Devices = Sequence[tuple[RecordedDesign, Sequence[LabRow]]]


def _json_history(devices: _Devices) -> str:
    """Return a document with the rows grouped by device."""
    listed = []
    for build, rows in devices:
        head = {"design": build.name, "actuator_sha256": build.actuator}
        records = [row for row in rows if isinstance(row, Record)]
        entries = [row for row in rows if isinstance(row, HistoryEntry)]
        listed.append(DeviceEntry.read(rows[0], **head, records=records, entries=entries))
    document = HistoryDocument.of(None, devices=listed)
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _csv_history(devices: _Devices) -> str:
    """Return a table with one row per row of each device."""
    lines = []
    for build, rows in devices:
        for row in rows:
            cells = {name: getattr(row, name) for name in ("recorded", "design_sha256", "attempt")}
            cells |= {"row": row.number, "design": build.name, "withdrawn": int(row.withdrawn)}
            cells |= row.cells
            if row.corrects is not None:
                cells["corrects"] = f"{row.SIGN}{row.corrects}"
            if isinstance(row, HistoryEntry):
                cells["expired"] = int(row.is_expired)
            lines.append([cells.get(column) for column in CSV_COLUMNS])
    return csv_text([CSV_COLUMNS, *lines])
