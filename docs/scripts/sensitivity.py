"""Sensitivity of the calibrated figures: the same stack with one assumption changed at a time.

``table`` is docs/measured/sensitivity.csv, which ``python -m docs.scripts.validate`` writes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from docs.scripts.tables import Table
from sbafab.actuators import load_design
from sbafab.errors import DesignError
from sbafab.models import paper
from sbafab.models.balloon_map import balloon_map
from sbafab.models.calibration import PAPER, load_calibration
from sbafab.models.elastic import blocked_force, pose_bent_by
from sbafab.models.figures import Factors
from sbafab.models.stack import Plate, Pose, Stack, stack
from sbafab.validation.evidence import load_evidence

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
LEAN = 6.0
"""Degrees by which a force sensor might lean."""
TALLER = 20.0
"""Full height in mm that 25 and 75 % might be of."""
BENT = load_evidence(PAPER).curve("force-bent")
MEASURED = (*(value.value for value in paper.FORCE_3DOF), *BENT.y)


def calibrated() -> Factors:
    """Return the factors of the shipped calibration."""
    calibration = load_calibration(PAPER)
    assert calibration is not None, "it ships"
    return calibration.factors


CALIBRATED = calibrated()


@dataclass(frozen=True)
class Variant:
    """One change: what the 3-DoF is made of, where it is held, and what pushes when bent.

    ``neck`` mm by which necks are wider than drawn; ``full`` mm that heights are shares of;
    ``pushing`` chambers bend the tip, which ``sticks`` to the plate or slides, and the others get
    the pressure too where ``all_push``.
    """

    name: str
    factors: Factors = CALIBRATED
    neck: float = 0.0
    full: float = paper.FULL_HEIGHT.value
    pushing: int = 2
    sticks: bool = True
    all_push: bool = False


FIRST = "calibrated"
DRAWN_FILM = replace(CALIBRATED, modulus_ratio=1.0)
VARIANTS = (
    Variant(FIRST),
    Variant("laminate as thick as its films, 1.865 mm", replace(CALIBRATED, press_factor=1.0)),
    Variant("pockets as drawn", replace(CALIBRATED, pocket_loss=0.0)),
    Variant("films of 10 MPa, as bought", DRAWN_FILM),
    Variant("necks wider by as much as pockets are smaller", neck=CALIBRATED.pocket_loss),
    Variant(f"25 and 75 % of {TALLER:g} mm", full=TALLER),
    Variant("bent: one chamber pushes", pushing=1),
    Variant("bent: the tip slides on the plate", sticks=False),
    Variant("bent by two chambers, then all three push", all_push=True),
)


def rows() -> Iterator[tuple[str, list[float]]]:
    """Of each variant its forces in N (flat, 25 and 75 %; bent by 30, 60 and 90 degrees), height in
    mm and bend in degrees with two chambers, both at 10 kPa; nan where there is no balance.
    """
    design = load_design("3dof-15mm")
    made: dict[tuple[Factors, float], Stack] = {}
    for one in VARIANTS:
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
    for angle in BENT.x:
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


def table() -> Table:
    """Return docs/measured/sensitivity.csv: the 3-DoF's variants, then the 1-DoF's."""
    wanted = [*MEASURED, paper.FULL_HEIGHT.value, paper.LARGEST_BEND.value]
    lines = [_cells("3-DoF", "**measured**", wanted)]
    lines += [_cells("3-DoF", name, values) for name, values in rows()]
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
    whole = stack(design, factors=CALIBRATED)
    soft = stack(design, factors=DRAWN_FILM)
    yield FIRST, _straight(whole, full)
    yield "films of 10 MPa, as bought", _straight(soft, full)
    for sticks, words in ((True, "sticks"), (False, "slides")):
        name = f"the plate leans by {LEAN:g} degrees, the tip {words}"
        yield name, [_straight(whole, full)[0], *_leaning(whole, full, sticks)]


def _leaning(found: Stack, full: float, sticks: bool) -> Iterator[float]:
    turn = math.radians(LEAN)
    for share in paper.HEIGHTS[1:]:
        height = found.flat_height + share * (full - found.flat_height)
        plate = Plate((0.0, 0.0, height), (math.sin(turn), 0.0, math.cos(turn)), sticks)
        try:
            yield found.pose([paper.FORCE_KPA], plate=plate).force
        except DesignError:
            yield math.nan
