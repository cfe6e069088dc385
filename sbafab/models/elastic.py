"""Predictions by the elastic balloon and the elastic stack: free strokes, blocked forces, bending,
clearances, times, stiffness, and the curves of these.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import combinations, product
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from sbafab.errors import BeyondError, DesignError
from sbafab.models import paper
from sbafab.models.actuator import Actuator
from sbafab.models.balloon import Shapes, inflate
from sbafab.models.balloon_map import MOST_STRETCH, BalloonMap, stretch
from sbafab.models.balloons import balloons_of
from sbafab.models.column import BatchPoses
from sbafab.models.figures import (
    MODELS,
    Factors,
    Figure,
    FigureItem,
    LeftOut,
    Model,
    PredictionRequest,
    Relation,
    Trace,
)
from sbafab.models.film_elements import Array, Balloon
from sbafab.models.pneumatics import AIR, TUBE_LENGTH, WATER, Line
from sbafab.models.quantity import Conditions, Quantity, chamber_count
from sbafab.models.rim_correction import compressed_shapes, free_shapes
from sbafab.models.stack import GRAVITY, MOST_PRESSURE, Motion, Plate, Pose, Stack, stack

Value = TypeVar("Value")
ELASTIC, TIME, SHUT = (MODELS[of] for of in ("elastic-balloon", "stack-in-time", "stack-shut"))
FORCE, BEND, CONTACT, HELD = (
    MODELS[f"elastic-stack {of}"] for of in ("force", "bend", "contact", "held")
)
CALIBRATED_TRUST = (
    "modulus, pockets, pressed thickness and delays as the calibration has them; what would be "
    "measured lies in the interval with 90 %. Plates are rigid and carry no shear; poses and "
    "forces are those of films that lose no energy"
)
OUTSIDE = (
    "outside the checked part of the balloons' map, which misses a balloon computed there by more "
    "than 3 %"
)
"""Flag of a figure whose pose has balloons outside the valid range of a map."""
BUCKLES = (
    "that of a straight column, which is unstable here and buckles: it may push harder, or give "
    "way to a tenth or less"
)
"""Flag of the force of a column that would buckle (docs/measured/candidates.csv)."""
SAMPLES, SERIES_SAMPLES = 21, 401
ANGLES = (30.0, 60.0, 90.0)
LEAST_PRESSURE, NO_FURTHER, NONE = 0.01, 1e-10, 1e-6
"""Lowest pressure of a bend in kPa; the relative tolerance of its pressure, and that within which
there is none."""
NEARBY = 2.0
"""Largest ratio of a bend's pressure to that of another stack which guides the search."""
PROBE_FORCE = 1e-5
"""Lateral force in N on the tip with which its stiffness is probed."""
LEAST_GAP = 0.02
"""Least gap in mm of a balloon whose radius is computed."""


def calibrated(model: Model, factors: Factors) -> Model:
    """Return a model with the calibration of its factors, if they have one."""
    if not factors.calibration:
        return model
    return replace(model, calibration=factors.calibration, trust=CALIBRATED_TRUST)


# Actuators at several factors, inflated together. At equal pressure over modulus balloons have
# equal shapes, so that one computation of a balloon serves all moduli, all pressures and poses.


RISES = (
    Quantity.FREE_STROKE,
    Quantity.FREE_HEIGHT,
    Quantity.BALLOON_VOLUME,
    Quantity.FREE_WORK,
)
BENDS = Quantity.BEND, Quantity.RIM_ROOM, Quantity.CHAMBER_CLEARANCE, Quantity.ASIDE


class Rise(NamedTuple):
    """Rise of one free stack of balloons: ``stroke`` in mm, ``volume`` in ul, and the ``energy`` in
    its films in uJ, to 3 % the integral of p dV.
    """

    stroke: float
    volume: float
    energy: float


FreeShapes = Mapping[float, Shapes | DesignError]
"""Free balloons of one kind by pressure in kPa, or why there is none."""


@dataclass(frozen=True)
class Inflated:
    """An actuator with its stack, or the reason why it has none (None: not computed).

    ``rises`` are those of a free chamber by pressure in kPa; ``bent`` are the poses bent by some
    chambers, each with the clearance between chambers in mm. Errors replace values without an
    equilibrium.
    """

    actuator: Actuator
    stack: Stack | LeftOut | None
    rises: Mapping[float, Rise | DesignError] | DesignError
    bent: Mapping[Conditions, tuple[Pose, float] | DesignError]


def inflated(
    actuators: Sequence[Actuator],
    stacks: Sequence[Stack | LeftOut | None],
    request: PredictionRequest,
) -> list[Inflated]:
    """Return actuators of one form at the pressures of a request."""
    pairs = list(zip(actuators, stacks, strict=True))
    bent = [_bent_poses(*pair, request) for pair in pairs]
    posed = [
        (each, pose)
        for each, poses in zip(stacks, bent, strict=True)
        for pose in poses.values()
        if isinstance(each, Stack) and isinstance(pose, Pose) and request.wanted is None
    ]
    rooms = iter(chamber_clearances(posed))
    usual = (Conditions(kpa=kpa) for kpa in request.pressures_kpa if actuators[0].radii)
    pressures = [at.kpa or 0.0 for at in request.places(usual, *RISES)]
    rises: list[dict[float, Rise | DesignError] | DesignError]
    if any(of.factors.tip_load for of in actuators):
        rises = [{p: _attempt(_loaded_rise, *pair, p) for p in pressures} for pair in pairs]
    else:
        rises = _rises(actuators, pressures)
    states = []
    for pair, rise, poses in zip(pairs, rises, bent, strict=True):
        with_rooms = {
            at: (pose, next(rooms, math.nan)) if isinstance(pose, Pose) else pose
            for at, pose in poses.items()
        }
        states.append(Inflated(*pair, rise, with_rooms))
    return states


def _attempt(value: Callable[..., Value], *at: Any) -> Value | DesignError:
    """Return a value, or the reason why there is none."""
    try:
        return value(*at)
    except DesignError as error:
        return error


def _rises(
    actuators: Sequence[Actuator], pressures: Sequence[float]
) -> list[dict[float, Rise | DesignError] | DesignError]:
    """Return the rises of a free chamber by pressure, or why it has no elastic balloons; the
    balloons of each kind are those of films as bought, computed together.
    """
    if not pressures:
        return [{} for _ in actuators]
    drawn = [replace(of, factors=replace(of.factors, modulus_ratio=1.0)) for of in actuators]
    ratios = [of.factors.modulus_ratio for of in actuators]
    chambers = [_attempt(_kinds, of) for of in drawn]
    asked: dict[Balloon, dict[float, None]] = defaultdict(dict)
    for kinds, ratio in zip(chambers, ratios, strict=True):
        for kind in () if isinstance(kinds, DesignError) else kinds:
            asked[kind].update(dict.fromkeys(p / ratio for p in pressures))
    shapes = {kind: _free_shapes(kind, (*at,)) for kind, at in asked.items()}
    return [
        kinds
        if isinstance(kinds, DesignError)
        else {p: _attempt(_rise, kinds, shapes, p, ratio) for p in pressures}
        for kinds, ratio in zip(chambers, ratios, strict=True)
    ]


def _kinds(of: Actuator) -> Counter[Balloon]:
    """Return how many balloons of each kind a chamber has."""
    return Counter(balloons_of(of.design, of.laminate, of.factors, of.form))


@lru_cache(maxsize=256)
def _free_shapes(kind: Balloon, pressures: tuple[float, ...]) -> FreeShapes:
    """Return the free balloon at each pressure, or why it has no equilibrium there."""
    together = _attempt(free_shapes, kind, [*pressures])
    if isinstance(together, DesignError):
        # A balloon without an equilibrium spoils no other.
        return {p: _attempt(free_shapes, kind, p) for p in pressures}
    return {p: together.rows(slice(row, row + 1)) for row, p in enumerate(pressures)}


def _rise(
    kinds: Counter[Balloon], shapes: Mapping[Balloon, FreeShapes], pressure: float, ratio: float
) -> Rise:
    total = np.zeros(3)
    for kind, count in kinds.items():
        shape = shapes[kind][pressure / ratio]
        if isinstance(shape, DesignError):
            raise shape
        refuse_stretched(float(stretch(kind, shape)[0]))
        total += count * np.array([shape.height[0], shape.volume[0], ratio * shape.energy[0]])
    return Rise(*total.tolist())


def tip_force(factors: Factors) -> tuple[float, float, float]:
    """Return the weight in N on the tip, for a level base."""
    return (0.0, 0.0, -1e-3 * GRAVITY * factors.tip_load)


def _loaded_rise(of: Actuator, whole: Stack | LeftOut | None, pressure: float) -> Rise:
    if not isinstance(whole, Stack):
        raise DesignError("with a weight on the tip, only the elastic stack gives it")
    pose = whole.pose((pressure,) * whole.chambers, tip_force(of.factors))
    rise = pose.height - whole.flat_height
    return Rise(rise, float(pose.volumes[0]), pose.energy / whole.chambers)


def free_rise(kinds: Counter[Balloon], pressure: float) -> Rise:
    """Return the rise of the counted balloons of each kind at a pressure in kPa. Raises BeyondError
    if a film would be stretched too far.
    """
    shapes: dict[Balloon, FreeShapes] = {
        kind: {pressure: free_shapes(kind, pressure)} for kind in kinds
    }
    return _rise(kinds, shapes, pressure, 1.0)


def _bent_poses(
    of: Actuator, whole: Stack | LeftOut | None, request: PredictionRequest
) -> dict[Conditions, Pose | DesignError]:
    """Return poses with some chambers at each pressure, the others empty, or why there is none."""
    if not isinstance(whole, Stack):
        return {}
    every = product(request.pressures_kpa, range(1, whole.chambers))
    usual = (Conditions(kpa=kpa, chambers=count) for kpa, count in every)
    return {
        at: _attempt(
            whole.pose,
            chamber_pressures(whole, at.chambers or 0, at.kpa or 0.0),
            tip_force(of.factors),
        )
        for at in request.places(usual, *BENDS)
    }


def chamber_clearances(posed: Sequence[tuple[Stack, Pose]]) -> list[float]:
    """Return the smallest clearance in mm between the films of adjacent balloons in each pose of a
    stack.

    It is negative if they would intersect. Both are in the frame of their level, and balloons of
    other levels lie beyond a plate, so that axes and largest radii suffice. Raises DesignError for
    a balloon without an equilibrium.
    """
    firsts: dict[Balloon, BalloonMap] = {}
    places: list[tuple[Balloon, float, float]] = []
    for whole, pose in posed:
        for kind, gaps in zip((whole.maps[of] for of in whole.levels), pose.gaps, strict=True):
            # One of equal sizes has the same shape at equal pressure over modulus.
            first = firsts.setdefault(kind.drawn.balloon, kind)
            ratio = kind.most_pressure / first.most_pressure
            heights = np.maximum(gaps, LEAST_GAP).round(4).tolist()
            scaled = [pressure / ratio for pressure in pose.pressures]
            places += zip([first.balloon] * len(heights), scaled, heights, strict=True)
    radii = dict.fromkeys(places, 0.0)
    for balloon in {place[0]: None for place in radii}:
        same = [place for place in radii if place[0] == balloon]
        pressures, heights = np.array([place[1:] for place in same]).T
        shapes = inflate(balloon, pressures, heights, tied=True)
        widest = shapes.r[:, balloon.neck_edge : balloon.edge + 1].max(-1)
        radii.update(zip(same, widest.tolist(), strict=True))
    each, rooms = iter(places), []
    for whole, pose in posed:
        wide = np.array([radii[next(each)] for _ in pose.gaps.flat]).reshape(pose.gaps.shape)
        nearest = min(
            float(np.hypot(*(whole.axes[i] - whole.axes[j])) - (wide[:, i] + wide[:, j]).max())
            for i, j in combinations(range(whole.chambers), 2)
        )
        rooms.append(nearest - max(kind.balloon.thickness for kind in whole.maps))
    return rooms


def rim_gap(stack: Stack, pose: Pose) -> float:
    """Return the smallest gap in mm between rims of neighbouring levels.

    0 for flat levels, and if levels tilt so far that their rims touch.
    """
    gaps = stack.rims[stack.levels] @ pose.freedoms[..., None]
    return max(float(gaps.min()), 0.0)


def held_stretch(kinds: Sequence[Balloon], pressures: ArrayLike, strokes: ArrayLike) -> Array:
    """Return the largest strain of the films of a chamber's balloons at pressures (n,) in kPa and
    strokes of all (n,) in mm, with an equal ratio of height to radius for all balloons.
    """
    high = np.asarray(strokes, dtype=float) / sum(balloon.pocket for balloon in kinds)
    each = [
        stretch(kind, compressed_shapes(kind, pressures, np.maximum(high * kind.pocket, 1e-3)))
        for kind in dict.fromkeys(kinds)
    ]
    return np.asarray(np.max(each, axis=0))


def refuse_stretched(longer: float) -> None:
    """Raise BeyondError for a film that is stretched too far."""
    if longer > MOST_STRETCH:
        raise BeyondError(
            f"the film would stretch by {100 * longer:.0f} %, and a constant modulus is unlikely "
            f"to be valid beyond {100 * MOST_STRETCH:g} %; lower the pressure",
            longer / MOST_STRETCH - 1,
        )


def free_strokes(state: Inflated) -> Iterator[FigureItem]:
    """Yield stroke, volume and input work of a free stack of round pockets at each pressure."""
    actuator, quantity = state.actuator, Quantity.FREE_STROKE
    if isinstance(state.rises, DesignError):
        yield LeftOut.of("free stroke, elastic balloon", state.rises, quantity)
        return
    model = calibrated(ELASTIC, actuator.factors)
    for pressure, rise in state.rises.items():
        at = Conditions(kpa=pressure)
        if isinstance(rise, DesignError):
            yield LeftOut.of(f"{quantity.named(at)}, elastic balloon", rise, quantity)
            continue
        yield Figure(quantity, rise.stroke, model, at)
        yield Figure(Quantity.FREE_HEIGHT, actuator.thickness + rise.stroke, model, at)
        yield Figure(Quantity.BALLOON_VOLUME, rise.volume / actuator.balloons, model, at)
        work = rise.energy * actuator.form.stacks / 1000
        yield Figure(Quantity.FREE_WORK, work, model, at)
    if actuator.factors.loss_share and state.rises:
        yield Figure(Quantity.LOST_WORK, 100 * actuator.factors.loss_share, model)


# The elastic stack: forces, bending, time, stiffness.


def elastic_stack(actuator: Actuator, request: PredictionRequest) -> Stack | LeftOut | None:
    """The stack of an actuator with round pockets, or why there is none; None for other forms."""
    if not actuator.radii:
        return None
    most = max(MOST_PRESSURE, *request.pressures_kpa, 0.0)
    try:
        return stack(actuator.design, actuator.laminate, most, actuator.factors, actuator.form)
    except DesignError as error:
        return LeftOut.of("elastic stack", error)


def moved_stack(together: Stack, actuator: Actuator, moved: Factors) -> Stack | None:
    """Return an actuator's stack at ``moved`` factors without new maps; None if it needs any."""
    factors = actuator.factors
    if moved.pocket_loss != factors.pocket_loss:
        return None
    ratio = moved.modulus_ratio / factors.modulus_ratio
    return replace(
        together,
        maps=tuple(kind.stiffened(ratio) for kind in together.maps),
        pitch=moved.folded(actuator.laminate).height / len(together.levels),
    )


PosedItem = tuple[FigureItem, Pose | None]
"""A figure with the pose that it is taken from."""
Guides = dict[Conditions, tuple[Pose, Pose]]
"""Bent poses, and those pressed further, by conditions: starts for those of other stacks."""


def stack_figures(
    state: Inflated,
    request: PredictionRequest,
    guides: Guides,
    checks_films: bool = True,
    checks_maps: bool = False,
) -> Iterator[FigureItem]:
    """Yield forces, bending, times and stiffness of the stack.

    With ``checks_films`` figures with overstretched films are omitted; with ``checks_maps`` figures
    are flagged if their balloons are outside the valid range of a map. Poses that ``guides`` lack
    are added.
    """
    assert isinstance(state.stack, Stack)
    stack, factors = state.stack, state.actuator.factors
    rows = list(_forces(state.actuator, request, stack, checks_films))
    if state.actuator.form.is_parallel:
        rows += [*_bends(state, stack), *_bent_forces(request, stack, guides, factors)]
    rows += [*_times(request, stack, factors), *_stiffness(request, stack, factors)]
    poses = list({id(pose): pose for _, pose in rows if pose and checks_maps}.values())
    outside = {id(pose) for pose, holds in zip(poses, stack.hold(poses), strict=True) if not holds}
    for item, pose in rows:
        if isinstance(item, Figure) and id(pose) in outside:
            trust = f"{OUTSIDE}; {item.model.trust}"
            yield replace(item, model=replace(item.model, trust=trust))
        else:
            yield item


def _forces(
    actuator: Actuator, request: PredictionRequest, stack: Stack, checks_films: bool
) -> Iterator[PosedItem]:
    quantity, model = Quantity.BLOCKED_FORCE, calibrated(FORCE, actuator.factors)
    shares = paper.HEIGHTS if actuator.has_reference else paper.HEIGHTS[:1]
    every = product(request.pressures_kpa, shares)
    places = request.places((Conditions(kpa=kpa, share=share) for kpa, share in every), quantity)
    strokes = [actuator.stroke_at(at.share or 0.0) if at.rise is None else at.rise for at in places]
    strains = [0.0] * len(places)
    if checks_films and places:
        kinds = balloons_of(actuator.design, actuator.laminate, actuator.factors, actuator.form)
        strains = held_stretch(kinds, [at.kpa or 0.0 for at in places], strokes).tolist()
    for at, stroke, strain in zip(places, strokes, strains, strict=True):
        pressure = at.kpa or 0.0
        try:
            value = actuator.form.pushing * float(blocked_force(stack, pressure, stroke))
            if value > 0 or request.wanted is None:
                refuse_stretched(strain)
        except DesignError as error:
            yield LeftOut.of(f"{quantity.named(at)}, elastic stack", error, quantity), None
            continue
        # Values at other factors need no pose: a force does not depend on whether it is stable.
        is_posed = checks_films and request.wanted is None
        pose = _level_pose(stack, pressure, stroke) if is_posed else None
        buckles = pose is not None and not pose.stable
        by = replace(model, trust=f"{BUCKLES}; {model.trust}") if buckles else model
        yield Figure(quantity, value, by, at), pose


def _level_pose(stack: Stack, pressure: float, stroke: float) -> Pose | None:
    """Return the straight pose below a level plate that holds a stack at a stroke in mm; None if
    there is none. A column that would buckle there is not stable.
    """
    pressures, plate = (pressure,) * stack.chambers, stack.flat_height + stroke
    pose = _attempt(partial(stack.pose, plate=plate), pressures)
    return pose if isinstance(pose, Pose) else None


def chamber_pressures(
    stack: Stack, chambers: int, pressure: float, rest: float = 0.0
) -> tuple[float, ...]:
    """Return the pressures in kPa with some chambers filled, the others at ``rest``."""
    return (pressure,) * chambers + (rest,) * (stack.chambers - chambers)


def _bends(state: Inflated, stack: Stack) -> Iterator[PosedItem]:
    bends, contacts = (calibrated(model, state.actuator.factors) for model in (BEND, CONTACT))
    for at, bent in state.bent.items():
        if isinstance(bent, DesignError):
            yield LeftOut.of(Quantity.BEND.named(at), bent, Quantity.BEND), None
            continue
        pose, room = bent
        for quantity, value, model in (
            (Quantity.BEND, pose.bend, bends),
            (Quantity.RIM_ROOM, rim_gap(stack, pose), contacts),
            (Quantity.CHAMBER_CLEARANCE, room, contacts),
            (Quantity.ASIDE, float(np.hypot(*pose.tip[:2])), bends),
        ):
            yield Figure(quantity, value, model, at), pose


def pose_bent_by(stack: Stack, chambers: int, angle: float) -> Pose | None:
    """Return the pose of ``poses_bent_by`` for one bend."""
    return poses_bent_by(stack, [(chambers, angle)])[0]


def poses_bent_by(
    stack: Stack,
    bends: Sequence[tuple[int, float]],
    ranges: Mapping[int, tuple[float, float]] | None = None,
) -> list[Pose | None]:
    """Return the pose of each bend: some chambers pressurised and the others empty, bent by an
    angle in degrees; None if no pressure gives it, or none in the range in kPa that ``ranges``
    holds for the bend's number.

    Bisection until both ends have poses, then false position in the logarithm of the pressure,
    halving the end that is retained (Illinois); all bends in step.
    """
    poses: list[Pose | None] = [None] * len(bends)
    given = {} if ranges is None else ranges
    all_ends = (given.get(number, (LEAST_PRESSURE, math.inf)) for number in range(len(bends)))
    low, high = np.array(list(all_ends)).reshape(-1, 2).T
    high = np.minimum(high, stack.most_pressure)
    below, above, before = np.full((3, len(bends)), math.nan)
    while (live := np.flatnonzero(high > low * (1 + np.where(above > 0, NO_FURTHER, NONE)))).size:
        share = below[live] / (below[live] - above[live])
        ratio = high[live] / low[live]
        middle = low[live] * ratio ** np.where(np.isfinite(share), share, 0.5)
        rows = [
            chamber_pressures(stack, bends[k][0], p)
            for k, p in zip(live.tolist(), middle.tolist(), strict=True)
        ]
        states = stack.equilibria(np.array(rows), None)
        for number, k in enumerate(live.tolist()):
            missing = states.bends[number] - bends[k][1]
            if not states.is_met[number]:
                high[k], above[k], before[k] = middle[number], math.nan, 0.0
            elif abs(missing) < 1e-6:
                poses[k], high[k] = states.pose(number), low[k]
            else:
                stays = 0.5 if missing * before[k] > 0 else 1.0
                ends = (below, above) if missing < 0 else (above, below)
                ends[0][k], ends[1][k] = missing, stays * ends[1][k]
                (low if missing < 0 else high)[k] = middle[number]
                before[k] = missing
    return poses


def _bent_forces(
    request: PredictionRequest, stack: Stack, guides: Guides, factors: Factors
) -> Iterator[PosedItem]:
    """Yield forces on a plate perpendicular to the bent tip, at higher chamber pressures."""
    if not request.pressures_kpa or request.wanted is not None:
        return
    quantity, model = Quantity.BENT_FORCE, calibrated(FORCE, factors)
    pressure = max(request.pressures_kpa)
    bends = list(product(range(1, min(stack.chambers, 3)), ANGLES))
    conditions = [Conditions(kpa=pressure, chambers=count, angle=angle) for count, angle in bends]
    usual = {k: guides[at][0].pressures[0] for k, at in enumerate(conditions) if at in guides}
    near = {k: (kpa / NEARBY, kpa * NEARBY) for k, kpa in usual.items()}
    poses = poses_bent_by(stack, bends, near)
    for (chambers, angle), at, nearby in zip(bends, conditions, poses, strict=True):
        is_far = nearby is None and at in guides
        pose = pose_bent_by(stack, chambers, angle) if is_far else nearby
        if pose is None or pose.pressures[0] > pressure:
            yield LeftOut(quantity.named(at), "it does not bend so far", (quantity,)), None
            continue
        guide = guides.get(at)
        try:
            start = pose if guide is None else guide[1]
            pressed = pressed_further(stack, chambers, pressure, pose, start)
        except DesignError as error:
            yield LeftOut.of(quantity.named(at), error, quantity), None
            continue
        guides.setdefault(at, (pose, pressed))
        yield Figure(quantity, pressed.force, model, at), pressed


def pressed_further(
    stack: Stack, chambers: int, pressure: float, bent: Pose, near: Pose | None = None
) -> Pose:
    """Return the pose with some chambers at a pressure in kPa below a plate perpendicular to the
    tip of a bent pose.

    ``near`` is an initial pose. Raises DesignError if there is no such pose.
    """
    (x, y, z), (across, aside, along) = bent.tip.tolist(), bent.frames[1][-1][:, 2].tolist()
    plate = Plate((x, y, z), (across, aside, along))
    return stack.pose(chamber_pressures(stack, chambers, pressure), plate=plate, near=near or bent)


def time_to_fill(
    stack: Stack, flow_ml_min: float, until: float, length: float = TUBE_LENGTH
) -> tuple[float, Pose]:
    """Return the seconds until the pump shows a pressure in kPa, for a flow of water shared by all
    chambers through tubes of a ``length`` in mm; and the pose at that time.

    Raises DesignError if the pressure drop of the tubes alone is as large.
    """
    flow = flow_ml_min * 1000 / 60 / stack.chambers
    tube = Line(WATER, length).source_pressure(flow, 0.0)
    if tube >= until:
        raise DesignError(f"at this flow a tube of {length:g} mm alone takes {tube:.3g} kPa")
    pose = stack.pose((until - tube,) * stack.chambers)
    empty = stack.pose((0.0,) * stack.chambers)
    return float((pose.volumes - empty.volumes).mean()) / flow, pose


def air_time(whole: Stack, flow_ml_min: float, until: float, line: Line) -> float:
    """Return the seconds of a steady air flow of the pump, shared by all chambers, until they reach
    a pressure in kPa: the air that they and their lines take in, divided by the flow.
    """
    held = line.dead_volume + line.tube_volume
    empty, full = (
        line.content(float(whole.pose((p,) * whole.chambers).volumes.mean()) + held, p)
        for p in (0.0, until)
    )
    flow = flow_ml_min * 1000 / 60 / whole.chambers
    return line.delay + (full - empty) / flow


def _times(request: PredictionRequest, stack: Stack, factors: Factors) -> Iterator[PosedItem]:
    model, quantity = calibrated(TIME, factors), Quantity.WATER_TIME
    for at in request.places([Conditions(kpa=paper.FULL_KPA, flow=request.flow_ml_min)], quantity):
        try:
            time, pose = time_to_fill(stack, request.flow_ml_min, paper.FULL_KPA)
        except DesignError as error:
            yield LeftOut.of(quantity.named(at), error, quantity), None
            return
        yield Figure(quantity, time + factors.water_delay, model, at), pose
        yield Figure(Quantity.WATER_HEIGHT, pose.height, model, at._replace(flow=None)), pose


def _stiffness(request: PredictionRequest, stack: Stack, factors: Factors) -> Iterator[PosedItem]:
    held, shut = (calibrated(each, factors) for each in (HELD, SHUT))
    both = Quantity.HELD_STIFFNESS, Quantity.SHUT_STIFFNESS
    usual = (Conditions(kpa=kpa) for kpa in request.pressures_kpa[:1])
    for at in request.places(usual, *both):
        pressure = at.kpa or 0.0
        try:
            start = stack.pose((pressure,) * stack.chambers)
            aside = (PROBE_FORCE, 0.0, 0.0)
            pushed = stack.pose(start.pressures, aside, near=start)
            stiffness = PROBE_FORCE / float(pushed.tip[0])
            yield Figure(Quantity.HELD_STIFFNESS, stiffness, held, at), start
            stiffness, _ = shut_stiffness(stack, pressure)
            yield Figure(Quantity.SHUT_STIFFNESS, stiffness, shut, at), start
        except DesignError as error:
            yield LeftOut.of(f"lateral tip stiffness at {pressure:g} kPa", error, *both), None


def shut_stiffness(stack: Stack, pressure: float) -> tuple[float, float]:
    """Return the lateral stiffness of the tip in N/mm with the chambers closed at a pressure in
    kPa, and the height in mm.
    """
    aside = (PROBE_FORCE, 0.0, 0.0)
    start = stack.pose((pressure,) * stack.chambers)
    shut = Motion(stack, Line(AIR, length=1e-3), {"tip_load": aside}, start)
    shut.step(1.0, flows=(0.0,) * stack.chambers)
    return PROBE_FORCE / float(shut.pose.tip[0]), start.height


def force_traces(actuator: Actuator, request: PredictionRequest, stack: Stack) -> list[Trace]:
    """Return curves of force against stroke, one per pressure."""
    most = actuator.reference_height - actuator.thickness
    if not actuator.has_reference:
        most = min(each.largest_stroke for each in actuator.pockets)
    strokes = np.linspace(0, most, SAMPLES)
    model = calibrated(FORCE, actuator.factors)
    lines = []
    for pressure in request.pressures_kpa:
        if pressure > stack.most_pressure:
            continue
        values = (actuator.form.pushing * blocked_force(stack, pressure, strokes)).tolist()
        lines.append(Trace(f"elastic stack, {pressure:g} kPa", strokes.tolist(), values, model))
    return lines


def bend_relation(factors: Factors, stack: Stack) -> Relation:
    """Return the curves of bend against pressure."""
    model = calibrated(BEND, factors)
    pressures = np.geomspace(0.01, 20.0, SAMPLES)
    lines = []
    for chambers in range(1, stack.chambers):
        poses = _poses(stack, chambers, pressures)
        label = f"{chamber_count(chambers)}, the others empty"
        lines.append(Trace(label, poses.pressures[:, 0].tolist(), poses.bends.tolist(), model))
    return Relation(
        "bend", "Bending against pressure", "pressure, kPa", "bend of the top, deg", tuple(lines)
    )


def workspace_traces(factors: Factors, stack: Stack) -> list[Trace]:
    """Tip paths with 1, 2 ... chambers inflated up to 10 kPa and the others empty or full."""
    model = calibrated(BEND, factors)
    pressures = np.linspace(0.1, paper.FULL_KPA**0.5, SAMPLES) ** 2
    lines = []
    for rest, words in ((0.0, "empty"), (paper.FULL_KPA, f"at {paper.FULL_KPA:g} kPa")):
        for chambers in range(1, stack.chambers):
            poses = _poses(stack, chambers, pressures, rest)
            label = f"elastic stack, {chamber_count(chambers)} to 10 kPa, the others {words}"
            aside = np.hypot(*poses.tips[:, :2].T)
            lines.append(Trace(label, aside.tolist(), poses.heights.tolist(), model))
    return lines


def _poses(stack: Stack, chambers: int, pressures: Array, rest: float = 0.0) -> BatchPoses:
    """Return the poses at rising pressures in some chambers, up to the first without one."""
    rows = np.full((len(pressures), stack.chambers), rest)
    rows[:, :chambers] = pressures[:, None]
    states = stack.equilibria(rows[rows.max(1) <= stack.most_pressure], None)
    count = int(np.logical_and.accumulate(states.is_met).sum())
    return states.part(slice(count))


# Balloons on top of each other: all carry the same force, and their strokes add up.


def blocked_force(stack: Stack, pressure: float, stroke: ArrayLike) -> Array:
    """Return the force in N of one straight chamber blocked at strokes in mm; 0 beyond its free
    stroke.

    It is at most the force of its weakest balloon when flat. Below the stroke at which this balloon
    closes, its solid films may carry more, which is not counted.
    """
    curves = [_curve(balloon, pressure) for balloon in stack.maps]
    counts = np.bincount(stack.levels, minlength=len(stack.maps))
    force = np.linspace(0.0, min(push[0] for _, push in curves), SERIES_SAMPLES)
    total = np.zeros(SERIES_SAMPLES)
    for count, (heights, push) in zip(counts, curves, strict=True):
        total += count * np.interp(force, push[::-1], heights[::-1])
    return np.asarray(
        np.interp(np.asarray(stroke, dtype=float), total[::-1], force[::-1], right=0.0) / 1000
    )


def _curve(balloon: BalloonMap, pressure: float) -> tuple[Array, Array]:
    """Return heights in mm and the force in mN at each, made monotonic."""
    heights = np.linspace(0.0, balloon.most_height, SERIES_SAMPLES)
    return heights, np.minimum.accumulate(balloon.force(pressure, heights))
