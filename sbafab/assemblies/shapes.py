"""Solids and colours of parts, in their own frame and in place."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sbafab.assemblies.build import Assembled, PlacedPart
from sbafab.assemblies.records import AnyPart, Base, Cup, Line, Magnet, Sba, Tube
from sbafab.geometry.region import Region, disc, rectangle
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.solid import (
    Slab,
    TubeWrap,
    closed_surface,
    film_slab,
    gap_slab,
    solid_slabs,
    wrapped,
)
from sbafab.meshing.surface import Surface

SAGITTA = 0.02
"""mm: an assembly is seen whole, so its arcs are coarser than a single solid's."""
AROUND = 48
"""Facets of a suction cup round its axis."""


def placed_surface(placed: PlacedPart, filled: bool = False) -> Surface:
    """Return the closed surface of a part in place; ``filled`` fills its pockets."""
    surface = bent_surface(placed, filled)
    return Surface(placed.pose.points(surface.points), surface.faces)


def bent_surface(placed: PlacedPart, filled: bool = False) -> Surface:
    """Return the surface before its pose: rotated about its own axis and bent around its tube."""
    if placed.radius is None:
        surface = own_surface(placed, filled)
        return Surface(placed.turned(surface.points), surface.faces)
    wrap = TubeWrap(placed.radius)
    slabs = [
        slab._replace(region=slab.region.turned(placed.turn)) for slab in _slabs(placed, filled)
    ]
    return wrapped(closed_surface(f"parts.{placed.name}", slabs, SAGITTA, wrap.step), wrap)


def own_surface(placed: PlacedPart, filled: bool = False) -> Surface:
    """Return the closed surface of a part in its own frame."""
    if isinstance(placed.part, Cup):
        return _bell(placed.part)
    return closed_surface(f"parts.{placed.name}", _slabs(placed, filled), SAGITTA)


def _slabs(placed: PlacedPart, filled: bool) -> list[Slab]:
    if placed.made is None:
        return [Slab(face(placed.part), 0.0, placed.height)]
    laminate = placed.made.laminate
    return filled_slabs(laminate) if filled else solid_slabs(laminate)


def filled_slabs(laminate: Laminate) -> list[Slab]:
    """Return slabs of the films and the gaps between them, pockets included, for collisions."""
    slabs = [film_slab(layer) for layer in laminate.tpe_layers]
    slabs += [gap_slab(gap, gap.contact) for gap in laminate.interfaces if gap.masks]
    return sorted(slabs, key=lambda slab: slab.bottom)


def face(part: AnyPart) -> Region:
    """Return the end face of a purchased part, in its own frame."""
    if isinstance(part, Tube | Line):
        return _ring(part.outer_diameter, part.inner_diameter)
    if isinstance(part, Magnet):
        return disc((0.0, 0.0), part.diameter / 2)
    if isinstance(part, Cup):
        return _ring(part.neck, part.bore)
    assert not isinstance(part, Sba)
    assert isinstance(part, Base)
    return rectangle((-part.width / 2, -part.length / 2), (part.width / 2, part.length / 2))


def _ring(outer: float, inner: float) -> Region:
    return disc((0.0, 0.0), outer / 2) - disc((0.0, 0.0), inner / 2)


def _bell(cup: Cup) -> Surface:
    """A cup's surface: its section, counter-clockwise from its bore, revolved about its axis."""
    bore, neck, rim = cup.bore / 2, cup.neck / 2, cup.diameter / 2
    inside = max(neck - cup.wall, bore)
    outer = [(bore, 0.0), (neck, 0.0), (rim, cup.height)]
    return _turned([*outer, (rim - cup.wall / 2, cup.height), (inside, cup.wall), (bore, cup.wall)])


MOULD_WALL, DOWEL, DOWEL_PLAY = 4.0, 2.0, 0.1
"""mm: of the mould round the cup, of the bore's pin in the lower half, and of its play there."""


def cup_mould(cup: Cup) -> tuple[Surface, Surface]:
    """Return the lower and upper half of the mould for casting a cup, rim up.

    The lower half forms the outside, the upper one the inside with a pin for the bore, which enters
    a hole of the lower half. Our own design, untested.
    """
    bore, neck, rim = cup.bore / 2, cup.neck / 2, cup.diameter / 2
    inside, out, foot = max(neck - cup.wall, bore), rim + MOULD_WALL, -DOWEL - MOULD_WALL
    socket = bore + DOWEL_PLAY
    lower = [(0.0, foot), (out, foot), (out, cup.height), (rim, cup.height), (neck, 0.0)]
    lower += [(socket, 0.0), (socket, -DOWEL), (0.0, -DOWEL)]
    upper = [(0.0, -DOWEL), (bore, -DOWEL), (bore, cup.wall), (inside, cup.wall)]
    upper += [(rim - cup.wall / 2, cup.height), (out, cup.height)]
    upper += [(out, cup.height + MOULD_WALL), (0.0, cup.height + MOULD_WALL)]
    return _turned(lower), _turned(list(dict.fromkeys(upper)))


def _turned(outline: Sequence[tuple[float, float]]) -> Surface:
    """Return a section (r, z), counter-clockwise, revolved about the axis."""
    section = np.array(outline)
    angles = np.arange(AROUND) * (2 * math.pi / AROUND)
    r, z = section.T
    points = np.concatenate([np.column_stack([r * np.cos(a), r * np.sin(a), z]) for a in angles])
    count = len(section)
    # All turns share a point on the axis.
    number = np.where(r == 0.0, 0, np.arange(AROUND)[:, None]) * count + np.arange(count)
    here, up = number, np.roll(number, -1, axis=1)
    on, both = np.roll(here, -1, axis=0), np.roll(up, -1, axis=0)
    lower, upper = np.stack([here, on, both], axis=-1), np.stack([here, both, up], axis=-1)
    faces = np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])
    a, b, c = faces.T
    return Surface(points, faces[(a != b) & (b != c) & (c != a)])


# Colours of parts in pictures and solids, distinct for the colour blind.


RGB = tuple[int, int, int]
FILMS: tuple[RGB, ...] = ((86, 180, 233), (0, 114, 178), (240, 228, 66), (204, 121, 167))
"""Colours of the assembly's designs in their order, repeated (Okabe and Ito's set)."""
BOUGHT: dict[str, RGB] = {
    "tube": (190, 190, 186),
    "magnet": (66, 66, 72),
    "cup": (230, 159, 0),
    "line": (213, 94, 0),
    "base": (150, 200, 180),
    "sheet": (0, 158, 115),
}


def colours(assembled: Assembled) -> dict[str, RGB]:
    """Return screen colours by part name."""
    designs = [source.design.name for source in assembled.designs]
    return {
        placed.name: BOUGHT[placed.part.kind]
        if placed.made is None
        else FILMS[designs.index(placed.made.design.name) % len(FILMS)]
        for placed in assembled.parts
    }


def linear(colour: RGB) -> tuple[float, float, float]:
    """Return a screen (sRGB) colour in linear light, 0 to 1."""
    r, g, b = (
        round(value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4, 6)
        for value in (part / 255 for part in colour)
    )
    return r, g, b
