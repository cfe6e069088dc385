"""sweep.html: passing designs, causes of failure, trade-offs and Pareto fronts.

Self-contained: style and pictures stand in it, nothing is fetched.
"""

from __future__ import annotations

import io
import textwrap
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab.design.identity import design_sha256
from sbafab.design.records import Design
from sbafab.models.intervals import factors_of
from sbafab.models.paper import counterpart_of_column
from sbafab.reports.charts import PLAIN, STYLE
from sbafab.reports.html_templates import environment
from sbafab.search.sweep_table import Table
from sbafab.search.vary import Varied
from sbafab.version import GENERATOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Pictures: outcomes by the varied keys, and trade-offs.


LOOKS = {
    "passes": ("#009e73", "o"),
    "fails": ("#d55e00", "x"),
    "refused": ("#999999", "s"),
    "crashed": ("#000000", "^"),
    "too long": ("#cc79a7", "v"),
}
"""Colour and marker of an outcome: told apart by the colour blind and in grey."""
BINS = 12
MOST_BARS = 30
MANY = 1500
"""More points than this are drawn as a picture inside the drawing."""


class Objective(NamedTuple):
    """A column, what it is called, and whether more of it is better."""

    column: str
    label: str
    more: bool


@dataclass(frozen=True)
class Dots:
    """A value each of some designs, with outcomes; None where a design has none."""

    outcomes: Sequence[str]
    columns: dict[str, Sequence[Any]]

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


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def passes_svg(dots: Dots, keys: Sequence[str]) -> str:
    """Outcomes by the value of each key; of two keys with numbers also by both."""
    panels: list[Any] = [lambda axes, key=key: _bars(axes, dots, key) for key in keys]
    if len(keys) == 2 and all(any(map(_is_number, dots.columns[key])) for key in keys):
        panels.append(lambda axes: _map(axes, dots, *keys))
    return _drawn(panels)


def trades_svg(dots: Dots, pairs: Sequence[tuple[Objective, Objective]]) -> tuple[str, set[int]]:
    """A panel a pair with the front of what passes, and the numbers of the designs on any front."""
    on_front: set[int] = set()

    def panel(axes: Axes, x: Objective, y: Objective) -> None:
        on_front.update(_trade(axes, dots, x, y))

    return _drawn([lambda axes, x=x, y=y: panel(axes, x, y) for x, y in pairs]), on_front


def _drawn(panels: Sequence[Any]) -> str:
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    with rc_context(STYLE):
        figure = Figure(figsize=(4.3 * columns, 3.5 * rows), layout="constrained")
        FigureCanvasSVG(figure)
        places = list(figure.subplots(rows, columns, squeeze=False).flat)
        for axes, draw in zip(places, panels, strict=False):
            draw(axes)
        for axes in places[len(panels) :]:
            axes.remove()
        labels = {
            text: handle
            for axes in figure.axes
            for handle, text in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(
            labels.values(), labels.keys(), loc="outside upper left", ncols=max(1, len(labels))
        )
        written = io.StringIO()
        figure.savefig(written, format="svg", metadata=PLAIN)
    text = written.getvalue()
    return text[text.index("<svg") :]


def _bars(axes: Axes, dots: Dots, key: str) -> None:
    """Designs of each outcome, one on top of the other, by value or in equal bins of it."""
    column = dots.columns[key]
    names, group = _groups(column)
    below = [0] * len(names)
    for outcome, (colour, _) in LOOKS.items():
        counts = [0] * len(names)
        for of, place in zip(dots.outcomes, group, strict=True):
            counts[place] += of == outcome
        if any(counts):
            axes.bar(range(len(names)), counts, 0.8, below, color=colour, label=outcome)
            below = [a + b for a, b in zip(below, counts, strict=True)]
    every = max(1, len(names) // 8)
    axes.set_xticks(range(0, len(names), every), names[::every])
    axes.set_xlabel(key)
    axes.set_ylabel("designs")
    axes.locator_params("y", integer=True)
    axes.grid(False, axis="x")
    axes.set_axisbelow(True)


def _groups(column: Sequence[Any]) -> tuple[list[str], list[int]]:
    """Names of the values, or of bins where there are many, and the place of each design."""
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


def _map(axes: Axes, dots: Dots, x: str, y: str) -> None:
    for outcome in LOOKS:
        _points(axes, outcome, *dots.both(x, y, outcome)[:2])
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def _points(axes: Axes, outcome: str, x: list[float], y: list[float]) -> None:
    if x:
        colour, marker = LOOKS[outcome]
        style: dict[str, Any] = {"color": colour, "marker": marker, "s": 22}
        axes.scatter(
            x, y, label=outcome, linewidths=1.0, alpha=0.85, rasterized=len(x) > MANY, **style
        )


def _trade(axes: Axes, dots: Dots, x: Objective, y: Objective) -> list[int]:
    for outcome in ("fails", "passes"):
        _points(axes, outcome, *dots.both(x.column, y.column, outcome)[:2])
    across, up, numbers = dots.both(x.column, y.column, "passes")
    best = front(list(zip(across, up, strict=True)), (x.more, y.more))
    line = sorted((across[place], up[place]) for place in best)
    axes.plot(
        [point[0] for point in line],
        [point[1] for point in line],
        color="#0072b2",
        lw=1.4,
        marker="o",
        ms=7,
        mfc="none",
        label="Pareto front",
        zorder=5,
    )
    axes.set_xlabel(_wrapped(x))
    axes.set_ylabel(_wrapped(y))
    return [numbers[place] for place in best]


def _wrapped(objective: Objective) -> str:
    return textwrap.fill(
        f"{objective.label} ({'more' if objective.more else 'less'} is better)", 42
    )


TEMPLATE = "sweep.html.j2"
YIELD = Objective("registration-yield.measured", "share of good builds", True)
INTRODUCTION = (
    ("mass [g]", False),
    ("overall diameter [mm]", False),
    ("deflated diameter [mm]", False),
)
MOST_REASONS = 12
MOST_ROWS = 60
"""Designs on a front that the page lists; all are in the tables."""


class _Cause(NamedTuple):
    """Cause of failure of so many ``designs``, with the number of one as an example."""

    name: str
    designs: int
    example: int
    reason: str


def sweep_html(design: Design, varied: Sequence[Varied], table: Table) -> str:
    """The whole page."""
    keys = [swept.key for swept in varied]
    objectives = _objectives(table)
    names = [*keys, *(objective.column for objective in objectives)]
    dots, causes = _read(table, names)
    pairs = _pairs(objectives, dots)
    trades, best = trades_svg(dots, pairs) if pairs else ("", set())
    listed = sorted(best)[:MOST_ROWS]
    return (
        environment(Path(__file__).parent)
        .get_template(TEMPLATE)
        .render(
            name=design.name,
            sha256=design_sha256(design)[:12],
            generator=GENERATOR,
            total=len(table),
            outcomes=Counter(dots.outcomes),
            keys=[(swept.key, _values_text(swept)) for swept in varied],
            passes=passes_svg(dots, keys),
            trades=trades,
            causes=causes[:MOST_REASONS],
            more_causes=max(0, len(causes) - MOST_REASONS),
            head=[*keys, *(objective.label for objective in objectives)],
            best=[(n + 1, [_cell(dots.columns[name][n]) for name in names]) for n in listed],
            unlisted=len(best) - len(listed),
            measured=_measured(design, objectives),
        )
    )


def _measured(design: Design, objectives: Sequence[Objective]) -> list[tuple[str, str]]:
    """Return the paper's measured values for figures whose model is off by more than a quarter."""
    calibration = factors_of(design).calibration
    rows = [
        (objective.label, counterpart_of_column(design.form, objective.column, calibration))
        for objective in objectives
    ]
    return [(label, row.sentence()) for label, row in rows if row is not None]


def _values_text(swept: Varied) -> str:
    if swept.is_continuous:
        return f"{swept.low:g} to {swept.high:g}"
    if len(swept.values) > 6:
        return f"{_cell(swept.values[0])} to {_cell(swept.values[-1])}, {len(swept.values)} values"
    return ", ".join(map(_cell, swept.values))


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.5g}" if isinstance(value, float) else str(value)


def _objectives(table: Table) -> list[Objective]:
    """Size and mass, the first stroke and force that were predicted, and the yield."""
    names = [column.name for column in table.columns]
    objectives = [
        Objective(name, _label(name), more) for name, more in INTRODUCTION if name in names
    ]
    strokes = [name for name in names if name.startswith(("free stroke", "full stroke"))]
    forces = [n for n in names if n.startswith("blocked force") and ", flat" in n]
    for group in (sorted(strokes, key=lambda name: name.startswith("full")), forces[::-1]):
        if group:
            objectives.append(Objective(group[0], _label(group[0]), True))
    return [*objectives, YIELD] if YIELD.column in names else objectives


def _label(column: str) -> str:
    return column.replace("[", "in ").replace("]", "")


def _read(table: Table, wanted_columns: Sequence[str]) -> tuple[Dots, list[_Cause]]:
    """Return the wanted columns, and the causes of failure, the commonest first."""
    names = [column.name for column in table.columns]
    places = {name: names.index(name) for name in (*wanted_columns, "outcome", "reason")}
    columns: dict[str, list[Any]] = {name: [] for name in places}
    stopped: dict[str, list[tuple[int, str]]] = {}
    for number, cells in enumerate(table.cells(), 1):
        for name, place in places.items():
            columns[name].append(cells[place])
        outcome, reason = cells[places["outcome"]], cells[places["reason"]]
        if outcome != "passes":
            for message in reason.split(" | ") if outcome == "fails" else [f"{outcome}: {reason}"]:
                cause, colon, _ = message.partition(": ")
                if colon:
                    stopped.setdefault(cause, []).append((number, message))
    causes = [_Cause(cause, len(designs), *designs[0]) for cause, designs in stopped.items()]
    causes.sort(key=lambda cause: -cause.designs)
    return Dots(columns["outcome"], {name: columns[name] for name in wanted_columns}), causes


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
    """Return the numbers of the rows that none dominates, in their order; of equal ones the first.

    ``more`` says of each value whether more of it is better.
    """
    signed = [
        tuple(-value if up else value for value, up in zip(row, more, strict=True)) for row in rows
    ]
    order = sorted(range(len(signed)), key=lambda number: (signed[number], number))
    best: list[int] = []
    # Whatever betters a row comes before it in this order.
    for number in order:
        if not any(_dominates(signed[better], signed[number]) for better in best):
            best.append(number)
    return sorted(best)


def _dominates(first: Sequence[float], second: Sequence[float]) -> bool:
    """Return True if the first row is nowhere worse; equal rows come in their order."""
    return all(a <= b for a, b in zip(first, second, strict=True))
