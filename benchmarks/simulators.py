"""The same actuator in SOFA and MuJoCo: processor time of a step, and steps to an equilibrium."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import sbafab

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
    from sbafab.simulators.sofa.run import USUAL, SofaJob, simulate
    from sbafab.simulators.sofa.scenes import DT

    laminate = sbafab.build(DESIGN)
    pressures = {chamber.name: KPA for chamber in laminate.chambers}
    taken = []
    for seconds in (SHORT, LONG):
        with tempfile.TemporaryDirectory() as place:
            began = os.times().children_user
            simulate(laminate, Path(place), pressures, SofaJob("shell", seconds))
            taken.append(os.times().children_user - began)
    return Stepped((taken[1] - taken[0]) / round((LONG - SHORT) / DT), round(USUAL.seconds / DT))


def mujoco(sectors: int) -> Stepped | None:
    """Its flexes with rings of so many nodes; None where the package is not there."""
    from sbafab.errors import OutputError
    from sbafab.simulators.mujoco.run import LEAST_TIME, SECONDS, find_mujoco, simulate

    try:
        find_mujoco()
    except OutputError:
        return None
    laminate = sbafab.build(DESIGN)
    pressures = {chamber.name: KPA for chamber in laminate.chambers}
    with tempfile.TemporaryDirectory() as place:
        began = time.process_time()
        done = simulate(laminate, Path(place), pressures, LEAST_TIME, sectors=sectors)
        each = (time.process_time() - began) / done.steps
    return Stepped(each, round(SECONDS / LEAST_TIME * done.steps))
