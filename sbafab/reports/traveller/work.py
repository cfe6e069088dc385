"""A build with its sheets, as shown on the pages for the bench: times, materials and parts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from sbafab.cutting.fixture import PATH as FIXTURE
from sbafab.cutting.sheets import SheetFile
from sbafab.design.identity import adhesive_for, cure_hours, tube_name
from sbafab.folders.build import Build
from sbafab.laminate.films import FIRST, Film
from sbafab.laminate.laminate import Layer
from sbafab.pressing.build_up import BASE_PLATE, PAD, RELEASE, UNDERLAY, pad_sheets
from sbafab.pressing.dowels import pin_holes
from sbafab.pressing.plate_heating import START, cool_minutes, warm_minutes
from sbafab.pressing.schedule import HANDLING_MINUTES, Step, joined_words
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.prints import NAME, PAPER, guides, leaves, tray_sheets
from sbafab.reports.traveller.formatting import BLANK, count, millimetres, size
from sbafab.reports.traveller.pictures import thumbnail
from sbafab.spreadsheet import csv_text

CONNECT_MINUTES = 2.0  # to connect one tube to the test bench and disconnect it: ours
CURE_HOURS = 24.0  # of the tubes' adhesive if neither order nor kit states them: ours


@dataclass(frozen=True, eq=False)
class Work(Build):
    """A build with the ``sheets`` for all copies.

    ``folder`` is the path from the page to the design's files, ``solid_png`` the picture of the
    solid, as bytes.
    """

    sheets: Sequence[SheetFile] = ()
    folder: str = ""
    solid_png: bytes | None = None

    @property
    def copies(self) -> int:
        """The number of actuators to make."""
        return self.design.order.quantity

    @cached_property
    def films(self) -> list[Film]:
        """Every film once, in the order of the layers."""
        return list(dict.fromkeys(layer.film for layer in self.laminate.layers))

    @property
    def fixture(self) -> str | None:
        """The path of the base plate's cut file; None if no pins are used."""
        return f"{self.folder}{FIXTURE}" if self.laminate.pins else None

    @cached_property
    def underlay(self) -> str | None:
        """The path of the lay-up page; None if pins hold every part in every step."""
        return f"{self.folder}{NAME}" if guides(self.laminate) else None


class Times(NamedTuple):
    """The minutes ``warm`` before the clock of every step, ``cool`` after it, ``cure`` and ``test``
    of one actuator, and at least ``worked`` until its tubes are glued: unstated press minutes count
    as 0.
    """

    warm: float
    cool: float
    cure: float
    test: float
    worked: float

    @property
    def total(self) -> float:
        return self.worked + self.cure + self.test


def times(work: Work) -> Times:
    """Return the times of one actuator; warming and cooling are estimates until measured."""
    press, acceptance, steps = work.design.press, work.design.acceptance, work.schedule.steps
    built = [part for step in steps for part in step.build_up]
    plate = next((part.thickness_mm for part in built if part.part == BASE_PLATE), 0.0)
    points = [point for step in steps[:1] for point in step.time_temperature]
    measured = next((p.after_minutes for p in points if p.point == START), None)
    warm = warm_minutes(plate, press.temperature_c) if measured is None else measured
    cool = press.cool_minutes or cool_minutes(plate, press.temperature_c)
    tubes = work.laminate.tube_count
    tested = (2 * acceptance.leak_seconds + acceptance.proof_seconds) / 60
    pressed = work.schedule.total_press_minutes or 0.0
    cure = 60 * (cure_hours(work.design) or CURE_HOURS) if tubes else 0.0
    test = max(1, tubes) * (tested + CONNECT_MINUTES)
    return Times(warm, cool, cure, test, HANDLING_MINUTES + pressed + len(steps) * (warm + cool))


def assembly_times(works: Sequence[Work]) -> dict[str, Any]:
    """Return the minutes before the parts of an assembly can be joined: ``waited`` for plates to
    warm and cool, ``worked`` until all tubes are glued, and the longest ``cure``; ``is_known``: all
    press minutes are stated.
    """
    waited = handled = cure = 0.0
    for work in works:
        each, count = times(work), work.cycles.count
        waited += count * len(work.schedule.steps) * (each.warm + each.cool)
        handled += count * (work.schedule.total_press_minutes or 0.0)
        handled += HANDLING_MINUTES * work.cycles.copies
        cure = max(cure, each.cure)
    is_known = all(work.schedule.total_press_minutes is not None for work in works)
    return {"waited": waited, "worked": handled + waited, "cure": cure, "is_known": is_known}


# Materials: films, tubes and press supplies.


TAPE = "polyimide tape (silicone adhesive, rated 260 °C)"
SPARE_TUBES = 1
BILL_COLUMNS = ("item", "specification", "needed", "area_m2", "quantity")


class Item(NamedTuple):
    """A row of the bill of materials.

    ``quantity`` is a text, ``number`` the count needed, None if uncounted; ``area`` is the total
    area of film in m2.
    """

    name: str
    what: str
    quantity: str = "as needed"
    number: int | None = None
    area: float | None = None


THREAD = Item("Thread", "ties supply tubes, loose enough for them to slide")


def bill_csv(work: Work) -> str | None:
    """Return the bill of a batch as a table; None for one copy."""
    if work.cycles.copies == 1:
        return None
    rows: list[Sequence[object]] = [BILL_COLUMNS]
    for name, what, quantity, number, area in bill(work):
        rows.append((name, what, number, None if area is None else f"{area:.4f}", quantity))
    return csv_text(rows)


def bill(work: Work) -> list[Item]:
    """Return all materials for all copies."""
    return [*film_items([work]), *_tubes(work), *_wrap(work), *_supplies(work)]


def items_of_part(work: Work) -> list[Item]:
    """The materials of a design in an assembly besides films; its wrap belongs to the assembly."""
    return [*_tubes(work), *_supplies(work)]


def films_of(works: Sequence[Work]) -> list[Film]:
    """Return every film of designs once, in the order of the layers."""
    return list(dict.fromkeys(film for work in works for film in work.films))


def film_items(works: Sequence[Work]) -> Iterator[Item]:
    """Yield each film of designs on common sheets."""
    for film in films_of(works):
        layers = [(w, layer) for w in works for layer in w.laminate.layers if layer.film == film]
        area = sum(work.copies * layer.profile.area for work, layer in layers) / 100
        sheets = [sheet for sheet in works[0].sheets if sheet.material == film.material]
        sizes = Counter(size(sheet.width, sheet.length) for sheet in sheets)
        needed = [f"{count(number, 'sheet')} {of_size}" for of_size, number in sizes.items()]
        yield Item(
            f"{film.material} film",
            f"{film.product}, {millimetres(film.thickness)} thick; {area:.1f} cm² of parts in "
            f"{count(sum(work.copies for work, _ in layers), 'layer')}",
            ", ".join(needed) or "see the cut files",
            len(sheets) or None,
            sum(sheet.width * sheet.length for sheet in sheets) / 1e6 if sheets else None,
        )


def _tubes(work: Work) -> Iterator[Item]:
    number = work.laminate.tube_count * work.copies
    if number:
        diameter = millimetres(work.design.inlet.tube_outer_diameter)
        pieces = f"{count(number, 'piece')} + {SPARE_TUBES} spare"
        words = f"{tube_name(work.design)}, outer diameter {diameter}"
        yield Item("Tube", words, pieces, number + SPARE_TUBES)
        yield Item("Adhesive", adhesive_words(work), count(number, "small drop"), number)


def adhesive_words(work: Work) -> str:
    """Return the adhesive of the tubes; if unstated, a blank and the materials to be bonded."""
    films = work.laminate.glued_films
    adhesive = adhesive_for(work.design, films)
    if adhesive is not None:
        return adhesive
    names = joined_words(list(dict.fromkeys(film.product for film in films)))
    return f"{BLANK} (nobody stated an adhesive for {names}: try one on scrap, with the tube)"


def _wrap(work: Work) -> Iterator[Item]:
    wrap = work.design.form.wrap
    if wrap is not None:
        words = f"to wrap the sheet round, outer diameter {millimetres(wrap.outer_diameter)}"
        yield Item("Tube to wrap", words, str(work.copies), work.copies)
        words = f"{wrap.glue}, between sheet and tube (ours: the paper does not say what holds it)"
        yield Item("Adhesive of the wrap", words)
        yield THREAD


def _supplies(work: Work) -> Iterator[Item]:
    """Yield the supplies of the press: pins, plate, films, pad, and prints for the lay-up."""
    if work.schedule.steps:
        yield from _pins(work)
        yield from _build_up(work)
    if work.underlay is not None:
        yield _underlay(work, work.underlay)
        words = f"{TAPE}, 0.06 mm thick, 10 mm wide: along the plate's edges, off the films"
        yield Item("Tape", words)
    if work.cycles.together > 1:
        words = "flat, with a lid, lined as section Batch says; tape for flags round the tubes"
        yield Item("Tray", words, str(_trays(work)), _trays(work))
        if work.design.order.tray is not False:
            pages = len(tray_sheets(work.laminate)) * work.cycles.together
            words = "tray.pdf printed at 100 % on plain paper; its bars must measure 100 mm"
            yield Item("Tray plan", words, count(pages, "page"), pages)


def _pins(work: Work) -> Iterator[Item]:
    holes = pin_holes([step.pin_settings for step in work.schedule.steps])
    sizes = Counter(
        (pin.diameter, length)
        for pin in work.laminate.pins * work.cycles.together
        if pin.name in holes
        for length in holes[pin.name].lengths
    )
    for (diameter, length), number in sorted(sizes.items()):
        spare = max(2, number // 2)
        words = (
            f"{work.design.registration.pin_standard}, ⌀{millimetres(diameter)} m6, "
            f"{millimetres(length)} long; spares to choose from"
        )
        yield Item("Dowel pins", words, f"{number} + {spare} spare", number + spare)


def _build_up(work: Work) -> Iterator[Item]:
    first = work.schedule.steps[0]
    parts = {item.part: item for item in first.build_up}
    platen = size(*first.platen_mm)

    def product(part: str, more: str = "") -> str:
        item = parts[part]
        return f"{item.material}, {millimetres(item.thickness_mm)}{more}, {platen}"

    holes = f"stepped holes from {work.fixture} and the table in bench.html"
    holes = holes if work.fixture else "no holes"
    yield Item("Base plate", f"{product(BASE_PLATE)}; {holes}", "1", 1)
    has_tpe = any(film.material == FIRST[0] for film in work.films)
    turned = "; one of them for films that are turned over" if turns_over(work) else ""
    words = (
        f"{product(RELEASE)}; {'TPE' if has_tpe else 'films'} must not stick to it at press "
        f"temperature (our advice; the paper names none){turned}"
    )
    number = release_films(work)
    area = number * first.platen_mm[0] * first.platen_mm[1] / 1e6
    yield Item("Release film", words, str(number), number, area)
    sheets = pad_sheets(parts[PAD].thickness_mm)
    piled = f", a pile of {sheets} sheets" if sheets > 1 else ""
    words = (
        f"{product(PAD, piled)}, for {first.temperature_c:g} °C in continuous use (our advice; the "
        "paper names none)"
    )
    yield Item("Press pad", words, str(sheets), sheets)


def _underlay(work: Work, path: str) -> Item:
    """Return the pages to print, and the paper if A4 and Letter are too small."""
    spread = leaves(work.laminate, work.cycles.places, work.schedule.steps[0].platen_mm)
    width, height = (max(leaf.size[axis] for leaf in spread) for axis in (0, 1))
    paper = "A4 or Letter"
    if (width, height) != PAPER:
        paper = f"at least {size(math.ceil(width), math.ceil(height))}"
    join = "; cut out along their dotted frames and laid edge to edge" if len(spread) > 1 else ""
    linings = _trays(work)
    tray = f", and one to line {'the tray' if linings == 1 else 'each tray'}" if linings else ""
    words = (
        f"{path} printed at 100 % on plain paper "
        f"{millimetres(work.design.press.underlay_thickness)} thick, {paper}; its bars must "
        f"measure 100 mm{join}. A fresh print for each of "
        f"{count(prints(work) - linings, 'closing')} of the press, as paper dries there and "
        f"shrinks{tray}"
    )
    pages = len(spread) * prints(work)
    return Item("Underlay", words, count(pages, "page"), pages)


def has_underlay(step: Step) -> bool:
    return any(item.part == UNDERLAY for item in step.build_up)


def prints(work: Work) -> int:
    """Return the number of underlay prints needed: one per hot closing, one per tray."""
    if work.underlay is None:
        return 0
    return work.cycles.count * sum(map(has_underlay, work.schedule.steps)) + _trays(work)


def _trays(work: Work) -> int:
    """Return the number of trays for films between steps: one per cycle of several laminates."""
    return work.cycles.count if work.cycles.together > 1 else 0


def release_films(work: Work) -> int:
    """Return the release films for all cycles: two new ones for each closing of the press, and one
    for films that are turned over.
    """
    return 2 * work.cycles.count * len(work.schedule.steps) + turns_over(work)


def turns_over(work: Work) -> bool:
    """Return True if films are turned over for pushing out their pins."""
    return any(step.pin_settings for step in work.schedule.steps)


# The parts to cut.


def cut_list(work: Work) -> list[dict[str, Any]]:
    """Return every cut pattern once, in the order of its first layer."""
    return [
        _cut(work, layers)
        for layers in work.laminate.patterns.values()
        if work.laminate.cut_with(layers[0]) == layers[0].index
    ]


def _cut(work: Work, same: Sequence[Layer]) -> dict[str, Any]:
    """Return the row of layers of the same pattern; halves of a folded film are one part."""
    laminate, first = work.laminate, same[0]
    halves = [half for half in laminate.layers if laminate.cut_with(half) == first.index]
    is_flat = len(halves) > 1 or first.turned
    profile = laminate.as_cut(first) if is_flat else first.profile
    layers = [*same, *(half for half in halves if half is not first)]
    on_sheets = {
        sheet.path.rpartition("/")[2].removesuffix(".dxf"): number
        for sheet in work.sheets
        for design, pattern, number in sheet.counts
        if (design, pattern) == (work.design.name, first.pattern)
    }
    needed = (len(layers) - len(halves) + 1) * work.copies
    return {
        "pattern": first.pattern,
        "picture": thumbnail(first.pattern, is_flat, first.film, profile.bounds),
        "material": first.film.material,
        "roles": ", ".join(dict.fromkeys(layer.role.replace("-", " ") for layer in layers)),
        "layers": layer_numbers([layer.index for layer in layers]),
        "parts": needed,
        "spares": max(0, sum(on_sheets.values()) // len(first.profile.pieces) - needed),
        "pieces": len(profile.pieces),
        # mm, of one layer
        "cut_length": _cut_length(work, first),
        "sheets": ", ".join(on_sheets),
    }


def _cut_length(work: Work, layer: Layer) -> float:
    """Return the length of the beam's path around a layer, mm; of its edges if it is on no sheet.

    Equal pieces are one part of a nest with a higher count.
    """
    profile = work.laminate.as_cut(layer) if work.laminate.folds else layer.profile
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
