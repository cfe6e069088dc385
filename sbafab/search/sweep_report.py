"""Reports of searches: the rows of a sweep as CSV, and pages of pictures and tables.

A table has the same bytes, whoever measured the rows and when. Pages are self-contained: style and
pictures are inline, nothing is fetched.
"""

from __future__ import annotations

import csv
import json
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import chain
from operator import le
from pathlib import Path
from typing import Any, NamedTuple

from sbafab.design.files import rule_names
from sbafab.design.identity import design_sha256
from sbafab.design.records import Design, Free
from sbafab.errors import OutputError
from sbafab.folders.swap import replace_text
from sbafab.markup import environment
from sbafab.models.calibration import factors_of
from sbafab.models.paper import CALIBRATED_MODELS, counterpart
from sbafab.models.quantity import ANYWHERE, Conditions, FigureKey, Quantity
from sbafab.reports.charts import ChartBars, ChartCurve, ChartSpecks, Panel, chart_svg
from sbafab.search.trials import SweepOutcome, SweepRow
from sbafab.search.vary import Values, format_value
from sbafab.spreadsheet import csv_text
from sbafab.version import GENERATOR

# The tables: one design per row, in the order requested.


CSV, PAGE, JOURNAL = "sweep.csv", "sweep.html", "journal.jsonl"
"""Files of a sweep's folder."""
PARTS = ("verdict", "margin")
"""Columns of each rule, in the order of its list."""
HEAD = ("number", "sha256", "outcome", "reason")
"""The first columns of every table."""
FIRST = (
    Quantity.OUTLINE_DIAMETER,
    Quantity.OVERALL_DIAMETER,
    Quantity.DEFLATED_DIAMETER,
    Quantity.REACHED_DIAMETER,
    Quantity.FOLDED_HEIGHT,
    Quantity.MASS,
    Quantity.REFERENCE_STROKE,
    Quantity.BURST,
)
"""The most important figures without a pressure."""
MOVED = (Quantity.FREE_STROKE, Quantity.BEND, Quantity.BLOCKED_FORCE)
"""The most important figures at a pressure."""
YIELD = ("yield", "yield.low", "yield.high")
"""Share of good builds, with its 95 % interval for this number of random builds."""
LITTLE = 0.005
"""Largest share of a limit that counts as nothing to spare."""


@dataclass(frozen=True)
class Table:
    """Rows of a sweep, read again for each pass, so that only the disk limits their number.

    ``values`` are of the varied keys, a set for each row; ``limited`` are labels of the quantities
    that have limits, which stand among the rules.
    """

    rows: Callable[[], Iterator[SweepRow]]
    values: Sequence[Values]
    pressures_kpa: Sequence[float] = ()
    is_calibrated: bool = False
    limited: Sequence[str] = ()
    figures: dict[str, FigureKey] = field(default_factory=dict, init=False)
    """The figures of all rows by their columns."""
    outcomes: Counter[SweepOutcome] = field(default_factory=Counter, init=False)
    causes: dict[str, list[str]] = field(default_factory=dict, init=False)
    """Reasons of each cause of failure, each with the number of its design."""
    hashes: set[str] = field(default_factory=lambda: {""}, init=False)
    _limited_columns: dict[str, None] = field(default_factory=dict, init=False)
    _binding: set[str] = field(default_factory=set, init=False)
    """Rules that anywhere fail, warn or pass without margin."""

    def __post_init__(self) -> None:
        self._binding.update(self.limited)
        for number, row in enumerate(self.rows(), 1):
            self.outcomes[row["outcome"]] += 1
            self.hashes.add(row.get("sha256", ""))
            failed = {} if row["outcome"] == "passes" else {row["outcome"]: row["reason"]}
            for cause, message in row.get("failed", failed).items():
                told = f"no. {number}: {cause}: {message}"
                self.causes.setdefault(cause, []).append(told)
            keys = row.get("figures", ())
            self.figures.update({_heading(key): FigureKey.read(key) for key in keys})
            columns = [cells[1] for cells in row.get("quantities", {}).values()]
            self._limited_columns.update(dict.fromkeys(filter(None, columns)))
            for name, (verdict, margin, _, limit, _) in row.get("rules", {}).items():
                is_tight = margin is not None and limit and abs(margin) < LITTLE * abs(limit)
                if verdict != "pass" or is_tight:
                    self._binding.add(name)

    @cached_property
    def has_yield(self) -> bool:
        """True if any design has a yield."""
        return any(row.get("yield") for row in self.rows())

    @cached_property
    def written(self) -> list[str]:
        """Columns of the files: varied keys, leading figures, limited quantities, yield, and rules
        that bind or stand for limits.
        """
        moved = [(of, Conditions(kpa=kpa)) for kpa in self.pressures_kpa for of in MOVED]
        leading = (self.first(*sought) for sought in (*((of, ANYWHERE) for of in FIRST), *moved))
        rules = (name for name in (*rule_names(), *self.limited) if name in self._binding)
        margins = (f"{name}.{part}" for name in rules for part in PARTS)
        varied = (name for values in self.values for name in values)
        good = YIELD if self.has_yield else ()
        names = (*HEAD, *varied, *filter(None, leading), *self._limited_columns, *good, *margins)
        return list(dict.fromkeys(names))

    def first(self, quantity: Quantity, at: Conditions = ANYWHERE) -> str:
        """Return the column of the first figure of a quantity, at conditions that match ``at``, by
        the design model: the calibrated one, else the first; empty if no row has one.
        """
        columns = {
            c: f for c, f in self.figures.items() if f.quantity is quantity and f.at.meet(at)
        }
        here = next((figure.at for figure in columns.values()), None)
        same = [column for column, figure in columns.items() if figure.at == here]
        calibrated = (c for c in same if columns[c].model in CALIBRATED_MODELS)
        return next(calibrated if self.is_calibrated else iter(()), next(iter(same), ""))

    def cells(self, names: Iterable[str]) -> Iterator[list[Any]]:
        """Yield the cells of every row in these columns; None for empty cells."""
        chosen = list(names)
        for number, row in enumerate(self.rows(), 1):
            head = (number, row.get("sha256", ""), row["outcome"], row["reason"])
            # Varied values are listed even if no design resulted.
            every = {**self.values[number - 1], **row.get("keys", {})}
            for rule, cells in row.get("rules", {}).items():
                every |= {f"{rule}.{part}": cell for part, cell in zip(PARTS, cells, strict=False)}
            every |= zip(HEAD, head, strict=True)
            every |= zip(YIELD, row.get("yield", ()), strict=False)
            every |= {_heading(key): value for key, value in row.get("figures", {}).items()}
            yield [_cell(every.get(name)) for name in chosen]


@lru_cache(maxsize=4096)
def _heading(key: str) -> str:
    """Return the column of a figure."""
    return FigureKey.read(key).heading


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _cell(value: Any) -> Any:
    if value is None or isinstance(value, str) or _is_number(value):
        return value
    return json.dumps(value, ensure_ascii=False)


def write_table(table: Table, path: Path) -> None:
    """Write every row in the table's ``written`` columns; unknown values are empty cells."""
    replace_text(path, csv_text(chain([table.written], table.cells(table.written))))


def designs_before(path: Path) -> set[str]:
    """Return the hashes of the designs in a table that is there. Raises OutputError for one that no
    sweep has written.
    """
    if not path.exists():
        return set()
    with path.open(newline="", encoding="utf-8", errors="replace") as opened:
        if not opened.readline(200).startswith(",".join(HEAD)):
            raise OutputError(
                f"{path} was not written by sbafab sweep; move it away, or choose another folder "
                "with -o"
            )
        opened.seek(0)
        return {row.get("sha256", "") for row in csv.DictReader(opened)}


# Pictures of the page: outcomes by the varied keys, and trade-offs.


OUTCOMES: Mapping[SweepOutcome, tuple[str, str]] = {
    "passes": ("#009e73", "pass every rule"),
    "fails": ("#d55e00", "fail a rule or limit"),
    "refused": ("#999999", "cannot be made"),
    "crashed": ("#000000", "crashed"),
    "too long": ("#cc79a7", "took too long"),
}
"""Colour of an outcome and its words; with a mark by its order, distinct for the colour blind and
in grey."""
BINS = 12
MOST_BARS = 30
IN_ROW = 3
"""Panels per row."""
Columns = Mapping[str, Sequence[Any]]
"""One value for each design by column, with ``outcome``; None if a design lacks it."""


def _both(columns: Columns, x: str, y: str, outcome: str) -> list[tuple[float, float, int]]:
    """Return values and numbers of the designs of one outcome that have both."""
    rows = enumerate(zip(columns["outcome"], columns[x], columns[y], strict=True))
    return [
        (a, b, number)
        for number, (of, a, b) in rows
        if of == outcome and _is_number(a) and _is_number(b)
    ]


def passes_svg(columns: Columns, keys: Sequence[str]) -> str:
    """Return the chart of outcomes by the value of each key; for two numeric keys also by both."""
    panels = [_bars(columns, key) for key in keys]
    if len(keys) == 2 and all(any(map(_is_number, columns[key])) for key in keys):
        x, y = keys
        specks = _specks(columns, x, y, OUTCOMES)
        panels.append(Panel(f"{x} and {y}", x, y, (), (), False, specks))
    return _drawn("Outcomes", panels)


def trades_svg(columns: Columns, pairs: Sequence[tuple[str, str]]) -> tuple[str, set[int]]:
    """Return one panel per pair of a cost and a gain with the front of passing designs, and the
    numbers of designs on any front.
    """
    on_front: set[int] = set()
    panels = []
    for x, y in pairs:
        rows = _both(columns, x, y, "passes")
        best = sorted(rows[place] for place in front([row[:2] for row in rows], (False, True)))
        on_front.update(number for _, _, number in best)
        on_curve = [a for a, _, _ in best], [b for _, b, _ in best]
        curve = ChartCurve("Pareto front", *on_curve, dotted=True)
        labels = f"{_label(x)} (less is better)", f"{_label(y)} (more is better)"
        specks = _specks(columns, x, y, ("fails", "passes"))
        panels.append(Panel("", *labels, [curve], (), False, specks))
    return _drawn("Trade-offs", panels), on_front


def _label(column: str) -> str:
    """Return the words of a column."""
    return "share of good builds" if column == YIELD[0] else re.sub(r"\[(.*)\]", r"in \1", column)


def _drawn(title: str, panels: Sequence[Panel]) -> str:
    text = chart_svg(title, panels, IN_ROW)
    return text[text.index("<svg") :]


def _bars(columns: Columns, key: str) -> Panel:
    """Return stacked counts of designs by outcome, by value or in equal bins."""
    names, group = _groups(columns[key])
    counts = Counter(zip(columns["outcome"], group, strict=True))
    heights = {outcome: [counts[outcome, n] for n in range(len(names))] for outcome in OUTCOMES}
    bars = [ChartBars(each, high, OUTCOMES[each][0]) for each, high in heights.items() if any(high)]
    return Panel("", key, "designs", (), bars=bars, names=names)


def _specks(
    columns: Columns, x: str, y: str, outcomes: Iterable[SweepOutcome]
) -> list[ChartSpecks]:
    marks = [*OUTCOMES]
    rows = {outcome: _both(columns, x, y, outcome) for outcome in outcomes}
    return [
        ChartSpecks(
            *(outcome, [a for a, _, _ in each], [b for _, b, _ in each]),
            *(OUTCOMES[outcome][0], marks.index(outcome)),
        )
        for outcome, each in rows.items()
        if each
    ]


def _groups(column: Sequence[Any]) -> tuple[list[str], list[int]]:
    """The names of the values, or of bins if there are many, and the index of each design."""
    are_numbers = all(map(_is_number, column))
    distinct = list(dict.fromkeys(map(repr, column)))
    if len(distinct) <= MOST_BARS or not are_numbers:
        if are_numbers:
            distinct.sort(key=float)
        place = {text: number for number, text in enumerate(distinct)}
        return [_tick(text) for text in distinct], [place[repr(value)] for value in column]
    low, step = min(column), (max(column) - min(column)) / BINS
    middles = [f"{low + (number + 0.5) * step:.3g}" for number in range(BINS)]
    return middles, [min(BINS - 1, int((value - low) / step)) for value in column]


def _tick(text: str) -> str:
    try:
        return f"{float(text):g}"
    except ValueError:
        return text.strip("'").rpartition("/")[2][:24]


# The page.


INTRODUCTION = (Quantity.MASS, Quantity.OVERALL_DIAMETER, Quantity.DEFLATED_DIAMETER)
MOST_REASONS = 12
MOST_ROWS = 60
"""Most designs on a front that the page lists; all are in the tables."""


class PageSection(NamedTuple):
    """A section of a page: ``lines``, a drawing, ``pictures`` side by side (name, data URI or a
    note), and a table, with unimportant rows in ``grey``.
    """

    title: str
    lines: Sequence[str] = ()
    svg: str = ""
    pictures: Sequence[tuple[str, str, str]] = ()
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    grey: Collection[int] = ()
    note: str = ""


def page_html(
    title: str,
    lines: Sequence[str],
    sections: Sequence[PageSection],
    footer: str,
    tiles: Sequence[tuple[str, int, str]] = (),
) -> str:
    """Return a whole page; ``tiles`` are counts with their colour and words."""
    template = environment(Path(__file__).parent).get_template("report.html.j2")
    return template.render(title=title, lines=lines, sections=sections, footer=footer, tiles=tiles)


def sweep_html(
    design: Design, varied: Sequence[Free], table: Table, limits: Iterable[str] = ()
) -> str:
    """Return the whole page of a sweep, with its ``limits`` in the head."""
    keys = [swept.key for swept in varied]
    costs, gains = _objectives(table)
    names = ["outcome", *keys, *costs, *gains]
    columns = dict(zip(names, zip(*table.cells(names), strict=True), strict=True))
    counts = table.outcomes
    passing = [number for number, of in enumerate(columns["outcome"]) if of == "passes"]
    differ = [name for name in names if len({columns[name][at] for at in passing} - {None}) > 1]
    pairs = [(cost, gain) for cost in costs for gain in gains if {cost, gain} <= {*differ}][:6]
    none = "The passing designs do not differ in two figures, so there is no trade-off."
    note = "" if pairs else none if counts["passes"] else "No design passes."
    sections = [PageSection("Passing designs", svg=passes_svg(columns, keys), note=note)]
    causes = sorted(table.causes.items(), key=lambda item: -len(item[1]))
    if causes:
        more = len(causes) - MOST_REASONS
        note = f"{more} more causes are listed in the tables." if more > 0 else ""
        head = ["cause", "designs", "example"]
        rows = [[cause, str(len(told)), told[0]] for cause, told in causes[:MOST_REASONS]]
        sections.append(PageSection("Causes of failure", head=head, rows=rows, note=note))
    if pairs:
        sections += _trade_offs(design, table, keys, [*costs, *gains], columns, pairs)
    footer = (
        f"Design {design_sha256(design)[:12]}, {GENERATOR}. Values: sweep.csv; all of them: "
        "journal.jsonl. Predictions are models, each with its validity: sbafab predict."
    )
    lines = [*(f"{swept.key} {_values_text(swept)}" for swept in varied), *limits]
    tiles = [
        (colour, counts[outcome], words)
        for outcome, (colour, words) in OUTCOMES.items()
        if counts[outcome] or outcome == "passes"
    ]
    title = f"{design.name}: {len(table.values)} designs"
    return page_html(title, lines, sections, footer, tiles)


def _trade_offs(
    design: Design,
    table: Table,
    keys: Sequence[str],
    objectives: Sequence[str],
    columns: Columns,
    pairs: Sequence[tuple[str, str]],
) -> Iterator[PageSection]:
    """Yield the pictures of trade-offs, with the paper's measured values if the model deviates by
    more than a quarter, and the designs on their fronts.
    """
    trades, best = trades_svg(columns, pairs)
    calibration = factors_of(design).calibration
    figures = {name: table.figures[name] for name in objectives if name in table.figures}
    beside = {name: counterpart(design.form, *of, calibration) for name, of in figures.items()}
    measured = [f"{_label(name)}: {row.sentence}." for name, row in beside.items() if row]
    yield PageSection("Trade-offs", measured, trades)
    listed = sorted(best)[:MOST_ROWS]
    names = [*keys, *objectives]
    rows = [[str(n + 1), *(format_value(columns[name][n]) for name in names)] for n in listed]
    head = ("no.", *keys, *map(_label, objectives))
    line = "Passing designs that no other one improves on in both values of a picture above."
    more = len(best) - len(listed)
    note = f"{more} more designs are in the tables." if more else ""
    yield PageSection("Pareto fronts", [line], head=head, rows=rows, note=note)


def _values_text(swept: Free) -> str:
    if not swept.step:
        return f"{swept.low:g} to {swept.high:g}"
    texts = [format_value(value) for value in swept.values]
    if len(texts) > 6:
        return f"{texts[0]} to {texts[-1]}, {len(texts)} values"
    return ", ".join(texts)


def _objectives(table: Table) -> tuple[list[str], list[str]]:
    """Return the columns of costs, sizes and mass, and of gains: the first predicted stroke and
    force, and the yield.
    """
    first = table.first
    flat = Conditions(share=0.0, kpa=max(table.pressures_kpa, key=abs, default=None))
    stroke = first(Quantity.FREE_STROKE) or first(Quantity.REFERENCE_STROKE)
    force = first(Quantity.BLOCKED_FORCE, flat) or first(Quantity.FORCE_BOUND)
    good = YIELD[0] if table.has_yield else ""
    costs, gains = map(first, INTRODUCTION), (stroke, force, good)
    return [*filter(None, costs)], [*filter(None, gains)]


# The Pareto front.


def front(rows: Sequence[Sequence[float]], more: Sequence[bool]) -> list[int]:
    """Return the numbers of the non-dominated rows, in order; the first of equal rows.

    ``more`` tells for each value whether more is better.
    """
    signed = [
        tuple(-value if up else value for value, up in zip(row, more, strict=True)) for row in rows
    ]
    best: list[int] = []
    # Every row that dominates another, nowhere worse, comes before it in this order.
    for number in sorted(range(len(signed)), key=lambda number: (signed[number], number)):
        if not any(all(map(le, signed[better], signed[number])) for better in best):
            best.append(number)
    return sorted(best)
