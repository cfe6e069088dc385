"""Stiffness with shut chambers, against pressures at which each chamber keeps its air by itself."""

from __future__ import annotations

import numpy as np
import pytest

import sbafab
from sbafab.models.elastic import PROBE_FORCE, shut_stiffness

ATMOSPHERE = 101.325
"""kPa."""


@pytest.mark.parametrize("pressure", [10.0, 100.0])
def test_each_chamber_keeps_its_air_under_the_probe(pressure: float) -> None:
    """Newton's method with finite differences on poses at given pressures, Boyle's law."""
    stack = sbafab.stack("3dof-15mm")
    probe = (PROBE_FORCE, 0.0, 0.0)

    def air(pressures: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
        pose = stack.pose(tuple(pressures), tip_load=probe)
        return np.asarray((pressures + ATMOSPHERE) * pose.volumes)

    pressures = np.full(stack.chambers, pressure)
    shut = (pressures + ATMOSPHERE) * stack.pose(tuple(pressures)).volumes
    for _ in range(5):
        steps = 1e-3 * np.eye(stack.chambers)
        rates = np.stack([air(pressures + step) - air(pressures) for step in steps], -1) / 1e-3
        pressures = pressures - np.linalg.solve(rates, air(pressures) - shut)
    tip = float(stack.pose(tuple(pressures), tip_load=probe).tip[0])
    stiffness, _ = shut_stiffness(stack, pressure)
    assert stiffness == pytest.approx(PROBE_FORCE / tip, rel=1e-5)
