"""Physics that might explain what the calibrated models miss, each tried by itself.

``table`` is docs/measured/candidates.csv, which ``python -m docs.scripts.validate`` writes. Forces
are in N at 100 kPa, flat, at 25 and at 75 % of the full stroke.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from docs.scripts.sensitivity import CALIBRATED
from docs.scripts.tables import Table
from sbafab.actuators import build, load_design
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.models import paper
from sbafab.models.balloon import inflate
from sbafab.models.balloon_map import stretch
from sbafab.models.balloons import balloons_of
from sbafab.models.elastic import blocked_force, pose_bent_by
from sbafab.models.rim_correction import free_shapes
from sbafab.models.stack import Plate, Pose, Stack, stack

COLUMNS = ("section", "case", "1-DoF", "3-DoF", "remark")
SHORT = paper.FULL_HEIGHT.value - paper.FLAT_HEIGHT.value
LONG = paper.LONGEST_STROKE.value
FULL_STROKES = {"17.5 mm high, Sec. 4.6": SHORT, "almost 20 mm, Sec. 4.2": LONG}
"""Full strokes in mm of 15 balloons that the paper gives."""
ORDERS = (2, 6, 12)
"""Orders of the film's law (``Balloon``); the models have 2."""
STRAIN = 0.1
"""Strain at which the stiffening is stated."""
FLAT = 2e-3
"""Height in mm that stands for a balloon pressed flat."""
SILICONES = (
    "orders fitted to tensile curves of 19 silicone rubbers, 2 to 50 % strain, in "
    "github.com/LucMarechal/Soft-Robotics-Materials-Database (8ff66c3): 0.1 to 6.7, median 1.1, "
    "16 of them below 2. None of a thermoplastic elastomer could be had"
)
LOSSES = (0.0, 0.1, 0.2, 0.3)
"""Pocket losses in mm between which that of one actuator is interpolated."""
BALLOONS = (6, 8, 10, 12, 15)
"""Balloons of the columns."""
LEANS, MODES = (0.003, 0.03, 0.2), (0.5, 1.0)
"""Leans of a level in rad, and waves along the column, from which buckled columns are sought."""
LEAST_LEAN = 1e-3
LEAST_BUCKLED = 0.3
"""N; whether the search ends in a column that hardly pushes, and whether one counts as stable,
depends on rounding, so neither is written."""


def table() -> Table:
    """Return docs/measured/candidates.csv."""
    one, three = load_design("1dof-5mm", ("stack.balloons=6",)), load_design("3dof-15mm")
    pair = stack(one, factors=CALIBRATED), stack(three, factors=CALIBRATED)
    measured = [
        _texts([value.value for value in row]) for row in (paper.FORCE_1DOF, paper.FORCE_3DOF)
    ]
    sections = {
        "Full stroke": full_strokes(*pair),
        "A film that stiffens": stiffening(one, three),
        "Pockets of each actuator": single_pockets(one, three),
        "A column that buckles": columns(),
        "Losses in the supply of water": supply(pair[1]),
    }
    lines = [["Measured", "", *measured, ""]]
    lines += [[section, *row] for section, rows in sections.items() for row in rows]
    return Table(COLUMNS, lines)


def _texts(values: Sequence[float]) -> str:
    return ", ".join("none" if math.isnan(value) else f"{value:.2f}" for value in values)


def _forces(whole: Stack, full: float) -> list[float]:
    """Return the forces at the paper's shares of a full stroke in mm of 15 balloons."""
    strokes = np.array(paper.HEIGHTS) * full * len(whole.levels) / paper.BALLOONS
    return (whole.chambers * blocked_force(whole, paper.FORCE_KPA, strokes)).tolist()


def full_strokes(one: Stack, three: Stack) -> Iterator[list[str]]:
    """Yield the calibrated forces by what counts as the full stroke."""
    readings = dict(FULL_STROKES)
    for pressure in (10.0, 30.0, 100.0):
        free = three.pose((pressure,) * 3).height - three.flat_height
        readings[f"free at {pressure:g} kPa, {free:.1f} mm"] = free
    for name, full in readings.items():
        yield [name, *(_texts(_forces(whole, full)) for whole in (one, three)), ""]


def stiffening(one: Design, three: Design) -> Iterator[list[str]]:
    """Yield the forces of balloons whose films stiffen with strain."""
    heights = np.maximum(np.array(paper.HEIGHTS) * SHORT / paper.BALLOONS, FLAT)
    for ratio in (1.0, CALIBRATED.modulus_ratio):
        factors = replace(CALIBRATED, modulus_ratio=ratio)
        for order in ORDERS:
            forces = []
            for design, pushing in ((one, 1), (three, 3)):
                balloon = replace(balloons_of(design, build(design), factors)[0], order=order)
                shapes = inflate(balloon, np.full(len(heights), paper.FORCE_KPA), heights)
                forces.append(_texts((pushing * shapes.force / 1000).tolist()))
            longer = float(stretch(balloon, free_shapes(balloon, paper.FORCE_KPA))[0])
            pull = ((1 + STRAIN) ** order - 1) / order * (1 + STRAIN) ** (order - 1) / STRAIN
            yield [
                f"modulus ratio {ratio:.3g}, order {order}",
                *forces,
                f"{100 * STRAIN:g} % longer it pulls {pull:.2g} times as hard as a linear film; "
                f"free at 100 kPa it is {100 * longer:.0f} % longer",
            ]
    yield ["published tensile curves", "", "", SILICONES]


def single_pockets(one: Design, three: Design) -> Iterator[list[str]]:
    """Yield the forces where each actuator has the pocket loss that its flat force asks for."""
    curves, losses = [], []
    for design, flat in ((one, paper.FORCE_1DOF[0]), (three, paper.FORCE_3DOF[0])):
        wholes = [stack(design, factors=replace(CALIBRATED, pocket_loss=loss)) for loss in LOSSES]
        curve = np.array(
            [[_forces(each, full) for full in FULL_STROKES.values()] for each in wholes]
        )
        curves.append(curve)
        losses.append(float(np.interp(-flat.value, -curve[:, 0, 0], LOSSES)))
    for row, name in enumerate(FULL_STROKES):
        forces = [
            _texts([float(np.interp(loss, LOSSES, values)) for values in curve[:, row].T])
            for loss, curve in zip(losses, curves, strict=True)
        ]
        yield [name, *forces, f"pocket losses {losses[0]:.2f} and {losses[1]:.2f} mm"]


def columns() -> Iterator[list[str]]:
    """Yield the forces at 25 and 75 % of 1-DoF columns, straight and buckled."""
    for count in BALLOONS:
        whole = stack(load_design("1dof-5mm", (f"stack.balloons={count}",)), factors=CALIBRATED)
        for sticks in (True, False):
            poses = [_column(whole, share, sticks) for share in paper.HEIGHTS[1:]]
            straight = _texts([pose.force for pose, _ in poses])
            bent = _texts([math.nan if bent is None else bent.force for _, bent in poses])
            stable = " and ".join("stable" if pose.stable else "unstable" for pose, _ in poses)
            yield [
                f"{count} balloons, the tip {'sticks' if sticks else 'slides'}",
                straight,
                "",
                f"{stable}; buckled {bent}",
            ]


def _column(whole: Stack, share: float, sticks: bool) -> tuple[Pose, Pose | None]:
    """Return a column that a plate holds at a share of the full stroke while straight, and of the
    buckled ones in balance that push by ``LEAST_BUCKLED`` the one of least energy, if there is one.
    """
    stroke = share * SHORT * len(whole.levels) / paper.BALLOONS
    plate = Plate((0.0, 0.0, whole.flat_height + stroke), sticks=sticks)
    pressures = (paper.FORCE_KPA,)
    straight = whole.pose(pressures, plate=plate)
    along = (np.arange(len(whole.levels)) + 0.5) / len(whole.levels)
    buckled = []
    for lean in LEANS:
        for mode in MODES:
            freedoms = straight.freedoms.copy()
            freedoms[:, 1] = lean * np.cos(math.tau * mode * along)
            try:
                pose = whole.pose(pressures, plate=plate, near=replace(straight, freedoms=freedoms))
            except DesignError:
                continue
            bent = np.abs(pose.freedoms[:, 1:]).max() > LEAST_LEAN
            if bent and pose.force >= LEAST_BUCKLED:
                buckled.append((pose.energy - paper.FORCE_KPA * float(pose.volumes.sum()), pose))
    return straight, min(buckled, key=lambda pair: pair[0])[1] if buckled else None


WATER_TIME = 0.92
"""s to full actuation with water (Sec. 4.5)."""


def supply(whole: Stack) -> Iterator[list[str]]:
    """Yield the paper's times with water beside volume over flow."""
    empty = float(whole.pose((0.0,) * whole.chambers).volumes.sum())
    flow = paper.WATER_FLOW * 1000 / 60
    full = float(whole.pose((paper.FULL_KPA,) * whole.chambers).volumes.sum())
    cases = [("to 10 kPa", WATER_TIME, (full - empty) / flow)]
    for time, angle in paper.BENDING:
        for chambers in (1, 2):
            pose = pose_bent_by(whole, chambers, angle.value)
            if pose is not None:
                name = f"to {angle.value:g} deg by {chambers} chamber{'s' * (chambers > 1)}"
                taken = float(pose.volumes[:chambers].sum()) - empty * chambers / whole.chambers
                cases.append((name, time, taken / flow))
    for name, time, filled in cases:
        yield [
            name,
            "",
            f"{time:.2f} s",
            f"volume over flow {filled:.2f} s: lag {time - filled:.2f} s, ratio {time / filled:.1f}",
        ]
