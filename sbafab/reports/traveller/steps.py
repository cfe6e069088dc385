"""The steps in order: layers and the edges they are laid along, pins, seams, folds, settings."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import Any, Literal, NamedTuple

from sbafab.cutting.layer_files import seam_path, shift_words
from sbafab.geometry.edges import Arc, Bounds, Point, box_round
from sbafab.geometry.region import Region, chain_data, coord, path_data, union
from sbafab.laminate.films import FIRST, ink
from sbafab.laminate.folding import distance_from, unfolded
from sbafab.laminate.joints import Fold, Seam
from sbafab.laminate.laminate import Inlet, Laminate, Layer
from sbafab.laminate.lay_up import (
    LayUpStep,
    distinct_layers,
    lay_up_steps,
    press_steps,
    stack_count,
)
from sbafab.pressing.cycles import cycle_name
from sbafab.pressing.dowels import PinSetting
from sbafab.pressing.plate_heating import PATIENCE
from sbafab.pressing.press_force import PAD
from sbafab.pressing.schedule import FoldStep, SeamStep, Step
from sbafab.reports import drawing as draw
from sbafab.reports.prints import guides
from sbafab.reports.traveller.bench import punch
from sbafab.reports.traveller.lay_up import (
    EQUAL,
    Alignment,
    Bed,
    PiecePlace,
    Round,
    Things,
    beds,
    inlets_in,
    over_tab,
    pitch,
    places,
    rounds,
)
from sbafab.reports.traveller.materials import TAPE, has_underlay, turns_over
from sbafab.reports.traveller.pictures import Picture, exploded, flat, plan
from sbafab.reports.traveller.work import Work

MOST_LINES = 12  # up to this many single layers each has its own line, and cycles their own box
SETTLED = 1e-6  # mm: a turn moves no edge that is as near as this to a circle around its pin

HandTask = Literal["none", "turn", "lay"]
"""The hand's task for a layer on its pins: none, its angle, its place."""


class ByEye(NamedTuple):
    """The hand's task for layers of a pattern, and the edge to lay them along; ``layers`` are named
    if others of that pattern lie along other edges.
    """

    hand: HandTask
    pattern: str
    edge: Alignment | None
    layers: list[int]


class Lay(NamedTuple):
    """Layers laid in one action: a round that repeats, many without repetition, or one."""

    turns: list[Round]
    by_eye: list[ByEye]

    @property
    def layers(self) -> list[Layer]:
        return [layer for turn in self.turns for layer in turn.layers]


@dataclass(frozen=True)
class PressPage:
    """A press step as its page, and its row on the first page, show it."""

    work: Work
    part: LayUpStep
    step: Step

    @property
    def is_whole(self) -> bool:
        return len(self.part.layers) == len(self.work.laminate.layers)

    @cached_property
    def beds(self) -> tuple[Bed, ...]:
        return beds(lay_up_steps(self.work.laminate), self.part)

    @cached_property
    def things(self) -> Things:
        return Things(self.work.laminate, self.beds)

    @property
    def is_loose(self) -> bool:
        return _is_loose(self.work, self.part)

    @property
    def left_out(self) -> list[tuple[tuple[int, ...], int]]:
        """The stacks of earlier steps that bond nothing, and the numbers of those steps."""
        steps = press_steps(self.work.laminate)
        loose = {part.layers: part.number for part in steps if _is_loose(self.work, part)}
        return [(stack, loose[stack]) for stack in self.part.stacks if stack in loose]

    @property
    def bonds_others(self) -> bool:
        """True for a full bond of drawn films other than TPE."""
        films = [self.work.laminate.layer(index).film for index in self.part.layers]
        has_tpe = any(film.material == FIRST[0] for film in films)
        return self.part.bond == "full" and self.work.design.form.is_drawn and not has_tpe

    @property
    def stacks(self) -> int:
        return stack_count(self.work.laminate, self.part.layers)

    @property
    def height(self) -> float:
        """Height of the films as bought, mm."""
        return sum(self.work.laminate.layer(i).film.thickness for i in self.part.layers)

    @property
    def inlets(self) -> tuple[Inlet, ...]:
        return inlets_in(self.work.laminate, self.part.layers)

    @property
    def printed(self) -> list[str]:
        """The patterns whose edges the underlay shows in this step; empty without one.

        A print is used for one hot cycle: paper dries and shrinks, and lines wear.
        """
        laminate, number = self.work.laminate, self.part.number
        return [p for guide in guides(laminate) if number in guide.steps for p in guide.patterns]

    @cached_property
    def places(self) -> list[PiecePlace]:
        return places(self.work.laminate, self.part, self.beds)

    @property
    def pitch(self) -> float | None:
        return pitch(self.places)

    @property
    def pins(self) -> list[tuple[list[str], PinSetting]]:
        """The names of equal pins, and one pin of each kind."""
        groups: dict[PinSetting, list[str]] = {}
        for pin in sorted(self.step.pin_settings, key=lambda pin: (pin.diameter_mm, pin.length_mm)):
            groups.setdefault(replace(pin, pin=""), []).append(pin.pin)
        return [(names, pin) for pin, names in groups.items()]

    @property
    def punches(self) -> list[tuple[float, float, float]]:
        """Diameter and seat of the pins of each size, and the diameter of their punch, mm."""
        sizes = sorted({(pin.diameter_mm, pin.seat_mm) for pin in self.step.pin_settings})
        return [(diameter, seat, punch(diameter)) for diameter, seat in sizes]

    @property
    def foam(self) -> float:
        """Thickness in mm of the soft support while pins are pushed out; 0 if the pad will do."""
        pins, step = self.step.pin_settings, self.step
        out = max(pin.stands_mm + pin.tolerance_mm - step.top_mm + pin.seat_mm for pin in pins)
        pad = next(item.thickness_mm for item in step.build_up if item.part == PAD)
        return 0.0 if pad > out else out + 1

    @property
    def plan(self) -> str:
        return plan(self.work.laminate, self.part, self.beds, f"plan-{self.step.step}")

    @property
    def exploded(self) -> str:
        return exploded(self.work.laminate, self.part, self.beds, f"exploded-{self.step.step}")

    def edge(self, index: int) -> Alignment | None:
        """Return what a layer, or a stack by its lowest, is aligned with; None if it is lowest."""
        return None if self.things.is_lowest(index) else self.things.alignment(index)

    def stacks_of(self, bed: Bed) -> int:
        return stack_count(self.work.laminate, bed.layers)

    def over_tab(self, bed: Bed) -> Layer | None:
        return over_tab(self.work.laminate, bed.layers)

    def lays(self, bed: Bed) -> Iterator[Lay]:
        """Yield the actions that lay single layers."""
        turns = rounds([self.work.laminate.layer(index) for index in bed.layers])
        for repeats, group in groupby(turns, key=lambda turn: turn.count > 1):
            batch = list(group)
            is_many = not repeats and len(batch) > MOST_LINES
            for together in [batch] if is_many else [[turn] for turn in batch]:
                layers = [layer for turn in together for layer in turn.layers]
                yield Lay(together, self._by_eye(layers) if self.part.pins else [])

    def _by_eye(self, layers: Sequence[Layer]) -> list[ByEye]:
        """Return what a hand decides about layers that no pin in the plate holds, or one alone."""
        things = self.things
        hands = {layer.pattern: self._hand(layer) for layer in layers}
        # A pattern may lie on a larger film here and on a smaller one there.
        tasks: dict[tuple[str, Alignment | None], ByEye] = {}
        for layer in layers:
            # The lowest layer on a step's only pin sets the angle that the others are aligned to.
            gives_the_angle = len(self.part.pins) == 1 and things.is_lowest(layer.index)
            hand = hands[layer.pattern]
            if hand == "lay" or (hand == "turn" and not gives_the_angle):
                edge = things.alignment(layer.index)
                key = layer.pattern, None if edge is None else edge._replace(numbers=(0, 0))
                tasks.setdefault(key, ByEye(hand, layer.pattern, edge, []))
                tasks[key].layers.append(layer.index)
        edges = Counter(pattern for pattern, _ in tasks)
        return [
            by_eye if edges[pattern] > 1 else by_eye._replace(layers=[])
            for pattern in edges
            for by_eye in tasks.values()
            if by_eye.pattern == pattern
        ]

    def _hand(self, layer: Layer) -> HandTask:
        """Return what the hand decides about a layer; a disc turned on its pin is unchanged."""
        laminate = self.work.laminate
        pins = [pin for pin in self.part.pins if pin in laminate.pins_holding(layer)]
        if not pins:
            return "lay"
        for outline in (Region(piece.outers) for piece in layer.profile.pieces):
            inside = [pin for pin in pins if outline.contains(pin.centre)]
            if len(inside) == 1 and not all(
                isinstance(edge, Arc) and math.dist(edge.centre, inside[0].centre) <= SETTLED
                for edge in outline.edges
            ):
                return "turn"
        return "none"


def step_pages(work: Work) -> list[PressPage]:
    """Return the press steps in order."""
    steps = zip(press_steps(work.laminate), work.schedule.steps, strict=True)
    return [PressPage(work, part, step) for part, step in steps]


def step_rows(work: Work) -> list[PressPage | SeamStep | FoldStep]:
    """Return presses, seams and folds by number."""
    rows: dict[int, PressPage | SeamStep | FoldStep] = {p.step.step: p for p in step_pages(work)}
    rows |= {seam.step: seam for seam in work.schedule.seams}
    rows |= {fold.step: fold for fold in work.schedule.folds}
    return [rows[number] for number in sorted(rows)]


def _is_loose(work: Work, part: LayUpStep) -> bool:
    """Return True for a flash bond of one drawn film and masks without pins."""
    films = [index for index in part.layers if not work.laminate.layer(index).is_mask]
    is_held = part.bond != "flash" or bool(part.pins) or len(films) > 1
    return work.design.form.is_drawn and not is_held


def every_step(work: Work) -> dict[str, Any]:
    """Return the facts common to all press steps; ``build_ups`` are the kinds of build-up, each
    with the numbers of its steps.
    """
    steps = work.schedule.steps
    if not steps:
        return {"press": None}
    tau = work.schedule.heating.time_constant_minutes
    papered = [step for step in steps if has_underlay(step)]
    kinds: dict[tuple[bool, bool], list[Step]] = {}
    for step in steps:
        kinds.setdefault((bool(step.pin_settings), has_underlay(step)), []).append(step)
    cycles = [f"cycle {cycle_name(n)}" for n in range(1, work.cycles.count + 1)]
    return {
        "press": steps[0],
        "heating": work.schedule.heating,
        "parts": {item.part: item for item in steps[-1].build_up},
        "papered": [str(step.step) for step in papered],
        "papered_pins": any(step.pin_settings for step in papered),
        "tape": TAPE,
        "is_pinned": turns_over(work),
        "masks_on_pins": {
            bool(part.pins)
            for part in press_steps(work.laminate)
            if any(layer.is_mask for layer in distinct_layers(work.laminate, part.adds))
        },
        "patience": PATIENCE,
        "patience_minutes": None if tau is None else PATIENCE * tau,
        "build_ups": [([step.step for step in same], same[0]) for same in kinds.values()],
        "cycles": cycles if 1 < len(cycles) <= MOST_LINES else [],
    }


# Seams and folds.


WIDEST = 90.0  # longer side of a picture on the page, mm
RIM, PAST_FOLD, NUMBER = 5.0, 3.0, 3.5
"""mm on the page: free round a picture, of a fold line past the part, and letters of numbers."""
START = 0.9  # mm on the page: radius of the dot where a path begins
SEAM_INK = "#d1495b"


class SeamPage(NamedTuple):
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


class FoldPage(NamedTuple):
    """A fold on the page: its lower half, the masks in it, and the film unfolded: the lengths of
    the lower and the upper half perpendicular to the line, mm, and their ends in text.
    """

    step: FoldStep
    lower: Layer
    masks: range
    lengths: tuple[float, float]
    ends: list[str]
    picture: str


def joint_pages(work: Work) -> list[SeamPage | FoldPage]:
    """Return the seams and folds of a laminate, by step number."""
    seams = {seam.name: seam for seam in work.laminate.seams}
    folds = {(fold.lower, fold.upper): fold for fold in work.laminate.folds}
    pages: list[SeamPage | FoldPage] = []
    pages += [_seam_page(work, step, seams[step.seam]) for step in work.schedule.seams]
    pages += [_fold_page(work.laminate, step, folds[step.layers]) for step in work.schedule.folds]
    return sorted(pages, key=lambda page: page.step.step)


def _seam_page(work: Work, step: SeamStep, seam: Seam) -> SeamPage:
    laminate = work.laminate
    layers_below = [index for index in step.layers if index not in step.adds]
    is_under = bool(layers_below) and not step.from_below
    offset = work.design.seam_offsets.get(seam.tool)
    films = [laminate.layer(index) for index in step.layers]
    x, y = seam.path[0][0].start
    low_x, low_y, high_x, _ = _box([layer.profile for layer in films])
    return SeamPage(
        step,
        seam_path(seam),
        ((high_x - x if step.from_below else x - low_x), y - low_y),
        [
            (laminate.layer(index), is_under and index < min(layers_below))
            for index in sorted(step.adds, reverse=step.from_below)
        ],
        max(layers_below, default=0),
        offset,
        "" if offset is None else shift_words(seam.tool, offset),
        _seam_picture(films, step, seam),
    )


def _box(regions: Sequence[Region]) -> Bounds:
    return box_round([region.bounds for region in regions])


def _seam_picture(films: Sequence[Layer], step: SeamStep, seam: Seam) -> str:
    """Return the films as they lie, the seam at its width, and its path."""
    low_x, low_y, high_x, high_y = _box([*(layer.profile for layer in films), seam.region])
    margin = 0.03 * max(high_x - low_x, high_y - low_y)
    width, height = high_x - low_x + 2 * margin, high_y - low_y + 2 * margin
    scale = min(WIDEST / max(width, height), 4.0)
    words = f"Seam {step.seam} {'from below, turned over' if step.from_below else 'from above'}"
    picture = Picture(f"seam-{step.step}", width * scale, height * scale, words)
    left, over = (-high_x, -scale) if step.from_below else (low_x, scale)
    to_page = over, 0, 0, -scale, (margin - left) * scale, (margin + high_y) * scale
    picture.add(f'<g transform="matrix({" ".join(map(coord, to_page))})">')
    for layer in films:
        look = draw.style(ink(layer.film).line, 0.2 / scale, fill=ink(layer.film).fill)
        picture.add(draw.path(path_data(layer.profile), f'{look} fill-opacity="0.45"'))
    picture.add(draw.path(path_data(seam.region), f'fill="{SEAM_INK}" fill-opacity="0.5"'))
    path = "".join(map(chain_data, seam.path))
    picture.add(draw.path(path, draw.style(draw.DARK, 0.2 / scale)))
    picture.add(draw.circle(seam.path[0][0].start, START / scale, f'fill="{draw.DARK}"'), "</g>")
    return picture.svg()


def _fold_page(laminate: Laminate, step: FoldStep, fold: Fold) -> FoldPage:
    (x0, y0), (x1, y1) = fold.line
    degrees = math.degrees(math.atan2(y1 - y0, x1 - x0))
    lower, upper = (laminate.layer(index) for index in (fold.lower, fold.upper))
    # About the line, which runs along x through (0, 0); the lower half lies above it on the page.
    halves = [
        half.moved(-x0, -y0).turned(-degrees)
        for half in (lower.profile, unfolded(upper.profile, [fold.line]))
    ]
    lengths = halves[0].bounds[3], -halves[1].bounds[1]
    tabs = [distance_from(fold.line, inlet.mouth) for inlet in laminate.inlets]
    ends = [
        "the tab's end" if any(abs(length - tab) < EQUAL for tab in tabs) else "the far edge"
        for length in lengths
    ]
    words = [f"{end} of half {half.index}" for end, half in zip(ends, (lower, upper), strict=True)]
    picture = _fold_picture(lower, upper, halves, lengths, f"fold-{step.step}")
    return FoldPage(step, lower, range(lower.index + 1, upper.index), lengths, words, picture)


def _fold_picture(
    lower: Layer, upper: Layer, halves: Sequence[Region], lengths: tuple[float, float], name: str
) -> str:
    """Return the flat part from above: a dash-dot fold line, both halves' numbers and lengths."""
    low_x, low_y, high_x, high_y = _box(halves)
    scale = min(WIDEST / max(high_x - low_x, high_y - low_y), 4.0)
    width, height = scale * (high_x - low_x) + 4 * RIM, scale * (high_y - low_y) + 2 * RIM
    words = f"flat part of halves {lower.index} and {upper.index}, fold line dash-dot"
    picture = Picture(name, width, height, words)
    x, y = RIM - scale * low_x, RIM + scale * high_y
    colours = ink(lower.film)
    moved = f'transform="matrix({" ".join(map(coord, flat(scale, (x, y))))})"'
    for half in halves:
        picture.add(draw.path(path_data(half), f"{draw.style(fill=colours.fill)} {moved}"))
    outline = draw.style(colours.line, 0.22 / scale)
    picture.add(draw.path(path_data(union(halves)), f"{outline} {moved}"))
    left, right = x + scale * low_x, x + scale * high_x
    ends = f"M{coord(left - PAST_FOLD)} {coord(y)}L{coord(right + PAST_FOLD)} {coord(y)}"
    picture.add(draw.path(ends, draw.fold_style()))
    for layer, way, length in zip((lower, upper), (-1, 1), lengths, strict=True):
        at = y + scale * way * length
        picture.label(((left + right) / 2, (y + at) / 2), f"half {layer.index}", NUMBER)
        tips = (right, min(y, at)), (right, max(y, at))
        picture.add(*draw.dimension(*tips, f"{length:.1f}", (1.0, 0.0), RIM))
    return picture.svg()
