"""The label that is engraved into a sheet's border, where parts and pins leave room for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.cutting.lettering import Stroke, strokes, width
from sbafab.geometry.edges import Bounds, Point
from sbafab.nesting.records import Stock

LETTERS = 4.0
"""Most height of engraved letters in mm."""
LEAST_LETTERS = 1.5
MOST_LINES = 3
PITCH = 1.4
"""From line to line, in heights of a letter."""
ONE_LINE, SEVERAL_LINES = 0.5, 0.7
"""Share of the border's width that a line, or several, may take."""


class _Margin(NamedTuple):
    """A strip of border: its reading direction runs from ``corner`` along x, or along y upward.

    Lines are ``room`` long at most and stand over each other away from ``corner``.
    """

    corner: Point
    upward: bool
    room: float

    def at(self, p: Point) -> Point:
        (x, y), (u, v) = self.corner, p
        return (x - v, y + u) if self.upward else (x + u, y + v)


def label(text: str, stock: Stock, length: float) -> tuple[Stroke, ...]:
    """The strokes of a sheet's label; none where its border has no room.

    In one line along the lower edge if it can, else along another, else in up to three lines.
    """
    for count in range(1, MOST_LINES + 1):
        lines = _wrapped(text, count)
        for margin in _margins(stock, length):
            written = _written(lines, margin, stock)
            if written:
                return written
    return ()


def _margins(stock: Stock, length: float) -> Iterator[_Margin]:
    """The border's four strips: below, left, above, right."""
    edge = stock.border
    along, up = stock.width - 2 * edge, length - 2 * edge
    yield _Margin((edge, 0.0), False, along)
    yield _Margin((edge, edge), True, up)
    yield _Margin((edge, length - edge), False, along)
    yield _Margin((stock.width, edge), True, up)


def _written(lines: Sequence[str], margin: _Margin, stock: Stock) -> tuple[Stroke, ...]:
    longest = max(width(line, 1.0) for line in lines)
    block = 1 + PITCH * (len(lines) - 1)
    share = ONE_LINE if len(lines) == 1 else SEVERAL_LINES
    height = min(LETTERS, share * stock.border / block, margin.room / max(longest, 1e-9))
    if height < LEAST_LETTERS:
        return ()
    low = (stock.border - height * block) / 2
    ends = margin.at((0.0, low)), margin.at((height * longest, low + height * block))
    if not all(_is_clear(ends, pin) for pin in stock.pins):
        return ()
    rows = [low + height * PITCH * row for row in reversed(range(len(lines)))]
    return tuple(
        tuple(map(margin.at, stroke))
        for line, row in zip(lines, rows, strict=True)
        for stroke in strokes(line, (0.0, row), height)
    )


def _is_clear(ends: tuple[Point, Point], pin: tuple[float, float, float]) -> bool:
    """Whether the box between two corners keeps off a pin's."""
    low_x, low_y, high_x, high_y = _box(ends)
    x, y, r = pin[0], pin[1], pin[2] / 2
    return x + r < low_x or x - r > high_x or y + r < low_y or y - r > high_y


def _box(ends: tuple[Point, Point]) -> Bounds:
    (ax, ay), (bx, by) = ends
    return min(ax, bx), min(ay, by), max(ax, bx), max(ay, by)


def _wrapped(text: str, count: int) -> list[str]:
    """The text in at most so many lines, the longest as short as words allow."""
    words = text.split()
    for most in range(max(map(len, words)), len(text) + 1):
        lines = [words[0]]
        for word in words[1:]:
            if len(lines[-1]) + 1 + len(word) <= most:
                lines[-1] += f" {word}"
            else:
                lines.append(word)
        if len(lines) <= count:
            return lines
    return [text]
