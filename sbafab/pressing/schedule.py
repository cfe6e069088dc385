"""The heat-press schedule: which layers are pressed together, in what order (paper Sec. 2).

Temperatures are C, pressures kPa, forces N, times minutes, lengths mm.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from sbafab.errors import DesignError
from sbafab.laminate.assembly import (
    AssemblyStep,
    BondState,
    StepName,
    assembly,
    distinct_layers,
    stack_count,
)
from sbafab.laminate.films import FIRST
from sbafab.laminate.laminate import Laminate

TITLES: dict[StepName, str] = {
    "flash_bottom": "Bottom balloon, upper two layers",
    "bond_bottom": "Bottom balloon, with its base",
    "flash_middle": "Middle layers",
    "bond_all": "Whole laminate",
}
TITLES_OF_SEVERAL = {
    **TITLES,
    "flash_bottom": "Bottom balloons, upper two layers of each",
    "bond_bottom": "Bottom balloons, each with its base",
}
"""Where stacks are pressed beside each other."""

SNIP = (
    "Snip off the ears along the outline, and the tails of the inlet strips at the tab's end; the "
    "masks stay in their pockets."
)

HOTTEST_TRIED = 150.0
PRESSURES_TRIED = (70.0, 200.0)
HANDLING_MINUTES = 60.0
"""The paper's total build time of 1.75 h less its 45 minutes in the press."""

COLUMNS = (
    "step",
    "title",
    "bond",
    "layers",
    "adds",
    "pins",
    "temperature_c",
    "pressure_kpa",
    "force_n",
    "platen_width_mm",
    "platen_length_mm",
    "minutes",
    "instructions",
)


@dataclass(frozen=True)
class PressSettings:
    """What the press is set to; the defaults are the paper's (Sec. 2)."""

    temperature_c: float = 135.0
    pressure_kpa: float = 110.0
    platen: tuple[float, float] = (152.4, 152.4)
    flash_bottom: float = 3.0
    bond_bottom: float = 12.0
    flash_middle: float = 10.0
    bond_all: float = 20.0
    validated_balloons: int = 20

    @property
    def force_n(self) -> float:
        """Force on the whole platen."""
        return self.pressure_kpa * self.platen[0] * self.platen[1] / 1000

    def minutes(self, step: StepName) -> float:
        """How long the press stays closed in a step."""
        return {
            "flash_bottom": self.flash_bottom,
            "bond_bottom": self.bond_bottom,
            "flash_middle": self.flash_middle,
            "bond_all": self.bond_all,
        }[step]


@dataclass(frozen=True)
class Step:
    """One closing of the press.

    ``layers`` are pressed together, ``adds`` those of them that join in this step, both by layer
    index; ``pins`` names the dowel pins that are in.
    """

    step: int
    title: str
    bond: BondState
    layers: tuple[int, ...]
    adds: tuple[int, ...]
    pins: tuple[str, ...]
    temperature_c: float
    pressure_kpa: float
    force_n: float
    platen_mm: tuple[float, float]
    minutes: float
    instructions: str


@dataclass(frozen=True)
class Schedule:
    """All steps, the time they take, and what the technician should know beforehand."""

    steps: tuple[Step, ...]
    total_press_minutes: float
    estimated_build_minutes: float
    estimate_basis: str
    warnings: tuple[str, ...]


def schedule(laminate: Laminate, press: PressSettings) -> Schedule:
    """The press steps of a laminate, bottom balloon first.

    Flash bonds hold layers in place on their pins. Full bonds are pressed without any: base and
    cap have no bore for a channel pin, and a lumen pin, though it would pass, stays out as in the
    paper. Raises DesignError at a temperature that would not bond the films or that one of them
    does not stand.
    """
    _refuse_temperature(laminate, press)
    *parts, last = assembly(laminate)
    after = f" {SNIP}" if laminate.registration == "ears" else ""
    steps = (
        *(_step(laminate, part, press) for part in parts),
        _step(laminate, last, press, after),
    )
    total = sum(step.minutes for step in steps)
    return Schedule(
        steps,
        total,
        total + HANDLING_MINUTES,
        f"{total:g} min in the press and {HANDLING_MINUTES:g} min to cut, lay up, pin and fit the "
        "tubing; the latter is assumed the same for every design (paper: 1.75 h in all)",
        tuple(_warnings(laminate, press, steps)),
    )


def _step(laminate: Laminate, part: AssemblyStep, press: PressSettings, after: str = "") -> Step:
    count = stack_count(laminate, part.layers)
    return Step(
        step=part.number,
        title=TITLES[part.name] if count == 1 else TITLES_OF_SEVERAL[part.name],
        bond=part.bond,
        layers=part.layers,
        adds=part.adds,
        pins=tuple(pin.name for pin in part.pins),
        temperature_c=press.temperature_c,
        pressure_kpa=press.pressure_kpa,
        force_n=round(press.force_n, 1),
        platen_mm=press.platen,
        minutes=press.minutes(part.name),
        instructions=_instructions(part, count) + after,
    )


def _instructions(part: AssemblyStep, count: int) -> str:
    """What to do in a step that makes ``count`` stacks beside each other."""
    pins = [pin.name for pin in part.pins]
    stacks = ", then ".join(_named(stack) for stack in part.stacks if stack)
    on_pins = f"on the pin{'s' if len(pins) > 1 else ''} {_listed(pins)}"
    if part.bond == "full":
        how = on_pins if pins else "by eye, with no pin"
        return (
            f"Lay down {stacks}, {how}. Press to the full bond and let the laminate cool flat"
            + (", then draw the pins." if pins else ".")
        )
    by = on_pins if pins else "by hand"
    after = "Press to the flash bond" + (" and draw the pins." if pins else ".")
    own = "a stack" if count == 1 else f"{count} stacks"
    return f"Lay {stacks} on each other {by}, lowest first, as {own} of their own. {after}"


def _listed(words: Sequence[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _named(layers: Sequence[int]) -> str:
    """Layer indices in words; never 2-3, which a spreadsheet takes for a date."""
    runs: list[list[int]] = []
    for index in layers:
        if runs and index == runs[-1][1] + 1:
            runs[-1][1] = index
        else:
            runs.append([index, index])
    words = [
        word
        for first, last in runs
        for word in (
            [f"{first} to {last}"] if last > first + 1 else map(str, range(first, last + 1))
        )
    ]
    return f"layer{'s' if len(layers) > 1 else ''} {_listed(words)}"


def _refuse_temperature(laminate: Laminate, press: PressSettings) -> None:
    for film in dict.fromkeys(layer.film for layer in laminate.layers):
        melts = not film.is_mask and film.softens_above is not None
        if melts and press.temperature_c <= (film.softens_above or 0.0):
            raise DesignError(
                f"press.temperature_c = {press.temperature_c:g} does not bond {film.product}, "
                f"which melts at {film.softens_above:g} C; raise it (the paper presses at 135 C)"
            )
        if film.material == "PTFE" and press.temperature_c >= film.limit:
            raise DesignError(
                f"press.temperature_c = {press.temperature_c:g} reaches the limit of the masks, "
                f"{film.limit:g} C for {film.product}; lower it, for hotter PTFE gives off toxic "
                "fumes"
            )
        if film.material not in FIRST and press.temperature_c >= film.limit:
            raise DesignError(
                f"press.temperature_c = {press.temperature_c:g} reaches the limit of "
                f"{film.material}, {film.limit:g} C for {film.product}; lower it"
            )
    for interface in laminate.interfaces:
        below, above = interface.below, interface.above
        if below.film.softens_above is None and above.film.softens_above is None:
            roles = " or the ".join(dict.fromkeys((below.role, above.role)))
            raise DesignError(
                f"layers {below.index} and {above.index} are of {below.film.material} and "
                f"{above.film.material}, which both stay solid in the press and do not bond; give "
                f"the {roles} another film in [layup]"
            )


def _warnings(laminate: Laminate, press: PressSettings, steps: Sequence[Step]) -> Iterator[str]:
    if press.temperature_c > HOTTEST_TRIED:
        yield (
            f"{press.temperature_c:g} C is hotter than the {HOTTEST_TRIED:g} C of earlier work, "
            "which already over-melted more than 135 C does"
        )
    low, high = PRESSURES_TRIED
    if not low <= press.pressure_kpa <= high:
        yield (
            f"{press.pressure_kpa:g} kPa lies outside {low:g} to {high:g} kPa; 110 kPa is "
            "validated, and earlier work pressed at 70 kPa"
        )
    if laminate.balloons > press.validated_balloons:
        yield (
            f"{laminate.balloons} balloons are more than the {press.validated_balloons} validated; "
            "heat must pass the whole laminate, so try the bond on a sample first"
        )
    for step in steps:
        if step.bond == "flash":
            held = {pin for pin in laminate.pins if pin.name in step.pins}
            loose = [
                layer.pattern
                for layer in distinct_layers(laminate, step.layers)
                if held.isdisjoint(laminate.pins_holding(layer))
            ]
            layers = [i for i in step.layers if laminate.layer(i).pattern in loose]
            if layers:
                which = _named(layers) if len(layers) < 4 else _by_role(laminate, layers)
                yield f"step {step.step}: no pin holds {which}; align by hand"


def _by_role(laminate: Laminate, layers: Sequence[int]) -> str:
    counts = Counter(laminate.layer(index).role for index in layers)
    return _listed([f"the {count} {role}s" for role, count in counts.items()])


def press_json(plan: Schedule) -> dict[str, Any]:
    """The schedule as ``press.json`` holds it."""
    return {
        "steps": [
            {
                key: list(value) if isinstance(value, tuple) else value
                for key, value in asdict(step).items()
            }
            for step in plan.steps
        ],
        "total_press_minutes": plan.total_press_minutes,
        "estimated_build_minutes": plan.estimated_build_minutes,
        "estimate_basis": plan.estimate_basis,
        "warnings": list(plan.warnings),
    }


def press_csv(plan: Schedule) -> str:
    """The steps as a table, one row each, with units in the column names."""
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(COLUMNS)
    for step in plan.steps:
        writer.writerow(
            [
                step.step,
                step.title,
                step.bond,
                _named(step.layers),
                _named(step.adds),
                ", ".join(step.pins),
                f"{step.temperature_c:g}",
                f"{step.pressure_kpa:g}",
                f"{step.force_n:.1f}",
                *(f"{size:g}" for size in step.platen_mm),
                f"{step.minutes:g}",
                step.instructions,
            ]
        )
    return table.getvalue()
