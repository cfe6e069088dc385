"""Predictions by the elastic balloon and the elastic stack: free strokes, blocked forces, bending,
clearances, times, stiffness, and the curves of these.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sbafab.errors import BeyondError, DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.models import paper
from sbafab.models.balloon import Balloon, Shapes, distinct, inflate
from sbafab.models.balloon_map import MOST_STRETCH, BalloonMap, stretch
from sbafab.models.balloons import balloons_of
from sbafab.models.figures import (
    Factors,
    Figure,
    LeftOut,
    Model,
    PredictionRequest,
    Relation,
    Trace,
)
from sbafab.models.film_elements import Array
from sbafab.models.pneumatics import AIR, TUBE_LENGTH, WATER, Line
from sbafab.models.pocket_models import Actuator
from sbafab.models.quantity import Conditions, ModelId, Quantity, chamber_count
from sbafab.models.rippled_balloon import compressed_shapes, free_shapes
from sbafab.models.stack import MOST_PRESSURE, Motion, Plate, Pose, Stack, stack
from sbafab.models.stack_balance import BatchPoses

Inflated = Mapping[Balloon, Shapes]
ELASTIC = Model(
    ModelId.ELASTIC_BALLOON,
    "membrane of revolution, the film's modulus",
    "one balloon to 10 kPa: within 1.2 % of an axisymmetric mesh; of a solid one that ripples, "
    "d = 5 to 15 within 3 %, d = 20 within 5 %, but d = 10 is 6 to 19 % low where a lone one's rim "
    "rolls to one side; all balloons of a stack are taken for inner ones, inlets left out",
)


CALIBRATED_TRUST = (
    "modulus, pockets, pressed thickness and delays as the calibration has them; what would be "
    "measured lies in the interval with 90 %. Plates are rigid and carry no shear; poses and "
    "forces are those of films that lose no energy"
)


def calibrated(model: Model, factors: Factors) -> Model:
    """Return a model with its calibration factors in its name, unless they are the defaults."""
    if factors.calibration:
        return replace(model, calibration=factors.calibration, trust=CALIBRATED_TRUST)
    given = {
        "press_factor": factors.press_factor if factors.press_factor != 1 else None,
        "pocket_loss": factors.pocket_loss or None,
        "modulus_mpa": factors.modulus_mpa,
    }
    named = tuple((factor, value) for factor, value in given.items() if value is not None)
    return replace(model, factors=named)


def free_strokes(actuator: Actuator, request: PredictionRequest) -> Iterator[Figure | LeftOut]:
    """Yield stroke, volume and input work of a free stack of round pockets at each pressure."""
    if not actuator.radii or not request.pressures_kpa:
        return
    try:
        kinds = Counter(
            balloons_of(actuator.design, actuator.laminate, request.factors, actuator.form)
        )
    except DesignError as error:
        yield LeftOut("free stroke, elastic balloon", str(error), (Quantity.FREE_STROKE,))
        return
    model = calibrated(ELASTIC, request.factors)
    together = _inflated(kinds, request.pressures_kpa)
    for row, pressure in enumerate(request.pressures_kpa):
        at = Conditions(kpa=pressure)
        try:
            rise = free_rise(kinds, pressure, together[row] if together else None)
        except DesignError as error:
            name = f"{Quantity.FREE_STROKE.named(at)}, elastic balloon"
            yield LeftOut(name, str(error), (Quantity.FREE_STROKE,))
            continue
        height = actuator.thickness + rise.stroke
        volume = rise.volume / actuator.balloons
        yield Figure(Quantity.FREE_STROKE, rise.stroke, model, at)
        yield Figure(Quantity.FREE_HEIGHT, height, model, at)
        yield Figure(Quantity.BALLOON_VOLUME, volume, model, at)
        work = rise.energy * actuator.form.stacks / 1000
        yield Figure(Quantity.FREE_WORK, work, model, at)
    if request.factors.loss_share:
        yield Figure(Quantity.LOST_WORK, 100 * request.factors.loss_share, model)


def _inflated(kinds: Iterable[Balloon], pressures: Sequence[float]) -> list[Inflated] | None:
    """Return the balloons at each pressure, solved at once; None if one has no equilibrium."""
    try:
        shapes = {kind: _free_shapes(kind, tuple(pressures)) for kind in kinds}
    except DesignError:
        return None
    return [
        {kind: shapes[kind].rows(slice(row, row + 1)) for kind in shapes}
        for row in range(len(pressures))
    ]


@lru_cache(maxsize=64)
def _free_shapes(kind: Balloon, pressures: tuple[float, ...]) -> Shapes:
    """Return ``free_shapes``, cached for factors that do not change the balloon."""
    return free_shapes(kind, pressures)


class Rise(NamedTuple):
    """Rise of one free stack of balloons: ``stroke`` in mm, ``volume`` in ul, and the ``energy`` in
    its films in uJ, to 3 % the integral of p dV.
    """

    stroke: float
    volume: float
    energy: float


def free_rise(kinds: Counter[Balloon], pressure: float, shapes: Inflated | None = None) -> Rise:
    """Return the rise of the counted balloons of each kind at a pressure in kPa; ``shapes`` are
    their shapes if known. Raises BeyondError if a film would be stretched too far.
    """
    stroke = volume = energy = 0.0
    for kind, count in kinds.items():
        shape = shapes[kind] if shapes else free_shapes(kind, pressure)
        refuse_stretched(float(stretch(kind, shape)[0]))
        stroke += count * float(shape.height[0])
        volume += count * float(shape.volume[0])
        energy += count * float(shape.energy[0])
    return Rise(stroke, volume, energy)


def held_stretch(kinds: Sequence[Balloon], pressures: ArrayLike, strokes: ArrayLike) -> Array:
    """Return the largest strain of the films of a chamber's balloons at pressures (n,) in kPa and
    strokes of all (n,) in mm, each balloon at the same height over radius.
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
            f"the film would be {100 * longer:.0f} % longer, and one modulus is unlikely to hold "
            f"beyond {100 * MOST_STRETCH:g} %; ask for less pressure",
            longer / MOST_STRETCH - 1,
        )


# The elastic stack: forces, bending, time, stiffness.


SAMPLES = 21
ANGLES = (30.0, 60.0, 90.0)
LEAST_PRESSURE, NO_FURTHER = 0.01, 1e-7
"""Lowest pressure of a bend in kPa, and the relative tolerance of its pressure."""
NEARBY = 2.0
"""Largest ratio of a bend's pressure to that of another stack which guides the search."""
PROBE_FORCE = 1e-5
"""Lateral force in N on the tip with which its stiffness is probed."""
SOURCE = "membrane of revolution between plates, the film's modulus"
FORCE = Model(
    ModelId.ELASTIC_STACK,
    SOURCE,
    "no shear between plates; films of constant modulus to 100 kPa. The paper's 3-DoF at 100 kPa "
    "has 0.9, 0.8 and 0.6 of it, its 1-DoF less",
)
BEND = Model(
    ModelId.ELASTIC_STACK,
    SOURCE,
    "rigid plates that tilt, balloons that push by the gap at their ring, rims that touch on the "
    "inner side. The 3-DoF at 5 kPa has 86 deg with two chambers, 105 with one, where shells in "
    "SOFA, whose rims do not touch, have 85 and 109; the paper's largest is 81 +- 6 at a pressure "
    "that it does not give",
)
CONTACT = Model(
    ModelId.ELASTIC_STACK,
    SOURCE,
    "films as wide as their meridians in balance; 0 is touching, which the stack then allows for",
)
TIME = Model(
    ModelId.STACK_IN_TIME,
    f"Poiseuille or Blasius in {TUBE_LENGTH:g} mm of tube to each chamber",
    "the paper gives no length, and this one makes its 0.92 s come out; the sensor is taken to sit "
    "at the pump; no lag of valve and pump",
)
AT_PRESSURE = Model(
    ModelId.ELASTIC_STACK,
    SOURCE,
    "no shear between plates; the paper's moduli would make it 15 times as firm, at a pressure "
    "that it does not give",
)
CHAMBERS_SHUT = Model(
    ModelId.STACK_SHUT,
    SOURCE,
    "the air that is in the chambers stays in, tubes left out; no shear between plates",
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


def elastic_stack(actuator: Actuator, request: PredictionRequest) -> Stack | LeftOut | None:
    """Return the stack of an actuator with round pockets, or why not; None for others."""
    if not actuator.radii:
        return None
    most = max(MOST_PRESSURE, *request.pressures_kpa, 0.0)
    try:
        return stack(actuator.design, actuator.laminate, most, request.factors, actuator.form)
    except DesignError as error:
        return LeftOut("elastic stack", str(error))


def moved_stack(
    together: Stack, laminate: Laminate, factors: Factors, moved: Factors
) -> Stack | None:
    """Return a laminate's stack of ``factors`` at other ones without new maps; None if it needs
    new ones.
    """
    if (moved.pocket_loss, moved.modulus_mpa) != (factors.pocket_loss, factors.modulus_mpa):
        return None
    ratio = moved.modulus_ratio / factors.modulus_ratio
    return replace(
        together,
        maps=tuple(kind.stiffened(ratio) for kind in together.maps),
        pitch=moved.folded(laminate).height / len(together.levels),
    )


PosedItem = tuple[Figure | LeftOut, Pose | None]
"""A figure with the pose that it is taken from."""
Guides = dict[Conditions, tuple[Pose, Pose]]
"""Bent poses, and those pressed further, by conditions: starts for those of other stacks."""


def stack_figures(
    actuator: Actuator,
    request: PredictionRequest,
    stack: Stack,
    guides: Guides,
    checks_films: bool = True,
    checks_maps: bool = False,
) -> Iterator[Figure | LeftOut]:
    """Yield forces, bending, times and stiffness of the stack. With ``checks_films`` figures with
    films stretched too far are left out; with ``checks_maps`` figures are flagged if their balloons
    are outside the valid range of a map. Poses that ``guides`` lack are added.
    """
    rows = list(_posed_figures(actuator, request, stack, guides, checks_films))
    poses = list({id(pose): pose for _, pose in rows if pose and checks_maps}.values())
    outside = {id(pose) for pose, holds in zip(poses, stack.hold(poses), strict=True) if not holds}
    for item, pose in rows:
        if isinstance(item, Figure) and id(pose) in outside:
            trust = f"{OUTSIDE}; {item.model.trust}"
            yield replace(item, model=replace(item.model, trust=trust))
        else:
            yield item


def _posed_figures(
    actuator: Actuator,
    request: PredictionRequest,
    stack: Stack,
    guides: Guides,
    checks_films: bool,
) -> Iterator[PosedItem]:
    yield from _forces(actuator, request, stack, checks_films)
    if actuator.form.is_parallel:
        yield from _bends(request, stack)
        yield from _bent_forces(request, stack, guides)
    yield from _times(request, stack)
    yield from _stiffness(request, stack)


def stroke_at(actuator: Actuator, share: float) -> float:
    """Return the stroke in mm at a share of the way from the flat to the reference height."""
    return max(share * (actuator.reference_height - actuator.thickness), 0.0)


def _forces(
    actuator: Actuator, request: PredictionRequest, stack: Stack, checks_films: bool
) -> Iterator[PosedItem]:
    kinds = balloons_of(actuator.design, actuator.laminate, request.factors, actuator.form)
    shares = paper.HEIGHTS if actuator.has_reference else paper.HEIGHTS[:1]
    strokes = [stroke_at(actuator, share) for share in shares]
    for pressure in request.pressures_kpa:
        longer = np.zeros(len(strokes))
        if checks_films:
            longer = held_stretch(kinds, [pressure] * len(strokes), strokes)
        for share, stroke, strain in zip(shares, strokes, longer.tolist(), strict=True):
            quantity, at = Quantity.BLOCKED_FORCE, Conditions(kpa=pressure, share=share)
            try:
                refuse_stretched(strain)
                value = float(blocked_force(stack, pressure, stroke))
            except DesignError as error:
                name = f"{quantity.named(at)}, elastic stack"
                yield LeftOut(name, str(error), (quantity,)), None
                continue
            model = calibrated(FORCE, request.factors)
            pose = _level_pose(stack, pressure, stroke)
            if pose and not pose.stable:
                model = replace(model, trust=f"{BUCKLES}; {model.trust}")
            value *= actuator.form.pushing
            yield Figure(quantity, value, model, at), pose


def _level_pose(stack: Stack, pressure: float, stroke: float) -> Pose | None:
    """Return the straight pose below a level plate that holds a stack at a stroke in mm; None
    without one. A column that would buckle there is not stable.
    """
    try:
        plate = stack.flat_height + stroke
        return stack.pose(_pressures(stack, stack.chambers, pressure), plate=plate)
    except DesignError:
        return None


def _pressures(
    stack: Stack, chambers: int, pressure: float, rest: float = 0.0
) -> tuple[float, ...]:
    return (pressure,) * chambers + (rest,) * (stack.chambers - chambers)


def _bends(request: PredictionRequest, stack: Stack) -> Iterator[PosedItem]:
    bent: list[tuple[Conditions, Pose]] = []
    for pressure, chambers in product(request.pressures_kpa, range(1, stack.chambers)):
        at = Conditions(kpa=pressure, chambers=chambers)
        try:
            bent.append((at, stack.pose(_pressures(stack, chambers, pressure))))
        except DesignError as error:
            yield LeftOut(Quantity.BEND.named(at), str(error), (Quantity.BEND,)), None
    rooms = chamber_clearances(stack, [pose for _, pose in bent])
    bends, contacts = (calibrated(model, request.factors) for model in (BEND, CONTACT))
    for (at, pose), room in zip(bent, rooms.tolist(), strict=True):
        for quantity, value, model in (
            (Quantity.BEND, pose.bend, bends),
            (Quantity.RIM_ROOM, rim_gap(stack, pose), contacts),
            (Quantity.CHAMBER_CLEARANCE, room, contacts),
            (Quantity.ASIDE, float(np.hypot(*pose.tip[:2])), bends),
        ):
            yield Figure(quantity, value, model, at), pose


def pose_bent_by(
    stack: Stack, chambers: int, angle: float, low: float = LEAST_PRESSURE, high: float = math.inf
) -> Pose | None:
    """Return the pose bent by an angle in degrees with some chambers pressurised and the others
    empty; None if no pressure from ``low`` to ``high`` (kPa) gives it.

    Bisection until both ends have poses, then false position by the pressure's logarithm, with the
    end that stays halved (Illinois).
    """
    high = min(high, stack.most_pressure)
    below = above = math.nan
    pose, before = None, 0.0
    while high > low * (1 + NO_FURTHER):
        share = below / (below - above)
        middle = low * (high / low) ** (share if math.isfinite(share) else 0.5)
        try:
            pose = stack.pose(_pressures(stack, chambers, middle), near=pose)
        except DesignError:
            high, above, before = middle, math.nan, 0.0
            continue
        missing = pose.bend - angle
        if abs(missing) < 1e-6:
            return pose
        stays = 0.5 if missing * before > 0 else 1.0
        if missing < 0:
            low, below, above = middle, missing, stays * above
        else:
            high, above, below = middle, missing, stays * below
        before = missing
    return None


def _bent_forces(request: PredictionRequest, stack: Stack, guides: Guides) -> Iterator[PosedItem]:
    """Yield forces on a plate square to the bent tip, its chambers pressurised further."""
    if not request.pressures_kpa:
        return
    model = calibrated(FORCE, request.factors)
    pressure = max(request.pressures_kpa)
    for chambers in range(1, min(stack.chambers, 3)):
        for angle in ANGLES:
            quantity = Quantity.BENT_FORCE
            at = Conditions(kpa=pressure, chambers=chambers, angle=angle)
            pose, guide = None, guides.get(at)
            if guide is not None:
                usual = guide[0].pressures[0]
                pose = pose_bent_by(stack, chambers, angle, usual / NEARBY, usual * NEARBY)
            pose = pose or pose_bent_by(stack, chambers, angle)
            if pose is None or pose.pressures[0] > pressure:
                reason = "it does not bend so far"
                yield LeftOut(quantity.named(at), reason, (quantity,)), None
                continue
            plate = Plate(_three(pose.tip), _three(pose.frames[1][-1][:, 2]))
            try:
                start = pose if guide is None else guide[1]
                pressed = stack.pose(_pressures(stack, chambers, pressure), plate=plate, near=start)
            except DesignError as error:
                yield LeftOut(quantity.named(at), str(error), (quantity,)), None
                continue
            guides.setdefault(at, (pose, pressed))
            yield Figure(quantity, pressed.force, model, at), pressed


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return (x, y, z)


def time_to_fill(
    stack: Stack, flow_ml_min: float, until: float, length: float = TUBE_LENGTH
) -> tuple[float, Pose]:
    """Return the seconds of water at a flow, shared by all chambers through tubes of a ``length``
    in mm, until the pump shows a pressure in kPa; and the pose by then.

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
    """Return the seconds of air at a steady flow of the pump, shared by all chambers, until they
    have a pressure in kPa: the air that they and their lines take in, over the flow.
    """
    held = line.dead_volume + line.tube_volume
    empty, full = (
        line.content(float(whole.pose((p,) * whole.chambers).volumes.mean()) + held, p)
        for p in (0.0, until)
    )
    flow = flow_ml_min * 1000 / 60 / whole.chambers
    return line.delay + (full - empty) / flow


def _times(request: PredictionRequest, stack: Stack) -> Iterator[PosedItem]:
    model = calibrated(TIME, request.factors)
    at = Conditions(kpa=paper.FULL_KPA, flow=request.flow_ml_min)
    try:
        time, pose = time_to_fill(stack, request.flow_ml_min, paper.FULL_KPA)
    except DesignError as error:
        quantity = Quantity.WATER_TIME
        yield LeftOut(quantity.named(at), str(error), (quantity,)), None
        return
    yield Figure(Quantity.WATER_TIME, time + request.factors.water_delay, model, at), pose
    at = Conditions(kpa=paper.FULL_KPA)
    yield Figure(Quantity.WATER_HEIGHT, pose.height, model, at), pose


def _stiffness(request: PredictionRequest, stack: Stack) -> Iterator[PosedItem]:
    for pressure in request.pressures_kpa[:1]:
        at = Conditions(kpa=pressure)
        held, shut = (calibrated(each, request.factors) for each in (AT_PRESSURE, CHAMBERS_SHUT))
        try:
            start = stack.pose((pressure,) * stack.chambers)
            aside = (PROBE_FORCE, 0.0, 0.0)
            pushed = stack.pose(start.pressures, aside, near=start)
            stiffness = PROBE_FORCE / float(pushed.tip[0])
            yield Figure(Quantity.HELD_STIFFNESS, stiffness, held, at), start
            stiffness, _ = shut_stiffness(stack, pressure)
            yield Figure(Quantity.SHUT_STIFFNESS, stiffness, shut, at), start
        except DesignError as error:
            both = (Quantity.HELD_STIFFNESS, Quantity.SHUT_STIFFNESS)
            name = f"lateral tip stiffness at {pressure:g} kPa"
            yield LeftOut(name, str(error), both), None


def shut_stiffness(stack: Stack, pressure: float) -> tuple[float, float]:
    """Return the lateral stiffness of the tip in N/mm with the chambers shut at a pressure in kPa,
    and the height in mm.
    """
    aside = (PROBE_FORCE, 0.0, 0.0)
    start = stack.pose((pressure,) * stack.chambers)
    shut = Motion(stack, Line(AIR, length=1e-3), {"tip_load": aside}, start)
    shut.step(1.0, flows=(0.0,) * stack.chambers)
    return PROBE_FORCE / float(shut.pose.tip[0]), start.height


def force_traces(actuator: Actuator, request: PredictionRequest, stack: Stack) -> list[Trace]:
    """Return curves of force against stroke, one a pressure."""
    most = actuator.reference_height - actuator.thickness
    if not actuator.has_reference:
        most = min(k.largest_stroke for k in actuator.kinematics)
    strokes = np.linspace(0, most, SAMPLES)
    model = calibrated(FORCE, request.factors)
    lines = []
    for pressure in request.pressures_kpa:
        if pressure > stack.most_pressure:
            continue
        values = (actuator.form.pushing * blocked_force(stack, pressure, strokes)).tolist()
        lines.append(Trace(f"elastic stack, {pressure:g} kPa", strokes.tolist(), values, model))
    return lines


def bend_relation(request: PredictionRequest, stack: Stack) -> Relation:
    """Return the curves of bend against pressure."""
    model = calibrated(BEND, request.factors)
    pressures = np.geomspace(0.01, 20.0, SAMPLES)
    lines = []
    for chambers in range(1, stack.chambers):
        poses = _poses(stack, chambers, pressures)
        label = f"{chamber_count(chambers)}, the others empty"
        lines.append(Trace(label, poses.pressures[:, 0].tolist(), poses.bends.tolist(), model))
    return Relation(
        "bend", "Bending against pressure", "pressure, kPa", "bend of the top, deg", tuple(lines)
    )


def workspace_traces(request: PredictionRequest, stack: Stack) -> list[Trace]:
    """Return paths of the tip with 1, 2 ... chambers up to 10 kPa, the others empty or full."""
    model = calibrated(BEND, request.factors)
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
    """Return the poses at rising pressures in some chambers, up to the first that has none."""
    rows = np.full((len(pressures), stack.chambers), rest)
    rows[:, :chambers] = pressures[:, None]
    states = stack.equilibria(rows[rows.max(1) <= stack.most_pressure], None)
    count = int(np.logical_and.accumulate(states.is_met).sum())
    return stack.poses_of(states.part(slice(count)))


# Clearances of an inflated stack.
#
# The elastic balloon covers contact between balloons on each other, at the plate between them; the
# stack covers contact between leaning levels, at their rims. Balloons side by side do not touch if
# the clearance below is positive. Lengths mm.


LEAST_GAP = 0.02
"""Least gap in mm of a balloon whose radius is computed."""


def rim_gap(stack: Stack, pose: Pose) -> float:
    """Return the smallest gap in mm between rims of neighbouring levels.

    0 for flat levels, and if levels lean so far that their rims touch.
    """
    gaps = stack.rims[stack.levels] @ pose.freedoms[..., None]
    return max(float(gaps.min()), 0.0)


def chamber_clearances(stack: Stack, poses: Sequence[Pose]) -> Array:
    """Return the smallest clearance in mm between the films of balloons side by side, by pose.

    Below 0 they would pass through each other. Both are in the frame of their level, and balloons
    of other levels lie beyond a plate, so that axes and largest radii suffice. Raises DesignError
    for a balloon without an equilibrium.
    """
    widest = _radii(stack, poses)
    nearest = np.full(len(poses), math.inf)
    for first, second in combinations(range(stack.chambers), 2):
        apart = float(np.hypot(*(stack.axes[first] - stack.axes[second])))
        together = (widest[..., first] + widest[..., second]).max(-1)
        nearest = np.minimum(nearest, apart - together)
    return nearest - max(kind.balloon.thickness for kind in stack.maps)


def _radii(stack: Stack, poses: Sequence[Pose]) -> Array:
    """Return the largest radius of each balloon's middle surface: (poses, levels, chambers)."""
    gaps = np.array([pose.gaps for pose in poses])
    radii = np.empty_like(gaps)
    pressures = np.array([np.broadcast_to(pose.pressures, pose.gaps.shape) for pose in poses])
    for kind, balloon in enumerate(stack.maps if poses else ()):
        rows = stack.levels == kind
        heights = np.maximum(gaps[:, rows], LEAST_GAP).round(4)
        states = np.stack([pressures[:, rows], heights], -1)
        unique, back = distinct(states.reshape(-1, 2))
        shapes = inflate(balloon.balloon, unique[:, 0], unique[:, 1], tied=True)
        within = shapes.r[:, balloon.balloon.neck_edge : balloon.balloon.edge + 1].max(-1)
        radii[:, rows] = within[back].reshape(heights.shape)
    return radii


# Balloons on top of each other: all carry the same force, and their strokes add up.


SERIES_SAMPLES = 401


def blocked_force(stack: Stack, pressure: float, stroke: ArrayLike) -> Array:
    """Return the force in N of one straight chamber blocked at strokes in mm; 0 beyond its free
    stroke.

    At most the force of its weakest balloon when flat. Below the stroke at which this balloon
    shuts, its solid films may carry more; that is not counted.
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
    """Return heights in mm and the force in mN there, made monotonic."""
    heights = np.linspace(0.0, balloon.most_height, SERIES_SAMPLES)
    return heights, np.minimum.accumulate(balloon.force(pressure, heights))
