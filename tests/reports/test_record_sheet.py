"""The record page of a traveller: a blank for each field, in one order, and for each press step."""

from __future__ import annotations

from typing import Any

from sbafab.pressing.schedule import schedule
from sbafab.reports.traveller.record_sheet import HISTORY_FIELDS
from sbafab.results.recording import entries_of
from tests.reports.bench_pages import built, page, words_of

ORDER = [field.label for field in HISTORY_FIELDS]


def test_a_traveller_ends_with_the_record_page(sheet_files: Any) -> None:
    [section] = page(sheet_files, "3dof-15mm").xpath("//section[@aria-labelledby='record']")
    assert not section.xpath("./following::section")
    head = [words_of(label) for label in section.xpath(".//label")]
    assert head == ORDER[:2]
    tables = section.xpath(".//table")
    labels = [[words_of(cell) for cell in table.xpath("./thead//th")] for table in tables]
    assert {label for row in labels for label in row} == set(ORDER[2:])
    for row in labels:
        assert row == sorted(row, key=ORDER.index)
    design, laminate = built("3dof-15mm")
    steps = [words_of(cell) for cell in tables[1].xpath("./tbody//th")]
    assert steps == [
        f"{step.step}{step.temperature_c:g} °C, {step.force_n:.0f} N, {step.minutes:g} min"
        for step in schedule(laminate, design).steps
    ]
    blanks = section.xpath(".//tbody//input")
    cells = sum(
        len(row) * len(t.xpath("./tbody/tr")) for row, t in zip(labels, tables, strict=True)
    )
    rows = sum(len(table.xpath("./tbody/tr")) for table in tables)
    assert len(blanks) == cells - rows, "all cells but the name of the row are blanks"


def test_every_blank_of_the_page_can_be_entered() -> None:
    """A line for each name of a field is read as it stands on paper."""
    samples = {
        "date": "2026-05-04",
        "serial": "A1",
        "expires": "2027-01-31",
        "decision": "rework",
    }
    values = {
        field.name: samples.get(field.name, "12" if ", " in field.label else "text")
        for field in HISTORY_FIELDS
        if field.name != "kerf_mm"
    }
    [entry] = entries_of(values)
    assert entry.readings == {"temperature_c": 12.0, "press_force_n": 12.0, "minutes": 12.0}
    assert (entry.item, entry.lot, entry.reason, entry.photograph) == ("text",) * 4
