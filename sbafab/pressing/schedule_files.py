"""The schedule as ``press.json`` and ``press.csv``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sbafab.documents import Document, PlainNumber
from sbafab.pressing.cycles import BatchEntry
from sbafab.pressing.dowels import PinSetting
from sbafab.pressing.plate_heating import Heating, HeatPoint
from sbafab.pressing.schedule import (
    HANDLING_MINUTES,
    FoldStep,
    Schedule,
    SeamStep,
    Step,
    layers_in_words,
)
from sbafab.spreadsheet import csv_text

JOINTS = ("seams", "folds", "batch")
COLUMNS = (
    "step",
    "title",
    "bond",
    "layers",
    "adds",
    "pins",
    "temperature_c",
    "pressure_kpa",
    "force_n",
    "platen_width_mm",
    "platen_length_mm",
    "minutes",
    "film_kpa",
    "edge_kpa",
    "bond_kpa",
    "plate_kpa",
    "pressure_basis",
    "build_up",
    "pin_settings",
    "instructions",
    "time_temperature",
)


class PressDocument(Document, schema="sbafab/press@1"):
    """The heat-press schedule."""

    steps: list[Step]
    total_press_minutes: PlainNumber | None
    estimated_build_minutes: PlainNumber | None
    estimate_basis: str
    warnings: list[str]
    heating: Heating
    hands_minutes: PlainNumber | None
    seams: tuple[SeamStep, ...] = ()
    folds: tuple[FoldStep, ...] = ()
    batch: BatchEntry | None = None


def press_json(plan: Schedule, **more: object) -> dict[str, Any]:
    """Return ``press.json``; empty seams, folds and reasons are left out."""
    hands = HANDLING_MINUTES if plan.is_timed else None
    document = PressDocument.of(plan, hands_minutes=hands, **more)
    for step in document["steps"]:
        if not step["reason"]:
            del step["reason"]
    return {key: value for key, value in document.items() if value or key not in JOINTS}


def press_csv(plan: Schedule) -> str:
    """Return the steps as a table, one row each, with units in the column names."""
    rows: list[Sequence[object]] = [COLUMNS]
    for step in plan.steps:
        rows.append(
            [
                step.step,
                step.title,
                step.bond,
                layers_in_words(step.layers),
                layers_in_words(step.adds),
                ", ".join(step.pins),
                f"{step.temperature_c:g}",
                f"{step.pressure_kpa:g}",
                f"{step.force_n:.1f}",
                *(f"{size:g}" for size in step.platen_mm),
                "" if step.minutes is None else f"{step.minutes:g}",
                f"{step.film_kpa:g}",
                f"{step.edge_kpa:g}",
                f"{step.bond_kpa:g}",
                f"{step.plate_kpa:g}",
                step.pressure_basis,
                "; ".join(f"{i.part} {i.thickness_mm:g} mm ({i.material})" for i in step.build_up),
                "; ".join(map(pin_words, step.pin_settings)),
                step.instructions,
                "; ".join(map(heat_words, step.time_temperature)),
            ]
        )
    return csv_text(rows)


def heat_words(point: HeatPoint) -> str:
    """Return one point of the time-temperature line as in the table."""
    edge = "" if point.edge_c is None else f", {point.edge_c:g} C"
    after = "" if point.after_constants is None else f", after {point.after_constants:g} tau"
    minutes = "" if point.after_minutes is None else f", {point.after_minutes:g} min"
    return f"{point.point}{edge}{after}{minutes}"


def pin_words(pin: PinSetting) -> str:
    """Return one pin as in the table and on the page."""
    return (
        f"{pin.pin}: {pin.diameter_mm:g} x {pin.length_mm:g} mm, {pin.seat_mm:g} in the plate, "
        f"stands {pin.stands_mm:g} +- {pin.tolerance_mm:g}"
    )
