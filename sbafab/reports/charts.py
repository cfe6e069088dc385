"""Charts as SVG for screen and print, in mm.

The colours suit colour-blind readers (Okabe and Ito); dashes and markers distinguish lines in grey.
The key is below the axes, where it covers nothing. Text is not converted to outlines.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import cycle
from typing import NamedTuple

from sbafab.geometry.region import coord
from sbafab.models.figures import Relation
from sbafab.reports import drawing as draw

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
DASHES = ("", "3.8 1.3", "0.95 0.95", "4.4 1.3 0.95 1.3", "1.9 0.95", "6.4 1.9")
MARKERS = (
    "M-.8 0a.8 .8 0 1 0 1.6 0a.8 .8 0 1 0-1.6 0z",
    "M-.7-.7h1.4v1.4h-1.4z",
    "M0-1L1 0L0 1L-1 0z",
    "M-.3-.9h.6v.6h.6v.6h-.6v.6h-.6v-.6h-.6v-.6h.6z",
    "M0-.9L.9.7H-.9z",
    "M0 .9L.9-.7H-.9z",
)
"""Round the place of a measured point."""
REFERENCE, GRID = "#555555", "#dddddd"
AXES = 88.0, 64.0  # width and height of a panel's axes
HEAD, FOOT, RIM = 16.0, 12.0, 6.0
"""Titles above the axes, numbers and label below them, and the rim right of them."""
ROW, SIGN = 4.4, 11.0  # height of a row of the key, and length of its curve sample
MOST_STEPS = 8  # steps between the numbers at an axis
MARGIN = 0.05  # margin of an axis, as a share of the values' range
SPECKS = (
    "m-.7 0a.7 .7 0 1 0 1.4 0a.7 .7 0 1 0-1.4 0z",
    "m-.7-.5l.2-.2l.5.5l.5-.5l.2.2l-.5.5l.5.5l-.2.2l-.5-.5l-.5.5l-.2-.2l.5-.5z",
    "m-.6-.6h1.2v1.2h-1.2z",
    "m0-.8l.7 1.3h-1.4z",
    "m0 .8l.7-1.3h-1.4z",
)
"""Filled marks of many values, from their middle."""
SPECK_GRID = 4  # specks of one colour in the same 1/4 mm are drawn once
BAR = 0.4  # half of a bar's width, as a share of the distance between two
MOST_NAMES = 8  # names below bars, as many as have room


class ChartCurve(NamedTuple):
    """A line through (x, y). ``is_reference`` draws it thin and grey, ``dotted`` marks values."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    is_reference: bool = False
    dotted: bool = False


class ChartPoints(NamedTuple):
    """Measured points, each with an error bar +- (0: none)."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    error: Sequence[float]


class ChartSpecks(NamedTuple):
    """Many values, each a small filled marker."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    colour: str
    mark: int


class ChartBars(NamedTuple):
    """One bar per name of the panel, stacked on earlier ones: ``y`` are integers."""

    label: str
    y: Sequence[int]
    colour: str


class Panel(NamedTuple):
    """A pair of axes; labels include units. A key names the curves if any has a label."""

    title: str
    x_label: str
    y_label: str
    curves: Sequence[ChartCurve]
    points: Sequence[ChartPoints] = ()
    from_zero: bool = True
    """Axes begin at 0 if nothing is negative, so that lengths of bars and slopes have a meaning."""
    specks: Sequence[ChartSpecks] = ()
    bars: Sequence[ChartBars] = ()
    names: Sequence[str] = ()
    """Below the bars."""


def chart_svg(title: str, panels: Sequence[Panel], in_row: int = 1000) -> str:
    """Return the panels under one title, with this many in a row."""
    elements, width, height = [draw.text((3.0, 6.0), title, size=4.0, bold=True)], 0.0, 0.0
    for first in range(0, len(panels), in_row):
        end = below = 0.0
        drawn: list[str] = []
        for place, panel in enumerate(panels[first : first + in_row], start=first + 1):
            parts, end, high = _panel(panel, place, end)
            drawn += parts
            below = max(below, high)
        elements.append(f'<g transform="translate(0 {coord(height)})">{"".join(drawn)}</g>')
        width, height = max(width, end), height + below
    return draw.document(width, height, title, elements)


def _panel(panel: Panel, place: int, begin: float) -> tuple[list[str], float, float]:
    """Return the elements of panel number ``place``, its right end and its height.

    The elements of a label form the group ``bars<place>.<number>``, ``curve...`` and so on.
    """
    plot = _plot(panel, begin)
    elements = list(_axes(plot, place))
    rows, widest = 0, AXES[0]
    kinds = {"bars": _bars, "specks": _specks, "curve": _curves, "points": _points}
    for kind, items in kinds.items():
        for number, (label, sign, shapes) in enumerate(items(plot), start=1):
            elements.append(f'<g id="{kind}{place}.{number}">{shapes}</g>')
            if label:
                x, y = plot.left, HEAD + AXES[1] + FOOT + ROW * (rows + 0.5)
                elements.append(f'<g transform="translate({coord(x)} {coord(y)})">{sign}</g>')
                elements.append(draw.text((x + SIGN + 2, y + 0.9), label, size=draw.SMALL))
                widest = max(widest, SIGN + 2 + draw.text_width(label, draw.SMALL))
                rows += 1
    return elements, plot.left + widest + RIM, HEAD + AXES[1] + FOOT + ROW * rows + 1


class _Scale(NamedTuple):
    """An axis: the values at its ends, and its tick values with their labels."""

    low: float
    high: float
    ticks: Sequence[tuple[float, str]]

    def share(self, value: float) -> float:
        """Return the position of a value, 0 at the low end and 1 at the high end."""
        return (value - self.low) / (self.high - self.low)


class _Plot(NamedTuple):
    """The position ``begin`` of a panel on the page, ``left`` of its axes, and their scales."""

    panel: Panel
    begin: float
    left: float
    x: _Scale
    y: _Scale

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the position of values on the page."""
        wide, high = AXES
        return self.left + wide * self.x.share(x), HEAD + high * (1 - self.y.share(y))


def _plot(panel: Panel, begin: float) -> _Plot:
    """Return the plot of a panel; wider numbers move its axes to the right."""
    items: list[ChartCurve | ChartPoints | ChartSpecks]
    items = [*panel.curves, *panel.points, *panel.specks]
    bars = [pair for each in panel.points for pair in zip(each.y, each.error, strict=True)]
    ends = [y + sign * error for y, error in bars for sign in (-1, 1)]
    if panel.bars:
        every = max(1, len(panel.names) // MOST_NAMES)
        ticks = list(enumerate(panel.names))[::every]
        x = _Scale(-2 * BAR, len(panel.names) - 1 + 2 * BAR, ticks)
        tops = map(sum, zip(*(bars.y for bars in panel.bars), strict=True))
        y = _scale(map(float, tops), True, least=1.0)
    else:
        x = _scale([value for item in items for value in item.x], panel.from_zero)
        y = _scale([*(value for item in items for value in item.y), *ends], panel.from_zero)
    numbers = max(draw.text_width(text) for _, text in y.ticks)
    return _Plot(panel, begin, begin + draw.TEXT + 6 + numbers, x, y)


def _scale(values: Iterable[float], from_zero: bool, least: float = 0.0) -> _Scale:
    """Return the axis for values, ignoring non-finite ones.

    Tick values are at least ``least`` apart.
    """
    finite = [value for value in values if math.isfinite(value)] or [0.0, 1.0]
    low, high = min(finite), max(finite)
    over = MARGIN * ((high - low) or abs(high) or 1.0)
    low, high = 0.0 if from_zero and low >= 0 else low - over, high + over
    least = max(least, (high - low) / MOST_STEPS)
    power = 10.0 ** math.floor(math.log10(least))
    step = next(each * power for each in (1, 2, 2.5, 5, 10) if each * power >= least * (1 - 1e-9))
    # Rounding does not drop a number at the end of an axis.
    counts = range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    return _Scale(low, high, [(count * step, _number(count * step)) for count in counts])


def _number(value: float) -> str:
    return f"{value:.6g}".replace("-", "\N{MINUS SIGN}")


def _axes(plot: _Plot, place: int) -> Iterator[str]:
    """Yield grid, numbers, titles and labels; a tick's group is ``xtick<place>.<number>``."""
    low_x, right, bottom = plot.left, plot.left + AXES[0], HEAD + AXES[1]
    for number, (value, text) in enumerate(plot.x.ticks, start=1):
        x, _ = plot.at(value, plot.y.low)
        grid = draw.line([(x, bottom), (x, HEAD)], colour=GRID)
        words = draw.text((x, bottom + 4.2), text, anchor="middle")
        yield f'<g id="xtick{place}.{number}">{grid}{words}</g>'
    for number, (value, text) in enumerate(plot.y.ticks, start=1):
        _, y = plot.at(plot.x.low, value)
        grid = draw.line([(low_x, y), (right, y)], colour=GRID)
        words = draw.text((low_x - 1.5, y + 1.0), text, anchor="end")
        yield f'<g id="ytick{place}.{number}">{grid}{words}</g>'
    yield draw.line([(low_x, HEAD), (low_x, bottom), (right, bottom)], width=0.25)
    panel, middle = plot.panel, (low_x + right) / 2
    yield draw.text((low_x, HEAD - 3.0), panel.title, size=3.5)
    yield draw.text((middle, bottom + 9.0), panel.x_label, anchor="middle")
    at = plot.begin + draw.TEXT + 1, HEAD + AXES[1] / 2
    yield draw.text(at, panel.y_label, anchor="middle", turned=True)


_Items = Iterator[tuple[str, str, str]]
"""Labels, each with its sign in the key, ``SIGN`` long from (0, 0), and all that is drawn."""


def _bars(plot: _Plot) -> _Items:
    below = [0] * len(plot.panel.names)
    for bars in plot.panel.bars:
        boxes = ""
        for name, (base, count) in enumerate(zip(below, bars.y, strict=True)):
            if count:
                left, low = plot.at(name - BAR, base)
                right, high = plot.at(name + BAR, base + count)
                boxes += draw.box((left, high), (right, low), fill=bars.colour)
        below = [a + b for a, b in zip(below, bars.y, strict=True)]
        yield bars.label, draw.path(f"M0 0h{SIGN:g}", draw.style(bars.colour, 2.4)), boxes


def _specks(plot: _Plot) -> _Items:
    for specks in plot.panel.specks:
        middles = (plot.at(*pair) for pair in zip(specks.x, specks.y, strict=True))
        # In a sweep of many designs most specks coincide.
        places = dict.fromkeys(
            (round(x * SPECK_GRID) / SPECK_GRID, round(y * SPECK_GRID) / SPECK_GRID)
            for x, y in middles
        )
        mark, look = SPECKS[specks.mark], f'fill="{specks.colour}"'
        sign = draw.path(f"M{SIGN / 2} 0{mark}", look)
        data = "".join(f"M{coord(x)} {coord(y)}{mark}" for x, y in places)
        yield specks.label, sign, draw.path(data, look)


def _curves(plot: _Plot) -> _Items:
    drawn = 0
    for curve in plot.panel.curves:
        colour, dashes, width = REFERENCE, "0.7 0.7", 0.35
        if not curve.is_reference:
            colour, dashes = COLOURS[drawn % len(COLOURS)], DASHES[drawn % len(DASHES)]
            drawn, width = drawn + 1, 0.6
        pen = draw.style(colour, width, dashes=dashes) + ' stroke-linejoin="round"'
        data, dots, command = "", "", "M"
        for x, y in zip(curve.x, curve.y, strict=True):
            if not (math.isfinite(x) and math.isfinite(y)):
                command = "M"
                continue
            at = plot.at(x, y)
            data += f"{command}{coord(at[0])} {coord(at[1])}"
            command = "L"
            dots += draw.circle(at, 0.55, f'fill="{colour}"') if curve.dotted else ""
        yield curve.label, draw.path(f"M0 0h{SIGN:g}", pen), draw.path(data, pen) + dots


def _points(plot: _Plot) -> _Items:
    for points, shape in zip(plot.panel.points, cycle(MARKERS)):
        bars, marks = "", ""
        for x, y, error in zip(points.x, points.y, points.error, strict=True):
            if error:
                (across, low), (_, high) = plot.at(x, y - error), plot.at(x, y + error)
                bars += draw.line([(across, low), (across, high)], colour="#000000", width=0.3)
                for end in (low, high):
                    cap = [(across - 1.2, end), (across + 1.2, end)]
                    marks += draw.line(cap, colour="#000000", width=0.3)
            marks += _marker(shape, plot.at(x, y))
        yield points.label, _marker(shape, (SIGN / 2, 0.0)), f'<g class="errors">{bars}</g>{marks}'


def _marker(shape: str, at: tuple[float, float]) -> str:
    look = draw.style("#000000", 0.3, fill="#ffffff")
    x, y = map(coord, at)
    return draw.path(shape, f'transform="translate({x} {y})" {look}')


# A predicted relation as a chart, with the paper's measurements.


def relation_svg(name: str, relation: Relation) -> str:
    """Return the chart of a relation for the design ``name``."""
    curves = [ChartCurve(line.label, line.x, line.y, line.model is None) for line in relation.lines]
    points = [ChartPoints(p.label, p.x, p.y, p.error) for p in relation.points]
    panel = Panel(relation.title, relation.x_label, relation.y_label, curves, points)
    return chart_svg(name, [panel])
