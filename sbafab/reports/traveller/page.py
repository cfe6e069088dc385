"""traveller.html: one page that goes from the laser to the press and comes back with an actuator.

Self-contained: style and pictures stand in it, nothing is fetched. Same input, same bytes: the
date of a print is written by the browser that prints.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from sbafab.cutting.sheets import SheetFile
from sbafab.design.records import Design
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.models.sizes import sizes
from sbafab.pressing.schedule import Schedule
from sbafab.reports.drawing import TIMES
from sbafab.reports.features import layer_numbers
from sbafab.reports.traveller import bill, notes, process, times
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.cautions import cautions
from sbafab.reports.traveller.code import code_svg, code_text
from sbafab.reports.traveller.job import Job, Work
from sbafab.reports.traveller.layup import Round, rounds
from sbafab.reports.traveller.shapes import definitions, pattern_regions
from sbafab.reports.traveller.sheet_map import part_regions, sheet_map

HERE = Path(__file__).parent
TEMPLATE = "traveller.html.j2"
STYLE = "traveller.css"
SHORT_HASH = 12

BURST_KILOPASCALS = "367 ± 18"


def traveller_html(
    design: Design,
    laminate: Laminate,
    schedule: Schedule,
    sheets: Sequence[SheetFile],
    job: Job,
) -> str:
    """The whole page. ``schedule`` is this laminate's, ``sheets`` hold all its copies."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    work = Work(design, laminate, schedule, sheets, job)
    environment = Environment(
        loader=FileSystemLoader(HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    text = code_text(laminate.name, job.design_sha256, job.generator)
    return environment.get_template(TEMPLATE).render(
        work=work,
        design=design,
        laminate=laminate,
        schedule=schedule,
        job=job,
        say=say,
        notes=notes,
        style=(HERE / STYLE).read_text(encoding="utf-8"),
        running_head=css_string(f"{laminate.name}  {job.design_sha256[:SHORT_HASH]}"),
        shapes=definitions(chain(pattern_regions(laminate), part_regions(sheets))),
        family=family_words(laminate),
        facts=_facts(work),
        short_hash=job.design_sha256[:SHORT_HASH],
        code=code_svg(text),
        code_text=text,
        solid=None if job.solid_png is None else b64encode(job.solid_png).decode("ascii"),
        cautions=cautions(work),
        bill=bill.bill(work),
        sheet_rows=_sheet_rows(work),
        cuts=bill.cut_list(work),
        kerf=bill.kerf_states(job, list(dict.fromkeys(x.film.material for x in laminate.layers))),
        laser_minutes=times.laser_minutes(work),
        laser_basis=times.laser_basis(work),
        lay_up=_lay_up(work),
        step_pages=process.step_pages(work),
        finishing=process.finishing(work),
        tubing=process.tubing(work),
        leak_test=process.leak_test(work),
        wrapping=process.wrapping(work),
        leak_kilopascals=process.LEAK_KILOPASCALS,
        burst=BURST_KILOPASCALS,
        times=times.times(work),
    )


def family_words(laminate: Laminate) -> str:
    """The family as a technician would say it."""
    if laminate.family == "radial":
        return "radial expansion stacked balloon actuator"
    chambers = len(laminate.chambers)
    freedoms = {1: " (1-DoF)", 3: " (3-DoF)"}.get(chambers, "")
    return f"stacked balloon actuator with {say.count(chambers, 'chamber')}{freedoms}"


def _facts(work: Work) -> list[tuple[str, str]]:
    laminate = work.laminate
    names = {
        "thickness": "Thickness, flat (nominal films)",
        "width": "Width of all that is cut, with tabs",
        "length": "Length of all that is cut, with tabs",
        "outline_diameter": "Fits a circle of",
        "pitch": "Pitch round the tube",
        "deflated_diameter": "Diameter on its tube, deflated",
        "inflated_diameter": "Diameter on its tube, inflated (computed)",
    }
    return [
        ("Copies", str(work.job.copies)),
        ("Balloons", str(laminate.balloons)),
        ("Chambers", str(len(laminate.chambers))),
        ("Layers", f"{len(laminate.layers)} of {len(laminate.patterns)} patterns"),
        *(
            (names.get(name, name.replace("_", " ")), say.millimetres(value))
            for name, value in sizes(work.design, laminate).items()
        ),
        ("Inlets", f"{len(laminate.inlets)}, tube {work.design.inlet.tube}"),
    ]


@dataclass(frozen=True)
class SheetRow:
    """A sheet as it stands in the cut list."""

    sheet: SheetFile
    picture: str
    counts: str
    size: str
    minutes: str


def _sheet_rows(work: Work) -> list[SheetRow]:
    rows = []
    for number, sheet in enumerate(work.sheets, 1):
        counts = [
            f"{count} {TIMES} {_part_name(work, design, pattern)}"
            for design, pattern, count in sheet.counts
        ]
        rows.append(
            SheetRow(
                sheet,
                sheet_map(sheet, work.design.name, f"sheet-{number}"),
                ", ".join(counts),
                say.size(sheet.width, sheet.length),
                say.minutes(sheet.minutes),
            )
        )
    return rows


def _part_name(work: Work, design: str, pattern: str) -> str:
    return pattern if design == work.design.name else f"{design} {pattern}"


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
    return [row for turn in rounds(work.laminate.layers) for row in _round_rows(work, turn)]


def _round_rows(work: Work, turn: Round) -> list[LayUpRow]:
    rows = []
    for place, layers in enumerate(turn.places):
        pins = [pin.name for pin in work.laminate.pins_holding(layers[0])]
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
                say.listed(pins) if pins else "none",
                repeat,
                len(turn.places) if place == 0 else 0,
            )
        )
    return rows


def css_string(words: str) -> str:
    """Words as a CSS string that can neither end early nor leave the style element."""
    return '"' + "".join(c if c.isalnum() or c in " .-_" else f"\\{ord(c):x} " for c in words) + '"'
