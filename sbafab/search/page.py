"""sweep.html: what passes, what stops the others, and what is traded for what.

Self-contained: style and pictures stand in it, nothing is fetched.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from sbafab.design.records import Design
from sbafab.design.writing import design_sha256
from sbafab.models.counterparts import counterpart_of_column
from sbafab.output.settings import GENERATOR
from sbafab.search.plots import Dots, Objective, passes_svg, trades_svg
from sbafab.search.table import Table
from sbafab.search.vary import Varied

TEMPLATE = "sweep.html.j2"
YIELD = Objective("registration-yield.measured", "share of good builds", True)
PLAIN = (
    ("mass [g]", False),
    ("overall diameter [mm]", False),
    ("deflated diameter [mm]", False),
)
MOST_REASONS = 12
MOST_ROWS = 60
"""Designs on a front that the page lists; all are in the tables."""


class _Stop(NamedTuple):
    """What stopped so many ``designs``, and an example."""

    what: str
    designs: int
    example: int
    reason: str


def sweep_html(design: Design, varied: Sequence[Varied], table: Table) -> str:
    """The whole page."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    keys = [one.key for one in varied]
    objectives = _objectives(table)
    wanted = [*keys, *(one.column for one in objectives)]
    dots, stops = _read(table, wanted)
    pairs = _pairs(objectives, dots)
    trades, best = trades_svg(dots, pairs) if pairs else ("", set())
    listed = sorted(best)[:MOST_ROWS]
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(TEMPLATE).render(
        name=design.name,
        sha256=design_sha256(design)[:12],
        generator=GENERATOR,
        total=len(table),
        outcomes=Counter(dots.outcomes),
        keys=[(one.key, _values_said(one)) for one in varied],
        passes=passes_svg(dots, keys),
        trades=trades,
        stops=stops[:MOST_REASONS],
        more_stops=max(0, len(stops) - MOST_REASONS),
        head=[*keys, *(one.label for one in objectives)],
        best=[(n + 1, [_cell(dots.columns[name][n]) for name in wanted]) for n in listed],
        unlisted=len(best) - len(listed),
        measured=_measured(design, objectives),
    )


def _measured(design: Design, objectives: Sequence[Objective]) -> list[tuple[str, str]]:
    """What the paper measured beside figures whose model is off by more than a quarter of it."""
    found = [(one.label, counterpart_of_column(design.form, one.column)) for one in objectives]
    return [(label, row.sentence()) for label, row in found if row is not None]


def _values_said(one: Varied) -> str:
    if one.is_continuous:
        return f"{one.low:g} to {one.high:g}"
    if len(one.values) > 6:
        return f"{_cell(one.values[0])} to {_cell(one.values[-1])}, {len(one.values)} values"
    return ", ".join(map(_cell, one.values))


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.5g}" if isinstance(value, float) else str(value)


def _objectives(table: Table) -> list[Objective]:
    """Size and mass, the first stroke and force that were predicted, and the yield."""
    names = [column.name for column in table.columns]
    found = [Objective(name, _label(name), more) for name, more in PLAIN if name in names]
    strokes = [name for name in names if name.startswith(("free stroke", "full stroke"))]
    forces = [n for n in names if n.startswith("blocked force") and ", flat" in n]
    for group in (sorted(strokes, key=lambda name: name.startswith("full")), forces[::-1]):
        if group:
            found.append(Objective(group[0], _label(group[0]), True))
    return [*found, YIELD] if YIELD.column in names else found


def _label(column: str) -> str:
    return column.replace("[", "in ").replace("]", "")


def _read(table: Table, wanted: Sequence[str]) -> tuple[Dots, list[_Stop]]:
    """The wanted columns, and what stopped designs, the commonest first."""
    names = [column.name for column in table.columns]
    places = {name: names.index(name) for name in (*wanted, "outcome", "reason")}
    columns: dict[str, list[Any]] = {name: [] for name in places}
    stopped: dict[str, list[tuple[int, str]]] = {}
    for number, cells in enumerate(table.cells(), 1):
        for name, place in places.items():
            columns[name].append(cells[place])
        outcome, reason = cells[places["outcome"]], cells[places["reason"]]
        if outcome != "passes":
            for said in reason.split(" | ") if outcome == "fails" else [f"{outcome}: {reason}"]:
                what, colon, _ = said.partition(": ")
                if colon:
                    stopped.setdefault(what, []).append((number, said))
    stops = [_Stop(what, len(own), *own[0]) for what, own in stopped.items()]
    stops.sort(key=lambda stop: -stop.designs)
    return Dots(columns["outcome"], {name: columns[name] for name in wanted}), stops


def _pairs(objectives: Sequence[Objective], dots: Dots) -> list[tuple[Objective, Objective]]:
    """Those of which both differ between designs that pass, what costs before what it buys."""
    differ = [
        one
        for one in objectives
        if len({v for v, o in zip(dots.columns[one.column], dots.outcomes, strict=True)
                if o == "passes" and v is not None}) > 1
    ]  # fmt: skip
    costs, gains = [o for o in differ if not o.more], [o for o in differ if o.more]
    return [(cost, gain) for cost in costs for gain in gains][:6]
