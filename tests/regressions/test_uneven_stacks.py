"""Stacks whose parts differ: wider balloons above the tab, wide fillets between neighbours."""

from __future__ import annotations

import math

import pytest

from sbafab.actuators import build, load_design


@pytest.mark.parametrize("above", [5.0, 10.0, 17.0])
def test_the_inlet_tab_never_bonds_to_the_balloon_above(above: float) -> None:
    sizes = ["stack.balloons=2", f"chamber.diameter=[5, {above}]"]
    _, separator, _ = build(load_design("1dof-5mm", sizes)).interfaces
    # The neck ring alone: bore 0.52, bond 0.75.
    assert separator.bond.area == pytest.approx(math.pi * (1.27**2 - 0.52**2))


@pytest.mark.parametrize("radius", [0.0, 1.0, 2.2, 3.0])
def test_a_fillet_joins_no_neighbouring_sbas(radius: float) -> None:
    # They stand 15.708 - 11.5 = 4.208 apart, less than two radii of the last two.
    laminate = build(load_design("radial-15mm", [f"fillet.radius={radius}"]))
    assert [len(layer.profile.pieces) for layer in laminate.layers] == [1, 3, 3, 3, 3]
