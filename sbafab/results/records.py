"""Records of built actuators: test results, operator, measurements, promises of the design."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

from sbafab.actuators import build as laminate_of
from sbafab.assemblies.build import Assembled
from sbafab.assemblies.files import assembled_sha256, assembly_sha256, assembly_toml
from sbafab.design.identity import actuator_sha256, design_sha256, kit_of
from sbafab.design.records import Design, design_toml
from sbafab.errors import DesignError
from sbafab.models.figures import BURST, Prediction, PredictionRequest
from sbafab.models.formulas import usual_pressures
from sbafab.models.paper import FOLDED_HEIGHT
from sbafab.models.prediction import predict
from sbafab.output.checked import limits
from sbafab.rules.registration_yield import simulate
from sbafab.version import GENERATOR

PASS, FAIL = "pass", "fail"
LONGEST = {"serial": 64, "operator": 80, "kit": 120, "note": 400}
"""Characters of a text."""
UNWRITABLE = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


class Measurand(NamedTuple):
    """A measured number: its unit, the largest plausible value, and the option's name."""

    name: str
    unit: str
    most: float
    option: str
    says: str


NUMBERS = (
    Measurand("burst_kpa", "kPa", 10_000, "burst", "Pressure at which it burst."),
    Measurand(
        "stroke_mm",
        "mm",
        10_000,
        "stroke",
        "Stroke when full, beside the reference stroke.",
    ),
    Measurand("force_n", "N", 10_000, "force", "Blocked force at 100 kPa, flat."),
    Measurand("height_mm", "mm", 10_000, "height", "Height after pressing, deflated."),
    Measurand("mass_g", "g", 100_000, "mass", "Mass without tubes."),
    Measurand("proof_kpa", "kPa", 10_000, "proof", "Pressure that it held in the proof test."),
)
"""Once an actuator."""
ERRORS = (
    Measurand("offset_mm", "mm", 10, "offset", "How far a layer that a hand laid lies off."),
    Measurand("turn_deg", "deg", 45, "turn", "How far a layer that a hand laid is turned."),
    Measurand("cut_mm", "mm", 10, "cut-error", "How far a cut edge lies off its place."),
)
"""As often as one likes."""
TEXTS = ("serial", "operator", "kit", "note")
COLUMNS = (*TEXTS[:3], "leak", *(q.name for q in (*NUMBERS, *ERRORS)), "note")
"""Of a table of a batch."""


@dataclass(frozen=True)
class LabResult:
    """A record of the actuator ``serial``; a field that it does not state is empty.

    ``leak`` is "pass", "fail" or "". ``operator`` built it. Units stand in the names of NUMBERS
    and ERRORS; errors are sizes without sign.
    """

    serial: str = ""
    leak: str = ""
    operator: str = ""
    kit: str = ""
    note: str = ""
    numbers: Mapping[str, float] = field(default_factory=dict)
    errors: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    withdrawn: bool = False

    @property
    def is_empty(self) -> bool:
        """True if no result is stated."""
        return not (self.leak or self.note or self.numbers or self.errors)

    @property
    def once(self) -> dict[str, str | float]:
        """The values that only one record of an actuator may state."""
        texts = {"leak": self.leak, "operator": self.operator, "kit": self.kit}
        return {**{name: text for name, text in texts.items() if text}, **self.numbers}

    def changed(self, change: LabResult) -> LabResult:
        """Return the result with all that ``change`` states in its place."""
        texts = {
            name: getattr(change, name) for name in (*TEXTS, "leak") if getattr(change, name) != ""
        }
        return replace(
            self,
            **texts,
            numbers={**self.numbers, **change.numbers},
            errors={**self.errors, **change.errors},
            withdrawn=change.withdrawn,
        )


@dataclass(frozen=True)
class Record(LabResult):
    """A result as it is stored: its number, when (UTC), of which design, what it corrects.

    ``attempt`` is 1, and one more each time that the actuator was mended and tested again.
    """

    id: int = 0
    recorded: str = ""
    design_sha256: str = ""
    corrects: int | None = None
    attempt: int = 1

    def as_dict(self) -> dict[str, Any]:
        """The record for JSON; units stand in the keys."""
        plain = {f.name: getattr(self, f.name) for f in fields(self)}
        return {**plain, "errors": {name: list(sizes) for name, sizes in self.errors.items()}}


@dataclass(frozen=True)
class Build:
    """A design that was recorded, with what was predicted of it and the tolerances it states.

    ``predicted``: quantity to value and model. ``tolerances``: key of the design to value.
    ``good_builds``: of how many random builds how many keep every limit. ``actuator_sha256`` is
    the hash of what is built, the same for designs that differ in how many, or on what sheets.
    """

    sha256: str
    generator: str
    name: str
    family: str
    method: str
    toml: str
    predicted: Mapping[str, tuple[float, str]]
    tolerances: Mapping[str, float]
    good_builds: tuple[int, int]
    actuator_sha256: str = ""

    @property
    def actuator(self) -> str:
        """The hash that actuators are grouped by; the design's own where the other is not known."""
        return self.actuator_sha256 or self.sha256


def checked(result: LabResult, where: str = "") -> LabResult:
    """The result, with texts stripped. Raises DesignError for what cannot be meant."""
    place = f"{where}: " if where else ""
    texts = {name: getattr(result, name).strip() for name in TEXTS}
    for name, text in texts.items():
        if len(text) > LONGEST[name]:
            raise DesignError(
                f"{place}{name} has {len(text)} characters; at most {LONGEST[name]} are kept"
            )
        if UNWRITABLE.search(text):
            raise DesignError(f"{place}{name} must be plain text in one line")
    if result.leak not in ("", PASS, FAIL):
        raise DesignError(f"{place}leak is {result.leak[:40]!r}; write {PASS} or {FAIL}")
    for quantity in NUMBERS:
        if quantity.name in result.numbers:
            check_number(quantity, result.numbers[quantity.name], place, "above 0")
    for quantity in ERRORS:
        for value in result.errors.get(quantity.name, ()):
            check_number(quantity, value, place, "0 or more, without sign")
    return replace(result, **texts)


def check_number(quantity: Measurand, value: float, place: str, least: str) -> None:
    """Raise DesignError for a number that is not ``least`` or is over the quantity's largest."""
    is_low = value < 0 or (value == 0 and least == "above 0")
    if not math.isfinite(value) or is_low or value > quantity.most:
        raise DesignError(
            f"{place}{quantity.name} is {value:g}; it must be {least}, at most {quantity.most:,g} "
            f"{quantity.unit}"
        )


# Promises of a design, stored with its records so that a report needs no design file.


FIGURES = {
    "burst_kpa": (BURST, ""),
    "stroke_mm": ("reference stroke", ""),
    "force_n": ("blocked force at 100 kPa, flat", ""),
    "height_mm": (FOLDED_HEIGHT, ""),
    "mass_g": ("mass", ""),
}
"""The prediction's figure that a measured quantity is held against, of the model to design with,
and how the model's title begins, if not anyhow.
"""
TOLERANCES = {
    "offset_mm": "hand_placement",
    "turn_deg": "hand_turn",
    "cut_mm": "cutting_error",
}
"""The key of [registration] that bounds a measured error."""


def promised(design: Design) -> Build:
    """The design with its predictions, tolerances and yield. Raises DesignError."""
    laminate = laminate_of(design)
    share = simulate(laminate, limits(design)).whole
    registration = design.registration
    return Build(
        sha256=design_sha256(design),
        generator=GENERATOR,
        name=design.name,
        family=design.family,
        method=registration.method,
        toml=design_toml(design),
        predicted=_predicted(predict(design, PredictionRequest(usual_pressures(design.form)[-1:]))),
        tolerances={name: getattr(registration, key) for name, key in TOLERANCES.items()},
        good_builds=(share.good, share.builds),
        actuator_sha256=actuator_sha256(design),
    )


def promised_assembly(assembled: Assembled) -> Build:
    """Return the promises of an assembly: it holds where every part holds. Raises DesignError."""
    good, builds = 1.0, 0
    for part in assembled.designs:
        share = simulate(part.laminate, limits(part.design)).whole
        good *= (share.good / share.builds) ** len(part.parts)
        builds = max(builds, share.builds)
    designs = [part.design for part in assembled.designs]
    return Build(
        sha256=assembly_sha256(assembled),
        generator=GENERATOR,
        name=assembled.assembly.name,
        family="assembly",
        method=", ".join(dict.fromkeys(design.registration.method for design in designs)),
        toml=assembly_toml(assembled),
        predicted={},
        tolerances={
            name: max(getattr(design.registration, key) for design in designs)
            for name, key in TOLERANCES.items()
        },
        good_builds=(round(good * builds), builds),
        actuator_sha256=assembled_sha256(assembled),
    )


def kit_name(design: Design) -> str:
    """The name of the design's kit, as the kit's file says it. Raises DesignError."""
    return kit_of(design).name


def _predicted(prediction: Prediction) -> dict[str, tuple[float, str]]:
    """Return the prediction of each quantity and its model."""
    figures = {}
    for quantity, (name, model) in FIGURES.items():
        for figure in prediction.figures:
            is_other = figure.other or not figure.model.title.startswith(model)
            if figure.name == name and not is_other:
                figures[quantity] = (figure.value, figure.model.title)
                break
    return figures
