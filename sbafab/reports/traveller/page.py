"""traveller.html: one page that goes from the laser to the press and comes back with an actuator.

Self-contained: style and pictures are inline, nothing is fetched. Same input, same bytes: the
browser writes the date of a print.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from itertools import chain
from string import ascii_uppercase
from typing import Any

from sbafab.design.identity import cited, cure_hours, departures, tube_name
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.laminate.lay_up import pins_when_added
from sbafab.models.formulas import sizes
from sbafab.pressing.cycles import batch_times
from sbafab.pressing.schedule import joined_words, layers_in_words
from sbafab.reports.canvas import COLOURS, KEY
from sbafab.reports.drawing import balloons
from sbafab.reports.traveller import acceptance, steps
from sbafab.reports.traveller.batch import batch_page
from sbafab.reports.traveller.bench import cutting, nominal
from sbafab.reports.traveller.formatting import SHORT_HASH, frame, render
from sbafab.reports.traveller.lay_up import Round, rounds
from sbafab.reports.traveller.materials import bill, cut_list, prints, release_films
from sbafab.reports.traveller.pictures import definitions, part_regions, pattern_regions, sheet_rows
from sbafab.reports.traveller.record_sheet import HISTORY_FIELDS, record_tables
from sbafab.reports.traveller.steps import joint_pages
from sbafab.reports.traveller.times import times
from sbafab.reports.traveller.work import Work
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
        **acceptance.values(work),
        "work": work,
        "works": [work],
        "assembly": None,
        "design": design,
        "laminate": laminate,
        "shapes": definitions(chain(pattern_regions(laminate), part_regions(work.sheets))),
        "balloons": balloons(laminate),
        "sizes": sizes(design, laminate),
        "tube": tube_name(design),
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
        "batch": batch_page(work),
        "step_pages": steps.step_pages(work),
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
    """Return the warnings, and the work that precedes the lay-up: cutting, printing, drying."""
    films = dict.fromkeys(film for work in works for film in work.films if film.warning)
    rules = {finding.rule for finding in findings if finding.verdict == "warn"}
    pressed = [work for work in works if work.schedule.steps]
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


def _legend(work: Work) -> list[tuple[str, str]]:
    """Return the name and the hex code of each colour of the solid."""
    structural = dict.fromkeys(film.material for film in work.films if not film.is_mask)
    films = ", ".join(structural)
    return [
        (films if tone == "film" else words, f"#{bytes(COLOURS[tone]).hex()}")
        for tone, words in KEY
    ]


def _other_marks(work: Work) -> dict[str, str]:
    """Return a letter for each other design on the same sheets, so that labels stay short."""
    designs = {design for sheet in work.sheets for design, _, _ in sheet.counts}
    names = sorted(designs - {work.design.name})
    return {name: ascii_uppercase[i % 26] for i, name in enumerate(names, 1)}


def _lay_up(laminate: Laminate) -> list[tuple[Round, list[tuple[tuple[Layer, ...], str, str]]]]:
    """Return the rounds of layers, bottom to top; for each place of a round its layers, the part
    that the first is cut from, as it is sorted and counted, and the pins that hold them.
    """
    pins_of = {
        index: joined_words([pin.name for pin in pins]) if pins else "none (by hand)"
        for index, pins in pins_when_added(laminate).items()
    }

    def part(layer: Layer) -> str:
        root = laminate.layer(laminate.cut_with(layer))
        return root.pattern if root is layer else f"{root.pattern}, folded over"

    return [
        (
            turn,
            [
                (place, part(place[0]), "; ".join(dict.fromkeys(pins_of[x.index] for x in place)))
                for place in turn.places
            ],
        )
        for turn in rounds(laminate.layers)
    ]


# The QR code: the design that a printed page belongs to.


QUIET = 4
"""Modules left white around the code, as its standard requires."""


def record_text(name: str, sha256: str) -> str:
    """Return the code's text, with the command that finds build records; it holds no link."""
    find = f"sbafab record --find {sha256[:SHORT_HASH]}"
    return f"{name}\nsha256 {sha256}\n{GENERATOR}\n{find}"


def code_svg(text: str) -> str:
    """Return the text as a QR code, inline SVG without a fixed size."""
    import segno

    code = segno.make(text, error="m", micro=False)
    return code.svg_inline(border=QUIET, omitsize=True, light="white", svgclass="code")
