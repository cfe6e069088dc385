"""What an assembly does inflated: reach, load, grip in its lumen, and what its parts then touch."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.assemblies.build import Assembled, PlacedPart, PlacedSba
from sbafab.design.form import Discs, Slots
from sbafab.models.lens import fullest, rate
from sbafab.models.stack import Stack, stack
from sbafab.reports.bent_arms import BentTouch, Clearance, bent_arms
from sbafab.reports.inflated_parts import (
    TOUCHING,
    as_it_is,
    carried,
    in_place,
    lifted,
    shared,
    solids,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.reports.inflated_parts import Solids

GRAVITY = 9.80665
MARBLE_G = 1.2
"""Mass of the marble that the paper's brace lifts, g (Sec. 5)."""
ELASTIC = "elastic stack"
LENS = "lens of two arcs, virtual work p dV/dh"
STATIC = "statics"
PAPERS = ("aperture", "brace", "standing")
"""The assemblies that the paper built: figures of others stand beside nothing."""


class AssemblyFigure(NamedTuple):
    """One figure of a part: its value, the model it is of, and what the paper says, if it does."""

    part: str
    name: str
    value: float
    unit: str
    model: str
    paper: str = ""


class Touch(NamedTuple):
    """Two parts that share ``volume`` mm3 when the first one is inflated."""

    part: str
    other: str
    volume: float


class AssemblyPrediction(NamedTuple):
    """Figures at ``pressure_kpa``; ``touches`` are parts in each other's way when all stand up
    straight, ``bent_touches`` what arms meet when bent; ``left_out`` says what no model reaches.
    """

    name: str
    pressure_kpa: float
    load_g: float
    figures: tuple[AssemblyFigure, ...]
    touches: tuple[Touch, ...]
    left_out: tuple[str, ...]
    bent_touches: tuple[BentTouch, ...] = ()


def predict_assembly(
    assembled: Assembled, pressure_kpa: float = 10.0, load_g: float = MARBLE_G
) -> AssemblyPrediction:
    """What the parts do at one pressure, with a mass at the tips; the paper's marble has 1.2 g.

    Raises DesignError for pressures that the models do not reach.
    """
    figures: list[AssemblyFigure] = []
    touches: list[Touch] = []
    left_out: list[str] = []
    bent: list[BentTouch] = []
    stacks = _stacks(assembled)
    rises = {name: _rise(assembled[name], one, pressure_kpa) for name, one in stacks.items()}
    for placed in assembled.parts:
        if not isinstance(placed, PlacedSba):
            continue
        pockets = placed.made.design.form.pockets
        if isinstance(pockets, Slots):
            figures += _grip(assembled, placed, pockets, pressure_kpa, load_g)
        elif isinstance(pockets, Discs):
            figures += _arm(placed, stacks[placed.name], pressure_kpa, load_g)
            touches += _touches(assembled, placed, stacks, rises, pressure_kpa)
            for met in bent_arms(assembled, placed, stacks, rises, pressure_kpa):
                if isinstance(met, Clearance):
                    what = f"clearance to {met.other}, bent by {met.chambers}"
                    figures.append(AssemblyFigure(placed.name, what, met.gap, "mm", ELASTIC))
                else:
                    bent.append(met)
        else:
            left_out.append(f"{placed.name}: no model knows the form of a drawn pocket outline")
    if assembled.assembly.name not in PAPERS:
        figures = [figure._replace(paper="") for figure in figures]
    return AssemblyPrediction(
        assembled.assembly.name,
        pressure_kpa,
        load_g,
        tuple(figures),
        tuple(touches),
        tuple(left_out),
        tuple(bent),
    )


def as_json(found: AssemblyPrediction) -> dict[str, object]:
    """The same for programs."""
    return {
        **found._asdict(),
        "figures": [figure._asdict() for figure in found.figures],
        "touches": [touch._asdict() for touch in found.touches],
        "bent_touches": [touch._asdict() for touch in found.bent_touches],
    }


def _arm(
    placed: PlacedSba, found: Stack, pressure: float, load_g: float
) -> Iterator[AssemblyFigure]:
    """Height, reach, bend and load of an actuator with round pockets."""
    name, weight = placed.name, load_g * 1e-3 * GRAVITY
    every = (pressure,) * found.chambers
    free = found.pose(every)
    flat = found.flat_height
    yield AssemblyFigure(name, "height, flat", flat, "mm", ELASTIC, "about 1 (Sec. 6)")
    yield AssemblyFigure(name, "height, inflated", free.height, "mm", ELASTIC, "about 20 (Sec. 5)")
    three_quarters = found.pose(every, plate=flat + 0.75 * (free.height - flat))
    yield AssemblyFigure(name, "push at 75 % of its stroke", three_quarters.force, "N", ELASTIC)
    if found.chambers > 1:
        one = found.pose((pressure, *(0.0,) * (found.chambers - 1)))
        yield AssemblyFigure(name, "bend by one chamber", one.bend, "deg", ELASTIC)
        aside = float(np.hypot(*one.tip[:2]))
        yield AssemblyFigure(name, "reach of the tip aside", aside, "mm", ELASTIC)
    if weight > 0:
        hung = found.pose(every, tip_load=(weight, 0.0, 0.0), near=free)
        sag = float(np.linalg.norm(hung.tip - free.tip))
        said = "lifts 1.2 g (Sec. 5)" if load_g == MARBLE_G else ""
        yield AssemblyFigure(
            name, f"sag of the tip, {load_g:g} g across it", sag, "mm", ELASTIC, said
        )


def _grip(
    assembled: Assembled, placed: PlacedSba, pockets: Slots, pressure: float, load_g: float
) -> Iterator[AssemblyFigure]:
    """Diameter of a radial actuator, and how hard it holds in the assembly's lumen."""
    form, laminate = placed.made.design.form, placed.made.laminate
    tube = form.wrap.tube_diameter if form.wrap is not None else 2 * (placed.radius or 0.0)
    balloons = laminate.balloons
    deflated = tube + 2 * laminate.thickness
    highest = 2 * pockets.width / math.pi
    yield AssemblyFigure(
        placed.name, "diameter, deflated", deflated, "mm", "films", "15.33 (Sec. 2.1)"
    )
    yield AssemblyFigure(
        placed.name,
        "diameter, inflated free",
        deflated + 2 * balloons * highest,
        "mm",
        "lens of two arcs",
        "about 28 (Sec. 2.1)",
    )
    lumen = assembled.assembly.deploy.lumen_diameter
    if lumen is None:
        return
    room = (lumen - deflated) / 2 / balloons
    most = fullest(pockets.width, pockets.run).stroke
    if not 0 < room < most:
        return
    # 1 kPa mm2 is 1 mN.
    force = pressure * float(rate(room, pockets.width, pockets.run)) / 1000
    yield AssemblyFigure(
        placed.name, f"height of a balloon in the lumen of {lumen:g} mm", room, "mm", STATIC
    )
    yield AssemblyFigure(
        placed.name, "push of each stack on the wall", force, "N", LENS, "holds (Sec. 5)"
    )
    if load_g > 0:
        needed = load_g * 1e-3 * GRAVITY / (form.stacks * force)
        yield AssemblyFigure(
            placed.name, f"friction that holds {load_g:g} g along the lumen", needed, "", STATIC
        )


def _stacks(assembled: Assembled) -> dict[str, Stack]:
    """The stacks of all actuators with round pockets, by part; alike ones are one."""
    known: dict[int, Stack] = {}
    found = {}
    for placed in assembled.parts:
        if isinstance(placed, PlacedSba) and isinstance(placed.made.design.form.pockets, Discs):
            key = id(placed.made)
            if key not in known:
                known[key] = stack(placed.made.design, placed.made.laminate)
            found[placed.name] = known[key]
    return found


def _rise(placed: PlacedPart, found: Stack, pressure: float) -> NDArray[np.float64]:
    """By what (3,) in mm an actuator lifts what stands on its top."""
    free = found.pose((pressure,) * found.chambers)
    ends = np.array([[0.0, 0.0, found.flat_height], [0.0, 0.0, free.height]])
    low, high = in_place(placed, ends)
    lift: NDArray[np.float64] = high - low
    return lift


def _touches(
    assembled: Assembled,
    placed: PlacedSba,
    stacks: Mapping[str, Stack],
    rises: Mapping[str, NDArray[np.float64]],
    pressure: float,
) -> Iterator[Touch]:
    """Other parts that an actuator meets when all stand up straight."""
    names = [part.name for part in assembled.parts]
    own = _upright(placed, stacks[placed.name], pressure, lifted(assembled, placed, rises))
    moved = carried(assembled, placed.name)
    for other in assembled.parts:
        # What stands on it moves along, and what it stands on it touches as it does flat.
        if other.name in moved or other.name == placed.part.on or other.part.kind == "line":
            continue
        lift = lifted(assembled, other, rises)
        if isinstance(other, PlacedSba) and other.name in stacks:
            if names.index(other.name) < names.index(placed.name):
                continue  # each pair once
            theirs = _upright(other, stacks[other.name], pressure, lift)
        else:
            theirs = as_it_is(other, lift)
        volume = shared(own, theirs)
        if volume > TOUCHING:
            yield Touch(placed.name, other.name, volume)


def _upright(placed: PlacedSba, found: Stack, pressure: float, lift: NDArray[np.float64]) -> Solids:
    return solids(placed, found, found.pose((pressure,) * found.chambers), lift)
