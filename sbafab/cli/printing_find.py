"""How the end of a search is told: for people, and for programs."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from sbafab.cli.lines import print_line, print_wrapped
from sbafab.output.schemas import FIND_SCHEMA
from sbafab.search.find import FoundDesign
from sbafab.search.quantities import AskedQuantity, shown_value
from sbafab.search.trial import Trial, keys_said, value_said

TABS = (
    "overall_diameter counts the inlet tabs: ask for outline_diameter where they may stand out, or "
    "add --free inlet.tab_length=3:5:0.5"
)


def as_json(found: FoundDesign, started: str, target: Path) -> dict[str, Any]:
    """What ``find --json`` prints."""

    def shown(trial: Trial) -> dict[str, Any]:
        return {"keys": dict(trial.values), "figures": dict(trial.figures)}

    return {
        "schema": FIND_SCHEMA,
        "holds": found.holds,
        "file": str(target) if found.holds else None,
        "started_from": started,
        "tries": found.tries,
        "is_cut_short": found.is_cut_short,
        "best": shown(found.best),
        "full_stroke": found.full_stroke,
        "measured": {name: one.as_dict() for name, one in found.measured.items()},
        "missed": found.missed,
        "binds": [{"key": b.key, "value": b.value, "breaks": b.breaks} for b in found.binds],
        "range_ends": [
            {"key": one.key, "value": one.value, "low": one.low, "high": one.high}
            for one in found.ends
        ],
        "without_room": [
            {"rule": s.rule, "measured": s.measured, "unit": s.unit, "place": s.place}
            for s in found.without_room
        ],
        "front": [shown(trial) for trial in found.front],
        "on_front": found.on_front,
    }


def print_found(found: FoundDesign, started: str, target: Path) -> None:
    """The design with its figures, what binds and the front; or the nearest miss."""
    keys = keys_said(found.best.values)
    if found.holds:
        print_line(f"{target}: {keys}, from {started}", "bold")
    else:
        print_line(f"Nearest miss: {keys}, from {started}", "bold red")
    for one in found.wanted.requirements:
        value = found.best.value(one)
        said = f"  {one.quantity.said} {shown_value(one.quantity, value)}"
        print_line(
            f"{said}; {one.bound}" if one.holds(value) else f"{said}, not {one.bound}  MISSED"
        )
        _print_measured(found, one.quantity)
    goal = found.wanted.goal
    value = found.best.value(goal)
    said = goal.said if found.holds else goal.quantity.said
    print_line(f"  {said}: {shown_value(goal.quantity, value)}")
    if goal.quantity.said not in [one.quantity.said for one in found.wanted.requirements]:
        _print_measured(found, goal.quantity)
    asked = found.wanted.quantities
    is_told = any(one.is_full_stroke for one in asked)
    if any(one.name == "stroke" for one in asked) and not is_told and found.full_stroke is not None:
        print_line(f"  full stroke {found.full_stroke:.4g} mm, as the paper's in proportion")
    for said in found.broken_rules:
        print_line(f"  {said}")
    told = found.binds or found.ends or (found.holds and found.without_room)
    if told:
        print_line("What binds" if found.holds else "What stops it there", "bold")
    for bind in found.binds:
        print_line(f"  {bind.key} = {value_said(bind.value)}: {bind.breaks}")
    _print_ends(found)
    if not found.holds:
        _print_miss(found)
        return
    for spare in found.without_room:
        print_line(
            f"  {spare.rule} {spare.place}: {spare.measured:g} {spare.unit}, nothing to spare"
        )
    _print_front(found)
    _print_cut(found)
    print_line(f"Next: sbafab generate {shlex.quote(str(target))}")


def _print_measured(found: FoundDesign, quantity: AskedQuantity) -> None:
    measured = found.measured.get(quantity.said)
    if measured is not None:
        print_wrapped(f"({measured.sentence()})", indent="    ")


def _print_cut(found: FoundDesign) -> None:
    if found.is_cut_short:
        more = 2 * found.tries
        print_line(f"All {found.tries} tries are used up; --tries {more} may lead to a better one")


def _print_ends(found: FoundDesign) -> None:
    for one in found.ends:
        span = one.high - one.low
        low, high = one.low, one.high + span
        if one.value <= one.low:
            low, high = max(one.step, one.low - span), one.high
        print_line(
            f"  {one.key} = {one.value:g} is the end of its range, {one.low:g} to {one.high:g}; "
            f"--free {one.key}={low:g}:{high:g}:{one.step:g} lets it go further"
        )


def _print_miss(found: FoundDesign) -> None:
    missed = {
        one.quantity.name
        for one in found.wanted.requirements
        if not one.holds(found.best.value(one))
    }
    is_free = any(one.key == "inlet.tab_length" for one in found.free)
    if "overall_diameter" in missed and not is_free:
        print_line(TABS)
    _print_cut(found)
    words = f"None of {found.tries} designs meets all, and nothing was written: ask for less, "
    print_line(words + "or free more with --free KEY=LOW:HIGH:STEP")


def _print_front(found: FoundDesign) -> None:
    if len(found.front) < 2:
        return
    some = f"{len(found.front)} of " if found.on_front > len(found.front) else ""
    print_line(f"Pareto front, {some}{found.on_front} of the {found.tries} designs tried", "bold")
    for trial in found.front:
        figures = ", ".join(f"{name} {value:.4g}" for name, value in trial.figures.items())
        print_line(f"  {keys_said(trial.values)}: {figures}")
    for name, measured in found.measured.items():
        print_wrapped(f"({name}: {measured.sentence()})", indent="    ")
