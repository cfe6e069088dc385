"""Seams and folds on the technician's pages, in order among the press steps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.cutting.seam_files import seam_path, shift_words
from sbafab.geometry.edges import Bounds, Point, box_round
from sbafab.geometry.region import Region, chain_data, coord, path_data, union
from sbafab.laminate.films import ink
from sbafab.laminate.folding import distance_from, unfolded
from sbafab.laminate.joints import Fold, Seam
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.pressing.schedule import FoldStep, SeamStep
from sbafab.reports import drawing as draw
from sbafab.reports.traveller.lay_up import EQUAL
from sbafab.reports.traveller.shapes import Picture, flat, label
from sbafab.reports.traveller.work import Work

WIDEST = 90.0
"""Longer side of a picture on the page, mm."""
RIM, PAST_FOLD, NUMBER = 5.0, 3.0, 3.5
"""mm on the page: free round a picture, of a fold line past the part, and letters of numbers."""
START = 0.9
"""mm on the page: radius of the dot where a path begins."""
SEAM_INK, PATH_INK = "#d1495b", "#1a1a1a"


@dataclass(frozen=True)
class SeamPage:
    """A seam on the page.

    ``start`` of its path is mm to the right of and above the lower left corner of the films as they
    lie. ``lays`` are the layers laid for it, each with whether the work so far is laid on it;
    ``held`` is the highest layer of that work. ``offset`` is the tool's from its machine's head.
    """

    step: SeamStep
    path: str
    start: Point
    lays: list[tuple[Layer, bool]]
    held: int
    offset: Point | None
    shift: str
    picture: str


@dataclass(frozen=True)
class FoldPage:
    """A fold on the page: its lower half, the masks in it, and the film unfolded."""

    step: FoldStep
    lower: Layer
    masks: range
    opened: Opened
    picture: str


def joint_pages(work: Work) -> list[SeamPage | FoldPage]:
    """Return the seams and folds of a laminate, by step number."""
    pages: list[SeamPage | FoldPage] = [*_seams(work), *_folds(work)]
    return sorted(pages, key=lambda page: page.step.step)


def _seams(work: Work) -> Iterator[SeamPage]:
    laminate = work.laminate
    by_name = {seam.name: seam for seam in laminate.seams}
    for step in work.schedule.seams:
        seam = by_name[step.seam]
        held = [index for index in step.layers if index not in step.adds]
        adds = sorted(step.adds, reverse=step.from_below)
        is_under = bool(held) and not step.from_below
        offset = work.design.seam_offsets.get(seam.tool)
        yield SeamPage(
            step,
            seam_path(seam),
            _start(laminate, step, seam),
            [(laminate.layer(index), is_under and index < min(held)) for index in adds],
            max(held, default=0),
            offset,
            "" if offset is None else shift_words(seam.tool, offset),
            _picture(laminate, step, seam),
        )


def _start(laminate: Laminate, step: SeamStep, seam: Seam) -> Point:
    x, y = seam.path[0][0].start
    low_x, low_y, high_x, _ = _box([laminate.layer(index).profile for index in step.layers])
    return (high_x - x if step.from_below else x - low_x), y - low_y


def _folds(work: Work) -> Iterator[FoldPage]:
    by_layers = {(fold.lower, fold.upper): fold for fold in work.laminate.folds}
    for step in work.schedule.folds:
        opened = _opened(work.laminate, by_layers[step.layers])
        lower, upper = step.layers
        picture = _fold_picture(work.laminate, opened, f"fold-{step.step}")
        half, masks = work.laminate.layer(lower), range(lower + 1, upper)
        yield FoldPage(step, half, masks, opened, picture)


class Opened(NamedTuple):
    """Two halves of a film unfolded about their fold line, which runs along x through (0, 0).

    The lower half lies above the line on the page. ``lengths`` are of the lower and the upper half,
    perpendicular to the line, mm; ``ends`` describe where they end.
    """

    fold: Fold
    halves: tuple[Region, Region]
    lengths: tuple[float, float]
    ends: tuple[str, str]


def _opened(laminate: Laminate, fold: Fold) -> Opened:
    (x0, y0), (x1, y1) = fold.line
    degrees = math.degrees(math.atan2(y1 - y0, x1 - x0))
    lower, upper = (laminate.layer(index).profile for index in (fold.lower, fold.upper))
    flat = lower, unfolded(upper, [fold.line])
    above, below = (half.moved(-x0, -y0).turned(-degrees) for half in flat)
    lengths = above.bounds[3], -below.bounds[1]
    tabs = [distance_from(fold.line, inlet.mouth) for inlet in laminate.inlets]

    def end(index: int, length: float) -> str:
        is_tab = any(abs(length - tab) < EQUAL for tab in tabs)
        return f"the tab's end of half {index}" if is_tab else f"the far edge of half {index}"

    ends = end(fold.lower, lengths[0]), end(fold.upper, lengths[1])
    return Opened(fold, (above, below), lengths, ends)


def _fold_picture(laminate: Laminate, opened: Opened, name: str) -> str:
    """Return the flat part from above: a dash-dot fold line, both halves' numbers and lengths."""
    low_x, low_y, high_x, high_y = _box(opened.halves)
    scale = min(WIDEST / max(high_x - low_x, high_y - low_y), 4.0)
    width, height = scale * (high_x - low_x) + 4 * RIM, scale * (high_y - low_y) + 2 * RIM
    words = f"flat part of halves {opened.fold.lower} and {opened.fold.upper}, fold line dash-dot"
    picture = Picture(name, width, height, words)

    def at(x: float, y: float) -> Point:
        return RIM + scale * (x - low_x), RIM + scale * (high_y - y)

    colours = ink(laminate.layer(opened.fold.lower).film)
    matrix = " ".join(map(coord, flat(scale, at(0.0, 0.0))))
    moved = f'transform="matrix({matrix})"'
    picture.add(
        *(
            draw.path(path_data(half), f"{draw.style(fill=colours.fill)} {moved}")
            for half in opened.halves
        ),
        draw.path(
            path_data(union(opened.halves)), f"{draw.style(colours.line, 0.22 / scale)} {moved}"
        ),
    )
    (left, y), (right, _) = at(low_x, 0.0), at(high_x, 0.0)
    ends = f"M{coord(left - PAST_FOLD)} {coord(y)}L{coord(right + PAST_FOLD)} {coord(y)}"
    picture.add(draw.path(ends, draw.fold_style()))
    numbers = opened.fold.lower, opened.fold.upper
    for number, way, length in zip(numbers, (1, -1), opened.lengths, strict=True):
        middle = (low_x + high_x) / 2
        picture.add(label(at(middle, way * length / 2), f"half {number}", NUMBER))
        far = at(high_x, way * length)
        tips = (far, (right, y)) if way > 0 else ((right, y), far)
        picture.add(*draw.dimension(*tips, f"{length:.1f}", (1.0, 0.0), RIM))
    return picture.svg()


def _box(regions: Sequence[Region]) -> Bounds:
    return box_round([region.bounds for region in regions])


def _picture(laminate: Laminate, step: SeamStep, seam: Seam) -> str:
    """Return the films as they lie, the seam at its width, and its path."""
    stack = [laminate.layer(index) for index in step.layers]
    words = f"Seam {step.seam} {'from below, turned over' if step.from_below else 'from above'}"
    low_x, low_y, high_x, high_y = _box([*(layer.profile for layer in stack), seam.region])
    margin = 0.03 * max(high_x - low_x, high_y - low_y)
    width, height = high_x - low_x + 2 * margin, high_y - low_y + 2 * margin
    scale = min(WIDEST / max(width, height), 4.0)
    films = "".join(
        f'<path d="{path_data(layer.profile)}" fill="{ink(layer.film).fill}" fill-opacity="0.45" '
        f'stroke="{ink(layer.film).line}"/>'
        for layer in stack
    )
    path = "".join(chain_data(chain) for chain in seam.path)
    x, y = map(coord, seam.path[0][0].start)
    left, over = (-high_x, -1) if step.from_below else (low_x, 1)
    box = " ".join(map(coord, (left - margin, -high_y - margin, width, height)))
    return (
        f'<svg class="picture" role="img" aria-label="{words}" viewBox="{box}" '
        f'width="{coord(width * scale)}mm" height="{coord(height * scale)}mm">'
        f'<g transform="scale({over} -1)" fill-rule="evenodd" stroke-width="{coord(0.2 / scale)}">'
        f'{films}<path d="{path_data(seam.region)}" fill="{SEAM_INK}" fill-opacity="0.5"/>'
        f'<path d="{path}" fill="none" stroke="{PATH_INK}"/>'
        f'<circle cx="{x}" cy="{y}" r="{coord(START / scale)}" fill="{PATH_INK}"/></g></svg>'
    )
