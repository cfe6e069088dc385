"""Results of built actuators: recorded from Python or a batch's table, and found again."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from sbafab.actuators import build as laminate_of
from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.files import assembly_sha256, load
from sbafab.cutting.calibration import table_text
from sbafab.design.files import Change
from sbafab.design.identity import design_sha256
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.output.checked import press_settings
from sbafab.pressing.schedule import schedule
from sbafab.reports.traveller.record_sheet import TESTS_TABLE, RecordTable, record_tables
from sbafab.results.history import HistoryEntry, StoredEntry
from sbafab.results.records import (
    COLUMNS,
    ERRORS,
    NUMBERS,
    TEXTS,
    Build,
    LabResult,
    Record,
    checked,
    kit_name,
    promised,
    promised_assembly,
)
from sbafab.results.store import Lab
from sbafab.version import GENERATOR

RESULT_NAMES = (*TEXTS, "leak", *(quantity.name for quantity in (*NUMBERS, *ERRORS)))
"""Names of the values that a result of an actuator may have."""


def built_from(source: str | Path | Design, changes: Sequence[Change] = ()) -> Design | Assembled:
    """Return the design, or the assembly put together, of a template, a file or a run's folder."""
    if isinstance(source, Design):
        return source.with_(*changes) if changes else source
    resolved = Path(source) / "design.toml"
    loaded = load(resolved if resolved.is_file() else source, changes)
    return loaded if isinstance(loaded, Design) else assemble(loaded)


def record(
    lab: Lab, built: Design | Assembled, results: Sequence[LabResult], is_again: bool = False
) -> list[Record]:
    """Store results of a built design, with what it promises; all or none.

    ``is_again``: as new attempts of actuators that were mended and tested again. Raises
    DesignError.
    """
    if isinstance(built, Design):
        kit = kit_name(built)
    else:
        kit = ", ".join(dict.fromkeys(kit_name(part.design) for part in built.designs))
    results = [replace(result, kit=result.kit or kit) for result in results]
    sha256, promise = _promise(lab, built)
    return lab.add(sha256, promise, results, is_again)


def record_history(
    lab: Lab, built: Design | Assembled, entries: Sequence[HistoryEntry], is_again: bool = False
) -> list[StoredEntry]:
    """Store lines of the history of devices of a built design; all or none. Raises DesignError."""
    sha256, promise = _promise(lab, built)
    return lab.add_entries(sha256, promise, entries, is_again)


def _promise(lab: Lab, built: Design | Assembled) -> tuple[str, Build | None]:
    """Return the hash of what was built, and its promises where the lab does not know them yet."""
    if isinstance(built, Design):
        sha256 = design_sha256(built)
        return sha256, None if lab.knows(sha256, GENERATOR) else promised(built)
    sha256 = assembly_sha256(built)
    return sha256, None if lab.knows(sha256, GENERATOR) else promised_assembly(built)


def results_of(values: Mapping[str, Any], table: str | Path | None = None) -> list[LabResult]:
    """Return one result from values by name, or those of a table. Raises DesignError.

    Errors are one number or several.
    """
    if table is not None:
        if values:
            raise DesignError(f"a table says it all; leave out {', '.join(values)}")
        return read_batch(Path(table))
    if not values.get("serial"):
        raise DesignError("an actuator needs its serial; give serial, as on its traveller")
    errors = {q.name: values[q.name] for q in ERRORS if q.name in values}
    serial, operator, kit, note, leak = (str(values.get(name, "")) for name in (*TEXTS, "leak"))
    result = LabResult(
        serial=serial,
        leak=leak,
        operator=operator,
        kit=kit,
        note=note,
        numbers={q.name: float(values[q.name]) for q in NUMBERS if q.name in values},
        errors={
            name: tuple(map(float, (value,) if isinstance(value, int | float) else value))
            for name, value in errors.items()
        },
    )
    if result.is_empty:
        raise DesignError('say what came out, such as leak="pass" or a note')
    return [checked(result)]


def record_sheet(built: Design | Assembled) -> tuple[RecordTable, ...]:
    """Return the tables of the record page of what was built; of an assembly its tests."""
    if not isinstance(built, Design):
        return (TESTS_TABLE,)
    laminate = laminate_of(built)
    return record_tables(built, laminate, schedule(laminate, press_settings(built)))


# A batch's table as it was filled in: a row an actuator, all rows or none.


_NUMBER = re.compile(r"\d+(?:[.,]\d*)?|[.,]\d+", re.ASCII)


def read_batch(path: Path) -> list[LabResult]:
    """Return a result for each row of a table with some of COLUMNS, "serial" among them.

    Columns are separated by commas, semicolons or tabs, the latter two also with decimal commas;
    several errors stand in one cell, separated by blanks. Raises DesignError with the line.
    """
    lines = [
        (f"{path}, line {number}", line)
        for number, line in enumerate(table_text(path).splitlines(), start=1)
        if line.strip(' ,;\t"') and not line.lstrip(' "').startswith("#")
    ]
    if not lines:
        raise DesignError(f"{path} is empty; its first line names columns: {', '.join(COLUMNS)}")
    separator = max(",;\t", key=lines[0][1].count)
    names = [name.lower() for name in _cells(lines[0], separator)]
    _check_names(names, path)
    results = [_result(_row(line, names, separator), line[0]) for line in lines[1:]]
    if not results:
        raise DesignError(f"{path} has no row below its columns; fill in one for each actuator")
    return results


def _check_names(names: Sequence[str], path: Path) -> None:
    for name in names:
        if name and name not in COLUMNS:
            raise DesignError(f"{path} has a column {name[:40]!r}; known are {', '.join(COLUMNS)}")
        if name and names.count(name) > 1:
            raise DesignError(f"{path} has two columns {name}; keep one")
    if "serial" not in names:
        raise DesignError(f"{path} has no column serial; each actuator needs one")


def _cells(line: tuple[str, str], separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line[1]], delimiter=separator))]
    except csv.Error as error:
        raise DesignError(f"{line[0]} cannot be read ({error}); save the table as CSV") from None


def _row(line: tuple[str, str], names: Sequence[str], separator: str) -> dict[str, str]:
    cells = _cells(line, separator)
    while len(cells) > len(names) and not cells[-1]:
        cells.pop()
    if len(cells) != len(names):
        raise DesignError(
            f"{line[0]} has {len(cells)} cells where the header has {len(names)}; write decimal "
            "points, or part columns by semicolons"
        )
    return {name: cell for name, cell in zip(names, cells, strict=True) if name and cell}


def _result(row: dict[str, str], where: str) -> LabResult:
    if "serial" not in row:
        raise DesignError(f"{where} has no serial")
    serial, operator, kit, note = (row.get(name, "") for name in TEXTS)
    result = LabResult(
        serial=serial,
        operator=operator,
        kit=kit,
        note=note,
        leak=row.get("leak", "").lower(),
        numbers={q.name: _number(row[q.name], q.name, where) for q in NUMBERS if q.name in row},
        errors={
            q.name: tuple(_number(text, q.name, where) for text in row[q.name].split())
            for q in ERRORS
            if q.name in row
        },
    )
    if result.is_empty:
        raise DesignError(
            f"{where}: nothing is said of {result.serial}; fill in a cell or remove it"
        )
    return checked(result, where)


def _number(text: str, column: str, where: str) -> float:
    if _NUMBER.fullmatch(text) is None:
        raise DesignError(f"{where}: {column} is {text[:40]!r}, not a number such as 16.8")
    return float(text.replace(",", "."))


# Records found by a traveller's code, a serial or a design's name.


_HASH = re.compile(r"\b[0-9a-f]{8,64}\b")


RecordRow = Record | StoredEntry
"""What is stored of a device."""
Stored = TypeVar("Stored", Record, StoredEntry)


def all_rows(records: Sequence[Record], entries: Sequence[StoredEntry]) -> list[RecordRow]:
    """Return entries and records in one list, entries first, as the work goes."""
    return [*entries, *records]


def found_by(
    text: str, serial: str, records: Sequence[Record], builds: Mapping[str, Build]
) -> list[Record]:
    """Return the records that ``matching`` returns. Raises DesignError where there are none."""
    matches = matching(text, serial, records, builds)
    if not matches:
        query = " ".join([*text.split(), serial]).strip()[:60]
        raise DesignError(
            f"no record goes with {query!r}; give a serial, a design's name, 8 "
            "digits or more of its sha256, or what the traveller's code says"
        )
    return matches


def matching(
    text: str, serial: str, stored: Sequence[Stored], builds: Mapping[str, Build]
) -> list[Stored]:
    """Return the rows of the design whose hash (eight digits or more of it) the text holds.

    With them come those of other designs that build the same actuator. Else those of a serial or of
    a design of that name, or the one of that number; of these only those of ``serial``, if one is
    given.
    """
    text = text.strip()
    hashes = _HASH.findall(text.lower())
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
            if text in (row.serial, builds[row.design_sha256].name, row_number(row))
        ]
    return [row for row in matches if serial in ("", row.serial)]


def row_number(row: RecordRow, number: int | None = None) -> str:
    """Return the number of a record, such as 3, or of an entry of history, such as e3.

    ``number`` is that of another row of its kind.
    """
    sign = "e" if isinstance(row, StoredEntry) else ""
    return f"{sign}{row.id if number is None else number}"


def row_words(row: RecordRow) -> str:
    """Return what a row states, in one line; units stand in the names."""
    if isinstance(row, Record):
        parts = [f"{name} {value}" for name, value in row.once.items()]
        parts += [
            f"{name} {' '.join(f'{v:g}' for v in sizes)}" for name, sizes in row.errors.items()
        ]
        return ", ".join([*parts, *([row.note] if row.note else [])])
    parts = [
        row.day,
        f"step {row.step}" if row.step else "",
        f"{row.item} lot {row.lot}" if row.lot else row.item,
        f"expires {row.expires}" if row.expires else "",
        *(f"{name} {value:g}" for name, value in row.readings.items()),
        f"{row.decision}: {row.reason}" if row.reason else row.decision,
        f"photograph {row.photograph[:12]}" if row.photograph else "",
        row.note,
        f"initials {row.initials}" if row.initials else "",
    ]
    return ", ".join(part for part in parts if part)
