"""Use a lab's records as evidence: curves over all actuators of one design."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

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


class _Recorded(NamedTuple):
    quantity: str
    setup: Setup = Setup()
    unknown: tuple[str, ...] = ()
    x_name: str = ""


RECORDED = {
    "stroke_mm": _Recorded("stroke_mm", Setup(tip="free"), ("The pressure is not recorded.",)),
    "force_n": _Recorded(
        "force_n",
        Setup(pressure_kpa=100.0, tip="held"),
        ("How the sensor holds the tip is not recorded.",),
        "height_share",
    ),
    "height_mm": _Recorded("flat_height_mm", Setup(tip="free")),
    "mass_g": _Recorded("mass_g"),
    "burst_kpa": _Recorded("burst_kpa"),
}
"""Recorded quantities used as evidence, named as in ``sbafab record``; x is 0 if it is named."""


def from_lab_records(lab: Lab) -> Evidence:
    """Return a curve for each design and recorded quantity, with one value per actuator.

    Records have no measurement error, so a curve's error is the scatter of its actuators. A
    repaired actuator counts by its first attempt. Raises DesignError if no number is recorded.
    """
    records, _, builds = lab.contents()
    by_design: dict[str, list[Built]] = defaultdict(list)
    for built in items(records, builds):
        by_design[built.design].append(built)
    curves = tuple(curve for actuators in by_design.values() for curve in _curves(actuators))
    if not curves:
        raise DesignError(
            f"{lab.path} has no record with any of {', '.join(RECORDED)}; record one, such as "
            "--stroke 16.8"
        )
    citation = f"build records in {lab.path.name}"
    return Evidence(id=_id(lab.path.stem), citation=citation, curves=_renamed(curves))


def _curves(actuators: Sequence[Built]) -> list[MeasuredCurve]:
    build = actuators[0].build
    curves = []
    for name, kind in RECORDED.items():
        values = tuple(a.numbers[name] for a in actuators if name in a.numbers)
        if not values:
            continue
        curves.append(
            MeasuredCurve(
                id=_id(f"{actuators[0].design}-{name}"),
                quantity=kind.quantity,
                place=f"{len(values)} actuators",
                y=values,
                x_name=kind.x_name,
                x=(0.0,) * len(values) if kind.x_name else (),
                toml=build.toml if build.design else "",
                setup=kind.setup,
                error=StatedError(source="not recorded"),
                group=_id(actuators[0].design),
                unknown=kind.unknown,
            )
        )
    return curves


def _id(text: str) -> str:
    """Return a text as an id of evidence."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", text).lstrip("-._")[:64] or "lab"


def _renamed(curves: Sequence[MeasuredCurve]) -> tuple[MeasuredCurve, ...]:
    """Return the curves, with a number appended to ids that designs of one name share."""
    counts: dict[str, int] = defaultdict(int)
    renamed = []
    for curve in curves:
        counts[curve.id] += 1
        number = counts[curve.id]
        renamed.append(
            curve if number == 1 else curve.model_copy(update={"id": f"{curve.id}-{number}"})
        )
    return tuple(renamed)


RECORDS = (".sqlite", ".db")
"""File suffixes of a lab's build records."""


def load_source(source: str | Path) -> Evidence:
    """Return the evidence of a bundled source, a file (.toml, .csv), or build records.

    Raises DesignError with one sentence if the source does not exist.
    """
    if Path(source).suffix.lower() in RECORDS:
        return from_lab_records(Lab(Path(source)))
    return load_evidence(source)
