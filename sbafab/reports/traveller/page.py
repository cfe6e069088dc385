"""traveller.html: one page that goes from the laser to the press and comes back with an actuator.

Self-contained: style and pictures are inline, nothing is fetched. Same input, same bytes: the
browser writes the date of a print.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Iterator, Sequence
from itertools import chain
from string import ascii_uppercase
from typing import Any, NamedTuple

from sbafab.cutting.fixture import whole_plate
from sbafab.design.identity import cited, cure_hours, departures, kit_of, tube_name
from sbafab.design.records import Discs
from sbafab.design.sections import Acceptance
from sbafab.geometry.edges import Point
from sbafab.geometry.region import coord
from sbafab.laminate.burst import RADIUS, burst
from sbafab.laminate.laminate import Inlet, Laminate, Layer
from sbafab.laminate.lay_up import pins_when_added
from sbafab.models.paper import BURST, FORCE_KPA
from sbafab.models.sizes import sizes
from sbafab.pressing.cycles import (
    CYCLE_HOURS,
    Runs,
    batch_times,
    cycle_name,
    most_together,
    serial,
)
from sbafab.pressing.schedule import joined_words, layers_in_words
from sbafab.reports import drawing as draw
from sbafab.reports.canvas import COLOURS, KEY
from sbafab.reports.drawing import balloons
from sbafab.reports.traveller import steps
from sbafab.reports.traveller.bench import cutting, nominal
from sbafab.reports.traveller.formatting import SHORT_HASH, frame, render
from sbafab.reports.traveller.lay_up import Round, rounds
from sbafab.reports.traveller.materials import (
    adhesive_words,
    bill,
    cut_list,
    films_of,
    prints,
    release_films,
)
from sbafab.reports.traveller.pictures import (
    Picture,
    definitions,
    flat,
    part_regions,
    pattern_id,
    pattern_regions,
    sheet_rows,
)
from sbafab.reports.traveller.record_sheet import HISTORY_FIELDS, record_tables
from sbafab.reports.traveller.work import Work, times
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
        **steps.every_step(work),
        **acceptance(work),
        "work": work,
        "works": [work],
        "assembly": None,
        "design": design,
        "laminate": laminate,
        "shapes": definitions(chain(pattern_regions(laminate), part_regions(work.sheets))),
        "balloons": balloons(laminate),
        "sizes": sizes(design, laminate),
        "kit": cited(design),
        "departures": len(departures(design)),
        "code": code_svg(text),
        "code_text": text,
        "legend": _legend(work),
        "solid": None if work.solid_png is None else b64encode(work.solid_png).decode("ascii"),
        "step_rows": steps.step_rows(work),
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
        "step_pages": steps.step_pages(work),
        "joint_pages": steps.joint_pages(work),
        "times": times(work),
        "batch_times": batch_times(work.cycles, work.schedule),
        "cure_is_stated": cure_hours(design) is not None,
        "in_chapter": False,
        "again": False,
        "record_fields": HISTORY_FIELDS,
        "record_tables": record_tables(design, laminate, work.schedule),
    }


def preparations(works: Sequence[Work], findings: Sequence[Finding]) -> dict[str, Any]:
    """Return the warnings, and the work that precedes the lay-up: cutting, printing, drying."""
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
    """Yield the name and the hex code of each colour of the solid."""
    films = ", ".join(dict.fromkeys(film.material for film in work.films if not film.is_mask))
    for tone, words in KEY:
        yield films if tone == "film" else words, f"#{bytes(COLOURS[tone]).hex()}"


def _other_marks(work: Work) -> dict[str, str]:
    """Return a letter for each other design on the same sheets, so that labels stay short."""
    designs = {design for sheet in work.sheets for design, _, _ in sheet.counts}
    names = sorted(designs - {work.design.name})
    return {name: ascii_uppercase[i % 26] for i, name in enumerate(names, 1)}


def _lay_up(laminate: Laminate) -> Iterator[tuple[Round, list[tuple[tuple[Layer, ...], str, str]]]]:
    """Yield the rounds of layers, bottom to top; for each place of a round its layers, the part
    that the first is cut from, as it is sorted and counted, and the pins that hold them.
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
    """Return the code's text, with the command that finds build records; it holds no link."""
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
    tube = kit_of(design).tubes.get(tube_name(design))
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
    """Return the labels of boxes, one for each of several; a single one needs none."""
    return names if len(names) > 1 else []


def _tab_films(work: Work) -> dict[tuple[int, int], list[str]]:
    """Return the chambers of drawn layers by the two films around their tube; empty if a tab has no
    others.
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
    """Return the straight run of an inlet's channel inward from its mouth at constant width, mm; 0
    without a channel there.
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
    """The proof test's pressure in kPa, None if unknown; the estimated burst pressure, None without
    a burst test of the film; and the pressure that the design or its kit states.
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
    near it. For a film without a burst test it is the kit's or the design's own value, not the
    default.
    """
    stated = work.design.acceptance.proof_pressure_kpa
    estimate = burst(work.laminate)
    if estimate is None:
        return Proof(None if stated == USUAL_PROOF else stated, None, stated)
    most = math.floor(SHARE * estimate.kpa / STEP) * STEP
    return Proof(min(stated, most), estimate.kpa, stated)


# Several copies: places on the plate, counts for each press cycle, and serials.


WIDEST = 110.0  # width of the platen's picture on the page, mm


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
    """Return the names of the cycles of a size as text."""
    numbers = [n for n, copies in enumerate(runs.cycles, 1) if copies == size]
    first, last = cycle_name(numbers[0]), cycle_name(numbers[-1])
    if len(numbers) == 1:
        return f"Cycle {first} ({size})"
    return f"Cycles {first} to {last}, each ({size})"


def _places_picture(work: Work, runs: Runs) -> str:
    """Return the places on the base plate, numbered in the order of laying."""
    laminate = work.laminate
    plate = whole_plate(laminate, work.design.press.platen, runs.places)
    low_x, low_y, high_x, high_y = plate.bounds
    wide, high = high_x - low_x, high_y - low_y
    scale = WIDEST / max(wide, high)
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
