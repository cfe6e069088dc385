"""Prediction of an inflated assembly: reach, load, grip in its lumen, contacts between parts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.assemblies.build import Assembled, PlacedPart, PlacedSba
from sbafab.design.records import Discs, Slots
from sbafab.models.balloons import balloons_of
from sbafab.models.elastic import free_rise
from sbafab.models.formulas import is_near_burst, is_the_papers_3dof, refuse_beyond_burst
from sbafab.models.intervals import factors_of
from sbafab.models.lens import fullest, rate
from sbafab.models.paper import counterpart
from sbafab.models.quantity import ANYWHERE, Conditions, FigureKey, ModelId, Quantity
from sbafab.models.stack import Stack, stack
from sbafab.reports.inflated import (
    TOUCHING,
    as_it_is,
    box_gap,
    carried,
    lifted,
    shared_volume,
    solids,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.stack import Pose
    from sbafab.reports.inflated import Solids

# Contacts and clearances of an arm bent by some of its chambers.
#
# Each chamber alone and each pair of neighbours are pressurised, the others empty, while every
# other actuator is inflated; parts on the arm move with its tip.


FARTHEST = 10.0
"""Clearances are computed up to this distance, mm."""
SLIGHTEST = 0.1
"""Lowest pressure at which an arm is checked, kPa."""
HALVINGS = 5
FOOT = 3
"""Levels from below that may rest on the part under the arm."""


class Clearance(NamedTuple):
    """Clearance in mm between a bent arm, with the parts on it, and another part."""

    other: str
    chambers: str
    gap: float


@dataclass(frozen=True)
class BentTouch:
    """An arm that shares ``volume`` mm3 with another part when its ``chambers`` are pressed.

    Contact begins at about ``from_kpa``, at a bend of ``bend`` degrees; ``measured`` is the paper's
    bend if the model is off by more than a quarter of it.
    """

    part: str
    other: str
    chambers: str
    volume: float
    from_kpa: float
    bend: float
    measured: str = ""


class _Around(NamedTuple):
    """An arm and its surroundings: ``carried`` are solids on its top, when it is flat."""

    placed: PlacedSba
    arm_stack: Stack
    lift: NDArray[np.float64]
    carried: Solids
    surrounding: dict[str, Solids]


def bent_arms(
    assembled: Assembled,
    placed: PlacedSba,
    stacks: Mapping[str, Stack],
    rises: Mapping[str, NDArray[np.float64]],
    pressure: float,
    pause: Callable[[], None] = lambda: None,
) -> Iterator[Clearance | BentTouch]:
    """Yield for each other part the least clearance, or each bend at which the arm meets it.

    ``rises`` is how far each actuator lifts the parts on it. No clearance is given for the part
    under the arm and for parts farther away than ``FARTHEST``.
    """
    arm_stack = stacks[placed.name]
    if arm_stack.chambers < 2:
        return
    around = _around(assembled, placed, stacks, rises, pressure)
    nearest: dict[str, Clearance] = {}
    met = set()
    for pressed in _ways(arm_stack.chambers):
        pause()
        names = " and ".join(placed.made.laminate.chambers[i].name for i in pressed)
        arm = _moved(around, _bent(arm_stack, pressed, pressure))
        for part, theirs in around.surrounding.items():
            volume = shared_volume(arm.beyond(part, placed), theirs)
            if volume > TOUCHING:
                met.add(part)
                first = _first(around, part, pressed, pressure)
                start, beside = (
                    first.pressures[pressed[0]],
                    arm_stack.counterparts.get("bend", ""),
                )
                yield BentTouch(placed.name, part, names, volume, start, first.bend, beside)
                continue
            if part == placed.part.on:
                continue
            gap = _gap(arm.beyond(part, placed), theirs)
            if gap < min(FARTHEST, nearest[part].gap if part in nearest else FARTHEST):
                nearest[part] = Clearance(part, names, gap)
    yield from (clearance for part, clearance in nearest.items() if part not in met)


def _ways(chambers: int) -> list[tuple[int, ...]]:
    """Return the sets of pressurised chambers: each alone, and each two side by side."""
    alone: list[tuple[int, ...]] = [(i,) for i in range(chambers)]
    return alone + [(i, (i + 1) % chambers) for i in range(chambers) if chambers > 2]


def _bent(arm_stack: Stack, pressed: Sequence[int], pressure: float) -> Pose:
    return arm_stack.pose(
        tuple(pressure if i in pressed else 0.0 for i in range(arm_stack.chambers))
    )


def _around(
    assembled: Assembled,
    placed: PlacedSba,
    stacks: Mapping[str, Stack],
    rises: Mapping[str, NDArray[np.float64]],
    pressure: float,
) -> _Around:
    moving = carried(assembled, placed.name)
    lift = lifted(assembled, placed, rises)
    on_top: Solids = []
    surrounding = {}
    for part in assembled.parts:
        if part.name == placed.name or part.part.kind == "line":
            continue
        raised = lifted(assembled, part, rises)
        if part.name in moving:
            raised = raised - rises[placed.name]
        if isinstance(part, PlacedSba) and part.name in stacks:
            part_stack = stacks[part.name]
            part_solids = solids(
                part, part_stack, part_stack.pose((pressure,) * part_stack.chambers), raised
            )
        else:
            part_solids = as_it_is(part, raised)
        if part.name in moving:
            on_top += part_solids
        else:
            surrounding[part.name] = part_solids
    return _Around(placed, stacks[placed.name], lift, on_top, surrounding)


class _Arm(NamedTuple):
    """A bent arm's solids and the parts on it; ``foot`` holds the solids of its lowest levels."""

    foot: Solids
    rest: Solids

    def beyond(self, part: str, placed: PlacedPart) -> Solids:
        """Return the solids that may meet another part; the foot may rest on the part under the
        arm.
        """
        return self.rest if part == placed.part.on else self.foot + self.rest


def _moved(around: _Around, pose: Pose) -> _Arm:
    """The bent arm and the parts on it."""
    places = around.placed.upright(pose.frames[0]) + around.lift
    levels = (places[1:] + places[:-1]) / 2
    arm = _Arm([], [])
    for solid in solids(around.placed, around.arm_stack, pose, around.lift):
        middle = np.array(solid.bounding_box()).reshape(2, 3).mean(0)
        level = int(np.linalg.norm(levels - middle, axis=1).argmin())
        (arm.foot if level < FOOT else arm.rest).append(solid)
    if not around.carried:
        return arm
    # From the flat arm's top to the bent one's, in the arm's own frame, then in the assembly's.
    tip = np.eye(4)
    tip[:3, :3] = pose.frames[1][-1]
    tip[:3, 3] = pose.tip - tip[:3, :3] @ np.array([0.0, 0.0, around.arm_stack.flat_height])
    frame = _frame(around.placed)
    frame[:3, 3] += around.lift
    rows = np.ascontiguousarray((frame @ tip @ np.linalg.inv(frame))[:3])
    return arm._replace(rest=arm.rest + [solid.transform(rows) for solid in around.carried])


def _frame(placed: PlacedPart) -> NDArray[np.float64]:
    """Matrix (4, 4) of a part's own frame in the assembly's."""
    corners = placed.upright(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
    frame = np.eye(4)
    frame[:3, 3] = corners[0]
    frame[:3, :3] = (corners[1:] - corners[0]).T
    return frame


def _gap(arm: Solids, theirs: Solids) -> float:
    """Distance in mm between the nearest two, at most ``FARTHEST``."""
    least = FARTHEST
    pairs = ((box_gap(a, b), a, b) for a in arm for b in theirs)
    for boxes, a, b in sorted(pairs, key=lambda pair: pair[0]):
        if boxes >= least:
            break
        least = min(least, float(a.min_gap(b, least)))
    return least


def _first(around: _Around, part: str, pressed: Sequence[int], pressure: float) -> Pose:
    """Return approximately the first pose in contact with another part, up to a pressure."""
    low, high = min(SLIGHTEST, pressure / 2), pressure
    pose = _bent(around.arm_stack, pressed, high)
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        tried = _bent(around.arm_stack, pressed, middle)
        arm = _moved(around, tried).beyond(part, around.placed)
        if shared_volume(arm, around.surrounding[part]) > TOUCHING:
            high, pose = middle, tried
        else:
            low = middle
    return pose


GRAVITY = 9.80665
MARBLE_G = 1.2
"""Mass of the marble that the paper's brace lifts, g (Sec. 5)."""
STACK_WORDS = ModelId.ELASTIC_STACK.words
LENS = f"{ModelId.LENS.words}, virtual work p dV/dh"
STATIC = "statics"
IN_THE_LUMEN = (
    "height of a balloon in the lumen",
    "push of each stack on the wall",
    "friction",
)
SEVERAL = 3
"""Number of chambers of a bending arm."""
PAPERS = ("aperture", "brace", "standing")
"""The assemblies built in the paper; only their figures have measured values beside them."""


@dataclass(frozen=True)
class AssemblyFigure:
    """One figure of a part: value in ``unit``, model, and the paper's remark, if any.

    ``measured`` is the paper's value for a single actuator, if the model is off by more than a
    quarter of it.
    """

    part: str
    name: str
    value: float
    unit: str
    model: str
    paper: str = ""
    measured: str = ""


@dataclass(frozen=True)
class Touch:
    """Two parts that share ``volume`` mm3 when the first one is inflated."""

    part: str
    other: str
    volume: float


@dataclass(frozen=True)
class AssemblyPrediction:
    """Figures at ``pressure_kpa``; ``touches`` are parts that collide when all are upright,
    ``bent_touches`` contacts of bent arms; ``left_out`` names what no model covers, ``near_burst``
    the parts above half of their estimated burst pressure.
    """

    name: str
    pressure_kpa: float
    load_g: float
    figures: tuple[AssemblyFigure, ...]
    touches: tuple[Touch, ...]
    left_out: tuple[str, ...]
    bent_touches: tuple[BentTouch, ...]
    near_burst: tuple[str, ...]

    def met(self) -> list[str]:
        """Sentences on contacts of inflated parts, and remedies."""
        sentences = [
            f"{touch.part} and {touch.other} meet when inflated: they share "
            f"{touch.volume:.2f} mm3; move them apart, or give less pressure"
            for touch in self.touches
        ]
        sentences += [
            f"press {bent.chambers} of {bent.part} to less than {bent.from_kpa:.2g} kPa, or move "
            f"{bent.other}: from there on, bent by {bent.bend:.0f} degrees, they meet, and at "
            f"{self.pressure_kpa:g} kPa they share {bent.volume:.2f} mm3"
            + (f" ({bent.measured})" if bent.measured else "")
            for bent in self.bent_touches
        ]
        if not self.touches:
            how = "standing straight" if self.bent_touches else "straight or bent"
            sentences.append(f"no inflated part meets another one, {how}")
        return sentences


class Grip(NamedTuple):
    """A radial actuator: diameters ``deflated``, inflated ``free``, out of any lumen, and ``most``,
    the upper end, in mm.

    In the assembly's ``lumen`` a balloon is ``room`` mm high; each stack pushes on the wall with
    ``push`` N per kPa. Both are None if it reaches no lumen.
    """

    part: str
    deflated: float
    free: float
    most: float
    lumen: float | None = None
    room: float | None = None
    push: float | None = None

    @property
    def why_none(self) -> str:
        """The reason why no hold in the lumen is given."""
        if self.lumen is None:
            return "no lumen is given: set deploy.lumen_diameter"
        if self.deflated >= self.lumen:
            return (
                f"deflated it is {self.deflated:.2f} mm wide already, in a lumen of "
                f"{self.lumen:g} mm; make it narrower"
            )
        return (
            f"its stacks do not touch the wall: {self.free:.2f} mm by the lens of two arcs in a "
            f"lumen of {self.lumen:g} mm; use wider or longer chambers, more balloons or a thicker "
            "tube"
        )


def predict_assembly(
    assembled: Assembled,
    pressure_kpa: float = 10.0,
    load_g: float = MARBLE_G,
    pause: Callable[[], None] = lambda: None,
) -> AssemblyPrediction:
    """Predict the parts at one pressure, with a mass at the tips; the paper's marble has 1.2 g.

    ``pause`` is called between parts of the work, which takes seconds; an exception from it stops
    the work. Raises DesignError for pressures beyond the models or a part's estimated burst.
    """
    near = []
    for placed in assembled.parts:
        if isinstance(placed, PlacedSba):
            refuse_beyond_burst(placed.made.laminate, pressure_kpa)
            near += [placed.name] if is_near_burst(placed.made.laminate, pressure_kpa) else []
    figures: list[AssemblyFigure] = []
    touches: list[Touch] = []
    left_out: list[str] = []
    bent: list[BentTouch] = []
    stacks = _stacks(assembled)
    rises = {
        name: _rise(assembled[name], part_stack, pressure_kpa)
        for name, part_stack in stacks.items()
    }
    for placed in assembled.parts:
        if not isinstance(placed, PlacedSba):
            continue
        pause()
        pockets = placed.made.design.form.pockets
        if isinstance(pockets, Slots):
            hold = grip(assembled, placed)
            assert hold is not None
            figures += _grip_figures(hold, placed.made.design.form.stacks, pressure_kpa, load_g)
            if hold.push is None:
                left_out.append(f"{placed.name}, {', '.join(IN_THE_LUMEN)}: {hold.why_none}")
        elif isinstance(pockets, Discs):
            figures += _arm(placed, stacks[placed.name], pressure_kpa, load_g)
            touches += _touches(assembled, placed, stacks, rises, pressure_kpa)
            pause()
            for bend in bent_arms(assembled, placed, stacks, rises, pressure_kpa, pause):
                if isinstance(bend, Clearance):
                    clearance = f"clearance to {bend.other}, bent by {bend.chambers}"
                    figures.append(
                        AssemblyFigure(placed.name, clearance, bend.gap, "mm", STACK_WORDS)
                    )
                else:
                    bent.append(bend)
        else:
            left_out.append(f"{placed.name}: no model knows the form of a drawn pocket outline")
    if assembled.assembly.name not in PAPERS:
        figures = [replace(figure, paper="") for figure in figures]
    return AssemblyPrediction(
        assembled.assembly.name,
        pressure_kpa,
        load_g,
        tuple(figures),
        tuple(touches),
        tuple(left_out),
        tuple(bent),
        tuple(near),
    )


def _arm(
    placed: PlacedSba, arm_stack: Stack, pressure: float, load_g: float
) -> Iterator[AssemblyFigure]:
    """Height, reach, bend and load of an actuator with round pockets."""
    for figure, predicted in _figures_of_arm(placed, arm_stack, pressure, load_g):
        form = placed.made.design.form
        of_papers = is_the_papers_3dof(form, placed.made.laminate)
        beside = counterpart(form, *predicted, arm_stack.calibration, of_papers)
        yield replace(figure, measured=beside.sentence() if beside else "")


def _figures_of_arm(
    placed: PlacedSba, arm_stack: Stack, pressure: float, load_g: float
) -> Iterator[tuple[AssemblyFigure, FigureKey]]:
    """Yield figures, each with the matching figure of a design's own prediction."""
    name, weight = placed.name, load_g * 1e-3 * GRAVITY
    at, stack_model = Conditions(kpa=pressure), ModelId.ELASTIC_STACK

    def key(quantity: Quantity, model: ModelId = stack_model, **where: float) -> FigureKey:
        return FigureKey(quantity, at._replace(**where), model)  # type: ignore[arg-type]

    def figure(words: str, value: float, unit: str, paper: str = "") -> AssemblyFigure:
        return AssemblyFigure(name, words, value, unit, stack_model.words, paper)

    every = (pressure,) * arm_stack.chambers
    free = arm_stack.pose(every)
    flat = arm_stack.flat_height
    yield (
        figure("height, flat", flat, "mm", "about 1 (Sec. 6)"),
        FigureKey(Quantity.FOLDED_HEIGHT, ANYWHERE, ModelId.FILMS),
    )
    stroke = _free_stroke(placed, pressure)
    balloon = ModelId.ELASTIC_BALLOON
    yield (
        replace(
            figure("height, inflated", flat + stroke, "mm", "about 20 (Sec. 5)"),
            model=balloon.words,
        ),
        key(Quantity.FREE_HEIGHT, balloon),
    )
    push = arm_stack.pose(every, plate=flat + 0.75 * stroke).force
    blocked = key(Quantity.BLOCKED_FORCE, share=0.75)
    yield figure("push at 75 % of its stroke", push, "N"), blocked
    if arm_stack.chambers > 1:
        single = arm_stack.pose((pressure, *(0.0,) * (arm_stack.chambers - 1)))
        yield figure("bend by one chamber", single.bend, "deg"), key(Quantity.BEND, chambers=1)
        aside = float(np.hypot(*single.tip[:2]))
        bent = key(Quantity.ASIDE, chambers=1)
        yield figure("maximum lateral tip displacement", aside, "mm"), bent
    if weight > 0:
        hung = arm_stack.pose(every, tip_load=(weight, 0.0, 0.0), near=free)
        sag = float(np.linalg.norm(hung.tip - free.tip))
        paper = "lifts 1.2 g (Sec. 5)" if load_g == MARBLE_G else ""
        words = f"sag of the tip, {load_g:g} g across it"
        # Sag is load over stiffness.
        yield figure(words, sag, "mm", paper), key(Quantity.HELD_STIFFNESS)


def _free_stroke(placed: PlacedSba, pressure: float) -> float:
    """Return the free stroke in mm as in ``predict``: the stack's maps are approximate."""
    design, laminate = placed.made.design, placed.made.laminate
    kinds = Counter(balloons_of(design, laminate, factors_of(design)))
    return free_rise(kinds, pressure).stroke


def grip(assembled: Assembled, placed: PlacedSba) -> Grip | None:
    """Return hold of a radial actuator in the assembly's lumen; None for other forms."""
    design, laminate = placed.made.design, placed.made.laminate
    form = design.form
    pockets = form.pockets
    if not isinstance(pockets, Slots):
        return None
    tube = form.wrap.tube_diameter if form.wrap is not None else 2 * (placed.radius or 0.0)
    balloons = laminate.balloons
    deflated = tube + 2 * factors_of(design).folded(laminate).height
    rise, widest = fullest(pockets.width, pockets.run).stroke, 2 * pockets.width / math.pi
    free, most = (deflated + 2 * balloons * high for high in (rise, widest))
    lumen = assembled.assembly.deploy.lumen_diameter
    free_grip = Grip(placed.name, deflated, free, most, lumen)
    if lumen is None:
        return free_grip
    room = (lumen - deflated) / 2 / balloons
    if not 0 < room <= rise:
        return free_grip
    # 1 kPa mm2 is 1 mN.
    push = float(rate(room, pockets.width, pockets.run)) / 1000
    return free_grip._replace(room=room, push=push)


def _grip_figures(
    hold: Grip, stacks: int, pressure: float, load_g: float
) -> Iterator[AssemblyFigure]:
    """Diameter of a radial actuator, and the hold of its stacks in the assembly's lumen."""
    name, paper = hold.part, "about 28 (Sec. 2.1)"
    diameters = (
        ("diameter, deflated", hold.deflated, "tube and films", "15.33 (Sec. 2.1)"),
        ("diameter, inflated free", hold.free, ModelId.LENS.words, paper),
        ("diameter, inflated at most", hold.most, ModelId.CYLINDER.words, paper),
    )
    for diameter, value, model, paper in diameters:
        yield AssemblyFigure(name, diameter, value, "mm", model, paper)
    if hold.room is None or hold.push is None:
        return
    force = pressure * hold.push
    height, push, friction = IN_THE_LUMEN
    lumen = f"{height} of {hold.lumen:g} mm"
    yield AssemblyFigure(name, lumen, hold.room, "mm", STATIC)
    yield AssemblyFigure(name, push, force, "N", LENS, "holds (Sec. 5)")
    if load_g > 0:
        needed = load_g * 1e-3 * GRAVITY / (stacks * force)
        needed_friction = f"{friction} that holds {load_g:g} g along the lumen"
        yield AssemblyFigure(name, needed_friction, needed, "", STATIC)


def _stacks(assembled: Assembled) -> dict[str, Stack]:
    """Return the stacks of all actuators with round pockets, by part; shared within a design."""
    by_design: dict[int, Stack] = {}
    by_part = {}
    for placed in assembled.parts:
        if isinstance(placed, PlacedSba) and isinstance(placed.made.design.form.pockets, Discs):
            key = id(placed.made)
            if key not in by_design:
                design = placed.made.design
                factors = factors_of(design)
                by_design[key] = stack(design, placed.made.laminate, factors=factors)
            by_part[placed.name] = by_design[key]
    return by_part


def _rise(placed: PlacedPart, part_stack: Stack, pressure: float) -> NDArray[np.float64]:
    """Return the vector (3,), mm, by which an actuator lifts the parts on its top."""
    free = part_stack.pose((pressure,) * part_stack.chambers)
    ends = np.array([[0.0, 0.0, part_stack.flat_height], [0.0, 0.0, free.height]])
    low, high = placed.upright(ends)
    lift: NDArray[np.float64] = high - low
    return lift


def _touches(
    assembled: Assembled,
    placed: PlacedSba,
    stacks: Mapping[str, Stack],
    rises: Mapping[str, NDArray[np.float64]],
    pressure: float,
) -> Iterator[Touch]:
    """Other parts that an actuator meets when all are upright."""
    names = [part.name for part in assembled.parts]
    solid_parts = _upright(placed, stacks[placed.name], pressure, lifted(assembled, placed, rises))
    moved = carried(assembled, placed.name)
    for neighbour in assembled.parts:
        # Parts on it move along; the part under it touches it as when flat.
        if (
            neighbour.name in moved
            or neighbour.name == placed.part.on
            or neighbour.part.kind == "line"
        ):
            continue
        lift = lifted(assembled, neighbour, rises)
        if isinstance(neighbour, PlacedSba) and neighbour.name in stacks:
            if names.index(neighbour.name) < names.index(placed.name):
                continue  # each pair once
            theirs = _upright(neighbour, stacks[neighbour.name], pressure, lift)
        else:
            theirs = as_it_is(neighbour, lift)
        volume = shared_volume(solid_parts, theirs)
        if volume > TOUCHING:
            yield Touch(placed.name, neighbour.name, volume)


def _upright(
    placed: PlacedSba, part_stack: Stack, pressure: float, lift: NDArray[np.float64]
) -> Solids:
    return solids(placed, part_stack, part_stack.pose((pressure,) * part_stack.chambers), lift)
