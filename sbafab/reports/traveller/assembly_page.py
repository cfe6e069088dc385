"""traveller.html of an assembly: cut once, make each design, put them together."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from string import ascii_uppercase
from typing import Any

from sbafab.assemblies.build import Assembled
from sbafab.assemblies.colours import colours
from sbafab.cutting.sheets import SheetFile
from sbafab.laminate.films import Film
from sbafab.pressing.together import Runs
from sbafab.pressing.words import listed
from sbafab.reports.traveller import base_plate, bench, bill, joining, notes, times
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.cautions import cautions, for_the_designer
from sbafab.reports.traveller.code import code_svg, record_text
from sbafab.reports.traveller.day import before_the_day, tools
from sbafab.reports.traveller.job import Work
from sbafab.reports.traveller.page import context, environment, frame, sheet_rows
from sbafab.reports.traveller.shapes import definitions, pattern_regions
from sbafab.reports.traveller.sheet_map import part_regions
from sbafab.rules.finding import Finding
from sbafab.rules.lowered import CHECKED_AGAINST

PAGE, CHAPTER = "assembly.html.j2", "chapter.html.j2"
_NAMES = re.compile(r'(\b(?:id|aria-labelledby)="|\bhref="#|url\(#)')


@dataclass(frozen=True)
class DesignWork:
    """One design of the assembly; ``folder`` leads to its files from the page."""

    work: Work
    folder: str

    @property
    def name(self) -> str:
        return self.work.design.name

    @property
    def runs(self) -> Runs:
        return self.work.runs


@dataclass(frozen=True)
class AssemblyJob:
    """The order behind an assembly's traveller; ``findings`` are those between parts.

    ``lowered`` are limits below the usual ones, of the checks between parts and of all designs.
    """

    assembled: Assembled
    sha256: str
    generator: str
    works: Sequence[DesignWork]
    sheets: Sequence[SheetFile]
    findings: Sequence[Finding]
    waived: Sequence[str]
    lowered: Sequence[str]
    picture: bytes
    copies: int = 1
    made_for: str = ""
    note: str = ""


def assembly_html(job: AssemblyJob) -> str:
    """The whole page."""
    name = job.assembled.assembly.name
    text = record_text(name, job.sha256, job.generator)
    works = [one.work for one in job.works]
    return (
        environment()
        .get_template(PAGE)
        .render(
            **frame(name, job.sha256, job.generator),
            job=job,
            sha256=job.sha256,
            shapes=definitions(part_regions(job.sheets)),
            code=code_svg(text),
            code_text=text,
            picture=b64encode(job.picture).decode("ascii"),
            parts=_parts(job),
            tested=[name for made in job.assembled.designs for name in made.parts],
            cautions=_cautions(job),
            bill=_bill(job),
            before_the_day=before_the_day(works),
            tools=tools(works),
            before_cutting=bench.before_cutting(works),
            after_cutting=bench.after_cutting(works),
            sheet_rows=sheet_rows(works[0].design, job.sheets, _marks(job)),
            laser_minutes=times.laser_minutes(works[0]),
            laser_basis=times.laser_basis(works[0]),
            press_plan=[_press_words(one) for one in job.works],
            not_together=_not_together(job),
            marks=_marks(job),
            chapters=[
                _chapter(one, number, _marks(job)[one.name])
                for number, one in enumerate(job.works, 1)
            ],
            joins=joining.join_pages(job.assembled),
            finals=joining.final_checks(job.assembled),
            times=_times(job),
            kerf_notes=list(dict.fromkeys(n for work in works for n in notes.kerf_notes(work))),
            expected_sizes=list(dict.fromkeys(s for w in works for s in notes.expected_sizes(w))),
        )
    )


def _chapter(one: DesignWork, number: int, mark: str) -> str:
    """The making of one design, with ids that no other chapter has."""
    said: dict[str, Any] = context(one.work)
    said["shapes"] = definitions(pattern_regions(one.work.laminate))
    # The sheet goes round its tube when the assembly is put together.
    said["wrapping"] = []
    html = (
        environment()
        .get_template(CHAPTER)
        .render(
            **said | _again(one, number),
            runs=one.runs,
            press_words=_press_words(one),
            number=number,
            mark=mark,
        )
    )
    return _NAMES.sub(rf"\g<1>d{number}-", html)


def _again(one: DesignWork, number: int) -> dict[str, tuple[str, ...]]:
    """What the first chapter has said of the build-up, in short in those that follow."""
    return {} if number == 1 else {"force_notes": base_plate.build_up_again(one.work)}


def _parts(job: AssemblyJob) -> list[tuple[str, str, str, str]]:
    """Name, what it is, where it goes, and its colour in the picture, of each part."""
    rows = []
    paints = colours(job.assembled)
    for placed in job.assembled.parts:
        what = placed.part.kind if placed.made is None else f"SBA {placed.made.design.name}"
        on = placed.part.on
        where = "everything else is fixed on it" if on is None else f"{on}, {placed.part.at}"
        rows.append((placed.name, what, where, f"#{bytes(paints[placed.name]).hex()}"))
    return rows


def _cautions(job: AssemblyJob) -> list[tuple[str, str]]:
    found: list[tuple[str, str]] = []
    if job.waived:
        said = " / ".join(finding.message for finding in job.findings if finding.by_user)
        words = (
            f"made although the assembly waives {', '.join(job.waived)}. What they found: {said}"
        )
        found.append(("Waived checks", words))
    if job.lowered:
        found.append(("Lowered limits", f"{CHECKED_AGAINST}{', '.join(job.lowered)}."))
    for one in job.works:
        for title, text in cautions(one.work):
            is_own = title.startswith(("Press", "Waived", "Lowered"))
            found.append((f"{title} ({one.name})" if is_own else title, text))
    if any(placed.part.kind == "magnet" for placed in job.assembled.parts):
        words = "small and brittle, they snap together; keep them from what a magnet harms."
        found.append(("Magnets", words))
    every = [*job.findings, *(finding for one in job.works for finding in one.work.job.findings)]
    return list(dict.fromkeys([*found, *for_the_designer(every)]))


def _bill(job: AssemblyJob) -> list[bill.Item]:
    """Films of all designs together, what each design needs beside them, what is bought."""
    items = _films(job)
    for one in job.works:
        items += [_named(item, one) for item in bill.bill(one.work) if not _is_elsewhere(item)]
    items += joining.bought(job.assembled, job.copies)
    return list(dict.fromkeys(items))


def _is_elsewhere(item: bill.Item) -> bool:
    """Films are summed over the designs, and the tube to wrap is a part of the assembly."""
    name, _, rest = item.name.partition(" ")
    is_film = name.isupper() and rest == "film"
    return is_film or item.name in ("Tube to wrap", "Adhesive of the wrap")


def _named(item: bill.Item, one: DesignWork) -> bill.Item:
    """A design's item with its name."""
    if item.name == "Release film":
        return item
    return bill.Item(f"{item.name} ({one.name})", item.what, item.quantity)


def _films(job: AssemblyJob) -> list[bill.Item]:
    areas: dict[Film, float] = {}
    for one in job.works:
        for layer in one.work.laminate.layers:
            area = layer.profile.area * one.work.job.copies / 100
            areas[layer.film] = areas.get(layer.film, 0.0) + area
    items = []
    for film, area in areas.items():
        sheets = [sheet for sheet in job.sheets if sheet.material == film.material]
        sizes: dict[str, int] = {}
        for sheet in sheets:
            size = say.size(sheet.width, sheet.length)
            sizes[size] = sizes.get(size, 0) + 1
        needed = ", ".join(f"{say.count(n, 'sheet')} {size}" for size, n in sizes.items())
        what = f"{film.product}, {say.millimetres(film.thickness)} thick; {area:.1f} cm² of parts"
        items.append(bill.Item(f"{film.material} film", what, needed))
    return items


def _press_words(one: DesignWork) -> str:
    """How often the press closes on a design, and why that is enough."""
    runs, minutes = one.runs, one.work.schedule.total_press_minutes
    design = one.work.design
    copies = say.count(runs.copies, "copy", "copies")
    words = f"{design.name}, {copies}: "
    if runs.together > 1:
        width, length = design.press.platen_width, design.press.platen_length
        at_once = "all at once" if runs.count == 1 else f"{runs.together} at a time"
        words += (
            f"{say.count(runs.count, 'lamination')}, {at_once}, side by side within the heated "
            f"{say.size(width, length)}: copies are alike layer by layer, so they share the "
            f"pressure evenly (ours: the paper does not say how many it pressed at once). "
            f"{runs.count * minutes:g} min in the press instead of "
            f"{runs.copies * minutes:g}"
        )
    else:
        words += f"{say.count(runs.count, 'lamination')}, {runs.count * minutes:g} min in the press"
    if design.form.wrap is not None and design.form.stacks > 1:
        words += f". Its {design.form.stacks} SBAs lie on one sheet and are laminated at once"
        words += ", as in the paper"
    return f"{words}."


def _marks(job: AssemblyJob) -> dict[str, str]:
    """A letter for each of several designs, so that labels stay short."""
    names = [one.name for one in job.works]
    return {name: ascii_uppercase[i % 26] if names[1:] else "" for i, name in enumerate(names)}


def _not_together(job: AssemblyJob) -> str:
    """Why unlike designs do not share the press; empty where there is only one."""
    if len(job.works) < 2:
        return ""
    sizes = [f"{one.name} {say.millimetres(one.work.laminate.thickness)}" for one in job.works]
    return (
        f"Not pressed together: {listed([one.name for one in job.works])}. Their stacks differ "
        f"in height ({listed(sizes)}) and steps; the paper presses only like patterns at once, "
        "and glues these parts to each other."
    )


def _times(job: AssemblyJob) -> list[times.Time]:
    rows, total = [], 0.0
    for one in job.works:
        plan, runs = one.work.schedule, one.runs
        pressed = runs.count * plan.total_press_minutes
        handled = runs.copies * (plan.estimated_build_minutes - plan.total_press_minutes)
        total += pressed + handled
        made_of = (
            f"{say.count(runs.count, 'lamination')} of {plan.total_press_minutes:g} min; "
            f"{handled:g} min to cut, lay up, pin and fit tubes"
        )
        rows.append(times.Time(f"Making {one.name}", say.minutes(pressed + handled), made_of))
    laser = say.minutes(times.laser_minutes(job.works[0].work))
    basis = times.laser_basis(job.works[0].work)
    rows.append(times.Time("Laser (within making)", laser, f"{basis}; all sheets"))
    rows.append(
        times.Time(
            "Total, without joining",
            f"{total:.0f} min = {say.hours(total)}",
            "without heating the press up, leak tests, gluing and curing, of which the paper gives "
            "no times",
        )
    )
    return rows
