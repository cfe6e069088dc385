"""Reports of searches: the rows of a sweep as CSV, and pages of pictures and tables.

A table has the same bytes, whoever measured the rows and when; the time of each design is in a
separate file. Pages are self-contained: style and pictures are inline, nothing is fetched.
"""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain
from pathlib import Path
from typing import IO, Any, NamedTuple

from sbafab.design.identity import design_sha256
from sbafab.design.records import Design
from sbafab.design.sections import rule_names
from sbafab.errors import OutputError
from sbafab.markup import environment
from sbafab.models.intervals import factors_of
from sbafab.models.paper import CALIBRATED_MODELS, counterpart
from sbafab.models.quantity import ANYWHERE, Conditions, FigureKey, Quantity
from sbafab.reports.charts import ChartBars, ChartCurve, ChartSpecks, Panel, chart_svg
from sbafab.search.trials import SweepRow
from sbafab.search.vary import Values, Varied, format_value
from sbafab.spreadsheet import write_rows
from sbafab.version import GENERATOR

# The tables: one design per row, in the order requested.


CSV, TIMES = "sweep.csv", "times.csv"
PAGE, JOURNAL = "sweep.html", "journal.jsonl"
"""Files of a sweep's folder."""
PARTS = (("verdict", 0), ("margin", 1), ("measured", 2), ("limit", 3))
"""Columns of each rule, and their index in its list."""
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
)
"""The most important figures without a pressure."""
MOVED = (Quantity.FREE_STROKE, Quantity.BEND, Quantity.BLOCKED_FORCE)
"""The most important figures at a pressure."""
YIELD = ("yield", "yield.low", "yield.high")
"""Share of good builds, with its 95 % interval for this number of random builds."""
LITTLE = 0.005
"""Largest share of a limit that counts as nothing to spare."""


class Table:
    """Rows of a sweep, read again for each pass, so that only the disk limits their number.

    Files get the most important columns; ``is_whole``: all of them.
    """

    def __init__(
        self,
        rows: Callable[[], Iterator[SweepRow]],
        values: Sequence[Values],
        pressures_kpa: Sequence[float] = (),
        is_whole: bool = False,
        is_calibrated: bool = False,
    ) -> None:
        self.rows = rows
        self.values = values
        self.pressures_kpa = pressures_kpa
        self.is_whole = is_whole
        self.is_calibrated = is_calibrated

    @cached_property
    def columns(self) -> dict[str, bool]:
        """Columns of all rows, and whether they hold numbers only: keys, the varied ones first,
        then rules, then figures.
        """
        kinds: dict[str, bool] = {}
        order: tuple[dict[str, None], ...] = ({}, {}, {}, {})
        for row in self._flat():
            for part, cells in zip(order, row, strict=True):
                part.update(dict.fromkeys(cells))
                for name, cell in cells.items():
                    if cell is not None:
                        kinds[name] = kinds.get(name, True) and _is_number(cell)
        return {name: kinds.get(name, True) for part in order for name in part}

    @cached_property
    def written(self) -> list[str]:
        """Columns of the files: varied keys, leading figures, binding rules; or all."""
        varied = [name for values in self.values for name in values]
        first = [*HEAD, *varied, *self._leading(), *self._binding()]
        every = dict.fromkeys([*first, *(self.columns if self.is_whole else ())])
        return [name for name in every if name in self.columns]

    @cached_property
    def figures(self) -> dict[str, FigureKey]:
        """The figures of all rows by their columns."""
        keys = dict.fromkeys(key for row in self.rows() for key in row.get("figures", ()))
        return {_heading(key): FigureKey.read(key) for key in keys}

    def first(self, quantity: Quantity, at: Conditions) -> str | None:
        """Return the column of the first figure of a quantity, at conditions that match ``at``, by
        the model to design with: the calibrated one, else the first.
        """
        columns = [
            c for c, of in self.figures.items() if of.quantity is quantity and of.at.meet(at)
        ]
        if not columns:
            return None
        here = self.figures[columns[0]].at
        same = [column for column in columns if self.figures[column].at == here]
        if not self.is_calibrated:
            return same[0]
        return min(same, key=lambda column: self.figures[column].model not in CALIBRATED_MODELS)

    def _leading(self) -> Iterator[str]:
        """Yield each leading figure's first column, by the model to design with."""
        moved = [(of, Conditions(kpa=kpa)) for kpa in self.pressures_kpa for of in MOVED]
        for quantity, at in (*((of, ANYWHERE) for of in FIRST), *moved):
            column = self.first(quantity, at)
            if column is not None:
                yield column
        yield from YIELD

    def _binding(self) -> Iterator[str]:
        """Yield verdict and margin of rules that anywhere fail, warn or pass without margin."""
        not_passing = {
            name
            for row in self.rows()
            for name, (verdict, margin, _, limit, _) in row.get("rules", {}).items()
            if verdict != "pass"
            or (margin is not None and limit and abs(margin) < LITTLE * abs(limit))
        }
        for name in rule_names():
            if name in not_passing:
                yield from (f"{name}.verdict", f"{name}.margin")

    def cells(self, names: Iterable[str]) -> Iterator[list[Any]]:
        """The cells of every row in these columns; None for empty cells."""
        chosen = [(name, self.columns[name]) for name in names]
        for row in self._flat():
            every = {name: cell for part in row for name, cell in part.items()}
            yield [_cell(every.get(name), is_number) for name, is_number in chosen]

    def _flat(self) -> Iterator[tuple[dict[str, Any], ...]]:
        for number, (row, values) in enumerate(zip(self.rows(), self.values, strict=True), 1):
            cells = (number, row.get("sha256", ""), row["outcome"], row["reason"])
            head = dict(zip(HEAD, cells, strict=True))
            shares = dict(zip(YIELD, row.get("yield", ()), strict=False))
            by_column = {_heading(key): value for key, value in row.get("figures", {}).items()}
            # Varied values are listed even if no design resulted.
            yield head, {**values, **row.get("keys", {})}, _rules(row), {**shares, **by_column}


@lru_cache(maxsize=4096)
def _heading(key: str) -> str:
    """Return the column of a figure."""
    return FigureKey.read(key).heading


def _rules(row: SweepRow) -> dict[str, Any]:
    rules = row.get("rules", {})
    return {
        f"{name}.{part}": rules[name][place]
        for name in rule_names()
        if name in rules
        for part, place in PARTS
    }


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _cell(value: Any, is_number: bool) -> Any:
    if value is None or is_number or isinstance(value, str):
        return value
    return json.dumps(value, ensure_ascii=False)


@contextmanager
def replacing(path: Path) -> Iterator[IO[str]]:
    """A file that is swapped in once it is complete."""
    begun = path.with_name(f".{path.name}.part")
    with begun.open("w", encoding="utf-8", newline="") as opened:
        yield opened
    begun.replace(path)


def write_tables(table: Table, folder: Path) -> list[str]:
    """Write every row in the table's ``written`` columns, and the time of each design, s.

    Unknown values are empty cells. Returns the files' names.
    """
    with replacing(folder / CSV) as opened:
        write_rows(opened, chain([table.written], table.cells(table.written)))
    times = (
        [n, row.get("sha256", ""), row.get("seconds")] for n, row in enumerate(table.rows(), 1)
    )
    with replacing(folder / TIMES) as opened:
        write_rows(opened, chain([["number", "sha256", "seconds"]], times))
    return [CSV, TIMES]


# The tables of an earlier sweep in the folder.


def refuse_foreign(path: Path) -> None:
    """Raises OutputError if there is a table that no sweep has written."""
    if not path.exists():
        return
    with path.open(newline="", encoding="utf-8", errors="replace") as opened:
        first = opened.readline(200)
    if not first.startswith(",".join(HEAD)):
        raise OutputError(
            f"{path} was not written by sbafab sweep; move it away, or choose another folder "
            "with -o"
        )


def stale_designs(path: Path, table: Table) -> int:
    """Return the number of designs in the CSV file at the path that are not in the table."""
    if not path.exists():
        return 0
    now = {row.get("sha256", "") for row in table.rows()}
    with path.open(newline="", encoding="utf-8") as opened:
        before = {row.get("sha256", "") for row in csv.DictReader(opened)}
    return len(before - now - {""})


# Pictures of the page: outcomes by the varied keys, and trade-offs.


LOOKS = {
    "passes": "#009e73",
    "fails": "#d55e00",
    "refused": "#999999",
    "crashed": "#000000",
    "too long": "#cc79a7",
}
"""Colour of an outcome, with its own mark: distinct for the colour blind and in grey."""
BINS = 12
MOST_BARS = 30
IN_ROW = 3
"""Panels per row."""


class Objective(NamedTuple):
    """A column, its label, and whether more of it is better."""

    column: str
    label: str
    more: bool


@dataclass(frozen=True)
class Dots:
    """One value for each of some designs, with outcomes; None if a design lacks it."""

    outcomes: Sequence[str]
    columns: Mapping[str, Sequence[Any]]

    def both(self, x: str, y: str, outcome: str) -> tuple[list[float], list[float], list[int]]:
        """Values and numbers of the designs of one outcome that have both."""
        rows = [
            (a, b, number)
            for number, (of, a, b) in enumerate(
                zip(self.outcomes, self.columns[x], self.columns[y], strict=True)
            )
            if of == outcome and _is_number(a) and _is_number(b)
        ]
        return [a for a, _, _ in rows], [b for _, b, _ in rows], [number for _, _, number in rows]


def passes_svg(dots: Dots, keys: Sequence[str]) -> str:
    """Outcomes by the value of each key; of two keys with numbers also by both."""
    panels = [_bars(dots, key) for key in keys]
    if len(keys) == 2 and all(any(map(_is_number, dots.columns[key])) for key in keys):
        x, y = keys
        panels.append(Panel(f"{x} and {y}", x, y, (), (), False, _specks(dots, x, y, tuple(LOOKS))))
    return _drawn("Outcomes", panels)


def trades_svg(dots: Dots, pairs: Sequence[tuple[Objective, Objective]]) -> tuple[str, set[int]]:
    """One panel per pair with the front of passing designs, and the numbers of designs on any
    front.
    """
    on_front: set[int] = set()
    panels = []
    for x, y in pairs:
        across, up, numbers = dots.both(x.column, y.column, "passes")
        best = front(list(zip(across, up, strict=True)), (x.more, y.more))
        on_front.update(numbers[place] for place in best)
        line = sorted((across[place], up[place]) for place in best)
        ends = [a for a, _ in line], [b for _, b in line]
        curve = ChartCurve("Pareto front", *ends, dotted=True)
        specks = _specks(dots, x.column, y.column, ("fails", "passes"))
        panels.append(Panel("", _better(x), _better(y), [curve], (), False, specks))
    return _drawn("Trade-offs", panels), on_front


def _drawn(title: str, panels: Sequence[Panel]) -> str:
    text = chart_svg(title, panels, IN_ROW)
    return text[text.index("<svg") :]


def _bars(dots: Dots, key: str) -> Panel:
    """Stacked counts of designs by outcome, by value or in equal bins of it."""
    names, group = _groups(dots.columns[key])
    counts = {outcome: [0] * len(names) for outcome in LOOKS}
    for outcome, place in zip(dots.outcomes, group, strict=True):
        counts[outcome][place] += 1
    bars = [
        ChartBars(outcome, each, LOOKS[outcome]) for outcome, each in counts.items() if any(each)
    ]
    return Panel("", key, "designs", (), bars=bars, names=names)


def _specks(dots: Dots, x: str, y: str, outcomes: Sequence[str]) -> list[ChartSpecks]:
    places = [*LOOKS]
    values = ((outcome, *dots.both(x, y, outcome)[:2]) for outcome in outcomes)
    return [
        ChartSpecks(outcome, across, up, LOOKS[outcome], places.index(outcome))
        for outcome, across, up in values
        if across
    ]


def _better(objective: Objective) -> str:
    return f"{objective.label} ({'more' if objective.more else 'less'} is better)"


def _groups(column: Sequence[Any]) -> tuple[list[str], list[int]]:
    """Names of the values, or of bins if there are many, and the index of each design."""
    distinct = list(dict.fromkeys(map(repr, column)))
    if len(distinct) <= MOST_BARS or not all(map(_is_number, column)):
        if all(map(_is_number, column)):
            distinct.sort(key=float)
        place = {text: number for number, text in enumerate(distinct)}
        return [_tick(text) for text in distinct], [place[repr(value)] for value in column]
    low, high = min(column), max(column)
    step = (high - low) / BINS
    middles = [f"{low + (number + 0.5) * step:.3g}" for number in range(BINS)]
    return middles, [min(BINS - 1, int((value - low) / step)) for value in column]


def _tick(text: str) -> str:
    try:
        return f"{float(text):g}"
    except ValueError:
        return text.strip("'").rpartition("/")[2][:24]


GOOD_BUILDS = Objective(YIELD[0], "share of good builds", True)
INTRODUCTION = (Quantity.MASS, Quantity.OVERALL_DIAMETER, Quantity.DEFLATED_DIAMETER)
MOST_REASONS = 12
MOST_ROWS = 60
"""Most designs on a front that the page lists; all are in the tables."""
WORDS = {
    "passes": "pass every rule",
    "fails": "fail a rule",
    "refused": "cannot be made",
    "too long": "took too long",
    "crashed": "crashed",
}


def sweep_html(design: Design, varied: Sequence[Varied], table: Table) -> str:
    """Return the whole page of a sweep."""
    keys = [swept.key for swept in varied]
    objectives = _objectives(table)
    names = [*keys, *(objective.column for objective in objectives)]
    dots, causes = _read(table, names)
    outcomes = Counter(dots.outcomes)
    sections = [PageSection("Passing designs", svg=passes_svg(dots, keys))]
    if causes:
        more = len(causes) - MOST_REASONS
        note = f"{more} more causes are listed in the tables." if more > 0 else ""
        rows: Sequence[Sequence[str]] = causes[:MOST_REASONS]
        named = ["cause", "designs", "example"]
        sections.append(PageSection("Causes of failure", head=named, rows=rows, note=note))
    pairs = _pairs(objectives, dots)
    if pairs:
        trades, best = trades_svg(dots, pairs)
        measured = [f"{label}: {text}." for label, text in _measured(design, table, objectives)]
        sections.append(PageSection("Trade-offs", measured, trades))
        listed = sorted(best)[:MOST_ROWS]
        rows = [
            [str(n + 1), *(format_value(dots.columns[name][n]) for name in names)] for n in listed
        ]
        head = ("no.", *keys, *(objective.label for objective in objectives))
        line = "Passing designs that no other one improves on in both values of a picture above."
        more = len(best) - len(listed)
        note = f"{more} more designs are in the tables." if more else ""
        sections.append(PageSection("Pareto fronts", [line], head=head, rows=rows, note=note))
    elif outcomes["passes"]:
        line = "The passing designs do not differ in two figures, so there is no trade-off."
        sections[-1] = sections[-1]._replace(note=line)
    else:
        sections[-1] = sections[-1]._replace(note="No design passes.")
    footer = (
        f"Design {design_sha256(design)[:12]}, {GENERATOR}. Values: sweep.csv; all of them: sbafab "
        "sweep --all-columns. Predictions are models, each with its validity: sbafab predict."
    )
    lines = [f"{swept.key} {_values_text(swept)}" for swept in varied]
    tiles = [
        (LOOKS[outcome], outcomes[outcome], words)
        for outcome, words in WORDS.items()
        if outcomes[outcome] or outcome == "passes"
    ]
    title = f"{design.name}: {len(table.values)} designs"
    return page_html(title, lines, sections, footer, tiles)


class PageSection(NamedTuple):
    """A part of a page: ``lines``, a drawing, ``pictures`` side by side (name, data URI, or a note
    in place of one), and a table, of which rows in ``grey`` are of no interest.
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


def _measured(
    design: Design, table: Table, objectives: Sequence[Objective]
) -> Iterator[tuple[str, str]]:
    """Yield the paper's measured values for figures with a model off by more than a quarter."""
    calibration = factors_of(design).calibration
    for objective in objectives:
        figure = table.figures.get(objective.column)
        beside = figure and counterpart(design.form, *figure, calibration)
        if beside:
            yield objective.label, beside.sentence()


def _values_text(swept: Varied) -> str:
    if swept.is_continuous:
        return f"{swept.low:g} to {swept.high:g}"
    if len(swept.values) > 6:
        ends = f"{format_value(swept.values[0])} to {format_value(swept.values[-1])}"
        return f"{ends}, {len(swept.values)} values"
    return ", ".join(map(format_value, swept.values))


def _objectives(table: Table) -> list[Objective]:
    """Size and mass, the first predicted stroke and force, and the yield."""
    wanted_columns = [(table.first(quantity, ANYWHERE), False) for quantity in INTRODUCTION]
    stroke = table.first(Quantity.FREE_STROKE, ANYWHERE)
    wanted_columns.append((stroke or table.first(Quantity.REFERENCE_STROKE, ANYWHERE), True))
    flat = Conditions(share=0.0)
    if table.pressures_kpa:
        flat = flat._replace(kpa=max(table.pressures_kpa, key=abs))
    force = table.first(Quantity.BLOCKED_FORCE, flat) or table.first(Quantity.FORCE_BOUND, ANYWHERE)
    wanted_columns.append((force, True))
    objectives = [
        Objective(name, name.replace("[", "in ").replace("]", ""), more)
        for name, more in wanted_columns
        if name in table.columns
    ]
    return [*objectives, GOOD_BUILDS] if YIELD[0] in table.columns else objectives


def _read(table: Table, wanted_columns: Sequence[str]) -> tuple[Dots, list[list[str]]]:
    """Return the objectives' columns, and the causes of failure, the most common first: each with
    the number of designs, and the first of them with its reason.
    """
    columns: dict[str, list[Any]] = {name: [] for name in ("outcome", *wanted_columns)}
    for cells in table.cells(columns):
        for column, cell in zip(columns.values(), cells, strict=True):
            column.append(cell)
    counts: Counter[str] = Counter()
    examples: dict[str, str] = {}
    for number, row in enumerate(table.rows(), 1):
        failed = row.get("failed", {})
        if row["outcome"] not in ("passes", "fails"):
            failed = {row["outcome"]: row["reason"]}
        for cause, message in failed.items():
            counts[cause] += 1
            examples.setdefault(cause, f"no. {number}: {cause}: {message}")
    causes = [[cause, str(count), examples[cause]] for cause, count in counts.most_common()]
    return Dots(columns["outcome"], columns), causes


def _pairs(objectives: Sequence[Objective], dots: Dots) -> list[tuple[Objective, Objective]]:
    """Return (cost, gain) pairs of objectives that both differ between passing designs."""
    differ = [
        objective
        for objective in objectives
        if len({v for v, o in zip(dots.columns[objective.column], dots.outcomes, strict=True)
                if o == "passes" and v is not None}) > 1
    ]  # fmt: skip
    costs, gains = [o for o in differ if not o.more], [o for o in differ if o.more]
    return [(cost, gain) for cost in costs for gain in gains][:6]


# The Pareto front.


def front(rows: Sequence[Sequence[float]], more: Sequence[bool]) -> list[int]:
    """Return the numbers of the non-dominated rows, in order; of equal rows the first.

    ``more`` says for each value whether more of it is better.
    """
    signed = [
        tuple(-value if up else value for value, up in zip(row, more, strict=True)) for row in rows
    ]
    order = sorted(range(len(signed)), key=lambda number: (signed[number], number))
    best: list[int] = []
    # Every row that dominates another comes before it in this order.
    for number in order:
        if not any(_dominates(signed[better], signed[number]) for better in best):
            best.append(number)
    return sorted(best)


def _dominates(first: Sequence[float], second: Sequence[float]) -> bool:
    """Return True if the first row is nowhere worse; equal rows keep their order."""
    return all(a <= b for a, b in zip(first, second, strict=True))
