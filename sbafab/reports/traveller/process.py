"""The technician's actions in order, with boxes to tick: press steps, tubes, tests, wrapping."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

from sbafab.design.identity import cure_hours, kit_of, tube_name
from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.laminate.assembly import AssemblyStep, assembly, laying, stack_count
from sbafab.laminate.laminate import Laminate, Layer, Pin
from sbafab.models.formulas import burst_pressure
from sbafab.models.paper import BURST, FORCE_KPA
from sbafab.pressing.build_up import BASE_PLATE, LAMINATE, PAD
from sbafab.pressing.cycles import Runs, cycle_name, serial
from sbafab.pressing.schedule import Step, joined_words
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.traveller import bench, units
from sbafab.reports.traveller.base_plate import has_underlay, punch
from sbafab.reports.traveller.bench import HeatBlank, closing, reseat, underlay
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
    STATION,
    Bed,
    Picture,
    Round,
    beds,
    inlets_in,
    rounds,
    straight_run,
)
from sbafab.reports.traveller.step_pictures import INKS, build_up_svg, exploded, pin_lines, plan

COVER = (
    "Cover with a release film and the press pad, flush with the platen all round. No second plate "
    "on top."
)
SET_PINS = (
    "Set the pins on the shoulders of their holes, by hand or with light taps; gauge their heights "
    "(above), change one that is wrong."
)
MOST_LINES = 12
"""Single layers up to which each has a line of its own."""
MOST_COPIES = 36
"""Copies up to which each has a box."""
BONDS = {
    "flash": "Flash bond: the layers just barely stick together.",
    "full": "Full bond: all TPE that touches melts into one.",
}


@dataclass(frozen=True)
class StepPage:
    """One press step as it stands on the page; pictures are inline SVG.

    ``places`` are those of pieces that are laid on a sheet by hand.
    """

    step: Step
    bond: str
    dials: tuple[tuple[str, str], ...]
    heat: tuple[HeatBlank, ...]
    build_up: str
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
                BONDS[step.bond],
                _dials(step, runs.together),
                tuple(bench.heat_blanks(step, work.schedule.heating)),
                build_up_svg(step, f"build-up-{step.step}"),
                pin_lines(step),
                (*_place_notes(runs), *_loose_notes(work, part)),
                placed,
                pitch(placed),
                plan(work.laminate, part, lying, f"plan-{step.step}"),
                exploded(work.laminate, part, lying, f"exploded-{step.step}"),
                _bench_actions(work, part, step, lying, runs),
            )
        )
    return pages


def _dials(step: Step, together: int) -> tuple[tuple[str, str], ...]:
    width, length = step.platen_mm
    return (
        ("Both platens", units.temperature(step.temperature_c)),
        ("Force on the whole platen", units.force(step.force_n)),
        (f"Pressure on {units.size(width, length)}", units.pressure(step.pressure_kpa)),
        ("On the films (estimate)", f"about {step.film_kpa:.0f} kPa"),
        ("Clock", units.minutes(step.minutes)),
        ("Pins", _pin_count(step, together)),
    )


def _pin_count(step: Step, together: int) -> str:
    """Return the pins that stand in the plate, at each of the places pressed together."""
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


def _loose_notes(work: Work, part: AssemblyStep) -> tuple[str, ...]:
    """Return a note on a flash bond of one drawn film and masks that no pin holds."""
    layers = [work.laminate.layer(index) for index in part.layers]
    films = [layer for layer in layers if not layer.is_mask]
    is_loose = part.bond == "flash" and not part.pins and len(films) < 2
    if not is_loose or not work.design.form.is_drawn:
        return ()
    return (
        "One film and masks, no pin: nothing bonds here, and masks may come off. You may leave "
        "this step out and lay its layers in the next step, lowest first. (Our advice, not tried.)",
    )


def _bench_actions(
    work: Work, part: AssemblyStep, step: Step, lying: Sequence[Bed], runs: Runs
) -> tuple[Action, ...]:
    """Return a step's actions; what it is laid up on comes between base plate and release film."""
    heat, *rest = _actions(work, part, step, lying, runs)
    laid = underlay(work, part)
    pinned = any(step.pin_settings for step in work.schedule.steps)
    down = taking_down(step, _product(work.laminate, part), pinned)
    return (heat, _plate(part, bool(laid)), *laid, *rest, *down)


def _plate(part: AssemblyStep, is_underlaid: bool) -> Action:
    """Return the laying of base plate and pins, and of the release film unless an underlay comes
    first.
    """
    text = "Lay the base plate down, cold, cut corner at the back right"
    if part.pins:
        film = "" if is_underlaid else " Prick a release film over them."
        return Action(f"{text}. {SET_PINS}{film}")
    film = "" if is_underlaid else ", and a release film on it"
    by_eye = " Lay by eye, as each line says." if part.adds and not is_underlaid else ""
    return Action(f"{text}, no pins in it{film}.{by_eye}")


def _actions(
    work: Work, part: AssemblyStep, step: Step, lying: Sequence[Bed], runs: Runs
) -> Iterator[Action]:
    laminate = work.laminate
    things = Things(laminate, lying)
    yield Action(
        f"Heat both platens to {units.temperature(step.temperature_c)}; set the force to "
        f"{units.force(step.force_n)}."
    )
    for bed in lying:
        yield from _lay(things, bed, part.pins)
    yield from reseat(laminate, part.adds, bool(part.pins))
    many = stack_count(laminate, part.layers)
    lies = "stack lies" if many == 1 else f"{many} stacks lie"
    yield Action(
        f"Check: {_tabs(laminate, part.layers)}edges lie as in the picture, {_flat(laminate)}no "
        f"dust or hair between the films, the {lies} flat (about {_height(laminate, part)})"
        + (", every pin reaches through the highest layer with its hole." if part.pins else ".")
    )
    yield Action(COVER)
    cycles = tuple(f"cycle {cycle_name(n)}" for n in range(1, runs.count + 1))
    yield closing(step, work.schedule.heating, cycles if 1 < len(cycles) <= MOST_LINES else ())


def _flat(laminate: Laminate) -> str:
    return "" if laminate.folds else "nothing is folded, "


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
    """Return the laying of a round with one box for every turn, so that nobody loses count."""
    order = ", then ".join(_named(layer) for layer in turn.turns[0])
    return Action(
        f"Lay layers {turn.first.index} to {turn.last.index}, {turn.count} times the same "
        f"{len(turn.places)}, lowest first: {order}." + _by_eye(things, turn.layers, pins),
        tuple(layer.index for layer in turn.layers),
        tuple(layer_numbers([layer.index for layer in part]) for part in turn.turns),
    )


def _lay_many(things: Things, layers: Sequence[Layer], pins: Sequence[Pin]) -> Action:
    """Return the laying of many layers that do not repeat, short enough for the step's page."""
    return Action(
        f"Lay layers {layers[0].index} to {layers[-1].index} one by one, lowest first."
        + _by_eye(things, layers, pins),
        tuple(layer.index for layer in layers),
        tuple(f"{layer.index}: {_named(layer)}" for layer in layers),
    )


def _by_eye(things: Things, layers: Sequence[Layer], pins: Sequence[Pin]) -> str:
    """Return sentences on those of the layers that none of the pins in the plate holds."""
    if not pins:
        return "".join(_along(things, layer) for layer in layers[:1])
    # A pattern may lie on a larger film here and on a smaller one there.
    lines: dict[str, dict[str, list[int]]] = {}
    for layer in layers:
        if not set(pins).intersection(things.laminate.pins_holding(layer)):
            line = things.line_up(layer.index, numbered=False)
            lines.setdefault(layer.pattern, {}).setdefault(line, []).append(layer.index)
    sentences = []
    for pattern, indices_by_line in lines.items():
        for line, indices in indices_by_line.items():
            many = "layers" if len(indices) > 1 else "layer"
            where = f" in {many} {layer_numbers(indices)}" if len(indices_by_line) > 1 else ""
            sentences.append(
                f" No pin holds {pattern}{where}: lay by eye{', ' if line else ''}{line}."
            )
    return "".join(sentences)


def _along(things: Things, layer: Layer) -> str:
    """Return a sentence on the edge along which a layer, or the stack over it, is laid."""
    line = "" if things.is_lowest(layer.index) else things.line_up(layer.index)
    return f" Lay {line}." if line else ""


def _turned(laminate: Laminate, layers: Sequence[int]) -> str:
    """Return the turn of a round stack of which a mask reaches out over the inlet tab; empty for
    none.
    """
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
    return f"inlet tabs point as in the picture ({points}), "


def _product(laminate: Laminate, part: AssemblyStep) -> str:
    if len(part.layers) == len(laminate.layers):
        return "the whole laminate"
    numbers = layer_numbers(part.layers)
    many = stack_count(laminate, part.layers)
    keep = "keep it" if many == 1 else "keep them"
    stack = f"the {units.stacks(many)} from step {part.number}, layers {numbers}"
    return f"{stack}; {keep} this side up"


def finishing(work: Work) -> list[Action]:
    """Return the trimming after the last press step; empty where nothing is to be cut off."""
    if work.laminate.registration != "ears":
        return []
    return [
        Action("Snip off every ear along the outline, not into the bond."),
        Action("Cut the tails of the inlet strips flush with the tab's end."),
        Action("Leave the masks in their pockets."),
    ]


def tubing(work: Work) -> list[Action]:
    """Return the paper's step 5, one box an inlet where it is done for each of them.

    Tubes on holes of an outer film are glued on after that, which the paper has not.
    """
    return [*_in_inlets(work), *_on_holes(work)]


def _on_holes(work: Work) -> list[Action]:
    """Return the gluing of tubes on holes of an outer film; empty without one."""
    holes = work.laminate.tube_holes
    if not holes:
        return []
    names = _boxes([port.name for port in holes])
    diameter = units.millimetres(work.design.inlet.tube_outer_diameter)
    at = f"the {'hole' if len(holes) == 1 else 'holes'} of {joined_words([p.name for p in holes])}"
    return [
        *_each_copy(work, "Glue the tubes on their holes"),
        Action(f"Mark {at} with a pen beside each, on the face that it opens to."),
        Action(
            f"Cut {units.count(len(holes), 'piece')} of {tube_name(work.design)}, outer diameter "
            f"{diameter}, square and without burr, as long as your rig needs."
        ),
        Action("Wipe the film round the hole with isopropanol and let it dry.", (), names),
        Action(
            f"Stand the tube, or a flange with the tube in it, on the hole, its bore over the "
            f"opening, and seal its foot all round with {work.design.inlet.adhesive}, at least "
            f"{units.millimetres(work.design.rules.bond_width)} wide on the film; keep it out of "
            "the hole.",
            (),
            names,
        ),
        _cure(work.design),
    ]


def _cure(design: Design) -> Action:
    hours = cure_hours(design)
    how = "as its package says" if hours is None else f"for {hours:g} h"
    return Action(f"Let the adhesive cure {how} before you pressurise anything.")


def _in_inlets(work: Work) -> list[Action]:
    """Return the fitting of tubes between two films; empty without an inlet."""
    inlets = work.laminate.inlets
    if not inlets:
        return []
    names = _boxes([inlet.chamber for inlet in inlets])
    diameter = units.millimetres(inlets[0].tube_diameter)
    deep = f"up to {units.millimetres(min(inlet.length for inlet in inlets))} deep: "
    deep += "the length of the tab's straight run"
    if work.design.form.is_drawn:
        deep = _depth(work.laminate)
    masks = [mask for gap in work.laminate.interfaces for mask in gap.masks]
    strip = f"the {masks[-1].film.material} strip lies" if masks else "nothing lies"
    end = [Action("Snip the strip off flush with the tab's end.", (), names)] if masks else []
    beside = " beside the strip" if masks else " between them"
    first = f"the tab of {inlets[0].chamber}" if len(inlets) > 1 else "the tab"
    return [
        *_each_copy(work, "Fit the tubes"),
        Action(f"Mark {first} with a pen, on {_upper_side(work)}."),
        Action(
            f"Cut {units.count(len(inlets), 'piece')} of {tube_name(work.design)}, outer diameter "
            f"{diameter}, square and without burr, as long as your rig needs."
        ),
        Action(f"Part the two films at the tab's end; {strip} between them.", (), names),
        Action(f"Push the tube in{beside}, {deep}.", (), names),
        *end,
        Action(
            f"Seal the mouth all round with a small drop of {work.design.inlet.adhesive}; keep it "
            "out of the tube.",
            (),
            names,
        ),
        _cure(work.design),
    ]


def _upper_side(work: Work) -> str:
    """Return words for the side of a tab that is marked."""
    if not work.schedule.steps:
        return "the upper side, on which the highest layer lies"
    below = "the base is below"
    if work.design.form.is_drawn:
        below = f"layer {work.laminate.layers[0].index} is below"
    return f"the side that faced up in the press: {below}"


def _depth(laminate: Laminate) -> str:
    """Return how deep a tube goes into drawn tabs, and how far the shortest runs straight."""
    length = min(inlet.length for inlet in laminate.inlets)
    run = math.floor(min(straight_run(laminate, inlet) for inlet in laminate.inlets) + STATION)
    if run < length:
        return f"up to {units.millimetres(length)} deep, the inlet's length in the design"
    return (
        f"up to {units.millimetres(length)} deep, the inlet's length in the design; the channel "
        f"runs straight for {run} mm"
    )


def _each_copy(work: Work, task: str) -> list[Action]:
    """Return a box for each copy of a batch; empty for one copy."""
    count = work.job.copies
    if count == 1 or work.laminate.panel is not None:
        return []
    copies = range(1, count + 1) if count <= MOST_COPIES else ()
    numbers = tuple(serial(work.runs, copy, work.design.order.batch) for copy in copies)
    return [Action(f"{task} of all {count} copies, one after the other, as follows.", (), numbers)]


def _boxes(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of boxes for each of several; a single one needs no name."""
    return tuple(names) if len(names) > 1 else ()


def _each(names: Sequence[str]) -> str:
    return "each chamber" if names else "the chamber"


def leak_test(work: Work) -> list[Action]:
    """Return the paper's way to find leaks, then the proof test; pressures and times are ours."""
    holes = [port.name for port in work.laminate.tube_holes]
    names = _boxes([*[chamber.name for chamber in work.laminate.chambers], *holes])
    lumen = ["lumen"] if work.laminate.lumen else []
    tab = ["tab"] if work.laminate.inlets or not holes else []
    alone = work.job.copies == 1
    where = "at the head of this traveller" if alone else "beside its serial number"
    places = joined_words(["outline", *tab, "tube", "cap", *lumen])
    several = (
        [
            Action(
                "While one chamber is full, watch the open tubes of the others: bubbles there mean "
                "a leak between chambers.",
            )
        ]
        if work.laminate.tube_count > 1
        else []
    )
    return [
        *_each_copy(work, "Test the chambers"),
        Action(
            f"Fit to each tube: {fitting(work)}; push it in by 5 mm or more. Connect a "
            "regulator or a syringe with a gauge. Wear eye protection."
        ),
        *_joined_tubes(work),
        Action(
            f"Under water, or brushed with soapy water, raise {_each(names)} slowly to "
            f"{leak_words(work).replace(' for ', ' and hold for ')}.",
            (),
            names,
        ),
        Action("All balloons open evenly. One that stays shut was over-melted."),
        Action(f"No stream of bubbles anywhere; look at {places}."),
        *several,
        Action("Release the pressure; dry the actuator."),
        *proof_test(work, names, where),
    ]


def _joined_tubes(work: Work) -> Iterator[Action]:
    """Yield which tubes to close, for each net with a tube on a hole and one more tube."""
    holes = {port.name for port in work.laminate.tube_holes}
    tubes = holes | {inlet.chamber for inlet in work.laminate.inlets}
    for net in work.laminate.nets:
        joined = [name for name in net.ports if name in tubes]
        if len(joined) > 1 and holes.intersection(joined):
            yield Action(
                f"Tubes of {joined_words(joined)} lead into the same channels (net {net.name}): "
                "close all of them but one, and fill by that."
            )


# Taking down, after the press has opened. The order is ours; the paper gives none.


CELL, HIGH, WORDS = 35.0, 24.0, 2.2
PIN = "#6d737c"


@dataclass(frozen=True)
class TakingDown:
    """The order of taking down, once for all steps: a picture and its numbered sentences."""

    picture: str
    lines: tuple[str, ...]


def order_of(steps: Sequence[Step]) -> TakingDown:
    """Return order of taking down after every press step, by the numbers that the steps name."""
    pinned = any(step.pin_settings for step in steps)
    lines = [
        "Pad off first, straight up. The upper release film stays on until the plate is as cool as "
        "your hand: hot films still flow.",
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
    """Yield the boxes to tick of one step, from the opening of the press to the ``product``.

    ``is_pinned``: some step of the design has pins, and the order five numbers, not three.
    """
    last = 5 if is_pinned else 3
    yield Action(
        "Take plate, films and pad out together, level; all are hot. Pad off (1). Let the plate "
        "cool. Upper release film off (2)."
    )
    if step.pin_settings:
        yield Action(
            f"Turn over onto a clean release film on {_soft(step)} and push the pins out of their "
            f"seats (3): {_punches(step)}. Turn back, hold the films down and draw the pins (4)."
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
    """Return the soft support of the films while pins are pushed into it."""
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


# Acceptance: leak test and proof test.
#
# The paper looks for leaks under water and bursts three actuators (Sec. 2, 7). Pressures, times and
# fitting are ours: keys of ``acceptance``, which a kit gives.


SHARE = 0.6
"""Of the estimated burst pressure, above which nothing is proved: ours."""
STEP = 5.0
"""kPa to which a lowered proof pressure is rounded down."""
RAMP = 10
"""Seconds in which the proof pressure is raised: ours."""


class Proof(NamedTuple):
    """The proof test's pressure in kPa (None: nobody can say), and where it comes from."""

    kilopascals: float | None
    basis: str


def proof(work: Work) -> Proof:
    """Return the pressure of the proof test: the kit's, or less for what would burst near it."""
    kit_pressure = work.design.acceptance.proof_pressure_kpa
    burst = burst_pressure(work.design.form, work.laminate)
    forces = (
        f"the paper gives forces at {FORCE_KPA:g} kPa and burst three actuators with pockets of "
        f"5 mm at {BURST.value:g} ± {BURST.error:g} kPa"
    )
    if burst is None:
        return Proof(
            None,
            f"{forces}; nobody has burst this film or this pocket. Burst one actuator, write down "
            f"the pressure, ________ kPa, and proof test the others at {SHARE:.0%} of it",
        )
    most = math.floor(SHARE * burst / STEP) * STEP
    if kit_pressure <= most:
        return Proof(
            kit_pressure, f"{forces}; this one is estimated to burst at about {burst:.0f} kPa"
        )
    return Proof(
        most,
        f"{forces}; this one is estimated to burst at about {burst:.0f} kPa (film stress in "
        f"proportion, ours), so its proof pressure is {SHARE:.0%} of that and not {kit_pressure:g} "
        "kPa" + ("" if most >= FORCE_KPA else f"; do not count on forces at {FORCE_KPA:g} kPa"),
    )


def leak_words(work: Work) -> str:
    """Return pressure and time of the leak test: "5 kPa for 60 s"."""
    acceptance = work.design.acceptance
    return f"{acceptance.leak_pressure_kpa:g} kPa for {acceptance.leak_seconds:g} s"


def proof_words(work: Work) -> str:
    """Return pressure and time of the proof test, a blank where nobody can say."""
    return (
        f"{units.plain(proof(work).kilopascals)} kPa for {work.design.acceptance.proof_seconds:g} s"
    )


def fitting(work: Work) -> str:
    """Return what joins tube and supply, with the bore of the tube where the kit knows it."""
    tube = kit_of(work.design).tubes.get(tube_name(work.design))
    bore = None if tube is None else tube.inner_diameter
    of = "" if bore is None else f" of {units.millimetres(bore)}"
    return f"{work.design.acceptance.fitting}, in the tube's bore{of}"


def proof_test(work: Work, names: tuple[str, ...], where: str) -> list[Action]:
    """Return the proof test's actions, ``names`` the chambers that have a box each."""
    seconds = work.design.acceptance.proof_seconds
    target = proof(work)
    others = ", the other chambers open" if names else ""
    return [
        Action(
            "Proof test, behind a shield, the actuator free to move and dry or full of water: "
            f"raise {_each(names)} in {RAMP} s to {units.plain(target.kilopascals)} kPa, hold for "
            f"{seconds:g} s{others} ({target.basis}).",
            (),
            names,
        ),
        Action("Passed: no bang, no hiss, no balloon that swells more than its neighbours."),
        Action(
            f"Leak test again, as above, at {work.design.acceptance.leak_pressure_kpa:g} kPa: a "
            "bond that began to peel shows now.",
            (),
            names,
        ),
        Action(
            f"Accepted: no leak at {leak_words(work)}, {proof_words(work)} held, no leak after "
            f"it. Write both results {where}; reject an actuator that fails either."
        ),
    ]


def wrapping(work: Work) -> list[Action]:
    """Return the wrapping of a laminate round its tube; empty for others."""
    wrap = work.design.form.wrap
    if wrap is None:
        return []
    closed = (
        f"overlapping by {units.millimetres(wrap.overlap)}"
        if wrap.overlap
        else "meeting edge to edge"
    )
    return [
        Action("Wipe the tube and the sheet's under side with isopropanol, let them dry."),
        Action(
            f"Try it dry. Wrap the sheet round its tube, outer diameter "
            f"{units.millimetres(wrap.tube_diameter)}, balloons outward, its straight edges "
            f"along the tube, {closed}."
        ),
        Action(
            f"Glue: {wrap.glue}, a thin, even film on the tube below the sheet. Keep it off "
            "inlets, tabs and balloons. What holds the sheet is ours: the paper does not say."
        ),
        Action(
            "Wrap it again, stroke it on from the middle to both edges, and bind it with tape over "
            "release film, the balloons empty, until the adhesive has cured as its package says."
        ),
        Action(
            "Lead the supply tubes along the tube, the way the tabs point, and tie them to it with "
            "a turn of thread behind the tabs, so that no pull reaches them."
        ),
        Action(
            f"Raise each chamber to {work.design.acceptance.leak_pressure_kpa:g} kPa once more: "
            "balloons open evenly round the tube, and no edge of the sheet lifts."
        ),
    ]
