"""A lab's records as evidence: curves over all actuators of one design."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

from sbafab.errors import DesignError
from sbafab.lab.report import Built, items
from sbafab.lab.store import Lab
from sbafab.validation.evidence import (
    Evidence,
    MeasuredCurve,
    Setup,
    StatedError,
    load_evidence,
)

FREE, HELD = Setup(tip="free"), Setup(pressure_kpa=100.0, tip="held")
PRESSURE, SENSOR = "The pressure is not recorded.", "How the sensor holds the tip is not recorded."
RECORDED: dict[str, tuple[str, Setup, tuple[str, ...], str]] = {
    "stroke_mm": ("stroke_mm", FREE, (PRESSURE,), ""),
    "force_n": ("force_n", HELD, (SENSOR,), "height_share"),
    "height_mm": ("flat_height_mm", FREE, (), ""),
    "mass_g": ("mass_g", Setup(), (), ""),
    "burst_kpa": ("burst_kpa", Setup(), (), ""),
}
"""Recorded quantities used as evidence, named as in ``sbafab record``: quantity, set-up, what is
unknown, and the axis along which x is 0.
"""


def from_lab_records(lab: Lab) -> Evidence:
    """Return a curve for each design and recorded quantity, with one value per actuator.

    Records have no measurement error, so a curve's error is the scatter of its actuators. A
    repaired actuator counts with its first attempt. Raises DesignError if no number is recorded.
    """
    records, _, builds = lab.contents()
    by_design: dict[str, list[Built]] = defaultdict(list)
    for built in items(records, builds):
        by_design[built.design].append(built)
    counts: Counter[str] = Counter()
    curves = []
    for actuators in by_design.values():
        for curve in _curves(actuators):
            # Designs of one name share ids.
            counts[curve.id] += 1
            number = counts[curve.id]
            name = curve.id if number == 1 else f"{curve.id}-{number}"
            curves.append(curve.model_copy(update={"id": name}))
    if not curves:
        raise DesignError(
            f"{lab.path} has no record of {', '.join(RECORDED)}; record one, such as --stroke 16.8"
        )
    citation = f"build records in {lab.path.name}"
    return Evidence(id=_id(lab.path.stem), citation=citation, curves=tuple(curves))


def _curves(actuators: Sequence[Built]) -> Iterator[MeasuredCurve]:
    design, build = actuators[0].design, actuators[0].build
    for name, (quantity, setup, unknown, x_name) in RECORDED.items():
        measured = [actuator for actuator in actuators if name in actuator.numbers]
        values = tuple(actuator.numbers[name] for actuator in measured)
        if values:
            yield MeasuredCurve(
                id=_id(f"{design}-{name}"),
                quantity=quantity,
                place=f"{len(values)} actuators",
                y=values,
                x_name=x_name,
                x=(0.0,) * len(values) if x_name else (),
                toml=build.toml if build.design else "",
                actuators=tuple(actuator.records[0].serial for actuator in measured),
                setup=setup,
                error=StatedError(source="not recorded"),
                group=_id(design),
                unknown=unknown,
            )


def _id(text: str) -> str:
    """Return a text as an id of evidence."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", text).lstrip("-._")[:64] or "lab"


RECORDS = (".sqlite", ".db")  # file suffixes of a lab's build records


def load_source(source: str | Path) -> Evidence:
    """Return the evidence of a bundled source, a file (.toml, .csv), or build records.

    Raises DesignError with one sentence if the source does not exist.
    """
    if Path(source).suffix.lower() in RECORDS:
        return from_lab_records(Lab(Path(source)))
    return load_evidence(source)
