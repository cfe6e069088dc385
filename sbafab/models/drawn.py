"""What holds of flat pockets of any outline, also drawn ones."""

from __future__ import annotations

from collections.abc import Iterator

from sbafab.design.outline import read_outline
from sbafab.models.actuator import Actuator
from sbafab.models.figures import Asked, Figure, Model
from sbafab.models.force import force

FLAT = Model(
    "pressure x pocket area",
    "statics of a stiff plate",
    "an upper bound, for plates that lie flat on the whole pocket: the paper's 3-DoF actuator "
    "reached 0.83 of it at 100 kPa",
)


def flat_forces(actuator: Actuator, asked: Asked) -> Iterator[Figure]:
    """The most that drawn pockets push with at the pressures asked for, before plates part."""
    drawing = actuator.design.drawing
    if drawing is None or actuator.form.wrap is not None:
        return
    area = actuator.form.pushing * read_outline(drawing).area
    for pressure in asked.pressures_kpa:
        name = f"blocked force at {pressure:g} kPa, flat, at most"
        yield Figure("force", name, float(force(pressure, area)), "N", FLAT)
