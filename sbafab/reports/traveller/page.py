"""traveller.html: one page that goes from the laser to the press and comes back with an actuator.

Self-contained: style and pictures are inline, nothing is fetched. Same input, same bytes: the
browser writes the date of a print.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from string import ascii_uppercase
from typing import Any, NamedTuple

from sbafab.cutting.sheets import SheetFile
from sbafab.design.identity import cited, departures, tube_name
from sbafab.design.records import Design
from sbafab.laminate.assembly import pins_when_added
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.models.formulas import sizes
from sbafab.pressing.schedule import joined_words, layers_in_words
from sbafab.reports.canvas import COLOURS, KEY
from sbafab.reports.drawing import TIMES, balloons, layer_numbers
from sbafab.reports.html_templates import environment
from sbafab.reports.traveller import acceptance, base_plate, bench, bill, process, units
from sbafab.reports.traveller.batch import batch_page
from sbafab.reports.traveller.bill import kerf_states
from sbafab.reports.traveller.job import HERE, Work, frame
from sbafab.reports.traveller.joints import joint_pages
from sbafab.reports.traveller.record_sheet import HISTORY_FIELDS, record_tables
from sbafab.reports.traveller.shapes import Round, definitions, pattern_regions, rounds
from sbafab.reports.traveller.sheet_map import (
    is_long,
    marked,
    part_regions,
    picture_note,
    sheet_map,
)
from sbafab.rules.finding import Finding
from sbafab.rules.limits import CHECKED_AGAINST

TEMPLATE = "traveller.html.j2"
BY_HAND = "none (by hand)"


def traveller_html(work: Work) -> str:
    """Return the whole page."""
    return environment(HERE).get_template(TEMPLATE).render(context(work))


def context(work: Work) -> dict[str, Any]:
    """Return the values of one design for the templates."""
    laminate, job = work.laminate, work.job
    text = record_text(laminate.name, job.design_sha256, job.generator)
    other_marks = _other_marks(work)
    # A drawing's notes concern its lay-up; other families' notes concern trimming.
    is_drawn = work.design.form.is_drawn
    notes = tuple(f"{note.rstrip('.')}." for note in laminate.notes)
    return {
        **frame(laminate.name, job.design_sha256, job.generator),
        "work": work,
        "design": work.design,
        "laminate": laminate,
        "schedule": work.schedule,
        "job": job,
        "shapes": definitions(chain(pattern_regions(laminate), part_regions(work.sheets))),
        "family": work.design.form.words,
        "facts": _facts(work),
        "kit": cited(work.design),
        "departures": len(departures(work.design)),
        "code": code_svg(text),
        "code_text": text,
        "legend": _legend(laminate),
        "solid": None if job.solid_png is None else b64encode(job.solid_png).decode("ascii"),
        "cautions": [*cautions(work), *for_the_designer(job.findings)],
        "step_rows": process.step_rows(work),
        "lay_up": _lay_up(work),
        "lay_up_notes": notes if is_drawn else (),
        "turned": _turned(laminate),
        "before_cutting": bench.before_cutting([work]),
        "after_cutting": bench.after_cutting([work]),
        "bill": bill.bill(work),
        **to_be_ready([work]),
        "others": other_marks,
        "other_films": joined_words(
            [film.written for film in films(laminate) if film.written != film.material]
        ),
        "sheet_rows": sheet_rows(work.design, work.sheets, {work.design.name: "", **other_marks}),
        "program": work.design.sheets.program,
        "cuts": bill.cut_list(work),
        "laser_minutes": bill.laser_minutes(work),
        "laser_basis": bill.laser_basis(work),
        "kerf_notes": bill.kerf_notes([work]),
        "trim_notes": () if is_drawn else notes,
        "batch": batch_page(work),
        **process.every_step(work),
        "step_pages": process.step_pages(work),
        "joint_pages": joint_pages(work),
        **acceptance.values(work),
        "times": bill.times(work),
        "total_time": bill.total_time(work),
        "castings": (),
        "in_chapter": False,
        "again": False,
        "record_fields": HISTORY_FIELDS,
        "record_tables": record_tables(work.design, laminate, work.schedule),
    }


def to_be_ready(works: Sequence[Work]) -> dict[str, Any]:
    """Return the preparations before the lay-up: cut, printed and dry."""
    pressed = [work for work in works if work.schedule.steps]
    underlaid = [work for work in works if work.job.underlay is not None]
    return {
        "release_films": sum(base_plate.release_films(work) for work in pressed),
        "prints": sum(base_plate.prints(work) for work in underlaid),
        "is_glued": any(work.laminate.tube_count for work in works),
        "is_pressed": bool(pressed),
    }


def _turned(laminate: Laminate) -> str:
    """Return the layers that are cut turned over, as text; folds do not count."""
    roots = {laminate.cut_with(layer) for layer in laminate.layers if layer.turned}
    turned = [index for index in sorted(roots) if laminate.layer(index).turned]
    return layers_in_words(turned) if turned else ""


def _legend(laminate: Laminate) -> list[tuple[str, str]]:
    """Return the name and the hex code of each colour of the solid."""
    structural = ", ".join(
        dict.fromkeys(film.material for film in films(laminate) if not film.is_mask)
    )
    tones = [(structural if tone == "film" else words, tone) for tone, words in KEY]
    return [(words, f"#{bytes(COLOURS[tone]).hex()}") for words, tone in tones]


def _other_marks(work: Work) -> dict[str, str]:
    """Return a letter for each other design on the same sheets, so that labels stay short."""
    designs = {design for sheet in work.sheets for design, _, _ in sheet.counts}
    names = sorted(designs - {work.design.name})
    return {name: ascii_uppercase[i % 26] for i, name in enumerate(names, 1)}


def films(laminate: Laminate) -> list[Film]:
    return list(dict.fromkeys(layer.film for layer in laminate.layers))


def _facts(work: Work) -> list[tuple[str, str]]:
    laminate = work.laminate
    extras = "tabs and ears" if laminate.registration == "ears" else "tabs"
    names = {
        "thickness": "Thickness, sum of the films as bought",
        "folded_height": "Folded height, after the press (computed)",
        "width": f"Overall width, with {extras}",
        "length": f"Overall length, with {extras}",
        "outline_diameter": f"Diameter round the axis, without {extras}",
        "overall_diameter": f"Diameter round the axis, with {extras}",
        "pitch": "Pitch round the tube",
        "deflated_diameter": "Diameter on its tube, deflated",
        "reached_diameter": "Diameter on its tube, inflated (computed)",
        "inflated_diameter": "Diameter on its tube, inflated, at most (computed)",
    }
    return [
        ("Copies", str(work.copies)),
        ("Balloons", balloons(laminate)),
        ("Chambers", str(len(laminate.chambers))),
        ("Layers", f"{len(laminate.layers)} of {len(laminate.patterns)} patterns"),
        *(
            (names.get(name, name.replace("_", " ")), units.millimetres(value))
            for name, value in sizes(work.design, laminate).items()
        ),
        ("Inlets", str(len(laminate.inlets))),
        ("Tube", tube_name(work.design)),
    ]


@dataclass(frozen=True)
class SheetRow:
    """A sheet of the cut list; ``note`` says how a long one is drawn."""

    sheet: SheetFile
    film: Film
    picture: str
    counts: str
    size: str
    minutes: str
    note: str
    is_long: bool


def sheet_rows(
    design: Design, sheets: Sequence[SheetFile], marks: Mapping[str, str]
) -> list[SheetRow]:
    """Return the film sheets of a design; patterns carry the mark or the name of their design."""
    films = {film.material: film for film in design.films.stock.values()}
    rows = []
    for number, sheet in enumerate(sheets, 1):
        counts = [
            f"{count} {TIMES} {marked(design, pattern, marks)}"
            for design, pattern, count in sheet.counts
        ]
        if sheet.index_marks is not None:
            parts = sum(count for _, _, count in sheet.counts)
            counts.append(
                f"{sheet.index_marks} of {parts} parts have their pattern's number beside"
            )
        rows.append(
            SheetRow(
                sheet,
                films[sheet.material],
                sheet_map(sheet, films[sheet.material], marks, f"sheet-{number}"),
                ", ".join(counts),
                units.size(sheet.width, sheet.length),
                units.minutes(sheet.minutes),
                picture_note(sheet),
                is_long(sheet),
            )
        )
    return rows


@dataclass(frozen=True)
class LayUpRow:
    """One row of the lay-up table; ``repeat`` is printed beside the first row of a round.

    ``part`` names the part as it is sorted: a folded half is one with the lower half.
    """

    numbers: str
    layer: Layer
    part: str
    pieces: int
    pins: str
    repeat: str
    span: int


def _lay_up(work: Work) -> list[LayUpRow]:
    """Return the layers bottom to top, rounds once."""
    pins_of = {
        index: joined_words([pin.name for pin in pins]) if pins else BY_HAND
        for index, pins in pins_when_added(work.laminate).items()
    }
    turns = rounds(work.laminate.layers)
    return [row for turn in turns for row in _round_rows(work.laminate, pins_of, turn)]


def _part(laminate: Laminate, layer: Layer) -> str:
    """Return the pattern of the part that a layer is cut from, as it is sorted and counted."""
    root = laminate.layer(laminate.cut_with(layer))
    return root.pattern if root is layer else f"{root.pattern}, folded over"


def _round_rows(laminate: Laminate, pins_of: Mapping[int, str], turn: Round) -> list[LayUpRow]:
    rows = []
    for place, layers in enumerate(turn.places):
        repeat = "once"
        if turn.count > 1:
            repeat = (
                f"{turn.count} times in this order, layers {turn.first.index} to {turn.last.index}"
            )
        rows.append(
            LayUpRow(
                layer_numbers([layer.index for layer in layers]),
                layers[0],
                _part(laminate, layers[0]),
                len(layers[0].profile.pieces),
                "; ".join(dict.fromkeys(pins_of[layer.index] for layer in layers)),
                repeat,
                len(turn.places) if place == 0 else 0,
            )
        )
    return rows


# The QR code: the design that a printed page belongs to.


QUIET = 4
"""Modules left white around the code, as its standard requires."""


def code_text(name: str, design_sha256: str, generator: str) -> str:
    """Return the code's plain text in three lines: name, checksum, generator; it holds no link."""
    return f"{name}\nsha256 {design_sha256}\n{generator}"


def record_text(name: str, design_sha256: str, generator: str) -> str:
    """Return the code's text for a built design, with the command that finds its build records."""
    text = code_text(name, design_sha256, generator)
    return f"{text}\nsbafab record --find {design_sha256[:12]}"


def code_svg(text: str) -> str:
    """Return the text as a QR code, inline SVG without a fixed size."""
    import segno

    code = segno.make(text, error="m", micro=False)
    return code.svg_inline(border=QUIET, omitsize=True, light="white", svgclass="code")


# Warnings; the rules' findings have their own page.


class PageWarning(NamedTuple):
    """A warning of a page: a short title, its text, and whether it concerns one design only."""

    title: str
    text: str
    of_design: bool = False


def cautions(work: Work) -> list[PageWarning]:
    """Return every warning once."""
    return list(dict.fromkeys(_all(work)))


def for_the_designer(findings: Iterable[Finding]) -> list[PageWarning]:
    """Return a pointer to the rules' warnings, which cannot be fixed at the press; empty without
    any.
    """
    rules = {finding.rule for finding in findings if finding.verdict == "warn"}
    if not rules:
        return []
    words = (
        f"{units.count(len(rules), 'rule')} {'warns' if len(rules) == 1 else 'warn'}. "
        "findings.html gives places and remedies; at the press follow the steps."
    )
    return [PageWarning("For the designer", words)]


def _all(work: Work) -> Iterator[PageWarning]:
    job, schedule = work.job, work.schedule
    films = list(dict.fromkeys(layer.film for layer in work.laminate.layers))
    materials = [film.material for film in films]
    for film in films:
        if film.warning:
            title = "PTFE fumes" if film.material == "PTFE" else f"Cutting {film.material}"
            yield PageWarning(title, film.warning)
    if job.waived:
        yield PageWarning(
            "Waived rules",
            f"made although the design waives {', '.join(job.waived)}: ask the designer whether "
            "this is intended (findings.html).",
            of_design=True,
        )
    if job.lowered:
        yield PageWarning(
            "Lowered limits",
            f"{CHECKED_AGAINST}{', '.join(job.lowered)}. A pass here may be a failure at the usual "
            "limits: ask the designer whether this is intended.",
            of_design=True,
        )
    nominal = [material for material, _, measured in kerf_states(job, materials) if not measured]
    if nominal:
        yield PageWarning(
            f"{joined_words(nominal)} kerf uncalibrated",
            "edges are nominal, so outlines come out smaller and holes larger by half a kerf. A "
            "calibration piece tells by how much (bench.html).",
        )
    if job.underlay is not None:
        yield PageWarning(
            "Toner on the underlay",
            "laser toner softens in the press and may mark the release film or stick to it: print "
            "with ink if you can. Each print goes into the press once: paper dries there and "
            "shrinks. Not tried by us.",
        )
    for caution in schedule.cautions:
        if not caution.at_step:
            tell = "; tell the designer" if caution.remedy else ""
            yield PageWarning("Press schedule", f"{caution.words}{tell}", of_design=True)
