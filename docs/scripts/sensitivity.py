"""Sensitivity of the calibrated figures: the same stack with one assumption changed at a time.

``table`` is docs/measured/sensitivity.csv, which ``python -m docs.scripts.validate`` writes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from docs.scripts.tables import Table
from sbafab.actuators import build, load_design
from sbafab.errors import DesignError
from sbafab.models import paper
from sbafab.models.balloon import inflate
from sbafab.models.balloon_map import balloon_map
from sbafab.models.balloons import balloons_of
from sbafab.models.elastic import blocked_force, pose_bent_by
from sbafab.models.figures import Factors
from sbafab.models.stack import Plate, Pose, Stack, stack
from sbafab.reproduction.rows import FITTED

COLUMNS = (
    "section",
    "assumption",
    "force flat, N",
    "at 25 %",
    "at 75 %",
    "bent 30 deg",
    "bent 60 deg",
    "bent 90 deg",
    "height, mm",
    "bend, deg",
)
OWN_LOSS = 0.18
"""Pocket loss in mm that makes the flat 3-DoF's force right, in steps of 0.01."""
STIFFER = 20.0
"""MPa: twice the paper's modulus."""
LEAN = 6.0
"""Degrees by which a force sensor might lean."""
TALLER = 20.0
"""Full height in mm that 25 and 75 % might be of."""
TOUCHING = 2e-3
"""mm that stand for a balloon pressed flat."""
STEPS = 8
FARTHEST = 0.3
LITTLE = 1e-3
"""Steps of the fit: how many, by how much at most, and those that slopes are taken by."""
MEASURED = (*paper.FORCE_3DOF, *(value for _, value in paper.FORCE_BENT))


@dataclass(frozen=True)
class Variant:
    """One change: what the 3-DoF is made of, where it is held, and what pushes when bent.

    ``neck`` mm by which necks are wider than drawn; ``full`` mm that heights are shares of;
    ``pushing`` chambers bend the tip, which ``sticks`` to the plate or slides, and the others get
    the pressure too where ``all_push``.
    """

    name: str
    factors: Factors = FITTED
    neck: float = 0.0
    full: float = paper.FULL_HEIGHT.value
    pushing: int = 2
    sticks: bool = True
    all_push: bool = False


def variants(fitted: Factors) -> tuple[Variant, ...]:
    """What is looked at; ``fitted`` is what all forces of the 1-DoF ask for."""
    less = replace(FITTED, pocket_loss=OWN_LOSS)
    return (
        Variant("calibrated, as above"),
        Variant("laminate as thick as its films, 1.865 mm", replace(FITTED, press_factor=1.0)),
        Variant(f"pockets {OWN_LOSS:g} mm smaller, as the flat 3-DoF asks", less),
        Variant(f"films of {STIFFER:g} MPa", replace(FITTED, modulus_mpa=STIFFER)),
        Variant(f"both: {OWN_LOSS:g} mm and {STIFFER:g} MPa", replace(less, modulus_mpa=STIFFER)),
        Variant(
            f"fitted to the three forces of the 1-DoF: {fitted.pocket_loss:g} mm and "
            f"{fitted.modulus_mpa:g} MPa",
            fitted,
        ),
        Variant("necks wider by as much as pockets are smaller", neck=FITTED.pocket_loss),
        Variant(f"25 and 75 % of {TALLER:g} mm", full=TALLER),
        Variant("bent: one chamber pushes", pushing=1),
        Variant("bent: the tip slides on the plate", sticks=False),
        Variant("bent by two chambers, then all three push", all_push=True),
    )


def rows(fitted: Factors) -> Iterator[tuple[str, list[float]]]:
    """Of each variant its forces in N (flat, 25 and 75 %; bent by 30, 60 and 90 degrees), height in
    mm and bend in degrees with two chambers, both at 10 kPa; nan where there is no balance.
    """
    design = load_design("3dof-15mm")
    made: dict[tuple[Factors, float], Stack] = {}
    for one in variants(fitted):
        key = (one.factors, one.neck)
        if key not in made:
            made[key] = _wider(stack(design, factors=one.factors), one.neck)
        found = made[key]
        yield one.name, [*_straight(found, one.full), *_bent(found, one), *_free(found)]


def _wider(found: Stack, by: float) -> Stack:
    """The stack with wider necks."""
    if not by:
        return found
    kinds = [replace(one.balloon, neck=one.balloon.neck + by) for one in found.maps]
    maps = tuple(balloon_map(kind, found.most_pressure) for kind in kinds)
    return replace(found, maps=maps)


def _straight(found: Stack, full: float) -> list[float]:
    strokes = np.array(paper.HEIGHTS) * (full - found.flat_height)
    force = found.chambers * blocked_force(found, paper.FORCE_KPA, strokes)
    return [float(value) for value in force]


def _bent(found: Stack, one: Variant) -> Iterator[float]:
    rest = paper.FORCE_KPA if one.all_push else 0.0
    pressed = [paper.FORCE_KPA] * one.pushing + [rest] * (found.chambers - one.pushing)
    for angle, _ in paper.FORCE_BENT:
        pose = pose_bent_by(found, one.pushing, angle)
        yield math.nan if pose is None else _held(found, pose, pressed, one.sticks)


def _held(found: Stack, pose: Pose, pressed: list[float], sticks: bool) -> float:
    """Force on a plate square to the tip of a pose, under other pressures."""
    x, y, z = pose.tip.tolist()
    along = pose.frames[1][-1][:, 2].tolist()
    plate = Plate((x, y, z), (along[0], along[1], along[2]), sticks)
    try:
        return found.pose(pressed, plate=plate, near=pose).force
    except DesignError:
        return math.nan


def _free(found: Stack) -> Iterator[float]:
    full = paper.FULL_KPA
    yield found.pose((full,) * 3).height
    yield found.pose((full, full, 0.0)).bend


def fitted_modulus() -> Factors:
    """Pocket loss (to 0.01 mm) and modulus (to 1 MPa) that fit all three forces of the 1-DoF best:
    least squares of their relative errors, by Gauss and Newton.
    """
    design = load_design("1dof-5mm")
    laminate = build(design)
    full, flat = paper.FULL_HEIGHT.value, paper.FLAT_HEIGHT.value
    heights = np.maximum(np.array(paper.HEIGHTS) * (full - flat) / paper.BALLOONS, TOUCHING)
    wanted = np.array([value.value for value in paper.FORCE_1DOF])

    def apart(x: np.ndarray) -> np.ndarray:
        factors = replace(FITTED, pocket_loss=float(x[0]), modulus_mpa=math.exp(x[1]))
        one = balloons_of(design, laminate, factors)[0]
        return np.asarray(inflate(one, paper.FORCE_KPA, heights).force / 1000 / wanted - 1)

    x = np.array([FITTED.pocket_loss, math.log(10.0)])
    for _ in range(STEPS):
        off = apart(x)
        slopes = np.stack([(apart(x + step) - off) / LITTLE for step in LITTLE * np.eye(2)], 1)
        x = x - np.clip(np.linalg.lstsq(slopes, off)[0], -FARTHEST, FARTHEST)
    loss, modulus = round(float(x[0]), 2), round(math.exp(x[1]))
    return replace(FITTED, pocket_loss=loss, modulus_mpa=float(modulus))


def table() -> Table:
    """Return docs/measured/sensitivity.csv: the 3-DoF's variants, then the 1-DoF's."""
    wanted = [value.value for value in MEASURED]
    wanted += [paper.FULL_HEIGHT.value, paper.LARGEST_BEND.value]
    lines = [_cells("3-DoF", "**measured**", wanted)]
    lines += [_cells("3-DoF", name, values) for name, values in rows(fitted_modulus())]
    wanted = [value.value for value in paper.FORCE_1DOF]
    lines.append(_cells("1-DoF, a column of six", "**measured**", wanted))
    lines += [_cells("1-DoF, a column of six", name, values) for name, values in column()]
    return Table(COLUMNS, lines)


def _cells(section: str, name: str, values: Sequence[float]) -> list[str]:
    cells = ["none" if math.isnan(value) else f"{value:.2f}" for value in values[:6]]
    cells += [f"{value:.1f}" for value in values[6:]]
    return [section, name, *cells, *[""] * (len(COLUMNS) - 2 - len(cells))]


def column() -> Iterator[tuple[str, list[float]]]:
    """Forces of a 1-DoF column of six in N: flat, at 25 and at 75 %."""
    design = load_design("1dof-5mm", ("stack.balloons=6",))
    full = paper.FULL_HEIGHT.value * 6 / paper.BALLOONS
    soft = stack(design, factors=FITTED)
    stiff = stack(design, factors=replace(FITTED, modulus_mpa=STIFFER))
    yield "calibrated, as above", _straight(soft, full)
    yield f"films of {STIFFER:g} MPa", _straight(stiff, full)
    for sticks, words in ((True, "sticks"), (False, "slides")):
        name = f"the plate leans by {LEAN:g} degrees, the tip {words}"
        yield name, [_straight(soft, full)[0], *_leaning(soft, full, sticks)]


def _leaning(found: Stack, full: float, sticks: bool) -> Iterator[float]:
    turn = math.radians(LEAN)
    for share in paper.HEIGHTS[1:]:
        height = found.flat_height + share * (full - found.flat_height)
        plate = Plate((0.0, 0.0, height), (math.sin(turn), 0.0, math.cos(turn)), sticks)
        try:
            yield found.pose([paper.FORCE_KPA], plate=plate).force
        except DesignError:
            yield math.nan
