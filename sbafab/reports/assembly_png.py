"""preview/assembled.png: an assembly at true proportions, one colour per part, with a scale bar."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from sbafab.assemblies.build import Assembled
from sbafab.assemblies.shapes import RGB, colours, placed_surface
from sbafab.reports.canvas import (
    ENLARGED,
    PAPER,
    draw_length_bar,
    edges,
    framed,
    image_of,
    inscribe,
    png,
    rasterize,
    view_of,
)

ELEVATION, AZIMUTH = 22.0, -58.0
"""Elevation of the eye over the bench, and azimuth from x, degrees."""
LAMP = (-0.35, 0.55, 0.76)
MARGIN, FOOT = 0.06, 0.17
STEP_MM = 0.25
"""Jump in depth that is drawn as an edge."""


def assembly_png(
    assembled: Assembled, note: str = "", width: int = 1040, height: int = 780
) -> bytes:
    """The assembly before inflation, seen from the front above, as PNG; ``note`` ends its caption.

    Inlet tubes and what the films enclose are not shown.
    """
    return assembly_pngs(assembled, note, width, height)[0]


def assembly_pngs(
    assembled: Assembled, note: str = "", width: int = 1040, height: int = 780
) -> tuple[bytes, bytes]:
    """Return that picture, and one without caption and legend for pages with their own."""
    from PIL import ImageDraw, ImageFont

    surfaces = [placed_surface(placed, filled=True) for placed in assembled.parts]
    size = width * ENLARGED, height * ENLARGED
    view = view_of(surfaces, ELEVATION, AZIMUTH, framed(*size, MARGIN, FOOT))
    length = math.hypot(*LAMP)
    buffer = rasterize(surfaces, view, *size, [part / length for part in LAMP])
    paints = colours(assembled)
    # The content of a tube does not show through: no part is transparent.
    palette = np.array([*(paints[placed.name] for placed in assembled.parts), PAPER], dtype=float)
    rgb = palette[buffer.body] * np.where(buffer.body < 0, 1.0, buffer.light)[:, :, None]
    # Darker where one body or one step ends against another.
    rgb[edges(buffer, STEP_MM, borders=True)] *= 0.45
    picture = image_of(rgb)
    bare = picture.crop((0, 0, width, round((1 - FOOT / 2) * height)))
    # Alone, the bar has letters that stay legible when the picture is printed small.
    font, scale = ImageFont.load_default(round(width / 32)), view.scale / ENLARGED
    right, low = 0.97 * width, 0.96 * bare.height
    draw_length_bar(ImageDraw.Draw(bare), right, low, width / 4, scale, font)
    caption = f"{assembled.assembly.name}, before inflation, nominal films, true proportions{note}"
    legend = _legend(assembled, paints)
    inscribe(picture, [caption], max(10, round(height / 46)), legend, scale)
    return png(picture), png(bare)


def _legend(assembled: Assembled, paints: Mapping[str, RGB]) -> list[tuple[RGB, str]]:
    """One line per colour: the parts that have it, and what they are."""
    lines: dict[tuple[RGB, str], list[str]] = {}
    for placed in assembled.parts:
        kind = placed.part.kind if placed.made is None else placed.made.design.name
        lines.setdefault((paints[placed.name], kind), []).append(placed.name)
    return [
        (colour, ", ".join(names) if [kind] == names else f"{', '.join(names)} ({kind})")
        for (colour, kind), names in lines.items()
    ]
