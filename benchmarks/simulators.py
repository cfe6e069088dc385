"""The same actuator in SOFA and MuJoCo: processor time of a step, and steps to an equilibrium."""

from __future__ import annotations

import os
import shutil
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import sbafab
from sbafab.runtime import ignore_progress
from sbafab.simulators.simulator import SimulationRequest

DESIGN = "3dof-15mm"
KPA = 5.0
SHORT, LONG = 0.5, 2.5
"""Simulated s; the difference leaves loading out."""


class Stepped(NamedTuple):
    """Seconds a step, and how many steps come to rest."""

    seconds: float
    steps: int


def sofa() -> Stepped | None:
    """Scene A, every film as a shell; None where runSofa is not there."""
    if shutil.which("runSofa") is None:
        return None
    from sbafab.simulators.sofa import DT, SECONDS, run

    laminate = sbafab.build(DESIGN)
    taken = []
    for seconds in (SHORT, LONG):
        with tempfile.TemporaryDirectory() as place:
            began = os.times().children_user
            run(laminate, SimulationRequest(KPA, seconds=seconds), Path(place), ignore_progress)
            taken.append(os.times().children_user - began)
    return Stepped((taken[1] - taken[0]) / round((LONG - SHORT) / DT), round(SECONDS / DT))


def mujoco(sectors: int) -> Stepped | None:
    """Its flexes with rings of so many nodes; None where the package is not there."""
    if find_spec("mujoco") is None:
        return None
    from sbafab.simulators.mujoco import DT, LEAST_TIME, SECONDS, run

    laminate = sbafab.build(DESIGN)
    with tempfile.TemporaryDirectory() as place:
        began = os.times().children_user
        run(
            laminate,
            SimulationRequest(KPA, seconds=LEAST_TIME),
            Path(place),
            ignore_progress,
            sectors,
        )
        each = (os.times().children_user - began) / round(LEAST_TIME / DT)
    return Stepped(each, round(SECONDS / DT))
