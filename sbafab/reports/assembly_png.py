"""preview/assembled.png: an assembly at true proportions, one colour per part, with a scale bar."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sbafab.assemblies.build import Assembled
from sbafab.assemblies.shapes import RGB, colours, placed_surface
from sbafab.reports.canvas import INK, Buffer, draw_length_bar, rasterize, view_of

if TYPE_CHECKING:
    from PIL.Image import Image

ELEVATION, AZIMUTH = 22.0, -58.0
"""Elevation of the eye over the bench, and azimuth from x, degrees."""
LAMP = (-0.35, 0.55, 0.76)
ENLARGED = 2
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
    surfaces = [placed_surface(placed, filled=True) for placed in assembled.parts]
    # The content of a tube does not show through: no part is transparent.
    size = width * ENLARGED, height * ENLARGED
    box = MARGIN * size[0], MARGIN * size[1], (1 - MARGIN) * size[0], (1 - MARGIN - FOOT) * size[1]
    view = view_of(surfaces, ELEVATION, AZIMUTH, box)
    buffer = rasterize(surfaces, view, *size, _unit(LAMP))
    paints = colours(assembled)
    picture = _coloured(buffer, [paints[placed.name] for placed in assembled.parts])
    picture = picture.reduce(ENLARGED)
    bare = picture.crop((0, 0, width, round((1 - FOOT / 2) * height)))
    scale = view.scale / ENLARGED
    _write_bar(bare, scale)
    caption = f"{assembled.assembly.name}, before inflation, nominal films, true proportions"
    _write(picture, f"{caption}{note}", _legend(assembled, paints), scale)
    return _png(picture), _png(bare)


def _png(picture: Image) -> bytes:
    out = BytesIO()
    picture.save(out, "PNG", compress_level=6)
    return out.getvalue()


def _write_bar(picture: Image, pixels_per_mm: float) -> None:
    """A length bar alone, with letters that stay legible when the picture is printed small."""
    from PIL import ImageDraw, ImageFont

    width, height = picture.size
    font = ImageFont.load_default(round(width / 32))
    draw = ImageDraw.Draw(picture)
    draw_length_bar(draw, 0.97 * width, 0.96 * height, width / 4, pixels_per_mm, font)


def _unit(v: Sequence[float]) -> list[float]:
    size = math.hypot(*v)
    return [value / size for value in v]


def _coloured(buffer: Buffer, paints: Sequence[RGB]) -> Image:
    """Lit colours, darker where one body or one step ends against another."""
    from PIL import Image

    palette = np.array([*paints, (255, 255, 255)], dtype=float)
    light = np.where(buffer.body < 0, 1.0, buffer.light)
    rgb = palette[buffer.body] * light[:, :, None]
    rgb[_edges(buffer)] *= 0.45
    return Image.fromarray(np.clip(np.rint(rgb), 0, 255).astype(np.uint8), "RGB")


def _edges(buffer: Buffer) -> NDArray[np.bool_]:
    edges = np.zeros(buffer.body.shape, dtype=bool)
    depth = np.where(buffer.body < 0, -1e9, buffer.depth)
    for axis in (0, 1):
        border = np.diff(buffer.body, axis=axis) != 0
        step = np.abs(np.diff(depth, axis=axis)) > STEP_MM
        edge = border | step
        edges[tuple(slice(0, -1) if i == axis else slice(None) for i in (0, 1))] |= edge
    return edges


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


def _write(
    picture: Image, caption: str, legend: Sequence[tuple[RGB, str]], pixels_per_mm: float
) -> None:
    from PIL import ImageDraw, ImageFont

    width, height = picture.size
    size = max(10, round(height / 46))
    font = ImageFont.load_default(size)
    draw = ImageDraw.Draw(picture)
    margin = round(0.03 * width)
    x, y = margin, height - 2 * size
    for colour, words in legend:
        needed = round(3.4 * size + draw.textlength(words, font=font))
        if x + needed > width - margin:
            x, y = margin, y - round(1.5 * size)
        draw.rectangle((x, y, x + 1.5 * size, y + size), fill=colour, outline=INK)
        draw.text((x + 2 * size, y - 0.1 * size), words, fill=INK, font=font)
        x += needed
    y -= round(2 * size)
    draw.text((margin, y), caption, fill=INK, font=font)
    y += round(0.6 * size)
    draw_length_bar(draw, width - margin, y, width / 4, pixels_per_mm, font)
