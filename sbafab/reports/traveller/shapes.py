"""Shared parts of the page's pictures: pattern outlines, labels, rounds of layers, steps' stacks.

Pictures are inline SVG in millimetres. Masks are hatched as well as coloured, so that they differ
from structural films in a grey print.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region, coord, path_data
from sbafab.laminate.films import Film, Ink, ink
from sbafab.laminate.laminate import Inlet, Laminate, Layer
from sbafab.laminate.lay_up import LayUpStep, distinct_layers
from sbafab.markup import escape, quoteattr
from sbafab.reports import drawing as draw

LINE = 0.22
"""Width of a part's outline on the page, mm."""
THUMB = (24.0, 12.5)
HATCH_STEP = 1.3
PLATE = "#f1f1ef"


def definitions(regions: Iterable[tuple[str, Region]]) -> str:
    """Return the outlines that pictures refer to by id, in a picture of zero size."""
    paths = (
        f'<path id="{name}" d="{path_data(region)}" fill-rule="evenodd"/>'
        for name, region in regions
    )
    return (
        '<svg width="0" height="0" class="shapes" aria-hidden="true"><defs>'
        f"{''.join(paths)}</defs></svg>"
    )


def pattern_id(pattern: str, is_flat: bool = False) -> str:
    """Return the id of a pattern's outline, or of the part cut folded out or turned over; "A P03"
    has a space, which ids must not have.
    """
    return f"shape-{pattern.replace(' ', '-')}{'-flat' if is_flat else ''}"


def pattern_regions(laminate: Laminate) -> Iterable[tuple[str, Region]]:
    for pattern, layers in laminate.patterns.items():
        yield pattern_id(pattern), layers[0].profile
        is_folded = any(fold.lower == layers[0].index for fold in laminate.folds)
        if is_folded or layers[0].turned:
            yield pattern_id(pattern, is_flat=True), laminate.as_cut(layers[0])


class Picture:
    """An inline SVG under construction: its elements in drawing order, and its hatch.

    ``name`` is unique on the page; ``words`` are its text alternative.
    """

    def __init__(self, name: str, width: float, height: float, words: str) -> None:
        self.name = name.replace(" ", "-")
        self.width, self.height, self.words = width, height, words
        self._elements: list[str] = []
        self._hatches: dict[tuple[float, Ink], str] = {}

    def add(self, *elements: str) -> None:
        self._elements += elements

    def part(self, shape: str, film: Film, matrix: tuple[float, ...], look: str) -> None:
        """Add a shape by its id; ``matrix`` maps its frame to the page, ``look`` is fresh, made
        (both opaque) or clear.
        """
        scale = abs(matrix[0]) or abs(matrix[1])
        fill = "#e4e7ea" if look == "made" else self._fill(film, scale)
        opacity = ' fill-opacity="0.6"' if look == "clear" else ""
        moved = " ".join(map(coord, matrix))
        self.add(
            f'<use href="#{shape}" transform="matrix({moved})" fill="{fill}"{opacity} '
            f'stroke="{ink(film).line}" stroke-width="{coord(LINE / scale)}"/>'
        )

    def plate(self, plate: Region, matrix: tuple[float, ...], is_used: bool = True) -> None:
        """Add the base plate; dashed if it is not used, as it still shows the orientation."""
        scale, moved = matrix[0], " ".join(map(coord, matrix))
        dash = "" if is_used else f' stroke-dasharray="{coord(1.6 / scale)} {coord(1.2 / scale)}"'
        self.add(
            f'<path d="{path_data(plate)}" fill="{PLATE if is_used else "none"}" '
            f'fill-rule="evenodd" stroke="{draw.GREY}" stroke-width="{coord(0.25 / scale)}"{dash} '
            f'transform="matrix({moved})"/>'
        )

    def _fill(self, film: Film, scale: float) -> str:
        colours = ink(film)
        if not film.is_mask:
            return colours.fill
        self._hatches.setdefault((scale, colours), f"hatch-{self.name}-{len(self._hatches) + 1}")
        return f"url(#{self._hatches[scale, colours]})"

    def svg(self) -> str:
        w, h = coord(self.width), coord(self.height)
        hatches = "".join(
            _hatch(name, scale, colours) for (scale, colours), name in self._hatches.items()
        )
        return (
            f'<svg class="picture" role="img" aria-label={quoteattr(self.words)} '
            f'width="{w}mm" height="{h}mm" viewBox="0 0 {w} {h}" font-family="{draw.FONT}" '
            f'font-size="{coord(draw.TEXT)}" fill="{draw.DARK}">'
            f"<defs>{hatches}</defs>{''.join(self._elements)}</svg>"
        )


def _hatch(name: str, scale: float, colours: Ink) -> str:
    """Return a hatch of oblique lines, equally dense on the page at every scale."""
    turned = f"rotate(45) scale({coord(1 / scale)})"
    step = coord(HATCH_STEP)
    return (
        f'<pattern id="{name}" patternUnits="userSpaceOnUse" width="{step}" height="{step}" '
        f'patternTransform="{turned}"><rect width="{step}" height="{step}" fill="{colours.fill}"/>'
        f'<rect width="0.18" height="{step}" fill="{colours.line}" fill-opacity="0.6"/></pattern>'
    )


def flat(scale: float, at: Point) -> tuple[float, ...]:
    """Return the matrix of a plan view: the part's origin is at ``at`` on the page, y upward."""
    return scale, 0.0, 0.0, -scale, at[0], at[1]


def label(at: Point, words: str, size: float = draw.SMALL) -> str:
    """Return text over a drawing, with a white rim for legibility."""
    x, y = map(coord, at)
    return (
        f'<text x="{x}" y="{y}" font-size="{coord(size)}" text-anchor="middle" stroke="#ffffff" '
        f'stroke-width="{coord(size / 4)}" stroke-linejoin="round" paint-order="stroke" '
        f'fill="{draw.DARK}">{escape(words)}</text>'
    )


def thumbnail(pattern: str, is_flat: bool, film: Film, bounds: Bounds) -> str:
    """Return a small picture of a pattern, as it is cut."""
    low_x, low_y, high_x, high_y = bounds
    scale = min((THUMB[0] - 1) / (high_x - low_x), (THUMB[1] - 1) / (high_y - low_y))
    picture = Picture(f"thumb-{pattern}", *THUMB, f"outline of pattern {pattern}")
    middle = (low_x + high_x) / 2, (low_y + high_y) / 2
    at = THUMB[0] / 2 - scale * middle[0], THUMB[1] / 2 + scale * middle[1]
    picture.part(pattern_id(pattern, is_flat), film, flat(scale, at), "fresh")
    return picture.svg()


# Rounds: layers that repeat, named once and counted.


LONGEST_ROUND = 12
INSIDE = 0.1
"""Distance inward of its mouth at which a tab is searched, mm."""


@dataclass(frozen=True)
class Round:
    """Layers that are laid repeatedly in one order; ``turns`` holds every turn."""

    turns: tuple[tuple[Layer, ...], ...]

    @property
    def count(self) -> int:
        return len(self.turns)

    @property
    def first(self) -> Layer:
        return self.turns[0][0]

    @property
    def last(self) -> Layer:
        return self.turns[-1][-1]

    @property
    def places(self) -> tuple[tuple[Layer, ...], ...]:
        """The layers of all turns at the same place in the round."""
        return tuple(zip(*self.turns, strict=True))

    @property
    def layers(self) -> tuple[Layer, ...]:
        return tuple(layer for turn in self.turns for layer in turn)


def rounds(layers: Sequence[Layer]) -> tuple[Round, ...]:
    """Return the layers in order, repetitions grouped; a layer without repetition is a round of
    one.
    """
    keys = [(layer.pattern, layer.role) for layer in layers]
    gathered: list[Round] = []
    start = 0
    while start < len(layers):
        period, count = _repetition(keys[start : start + len(keys)])
        turns = tuple(
            tuple(layers[start + turn * period : start + (turn + 1) * period])
            for turn in range(count)
        )
        gathered.append(Round(turns))
        start += period * count
    return tuple(gathered)


def _repetition(keys: Sequence[object]) -> tuple[int, int]:
    """Return period and count of the longest repetition at the start; (1, 1) without one."""
    best = 1, 1
    for period in range(1, min(LONGEST_ROUND, len(keys) // 2) + 1):
        count = 1
        while keys[count * period : (count + 1) * period] == keys[:period]:
            count += 1
        if count > 1 and count * period > best[0] * best[1]:
            best = period, count
    return best


@dataclass(frozen=True)
class Bed:
    """One of the stacks that a step lays on each other; ``made_in`` is the step that made it.

    Single layers come off the sheet: ``made_in`` is None.
    """

    layers: tuple[int, ...]
    made_in: int | None


def beds(steps: Sequence[LayUpStep], step: LayUpStep) -> tuple[Bed, ...]:
    """Return the stacks of a step, lowest first."""
    before = [earlier for earlier in steps if earlier.number < step.number]
    stacks = []
    for stack in step.stacks:
        maker = next((e.number for e in reversed(before) if set(e.layers) == set(stack)), None)
        stacks.append(Bed(stack, maker))
    return tuple(stacks)


def inlets_in(laminate: Laminate, layers: Sequence[int]) -> tuple[Inlet, ...]:
    """Return the inlets whose tab is part of at least one of the layers."""
    shapes = [layer.profile for layer in distinct_layers(laminate, layers)]
    return tuple(
        inlet
        for inlet in laminate.inlets
        if any(
            shape.contains(
                (
                    inlet.mouth[0] - INSIDE * inlet.direction[0],
                    inlet.mouth[1] - INSIDE * inlet.direction[1],
                )
            )
            for shape in shapes
        )
    )
