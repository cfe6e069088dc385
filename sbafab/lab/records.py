"""Rows of a lab's file: results of built actuators, and entries of their history."""

from __future__ import annotations

import datetime
import re
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    FiniteFloat,
    model_validator,
)

from sbafab.design.files import checked
from sbafab.documents import Document, attribute
from sbafab.errors import DesignError

PASS = "pass"
REJECT, REWORK = "reject", "rework"


NUMBERS = {
    "burst_kpa": "kPa",
    "stroke_mm": "mm",
    "force_n": "N",
    "height_mm": "mm",
    "mass_g": "g",
    "proof_kpa": "kPa",
}
"""Measured once per attempt, with their units; see ``docs/recording.md``."""
ERRORS = ("offset_mm", "turn_deg", "cut_mm")  # measured any number of times; unsigned
READINGS = ("kerf_mm", "temperature_c", "press_force_n", "minutes")  # numbers of a history entry
_UNWRITABLE = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
_DECIMAL = re.compile(r"\d+(?:[.,]\d*)?|[.,]\d+", re.ASCII)


def _one_line(text: str) -> str:
    if _UNWRITABLE.search(text):
        raise ValueError("must be plain text in one line")
    return text


def _day(text: str) -> str:
    try:
        is_day = not text or datetime.date.fromisoformat(text).isoformat() == text
    except ValueError:
        is_day = False
    if not is_day:
        raise ValueError("must be a day such as 2026-05-04")
    return text


def _number(value: object) -> object:
    """Return a text as a number, with a decimal point or comma."""
    if not isinstance(value, str):
        return value
    if _DECIMAL.fullmatch(value.strip()) is None:
        raise ValueError("must be a number such as 16.8")
    return float(value.strip().replace(",", "."))


def _several(value: object) -> object:
    """Return one number, or space-separated numbers, as a list."""
    if isinstance(value, str):
        return value.split()
    return list(value) if isinstance(value, Iterable) else [value]


LINE = AfterValidator(_one_line)
SEVERAL = BeforeValidator(_several)
Text = Annotated[str, Field(max_length=400), LINE]
Day = Annotated[str, AfterValidator(_day)]
LabNumber = Annotated[FiniteFloat, BeforeValidator(_number), Field(gt=0)]
ErrorSize = Annotated[FiniteFloat, BeforeValidator(_number), Field(ge=0)]


class LabRow(BaseModel):
    """A row about the device ``serial``; fields without a value are empty.

    The file adds the row's number ``id``, the time ``recorded`` (UTC) and the hash of the design. A
    row replaces the one that it ``corrects``. ``attempt`` is 1, plus one for each repair and retest
    of the device.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", str_strip_whitespace=True, coerce_numbers_to_str=True
    )
    NOUN: ClassVar[str]
    """The row's name in messages, and its table in the file."""
    SIGN: ClassVar[str] = ""
    """Prefix of the number."""

    id: int = 0
    recorded: str = ""
    design_sha256: str = ""
    corrects: int | None = None
    withdrawn: bool = False
    attempt: int = Field(default=1, ge=1)
    serial: Annotated[str, Field(max_length=64), LINE] = ""

    @property
    def number(self) -> str:
        """The number as displayed and typed: 3 for a result, e3 for a history entry."""
        return f"{self.SIGN}{self.id}"

    @property
    def stated(self) -> dict[str, Any]:
        """The values by column, without empty ones and those that the file adds."""
        return self.given(columns(type(self)))

    @property
    def cells(self) -> dict[str, Any]:
        """The stated values for a table: several errors in one text."""
        return {
            name: " ".join(map(str, value)) if isinstance(value, tuple) else value
            for name, value in self.stated.items()
        }

    def given(self, names: Iterable[str]) -> dict[str, Any]:
        """Return the non-empty values of these columns."""
        return {name: value for name in names if (value := getattr(self, name))}

    @abstractmethod
    def conflict(self, stored: Self) -> str:
        """Return a sentence if this row repeats or contradicts one of the same attempt, or ""."""

    @abstractmethod
    def _problems(self) -> Iterator[str]:
        """Yield sentences about fields that need another field."""

    @model_validator(mode="after")
    def _whole(self) -> Self:
        for problem in self._problems():
            raise ValueError(problem)
        return self


class Record(LabRow):
    """A result of an actuator: "pass" or "fail" of its ``leak`` test, its ``operator`` and ``kit``,
    and the measured values; field names include their units.
    """

    NOUN: ClassVar[str] = "record"

    operator: Annotated[str, Field(max_length=80), LINE] = ""
    kit: Annotated[str, Field(max_length=120), LINE] = ""
    leak: Annotated[Literal["", "pass", "fail"], BeforeValidator(lambda v: str(v).lower())] = ""
    burst_kpa: Annotated[LabNumber, Field(le=10_000)] | None = None
    stroke_mm: Annotated[LabNumber, Field(le=10_000)] | None = None
    force_n: Annotated[LabNumber, Field(le=10_000)] | None = None
    height_mm: Annotated[LabNumber, Field(le=10_000)] | None = None
    mass_g: Annotated[LabNumber, Field(le=100_000)] | None = None
    proof_kpa: Annotated[LabNumber, Field(le=10_000)] | None = None
    offset_mm: Annotated[tuple[Annotated[ErrorSize, Field(le=10)], ...], SEVERAL] = ()
    turn_deg: Annotated[tuple[Annotated[ErrorSize, Field(le=45)], ...], SEVERAL] = ()
    cut_mm: Annotated[tuple[Annotated[ErrorSize, Field(le=10)], ...], SEVERAL] = ()
    note: Text = ""

    @property
    def numbers(self) -> dict[str, float]:
        """The values measured once, by column, each in the unit in its name."""
        return self.given(NUMBERS)

    @property
    def errors(self) -> dict[str, tuple[float, ...]]:
        """The measured errors, by column, each in the unit in its name."""
        return self.given(ERRORS)

    def _problems(self) -> Iterator[str]:
        if not self.serial:
            yield "a result needs its serial, the actuator's number on its traveller"
        if not (self.leak or self.note or self.numbers or self.errors or self.withdrawn):
            yield f"{self.serial} has no result; give leak (pass or fail), a number or a note"

    def conflict(self, stored: Self) -> str:
        before = stored.stated
        for name, value in self.stated.items():
            is_once = name in ("leak", "operator", "kit", *NUMBERS) and name in before
            if is_once and (before[name] != value or name not in ("operator", "kit")):
                return (
                    f"serial {self.serial} has {name} = {before[name]} in record {stored.id}; "
                    f"correct that with --correct {stored.id}, record the mended and tested device "
                    "again with --again, or choose another serial"
                )
        return ""


class HistoryEntry(LabRow):
    """An entry of a device's history.

    ``date`` is the day of the work, ``step`` a press step's number or a test's name, ``item`` a
    film or the adhesive with its ``lot`` and last day ``expires``. ``photograph`` is the name of a
    file in the folder beside the lab's file. Field names include their units.
    """

    NOUN: ClassVar[str] = "entry"
    SIGN: ClassVar[str] = "e"

    date: Day = ""
    step: Annotated[str, Field(max_length=40), LINE] = ""
    item: Annotated[str, Field(max_length=60), LINE] = ""
    lot: Annotated[str, Field(max_length=60), LINE] = ""
    expires: Day = ""
    kerf_mm: Annotated[LabNumber, Field(le=1)] | None = None
    temperature_c: Annotated[LabNumber, Field(le=400)] | None = None
    press_force_n: Annotated[LabNumber, Field(le=1_000_000)] | None = None
    minutes: Annotated[LabNumber, Field(le=10_000)] | None = None
    decision: Literal["", "accept", "reject", "rework"] = ""
    reason: Annotated[str, Field(max_length=200), LINE] = ""
    photograph: Text = ""
    note: Text = ""
    initials: Annotated[str, Field(max_length=16), LINE] = ""

    @property
    def readings(self) -> dict[str, float]:
        """The readings, by column, each in the unit in its name."""
        return self.given(READINGS)

    @property
    def is_expired(self) -> bool:
        """True if the lot had expired on the day of work, or of recording if none is given."""
        return bool(self.expires) and self.expires < (self.date or self.recorded[:10])

    def _problems(self) -> Iterator[str]:
        if not self.serial:
            yield "an entry needs its serial, as on the traveller"
        stated = self.lot or self.decision or self.photograph or self.note or self.readings
        if not stated and not self.withdrawn:
            yield (
                f"an entry states a lot, a reading ({', '.join(READINGS)}), a decision, a "
                "photograph or a note; fill in one of them"
            )
        is_sent_back = self.decision in (REJECT, REWORK)
        if is_sent_back and not self.reason:
            yield f"a {self.decision} needs its reason; fill in reason"
        if self.reason and not is_sent_back:
            yield f"a reason goes with the decision {REJECT} or {REWORK}; fill in decision"
        if self.lot and not self.item:
            yield "a lot needs its item, the film or the adhesive, such as TPE"
        if self.expires and not self.lot:
            yield "a day of expiry needs its lot; fill in lot"
        if self.readings.keys() - {"kerf_mm"} and not self.step:
            yield "temperature_c, press_force_n and minutes need their step, such as 1"

    def conflict(self, stored: Self) -> str:
        if self.stated != stored.stated:
            return ""
        return (
            f"serial {self.serial} has this line already, entry {stored.number}; leave it out, or "
            "add a date or a note that tells them apart"
        )


Row = TypeVar("Row", bound=LabRow)


# Rows for programs.


class RowEntry(Document):
    """A row of a lab's file; units are in the keys."""

    id: int
    recorded: str
    """UTC"""
    design_sha256: str
    corrects: int | None
    withdrawn: bool
    attempt: int
    serial: str
    note: str
    design: str = ""
    actuator_sha256: str = ""
    """equal for all designs that build this"""
    corrected_by: int | None = None


class RecordEntry(RowEntry):
    """A result of an actuator."""

    operator: str
    kit: str
    leak: str
    numbers: dict[str, float]
    errors: dict[str, tuple[float, ...]]
    """sizes"""


class HistoryRow(RowEntry):
    """An entry of a device's history."""

    date: str
    step: str
    item: str
    lot: str
    expires: str
    decision: str
    reason: str
    photograph: str
    initials: str
    readings: dict[str, float]
    expired: bool = attribute("is_expired")


class RecordsDocument(Document, schema="sbafab/records@1"):
    """Output of ``record --json``."""

    records: list[RecordEntry]
    entries: list[HistoryRow]


class DeviceEntry(Document):
    """The rows of a device."""

    serial: str
    design: str
    actuator_sha256: str
    records: list[RecordEntry]
    entries: list[HistoryRow]


class HistoryDocument(Document, schema="sbafab/history@1"):
    """Contents of ``record --export FILE.json``."""

    devices: list[DeviceEntry]


@cache
def columns(kind: type[LabRow]) -> tuple[str, ...]:
    """Return the columns of a table of rows: the fields that a user fills in."""
    added = ("id", "recorded", "design_sha256", "corrects", "withdrawn", "attempt")
    return tuple(name for name in kind.model_fields if name not in added)


def row_of(kind: type[Row], values: Mapping[str, Any], where: str = "") -> Row:
    """Return a row of values by column; numbers may be text, several errors a list or text.

    Raises DesignError with one sentence that begins with ``where``.
    """
    empty = (str, tuple, list, type(None))
    stated = {name: v for name, v in values.items() if v or not isinstance(v, empty)}
    place = f"{where}: " if where else ""
    for name in stated:
        if name not in (*columns(kind), "withdrawn"):
            raise DesignError(
                f"{place}{name[:40]!r} is not a column; use {', '.join(columns(kind))}"
            )
    try:
        return checked(kind, stated, {}, place)
    except DesignError as error:
        # A sentence on the whole row begins where a field's name would be.
        raise DesignError(" ".join(str(error).split())) from None


def standing(rows: Iterable[Row]) -> list[Row]:
    """Return the rows that are neither corrected nor withdrawn."""
    rows = list(rows)
    corrected = {row.corrects for row in rows}
    return [row for row in rows if row.id not in corrected and not row.withdrawn]
