"""Requirements of a job: bill of materials, cut list, minutes, and notes on the cut files."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

from sbafab.design.identity import cure_hours, tube_name
from sbafab.laminate.laminate import Layer
from sbafab.pressing.build_up import BASE_PLATE
from sbafab.pressing.cycles import batch_times
from sbafab.pressing.plate_heating import START, cool_minutes, warm_minutes
from sbafab.pressing.schedule import HANDLING_MINUTES, joined_words
from sbafab.reports.drawing import TIMES, layer_numbers
from sbafab.reports.traveller import acceptance, base_plate, units
from sbafab.reports.traveller.job import Job, Work
from sbafab.reports.traveller.shapes import flat_shape, thumbnail
from sbafab.reports.tray_plan import tray_sheets
from sbafab.reports.underlay import PAPER, leaves
from sbafab.spreadsheet import csv_text


@dataclass(frozen=True)
class Item:
    """A row of the bill of materials.

    ``quantity`` is a text, ``number`` the count needed, None if it is not counted; ``area`` in m2
    is the total area of film. ``kind``: film that parts are cut from, or the tube that a sheet is
    wrapped around.
    """

    name: str
    what: str
    quantity: str
    number: int | None = None
    area: float | None = None
    kind: Literal["film", "wrap", "other"] = "other"


SPARE_TUBES = 1
THREAD = Item("Thread", "ties supply tubes, loose enough for them to slide", "as needed")


BILL_COLUMNS = ("item", "specification", "needed", "area_m2", "quantity")


def bill_csv(work: Work) -> str | None:
    """Return the bill of a batch as a table; None for one copy."""
    if work.runs.copies == 1:
        return None
    rows: list[Sequence[object]] = [BILL_COLUMNS]
    rows += [
        (
            item.name,
            item.what,
            item.number,
            None if item.area is None else f"{item.area:.4f}",
            item.quantity,
        )
        for item in bill(work)
    ]
    return csv_text(rows)


def bill(work: Work) -> list[Item]:
    """Return everything needed before the work starts, for all copies."""
    laminate, underlay = work.laminate, work.job.underlay
    items = [*_films(work)]
    if laminate.tube_count:
        number = laminate.tube_count * work.copies
        diameter = units.millimetres(work.design.inlet.tube_outer_diameter)
        tube = tube_name(work.design)
        pieces = f"{units.count(number, 'piece')} + {SPARE_TUBES} spare"
        words = f"{tube}, outer diameter {diameter}"
        items.append(Item("Tube", words, pieces, number + SPARE_TUBES))
        drops = units.count(number, "small drop")
        items.append(Item("Adhesive", acceptance.adhesive_words(work), drops, number))
    wrap = work.design.form.wrap
    if wrap is not None:
        diameter = units.millimetres(wrap.tube_diameter)
        words = f"to wrap the sheet round, outer diameter {diameter}"
        items.append(Item("Tube to wrap", words, str(work.copies), work.copies, kind="wrap"))
        words = f"{wrap.glue}, between sheet and tube (ours: the paper does not say what holds it)"
        items.append(Item("Adhesive of the wrap", words, "as needed", kind="wrap"))
        items.append(replace(THREAD, kind="wrap"))
    width, length = work.design.press.platen
    for name, what, quantity, count in base_plate.items(work):
        area = count * width * length / 1e6 if name == base_plate.RELEASE_FILM else None
        items.append(Item(name, what, quantity, count, area))
    if underlay is not None:
        items.append(_underlay(work, underlay))
        words = (
            f"{base_plate.TAPE}, 0.06 mm thick, 10 mm wide: along the plate's edges, off the films"
        )
        items.append(Item("Tape", words, "as needed"))
    if work.runs.together > 1:
        words = "flat, with a lid, lined as section Batch says; tape for flags round the tubes"
        count = base_plate.trays(work)
        items.append(Item("Tray", words, str(count), count))
        if work.design.order.tray is not False:
            pages = len(tray_sheets(laminate)) * work.runs.together
            words = "tray.pdf printed at 100 % on plain paper; its bars must measure 100 mm"
            items.append(Item("Tray plan", words, units.count(pages, "page"), pages))
    return items


def _underlay(work: Work, path: str) -> Item:
    """Return the pages to print, and the paper if A4 and Letter are too small."""
    spread = leaves(work.laminate, work.runs.places, work.schedule.steps[0].platen_mm)
    width, height = (max(leaf.size[axis] for leaf in spread) for axis in (0, 1))
    paper = "A4 or Letter"
    if (width, height) != PAPER:
        paper = f"at least {units.size(math.ceil(width), math.ceil(height))}"
    join = "; cut out along their dotted frames and laid edge to edge" if len(spread) > 1 else ""
    thick = units.millimetres(work.design.press.underlay_thickness)
    closings, prints = base_plate.hot_prints(work), base_plate.prints(work)
    linings = prints - closings
    tray = f", and one to line {'the tray' if linings == 1 else 'each tray'}" if linings else ""
    words = (
        f"{path} printed at 100 % on plain paper {thick} thick, {paper}; its bars must measure 100 "
        f"mm{join}. A fresh print for each of {units.count(closings, 'closing')} of the press, as "
        f"paper dries there and shrinks{tray}"
    )
    pages = len(spread) * prints
    return Item("Underlay", words, units.count(pages, "page"), pages)


def _films(work: Work) -> list[Item]:
    items = []
    for film in dict.fromkeys(layer.film for layer in work.laminate.layers):
        layers = [layer for layer in work.laminate.layers if layer.film == film]
        area = sum(layer.profile.area for layer in layers) * work.copies / 100
        sheets = [sheet for sheet in work.sheets if sheet.material == film.material]
        sizes = Counter(units.size(sheet.width, sheet.length) for sheet in sheets)
        needed = [f"{units.count(number, 'sheet')} {size}" for size, number in sizes.items()]
        items.append(
            Item(
                f"{film.material} film",
                f"{film.product}, {units.millimetres(film.thickness)} thick; {area:.1f} cm² of "
                f"parts in {units.count(len(layers) * work.copies, 'layer')}",
                ", ".join(needed) or "see the cut files",
                len(sheets) or None,
                sum(sheet.width * sheet.length for sheet in sheets) / 1e6 if sheets else None,
                "film",
            )
        )
    return items


@dataclass(frozen=True)
class Cut:
    """A row of the cut list: one pattern. ``cut_length`` in mm, of one layer."""

    pattern: str
    picture: str
    material: str
    roles: str
    layers: str
    count: int
    spares: int
    pieces: int
    cut_length: float
    sheets: str


def cut_list(work: Work) -> list[Cut]:
    """Return every pattern that is cut, once, in the order of its first layer."""
    return [
        _cut(work, layers)
        for layers in work.laminate.patterns.values()
        if work.laminate.cut_with(layers[0]) == layers[0].index
    ]


def _cut(work: Work, layers: tuple[Layer, ...]) -> Cut:
    first = layers[0]
    folded = [
        layer for layer in work.laminate.layers if work.laminate.cut_with(layer) == first.index
    ]
    is_flat = len(folded) > 1 or first.turned
    profile = work.laminate.as_cut(first) if is_flat else first.profile
    shape = flat_shape(first.pattern) if is_flat else first.pattern
    layers = (*layers, *(layer for layer in folded if layer is not first))
    name = work.design.name
    holding = [
        sheet.path.rpartition("/")[2].removesuffix(".dxf")
        for sheet in work.sheets
        if any((design, pattern) == (name, first.pattern) for design, pattern, _ in sheet.counts)
    ]
    return Cut(
        first.pattern,
        thumbnail(f"thumb-{first.pattern}", shape, first.film, profile.bounds),
        first.film.material,
        ", ".join(dict.fromkeys(layer.role.replace("-", " ") for layer in layers)),
        layer_numbers([layer.index for layer in layers]),
        (len(layers) - len(folded) + 1) * work.copies,
        _spares(work, layers[: len(layers) - len(folded) + 1]),
        len(profile.pieces),
        _cut_length(work, first),
        ", ".join(holding),
    )


def _cut_length(work: Work, layer: Layer) -> float:
    """Return the length of the beam's path around a layer, mm; of its edges if it is on no sheet.

    Equal pieces are one part of a nest with a higher count.
    """
    laminate = work.laminate
    profile = laminate.as_cut(layer) if laminate.folds else layer.profile
    parts = {
        part.piece: part
        for sheet in work.sheets
        for part in sheet.nest.parts
        if (part.design, part.pattern) == (work.design.name, layer.pattern)
    }.values()
    if not parts:
        return sum(contour.length for contour in profile.contours)
    layers = sum(part.count for part in parts) / len(profile.pieces)
    return sum(c.length * part.count for part in parts for c in part.region.contours) / layers


def _spares(work: Work, layers: Sequence[Layer]) -> int:
    """Return the number of spares of a pattern on the sheets."""
    key = work.design.name, layers[0].pattern
    cut = sum(
        count
        for sheet in work.sheets
        for design, pattern, count in sheet.counts
        if (design, pattern) == key
    )
    needed = len(layers) * work.copies
    return max(0, cut // len(layers[0].profile.pieces) - needed)


def kerf_states(job: Job, materials: Sequence[str]) -> list[tuple[str, str, bool]]:
    """Return each material, the text on the kerf of its cut files, and True if it was measured."""
    states = []
    for material in materials:
        kerf = job.kerf.get(material)
        if kerf is None:
            states.append((material, "uncalibrated: edges are nominal", False))
        elif isinstance(kerf, tuple):
            words = f"compensated for {kerf[0]:g} mm along x, {kerf[1]:g} mm along y"
            states.append((material, words, True))
        else:
            states.append((material, f"compensated for {kerf:g} mm", True))
    return states


def kerf_notes(works: Sequence[Work]) -> list[str]:
    """Return the kerf of the cut files, one line for films with the same text."""
    layers = (layer for work in works for layer in work.laminate.layers)
    materials = list(dict.fromkeys(layer.film.material for layer in layers))
    by_words: dict[str, list[str]] = {}
    for material, words, _ in kerf_states(works[0].job, materials):
        by_words.setdefault(words, []).append(material)
    return [f"{joined_words(names)}: {words}" for words, names in by_words.items()]


# Times, beside the paper's.


PAPER_MINUTES = 105.0
"""1.75 h for a 1-DoF or 3-DoF actuator (paper Sec. 4)."""
CONNECT_MINUTES = 2.0
"""Minutes to connect one tube to the test bench and disconnect it: ours."""
CURE_HOURS = 24.0
"""Curing time of the tubes' adhesive in hours if neither order nor kit states one: ours."""


class Time(NamedTuple):
    """A row of the time table: the work, its estimate, and the estimate's parts."""

    what: str
    took: str
    made_of: str


def laser_minutes(work: Work) -> float:
    """Return the laser minutes of all sheets."""
    return sum(sheet.minutes for sheet in work.sheets)


def laser_basis(work: Work) -> str:
    """Return lengths and speeds behind the estimate of the laser's time."""
    laser = work.design.laser
    cut = sum(sheet.cut_length for sheet in work.sheets)
    travel = sum(sheet.travel for sheet in work.sheets)
    contours = sum(sheet.contours for sheet in work.sheets)
    return (
        f"{cut / 1000:.2f} m of cut at {laser.cut_speed:g} mm/s, {travel / 1000:.2f} m of travel "
        f"at {laser.travel_speed:g} mm/s, {units.count(contours, 'contour')} with "
        f"{laser.pierce_seconds:g} s each to pierce, without labels; not a setting of your machine"
    )


def _batch(work: Work) -> list[Time]:
    """Return the rows of the whole batch; empty for a single copy."""
    runs, plan = work.runs, work.schedule
    if runs.copies == 1:
        return []
    took = batch_times(runs, plan)
    made_of = (
        f"{units.count(runs.count, 'press cycle')} of {units.plain(plan.total_press_minutes)} min, "
        f"{runs.copies} times the handling below, one after the other; copies pressed singly: "
        f"{units.minutes(units.product(runs.copies, plan.estimated_build_minutes))}"
    )
    row = f"All {runs.copies} copies"
    return [Time(row, units.whole_minutes(took.total), made_of)]


def times(work: Work) -> list[Time]:
    """Return the rows of the time table; the total comes last but for the paper's."""
    plan = work.schedule
    rows = []
    if work.sheets:
        copies = units.count(work.copies, "copy", "copies")
        basis = f"{laser_basis(work)}; all sheets, {copies}"
        took = units.minutes(laser_minutes(work))
        rows.append(Time("Laser (within handling)", took, basis))
    handling = HANDLING_MINUTES if plan.is_timed else None
    rows.append(Time("Handling", units.minutes(handling), _handling_basis(work)))
    if plan.steps:
        steps = " + ".join(units.plain(step.minutes) for step in plan.steps)
        took = units.minutes(plan.total_press_minutes)
        rows.append(Time("In the press", took, f"{steps} min, one actuator"))
    if plan.seams:
        metres = sum(seam.length_mm for seam in plan.seams)
        rows.append(Time("Seams", "", f"{metres:.0f} mm of path; nobody stated their speed"))
    rows += [*_batch(work), *_waiting_rows(work), total_time(work)]
    # The paper's minutes are for a stack of balloons.
    if not work.design.form.is_drawn:
        took = units.whole_minutes(PAPER_MINUTES)
        basis = "1-DoF or 3-DoF: handling and press; nothing on warming, cooling, curing"
        rows.append(Time("The paper", took, basis))
    return rows


def _handling_basis(work: Work) -> str:
    if work.design.form.is_drawn:
        return "cutting, lay-up, joining, tubes: nobody has timed this design"
    return (
        "cutting, lay-up, pins, tubes: the paper's total less its 45 min in the press, assumed "
        "equal for every design"
    )


class Waiting(NamedTuple):
    """Minutes in addition to handling and press: ``warm`` before the clock of every step, ``cool``
    after it, ``cure`` and ``test`` of one copy.
    """

    warm: float
    cool: float
    cure: float
    test: float


def waiting(work: Work) -> Waiting:
    """Return the minutes of waiting; warming and cooling are estimates until measured."""
    press, acceptance, steps = work.design.press, work.design.acceptance, work.schedule.steps
    built = [part for step in steps for part in step.build_up]
    plate = next((part.thickness_mm for part in built if part.part == BASE_PLATE), 0.0)
    points = [point for step in steps[:1] for point in step.time_temperature]
    measured = next((p.after_minutes for p in points if p.point == START), None)
    tubes = work.laminate.tube_count
    held = (2 * acceptance.leak_seconds + acceptance.proof_seconds) / 60
    return Waiting(
        warm=warm_minutes(plate, press.temperature_c) if measured is None else measured,
        cool=press.cool_minutes or cool_minutes(plate, press.temperature_c),
        cure=60 * (cure_hours(work.design) or CURE_HOURS) if tubes else 0.0,
        test=max(1, tubes) * (held + CONNECT_MINUTES),
    )


def _waiting_rows(work: Work) -> list[Time]:
    """Return warming, cooling, curing and tests."""
    plan, steps = work.schedule, len(work.schedule.steps)
    each = waiting(work)
    is_measured = plan.heating.time_constant_minutes is not None
    rows = []
    if steps:
        warm = "by the τ of this bench" if is_measured else "estimate, until τ is measured"
        cool = "as measured" if work.design.press.cool_minutes else "estimate"
        rows = [
            _waits("Warming the plate", steps, each.warm, warm),
            _waits("Cooling the plate", steps, each.cool, f"{cool}; in still air, to be touched"),
        ]
    if each.cure:
        known = cure_hours(work.design) is not None
        basis = "as stated" if known else "ours: its package says how long"
        rows.append(Time("Curing the adhesive", f"{each.cure / 60:g} h", basis))
    basis = f"leak and proof tests, {units.count(work.laminate.tube_count, 'tube')} (ours)"
    return [*rows, Time("Tests", units.minutes(each.test), basis)]


def _waits(what: str, steps: int, each: float, basis: str) -> Time:
    return Time(what, units.minutes(steps * each), f"{steps} {TIMES} {each:g} min: {basis}")


def total_time(work: Work) -> Time:
    """Return the hours for one actuator, and their parts; a lower bound if the press minutes are
    unknown.
    """
    plan = work.schedule
    each, row = waiting(work), "Total, one actuator"
    if not plan.is_timed or plan.seams:
        basis = "nobody has timed this design; its tests come when the adhesive has cured"
        return Time(row, units.hours(None), basis)
    pressed = plan.total_press_minutes
    least, more = ("", "") if pressed is not None else ("at least ", " and the press minutes")
    worked = HANDLING_MINUTES + (pressed or 0.0) + len(plan.steps) * (each.warm + each.cool)
    cures = f"{each.cure / 60:g} h for the adhesive, " if each.cure else ""
    basis = (
        f"{worked / 60:.1f} h{more} until its tubes are glued, {cures}"
        f"{units.minutes(each.test)} of tests; warming cold platens not included"
    )
    hours = (worked + each.cure + each.test) / 60
    return Time(row, f"{least}{hours:.1f} h{more}", basis)
