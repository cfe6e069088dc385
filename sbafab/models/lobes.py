"""Bending and workspace of parallel chambers, and how they fold."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.models import paper
from sbafab.models.actuator import NOT_MEASURED, Actuator
from sbafab.models.bending import bend
from sbafab.models.figures import Asked, Figure, LeftOut, Model, Points, Relation, Trace
from sbafab.models.flow import seconds
from sbafab.models.folded import LOBES, folded_diameter

if TYPE_CHECKING:
    from numpy.typing import NDArray

SAMPLES = 61
CURVATURE = Model(
    "constant curvature",
    "from chamber lengths, each at its own stroke",
    "upper bound: chambers are taken to lengthen freely, and films between them do not hold back; "
    "the paper's largest is 81 +- 6 deg",
)


class Path(NamedTuple):
    """Chambers side by side, from flat to full stroke: stroke (mm), angle (rad), reach, height."""

    chambers: int
    stroke: NDArray[np.float64]
    angle: NDArray[np.float64]
    aside: NDArray[np.float64]
    height: NDArray[np.float64]


def paths(actuator: Actuator, others_full: bool = False) -> list[Path]:
    """One path for 1, 2 ... chambers next to each other; the others flat, or full.

    A path ends where the top has turned by half a turn.
    """
    axes = actuator.axes
    stroke = np.linspace(0, actuator.full_stroke, SAMPLES)
    rest = actuator.full_height if others_full else actuator.thickness
    found = []
    for chambers in range(1, len(axes)):
        lengths = np.full((SAMPLES, len(axes)), rest)
        lengths[:, :chambers] = actuator.lengths(stroke)[:, None]
        bent = bend(lengths, axes)
        good = bent.angle <= math.pi
        aside = np.hypot(bent.tip[:, 0], bent.tip[:, 1])
        found.append(Path(chambers, stroke[good], bent.angle[good], aside[good], bent.tip[good, 2]))
    return found


def bending(actuator: Actuator) -> Iterator[Figure | LeftOut]:
    """The largest bend of each number of chambers, and how far the tip gets."""
    if not actuator.knows_full:
        yield LeftOut("bend and tip displacement at full stroke, constant curvature", NOT_MEASURED)
        return
    all_paths = paths(actuator)
    for path in all_paths:
        name = f"bend with {_chambers(path.chambers)} at full stroke, the others flat"
        if len(path.stroke) < SAMPLES:
            reason = "more than half a turn: the tip would come down through the base"
            yield LeftOut(name, reason)
        else:
            yield Figure("bending", name, math.degrees(path.angle[-1]), "deg", CURVATURE)
    every = [*all_paths, *paths(actuator, others_full=True)]
    reach = max(float(path.aside.max()) for path in every)
    yield Figure("bending", "maximum lateral tip displacement", reach, "mm", CURVATURE)


def folding(actuator: Actuator, asked: Asked) -> Figure | LeftOut:
    """Diameter of the channel that three folded lobes pass."""
    if actuator.form.stacks != LOBES:
        reason = f"the model is of {LOBES} lobes folded into a triangle"
        return LeftOut("folded diameter", f"{reason}; this design has {actuator.form.stacks}")
    model = Model(
        "three lobes as chords of a circle",
        "our geometry; the paper reports 9.25",
        "one figure to compare with: 9.91 at the nominal thickness, 8.61 at the 0.95 mm that the "
        "paper measures, between which its 9.25 lies",
    ).times("press factor", asked.calibration.press_factor)
    width = 2 * max(actuator.radii) + 2 * actuator.design.bond.width
    value = folded_diameter(width, actuator.thickness)
    return Figure("size", "folded diameter", value, "mm", model)


def bending_relation(actuator: Actuator, asked: Asked) -> Relation:
    """Bend against time, each chamber fed at the flow asked for."""
    first = actuator.kinematics[0]
    model = Model(
        f"{CURVATURE.name}, {first.model.name} over flow",
        CURVATURE.source,
        f"{CURVATURE.trust}; no lag of pump or tube",
    )
    lines = []
    for path in paths(actuator):
        held = first.volume(path.stroke) * actuator.balloons
        time = seconds(held, asked.flow_ml_min)
        label = f"{_chambers(path.chambers)} inflated, the others flat"
        lines.append(Trace(label, time.tolist(), np.degrees(path.angle).tolist(), model))
    points = []
    if actuator.is_like_paper(3, 2.5) and actuator.balloons == paper.BALLOONS:
        ends = [0.0, max(max(line.x) for line in lines)]
        largest = paper.LARGEST_BEND
        if asked.flow_ml_min == paper.WATER_FLOW:
            x = [time for time, _ in paper.BENDING]
            y = [angle.value for _, angle in paper.BENDING]
            label = "paper: time to steady angles"
            points.append(Points(label, x, y, [angle.error for _, angle in paper.BENDING]))
            ends[1] = max(x)
        label = f"paper: largest bend, {largest.value:g} +- {largest.error:g} deg"
        lines.append(Trace(label, ends, [largest.value] * 2))
    return Relation(
        "bending",
        "Bending against time",
        f"time with {asked.flow_ml_min:g} ml/min into each inflated chamber, s",
        "bend of the top, deg",
        tuple(lines),
        tuple(points),
    )


def workspace_relation(actuator: Actuator) -> Relation:
    """Where the tip gets to: the plane in which the chambers next to each other bend; no lines of
    constant curvature where the full stroke is not known.
    """
    lines = []
    rests = (("flat", False), ("full", True)) if actuator.knows_full else ()
    for rest, others_full in rests:
        for path in paths(actuator, others_full):
            label = f"{_chambers(path.chambers)}, the others {rest}"
            lines.append(Trace(label, path.aside.tolist(), path.height.tolist(), CURVATURE))
    points = []
    if actuator.is_like_paper(3, 2.5) and actuator.balloons == paper.BALLOONS:
        label = f"paper: all full, {paper.FULL_HEIGHT.value:g} mm"
        points.append(Points(label, [0.0], [paper.FULL_HEIGHT.value], [0.0]))
    return Relation(
        "workspace",
        "Paths of the tip",
        "reach aside, mm",
        "height of the tip, mm",
        tuple(lines),
        tuple(points),
    )


def _chambers(number: int) -> str:
    return "one chamber" if number == 1 else f"{number} chambers"
