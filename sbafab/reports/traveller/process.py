"""The press steps in order, with boxes to tick, and the table of all steps on the first page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal, NamedTuple

from sbafab.geometry.edges import Arc, Point
from sbafab.geometry.region import Region
from sbafab.laminate.assembly import (
    AssemblyStep,
    assembly,
    distinct_layers,
    laying,
    stack_count,
)
from sbafab.laminate.films import FIRST
from sbafab.laminate.laminate import Laminate, Layer, Pin
from sbafab.pressing.build_up import BASE_PLATE, LAMINATE, PAD
from sbafab.pressing.cycles import Runs, cycle_name
from sbafab.pressing.plate_heating import PATIENCE
from sbafab.pressing.schedule import FoldStep, SeamStep, Step, joined_words, layers_in_words
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.traveller import bench, units
from sbafab.reports.traveller.base_plate import TAPE, has_underlay, punch
from sbafab.reports.traveller.bench import HeatBlank
from sbafab.reports.traveller.job import Action, Work
from sbafab.reports.traveller.lay_up import (
    PiecePlace,
    Things,
    face_down,
    over_tab,
    pitch,
    places,
)
from sbafab.reports.traveller.shapes import (
    Bed,
    Picture,
    Round,
    beds,
    inlets_in,
    rounds,
)
from sbafab.reports.traveller.step_pictures import INKS, build_up_svg, exploded, pin_lines, plan
from sbafab.reports.underlay import guides

MOST_LINES = 12
"""Up to this many single layers each has its own line."""

BONDS = {
    "flash": "Flash bond: the layers just barely stick together.",
    "full": "Full bond: all TPE that touches melts into one.",
}
FULL_OF_OTHERS = "Full bond: films that face each other melt into one, but where a mask lies."
LOOSE = "No bond: one film and masks, which nothing holds together."


SETTLED = 1e-6
"""Largest distance of an edge from a circle around its pin for which a turn moves nothing, mm."""


@dataclass(frozen=True)
class StepPage:
    """One press step on the page; pictures are inline SVG.

    ``places`` are of pieces laid on a sheet by hand.
    """

    step: Step
    bond: str
    dials: tuple[tuple[str, str], ...]
    heat: tuple[HeatBlank, ...]
    pins: str
    notes: tuple[str, ...]
    places: tuple[PiecePlace, ...]
    pitch: float | None
    plan: str
    exploded: str
    actions: tuple[Action, ...]


def step_pages(work: Work) -> list[StepPage]:
    """Return the press steps in order, each with its pictures, dial settings and actions."""
    parts = assembly(work.laminate)
    runs = work.runs
    pages = []
    for part, step in zip(parts, work.schedule.steps, strict=True):
        lying = beds(laying(work.laminate), part)
        placed = places(work.laminate, part, lying)
        pages.append(
            StepPage(
                step,
                _bond(work, part),
                _dials(step, runs.together),
                tuple(bench.heat_blanks(step, work.schedule.heating)),
                pin_lines(step),
                (*_notes_of_design(work, part), *_place_notes(runs), *_loose_notes(work, part)),
                placed,
                pitch(placed),
                plan(work.laminate, part, lying, f"plan-{step.step}"),
                exploded(work.laminate, part, lying, f"exploded-{step.step}"),
                tuple(_actions(work, part, step, lying, runs)),
            )
        )
    return pages


def _dials(step: Step, together: int) -> tuple[tuple[str, str], ...]:
    return (
        ("Both platens", units.temperature(step.temperature_c)),
        ("Force on the platen", units.force(step.force_n)),
        ("That is", units.pressure(step.pressure_kpa)),
        ("On the films", f"about {step.film_kpa:.0f} kPa"),
        ("Clock", units.minutes(step.minutes)),
        ("Pins", _pin_count(step, together)),
    )


class StepRow(NamedTuple):
    """A row of the table of all steps: the layers laid, the press's settings, and what holds
    them.
    """

    step: int
    parts: str
    heat: str
    force: str
    minutes: str
    pins: str
    product: str


def step_rows(work: Work) -> list[StepRow]:
    """Return presses, seams and folds by number, one row each."""
    plan = work.schedule
    parts = zip(assembly(work.laminate), plan.steps, strict=True)
    rows = [_press_row(work, part, step) for part, step in parts]
    rows += [_seam_row(seam) for seam in plan.seams]
    rows += [_fold_row(fold) for fold in plan.folds]
    return sorted(rows)


def _press_row(work: Work, part: AssemblyStep, step: Step) -> StepRow:
    whole = len(part.layers) == len(work.laminate.layers)
    product = "the whole laminate" if whole else layers_in_words(part.layers)
    if _is_loose(work, part):
        product = f"leave it out: nothing bonds in it; {product} are loose"
    elif part.bond == "flash":
        product += ", tacked"
    return StepRow(
        step.step,
        "; ".join(_laid(bed) for bed in beds(laying(work.laminate), part)),
        units.temperature(step.temperature_c),
        f"{step.force_n:.0f} N",
        units.minutes(step.minutes),
        _pins_in_and_out(step),
        product,
    )


def _laid(bed: Bed) -> str:
    words = layers_in_words(bed.layers)
    return words if bed.made_in is None else f"{words} from step {bed.made_in}"


def _pins_in_and_out(step: Step) -> str:
    """Return the pins of a step by size, and when they come out."""
    sizes: dict[tuple[float, float], list[str]] = {}
    for pin in step.pin_settings:
        sizes.setdefault((pin.diameter_mm, pin.length_mm), []).append(pin.pin)
    if not sizes:
        return "none"
    pins = "; ".join(
        f"{joined_words(names)} ⌀{diameter:g} {draw.TIMES} {length:g} mm"
        for (diameter, length), names in sizes.items()
    )
    return f"{pins}: in, and out after it"


def _seam_row(seam: SeamStep) -> StepRow:
    heat = units.BLANK if seam.temperature_c is None else units.temperature(seam.temperature_c)
    turned = ", turned over" if seam.from_below else ""
    return StepRow(
        seam.step,
        f"{layers_in_words(seam.layers)}{turned}",
        f"{seam.tool}, {heat}",
        "",
        "",
        "none",
        f"layers {seam.joins[0]} and {seam.joins[1]} joined along {seam.seam}",
    )


def _fold_row(fold: FoldStep) -> StepRow:
    lower, upper = fold.layers
    laid = layers_in_words(range(lower + 1, upper))
    parts = f"half {lower}" + (f"; {laid}" if upper > lower + 1 else "")
    return StepRow(fold.step, parts, "", "", "", "none", f"half {upper} folded onto it")


def every_step(work: Work) -> dict[str, Any]:
    """Return what all press steps have in common."""
    steps = work.schedule.steps
    if not steps:
        return {"press": None}
    parts = {item.part: item for item in steps[-1].build_up}
    heating, tau = work.schedule.heating, work.schedule.heating.time_constant_minutes
    papered = [step for step in steps if has_underlay(step)]
    masks = {
        bool(part.pins)
        for part in assembly(work.laminate)
        if any(layer.is_mask for layer in distinct_layers(work.laminate, part.adds))
    }
    return {
        "press": steps[0],
        "heating": heating,
        "parts": parts,
        "papered": joined_words([str(step.step) for step in papered]),
        "papered_pins": any(step.pin_settings for step in papered),
        "tape": TAPE,
        "is_pinned": any(step.pin_settings for step in steps),
        "slipped": [words for pinned, words in SLIPPED.items() if pinned in masks],
        "patience": f"{PATIENCE:g} τ ({units.minutes(None if tau is None else PATIENCE * tau)})",
        "build_ups": build_ups(work),
        "taking_down": order_of(steps),
    }


SLIPPED = {True: "down on its pin", False: "to its edge"}
"""Direction in which a slipped mask is pushed, in steps with pins and without."""


class BuildUp(NamedTuple):
    """A build-up between the platens as a picture, and its steps."""

    steps: str
    picture: str


def build_ups(work: Work) -> list[BuildUp]:
    """Return one picture for steps with pins and one for those without, with paper and without."""
    kinds: dict[tuple[bool, bool], list[Step]] = {}
    for step in work.schedule.steps:
        kinds.setdefault((bool(step.pin_settings), has_underlay(step)), []).append(step)
    return [
        BuildUp(
            f"step{'s' * (len(steps) > 1)} {joined_words([str(step.step) for step in steps])}",
            build_up_svg(steps[0], f"build-up-{steps[0].step}"),
        )
        for steps in kinds.values()
    ]


def _pin_count(step: Step, together: int) -> str:
    """Return the pins in the plate, at each of the places pressed together."""
    if not step.pins:
        return "none"
    return f"{len(step.pins)} in" if together == 1 else f"{len(step.pins)} at each place"


def _height(laminate: Laminate, part: AssemblyStep) -> str:
    return units.millimetres(sum(laminate.layer(index).film.thickness for index in part.layers))


def _place_notes(runs: Runs) -> tuple[str, ...]:
    """Return the notes on laying every laminate of a cycle; the pictures show one place."""
    if runs.copies == 1:
        return ()
    at = f"all {runs.together} places" if runs.together > 1 else "its place"
    notes = [f"Lay each layer at {at} before the next one; press once a cycle, for all."]
    if runs.together > 1:
        notes.append(
            "Stacks of earlier steps go back to the places of their numbers, and what comes off "
            "the plate goes to its number in the tray (section Batch)."
        )
    return tuple(notes)


def _bond(work: Work, part: AssemblyStep) -> str:
    """Return the sentence on what a step bonds."""
    if _is_loose(work, part):
        return LOOSE
    films = [work.laminate.layer(index).film for index in part.layers]
    has_tpe = any(film.material == FIRST[0] for film in films)
    if part.bond == "full" and work.design.form.is_drawn and not has_tpe:
        return FULL_OF_OTHERS
    return BONDS[part.bond]


def _notes_of_design(work: Work, part: AssemblyStep) -> tuple[str, ...]:
    """Return the notes of a drawn design on its lay-up, in the first press step."""
    first = assembly(work.laminate)[0]
    if not work.design.form.is_drawn or part.number != first.number:
        return ()
    return tuple(f"Note: {note}" for note in work.laminate.notes)


def _is_loose(work: Work, part: AssemblyStep) -> bool:
    """Return True for a flash bond of one drawn film and masks without pins."""
    films = [index for index in part.layers if not work.laminate.layer(index).is_mask]
    is_held = part.bond != "flash" or bool(part.pins) or len(films) > 1
    return work.design.form.is_drawn and not is_held


def _loose_notes(work: Work, part: AssemblyStep) -> tuple[str, ...]:
    """Return notes on a step that bonds nothing, and on what the next step lays instead."""
    loose = {p.layers: p.number for p in assembly(work.laminate) if _is_loose(work, p)}
    if part.layers in loose:
        return (
            "Leave this step out: nothing bonds in it, and masks may come off. Lay its layers in "
            "the step that takes the stack, one by one, lowest first. (Our advice, not tried.)",
        )
    stacks = [stack for stack in part.stacks if stack in loose]
    edges = "" if work.job.underlay is None else "; the print shows their edges too"
    return tuple(
        f"Where step {loose[stack]} was left out, lay {layers_in_words(stack)} one by one in place "
        f"of its stack, as step {loose[stack]} says{edges}."
        for stack in stacks
    )


def _plate(part: AssemblyStep, is_underlaid: bool) -> Action:
    """Return the laying of base plate and pins, and of the release film unless an underlay
    precedes.
    """
    text = "Base plate down, cold, cut corner at the back right"
    if part.pins:
        film = "" if is_underlaid else "; prick a release film over them"
        return Action(f"{text}; pins in on their shoulders, heights gauged (above){film}.")
    film = "" if is_underlaid else "; a release film on it"
    by_eye = " Lay by eye, as each line says." if part.adds and not is_underlaid else ""
    return Action(f"{text}, no pins in it{film}.{by_eye}")


def _underlay(work: Work, part: AssemblyStep) -> list[Action]:
    """Return the printed page below the release film, in steps with a line to align to.

    A print is used for one hot cycle: paper dries and shrinks, and lines wear.
    """
    patterns = [
        pattern
        for guide in guides(work.laminate)
        if part.number in guide.steps
        for pattern in guide.patterns
    ]
    if work.job.underlay is None or not patterns:
        return []
    film, over = "a see-through release film", "flush with its edges and cut corner"
    eye = ": lay by eye along them, as each line says"
    if part.pins:
        film, over = f"{film}, pricked likewise", "pricked at its grey rings over the pins"
        eye = ": lay by eye along them what no pin holds"
    return [
        Action(
            f"Tape a fresh print of {work.job.underlay} to the plate, {over}; over it {film}. The "
            f"print shows the edges of {joined_words(patterns)}{eye}."
        )
    ]


def _actions(
    work: Work, part: AssemblyStep, step: Step, lying: Sequence[Bed], runs: Runs
) -> Iterator[Action]:
    """Yield a step's actions; lay-up aids come between base plate and release film."""
    laminate = work.laminate
    things = Things(laminate, lying)
    laid = _underlay(work, part)
    yield _plate(part, bool(laid))
    yield from laid
    for bed in lying:
        yield from _lay(things, bed, part.pins)
    many = stack_count(laminate, part.layers)
    lies = "stack lies" if many == 1 else f"{many} stacks lie"
    yield Action(
        f"Check: {_tabs(laminate, part.layers)}edges as in the picture, {_flat(laminate)}no dust "
        f"or hair between films, the {lies} flat (about {_height(laminate, part)})"
        + (", every pin reaches through the highest layer with its hole." if part.pins else ".")
    )
    yield closing(work, step)
    pinned = any(step.pin_settings for step in work.schedule.steps)
    yield from taking_down(step, _product(laminate, part), pinned)


def closing(work: Work, step: Step) -> Action:
    """Return cover and start of the clock; one box per cycle of a small batch."""
    cycles = tuple(f"cycle {cycle_name(n)}" for n in range(1, work.runs.count + 1))
    return Action(
        f"Cover and close the press. Start the clock, {units.minutes(step.minutes)}, only when the "
        f"plate's edge reads {work.schedule.heating.clock_c:g} °C.",
        (),
        cycles if 1 < len(cycles) <= MOST_LINES else (),
    )


def _flat(laminate: Laminate) -> str:
    return "" if laminate.folds else "nothing folded, "


def _lay(things: Things, bed: Bed, pins: Sequence[Pin]) -> Iterator[Action]:
    laminate = things.laminate
    if bed.made_in is not None:
        numbers = layer_numbers(bed.layers)
        lowest = laminate.layer(bed.layers[0])
        many = units.stacks(stack_count(laminate, bed.layers))
        yield Action(
            f"Lay the {many} from step {bed.made_in} (layers {numbers}), layer {lowest.index}, the "
            f"{lowest.film.material} {lowest.role.replace('-', ' ')}, down."
            + ("" if pins else _along(things, lowest) + _turned(laminate, bed.layers))
        )
        return
    turns = rounds([laminate.layer(index) for index in bed.layers])
    for repeats, group in groupby(turns, key=lambda turn: turn.count > 1):
        batch = list(group)
        if repeats:
            yield from (_lay_round(things, turn, pins) for turn in batch)
        elif len(batch) > MOST_LINES:
            yield _lay_many(things, [turn.first for turn in batch], pins)
        else:
            for layer in (turn.first for turn in batch):
                text = f"Lay layer {layer.index}: {_named(layer)}."
                yield Action(text + _by_eye(things, [layer], pins), (layer.index,))


def _lay_round(things: Things, turn: Round, pins: Sequence[Pin]) -> Action:
    """Return the laying of a round with one box per turn, to keep count."""
    order = ", then ".join(_named(layer) for layer in turn.turns[0])
    size = len(turn.places)
    often = f"{turn.count} times the same {size}, lowest first" if size > 1 else "all alike"
    return Action(
        f"Lay layers {turn.first.index} to {turn.last.index}, {often}: {order}."
        + _by_eye(things, turn.layers, pins),
        tuple(layer.index for layer in turn.layers),
        tuple(layer_numbers([layer.index for layer in part]) for part in turn.turns),
    )


def _lay_many(things: Things, layers: Sequence[Layer], pins: Sequence[Pin]) -> Action:
    """Return the laying of many layers without repetition, short enough for the step's page."""
    return Action(
        f"Lay layers {layers[0].index} to {layers[-1].index} one by one, lowest first."
        + _by_eye(things, layers, pins),
        tuple(layer.index for layer in layers),
        tuple(f"{layer.index}: {_named(layer)}" for layer in layers),
    )


def _by_eye(things: Things, layers: Sequence[Layer], pins: Sequence[Pin]) -> str:
    """Return sentences on layers that no pin in the plate holds, or one pin alone."""
    if not pins:
        return "".join(_along(things, layer) for layer in layers[:1])
    hands = {layer.pattern: _hand(things.laminate, layer, pins) for layer in layers}
    # A pattern may lie on a larger film here and on a smaller one there.
    lines: dict[str, dict[str, list[int]]] = {}
    for layer in layers:
        # The lowest layer on a step's only pin sets the angle that the others are aligned to.
        gives_the_angle = len(pins) == 1 and things.is_lowest(layer.index)
        hand = hands[layer.pattern]
        if hand == "lay" or (hand == "turn" and not gives_the_angle):
            line = things.line_up(layer.index, numbered=False)
            lines.setdefault(layer.pattern, {}).setdefault(line, []).append(layer.index)
    sentences = []
    for pattern, indices_by_line in lines.items():
        held, task = HAND_WORDS[hands[pattern]]
        for line, indices in indices_by_line.items():
            many = "layers" if len(indices) > 1 else "layer"
            where = f" in {many} {layer_numbers(indices)}" if len(indices_by_line) > 1 else ""
            sentences.append(f" {held} {pattern}{where}: {task}{', ' if line else ''}{line}.")
    return "".join(sentences)


HandTask = Literal["none", "turn", "lay"]
"""What the hand decides about a layer on its pins: nothing, its angle, its place."""
HAND_WORDS: Mapping[HandTask, tuple[str, str]] = {
    "lay": ("No pin holds", "lay by eye"),
    "turn": ("One pin holds", "turn by eye"),
}


def _hand(laminate: Laminate, layer: Layer, pins: Sequence[Pin]) -> HandTask:
    """Return what the hand decides about a layer on these pins; a disc turned on its pin is
    unchanged.
    """
    held = [pin for pin in pins if pin in laminate.pins_holding(layer)]
    if not held:
        return "lay"
    for piece in layer.profile.pieces:
        outline = Region(piece.outers)
        inside = [pin for pin in held if outline.contains(pin.centre)]
        if len(inside) == 1 and not _is_round(outline, inside[0].centre):
            return "turn"
    return "none"


def _is_round(outline: Region, centre: Point) -> bool:
    return all(
        isinstance(edge, Arc) and math.dist(edge.centre, centre) <= SETTLED
        for edge in outline.edges
    )


def _along(things: Things, layer: Layer) -> str:
    """Return a sentence on the edge that a layer, or the stack above it, is aligned with."""
    line = "" if things.is_lowest(layer.index) else things.line_up(layer.index)
    return f" Lay {line}." if line else ""


def _turned(laminate: Laminate, layers: Sequence[int]) -> str:
    """Return the turn of a round stack whose mask reaches over the inlet tab; empty for none."""
    mask = over_tab(laminate, layers)
    if mask is None:
        return ""
    return (
        f" Turn it so that layer {mask.index}, the {mask.film.material} mask that reaches out, "
        "covers the tab."
    )


def _named(layer: Layer) -> str:
    pieces = len(layer.profile.pieces)
    loose = f" in {pieces} pieces" if pieces > 1 else ""
    role = layer.role.replace("-", " ")
    return f"{layer.film.material} {role} {layer.pattern}{loose}{face_down(layer)}"


def _tabs(laminate: Laminate, layers: Sequence[int]) -> str:
    """Return the directions of the inlet tabs of these layers; empty if no layer has one."""
    there = inlets_in(laminate, layers)
    if not there:
        return ""
    points = joined_words([f"{inlet.chamber} {units.toward(inlet)}" for inlet in there])
    return f"inlet tabs ({points}) and "


def _product(laminate: Laminate, part: AssemblyStep) -> str:
    if len(part.layers) == len(laminate.layers):
        return "the whole laminate"
    numbers = layer_numbers(part.layers)
    many = stack_count(laminate, part.layers)
    keep = "keep it" if many == 1 else "keep them"
    stack = f"the {units.stacks(many)} from step {part.number}, layers {numbers}"
    return f"{stack}; {keep} this side up"


# Taking down, after the press opens. The order is ours; the paper gives none.


CELL, HIGH, WORDS = 35.0, 24.0, 2.2
PIN = "#6d737c"


@dataclass(frozen=True)
class TakingDown:
    """The order of taking down, common to all steps: a picture and its numbered sentences."""

    picture: str
    lines: tuple[str, ...]


def order_of(steps: Sequence[Step]) -> TakingDown:
    """Return the order of taking down after every press step, by the numbers that the steps use."""
    pinned = any(step.pin_settings for step in steps)
    lines = [
        "Take plate, films and pad out together, level: all are hot. Pad off first, straight up. "
        "The upper release film stays on until the plate is as cool as your hand: hot films still "
        "flow.",
        "Upper release film: hold the films down with a fingertip and fold the release film back "
        "on itself, low, away from the finger. "
        + ("Pins may have pierced it: take" if pinned else "Take")
        + " a new one for each step.",
    ]
    if pinned:
        lines += [
            "In steps with pins: turn plate and films over, films down, onto something soft and "
            "cool with a clean release film on it, the same one in every step. It holds the films "
            "against the plate while the punch pushes each pin down through its push-out hole, "
            "until its seat is free. Turn everything back.",
            "Every pin now stands high. Hold the films down on both sides of it with flat tweezers "
            "and draw it straight up with pliers: the way in which the films went on, so that no "
            "edge of a hole folds back.",
        ]
    lines.append(
        "Slide the lower release film off the plate with what lies on it. At the bench's edge draw "
        "it down and back below the bench: what lies on it comes off flat, this side up. Peel the "
        "release film from the films, never the films from it."
    )
    return TakingDown(_picture(pinned), tuple(lines))


def taking_down(step: Step, product: str, is_pinned: bool) -> Iterator[Action]:
    """Yield one step's boxes to tick, from the opening of the press to the ``product``.

    ``is_pinned``: a step of the design has pins, so the order has five numbers, not three.
    """
    last = 5 if is_pinned else 3
    yield Action("All out together, hot. Pad off (1); let it cool; upper release film off (2).")
    if step.pin_settings:
        yield Action(
            f"Turn over onto a clean release film on {_soft(step)}, push the pins out of their "
            f"seats (3): {_punches(step)}. Turn back, hold the films down, draw the pins (4)."
        )
    away = "; underlay off the plate, discard it" if has_underlay(step) else ""
    yield Action(f"Lower release film off ({last}){away}. You now hold {product}.")


def _punches(step: Step) -> str:
    sizes = sorted({(pin.diameter_mm, pin.seat_mm) for pin in step.pin_settings})
    return joined_words(
        [
            f"⌀{diameter:g} by {units.millimetres(seat)}, punch "
            f"⌀{units.millimetres(punch(diameter))}"
            for diameter, seat in sizes
        ]
    )


def _soft(step: Step) -> str:
    """Return the soft support under the films while pins are pushed into it."""
    top = step.top_mm
    out = max(pin.stands_mm + pin.tolerance_mm - top + pin.seat_mm for pin in step.pin_settings)
    pad = next(item.thickness_mm for item in step.build_up if item.part == PAD)
    if pad > out:
        return "the cool press pad"
    return f"soft foam at least {units.millimetres(out + 1)} thick"


def _picture(is_pinned: bool) -> str:
    """Return the order of taking down as a row of small sections, not to scale."""
    cells = [("pad off", _pad_off), ("upper film back", _film_back)]
    if is_pinned:
        cells += [("turned over: pins down", _pushed), ("held, pins drawn up", _drawn)]
    cells.append(("lower film round the edge", _peeled))
    captions = "; ".join(f"{number} {words}" for number, (words, _) in enumerate(cells, 1))
    picture = Picture("taking-down", CELL * len(cells), HIGH, f"taking down: {captions}")
    for number, (words, drawn) in enumerate(cells):
        x0 = CELL * number
        picture.add(*drawn(x0, is_pinned))
        picture.add(draw.text((x0 + 1.0, HIGH - 1.0), f"{number + 1}  {words}", size=WORDS))
    return picture.svg()


def _box(x0: float, low: Sequence[float], high: Sequence[float], part: str) -> str:
    corners: list[Point] = [(x0 + p[0], p[1]) for p in (low, high)]
    return draw.box(corners[0], corners[1], fill=INKS[part], stroke=draw.DARK)


def _film(x0: float, points: Sequence[Point]) -> str:
    return draw.line([(x0 + x, y) for x, y in points], colour=INKS["film"], width=0.5)


def _to(x0: float, start: Point, end: Point) -> list[str]:
    """Return an arrow from one place to another."""
    (x, y), (u, v) = (x0 + start[0], start[1]), (x0 + end[0], end[1])
    length = max(abs(u - x), abs(v - y))
    return [
        draw.line([(x, y), (u, v)], width=0.35),
        draw.arrow((u, v), ((u - x) / length, (v - y) / length)),
    ]


def _lying(x0: float, is_pinned: bool, stands: float = 1.5) -> list[str]:
    """Return plate, lower film, films on it, and a pin in its hole."""
    parts = [
        _box(x0, (2.0, 16.0), (31.0, 20.5), BASE_PLATE),
        _film(x0, [(2.0, 15.7), (31.0, 15.7)]),
        _box(x0, (10.0, 13.0), (23.0, 15.4), LAMINATE),
    ]
    if is_pinned:
        tip = 13.0 - stands
        x = x0 + 15.7
        parts.append(draw.box((x, tip), (x + 1.6, tip + 8.0), fill=PIN, stroke=draw.DARK))
    return parts


def _pad_off(x0: float, is_pinned: bool) -> list[str]:
    return [
        *_lying(x0, is_pinned),
        _film(
            x0, [(2.0, 15.1), (7.0, 15.1), (9.5, 12.0), (23.5, 12.0), (26.0, 15.1), (31.0, 15.1)]
        ),
        _box(x0, (2.0, 4.5), (31.0, 8.5), PAD),
        *_to(x0, (28.0, 4.0), (28.0, 1.0)),
    ]


def _film_back(x0: float, is_pinned: bool) -> list[str]:
    return [
        *_lying(x0, is_pinned),
        _film(x0, [(17.5, 12.4), (22.5, 12.4), (23.3, 11.4), (21.5, 10.2), (6.0, 9.2)]),
        *_to(x0, (14.0, 7.6), (8.0, 7.2)),
        *_to(x0, (26.5, 8.0), (24.0, 12.6)),
    ]


def _pushed(x0: float, is_pinned: bool) -> list[str]:
    del is_pinned
    x = x0 + 15.7
    return [
        _box(x0, (2.0, 14.4), (31.0, 20.5), PAD),
        _box(x0, (2.0, 7.5), (31.0, 12.0), BASE_PLATE),
        _box(x0, (10.0, 12.0), (23.0, 14.4), LAMINATE),
        draw.box((x, 11.0), (x + 1.6, 19.0), fill=PIN, stroke=draw.DARK),
        draw.box((x + 0.4, 3.5), (x + 1.2, 11.0), fill="#ffffff", stroke=draw.DARK),
        *_to(x0, (16.5, 0.6), (16.5, 3.4)),
    ]


def _drawn(x0: float, is_pinned: bool) -> list[str]:
    return [
        *_lying(x0, is_pinned, stands=6.0),
        *_to(x0, (16.5, 5.0), (16.5, 1.0)),
        *_to(x0, (12.5, 8.5), (12.5, 12.8)),
        *_to(x0, (20.5, 8.5), (20.5, 12.8)),
    ]


def _peeled(x0: float, is_pinned: bool) -> list[str]:
    del is_pinned
    return [
        draw.box((x0 + 2.0, 14.0), (x0 + 19.0, 16.5), fill="#d9c7a8", stroke=draw.DARK),
        _film(x0, [(2.0, 13.6), (19.3, 13.6), (19.8, 14.2), (8.0, 19.0)]),
        _box(x0, (10.0, 10.9), (24.5, 13.3), LAMINATE),
        *_to(x0, (11.5, 20.0), (7.0, 20.9)),
        *_to(x0, (25.5, 12.1), (30.0, 12.1)),
    ]
