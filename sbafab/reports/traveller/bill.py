"""What a job takes: bill of materials, cut list, minutes, and notes on the cut files."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.cutting.fixture import fixture
from sbafab.cutting.properties import (
    COLOURS,
    CUT_INNER,
    CUT_OUTER,
    CUT_SEQUENCE,
    CUT_SHEET,
    ENGRAVE,
    REFERENCE,
)
from sbafab.design.identity import tube_name
from sbafab.laminate.laminate import Layer
from sbafab.pressing.cycles import batch_times
from sbafab.pressing.work_plan import shop_of, work_plan
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.traveller import acceptance, base_plate, units
from sbafab.reports.traveller.job import Job, Work
from sbafab.reports.traveller.shapes import flat_shape, thumbnail
from sbafab.reports.tray_plan import tray_sheets
from sbafab.reports.underlay import PAPER, leaves
from sbafab.spreadsheet import csv_text


@dataclass(frozen=True)
class Item:
    """A row of the bill of materials.

    ``quantity`` is in words, ``number`` what must be at hand, None where it is not counted;
    ``area`` in m2 is that of all of them, where they are film.
    """

    name: str
    what: str
    quantity: str
    number: int | None = None
    area: float | None = None


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
    """Return all that must be at hand before the work starts, for all copies."""
    job, laminate = work.job, work.laminate
    items = [*_films(work)]
    if laminate.tube_count:
        number = laminate.tube_count * job.copies
        diameter = units.millimetres(work.design.inlet.tube_outer_diameter)
        tube = tube_name(work.design)
        items.append(
            Item("Tube", f"{tube}, outer diameter {diameter}", units.count(number, "piece"), number)
        )
        drops = units.count(number, "small drop")
        items.append(Item("Adhesive", acceptance.adhesive_words(work), drops, number))
    wrap = work.design.form.wrap
    if wrap is not None:
        diameter = units.millimetres(wrap.tube_diameter)
        words = f"to wrap the sheet round, outer diameter {diameter}"
        items.append(Item("Tube to wrap", words, str(job.copies), job.copies))
        words = f"{wrap.glue}, between sheet and tube (ours: the paper does not say what holds it)"
        items.append(Item("Adhesive of the wrap", words, "as needed"))
    width, length = work.design.press.platen_width, work.design.press.platen_length
    for name, what, quantity, count in base_plate.items(work):
        area = count * width * length / 1e6 if name == base_plate.RELEASE_FILM else None
        items.append(Item(name, what, quantity, count, area))
    if job.underlay is not None:
        items.append(_underlay(work, job.underlay))
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
    items += [Item(name, "", quantity) for name, quantity in job.extras]
    return items


def _underlay(work: Work, path: str) -> Item:
    """Return the pages to print, and the paper where A4 and Letter are too small."""
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
        area = sum(layer.profile.area for layer in layers) * work.job.copies / 100
        sheets = [sheet for sheet in work.sheets if sheet.material == film.material]
        sizes = Counter(units.size(sheet.width, sheet.length) for sheet in sheets)
        needed = [f"{units.count(number, 'sheet')} {size}" for size, number in sizes.items()]
        items.append(
            Item(
                f"{film.material} film",
                f"{film.product}, {units.millimetres(film.thickness)} thick; {area:.1f} cm² of "
                f"parts in {units.count(len(layers) * work.job.copies, 'layer')}",
                ", ".join(needed) or "see the cut files",
                len(sheets) or None,
                sum(sheet.width * sheet.length for sheet in sheets) / 1e6 if sheets else None,
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
    """Return every pattern that is cut once, in the order of its first layer."""
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
    profile = work.laminate.first_cut(first) if is_flat else first.profile
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
        (len(layers) - len(folded) + 1) * work.job.copies,
        _spares(work, layers[: len(layers) - len(folded) + 1]),
        len(profile.pieces),
        _cut_length(work, first),
        ", ".join(holding),
    )


def _cut_length(work: Work, layer: Layer) -> float:
    """Return the length of the beam's path round a layer, mm; of its edges where it is on no sheet.

    Equal pieces are one part of a nest, cut as many times more.
    """
    laminate = work.laminate
    profile = laminate.first_cut(layer) if laminate.folds else layer.profile
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
    """Return the number of a pattern's spares on the sheets."""
    key = work.design.name, layers[0].pattern
    cut = sum(
        count
        for sheet in work.sheets
        for design, pattern, count in sheet.counts
        if (design, pattern) == key
    )
    needed = len(layers) * work.job.copies
    return max(0, cut // len(layers[0].profile.pieces) - needed)


def kerf_states(job: Job, materials: Sequence[str]) -> list[tuple[str, str, bool]]:
    """Return each material, the words on the kerf of its cut files, and True if it was measured."""
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


# Notes on opening the cut files in other programs: only what was tried or is documented.
#
# Tried with sheets and layer files of this program: LibreCAD 2.2.0 (``librecad dxf2pdf``) and
# Inkscape 1.2.2 (its DXF import, and ``--query-all``). LightBurn: from its documentation only.


COLOUR_NAMES = {1: "red", 5: "blue", 6: "magenta", 7: "black or white", 8: "grey"}
MEANINGS = {
    ENGRAVE: "the sheet's label, in its border; leave it out if you like",
    CUT_INNER: "holes: cut these before the outlines",
    CUT_OUTER: "outlines of the parts",
    CUT_SHEET: "cuts the used sheet off a roll; last",
    REFERENCE: "sheet frame or datum cross; never cut",
}


class CutLayer(NamedTuple):
    """A row of the table of cut layers."""

    order: str
    name: str
    colour: str
    meaning: str


class Program(NamedTuple):
    """A laser or drawing program, what is known of it, and how (``evidence``)."""

    name: str
    evidence: str
    notes: tuple[str, ...]


PROGRAMS = (
    Program(
        "LightBurn",
        "from its documentation, not tried",
        (
            "Open the .lbrn2 beside each DXF: layers, order and a frame without output are set, "
            "and lead-ins, overcuts and tabs where the design asks for them. Powers are 0 unless "
            "its notes name a recipe: set power and speed of each layer. The rest of this list is "
            "only for the DXF.",
            "Each colour becomes a layer of its own in the Cuts / Layers window. By default layers "
            "run in the order of that window, from the top: bring them into the order above.",
            "Switch Output off for the layer of the grey REFERENCE lines.",
            "Set every cut layer to Line mode, Kerf Offset 0.",
            "Optimization Settings count only while Optimize Cut Path is on: keep Order by Layer "
            "first and Cut inner shapes first on, as they are by default.",
            "We do not know which units it assumes for a DXF: compare the overall size above "
            "before you cut.",
            "Run Preview and watch the order of the holes and outlines.",
        ),
    ),
    Program(
        "Inkscape",
        "tried: 1.2.2",
        (
            "Use File > Open, not Import: only then the layers keep their names (its own help says "
            "so). In the DXF dialog choose “Read from file”, or “Manual scale” with 1.0: the size "
            "is then right.",
            "Do not choose “Automatic scaling to size A4”: it enlarges the drawing.",
            "Circles and arcs stay true arcs, layer colours are kept.",
            "Sizes include the width of the line unless its preferences are set to the geometric "
            "bounding box.",
        ),
    ),
    Program(
        "LibreCAD",
        "tried: 2.2.0",
        (
            "Opens the DXF correctly: layers, colours and arcs are right. Printed at scale 1:1 the "
            "parts have their size, to 0.1 mm.",
            "REFERENCE does not print: no frame on paper is right.",
        ),
    ),
)


def cut_layers() -> list[CutLayer]:
    """Return the layers in cutting order, what is not cut last."""
    numbered = {name: str(place) for place, name in enumerate(CUT_SEQUENCE, 1)}
    return [
        CutLayer(
            numbered.get(name, "not cut"),
            name,
            f"{COLOUR_NAMES[COLOURS[name]]} ({COLOURS[name]})",
            MEANINGS[name],
        )
        for name in (*CUT_SEQUENCE, REFERENCE)
    ]


def expected_sizes(work: Work) -> list[tuple[str, str]]:
    """Return file and overall size after opening, for every sheet and the base plate."""
    expected = [(sheet.path, units.size(sheet.width, sheet.length)) for sheet in work.sheets]
    press = work.design.press
    platen = press.platen_width, press.platen_length
    plate = fixture(work.laminate, platen, work.runs.places)
    if work.job.fixture is not None and plate is not None:
        low_x, low_y, high_x, high_y = plate.bounds
        expected.append((work.job.fixture, units.size(high_x - low_x, high_y - low_y)))
    return expected


def kerf_notes(work: Work) -> list[str]:
    """Return the kerf setting of the laser's program, a line for each material."""
    materials = list(dict.fromkeys(layer.film.material for layer in work.laminate.layers))
    return [
        f"{material}: {words}. "
        + (
            "The paths are compensated already: set kerf offset 0 in the laser's program."
            if measured
            else "No offset is known: set kerf offset 0 in the laser's program, and calibrate."
        )
        for material, words, measured in kerf_states(work.job, materials)
    ]


# Times, next to the paper's.


PAPER_MINUTES = 105.0
"""1.75 h for a 1-DoF or 3-DoF actuator (paper Sec. 4)."""


class Time(NamedTuple):
    """A row of the time table: the work, its estimate, and what that is made of."""

    what: str
    took: str
    made_of: str


def laser_minutes(work: Work) -> float:
    """Return the minutes of laser of all sheets."""
    return sum(sheet.minutes for sheet in work.sheets)


def laser_basis(work: Work) -> str:
    """Return lengths and speeds that the estimate of the laser's time assumes."""
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
    rows = [Time(row, units.whole_minutes(took.total), made_of)]
    days = {entry.day for entry in work_plan(work.design, work.laminate, plan, runs.copies)}
    if days:
        shop = shop_of(work.design)
        means = ", ".join(
            (
                units.count(shop.technicians, "technician"),
                units.count(shop.presses, "press", "presses"),
                units.count(shop.plates, "base plate"),
            )
        )
        words = f"sorting, warming, cooling, curing and tests included, see section Batch; {means}"
        rows.append(Time("In working days", str(max(days)), words))
    return rows


def times(work: Work) -> list[Time]:
    """Return the rows of the time table, the total last but for the paper's."""
    plan = work.schedule
    # The paper's minutes are those of a stack of balloons.
    is_drawn = work.design.form.is_drawn
    handling = plan.hands_minutes if plan.is_timed else None
    total = plan.estimated_build_minutes
    basis = (
        "cutting, lay-up, joining, tubes: nobody has timed this design"
        if is_drawn
        else "cutting, lay-up, pins, tubes: the paper's total less its 45 min in the press, "
        "assumed equal for every design"
    )
    steps = " + ".join(units.plain(step.minutes) for step in plan.steps)
    rows = []
    if plan.steps:
        took = units.minutes(plan.total_press_minutes)
        rows.append(Time("In the press", took, f"{steps} min, one actuator"))
    if plan.seams:
        metres = sum(seam.length_mm for seam in plan.seams)
        rows.append(Time("Seams", "", f"{metres:.0f} mm of path; nobody stated their speed"))
    if work.sheets:
        copies = units.count(work.job.copies, "copy", "copies")
        rows.append(
            Time(
                "Laser (within handling)",
                units.minutes(laser_minutes(work)),
                f"{laser_basis(work)}; all sheets, {copies}",
            )
        )
    papers = Time(
        "The paper", f"{PAPER_MINUTES:g} min = {units.hours(PAPER_MINUTES)}", "1-DoF or 3-DoF"
    )
    return [
        *rows,
        *_batch(work),
        Time(
            "Handling",
            units.minutes(handling),
            basis,
        ),
        Time(
            "Total, one actuator",
            units.whole_minutes(total),
            "not included: heating the press, warming the plate before each clock starts, curing "
            "the adhesive, leak and proof tests",
        ),
        *(() if is_drawn else (papers,)),
    ]
