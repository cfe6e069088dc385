"""Charts as SVG for screen and print: a thin wrapper over matplotlib.

Colours are told apart by the colour blind (Okabe and Ito), dashes and markers tell lines apart in
grey. Text stays text. The same data give the same bytes with the same matplotlib.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab.models.figures import Relation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
DASHES = ("solid", (0, (6, 2)), (0, (1.5, 1.5)), (0, (7, 2, 1.5, 2)), (0, (3, 1.5)), (0, (10, 3)))
MARKERS = "osD^vP"
PANEL = (4.6, 3.9)
"""Width and height of a panel in inches."""
STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "sbafab",
    "font.family": "sans-serif",
    # Comes with matplotlib, so that text is as wide on every machine; the others are for viewers.
    "font.sans-serif": ["DejaVu Sans", "Arial", "Helvetica"],
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
}
PLAIN: dict[str, Any] = dict.fromkeys(("Date", "Creator", "Format", "Type"))


class ChartCurve(NamedTuple):
    """A line through (x, y). ``is_reference`` draws it thin and grey, ``dotted`` marks values."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    is_reference: bool = False
    dotted: bool = False


class ChartPoints(NamedTuple):
    """Measured points, +- an error each (0 draws no bar)."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    error: Sequence[float]


class Panel(NamedTuple):
    """One pair of axes; labels carry their units. A key names curves if any has a label."""

    title: str
    x_label: str
    y_label: str
    curves: Sequence[ChartCurve]
    points: Sequence[ChartPoints] = ()
    from_zero: bool = True
    """Axes begin at 0 where nothing is negative."""


def chart_svg(title: str, panels: Sequence[Panel]) -> str:
    """The panels beside each other, under one title."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        width, height = PANEL
        figure = Figure(figsize=(width * len(panels), height), layout="constrained")
        FigureCanvasSVG(figure)
        figure.suptitle(_plain(title), fontsize=11, fontweight="bold", x=0.02, ha="left")
        row = figure.subplots(1, len(panels), squeeze=False)[0]
        for place, (axes, panel) in enumerate(zip(row, panels, strict=True), start=1):
            _draw(axes, panel, place)
        written = io.StringIO()
        figure.savefig(written, format="svg", metadata=PLAIN)
    return written.getvalue()


def _draw(axes: Axes, panel: Panel, place: int) -> None:
    """Draws panel number ``place``; its curves are groups called ``curve<place>.<number>``."""
    axes.set_title(_plain(panel.title), loc="left")
    axes.set_xlabel(_plain(panel.x_label))
    axes.set_ylabel(_plain(panel.y_label))
    drawn = 0
    for number, curve in enumerate(panel.curves, start=1):
        pen: dict[str, Any] = {"color": "#555555", "ls": (0, (2, 2)), "lw": 1.0}
        if not curve.is_reference:
            pen = {"color": COLOURS[drawn % len(COLOURS)], "ls": DASHES[drawn % len(DASHES)]}
            pen |= {"lw": 1.8, "marker": "o" if curve.dotted else None, "ms": 3.0}
            drawn += 1
        label = _plain(curve.label) or "_nolegend_"
        axes.plot(curve.x, curve.y, label=label, gid=f"curve{place}.{number}", **pen)
    for number, points in enumerate(panel.points):
        axes.errorbar(
            points.x,
            points.y,
            yerr=points.error if any(points.error) else None,
            fmt=MARKERS[number % len(MARKERS)],
            color="black",
            mfc="white",
            ms=4.5,
            capsize=4,
            clip_on=False,
            label=_plain(points.label),
            zorder=5,
        )
    if panel.from_zero:
        _begin_at_zero(axes, panel)
    if any(item.label for item in _items(panel)):
        axes.legend(loc="best")


def _begin_at_zero(axes: Axes, panel: Panel) -> None:
    """Axes begin at 0 where nothing is negative: lengths of bars and slopes then mean something."""
    items = _items(panel)
    if min((min(item.x) for item in items), default=0.0) >= 0:
        axes.set_xlim(left=0.0)
    if min((min(item.y) for item in items), default=0.0) >= 0:
        axes.set_ylim(bottom=0.0)


def _items(panel: Panel) -> list[ChartCurve | ChartPoints]:
    return [*panel.curves, *panel.points]


def _plain(text: str) -> str:
    """Text in which a dollar is a dollar and not the start of a formula."""
    return text.replace("$", r"\$")


# A predicted relation as a chart, with what the paper measured.


def relation_svg(name: str, relation: Relation) -> str:
    """The chart of a relation of the design called ``name``."""
    curves = [ChartCurve(line.label, line.x, line.y, line.model is None) for line in relation.lines]
    points = [ChartPoints(p.label, p.x, p.y, p.error) for p in relation.points]
    panel = Panel(relation.title, relation.x_label, relation.y_label, curves, points)
    return chart_svg(name, [panel])
