"""traveller.html of an assembly: cut once, make each design, join the parts."""

from __future__ import annotations

import math
import re
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from string import ascii_uppercase
from typing import Any

from sbafab.assemblies.build import Assembled, PlacedPart, PlacedSba
from sbafab.assemblies.checks import supply_runs
from sbafab.assemblies.records import Base, Cup, Line, Magnet, Sba, Tube
from sbafab.assemblies.shapes import colours, own_surface
from sbafab.cutting.sheets import SheetFile
from sbafab.laminate.films import Film
from sbafab.models.formulas import sizes
from sbafab.pressing.cycles import Runs
from sbafab.pressing.schedule import HANDLING_MINUTES, joined_words
from sbafab.reports.html_templates import environment
from sbafab.reports.traveller import bench, bill, process, units
from sbafab.reports.traveller.bench import Tool
from sbafab.reports.traveller.bill import THREAD, Item
from sbafab.reports.traveller.job import HERE, Action, Work, frame
from sbafab.reports.traveller.page import (
    PageWarning,
    cautions,
    code_svg,
    context,
    for_the_designer,
    record_text,
    sheet_rows,
    to_be_ready,
)
from sbafab.reports.traveller.shapes import definitions, pattern_regions
from sbafab.reports.traveller.sheet_map import part_regions
from sbafab.rules.finding import Finding
from sbafab.rules.limits import CHECKED_AGAINST

PAGE, CHAPTER = "assembly.html.j2", "chapter.html.j2"
_NAMES = re.compile(r'(\b(?:id|aria-labelledby)="|\bhref="#|url\(#)')


@dataclass(frozen=True)
class DesignWork:
    """One design of the assembly; ``folder`` is the path to its files from the page."""

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
    """The order behind an assembly's traveller; ``findings`` are from checks between parts.

    ``lowered`` are limits below the defaults, for the checks between parts and for all designs.
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


def assembly_html(job: AssemblyJob) -> str:
    """Return the whole page, each pattern prefixed with the mark of its design."""
    job = _with_marks(job)
    name = job.assembled.assembly.name
    text = record_text(name, job.sha256, job.generator)
    works = [one.work for one in job.works]
    return (
        environment(HERE)
        .get_template(PAGE)
        .render(
            **frame(name, job.sha256, job.generator),
            job=job,
            order=job.assembled.assembly.order,
            sha256=job.sha256,
            shapes=definitions(part_regions(job.sheets)),
            code=code_svg(text),
            code_text=text,
            picture=b64encode(job.picture).decode("ascii"),
            parts=_parts(job),
            tested=[name for build in job.assembled.designs for name in build.parts],
            cautions=_cautions(job),
            bill=_bill(job),
            **to_be_ready(works),
            castings=_castings(job.assembled),
            before_cutting=bench.before_cutting(works),
            after_cutting=bench.after_cutting(works),
            sheet_rows=sheet_rows(works[0].design, job.sheets, dict.fromkeys(_marks(job), "")),
            program=works[0].design.sheets.program,
            laser_minutes=bill.laser_minutes(works[0]),
            laser_basis=bill.laser_basis(works[0]),
            press_plan=[_press_words(one) for one in job.works],
            not_together=_not_together(job),
            marks=_marks(job),
            chapters=[
                _chapter(one, number, _marks(job)[one.name])
                for number, one in enumerate(job.works, 1)
            ],
            press_rows=[(one, process.step_rows(one.work)) for one in job.works],
            joins=join_pages(job.assembled),
            finals=final_checks(job.assembled),
            times=_times(job),
            kerf_notes=bill.kerf_notes(works),
        )
    )


def _chapter(design: DesignWork, number: int, mark: str) -> str:
    """Return the chapter on one design, with ids unique on the page."""
    page: dict[str, Any] = context(design.work)
    page["shapes"] = definitions(pattern_regions(design.work.laminate))
    html = (
        environment(HERE)
        .get_template(CHAPTER)
        .render(
            **page | {"in_chapter": True, "again": number > 1},
            runs=design.runs,
            press_words=_press_words(design),
            mark=mark,
        )
    )
    return _NAMES.sub(rf"\g<1>d{number}-", html)


def _with_marks(job: AssemblyJob) -> AssemblyJob:
    """Return the job with "A P03" for P03 of its first design, on sheets and in laminates; a single
    design's patterns need no mark.
    """
    marks = _marks(job)
    if len(marks) == 1:
        return job
    sheets = [
        replace(
            sheet,
            counts=tuple(
                (name, f"{marks[name]} {pattern}", n) for name, pattern, n in sheet.counts
            ),
            nest=replace(
                sheet.nest,
                parts=tuple(
                    replace(part, pattern=f"{marks[part.design]} {part.pattern}")
                    for part in sheet.nest.parts
                ),
            ),
        )
        for sheet in job.sheets
    ]
    works = []
    for one in job.works:
        layers = tuple(
            replace(layer, pattern=f"{marks[one.name]} {layer.pattern}")
            for layer in one.work.laminate.layers
        )
        laminate = replace(one.work.laminate, layers=layers)
        works.append(replace(one, work=replace(one.work, laminate=laminate, sheets=sheets)))
    return replace(job, works=works, sheets=sheets)


def _parts(job: AssemblyJob) -> list[tuple[str, str, str, str]]:
    """Return name, kind, place and colour in the picture of each part."""
    rows = []
    paints = colours(job.assembled)
    for placed in job.assembled.parts:
        kind = placed.part.kind if placed.made is None else f"SBA {placed.made.design.name}"
        on = placed.part.on
        where = "first part" if on is None else f"{on}, {placed.part.at}"
        rows.append((placed.name, kind, where, f"#{bytes(paints[placed.name]).hex()}"))
    return rows


def _cautions(job: AssemblyJob) -> list[PageWarning]:
    warnings: list[PageWarning] = []
    if job.waived:
        messages = " / ".join(finding.message for finding in job.findings if finding.by_user)
        words = f"made although the assembly waives {', '.join(job.waived)}. Findings: {messages}"
        warnings.append(PageWarning("Waived checks", words))
    if job.lowered:
        words = f"{CHECKED_AGAINST}{', '.join(job.lowered)}."
        warnings.append(PageWarning("Lowered limits", words))
    for design in job.works:
        for caution in cautions(design.work):
            of = f" ({design.name})" if caution.of_design else ""
            warnings.append(caution._replace(title=f"{caution.title}{of}"))
    if any(placed.part.kind == "magnet" for placed in job.assembled.parts):
        words = (
            "small and brittle; they snap together. Keep them away from anything that a magnet "
            "harms."
        )
        warnings.append(PageWarning("Magnets", words))
    every = [
        *job.findings,
        *(finding for design in job.works for finding in design.work.job.findings),
    ]
    return list(dict.fromkeys([*warnings, *for_the_designer(every)]))


def _bill(job: AssemblyJob) -> list[bill.Item]:
    """Return the films of all designs together, each design's other items, and bought items."""
    items = _films(job)
    for design in job.works:
        # Films are summed over the designs; the tube under a wrapped sheet is a part here.
        items += [_named(item, design) for item in bill.bill(design.work) if item.kind == "other"]
    items += bought(job.assembled, job.assembled.assembly.order.copies)
    return list(dict.fromkeys(items))


def _named(item: bill.Item, design: DesignWork) -> bill.Item:
    """Return a design's item labelled with the design's name."""
    return bill.Item(f"{item.name} ({design.name})", item.what, item.quantity)


def _films(job: AssemblyJob) -> list[bill.Item]:
    areas: dict[Film, float] = {}
    for design in job.works:
        for layer in design.work.laminate.layers:
            area = layer.profile.area * design.work.copies / 100
            areas[layer.film] = areas.get(layer.film, 0.0) + area
    items = []
    for film, area in areas.items():
        sheets = [sheet for sheet in job.sheets if sheet.material == film.material]
        sizes: dict[str, int] = {}
        for sheet in sheets:
            size = units.size(sheet.width, sheet.length)
            sizes[size] = sizes.get(size, 0) + 1
        needed = ", ".join(f"{units.count(n, 'sheet')} {size}" for size, n in sizes.items())
        product = (
            f"{film.product}, {units.millimetres(film.thickness)} thick; {area:.1f} cm² of parts"
        )
        items.append(bill.Item(f"{film.material} film", product, needed))
    return items


def _press_words(one: DesignWork) -> str:
    """Return the laminations of a design, and why they are enough."""
    runs, minutes = one.runs, one.work.schedule.total_press_minutes
    design = one.work.design
    copies = units.count(runs.copies, "copy", "copies")
    words = f"{design.name}, {copies}: "
    if runs.together > 1:
        width, length = design.press.platen
        at_once = "all at once" if runs.count == 1 else f"{runs.together} at a time"
        words += (
            f"{units.count(runs.count, 'lamination')}, {at_once}, side by side within the heated "
            f"{units.size(width, length)}: copies are alike layer by layer, so they share the "
            f"pressure evenly (ours: the paper does not say how many it pressed at once). "
            f"{units.plain(units.product(runs.count, minutes))} min in the press instead of "
            f"{units.plain(units.product(runs.copies, minutes))}"
        )
    else:
        pressed = units.plain(units.product(runs.count, minutes))
        words += f"{units.count(runs.count, 'lamination')}, {pressed} min in the press"
    if design.form.wrap is not None and design.form.stacks > 1:
        words += f". Its {design.form.stacks} SBAs lie on one sheet and are laminated at once"
        words += ", as in the paper"
    return f"{words}."


def _marks(job: AssemblyJob) -> dict[str, str]:
    """Return a letter for each of several designs, so that labels stay short."""
    names = [design.name for design in job.works]
    return {name: ascii_uppercase[i % 26] if names[1:] else "" for i, name in enumerate(names)}


def _not_together(job: AssemblyJob) -> str:
    """Return why different designs do not share the press; empty for a single design."""
    if len(job.works) < 2:
        return ""
    sizes = [
        f"{design.name} {units.millimetres(design.work.laminate.thickness)}" for design in job.works
    ]
    return (
        f"Not pressed together: {joined_words([design.name for design in job.works])}. Their "
        f"stacks differ in height ({joined_words(sizes)}) and steps; the paper presses only like "
        "patterns at once, and glues these parts to each other."
    )


def _times(job: AssemblyJob) -> list[bill.Time]:
    rows: list[bill.Time] = []
    worked = waited = cure = 0.0
    is_known = True
    for design in job.works:
        plan, runs = design.work.schedule, design.runs
        pressed = units.product(runs.count, plan.total_press_minutes)
        handled = runs.copies * HANDLING_MINUTES
        whole = None if pressed is None else pressed + handled
        worked += handled + (pressed or 0.0)
        is_known &= pressed is not None
        made_of = (
            f"{units.count(runs.count, 'lamination')} of {units.plain(plan.total_press_minutes)} "
            f"min; {handled:g} min of handling: cutting, lay-up, pins, tubes"
        )
        rows.append(bill.Time(f"Making {design.name}", units.minutes(whole), made_of))
        each = bill.waiting(design.work)
        waited += runs.count * len(plan.steps) * (each.warm + each.cool)
        cure = max(cure, each.cure)
    laser = units.minutes(bill.laser_minutes(job.works[0].work))
    basis = bill.laser_basis(job.works[0].work)
    rows.append(bill.Time("Laser (within making)", laser, f"{basis}; all sheets"))
    basis = "estimate, each plate after the other; warming cold platens comes before"
    rows.append(bill.Time("Warming and cooling", units.minutes(waited), basis))
    return [*rows, _total_time(job, worked + waited, cure, is_known)]


def _total_time(job: AssemblyJob, worked: float, cure: float, is_known: bool) -> bill.Time:
    """Return the hours until all actuators can be tested, and the work after that; a lower bound if
    press minutes are unknown.
    """
    least, more = ("", "") if is_known else ("at least ", " and the press minutes")
    joints = sum(placed.part.on is not None for placed in job.assembled.parts)
    basis = (
        f"{worked / 60:.1f} h{more} until all tubes are glued; {cure / 60:g} h for their adhesive, "
        f"then the tests; then {units.count(joints, 'joint')}, each cured as its package says "
        "before the next"
    )
    took = f"{least}{(worked + cure) / 60:.1f} h{more}"
    return bill.Time("Total, without joining", took, basis)


# Joining, part by part.


@dataclass(frozen=True)
class JoinPage:
    """The joining step of one part."""

    title: str
    actions: tuple[Action, ...]


def join_pages(assembled: Assembled) -> list[JoinPage]:
    """Return a step for each part: make it ready, then fix it."""
    pages = []
    for placed in _in_order(assembled):
        carrier = assembled.on(placed)
        kind = _kind(placed)
        title = placed.name if kind == placed.name else f"{placed.name} ({kind})"
        lines = [line.name for line in _lines_through(assembled, placed)]
        early = bool(lines) and carrier is not None
        actions = list(_ready(placed))
        if early:
            actions = [Action(f"Take {placed.name} with {joined_words(lines)} in it.")]
        if carrier is not None:
            title += f", {_where(placed)} of {carrier.name}"
            if early and isinstance(carrier.part, Tube):
                actions.append(Action(f"Lead {joined_words(lines)} through {carrier.name}."))
            actions += _fix(placed, carrier)
        actions += _supply(placed, carrier, assembled)
        if placed.part.note:
            actions.append(Action(placed.part.note))
        if actions:
            pages.append(JoinPage(title, tuple(actions)))
    return pages


def _in_order(assembled: Assembled) -> Iterator[PlacedPart]:
    """Yield parts in building order; a line is inserted while both ends of its lumen are in
    reach.
    """
    parts = assembled.parts
    for placed in parts:
        if placed.made is not None and placed.part.on is not None:
            yield from _lines_through(assembled, placed)
        carrier = assembled.on(placed)
        early = placed.part.at == "lumen" and carrier is not None and carrier.made is not None
        if not (early and carrier is not None and carrier.part.on is not None):
            yield placed


def _lines_through(assembled: Assembled, placed: PlacedPart) -> list[PlacedPart]:
    return [
        part for part in assembled.parts if part.part.at == "lumen" and part.part.on == placed.name
    ]


def _kind(placed: PlacedPart) -> str:
    if placed.made is not None:
        return placed.made.design.name
    names = {"line": "vacuum or fluid line", "cup": "suction cup"}
    return names.get(placed.part.kind, placed.part.kind)


def _where(placed: PlacedPart) -> str:
    words = {"start": "at the start", "end": "at the end", "outside": "on the outside"}
    at = str(placed.part.at)
    return words.get(at, f"in the {at}" if at in ("lumen", "inlet") else f"on the {at}")


def _ready(placed: PlacedPart) -> Iterator[Action]:
    part = placed.part
    if isinstance(part, Tube):
        yield Action(
            f"Cut {units.millimetres(part.length)} of {part.material} tube, outer diameter "
            f"{units.millimetres(part.outer_diameter)}, inner "
            f"{units.millimetres(part.inner_diameter)}, square. Mark its start, and a straight "
            "line along it: that is angle 0."
        )
    elif isinstance(part, Base):
        yield Action(
            f"Have a {part.kind} of {part.material} ready, {units.size(part.width, part.length)}, "
            f"{units.millimetres(part.thickness)} thick. Mark its top, and on both faces an arrow "
            f"along the {units.millimetres(part.width)}, the same way."
        )
    elif isinstance(part, Magnet):
        yield Action(
            f"Measure {part.part}: {units.millimetres(part.diameter)} across, "
            f"{units.millimetres(part.thickness)} thick. If it differs, tell the designer."
        )
        yield Action(
            "Bring it near the outer magnet, which will hold it through the wall, and mark the "
            "face that is attracted: that face goes outward."
        )
    elif isinstance(part, Cup):
        yield Action(
            f"Print mesh/mould_{placed.name}_lower.stl and mesh/mould_{placed.name}_upper.stl, not "
            "in resin, which may keep the silicone from curing. Fill the lower half, rim up, with "
            f"{part.material} mixed and freed of air as its package says; press the upper half in "
            "until both halves meet all round, let it cure, take the cup out. (Ours, not tried.)"
        )
        yield Action(
            f"Measure it: rim {units.millimetres(part.diameter)}, neck "
            f"{units.millimetres(part.neck)}, height {units.millimetres(part.height)}, wall "
            f"{units.millimetres(part.wall)}, hole for the line {units.millimetres(part.bore)}."
        )
    elif isinstance(part, Line):
        yield Action(
            f"Cut {part.tubing}, outer diameter {units.millimetres(part.outer_diameter)}, square "
            f"and without burr; the design has {units.millimetres(part.length)}, your rig may need "
            "more."
        )
    else:
        yield Action(
            f"Take a {_kind(placed)} that has passed its tests; its inlet tubes stay open."
        )


def _fix(placed: PlacedPart, carrier: PlacedPart) -> Iterator[Action]:
    part = placed.part
    if isinstance(part, Line):
        yield from _thread(placed, part, carrier)
    elif isinstance(placed, PlacedSba) and placed.radius is not None:
        yield from _bend(placed, carrier)
    else:
        yield Action(
            f"Lay it {_where(placed)} of {carrier.name}: {_spot(placed, carrier)}. Try it dry."
        )
    yield from _glue(placed, carrier)


def _spot(placed: PlacedPart, carrier: PlacedPart) -> str:
    """Return the position of a part's middle and the part's rotation."""
    part = placed.part
    x, y = part.offset
    if part.at == "outside":
        spot = f"{_round(part.angle)}, {units.millimetres(part.along)} from the tube's start"
        return spot if not part.turn else f"{spot}, turned {part.turn:g} degrees anti-clockwise"
    has_mark = isinstance(part, Sba | Tube | Base)
    words = [f"looking at that face, with {_mark(carrier)} to the right"]
    if not (x or y or has_mark):
        return "axis on axis"
    if x or y:
        # Up on an upper face is down on a lower one, seen from below.
        up = -y if _is_below(placed) else y
        sides = [_aside(x, "right", "left"), _aside(up, "up", "down")]
        words.append(f"its middle {' and '.join(filter(None, sides))}")
    else:
        words.append("axis on axis")
    if has_mark:
        words.append(_heading(placed, carrier))
    return ", ".join(words)


def _is_below(placed: PlacedPart) -> bool:
    """Return True if a part is fixed on a lower face, upside down."""
    return placed.part.at in ("bottom", "start")


def _aside(value: float, plus: str, minus: str) -> str:
    return f"{units.millimetres(abs(value))} {plus if value > 0 else minus}" if value else ""


def _mark(placed: PlacedPart) -> str:
    """Return the mark that shows a part's direction x."""
    if placed.made is not None:
        return f"the tab of {placed.made.laminate.inlets[0].chamber}"
    marks = {"tube": "the marked line", "base": "the arrow", "sheet": "the arrow"}
    return marks.get(placed.part.kind, "any side")


def _heading(placed: PlacedPart, carrier: PlacedPart) -> str:
    """Return the glued face of a part and the direction of its mark: an SBA bends by its tabs."""
    face = {"sba": "base", "tube": "start"}.get(placed.part.kind, "underside")
    # On a lower face the part is upside down and seen from below.
    turn = _angle(placed) + placed.turn
    turn += _angle(carrier) - 180 if _is_below(placed) else -_angle(carrier)
    turn = round(turn, 6) % 360
    way = f"over {_mark(carrier)}" if turn == 0 else f"{turn:g} degrees anti-clockwise from there"
    return f"its {face} glued, {_mark(placed)} {way}"


def _angle(placed: PlacedPart) -> float:
    """Return the angle in degrees from a part's x to its mark."""
    if placed.made is None:
        return 0.0
    x, y = placed.made.laminate.inlets[0].direction
    return math.degrees(math.atan2(y, x))


def _round(angle: float) -> str:
    if not angle:
        return "on the marked line"
    way = "anti-clockwise" if angle > 0 else "clockwise"
    return f"{abs(angle):g} degrees {way} from the marked line, looking at the tube's end"


def _bend(placed: PlacedSba, carrier: PlacedPart) -> Iterator[Action]:
    part = placed.part
    form = placed.made.design.form
    middle = units.millimetres(part.along)
    if form.wrap is None:
        yield Action(
            f"Bend it round {carrier.name}, base inward: its lumen {_round(part.angle)}, {middle} "
            f"from the tube's start; {_tab(placed)}. Try it dry."
        )
        return
    end = "start" if part.turn % 360 == 180 else "end"
    yield Action(
        f"Wrap the sheet round {carrier.name}, balloons outward, its straight edges along the "
        f"tube: the middle of the SBAs {middle} from the tube's start, tabs toward its {end}, the "
        f"middle SBA {_round(part.angle)}. Try it dry."
    )
    yield Action(
        f"Check: the edges of the sheet meet, and the {form.stacks} SBAs lie {360 / form.stacks:g} "
        f"degrees apart ({units.millimetres(form.wrap.pitch)} round the tube, measured on the "
        "sheet)."
    )


def _tab(placed: PlacedPart) -> str:
    """Return the direction of chamber1's tab: without a turn around the tube, then toward the
    tube's end.
    """
    turn = placed.part.turn % 360
    plain = {
        0: "round the tube, anti-clockwise as you look at its end",
        90: "to the tube's end",
        180: "round the tube, clockwise as you look at its end",
        270: "to the tube's start",
    }
    if turn in plain:
        return f"the tab of chamber1 points {plain[int(turn)]}"
    return (
        f"the tab of chamber1 points {turn:g} degrees from the anti-clockwise way round the tube, "
        "by way of the tube's end"
    )


def _thread(placed: PlacedPart, line: Line, carrier: PlacedPart) -> Iterator[Action]:
    if line.at == "inlet":
        yield Action(
            f"Push it into the inlet of {line.chamber} of {carrier.name}, beside the PTFE strip, "
            "in place of a tube fitted earlier."
        )
        return
    if carrier.part.on is not None and carrier.made is not None:
        yield Action(
            f"Take {carrier.name}, not yet fixed: a {_kind(carrier)} that has passed its tests."
        )
    past = line.along + line.length - carrier.height
    face = "top" if carrier.made is not None else "end"
    side = f"{units.millimetres(abs(past))} {'past' if past >= 0 else 'short of'} its {face}"
    yield Action(f"Thread it through the lumen of {carrier.name} until it ends {side}.")


def _glue(placed: PlacedPart, carrier: PlacedPart) -> Iterator[Action]:
    glue = _adhesive(placed)
    if glue is None:
        if placed.part.at == "outside" or not isinstance(placed.part, Line):
            yield Action(
                "No adhesive is named for this joint: write here how it is fixed, ________."
            )
        return
    how = (
        "a small drop"
        if isinstance(placed.part, Magnet)
        else "a thin bead round the line at each face that it comes out of"
        if isinstance(placed.part, Line)
        else "a thin, even film"
    )
    clear = "the line" if isinstance(placed.part, Line) else "lumen"
    yield Action(f"Glue: {glue}, {how}. Keep it out of {clear}, bores, inlets and balloons.")
    yield Action("Hold it in place and let it cure as the package says before the next step.")


def _adhesive(placed: PlacedPart) -> str | None:
    """Return the adhesive of a part; for a sheet wrapped around its tube, its design's."""
    wrap = None if placed.made is None else placed.made.design.form.wrap
    return placed.part.glue or (wrap.glue if wrap is not None else None)


def _supply(
    placed: PlacedPart, carrier: PlacedPart | None, assembled: Assembled
) -> Iterator[Action]:
    """Yield the run of an actuator's tubes and the folding of its tabs."""
    if placed.made is None or not placed.made.laminate.inlets:
        return
    tie = "tie them there with a turn of thread, loose enough for tubes to slide"
    tube_runs = supply_runs(placed, assembled)
    if carrier is not None and tube_runs:
        away = "start" if placed.part.at == "end" else "end"
        over = joined_words(list(dict.fromkeys(name for run in tube_runs for name in run.over)))
        past = f"; where one crosses {over}, leave it slack" if over else ""
        places = joined_words(
            [f"{run.chamber} at {round(run.angle, 1) % 360:g}" for run in tube_runs]
        )
        yield Action(
            f"Fold each tab back over the rim, round its tube and not flat, and lead the tubes "
            f"along the outside of {carrier.name} toward its {away}: {places} degrees{past}; {tie}."
        )
    elif carrier is not None and placed.radius is not None:
        yield Action(
            f"Lead its tubes along {carrier.name}, the way the tabs point, off all balloons; {tie}."
        )
    else:
        yield Action(
            "Gather its tubes below the base, away from what bends or opens, and tie them 10 mm "
            "behind the tabs, so that they trail and no pull reaches a tab."
        )


def _leak_pressures(actuators: Sequence[PlacedSba]) -> str:
    """Return the leak tests' pressures, one number if the designs agree."""
    pressures = {actuator.made.design.acceptance.leak_pressure_kpa for actuator in actuators}
    return " or ".join(f"{pressure:g}" for pressure in sorted(pressures))


def _castings(assembled: Assembled) -> list[str]:
    """Return what must have cured by the day of joining."""
    names = [placed.name for placed in assembled.parts if isinstance(placed.part, Cup)]
    cast = f"{joined_words(names)}: cast and cured as its section under Join the parts says."
    return [cast] if names else []


def tools_of_assembly(assembled: Assembled) -> list[Tool]:
    """Return the tools for the joining and the tests of the finished assembly."""
    deploy = assembled.assembly.deploy
    kinds = {type(placed.part) for placed in assembled.parts}
    rows = [Tool("Protractor, pen, steel rule", "marks and angles of the parts")]
    if Cup in kinds:
        rows.append(Tool("3D printer; scales, vacuum chamber", "mould and casting of the cup"))
    if Magnet in kinds:
        rows.append(Tool("Outer magnet", "finds the face to turn outward; test of the assembly"))
    if Line in kinds or Cup in kinds:
        glass = ", glass plate" if Cup in kinds else ""
        rows.append(Tool(f"Vacuum supply{glass}", "test of the assembly"))
    if deploy.aperture_diameter is not None:
        hole = units.millimetres(deploy.aperture_diameter)
        rows.append(Tool(f"Plate with a hole of {hole}", "test of the assembly"))
    if deploy.lumen_diameter is not None:
        lumen = units.millimetres(deploy.lumen_diameter)
        rows.append(Tool(f"Tube of inner diameter {lumen}", "test of the assembly"))
    return rows


def final_checks(assembled: Assembled) -> list[Action]:
    """Return the tests of the finished assembly; figures are predictions."""
    actuators = [placed for placed in assembled.parts if isinstance(placed, PlacedSba)]
    deploy = assembled.assembly.deploy
    actions = [
        Action(
            f"Raise each actuator to {_leak_pressures(actuators)} kPa again: no leak, no joint "
            "opens.",
            (),
            tuple(placed.name for placed in actuators) if len(actuators) > 1 else (),
        )
    ]
    if any(isinstance(placed.part, Line) for placed in assembled.parts):
        actions.append(Action("Draw air through every line: it is open from end to end."))
    if any(isinstance(placed.part, Cup) for placed in assembled.parts):
        actions.append(Action("Press the cup on glass and draw vacuum: the cup holds."))
    if deploy.aperture_diameter is not None:
        hole = units.millimetres(deploy.aperture_diameter)
        actions.append(Action(f"Deflated and folded, it goes through a hole of {hole}."))
    if deploy.lumen_diameter is not None:
        lumen = units.millimetres(deploy.lumen_diameter)
        actions.append(Action(f"Deflated, it slides through a tube of inner diameter {lumen}."))
        actions += [
            Action(
                f"Inflated in the open until its films are taut, {placed.name} measures about "
                f"{across}; in the tube of {lumen} it holds against a pull."
            )
            for placed in actuators
            if (across := _across(placed)) is not None
        ]
    if any(isinstance(placed.part, Magnet) for placed in assembled.parts):
        actions.append(Action("The outer magnet attracts and holds the base through the wall."))
    return actions


def _across(placed: PlacedSba) -> str | None:
    size = sizes(placed.made.design, placed.made.laminate)
    if "reached_diameter" not in size:
        return None
    return f"{size['reached_diameter']:.1f} mm across, {size['inflated_diameter']:.1f} mm at most"


def bought(assembled: Assembled, copies: int) -> list[Item]:
    """Return rows of the bill of materials for everything not cut from film."""
    items = [item for placed in assembled.parts for item in _items(placed, copies)]
    if any(placed.made is not None and placed.made.laminate.inlets for placed in assembled.parts):
        items.append(THREAD)
    glues = dict.fromkeys(filter(None, map(_adhesive, assembled.parts)))
    for glue in glues:
        joints = [placed.name for placed in assembled.parts if _adhesive(placed) == glue]
        items.append(Item("Adhesive", f"{glue}, for {joined_words(joints)}", "as needed"))
    return items


POUR = 10.0
"""Smallest amount of silicone that can be weighed and mixed well, ml: ours."""


def _items(placed: PlacedPart, copies: int) -> Iterator[Item]:
    """Yield bought items of a part, and for a cup its casting material and mould."""
    if placed.made is not None:
        return
    yield _item(placed, copies)
    if isinstance(placed.part, Cup):
        takes = own_surface(placed).volume / 1000 * copies
        words = f"both parts of it; the cup takes {takes:.2g} ml"
        yield Item(placed.part.material, words, f"{max(POUR, 2 * takes):.0f} ml")
        mould = f"mesh/mould_{placed.name}_lower.stl and mesh/mould_{placed.name}_upper.stl"
        yield Item(f"Mould of “{placed.name}”", f"printed: {mould}", "1")


def _item(placed: PlacedPart, copies: int) -> Item:
    part, name = placed.part, f"{placed.part.kind.capitalize()} “{placed.name}”"
    if isinstance(part, Tube):
        size = (
            f"{part.material}, outer diameter {units.millimetres(part.outer_diameter)}, inner "
            f"{units.millimetres(part.inner_diameter)}, {units.millimetres(part.length)} long"
        )
    elif isinstance(part, Magnet):
        size = (
            f"{part.part}, {units.millimetres(part.diameter)} across, "
            f"{units.millimetres(part.thickness)} thick"
        )
    elif isinstance(part, Cup):
        size = f"cast from {part.material}, rim {units.millimetres(part.diameter)}"
    elif isinstance(part, Line):
        size = (
            f"{part.tubing}, outer diameter {units.millimetres(part.outer_diameter)}, "
            f"{units.millimetres(part.length)}"
        )
    else:
        assert isinstance(part, Base)
        size = f"{part.material}, {units.size(part.width, part.length)}"
    return Item(name, size, str(copies))
