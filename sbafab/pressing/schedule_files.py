"""The schedule as ``press.json`` and ``press.csv``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
    """Return ``press.json``; empty seams, folds and reasons are omitted."""
    hands = HANDLING_MINUTES if plan.is_timed else None
    document = PressDocument.of(plan, hands_minutes=hands, **more)
    for step in document["steps"]:
        if not step["reason"]:
            del step["reason"]
    return {key: value for key, value in document.items() if value or key not in JOINTS}


def heat_words(point: HeatPoint) -> str:
    """Return one point of the time-temperature curve as in the table."""
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


COLUMNS: Mapping[str, Callable[[Step], object]] = {
    "step": lambda step: step.step,
    "title": lambda step: step.title,
    "bond": lambda step: step.bond,
    "layers": lambda step: layers_in_words(step.layers),
    "adds": lambda step: layers_in_words(step.adds),
    "pins": lambda step: ", ".join(step.pins),
    "temperature_c": lambda step: f"{step.temperature_c:g}",
    "pressure_kpa": lambda step: f"{step.pressure_kpa:g}",
    "force_n": lambda step: f"{step.force_n:.1f}",
    "platen_width_mm": lambda step: f"{step.platen_mm[0]:g}",
    "platen_length_mm": lambda step: f"{step.platen_mm[1]:g}",
    "minutes": lambda step: "" if step.minutes is None else f"{step.minutes:g}",
    "film_kpa": lambda step: f"{step.film_kpa:g}",
    "edge_kpa": lambda step: f"{step.edge_kpa:g}",
    "bond_kpa": lambda step: f"{step.bond_kpa:g}",
    "plate_kpa": lambda step: f"{step.plate_kpa:g}",
    "pressure_basis": lambda step: step.pressure_basis,
    "build_up": lambda step: "; ".join(
        f"{item.part} {item.thickness_mm:g} mm ({item.material})" for item in step.build_up
    ),
    "pin_settings": lambda step: "; ".join(map(pin_words, step.pin_settings)),
    "instructions": lambda step: step.instructions,
    "time_temperature": lambda step: "; ".join(map(heat_words, step.time_temperature)),
}
"""The columns of ``press.csv``."""


def press_csv(plan: Schedule) -> str:
    """Return the steps as a table, one row per step, with units in the column names."""
    return csv_text(
        [[*COLUMNS], *([cell(step) for cell in COLUMNS.values()] for step in plan.steps)]
    )
