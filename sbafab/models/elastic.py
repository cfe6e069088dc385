"""Strokes, volumes and stored energy at a pressure, by the elastic balloon, free to rise."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from sbafab.models.actuator import Actuator
from sbafab.models.balloon import Balloon, inflate
from sbafab.models.figures import Asked, Figure, LeftOut, Model

ELASTIC = Model(
    "elastic balloon",
    "membrane of revolution, E = 10 MPa, nu = 0.2",
    "one balloon: within 1 % of an axisymmetric mesh, 2 % of a solid one that wrinkles, to 10 kPa; "
    "every balloon is taken for one inside the stack, inlets left out. At 100 kPa the film is "
    "stretched by a quarter and more, where one modulus is unlikely to hold",
)
FLATTEST = 1e-3
"""kPa below which a film is called flat."""


def balloons(one: Actuator) -> Counter[Balloon]:
    """The balloons of a stack of round pockets, alike ones together."""
    design = one.design
    film = one.laminate.films["TPE"].thickness
    bore = design.bore.diameter / 2 if one.balloons > 1 else 0.0
    neck = bore + design.bond.width if one.balloons > 1 else 0.0
    return Counter(
        Balloon(radius, design.bond.width, neck, bore, film) for radius in one.radii
    )


def free_strokes(one: Actuator, asked: Asked) -> Iterator[Figure | LeftOut]:
    """What the stack rises by, holds and stores at the pressures asked for."""
    pressures = [pressure for pressure in asked.pressures_kpa if pressure > FLATTEST]
    if not pressures or not one.radii:
        return
    kinds = balloons(one)
    shapes = [(inflate(kind, pressures), count) for kind, count in kinds.items()]
    stroke = sum(count * shape.height for shape, count in shapes)
    volume = sum(count * shape.volume for shape, count in shapes) / one.balloons
    stored = sum(count * shape.energy for shape, count in shapes) * one.form.stacks / 1000
    for number, pressure in enumerate(pressures):
        at = f"at {pressure:g} kPa"
        yield Figure("stroke", f"free stroke {at}", float(stroke[number]), "mm", ELASTIC)
        yield Figure("stroke", f"volume a balloon {at}", float(volume[number]), "ul", ELASTIC)
        name = f"pneumatic input work {at}, free"
        yield Figure("actuation", name, float(stored[number]), "mJ", ELASTIC)
