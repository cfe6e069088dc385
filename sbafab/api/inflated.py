"""Balloons inflated to a state: maps and models of them for other programs, and pictures."""

from __future__ import annotations

from sbafab.actuators import build, load_design
from sbafab.design.records import Design
from sbafab.laminate.burst import refuse_beyond_burst
from sbafab.models.actuator import model_form, near_discs
from sbafab.models.balloons import has_balloons
from sbafab.models.calibration import factors_of
from sbafab.models.map_files import FORMATS, map_text
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
from sbafab.simulators.mujoco.mjcf import chain_text
