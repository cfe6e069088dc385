"""One colour a part in pictures and solids, apart from each other for the colour blind."""

from __future__ import annotations

from sbafab.assemblies.build import Assembled

RGB = tuple[int, int, int]
FILMS: tuple[RGB, ...] = ((86, 180, 233), (0, 114, 178), (240, 228, 66), (204, 121, 167))
"""Of the assembly's designs in their order, then from the first again (Okabe and Ito's set)."""
BOUGHT: dict[str, RGB] = {
    "tube": (190, 190, 186),
    "magnet": (66, 66, 72),
    "cup": (230, 159, 0),
    "line": (213, 94, 0),
    "base": (150, 200, 180),
    "sheet": (0, 158, 115),
}


def colours(assembled: Assembled) -> dict[str, RGB]:
    """Screen colours by part name."""
    designs = [made.design.name for made in assembled.designs]
    return {
        placed.name: BOUGHT[placed.part.kind]
        if placed.made is None
        else FILMS[designs.index(placed.made.design.name) % len(FILMS)]
        for placed in assembled.parts
    }


def linear(colour: RGB) -> tuple[float, float, float]:
    """A screen (sRGB) colour as light adds up, 0 to 1."""
    r, g, b = (round(_light(value / 255), 6) for value in colour)
    return r, g, b


def _light(value: float) -> float:
    low = 0.04045
    return value / 12.92 if value <= low else ((value + 0.055) / 1.055) ** 2.4
