"""bench.html: work and measurements done once per bench; fixing and cutting of films.

This content is not from the paper.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from operator import itemgetter
from typing import Any

from sbafab.assemblies.build import Assembled
from sbafab.cutting.fixture import plate_corner, whole_plate
from sbafab.design.identity import adhesive_for
from sbafab.design.sections import HoldDown
from sbafab.laminate.base_plate import HOLE_PROCESSES, for_a_cnc_mill, most_play, pin_error
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS, Film
from sbafab.laminate.joints import SeamTool
from sbafab.laminate.lay_up import films_without_minutes
from sbafab.pressing.dowels import push_out
from sbafab.pressing.plate_heating import MELTING, PATIENCE, START
from sbafab.pressing.schedule import plate_holes
from sbafab.reports.traveller.formatting import NEWTONS_PER_POUND, frame, render
from sbafab.reports.traveller.work import Work, films_of, has_underlay
from sbafab.rules.pin_fit import NAME as PIN_FIT
from sbafab.rules.pin_fit import most_on_a_pin

# Cutting: how films are held, and how parts are taken off the sheet.


def held_films(works: Sequence[Work]) -> Iterator[dict[str, Any]]:
    """Yield every film of sheets whose parts all come free, with its fixing, the number of parts
    and the mass of the ``lightest``, mg (None if its density is unknown). Masks are fixed like
    PTFE.
    """
    for film in films_of(works):
        count, area = 0, math.inf
        for work in works:
            laminate = work.laminate
            for layers in laminate.patterns.values():
                # Halves of a folded film are one part.
                cut = [layer for layer in layers if laminate.cut_with(layer) == layer.index]
                if cut and cut[0].film == film:
                    shape = laminate.as_cut(cut[0]) if laminate.folds else cut[0].profile
                    needed = len(cut) * work.copies
                    count += len(shape.pieces) * (needed + work.design.order.spare_parts(needed))
                    area = min(area, *(piece.area for piece in shape.pieces))
        mass = None if film.density is None else area * film.thickness * film.density / 1000
        hold = _hold(works[0], film)
        yield {"film": film, "hold": hold, "parts": count, "lightest": mass}


def _hold(work: Work, film: Film) -> HoldDown:
    beam = work.design.laser
    return beam.hold_ptfe if film.is_mask else beam.hold_tpe


def cutting(works: Sequence[Work]) -> dict[str, Any]:
    """Return the facts of the section on cutting, for designs on common sheets.

    The laser's minutes, metres of cut and travel, and contours are those of all sheets.
    ``tight_pin``: the finding of pin-fit on the design whose films stretch most, the design, and
    the most films on one pin; None without such a finding. ``loose`` and ``spare`` count the pieces
    of masks in several pieces.
    """
    sheets = works[0].sheets
    tight = [
        (finding.measured, finding.limit or 0.0, work.design, most_on_a_pin(work.laminate))
        for work in works
        for finding in work.findings
        if finding.rule == PIN_FIT and finding.measured
    ]
    loose = [
        (pieces * needed, pieces * work.design.order.spare_parts(needed))
        for work, pieces, needed in _loose_masks(works)
    ]
    return {
        "laser": {
            "minutes": sum(sheet.minutes for sheet in sheets),
            "cut": sum(sheet.cut_length for sheet in sheets) / 1000,
            "travel": sum(sheet.travel for sheet in sheets) / 1000,
            "contours": sum(sheet.contours for sheet in sheets),
        },
        "program": works[0].design.sheets.program,
        "kerf_notes": _kerf_notes(works),
        "held": list(held_films(works)),
        "tight_pin": max(tight, key=itemgetter(0), default=None),
        "loose": sum(needed for needed, _ in loose),
        "spare": sum(spare for _, spare in loose),
    }


def _loose_masks(works: Sequence[Work]) -> Iterator[tuple[Work, int, int]]:
    """Yield the masks in several pieces: their pieces, and the layers needed."""
    for work in works:
        for layers in work.laminate.patterns.values():
            pieces = len(layers[0].profile.pieces)
            if layers[0].is_mask and pieces > 1:
                yield work, pieces, len(layers) * work.copies


def _kerf_notes(works: Sequence[Work]) -> dict[str, list[str]]:
    """Return the materials by the note on the kerf of their cut files."""
    notes: dict[str, list[str]] = {}
    for film in films_of(works):
        kerf = works[0].design.kerf_widths.get(film.material)
        words = "uncalibrated: edges are nominal"
        if isinstance(kerf, tuple):
            words = f"compensated for {kerf[0]:g} mm along x, {kerf[1]:g} mm along y"
        elif kerf is not None:
            words = f"compensated for {kerf:g} mm"
        notes.setdefault(words, []).append(film.material)
    return notes


def nominal(works: Sequence[Work]) -> list[str]:
    """Return the materials whose kerf was not measured."""
    widths = works[0].design.kerf_widths
    materials = dict.fromkeys(film.material for film in films_of(works))
    return [material for material in materials if widths.get(material) is None]


# Pressure-indicating film.


FILM_CLASSES = (
    ("extreme low pressure", "4LW", 50, 200),
    ("ultra super low pressure", "LLLW", 200, 600),
    ("super low pressure", "LLW", 500, 2500),
)
"""Two-sheet films of Fujifilm Prescale, by the ranges in kPa in its maker's list as far as we know:
the list was not opened, so the page asks to compare them with the box."""


def pressure_range(works: Sequence[Work]) -> tuple[float, float]:
    """Return the lowest and highest pressure in kPa anywhere on the films."""
    steps = [step for work in works for step in work.schedule.steps]
    low = min(min(step.film_kpa, step.bond_kpa, step.plate_kpa) for step in steps)
    return low, max(max(step.edge_kpa, step.film_kpa) for step in steps)


# The page.


WANTED = 0.05  # accuracy of setting the pressure on a gauge, as a share: ours
MOST_RAISED = 5.0  # excess in C that the platens may have over the schedule's temperature: ours
MOST_LISTED = 9  # up to this many places of a plate each is listed
PUNCH_PLAY = 0.1  # difference in mm between the push-out hole and the punch


def punch(diameter: float) -> float:
    """Return the diameter of the punch for pins of this diameter, mm."""
    return round(push_out(diameter) - PUNCH_PLAY, 2)


def bench_html(
    title: str, sha256: str, works: Sequence[Work], assembled: Assembled | None = None
) -> str:
    """Return the page for work done once per bench, for all designs of a folder."""
    pressed = [work for work in works if work.schedule.steps]
    films = films_of(works)
    hands = [w.design.registration for w in works if w.laminate.registration == "channel-pin"]
    return render(
        "bench.html.j2",
        **frame(title, sha256),
        shapes="",
        works=works,
        design=works[0].design,
        assembled=assembled,
        nominal=nominal(works),
        warned=[film.material for film in films if film.warning],
        plates=[_plate(work) for work in works if work.fixture is not None],
        cnc=HOLE_PROCESSES["cnc-mill"],
        loupe=min((hand.hand_placement for hand in hands), default=None),
        prints=any(work.underlay is not None for work in works),
        **_trials(works),
        **_tools(works, films),
        **(_heat_and_force(pressed) if pressed else {"first": None}),
    )


def _trials(works: Sequence[Work]) -> dict[str, object]:
    """Return the films that need a trial of bond and adhesive: all but the paper's and masks."""
    papers = [(PAPER_PRODUCT, PAPER_THICKNESS)]
    bonded = [film for work in works for film in films_without_minutes(work.laminate, papers)]
    glued = [film.product for work in works for film in work.laminate.glued_films]
    return {
        "bonded": list(dict.fromkeys(film.said for film in bonded)),
        "glued": [product for product in dict.fromkeys(glued) if product != PAPER_PRODUCT],
        "adhesive": adhesive_for(works[0].design, works[0].laminate.glued_films),
    }


def _tools(works: Sequence[Work], films: Iterable[Film]) -> dict[str, object]:
    """Return the facts that determine the tools, without consumables."""
    laminates = [work.laminate for work in works]
    steps = [step for work in works for step in work.schedule.steps]
    seams: dict[SeamTool, set[float]] = {}
    for seam in (seam for work in works for seam in work.schedule.seams):
        seams.setdefault(seam.tool, set()).add(seam.width_mm)
    pins = sorted({pin.diameter for laminate in laminates for pin in laminate.pins})
    return {
        "holds": {_hold(works[0], film) for film in films},
        "has_loose": any(_loose_masks(works)),
        "pins": [(diameter, punch(diameter)) for diameter in pins],
        "pricks_paper": any(step.pin_settings and has_underlay(step) for step in steps),
        "seam_tools": seams,
        "has_tubes": any(laminate.tube_count for laminate in laminates),
        "has_tabs": any(laminate.inlets for laminate in laminates),
        "has_ears": any(laminate.registration == "ears" for laminate in laminates),
    }


def _plate(work: Work) -> dict[str, Any]:
    """Return the base plate of a design: the accuracy of its holes and their table, mm."""
    design, laminate, places = work.design, work.laminate, work.cycles.places
    machine, pin = design.registration.plate_made_by, design.thickest_pin
    several = len(laminate.pins) > 1
    finer = several and design.registration.pin_error is None and machine == "jig-borer"
    low_x, low_y, high_x, high_y = whole_plate(laminate, design.press.platen, places).bounds
    xs, ys = (sorted({place[axis] for place in places}) for axis in (0, 1))
    return {
        "work": work,
        "size": (high_x - low_x, high_y - low_y),
        "several": several,
        "making": HOLE_PROCESSES[machine],
        "play": most_play(pin, machine),
        "counted": design.pin_error if several else design.lone_pin_error,
        "coarse": pin_error(pin, "cnc-mill"),
        "command": for_a_cnc_mill("design.toml") if finer else "",
        "corner": plate_corner(laminate, design.press.platen, places),
        "holes": plate_holes(laminate, design),
        "places": places,
        "is_listed": len(places) <= MOST_LISTED,
        "columns": len(xs),
        "pitch": [steps[1] - steps[0] if len(steps) > 1 else 0.0 for steps in (xs, ys)],
    }


def _heat_and_force(works: Sequence[Work]) -> dict[str, Any]:
    """Return the page's values for time, temperature and force."""
    first, heating = works[0].schedule.steps[0], works[0].schedule.heating
    points = {point.point: point for point in first.time_temperature}
    start, melting = points[START], points.get(MELTING)
    pound = first.pressure_kpa / first.force_n * NEWTONS_PER_POUND
    low, high = pressure_range(works)
    return {
        "first": first,
        "heating": heating,
        "reach": heating.platen_c - (heating.platen_c - heating.start_c) * math.exp(-1),
        "patience": PATIENCE,
        "most_raised": MOST_RAISED,
        "closings": sum(work.cycles.count * len(work.schedule.steps) for work in works),
        "pressures": (low, high),
        # The fewest classes that cover the range, as far as possible.
        "film_classes": [film for film in FILM_CLASSES if film[2] < high and film[3] > low],
        "pound_kpa": pound,
        "division_lbf": 2 * WANTED * first.pressure_kpa / pound,
        "division_n": 2 * WANTED * first.force_n,
        "start": start,
        "melting": melting,
        "molten": (start.after_constants or 0) - ((melting or start).after_constants or 0),
    }
