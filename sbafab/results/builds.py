"""What a design promises, kept beside its records so that a report needs no design file."""

from __future__ import annotations

from sbafab.actuators import build as laminate_of
from sbafab.assemblies.build import Assembled
from sbafab.assemblies.writing import assembled_sha256, assembly_sha256, assembly_toml
from sbafab.design.kits import kit_of
from sbafab.design.records import Design
from sbafab.design.writing import actuator_sha256, design_sha256, design_toml
from sbafab.models.figures import Asked, Prediction
from sbafab.models.paper import BURST
from sbafab.models.prediction import predict
from sbafab.output.settings import GENERATOR, limits
from sbafab.results.records import Build

FIGURES = {
    "stroke_mm": ("full stroke", ""),
    "force_n": ("blocked force at 100 kPa, flat", "virtual work on Eq. 4"),
    "height_mm": ("deflated height", ""),
    "mass_g": ("mass", ""),
}
"""The prediction's figure and model that a measured quantity is held against."""
TOLERANCES = {
    "offset_mm": "hand_placement",
    "turn_deg": "hand_turn",
    "cut_mm": "cutting_error",
}
"""The key of [registration] that bounds a measured error."""


def promised(design: Design) -> Build:
    """The design with its predictions, tolerances and yield. Raises DesignError."""
    from sbafab.rules.registration_yield import simulate

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
        predicted=_predicted(predict(design, Asked(pressures_kpa=(100.0,)))),
        tolerances={name: getattr(registration, key) for name, key in TOLERANCES.items()},
        good_builds=(share.good, share.builds),
        actuator_sha256=actuator_sha256(design),
    )


def promised_assembly(assembled: Assembled) -> Build:
    """The same of a whole assembly: it holds where every part holds. Raises DesignError.

    No figure of a whole is predicted. Of the tolerances of its designs each is the widest.
    """
    from sbafab.rules.registration_yield import simulate

    good, builds = 1.0, 0
    for made in assembled.designs:
        share = simulate(made.laminate, limits(made.design)).whole
        good *= (share.good / share.builds) ** len(made.parts)
        builds = max(builds, share.builds)
    designs = [made.design for made in assembled.designs]
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
    """What is predicted of each quantity, and by which model; the paper's burst pressure."""
    found = {"burst_kpa": (BURST.value, f"the paper's balloons of 5 mm ({BURST.where})")}
    for quantity, (name, model) in FIGURES.items():
        for figure in prediction.figures:
            if figure.name == name and figure.model.title.startswith(model):
                found[quantity] = (figure.value, figure.model.title)
                break
    return found
