"""Raster pictures: a canvas of flat colours, a depth buffer for surfaces, a length bar (Pillow)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.geometry.edges import Point
from sbafab.meshing.surface import Surface

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw as Draw
    from PIL.ImageFont import FreeTypeFont, ImageFont

Tone = Literal["film", "bond", "cut film", "cut bond", "shade", "line"]
Colour = tuple[int, int, int]

COLOURS: dict[Tone, Colour] = {
    "film": (164, 206, 235),
    "bond": (118, 174, 216),
    "cut film": (224, 238, 248),
    "cut bond": (24, 96, 168),
    "shade": (72, 84, 98),
    "line": (58, 104, 142),
}
KEY: tuple[tuple[Tone, str], ...] = (
    ("film", "TPE"),
    ("cut film", "film, cut"),
    ("cut bond", "bond, cut"),
    ("shade", "open gap"),
)
"""Meaning of the colours, in the picture's foot and beside it on a page."""
LEVELS = 60
PAPER = (255, 255, 255)
INK = (40, 44, 50)
SHADOW = 70
SMALLEST = 15
"""Least letter size, pixels: pages often show a picture smaller than it is."""
BLUR = 8
STRIP = 64
"""Rows reduced at once: enlarged and in full colour they are large."""


class Canvas:
    """Later paint covers earlier paint. One byte per pixel keeps the fills fast."""

    def __init__(self, width: int, height: int, supersample: int) -> None:
        from PIL import Image, ImageDraw

        self._size = width, height
        self._enlarged = supersample
        self._image = Image.new("P", (width * supersample, height * supersample), 0)
        self._draw = ImageDraw.Draw(self._image)
        self._index: dict[Colour, int] = {PAPER: 0}
        self._known: dict[tuple[Tone, int], int] = {}

    def fill(self, points: Sequence[Point], tone: Tone, level: float) -> None:
        """Fills a polygon; ``level`` darkens the tone (1: as it is)."""
        self._draw.polygon(points, fill=self._colour(tone, level))

    def outline(self, points: Sequence[Point]) -> None:
        closed = [*points, *points[:1]]
        self._draw.line(closed, fill=self._colour("line", 1.0), width=self._enlarged)

    def _colour(self, tone: Tone, level: float) -> int:
        steps = round(level * LEVELS)
        number = self._known.get((tone, steps))
        if number is None:
            r, g, b = (min(255, round(part * (steps / LEVELS))) for part in COLOURS[tone])
            number = self._index.setdefault((r, g, b), len(self._index))
            self._known[tone, steps] = number
        return number

    def png(self, footprint: Sequence[Sequence[Point]], caption: str, films: str) -> bytes:
        """The picture over the soft shadow of ``footprint``, with caption and key of ``films``."""
        self._image.putpalette([part for colour in self._index for part in colour])
        picture = self._backdrop(footprint).convert("RGB")
        # Unpainted pixels are backdrop.
        whole = self._enlarged
        x0, top, right, bottom = self._image.getbbox() or (0, 0, *self._image.size)
        last = -(-bottom // whole)
        for row in range(top // whole, last, STRIP):
            strip = x0 // whole, row, -(-right // whole), min(row + STRIP, last)
            picture.paste(self._reduced(strip, picture.crop(strip)), strip[:2])
        self._write(picture, caption, films)
        out = BytesIO()
        picture.save(out, "PNG", compress_level=6)
        return out.getvalue()

    def _reduced(self, box: tuple[int, int, int, int], behind: Image) -> Image:
        """Return the paint within the ``box`` of the picture, over the picture ``behind`` it."""
        from PIL import ImageChops

        whole = self._enlarged
        x0, top, right, bottom = box
        inside = self._image.crop((whole * x0, whole * top, whole * right, whole * bottom))
        painted = inside.convert("RGB").reduce(whole)
        empty = inside.point([255] + [0] * 255, "L").reduce(whole).convert("RGB")
        # The empty canvas is white: subtracting the backdrop's difference from white, in
        # proportion, leaves no bright rim around the solid.
        lack = ImageChops.multiply(ImageChops.invert(behind), empty)
        return ImageChops.subtract(painted, lack)

    def _backdrop(self, footprint: Sequence[Sequence[Point]]) -> Image:
        from PIL import Image, ImageDraw, ImageFilter

        width, height = self._size
        coarse = 4
        shrink = self._enlarged * coarse
        small = Image.new("L", (width // coarse, height // coarse), 255)
        draw = ImageDraw.Draw(small)
        for ring in footprint:
            draw.polygon([(x / shrink + 2, y / shrink + 4) for x, y in ring], fill=255 - SHADOW)
        return small.filter(ImageFilter.GaussianBlur(BLUR)).resize(self._size)

    def _write(self, picture: Image, caption: str, films: str) -> None:
        """Caption and colour key along the foot, in Pillow's own font."""
        from PIL import ImageDraw, ImageFont

        width, height = self._size
        size = max(SMALLEST, round(height / 52))
        font = ImageFont.load_default(size)
        draw = ImageDraw.Draw(picture)
        x, y = round(0.03 * width), height - 2 * size
        lines = [""]
        for word in caption.split():
            longer = f"{lines[-1]} {word}".strip()
            if draw.textlength(longer, font=font) <= width - 2 * x:
                lines[-1] = longer
            else:
                lines.append(word)
        for above, line in enumerate(reversed(lines)):
            draw.text((x, y - (1.7 + 1.3 * above) * size), line, fill=INK, font=font)
        for tone, meaning in KEY:
            words = films if tone == "film" else meaning
            draw.rectangle((x, y, x + 1.6 * size, y + size), fill=COLOURS[tone], outline=INK)
            draw.text((x + 2.1 * size, y - 0.1 * size), words, fill=INK, font=font)
            x += round(3.6 * size + draw.textlength(words, font=font))


def keyhole(rings: Sequence[Sequence[Point]]) -> list[Point]:
    """One closed ring for a piece with holes: a slit joins each hole to the contour right of it."""
    merged = list(rings[0])
    for hole in sorted(rings[1:], key=lambda ring: -max(ring)[0]):
        first = max(range(len(hole)), key=lambda i: hole[i])
        x, y = hole[first]
        after, landing = _first_right_of(merged, x, y)
        turned = [*hole[first:], *hole[:first]]
        merged[after:after] = [landing, *turned, (x, y), landing]
    return merged


def _first_right_of(ring: Sequence[Point], x: float, y: float) -> tuple[int, Point]:
    """Return first point at which a ray to the right meets the ring, and the vertex after it."""
    best: tuple[float, int] | None = None
    for i, (x1, y1) in enumerate(ring):
        x0, y0 = ring[i - 1]
        if (y0 <= y) == (y1 <= y):
            continue
        meets = x0 + (x1 - x0) * (y - y0) / (y1 - y0)
        if meets >= x and (best is None or meets < best[0]):
            best = meets, i
    assert best is not None, "a hole lies inside its outer ring"
    return best[1], (best[0], y)


# Triangulated surfaces on a picture, nearest first: a depth buffer filled by sample points.


DENSITY = 1.45
"""Samples per pixel along a triangle's side: more than the root of 2, so none is missed."""
MOST = 4_000_000
"""Most samples in memory at once."""
AMBIENT = 0.58


class View(NamedTuple):
    """A parallel projection: mm to pixels, the three axes as rows (right, up, toward the eye)."""

    axes: NDArray[np.float64]
    scale: float
    centre: tuple[float, float]

    def flat(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) as pixels right and down, and mm toward the eye."""
        right, up, toward = (points @ self.axes.T).T
        x = self.centre[0] + self.scale * right
        y = self.centre[1] - self.scale * up
        return np.column_stack([x, y, toward])


class Buffer(NamedTuple):
    """For each pixel the depth, the number of the surface seen (-1: none), its face and light."""

    depth: NDArray[np.float64]
    body: NDArray[np.int16]
    face: NDArray[np.int32]
    light: NDArray[np.float64]


def view_of(
    surfaces: Sequence[Surface], elevation: float, azimuth: float, box: Sequence[float]
) -> View:
    """The view from an elevation over the bench and an azimuth from x, degrees, filling a box.

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


def rasterize(
    surfaces: Sequence[Surface],
    view: View,
    width: int,
    height: int,
    lamp: Sequence[float],
    normals: Sequence[NDArray[np.float64]] | None = None,
) -> Buffer:
    """Return the depth buffer of the surfaces; ``lamp`` is the direction to the light, in the view.

    Faces are lit one by one, or smoothly if ``normals`` (n, 3) of the points are given.
    """
    size = width * height
    buffer = Buffer(
        np.full(size, -np.inf),
        np.full(size, -1, dtype=np.int16),
        np.zeros(size, dtype=np.int32),
        np.zeros(size, dtype=np.float64),
    )
    for body, surface in enumerate(surfaces):
        smooth = None if normals is None else lit(normals[body] @ view.axes.T, np.array(lamp))
        _paint(buffer, body, surface, view, (width, height), np.array(lamp), smooth)
    return Buffer(
        buffer.depth.reshape(height, width),
        buffer.body.reshape(height, width),
        buffer.face.reshape(height, width),
        buffer.light.reshape(height, width),
    )


def _paint(
    buffer: Buffer,
    body: int,
    surface: Surface,
    view: View,
    size: tuple[int, int],
    lamp: NDArray[np.float64],
    smooth: NDArray[np.float64] | None,
) -> None:
    corners = view.flat(surface.points)[surface.faces]
    # Pixels count downward, so faces toward the eye run clockwise there.
    a, b, c = (corners[:, i, :2] for i in range(3))
    twice = (c - a)[:, 0] * (b - a)[:, 1] - (c - a)[:, 1] * (b - a)[:, 0]
    front = np.flatnonzero(twice > 1e-12)
    corners, twice = corners[front], twice[front]
    if smooth is None:
        light = np.repeat(_light(corners, view.scale, lamp)[:, None], 3, axis=1)
    else:
        light = smooth[surface.faces[front]]
    corners, light, long = _longest_first(corners, light)
    along = np.ceil(DENSITY * long).astype(np.int64) + 2
    across = np.ceil(DENSITY * twice / np.maximum(long, 1e-9)).astype(np.int64) + 2
    # Triangles of similar size are sampled together.
    grids = np.column_stack([_power_of_two(along), _power_of_two(across)])
    for n, m in np.unique(grids, axis=0):
        samples = np.flatnonzero((grids == (n, m)).all(axis=1))
        for part in np.array_split(samples, max(1, len(samples) * n * m // MOST)):
            seen_as = _Triangles(body, front[part], corners[part], light[part])
            _sample(buffer, seen_as, (int(n), int(m)), size)


def _light(
    corners: NDArray[np.float64], scale: float, lamp: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the light of a triangle, from its normal in the view (right, up, toward)."""
    true = corners * np.array([1 / scale, -1 / scale, 1.0])
    normal = np.cross(true[:, 1] - true[:, 0], true[:, 2] - true[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return lit(normal, lamp)


def lit(normals: NDArray[np.float64], lamp: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the light of faces with normals (n, 3) in the view: from AMBIENT to 1."""
    light: NDArray[np.float64] = AMBIENT + (1 - AMBIENT) * np.clip(normals @ lamp, 0, 1)
    return light


def _longest_first(
    corners: NDArray[np.float64], light: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Corners and their light, rotated so that the longest side comes first; its length in
    pixels.
    """
    sides = np.roll(corners, -1, axis=1)[:, :, :2] - corners[:, :, :2]
    lengths = np.hypot(sides[:, :, 0], sides[:, :, 1])
    first = lengths.argmax(axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(corners, order[:, :, None], axis=1)
    return turned, np.take_along_axis(light, order, axis=1), lengths.max(axis=1)


def _power_of_two(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    return 2 ** np.ceil(np.log2(counts)).astype(np.int64)


class _Triangles(NamedTuple):
    """Triangles of one surface: their numbers in it, corners (n, 3, 3) in the view, and light."""

    body: int
    face: NDArray[np.int64]
    corners: NDArray[np.float64]
    light: NDArray[np.float64]


def _sample(
    buffer: Buffer, corners: _Triangles, grid: tuple[int, int], size: tuple[int, int]
) -> None:
    """Points of each triangle: along its first side, and from there towards its third corner."""
    s = np.linspace(0, 1, grid[0])[None, :, None, None]
    t = np.linspace(0, 1, grid[1])[None, None, :, None]
    a, b, c = (corners.corners[:, i][:, None, None, :] for i in range(3))
    points = (1 - t) * (a + s * (b - a)) + t * c
    number = np.repeat(np.arange(len(corners.face)), grid[0] * grid[1])
    x, y, depth = points.reshape(-1, 3).T
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    inside = (column >= 0) & (column < size[0]) & (row >= 0) & (row < size[1])
    place = row[inside] * size[0] + column[inside]
    depth, number = depth[inside], number[inside]
    np.maximum.at(buffer.depth, place, depth)
    won = depth == buffer.depth[place]
    place, number = place[won], number[won]
    at = np.flatnonzero(inside)[won] % (grid[0] * grid[1])
    p, q = s.ravel()[at // grid[1]], t.ravel()[at % grid[1]]
    shares = np.stack([(1 - q) * (1 - p), (1 - q) * p, q], axis=-1)
    buffer.light[place] = (corners.light[number] * shares).sum(axis=1)
    buffer.face[place] = corners.face[number]
    buffer.body[place] = corners.body


# A bar of round length under a picture that is true to scale.


BAR_INK = (34, 34, 34)
BARS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)


def draw_length_bar(
    draw: Draw,
    right: float,
    y: float,
    widest: float,
    pixels_per_mm: float,
    font: FreeTypeFont | ImageFont,
) -> None:
    """A bar that ends at ``right``, at most ``widest`` pixels long, with its length in mm above."""
    bar = max(step for step in BARS if step * pixels_per_mm <= widest or step == BARS[0])
    start = right - bar * pixels_per_mm
    words = f"{bar:g} mm"
    draw.line((start, y, right, y), fill=BAR_INK, width=3)
    for tick in (start, right):
        draw.line((tick, y - 6, tick, y + 6), fill=BAR_INK, width=3)
    _, _, width, height = draw.textbbox((0, 0), words, font=font)
    draw.text(((start + right - width) / 2, y - height - 8), words, fill=BAR_INK, font=font)
