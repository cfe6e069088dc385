"""A canvas of few flat colours, painted enlarged and reduced at the end (Pillow)."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Literal

from sbafab.geometry.edges import Point

if TYPE_CHECKING:
    from PIL.Image import Image

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
"""What the colours are, in the picture's foot and beside it on a page."""
LEVELS = 60
PAPER = (255, 255, 255)
INK = (40, 44, 50)
SHADOW = 70
SMALLEST = 15
"""Pixels of the words, at least: a picture on a page is often shown smaller than it is."""
BLUR = 8
STRIP = 64
"""Rows of the picture that are reduced at once: enlarged and in full colour they are large."""


class Canvas:
    """Painted later covers painted earlier. One byte a pixel keeps the fills fast."""

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
        # What nothing is painted on is backdrop.
        whole = self._enlarged
        left, top, right, bottom = self._image.getbbox() or (0, 0, *self._image.size)
        last = -(-bottom // whole)
        for row in range(top // whole, last, STRIP):
            strip = left // whole, row, -(-right // whole), min(row + STRIP, last)
            picture.paste(self._reduced(strip, picture.crop(strip)), strip[:2])
        self._write(picture, caption, films)
        out = BytesIO()
        picture.save(out, "PNG", compress_level=6)
        return out.getvalue()

    def _reduced(self, box: tuple[int, int, int, int], behind: Image) -> Image:
        """What is painted within the ``box`` of the picture, over what lies ``behind`` it there."""
        from PIL import ImageChops

        whole = self._enlarged
        left, top, right, bottom = box
        inside = self._image.crop((whole * left, whole * top, whole * right, whole * bottom))
        painted = inside.convert("RGB").reduce(whole)
        empty = inside.point([255] + [0] * 255, "L").reduce(whole).convert("RGB")
        # Where the canvas is empty it is white: taking off what the backdrop lacks of white,
        # in proportion, leaves no bright rim round the solid.
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
        for tone, said in KEY:
            words = films if tone == "film" else said
            draw.rectangle((x, y, x + 1.6 * size, y + size), fill=COLOURS[tone], outline=INK)
            draw.text((x + 2.1 * size, y - 0.1 * size), words, fill=INK, font=font)
            x += round(3.6 * size + draw.textlength(words, font=font))


def keyhole(rings: Sequence[Sequence[Point]]) -> list[Point]:
    """One closed ring for a piece with holes: each hole joined by a slit to what is right of it."""
    merged = list(rings[0])
    for hole in sorted(rings[1:], key=lambda ring: -max(ring)[0]):
        first = max(range(len(hole)), key=lambda i: hole[i])
        x, y = hole[first]
        after, landing = _first_right_of(merged, x, y)
        turned = [*hole[first:], *hole[:first]]
        merged[after:after] = [landing, *turned, (x, y), landing]
    return merged


def _first_right_of(ring: Sequence[Point], x: float, y: float) -> tuple[int, Point]:
    """Where a ray to the right first meets the ring, and the index of the vertex after it."""
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
