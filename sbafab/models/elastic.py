"""Strokes, volumes and stored energy at a pressure, by the elastic balloon, free to rise."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.actuator import Actuator
from sbafab.models.balloon import Balloon, Shapes, inflate
from sbafab.models.figures import Asked, Figure, LeftOut, Model

ELASTIC = Model(
    "elastic balloon",
    "membrane of revolution, E = 10 MPa",
    "one balloon to 10 kPa: within 1 % of an axisymmetric mesh, 2 % of a solid one that wrinkles; "
    "all balloons of a stack are taken for inner ones, inlets left out",
)
MOST_STRETCH = 0.15
"""Share by which films may stretch; one modulus is unlikely to hold beyond."""


def free_strokes(one: Actuator, asked: Asked) -> Iterator[Figure | LeftOut]:
    """What a stack of round pockets rises by, holds and stores at the pressures asked for."""
    if not one.radii:
        return
    others = {film for film in _films(one) if film != "TPE"}
    if others:
        yield LeftOut("free stroke, elastic balloon", f"no modulus of {min(others)} is known")
        return
    for pressure in asked.pressures_kpa:
        at = f"at {pressure:g} kPa"
        try:
            stroke, volume, stored = _risen(one, pressure)
        except DesignError as error:
            yield LeftOut(f"free stroke {at}, elastic balloon", str(error))
            continue
        yield Figure("stroke", f"free stroke {at}", stroke, "mm", ELASTIC)
        yield Figure("stroke", f"volume a balloon {at}", volume / one.balloons, "ul", ELASTIC)
        work = stored * one.form.stacks / 1000
        yield Figure("actuation", f"pneumatic input work {at}, free", work, "mJ", ELASTIC)


def _risen(one: Actuator, pressure: float) -> tuple[float, float, float]:
    """Stroke in mm, air in ul and energy in uJ (that is the integral of p dV) of one stack."""
    stroke = volume = stored = 0.0
    for kind, count in _balloons(one).items():
        shape = inflate(kind, pressure)
        longer = _stretch(kind, shape)
        if longer > MOST_STRETCH:
            raise DesignError(
                f"the film would be {100 * longer:.0f} % longer, and one modulus is unlikely to "
                f"hold beyond {100 * MOST_STRETCH:g} %; ask for less pressure"
            )
        stroke += count * float(shape.height[0])
        volume += count * float(shape.volume[0])
        stored += count * float(shape.energy[0])
    return stroke, volume, stored


def _films(one: Actuator) -> set[str]:
    """Materials of the films that balloons are made of."""
    return {layer.film.material for layer in one.laminate.layers if not layer.is_mask}


def _balloons(one: Actuator) -> Counter[Balloon]:
    """The balloons of a stack, alike ones together."""
    design = one.design
    film = next(layer.film for layer in one.laminate.layers if not layer.is_mask)
    bore = design.bore.diameter / 2 if one.balloons > 1 else 0.0
    neck = bore + design.bond.width if one.balloons > 1 else 0.0
    return Counter(
        Balloon(radius, design.bond.width, neck, bore, film.thickness) for radius in one.radii
    )


def _stretch(kind: Balloon, shape: Shapes) -> float:
    """By what share the film between neck and rim is longer than it was flat."""
    part = slice(kind.held, kind.edge + 1)
    lengths = np.hypot(np.diff(shape.r[:, part]), np.diff(shape.z[:, part]))
    return float(lengths.sum()) / (kind.pocket - kind.neck) - 1
