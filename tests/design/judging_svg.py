"""What resvg, a renderer of another house, makes of an SVG: size and area in mm from its pixels."""

from __future__ import annotations

import io
from typing import NamedTuple

import numpy as np
import resvg_py
from PIL import Image

ZOOM = 3
PIXEL = 25.4 / 96 / ZOOM
"""mm a pixel of the picture."""


class Seen(NamedTuple):
    """What was drawn: its bounds on the page, y upward, and its area. Lengths are mm.

    ``whole``: whether none of it may lie beyond the page.
    """

    bounds: tuple[float, float, float, float]
    area: float
    whole: bool

    @property
    def size(self) -> tuple[float, float]:
        return self.bounds[2] - self.bounds[0], self.bounds[3] - self.bounds[1]


def seen(drawing: str) -> Seen | None:
    """What resvg draws, None where that is nothing."""
    picture = bytes(
        resvg_py.svg_to_bytes(svg_string=drawing, zoom=ZOOM, dpi=96, skip_system_fonts=True)
    )
    cover = np.asarray(Image.open(io.BytesIO(picture)).convert("RGBA"))[..., 3] / 255.0
    height, width = cover.shape
    # Half covered pixels count where an edge crosses them half way.
    rows, columns = (np.flatnonzero(cover.max(axis=axis) > 0) for axis in (1, 0))
    if not len(rows):
        return None
    left, right = columns[0], columns[-1] + 1
    top, bottom = rows[0], rows[-1] + 1
    whole = left > 0 and top > 0 and right < width and bottom < height
    bounds = left, height - bottom, right, height - top
    return Seen(tuple(PIXEL * value for value in bounds), PIXEL**2 * cover.sum(), whole)
