"""A bar of round length under a picture that is true to scale."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw as Draw
    from PIL.ImageFont import FreeTypeFont, ImageFont

INK = (34, 34, 34)
BARS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)


def draw_length_bar(
    draw: Draw,
    right: float,
    y: float,
    widest: float,
    pixels_per_mm: float,
    font: FreeTypeFont | ImageFont,
) -> None:
    """A bar that ends at ``right``, no longer than ``widest`` pixels, its length in mm above it."""
    bar = max(step for step in BARS if step * pixels_per_mm <= widest or step == BARS[0])
    start = right - bar * pixels_per_mm
    words = f"{bar:g} mm"
    draw.line((start, y, right, y), fill=INK, width=3)
    for tick in (start, right):
        draw.line((tick, y - 6, tick, y + 6), fill=INK, width=3)
    _, _, width, height = draw.textbbox((0, 0), words, font=font)
    draw.text(((start + right - width) / 2, y - height - 8), words, fill=INK, font=font)
