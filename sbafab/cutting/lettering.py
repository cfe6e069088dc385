"""Single-stroke letters, for labels engraved by a laser or read in a drawing.

Every glyph is drawn on a 4 by 6 grid: strokes separated by blanks, each a run of points, with one
digit for x and one for y.
"""

from __future__ import annotations

from collections.abc import Iterator

from sbafab.geometry.edges import Point

Stroke = tuple[Point, ...]

CAP_HEIGHT = 6
ADVANCE = 6
"""Grid steps from a letter to the next."""

GLYPHS = {
    "0": "011030414536160501 1135",
    "1": "152620 1030",
    "2": "05163645440040",
    "3": "05163645443342413010 1001 3313",
    "4": "3630 360242",
    "5": "4606043443413001",
    "6": "46160501103041423303",
    "7": "06461000",
    "8": "13030516364543331302011030414233",
    "9": "0030414536160504133343",
    "A": "000416364440 0343",
    "B": "000636454433033342413000",
    "C": "4536160501103041",
    "D": "00062644422000",
    "E": "46060040 0333",
    "F": "460600 0333",
    "G": "45361605011030414323",
    "H": "0006 4046 0343",
    "I": "1030 1636 2026",
    "J": "3631201001 1636",
    "K": "0006 460340",
    "L": "060040",
    "M": "0006234640",
    "N": "00064046",
    "O": "011030414536160501",
    "P": "000636454433 3303",
    "Q": "011030414536160501 2240",
    "R": "00063645443303 2340",
    "S": "453616050413334241301001",
    "T": "0646 2620",
    "U": "060110304146",
    "V": "062046",
    "W": "0610233046",
    "X": "0046 0640",
    "Y": "062346 2320",
    "Z": "06460040",
    "-": "1333",
    "+": "1333 2224",
    ".": "2021",
    ",": "2110",
    ":": "2122 2425",
    "/": "0046",
    "_": "0040",
    "#": "1016 3036 0242 0444",
    "=": "0242 0444",
}


def strokes(text: str, at: Point, height: float) -> tuple[Stroke, ...]:
    """Return the strokes of a line of text: lower left corner ``at``, capitals ``height`` mm high.

    Lower case letters become capitals; a character without a glyph leaves a gap.
    """
    step = height / CAP_HEIGHT
    return tuple(
        tuple((at[0] + (column + x) * step, at[1] + y * step) for x, y in points)
        for column, letter in zip(range(0, ADVANCE * len(text), ADVANCE), text.upper(), strict=True)
        for points in _points(GLYPHS.get(letter, ""))
    )


def width(text: str, height: float) -> float:
    """Return the length of a line of text, mm."""
    return max(0, ADVANCE * len(text) - 2) * height / CAP_HEIGHT


def _points(glyph: str) -> Iterator[list[tuple[int, int]]]:
    for run in glyph.split():
        yield [(int(run[i]), int(run[i + 1])) for i in range(0, len(run), 2)]
