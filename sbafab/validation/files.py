"""Evidence in and out: the sources that ship, TOML files, and CSV tables of a lab's curves."""

from __future__ import annotations

import csv
import difflib
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import Field

from sbafab.design.files import checked, listed, read_toml, shown
from sbafab.design.sections import NAME_PATTERN
from sbafab.design.toml_table import Section
from sbafab.errors import DesignError
from sbafab.spreadsheet import plain_text
from sbafab.validation.records import (
    KINDS,
    NO_AXIS,
    QUANTITIES,
    TIPS,
    Evidence,
    MeasuredActuator,
    MeasuredCurve,
    Setup,
    StatedError,
)

FOLDER = Path(__file__).parent
MOST_BYTES = 1_000_000
"""Size of a CSV table."""
MOST_POINTS = 10_000
AnySection = TypeVar("AnySection", bound=Section)


class _SetupTable(Section):
    supply: str = Field(default="", max_length=400)
    fluid: Literal["air", "water", ""] = ""
    flow_ml_min: float | None = Field(default=None, gt=0, le=1e6)
    tube_mm: float | None = Field(default=None, ge=0, le=1e5)
    tube_bore_mm: float | None = Field(default=None, gt=0, le=100)
    pressure_kpa: float | None = Field(default=None, ge=0, le=1e4)
    height_share: float | None = Field(default=None, ge=0, le=1)
    stroke_mm: float | None = Field(default=None, ge=0, le=1e4)
    bend_deg: float | None = Field(default=None, ge=0, le=360)
    chambers: int | None = Field(default=None, ge=0, le=100)
    tip: Literal["free", "held", "bent", "pushed", ""] = ""
    note: str = Field(default="", max_length=400)


class _ErrorTable(Section):
    absolute: list[float] = Field(default_factory=list, max_length=MOST_POINTS)
    relative: float = Field(default=0.0, ge=0, le=10)
    kind: Literal["standard deviation", "standard error", "largest", "rounding"] = (
        "standard deviation"
    )
    runs: int | None = Field(default=None, ge=1)
    source: str = Field(min_length=1, max_length=400)


class _CurveTable(Section):
    id: str = Field(pattern=NAME_PATTERN)
    quantity: str
    place: str = Field(min_length=1, max_length=400)
    group: str = Field(default="", max_length=400)
    design: str = Field(default="", max_length=400)
    changes: dict[str, Any] = Field(default_factory=dict)
    x_name: str = NO_AXIS
    x: list[float] = Field(default_factory=list, max_length=MOST_POINTS)
    y: list[float] = Field(min_length=1, max_length=MOST_POINTS)
    setup: _SetupTable = Field(default_factory=_SetupTable)
    error: _ErrorTable
    comparable: bool = True
    reason: str = Field(default="", max_length=400)
    unknown: list[str] = Field(default_factory=list)


class _EvidenceFile(Section):
    schema_name: Literal["sbafab/evidence@1"] = Field(alias="schema")
    citation: str = Field(min_length=1, max_length=400)
    doi: str = Field(default="", max_length=400)
    missing: list[str] = Field(default_factory=list)
    curves: list[dict[str, Any]] = Field(min_length=1)


@cache
def evidence_ids() -> tuple[str, ...]:
    """Return the ids of the sources that ship, the paper first."""
    names = sorted(path.stem for path in FOLDER.glob("*.toml"))
    return tuple(sorted(names, key=lambda name: name != "paper"))


def load_evidence(source: str | Path) -> Evidence:
    """Return the evidence of a shipped source, or of a file (``.toml``, ``.csv``).

    Raises DesignError with one sentence if the source does not exist or has a fault.
    """
    if str(source) in evidence_ids():
        return _shipped(str(source))
    path = Path(source)
    if path.suffix.lower() not in (".toml", ".csv"):
        near = difflib.get_close_matches(str(source), evidence_ids(), 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise DesignError(
            f"{shown(source)} is neither evidence that ships ({', '.join(evidence_ids())}) nor a "
            f"file that ends in .toml or .csv{hint}"
        )
    return read_csv(path) if path.suffix.lower() == ".csv" else read_evidence(path)


@cache
def _shipped(name: str) -> Evidence:
    return read_evidence(FOLDER / f"{name}.toml")


def shipped_evidence() -> tuple[Evidence, ...]:
    """Return all evidence that ships, the paper first."""
    return tuple(map(_shipped, evidence_ids()))


def read_evidence(path: Path) -> Evidence:
    """Return the evidence of a TOML file; its id is the file's name.

    A ``design`` that is a file is taken to lie beside it. Raises DesignError with one sentence.
    """
    tables = read_toml(path)
    record = _checked(_EvidenceFile, tables, path)
    curves = []
    for place, table in enumerate(record.curves, start=1):
        name = table.get("id", place)
        where = f"{path}, curve {shown(name) if isinstance(name, str) else place}"
        curves.append(_curve(_checked(_CurveTable, table, where), path.parent, where))
    _check_ids(curves, path)
    return Evidence(path.stem, record.citation, record.doi, tuple(curves), tuple(record.missing))


def _checked(kind: type[AnySection], table: Mapping[str, Any], where: object) -> AnySection:
    try:
        return checked(kind, table, {})
    except DesignError as error:
        message = str(error).replace("the design file", "the file of evidence")
        message = message.replace("a design file", "a file of evidence")
        raise DesignError(f"{where}: {message}") from None


def _curve(table: _CurveTable, folder: Path, where: str) -> MeasuredCurve:
    curve = MeasuredCurve(
        id=table.id,
        quantity=table.quantity,
        place=table.place,
        y=tuple(table.y),
        x_name=table.x_name,
        x=tuple(table.x),
        actuator=MeasuredActuator(_beside(table.design, folder), table.changes),
        setup=Setup(**table.setup.model_dump()),
        error=StatedError(
            tuple(table.error.absolute),
            table.error.relative,
            table.error.kind,
            table.error.runs,
            table.error.source,
        ),
        comparable=table.comparable,
        reason=table.reason,
        group=table.group or table.id,
        unknown=tuple(table.unknown),
    )
    check(curve, where)
    return curve


def _beside(design: str, folder: Path) -> str:
    """Return the path of a design file beside the evidence; a template's name as it is."""
    return str(folder / design) if design.endswith(".toml") else design


def check(curve: MeasuredCurve, where: str) -> None:
    """Raise DesignError with one sentence for a curve that does not agree with itself."""
    if curve.quantity not in QUANTITIES:
        near = difflib.get_close_matches(curve.quantity, QUANTITIES, 1)
        hint = f"did you mean {near[0]}?" if near else f"write one of {', '.join(QUANTITIES)}"
        raise DesignError(f"{where}: quantity {shown(curve.quantity)} is not known; {hint}")
    axes = QUANTITIES[curve.quantity].axes
    if curve.x_name not in axes:
        allowed = listed(axes)
        raise DesignError(
            f"{where}: x_name = {shown(curve.x_name)} is no axis of {curve.quantity}; write one of "
            f"{allowed}"
        )
    values = len(curve.y)
    if len(curve.x) != (values if curve.x_name else 0):
        fix = "give one for each" if curve.x_name else "remove them, or name their axis by x_name"
        raise DesignError(f"{where} has {len(curve.x)} x for {values} y; {fix}")
    if curve.error.absolute and len(curve.error.absolute) != values:
        raise DesignError(
            f"{where} has {len(curve.error.absolute)} absolute errors for {values} y; give one for "
            "each, or relative"
        )
    low = [size for size in curve.error.absolute if size < 0]
    if low:
        raise DesignError(f"{where}: an absolute error is {low[0]:g}; it must be at least 0")
    if not curve.comparable and not curve.reason:
        raise DesignError(f"{where} is not comparable without a reason; give reason")


def _check_ids(curves: Sequence[MeasuredCurve], path: Path) -> None:
    names = [curve.id for curve in curves]
    for name in names:
        if names.count(name) > 1:
            raise DesignError(f"{path} has two curves {shown(name)}; give each its id")


# CSV: one row for each value; a curve's cells are in its first row, and may be repeated below.


COLUMNS = (
    "curve",
    "quantity",
    "design",
    "x_name",
    "x",
    "y",
    "error",
    "place",
    "group",
    "kind",
    "runs",
    "error_source",
    "supply",
    "fluid",
    "flow_ml_min",
    "tube_mm",
    "tube_bore_mm",
    "pressure_kpa",
    "height_share",
    "stroke_mm",
    "bend_deg",
    "chambers",
    "tip",
    "note",
    "comparable",
    "reason",
    "unknown",
)
"""Columns of a lab's table; only quantity and y are needed. ``unknown`` parts its sentences by "|".
"""
OF_A_VALUE = ("x", "y", "error")
NUMBERS = (
    *("flow_ml_min", "tube_mm", "tube_bore_mm"),
    *("pressure_kpa", "height_share", "stroke_mm", "bend_deg"),
)
COUNTS = ("runs", "chambers")
CHOICES: dict[str, tuple[str, ...]] = {
    "fluid": ("air", "water"),
    "tip": tuple(filter(None, TIPS)),
    "kind": tuple(KINDS),
    "comparable": ("yes", "no"),
}
_NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
TableRow = tuple[str, dict[str, str]]
"""The place of a row for messages, and its cells that are not empty by column."""


def read_csv(path: Path) -> Evidence:
    """Return the curves of a table with some of COLUMNS; the file's name is their id and citation.

    Columns are separated by commas, semicolons or tabs, the latter two also with decimal commas.
    Rows of one ``curve`` need not be adjacent; without that column the quantity separates curves. A
    cell that applies to the whole curve may be in any of its rows. Raises DesignError with the
    line.
    """
    rows_by_curve: dict[str, list[TableRow]] = {}
    for where, row in _rows(path):
        name = row.get("curve") or row.get("quantity", "")
        if not name:
            raise DesignError(f"{where} names no curve and no quantity; fill in one of the two")
        rows_by_curve.setdefault(name, []).append((where, row))
    curves = [_curve_of_rows(name, rows, path) for name, rows in rows_by_curve.items()]
    if not curves:
        raise DesignError(f"{path} has no row below its columns; fill in one for each value")
    return Evidence(path.stem, f"measurements in {path.name}", "", tuple(curves))


def _rows(path: Path) -> Iterator[TableRow]:
    lines = [
        line
        for line in enumerate(_text(path).splitlines(), start=1)
        if line[1].strip(' ,;\t"') and not line[1].lstrip(' "').startswith("#")
    ]
    if not lines:
        raise DesignError(f"{path} is empty; its first line names columns: {', '.join(COLUMNS)}")
    separator = max(",;\t", key=lines[0][1].count)
    names = [name.lower() for name in _cells(lines[0][1], separator, str(path))]
    _check_names(names, path)
    for number, line in lines[1:]:
        where = f"{path}, line {number}"
        cells = _cells(line, separator, where)
        if len(cells) != len(names):
            raise DesignError(
                f"{where} has {len(cells)} cells where the header has {len(names)}; write decimal "
                "points, or part columns by semicolons"
            )
        yield where, {name: cell for name, cell in zip(names, cells, strict=True) if name and cell}


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise DesignError(f"{path} is larger than {MOST_BYTES:,} bytes; give fewer values")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise DesignError(f"{path} cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise DesignError(f"{path} is not a text file in UTF-8; save it as CSV") from None


def _cells(line: str, separator: str, where: str) -> list[str]:
    try:
        return [_unmarked(cell.strip()) for cell in next(csv.reader([line], delimiter=separator))]
    except csv.Error as error:
        raise DesignError(f"{where} cannot be read ({error}); save the table as CSV") from None


def _unmarked(cell: str) -> str:
    """Return a cell without the mark that keeps a spreadsheet from taking it for a formula."""
    return cell[1:] if cell[:1] == "'" and plain_text(cell[1:]) == cell else cell


def _check_names(names: Sequence[str], path: Path) -> None:
    for name in filter(None, names):
        if name not in COLUMNS:
            near = difflib.get_close_matches(name, COLUMNS, 1)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(COLUMNS)}"
            raise DesignError(f"{path} has a column {shown(name)}; {hint}")
        if names.count(name) > 1:
            raise DesignError(f"{path} has two columns {name}; keep one")
    for name in ("quantity", "y"):
        if name not in names:
            raise DesignError(f"{path} has no column {name}; every value needs it")


def _curve_of_rows(name: str, rows: Sequence[TableRow], path: Path) -> MeasuredCurve:
    where = f"{path}, curve {shown(name)}"
    if re.fullmatch(NAME_PATTERN, name) is None:
        raise DesignError(
            f"{where}: a curve's name is 1 to 64 letters, digits, dots, dashes or underscores, "
            "beginning with a letter or digit"
        )
    cells = _cells_of_curve(rows)
    if "quantity" not in cells:
        raise DesignError(f"{where} names no quantity; write one of {', '.join(QUANTITIES)}")
    values = {key: [_value(row, key) for row in rows if key in row[1]] for key in OF_A_VALUE}
    if len(values["y"]) < len(rows):
        gap = next(place for place, row in rows if "y" not in row)
        raise DesignError(f"{gap} has no y; fill it in or remove the line")
    curve = MeasuredCurve(
        id=name,
        quantity=cells["quantity"],
        place=cells.get("place", path.name),
        y=tuple(values["y"]),
        x_name=cells.get("x_name", NO_AXIS),
        x=tuple(values["x"]),
        actuator=MeasuredActuator(_beside(cells.get("design", ""), path.parent)),
        setup=Setup(
            supply=cells.get("supply", ""),
            fluid=cells.get("fluid", ""),
            tip=cells.get("tip", ""),
            note=cells.get("note", ""),
            chambers=_count(cells, "chambers", where),
            **{key: _positive(cells, key, where) for key in NUMBERS},
        ),
        error=StatedError(
            absolute=tuple(values["error"]),
            kind=cells.get("kind", "standard deviation"),
            runs=_count(cells, "runs", where),
            source=cells.get("error_source", path.name),
        ),
        comparable=cells.get("comparable", "yes") == "yes",
        reason=cells.get("reason", ""),
        group=cells.get("group", name),
        unknown=tuple(filter(None, map(str.strip, cells.get("unknown", "").split("|")))),
    )
    check(curve, where)
    return curve


def _cells_of_curve(rows: Sequence[TableRow]) -> dict[str, str]:
    """Return the curve's fields from its rows. Raises DesignError if two rows do not agree."""
    cells: dict[str, str] = {}
    for where, row in rows:
        for key, cell in row.items():
            if key not in OF_A_VALUE and cells.setdefault(key, cell) != cell:
                raise DesignError(
                    f"{where}: {key} is {shown(cell)}, and {shown(cells[key])} in an earlier line "
                    "of this curve; write one of the two, or name two curves"
                )
            choices = CHOICES.get(key)
            if choices and cell not in choices:
                raise DesignError(f"{where}: {key} is {shown(cell)}; write {' or '.join(choices)}")
    return cells


def _value(row: TableRow, key: str) -> float:
    return _number(row[1][key], key, row[0])


def _number(text: str, key: str, where: str) -> float:
    number = float(text.replace(",", ".")) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(number):
        raise DesignError(f"{where}: {key} is {shown(text)}, not a number such as 16.8")
    return number


def _positive(cells: Mapping[str, str], key: str, where: str) -> float | None:
    if key not in cells:
        return None
    number = _number(cells[key], key, where)
    if number < 0:
        raise DesignError(f"{where}: {key} is {number:g}; it must be at least 0")
    return number


def _count(cells: Mapping[str, str], key: str, where: str) -> int | None:
    if key not in cells:
        return None
    if not re.fullmatch(r"\d{1,6}", cells[key], re.ASCII):
        raise DesignError(f"{where}: {key} is {shown(cells[key])}; it must be a whole number")
    return int(cells[key])
