"""plan.svg: the plan of a batch as a chart, a strip for each day, a row for each person, press and
base plate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from sbafab.design.records import Design
from sbafab.geometry.region import coord
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.cycles import cycle_name, design_runs
from sbafab.pressing.schedule import Schedule
from sbafab.pressing.work_plan import PlanEntry, Shop, TaskName, shop_of, work_plan
from sbafab.reports import drawing as draw

WIDTH = 180.0
"""mm of a page's width that a strip takes."""
LABELS, ROW, BAR, RIM = 21.0, 5.0, 4.2, 4.0
"""mm: the names of the rows, the height of a row and of a bar in it, and the right rim."""
HEAD, FOOT = 6.0, 5.0
AFTER = 60.0
"""Minutes after the shift that are drawn where something goes on."""
DAY = 1440.0
MOST_DAYS = 100
FILLS: dict[TaskName, tuple[str, str]] = {
    "cut": ("#cfd8dc", "cut"),
    "sort": ("#eceff1", "sort"),
    "lay": ("#90caf9", "lay up"),
    "press": ("#e57373", "press"),
    "open": ("#ffcc80", "open"),
    "cool": ("#e0f2f1", "cool"),
    "unpin": ("#ffe0b2", "take down"),
    "tubes": ("#a5d6a7", "tubes"),
    "cure": ("#f1f8e9", "cure"),
    "test": ("#ce93d8", "test"),
}
"""Colour and name of each task; every bar that has room for it bears its cycle and step too."""


def plan_svg(design: Design, laminate: Laminate, schedule: Schedule) -> str | None:
    """Return the chart of all days; None for one copy, no plan, or more days than one can read."""
    entries = work_plan(design, laminate, schedule)
    days = max((entry.day for entry in entries), default=0)
    if design_runs(design, laminate).copies == 1 or not 0 < days <= MOST_DAYS:
        return None
    title = f"{design.name}: plan of {design.order.quantity} copies"
    y, drawn = 10.0, [draw.text((1.0, 6.0), title, bold=True)]
    for _, height, elements in day_strips(entries, shop_of(design)):
        drawn.append(f'<g transform="translate(0 {coord(y)})">{"".join(elements)}</g>')
        y += height + 3
    drawn += legend(entries, (1.0, y + 1))
    return draw.document(WIDTH, y + 6, title, drawn)


def day_strips(entries: Sequence[PlanEntry], shop: Shop) -> Iterator[tuple[int, float, list[str]]]:
    """Yield day, height (mm) and elements of each strip, ``WIDTH`` wide."""
    rows = [(name, [*_spans(entries, kind, number)]) for name, kind, number in _resources(shop)]
    if not any(entry.task == "cure" for entry in entries):
        rows.pop()
    is_late = any(entry.end > shop.shift for entry in entries if entry.task != "cure")
    axis = shop.shift + (AFTER if is_late else 0.0)
    for day in range(1, max(entry.day for entry in entries if entry.technician) + 1):
        yield day, HEAD + ROW * len(rows) + FOOT, _strip(day, rows, shop, axis)


def legend(entries: Sequence[PlanEntry], at: tuple[float, float]) -> list[str]:
    """Return the colours of the tasks in one line."""
    tasks = {entry.task for entry in entries}
    x, y = at
    drawn = []
    for task, (fill, name) in FILLS.items():
        if task in tasks:
            drawn.append(_bar(x, y, 4.0, 3.0, fill))
            drawn.append(draw.text((x + 5, y + 2.5), name, size=2.4))
            x += 7.5 + draw.text_width(name, 2.4)
    return drawn


_Bar = tuple[float, float, TaskName, str]
"""Start and end in minutes from the start of the first shift, task, and label."""
_Row = tuple[str, list[_Bar]]


def _resources(shop: Shop) -> Iterator[tuple[str, str, int]]:
    """Yield the name of each row, and the field and number by which an entry belongs into it."""
    for kind, many, name in (
        ("technician", shop.technicians, "Technician"),
        ("press", shop.presses, "Press"),
        ("plate", shop.plates, "Base plate"),
    ):
        for number in range(1, many + 1):
            yield f"{name} {number}", kind, number
    yield "Adhesive", "cure", 0


def _spans(entries: Sequence[PlanEntry], kind: str, number: int) -> Iterator[_Bar]:
    if kind == "cure":
        cures = sorted(_span(entry) for entry in entries if entry.task == "cure")
        yield from ((start, end, "cure", "cure") for start, end in _united(cures))
        return
    for entry in entries:
        if getattr(entry, kind) == number:
            short = f"{cycle_name(entry.cycle)}{entry.step or ''}"
            yield *_span(entry), entry.task, short or FILLS[entry.task][1]


def _span(entry: PlanEntry) -> tuple[float, float]:
    start = (entry.day - 1) * DAY + entry.start
    return start, start + entry.minutes


def _united(spans: Iterable[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """Yield spans of which those that touch are one."""
    first, last = math.inf, -math.inf
    for start, end in spans:
        if start > last > first:
            yield first, last
            first = start
        first, last = min(first, start), max(last, end)
    if last > first:
        yield first, last


def _strip(day: int, rows: Sequence[_Row], shop: Shop, axis: float) -> list[str]:
    """Return the elements of one day: hours, rows, bars, and the end of the shift."""
    scale = (WIDTH - LABELS - RIM) / axis
    foot = HEAD + ROW * len(rows)
    drawn = [draw.text((1.0, 4.0), f"Day {day}", size=2.8, bold=True)]
    for hour in range(math.floor(axis / 60) + 1):
        x = LABELS + 60 * hour * scale
        drawn.append(draw.line([(x, HEAD), (x, foot)], colour="#cccccc"))
        drawn.append(draw.text((x, foot + 3), f"{hour} h", size=2.2, anchor="middle"))
    for number, (name, spans) in enumerate(rows):
        y = HEAD + ROW * number
        drawn.append(draw.text((1.0, y + 3.4), name, size=2.6))
        for start, end, task, label in spans:
            low, high = (min(max(t - (day - 1) * DAY, 0.0), axis) for t in (start, end))
            if high > low:
                x, width = LABELS + low * scale, (high - low) * scale
                drawn.append(_bar(x, y + (ROW - BAR) / 2, width, BAR, FILLS[task][0]))
                if draw.text_width(label, 2.2) <= width:
                    at = x + width / 2, y + 3.3
                    drawn.append(draw.text(at, label, size=2.2, anchor="middle"))
    x = LABELS + shop.shift * scale
    drawn.append(draw.line([(x, HEAD - 1), (x, foot)], width=0.4))
    return drawn


def _bar(x: float, y: float, width: float, height: float, fill: str) -> str:
    return draw.box((x, y), (x + width, y + height), fill=fill, stroke=draw.GREY, width=0.1)
