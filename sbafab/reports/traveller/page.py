"""traveller.html: one page that leads from the laser to the press and to a finished actuator.

Self-contained: style and pictures are inline, nothing is fetched. The same input gives the same
bytes: the browser adds the date of a print.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, groupby
from string import ascii_uppercase
from typing import Any, Literal, NamedTuple

from sbafab.cutting.fixture import whole_plate
from sbafab.cutting.layer_files import seam_path, shift_words
from sbafab.design.identity import cited, cure_hours, departures, kit_of, tube_name
from sbafab.design.records import Discs
from sbafab.design.sections import Acceptance
from sbafab.geometry.edges import Arc, Point, box_round
from sbafab.geometry.region import Region, chain_data, coord, path_data, union
from sbafab.laminate.burst import RADIUS, burst
from sbafab.laminate.films import FIRST, ink
from sbafab.laminate.folding import distance_from, unfolded
from sbafab.laminate.joints import Fold, Seam
from sbafab.laminate.laminate import Inlet, Laminate, Layer
from sbafab.laminate.lay_up import (
    LayUpStep,
    distinct_layers,
    lay_up_steps,
    pins_when_added,
    press_steps,
    stack_count,
)
from sbafab.models.calibration import factors_of
from sbafab.models.paper import BURST, FORCE_KPA
from sbafab.models.sizes import sizes
from sbafab.pressing.build_up import PAD
from sbafab.pressing.cycles import (
    CYCLE_HOURS,
    Runs,
    batch_times,
    cycle_name,
    most_together,
    serial,
)
from sbafab.pressing.dowels import PinSetting
from sbafab.pressing.plate_heating import PATIENCE
from sbafab.pressing.schedule import FoldStep, SeamStep, Step, joined_words, layers_in_words
from sbafab.reports import drawing as draw
from sbafab.reports.canvas import COLOURS, KEY
from sbafab.reports.drawing import balloons
from sbafab.reports.prints import guides
from sbafab.reports.traveller.bench import cutting, nominal, punch
from sbafab.reports.traveller.formatting import SHORT_HASH, frame, render
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
from sbafab.reports.traveller.pictures import (
    Matrix,
    Picture,
    definitions,
    exploded,
    flat,
    part_regions,
    pattern_id,
    pattern_regions,
    plan,
    sheet_rows,
)
from sbafab.reports.traveller.record_sheet import HISTORY_FIELDS, record_tables
from sbafab.reports.traveller.work import (
    TAPE,
    Work,
    adhesive_words,
    bill,
    cut_list,
    films_of,
    has_underlay,
    prints,
    release_films,
    times,
    turns_over,
)
from sbafab.rules.finding import Finding
from sbafab.version import GENERATOR


def traveller_html(work: Work) -> str:
    """Return the whole page."""
    return render("traveller.html.j2", **context(work))


def context(work: Work) -> dict[str, Any]:
    """Return the values of one design for the templates."""
    design, laminate = work.design, work.laminate
    text = record_text(laminate.name, work.sha256)
    other_marks = _other_marks(work)
    # A drawing's notes concern its lay-up; other families' notes concern trimming.
    is_drawn = design.form.is_drawn
    notes = tuple(f"{note.rstrip('.')}." for note in laminate.notes)
    return {
        **frame(laminate.name, work.sha256),
        **preparations([work], work.findings),
        **cutting([work]),
        **every_step(work),
        **FUNCTIONS,
        **acceptance(work),
        "work": work,
        "works": [work],
        "assembly": None,
        "design": design,
        "laminate": laminate,
        "shapes": definitions(chain(pattern_regions(laminate), part_regions(work.sheets))),
        "balloons": balloons(laminate),
        "sizes": sizes(design, laminate),
        "flow": factors_of(design).folded(laminate).remark,
        "kit": cited(design),
        "departures": len(departures(design)),
        "code": code_svg(text),
        "code_text": text,
        "legend": _legend(work),
        "solid": None if work.solid_png is None else b64encode(work.solid_png).decode("ascii"),
        "step_rows": step_rows(work),
        "lay_up": _lay_up(laminate),
        "lay_up_notes": notes if is_drawn else (),
        "turned": _turned(laminate),
        "bill": bill(work),
        "others": other_marks,
        "other_films": [film.written for film in work.films if film.written != film.material],
        "sheet_rows": sheet_rows(design, work.sheets, {design.name: "", **other_marks}),
        "cuts": cut_list(work),
        "trim_notes": () if is_drawn else notes,
        "batch": _batch(work),
        "step_pages": step_pages(work),
        "joint_pages": joint_pages(work),
        "times": times(work),
        "batch_times": batch_times(work.cycles, work.schedule),
        "cure_is_stated": cure_hours(design) is not None,
        "in_chapter": False,
        "again": False,
        "record_fields": HISTORY_FIELDS,
        "record_tables": record_tables(design, laminate, work.schedule),
    }


def preparations(works: Sequence[Work], findings: Sequence[Finding]) -> dict[str, Any]:
    """Return the warnings, and the work before the lay-up: cutting, printing, drying."""
    rules = {finding.rule for finding in findings if finding.verdict == "warn"}
    pressed = [work for work in works if work.schedule.steps]
    films = [film for film in films_of(works) if film.warning]
    return {
        "warnings": {"films": films, "nominal": nominal(works), "rules": len(rules)},
        "release_films": sum(map(release_films, pressed)),
        "prints": sum(map(prints, works)),
        "is_glued": any(work.laminate.tube_count for work in works),
        "is_pressed": bool(pressed),
        "cups": (),
    }


def _turned(laminate: Laminate) -> str:
    """Return the layers that are cut turned over, as text; folds do not count."""
    roots = {laminate.cut_with(layer) for layer in laminate.layers if layer.turned}
    turned = [index for index in sorted(roots) if laminate.layer(index).turned]
    return layers_in_words(turned) if turned else ""


def _legend(work: Work) -> Iterator[tuple[str, str]]:
    """Yield the name and hex code of each colour of the solid."""
    films = ", ".join(dict.fromkeys(film.material for film in work.films if not film.is_mask))
    for tone, words in KEY:
        yield films if tone == "film" else words, f"#{bytes(COLOURS[tone]).hex()}"


def _other_marks(work: Work) -> dict[str, str]:
    """Return a letter for each other design on the same sheets, for short labels."""
    designs = {design for sheet in work.sheets for design, _, _ in sheet.counts}
    names = sorted(designs - {work.design.name})
    return {name: ascii_uppercase[i % 26] for i, name in enumerate(names, 1)}


def _lay_up(laminate: Laminate) -> Iterator[tuple[Round, list[tuple[tuple[Layer, ...], str, str]]]]:
    """Yield the rounds of layers, bottom to top. For each place of a round: its layers, the part
    from which the first is cut, as sorted and counted, and the pins that hold them.
    """
    pins_of = {
        index: joined_words([pin.name for pin in pins]) if pins else "none (by hand)"
        for index, pins in pins_when_added(laminate).items()
    }
    for turn in rounds(laminate.layers):
        rows = []
        for place in turn.places:
            root = laminate.layer(laminate.cut_with(place[0]))
            part = root.pattern if root is place[0] else f"{root.pattern}, folded over"
            rows.append((place, part, "; ".join(dict.fromkeys(pins_of[x.index] for x in place))))
        yield turn, rows


# The QR code: the design that a printed page belongs to.


QUIET = 4  # modules left white around the code, as its standard requires


def record_text(name: str, sha256: str) -> str:
    """Return the text of the code, with the command that finds build records; it holds no link."""
    find = f"sbafab record --find {sha256[:SHORT_HASH]}"
    return f"{name}\nsha256 {sha256}\n{GENERATOR}\n{find}"


def code_svg(text: str) -> str:
    """Return the text as a QR code, inline SVG without a fixed size."""
    import segno

    code = segno.make(text, error="m", micro=False)
    return code.svg_inline(border=QUIET, omitsize=True, light="white", svgclass="code")


# After the last joint: tubes, leak and proof tests.
#
# The paper looks for leaks under water and bursts three actuators (Sec. 2, 7). Pressures, times and
# fitting are ours: keys of ``acceptance``, which a kit gives.


MOST_COPIES = 36  # up to this many copies each has a box
SHARE = 0.6  # share of the estimated burst pressure that no proof test exceeds: ours
USUAL_PROOF = Acceptance().proof_pressure_kpa
"""kPa, below the burst pressure of the paper's film; it does not apply to other films."""
STEP = 5.0  # step in kPa for rounding down a lowered proof pressure
RAMP = 10  # time for raising the proof pressure, s: ours
STATION = 0.1  # steps in depth at which a channel's walls are searched, mm


def acceptance(work: Work) -> dict[str, Any]:
    """Return the values for ``acceptance.html.j2``."""
    design, laminate = work.design, work.laminate
    masks = [mask for gap in laminate.interfaces for mask in gap.masks]
    tube = kit_of(design).record.tubes.get(tube_name(design))
    mechanism = design.form.mechanism
    inlets, ports = (
        [inlet.chamber for inlet in laminate.inlets],
        [port.name for port in laminate.tube_holes],
    )
    # Nets that join several tubes: a net's chambers are filled by its first one.
    nets = {net.name: [x for x in net.ports if x in {*inlets, *ports}] for net in laminate.nets}
    shared = {net: names for net, names in nets.items() if len(names) > 1}
    closed = {name for names in shared.values() for name in names[1:]}
    names = [*(chamber.name for chamber in laminate.chambers), *ports]
    copies = range(1, work.copies + 1) if 1 < work.copies <= MOST_COPIES else ()
    runs = [straight_run(laminate, inlet) for inlet in laminate.inlets * design.form.is_drawn]
    return {
        "is_eared": laminate.registration == "ears",
        "serials": [serial(work.cycles, n, design.order.batch) for n in copies],
        "inlets": _boxes(inlets),
        "holes": _boxes(ports),
        "tube": tube_name(design),
        "depth": min((inlet.length for inlet in laminate.inlets), default=0.0),
        "run": math.floor(min(runs) + STATION) if runs else 0,
        "tab_films": _tab_films(work),
        "strip": masks[-1].film.material if masks else "",
        "adhesive": adhesive_words(work),
        "cure_hours": cure_hours(design),
        "bore": None if tube is None else tube.inner_diameter,
        "shared": shared,
        "filled": _boxes([name for name in names if name not in closed]),
        "is_jamming": mechanism is not None and mechanism.kind == "jamming",
        "proof": proof(work),
        "ramp": RAMP,
        "unfolds_as_measured": design.form.pockets == Discs((2 * RADIUS,) * laminate.balloons)
        and all(layer.film.is_the_papers for layer in laminate.tpe_layers),
        "wrap": design.form.wrap,
    }


def _boxes(names: list[str]) -> list[str]:
    """Return the labels of boxes, one for each of several; a single box needs none."""
    return names if len(names) > 1 else []


def _tab_films(work: Work) -> dict[tuple[int, int], list[str]]:
    """Return the chambers of drawn layers by the two films around their tube; empty for tabs with
    no others.
    """
    laminate = work.laminate
    pairs: dict[tuple[int, int], list[str]] = {}
    if work.design.form.is_drawn and len(laminate.interfaces) > 1:
        for inlet in laminate.inlets:
            gap = laminate.mouth_gap(inlet)
            if gap is not None:
                pairs.setdefault((gap.below.index, gap.above.index), []).append(inlet.chamber)
    return pairs


def straight_run(laminate: Laminate, inlet: Inlet) -> float:
    """Return the length of an inlet channel of constant width inward from its mouth, mm; 0 without
    a channel.
    """
    (x, y), (u, v) = inlet.mouth, inlet.direction

    def at(depth: float, aside: float) -> Point:
        return x - depth * u - aside * v, y - depth * v + aside * u

    within, beyond = inlet.width / 2 - STATION / 2, inlet.width / 2 + STATION / 2
    gap = laminate.mouth_gap(inlet)
    void = None if gap is None else gap.unbonded
    depth = 0.0
    while void is not None:
        here = depth + STATION
        inside = all(void.contains(at(here, wall)) for wall in (-within, within))
        if not inside or any(void.contains(at(here, wall)) for wall in (-beyond, beyond)):
            break
        depth = here
    return depth


class Proof(NamedTuple):
    """The proof test's pressure in kPa (None if unknown), the estimated burst pressure (None
    without a burst test of the film), and the stated pressure of the design or its kit.
    """

    kilopascals: float | None
    burst_kpa: float | None
    stated: float
    share: float = SHARE
    force_kpa: float = FORCE_KPA
    paper_kpa: float = BURST.value
    paper_error: float = BURST.error


def proof(work: Work) -> Proof:
    """Return the pressure of the proof test: the kit's, or less for an actuator that would burst
    near it.

    A film without a burst test takes the stated value of the kit or design, not the default.
    """
    stated = work.design.acceptance.proof_pressure_kpa
    estimate = burst(work.laminate)
    if estimate is None:
        return Proof(None if stated == USUAL_PROOF else stated, None, stated)
    most = math.floor(SHARE * estimate.kpa / STEP) * STEP
    return Proof(min(stated, most), estimate.kpa, stated)


# Several copies: places on the plate, counts for each press cycle, and serials.


PLACES_WIDTH = 110.0  # width of the platen's picture on the page, mm


def _batch(work: Work) -> dict[str, Any] | None:
    """Return the batch of a design; None for a single copy. Cycles of one size share a column.

    ``copies`` have number, serial, cycle and place in the press, from 1.
    """
    runs, batch = work.cycles, work.design.order.batch
    if runs.copies == 1:
        return None
    sizes = list(dict.fromkeys(runs.cycles))
    return {
        "sizes": sizes,
        "room": most_together(work.laminate, work.design.press.platen),
        "cycle_hours": CYCLE_HOURS,
        "picture": _places_picture(work, runs),
        "cycle_names": [cycles_of(runs, size) for size in sizes],
        "patterns": work.laminate.patterns,
        "copies": [
            (copy, serial(runs, copy, batch), cycle_name(cycle), place)
            for copy in range(1, runs.copies + 1)
            for cycle, place in [runs.position(copy)]
        ],
    }


def cycles_of(runs: Runs, size: int) -> str:
    """Return the names of the cycles of one size as text."""
    numbers = [n for n, copies in enumerate(runs.cycles, 1) if copies == size]
    first, last = cycle_name(numbers[0]), cycle_name(numbers[-1])
    if len(numbers) == 1:
        return f"Cycle {first} ({size})"
    return f"Cycles {first} to {last}, each ({size})"


def _places_picture(work: Work, runs: Runs) -> str:
    """Return the places on the base plate, numbered in lay-up order."""
    laminate = work.laminate
    plate = whole_plate(laminate, work.design.press.platen, runs.places)
    low_x, low_y, high_x, high_y = plate.bounds
    wide, high = high_x - low_x, high_y - low_y
    scale = PLACES_WIDTH / max(wide, high)
    at = 1 - scale * low_x, 1 + scale * high_y
    words = f"{runs.together} places on the base plate, from above"
    picture = Picture("batch-plan", scale * wide + 2, scale * high + 8, words)
    picture.plate(plate, flat(scale, at))
    widest = max(laminate.layers, key=lambda layer: layer.profile.area)
    box = laminate.bounds
    size = min(3.2, 0.4 * scale * min(box[2] - box[0], box[3] - box[1]))
    middle = scale * (box[0] + box[2]) / 2, scale * (box[1] + box[3]) / 2
    for place, (x, y) in enumerate(runs.places, 1):
        u, v = at[0] + scale * x, at[1] - scale * y
        picture.part(pattern_id(widest.pattern), widest.film, flat(scale, (u, v)), "clear")
        picture.label((u + middle[0], v - middle[1] + size / 3), str(place), size)
    plate_size = f"{coord(round(wide, 6))} x {coord(round(high, 6))} mm"
    words = (
        f"base plate and heated area, {plate_size}, from above; the cut corner at the back right"
    )
    picture.add(draw.text((1.0, scale * high + 6), words, size=2.2))
    return picture.svg()


# The steps in order: layers and the edges they are laid along, pins, seams, folds, settings.


MOST_LINES = 12  # up to this many single layers each has its own line, and cycles their own box
SETTLED = 1e-6  # mm: a turn moves no edge that is as near as this to a circle around its pin

HandTask = Literal["none", "turn", "lay"]
"""The hand's task for a layer on its pins: none, its angle, its place."""


class ByEye(NamedTuple):
    """The manual alignment of layers of a pattern, and the reference edge. ``layers`` are named if
    others of the pattern use other edges.
    """

    hand: HandTask
    pattern: str
    edge: Alignment | None
    layers: list[int]


class Lay(NamedTuple):
    """Layers laid in one action: a repeated round, many without repetition, or one."""

    turns: list[Round]
    by_eye: list[ByEye]

    @property
    def layers(self) -> list[Layer]:
        return [layer for turn in self.turns for layer in turn.layers]


@dataclass(frozen=True)
class PressPage:
    """The values of a press step for its page and its row on the first page."""

    work: Work
    part: LayUpStep
    step: Step

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
        """The stacks of earlier steps that do not bond here, and the numbers of those steps."""
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
    def height(self) -> float:
        """The height of the films as bought, mm."""
        return sum(self.work.laminate.layer(i).film.thickness for i in self.part.layers)

    @property
    def printed(self) -> list[str]:
        """The patterns with edges on the underlay in this step; empty without one.

        A print is used for one hot cycle: paper dries and shrinks, and lines wear.
        """
        laminate, number = self.work.laminate, self.part.number
        return [p for guide in guides(laminate) if number in guide.steps for p in guide.patterns]

    @cached_property
    def places(self) -> list[PiecePlace]:
        return places(self.work.laminate, self.part, self.beds)

    @property
    def pins(self) -> list[tuple[list[str], PinSetting]]:
        """The names of equal pins, and one pin of each kind."""
        groups: dict[PinSetting, list[str]] = {}
        for pin in sorted(self.step.pin_settings, key=lambda pin: (pin.diameter_mm, pin.length_mm)):
            groups.setdefault(replace(pin, pin=""), []).append(pin.pin)
        return [(names, pin) for pin, names in groups.items()]

    @property
    def punches(self) -> list[tuple[float, float, float]]:
        """The diameter and seat of the pins of each size, and the diameter of their punch, mm."""
        sizes = sorted({(pin.diameter_mm, pin.seat_mm) for pin in self.step.pin_settings})
        return [(diameter, seat, punch(diameter)) for diameter, seat in sizes]

    @property
    def foam(self) -> float:
        """The thickness in mm of the soft support for pushing pins out; 0 if the pad is enough."""
        pins, step = self.step.pin_settings, self.step
        out = max(pin.stands_mm + pin.tolerance_mm - step.top_mm + pin.seat_mm for pin in pins)
        pad = next(item.thickness_mm for item in step.build_up if item.part == PAD)
        return 0.0 if pad > out else out + 1

    def edge(self, index: int) -> Alignment | None:
        """The alignment of a layer, or of a stack by its lowest layer; None if it is lowest."""
        return None if self.things.is_lowest(index) else self.things.alignment(index)

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
        """Return the manual alignment of layers that no pin in the plate holds, or only one."""
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
        """Return the manual alignment of a layer; rotation does not change a disc on its pin."""
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


WIDEST = 80.0  # longer side of the films in a picture on the page, mm
RIM, PAST_FOLD, NUMBER = 5.0, 3.0, 3.5
"""mm on the page: free round a picture, of a fold line past the part, and letters of numbers."""
START = 0.9  # mm on the page: radius of the dot where a path begins
SEAM_INK = "#d1495b"


def joint_pages(work: Work) -> list[dict[str, Any]]:
    """Return the seams and folds of a laminate, by step number."""
    seams = {seam.name: seam for seam in work.laminate.seams}
    folds = {(fold.lower, fold.upper): fold for fold in work.laminate.folds}
    pages = [_seam_page(work.laminate, step, seams[step.seam]) for step in work.schedule.seams]
    pages += [_fold_page(work.laminate, step, folds[step.layers]) for step in work.schedule.folds]
    return sorted(pages, key=lambda page: int(page["step"].step))


def _seam_page(laminate: Laminate, step: SeamStep, seam: Seam) -> dict[str, Any]:
    """Return a seam. ``start`` is the start of its path, mm right of and above the lower left
    corner of the films as laid; ``lays`` are the layers laid for it, each with whether the previous
    work is laid on it; ``held`` is the highest layer of that work.
    """
    layers_below = [index for index in step.layers if index not in step.adds]
    is_under = bool(layers_below) and not step.from_below
    films = [laminate.layer(index) for index in step.layers]
    x, y = seam.path[0][0].start
    low_x, low_y, high_x, _ = box_round([layer.profile.bounds for layer in films])
    return {
        "step": step,
        "path": seam_path(seam),
        "start": ((high_x - x if step.from_below else x - low_x), y - low_y),
        "lays": [
            (laminate.layer(index), is_under and index < min(layers_below))
            for index in sorted(step.adds, reverse=step.from_below)
        ],
        "held": max(layers_below, default=0),
        "picture": _seam_picture(films, step, seam),
    }


def _plan_of(
    name: str, words: str, regions: Sequence[Region], beside: float, over: int = 1
) -> tuple[Picture, Matrix]:
    """Return an empty picture for regions, with space ``beside`` them, mm, and their matrix;
    ``over`` is -1 for work turned over, left to right.
    """
    low_x, low_y, high_x, high_y = box_round([region.bounds for region in regions])
    wide, high = high_x - low_x, high_y - low_y
    scale = min(WIDEST / max(wide, high), 4.0)
    picture = Picture(name, scale * wide + 2 * RIM + beside, scale * high + 2 * RIM, words)
    left = low_x if over > 0 else -high_x
    return picture, (over * scale, 0, 0, -scale, RIM - scale * left, RIM + scale * high_y)


def _seam_picture(films: Sequence[Layer], step: SeamStep, seam: Seam) -> str:
    """Return the films as laid, the seam at its width, and its path."""
    words = f"Seam {step.seam} {'from below, turned over' if step.from_below else 'from above'}"
    shown = [*(layer.profile for layer in films), seam.region]
    over = -1 if step.from_below else 1
    picture, matrix = _plan_of(f"seam-{step.step}", words, shown, 0.0, over)
    thin = -0.2 / matrix[3]
    elements = []
    for layer in films:
        look = draw.style(ink(layer.film).line, thin, fill=ink(layer.film).fill)
        elements.append(draw.path(path_data(layer.profile), f'{look} fill-opacity="0.45"'))
    elements.append(draw.path(path_data(seam.region), f'fill="{SEAM_INK}" fill-opacity="0.5"'))
    elements.append(draw.path("".join(map(chain_data, seam.path)), draw.style(draw.DARK, thin)))
    dot = draw.circle(seam.path[0][0].start, -START / matrix[3], f'fill="{draw.DARK}"')
    picture.place(matrix, *elements, dot)
    return picture.svg()


def _fold_page(laminate: Laminate, step: FoldStep, fold: Fold) -> dict[str, Any]:
    """Return a fold, its film unfolded: the lengths of the lower and upper half perpendicular to
    the line, mm, and their ends in text.
    """
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
    picture = _fold_picture(lower, upper, halves, lengths, step.step)
    return {"step": step, "lengths": lengths, "ends": words, "picture": picture}


def _fold_picture(
    lower: Layer, upper: Layer, halves: Sequence[Region], lengths: tuple[float, float], step: int
) -> str:
    """Return the flat part from above: a dash-dot fold line, both halves' numbers and lengths."""
    words = f"flat part of halves {lower.index} and {upper.index}, fold line dash-dot"
    picture, matrix = _plan_of(f"fold-{step}", words, halves, 2 * RIM)
    scale, y, colours = matrix[0], matrix[5], ink(lower.film)
    filled = [draw.path(path_data(half), draw.style(fill=colours.fill)) for half in halves]
    outline = draw.path(path_data(union(halves)), draw.style(colours.line, 0.22 / scale))
    picture.place(matrix, *filled, outline)
    left, right = RIM, picture.width - 3 * RIM
    ends = f"M{coord(left - PAST_FOLD)} {coord(y)}L{coord(right + PAST_FOLD)} {coord(y)}"
    picture.add(draw.path(ends, draw.fold_style()))
    for layer, way, length in zip((lower, upper), (-1, 1), lengths, strict=True):
        at = y + scale * way * length
        picture.label(((left + right) / 2, (y + at) / 2), f"half {layer.index}", NUMBER)
        tips = (right, min(y, at)), (right, max(y, at))
        picture.add(*draw.dimension(*tips, f"{length:.1f}", (1.0, 0.0), RIM))
    return picture.svg()


# Called by the templates of steps.
FUNCTIONS = {
    "exploded": exploded,
    "inlets_in": inlets_in,
    "over_tab": over_tab,
    "pitch": pitch,
    "plan": plan,
    "shift_words": shift_words,
    "stack_count": stack_count,
}
