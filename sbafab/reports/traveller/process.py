"""What the technician does at the press, action by action, each with a box to tick."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from sbafab.design.kits import tube_name
from sbafab.laminate.assembly import AssemblyStep, assembly, stack_count
from sbafab.laminate.laminate import Laminate, Layer, Pin
from sbafab.pressing.schedule import Step
from sbafab.pressing.together import Runs
from sbafab.pressing.words import listed
from sbafab.reports.features import layer_numbers
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.action import Action
from sbafab.reports.traveller.bench import closing, reseat, underlay
from sbafab.reports.traveller.build_up_svg import build_up_svg, pin_lines
from sbafab.reports.traveller.exploded import exploded
from sbafab.reports.traveller.job import Work
from sbafab.reports.traveller.layup import Bed, Round, beds, inlets_in, rounds
from sbafab.reports.traveller.placing import PiecePlace, Things, over_tab, pitch, places
from sbafab.reports.traveller.plan import plan
from sbafab.reports.traveller.taking_down import taking_down

LEAK_KILOPASCALS = 5.0
"""Our choice, far below the paper's burst pressure and enough to open every balloon."""
LEAK_SECONDS = 60
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
    build_up: str
    pins: str
    notes: tuple[str, ...]
    places: tuple[PiecePlace, ...]
    pitch: float | None
    plan: str
    exploded: str
    actions: tuple[Action, ...]


def step_pages(work: Work) -> list[StepPage]:
    """The press steps in order, each with its pictures, dial settings and actions."""
    parts = assembly(work.laminate)
    runs = work.runs
    found = []
    for part, step in zip(parts, work.schedule.steps, strict=True):
        lying = beds(parts, part)
        placed = places(work.laminate, part, lying)
        found.append(
            StepPage(
                step,
                BONDS[step.bond],
                _dials(step),
                build_up_svg(step, f"build-up-{step.step}"),
                pin_lines(step),
                _place_notes(runs),
                placed,
                pitch(placed),
                plan(work.laminate, part, lying, f"plan-{step.step}"),
                exploded(work.laminate, part, lying, f"exploded-{step.step}"),
                _bench_actions(work, part, step, lying, runs),
            )
        )
    return found


def _dials(step: Step) -> tuple[tuple[str, str], ...]:
    width, length = step.platen_mm
    return (
        ("Both platens", say.temperature(step.temperature_c)),
        ("Force on the whole platen", say.force(step.force_n)),
        (f"Pressure on {say.size(width, length)}", say.pressure(step.pressure_kpa)),
        ("On the films (estimate)", f"about {step.film_kpa:.0f} kPa"),
        ("Timer", say.minutes(step.minutes)),
        ("Pins", f"{len(step.pins)} in" if step.pins else "none"),
    )


def _height(laminate: Laminate, part: AssemblyStep) -> str:
    return say.millimetres(sum(laminate.layer(index).film.thickness for index in part.layers))


def _place_notes(runs: Runs) -> tuple[str, ...]:
    """What is done for every laminate of a cycle; the pictures show one place."""
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


def _bench_actions(
    work: Work, part: AssemblyStep, step: Step, lying: Sequence[Bed], runs: Runs
) -> tuple[Action, ...]:
    """A step's actions; what it is laid up on comes between base plate and release film."""
    heat, *others = _actions(work.laminate, part, step, lying, runs)
    laid = underlay(work, part)
    pinned = any(step.pin_settings for step in work.schedule.steps)
    down = taking_down(step, _product(work.laminate, part), pinned)
    return (heat, _plate(part, bool(laid)), *laid, *others, *down)


def _plate(part: AssemblyStep, has_underlay: bool) -> Action:
    """Base plate and pins, and the release film unless an underlay comes first."""
    text = "Lay the base plate down, cold, cut corner at the back right"
    if part.pins:
        film = "" if has_underlay else " Prick a release film over them."
        return Action(f"{text}. {SET_PINS}{film}")
    film = "" if has_underlay else ", and a release film on it"
    by_eye = " Lay by eye, as each line says." if part.adds and not has_underlay else ""
    return Action(f"{text}, no pins in it{film}.{by_eye}")


def _actions(
    laminate: Laminate, part: AssemblyStep, step: Step, lying: Sequence[Bed], runs: Runs
) -> Iterator[Action]:
    things = Things(laminate, lying)
    yield Action(
        f"Heat both platens to {say.temperature(step.temperature_c)}; set the force to "
        f"{say.force(step.force_n)}."
    )
    for bed in lying:
        yield from _lay(things, bed, part.pins)
    yield from reseat(laminate, part.adds, bool(part.pins))
    many = stack_count(laminate, part.layers)
    lies = "stack lies" if many == 1 else f"{many} stacks lie"
    yield Action(
        f"Check: {_tabs(laminate, part.layers)}edges lie as in the picture, nothing is folded, no "
        f"dust or hair between the films, the {lies} flat (about {_height(laminate, part)})"
        + (", every pin reaches through the highest layer with its hole." if part.pins else ".")
    )
    yield Action(COVER)
    cycles = tuple(f"cycle {n}" for n in range(1, runs.count + 1))
    yield closing(step, cycles if 1 < len(cycles) <= MOST_LINES else ())


def _lay(things: Things, bed: Bed, pins: Sequence[Pin]) -> Iterator[Action]:
    laminate = things.laminate
    if bed.made_in is not None:
        numbers = layer_numbers(bed.layers)
        lowest = laminate.layer(bed.layers[0])
        many = say.stacks(stack_count(laminate, bed.layers))
        yield Action(
            f"Lay the {many} from step {bed.made_in} (layers {numbers}), layer {lowest.index}, the "
            f"{lowest.film.material} {lowest.role.replace('-', ' ')}, down."
            + ("" if pins else _along(things, lowest) + _turned(laminate, bed.layers))
        )
        return
    turns = rounds([laminate.layer(index) for index in bed.layers])
    for repeats, group in groupby(turns, key=lambda turn: turn.count > 1):
        found = list(group)
        if repeats:
            yield from (_lay_round(things, turn, pins) for turn in found)
        elif len(found) > MOST_LINES:
            yield _lay_many(things, [turn.first for turn in found], pins)
        else:
            for layer in (turn.first for turn in found):
                text = f"Lay layer {layer.index}: {_named(layer)}."
                yield Action(text + _by_eye(things, [layer], pins), (layer.index,))


def _lay_round(things: Things, turn: Round, pins: Sequence[Pin]) -> Action:
    """One box for every turn, so that nobody loses count."""
    order = ", then ".join(_named(layer) for layer in turn.turns[0])
    return Action(
        f"Lay layers {turn.first.index} to {turn.last.index}, {turn.count} times the same "
        f"{len(turn.places)}, lowest first: {order}." + _by_eye(things, turn.layers, pins),
        tuple(layer.index for layer in turn.layers),
        tuple(layer_numbers([layer.index for layer in part]) for part in turn.turns),
    )


def _lay_many(things: Things, layers: Sequence[Layer], pins: Sequence[Pin]) -> Action:
    """Many layers that do not repeat, close together so that the step stays on its page."""
    return Action(
        f"Lay layers {layers[0].index} to {layers[-1].index} one by one, lowest first."
        + _by_eye(things, layers, pins),
        tuple(layer.index for layer in layers),
        tuple(f"{layer.index}: {_named(layer)}" for layer in layers),
    )


def _by_eye(things: Things, layers: Sequence[Layer], pins: Sequence[Pin]) -> str:
    """Sentences on those of the layers that none of the pins in the plate holds."""
    if not pins:
        return "".join(_along(things, layer) for layer in layers[:1])
    # A pattern may lie on a larger film here and on a smaller one there.
    lines: dict[str, dict[str, list[int]]] = {}
    for layer in layers:
        if not set(pins).intersection(things.laminate.pins_holding(layer)):
            line = things.line_up(layer.index, numbered=False)
            lines.setdefault(layer.pattern, {}).setdefault(line, []).append(layer.index)
    said = []
    for pattern, found in lines.items():
        for line, indices in found.items():
            many = "layers" if len(indices) > 1 else "layer"
            where = f" in {many} {layer_numbers(indices)}" if len(found) > 1 else ""
            said.append(f" No pin holds {pattern}{where}: lay by eye{', ' if line else ''}{line}.")
    return "".join(said)


def _along(things: Things, layer: Layer) -> str:
    """A sentence on the edge along which a layer, or the stack over it, is laid."""
    line = "" if things.is_lowest(layer.index) else things.line_up(layer.index)
    return f" Lay {line}." if line else ""


def _turned(laminate: Laminate, layers: Sequence[int]) -> str:
    """Which way a round stack is turned, where a mask of it reaches out over the inlet tab."""
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
    return f"{layer.film.material} {layer.role.replace('-', ' ')} {layer.pattern}{loose}"


def _tabs(laminate: Laminate, layers: Sequence[int]) -> str:
    """Where the inlet tabs of these layers point; empty if no layer has one."""
    there = inlets_in(laminate, layers)
    if not there:
        return ""
    points = listed([f"{inlet.chamber} {say.toward(inlet)}" for inlet in there])
    return f"inlet tabs point as in the picture ({points}), "


def _product(laminate: Laminate, part: AssemblyStep) -> str:
    if len(part.layers) == len(laminate.layers):
        return "the whole laminate"
    numbers = layer_numbers(part.layers)
    many = stack_count(laminate, part.layers)
    keep = "keep it" if many == 1 else "keep them"
    made = f"the {say.stacks(many)} from step {part.number}, layers {numbers}"
    return f"{made}; {keep} this side up"


def finishing(work: Work) -> list[Action]:
    """Trimming after the last press step; empty where nothing is to be cut off."""
    if work.laminate.registration != "ears":
        return []
    return [
        Action("Snip off every ear along the outline, not into the bond."),
        Action("Cut the tails of the inlet strips flush with the tab's end."),
        Action("Leave the masks in their pockets."),
    ]


def tubing(work: Work) -> list[Action]:
    """The paper's step 5, one box an inlet where it is done for each of them."""
    inlets = work.laminate.inlets
    if not inlets:
        return []
    names = _apart([inlet.chamber for inlet in inlets])
    diameter = say.millimetres(inlets[0].tube_diameter)
    straight = say.millimetres(min(inlet.length for inlet in inlets))
    strip = work.laminate.interfaces[-1].masks[0].film.material
    first = f"the tab of {inlets[0].chamber}" if len(inlets) > 1 else "the tab"
    return [
        *_each_copy(work, "Fit the tubes"),
        Action(
            f"Mark {first} with a pen, on the side that lay up in the press: the base is below."
        ),
        Action(
            f"Cut {say.count(len(inlets), 'piece')} of {tube_name(work.design)}, outer diameter "
            f"{diameter}, square and without burr, as long as your rig needs."
        ),
        Action(
            f"Part the two films at the tab's end; the {strip} strip lies between them.", (), names
        ),
        Action(
            f"Push the tube in beside the strip, up to {straight} deep: so long is the straight "
            "run of the tab.",
            (),
            names,
        ),
        Action("Snip off what of the strip stands out of the tab, flush with its end.", (), names),
        Action(
            f"Seal the mouth all round with a small drop of {work.design.inlet.adhesive}; keep it "
            "out of the tube.",
            (),
            names,
        ),
        Action("Let the adhesive cure as its package says before you pressurise anything."),
    ]


def _each_copy(work: Work, what: str) -> list[Action]:
    """That what follows is done for every copy of a batch, with a box for each."""
    count = work.job.copies
    if count == 1 or work.laminate.panel is not None:
        return []
    numbers = tuple(str(copy) for copy in range(1, count + 1)) if count <= MOST_COPIES else ()
    return [Action(f"{what} of all {count} copies, one after the other, as follows.", (), numbers)]


def _apart(names: Sequence[str]) -> tuple[str, ...]:
    """A box for each of several; a single one needs no name."""
    return tuple(names) if len(names) > 1 else ()


def leak_test(work: Work) -> list[Action]:
    """The paper's way to find leaks; the pressure and the time are ours."""
    names = _apart([chamber.name for chamber in work.laminate.chambers])
    lumen = ["lumen"] if work.laminate.lumen else []
    alone = work.job.copies == 1
    where = "at the head of this traveller" if alone else "beside its serial number"
    places = listed(["outline", "tab", "tube", "cap", *lumen])
    several = (
        [
            Action(
                "While one chamber is full, watch the open tubes of the others: bubbles there mean "
                "a leak between chambers.",
            )
        ]
        if len(work.laminate.inlets) > 1
        else []
    )
    return [
        *_each_copy(work, "Test the chambers"),
        Action("Connect a regulator or a syringe with a gauge. Wear eye protection."),
        Action(
            f"Under water, or brushed with soapy water, raise each chamber slowly to "
            f"{LEAK_KILOPASCALS:g} kPa and hold for {LEAK_SECONDS} s.",
            (),
            names,
        ),
        Action("All balloons open evenly. One that stays shut was over-melted."),
        Action(f"No stream of bubbles anywhere; look at {places}."),
        *several,
        Action(f"Let the pressure out, dry it, write the result {where}."),
    ]
