"""Rates of a design's pose by its keys."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import sbafab
from sbafab.errors import DesignError
from sbafab.models.figures import Factors
from sbafab.models.sensitivities import sensitivities
from sbafab.models.stack import stack

PRESSURES = (6.0, 3.0, 2.0)
TIP_LOAD = (0.0, 0.005, -0.005)


@pytest.mark.parametrize("force", [(0.0, 0.0, 0.0), TIP_LOAD])
def test_films_so_much_stiffer_under_as_much_more_pressure_and_load_stay_as_they_are(
    force: tuple[float, float, float],
) -> None:
    """Film energies are in proportion to the modulus: Euler's theorem of homogeneous functions."""
    design = sbafab.load("3dof-15mm")
    (row,) = sensitivities(
        design, PRESSURES, ["films.tpe.modulus"], factors=Factors(), tip_load=force
    )
    each = stack(design).derivatives(PRESSURES, tip_load=force)
    for part in ("tip", "turn", "volumes"):
        by_modulus = getattr(row.rates, part)[:, 0] * row.value
        by_pressure = getattr(each.by_pressure, part) @ np.array(PRESSURES)
        by_force = getattr(each.by_wrench, part)[:, :3] @ np.array(force)
        total = by_modulus + by_pressure + by_force
        assert total == pytest.approx(0.0, abs=1e-6 * np.abs(by_pressure).max())


@pytest.mark.parametrize("load", [{}, {"tip_load": TIP_LOAD}, {"plate": 12.0}])
def test_rates_by_a_key_are_those_of_stacks_with_more_and_less_of_it(load: dict[str, Any]) -> None:
    """The same maps: what differs is the implicit step from the balance of the middle one."""
    design = sbafab.load("3dof-15mm")
    keys = ("chamber.diameter", "films.tpe.thickness", "stack.balloons")
    for row in sensitivities(design, PRESSURES, keys, factors=Factors(), **load):
        step = 1 if row.key == "stack.balloons" else 0.1 * row.value
        low, high = (
            stack(design.with_({row.key: row.value + side * step})).pose(PRESSURES, **load)
            for side in (-1, 1)
        )
        tip, volumes = (high.tip - low.tip) / (2 * step), (high.volumes - low.volumes) / (2 * step)
        # Over a step of a tenth the differences bend.
        assert row.rates.tip[:, 0] == pytest.approx(tip, rel=0.15, abs=0.1 * np.abs(tip).max())
        assert row.rates.volumes[:, 0] == pytest.approx(volumes, rel=0.15)
        force = (high.force - low.force) / (2 * step)
        assert row.rates.force[0] == pytest.approx(force, rel=0.1, abs=1e-9)


def test_wider_pockets_raise_the_stroke_and_stiffer_films_lower_it() -> None:
    design = sbafab.load("1dof-5mm")
    wider, stiffer, more = sensitivities(
        design, (5,), ["chamber.diameter", "films.tpe.modulus", "stack.balloons"]
    )
    assert wider.stroke > 1
    assert -1 < stiffer.stroke < 0
    # Balloons in series without a load rise alike.
    assert more.stroke == pytest.approx(1.0, rel=1e-6)


def test_keys_without_a_number_are_refused() -> None:
    design = sbafab.load("3dof-15mm")
    for key in ("chamber.colour", "name", "press"):
        with pytest.raises(DesignError, match=f"{key} is not a number above 0 in this design"):
            sensitivities(design, PRESSURES, [key])
