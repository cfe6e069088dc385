"""Balloons inflated to a state: maps and models of them for other programs, and pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sbafab.actuators import build, load_design
from sbafab.design.records import Design
from sbafab.laminate.burst import refuse_beyond_burst
from sbafab.models.actuator import model_form, near_discs
from sbafab.models.balloon_map import BalloonMap, holds_at
from sbafab.models.balloons import has_balloons
from sbafab.models.calibration import factors_of
from sbafab.models.pneumatics import refuse_pressure
from sbafab.models.stack import MOST_PRESSURE, stack
from sbafab.reports.solid_pictures import (
    MOVING,
    WHY,
    Movement,
    PictureRequest,
    write_flat_picture,
    write_picture,
)
from sbafab.simulators.mujoco_chain import chain_text
from sbafab.spreadsheet import csv_text

MAP = ("balloon", "pressure_kpa", "height_mm", "force_mn", "volume_ul", "potential_uj")
"""Columns of a table of balloons, which have risen by a height and push plates with a force."""


def map_text(balloons: Sequence[BalloonMap], points: int) -> str:
    """Return balloons as CSV, on a grid of pressures (closer together at low pressure) and heights,
    from a balloon computed at each place. Rows are omitted where the map is invalid.
    """
    rows: list[Sequence[str]] = [MAP]
    even = np.linspace(0.0, 1.0, points)
    for number, of in enumerate(balloons, start=1):
        grid = np.meshgrid(of.most_pressure * even**2, of.most_height * even, indexing="ij")
        p, h = (axis.ravel() for axis in grid)
        columns = np.stack([p, h, of.force(p, h), of.volume(p, h), of.potential(p, h)])
        for row in columns[:, holds_at(of, p, h)].T.tolist():
            rows.append([str(number), *(f"{value:.7g}" for value in row)])
    return csv_text(rows)
