"""Pictures of a sweep: what passes by the keys that were varied, and what is traded for what."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab.reports.chart import PLAIN, STYLE
from sbafab.search.pareto import front

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    found: set[int] = set()

    def panel(axes: Axes, x: Objective, y: Objective) -> None:
        found.update(_trade(axes, dots, x, y))

    return _drawn([lambda axes, x=x, y=y: panel(axes, x, y) for x, y in pairs]), found


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
        return [_said(text) for text in distinct], [place[repr(value)] for value in column]
    low, high = min(column), max(column)
    step = (high - low) / BINS
    middles = [f"{low + (number + 0.5) * step:.3g}" for number in range(BINS)]
    return middles, [min(BINS - 1, int((value - low) / step)) for value in column]


def _said(text: str) -> str:
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
    left, up, numbers = dots.both(x.column, y.column, "passes")
    best = front(list(zip(left, up, strict=True)), (x.more, y.more))
    line = sorted((left[place], up[place]) for place in best)
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


def _wrapped(one: Objective) -> str:
    return textwrap.fill(f"{one.label} ({'more' if one.more else 'less'} is better)", 42)
