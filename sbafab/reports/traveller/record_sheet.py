"""Fields of a device's history, and tables of a design's record page, on paper and as a form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from sbafab.design.identity import adhesive_for
from sbafab.design.records import Design
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.schedule import Schedule, SeamStep, Step

ADHESIVE = "adhesive"
TESTS = ("leak test", "proof test", "device")
"""Steps after the press; the last one decides on the whole device."""


class HistoryField(NamedTuple):
    """A blank of the record page: key, label with unit, characters to write, explanation."""

    name: str
    label: str
    width: int
    says: str


HISTORY_FIELDS = (
    HistoryField("date", "Date", 10, "Day on which it was done: 2026-05-04."),
    HistoryField("serial", "Serial no.", 12, "Device, or several with commas between them."),
    HistoryField("step", "Step", 8, "Number of the press step, or a name such as leak test."),
    HistoryField("item", "Material", 10, "Film or adhesive."),
    HistoryField("lot", "Lot", 12, "Lot of the film or adhesive."),
    HistoryField("expires", "Expires", 10, "Last day of the lot: 2027-01-31."),
    HistoryField("kerf_mm", "Kerf, mm", 6, "Kerf measured on this film."),
    HistoryField("temperature_c", "Temperature, °C", 6, "Temperature that was read."),
    HistoryField("press_force_n", "Force, N", 7, "Force on the whole platen that was read."),
    HistoryField("minutes", "Time, min", 6, "Minutes in the press."),
    HistoryField("decision", "Decision", 8, "accept, reject or rework."),
    HistoryField("reason", "Reason", 18, "Reason of a reject or rework."),
    HistoryField("photograph", "Photograph", 12, "File of a photograph: JPEG, PNG or WebP."),
    HistoryField("note", "Note", 18, "Free text."),
    HistoryField("initials", "Initials", 5, "Who did it."),
)
"""In the order of the page, the form and a table's columns."""
MATERIAL = "item lot expires kerf_mm initials"
PRESS = "step temperature_c press_force_n minutes decision reason initials"
DEVICE = "step decision reason photograph note initials"


class RecordTable(NamedTuple):
    """A table of the record page: its title and fields, and a row for each item of the first field,
    with preset values.
    """

    title: str
    fields: list[HistoryField]
    rows: Mapping[str, str]


def record_tables(design: Design, laminate: Laminate, schedule: Schedule) -> list[RecordTable]:
    """Return the tables of a design's record page: materials, press steps, tests."""
    films = {layer.film.material: layer.film for layer in laminate.layers}
    products = {m: "" if film.written == m else film.product for m, film in films.items()}
    if laminate.tube_count:
        products[ADHESIVE] = adhesive_for(design, laminate.glued_films) or ""
    unsorted: list[Step | SeamStep] = [*schedule.steps, *schedule.seams]
    steps = {str(step.step): _set_values(step) for step in sorted(unsorted, key=lambda s: s.step)}
    tables = _table("Materials", MATERIAL, products), _table("Steps", PRESS, steps), TESTS_TABLE
    return [table for table in tables if table.rows]


def _table(title: str, names: str, rows: Mapping[str, str]) -> RecordTable:
    fields = {field.name: field for field in HISTORY_FIELDS}
    return RecordTable(title, [fields[name] for name in names.split()], rows)


def _set_values(step: Step | SeamStep) -> str:
    """Return the values preset by the schedule, as text."""
    heat = "" if step.temperature_c is None else f"{step.temperature_c:g} °C"
    if isinstance(step, SeamStep):
        return heat
    time = "" if step.minutes is None else f", {step.minutes:g} min"
    return f"{heat}, {step.force_n:.0f} N{time}"


# The part of the record page common to all devices.
TESTS_TABLE = _table("Tests", DEVICE, dict.fromkeys(TESTS, ""))
