"""What a lab measures: the kerf of its laser, and what came out of the press."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.api.sources import Source
from sbafab.design.reading import Change

if TYPE_CHECKING:
    from sbafab.cutting.calibration import Calibration
    from sbafab.results.records import Record
    from sbafab.results.report import Report


def kerf(
    measurements: str | Path, resolution: float | None = None, instrument: str = ""
) -> Calibration:
    """The kerf in mm from a filled ``coupon.csv``, over all and along x and y.

    ``instrument`` is "calliper", "scanner" or "microscope" where the table has no column of that
    name; ``resolution`` mm is its least step, by default 0.01, 0.0106 (2400 dpi) or 0.001. A
    constant reading error and a scale are fitted with the kerf. Uncertainties follow the usual
    guide to their expression (JCGM 100:2008), intervals hold 95 %. Raises DesignError for a table
    that can be read in two ways, for a slip in it, and for what no beam cuts.
    """
    from sbafab.cutting.calibration import calibrated
    from sbafab.cutting.measured_table import read_measurements

    return calibrated(read_measurements(Path(measurements), instrument), resolution)


def record(
    source: Source,
    *changes: Change,
    lab: str | Path = "lab.sqlite",
    table: str | Path | None = None,
    again: bool = False,
    **said: Any,
) -> list[Record]:
    """Records what came out of a design or an assembly in the lab's file; the records added.

    ``said`` holds ``serial``, ``leak`` ("pass" or "fail"), ``operator``, ``kit``, ``note``, and
    what was measured: ``burst_kpa``, ``stroke_mm``, ``force_n``, ``height_mm``, ``mass_g``, one
    or several of ``offset_mm``, ``turn_deg``, ``cut_mm``; beside tables of the design. A
    ``table`` (CSV) says it of a batch instead. ``again`` records new attempts of actuators that
    were mended and tested again. Raises DesignError, OutputError.
    """
    from sbafab.results import recording
    from sbafab.results.store import Lab

    told = {name: value for name, value in said.items() if name in recording.SAID}
    tables = {name: value for name, value in said.items() if name not in recording.SAID}
    results = recording.results_of(told, table)
    built = recording.built_from(source, [*changes, tables] if tables else changes)
    return recording.record(Lab(Path(lab)), built, results, again)


def report(lab: str | Path = "lab.sqlite") -> Report:
    """What all records of a lab's file say together: success, figures, tolerances.

    Units stand in the names and in ``unit``; shares come with their interval of 95 %. Raises
    OutputError where the file cannot be read.
    """
    from sbafab.results.report import report as report_of
    from sbafab.results.store import Lab

    return report_of(*Lab(Path(lab)).contents())
