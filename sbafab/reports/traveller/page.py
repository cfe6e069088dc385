"""traveller.html: one page that goes from the laser to the press and comes back with an actuator.

Self-contained: style and pictures stand in it, nothing is fetched. Same input, same bytes: the
date of a print is written by the browser that prints.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from string import ascii_uppercase
from typing import TYPE_CHECKING, Any

from sbafab.cutting.sheets import SheetFile
from sbafab.design.kits import cited, departures, tube_name
from sbafab.design.records import Design
from sbafab.laminate.assembly import pins_when_added
from sbafab.laminate.films import Film, Material
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.models.paper import BURST
from sbafab.models.sizes import sizes
from sbafab.pressing.schedule import Schedule
from sbafab.pressing.words import listed
from sbafab.reports.canvas import COLOURS, KEY
from sbafab.reports.drawing import TIMES
from sbafab.reports.features import balloons, layer_numbers
from sbafab.reports.traveller import base_plate, bench, bill, notes, panel, process, times
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.batch import batch_page
from sbafab.reports.traveller.cautions import cautions, for_the_designer
from sbafab.reports.traveller.code import code_svg, record_text
from sbafab.reports.traveller.day import before_the_day, tools
from sbafab.reports.traveller.job import Job, Work
from sbafab.reports.traveller.layup import Round, rounds
from sbafab.reports.traveller.shapes import definitions, pattern_regions
from sbafab.reports.traveller.sheet_map import marked, part_regions, rows_said, sheet_map
from sbafab.reports.traveller.taking_down import order_of
from sbafab.reports.traveller.wrapping import wrapping

if TYPE_CHECKING:
    from jinja2 import Environment

HERE = Path(__file__).parent
TEMPLATE = "traveller.html.j2"
STYLE = "traveller.css"
SHORT_HASH = 12
BY_HAND = "none (by hand)"


def traveller_html(
    design: Design,
    laminate: Laminate,
    schedule: Schedule,
    sheets: Sequence[SheetFile],
    job: Job,
) -> str:
    """The whole page. ``schedule`` is this laminate's, ``sheets`` hold all its copies."""
    work = Work(design, laminate, schedule, sheets, job)
    return environment().get_template(TEMPLATE).render(context(work))


def environment() -> Environment:
    """The templates of this folder; what they are not given is an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    from sbafab.reports.traveller.compiled import compiled_beside

    return Environment(
        loader=FileSystemLoader(HERE),
        bytecode_cache=compiled_beside(HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def context(work: Work) -> dict[str, Any]:
    """What the templates say of one design."""
    laminate, job = work.laminate, work.job
    text = record_text(laminate.name, job.design_sha256, job.generator)
    others = _others(work)
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
        "departures": departures(work.design),
        "code": code_svg(text),
        "code_text": text,
        "legend": _legend(laminate),
        "solid": None if job.solid_png is None else b64encode(job.solid_png).decode("ascii"),
        "cautions": [*cautions(work), *for_the_designer(job.findings)],
        "before_cutting": bench.before_cutting([work]),
        "after_cutting": bench.after_cutting([work]),
        "bill": bill.bill(work),
        "before_the_day": before_the_day([work]),
        "tools": tools([work]),
        "others": others,
        "sheet_rows": sheet_rows(work.design, work.sheets, {work.design.name: "", **others}),
        "cuts": bill.cut_list(work),
        "laser_minutes": times.laser_minutes(work),
        "laser_basis": times.laser_basis(work),
        "lay_up": _lay_up(work),
        "force_notes": base_plate.build_up_notes(work),
        "plate_holes": base_plate.holes(work),
        "plate_notes": base_plate.plate_notes(work),
        "plate_places": base_plate.places(work),
        "plate_grid": base_plate.grid(work),
        "batch": batch_page(work),
        "step_pages": process.step_pages(work),
        "taking_down": order_of(work.schedule.steps),
        "finishing": process.finishing(work),
        "tubing": process.tubing(work),
        "leak_test": process.leak_test(work),
        "wrapping": wrapping(work),
        "leak_kilopascals": process.LEAK_KILOPASCALS,
        "burst": f"{BURST.value:g} ± {BURST.error:g}",
        "times": times.times(work),
        "kerf_notes": notes.kerf_notes(work),
        "expected_sizes": notes.expected_sizes(work),
        **panel.chapter(work),
    }


def _legend(laminate: Laminate) -> list[tuple[str, str]]:
    """What the solid's colours are, each with its colour."""
    own = ", ".join(dict.fromkeys(film.material for film in films(laminate) if not film.is_mask))
    said = [(own if tone == "film" else words, tone) for tone, words in KEY]
    return [(words, f"#{bytes(COLOURS[tone]).hex()}") for words, tone in said]


def _others(work: Work) -> dict[str, str]:
    """A letter for each other design that lies on the same sheets, so that labels stay short."""
    designs = {design for sheet in work.sheets for design, _, _ in sheet.counts}
    names = sorted(designs - {work.design.name})
    return {name: ascii_uppercase[i % 26] for i, name in enumerate(names, 1)}


def frame(title: str, sha256: str, generator: str) -> dict[str, Any]:
    """What every page has: its style, and what stands at the head and foot of each sheet."""
    short = sha256[:SHORT_HASH]
    return {
        "title": title,
        "short_hash": short,
        "generator": generator,
        "running_head": css_string(f"{title}  {short}"),
        "style": (HERE / STYLE).read_text(encoding="utf-8"),
        "say": say,
        "notes": notes,
    }


def materials(laminate: Laminate) -> list[Material]:
    return list(dict.fromkeys(layer.film.material for layer in laminate.layers))


def films(laminate: Laminate) -> list[Film]:
    return list(dict.fromkeys(layer.film for layer in laminate.layers))


def _facts(work: Work) -> list[tuple[str, str]]:
    laminate = work.laminate
    extras = "tabs and ears" if laminate.registration == "ears" else "tabs"
    names = {
        "thickness": "Thickness, flat (nominal films)",
        "width": f"Width of all that is cut, with {extras}",
        "length": f"Length of all that is cut, with {extras}",
        "outline_diameter": f"Films without {extras} fit a circle round the axis of",
        "overall_diameter": f"All that is cut, with {extras}, fits one of",
        "pitch": "Pitch round the tube",
        "deflated_diameter": "Diameter on its tube, deflated",
        "reached_diameter": "Diameter on its tube, inflated (computed)",
        "inflated_diameter": "Diameter on its tube, inflated, at most (computed)",
    }
    return [
        ("Copies", str(work.job.copies)),
        ("Balloons", balloons(laminate)),
        ("Chambers", str(len(laminate.chambers))),
        ("Layers", f"{len(laminate.layers)} of {len(laminate.patterns)} patterns"),
        *(
            (names.get(name, name.replace("_", " ")), say.millimetres(value))
            for name, value in sizes(work.design, laminate).items()
        ),
        ("Inlets", str(len(laminate.inlets))),
        ("Tube", tube_name(work.design)),
    ]


@dataclass(frozen=True)
class SheetRow:
    """A sheet as it stands in the cut list; ``said`` tells how a long one is drawn."""

    sheet: SheetFile
    picture: str
    counts: str
    size: str
    minutes: str
    said: str


def sheet_rows(
    design: Design, sheets: Sequence[SheetFile], marks: Mapping[str, str]
) -> list[SheetRow]:
    """The film sheets of a design; patterns go with the mark or the name of theirs."""
    films = {film.material: film for film in design.films.stock.values()}
    rows = []
    for number, sheet in enumerate(sheets, 1):
        counts = [
            f"{count} {TIMES} {marked(design, pattern, marks)}"
            for design, pattern, count in sheet.counts
        ]
        rows.append(
            SheetRow(
                sheet,
                sheet_map(sheet, films[sheet.material], marks, f"sheet-{number}"),
                ", ".join(counts),
                say.size(sheet.width, sheet.length),
                say.minutes(sheet.minutes),
                rows_said(sheet),
            )
        )
    return rows


@dataclass(frozen=True)
class LayUpRow:
    """One row of the lay-up table; ``repeat`` stands beside the first row of a round."""

    numbers: str
    layer: Layer
    pieces: int
    pins: str
    repeat: str
    span: int


def _lay_up(work: Work) -> list[LayUpRow]:
    """The layers bottom to top, rounds named once."""
    held = {
        index: listed([pin.name for pin in pins]) if pins else BY_HAND
        for index, pins in pins_when_added(work.laminate).items()
    }
    return [row for turn in rounds(work.laminate.layers) for row in _round_rows(held, turn)]


def _round_rows(held: Mapping[int, str], turn: Round) -> list[LayUpRow]:
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
                len(layers[0].profile.pieces),
                "; ".join(dict.fromkeys(held[layer.index] for layer in layers)),
                repeat,
                len(turn.places) if place == 0 else 0,
            )
        )
    return rows


def css_string(words: str) -> str:
    """Words as a CSS string that can neither end early nor leave the style element."""
    return '"' + "".join(c if c.isalnum() or c in " .-_" else f"\\{ord(c):x} " for c in words) + '"'
