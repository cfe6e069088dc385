"""Measured curves as data, with set-up, error and the facts that a source omits: the paper's, TOML
files, and CSV tables of a lab's curves.
"""

from __future__ import annotations

import csv
import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from sbafab.design.files import checked, hint, listed, read_toml, shown
from sbafab.design.toml_table import NAME_PATTERN, Section
from sbafab.errors import DesignError
from sbafab.models.calibration import BENT, PAPER
from sbafab.spreadsheet import plain_text, table_rows

MOST_POINTS = 10_000


class CurveQuantity(NamedTuple):
    """A measured quantity: its unit, its title, and its possible axes ("" means no axis); the
    ``group`` of its discrepancy if calibrations are fitted to it, and the reason if it is
    ``without_model``.
    """

    unit: str
    title: str
    axes: tuple[str, ...]
    group: str
    without_model: str


NO_AXIS = ""
AXES = {
    "pressure_kpa": "kPa",
    "volume_ul": "ul",
    "height_share": "",
    "stroke_mm": "mm",
    "bend_deg": "deg",
    NO_AXIS: "",
}
"""Axes and their units. ``height_share`` counts from the flat to the full height, as the source
counts it; ``volume_ul`` is one balloon's for ``balloon_stroke_mm``, else all chambers' in total."""


def _quantities() -> Iterator[tuple[str, CurveQuantity]]:
    with Path(__file__).with_name("quantities.csv").open(encoding="utf-8", newline="") as opened:
        for name, unit, title, axes, group, reason in list(csv.reader(opened))[1:]:
            names = tuple(axis.removeprefix("-") for axis in axes.split())
            yield name, CurveQuantity(unit, title, names, group, reason)


QUANTITIES = dict(_quantities())
"""Quantities by name."""
KINDS = {
    "standard deviation": 1.0,
    "standard error": 1.0,
    "largest": 1 / math.sqrt(3),
    "rounding": 1 / math.sqrt(3),
}
"""Kinds of a stated error, and the standard error over it: an error that is the largest, or half of
the last digit, is taken as even over its range (JCGM 100:2008, 4.3.7)."""

ShortText = Annotated[str, Field(max_length=400)]
_Values = Annotated[tuple[float, ...], Field(strict=False, max_length=MOST_POINTS)]
Sentences = Annotated[tuple[str, ...], Field(strict=False)]


class StatedError(Section):
    """The error of a curve's values as stated by its source.

    ``absolute``: one per value, in the curve's unit; empty if not stated. ``relative``: as a
    fraction of the value. ``runs``: the number of measurements of each value; ``source``: the place
    of the statement.
    """

    absolute: _Values = ()
    relative: float = Field(default=0.0, ge=0, le=10)
    kind: Literal["standard deviation", "standard error", "largest", "rounding"] = (
        "standard deviation"
    )
    runs: int | None = Field(default=None, ge=1)
    source: str = Field(min_length=1, max_length=400)


class Setup(Section):
    """The set-up of a measurement; None and "" mean that the source does not state the value.

    ``supply`` feeds ``fluid`` at ``flow_ml_min`` through a tube of ``tube_mm`` length and
    ``tube_bore_mm`` bore. ``chambers`` are pressurised, the others empty. The ``tip`` is free; held
    by a plate or sensor at ``height_share`` or ``stroke_mm``; bent by ``bend_deg`` and held by a
    sensor; or pushed sideways. A ``probed`` tip is free except for a sensor of unknown weight on
    it. The curve's axis, which may be ``pressure_kpa``, is empty here.
    """

    supply: ShortText = ""
    fluid: Literal["air", "water", ""] = ""
    flow_ml_min: float | None = Field(default=None, gt=0, le=1e6)
    tube_mm: float | None = Field(default=None, ge=0, le=1e5)
    tube_bore_mm: float | None = Field(default=None, gt=0, le=100)
    pressure_kpa: float | None = Field(default=None, ge=0, le=1e4)
    height_share: float | None = Field(default=None, ge=0, le=1)
    stroke_mm: float | None = Field(default=None, ge=0, le=1e4)
    bend_deg: float | None = Field(default=None, ge=0, le=360)
    chambers: int | None = Field(default=None, ge=0, le=100)
    tip: Literal["free", "probed", "held", "bent", "pushed", ""] = ""
    note: ShortText = ""


class MeasuredCurve(Section):
    """_Values of one quantity by one set-up.

    ``place``: figure and section of the source. The actuator is a ``design``, a template's name or
    a file, changed by ``changes`` (dotted key to value); or ``toml``, the text of a whole design;
    all are empty if no design describes it. ``actuators`` names the one that was measured, or one
    for each value; by default all values of a design are of one. ``x`` is empty if ``x_name`` is;
    else it has one number per value. ``comparable`` False: no prediction may be compared with it or
    fitted to it, for ``reason``. Curves of a ``group`` come from one test, so a fit that leaves one
    out leaves all of them out; "" is a test of its own. ``unknown``: sentences on facts that the
    source does not state.
    """

    id: str = Field(pattern=NAME_PATTERN)
    quantity: str
    place: str = Field(min_length=1, max_length=400)
    group: ShortText = ""
    design: ShortText = ""
    changes: dict[str, Any] = Field(default_factory=dict)
    toml: str = ""
    actuators: Sentences = ()
    x_name: str = NO_AXIS
    x: _Values = ()
    y: _Values = Field(min_length=1)
    setup: Setup = Setup.model_construct()
    error: StatedError
    comparable: bool = True
    reason: ShortText = ""
    unknown: Sentences = ()

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Self:
        if self.quantity not in QUANTITIES:
            near = hint(self.quantity, QUANTITIES)
            raise ValueError(f"has the unknown quantity {shown(self.quantity)}; {near}")
        axes, values = QUANTITIES[self.quantity].axes, len(self.y)
        if self.x_name not in axes:
            raise ValueError(
                f"has x_name = {shown(self.x_name)}, which is not an axis of {self.quantity}; "
                f"use one of {listed(axes)}"
            )
        if len(self.x) != (values if self.x_name else 0):
            fix = "give one for each" if self.x_name else "remove them, or name their axis: x_name"
            raise ValueError(f"has {len(self.x)} x for {values} y; {fix}")
        errors = self.error.absolute
        if errors and len(errors) != values:
            raise ValueError(
                f"has {len(errors)} absolute errors for {values} y; give one for each, or relative"
            )
        if len(self.actuators) not in (0, 1, values):
            raise ValueError(
                f"has {len(self.actuators)} actuators for {values} y; give one for all, or one "
                "for each"
            )
        if min(errors, default=0.0) < 0:
            raise ValueError(f"has an absolute error of {min(errors):g}; it must be at least 0")
        if not self.comparable and not self.reason:
            raise ValueError("is not comparable without a reason; give reason")
        return self

    @property
    def test(self) -> str:
        """The test of the curve."""
        return self.group or self.id

    @property
    def is_described(self) -> bool:
        """True if a design describes the actuator."""
        return bool(self.design or self.toml)

    @property
    def y_unit(self) -> str:
        """The unit of the values."""
        return QUANTITIES[self.quantity].unit

    @property
    def y_name(self) -> str:
        """The quantity's title."""
        return QUANTITIES[self.quantity].title

    @property
    def errors(self) -> tuple[float | None, ...]:
        """The standard errors of the values, in their unit; None if the source states none."""
        stated = self.error
        if not stated.absolute and not stated.relative:
            return (None,) * len(self.y)
        sizes = stated.absolute or (0.0,) * len(self.y)
        pairs = zip(sizes, self.y, strict=True)
        return tuple(KINDS[stated.kind] * math.hypot(e, stated.relative * y) for e, y in pairs)

    @property
    def actuator_of_points(self) -> tuple[str, ...]:
        """The actuator of each value, by default one of the design."""
        named = self.actuators or (self.design or self.toml,)
        return named if len(named) == len(self.y) else named * len(self.y)

    @property
    def discrepancy_group(self) -> str:
        """The group of the discrepancy of its values; "" if calibrations are not fitted to it."""
        group = QUANTITIES[self.quantity].group
        return BENT if group == "force" and self.at("bend_deg") else group

    def at(self, name: str) -> tuple[float, ...] | None:
        """Return a number of the set-up for each value: its axis, or what the set-up states; None
        if neither does.
        """
        stated = getattr(self.setup, name)
        if self.x_name == name:
            return self.x
        return None if stated is None else (stated,) * len(self.y)

    def points(self) -> Iterator[tuple[float | None, float, float | None]]:
        """Yield the values: position on the axis (None without one), value, standard error."""
        return zip(self.x or (None,) * len(self.y), self.y, self.errors, strict=True)


class Evidence(Section):
    """The measured curves of one source: a paper, or a lab's file or records.

    ``missing``: sentences about figures of the source that were unavailable.
    """

    schema_name: Literal["sbafab/evidence@1"] = Field(default="sbafab/evidence@1", alias="schema")
    id: str
    citation: str = Field(min_length=1, max_length=400)
    doi: ShortText = ""
    curves: Annotated[tuple[MeasuredCurve, ...], Field(strict=False, min_length=1)]
    missing: Sentences = ()

    @model_validator(mode="after")
    def _ids_differ(self) -> Self:
        names = [curve.id for curve in self.curves]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"has two curves {shown(name)}; give each a unique id")
        return self

    def curve(self, name: str) -> MeasuredCurve:
        """Return the curve with an id. Raises KeyError if there is none."""
        return {curve.id: curve for curve in self.curves}[name]


def load_evidence(source: str | Path) -> Evidence:
    """Return the paper's evidence, or that of a file (``.toml``, ``.csv``).

    Raises DesignError with one sentence if the source does not exist or is invalid.
    """
    if str(source) == PAPER:
        return _papers()
    path = Path(source)
    if path.suffix.lower() not in (".toml", ".csv"):
        raise DesignError(
            f"{shown(source)} is neither bundled evidence nor a .toml or .csv file; "
            f"{hint(str(source), (PAPER,))}"
        )
    return read_csv(path) if path.suffix.lower() == ".csv" else read_evidence(path)


@cache
def _papers() -> Evidence:
    return read_evidence(Path(__file__).with_name("paper.toml"))


def read_evidence(path: Path) -> Evidence:
    """Return the evidence of a TOML file; its id is the file's name.

    A ``design`` that is a file is relative to it. Raises DesignError with one sentence.
    """
    return _evidence(path, {"schema": "", **read_toml(path)})


def _evidence(path: Path, tables: Mapping[str, Any]) -> Evidence:
    """Return the evidence of tables; design files are relative to the evidence."""
    curves = tables.get("curves")
    for curve in curves if isinstance(curves, list) else ():
        if isinstance(curve, dict) and str(curve.get("design")).endswith(".toml"):
            curve["design"] = str(path.parent / curve["design"])
    try:
        return checked(Evidence, {**tables, "id": path.stem}, {}, file="file of evidence")
    except DesignError as error:
        # A message on the whole table begins with its verb.
        message = str(error)
        raise DesignError(f"{path}{'' if message[0] == ' ' else ': '}{message}") from None


# CSV: one row for each value; a curve's cells are in its first row, and may be repeated below.


OF_A_VALUE = ("x", "y", "error", "actuator")
OF_CURVE = ("quantity", "design", "x_name", "place", "group", "comparable", "reason", "unknown")
OF_ERROR = {"kind": "kind", "runs": "runs", "error_source": "source"}
OF_SETUP = tuple(Setup.model_fields)
COLUMNS = ("curve", *OF_A_VALUE, *OF_CURVE, *OF_ERROR, *OF_SETUP)
"""Columns of a lab's table; only quantity and y are needed. ``unknown`` parts its sentences by "|".
"""
COUNTS = ("runs", "chambers")
NUMBERS = (
    *("x", "y", "error"),
    *(name for name, key in Setup.model_fields.items() if key.annotation == float | None),
)
_NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


def read_csv(path: Path) -> Evidence:
    """Return the curves of a table with some of COLUMNS; the file's name is their id and citation.

    Columns are separated by commas, semicolons or tabs, the latter two also with decimal commas.
    Rows of one ``curve`` need not be adjacent; without that column the quantity distinguishes
    curves. A cell that applies to the whole curve may be in any of its rows. Raises DesignError
    with the line.
    """
    curves: dict[str, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for where, cells in table_rows(path, ("quantity", "y")):
        row = {name: _unmarked(cell) for name, cell in cells.items() if name and cell}
        for name in row.keys() - set(COLUMNS):
            raise DesignError(f"{path} has a column {shown(name)}; {hint(name, COLUMNS)}")
        if "y" not in row:
            raise DesignError(f"{where} has no y; fill it in or remove the line")
        name = row.get("curve") or row.get("quantity", "")
        if not name:
            raise DesignError(f"{where} has neither curve nor quantity; fill in one of them")
        for key, cell in row.items():
            value, values = _cell_value(cell, key, where), curves[name][key]
            if key not in OF_A_VALUE and values and values[0] != value:
                raise DesignError(
                    f"{where}: {key} is {shown(cell)}, but {shown(values[0])} in an earlier line "
                    "of this curve; use one of them, or name two curves"
                )
            values.append(value)
    if not curves:
        raise DesignError(f"{path} has no rows below its header; fill in one for each value")
    tables = [_table(name, columns, path.name) for name, columns in curves.items()]
    return _evidence(path, {"citation": f"measurements in {path.name}", "curves": tables})


def _table(name: str, columns: Mapping[str, list[Any]], file: str) -> dict[str, Any]:
    """Return the table of a curve from the filled cells of its columns."""
    cells = {key: values[0] for key, values in columns.items()}
    x, y, error, actuators = (columns.get(key, []) for key in OF_A_VALUE)
    stated = {key: cells[column] for column, key in OF_ERROR.items() if column in cells}
    return {
        "id": name,
        "place": file,
        "group": name,
        **{key: cells[key] for key in OF_CURVE if key in cells},
        "actuators": actuators[:1] if len(set(actuators)) == 1 else actuators,
        "x": x,
        "y": y,
        "error": {"source": file, **stated, "absolute": error},
        "setup": {key: cells[key] for key in OF_SETUP if key in cells},
    }


def _unmarked(cell: str) -> str:
    """Return a cell without the mark that keeps a spreadsheet from reading it as a formula."""
    return cell[1:] if cell[:1] == "'" and plain_text(cell[1:]) == cell else cell


def _cell_value(cell: str, key: str, where: str) -> Any:
    """Return the value of a cell. Raises DesignError for one that is invalid in its column."""
    if key in NUMBERS:
        number = float(cell.replace(",", ".")) if _NUMBER.fullmatch(cell) else math.nan
        if math.isfinite(number):
            return number
        raise DesignError(f"{where}: {key} is {shown(cell)}, not a number such as 16.8")
    if key in COUNTS:
        if re.fullmatch(r"\d{1,6}", cell, re.ASCII):
            return int(cell)
        raise DesignError(f"{where}: {key} is {shown(cell)}; it must be a whole number")
    if key == "comparable":
        if cell in ("yes", "no"):
            return cell == "yes"
        raise DesignError(f"{where}: comparable is {shown(cell)}; write yes or no")
    return list(filter(None, map(str.strip, cell.split("|")))) if key == "unknown" else cell
