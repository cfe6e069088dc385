"""Strokes, volumes and stored energy at a pressure, by the elastic balloon, free to rise."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from sbafab.errors import DesignError
from sbafab.models.actuator import Actuator
from sbafab.models.balloon import Balloon, Shapes
from sbafab.models.balloon_map import MOST_STRETCH, stretch
from sbafab.models.balloons import balloons_of
from sbafab.models.figures import Asked, Factors, Figure, LeftOut, Model
from sbafab.models.rippled import risen

Inflated = Mapping[Balloon, Shapes]
ELASTIC = Model(
    "elastic balloon",
    "membrane of revolution, the film's modulus",
    "one balloon to 10 kPa: within 1.2 % of an axisymmetric mesh; of a solid one that ripples, "
    "d = 5 to 15 within 3 %, d = 20 within 5 %, but d = 10 is 6 to 19 % low where a lone one's rim "
    "rolls to one side; all balloons of a stack are taken for inner ones, inlets left out",
)


def calibrated(model: Model, factors: Factors) -> Model:
    """The same model with the factors it took, named unless they are the defaults."""
    said = []
    if factors.press_factor != 1:
        said.append(f"press factor {factors.press_factor:g}")
    if factors.pocket_loss:
        said.append(f"pocket loss {factors.pocket_loss:g} mm")
    if factors.modulus_mpa is not None:
        said.append(f"E = {factors.modulus_mpa:g} MPa")
    return replace(model, name=f"{model.name}, {', '.join(said)}") if said else model


def free_strokes(one: Actuator, asked: Asked) -> Iterator[Figure | LeftOut]:
    """What a stack of round pockets rises by, holds and stores at the pressures asked for."""
    if not one.radii:
        return
    try:
        kinds = Counter(balloons_of(one.design, one.laminate, asked.calibration, one.form))
    except DesignError as error:
        yield LeftOut("free stroke, elastic balloon", str(error))
        return
    model = calibrated(ELASTIC, asked.calibration)
    together = _inflated(kinds, asked.pressures_kpa)
    for row, pressure in enumerate(asked.pressures_kpa):
        at = f"at {pressure:g} kPa"
        try:
            stroke, volume, stored = _risen(kinds, pressure, together[row] if together else None)
        except DesignError as error:
            yield LeftOut(f"free stroke {at}, elastic balloon", str(error))
            continue
        yield Figure("stroke", f"free stroke {at}", stroke, "mm", model)
        yield Figure("stroke", f"free height {at}", one.thickness + stroke, "mm", model)
        yield Figure("stroke", f"volume a balloon {at}", volume / one.balloons, "ul", model)
        work = stored * one.form.stacks / 1000
        yield Figure("actuation", f"pneumatic input work {at}, free", work, "mJ", model)


def _inflated(kinds: Iterable[Balloon], pressures: Sequence[float]) -> list[Inflated] | None:
    """The balloons at each pressure, all in one go; None where one finds no balance."""
    try:
        found = {kind: risen(kind, pressures) for kind in kinds}
    except DesignError:
        return None
    return [
        {kind: Shapes(*(values[row : row + 1] for values in found[kind])) for kind in found}
        for row in range(len(pressures))
    ]


def _risen(
    kinds: Counter[Balloon], pressure: float, known: Inflated | None
) -> tuple[float, float, float]:
    """Stroke in mm, air in ul and energy in uJ (to 3 % the integral of p dV) of one stack."""
    stroke = volume = stored = 0.0
    for kind, count in kinds.items():
        shape = known[kind] if known else risen(kind, pressure)
        longer = float(stretch(kind, shape)[0])
        if longer > MOST_STRETCH:
            raise DesignError(
                f"the film would be {100 * longer:.0f} % longer, and one modulus is unlikely to "
                f"hold beyond {100 * MOST_STRETCH:g} %; ask for less pressure"
            )
        stroke += count * float(shape.height[0])
        volume += count * float(shape.volume[0])
        stored += count * float(shape.energy[0])
    return stroke, volume, stored
