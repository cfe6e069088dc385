"""Measurements of a lab: coupons, cut sheets, results of its actuators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sbafab.api.designs import Source, command
from sbafab.design.files import Change
from sbafab.design.films import FILM_NAME, is_kerf
from sbafab.errors import DesignError
from sbafab.folders.swap import replace_text
from sbafab.lab import recording
from sbafab.lab.coupon import (
    RESOLUTIONS,
    Calibration,
    Estimate,
    Measurement,
    Value,
    calibrated,
    read_measurements,
    write_coupon,
)
from sbafab.lab.inspection import Inspection, InspectionDocument, drawing, history, sizes_csv
from sbafab.lab.records import (
    HistoryEntry,
    HistoryRow,
    LabRow,
    Record,
    RecordEntry,
    RecordsDocument,
    RowEntry,
    columns,
    row_of,
)
from sbafab.lab.report import Report, ReportDocument, success_svg
from sbafab.lab.report import report as report_of
from sbafab.lab.scan import Reference, Scan, ScanPicture, read_cut_sheet, read_picture
from sbafab.lab.store import Contents, Lab, store_photograph
from sbafab.reports.traveller.record_sheet import RecordTable


def kerf(
    measurements: str | Path, resolution: float | None = None, instrument: str = ""
) -> Calibration:
    """Return the kerf in mm from a filled ``coupon.csv``, over all and along x and y.

    ``instrument`` is "calliper", "scanner" or "microscope" if the table has no column of that name;
    ``resolution`` mm is its smallest step, by default 0.01, 0.0106 (2400 dpi) or 0.001. A constant
    reading error and a scale are fitted with the kerf. Uncertainties follow the Guide to the
    Expression of Uncertainty in Measurement (JCGM 100:2008); intervals are 95 %. Raises DesignError
    for an ambiguous table, an erroneous entry in it, and an implausible kerf.
    """
    return calibrated(read_measurements(Path(measurements), instrument), resolution)


@command
def record(
    source: Source,
    *changes: Change,
    lab: str | Path = "lab.sqlite",
    table: str | Path | None = None,
    again: bool = False,
    **values: Any,
) -> list[Record]:
    """Record results of a design or an assembly in the lab's file; return the records added.

    ``values`` holds ``serial``, ``leak`` ("pass" or "fail"), ``operator``, ``kit``, ``note``, and
    the measurements: ``proof_kpa``, ``burst_kpa``, ``stroke_mm``, ``force_n``, ``height_mm``,
    ``mass_g``, one or several of ``offset_mm``, ``turn_deg``, ``cut_mm``. It may also contain
    tables of the design. For a batch, pass a ``table`` (CSV) instead. ``again`` records new
    attempts of actuators that were repaired and tested again. Raises DesignError, OutputError.
    """
    result = {name: values.pop(name) for name in columns(Record) if name in values}
    if table is not None and result:
        raise DesignError(f"a table contains all values; omit {', '.join(result)}")
    rows = [row_of(Record, result)] if table is None else recording.read_batch(Path(table))
    built = recording.built_from(source, [*changes, values] if values else changes)
    return recording.record(Lab(Path(lab)), built, rows, again)


def record_history(
    source: Source,
    *changes: Change,
    entries: Sequence[Mapping[str, Any]],
    lab: str | Path = "lab.sqlite",
    again: bool = False,
) -> list[HistoryEntry]:
    """Record lines of the history of devices in the lab's file; return the entries added.

    An entry has ``serial`` (several, separated by commas) and ``date``, ``step``, ``item``,
    ``lot``, ``expires``, ``kerf_mm``, ``temperature_c``, ``press_force_n``, ``minutes``,
    ``decision``, ``reason``, ``photograph`` (a file, or its bytes), ``note``, ``initials``, as far
    as they are known. Raises DesignError, OutputError.
    """
    lines: list[HistoryEntry] = []
    for number, entry in enumerate(entries, start=1):
        values = dict(entry)
        content = values.get("photograph")
        if isinstance(content, bytes):
            values["photograph"] = store_photograph(Path(lab), content, f"photograph {number}")
        step = values.get("step") or values.get("item")
        lines += recording.entries_of(values, f"{step}" if step else f"entry {number}")
    built = recording.built_from(source, changes)
    return recording.record(Lab(Path(lab)), built, lines, again)


def record_sheet(source: Source, *changes: Change) -> list[RecordTable]:
    """Return the tables of the record page of a design: materials, steps, tests.

    Raises DesignError.
    """
    return recording.record_sheet(recording.built_from(source, changes))


def report(lab: str | Path = "lab.sqlite") -> Report:
    """Evaluate all records of a lab's file: success rates, figures, tolerances.

    Units are in the names and in ``unit``; shares have a 95 % interval. Raises OutputError if the
    file cannot be read.
    """
    records, _, builds = Lab(Path(lab)).contents()
    return report_of(records, builds)
