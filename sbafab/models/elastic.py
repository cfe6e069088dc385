"""Strokes, volumes and stored energy at a pressure, by the elastic balloon, free to rise."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import DesignError
from sbafab.models import paper
from sbafab.models.balloon import Balloon, Shapes, inflate
from sbafab.models.balloon_map import MOST_STRETCH, stretch
from sbafab.models.balloons import balloons_of
from sbafab.models.figures import Asked, Factors, Figure, LeftOut, Model, Relation, Trace
from sbafab.models.kinematics import Actuator
from sbafab.models.pneumatics import AIR, TUBE_LENGTH, WATER, Line
from sbafab.models.rippled import risen
from sbafab.models.stack import MOST_PRESSURE, Motion, Plate, Pose, Stack, stack

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from sbafab.models.balloon_map import BalloonMap
    from sbafab.models.film_elements import Array

Inflated = Mapping[Balloon, Shapes]
ELASTIC = Model(
    "elastic balloon",
    "membrane of revolution, the film's modulus",
    "one balloon to 10 kPa: within 1.2 % of an axisymmetric mesh; of a solid one that ripples, "
    "d = 5 to 15 within 3 %, d = 20 within 5 %, but d = 10 is 6 to 19 % low where a lone one's rim "
    "rolls to one side; all balloons of a stack are taken for inner ones, inlets left out",
)


def calibrated(model: Model, factors: Factors) -> Model:
    """The same model with the factors it took, named unless they are the defaults."""
    said = []
    if factors.press_factor != 1:
        said.append(f"press factor {factors.press_factor:g}")
    if factors.pocket_loss:
        said.append(f"pocket loss {factors.pocket_loss:g} mm")
    if factors.modulus_mpa is not None:
        said.append(f"E = {factors.modulus_mpa:g} MPa")
    return replace(model, name=f"{model.name}, {', '.join(said)}") if said else model


def free_strokes(one: Actuator, asked: Asked) -> Iterator[Figure | LeftOut]:
    """What a stack of round pockets rises by, holds and stores at the pressures asked for."""
    if not one.radii:
        return
    try:
        kinds = Counter(balloons_of(one.design, one.laminate, asked.calibration, one.form))
    except DesignError as error:
        yield LeftOut("free stroke, elastic balloon", str(error))
        return
    model = calibrated(ELASTIC, asked.calibration)
    together = _inflated(kinds, asked.pressures_kpa)
    for row, pressure in enumerate(asked.pressures_kpa):
        at = f"at {pressure:g} kPa"
        try:
            stroke, volume, stored = _risen(kinds, pressure, together[row] if together else None)
        except DesignError as error:
            yield LeftOut(f"free stroke {at}, elastic balloon", str(error))
            continue
        yield Figure("stroke", f"free stroke {at}", stroke, "mm", model)
        yield Figure("stroke", f"free height {at}", one.thickness + stroke, "mm", model)
        yield Figure("stroke", f"volume a balloon {at}", volume / one.balloons, "ul", model)
        work = stored * one.form.stacks / 1000
        yield Figure("actuation", f"pneumatic input work {at}, free", work, "mJ", model)


def _inflated(kinds: Iterable[Balloon], pressures: Sequence[float]) -> list[Inflated] | None:
    """The balloons at each pressure, all in one go; None where one finds no balance."""
    try:
        found = {kind: risen(kind, pressures) for kind in kinds}
    except DesignError:
        return None
    return [
        {kind: Shapes(*(values[row : row + 1] for values in found[kind])) for kind in found}
        for row in range(len(pressures))
    ]


def _risen(
    kinds: Counter[Balloon], pressure: float, known: Inflated | None
) -> tuple[float, float, float]:
    """Stroke in mm, air in ul and energy in uJ (to 3 % the integral of p dV) of one stack."""
    stroke = volume = stored = 0.0
    for kind, count in kinds.items():
        shape = known[kind] if known else risen(kind, pressure)
        longer = float(stretch(kind, shape)[0])
        if longer > MOST_STRETCH:
            raise DesignError(
                f"the film would be {100 * longer:.0f} % longer, and one modulus is unlikely to "
                f"hold beyond {100 * MOST_STRETCH:g} %; ask for less pressure"
            )
        stroke += count * float(shape.height[0])
        volume += count * float(shape.volume[0])
        stored += count * float(shape.energy[0])
    return stroke, volume, stored


# Drawn pockets: what holds of any outline, and discs in place of one that is nearly round.
#
# A pocket holds every disc within it and lies in every disc round it: its films are bonded where
# the outer disc's are free, and free where the inner disc's are bonded. So the figures of both
# discs, round the chamber's axis, bound its own, where a wider pocket rises more and pushes
# harder.


# What the stack of elastic balloons says of a design: forces, bending, time, stiffness.


SAMPLES = 21
SHARES = (0.0, 0.25, 0.75)
ANGLES = (30.0, 60.0, 90.0)
SLIGHT = 1e-5
"""N on the tip by which its stiffness is found."""
SOURCE = "membrane of revolution between plates, the film's modulus"
FORCE = Model(
    "elastic stack",
    SOURCE,
    "no shear between plates; films of constant modulus to 100 kPa. The paper's 3-DoF at 100 kPa "
    "has 0.9, 0.8 and 0.6 of it, its 1-DoF less",
)
BEND = Model(
    "elastic stack",
    SOURCE,
    "rigid plates that tilt, balloons that push by the gap at their ring, rims that touch on the "
    "inner side. The 3-DoF at 5 kPa has 87 deg with two chambers, 106 with one, where shells in "
    "SOFA, whose rims do not touch, have 85 and 109; the paper's largest is 81 +- 6 at a pressure "
    "that it does not give",
)
CONTACT = Model(
    "elastic stack",
    SOURCE,
    "films as wide as their meridians in balance; 0 is touching, which the stack then allows for",
)
TIME = Model(
    "elastic stack in time",
    f"Poiseuille or Blasius in {TUBE_LENGTH:g} mm of tube to each chamber",
    "the paper gives no length, and this one makes its 0.92 s come out; the sensor is taken to sit "
    "at the pump; no lag of valve and pump",
)
HELD = Model(
    "elastic stack",
    SOURCE,
    "no shear between plates; the paper's moduli would make it 15 times as firm, at a pressure "
    "that it does not give",
)
SHUT = Model(
    "elastic stack, chambers shut",
    SOURCE,
    "the air that is in the chambers stays in, tubes left out; no shear between plates",
)


def stacked(one: Actuator, asked: Asked) -> Stack | LeftOut | None:
    """The stack of an actuator with round pockets, or why there is none."""
    if not one.radii:
        return None
    most = max(MOST_PRESSURE, *asked.pressures_kpa, 0.0)
    try:
        return stack(one.design, one.laminate, most, asked.calibration, one.form)
    except DesignError as error:
        return LeftOut("elastic stack", str(error))


def figures(one: Actuator, asked: Asked, found: Stack) -> Iterator[Figure | LeftOut]:
    """Forces, bending, times and stiffness of the stack."""
    yield from _forces(one, asked, found)
    if one.form.is_parallel:
        yield from _bends(asked, found)
        yield from _bent_forces(asked, found)
    yield from _times(asked, found)
    yield from _stiffness(asked, found)


def stroke_at(one: Actuator, share: float) -> float:
    """Stroke in mm at a share of the way from the flat to the paper's full height."""
    return max(share * (one.full_height - one.thickness), 0.0)


def _forces(one: Actuator, asked: Asked, found: Stack) -> Iterator[Figure | LeftOut]:
    model = calibrated(FORCE, asked.calibration)
    for pressure in asked.pressures_kpa:
        for share in SHARES if one.knows_full else SHARES[:1]:
            at = "flat" if share == 0 else f"at {100 * share:g} % of full stroke"
            name = f"blocked force at {pressure:g} kPa, {at}"
            try:
                value = float(blocked(found, pressure, stroke_at(one, share)))
            except DesignError as error:
                yield LeftOut(f"{name}, elastic stack", str(error))
                continue
            yield Figure("force", name, one.form.pushing * value, "N", model)


def _some(found: Stack, chambers: int, pressure: float, rest: float = 0.0) -> tuple[float, ...]:
    return (pressure,) * chambers + (rest,) * (found.chambers - chambers)


def _chambers(number: int) -> str:
    return "one chamber" if number == 1 else f"{number} chambers"


def _bends(asked: Asked, found: Stack) -> Iterator[Figure | LeftOut]:
    model = calibrated(BEND, asked.calibration)
    for pressure in asked.pressures_kpa:
        for chambers in range(1, found.chambers):
            name = f"bend at {pressure:g} kPa in {_chambers(chambers)}, the others empty"
            try:
                pose = found.pose(_some(found, chambers, pressure))
            except DesignError as error:
                yield LeftOut(name, str(error))
                continue
            yield Figure("bending", name, pose.bend, "deg", model)
            yield from _rooms(name.replace("bend at ", "", 1), asked, found, pose)
            aside = float(np.hypot(*pose.tip[:2]))
            yield Figure("bending", name.replace("bend", "tip aside", 1), aside, "mm", model)


def _rooms(where: str, asked: Asked, found: Stack, pose: Pose) -> Iterator[Figure]:
    """How near a bent stack comes to itself."""
    model = calibrated(CONTACT, asked.calibration)
    room = rim_gap(found, pose)
    yield Figure("bending", f"room between rims on the inner side, {where}", room, "mm", model)
    room = chamber_gap(found, pose)
    yield Figure("bending", f"clearance between chambers, {where}", room, "mm", model)


def bent(found: Stack, chambers: int, angle: float) -> Pose | None:
    """The pose in which some chambers, the others empty, bend it by so many degrees."""
    low, high = 0.01, found.most_pressure
    pose = None
    for _ in range(40):
        middle = math.sqrt(low * high)
        try:
            pose = found.pose(_some(found, chambers, middle), near=pose)
        except DesignError:
            high = middle
            continue
        if abs(pose.bend - angle) < 1e-3:
            break
        low, high = (middle, high) if pose.bend < angle else (low, middle)
    return pose if pose is not None and abs(pose.bend - angle) < 0.01 else None


def _bent_forces(asked: Asked, found: Stack) -> Iterator[Figure | LeftOut]:
    """Force on a plate that lies square on the bent tip, as those chambers are pressed harder."""
    if not asked.pressures_kpa:
        return
    model = calibrated(FORCE, asked.calibration)
    pressure = max(asked.pressures_kpa)
    for chambers in range(1, min(found.chambers, 3)):
        for angle in ANGLES:
            name = f"force at {pressure:g} kPa in {_chambers(chambers)}, bent by {angle:g} deg"
            pose = bent(found, chambers, angle)
            if pose is None or pose.pressures[0] > pressure:
                yield LeftOut(name, "it does not bend so far")
                continue
            plate = Plate(_three(pose.tip), _three(pose.frames[1][-1][:, 2]))
            try:
                held = found.pose(_some(found, chambers, pressure), plate=plate, near=pose)
            except DesignError as error:
                yield LeftOut(name, str(error))
                continue
            yield Figure("force", name, held.force, "N", model)


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return (x, y, z)


def filled(
    found: Stack, flow_ml_min: float, until: float, length: float = TUBE_LENGTH
) -> tuple[float, Pose]:
    """Seconds of water at a flow, shared by all chambers through tubes of a ``length`` in mm, until
    the pump shows a pressure in kPa; and the pose by then. Raises DesignError where the tubes
    alone take that pressure.
    """
    flow = flow_ml_min * 1000 / 60 / found.chambers
    tube = Line(WATER, length).source_pressure(flow, 0.0)
    if tube >= until:
        raise DesignError(f"at this flow a tube of {length:g} mm alone takes {tube:.3g} kPa")
    pose = found.pose((until - tube,) * found.chambers)
    empty = found.pose((0.0,) * found.chambers)
    return float((pose.volumes - empty.volumes).mean()) / flow, pose


def _times(asked: Asked, found: Stack) -> Iterator[Figure | LeftOut]:
    model = calibrated(TIME, asked.calibration)
    until = f"{paper.FULL_KPA:g} kPa at the pump"
    name = f"time to {until}, water at {asked.flow_ml_min:g} ml/min in all"
    try:
        time, pose = filled(found, asked.flow_ml_min, paper.FULL_KPA)
    except DesignError as error:
        yield LeftOut(name, str(error))
        return
    yield Figure("actuation", name, time, "s", model)
    name = f"height when the water's pump shows {paper.FULL_KPA:g} kPa"
    yield Figure("actuation", name, pose.height, "mm", model)


def _stiffness(asked: Asked, found: Stack) -> Iterator[Figure | LeftOut]:
    for pressure in asked.pressures_kpa[:1]:
        name = f"lateral tip stiffness at {pressure:g} kPa"
        try:
            start = found.pose((pressure,) * found.chambers)
            aside = (SLIGHT, 0.0, 0.0)
            held = found.pose(start.pressures, aside, near=start)
            yield _per_mm(f"{name}, pressure held", held, HELD, asked)
            shut = Motion(found, Line(AIR, length=1e-3), {"tip_load": aside}, start)
            shut.step(1.0, flows=(0.0,) * found.chambers)
            yield _per_mm(f"{name}, chambers shut", shut.pose, SHUT, asked)
        except DesignError as error:
            yield LeftOut(name, str(error))


def _per_mm(name: str, pose: Pose, model: Model, asked: Asked) -> Figure:
    value = SLIGHT / float(pose.tip[0])
    return Figure("stiffness", name, value, "N/mm", calibrated(model, asked.calibration))


def force_traces(one: Actuator, asked: Asked, found: Stack) -> list[Trace]:
    """Force against stroke at every pressure asked for."""
    most = one.full_height - one.thickness
    if not one.knows_full:
        most = min(k.largest_stroke for k in one.kinematics)
    strokes = np.linspace(0, most, SAMPLES)
    model = calibrated(FORCE, asked.calibration)
    lines = []
    for pressure in asked.pressures_kpa:
        if pressure > found.most_pressure:
            continue
        values = (one.form.pushing * blocked(found, pressure, strokes)).tolist()
        lines.append(Trace(f"elastic stack, {pressure:g} kPa", strokes.tolist(), values, model))
    return lines


def bend_relation(asked: Asked, found: Stack) -> Relation:
    """Bend against pressure."""
    model = calibrated(BEND, asked.calibration)
    pressures = np.geomspace(0.01, 20.0, SAMPLES)
    lines = []
    for chambers in range(1, found.chambers):
        poses = _poses(found, chambers, pressures)
        label = f"{_chambers(chambers)}, the others empty"
        x = [pose.pressures[0] for pose in poses]
        lines.append(Trace(label, x, [pose.bend for pose in poses], model))
    return Relation(
        "bend", "Bending against pressure", "pressure, kPa", "bend of the top, deg", tuple(lines)
    )


def workspace_traces(asked: Asked, found: Stack) -> list[Trace]:
    """Paths of the tip with 1, 2 ... chambers up to 10 kPa, the others empty or full."""
    model = calibrated(BEND, asked.calibration)
    pressures = np.linspace(0.1, paper.FULL_KPA**0.5, SAMPLES) ** 2
    lines = []
    for rest, words in ((0.0, "empty"), (paper.FULL_KPA, f"at {paper.FULL_KPA:g} kPa")):
        for chambers in range(1, found.chambers):
            poses = _poses(found, chambers, pressures, rest)
            label = f"elastic stack, {_chambers(chambers)} to 10 kPa, the others {words}"
            aside = [float(np.hypot(*pose.tip[:2])) for pose in poses]
            lines.append(Trace(label, aside, [pose.height for pose in poses], model))
    return lines


def _poses(
    found: Stack, chambers: int, pressures: Sequence[float] | Array, rest: float = 0.0
) -> list[Pose]:
    poses: list[Pose] = []
    for pressure in pressures:
        try:
            near = poses[-1] if poses else None
            poses.append(found.pose(_some(found, chambers, float(pressure), rest), near=near))
        except DesignError:
            break
    return poses


# Where an inflated stack touches itself, and how much room is left where it does not.
#
# Balloons on each other meet at the plate between them, which the elastic balloon has; levels that
# lean meet at their rims, which the stack has. Balloons side by side never do where the room below
# is more than 0. Lengths mm.


OPEN = 0.02
"""mm that a balloon is taken to be open at least."""


def rim_gap(stack: Stack, pose: Pose) -> float:
    """Mm by which rims of neighbouring levels have left each other where they are nearest.

    Flat ones lie on each other; 0 where levels lean so far that their rims do again.
    """
    gaps = stack.rims[stack.levels] @ pose.freedoms[..., None]
    return max(float(gaps.min()), 0.0)


def chamber_gap(stack: Stack, pose: Pose) -> float:
    """Mm between the films of balloons side by side where they are nearest.

    Below 0 they would pass through each other. Both stand in the frame of their level, and those
    of other levels lie beyond a plate, so that axes and largest radii tell. Raises DesignError for
    a balloon without a balance.
    """
    widest = _radii(stack, pose)
    nearest = []
    for one, other in combinations(range(stack.chambers), 2):
        apart = float(np.hypot(*(stack.axes[one] - stack.axes[other])))
        nearest.append(apart - float((widest[:, one] + widest[:, other]).max()))
    thick = max(one.balloon.thickness for one in stack.maps)
    return min(nearest) - thick


def _radii(stack: Stack, pose: Pose) -> Array:
    """Largest radius of the middle of each balloon's films: (levels, chambers)."""
    found = np.empty_like(pose.gaps)
    pressures = np.broadcast_to(np.array(pose.pressures), pose.gaps.shape)
    for kind, one in enumerate(stack.maps):
        own = stack.levels == kind
        asked = np.stack([pressures[own], np.maximum(pose.gaps[own], OPEN).round(4)], -1)
        alike, back = np.unique(asked.reshape(-1, 2), axis=0, return_inverse=True)
        shapes = inflate(one.balloon, alike[:, 0], alike[:, 1], tied=True)
        within = shapes.r[:, one.balloon.held : one.balloon.edge + 1].max(-1)
        found[own] = within[back].reshape(asked.shape[:2])
    return found


# Balloons on top of each other: all carry the same force, and their strokes add up.


SERIES_SAMPLES = 401


def blocked(stack: Stack, pressure: float, stroke: ArrayLike) -> Array:
    """Force in N of one straight chamber that is held at strokes in mm; 0 where it does not reach.

    At most what its weakest balloon pushes with when flat. Below the stroke at which that one
    shuts, its solid films may carry more; they are not counted.
    """
    curves = [_curve(one, pressure) for one in stack.maps]
    counts = np.bincount(stack.levels, minlength=len(stack.maps))
    force = np.linspace(0.0, min(push[0] for _, push in curves), SERIES_SAMPLES)
    total = np.zeros(SERIES_SAMPLES)
    for count, (heights, push) in zip(counts, curves, strict=True):
        total += count * np.interp(force, push[::-1], heights[::-1])
    return np.asarray(
        np.interp(np.asarray(stroke, dtype=float), total[::-1], force[::-1], right=0.0) / 1000
    )


def _curve(one: BalloonMap, pressure: float) -> tuple[Array, Array]:
    """Heights in mm and the force in mN there, made to fall."""
    heights = np.linspace(0.0, one.most_height, SERIES_SAMPLES)
    return heights, np.minimum.accumulate(one.force(pressure, heights))
