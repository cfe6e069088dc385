"""The press steps in order: layers and the edges they are laid along, pins, common settings."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import Any, Literal, NamedTuple

from sbafab.geometry.edges import Arc
from sbafab.geometry.region import Region
from sbafab.laminate.films import FIRST
from sbafab.laminate.laminate import Inlet, Layer
from sbafab.laminate.lay_up import (
    LayUpStep,
    distinct_layers,
    lay_up_steps,
    press_steps,
    stack_count,
)
from sbafab.pressing.build_up import PAD
from sbafab.pressing.cycles import cycle_name
from sbafab.pressing.dowels import PinSetting
from sbafab.pressing.plate_heating import PATIENCE
from sbafab.pressing.schedule import FoldStep, SeamStep, Step
from sbafab.reports.prints import guides
from sbafab.reports.traveller.bench import punch
from sbafab.reports.traveller.lay_up import (
    Alignment,
    PiecePlace,
    Things,
    over_tab,
    pitch,
    places,
)
from sbafab.reports.traveller.materials import TAPE, has_underlay, turns_over
from sbafab.reports.traveller.shapes import Bed, Round, beds, inlets_in, rounds
from sbafab.reports.traveller.step_pictures import build_up_svg, equal_pins, exploded, plan
from sbafab.reports.traveller.work import Work

MOST_LINES = 12
"""Up to this many single layers each has its own line, and cycles their own box."""
SETTLED = 1e-6
"""Largest distance of an edge from a circle around its pin for which a turn moves nothing, mm."""

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
        laminate = self.work.laminate
        loose = {p.layers: p.number for p in press_steps(laminate) if _is_loose(self.work, p)}
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
        layers = map(self.work.laminate.layer, self.part.layers)
        return sum(layer.film.thickness for layer in layers)

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
    def places(self) -> tuple[PiecePlace, ...]:
        return places(self.work.laminate, self.part, self.beds)

    @property
    def pitch(self) -> float | None:
        return pitch(self.places)

    @property
    def pins(self) -> list[tuple[list[str], PinSetting]]:
        return equal_pins(self.step)

    @property
    def punches(self) -> list[tuple[float, float, float]]:
        """Diameter and seat of the pins of each size, and the diameter of their punch, mm."""
        sizes = sorted({(pin.diameter_mm, pin.seat_mm) for pin in self.step.pin_settings})
        return [(diameter, seat, punch(diameter)) for diameter, seat in sizes]

    @property
    def foam(self) -> float:
        """Thickness in mm of the soft support while pins are pushed out; 0 if the pad will do."""
        step = self.step
        out = max(
            pin.stands_mm + pin.tolerance_mm - step.top_mm + pin.seat_mm
            for pin in step.pin_settings
        )
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
                key_edge = None if edge is None else edge._replace(numbers=(0, 0))
                key = layer.pattern, key_edge
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
        held = [pin for pin in self.part.pins if pin in laminate.pins_holding(layer)]
        if not held:
            return "lay"
        for piece in layer.profile.pieces:
            outline = Region(piece.outers)
            inside = [pin for pin in held if outline.contains(pin.centre)]
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
    plan = work.schedule
    rows: dict[int, PressPage | SeamStep | FoldStep] = {}
    for page in step_pages(work):
        rows[page.step.step] = page
    rows |= {seam.step: seam for seam in plan.seams} | {fold.step: fold for fold in plan.folds}
    return [rows[number] for number in sorted(rows)]


def _is_loose(work: Work, part: LayUpStep) -> bool:
    """Return True for a flash bond of one drawn film and masks without pins."""
    films = [index for index in part.layers if not work.laminate.layer(index).is_mask]
    is_held = part.bond != "flash" or bool(part.pins) or len(films) > 1
    return work.design.form.is_drawn and not is_held


def every_step(work: Work) -> dict[str, Any]:
    """Return the facts common to all press steps."""
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
        "build_ups": [
            ([step.step for step in same], build_up_svg(same[0], f"build-up-{same[0].step}"))
            for same in kinds.values()
        ],
        "cycles": cycles if 1 < len(cycles) <= MOST_LINES else [],
    }
