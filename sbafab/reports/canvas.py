"""Raster pictures (Pillow): a depth buffer for surfaces, edges in it, text and a scale bar."""

from __future__ import annotations

import math
from collections.abc import Sequence
from io import BytesIO
from textwrap import wrap
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.meshing.surface import Floats, Ints, Surface

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw as Draw
    from PIL.ImageFont import FreeTypeFont, ImageFont

RGB = tuple[int, int, int]

COLOURS: dict[str, RGB] = {
    "film": (164, 206, 235),
    "bond": (118, 174, 216),
    "cut film": (224, 238, 248),
    "cut bond": (24, 96, 168),
    "shade": (72, 84, 98),
    "line": (58, 104, 142),
}
KEY = (
    ("film", "TPE"),
    ("cut film", "film, cut"),
    ("cut bond", "bond, cut"),
    ("shade", "open gap"),
)
"""Meaning of the colours, in the solid's foot and beside it on a page."""
PAPER: RGB = (255, 255, 255)
INK: RGB = (40, 44, 50)
BAR_INK: RGB = (34, 34, 34)
BARS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
ENLARGED = 2  # pictures are painted larger by this and reduced, which smooths their edges
DENSITY = 1.45  # samples per pixel along a triangle's side: above the root of 2, none is missed
MOST = 4_000_000  # samples in memory at once
AMBIENT = 0.58


class View(NamedTuple):
    """A parallel projection: mm to pixels, the three axes as rows (right, up, toward the eye)."""

    axes: Floats
    scale: float
    centre: tuple[float, float]

    def flat(self, points: Floats) -> Floats:
        """Return points (n, 3) as pixels right and down, and mm toward the eye."""
        right, up, toward = (points @ self.axes.T).T
        x = self.centre[0] + self.scale * right
        y = self.centre[1] - self.scale * up
        return np.column_stack([x, y, toward])


class Buffer(NamedTuple):
    """For each pixel the depth, the number of the surface seen (-1: none), its face and light."""

    depth: Floats
    body: NDArray[np.int16]
    face: NDArray[np.int32]
    light: Floats


def view_of(
    surfaces: Sequence[Surface], elevation: float, azimuth: float, box: Sequence[float]
) -> View:
    """Return the view at an elevation and an azimuth from x, in degrees, that fills a box.

    The ``box`` is left, top, right, bottom in pixels.
    """
    e, a = math.radians(elevation), math.radians(azimuth)
    toward = [math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)]
    right = [-math.sin(a), math.cos(a), 0.0]
    axes = np.array([right, np.cross(toward, right), toward])
    points = np.concatenate([surface.points for surface in surfaces]) @ axes.T
    (low_x, low_y, _), (high_x, high_y, _) = points.min(axis=0), points.max(axis=0)
    x0, y0, x1, y1 = box
    scale = min((x1 - x0) / (high_x - low_x), (y1 - y0) / (high_y - low_y))
    centre = (
        (x0 + x1) / 2 - scale * (low_x + high_x) / 2,
        (y0 + y1) / 2 + scale * (low_y + high_y) / 2,
    )
    return View(axes, scale, centre)


def framed(width: float, height: float, margin: float, foot: float) -> tuple[float, ...]:
    """Return the box for ``view_of``, with a margin and a foot as fractions of the picture."""
    return margin * width, margin * height, (1 - margin) * width, (1 - margin - foot) * height


def rasterize(
    surfaces: Sequence[Surface],
    view: View,
    width: int,
    height: int,
    lamp: Sequence[float],
    normals: Sequence[Floats] | None = None,
) -> Buffer:
    """Return the depth buffer of the surfaces; ``lamp`` is the direction to the light, in the view.

    Faces are shaded flat, or smoothly if ``normals`` (n, 3) of the points are given.
    """
    shape = height, width
    buffer = Buffer(
        np.full(shape, -np.inf),
        np.full(shape, -1, dtype=np.int16),
        np.zeros(shape, dtype=np.int32),
        np.zeros(shape),
    )
    for body, surface in enumerate(surfaces):
        corners = view.flat(surface.points)[surface.faces]
        # Pixels count downward, so faces toward the eye run clockwise there.
        (ab, ac) = (corners[:, i, :2] - corners[:, 0, :2] for i in (1, 2))
        twice = ac[:, 0] * ab[:, 1] - ac[:, 1] * ab[:, 0]
        front = np.flatnonzero(twice > 1e-12)
        faces = surface.faces[front]
        if normals is None:
            a, b, c = surface.points.take(faces.T, axis=0)
            normal = np.cross(b - a, c - a)
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            light = np.repeat(_lit(normal @ view.axes.T, lamp)[:, None], 3, axis=1)
        else:
            light = _lit(normals[body] @ view.axes.T, lamp)[faces]
        _paint(buffer, body, front, corners[front], light)
    return buffer


def _lit(normals: Floats, lamp: Sequence[float]) -> Floats:
    """Return the brightness of faces with normals (n, 3) in the view: from AMBIENT to 1."""
    light: Floats = AMBIENT + (1 - AMBIENT) * np.clip(normals @ np.array(lamp), 0, 1)
    return light


def _paint(buffer: Buffer, body: int, front: Ints, corners: Floats, light: Floats) -> None:
    """Paint triangles (n, 3, 3) of twice these areas, those of similar size together. ``light`` (n,
    3) is the brightness of their corners, ``front`` their numbers.
    """
    sides = np.roll(corners, -1, axis=1)[:, :, :2] - corners[:, :, :2]
    lengths = np.hypot(sides[:, :, 0], sides[:, :, 1])
    twice = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    # The longest side comes first.
    order = (lengths.argmax(axis=1)[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    light = np.take_along_axis(light, order, axis=1)
    long = lengths.max(axis=1)
    counts = np.column_stack([long, twice / np.maximum(long, 1e-9)])
    grids = 2 ** np.ceil(np.log2(np.ceil(DENSITY * counts) + 2)).astype(np.int64)
    for n, m in np.unique(grids, axis=0):
        # Shares along the first side, and from there to the third corner.
        s, t = (grid.ravel() for grid in np.meshgrid(*(np.linspace(0, 1, k) for k in (n, m))))
        shares = np.stack([(1 - t) * (1 - s), (1 - t) * s, t], axis=-1)
        cells = np.flatnonzero((grids == (n, m)).all(axis=1))
        for part in np.array_split(cells, max(1, len(cells) * n * m // MOST)):
            number, at = _nearest(buffer, shares @ corners[part])
            place, which = number, part[at // len(shares)]
            buffer.light.reshape(-1)[place] = (light[which] * shares[at % len(shares)]).sum(axis=1)
            buffer.face.reshape(-1)[place] = front[which]
            buffer.body.reshape(-1)[place] = body


def _nearest(buffer: Buffer, points: Floats) -> tuple[Ints, Ints]:
    """Update the depths with points (n, m, 3), and return the pixels for which a point is now
    nearest to the eye, with its number.
    """
    x, y, depth = points.reshape(-1, 3).T
    height, width = buffer.body.shape
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    inside = np.flatnonzero((column >= 0) & (column < width) & (row >= 0) & (row < height))
    place, depth = row[inside] * width + column[inside], depth[inside]
    nearest = buffer.depth.reshape(-1)
    np.maximum.at(nearest, place, depth)
    won = depth == nearest[place]
    return place[won], inside[won]


def edges(buffer: Buffer, step: float, borders: bool = False) -> NDArray[np.bool_]:
    """Return the pixels beside a step in depth of more than ``step`` mm; with ``borders`` also
    those beside another body.
    """
    depth = np.where(buffer.body < 0, -1e9, buffer.depth)
    is_edge = np.zeros(depth.shape, dtype=bool)
    for axis in (0, 1):
        jumps = np.abs(np.diff(depth, axis=axis)) > step
        if borders:
            jumps |= np.diff(buffer.body, axis=axis) != 0
        is_edge[: jumps.shape[0], : jumps.shape[1]] |= jumps
    return is_edge


def image_of(rgb: Floats) -> Image:
    """Return colours (height, width, 3) from 0 to 255 as a picture, reduced by ``ENLARGED``."""
    from PIL import Image

    whole = np.clip(np.rint(rgb), 0, 255).astype(np.uint8)
    return Image.fromarray(whole, "RGB").reduce(ENLARGED)


def png(picture: Image) -> bytes:
    out = BytesIO()
    picture.save(out, "PNG", compress_level=6)
    return out.getvalue()


def inscribe(
    picture: Image,
    caption: Sequence[str],
    size: int,
    legend: Sequence[tuple[RGB, str]] = (),
    pixels_per_mm: float = 0.0,
) -> None:
    """Draw a legend along the foot, lines of text over it, and a scale bar at the right above
    those.

    ``size`` is the letter size, pixels, in Pillow's built-in font; the bar is drawn if a scale is
    given.
    """
    from PIL import ImageDraw, ImageFont

    width, height = picture.size
    font = ImageFont.load_default(size)
    draw = ImageDraw.Draw(picture)
    margin = round(0.03 * width)
    x, y = margin, height - 2 * size
    for colour, words in legend:
        needed = round(3.5 * size + draw.textlength(words, font=font))
        if margin < x and width - margin < x + needed:
            x, y = margin, y - round(1.5 * size)
        draw.rectangle((x, y, x + 1.6 * size, y + size), fill=colour, outline=INK)
        draw.text((x + 2.1 * size, y - 0.1 * size), words, fill=INK, font=font)
        x += needed
    y -= round(1.7 * size) if legend else 0
    for words in reversed(caption):
        share = (width - 2 * margin) / draw.textlength(words, font=font)
        for line in reversed(wrap(words, max(20, int(share * len(words))))):
            draw.text((margin, y), line, fill=INK, font=font)
            y -= round(1.3 * size)
    if pixels_per_mm:
        draw_length_bar(draw, width - margin, y + size, width / 4, pixels_per_mm, font)


def draw_length_bar(
    draw: Draw,
    right: float,
    y: float,
    widest: float,
    pixels_per_mm: float,
    font: FreeTypeFont | ImageFont,
) -> None:
    """Draw a bar that ends at ``right``, at most ``widest`` pixels, with its length in mm above."""
    bar = max(step for step in BARS if step * pixels_per_mm <= widest or step == BARS[0])
    start = right - bar * pixels_per_mm
    words = f"{bar:g} mm"
    draw.line((start, y, right, y), fill=BAR_INK, width=3)
    for tick in (start, right):
        draw.line((tick, y - 6, tick, y + 6), fill=BAR_INK, width=3)
    _, _, width, height = draw.textbbox((0, 0), words, font=font)
    draw.text(((start + right - width) / 2, y - height - 8), words, fill=BAR_INK, font=font)
