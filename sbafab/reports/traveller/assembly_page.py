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
from sbafab.assemblies.records import AnyPart, Base, Cup
from sbafab.assemblies.shapes import colours, own_surface
from sbafab.cutting.sheets import SheetFile
from sbafab.models.sizes import sizes
from sbafab.pressing.schedule import joined_words
from sbafab.reports.traveller.bench import cutting
from sbafab.reports.traveller.formatting import frame, millimetres, render, size
from sbafab.reports.traveller.page import code_svg, context, preparations, record_text, step_rows
from sbafab.reports.traveller.pictures import definitions, part_regions, pattern_regions, sheet_rows
from sbafab.reports.traveller.work import (
    THREAD,
    Item,
    Work,
    assembly_times,
    film_items,
    items_of_part,
)
from sbafab.rules.finding import Finding

_NAMES = re.compile(r'(\b(?:id|aria-labelledby)="|\bhref="#|url\(#)')


@dataclass(frozen=True)
class AssemblyWork:
    """The input of an assembly's traveller; ``findings`` are from checks between parts.

    ``waived`` are checks, ``lowered`` limits below the defaults, for the checks between parts and
    for all designs; ``picture`` is the picture of the assembly, as bytes.
    """

    assembled: Assembled
    sha256: str
    works: Sequence[Work]
    sheets: Sequence[SheetFile]
    findings: Sequence[Finding]
    waived: Sequence[str]
    lowered: Sequence[str]
    picture: bytes

    @property
    def marks(self) -> dict[str, str]:
        """Return a letter for each of several designs, for short labels."""
        names = [work.design.name for work in self.works]
        several = len(names) > 1
        return {name: ascii_uppercase[i % 26] if several else "" for i, name in enumerate(names)}


def assembly_html(assembly: AssemblyWork) -> str:
    """Return the whole page, with each pattern prefixed by the mark of its design."""
    assembly = _with_marks(assembly)
    assembled, works, marks = assembly.assembled, assembly.works, assembly.marks
    name = assembled.assembly.name
    text = record_text(name, assembly.sha256)
    findings = [*assembly.findings, *(finding for work in works for finding in work.findings)]
    cups = [placed.name for placed in assembled.parts if isinstance(placed.part, Cup)]
    return render(
        "assembly.html.j2",
        **frame(name, assembly.sha256),
        **preparations(works, findings) | {"cups": cups},
        **cutting(works),
        assembly=assembly,
        order=assembled.assembly.order,
        works=works,
        design=works[0].design,
        shapes=definitions(part_regions(assembly.sheets)),
        code=code_svg(text),
        code_text=text,
        picture=b64encode(assembly.picture).decode("ascii"),
        colours={part: f"#{bytes(rgb).hex()}" for part, rgb in colours(assembled).items()},
        tested=[name for build in assembled.designs for name in build.parts],
        bill=_bill(assembly),
        sheet_rows=sheet_rows(works[0].design, assembly.sheets, dict.fromkeys(marks, "")),
        marks=marks,
        chapters=[_chapter(assembly, number) for number in range(1, len(works) + 1)],
        step_rows=[(work, step_rows(work)) for work in works],
        joints=joints(assembled),
        joint_count=sum(placed.part.on is not None for placed in assembled.parts),
        deployed=deployed(assembled),
        times=assembly_times(works),
    )


def _chapter(assembly: AssemblyWork, number: int) -> str:
    """Return the chapter on one design, with ids unique on the page."""
    work = assembly.works[number - 1]
    page: dict[str, Any] = context(work)
    page["shapes"] = definitions(pattern_regions(work.laminate))
    page |= {"in_chapter": True, "again": number > 1, "mark": assembly.marks[work.design.name]}
    return _NAMES.sub(rf"\g<1>d{number}-", render("chapter.html.j2", **page))


def _with_marks(assembly: AssemblyWork) -> AssemblyWork:
    """Return the work with "A P03" for P03 of its first design, on sheets and in laminates; a
    single design needs no mark.
    """
    marks = assembly.marks
    if len(marks) == 1:
        return assembly

    def marked(thing: Any, design: str) -> Any:
        return replace(thing, pattern=f"{marks[design]} {thing.pattern}")

    sheets = []
    for sheet in assembly.sheets:
        parts = tuple(marked(part, part.design) for part in sheet.nest.parts)
        counts = tuple((name, f"{marks[name]} {pattern}", n) for name, pattern, n in sheet.counts)
        sheets.append(replace(sheet, counts=counts, nest=replace(sheet.nest, parts=parts)))
    works = []
    for work in assembly.works:
        layers = tuple(marked(layer, work.design.name) for layer in work.laminate.layers)
        works.append(replace(work, laminate=replace(work.laminate, layers=layers), sheets=sheets))
    return replace(assembly, works=works, sheets=sheets)


# The bill of materials.


POUR = 10.0  # smallest amount of silicone that can be weighed and mixed well, ml: ours


def _bill(assembly: AssemblyWork) -> list[Item]:
    """Return the films of all designs together, each design's other items, and purchased items."""
    of_designs = [
        Item(f"{item.name} ({work.design.name})", item.what, item.quantity)
        for work in assembly.works
        for item in items_of_part(work)
    ]
    films, bought = film_items(assembly.works), _bought(assembly.assembled)
    return list(dict.fromkeys([*films, *of_designs, *bought]))


def _bought(assembled: Assembled) -> Iterator[Item]:
    """Yield purchased items: parts, adhesives, and silicone and mould for cups."""
    copies = assembled.assembly.order.copies
    for placed in assembled.parts:
        part = placed.part
        if placed.made is None:
            name = f"{part.kind.capitalize()} “{placed.name}”"
            yield Item(name, _size(part), str(copies))
        if isinstance(part, Cup):
            takes = own_surface(placed).volume / 1000 * copies
            words = f"both parts of it; the cup takes {takes:.2g} ml"
            yield Item(part.material, words, f"{max(POUR, 2 * takes):.0f} ml")
            mould = f"mesh/mould_{placed.name}_lower.stl and mesh/mould_{placed.name}_upper.stl"
            yield Item(f"Mould of “{placed.name}”", f"printed: {mould}", "1")
    if any(placed.made is not None and placed.made.laminate.inlets for placed in assembled.parts):
        yield THREAD
    joints: dict[str, list[str]] = {}
    for placed in assembled.parts:
        glue = adhesive(placed)
        if glue:
            joints.setdefault(glue, []).append(placed.name)
    for glue, names in joints.items():
        yield Item("Adhesive", f"{glue}, for {joined_words(names)}")


SIZES = {
    "tube": "{material}, outer diameter {outer_diameter}, inner {inner_diameter}, {length} long",
    "magnet": "{part}, {diameter} across, {thickness} thick",
    "cup": "cast from {material}, rim {diameter}",
    "line": "{tubing}, outer diameter {outer_diameter}, {length}",
}
"""Of parts by kind; of others material, width and length."""


def _size(part: AnyPart) -> str:
    if isinstance(part, Base):
        return f"{part.material}, {size(part.width, part.length)}"
    values = {name: millimetres(v) if isinstance(v, float) else v for name, v in part}
    return SIZES[part.kind].format_map(values)


def adhesive(placed: PlacedPart) -> str | None:
    """Return the adhesive of a part; for a sheet wrapped around its tube, that of its design."""
    wrap = None if placed.made is None else placed.made.design.form.wrap
    return placed.part.glue or (wrap.glue if wrap is not None else None)


# Joining, part by part.


class PartJoint:
    """The joining step of one part: its host, and the ``lines`` inserted before.

    ``supply`` holds the runs of its tubes along the host. ``is_below``: it is fixed on a lower
    face, upside down.
    """

    def __init__(self, assembled: Assembled, placed: PlacedPart) -> None:
        self.placed, self.part, self.glue = placed, placed.part, adhesive(placed)
        self.carrier = assembled.on(placed)
        self.lines = [line.name for line in _lines_through(assembled, placed)]
        self.supply = supply_runs(placed, assembled)
        self.is_below = placed.part.at in ("bottom", "start")

    @property
    def heading(self) -> float:
        """The angle in degrees, anti-clockwise, from its host's mark to the part's, facing the
        joint: an actuator bends by its tabs.
        """
        assert self.carrier is not None
        turn = _mark_angle(self.placed) + self.placed.turn
        # On a lower face the part is upside down and seen from below.
        on = _mark_angle(self.carrier)
        return round(turn + (on - 180 if self.is_below else -on), 6) % 360

    @property
    def aside(self) -> tuple[float, float]:
        """The offset of the part's middle to the right and up, mm, facing the joint."""
        x, y = self.part.offset
        return x, (-y if self.is_below else y)


def _mark_angle(placed: PlacedPart) -> float:
    """Return the angle in degrees from a part's x to its mark, the tab of its first chamber."""
    if placed.made is None:
        return 0.0
    x, y = placed.made.laminate.inlets[0].direction
    return math.degrees(math.atan2(y, x))


def joints(assembled: Assembled) -> list[PartJoint]:
    """Return a step for each part, in a feasible order of joining."""
    return [PartJoint(assembled, placed) for placed in _in_order(assembled)]


def _in_order(assembled: Assembled) -> Iterator[PlacedPart]:
    """Yield parts in building order; a line is inserted while both ends of its lumen are
    accessible.
    """
    for placed in assembled.parts:
        if placed.made is not None and placed.part.on is not None:
            yield from _lines_through(assembled, placed)
        carrier = assembled.on(placed)
        is_late = carrier is None or carrier.made is None or carrier.part.on is None
        if is_late or placed.part.at != "lumen":
            yield placed


def _lines_through(assembled: Assembled, placed: PlacedPart) -> list[PlacedPart]:
    return [
        part for part in assembled.parts if part.part.at == "lumen" and part.part.on == placed.name
    ]


def deployed(assembled: Assembled) -> dict[str, Any]:
    """Return the tests of the finished assembly: actuators with their leak pressures, and those
    with a diameter, deflated and inflated.
    """
    actuators = [placed for placed in assembled.parts if isinstance(placed, PlacedSba)]
    each = [(sba.name, sizes(sba.made.design, sba.made.laminate)) for sba in actuators]
    leaks = {sba.made.design.acceptance.leak_pressure_kpa for sba in actuators}
    return {
        "actuators": [sba.name for sba in actuators],
        "leaks": sorted(leaks),
        "across": [(name, size) for name, size in each if "reached_diameter" in size],
    }
